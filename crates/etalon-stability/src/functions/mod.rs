//! The functions of the kernels' library, each by itself, on numbers of all sizes.
//!
//! Effects call them with what effects have. What the functions promise of every other
//! number, and of what is none, is held here to closed forms in `f64`, under strict
//! arithmetic, on the interpreter and on devices.
//!
//! * `table`: which there are, what they promise and of what;
//! * `truth`: their closed forms;
//! * `arguments`: the numbers they are given;
//! * `execute`: a kernel around a function, and what it stores;
//! * `judge`: whether that is what was promised.

mod arguments;
mod execute;
mod judge;
mod table;
mod truth;

use etalon_core::Format;
use etalon_core::resource::TextureDesc;

use self::arguments::{FILLING, WIDTH, arguments};
use self::table::functions;
use crate::executors::{Executor, Kind};
use crate::model::{CaseReport, ExecutorResult, Status};
use crate::run::conclusions;
use crate::sanitise::Watch;

/// What the cases of functions are called by.
pub const FAMILY: &str = "functions";

/// What they are run as: there is no effect of this name.
pub const LIBRARY: &str = "lib";

/// Runs all functions on the executors that compute as devices do, with the kernels'
/// library as it is in `kernels`.
pub fn run(
    executors: &mut [Executor],
    watch: &mut Watch,
    kernels: &[(String, String)],
) -> Vec<CaseReport> {
    let mut library = etalon_effects::kernels();
    for (path, text) in kernels {
        library.add_source(path, text);
    }
    for function in functions() {
        library.add_source(&function.path(), &function.kernel());
    }
    let mut all = arguments();
    let height = all.len().div_ceil(WIDTH as usize);
    all.resize(height * WIDTH as usize, FILLING);
    let desc = TextureDesc::d2(WIDTH, height as u32, Format::Rgba32Float);
    functions()
        .map(|function| {
            let taken = |v: &[f32; 4]| if (function.takes)(*v) { *v } else { FILLING };
            let arguments: Vec<[f32; 4]> = all.iter().map(taken).collect();
            let mut report = CaseReport {
                name: format!("function-{}", function.name.replace('_', "-")),
                family: FAMILY.to_owned(),
                effect: LIBRARY.to_owned(),
                reason: function.reason.to_owned(),
                source: format!("what shaders/lib/{}.wesl promises", function.module),
                size: [desc.extent.width, desc.extent.height],
                frames: 1,
                ..CaseReport::default()
            };
            let compute =
                |executor: &&mut Executor| executor.kind == Kind::Cpu || executor.kind.is_device();
            for executor in executors.iter_mut().filter(compute) {
                let kind = executor.kind;
                let mut result = ExecutorResult {
                    executor: kind.to_string(),
                    ..ExecutorResult::default()
                };
                match function.run(executor, &library, &arguments, desc) {
                    Ok(store) => {
                        result.executions = 1;
                        result.stores = 1;
                        result.untrue = function.judge(&arguments, &store);
                    }
                    Err(error) => {
                        result.status = Status::Failed {
                            reason: error.to_string(),
                        };
                    }
                }
                let checked = watch.checked(kind, executor.take_checked());
                report.findings.extend(checked);
                report.findings.extend(conclusions(&result));
                report.results.push(result);
            }
            report
        })
        .collect()
}

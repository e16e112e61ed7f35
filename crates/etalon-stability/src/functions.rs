//! The functions of the kernels' library, each by itself, on numbers of all sizes.
//!
//! Effects call them with what effects have. What the functions promise of every other
//! number, and of what is none, is held here to closed forms in `f64`, under strict
//! arithmetic, on the interpreter and on devices.

use etalon_core::Format;
use etalon_core::backend::Inputs;
use etalon_core::graph::{Graph, GraphError};
use etalon_core::image::{ImageData, ImageError};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_core::resource::TextureDesc;
use etalon_effects::CameraParams;
use etalon_effects::truth::{Plane, radiance, smooth, unit_interval};
use glam::{DVec2, DVec3};
use thiserror::Error;

use crate::executors::{Executor, Kind};
use crate::judge::truth::Untrue;
use crate::model::{CaseReport, ExecutorResult, Status};
use crate::observe::{ObserveError, Place, Store};
use crate::run::conclusions;
use crate::sanitise::Watch;

/// What the cases of functions are called by.
pub const FAMILY: &str = "functions";

/// What they are run as: there is no effect of this name.
pub const LIBRARY: &str = "lib";

/// What a function is given beside numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Given {
    Nothing,
    /// [`PICTURE`], as `picture`.
    Picture,
    /// [`camera`], in `params`.
    Camera,
}

impl Given {
    /// What the kernel declares of it.
    const fn declared(self) -> &'static str {
        match self {
            Self::Nothing => "",
            Self::Picture => "@group(0) @binding(2) var picture: texture_2d<f32>;",
            Self::Camera => {
                "import package::lib::camera::Camera;

struct Params {
    scale: vec2<f32>,
    centre: vec2<f32>,
    depth: vec2<f32>,
    range: vec2<f32>,
}
@group(0) @binding(2) var<uniform> params: Params;"
            }
        }
    }
}

/// A function of the library.
struct Function {
    name: &'static str,
    /// Where it is, below `lib`.
    module: &'static str,
    /// What makes four numbers of `v`, four numbers that are given.
    call: &'static str,
    /// What it promises, and of what.
    reason: &'static str,
    /// What it is given beside numbers.
    given: Given,
    /// Which arguments it takes.
    takes: fn([f32; 4]) -> bool,
    truth: fn([f64; 4]) -> [f64; 4],
    /// Largest error in units in the last place of the exact number,
    ulps: f64,
    /// or of this number, if that is more.
    scale: f64,
}

fn first(value: f64) -> [f64; 4] {
    [value, 0.0, 0.0, 0.0]
}

fn finite(v: [f32; 4]) -> bool {
    v[0].is_finite()
}

fn any(_: [f32; 4]) -> bool {
    true
}

/// 2^x of an `f32`'s range: 0 below its normal numbers, its largest above.
fn in_range(exponent: f64, value: f64) -> f64 {
    if exponent >= 128.0 {
        f32::MAX.into()
    } else if exponent < -126.0 {
        0.0
    } else {
        value
    }
}

/// Rounded to the nearest half float, ties to even, and never to an infinity.
fn half(x: f64) -> f64 {
    if x.is_nan() {
        return 0.0;
    }
    let x = x.clamp(-65_504.0, 65_504.0);
    // Of the next power of two below; subnormal numbers have the least one's.
    let exponent = (((x.to_bits() >> 52) & 0x7ff) as i32 - 1023).max(-14);
    let step = f64::from(exponent - 10).exp2();
    (x / step).round_ties_even() * step
}

/// The camera that distances are computed for: 0.1 is nearest, depth reversed.
fn camera() -> CameraParams {
    CameraParams::perspective(1.0, 1.5, NEAR)
}

const NEAR: f32 = 0.1;

fn distance(depth: f64) -> f64 {
    let distance = f64::from(NEAR) / depth;
    let nearest = f64::from(NEAR) * 0.999_999;
    if (nearest..2_f64.powi(40)).contains(&distance) {
        distance
    } else {
        0.0
    }
}

/// What is interpolated.
const PICTURE: [[f32; 4]; 6] = [
    [0.0, 1.0, 0.5, 0.25],
    [1.0, 0.0, 0.5, 0.5],
    [0.25, 0.75, 1.0, 0.0],
    [0.5, 0.125, 0.0, 1.0],
    [0.0, 0.625, 0.25, 0.5],
    [1.0, 1.0, 0.75, 0.75],
];
const PICTURE_SIZE: [u32; 2] = [3, 2];

fn interpolated(v: [f64; 4]) -> [f64; 4] {
    let [width, height] = PICTURE_SIZE;
    let texels = PICTURE.map(|texel| texel.map(f64::from)).to_vec();
    let place = DVec2::new(v[0] * f64::from(width), v[1] * f64::from(height));
    Plane::new(width, height, texels)
        .map_or([f64::NAN; 4], |plane| plane.bilinear(place).to_array())
}

fn direction([x, y, z, _]: [f64; 4]) -> [f64; 4] {
    let v = DVec3::new(x, y, z);
    let largest = v.abs().max_element();
    let known = !v.is_nan() && (2_f64.powi(-50)..=2_f64.powi(50)).contains(&largest);
    let v = if known {
        v / largest / (v / largest).length()
    } else {
        DVec3::new(0.0, 0.0, -7.0)
    };
    v.extend(0.0).to_array()
}

const FUNCTIONS: &[Function] = &[
    Function {
        name: "limited",
        module: "math",
        call: "vec4<f32>(limited(v.x, -2.5, 7.0), 0.0, 0.0, 0.0)",
        reason: "a finite number within two limits, whichever way `clamp` is computed",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(v[0].clamp(-2.5, 7.0)),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "limited01",
        module: "math",
        call: "vec4<f32>(limited01(v.x), 0.0, 0.0, 0.0)",
        reason: "a finite number within 0 and 1",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(v[0].clamp(0.0, 1.0)),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "smooth01",
        module: "math",
        call: "vec4<f32>(smooth01(v.x), 0.0, 0.0, 0.0)",
        reason: "a cubic that grows without end outside of 0 and 1",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(smooth(v[0])),
        ulps: 4.0,
        scale: 0.0,
    },
    Function {
        name: "exponential2",
        module: "math",
        call: "vec4<f32>(exponential2(v.x), 0.0, 0.0, 0.0)",
        reason: "2^x overflows from 128 on and has no normal number below -126",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(in_range(v[0], v[0].exp2())),
        ulps: 1.25,
        scale: 0.0,
    },
    Function {
        name: "exponential",
        module: "math",
        call: "vec4<f32>(exponential(v.x), 0.0, 0.0, 0.0)",
        reason: "e^x overflows from 128 ln 2 on and has no normal number below -126 ln 2",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(in_range(v[0] * std::f64::consts::LOG2_E, v[0].exp())),
        ulps: 1.25,
        scale: 0.0,
    },
    Function {
        name: "approach",
        module: "math",
        call: "vec4<f32>(approach(v.x), 0.0, 0.0, 0.0)",
        reason: "1 - e^-x cancels all digits of a small x, and a polynomial ends at ln 2",
        given: Given::Nothing,
        takes: |v| v[0].is_finite() && v[0] >= 0.0,
        truth: |v| first(-(-v[0]).exp_m1()),
        ulps: 1.5,
        scale: 0.0,
    },
    Function {
        name: "logarithm2",
        module: "math",
        call: "vec4<f32>(logarithm2(v.x), 0.0, 0.0, 0.0)",
        reason: "nothing and less have no logarithm, and subnormal numbers may be nothing",
        given: Given::Nothing,
        takes: finite,
        truth: |v| first(v[0].max(f64::from(f32::MIN_POSITIVE)).log2()),
        ulps: 1.0,
        scale: 0.0,
    },
    Function {
        name: "unit3_or",
        module: "math",
        call: "vec4<f32>(unit3_or(v.xyz, vec3<f32>(0.0, 0.0, -7.0)), 0.0)",
        reason: "squares leave f32's range where their numbers do not",
        given: Given::Nothing,
        takes: any,
        truth: direction,
        ulps: 3.0,
        scale: 0.0,
    },
    Function {
        name: "finite_or",
        module: "sanitise",
        call: "vec4<f32>(finite_or(v.x, 9.0), 0.0, 0.0, 0.0)",
        reason: "WGSL may assume that NaN does not occur: bits tell",
        given: Given::Nothing,
        takes: any,
        truth: |v| first(if v[0].is_finite() { v[0] } else { 9.0 }),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "radiance",
        module: "sanitise",
        call: "vec4<f32>(radiance(v.xyz), 0.0)",
        reason: "light that is negative, infinite or none at all",
        given: Given::Nothing,
        takes: any,
        truth: |v| [radiance(v[0]), radiance(v[1]), radiance(v[2]), 0.0],
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "unit_interval",
        module: "sanitise",
        call: "vec4<f32>(unit_interval(v.x), 0.0, 0.0, 0.0)",
        reason: "shares that are none: minima and maxima let a NaN through",
        given: Given::Nothing,
        takes: any,
        truth: |v| first(unit_interval(v[0])),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "f16_rounded",
        module: "storage",
        call: "f16_rounded(v)",
        reason: "ties, subnormal half floats, and numbers that would become infinite",
        given: Given::Nothing,
        takes: any,
        truth: |v| v.map(half),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "bilinear",
        module: "sampling",
        call: "bilinear(picture, v.xy)",
        reason: "coordinates far beyond what an integer holds",
        given: Given::Picture,
        takes: |v| v[0].is_finite() && v[1].is_finite(),
        truth: interpolated,
        // Of a place in texels, of which there are 3, and the weights made of it.
        ulps: 16.0,
        scale: 1.0,
    },
    Function {
        name: "distance_of",
        module: "camera",
        call: "vec4<f32>(distance_of(Camera(params.scale, params.centre, params.depth, params.range), v.x), \
               0.0, 0.0, 0.0)",
        reason: "depths that no projection makes: behind, before, infinite and none",
        given: Given::Camera,
        takes: any,
        truth: |v| first(distance(v[0])),
        ulps: 2.0,
        scale: 0.0,
    },
];

/// Numbers of every exponent and both signs, ends of what functions take, and what are
/// no numbers.
fn numbers() -> Vec<f32> {
    let bits = (0..=255_u32).flat_map(|exponent| {
        let mantissas = [0, 1, 0x2a_aaaa, 0x7f_e000, 0x7f_ffff];
        mantissas.map(|mantissa| exponent << 23 | mantissa)
    });
    let mut numbers: Vec<f32> = bits
        .flat_map(|bits| [bits, bits | 1 << 31].map(f32::from_bits))
        .collect();
    // In the range of exponents and of shares.
    numbers.extend((-640..=640).map(|i| i as f32 * 0.3125));
    numbers.extend((-40..=140).map(|i| i as f32 / 100.0));
    numbers
}

/// Four numbers for each texel; every number is the first of one.
fn arguments() -> Vec<[f32; 4]> {
    let numbers = numbers();
    let at = |index: usize| numbers[index % numbers.len()];
    (0..numbers.len())
        .map(|i| [at(i), at(i * 7 + 3), at(i * 13 + 5), at(i * 29 + 11)])
        .collect()
}

/// A row of the arguments' image.
const WIDTH: u32 = 64;

/// In place of arguments that are not taken: all functions take it.
const FILLING: [f32; 4] = [1.0; 4];

/// Why a function was not run.
#[derive(Debug, Error)]
enum FunctionError {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Graph(#[from] GraphError),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Observe(#[from] ObserveError),
}

impl Function {
    fn path(&self) -> String {
        format!("functions/{}", self.name)
    }

    fn kernel(&self) -> String {
        let Self {
            name, module, call, ..
        } = self;
        let given = self.given.declared();
        format!(
            "import package::lib::{module}::{name};
{given}
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let extent = textureDimensions(result);
    if (id.x >= extent.x || id.y >= extent.y) {{
        return;
    }}
    let v = textureLoad(source, id.xy, 0);
    textureStore(result, id.xy, {call});
}}
"
        )
    }

    fn run(
        &self,
        executor: &mut Executor,
        kernels: &KernelLibrary,
        arguments: &[[f32; 4]],
        desc: TextureDesc,
    ) -> Result<Store, FunctionError> {
        let arguments = &ImageData::from_rgba_f32(desc, arguments)?;
        let [width, height] = PICTURE_SIZE;
        let wide = |width, height| TextureDesc::d2(width, height, Format::Rgba32Float);
        let picture = ImageData::from_rgba_f32(wide(width, height), &PICTURE)?;
        let mut graph = Graph::new();
        let source = graph.import_texture("arguments", arguments.desc)?;
        let extent = arguments.desc.extent;
        let result = graph.texture("result", wide(extent.width, extent.height));
        let mut inputs = Inputs::new().texture("arguments", arguments);
        let given = match self.given {
            Given::Picture => {
                inputs = inputs.texture("picture", &picture);
                Some(graph.import_texture("picture", picture.desc)?)
            }
            _ => None,
        };
        let mut pass = graph
            .compute(self.path())
            .read("source", source)
            .write("result", result);
        if let Some(picture) = given {
            pass = pass.read("picture", picture);
        }
        if self.given == Given::Camera {
            let camera = camera();
            pass = pass
                .set("scale", camera.scale)
                .set("centre", camera.centre)
                .set("depth", camera.depth_bias_slope())
                .set("range", camera.distance_range());
        }
        let result = pass.per_texel("result")?;
        graph.output("result", result)?;
        let plan = Plan::new(
            &graph,
            kernels,
            &PlanOptions {
                arithmetic: Arithmetic::Strict,
                limits: executor.backend().limits(),
                capture: Capture::Outputs,
                memory: executor.backend().memory(),
            },
        )?;
        let mut stores = executor.run(&plan, &inputs)?;
        Ok(stores.pop().unwrap_or_default())
    }

    /// Holds what was stored to the truth.
    fn judge(&self, arguments: &[[f32; 4]], store: &Store) -> Option<Untrue> {
        let texels = store
            .image
            .as_ref()
            .and_then(|image| image.to_rgba_f32().ok());
        let texels = texels.unwrap_or_default();
        let mut found: Option<Untrue> = None;
        for (index, (v, stored)) in arguments.iter().zip(&texels).enumerate() {
            let exact = (self.truth)(v.map(f64::from));
            let wrong = (0..4).find(|&channel| {
                let (stored, exact) = (f64::from(stored[channel]), exact[channel]);
                let size = exact.abs().max(self.scale).max(f32::MIN_POSITIVE.into());
                let unit = f64::from(((size.to_bits() >> 52) as i32) - 1023 - 23).exp2();
                // Where nothing normal is left it may be flushed to zero.
                let flushed = exact.abs() <= f64::from(f32::MIN_POSITIVE) && stored == 0.0;
                // Written so that a NaN is wrong.
                let right = flushed || (stored - exact).abs() <= self.ulps * unit;
                !right
            });
            if let Some(channel) = wrong {
                let found = found.get_or_insert_with(|| Untrue {
                    texels: 0,
                    first: Place {
                        channel: channel as u32,
                        ..store.place(0, index, channel)
                    },
                    what: format!(
                        "{} of {:?}: {:e} in place of {:e}",
                        self.name, v, stored[channel], exact[channel]
                    ),
                });
                found.texels += 1;
            }
        }
        if texels.len() < arguments.len() {
            let what = format!("{} of {} results", texels.len(), arguments.len());
            return Some(Untrue {
                texels: (arguments.len() - texels.len()) as u64,
                what,
                ..Untrue::default()
            });
        }
        found
    }
}

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
    for function in FUNCTIONS {
        library.add_source(&function.path(), &function.kernel());
    }
    let mut all = arguments();
    let height = all.len().div_ceil(WIDTH as usize);
    all.resize(height * WIDTH as usize, FILLING);
    let desc = TextureDesc::d2(WIDTH, height as u32, Format::Rgba32Float);
    FUNCTIONS
        .iter()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_result_is_found_and_a_right_one_is_not() {
        let arguments = [[0.5, 1.0, 2.0, f32::NAN], [-3.0, 0.0, f32::INFINITY, 1.0]];
        let desc = TextureDesc::d2(2, 1, Format::Rgba32Float);
        let store = |texels: &[[f32; 4]]| Store {
            image: Some(ImageData::from_rgba_f32(desc, texels).unwrap()),
            ..Store::default()
        };
        let rounding = FUNCTIONS.iter().find(|f| f.name == "f16_rounded").unwrap();
        let mut right = [[0.5, 1.0, 2.0, 0.0], [-3.0, 0.0, 65_504.0, 1.0]];
        assert_eq!(rounding.judge(&arguments, &store(&right)), None);
        right[1][2] = f32::INFINITY;
        let found = rounding.judge(&arguments, &store(&right)).unwrap();
        assert_eq!(
            (found.texels, found.first.x, found.first.channel),
            (1, 1, 2)
        );
        assert!(rounding.judge(&arguments, &Store::default()).is_some());
    }

    #[test]
    fn half_floats_are_rounded_to_nearest_even() {
        for (x, expected) in [
            (1.0 + 1.0 / 2048.0, 1.0),
            (1.0 + 3.0 / 2048.0, 1.0 + 2.0 / 1024.0),
            (2_f64.powi(-25), 0.0),
            (3.0 * 2_f64.powi(-25), 2.0 * 2_f64.powi(-24)),
            (65_519.0, 65_504.0),
            (1e30, 65_504.0),
            (-2_f64.powi(-14), -2_f64.powi(-14)),
        ] {
            assert_eq!(half(x), expected, "{x}");
        }
    }
}

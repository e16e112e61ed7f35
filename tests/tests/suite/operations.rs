//! Every operation of WGSL on every executor; see `etalon_tests::operations`.

use etalon::kernel::Arithmetic;
use etalon_tests::executors;
use etalon_tests::operations::exceptions::known;
use etalon_tests::operations::judge::{Judgement, Who, expectations, judge};
use etalon_tests::operations::report::{Entry, Report};
use etalon_tests::operations::run::{RunError, executor_name, library, run};
use etalon_tests::operations::table;

#[test]
fn every_operation_is_as_wgsl_and_strict_arithmetic_have_it() {
    let operations = table::all();
    let kernels = library(&operations);
    let mut executors = executors();
    let names: Vec<String> = executors
        .iter()
        .map(|executor| executor_name(&executor.info()))
        .collect();
    let mut report = Report {
        executors: names.clone(),
        ..Report::default()
    };
    for (index, operation) in operations.iter().enumerate() {
        let expected = expectations(operation);
        let arithmetics = [("strict", Arithmetic::Strict), ("fast", Arithmetic::Fast)];
        for (arithmetic_name, arithmetic) in arithmetics {
            if arithmetic == Arithmetic::Strict && !operation.strict {
                continue;
            }
            let mut interpreter: Option<Vec<u32>> = None;
            for (executor, name) in executors.iter_mut().zip(&names) {
                let results = run(executor.as_mut(), &kernels, &operations, index, arithmetic);
                if let Some(feature) = results.as_ref().err().and_then(RunError::lacking) {
                    report.lacks(name, feature);
                    continue;
                }
                let judgement = match results {
                    Err(error) => Judgement::without_results(error.to_string()),
                    Ok(results) => {
                        let who = match (&interpreter, arithmetic) {
                            _ if name == "cpu" => Who::Interpreter,
                            (Some(interpreter), Arithmetic::Strict) => Who::Strict(interpreter),
                            _ => Who::Fast,
                        };
                        let judgement = judge(operation, &expected, &results, who);
                        if name == "cpu" {
                            interpreter = Some(results);
                        }
                        judgement
                    }
                };
                report.entries.push(Entry {
                    operation: operation.name.clone(),
                    executor: name.clone(),
                    arithmetic: arithmetic_name,
                    judgement,
                });
            }
        }
    }
    let exceptions = known().unwrap_or_else(|error| panic!("{error}"));
    report.conclude(&exceptions);
    let table = report.table(&exceptions);
    println!("{table}");
    assert!(report.ok(), "{table}");
}

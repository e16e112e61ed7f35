//! `cargo xtask test-operations`: every operation of WGSL on the interpreter
//! and on every driver, held to WGSL's accuracy table and to each other.

mod execute;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use etalon_tests::operations::exceptions::{BadLine, Exception, known};
use etalon_tests::operations::judge::{Judgement, Who, expectations, judge};
use etalon_tests::operations::operation::Operation;
use etalon_tests::operations::report::{Entry, Report};
use serde_json::{Value, json};
use thiserror::Error;

use crate::drivers;
use crate::execute::Api;
use crate::test_backends::model::{BackendKind, Executor, Target};
use crate::test_backends::{TestError, executors, supervise};
use execute::{OperationRun, Outcome, chosen};

pub use execute::{Job, ResultsError, execute};

/// Name of the hidden command that [`execute()`] serves.
pub const COMMAND: &str = "execute-operations";

/// Run every operator and built-in function of WGSL on the interpreter and on
/// every driver, and hold the results to WGSL's accuracy table.
///
/// Under strict arithmetic the results also have to have the interpreter's
/// bits. What drivers are known to do otherwise is listed in
/// tests/operations/exceptions.txt. Exit status 0 means that all required
/// backends ran and nothing else was found, 1 that they did not, 2 that the
/// command line is wrong.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// Only operations whose names contain this, as `sqrt` or `a / b, f32`
    #[arg(long, value_name = "TEXT")]
    pub operation: Option<String>,
    /// Drivers to use: `all`, or names like `lavapipe,swiftshader`
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "all|NAMES",
        default_value = "all"
    )]
    pub drivers: Vec<String>,
    /// Backends that have to run
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "BACKENDS",
        default_value = "cpu"
    )]
    pub require: Vec<BackendKind>,
    /// Write everything measured to this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Run ash under the Khronos validation layer, its messages being failures
    #[arg(long)]
    pub validate: bool,
    /// Seconds after which an executor counts as crashed
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub timeout: u64,
    /// Flip the last bit of the first result of an operation on one executor,
    /// as `ash/lavapipe=a + b, f32`, to see it found
    #[arg(long, value_name = "EXECUTOR=OPERATION", hide = true, value_parser = planted)]
    pub plant: Option<(String, String)>,
}

/// Reads `EXECUTOR=OPERATION`.
fn planted(text: &str) -> Result<(String, String), String> {
    let (executor, operation) = text
        .split_once('=')
        .ok_or("as in ash/lavapipe=a + b, f32")?;
    Ok((executor.to_owned(), operation.to_owned()))
}

/// Why there is no report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OperationsError {
    /// No operation has such a name.
    #[error("no operation's name contains `{0}`")]
    NoOperation(String),
    /// A driver that is not there.
    #[error(transparent)]
    Drivers(#[from] TestError),
    /// The table of exceptions makes no sense.
    #[error(transparent)]
    Exceptions(#[from] BadLine),
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Runs the command and says whether all is well. `program` is this program
/// itself, for its hidden command.
///
/// # Errors
/// If no report could be made; what is wrong with results is in the report.
pub fn run(options: &Options, program: &Path) -> Result<bool, OperationsError> {
    let operations = chosen(options.operation.as_deref());
    if operations.is_empty() {
        let text = options.operation.clone().unwrap_or_default();
        return Err(OperationsError::NoOperation(text));
    }
    let exceptions = known()?;
    let found = drivers::find(&drivers::Environment::of_process());
    // OpenGL has no strict arithmetic, and its shaders are translated anew.
    let mut asked = executors(&found.drivers, &options.drivers)?;
    asked.retain(|executor| executor.target != Target::Gl);
    let work = tempfile::tempdir().map_err(|source| OperationsError::Io {
        path: std::env::temp_dir(),
        source,
    })?;
    let mut bench = Bench {
        report: Report::default(),
        finished: Vec::new(),
        ran: Vec::new(),
    };
    for (number, executor) in asked.iter().enumerate() {
        let folder = work.path().join(number.to_string());
        std::fs::create_dir(&folder).map_err(|source| OperationsError::Io {
            path: folder.clone(),
            source,
        })?;
        bench.run(options, program, executor, folder);
    }
    for &required in &options.require {
        if !bench.ran.contains(&required) {
            bench
                .report
                .problems
                .push(format!("{required} is required and did not run"));
        }
    }
    for operation in &operations {
        bench.judge(operation, options.plant.as_ref());
    }
    let mut report = bench.report;
    report.conclude(&exceptions);
    write(&report, &exceptions, options)?;
    Ok(report.ok())
}

/// The results of one executor.
struct Finished {
    name: String,
    folder: PathBuf,
    runs: BTreeMap<(String, bool), OperationRun>,
}

/// A command under way.
struct Bench {
    report: Report,
    finished: Vec<Finished>,
    ran: Vec<BackendKind>,
}

impl Bench {
    /// Runs all operations on an executor.
    fn run(&mut self, options: &Options, program: &Path, executor: &Executor, folder: PathBuf) {
        let job = Job {
            backend: executor.backend,
            api: Api::Vulkan,
            validate: options.validate,
            operation: options.operation.clone(),
            out: folder.clone(),
        };
        let limit = Duration::from_secs(options.timeout);
        let log = folder.join("stderr.txt");
        let ended = supervise::to_the_end(
            program,
            COMMAND,
            &job.arguments(),
            &executor.target,
            limit,
            &log,
        );
        let outcome =
            ended.and_then(|()| Outcome::read(&folder).map_err(|error| error.to_string()));
        let mut problem = |text: String| {
            self.report
                .problems
                .push(format!("{}: {text}", executor.id))
        };
        match outcome {
            Ok(Outcome::Ran { name, runs }) => {
                self.report.executors.push(name.clone());
                self.ran.push(executor.backend);
                self.finished.push(Finished {
                    name,
                    folder,
                    runs: runs
                        .into_iter()
                        .map(|run| ((run.operation.clone(), run.strict), run))
                        .collect(),
                });
            }
            // A manifest without a device is no fault, unless that is required.
            Ok(Outcome::NoDevice { reason }) => eprintln!("{}: {reason}", executor.id),
            Ok(Outcome::Failed { reason }) => problem(reason),
            Err(reason) => problem(reason),
        }
    }

    /// Judges an operation on all executors, the interpreter first.
    fn judge(&mut self, operation: &Operation, plant: Option<&(String, String)>) {
        let expected = expectations(operation);
        for strict in [true, false] {
            if strict && !operation.strict {
                continue;
            }
            let mut interpreter: Option<Vec<u32>> = None;
            for finished in &self.finished {
                let key = (operation.name.clone(), strict);
                let run = finished.runs.get(&key);
                if let Some(feature) = run.and_then(|run| run.lacking.as_deref()) {
                    self.report.lacks(&finished.name, feature);
                    continue;
                }
                let results = match run {
                    Some(run) => run.read(&finished.folder),
                    None => Err("was not run".to_owned()),
                };
                let judgement = match results {
                    Err(reason) => Judgement::without_results(reason),
                    Ok(mut words) => {
                        let is_planted = plant.is_some_and(|(executor, name)| {
                            *executor == finished.name && *name == operation.name
                        });
                        if let (true, Some(word)) = (is_planted, words.first_mut()) {
                            *word ^= 1;
                        }
                        let who = match &interpreter {
                            _ if finished.name == "cpu" => Who::Interpreter,
                            Some(interpreter) if strict => Who::Strict(interpreter),
                            _ => Who::Fast,
                        };
                        let judgement = judge(operation, &expected, &words, who);
                        if finished.name == "cpu" {
                            interpreter = Some(words);
                        }
                        judgement
                    }
                };
                self.report.entries.push(Entry {
                    operation: operation.name.clone(),
                    executor: finished.name.clone(),
                    arithmetic: if strict { "strict" } else { "fast" },
                    judgement,
                });
            }
        }
    }
}

/// The report as JSON.
fn as_json(report: &Report) -> Value {
    let entries: Vec<Value> = report
        .entries
        .iter()
        .map(|entry| {
            let judgement = &entry.judgement;
            let failures: Vec<Value> = judgement
                .failures
                .iter()
                .map(|failure| {
                    json!({
                        "check": failure.check.name(),
                        "count": failure.count,
                        "first": failure.first,
                    })
                })
                .collect();
            json!({
                "operation": entry.operation,
                "executor": entry.executor,
                "arithmetic": entry.arithmetic,
                "results": judgement.results,
                "judged": judgement.judged,
                "worst_ulp": judgement.worst,
                "failures": failures,
            })
        })
        .collect();
    json!({
        "ok": report.ok(),
        "executors": report.executors,
        "problems": report.problems,
        "exceptions": report.excused,
        "lacking": report
            .lacking
            .iter()
            .map(|((executor, feature), count)| {
                json!({ "executor": executor, "feature": feature, "operations": count })
            })
            .collect::<Vec<_>>(),
        "entries": entries,
    })
}

/// Writes the report where it was asked for.
fn write(
    report: &Report,
    exceptions: &[Exception],
    options: &Options,
) -> Result<(), OperationsError> {
    if let Some(path) = &options.json {
        let text = format!("{:#}\n", as_json(report));
        std::fs::write(path, text).map_err(|source| OperationsError::Io {
            path: path.clone(),
            source,
        })?;
    }
    let text = report.table(exceptions);
    match io::stdout().lock().write_all(text.as_bytes()) {
        // Whoever reads may have read enough.
        Err(source) if source.kind() != io::ErrorKind::BrokenPipe => Err(OperationsError::Io {
            path: "standard output".into(),
            source,
        }),
        _ => Ok(()),
    }
}

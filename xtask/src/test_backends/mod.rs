//! `cargo xtask test-backends`: the same scenes on every backend and every
//! driver, compared pass by pass.

mod evaluate;
mod gallery;
mod html;
pub mod model;
mod options;
mod supervise;
mod table;
#[cfg(test)]
mod tests;
mod tolerances;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use etalon_scenes::scenes;
use indicatif::{ProgressBar, ProgressStyle};
use thiserror::Error;

use crate::drivers::{self, Driver};
use crate::execute::frame::{Source, SourceError};
use crate::execute::outcome::Run;
use crate::execute::{ArithmeticName, UnknownEffect, find_effect};
use crate::setup::{self, SetupError};
use evaluate::{EvaluateError, Finished};
use gallery::{Gallery, GalleryError};
use model::{BackendKind, Case, Executor, Report, RunReport, Settings, Status, Target};
pub use options::Options;
pub use supervise::COMMAND;

/// Why there is no report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TestError {
    /// Drivers cannot be installed.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A driver that is not there.
    #[error("there is no driver `{name}`; found: {}", if found.is_empty() { "none".to_owned() } else { found.join(", ") })]
    NoDriver {
        /// As asked.
        name: String,
        /// As there are.
        found: Vec<String>,
    },
    /// A fault for an executor that is not there.
    #[error("there is no executor `{name}`; there are {}", found.join(", "))]
    NoExecutor {
        /// As asked.
        name: String,
        /// As there are.
        found: Vec<String>,
    },
    /// An effect that is not there.
    #[error(transparent)]
    Effect(#[from] UnknownEffect),
    /// A frame that cannot be had.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The comparison could not be carried through.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// Pictures cannot be written.
    #[error(transparent)]
    Gallery(#[from] GalleryError),
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Runs the command. `program` is this program itself, for its hidden command.
///
/// # Errors
/// If no report could be made; disagreement is in the report.
pub fn run(options: &Options, program: &Path) -> Result<Report, TestError> {
    find_effect(&options.effect)?;
    let sources = sources(options)?;
    if options.setup {
        setup::run()?;
    }
    let found = drivers::find(&drivers::Environment::of_process());
    let executors = executors(&choose(&found.drivers, &options.drivers)?);
    check_planted(options, &executors)?;
    let cases = sources.len() * options.arithmetic.names().len();
    let mut bench = Bench {
        options,
        program,
        gallery: options.report.as_deref().map(Gallery::new).transpose()?,
        progress: progress(cases * executors.len()),
        report: Report {
            ok: false,
            problems: Vec::new(),
            notes: Vec::new(),
            settings: settings(options, &sources)?,
            executors,
            unusable_manifests: found.bad,
            runs: Vec::new(),
            comparisons: Vec::new(),
        },
    };
    for source in &sources {
        for &arithmetic in options.arithmetic.names() {
            bench.run_case(source, arithmetic)?;
        }
    }
    bench.progress.finish_and_clear();
    let mut report = bench.report;
    evaluate::conclude(&mut report);
    write(&report, options)?;
    Ok(report)
}

/// A command under way.
struct Bench<'a> {
    options: &'a Options,
    program: &'a Path,
    gallery: Option<Gallery>,
    progress: ProgressBar,
    report: Report,
}

impl Bench<'_> {
    /// Runs a frame in one arithmetic on every executor, compares, and forgets
    /// the texels.
    fn run_case(&mut self, source: &Source, arithmetic: ArithmeticName) -> Result<(), TestError> {
        let case = Case {
            scene: source.name(),
            arithmetic: arithmetic.name().to_owned(),
        };
        let work = tempfile::tempdir().map_err(|source| TestError::Io {
            path: std::env::temp_dir(),
            source,
        })?;
        let mut done: Vec<(Executor, Run, PathBuf)> = Vec::new();
        for (number, executor) in self.report.executors.clone().into_iter().enumerate() {
            self.progress
                .set_message(format!("{case}: {}", executor.id));
            let folder = work.path().join(number.to_string());
            let (status, run) = match self.absent(&executor) {
                Some(status) => (status, None),
                None => {
                    std::fs::create_dir(&folder).map_err(|source| TestError::Io {
                        path: folder.clone(),
                        source,
                    })?;
                    let job = self
                        .options
                        .job(source, arithmetic, &executor, folder.clone());
                    let limit = Duration::from_secs(self.options.timeout);
                    supervise::run(self.program, &job, &executor.target, limit)
                }
            };
            self.report.runs.push(RunReport {
                case: case.clone(),
                executor: executor.id.clone(),
                status,
            });
            done.extend(run.map(|run| (executor, run, folder)));
            self.progress.inc(1);
        }
        self.progress.set_message(format!("{case}: comparing"));
        let finished: Vec<Finished<'_>> = done
            .iter()
            .map(|(executor, run, folder)| Finished {
                executor,
                run,
                folder,
            })
            .collect();
        for pair in evaluate::pairs(&finished) {
            let tolerance = tolerances::of(&case, pair);
            let compared = evaluate::compare_pair(&case, pair, tolerance, self.gallery.as_mut())?;
            self.report.comparisons.extend(compared);
        }
        Ok(())
    }

    /// The status of an executor that had no device in an earlier case: it has
    /// none in the next either.
    fn absent(&self, executor: &Executor) -> Option<Status> {
        let is_absent = |run: &&RunReport| {
            run.executor == executor.id && matches!(run.status, Status::NoDevice { .. })
        };
        self.report
            .runs
            .iter()
            .find(is_absent)
            .map(|run| run.status.clone())
    }
}

/// Whether the faults to plant are for executors that are there.
fn check_planted(options: &Options, executors: &[Executor]) -> Result<(), TestError> {
    for (name, _) in &options.plant {
        if executors.iter().all(|executor| executor.id != *name) {
            let found = executors
                .iter()
                .map(|executor| executor.id.clone())
                .collect();
            return Err(TestError::NoExecutor {
                name: name.clone(),
                found,
            });
        }
    }
    Ok(())
}

/// The drivers asked for among those found.
fn choose(found: &[Driver], asked: &[String]) -> Result<Vec<Driver>, TestError> {
    if asked.iter().any(|name| name == "all") {
        return Ok(found.to_vec());
    }
    let choose = |name: &String| {
        found
            .iter()
            .find(|driver| driver.name == *name)
            .cloned()
            .ok_or_else(|| TestError::NoDriver {
                name: name.clone(),
                found: found.iter().map(|driver| driver.name.clone()).collect(),
            })
    };
    asked.iter().map(choose).collect()
}

/// Everyone who is to run: the interpreter, then each driver by wgpu and by
/// ash, then OpenGL.
fn executors(drivers: &[Driver]) -> Vec<Executor> {
    let mut executors = vec![Executor::new(BackendKind::Cpu, Target::Host)];
    for driver in drivers {
        for backend in [BackendKind::Wgpu, BackendKind::Ash] {
            executors.push(Executor::new(backend, Target::Vulkan(driver.clone())));
        }
    }
    executors.push(Executor::new(BackendKind::Wgpu, Target::Gl));
    executors
}

/// The frames to run on; unknown scenes are refused before anything runs.
fn sources(options: &Options) -> Result<Vec<Source>, SourceError> {
    if let Some(path) = &options.input {
        return Ok(vec![Source::File(path.clone())]);
    }
    let names: Vec<String> = if options.scene.is_empty() {
        scenes().iter().map(|scene| scene.name.to_owned()).collect()
    } else {
        options.scene.clone()
    };
    let source = |name: String| match etalon_scenes::scene(&name) {
        Some(_) => Ok(Source::Scene {
            name,
            width: options.size.width,
            height: options.size.height,
        }),
        None => Err(SourceError::NoScene { name }),
    };
    names.into_iter().map(source).collect()
}

/// What was asked for, as the report has it.
fn settings(options: &Options, sources: &[Source]) -> Result<Settings, SourceError> {
    let mut size = (options.size.width, options.size.height);
    if let [file @ Source::File(_)] = sources {
        let frame = file.frame()?.size();
        size = (frame.width(), frame.height());
    }
    Ok(Settings {
        width: size.0,
        height: size.1,
        frames: options.frames,
        effect: options.effect.clone(),
        scenes: sources.iter().map(Source::name).collect(),
        arithmetic: options
            .arithmetic
            .names()
            .iter()
            .map(|name| name.name().to_owned())
            .collect(),
        required: options.require.clone(),
    })
}

/// A bar on standard error; nothing where that is no terminal.
fn progress(length: usize) -> ProgressBar {
    let bar = ProgressBar::new(length as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Writes the report where it was asked for.
fn write(report: &Report, options: &Options) -> Result<(), TestError> {
    let save = |path: PathBuf, text: String| {
        std::fs::write(&path, text).map_err(|source| TestError::Io { path, source })
    };
    let json = || {
        let mut text =
            serde_json::to_string_pretty(report).unwrap_or_else(|error| format!("\"{error}\""));
        text.push('\n');
        text
    };
    if let Some(path) = &options.json {
        save(path.clone(), json())?;
    }
    if let Some(folder) = &options.report {
        save(folder.join("report.json"), json())?;
        save(folder.join("index.html"), html::render(report))?;
    }
    let mut out = io::stdout().lock();
    let shown = out.write_all(table::render(report).as_bytes());
    let place = options
        .report
        .as_deref()
        .map(|folder| folder.join("index.html"));
    let shown = shown
        .and_then(|()| place.map_or(Ok(()), |place| writeln!(out, "Report: {}", place.display())));
    match shown {
        // Whoever reads may have read enough.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(TestError::Io {
            path: "standard output".into(),
            source: error,
        }),
        _ => Ok(()),
    }
}

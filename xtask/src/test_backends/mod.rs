//! `cargo xtask test-backends`: the same scenes on every backend and every
//! driver, compared pass by pass.

mod evaluate;
mod gallery;
mod html;
pub mod model;
mod options;
pub(crate) mod supervise;
mod table;
#[cfg(test)]
mod tests;
mod tolerances;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

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
    #[error("there is no driver `{name}`; there are {}", found.join(", "))]
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
    let effects = effects(options)?;
    let sources = sources(options)?;
    if options.setup {
        setup::run()?;
    }
    let found = drivers::find(&drivers::Environment::of_process());
    let executors = executors(&found.drivers, &options.drivers)?;
    check_planted(options, &executors)?;
    let cases = sources.len() * effects.len() * options.arithmetic.names().len();
    let mut bench = Bench {
        options,
        program,
        gallery: options.report.as_deref().map(Gallery::new).transpose()?,
        progress: progress(cases * executors.len()),
        report: Report {
            ok: false,
            problems: Vec::new(),
            notes: Vec::new(),
            settings: settings(options, &sources, &effects)?,
            executors: executors.clone(),
            unusable_manifests: found.bad,
            runs: Vec::new(),
            comparisons: Vec::new(),
        },
    };
    for source in &sources {
        for &effect in &effects {
            for &arithmetic in options.arithmetic.names() {
                bench.run_case(source, effect, arithmetic, &executors)?;
            }
        }
    }
    bench.run_parts(&sources, &effects)?;
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
    /// Applies an effect to a frame on executors, compares, and forgets the
    /// texels.
    fn run_case(
        &mut self,
        source: &Source,
        effect: &str,
        arithmetic: ArithmeticName,
        executors: &[Executor],
    ) -> Result<(), TestError> {
        let case = Case {
            scene: source.name(),
            effect: effect.to_owned(),
            arithmetic: arithmetic.name().to_owned(),
        };
        let work = tempfile::tempdir().map_err(|source| TestError::Io {
            path: std::env::temp_dir(),
            source,
        })?;
        let mut done: Vec<(&Executor, Run, PathBuf)> = Vec::new();
        for (number, executor) in executors.iter().enumerate() {
            self.progress
                .set_message(format!("{case}: {}", executor.id));
            let folder = work.path().join(number.to_string());
            let (status, run) = match self.absent(executor) {
                Some(status) => (status, None),
                None => {
                    std::fs::create_dir(&folder).map_err(|source| TestError::Io {
                        path: folder.clone(),
                        source,
                    })?;
                    let job =
                        self.options
                            .job(source, effect, arithmetic, executor, folder.clone());
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
            let tolerance = tolerances::of(&case, source.is_drawn(), pair);
            let compared = evaluate::compare_pair(&case, pair, tolerance, self.gallery.as_mut())?;
            self.report.comparisons.extend(compared);
        }
        Ok(())
    }

    /// Where an executor lacks what a combination of effects needs, as OpenGL
    /// lacks formats, applies the other effects one by one to the first frame:
    /// it is tested as far as it goes.
    fn run_parts(&mut self, sources: &[Source], done: &[&str]) -> Result<(), TestError> {
        let Some(source) = sources.first() else {
            return Ok(());
        };
        let lacks_something = |executor: &&Executor| {
            let unsupported = |run: &RunReport| {
                run.executor == executor.id && matches!(run.status, Status::Unsupported { .. })
            };
            executor.backend == BackendKind::Cpu || self.report.runs.iter().any(unsupported)
        };
        let executors: Vec<Executor> = self
            .report
            .executors
            .iter()
            .filter(lacks_something)
            .cloned()
            .collect();
        if executors.len() < 2 {
            return Ok(());
        }
        for part in etalon::effects::effects()
            .iter()
            .filter(|effect| !done.contains(&effect.name))
        {
            for &arithmetic in self.options.arithmetic.names() {
                self.progress.inc_length(executors.len() as u64);
                self.run_case(source, part.name, arithmetic, &executors)?;
            }
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

/// Everyone who is to run: the interpreter, then each driver asked for by wgpu
/// and by ash, then OpenGL.
pub(crate) fn executors(drivers: &[Driver], asked: &[String]) -> Result<Vec<Executor>, TestError> {
    const GL: &str = "gl";
    let is_known = |name: &str| {
        name == "all" || name == GL || drivers.iter().any(|driver| driver.name == name)
    };
    if let Some(unknown) = asked.iter().find(|name| !is_known(name)) {
        let found = drivers
            .iter()
            .map(|driver| driver.name.as_str())
            .chain([GL]);
        return Err(TestError::NoDriver {
            name: unknown.clone(),
            found: found.map(str::to_owned).collect(),
        });
    }
    let wanted = |name: &str| asked.iter().any(|asked| asked == "all" || asked == name);
    let mut executors = vec![Executor::new(BackendKind::Cpu, Target::Host)];
    for driver in drivers.iter().filter(|driver| wanted(&driver.name)) {
        for backend in [BackendKind::Wgpu, BackendKind::Ash] {
            executors.push(Executor::new(backend, Target::Vulkan(driver.clone())));
        }
    }
    if wanted(GL) {
        executors.push(Executor::new(BackendKind::Wgpu, Target::Gl));
    }
    Ok(executors)
}

/// The effects asked for.
fn effects(options: &Options) -> Result<Vec<&'static str>, UnknownEffect> {
    if options.effect.iter().any(|name| name == "all") {
        return Ok(etalon::effects::effects()
            .iter()
            .map(|effect| effect.name)
            .collect());
    }
    options
        .effect
        .iter()
        .map(|name| Ok(find_effect(name)?.name))
        .collect()
}

/// The frames to run on; unknown scenes are refused before anything runs.
fn sources(options: &Options) -> Result<Vec<Source>, SourceError> {
    if let Some(path) = &options.input {
        return Ok(vec![Source::of_file(path.clone(), options.size)]);
    }
    let named = |name: &str| Source::named(name, options.size);
    if options.scene.is_empty() {
        Source::names().map(named).collect()
    } else {
        options.scene.iter().map(|name| named(name)).collect()
    }
}

/// What was asked for, as the report has it.
fn settings(
    options: &Options,
    sources: &[Source],
    effects: &[&str],
) -> Result<Settings, SourceError> {
    let mut size = (options.size.width, options.size.height);
    if let [file @ Source::File(_)] = sources {
        let frame = file.content()?.size();
        size = (frame.width(), frame.height());
    }
    Ok(Settings {
        width: size.0,
        height: size.1,
        frames: options.frames,
        effects: effects.iter().map(|&effect| effect.to_owned()).collect(),
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

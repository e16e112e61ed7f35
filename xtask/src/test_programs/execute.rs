//! The hidden command that tries programs on one executor, in a process of its
//! own, and writes down how each went before it goes on to the next.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use etalon_core::backend::{Backend, BackendError};
use etalon_tests::programs::{
    Evaluation, ExecuteError, Held, Interpreters, Program, STEPS, Trial, binds_devices,
    differences, evaluate, execute as run_trial, may_differ, of_seed, shrink, statements,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::execute::Api;
use crate::execute::backends::open;
use crate::execute::outcome::Device;
use crate::test_backends::model::BackendKind;

/// Name of the file with a line of JSON for each event.
const FILE: &str = "lines.json";

/// Most programs tried to make a failing one smaller.
const TRIES: usize = 4000;

/// What to try, on what, and where to write how it went.
#[derive(Clone, Debug, Args)]
pub struct Job {
    /// The backend.
    #[arg(long)]
    pub backend: BackendKind,
    /// The API that wgpu uses.
    #[arg(long, default_value = "vulkan")]
    pub api: Api,
    /// Whether ash runs under the validation layer, whose messages are errors.
    #[arg(long)]
    pub validate: bool,
    /// The first seed.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// How many seeds.
    #[arg(long, default_value_t = 0)]
    pub count: u64,
    /// A kept program to try instead.
    #[arg(long)]
    pub kept: Option<PathBuf>,
    /// A fault to plant into the text that is run.
    #[arg(long)]
    pub plant: Option<Fault>,
    /// An existing folder for the file of lines.
    #[arg(long)]
    pub out: PathBuf,
}

/// `FROM=>TO`: the first occurrence of a text is another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    from: String,
    to: String,
}

impl std::str::FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once("=>") {
            Some((from, to)) if !from.is_empty() => Ok(Self {
                from: from.to_owned(),
                to: to.to_owned(),
            }),
            _ => Err("as in FROM=>TO".to_owned()),
        }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}=>{}", self.from, self.to)
    }
}

impl Job {
    /// The job as arguments of the hidden command.
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let name = |value: Option<clap::builder::PossibleValue>| {
            value.map_or_else(OsString::new, |value| value.get_name().into())
        };
        let mut arguments: Vec<OsString> = vec![
            "--backend".into(),
            name(self.backend.to_possible_value()),
            "--api".into(),
            name(self.api.to_possible_value()),
            "--seed".into(),
            self.seed.to_string().into(),
            "--count".into(),
            self.count.to_string().into(),
            "--out".into(),
            (&self.out).into(),
        ];
        if let Some(kept) = &self.kept {
            arguments.extend(["--kept".into(), kept.into()]);
        }
        if let Some(plant) = &self.plant {
            arguments.extend(["--plant".into(), plant.to_string().into()]);
        }
        if self.validate {
            arguments.push("--validate".into());
        }
        arguments
    }
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "line", rename_all = "kebab-case")]
pub(super) enum Line {
    /// There is a device.
    Device(Device),
    /// There is none.
    NoDevice {
        /// What the backend says.
        reason: String,
    },
    /// A program is about to run.
    Started {
        /// Its seed.
        seed: u64,
    },
    /// It did what it should.
    Agreed {
        /// Its seed.
        seed: u64,
    },
    /// It computes something that WGSL leaves open or that naga gets wrong, and
    /// was left out.
    Open {
        /// Its seed.
        seed: u64,
    },
    /// It did something else, and has what this driver is known to do otherwise.
    Known {
        /// Its seed.
        seed: u64,
    },
    /// It did something else.
    Failed(Failure),
}

/// A program that does not do what it should.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Failure {
    /// Its seed.
    pub seed: u64,
    /// What it does: the first words that differ, or an error.
    pub reasons: Vec<String>,
    /// The program that is left of it, as a kept file.
    pub text: String,
    /// Statements of that.
    pub statements: usize,
    /// The whole program.
    pub whole: String,
    /// Programs tried to make it smaller.
    pub tried: usize,
}

/// Why lines cannot be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LinesError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line is none.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: serde_json::Error,
    },
    /// A kept program is none.
    #[error("{}: {reason}", path.display())]
    Kept {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
}

impl Line {
    /// The lines that a job wrote to its folder; a last one that was cut off
    /// does not count.
    ///
    /// # Errors
    /// If there is no file, or a whole line is broken.
    pub(super) fn read(folder: &Path) -> Result<Vec<Self>, LinesError> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| LinesError::Io {
            path: path.clone(),
            source,
        })?;
        text.split_inclusive('\n')
            .filter(|line| line.ends_with('\n'))
            .map(|line| {
                serde_json::from_str(line).map_err(|source| LinesError::Json {
                    path: path.clone(),
                    source,
                })
            })
            .collect()
    }
}

/// The file of lines being written.
struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    fn new(folder: &Path) -> Result<Self, LinesError> {
        let path = folder.join(FILE);
        match File::create(&path) {
            Ok(file) => Ok(Self { path, file }),
            Err(source) => Err(LinesError::Io { path, source }),
        }
    }

    fn write(&mut self, line: &Line) -> Result<(), LinesError> {
        let mut text = serde_json::to_string(line).map_err(|source| LinesError::Json {
            path: self.path.clone(),
            source,
        })?;
        text.push('\n');
        self.file
            .write_all(text.as_bytes())
            .map_err(|source| LinesError::Io {
                path: self.path.clone(),
                source,
            })
    }
}

/// What went wrong with a trial.
#[derive(Clone, Debug, PartialEq)]
enum Mistake {
    Differs(Vec<String>),
    /// Not accepted before it ran.
    Refused(String),
    Failed(String),
}

impl Mistake {
    /// Whether another is of the same kind: shrinking is not to wander off to
    /// programs that are not accepted.
    fn is_like(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    fn reasons(self) -> Vec<String> {
        match self {
            Self::Differs(words) => words,
            Self::Refused(reason) | Self::Failed(reason) => vec![reason],
        }
    }
}

/// An executor with its device.
struct Bench {
    job: Job,
    backend: Box<dyn Backend>,
    /// With the interpreter: every way it can run a program.
    interpreters: Option<Interpreters>,
}

impl Bench {
    fn open(job: &Job) -> Result<Self, BackendError> {
        let backend = open(job.backend, job.api, 0, job.validate)?;
        let interpreters = match job.backend {
            BackendKind::Cpu => {
                Some(Interpreters::new().map_err(|error| BackendError::NoDevice {
                    backend: "cpu",
                    reason: error.to_string(),
                })?)
            }
            _ => None,
        };
        Ok(Self {
            job: job.clone(),
            backend,
            interpreters,
        })
    }

    /// What a trial does wrong. `bound` says whether results are to be those
    /// expected; otherwise the interpreter's ways have to agree.
    fn mistake(&mut self, trial: &Trial, bound: bool) -> Option<Mistake> {
        let mut trial = trial.clone();
        if let Some(Fault { from, to }) = &self.job.plant {
            trial.wgsl = trial.wgsl.replacen(from, to, 1);
        }
        let found = match run_trial(&mut *self.backend, &trial) {
            Ok(found) => found,
            Err(
                error @ (ExecuteError::Kernel(_) | ExecuteError::Plan(_) | ExecuteError::Graph(_)),
            ) => return Some(Mistake::Refused(error.to_string())),
            Err(error) => {
                // The device may be lost; the next program gets another.
                let Job {
                    backend,
                    api,
                    validate,
                    ..
                } = self.job;
                if let Ok(backend) = open(backend, api, 0, validate) {
                    self.backend = backend;
                }
                return Some(Mistake::Failed(error.to_string()));
            }
        };
        if !bound {
            trial.expected.clone_from(&found);
        }
        let held = match self.interpreters {
            Some(_) => Held::Bits,
            None => Held::Wgsl,
        };
        /// Enough to see a pattern.
        const SHOWN: usize = 8;
        let mut words: Vec<String> = differences(&trial, &found, held)
            .iter()
            .take(SHOWN)
            .map(ToString::to_string)
            .collect();
        match self.interpreters.as_ref().map(|all| all.run(&trial)) {
            Some(Err(reason)) => return Some(Mistake::Failed(reason)),
            Some(Ok(all)) => {
                for (name, found) in all {
                    let differing = differences(&trial, &found, held);
                    words.extend(
                        differing
                            .iter()
                            .take(1)
                            .map(|word| format!("{name}: {word}")),
                    );
                }
            }
            None => {}
        }
        (!words.is_empty()).then_some(Mistake::Differs(words))
    }

    /// Tries the program of a seed.
    fn try_seed(&mut self, seed: u64) -> Line {
        let (program, evaluation) = of_seed(seed);
        // The interpreter keeps subnormal numbers, and is held to it.
        let own = self.interpreters.is_some();
        let spared = |program: &Program, evaluation: &Evaluation| {
            !own && !binds_devices(program, evaluation)
        };
        if spared(&program, &evaluation) {
            return Line::Open { seed };
        }
        let driver = self.backend.info().driver;
        let excused = |program: &Program, evaluation: &Evaluation, mistake: &Mistake| {
            let differs = matches!(mistake, Mistake::Differs(_));
            !own && differs && may_differ(program, evaluation, &driver)
        };
        let trial = Trial::new(&program, &evaluation.results);
        let Some(mistake) = self.mistake(&trial, !evaluation.open.unspecified) else {
            return Line::Agreed { seed };
        };
        if excused(&program, &evaluation, &mistake) {
            return Line::Known { seed };
        }
        let fails = |less: &Program| {
            let Ok(evaluation) = evaluate(less, STEPS) else {
                return false;
            };
            if spared(less, &evaluation) {
                return false;
            }
            let trial = Trial::new(less, &evaluation.results);
            self.mistake(&trial, !evaluation.open.unspecified)
                .is_some_and(|other| mistake.is_like(&other) && !excused(less, &evaluation, &other))
        };
        let less = shrink(&program, TRIES, fails);
        let left = evaluate(&less.program, STEPS)
            .ok()
            .map(|evaluation| Trial::new(&less.program, &evaluation.results))
            .unwrap_or_else(|| trial.clone());
        let bound = !evaluation.open.unspecified;
        let reasons = self.mistake(&left, bound).unwrap_or(mistake).reasons();
        Line::Failed(Failure {
            seed,
            reasons,
            text: left.to_string(),
            statements: statements(&less.program),
            whole: trial.to_string(),
            tried: less.tried,
        })
    }
}

/// Runs the job.
///
/// # Errors
/// If its lines cannot be written, or a kept program not be read; what goes
/// wrong with programs is in the lines.
pub fn execute(job: &Job) -> Result<(), LinesError> {
    let mut journal = Journal::new(&job.out)?;
    let mut bench = match Bench::open(job) {
        Ok(bench) => bench,
        Err(error) => {
            let reason = error.to_string();
            return journal.write(&Line::NoDevice { reason });
        }
    };
    journal.write(&Line::Device(bench.backend.info().into()))?;
    if let Some(path) = &job.kept {
        let text = std::fs::read_to_string(path).map_err(|source| LinesError::Io {
            path: path.clone(),
            source,
        })?;
        let trial: Trial = text.parse().map_err(|error| LinesError::Kept {
            path: path.clone(),
            reason: format!("{error}"),
        })?;
        // Whoever asks wants to know whether this survives.
        let _ = bench.mistake(&trial, true);
        return Ok(());
    }
    for seed in (job.seed..).take(usize::try_from(job.count).unwrap_or(usize::MAX)) {
        journal.write(&Line::Started { seed })?;
        let line = bench.try_seed(seed);
        journal.write(&line)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_cut_off_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::new(folder.path()).unwrap();
        let lines = [Line::Started { seed: 3 }, Line::Agreed { seed: 3 }];
        for line in &lines {
            journal.write(line).unwrap();
        }
        journal.file.write_all(br#"{"line":"star"#).unwrap();
        assert_eq!(Line::read(folder.path()).unwrap(), lines);
        journal.file.write_all(b"\n").unwrap();
        assert!(Line::read(folder.path()).is_err());
    }

    #[test]
    fn faults_are_read_as_they_are_written() {
        let fault: Fault = "a + b=>a - b".parse().unwrap();
        assert_eq!(fault.to_string(), "a + b=>a - b");
        assert!("=>b".parse::<Fault>().is_err() && "ab".parse::<Fault>().is_err());
    }
}

//! The interpreter and a Vulkan driver side by side.
//!
//! Every kernel is run on all executors one after the other, round by round,
//! so that what else a machine does meets all of them. What is compared are
//! the two times of one round: the ratio's median is over rounds.

use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::backend::{Backend, BackendError, Execution};
use etalon_core::kernel::Arithmetic;
use etalon_cpu::{CpuBackend, CpuOptions, Tier};
use serde::Serialize;
use thiserror::Error;

use crate::clock::{Moment, median};
use crate::subjects::{Size, Subject, SubjectError, Targets, frame};
use crate::work::Work;

/// Why nothing was measured.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// There is nothing to measure.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// An executor cannot be had, or fails.
    #[error("{executor}: {source}")]
    Backend {
        /// Which.
        executor: String,
        /// Why.
        source: BackendError,
    },
    /// An executor does not say how long its steps take.
    #[error("{executor} gave {given} times for {wanted} dispatches")]
    NoTimes {
        /// Which.
        executor: String,
        /// How many times it gave.
        given: usize,
        /// How many were wanted.
        wanted: usize,
    },
}

/// What to measure, and how long.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Size of the picture.
    pub size: Size,
    /// Effects and small kernels.
    pub subjects: Vec<Subject>,
    /// Kernels whose path contains this; all if empty.
    pub kernel: String,
    /// Which arithmetics.
    pub arithmetics: Vec<Arithmetic>,
    /// Tiers of the interpreter.
    pub tiers: Vec<Tier>,
    /// Part of the name of the Vulkan device; none to leave it out.
    pub device: Option<String>,
    /// Rounds, at least 1.
    pub rounds: usize,
    /// Threads of the interpreter; 0 for as many as there are processors.
    pub threads: usize,
    /// Milliseconds that one executor is to run a kernel in each round.
    pub span: f64,
}

/// Milliseconds for one execution of a kernel's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// On the wall, by the device's own clock.
    pub wall: f64,
    /// Of all processors together.
    pub processor: f64,
}

/// What one executor took for one kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Column {
    /// The executor.
    pub executor: String,
    /// Round by round.
    pub rounds: Vec<Times>,
}

impl Column {
    /// Medians over rounds.
    #[must_use]
    pub fn median(&self) -> Times {
        let of = |get: fn(&Times) -> f64| median(&self.rounds.iter().map(get).collect::<Vec<_>>());
        Times {
            wall: of(|times| times.wall),
            processor: of(|times| times.processor),
        }
    }

    /// Medians of the ratios to another column, round by round.
    #[must_use]
    pub fn ratio(&self, other: &Self) -> Times {
        Times {
            wall: median(&self.ratios(other, |times| times.wall)),
            processor: median(&self.ratios(other, |times| times.processor)),
        }
    }

    /// How much the ratios to another column differ between rounds: the
    /// largest over the smallest.
    #[must_use]
    pub fn spread(&self, other: &Self) -> Times {
        let of = |get| {
            let ratios = self.ratios(other, get);
            let largest = ratios.iter().copied().fold(0.0, f64::max);
            let smallest = ratios.iter().copied().fold(f64::INFINITY, f64::min);
            largest / smallest
        };
        Times {
            wall: of(|times| times.wall),
            processor: of(|times| times.processor),
        }
    }

    fn ratios(&self, other: &Self, get: fn(&Times) -> f64) -> Vec<f64> {
        let pairs = self.rounds.iter().zip(&other.rounds);
        pairs.map(|(a, b)| get(a) / get(b)).collect()
    }
}

/// What was measured of one kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The effect, or the small kernel's name.
    pub subject: String,
    /// The kernel's path.
    pub kernel: String,
    /// Number of dispatches of it in the effect.
    pub dispatches: usize,
    /// Arithmetic.
    pub arithmetic: Arithmetic,
    /// What is aimed at.
    pub targets: Targets,
    /// How often the work was repeated in each execution.
    pub repetitions: usize,
    /// By executor: the Vulkan device first, if there is one.
    pub columns: Vec<Column>,
}

/// An executor under measurement.
struct Executor {
    name: String,
    backend: Box<dyn Backend>,
}

impl Executor {
    fn fail(&self) -> impl Fn(BackendError) -> CompareError + use<> {
        let executor = self.name.clone();
        move |source| CompareError::Backend {
            executor: executor.clone(),
            source,
        }
    }

    fn execute(&mut self, work: &Work, times: usize) -> Result<Execution, CompareError> {
        let plan = work.repeated(times);
        let fail = self.fail();
        self.backend.execute(&plan, &work.inputs()).map_err(fail)
    }

    /// Median milliseconds of the repetitions of an execution.
    fn wall(&self, work: &Work, execution: &Execution, times: usize) -> Result<f64, CompareError> {
        let steps = work.steps.len();
        if execution.times.len() != steps * times {
            return Err(CompareError::NoTimes {
                executor: self.name.clone(),
                given: execution.times.len(),
                wanted: steps * times,
            });
        }
        let repetitions: Vec<f64> = execution
            .times
            .chunks_exact(steps)
            .map(|steps| {
                let nanoseconds: u64 = steps.iter().map(|step| step.nanoseconds).sum();
                nanoseconds as f64 * 1e-6
            })
            .collect();
        Ok(median(&repetitions))
    }

    /// One round: the empty execution first, whose processor time is that of
    /// uploading, then the one with the work.
    fn round(&mut self, work: &Work, times: usize) -> Result<Times, CompareError> {
        let plans = [work.repeated(0), work.repeated(times)];
        let inputs = work.inputs();
        let mut processor = [0.0; 2];
        let mut execution = Execution::default();
        for (plan, processor) in plans.iter().zip(&mut processor) {
            let fail = self.fail();
            let start = Moment::now();
            execution = self.backend.execute(plan, &inputs).map_err(fail)?;
            *processor = start.elapsed().processor;
        }
        Ok(Times {
            wall: self.wall(work, &execution, times)?,
            processor: (processor[1] - processor[0]).max(0.0) * 1e3 / times as f64,
        })
    }
}

/// An interpreter of a tier.
///
/// # Errors
/// If the system gives no threads.
pub fn interpreter(tier: Option<Tier>, threads: usize) -> Result<CpuBackend, BackendError> {
    CpuBackend::new(&CpuOptions {
        tier,
        threads,
        ..CpuOptions::default()
    })
}

/// Measures all kernels; `done` is told of each as it is measured. Returns the
/// names of the executors.
///
/// # Errors
/// A [`CompareError`] at the first thing that fails.
pub fn compare(settings: &Settings, mut done: impl FnMut(&Row)) -> Result<Vec<Row>, CompareError> {
    let of_cpu = |source| CompareError::Backend {
        executor: "cpu".to_owned(),
        source,
    };
    let mut executors = Vec::new();
    if let Some(device) = &settings.device {
        let backend = AshBackend::new(AshOptions {
            device: Some(device.clone()),
            validation: Validation::Off,
            plans_kept: 3,
            ..AshOptions::default()
        })
        .map_err(|source| CompareError::Backend {
            executor: device.clone(),
            source,
        })?;
        executors.push(Executor {
            name: backend.info().device,
            backend: Box::new(backend),
        });
    }
    for &tier in &settings.tiers {
        executors.push(Executor {
            name: tier.to_string(),
            backend: Box::new(interpreter(Some(tier), settings.threads).map_err(of_cpu)?),
        });
    }
    let mut prober = interpreter(None, settings.threads).map_err(of_cpu)?;
    let frame = frame(settings.size)?;
    let mut rows = Vec::new();
    for &arithmetic in &settings.arithmetics {
        for subject in settings
            .subjects
            .iter()
            .filter(|subject| subject.has(arithmetic))
        {
            for work in subject.works(&frame, arithmetic, &mut prober)? {
                if !work.kernel.contains(&settings.kernel) {
                    continue;
                }
                let row = measure(&work, subject, arithmetic, settings, &mut executors)?;
                done(&row);
                rows.push(row);
            }
        }
    }
    Ok(rows)
}

fn measure(
    work: &Work,
    subject: &Subject,
    arithmetic: Arithmetic,
    settings: &Settings,
    executors: &mut [Executor],
) -> Result<Row, CompareError> {
    // Twice: drivers compile a kernel when it first runs.
    let mut slowest = 0.0_f64;
    for executor in executors.iter_mut() {
        executor.execute(work, 1)?;
        let execution = executor.execute(work, 1)?;
        slowest = slowest.max(executor.wall(work, &execution, 1)?);
    }
    let repetitions = (settings.span / slowest.max(1e-3)).ceil().clamp(1.0, 100.0) as usize;
    for executor in executors.iter_mut() {
        executor.execute(work, repetitions)?;
    }
    let mut columns: Vec<Column> = executors
        .iter()
        .map(|executor| Column {
            executor: executor.name.clone(),
            rounds: Vec::with_capacity(settings.rounds),
        })
        .collect();
    for round in 0..settings.rounds {
        for turn in 0..executors.len() {
            // Another one begins each time.
            let index = (round + turn) % executors.len();
            let times = executors[index].round(work, repetitions)?;
            columns[index].rounds.push(times);
        }
    }
    Ok(Row {
        subject: subject.name.to_owned(),
        kernel: work.kernel.clone(),
        dispatches: work.steps.len(),
        arithmetic,
        targets: subject.targets,
        repetitions,
        columns,
    })
}

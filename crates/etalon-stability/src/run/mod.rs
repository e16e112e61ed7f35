//! Running everything.

mod conclude;
mod pair;
mod table;

use etalon_core::backend::BackendError;
use etalon_scenes::cases::case;
use thiserror::Error;

use crate::exceptions::{BadLine, Exception, exceptions};
use crate::executors::{Executor, Kind};
use crate::functions;
use crate::knobs;
use crate::model::{ExecutorInfo, Report};
use crate::plant::Plant;
use crate::sanitise::{AllowError, Watch};
use crate::scene::Effect;
use crate::subject::{Frames, Subject, SubjectError, subjects};
pub(crate) use conclude::conclusions;
use pair::Pair;
pub use table::TableError;
use table::table_of_mirroring;

/// Default of [`Options::followed`].
pub const FOLLOWED: usize = 2048;

/// What is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names of cases, or parts of names; all without one.
    pub cases: Vec<String>,
    /// Names of effects, or `lib` for the functions of kernels by themselves; all without
    /// one.
    pub effects: Vec<String>,
    /// Who runs them. Devices are compared with [`Kind::Cpu`], and [`Kind::Double`]
    /// with [`Kind::Shadow`], where those are among them.
    pub executors: Vec<Kind>,
    /// Most texels of a case's frame; larger cases are left out. All are run
    /// without it.
    pub largest: Option<usize>,
    /// Kernels in place of those built in: see [`kernels`](crate::kernels).
    pub kernels: Vec<(String, String)>,
    /// Most texels of a frame that the sanitiser and perturbed executions are run on:
    /// they take far longer than the others.
    pub followed: usize,
    /// A fault to be found.
    pub plant: Option<Plant>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            cases: Vec::new(),
            effects: Vec::new(),
            executors: Kind::ALL.to_vec(),
            largest: None,
            followed: FOLLOWED,
            kernels: Vec::new(),
            plant: None,
        }
    }
}

impl Options {
    /// Whether an effect is among those asked for.
    fn asks_for(&self, effect: &str) -> bool {
        self.effects.is_empty() || self.effects.iter().any(|name| name == effect)
    }
}

/// Who is told how far it got.
pub trait Progress {
    /// So many cases with an effect are to come.
    fn begin(&mut self, _pairs: usize) {}
    /// One is next.
    fn next(&mut self, _case: &str, _effect: &str) {}
}

impl Progress for () {}

/// Why there is no report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RunError {
    /// No effect of that name.
    #[error("there is no effect `{name}`; there are {}, and lib", Effect::names().collect::<Vec<_>>().join(", "))]
    NoEffect {
        /// As given.
        name: String,
    },
    /// No case with that in its name.
    #[error("no case has `{name}` in its name")]
    NoCase {
        /// As given.
        name: String,
    },
    /// A case has no frames.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// A comment in a kernel that is for the sanitiser cannot be understood.
    #[error(transparent)]
    Allow(#[from] AllowError),
    /// A line of the table of exceptions cannot be understood.
    #[error(transparent)]
    Exception(#[from] BadLine),
    /// What all cases that are lit share cannot be made.
    #[error("the table of what surfaces mirror cannot be made: {0}")]
    Table(#[from] TableError),
    /// An executor that `ETALON_REQUIRE` names is not there.
    #[error("{name} is required: {source}")]
    Required {
        /// The executor.
        name: &'static str,
        /// Why it is not there.
        source: BackendError,
    },
}

/// Runs the cases on the effects and executors asked for.
///
/// # Errors
/// If there is no such case or effect, a case cannot be made, or a backend that the
/// variable `ETALON_REQUIRE` lists is not there; what goes wrong in an execution is
/// in the report.
pub fn run(options: &Options, progress: &mut dyn Progress) -> Result<Report, RunError> {
    let chosen = choose(options)?;
    let mut report = Report::default();
    let mut executors = open(&options.executors, &mut report)?;
    let mut watch = Watch::new()?;
    let exceptions = exceptions()?;
    let mut kernels = etalon_effects::kernels();
    for (path, text) in &options.kernels {
        kernels.add_source(path, text);
    }
    let lit = |(subject, _): &(Subject, Vec<Effect>)| matches!(subject.frames, Frames::Stage(_));
    let mirroring = match chosen.iter().any(lit) {
        true => table_of_mirroring(&kernels)?,
        false => None,
    };
    progress.begin(chosen.iter().map(|(_, effects)| effects.len()).sum());
    for (subject, effects) in &chosen {
        let mut scenes = subject.scenes()?;
        if let Some(table) = &mirroring {
            scenes
                .iter_mut()
                .for_each(|scene| scene.give_mirroring(table));
        }
        let pixels = scenes.first().map_or(0, |scene| scene.size().pixels());
        if options.largest.is_some_and(|largest| pixels > largest) {
            continue;
        }
        for effect in effects {
            progress.next(&subject.name, effect.name());
            let pair = Pair {
                subject,
                effect,
                scenes: &scenes,
                kernels: &kernels,
                exceptions: &exceptions,
                plant: options.plant,
                followed: pixels <= options.followed,
            };
            report.cases.push(pair.run(&mut executors, &mut watch));
        }
    }
    if options.cases.is_empty() && options.asks_for(functions::LIBRARY) {
        let functions = functions::run(&mut executors, &mut watch, &options.kernels);
        report.cases.extend(functions);
    }
    // Values that are not allowed cost no execution: they are tried whenever no
    // particular case was asked for.
    if options.cases.is_empty()
        && let Some(frames) = case(knobs::FRAMES)
    {
        report.refusals = knobs::refusals(frames);
        report
            .refusals
            .retain(|refusal| options.asks_for(&refusal.effect));
    }
    report.notes.extend(not_needed(&exceptions, &report));
    let (found, unused) = watch.finish();
    for found in found {
        report.sites.push(found.finding);
        report.maps.push(found.map);
    }
    // Of a part of the corpus nothing can be said of what is not found.
    let whole = options.cases.is_empty() && options.effects.is_empty() && options.largest.is_none();
    if whole && options.executors.contains(&Kind::Sanitiser) {
        report.unused = unused;
    }
    report.count();
    Ok(report)
}

/// Exceptions about a device that was there and a case that was run, for which nothing is
/// excused.
fn not_needed(exceptions: &[Exception], report: &Report) -> Vec<String> {
    let devices = |one: &Exception| {
        let mut executors = report.executors.iter();
        executors.any(|executor| executor.device.contains(&one.device))
    };
    let idle = |one: &Exception| {
        let mut cases = report.cases.iter();
        cases.any(|case| {
            case.name == one.case && case.effect == one.effect && case.excused.is_empty()
        })
    };
    let found = exceptions.iter().filter(|one| devices(one) && idle(one));
    found
        .map(|one| {
            format!(
                "exceptions.txt: {} on {} by {} is not needed",
                one.effect, one.case, one.device
            )
        })
        .collect()
}

/// The cases asked for with their effects.
fn choose(options: &Options) -> Result<Vec<(Subject, Vec<Effect>)>, RunError> {
    for name in &options.effects {
        if !Effect::names().any(|known| known == name) && name != functions::LIBRARY {
            return Err(RunError::NoEffect { name: name.clone() });
        }
    }
    let all = subjects()?;
    for part in &options.cases {
        if !all.iter().any(|subject| subject.name.contains(part)) {
            return Err(RunError::NoCase { name: part.clone() });
        }
    }
    let named = |part: &String, subject: &Subject| {
        // A whole name is that case alone, and not those whose names begin with it.
        if all.iter().any(|subject| subject.name == *part) {
            subject.name == *part
        } else {
            subject.name.contains(part)
        }
    };
    let wanted: Vec<bool> = all
        .iter()
        .map(|subject| {
            options.cases.is_empty() || options.cases.iter().any(|part| named(part, subject))
        })
        .collect();
    Ok(all
        .into_iter()
        .zip(wanted)
        .filter_map(|(subject, wanted)| wanted.then_some(subject))
        .map(|subject| {
            let effects = subject
                .effects
                .iter()
                .copied()
                .filter(|effect| options.asks_for(effect.name()));
            let effects = effects.collect();
            (subject, effects)
        })
        .collect())
}

/// Opens the executors asked for, in the order they need each other's results in.
fn open(asked: &[Kind], report: &mut Report) -> Result<Vec<Executor>, RunError> {
    let mut executors = Vec::new();
    for kind in Kind::ALL.into_iter().filter(|kind| asked.contains(kind)) {
        match Executor::open(kind) {
            Ok(executor) => {
                let info = executor.info();
                report.executors.push(ExecutorInfo {
                    name: kind.to_string(),
                    api: info.api,
                    device: info.device,
                    driver: info.driver,
                });
                executors.push(executor);
            }
            Err(source) if required(kind.name()) => {
                return Err(RunError::Required {
                    name: kind.name(),
                    source,
                });
            }
            Err(error) => report.notes.push(format!("without {kind}: {error}")),
        }
    }
    Ok(executors)
}

/// The variable that names backends which have to be there.
pub(crate) const REQUIRED: &str = "ETALON_REQUIRE";

/// Whether `ETALON_REQUIRE`, a list with commas, names a backend.
pub(crate) fn required(backend: &str) -> bool {
    std::env::var(REQUIRED).is_ok_and(|list| list.split(',').any(|name| name.trim() == backend))
}

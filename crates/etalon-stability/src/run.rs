//! Running everything.

use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::graph::Graph;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_core::resource::Limits;
use etalon_cpu::StepSanitised;
use etalon_effects::knob::KnobValue;
use etalon_effects::ssr::Ssr;
use etalon_effects::{EffectEntry, EffectError, effect, effects};
use etalon_scenes::cases::{Step, case};
use thiserror::Error;

use crate::executors::{Executor, Kind};
use crate::judge::spread::{PERTURBATIONS, Spread};
use crate::judge::{agreement, finite, recovery, rounding};
use crate::knobs;
use crate::model::{
    CaseReport, ExecutorInfo, ExecutorResult, ExpectedError, Finding, FindingKind, Report, Status,
    Totals,
};
use crate::observe::{ObserveError, Store};
use crate::plant::Plant;
use crate::sanitise::{AllowError, Counts, Watch};
use crate::subject::{Subject, SubjectError, subjects};

/// Default of [`Options::followed`].
pub const FOLLOWED: usize = 2048;

/// What is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Parts of the names of cases; all without one.
    pub cases: Vec<String>,
    /// Names of effects; all without one.
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
    #[error("there is no effect `{name}`; there are {}", effects().iter().map(|effect| effect.name).collect::<Vec<_>>().join(", "))]
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
    /// An executor that `ETALON_REQUIRE` names is not there.
    #[error("{name} is required: {source}")]
    Required {
        /// The executor.
        name: &'static str,
        /// Why it is not there.
        source: BackendError,
    },
}

/// Why an executor has nothing to show.
#[derive(Debug, Error)]
enum ExecuteError {
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error("{0}")]
    Lacking(PlanError),
    #[error(transparent)]
    Observe(#[from] ObserveError),
}

impl ExecuteError {
    fn status(&self) -> Status {
        let reason = self.to_string();
        match self {
            Self::Lacking(_)
            | Self::Observe(ObserveError::Backend(
                BackendError::Unsupported { .. } | BackendError::Lacking { .. },
            )) => Status::Unsupported { reason },
            _ => Status::Failed { reason },
        }
    }
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
    let mut kernels = KernelLibrary::new();
    for (path, text) in &options.kernels {
        kernels.add_source(path, text);
    }
    progress.begin(chosen.iter().map(|(_, effects)| effects.len()).sum());
    let mut named = std::collections::BTreeSet::new();
    for (subject, effects) in &chosen {
        let steps = subject.steps()?;
        let pixels = steps.first().map_or(0, |step| step.frame.size().pixels());
        if options.largest.is_some_and(|largest| pixels > largest) {
            continue;
        }
        for &effect in effects {
            progress.next(&subject.name, effect.name);
            named.insert(&subject.name);
            let pair = Pair {
                subject,
                effect,
                steps: &steps,
                kernels: &kernels,
                plant: options.plant,
                followed: pixels <= options.followed,
            };
            report.cases.push(pair.run(&mut executors, &mut watch));
        }
    }
    // Values that are not allowed cost no execution: they are tried whenever no
    // particular case was asked for.
    if options.cases.is_empty()
        && let Some(frames) = case(knobs::FRAMES)
    {
        let wanted =
            |effect: &String| options.effects.is_empty() || options.effects.contains(effect);
        report.refusals = knobs::refusals(frames);
        report.refusals.retain(|refusal| wanted(&refusal.effect));
    }
    let (found, unused) = watch.finish();
    for found in found {
        report.sites.push(found.finding);
        report.maps.push(found.map);
    }
    // Of a part of the corpus nothing can be said of what is not found.
    if options.cases.is_empty() && options.effects.is_empty() && options.largest.is_none() {
        report.unused = unused;
    }
    report.totals = Totals {
        cases: named.len(),
        pairs: report.cases.len(),
        executions: report
            .cases
            .iter()
            .flat_map(|case| &case.results)
            .map(|result| result.executions)
            .sum(),
        refusals: report.refusals.len(),
        findings: report.findings().count() + report.accepted().count(),
    };
    Ok(report)
}

/// The cases asked for with their effects.
fn choose(options: &Options) -> Result<Vec<(Subject, Vec<&'static EffectEntry>)>, RunError> {
    for name in &options.effects {
        if effect(name).is_none() {
            return Err(RunError::NoEffect { name: name.clone() });
        }
    }
    let all = subjects()?;
    for part in &options.cases {
        if !all.iter().any(|subject| subject.name.contains(part)) {
            return Err(RunError::NoCase { name: part.clone() });
        }
    }
    let wanted = |subject: &Subject| {
        options.cases.is_empty() || options.cases.iter().any(|part| subject.name.contains(part))
    };
    Ok(all
        .into_iter()
        .filter(wanted)
        .map(|subject| {
            let effects = subject.effects.iter().copied().filter(|effect| {
                options.effects.is_empty() || options.effects.iter().any(|name| name == effect.name)
            });
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

/// Whether `ETALON_REQUIRE`, a list with commas, names a backend.
fn required(backend: &str) -> bool {
    std::env::var("ETALON_REQUIRE")
        .is_ok_and(|list| list.split(',').any(|name| name.trim() == backend))
}

/// A case and an effect.
struct Pair<'a> {
    subject: &'a Subject,
    effect: &'static EffectEntry,
    steps: &'a [Step],
    kernels: &'a KernelLibrary,
    plant: Option<Plant>,
    /// Whether the frame is small enough for [`Kind::is_costly`].
    followed: bool,
}

/// What all frames of a case stored.
type Frames = Vec<Vec<Store>>;

/// What later executors are held to.
#[derive(Default)]
struct Kept {
    /// What the interpreter stored.
    reference: Frames,
    /// What it stored in `f64`, in each arithmetic.
    double: Vec<(Arithmetic, Frames)>,
    /// How far perturbed executions are from each other in fast arithmetic, by frame.
    spread: Vec<Spread>,
}

impl Kept {
    /// What was stored in `f64`.
    fn double(&self, arithmetic: Arithmetic) -> Option<&Frames> {
        let mut known = self.double.iter();
        known.find_map(|(known, frames)| (*known == arithmetic).then_some(frames))
    }
}

impl Pair<'_> {
    fn run(&self, executors: &mut [Executor], watch: &mut Watch) -> CaseReport {
        let Self {
            subject, effect, ..
        } = self;
        let expected = subject
            .expected
            .iter()
            .find(|known| known.effect == effect.name);
        let size = self.steps.first().map_or([0, 0], |step| {
            [step.frame.size().width(), step.frame.size().height()]
        });
        let mut report = CaseReport {
            name: subject.name.clone(),
            family: subject.family.to_owned(),
            effect: effect.name.to_owned(),
            reason: subject.reason.clone(),
            source: subject.source.clone(),
            size,
            frames: self.steps.len(),
            knobs: subject
                .knobs
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.to_string()))
                .collect::<BTreeMap<_, _>>(),
            expected: expected.map(|expected| ExpectedError {
                bound: expected.bound,
                reason: expected.reason.to_owned(),
            }),
            ..CaseReport::default()
        };
        let mut kept = Kept::default();
        for executor in executors {
            if executor.kind.is_costly() && !self.followed {
                continue;
            }
            let result = self.on(executor, watch, &mut kept, &mut report.findings);
            report.results.push(result);
        }
        report
    }

    /// Runs it on one executor, and keeps what others are held to.
    fn on(
        &self,
        executor: &mut Executor,
        watch: &mut Watch,
        kept: &mut Kept,
        findings: &mut Vec<Finding>,
    ) -> ExecutorResult {
        let kind = executor.kind;
        let mut result = ExecutorResult {
            executor: kind.to_string(),
            ..ExecutorResult::default()
        };
        let mut errors = rounding::Gathering::new(
            self.expected(),
            self.subject
                .knobs
                .contains(&("metering", KnobValue::Choice("arithmetic"))),
        );
        for &arithmetic in kind.arithmetics() {
            let mut frames = match self.execute(executor, self.steps, arithmetic, &mut result) {
                Ok(frames) => frames,
                Err(error) => {
                    result.status = error.status();
                    break;
                }
            };
            if let (Some(plant), Some(first)) = (self.plant, frames.first_mut())
                && plant.executor == kind
            {
                plant.fault.strike(first);
            }
            for (number, stores) in frames.iter().enumerate() {
                result.stores += stores.len();
                finite::look(number, stores, &mut result.non_finite);
            }
            match kind {
                Kind::Cpu => {
                    if let Some(finding) = self.recovery(executor, &frames) {
                        findings.push(finding);
                    }
                    result.digest = Some(digest(&frames));
                    kept.reference = frames;
                }
                Kind::Double => kept.double.push((arithmetic, frames)),
                Kind::Shadow => {
                    let double = kept.double(arithmetic);
                    for (number, stores) in frames.iter().enumerate() {
                        let double = double.and_then(|frames| frames.get(number));
                        let double = double.map_or(&[][..], Vec::as_slice);
                        let strict = arithmetic == Arithmetic::Strict;
                        if let Some(step) = self.steps.get(number) {
                            let shown = rounding::Shown::of(&step.frame.colour, self.blur());
                            errors.look(number, stores, double, &shown, strict);
                        }
                    }
                }
                Kind::Sanitiser => {
                    findings.extend(executor.take_checked().into_iter().map(|found| Finding {
                        kind: FindingKind::Check,
                        executor: kind.to_string(),
                        text: found.to_string(),
                    }));
                    let steps = executor.take_sanitised();
                    let counts = result.sanitised.get_or_insert_default();
                    let case = format!("{}, {}, {arithmetic}", self.subject.name, self.effect.name);
                    findings.extend(watch.look(&case, &steps, self.expected(), counts));
                    decisions(&steps, &frames, kept.double(arithmetic), counts);
                }
                Kind::Perturbed => {
                    kept.spread = frames.iter().map(|stores| Spread::around(stores)).collect();
                    for seed in 0..PERTURBATIONS {
                        executor.perturb(Some(seed));
                        match self.execute(executor, self.steps, arithmetic, &mut result) {
                            Ok(moved) => {
                                for (spread, stores) in kept.spread.iter_mut().zip(&moved) {
                                    spread.widen(stores);
                                }
                            }
                            Err(error) => result.status = error.status(),
                        }
                    }
                    executor.perturb(None);
                    result.spread = Some(Spread::summary(&kept.spread));
                }
                Kind::Wgpu | Kind::Ash if arithmetic == Arithmetic::Strict => {
                    let pairs = kept.reference.iter().zip(&frames);
                    for (number, (reference, subject)) in pairs.enumerate() {
                        agreement::compare(number, reference, subject, &mut result.difference);
                    }
                }
                Kind::Wgpu | Kind::Ash => {
                    for (number, (spread, stores)) in kept.spread.iter().zip(&frames).enumerate() {
                        spread.compare(number, stores, &mut result.outside);
                    }
                }
            }
        }
        if kind == Kind::Shadow {
            result.rounding = errors.finish();
        }
        findings.extend(conclusions(&result));
        result
    }

    /// The error that the case declares for the effect.
    fn expected(&self) -> Option<f64> {
        let declared = self.subject.expected.iter();
        declared
            .filter(|known| known.effect == self.effect.name)
            .map(|known| known.bound)
            .next()
    }

    /// Runs the frames in a row from a fresh history.
    fn execute(
        &self,
        executor: &mut Executor,
        steps: &[Step],
        arithmetic: Arithmetic,
        result: &mut ExecutorResult,
    ) -> Result<Frames, ExecuteError> {
        executor.reset();
        let mut frames = Vec::new();
        for step in steps {
            let graph = self.subject.graph(self.effect, step)?;
            let plan = self.plan(executor, &graph, arithmetic)?;
            // An effect that is off hands on what it was given.
            if plan.steps.is_empty() {
                frames.push(Vec::new());
                continue;
            }
            frames.push(executor.run(&plan, &step.frame.inputs())?);
            result.executions += 1;
        }
        Ok(frames)
    }

    /// Texels to either side that reflections are blurred over.
    fn blur(&self) -> u32 {
        let set = self
            .subject
            .knobs
            .iter()
            .find(|(name, _)| *name == "blur_radius");
        match set {
            Some((_, KnobValue::Count(radius))) => *radius,
            _ => Ssr::default().blur_radius,
        }
    }

    /// Plans a graph for an executor. What would be planned for a device that stores
    /// to more formats fails for want of these.
    fn plan(
        &self,
        executor: &Executor,
        graph: &Graph,
        arithmetic: Arithmetic,
    ) -> Result<Plan, ExecuteError> {
        let backend = executor.backend();
        let with = |limits| {
            let options = PlanOptions {
                arithmetic,
                limits,
                capture: Capture::EveryPass,
                memory: backend.memory(),
            };
            Plan::new(graph, self.kernels, &options)
        };
        let limits = backend.limits();
        with(limits).map_err(|error| {
            let extended_storage_formats = true;
            let more = Limits {
                extended_storage_formats,
                ..limits
            };
            if with(more).is_ok() {
                ExecuteError::Lacking(error)
            } else {
                error.into()
            }
        })
    }

    /// Holds a sequence with a fault to the same without it: the faulty frame is
    /// replaced by the one after it.
    fn recovery(&self, executor: &mut Executor, faulty: &[Vec<Store>]) -> Option<Finding> {
        let recovery = self.subject.recovery?;
        if recovery.effect != self.effect.name {
            return None;
        }
        let mut steps = self.steps.to_vec();
        let good = steps.get(recovery.poisoned + 1)?.clone();
        *steps.get_mut(recovery.poisoned)? = good;
        let mut result = ExecutorResult::default();
        let strict = Arithmetic::Strict;
        let finding = |text| Finding {
            kind: FindingKind::Recovery,
            executor: Kind::Cpu.to_string(),
            text,
        };
        let clean = match self.execute(executor, &steps, strict, &mut result) {
            Ok(clean) => clean,
            Err(error) => return Some(finding(error.to_string())),
        };
        let from = recovery.poisoned + recovery.frames;
        let pairs = faulty.iter().zip(&clean).enumerate().skip(from);
        let place = pairs
            .filter_map(|(number, (faulty, clean))| recovery::differs(number, faulty, clean))
            .next()?;
        Some(finding(format!(
            "{} frames after the fault in frame {} it still shows: {place}",
            place.frame - recovery.poisoned,
            recovery.poisoned
        )))
    }
}

/// A number for all bits stored: FNV-1a (G. Fowler, L. C. Noll and K.-P. Vo, 1991).
fn digest(frames: &Frames) -> u64 {
    let stores = frames.iter().flatten();
    let bytes = stores.flat_map(|store| {
        let image = store.image.as_ref().map_or(&[][..], |image| &image.bytes);
        image.iter().chain(store.buffer.iter().flatten())
    });
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// What decisions that are not stable do to what is stored. Steps are those of all
/// frames.
fn decisions(
    steps: &[StepSanitised],
    frames: &Frames,
    double: Option<&Frames>,
    counts: &mut Counts,
) {
    let each = (steps.len() / frames.len().max(1)).max(1);
    let pairs = frames.iter().zip(double.into_iter().flatten());
    for (steps, (single, double)) in steps.chunks(each).zip(pairs) {
        counts.compare(steps, single, double);
    }
}

/// What should not be in a result.
fn conclusions(result: &ExecutorResult) -> Vec<Finding> {
    let finding = |kind, text| Finding {
        kind,
        executor: result.executor.clone(),
        text,
    };
    let mut found = Vec::new();
    if let Status::Failed { reason } = &result.status {
        found.push(finding(FindingKind::Failure, reason.clone()));
    }
    if let Some(wrong) = &result.non_finite {
        found.push(finding(
            FindingKind::NonFinite,
            format!(
                "{} channels are no numbers, the first: {}",
                wrong.channels, wrong.first
            ),
        ));
    }
    if let Some(wrong) = &result.difference {
        found.push(finding(
            FindingKind::Disagreement,
            format!(
                "{} texels differ, the first: {}, {:e} in place of {:e}",
                wrong.texels, wrong.first, wrong.subject, wrong.reference
            ),
        ));
    }
    if let Some(wrong) = &result.outside {
        found.push(finding(
            FindingKind::Outside,
            format!(
                "{} texels are outside of what perturbed executions allow, where {} may be, the first: {}, {:e}, \
                 not within {:e} of {:e}",
                wrong.texels, wrong.tolerated, wrong.first, wrong.subject, wrong.allowed, wrong.centre
            ),
        ));
    }
    if let Some(wrong) = result.rounding.as_ref().filter(|wrong| wrong.beyond > 0) {
        found.push(finding(
            FindingKind::Rounding,
            format!(
                "{} texels are off by more than {:.2e}, the worst by {:.2e}: {}, {:e} in place of {:e}",
                wrong.beyond, wrong.allowed, wrong.max, wrong.at, wrong.stored, wrong.exact
            ),
        ));
    }
    found
}

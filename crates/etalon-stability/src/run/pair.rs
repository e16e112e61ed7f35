//! One case with one effect, on every executor in turn.

use std::collections::BTreeMap;

use etalon_core::backend::{BackendError, BackendInfo};
use etalon_core::graph::Graph;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_core::resource::Limits;
use etalon_cpu::StepSanitised;
use etalon_effects::EffectError;
use etalon_effects::knob::KnobValue;
use etalon_effects::ssr::Ssr;
use thiserror::Error;

use super::conclude::conclusions;
use crate::exceptions::Exception;
use crate::executors::{Executor, Kind};
use crate::judge::spread::{PERTURBATIONS, Spread};
use crate::judge::{agreement, drawn, finite, recovery, rounding, truth};
use crate::model::{
    CaseReport, Excused, ExecutorResult, ExpectedError, Finding, FindingKind, Status,
};
use crate::observe::{ObserveError, Store};
use crate::plant::Plant;
use crate::sanitise::{Counts, Watch};
use crate::scene::{Drawing, Effect, Scene};
use crate::subject::Subject;

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

/// A case and an effect.
pub(super) struct Pair<'a> {
    pub(super) subject: &'a Subject,
    pub(super) effect: &'a Effect,
    pub(super) scenes: &'a [Scene],
    pub(super) kernels: &'a KernelLibrary,
    pub(super) plant: Option<Plant>,
    /// What drivers are known to do otherwise.
    pub(super) exceptions: &'a [Exception],
    /// Whether the frame is small enough for [`Kind::is_costly`].
    pub(super) followed: bool,
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
    /// What a device has drawn, in each arithmetic.
    devices: Vec<(Arithmetic, Frames)>,
}

impl Kept {
    /// What was stored in `f64`.
    fn double(&self, arithmetic: Arithmetic) -> Option<&Frames> {
        let mut known = self.double.iter();
        known.find_map(|(known, frames)| (*known == arithmetic).then_some(frames))
    }
}

impl Pair<'_> {
    pub(super) fn run(&self, executors: &mut [Executor], watch: &mut Watch) -> CaseReport {
        let Self {
            subject, effect, ..
        } = self;
        let expected = subject
            .expected
            .iter()
            .find(|known| known.effect == effect.name());
        let size = self.scenes.first().map_or([0, 0], |scene| {
            [scene.size().width(), scene.size().height()]
        });
        let mut report = CaseReport {
            name: subject.name.clone(),
            family: subject.family.to_owned(),
            effect: effect.name().to_owned(),
            reason: subject.reason.clone(),
            source: subject.source.clone(),
            size,
            frames: self.scenes.len(),
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
            // What is drawn is stored in `f32` whatever it was computed in, so that the
            // shadow has nothing to say that the sanitiser has not seen; and another
            // device may cover other pixels, which is nothing of a spread.
            if self.effect.drawing() != Drawing::None
                && matches!(executor.kind, Kind::Shadow | Kind::Perturbed)
            {
                continue;
            }
            let mut findings = Vec::new();
            let result = self.on(executor, watch, &mut kept, &mut findings);
            report.results.push(result);
            match self.exception(executor) {
                Some(exception) => report.excused.extend(findings.into_iter().map(|finding| {
                    let reason = exception.reason.clone();
                    Excused { finding, reason }
                })),
                None => report.findings.append(&mut findings),
            }
        }
        report
    }

    /// What an executor's driver is known for in this case.
    fn exception(&self, executor: &Executor) -> Option<&Exception> {
        if !executor.kind.is_device() {
            return None;
        }
        let device = executor.info().device;
        let mut exceptions = self.exceptions.iter();
        exceptions.find(|one| one.excuses(&self.subject.name, self.effect.name(), &device))
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
            let mut frames = match self.execute(executor, self.scenes, arithmetic, &mut result) {
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
                let overflows = self.subject.overflows.is_some();
                finite::look(number, stores, overflows, &mut result.non_finite);
            }
            match kind {
                Kind::Cpu => {
                    findings.extend(watch.checked(kind, executor.take_checked()));
                    result.untrue = self.truth(&frames);
                    if let Some(finding) = self.recovery(executor, &frames) {
                        findings.push(finding);
                    }
                    result.digest = Some(digest(&frames));
                    kept.reference = frames;
                }
                Kind::Double => {
                    if self.effect.drawing() != Drawing::None {
                        let layers = self.scenes.first().map_or(0, drawn::layers);
                        let pairs = kept.reference.iter().zip(&frames);
                        for (number, (single, double)) in pairs.enumerate() {
                            errors.look_at_drawn(number, single, double, layers);
                        }
                        result.rounding = errors.clone().finish();
                    }
                    kept.double.push((arithmetic, frames));
                }
                Kind::Shadow => {
                    let double = kept.double(arithmetic);
                    for (number, stores) in frames.iter().enumerate() {
                        let double = double.and_then(|frames| frames.get(number));
                        let double = double.map_or(&[][..], Vec::as_slice);
                        let strict = arithmetic == Arithmetic::Strict;
                        let light = self.scenes.get(number).and_then(Scene::light);
                        if let Some(light) = light {
                            let shown = rounding::Shown::of(light, self.blur());
                            errors.look(number, stores, double, &shown, strict);
                        }
                    }
                }
                Kind::Sanitiser => {
                    findings.extend(watch.checked(kind, executor.take_checked()));
                    let steps = executor.take_sanitised();
                    let counts = result.sanitised.get_or_insert_default();
                    let case = format!(
                        "{}, {}, {arithmetic}",
                        self.subject.name,
                        self.effect.name()
                    );
                    findings.extend(watch.look(&case, &steps, self.expected(), counts));
                    decisions(&steps, &frames, kept.double(arithmetic), counts);
                }
                Kind::Perturbed => {
                    kept.spread = frames.iter().map(|stores| Spread::around(stores)).collect();
                    for seed in 0..PERTURBATIONS {
                        executor.perturb(Some(seed));
                        match self.execute(executor, self.scenes, arithmetic, &mut result) {
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
                Kind::Wgpu | Kind::Ash if self.effect.drawing() != Drawing::None => {
                    self.drawn(&executor.info(), arithmetic, kept, &frames, &mut result);
                    kept.devices.push((arithmetic, frames));
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

    /// Holds what a device has drawn to the interpreter, within what rasterisers are
    /// free to do, and to what another backend has drawn on the same device, bit by bit.
    fn drawn(
        &self,
        info: &BackendInfo,
        arithmetic: Arithmetic,
        kept: &Kept,
        frames: &Frames,
        result: &mut ExecutorResult,
    ) {
        let rules = drawn::Rules {
            drawing: self.effect.drawing(),
            same_grid: info.device.contains("llvmpipe"),
            strict: arithmetic == Arithmetic::Strict,
            layers: self.scenes.first().map_or(0, drawn::layers),
        };
        for (number, (reference, subject)) in kept.reference.iter().zip(frames).enumerate() {
            rules.compare(number, reference, subject, &mut result.difference);
        }
        let mut devices = kept.devices.iter();
        if let Some((_, before)) = devices.find(|(known, _)| *known == arithmetic) {
            for (number, (reference, subject)) in before.iter().zip(frames).enumerate() {
                agreement::compare(number, reference, subject, &mut result.difference);
            }
        }
    }

    /// What of a case's frames is not what the effect's truth says.
    fn truth(&self, frames: &Frames) -> Option<truth::Untrue> {
        let mut judge =
            truth::Judge::new(self.effect.name(), &self.subject.knobs, self.expected())?;
        for (number, (scene, stores)) in self.scenes.iter().zip(frames).enumerate() {
            judge.look(number, scene, stores);
        }
        judge.finish()
    }

    /// The error that the case declares for the effect.
    fn expected(&self) -> Option<f64> {
        let declared = self.subject.expected.iter();
        declared
            .filter(|known| known.effect == self.effect.name())
            .map(|known| known.bound)
            .next()
    }

    /// Runs the frames in a row from a fresh history.
    fn execute(
        &self,
        executor: &mut Executor,
        scenes: &[Scene],
        arithmetic: Arithmetic,
        result: &mut ExecutorResult,
    ) -> Result<Frames, ExecuteError> {
        executor.reset();
        let mut frames = Vec::new();
        for scene in scenes {
            let graph = self.subject.graph(self.effect, scene)?;
            let plan = self.plan(executor, &graph, arithmetic)?;
            // An effect that is off hands on what it was given.
            if plan.steps.is_empty() {
                frames.push(Vec::new());
                continue;
            }
            frames.push(executor.run(&plan, &scene.inputs())?);
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
        if recovery.effect != self.effect.name() {
            return None;
        }
        let mut scenes = self.scenes.to_vec();
        let good = scenes.get(recovery.poisoned + 1)?.clone();
        *scenes.get_mut(recovery.poisoned)? = good;
        let mut result = ExecutorResult::default();
        let strict = Arithmetic::Strict;
        let finding = |text| Finding {
            kind: FindingKind::Recovery,
            executor: Kind::Cpu.to_string(),
            text,
        };
        let clean = match self.execute(executor, &scenes, strict, &mut result) {
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

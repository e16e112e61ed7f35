//! The sweep: settings are tried one after the other, their errors, work and times
//! kept as they come.
//!
//! For each effect on each scene first every setting is run once on every executor
//! and judged; then all of them are timed in turns, one frame each per round, so
//! that what else the machine does meets all alike. Time that runs out leaves
//! settings untried, the most turned first, and says so; what was found before is
//! not found again.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use etalon_core::backend::BackendError;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError};
use etalon_cpu::CpuBackend;
use etalon_effects::knob::KnobInfo;
use etalon_effects::{EffectEntry, EffectError};
use etalon_scenes::FrameSize;
use etalon_scenes::frame::FrameError;
use thiserror::Error;

use crate::executors::{self, Executor, Kind};
use crate::judge::{self, Judge, JudgeError, Judgement};
use crate::ladder::{self, Setting};
use crate::metric::spread;
use crate::model::{self, ErrorKind, Outcome, Point, Subject, Sweep};
use crate::observe::Observed;
use crate::pictures::{PictureError, Pictures};
use crate::stage::{Stage, StageError};
use crate::work;

/// Why a sweep ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SweepError {
    /// A backend that was asked for is not there, or fails.
    #[error("{kind}: {source}")]
    Backend {
        /// Which.
        kind: Kind,
        /// Why.
        source: BackendError,
    },
    /// The size is not possible.
    #[error(transparent)]
    Size(#[from] FrameError),
    /// A scene cannot be had.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// An effect refuses a scene.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// A graph cannot be planned on the interpreter.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// An effect cannot be seen or judged.
    #[error("{effect} on {scene}, {setting}: {source}")]
    Judge {
        /// The effect.
        effect: String,
        /// The scene.
        scene: String,
        /// The setting.
        setting: String,
        /// Why not.
        source: Box<JudgeError>,
    },
    /// A picture cannot be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// What was found cannot be kept.
    #[error("what was found cannot be kept: {0}")]
    Keep(String),
}

/// Which scenes effects are tried on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Scenes {
    /// Each effect on the one it has most to do on.
    First,
    /// Each effect on all that it is judged on.
    Judged,
    /// Every effect on these.
    Named(Vec<String>),
}

/// What to sweep.
#[derive(Clone, Debug)]
pub struct Options {
    /// Effects; `chain` has no knobs of its own.
    pub effects: Vec<&'static EffectEntry>,
    /// Scenes.
    pub scenes: Scenes,
    /// Backends; each has to be there.
    pub backends: Vec<Kind>,
    /// Pixels of the pictures.
    pub size: FrameSize,
    /// How many knobs are turned at once.
    pub depth: usize,
    /// Frames that each setting is timed for on each executor, at least [`LEAST_FRAMES`].
    pub frames: u32,
    /// Time for everything.
    pub budget: Duration,
}

/// Is told how a sweep comes on.
pub trait Progress {
    /// Something with so many steps begins.
    fn begin(&mut self, what: &str, steps: usize);
    /// A step is done.
    fn step(&mut self);
    /// What was found so far is complete in itself, and may be kept.
    ///
    /// # Errors
    /// A text, if it could not be kept; the sweep ends.
    fn keep(&mut self, sweep: &Sweep) -> Result<(), String>;
}

/// Frames that everything is timed for at least: quartiles of fewer would be none.
pub const LEAST_FRAMES: u32 = 3;

/// Points after which what was found is kept, should the sweep be stopped.
const KEPT_EVERY: usize = 8;

/// A setting and how to run it.
struct Candidate {
    setting: Setting,
    id: String,
    fingerprint: String,
    graph: etalon_core::graph::Graph,
}

/// Sweeps. What `before` holds is not measured again as far as its size, devices
/// and plans are the same.
///
/// # Errors
/// A [`SweepError`] at the first thing that fails; what `progress` was told to keep
/// is right.
pub fn sweep(
    options: &Options,
    before: Option<&Sweep>,
    pictures: &Pictures,
    progress: &mut dyn Progress,
) -> Result<Sweep, SweepError> {
    let end = Instant::now() + options.budget;
    let mut executors = Vec::new();
    for &kind in &options.backends {
        let executor = Executor::open(kind);
        executors.push(executor.map_err(|source| SweepError::Backend { kind, source })?);
    }
    let mut sweep = Sweep {
        size: [options.size.width(), options.size.height()],
        executors: executors.iter().map(Executor::model).collect(),
        ..Sweep::default()
    };
    let before = before
        .filter(|before| before.size == sweep.size && before.executors == sweep.executors)
        .map_or(&[][..], |before| &before.subjects);
    let mut pairs = Vec::new();
    for &effect in &options.effects {
        let judged = judge::scenes(effect.name);
        match &options.scenes {
            Scenes::First => pairs.extend(judged.iter().take(1).map(|scene| (effect, *scene))),
            Scenes::Judged => pairs.extend(judged.iter().map(|scene| (effect, *scene))),
            Scenes::Named(names) => {
                pairs.extend(names.iter().map(|scene| (effect, scene.as_str())));
            }
        }
    }
    let count = pairs.len();
    for (index, (effect, scene)) in pairs.into_iter().enumerate() {
        // What one subject leaves the others have.
        let left = end.saturating_duration_since(Instant::now());
        let share = left / u32::try_from(count - index).unwrap_or(u32::MAX);
        let known = before
            .iter()
            .find(|subject| subject.effect == effect.name && subject.scene == scene);
        let mut run = Run {
            options,
            done: sweep.clone(),
            executors: &mut executors,
            kernels: KernelLibrary::new(),
            effect,
            stage: Stage::new(scene, options.size)?,
            pictures,
            progress: &mut *progress,
            notes: Vec::new(),
        };
        let subject = run.subject(known, share)?;
        sweep.notes.append(&mut run.notes);
        sweep.subjects.push(subject);
        progress.keep(&sweep).map_err(SweepError::Keep)?;
    }
    Ok(sweep)
}

/// One effect on one scene, being swept.
struct Run<'a> {
    options: &'a Options,
    /// What was found before this.
    done: Sweep,
    executors: &'a mut [Executor],
    kernels: KernelLibrary,
    effect: &'static EffectEntry,
    stage: Stage,
    pictures: &'a Pictures,
    progress: &'a mut dyn Progress,
    notes: Vec<String>,
}

impl Run<'_> {
    fn subject(&mut self, known: Option<&Subject>, share: Duration) -> Result<Subject, SweepError> {
        let begin = Instant::now();
        let knobs = ladder::knobs(self.effect);
        let candidates = self.candidates(&knobs)?;
        let judge = judge::judge(self.effect.name, &self.stage)
            .map_err(|source| self.error("truth", source))?;
        let mut subject = Subject {
            effect: self.effect.name.to_owned(),
            scene: self.stage.scene.to_owned(),
            knobs: knobs.iter().map(knob_model).collect(),
            metrics: judge.metrics(),
            facts: judge.facts(),
            points: Vec::new(),
        };
        self.observe(
            &candidates,
            judge.as_ref(),
            known,
            begin + share,
            &mut subject,
        )?;
        self.time(
            &candidates[..subject.points.len()],
            begin + share,
            &mut subject,
        )?;
        self.notes.extend(rounding(&subject));
        Ok(subject)
    }

    /// The settings to be tried. Those that plan to the very same work are one.
    fn candidates(&mut self, knobs: &[KnobInfo]) -> Result<Vec<Candidate>, SweepError> {
        let reference = exact_backend()?;
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        let mut candidates: Vec<Candidate> = Vec::new();
        for setting in ladder::settings(self.effect, self.options.depth) {
            let graph = self.stage.graph(self.effect, &setting.values)?;
            let plan = executors::plan(
                &reference,
                &graph,
                &self.kernels,
                setting.arithmetic,
                Capture::None,
            )?;
            let fingerprint = fingerprint(&plan);
            match seen.get(&fingerprint) {
                Some(&same) => {
                    let preset = &mut candidates[same].setting.preset;
                    *preset = preset.or(setting.preset);
                }
                None => {
                    seen.insert(fingerprint.clone(), candidates.len());
                    candidates.push(Candidate {
                        id: setting.id(knobs),
                        setting,
                        fingerprint,
                        graph,
                    });
                }
            }
        }
        Ok(candidates)
    }

    /// Runs every candidate once on every executor and judges it, until `end`.
    fn observe(
        &mut self,
        candidates: &[Candidate],
        judge: &dyn Judge,
        known: Option<&Subject>,
        end: Instant,
        subject: &mut Subject,
    ) -> Result<(), SweepError> {
        let what = format!("{} on {}: errors", subject.effect, subject.scene);
        self.progress.begin(&what, candidates.len());
        let mut exact = exact_backend()?;
        // What timing all points once more takes, as far as one can tell from here.
        let mut round = Duration::ZERO;
        for candidate in candidates {
            let found = known.and_then(|known| {
                let mut points = known.points.iter();
                points.find(|point| {
                    point.id == candidate.id && point.fingerprint == candidate.fingerprint
                })
            });
            if let Some(found) = found
                && self.pictures.has_all(found)
            {
                subject.points.push(Point {
                    preset: candidate.setting.preset.map(|preset| preset.to_string()),
                    ..found.clone()
                });
                self.progress.step();
                continue;
            }
            let rounds = round * (LEAST_FRAMES + 1);
            if Instant::now() + rounds > end && subject.points.len() >= 2 {
                self.notes.push(format!(
                    "{} on {}: {} of {} settings were left out for want of time, the most turned first",
                    subject.effect,
                    subject.scene,
                    candidates.len() - subject.points.len(),
                    candidates.len()
                ));
                break;
            }
            let (point, took) = self
                .point(candidate, judge, &mut exact, subject)
                .map_err(|source| self.error(&candidate.id, source))?;
            round += took;
            subject.points.push(point);
            self.progress.step();
            if subject.points.len().is_multiple_of(KEPT_EVERY) {
                let mut sweep = self.done.clone();
                sweep.subjects.push(subject.clone());
                self.progress.keep(&sweep).map_err(SweepError::Keep)?;
            }
        }
        Ok(())
    }

    fn point(
        &mut self,
        candidate: &Candidate,
        judge: &dyn Judge,
        exact: &mut CpuBackend,
        subject: &Subject,
    ) -> Result<(Point, Duration), JudgeError> {
        let inputs = self.stage.frame.inputs();
        let plan = executors::plan(
            exact,
            &candidate.graph,
            &self.kernels,
            // What strict arithmetic rounds on purpose is an error, too.
            Arithmetic::Fast,
            Capture::EveryPass,
        )?;
        let reference = Observed::exact(exact, &plan, &inputs)?;
        let counted = executors::plan(
            exact,
            &candidate.graph,
            &self.kernels,
            candidate.setting.arithmetic,
            Capture::None,
        )?;
        let mut point = Point {
            id: candidate.id.clone(),
            fingerprint: candidate.fingerprint.clone(),
            settings: candidate
                .setting
                .values
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.to_string()))
                .collect(),
            arithmetic: candidate.setting.arithmetic.to_string(),
            preset: candidate.setting.preset.map(|preset| preset.to_string()),
            bytes: counted.texture_heap + counted.buffer_heap,
            work: work::count(&counted, &inputs)?,
            results: Vec::new(),
        };
        // Executors that wrote the same are judged once.
        let mut judged: Vec<(Observed, Judgement, [Option<String>; 2])> = Vec::new();
        let mut took = Duration::ZERO;
        for executor in self.executors.iter_mut() {
            let plan = match executor.plan(
                &candidate.graph,
                &self.kernels,
                candidate.setting.arithmetic,
                Capture::EveryPass,
            ) {
                Ok(plan) => plan,
                Err(error) => {
                    self.notes.push(format!(
                        "{} on {}, {}: not on {}: {error}",
                        subject.effect, subject.scene, candidate.id, executor.kind
                    ));
                    continue;
                }
            };
            let start = Instant::now();
            let seen = Observed::of(executor.backend(), &plan, &inputs)?;
            took += start.elapsed();
            if !judged.iter().any(|(known, ..)| *known == seen) {
                let judgement = judge.judge(&seen, &reference)?;
                let name = format!(
                    "{}-{}-{}-{}",
                    subject.effect, subject.scene, candidate.id, executor.kind
                );
                let files = self.pictures.write(&name, &judgement)?;
                judged.push((seen.clone(), judgement, files));
            }
            if let Some((_, judgement, [picture, difference])) =
                judged.iter().find(|(known, ..)| *known == seen)
            {
                point.results.push(Outcome {
                    executor: executor.kind.to_string(),
                    time: None,
                    errors: judgement.errors.clone(),
                    picture: picture.clone(),
                    difference: difference.clone(),
                });
            }
        }
        Ok((point, took))
    }

    /// Times all points in turns, until `end` or until each has been timed often
    /// enough.
    fn time(
        &mut self,
        candidates: &[Candidate],
        end: Instant,
        subject: &mut Subject,
    ) -> Result<(), SweepError> {
        /// One point on one executor.
        struct Clocked {
            point: usize,
            result: usize,
            executor: usize,
            plan: Plan,
            times: Vec<f64>,
        }
        let mut clocked = Vec::new();
        for (point, candidate) in candidates.iter().enumerate() {
            for (result, outcome) in subject.points[point].results.iter().enumerate() {
                if outcome
                    .time
                    .is_some_and(|time| time.frames >= self.options.frames)
                {
                    continue;
                }
                for (index, executor) in self.executors.iter().enumerate() {
                    if executor.kind.to_string() == outcome.executor {
                        clocked.push(Clocked {
                            point,
                            result,
                            executor: index,
                            plan: executor.plan(
                                &candidate.graph,
                                &self.kernels,
                                candidate.setting.arithmetic,
                                Capture::None,
                            )?,
                            times: Vec::new(),
                        });
                    }
                }
            }
        }
        let rounds = self.options.frames as usize;
        let what = format!("{} on {}: times", subject.effect, subject.scene);
        self.progress.begin(&what, rounds * clocked.len());
        let inputs = self.stage.frame.inputs();
        let mut silent = BTreeSet::new();
        // The first round warms caches and clocks up and does not count.
        'rounds: for round in 0..=rounds {
            for item in &mut clocked {
                if Instant::now() > end && round > LEAST_FRAMES as usize {
                    self.notes.push(format!(
                        "{} on {}: timed for {} frames instead of {rounds} for want of time",
                        subject.effect,
                        subject.scene,
                        round - 1
                    ));
                    break 'rounds;
                }
                let executor = &mut self.executors[item.executor];
                let time =
                    executor
                        .time(&item.plan, &inputs)
                        .map_err(|source| SweepError::Backend {
                            kind: executor.kind,
                            source,
                        })?;
                match time {
                    Some(time) if round > 0 => item.times.push(time),
                    Some(_) => {}
                    None => {
                        silent.insert(executor.kind.to_string());
                    }
                }
                if round > 0 {
                    self.progress.step();
                }
            }
        }
        for kind in silent {
            self.notes
                .push(format!("{kind} does not say how long its steps take"));
        }
        for item in clocked {
            subject.points[item.point].results[item.result].time = spread(&item.times).ok();
        }
        Ok(())
    }

    fn error(&self, setting: &str, source: JudgeError) -> SweepError {
        SweepError::Judge {
            effect: self.effect.name.to_owned(),
            scene: self.stage.scene.to_owned(),
            setting: setting.to_owned(),
            source: Box::new(source),
        }
    }
}

fn exact_backend() -> Result<CpuBackend, SweepError> {
    executors::exact().map_err(|source| SweepError::Backend {
        kind: Kind::Cpu,
        source,
    })
}

fn knob_model(knob: &KnobInfo) -> model::Knob {
    model::Knob {
        name: knob.name.to_owned(),
        description: knob.description.to_owned(),
        unit: knob.unit.to_owned(),
        default: knob.default.to_string(),
    }
}

/// What to say where rounding is no small part of the error: with the settings that
/// are the default, on the first executor, by the main measure of rounding.
fn rounding(subject: &Subject) -> Option<String> {
    let result = subject.points.first()?.results.first()?;
    let mains = subject.mains();
    let main = mains
        .into_iter()
        .find(|metric| metric.kind == ErrorKind::Rounding)?;
    let (_, measure) = main.id.split_once('.')?;
    let rounding = result.errors.get(&main.id)?;
    let algorithm = result.errors.get(&format!("algorithm.{measure}"))?;
    (rounding * 10.0 > *algorithm).then(|| {
        format!(
            "{} on {}: rounding ({rounding:.1e}) is not far below all that is left of the algorithm's error ({algorithm:.1e}) with the default settings",
            subject.effect, subject.scene
        )
    })
}

/// A name for all that a plan does: kernels, settings, sizes. The same on every
/// machine and run (FNV-1a, 64 bits).
fn fingerprint(plan: &Plan) -> String {
    // What cannot be printed is like nothing else.
    let text = plan.to_json().unwrap_or_default();
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{hash:016x}")
}

//! One effect on one scene.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use etalon_core::graph::Graph;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan};
use etalon_cpu::CpuBackend;
use etalon_effects::knob::KnobInfo;

use super::{LEAST_FRAMES, Options, Progress, SweepError};
use crate::executors::{self, Executor, Kind};
use crate::judge::{Judge, JudgeError, Judgement};
use crate::ladder::{self, Setting};
use crate::metric::spread;
use crate::model::{self, ErrorKind, Outcome, Point, Subject, Sweep};
use crate::observe::Observed;
use crate::pictures::Pictures;
use crate::trial::Trial;
use crate::work;

/// Points after which what was found is kept, should the sweep be stopped.
const KEPT_EVERY: usize = 8;

/// A setting and how to run it.
struct Candidate {
    setting: Setting,
    id: String,
    fingerprint: String,
    graph: Graph,
}

/// One effect on one scene, being swept.
pub(super) struct Run<'a> {
    pub(super) options: &'a Options,
    /// What was found before this.
    pub(super) done: Sweep,
    pub(super) executors: &'a mut [Executor],
    pub(super) kernels: KernelLibrary,
    pub(super) trial: Trial,
    /// Its number among all, from 1, and how many there are.
    pub(super) place: [usize; 2],
    pub(super) pictures: &'a Pictures,
    pub(super) progress: &'a mut dyn Progress,
    pub(super) notes: Vec<String>,
}

impl Run<'_> {
    /// Tries its settings, within a share of the time. What is known already is taken
    /// as it is.
    pub(super) fn subject(
        &mut self,
        known: Option<&Subject>,
        share: Duration,
    ) -> Result<Subject, SweepError> {
        let begin = Instant::now();
        self.begin("truth", 1);
        let knobs = ladder::knobs(&self.trial.effect());
        let candidates = self.candidates(&knobs)?;
        let judge = self
            .trial
            .judge()
            .map_err(|source| self.error("truth", source))?;
        self.progress.step();
        let mut subject = Subject {
            effect: self.trial.effect().name().to_owned(),
            scene: self.trial.scene().to_owned(),
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
        for setting in ladder::settings(&self.trial.effect(), self.options.depth) {
            let graph = self.trial.graph(&setting.values)?;
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
        self.begin("errors", candidates.len());
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
        let inputs = self.trial.inputs();
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
        self.begin("times", (rounds + 1) * clocked.len());
        let inputs = self.trial.inputs();
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
                self.progress.step();
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

    /// Tells that a part of it begins.
    fn begin(&mut self, part: &str, steps: usize) {
        let (effect, scene) = (self.trial.effect().name(), self.trial.scene());
        let [number, count] = self.place;
        let what = format!("{number} of {count}, {effect} on {scene}: {part}");
        self.progress.begin(&what, steps);
    }

    fn error(&self, setting: &str, source: JudgeError) -> SweepError {
        SweepError::Judge {
            effect: self.trial.effect().name().to_owned(),
            scene: self.trial.scene().to_owned(),
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

//! The sweep: settings are tried one after the other, their errors, work and times
//! kept as they come.
//!
//! For each effect on each scene first every setting is run once on every executor
//! and judged; then all of them are timed in turns, one frame each per round, so
//! that what else the machine does meets all alike. Time that runs out leaves
//! settings untried, the most turned first, and says so; what was found before is
//! not found again.

mod run;

use std::time::{Duration, Instant};

use etalon_core::backend::BackendError;
use etalon_core::plan::PlanError;
use etalon_effects::EffectError;
use etalon_scenes::FrameSize;
use etalon_scenes::frame::FrameError;
use thiserror::Error;

use self::run::Run;
use crate::executors::{Executor, Kind};
use crate::judge::{self, JudgeError};
use crate::model::Sweep;
use crate::pictures::{PictureError, Pictures};
use crate::stage::StageError;
use crate::trial::{Swept, Trial};

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
    /// Nothing is to be swept.
    #[error(
        "none of the effects can be tried on any of the scenes: frames are of scenes, environments of skies"
    )]
    Nothing,
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
    /// Every effect on those of these that suit it: frames are of scenes, environments
    /// of skies.
    Named(Vec<String>),
}

/// What to sweep.
#[derive(Clone, Debug)]
pub struct Options {
    /// Effects.
    pub effects: Vec<Swept>,
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
        let judged = judge::scenes(effect.name());
        match &options.scenes {
            Scenes::First => pairs.extend(judged.iter().take(1).map(|scene| (effect, *scene))),
            Scenes::Judged => pairs.extend(judged.iter().map(|scene| (effect, *scene))),
            Scenes::Named(names) => {
                let suitable = names.iter().filter(|scene| effect.suits(scene));
                pairs.extend(suitable.map(|scene| (effect, scene.as_str())));
            }
        }
    }
    if pairs.is_empty() {
        return Err(SweepError::Nothing);
    }
    let count = pairs.len();
    for (index, (effect, scene)) in pairs.into_iter().enumerate() {
        // What one subject leaves the others have.
        let left = end.saturating_duration_since(Instant::now());
        let share = left / u32::try_from(count - index).unwrap_or(u32::MAX);
        let known = before
            .iter()
            .find(|subject| subject.effect == effect.name() && subject.scene == scene);
        let mut run = Run {
            options,
            done: sweep.clone(),
            executors: &mut executors,
            kernels: etalon_effects::kernels(),
            trial: Trial::new(effect, scene, options.size)?,
            place: [index + 1, count],
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

//! What is swept, and on what: effects that run on a frame on scenes, those that are
//! made of an environment map on skies.

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_effects::knob::{KnobInfo, KnobValue};
use etalon_effects::registry::WITHOUT_KNOBS;
use etalon_effects::{EffectEntry, EffectError, MapEntry, effects, map_effects};
use etalon_scenes::{FrameSize, scene, sky};
use thiserror::Error;

use crate::judge::{self, Judge, JudgeError};
use crate::sky::SkyStage;
use crate::stage::{Stage, StageError};

/// An effect whose knobs are turned.
#[derive(Clone, Copy, Debug)]
pub enum Swept {
    /// It runs on a frame.
    Frame(&'static EffectEntry),
    /// It is made of an environment map.
    Map(&'static MapEntry),
}

/// Why an effect is not swept.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SweptError {
    /// There is nothing to turn.
    #[error("{effect} has no knob of accuracy: {reason}")]
    WithoutKnobs {
        /// The effect.
        effect: &'static str,
        /// Why not.
        reason: &'static str,
    },
    /// There is no such effect.
    #[error("there is no effect `{name}` to judge; there are {}", Swept::all().map(|effect| effect.name()).collect::<Vec<_>>().join(", "))]
    Unknown {
        /// As given.
        name: String,
    },
}

impl Swept {
    /// All that there is a truth for.
    pub fn all() -> impl Iterator<Item = Self> {
        let frames = effects().iter().filter(|effect| effect.name != "chain");
        frames
            .map(Self::Frame)
            .chain(map_effects().iter().map(Self::Map))
    }

    /// The effect of that name.
    ///
    /// # Errors
    /// If there is none, or it has nothing to turn.
    pub fn named(name: &str) -> Result<Self, SweptError> {
        let chain = ("chain", "its effects are swept one by one");
        let mut without = WITHOUT_KNOBS.iter().chain([&chain]);
        if let Some(&(effect, reason)) = without.find(|(known, _)| *known == name) {
            return Err(SweptError::WithoutKnobs { effect, reason });
        }
        Self::all()
            .find(|effect| effect.name() == name)
            .ok_or_else(|| SweptError::Unknown {
                name: name.to_owned(),
            })
    }

    /// Its name.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Frame(effect) => effect.name,
            Self::Map(effect) => effect.name,
        }
    }

    /// Its settings as data.
    #[must_use]
    pub fn knobs(&self) -> Vec<KnobInfo> {
        match self {
            Self::Frame(effect) => effect.knobs(),
            Self::Map(effect) => effect.knobs(),
        }
    }

    /// Whether it could be tried on what is known by a name: not if that is of the other
    /// kind, a sky or a scene. What is not known at all is left to be refused.
    #[must_use]
    pub fn suits(&self, name: &str) -> bool {
        match self {
            Self::Frame(_) => sky(name).is_none(),
            Self::Map(_) => scene(name).is_none(),
        }
    }
}

/// An effect on what it is tried on.
#[derive(Debug)]
pub enum Trial {
    /// On a frame of a scene.
    Frame(&'static EffectEntry, Box<Stage>),
    /// On the map of a sky.
    Map(&'static MapEntry, Box<SkyStage>),
}

impl Trial {
    /// Renders the scene or the sky of a name for an effect.
    ///
    /// # Errors
    /// If there is none of that name, or memory runs out.
    pub fn new(effect: Swept, name: &str, size: FrameSize) -> Result<Self, StageError> {
        Ok(match effect {
            Swept::Frame(effect) => Self::Frame(effect, Box::new(Stage::new(name, size)?)),
            Swept::Map(effect) => Self::Map(effect, Box::new(SkyStage::new(name, size)?)),
        })
    }

    /// The effect.
    #[must_use]
    pub const fn effect(&self) -> Swept {
        match self {
            Self::Frame(effect, _) => Swept::Frame(effect),
            Self::Map(effect, _) => Swept::Map(effect),
        }
    }

    /// The name of the scene or sky.
    #[must_use]
    pub const fn scene(&self) -> &'static str {
        match self {
            Self::Frame(_, stage) => stage.scene,
            Self::Map(_, stage) => stage.scene,
        }
    }

    /// The graph of the effect with some knobs set, its result as the output `result`.
    ///
    /// # Errors
    /// If the effect refuses its input or a value.
    pub fn graph(&self, values: &[(&str, KnobValue)]) -> Result<Graph, EffectError> {
        match self {
            Self::Frame(effect, stage) => stage.graph(effect, values),
            Self::Map(effect, stage) => stage.graph(effect, values),
        }
    }

    /// What the graph is given.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        match self {
            Self::Frame(_, stage) => stage.frame.inputs(),
            Self::Map(_, stage) => stage.inputs(),
        }
    }

    /// Who judges it. Computes the truths.
    ///
    /// # Errors
    /// If there are none for the effect, or memory runs out.
    pub fn judge(&self) -> Result<Box<dyn Judge>, JudgeError> {
        match self {
            Self::Frame(effect, stage) => judge::judge(effect.name, stage),
            Self::Map(_, stage) => judge::map_judge(stage),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_are_found_or_it_is_said_why_not() {
        for effect in Swept::all() {
            let found = Swept::named(effect.name()).map(|found| found.name());
            assert_eq!(found, Ok(effect.name()));
            let knobs = effect.knobs();
            assert!(!knobs.is_empty(), "{}", effect.name());
        }
        for name in ["geometry", "lighting", "forward", "chain"] {
            let error = Swept::named(name).unwrap_err().to_string();
            let begin = format!("{name} has no knob of accuracy: ");
            assert!(error.starts_with(&begin) && error.len() > begin.len());
        }
        let error = Swept::named("fog").unwrap_err().to_string();
        assert!(
            error.contains("`fog`") && error.contains("environment"),
            "{error}"
        );
    }

    #[test]
    fn frames_are_of_scenes_and_maps_of_skies() {
        let [frame, map] = ["bloom", "environment"].map(|name| Swept::named(name).unwrap());
        assert!(frame.suits("wet-floor") && !frame.suits("sun"));
        assert!(map.suits("sun") && !map.suits("wet-floor"));
        assert!(frame.suits("nowhere") && map.suits("nowhere"));
        let size = FrameSize::new(64, 36).unwrap();
        let error = Trial::new(map, "nowhere", size).unwrap_err();
        assert!(error.to_string().contains("sun"), "{error}");
        assert!(matches!(error, StageError::NoSky { .. }));
    }
}

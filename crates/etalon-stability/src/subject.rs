//! What is run: cases with the effects they concern.

use etalon_core::graph::Graph;
use etalon_effects::knob::KnobValue;
use etalon_effects::{EffectError, effect, effects};
use etalon_scenes::cases::drawn::{DrawnCase, DrawnEffect, drawn_cases};
use etalon_scenes::cases::{Case, CaseError, Expected, Family, Recovery, case, cases};
use thiserror::Error;

use crate::knobs;
use crate::scene::{Effect, Scene};

/// A case, by whatever its frames come from.
#[derive(Clone, Debug)]
pub struct Subject {
    /// By which it is known.
    pub name: String,
    /// What it is hard about: a family of the corpus, or `knobs`.
    pub family: &'static str,
    /// Why it is hard.
    pub reason: String,
    /// Where that is known from.
    pub source: String,
    /// The effects that are run on it.
    pub effects: Vec<Effect>,
    /// Knobs that are set.
    pub knobs: Vec<(&'static str, KnobValue)>,
    /// Larger rounding errors, with their reasons.
    pub expected: &'static [Expected],
    /// When the results have to be what they are without a fault.
    pub recovery: Option<Recovery>,
    /// Why sums in a target may be infinite, if they may.
    pub overflows: Option<&'static str>,
    /// The case whose frames these are.
    pub frames: Frames,
}

/// Where frames come from.
#[derive(Clone, Copy, Debug)]
pub enum Frames {
    /// Images of scenes.
    Images(&'static Case),
    /// What is drawn and lit.
    Stage(&'static DrawnCase),
}

/// Why a subject has no frames.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SubjectError {
    /// Its frames cannot be made.
    #[error("{name}: {source}")]
    Case {
        /// The case.
        name: String,
        /// Why not.
        source: Box<CaseError>,
    },
    /// The corpus lacks the frames that knobs are turned on.
    #[error("the corpus has no case `{0}`")]
    Missing(&'static str),
}

impl Subject {
    fn of_images(family: &'static str, case: &'static Case) -> Self {
        Self {
            name: case.name.to_owned(),
            family,
            reason: case.reason.to_owned(),
            source: case.source.to_owned(),
            effects: effects()
                .iter()
                .filter(|effect| case.concerns(effect.name))
                .copied()
                .map(Effect::OfImages)
                .collect(),
            knobs: case.knobs.to_vec(),
            expected: case.expected,
            recovery: case.recovery,
            overflows: None,
            frames: Frames::Images(case),
        }
    }

    /// The same frames for each search of reflections that the effect does not do by
    /// default: what is hard for one way along a ray is hard for all. The linear one is
    /// the default's first part; light and tone change nothing of what is found.
    fn otherwise_searched(family: Family, case: &'static Case) -> Vec<Self> {
        const KNOB: &str = "search";
        let found_alike = matches!(family, Family::Light | Family::Tone | Family::Time);
        let Some(ssr) = effect("ssr").filter(|ssr| case.concerns(ssr.name)) else {
            return Vec::new();
        };
        if found_alike || case.knobs.iter().any(|(name, _)| *name == KNOB) {
            return Vec::new();
        }
        let knobs = ssr.knobs();
        let knob = knobs.iter().find(|knob| knob.name == KNOB);
        let others = knob.into_iter().flat_map(|knob| {
            let others = knob.ladder.iter();
            let linear = KnobValue::Choice("linear");
            others.filter(move |value| **value != knob.default && **value != linear)
        });
        let searched = others.map(|&value| Self {
            name: format!("{}-by-{value}", case.name),
            effects: vec![Effect::OfImages(*ssr)],
            knobs: [case.knobs, &[(KNOB, value)]].concat(),
            expected: case.searched,
            ..Self::of_images(family.name(), case)
        });
        searched.collect()
    }

    fn of_stage(effect: DrawnEffect, case: &'static DrawnCase) -> Self {
        Self {
            name: case.name.to_owned(),
            family: effect.name(),
            reason: case.reason.to_owned(),
            source: case.source.to_owned(),
            effects: vec![Effect::Drawn(effect)],
            knobs: Vec::new(),
            expected: &[],
            recovery: None,
            overflows: case.overflows,
            frames: Frames::Stage(case),
        }
    }

    /// Makes its frames.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn scenes(&self) -> Result<Vec<Scene>, SubjectError> {
        let scenes = match self.frames {
            Frames::Images(case) => case.steps().map(|steps| {
                let steps = steps.into_iter().map(Box::new);
                steps.map(Scene::Images).collect()
            }),
            Frames::Stage(case) => case.stage().map(|stage| vec![Scene::Stage(stage)]),
        };
        scenes.map_err(|source| SubjectError::Case {
            name: self.name.clone(),
            source: Box::new(source),
        })
    }

    /// The graph of an effect on one of its frames; the result of one of images is the
    /// output `result`.
    ///
    /// # Errors
    /// If the effect refuses the frame or a knob's value.
    pub fn graph(&self, effect: &Effect, scene: &Scene) -> Result<Graph, EffectError> {
        match (effect, scene) {
            (Effect::OfImages(entry), Scene::Images(step)) => {
                let mut graph = Graph::new();
                let inputs = step.import(&mut graph)?;
                let result = entry.build_with(&mut graph, &inputs, &self.knobs)?;
                graph.output("result", result)?;
                Ok(graph)
            }
            (Effect::Drawn(effect), Scene::Stage(stage)) => stage.graph(*effect),
            // Cases name the effects that take what they make.
            _ => Ok(Graph::new()),
        }
    }
}

/// Every case: those of images, those of what is drawn, then every knob at its ends.
///
/// # Errors
/// If the corpus lacks the frames that knobs are turned on.
pub fn subjects() -> Result<Vec<Subject>, SubjectError> {
    let mut found: Vec<Subject> = cases()
        .map(|(family, case)| Subject::of_images(family.name(), case))
        .collect();
    for (family, case) in cases() {
        found.extend(Subject::otherwise_searched(family, case));
    }
    found.extend(drawn_cases().map(|(effect, case)| Subject::of_stage(effect, case)));
    let frames = case(knobs::FRAMES).ok_or(SubjectError::Missing(knobs::FRAMES))?;
    found.extend(knobs::subjects(frames));
    found.push(knobs::extremes(frames));
    Ok(found)
}

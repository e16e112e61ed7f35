//! What is run: cases with the effects they concern.

use etalon_core::graph::Graph;
use etalon_effects::knob::KnobValue;
use etalon_effects::{EffectEntry, EffectError, effects};
use etalon_scenes::cases::{Case, CaseError, Expected, Recovery, Step, case, cases};
use thiserror::Error;

use crate::knobs;

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
    pub effects: Vec<EffectEntry>,
    /// Knobs that are set.
    pub knobs: Vec<(&'static str, KnobValue)>,
    /// Larger rounding errors, with their reasons.
    pub expected: &'static [Expected],
    /// When the results have to be what they are without a fault.
    pub recovery: Option<Recovery>,
    /// The case whose frames these are.
    pub frames: &'static Case,
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
        source: CaseError,
    },
    /// The corpus lacks the frames that knobs are turned on.
    #[error("the corpus has no case `{0}`")]
    Missing(&'static str),
}

impl Subject {
    fn of(family: &'static str, case: &'static Case) -> Self {
        Self {
            name: case.name.to_owned(),
            family,
            reason: case.reason.to_owned(),
            source: case.source.to_owned(),
            effects: effects()
                .iter()
                .filter(|effect| case.concerns(effect.name))
                .copied()
                .collect(),
            knobs: case.knobs.to_vec(),
            expected: case.expected,
            recovery: case.recovery,
            frames: case,
        }
    }

    /// Makes its frames.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn steps(&self) -> Result<Vec<Step>, SubjectError> {
        self.frames.steps().map_err(|source| SubjectError::Case {
            name: self.name.clone(),
            source,
        })
    }

    /// The graph of an effect on one of its frames, its result as the output
    /// `result`.
    ///
    /// # Errors
    /// If the effect refuses the frame or a knob's value.
    pub fn graph(&self, effect: &EffectEntry, step: &Step) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let inputs = step.import(&mut graph)?;
        let result = effect.build_with(&mut graph, &inputs, &self.knobs)?;
        graph.output("result", result)?;
        Ok(graph)
    }
}

/// Every case: those of the corpus, then every knob at its ends.
///
/// # Errors
/// If the corpus lacks the frames that knobs are turned on.
pub fn subjects() -> Result<Vec<Subject>, SubjectError> {
    let mut found: Vec<Subject> = cases()
        .map(|(family, case)| Subject::of(family.name(), case))
        .collect();
    let frames = case(knobs::FRAMES).ok_or(SubjectError::Missing(knobs::FRAMES))?;
    found.extend(knobs::subjects(frames));
    found.push(knobs::extremes(frames));
    Ok(found)
}

//! Every knob of every effect at the ends of its range, and beyond them.
//!
//! The cases come from the effects' own tables, so that a new knob has its own.

use etalon_core::graph::Graph;
use etalon_effects::composite::{Composite, Output, ToneCurve};
use etalon_effects::exposure::Exposure;
use etalon_effects::knob::{Domain, KnobInfo, KnobValue};
use etalon_effects::{ChainSettings, EffectEntry, EffectError, chain, effects};
use etalon_scenes::cases::{Case, Step};

use crate::model::Refusal;
use crate::scene::Effect;
use crate::subject::{Frames, Subject};

/// The case on whose frames knobs are turned: one texel in sixteen is something
/// special, so that an end of a range meets every kind of input.
pub const FRAMES: &str = "bits-hard-inputs";

/// What the cases of knobs are called by.
pub const FAMILY: &str = "knobs";

/// The ends of a knob's range with a name for each, or all of its choices but the
/// default.
fn ends(knob: &KnobInfo) -> Vec<(String, KnobValue)> {
    match knob.domain {
        Domain::Real { min, max } => vec![
            ("least".to_owned(), KnobValue::Real(min)),
            ("most".to_owned(), KnobValue::Real(max)),
        ],
        Domain::Count { min, max } => vec![
            ("least".to_owned(), KnobValue::Count(min)),
            ("most".to_owned(), KnobValue::Count(max)),
        ],
        Domain::Choice(names) => names
            .iter()
            .map(|name| ((*name).to_owned(), KnobValue::Choice(name)))
            .filter(|(_, value)| *value != knob.default)
            .collect(),
    }
}

/// Values outside of a knob's range, or of another kind.
fn beyond(knob: &KnobInfo) -> Vec<KnobValue> {
    match knob.domain {
        Domain::Real { min, max } => vec![
            KnobValue::Real(min.next_down()),
            KnobValue::Real(max.next_up()),
            KnobValue::Real(f32::NAN),
            KnobValue::Real(f32::INFINITY),
            KnobValue::Real(f32::NEG_INFINITY),
            KnobValue::Count(1),
            KnobValue::Choice("on"),
        ],
        Domain::Count { min, max } => [min.checked_sub(1), max.checked_add(1), Some(u32::MAX)]
            .into_iter()
            .flatten()
            .filter(|value| !(min..=max).contains(value))
            .map(KnobValue::Count)
            .chain([KnobValue::Real(1.0), KnobValue::Choice("on")])
            .collect(),
        Domain::Choice(_) => vec![
            KnobValue::Choice("no such choice"),
            KnobValue::Real(0.0),
            KnobValue::Count(0),
        ],
    }
}

/// A knob's name as case names are spelled.
fn spelled(text: &str) -> String {
    text.replace('_', "-")
}

/// The cases of all knobs, on the frames of `frames`.
#[must_use]
pub fn subjects(frames: &'static Case) -> Vec<Subject> {
    let step = frames
        .steps()
        .ok()
        .and_then(|steps| steps.into_iter().next());
    let mut found = Vec::new();
    for effect in effects() {
        for knob in effect.knobs() {
            for (end, value) in ends(&knob) {
                let knobs = settled(effect, step.as_ref(), (knob.name, value));
                found.push(Subject {
                    name: format!(
                        "knob-{}-{}-{}",
                        effect.name,
                        spelled(knob.name),
                        spelled(&end)
                    ),
                    family: FAMILY,
                    reason: format!(
                        "{} at {value}, an end of what it may be ({}): {}",
                        knob.name, knob.domain, knob.description
                    ),
                    source: format!("the settings of etalon_effects::{}", effect.name),
                    effects: vec![Effect::OfImages(*effect)],
                    knobs,
                    expected: &[],
                    recovery: None,
                    overflows: None,
                    frames: Frames::Images(frames),
                });
            }
        }
    }
    found
}

/// Every factor on the light at its most, one after the other: the brightest light
/// that the settings can ask for.
#[must_use]
pub fn extremes(frames: &'static Case) -> Subject {
    Subject {
        name: "knobs-brightest-together".to_owned(),
        family: FAMILY,
        reason:
            "exposure of a dark scene by the largest key and compensation and the largest factor \
                 make light of 10²³ of that of the sun, whose square f32 cannot hold"
                .to_owned(),
        source: "the settings of etalon_effects::exposure and etalon_effects::composite".to_owned(),
        effects: vec![Effect::OfImages(EffectEntry::fixed(
            "chain",
            "The chain at its brightest",
            |graph, inputs| {
                let exposure = Exposure {
                    key: 10.0,
                    compensation: 16.0,
                    min_luminance: 1e-6,
                    max_luminance: 1e-6,
                    ..Exposure::default()
                };
                let settings = ChainSettings {
                    exposure: Some(exposure),
                    composite: Composite {
                        exposure: 1e6,
                        output: Output::Sdr(ToneCurve::Aces),
                    },
                    ..ChainSettings::full()
                };
                Ok(chain(graph, inputs, &settings)?.picture)
            },
        ))],
        knobs: Vec::new(),
        expected: &[],
        recovery: None,
        overflows: None,
        frames: Frames::Images(frames),
    }
}

/// A knob's value, and where another knob has to be no less than it, that one as
/// well: the effect's own refusal tells which, and what it has to be at least.
fn settled(
    effect: &'static EffectEntry,
    step: Option<&Step>,
    set: (&'static str, KnobValue),
) -> Vec<(&'static str, KnobValue)> {
    let knobs = vec![set];
    let refusal = step.and_then(|step| build(effect, step, &knobs).err());
    let Some(EffectError::Setting(refusal)) = refusal else {
        return knobs;
    };
    let mut knobs: Vec<_> = knobs
        .into_iter()
        .filter(|(name, _)| *name != refusal.field)
        .collect();
    knobs.push((refusal.field, KnobValue::Real(refusal.min as f32)));
    knobs
}

fn build(
    effect: &EffectEntry,
    step: &Step,
    knobs: &[(&str, KnobValue)],
) -> Result<(), EffectError> {
    let mut graph = Graph::new();
    let inputs = step.import(&mut graph)?;
    effect.build_with(&mut graph, &inputs, knobs).map(|_| ())
}

/// What every effect says to every value beyond its range, to a value of another
/// kind, and to a knob that it has not.
#[must_use]
pub fn refusals(frames: &Case) -> Vec<Refusal> {
    let Some(step) = frames
        .steps()
        .ok()
        .and_then(|steps| steps.into_iter().next())
    else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for effect in effects() {
        let mut tried: Vec<(&str, KnobValue)> = vec![("no_such_knob", KnobValue::Real(1.0))];
        for knob in effect.knobs() {
            tried.extend(beyond(&knob).into_iter().map(|value| (knob.name, value)));
        }
        for (knob, value) in tried {
            found.push(Refusal {
                effect: effect.name.to_owned(),
                knob: knob.to_owned(),
                value: value.to_string(),
                error: match build(effect, &step, &[(knob, value)]) {
                    Err(error @ (EffectError::Knob(_) | EffectError::Setting(_))) => {
                        Some(error.to_string())
                    }
                    _ => None,
                },
            });
        }
    }
    found
}

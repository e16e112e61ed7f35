//! Presets: how good an effect is to be, in one word.
//!
//! Presets are points of the measured front of error against work
//! (`cargo xtask accuracy`), chosen by one rule: `Ultra` is the most accurate
//! point of the front that does no more work than the one before it for less than
//! a hundredth of its error; `Low` is the cheapest point whose error is at most
//! ten times the default's; `Medium` and `High` lie nearest to a third and two
//! thirds of the way between them, in the logarithm of work. They set accuracy
//! and leave the look alone.

use std::fmt;

use crate::knob::KnobValue;

/// How good an effect is to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quality {
    /// The cheapest that can be looked at.
    Low,
    /// A third of the way up.
    Medium,
    /// Two thirds of the way up.
    #[default]
    High,
    /// Where more work shows no more.
    Ultra,
}

impl Quality {
    /// From the cheapest to the dearest.
    pub const ALL: [Self; 4] = [Self::Low, Self::Medium, Self::High, Self::Ultra];
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
            Self::Ultra => "ultra",
        })
    }
}

/// Knobs and their values, the others being at their defaults.
type Values = &'static [(&'static str, KnobValue)];

/// By effect: the presets, from the cheapest to the dearest.
const PRESETS: &[(&str, [Values; 4])] = &[
    (
        "ssr",
        [
            &[
                ("resolution", KnobValue::Real(0.125)),
                ("steps", KnobValue::Count(3)),
            ],
            &[("resolution", KnobValue::Real(0.25))],
            &[("resolution", KnobValue::Real(0.5))],
            &[],
        ],
    ),
    (
        "bloom",
        [
            &[("levels", KnobValue::Count(4))],
            &[],
            &[("levels", KnobValue::Count(8))],
            &[
                ("levels", KnobValue::Count(9)),
                ("storage", KnobValue::Choice("rgba32float")),
            ],
        ],
    ),
    (
        "exposure",
        [
            &[("stride", KnobValue::Count(8))],
            &[("stride", KnobValue::Count(4))],
            &[("stride", KnobValue::Count(2))],
            &[],
        ],
    ),
];

/// What a preset sets of an effect; nothing where no knob trades accuracy for
/// work.
#[must_use]
pub fn preset(effect: &str, quality: Quality) -> Values {
    let of_effect = PRESETS.iter().find(|(name, _)| *name == effect);
    of_effect.map_or(&[], |(_, presets)| presets[quality as usize])
}

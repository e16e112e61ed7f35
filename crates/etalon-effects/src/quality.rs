//! Presets: how good an effect is to be, in one word.
//!
//! Presets are points of the measured front of error against work (`cargo xtask
//! accuracy`), chosen by one rule. Work is what the interpreter counts of operations
//! at 320×180, where an environment's map is 128 texels high, error the main one of the
//! algorithm, both summed over the scenes that the effect is judged on. Of the points with the default formats that no other
//! beats in operations, texel fetches, bytes and error,
//!
//! * `Ultra` is the cheapest within 5 % of the least error;
//! * `Low` is the cheapest whose error, in the mean over scenes, is [`tolerance`];
//! * `Medium` and `High` are the nearest to a third and two thirds of the way from
//!   the one to the other, in the logarithm of operations; where bloom has too few
//!   points for that, the next ones.
//!
//! A test sees to it that none is beaten. Presets set accuracy and leave the look
//! alone; formats, which cost memory, and the march's limit, which is a bound on the
//! cost and counts in texels, as well.

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
                ("steps", KnobValue::Count(8)),
            ],
            &[("resolution", KnobValue::Real(0.25))],
            &[
                ("resolution", KnobValue::Real(0.25)),
                ("steps", KnobValue::Count(12)),
            ],
            &[("search", KnobValue::Choice("hi-z"))],
        ],
    ),
    (
        "bloom",
        [
            &[("levels", KnobValue::Count(4))],
            &[("levels", KnobValue::Count(5))],
            &[("levels", KnobValue::Count(6))],
            &[("levels", KnobValue::Count(7))],
        ],
    ),
    (
        "exposure",
        [
            &[("stride", KnobValue::Count(16))],
            &[("stride", KnobValue::Count(4))],
            &[("stride", KnobValue::Count(2))],
            &[("stride", KnobValue::Count(1))],
        ],
    ),
    (
        "environment",
        [
            &[("samples", KnobValue::Count(64))],
            &[("samples", KnobValue::Count(128))],
            &[("samples", KnobValue::Count(512))],
            &[("samples", KnobValue::Count(1024))],
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

/// How much of its main error an effect may have before it is seen without being
/// looked for: of reflections an HDR-FLIP of 0.03, of bloom, which is added to light
/// that is right, and of the composite a relative mean square error of 0.001, of
/// exposure a tenth of a stop, of an environment, where spots of single directions have
/// then run together, a relative mean square error of 0.03. 1 of what is no effect.
#[must_use]
pub fn tolerance(effect: &str) -> f64 {
    match effect {
        "ssr" => 0.03,
        "bloom" | "composite" => 0.001,
        "exposure" => 0.1,
        "environment" => 0.03,
        _ => 1.0,
    }
}

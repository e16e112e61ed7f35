//! The most accurate settings that a given time allows.
//!
//! A [`DeviceProfile`] holds what was measured on a device: for each effect the
//! settings of its front, with their times and errors (`cargo xtask accuracy
//! --profile FILE` writes one). [`ChainSettings::for_budget`] picks from them.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ChainSettings;
use crate::knob::{KnobError, Tunable};

/// What was measured on one device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeviceProfile {
    /// The device's name.
    pub device: String,
    /// Width and height of the pictures that times are of.
    pub size: [u32; 2],
    /// Each effect that was measured.
    pub effects: Vec<EffectProfile>,
}

/// What was measured of one effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EffectProfile {
    /// Its name.
    pub effect: String,
    /// Settings, in any order; those that others beat in both do no harm.
    pub points: Vec<ProfilePoint>,
}

/// One setting of an effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProfilePoint {
    /// What a frame takes, at least 0.
    pub milliseconds: f64,
    /// Of the effect's result, in multiples of what is
    /// [tolerable](crate::quality::tolerance), at least 0: so errors of different
    /// effects can be added up.
    pub error: f64,
    /// Knobs and their values as text; the others are as they were.
    pub values: Vec<(String, String)>,
}

/// Why no settings can be picked.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// The profile knows nothing of an effect that is on.
    #[error("the profile of {device} does not have the effect `{effect}`")]
    NotMeasured {
        /// The effect.
        effect: &'static str,
        /// The profile's device.
        device: String,
    },
    /// Not even the cheapest settings take so little time.
    #[error("{budget} ms are too few: the cheapest settings take {least} ms")]
    TooLittle {
        /// Milliseconds given.
        budget: f64,
        /// Milliseconds needed.
        least: f64,
    },
    /// The profile's values are not those of the effect.
    #[error(transparent)]
    Knob(#[from] KnobError),
}

impl DeviceProfile {
    /// The profile of pictures of another size, times taken to grow with the number
    /// of pixels. That is what they do from some hundred thousand pixels on; below,
    /// what a dispatch costs at least is underestimated.
    #[must_use]
    pub fn at_size(mut self, size: [u32; 2]) -> Self {
        let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        let factor = pixels(size) / pixels(self.size).max(1.0);
        for point in self
            .effects
            .iter_mut()
            .flat_map(|effect| &mut effect.points)
        {
            point.milliseconds *= factor;
        }
        self.size = size;
        self
    }
}

/// Settings that are chosen together.
#[derive(Clone, Debug, Default)]
struct Choice<'a> {
    milliseconds: f64,
    error: f64,
    points: Vec<&'a ProfilePoint>,
}

impl ChainSettings {
    /// These settings, with the knobs of every effect that is on set to what makes
    /// the sum of errors least within a budget of time. The look stays as it is.
    ///
    /// # Errors
    /// If the profile lacks an effect, or the budget is too small for any setting.
    pub fn for_budget(
        self,
        milliseconds: f64,
        profile: &DeviceProfile,
    ) -> Result<Self, BudgetError> {
        let on = [
            (self.ssr.is_some(), "ssr"),
            (self.exposure.is_some(), "exposure"),
            (self.bloom.is_some(), "bloom"),
            (true, "composite"),
        ];
        let on: Vec<&'static str> = on
            .into_iter()
            .filter_map(|(on, effect)| on.then_some(effect))
            .collect();
        let mut fronts = vec![Choice::default()];
        for &effect in &on {
            let known = profile.effects.iter().find(|known| known.effect == effect);
            let points = known.map(|known| known.points.iter().filter(|point| usable(point)));
            let Some(points) = points.filter(|points| points.clone().next().is_some()) else {
                return Err(BudgetError::NotMeasured {
                    effect,
                    device: profile.device.clone(),
                });
            };
            fronts = front(fronts.iter().flat_map(|choice| {
                points.clone().map(|point| {
                    let mut points = choice.points.clone();
                    points.push(point);
                    Choice {
                        milliseconds: choice.milliseconds + point.milliseconds,
                        error: choice.error + point.error,
                        points,
                    }
                })
            }));
        }
        // From the cheapest on; each is more accurate than the one before.
        let Some(best) = fronts
            .iter()
            .rev()
            .find(|choice| choice.milliseconds <= milliseconds)
        else {
            return Err(BudgetError::TooLittle {
                budget: milliseconds,
                least: fronts.first().map_or(0.0, |choice| choice.milliseconds),
            });
        };
        let mut settings = self;
        for (effect, point) in on.into_iter().zip(&best.points) {
            match effect {
                "ssr" => set(&mut settings.ssr, point)?,
                "exposure" => set(&mut settings.exposure, point)?,
                "bloom" => set(&mut settings.bloom, point)?,
                _ => settings.composite = turned(settings.composite, point)?,
            }
        }
        Ok(settings)
    }
}

fn usable(point: &ProfilePoint) -> bool {
    let good = |number: f64| number.is_finite() && number >= 0.0;
    good(point.milliseconds) && good(point.error)
}

/// Those that no other beats in both time and error, the cheapest first.
fn front<'a>(choices: impl Iterator<Item = Choice<'a>>) -> Vec<Choice<'a>> {
    let mut choices: Vec<_> = choices.collect();
    choices.sort_by(|a, b| {
        let time = a.milliseconds.total_cmp(&b.milliseconds);
        time.then(a.error.total_cmp(&b.error))
    });
    let mut least = f64::INFINITY;
    choices.retain(|choice| {
        let better = choice.error < least;
        least = least.min(choice.error);
        better
    });
    choices
}

fn set<S: Tunable>(settings: &mut Option<S>, point: &ProfilePoint) -> Result<(), KnobError> {
    if let Some(known) = settings.take() {
        *settings = Some(turned(known, point)?);
    }
    Ok(())
}

fn turned<S: Tunable>(mut settings: S, point: &ProfilePoint) -> Result<S, KnobError> {
    for (name, text) in &point.values {
        let knob = S::knob(name)?;
        let value = knob.domain.parse(text).ok_or_else(|| KnobError::Value {
            effect: S::EFFECT,
            knob: knob.name,
            value: text.clone(),
            domain: knob.domain,
        })?;
        settings = settings.with(name, value)?;
    }
    Ok(settings)
}

//! Punctual lights: `KHR_lights_punctual`.

pub use etalon_effects::lighting::LightKind;

use super::error::{Check, ModelError, Place};

/// A source of light without extent. A node places it; its direction is the
/// node's −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// May be empty.
    pub name: String,
    /// Linear, each channel not negative.
    pub colour: [f32; 3],
    /// In lux (lm/m²) for directional lights, in candela (lm/sr) for the others.
    pub intensity: f32,
    /// Distance from which on the light may be left out; `None` for no end.
    pub range: Option<f32>,
    /// Which kind it is.
    pub kind: LightKind,
}

impl Light {
    pub(super) fn check(&self, index: usize) -> Result<(), ModelError> {
        let place = Place::new("light", index, &self.name);
        let check = Check(&place);
        for channel in self.colour {
            check.not_negative("colour", channel)?;
        }
        check.not_negative("intensity", self.intensity)?;
        if let Some(range) = self.range {
            check.value(
                "range",
                range,
                "finite and over 0",
                range > 0.0 && range.is_finite(),
            )?;
        }
        if let LightKind::Spot { inner, outer } = self.kind {
            // The next float above π/2 is what π/2 in f32 is.
            let most = std::f32::consts::FRAC_PI_2;
            check.value(
                "outer cone angle",
                outer,
                "over 0 and at most π/2",
                outer > 0.0 && outer <= most,
            )?;
            check.value(
                "inner cone angle",
                inner,
                "at least 0 and under the outer one",
                (0.0..outer).contains(&inner),
            )?;
        }
        Ok(())
    }
}

//! Punctual lights: `KHR_lights_punctual`.

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

/// How a light's rays run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel, from infinitely far away.
    Directional,
    /// From a point into all directions, falling off with the squared distance.
    Point,
    /// From a point within a cone.
    Spot {
        /// Angle from the axis, in radians, up to which the light is full:
        /// at least 0 and under `outer`.
        inner: f32,
        /// Angle from which on there is none, at most π/2.
        outer: f32,
    },
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

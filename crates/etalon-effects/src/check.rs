//! Checks that every effect makes of its settings and inputs.

use etalon_core::graph::{Graph, Texture};

use crate::{EffectError, SettingError};

/// The settings of one effect, being checked.
#[derive(Clone, Copy)]
pub(crate) struct Settings(pub(crate) &'static str);

impl Settings {
    /// `value` is within `[min, max]`; NaN is not.
    pub(crate) fn range(
        self,
        field: &'static str,
        value: f32,
        min: f32,
        max: f32,
    ) -> Result<(), SettingError> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        Err(SettingError {
            effect: self.0,
            field,
            value: value.into(),
            min: min.into(),
            max: max.into(),
        })
    }

    /// As [`Settings::range`] for counts.
    pub(crate) fn count(
        self,
        field: &'static str,
        value: u32,
        min: u32,
        max: u32,
    ) -> Result<(), SettingError> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        Err(SettingError {
            effect: self.0,
            field,
            value: value.into(),
            min: min.into(),
            max: max.into(),
        })
    }
}

/// Width and height of a texture.
pub(crate) fn size(graph: &Graph, texture: Texture) -> [u32; 2] {
    let extent = graph.desc(texture).extent;
    [extent.width, extent.height]
}

/// Two inputs of `effect`, by name, have the same size.
pub(crate) fn same_size(
    effect: &'static str,
    (first, first_size): (&'static str, [u32; 2]),
    (second, second_size): (&'static str, [u32; 2]),
) -> Result<(), EffectError> {
    if first_size == second_size {
        return Ok(());
    }
    Err(EffectError::SizeMismatch {
        effect,
        first,
        first_size,
        second,
        second_size,
    })
}

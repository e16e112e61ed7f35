//! What can be wrong with an effect's settings and inputs.

use etalon_core::graph::GraphError;
use etalon_core::image::ImageError;
use thiserror::Error;

use crate::knob::KnobError;

/// A setting outside of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{effect}: `{field}` is {value}; it must be a number from {min} to {max}")]
pub struct SettingError {
    /// The effect.
    pub effect: &'static str,
    /// The field of its settings.
    pub field: &'static str,
    /// As given; NaN is outside of every range.
    pub value: f64,
    /// Smallest value allowed.
    pub min: f64,
    /// Largest value allowed.
    pub max: f64,
}

/// Why an effect cannot be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EffectError {
    /// A setting outside of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A setting by a name that there is not, or of a kind that it is not.
    #[error(transparent)]
    Knob(#[from] KnobError),
    /// Two inputs that must cover the same picture differ in size.
    #[error("{effect}: `{first}` is {}×{} texels, but `{second}` is {}×{}; they must be equal", .first_size[0], .first_size[1], .second_size[0], .second_size[1])]
    SizeMismatch {
        /// The effect.
        effect: &'static str,
        /// One input.
        first: &'static str,
        /// Its width and height.
        first_size: [u32; 2],
        /// The other input.
        second: &'static str,
        /// Its width and height.
        second_size: [u32; 2],
    },
    /// An image that cannot be made.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A pass that the graph refuses, such as one given a handle of another graph.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

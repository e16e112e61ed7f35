//! Perceived difference of images, by the FLIP metric of their pictures.

use etalon_accuracy::metric::flip::{SMALLEST, ldr};
use etalon_core::format::SampleKind;
use etalon_core::image::ImageData;
use serde::Serialize;

use super::view::{Mapping, picture};

/// The mean FLIP error of two images, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flip {
    /// From 0 (no visible difference) to 1, at 67 pixels per degree of the
    /// visual field, of the images as the report shows them.
    Mean(f32),
    /// Not computed.
    Skipped(&'static str),
}

impl Flip {
    /// The mean, if computed.
    #[must_use]
    pub const fn mean(&self) -> Option<f32> {
        match self {
            Self::Mean(mean) => Some(*mean),
            Self::Skipped(_) => None,
        }
    }
}

/// The mean FLIP error between the pictures of two images of one description,
/// tone-mapped alike and seen as 8-bit sRGB.
#[must_use]
pub fn flip(reference: &ImageData, subject: &ImageData) -> Flip {
    if matches!(
        reference.desc.format.sample_kind(),
        SampleKind::Sint | SampleKind::Uint
    ) {
        return Flip::Skipped("integers are no picture");
    }
    let extent = reference.desc.extent;
    if extent.width < SMALLEST || extent.height < SMALLEST {
        return Flip::Skipped("smaller than 8×8");
    }
    if reference.bytes == subject.bytes {
        return Flip::Mean(0.0);
    }
    let mapping = Mapping::of(reference);
    let (a, b) = (picture(reference, mapping), picture(subject, mapping));
    if (a.width, a.height) != (b.width, b.height) {
        return Flip::Skipped("different sizes");
    }
    // The sizes were looked at above, so only one too large is left to refuse.
    ldr(&b.rgb, &a.rgb, [a.width, a.height]).map_or(Flip::Skipped("too large"), |map| {
        Flip::Mean(map.mean() as f32)
    })
}

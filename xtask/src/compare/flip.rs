//! Perceived difference, by the FLIP metric of Andersson et al. (2020).

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

/// Smallest width and height the metric is computed for: its filters span
/// several pixels, and a picture smaller than them shows an eye nothing.
const SMALLEST: u32 = 8;

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
    if a.rgb == b.rgb {
        return Flip::Mean(0.0);
    }
    let reference = nv_flip::FlipImageRgb8::with_data(a.width, a.height, &a.rgb);
    let subject = nv_flip::FlipImageRgb8::with_data(b.width, b.height, &b.rgb);
    let errors = nv_flip::flip(reference, subject, nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec();
    // Summed here: the library's own mean is one of a histogram.
    let sum: f64 = errors.iter().map(|&error| f64::from(error)).sum();
    Flip::Mean((sum / errors.len().max(1) as f64) as f32)
}

//! Images as PNG files, for looking at them.

use std::path::Path;

use etalon_core::image::{ImageData, ImageError};
use thiserror::Error;

/// Why a picture cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The image cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The image's bytes are fewer than its description says.
    #[error("the image has {actual} texels where its description says {width}×{height}")]
    Incomplete {
        /// As described.
        width: u32,
        /// As described.
        height: u32,
        /// As given.
        actual: usize,
    },
    /// The file cannot be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// Which file.
        path: String,
        /// What went wrong.
        source: image::ImageError,
    },
}

/// How the channels of an image become a colour on screen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Look {
    /// Linear colour in the image's unit: multiplied by `exposure`, brought into
    /// range by `1 − exp(−x)`, encoded as sRGB.
    Colour {
        /// Factor before the curve.
        exposure: f64,
    },
    /// Signed unit vectors: `½ + ½ x`.
    Vectors,
    /// Device depth: brighter is nearer, in equal steps of the logarithm over
    /// five decades; the sky is black.
    Depth,
    /// Velocity in uv: grey is at rest, red is x, green is y, `scale` uv is full
    /// brightness.
    Velocity {
        /// Velocity that saturates.
        scale: f64,
    },
    /// Channels as they are, in `[0, 1]`.
    Plain,
    /// Alpha alone as grey, in `[0, 1]`.
    Alpha,
}

impl Look {
    /// The colour of a texel, each channel in `[0, 1]`; NaN becomes magenta.
    #[must_use]
    pub fn apply(self, texel: [f32; 4]) -> [f64; 3] {
        let [r, g, b, a] = texel.map(f64::from);
        let shown = match self {
            Self::Colour { exposure } => [r, g, b].map(|x| srgb(1.0 - (-x.max(0.0) * exposure).exp())),
            Self::Vectors => [r, g, b].map(|x| 0.5 + 0.5 * x),
            Self::Depth if r > 0.0 => [1.0 + 0.2 * r.log10(); 3],
            Self::Depth => [0.0; 3],
            Self::Velocity { scale } => [0.5 + 0.5 * r / scale, 0.5 + 0.5 * g / scale, 0.5],
            Self::Plain => [r, g, b],
            Self::Alpha => [a; 3],
        };
        let used: &[f64] = match self {
            Self::Depth => &[r],
            Self::Velocity { .. } => &[r, g],
            Self::Alpha => &[a],
            _ => &[r, g, b],
        };
        if used.iter().any(|x| x.is_nan()) { [1.0, 0.0, 1.0] } else { shown.map(|x| x.clamp(0.0, 1.0)) }
    }
}

/// The sRGB transfer function (IEC 61966-2-1).
fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Writes mip 0 of layer 0 as an 8-bit PNG.
///
/// # Errors
/// If the image is incomplete, memory runs out or the file cannot be written.
pub fn write_png(image: &ImageData, look: Look, path: &Path) -> Result<(), PictureError> {
    let (width, height) = (image.desc.extent.width, image.desc.extent.height);
    let texels = image.to_rgba_f32()?;
    let count = u64::from(width) * u64::from(height);
    let shown = usize::try_from(count).ok().and_then(|count| texels.get(..count));
    let shown = shown.ok_or(PictureError::Incomplete { width, height, actual: texels.len() })?;
    let bytes: Vec<u8> = shown
        .iter()
        .flat_map(|&texel| look.apply(texel).map(|x| (x * 255.0 + 0.5) as u8))
        .collect();
    image::save_buffer(path, &bytes, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|source| PictureError::Write { path: path.display().to_string(), source })
}

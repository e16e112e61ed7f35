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
            Self::Colour { exposure } => {
                [r, g, b].map(|x| srgb(1.0 - (-x.max(0.0) * exposure).exp()))
            }
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
        if used.iter().any(|x| x.is_nan()) {
            [1.0, 0.0, 1.0]
        } else {
            shown.map(|x| x.clamp(0.0, 1.0))
        }
    }
}

/// The sRGB transfer function (IEC 61966-2-1).
fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Writes mip 0 of layer 0 as an 8-bit PNG.
///
/// # Errors
/// If the image is incomplete, memory runs out or the file cannot be written.
pub fn write_png(image: &ImageData, look: Look, path: &Path) -> Result<(), PictureError> {
    let (width, height) = (image.desc.extent.width, image.desc.extent.height);
    let texels = image.to_rgba_f32()?;
    let count = u64::from(width) * u64::from(height);
    let shown = usize::try_from(count)
        .ok()
        .and_then(|count| texels.get(..count));
    let shown = shown.ok_or(PictureError::Incomplete {
        width,
        height,
        actual: texels.len(),
    })?;
    let bytes: Vec<u8> = shown
        .iter()
        .flat_map(|&texel| look.apply(texel).map(|x| (x * 255.0 + 0.5) as u8))
        .collect();
    image::save_buffer(path, &bytes, width, height, image::ExtendedColorType::Rgb8).map_err(
        |source| PictureError::Write {
            path: path.display().to_string(),
            source,
        },
    )
}

#[cfg(test)]
mod tests {
    use etalon_core::format::Format;
    use etalon_core::resource::TextureDesc;

    use super::*;

    #[test]
    fn looks_keep_their_fixed_points() {
        let colour = Look::Colour { exposure: 1.0 };
        assert_eq!(colour.apply([0.0; 4]), [0.0; 3]);
        let [negative, infinite, _] = colour.apply([-5.0, f32::INFINITY, 0.0, 1.0]);
        assert!(negative == 0.0 && (infinite - 1.0).abs() < 1e-15);
        // 1 − exp(−ln 2) = ½, which sRGB encodes as 0.7354.
        let half = colour.apply([std::f32::consts::LN_2; 4])[0];
        assert!((half - 0.735_357).abs() < 1e-6, "{half}");
        assert_eq!(Look::Vectors.apply([-1.0, 0.0, 1.0, 0.0]), [0.0, 0.5, 1.0]);
        assert_eq!(Look::Depth.apply([1.0, 0.0, 0.0, 0.0]), [1.0; 3]);
        assert_eq!(Look::Depth.apply([0.0; 4]), [0.0; 3]);
        assert!((Look::Depth.apply([0.01, 0.0, 0.0, 0.0])[0] - 0.6).abs() < 1e-6);
        assert_eq!(
            Look::Velocity { scale: 0.5 }.apply([-0.5, 0.25, 0.0, 0.0]),
            [0.0, 0.75, 0.5]
        );
        assert_eq!(Look::Alpha.apply([0.0, 0.0, 0.0, 0.25]), [0.25; 3]);
    }

    #[test]
    fn nan_is_seen_where_it_is_shown() {
        let magenta = [1.0, 0.0, 1.0];
        assert_eq!(Look::Plain.apply([f32::NAN, 0.0, 0.0, 0.0]), magenta);
        assert_eq!(Look::Plain.apply([0.0, 0.0, 0.0, f32::NAN]), [0.0; 3]);
        assert_eq!(Look::Alpha.apply([0.0, 0.0, 0.0, f32::NAN]), magenta);
        assert_eq!(Look::Depth.apply([f32::NAN, 0.0, 0.0, 0.0]), magenta);
    }

    #[test]
    fn pictures_are_written_as_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let desc = TextureDesc::d2(2, 2, Format::Rgba32Float);
        let texels = [
            [0.0, 0.5, 1.0, 1.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.2, 0.4, 0.6, 1.0],
            [2.0, -1.0, 0.0, 1.0],
        ];
        let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
        write_png(&image, Look::Plain, &path).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        assert_eq!(read.dimensions(), (2, 2));
        assert_eq!(
            read.into_raw(),
            [0, 128, 255, 255, 0, 0, 51, 102, 153, 255, 0, 0]
        );

        let cut = ImageData {
            desc,
            bytes: image.bytes[..16].to_vec(),
        };
        assert!(matches!(
            write_png(&cut, Look::Plain, &path),
            Err(PictureError::Incomplete { actual: 1, .. })
        ));
        let nowhere = folder.path().join("none/picture.png");
        assert!(matches!(
            write_png(&image, Look::Plain, &nowhere),
            Err(PictureError::Write { .. })
        ));
    }
}

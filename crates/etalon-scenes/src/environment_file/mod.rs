//! Pictures of all directions from files: equirectangular ones and cubes, OpenEXR and
//! Radiance HDR.
//!
//! What a file is its first bytes say, and how its picture is laid out its shape:
//!
//! | width : height | [`Layout`] |
//! |---|---|
//! | 2 : 1 | [`Equirectangular`](Layout::Equirectangular) |
//! | 1 : 6 | [`Column`](Layout::Column) of faces, as OpenEXR's cube maps are |
//! | 6 : 1 | [`Row`](Layout::Row) of faces |
//! | 4 : 3 | [`Cross`](Layout::Cross) |
//! | 3 : 4 | [`TallCross`](Layout::TallCross) |
//!
//! Light is linear, in whatever unit the file has; negative numbers and NaN are kept, and
//! count as no light where a map is made of them.
//!
//! # Untrusted files
//! As for [frames](crate::exr_frame): sizes are checked against
//! [`EnvironmentOptions::max_bytes`] before anything of that size is allocated, and the
//! decoders' panics are returned as errors.

mod layout;

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use etalon_core::Format;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::resource::TextureDesc;
use etalon_effects::EffectError;
use etalon_effects::environment::{CubePicture, EnvironmentMap, MAX_FACE};
use image::codecs::hdr::HdrDecoder;
use image::{ColorType, ImageDecoder, Limits};
use thiserror::Error;

pub use layout::{FaceOrder, Layout};

use crate::exr_frame::{ExrError, ExrOptions, decode_exr};

/// Why a file cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The file system says no.
    #[error("{path}: {source}")]
    Io {
        /// Which file.
        path: String,
        /// What went wrong.
        source: std::io::Error,
    },
    /// The first bytes are those of no format that is read.
    #[error("neither an OpenEXR nor a Radiance HDR file")]
    UnknownFormat,
    /// An OpenEXR file that cannot be read.
    #[error(transparent)]
    Exr(Box<ExrError>),
    /// A Radiance HDR file that is none, ends too early or contradicts itself.
    #[error("not a valid Radiance HDR file: {0}")]
    Hdr(String),
    /// A picture that needs more memory than allowed.
    #[error("the picture takes {bytes} bytes, over the limit of {limit}")]
    TooLarge {
        /// As the header says.
        bytes: u64,
        /// [`EnvironmentOptions::max_bytes`].
        limit: u64,
    },
    /// A picture whose shape is that of no layout, or not that of the one asked for.
    #[error("a picture of {width}×{height} is not {expected}")]
    Shape {
        /// Of the picture.
        width: u32,
        /// Of the picture.
        height: u32,
        /// What it would have to be.
        expected: &'static str,
    },
    /// Faces that are larger than effects take, or differ in size.
    #[error("faces of {size} texels: {why}")]
    Faces {
        /// Texels of a side.
        size: u32,
        /// What is wrong with that.
        why: &'static str,
    },
    /// An image that cannot be made.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A picture that effects refuse.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

impl From<ExrError> for EnvironmentError {
    fn from(error: ExrError) -> Self {
        Self::Exr(Box::new(error))
    }
}

/// How to read a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentOptions {
    /// How the picture is laid out; `None` takes what its shape says.
    pub layout: Option<Layout>,
    /// How faces of a row or a column are turned.
    pub faces: FaceOrder,
    /// Most bytes of a decoded picture.
    pub max_bytes: u64,
}

impl Default for EnvironmentOptions {
    fn default() -> Self {
        Self {
            layout: None,
            faces: FaceOrder::default(),
            max_bytes: 1 << 30,
        }
    }
}

/// A picture of all directions.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentPicture {
    /// As [`EnvironmentMap::of_equirectangular`] takes it, `rgba32float`.
    Equirectangular(ImageData),
    /// As [`EnvironmentMap::of_cube`] takes it.
    Cube(CubePicture),
}

impl EnvironmentPicture {
    /// A map of it, `side` texels high: a power of two in `[32, 2048]`.
    ///
    /// # Errors
    /// If the side is none, or an image does not fit into memory.
    pub fn map(&self, side: u32) -> Result<EnvironmentMap, EffectError> {
        match self {
            Self::Equirectangular(picture) => EnvironmentMap::of_equirectangular(picture, side),
            Self::Cube(picture) => EnvironmentMap::of_cube(picture, side),
        }
    }
}

/// Reads a picture of all directions from a file.
///
/// # Errors
/// If the file cannot be read, is none of these formats or invalid, is larger than
/// allowed, or has another shape than its layout.
pub fn load_environment(
    path: &Path,
    options: &EnvironmentOptions,
) -> Result<EnvironmentPicture, EnvironmentError> {
    decode_environment(&read(path)?, options)
}

/// Reads a picture of all directions from the bytes of a file.
///
/// # Errors
/// As [`load_environment`].
pub fn decode_environment(
    bytes: &[u8],
    options: &EnvironmentOptions,
) -> Result<EnvironmentPicture, EnvironmentError> {
    let picture = decode(bytes, options.max_bytes)?;
    let [width, height] = size(&picture);
    let layout = match options.layout {
        Some(layout) => layout,
        None => Layout::of_shape(width, height).ok_or(EnvironmentError::Shape {
            width,
            height,
            expected: "2 : 1, 1 : 6, 6 : 1, 4 : 3 or 3 : 4",
        })?,
    };
    let to_edges =
        bytes.starts_with(EXR) && layout == Layout::Column && options.faces == FaceOrder::Seen;
    layout.picture(picture, options.faces, to_edges)
}

/// What an OpenEXR file begins with.
const EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Reads the faces of a cube from six files, in the order +x, −x, +y, −y, +z, −z.
///
/// # Errors
/// As [`load_environment`], and if the pictures are not squares of one size.
pub fn load_faces(
    paths: [&Path; 6],
    options: &EnvironmentOptions,
) -> Result<CubePicture, EnvironmentError> {
    let mut faces = Vec::with_capacity(paths.len());
    // Each may take its part, so that all of them take no more than one file may.
    let each = options.max_bytes / 6;
    for path in paths {
        faces.push(decode(&read(path)?, each)?);
    }
    layout::assembled(&faces, options.faces)
}

fn read(path: &Path) -> Result<Vec<u8>, EnvironmentError> {
    std::fs::read(path).map_err(|source| EnvironmentError::Io {
        path: path.display().to_string(),
        source,
    })
}

fn size(picture: &ImageData) -> [u32; 2] {
    [picture.desc.extent.width, picture.desc.extent.height]
}

/// The picture of a file, `rgba32float`.
fn decode(bytes: &[u8], max_bytes: u64) -> Result<ImageData, EnvironmentError> {
    if bytes.starts_with(EXR) {
        let options = ExrOptions {
            colour_format: Format::Rgba32Float,
            max_bytes,
            ..ExrOptions::default()
        };
        return Ok(decode_exr(bytes, &options)?.frame.colour);
    }
    if bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE") {
        return decode_hdr(bytes, max_bytes);
    }
    Err(EnvironmentError::UnknownFormat)
}

fn decode_hdr(bytes: &[u8], max_bytes: u64) -> Result<ImageData, EnvironmentError> {
    let wrong = |error: image::ImageError| EnvironmentError::Hdr(error.to_string());
    let guarded = |read: &mut dyn FnMut() -> image::ImageResult<()>| {
        catch_unwind(AssertUnwindSafe(read))
            .unwrap_or_else(|_| {
                Err(image::ImageError::IoError(std::io::Error::other(
                    "the decoder gave up on it",
                )))
            })
            .map_err(wrong)
    };
    let mut decoder = None;
    guarded(&mut || {
        decoder = Some(HdrDecoder::new(Cursor::new(bytes))?);
        Ok(())
    })?;
    let Some(mut decoder) = decoder else {
        return Err(EnvironmentError::Hdr("it has no picture".into()));
    };
    let (width, height) = decoder.dimensions();
    if decoder.color_type() != ColorType::Rgb32F {
        return Err(EnvironmentError::Hdr("its texels are no light".into()));
    }
    // 12 bytes a texel as it is decoded, and 16 as it is kept.
    let texels = u64::from(width) * u64::from(height);
    let needed = texels.saturating_mul(28);
    if needed > max_bytes {
        return Err(EnvironmentError::TooLarge {
            bytes: needed,
            limit: max_bytes,
        });
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(max_bytes);
    decoder.set_limits(limits).map_err(wrong)?;
    let mut image = ImageData::zeroed(TextureDesc::d2(width, height, Format::Rgba32Float))?;
    let mut light = Vec::new();
    let length = usize::try_from(texels * 12).unwrap_or(usize::MAX);
    let no_room = |_| ImageError::OutOfMemory { bytes: texels * 12 };
    light.try_reserve_exact(length).map_err(no_room)?;
    light.resize(length, 0_u8);
    let mut decoder = Some(decoder);
    guarded(&mut || match decoder.take() {
        Some(decoder) => decoder.read_image(&mut light),
        None => Ok(()),
    })?;
    // The decoder hands numbers out in the machine's byte order.
    for (texel, given) in image.bytes.chunks_exact_mut(16).zip(light.chunks_exact(12)) {
        let numbers = given.as_chunks::<4>().0.iter();
        let numbers = numbers.map(|bytes| f32::from_ne_bytes(*bytes)).chain([1.0]);
        for (bytes, number) in texel.chunks_exact_mut(4).zip(numbers) {
            bytes.copy_from_slice(&number.to_le_bytes());
        }
    }
    Ok(image)
}

/// Refuses faces that effects do not take.
fn check_face(size: u32) -> Result<u32, EnvironmentError> {
    if (1..=MAX_FACE).contains(&size) {
        return Ok(size);
    }
    Err(EnvironmentError::Faces {
        size,
        why: "a side has from 1 to 4096",
    })
}

//! OpenEXR files as frames, and frames as OpenEXR files.
//!
//! [`load_exr`] reads single- and multi-part files of any of the `exr` crate's
//! compressions, scan lines or tiles (mip levels but the first are ignored),
//! half, float and uint channels. The frame is as large as the display window;
//! each part's data window is placed in it, what lies outside is cropped, and
//! pixels that no data window covers are 0.
//!
//! # What is taken for what
//! Channel names are only conventions; [`FrameChannels`] in [`ExrOptions`]
//! overrides them, and [`LoadedFrame::channels`] says what was used.
//!
//! | image | channels | becomes |
//! |---|---|---|
//! | colour | `R`, `G`, `B` and `A`, or `Y`; layers called *rgba*, *beauty*, *combined* … before others | linear colour as it is |
//! | depth | `Z`, `depth.Z`, `zdepth`, … ; `ZBack` only if there is nothing else | device depth, see [`DepthMeaning`] |
//! | normal | `X`, `Y`, `Z` or `R`, `G`, `B` of a layer called *N*, *normal* … | as it is, w = 1 where it is not 0 |
//! | velocity | `u`, `v` or `X`, `Y` of a layer called *back*, *forward*, *motion* … in pixels, y up | uv units, now minus before |
//! | specular | `R`, `G`, `B`, `A` of a layer called *specularMap* | as it is |
//!
//! Of a stereo file one view is read: the one asked for, or the one in which
//! colour is found first.
//!
//! # Untrusted files
//! All sizes in headers are checked against [`ExrOptions::max_bytes`] and the
//! length of the file before anything of that size is allocated. The decoder's
//! panics, if any are left, are caught and returned as errors.

mod assemble;
mod decode;
mod names;
mod save;

use std::path::Path;

use etalon_core::format::Format;
use glam::DVec2;
use thiserror::Error;

use crate::camera::{Camera, CameraError};
use crate::frame::{Frame, FrameError};

pub use names::{ChannelName, FrameChannels, Motion, MotionDirection};
pub use save::save_exr;

/// Why a file cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExrError {
    /// The file system says no.
    #[error("{path}: {source}")]
    Io {
        /// Which file.
        path: String,
        /// What went wrong.
        source: std::io::Error,
    },
    /// The file is no OpenEXR file, ends too early or contradicts itself.
    #[error("not a valid OpenEXR file: {0}")]
    Malformed(String),
    /// The file uses something that is not supported.
    #[error("unsupported OpenEXR file: {0}")]
    Unsupported(String),
    /// The file's header asks for more memory than allowed.
    #[error("{what} takes {bytes} bytes, over the limit of {limit}")]
    TooLarge {
        /// What it is.
        what: String,
        /// As the header says.
        bytes: u64,
        /// [`ExrOptions::max_bytes`].
        limit: u64,
    },
    /// The file has no channels that look like colour, and none were named.
    #[error("found no colour channels; name them among: {}", .available.join(", "))]
    NoColour {
        /// All channels of the file.
        available: Vec<String>,
    },
    /// A channel was named that the file does not have.
    #[error("there is no channel {name}; the file has: {}", .available.join(", "))]
    NoChannel {
        /// As named.
        name: ChannelName,
        /// All channels of the file.
        available: Vec<String>,
    },
    /// A view was named that the file does not have.
    #[error("there is no view {view:?}; the file has: {}", .available.join(", "))]
    NoView {
        /// As named.
        view: String,
        /// All views of the file.
        available: Vec<String>,
    },
    /// An option is no use.
    #[error("the option {option} is {value}; it must be {need}")]
    Option {
        /// Which one.
        option: &'static str,
        /// As given.
        value: String,
        /// What would be right.
        need: &'static str,
    },
    /// The camera options are no use.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The display window is not a possible frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The file cannot be encoded.
    #[error("cannot encode the file: {0}")]
    Encode(String),
}

/// What the numbers in a depth channel are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum DepthMeaning {
    /// Distance along the view axis: `−z_view`. What most renderers write.
    #[default]
    Planar,
    /// Distance from the eye along the ray, as some renderers write.
    Radial,
    /// Device depth of this crate's [projection](crate::camera), taken as it is.
    Device,
}

/// How to read a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrOptions {
    /// Channels to use; `None` means to look for them.
    pub channels: FrameChannels,
    /// Which view of a stereo file.
    pub view: Option<String>,
    /// Distance of the near plane, in the unit of the file's depth. Nearer
    /// points get device depths over 1: see [`LoadedFrame::nearest`].
    pub near: f64,
    /// Vertical field of view in radians; `None` takes it from the file's
    /// `screenWindowWidth`, the width of the picture at distance 1, which is 1
    /// where the writer did not care.
    pub vertical_fov: Option<f64>,
    /// What depth channels hold. A negative distance is taken for a `z_view`.
    pub depth: DepthMeaning,
    /// Distances from here on are the sky, as is a distance of 0. Renderers
    /// write large numbers, such as 1e10 or infinity, where nothing was hit.
    pub far: f64,
    /// What motion vectors are multiplied with, for writers that count y
    /// downwards (1, −1) or in another unit than pixels. A renderer that writes
    /// the motion while its shutter is open needs the inverse of that part of
    /// the frame's time.
    pub motion_scale: DVec2,
    /// `rgba16float`, or `rgba32float` for colours beyond ±65504.
    pub colour_format: Format,
    /// Most bytes of one part's pixels, and of all the frame's images together.
    pub max_bytes: u64,
}

impl Default for ExrOptions {
    fn default() -> Self {
        Self {
            channels: FrameChannels::default(),
            view: None,
            near: Camera::DEFAULT_NEAR,
            vertical_fov: None,
            depth: DepthMeaning::default(),
            far: 1e9,
            motion_scale: DVec2::ONE,
            colour_format: Format::Rgba16Float,
            max_bytes: 1 << 30,
        }
    }
}

/// A frame from a file, and what in the file it is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedFrame {
    /// The frame; images without channels in the file are 0.
    pub frame: Frame,
    /// The channels used; `None` where there were none.
    pub channels: FrameChannels,
    /// The view, if the file names views.
    pub view: Option<String>,
    /// Distance of the nearest surface along the view axis: where a near plane
    /// could be. `None` without depth channel or without any surface.
    pub nearest: Option<f64>,
    /// All channels of the file.
    pub available: Vec<ChannelName>,
}

/// Reads a frame from a file.
///
/// # Errors
/// If the file cannot be read, is invalid, uses deep or subsampled channels, is
/// larger than allowed, or has no channels of the names given or looked for.
pub fn load_exr(path: &Path, options: &ExrOptions) -> Result<LoadedFrame, ExrError> {
    let bytes = std::fs::read(path).map_err(|source| ExrError::Io {
        path: path.display().to_string(),
        source,
    })?;
    decode_exr(&bytes, options)
}

/// Reads a frame from the bytes of a file.
///
/// # Errors
/// As [`load_exr`].
pub fn decode_exr(bytes: &[u8], options: &ExrOptions) -> Result<LoadedFrame, ExrError> {
    if !matches!(
        options.colour_format,
        Format::Rgba16Float | Format::Rgba32Float
    ) {
        return Err(ExrError::Option {
            option: "colour_format",
            value: options.colour_format.to_string(),
            need: "rgba16float or rgba32float",
        });
    }
    if options.far.is_nan() || options.far <= 0.0 {
        return Err(ExrError::Option {
            option: "far",
            value: options.far.to_string(),
            need: "over 0",
        });
    }
    if !options.motion_scale.is_finite() {
        let value = options.motion_scale.to_string();
        return Err(ExrError::Option {
            option: "motion_scale",
            value,
            need: "finite",
        });
    }
    let file = decode::read_header(bytes, options.max_bytes)?;
    let (channels, view) = names::choose(&file, options)?;
    assemble::frame(bytes, &file, channels, view, options)
}

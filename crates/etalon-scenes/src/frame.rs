//! What a rendered frame hands to the effects.

use etalon_core::format::Format;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::resource::{Limits, ResourceError, TextureDesc};
use glam::DMat4;
use thiserror::Error;

use crate::camera::{Camera, CameraError, Projection};

/// Largest width and height of a frame: what desktop devices allow.
pub const MAX_SIDE: u32 = 16_384;

/// Why a frame cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A width or height of zero or beyond what is possible.
    #[error("a frame of {width}×{height} pixels is not possible: {source}")]
    Size {
        /// As asked.
        width: u32,
        /// As asked.
        height: u32,
        /// What is wrong with it.
        source: ResourceError,
    },
    /// An image cannot be made, as when memory runs out.
    #[error("the frame's {image} image: {source}")]
    Image {
        /// Its name.
        image: &'static str,
        /// What went wrong.
        source: ImageError,
    },
    /// The host has not that much memory to give.
    #[error("the {what} takes {bytes} bytes, which do not fit into memory")]
    OutOfMemory {
        /// What was to be made.
        what: &'static str,
        /// Bytes asked for.
        bytes: u64,
    },
    /// The camera has no projection for this size.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// A size that a frame can have; checked once, when made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameSize {
    width: u32,
    height: u32,
}

impl FrameSize {
    /// `width × height` pixels.
    ///
    /// # Errors
    /// If one is zero or over [`MAX_SIDE`], or the largest of the frame's images
    /// would take over 1 GiB.
    pub fn new(width: u32, height: u32) -> Result<Self, FrameError> {
        let limits = Limits {
            max_texture_2d: MAX_SIDE,
            ..Limits::default()
        };
        // Of the formats of a frame the one with the largest texels.
        TextureDesc::d2(width, height, Format::Rgba16Float)
            .validate(&limits)
            .map_err(|source| FrameError::Size {
                width,
                height,
                source,
            })?;
        Ok(Self { width, height })
    }

    /// Pixels in x.
    #[must_use]
    pub const fn width(self) -> u32 {
        self.width
    }

    /// Pixels in y.
    #[must_use]
    pub const fn height(self) -> u32 {
        self.height
    }

    /// All pixels.
    #[must_use]
    pub const fn pixels(self) -> usize {
        // Under 2²⁷ by the checks above.
        self.width as usize * self.height as usize
    }
}

/// The camera as the effects want it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCamera {
    /// Projection scales and near plane.
    pub projection: Projection,
    /// World to view space.
    pub view: DMat4,
    /// World to view space one frame earlier.
    pub previous_view: DMat4,
}

impl FrameCamera {
    /// The parameters of a camera for a picture of `size`.
    ///
    /// # Errors
    /// If the camera has no projection for this size.
    pub fn new(camera: &Camera, size: FrameSize) -> Result<Self, CameraError> {
        Ok(Self {
            projection: camera.projection(size)?,
            view: camera.pose().view_matrix(),
            previous_view: camera.previous_pose().view_matrix(),
        })
    }
}

/// One rendered frame: images of equal size, and the camera that saw them.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The camera.
    pub camera: FrameCamera,
    /// `rgba16float`: linear Rec. 709, scene-referred, without reflections;
    /// alpha is 1 where there is a surface.
    pub colour: ImageData,
    /// `r32float`: device depth, `near / −z_view`; 0 is the sky.
    pub depth: ImageData,
    /// `rgba16float`: unit normal in view space towards the camera, w = 1; all
    /// 0 for the sky.
    pub normal: ImageData,
    /// `rgba8unorm`: rgb is the specular reflectance at normal incidence, a the
    /// shininess, `1 − roughness`; all 0 for the sky.
    pub specular: ImageData,
    /// `rg16float`: uv now minus uv one frame earlier.
    pub velocity: ImageData,
}

impl Frame {
    /// Names and formats of the images.
    pub const IMAGES: [(&'static str, Format); 5] = [
        ("colour", Format::Rgba16Float),
        ("depth", Format::R32Float),
        ("normal", Format::Rgba16Float),
        ("specular", Format::Rgba8Unorm),
        ("velocity", Format::Rg16Float),
    ];

    /// A frame of nothing but black sky.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn empty(camera: FrameCamera, size: FrameSize) -> Result<Self, FrameError> {
        let image = |index: usize| {
            let (image, format) = Self::IMAGES[index];
            ImageData::zeroed(TextureDesc::d2(size.width, size.height, format))
                .map_err(|source| FrameError::Image { image, source })
        };
        Ok(Self {
            camera,
            colour: image(0)?,
            depth: image(1)?,
            normal: image(2)?,
            specular: image(3)?,
            velocity: image(4)?,
        })
    }

    /// Width and height.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        FrameSize {
            width: self.colour.desc.extent.width,
            height: self.colour.desc.extent.height,
        }
    }

    /// The images with their names, in the order of [`Frame::IMAGES`].
    #[must_use]
    pub const fn images(&self) -> [(&'static str, &ImageData); 5] {
        [
            (Self::IMAGES[0].0, &self.colour),
            (Self::IMAGES[1].0, &self.depth),
            (Self::IMAGES[2].0, &self.normal),
            (Self::IMAGES[3].0, &self.specular),
            (Self::IMAGES[4].0, &self.velocity),
        ]
    }

    /// The image of a name.
    #[must_use]
    pub fn image(&self, name: &str) -> Option<&ImageData> {
        self.images()
            .into_iter()
            .find(|(known, _)| *known == name)
            .map(|(_, image)| image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_sizes_are_refused_before_allocation() {
        for (width, height) in [
            (0, 0),
            (0, 5),
            (5, 0),
            (u32::MAX, u32::MAX),
            (16_385, 1),
            (16_384, 16_384),
        ] {
            assert!(
                matches!(FrameSize::new(width, height), Err(FrameError::Size { .. })),
                "{width}×{height}"
            );
        }
        for (width, height) in [
            (1, 1),
            (1, 4096),
            (7, 13),
            (257, 129),
            (1920, 1080),
            (8192, 4096),
        ] {
            let size = FrameSize::new(width, height).unwrap();
            assert_eq!(size.pixels() as u64, u64::from(width) * u64::from(height));
        }
    }

    #[test]
    fn an_empty_frame_is_all_zero_and_complete() {
        let size = FrameSize::new(7, 13).unwrap();
        let projection = Projection::perspective(1.0, 0.1, size).unwrap();
        let camera = FrameCamera {
            projection,
            view: DMat4::IDENTITY,
            previous_view: DMat4::IDENTITY,
        };
        let frame = Frame::empty(camera, size).unwrap();
        assert_eq!(frame.size(), size);
        for ((name, format), (known, image)) in Frame::IMAGES.into_iter().zip(frame.images()) {
            assert_eq!((name, format), (known, image.desc.format));
            assert_eq!(frame.image(name), Some(image));
            assert_eq!(
                image.bytes.len(),
                size.pixels() * format.texel_bytes() as usize
            );
            assert!(image.bytes.iter().all(|&byte| byte == 0));
        }
        assert_eq!(frame.image("nothing"), None);
    }
}

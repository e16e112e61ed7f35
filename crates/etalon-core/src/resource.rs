//! Descriptions of the things passes read and write: textures, buffers and
//! samplers. A description is plain data; nothing here owns memory.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::Format;

mod sampler;

pub use sampler::{AddressMode, Compare, Filter, LodRange, SamplerDesc};

/// The most layers a texture may have, whatever the device says: no device
/// offers more, and planning follows every layer of every mip.
pub const MAX_LAYERS: u32 = 4096;

/// The most mips a texture can have: sizes are 32-bit numbers.
pub const MAX_MIPS: u32 = 32;

/// The shape of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Dimension {
    /// Width × height × array layers.
    D2,
    /// Six layers per cube, seen as cubes.
    Cube,
    /// Width × height × depth.
    D3,
}

/// Width, height and depth (3D) or array layers (2D, cube: a multiple of six).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Extent {
    /// Texels in x.
    pub width: u32,
    /// Texels in y.
    pub height: u32,
    /// Texels in z for 3D textures, layers otherwise.
    pub depth_or_layers: u32,
}

impl Extent {
    /// An extent of one layer.
    #[must_use]
    pub const fn d2(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            depth_or_layers: 1,
        }
    }
}

/// Everything there is to know about a texture before it exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct TextureDesc {
    /// Shape.
    pub dimension: Dimension,
    /// Size of mip 0.
    pub extent: Extent,
    /// Number of mip levels, at least 1.
    pub mips: u32,
    /// Texel format.
    pub format: Format,
}

/// What is wrong with a texture or buffer description.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ResourceError {
    /// An extent, mip count or buffer size is zero.
    #[error(
        "{what} is zero; every texture has at least one texel and one mip, every buffer at least 4 bytes"
    )]
    Empty {
        /// Which of the sizes.
        what: &'static str,
    },
    /// More mips than the extent has.
    #[error("{mips} mips asked for, but {width}×{height}×{depth} has at most {max}")]
    TooManyMips {
        /// As asked.
        mips: u32,
        /// As possible.
        max: u32,
        /// Width of mip 0.
        width: u32,
        /// Height of mip 0.
        height: u32,
        /// Depth of mip 0 (1 for layered textures).
        depth: u32,
    },
    /// A cube whose faces are not square or whose layers are not a multiple of six.
    #[error(
        "a cube needs square faces and a multiple of six layers, not {width}×{height} with {layers} layers"
    )]
    NotACube {
        /// Width of mip 0.
        width: u32,
        /// Height of mip 0.
        height: u32,
        /// Layers given.
        layers: u32,
    },
    /// A size above what the device can do.
    #[error("{what} is {size}, over the device's limit of {limit}")]
    OverLimit {
        /// Which limit.
        what: &'static str,
        /// As asked.
        size: u64,
        /// As possible.
        limit: u64,
    },
}

impl TextureDesc {
    /// A 2D texture of one mip and one layer.
    #[must_use]
    pub const fn d2(width: u32, height: u32, format: Format) -> Self {
        Self {
            dimension: Dimension::D2,
            extent: Extent::d2(width, height),
            mips: 1,
            format,
        }
    }

    /// A cube map with square faces of `size` texels.
    #[must_use]
    pub const fn cube(size: u32, format: Format) -> Self {
        Self {
            dimension: Dimension::Cube,
            extent: Extent {
                width: size,
                height: size,
                depth_or_layers: 6,
            },
            mips: 1,
            format,
        }
    }

    /// A 3D texture of one mip.
    #[must_use]
    pub const fn d3(width: u32, height: u32, depth: u32, format: Format) -> Self {
        Self {
            dimension: Dimension::D3,
            extent: Extent {
                width,
                height,
                depth_or_layers: depth,
            },
            mips: 1,
            format,
        }
    }

    /// The same texture with `mips` levels.
    #[must_use]
    pub const fn with_mips(mut self, mips: u32) -> Self {
        self.mips = mips;
        self
    }

    /// The same texture in another format.
    #[must_use]
    pub const fn with_format(mut self, format: Format) -> Self {
        self.format = format;
        self
    }

    /// The same texture at half the width and height, rounded up, with one mip.
    ///
    /// Rounding up keeps every source texel covered by a target texel.
    #[must_use]
    pub const fn half(mut self) -> Self {
        self.extent.width = self.extent.width.div_ceil(2);
        self.extent.height = self.extent.height.div_ceil(2);
        self.mips = 1;
        self
    }

    /// The size of a mip level in texels; layers do not shrink, depth does.
    /// WebGPU and Vulkan round down and never go below one.
    #[must_use]
    pub const fn mip_extent(&self, mip: u32) -> Extent {
        const fn shrink(size: u32, mip: u32) -> u32 {
            let size = if mip < 32 { size >> mip } else { 0 };
            if size == 0 { 1 } else { size }
        }
        Extent {
            width: shrink(self.extent.width, mip),
            height: shrink(self.extent.height, mip),
            depth_or_layers: match self.dimension {
                Dimension::D3 => shrink(self.extent.depth_or_layers, mip),
                Dimension::D2 | Dimension::Cube => self.extent.depth_or_layers,
            },
        }
    }

    /// Array layers: 1 for 3D textures.
    #[must_use]
    pub const fn layers(&self) -> u32 {
        match self.dimension {
            Dimension::D3 => 1,
            Dimension::D2 | Dimension::Cube => self.extent.depth_or_layers,
        }
    }

    /// The mip count of a full chain.
    #[must_use]
    pub const fn max_mips(&self) -> u32 {
        let mut size = if self.extent.width > self.extent.height {
            self.extent.width
        } else {
            self.extent.height
        };
        if matches!(self.dimension, Dimension::D3) && self.extent.depth_or_layers > size {
            size = self.extent.depth_or_layers;
        }
        if size == 0 {
            1
        } else {
            32 - size.leading_zeros()
        }
    }

    /// Bytes of one mip level of all layers, tightly packed; `None` if that overflows.
    #[must_use]
    pub fn mip_bytes(&self, mip: u32) -> Option<u64> {
        let extent = self.mip_extent(mip);
        u64::from(extent.width)
            .checked_mul(u64::from(extent.height))?
            .checked_mul(u64::from(extent.depth_or_layers))?
            .checked_mul(u64::from(self.format.texel_bytes()))
    }

    /// Bytes of all mips and layers, tightly packed; `None` if that overflows.
    #[must_use]
    pub fn bytes(&self) -> Option<u64> {
        (0..self.mips).try_fold(0_u64, |sum, mip| sum.checked_add(self.mip_bytes(mip)?))
    }

    /// Checks the description against itself and the limits, allocating nothing.
    ///
    /// # Errors
    /// The first rule it breaks.
    pub fn validate(&self, limits: &Limits) -> Result<(), ResourceError> {
        let Extent {
            width,
            height,
            depth_or_layers,
        } = self.extent;
        for (what, size) in [
            ("width", width),
            ("height", height),
            ("depth or layer count", depth_or_layers),
            ("mip count", self.mips),
        ] {
            if size == 0 {
                return Err(ResourceError::Empty { what });
            }
        }
        let (flat, deep) = match self.dimension {
            Dimension::D2 | Dimension::Cube => (
                limits.max_texture_2d,
                limits.max_texture_layers.min(MAX_LAYERS),
            ),
            Dimension::D3 => (limits.max_texture_3d, limits.max_texture_3d),
        };
        for (what, size, limit) in [
            ("texture width", width, flat),
            ("texture height", height, flat),
            ("texture depth or layers", depth_or_layers, deep),
        ] {
            if size > limit {
                return Err(ResourceError::OverLimit {
                    what,
                    size: size.into(),
                    limit: limit.into(),
                });
            }
        }
        if self.dimension == Dimension::Cube && (width != height || depth_or_layers % 6 != 0) {
            return Err(ResourceError::NotACube {
                width,
                height,
                layers: depth_or_layers,
            });
        }
        let max = self.max_mips();
        if self.mips > max {
            let depth = if self.dimension == Dimension::D3 {
                depth_or_layers
            } else {
                1
            };
            return Err(ResourceError::TooManyMips {
                mips: self.mips,
                max,
                width,
                height,
                depth,
            });
        }
        let size = self.bytes().unwrap_or(u64::MAX);
        if size > limits.max_texture_bytes {
            return Err(ResourceError::OverLimit {
                what: "texture size in bytes",
                size,
                limit: limits.max_texture_bytes,
            });
        }
        Ok(())
    }
}

/// Everything there is to know about a buffer before it exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct BufferDesc {
    /// Size in bytes, a positive multiple of 4.
    pub bytes: u64,
}

impl BufferDesc {
    /// Checks the size, allocating nothing.
    ///
    /// # Errors
    /// If it is zero or over the limit.
    pub fn validate(&self, limits: &Limits) -> Result<(), ResourceError> {
        if self.bytes < 4 {
            return Err(ResourceError::Empty {
                what: "buffer size",
            });
        }
        if self.bytes > limits.max_buffer_bytes {
            return Err(ResourceError::OverLimit {
                what: "buffer size in bytes",
                size: self.bytes,
                limit: limits.max_buffer_bytes,
            });
        }
        Ok(())
    }
}

/// What a device can do, as far as planning must know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Largest width and height of 2D and cube textures.
    pub max_texture_2d: u32,
    /// Largest width, height and depth of 3D textures.
    pub max_texture_3d: u32,
    /// Most array layers.
    pub max_texture_layers: u32,
    /// Most bytes in one texture.
    pub max_texture_bytes: u64,
    /// Most bytes in one buffer.
    pub max_buffer_bytes: u64,
    /// Most workgroups in one dimension of a dispatch.
    pub max_workgroups: u32,
    /// Most invocations of one workgroup.
    pub max_workgroup_invocations: u32,
    /// Most bytes of workgroup memory.
    pub max_workgroup_bytes: u32,
    /// Alignment of uniform blocks within a buffer, a power of two.
    pub uniform_alignment: u32,
    /// Whether formats of [`StorageSupport::Extended`](crate::format::StorageSupport)
    /// may be written by kernels.
    pub extended_storage_formats: bool,
}

impl Default for Limits {
    /// WebGPU's guaranteed limits.
    fn default() -> Self {
        Self {
            max_texture_2d: 8192,
            max_texture_3d: 2048,
            max_texture_layers: 256,
            max_texture_bytes: 1 << 30,
            max_buffer_bytes: 1 << 28,
            max_workgroups: 65_535,
            max_workgroup_invocations: 256,
            max_workgroup_bytes: 16_384,
            uniform_alignment: 256,
            extended_storage_formats: false,
        }
    }
}

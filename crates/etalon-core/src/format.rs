//! Texel formats that WebGPU and Vulkan share.
//!
//! The names follow WebGPU's `GPUTextureFormat` with the usual Rust spelling;
//! the Vulkan name is in each variant's documentation where it is not obvious.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What a channel of a format holds, and so which WGSL type a load returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SampleKind {
    /// Floating point or normalised integers: loads return `f32`.
    Float,
    /// Signed integers: loads return `i32`.
    Sint,
    /// Unsigned integers: loads return `u32`.
    Uint,
    /// Depth: loads return one `f32`; may be compared by a sampler.
    Depth,
}

impl fmt::Display for SampleKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Float => "float",
            Self::Sint => "sint",
            Self::Uint => "uint",
            Self::Depth => "depth",
        })
    }
}

/// How the bits of one channel are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Encoding {
    /// `k / (2^bits - 1)`, in `[0, 1]`.
    Unorm,
    /// [`Encoding::Unorm`] after the sRGB transfer function (alpha is linear).
    UnormSrgb,
    /// `max(k / (2^(bits-1) - 1), -1)`, in `[-1, 1]`.
    Snorm,
    /// Unsigned integer.
    Uint,
    /// Two's complement integer.
    Sint,
    /// IEEE 754 binary16 or binary32, by the channel's width.
    Float,
    /// Unsigned float with a 5-bit exponent (6-bit mantissa at 11 bits, 5-bit
    /// at 10 bits), as in `B10G11R11_UFLOAT_PACK32`.
    Ufloat,
    /// Three 9-bit mantissas sharing one 5-bit exponent.
    SharedExponent,
}

macro_rules! formats {
    ($($(#[$doc:meta])* $variant:ident, $wgpu:literal, $bytes:literal, $channels:literal, $encoding:ident, $kind:ident, $storage:ident;)*) => {
        /// A texel format.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum Format {
            $($(#[$doc])* $variant,)*
        }

        impl Format {
            /// Every format, in declaration order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The WebGPU name, e.g. `rgba16float`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $wgpu,)* }
            }

            /// Bytes of one texel.
            #[must_use]
            pub const fn texel_bytes(self) -> u32 {
                match self { $(Self::$variant => $bytes,)* }
            }

            /// Number of channels stored.
            #[must_use]
            pub const fn channels(self) -> u32 {
                match self { $(Self::$variant => $channels,)* }
            }

            /// How each channel is encoded.
            #[must_use]
            pub const fn encoding(self) -> Encoding {
                match self { $(Self::$variant => Encoding::$encoding,)* }
            }

            /// What a shader load returns.
            #[must_use]
            pub const fn sample_kind(self) -> SampleKind {
                match self { $(Self::$variant => SampleKind::$kind,)* }
            }

            /// Who may use the format for a storage texture.
            #[must_use]
            pub const fn storage(self) -> StorageSupport {
                match self { $(Self::$variant => StorageSupport::$storage,)* }
            }
        }
    };
}

/// Whether a format can be written by `textureStore`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum StorageSupport {
    /// On every WebGPU and Vulkan device.
    Core,
    /// On devices that say so (Vulkan `shaderStorageImageExtendedFormats`,
    /// WebGPU `texture-formats-tier1`).
    Extended,
    /// Never.
    None,
}

formats! {
    /// One 8-bit channel in `[0, 1]`.
    R8Unorm, "r8unorm", 1, 1, Unorm, Float, Extended;
    /// One 8-bit channel in `[-1, 1]`.
    R8Snorm, "r8snorm", 1, 1, Snorm, Float, Extended;
    /// One 8-bit unsigned integer.
    R8Uint, "r8uint", 1, 1, Uint, Uint, Extended;
    /// One 8-bit signed integer.
    R8Sint, "r8sint", 1, 1, Sint, Sint, Extended;
    /// One 16-bit unsigned integer.
    R16Uint, "r16uint", 2, 1, Uint, Uint, Extended;
    /// One 16-bit signed integer.
    R16Sint, "r16sint", 2, 1, Sint, Sint, Extended;
    /// One half float.
    R16Float, "r16float", 2, 1, Float, Float, Extended;
    /// Two 8-bit channels in `[0, 1]`.
    Rg8Unorm, "rg8unorm", 2, 2, Unorm, Float, Extended;
    /// Two 8-bit channels in `[-1, 1]`.
    Rg8Snorm, "rg8snorm", 2, 2, Snorm, Float, Extended;
    /// Two 8-bit unsigned integers.
    Rg8Uint, "rg8uint", 2, 2, Uint, Uint, Extended;
    /// Two 8-bit signed integers.
    Rg8Sint, "rg8sint", 2, 2, Sint, Sint, Extended;
    /// One 32-bit unsigned integer.
    R32Uint, "r32uint", 4, 1, Uint, Uint, Core;
    /// One 32-bit signed integer.
    R32Sint, "r32sint", 4, 1, Sint, Sint, Core;
    /// One single-precision float.
    R32Float, "r32float", 4, 1, Float, Float, Core;
    /// Two 16-bit unsigned integers.
    Rg16Uint, "rg16uint", 4, 2, Uint, Uint, Extended;
    /// Two 16-bit signed integers.
    Rg16Sint, "rg16sint", 4, 2, Sint, Sint, Extended;
    /// Two half floats.
    Rg16Float, "rg16float", 4, 2, Float, Float, Extended;
    /// Four 8-bit channels in `[0, 1]`.
    Rgba8Unorm, "rgba8unorm", 4, 4, Unorm, Float, Core;
    /// Four 8-bit channels, sRGB-encoded colour and linear alpha.
    Rgba8UnormSrgb, "rgba8unorm-srgb", 4, 4, UnormSrgb, Float, None;
    /// Four 8-bit channels in `[-1, 1]`.
    Rgba8Snorm, "rgba8snorm", 4, 4, Snorm, Float, Core;
    /// Four 8-bit unsigned integers.
    Rgba8Uint, "rgba8uint", 4, 4, Uint, Uint, Core;
    /// Four 8-bit signed integers.
    Rgba8Sint, "rgba8sint", 4, 4, Sint, Sint, Core;
    /// Four 8-bit channels in `[0, 1]`, blue first in memory.
    Bgra8Unorm, "bgra8unorm", 4, 4, Unorm, Float, Extended;
    /// Shared-exponent colour (Vulkan `E5B9G9R9_UFLOAT_PACK32`).
    Rgb9e5Ufloat, "rgb9e5ufloat", 4, 3, SharedExponent, Float, None;
    /// 10-bit colour and 2-bit alpha, normalised (Vulkan `A2B10G10R10_UNORM_PACK32`).
    Rgb10a2Unorm, "rgb10a2unorm", 4, 4, Unorm, Float, Extended;
    /// Small unsigned floats (Vulkan `B10G11R11_UFLOAT_PACK32`).
    Rg11b10Ufloat, "rg11b10ufloat", 4, 3, Ufloat, Float, Extended;
    /// Two 32-bit unsigned integers.
    Rg32Uint, "rg32uint", 8, 2, Uint, Uint, Core;
    /// Two 32-bit signed integers.
    Rg32Sint, "rg32sint", 8, 2, Sint, Sint, Core;
    /// Two single-precision floats.
    Rg32Float, "rg32float", 8, 2, Float, Float, Core;
    /// Four 16-bit unsigned integers.
    Rgba16Uint, "rgba16uint", 8, 4, Uint, Uint, Core;
    /// Four 16-bit signed integers.
    Rgba16Sint, "rgba16sint", 8, 4, Sint, Sint, Core;
    /// Four half floats.
    Rgba16Float, "rgba16float", 8, 4, Float, Float, Core;
    /// Four 32-bit unsigned integers.
    Rgba32Uint, "rgba32uint", 16, 4, Uint, Uint, Core;
    /// Four 32-bit signed integers.
    Rgba32Sint, "rgba32sint", 16, 4, Sint, Sint, Core;
    /// Four single-precision floats.
    Rgba32Float, "rgba32float", 16, 4, Float, Float, Core;
    /// 16-bit normalised depth.
    Depth16Unorm, "depth16unorm", 2, 1, Unorm, Depth, None;
    /// Single-precision depth.
    Depth32Float, "depth32float", 4, 1, Float, Depth, None;
}

impl Format {
    /// Whether a filtering sampler may read the format on every device.
    ///
    /// 32-bit floats need a device feature in WebGPU, integers are never
    /// filtered.
    #[must_use]
    pub const fn filterable(self) -> bool {
        match self.sample_kind() {
            SampleKind::Float => {
                !matches!(self, Self::R32Float | Self::Rg32Float | Self::Rgba32Float)
            }
            SampleKind::Depth => true,
            SampleKind::Sint | SampleKind::Uint => false,
        }
    }

    /// Whether every device can draw to the format: to colour formats as colour
    /// targets, to depth formats as depth targets.
    #[must_use]
    pub const fn renderable(self) -> bool {
        !matches!(
            self,
            Self::R8Snorm
                | Self::Rg8Snorm
                | Self::Rgba8Snorm
                | Self::Rgb9e5Ufloat
                | Self::Rg11b10Ufloat
        )
    }

    /// Whether every device can blend what is drawn to the format with what is
    /// there.
    #[must_use]
    pub const fn blendable(self) -> bool {
        self.renderable() && matches!(self.sample_kind(), SampleKind::Float) && self.filterable()
    }

    /// The format with the given WebGPU name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|format| format.name() == name)
    }

    /// The widths of the stored channels in bits, lowest memory first.
    #[must_use]
    pub fn channel_bits(self) -> &'static [u32] {
        match self {
            Self::Rgb9e5Ufloat => &[9, 9, 9],
            Self::Rgb10a2Unorm => &[10, 10, 10, 2],
            Self::Rg11b10Ufloat => &[11, 11, 10],
            _ => match (self.channels(), self.texel_bytes() * 8 / self.channels()) {
                (1, 8) => &[8],
                (1, 16) => &[16],
                (1, _) => &[32],
                (2, 8) => &[8; 2],
                (2, 16) => &[16; 2],
                (2, _) => &[32; 2],
                (_, 8) => &[8; 4],
                (_, 16) => &[16; 4],
                _ => &[32; 4],
            },
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

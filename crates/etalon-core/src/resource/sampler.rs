//! Samplers: how a kernel's filtered reads address and combine texels.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What happens to coordinates outside the texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum AddressMode {
    /// The edge texel is repeated.
    #[default]
    ClampToEdge,
    /// The texture is repeated.
    Repeat,
    /// The texture is repeated, mirrored every other time.
    MirrorRepeat,
}

/// How texels are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Filter {
    /// The nearest one.
    #[default]
    Nearest,
    /// Weighted by distance.
    Linear,
}

/// How a comparison sampler compares: `reference OP texel`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Compare {
    /// Never true.
    Never,
    /// `reference < texel`.
    Less,
    /// `reference == texel`.
    Equal,
    /// `reference <= texel`.
    LessEqual,
    /// `reference > texel`.
    Greater,
    /// `reference != texel`.
    NotEqual,
    /// `reference >= texel`.
    GreaterEqual,
    /// Always true.
    Always,
}

/// The levels of detail a sampler reads, in units of 1/256 of a level: what is
/// asked for is clamped to them before mips are chosen.
///
/// Eight bits of fraction are what devices resolve between two mips.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct LodRange {
    /// The least, at most `max`.
    pub min: u16,
    /// The greatest.
    pub max: u16,
}

impl LodRange {
    /// Every level of any texture.
    pub const ALL: Self = Self {
        min: 0,
        max: u16::MAX,
    };

    /// The least as a level of detail.
    #[must_use]
    pub fn min_level(self) -> f32 {
        f32::from(self.min) / 256.0
    }

    /// The greatest as a level of detail.
    #[must_use]
    pub fn max_level(self) -> f32 {
        f32::from(self.max) / 256.0
    }

    /// Whether the least is not above the greatest.
    #[must_use]
    pub const fn is_valid(self) -> bool {
        self.min <= self.max
    }
}

impl Default for LodRange {
    fn default() -> Self {
        Self::ALL
    }
}

impl fmt::Display for LodRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..={}", self.min_level(), self.max_level())
    }
}

/// A sampler. The level of detail is always explicit in Etalon's kernels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct SamplerDesc {
    /// Addressing in u, v and w.
    pub address: [AddressMode; 3],
    /// Within a mip level, where the level of detail is at most 0.
    pub mag_filter: Filter,
    /// Within a mip level, where the level of detail is above 0.
    pub min_filter: Filter,
    /// Between mip levels.
    pub mip_filter: Filter,
    /// What the level of detail is clamped to.
    pub lod: LodRange,
    /// Makes it a comparison sampler, for depth textures.
    pub compare: Option<Compare>,
}

impl SamplerDesc {
    /// Linear within and between mips, clamped to the edge.
    pub const LINEAR_CLAMP: Self =
        Self::new(AddressMode::ClampToEdge, Filter::Linear, Filter::Linear);

    /// A sampler of all levels with one way of addressing, one filter within
    /// mip levels and one between them.
    #[must_use]
    pub const fn new(address: AddressMode, filter: Filter, mip_filter: Filter) -> Self {
        Self {
            address: [address; 3],
            mag_filter: filter,
            min_filter: filter,
            mip_filter,
            lod: LodRange::ALL,
            compare: None,
        }
    }

    /// The same as a comparison sampler.
    #[must_use]
    pub const fn comparing(mut self, compare: Compare) -> Self {
        self.compare = Some(compare);
        self
    }
}

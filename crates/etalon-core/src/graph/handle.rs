//! Handles to the resources of a graph.
//!
//! A handle names one *version* of a resource: every write returns a new one.
//! Whoever holds a handle has said which contents they mean, so the order of
//! passes follows from the handles alone.

use serde::Serialize;

/// Which graph a handle belongs to; handles of another graph are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct GraphId(pub(crate) u32);

/// One version of a texture in a [`Graph`](super::Graph).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Texture {
    pub(crate) graph: GraphId,
    pub(crate) resource: u32,
    pub(crate) version: u32,
}

/// One version of a buffer in a [`Graph`](super::Graph).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Buffer {
    pub(crate) graph: GraphId,
    pub(crate) resource: u32,
    pub(crate) version: u32,
}

/// A run of mips and layers. Layers count array layers and cube faces; 3D
/// textures have one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Subresources {
    /// First mip.
    pub mip: u32,
    /// Number of mips; `u32::MAX` means all that follow.
    pub mips: u32,
    /// First layer.
    pub layer: u32,
    /// Number of layers; `u32::MAX` means all that follow.
    pub layers: u32,
}

impl Subresources {
    /// Every mip and layer.
    pub const ALL: Self = Self {
        mip: 0,
        mips: u32::MAX,
        layer: 0,
        layers: u32::MAX,
    };

    /// The run with `u32::MAX` replaced by what the texture has, or `None` if
    /// it is empty or reaches outside.
    pub(crate) fn resolve(self, mips: u32, layers: u32) -> Option<Self> {
        let run = |first: u32, count: u32, available: u32| {
            let left = available.checked_sub(first)?;
            let count = if count == u32::MAX { left } else { count };
            (count > 0 && count <= left).then_some(count)
        };
        Some(Self {
            mips: run(self.mip, self.mips, mips)?,
            layers: run(self.layer, self.layers, layers)?,
            ..self
        })
    }

    /// The flat indices (`mip * layers_of_texture + layer`) of a resolved run.
    pub(crate) fn indices(self, layers_of_texture: u32) -> impl Iterator<Item = usize> {
        (self.mip..self.mip + self.mips).flat_map(move |mip| {
            (self.layer..self.layer + self.layers)
                .map(move |layer| (mip * layers_of_texture + layer) as usize)
        })
    }

    /// Whether two resolved runs share a mip of a layer.
    pub(crate) fn overlaps(self, other: Self) -> bool {
        let meet = |a: u32, n: u32, b: u32, m: u32| a < b + m && b < a + n;
        meet(self.mip, self.mips, other.mip, other.mips)
            && meet(self.layer, self.layers, other.layer, other.layers)
    }
}

/// A texture, or some of its mips and layers, as one binding sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureView {
    pub(crate) texture: Texture,
    pub(crate) range: Subresources,
}

impl Texture {
    /// One mip of all layers.
    #[must_use]
    pub fn mip(self, mip: u32) -> TextureView {
        TextureView {
            texture: self,
            range: Subresources {
                mip,
                mips: 1,
                ..Subresources::ALL
            },
        }
    }

    /// `count` mips from `first` of all layers.
    #[must_use]
    pub fn mips(self, first: u32, count: u32) -> TextureView {
        TextureView {
            texture: self,
            range: Subresources {
                mip: first,
                mips: count,
                ..Subresources::ALL
            },
        }
    }

    /// One layer of all mips.
    #[must_use]
    pub fn layer(self, layer: u32) -> TextureView {
        TextureView {
            texture: self,
            range: Subresources {
                layer,
                layers: 1,
                ..Subresources::ALL
            },
        }
    }
}

impl TextureView {
    /// The same view, of one layer only.
    #[must_use]
    pub fn layer(mut self, layer: u32) -> Self {
        self.range.layer = layer;
        self.range.layers = 1;
        self
    }
}

impl From<Texture> for TextureView {
    fn from(texture: Texture) -> Self {
        Self {
            texture,
            range: Subresources::ALL,
        }
    }
}

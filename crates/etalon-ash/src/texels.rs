//! How texels lie in the buffers that carry them to and from the host.

use ash::vk;
use etalon_core::graph::Subresources;
use etalon_core::resource::{Dimension, Extent, TextureDesc};

use crate::convert;

/// Where a mip begins: a multiple of every texel's size, and of what copies
/// between buffers and images ask for.
const ALIGNMENT: u64 = 16;

/// The next place in a buffer where texels may begin.
pub(crate) const fn align(offset: u64) -> u64 {
    offset.next_multiple_of(ALIGNMENT)
}

/// One mip in such a buffer, tightly packed: layers or slices in order, in
/// each the rows from top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Mip {
    /// First byte.
    pub(crate) offset: u64,
    /// Number of bytes.
    pub(crate) bytes: usize,
}

/// Part of a texture in a buffer.
#[derive(Clone, Debug)]
pub(crate) struct Texels {
    pub(crate) regions: Vec<vk::BufferImageCopy>,
    pub(crate) mips: Vec<Mip>,
    /// Behind the last byte.
    pub(crate) end: u64,
}

impl Texels {
    /// Lays out part of a texture from a byte on; `None` if that overflows.
    pub(crate) fn new(desc: &TextureDesc, range: Subresources, start: u64) -> Option<Self> {
        let mut this = Self {
            regions: Vec::new(),
            mips: Vec::new(),
            end: start,
        };
        for mip in range.mip..range.mip.checked_add(range.mips)? {
            let extent = convert::copy_extent(desc, mip);
            let bytes = u64::from(extent.width)
                .checked_mul(extent.height.into())?
                .checked_mul(extent.depth.into())?
                .checked_mul(range.layers.into())?
                .checked_mul(desc.format.texel_bytes().into())?;
            let offset = this.end.checked_next_multiple_of(ALIGNMENT)?;
            this.regions.push(
                vk::BufferImageCopy::default()
                    .buffer_offset(offset)
                    .image_subresource(convert::layers(desc.format, range, mip))
                    .image_extent(extent),
            );
            this.mips.push(Mip {
                offset,
                bytes: usize::try_from(bytes).ok()?,
            });
            this.end = offset.checked_add(bytes)?;
        }
        Some(this)
    }
}

/// Part of a texture as a texture of its own, as captures are given back: 2D,
/// unless it is a whole cube or 3D.
pub(crate) fn part(desc: &TextureDesc, range: Subresources) -> TextureDesc {
    let extent = desc.mip_extent(range.mip);
    let (dimension, depth_or_layers) = match desc.dimension {
        Dimension::D3 => (Dimension::D3, extent.depth_or_layers),
        Dimension::Cube if range.layers == desc.layers() => (Dimension::Cube, range.layers),
        Dimension::D2 | Dimension::Cube => (Dimension::D2, range.layers),
    };
    TextureDesc {
        dimension,
        extent: Extent {
            depth_or_layers,
            ..extent
        },
        mips: range.mips,
        format: desc.format,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_core::Format;

    #[test]
    fn mips_begin_at_aligned_bytes_and_do_not_overlap() {
        let desc = TextureDesc::d2(3, 3, Format::R8Unorm).with_mips(2);
        let texels = Texels::new(&desc, convert::whole(&desc), 5).unwrap();
        assert_eq!(
            texels.mips,
            [
                Mip {
                    offset: 16,
                    bytes: 9
                },
                Mip {
                    offset: 32,
                    bytes: 1
                }
            ]
        );
        assert_eq!(texels.end, 33);
    }

    #[test]
    fn the_size_is_that_of_the_part() {
        let desc = TextureDesc {
            mips: 3,
            extent: Extent {
                width: 8,
                height: 4,
                depth_or_layers: 5,
            },
            ..TextureDesc::d2(8, 4, Format::Rgba32Float)
        };
        for dimension in [Dimension::D2, Dimension::D3] {
            let desc = TextureDesc { dimension, ..desc };
            let range = Subresources {
                mip: 1,
                mips: 2,
                layer: 0,
                layers: desc.layers().min(2),
            };
            let part = part(&desc, range);
            let texels = Texels::new(&desc, range, 0).unwrap();
            let bytes: usize = texels.mips.iter().map(|mip| mip.bytes).sum();
            assert_eq!(Some(bytes as u64), part.bytes(), "{dimension:?}");
            assert_eq!(part.mips, 2);
        }
    }

    #[test]
    fn sizes_that_overflow_are_none() {
        let desc = TextureDesc {
            extent: Extent {
                width: u32::MAX,
                height: u32::MAX,
                depth_or_layers: u32::MAX,
            },
            ..TextureDesc::d2(1, 1, Format::Rgba32Float)
        };
        assert!(Texels::new(&desc, convert::whole(&desc), 0).is_none());
    }
}

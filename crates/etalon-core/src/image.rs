//! Images in host memory: what goes into a frame and what is read back.

use thiserror::Error;

use crate::format::Format;
use crate::resource::{Limits, ResourceError, TextureDesc};
use crate::texel::Texel;

/// A texture's texels in host memory.
///
/// `bytes` is tightly packed: mip 0 first; in each mip the array layers (or
/// depth slices) in order; in each of those the rows from top to bottom,
/// without padding. The constructors guarantee that its length is
/// [`TextureDesc::bytes`]; with fields changed since, accessors answer `None`
/// rather than panic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageData {
    /// Shape and format.
    pub desc: TextureDesc,
    /// The texels.
    pub bytes: Vec<u8>,
}

/// Why an image cannot be made or read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The description is not of a possible texture.
    #[error(transparent)]
    Description(#[from] ResourceError),
    /// The bytes given are not what the description needs.
    #[error(
        "{format} {width}×{height}×{depth_or_layers} with {mips} mips takes {expected} bytes, but {actual} are given"
    )]
    WrongLength {
        /// Texel format.
        format: Format,
        /// Width of mip 0.
        width: u32,
        /// Height of mip 0.
        height: u32,
        /// Depth or layers of mip 0.
        depth_or_layers: u32,
        /// Mip levels.
        mips: u32,
        /// Bytes needed.
        expected: u64,
        /// Bytes given.
        actual: u64,
    },
    /// The number of texels given is not what the description needs.
    #[error("{expected} texels are needed, but {actual} are given")]
    WrongTexelCount {
        /// Texels needed.
        expected: u64,
        /// Texels given.
        actual: u64,
    },
    /// The host has not that much memory to give.
    #[error("an image of {bytes} bytes does not fit into memory")]
    OutOfMemory {
        /// Bytes asked for.
        bytes: u64,
    },
    /// A texel outside the image.
    #[error("no texel at x {x}, y {y}, layer {layer}, mip {mip}")]
    OutOfRange {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Array layer or depth slice.
        layer: u32,
        /// Mip level.
        mip: u32,
    },
}

/// What the host can hold: no device's limits, only those of addresses.
fn host_limits() -> Limits {
    Limits {
        max_texture_2d: u32::MAX,
        max_texture_3d: u32::MAX,
        max_texture_layers: u32::MAX,
        max_texture_bytes: isize::MAX as u64,
        ..Limits::default()
    }
}

impl ImageData {
    /// An image of zero bytes, which every format reads as 0 in the channels it
    /// has.
    ///
    /// # Errors
    /// If the description is not of a possible texture, or memory runs out.
    pub fn zeroed(desc: TextureDesc) -> Result<Self, ImageError> {
        desc.validate(&host_limits())?;
        let size = desc.bytes().unwrap_or(u64::MAX);
        let mut bytes = reserve(size, size)?;
        // The reservation has shown that the size fits `usize`.
        bytes.resize(size as usize, 0);
        Ok(Self { desc, bytes })
    }

    /// An image of the given bytes, laid out as [`ImageData`] says.
    ///
    /// # Errors
    /// If the description is not of a possible texture, or the length is not
    /// what it needs.
    pub fn from_bytes(desc: TextureDesc, bytes: Vec<u8>) -> Result<Self, ImageError> {
        desc.validate(&host_limits())?;
        let expected = desc.bytes().unwrap_or(u64::MAX);
        let actual = bytes.len() as u64;
        if expected != actual {
            return Err(ImageError::WrongLength {
                format: desc.format,
                width: desc.extent.width,
                height: desc.extent.height,
                depth_or_layers: desc.extent.depth_or_layers,
                mips: desc.mips,
                expected,
                actual,
            });
        }
        Ok(Self { desc, bytes })
    }

    /// An image of red, green, blue, alpha values in the order of the bytes,
    /// encoded by the format's rules ([`Format::encode`]).
    ///
    /// # Errors
    /// If the description is not of a possible texture, the number of texels is
    /// not what it needs, or memory runs out.
    pub fn from_rgba_f32(desc: TextureDesc, texels: &[[f32; 4]]) -> Result<Self, ImageError> {
        desc.validate(&host_limits())?;
        let expected = desc.bytes().unwrap_or(u64::MAX) / u64::from(desc.format.texel_bytes());
        let actual = texels.len() as u64;
        if expected != actual {
            return Err(ImageError::WrongTexelCount { expected, actual });
        }
        let mut image = Self::zeroed(desc)?;
        let size = desc.format.texel_bytes() as usize;
        for (bytes, &texel) in image.bytes.chunks_exact_mut(size).zip(texels) {
            desc.format.encode(Texel::Float(texel), bytes);
        }
        Ok(image)
    }

    /// All texels as red, green, blue, alpha values in the order of the bytes.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn to_rgba_f32(&self) -> Result<Vec<[f32; 4]>, ImageError> {
        let size = self.desc.format.texel_bytes() as usize;
        let count = self.bytes.len() / size;
        let mut texels = reserve(count as u64, (count as u64).saturating_mul(16))?;
        texels.extend(
            self.bytes
                .chunks_exact(size)
                .map(|bytes| self.desc.format.decode(bytes).to_f32()),
        );
        Ok(texels)
    }

    /// Where a texel's bytes begin; `None` outside the image. `layer` is the
    /// array layer, or the depth slice of a 3D image.
    #[must_use]
    pub fn offset(&self, x: u32, y: u32, layer: u32, mip: u32) -> Option<usize> {
        if mip >= self.desc.mips {
            return None;
        }
        let extent = self.desc.mip_extent(mip);
        if x >= extent.width || y >= extent.height || layer >= extent.depth_or_layers {
            return None;
        }
        let row = u64::from(layer)
            .checked_mul(extent.height.into())?
            .checked_add(y.into())?;
        let index = row
            .checked_mul(extent.width.into())?
            .checked_add(x.into())?;
        let offset = index.checked_mul(self.desc.format.texel_bytes().into())?;
        usize::try_from(self.mip_offset(mip)?.checked_add(offset)?).ok()
    }

    /// The bytes of one texel; `None` outside the image.
    #[must_use]
    pub fn texel_bytes(&self, x: u32, y: u32, layer: u32, mip: u32) -> Option<&[u8]> {
        let start = self.offset(x, y, layer, mip)?;
        self.bytes
            .get(start..start.checked_add(self.desc.format.texel_bytes() as usize)?)
    }

    /// One texel; `None` outside the image. `layer` is the array layer, or the
    /// depth slice of a 3D image.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32, layer: u32, mip: u32) -> Option<Texel> {
        self.texel_bytes(x, y, layer, mip)
            .map(|bytes| self.desc.format.decode(bytes))
    }

    /// Stores one texel, encoded by the format's rules.
    ///
    /// # Errors
    /// If there is no such texel.
    pub fn set_texel(
        &mut self,
        x: u32,
        y: u32,
        layer: u32,
        mip: u32,
        texel: Texel,
    ) -> Result<(), ImageError> {
        let format = self.desc.format;
        let size = format.texel_bytes() as usize;
        let bytes = self
            .offset(x, y, layer, mip)
            .and_then(|start| self.bytes.get_mut(start..start.checked_add(size)?))
            .ok_or(ImageError::OutOfRange { x, y, layer, mip })?;
        format.encode(texel, bytes);
        Ok(())
    }

    /// The bytes of one mip level, all layers; `None` if there is no such mip.
    #[must_use]
    pub fn mip(&self, mip: u32) -> Option<&[u8]> {
        if mip >= self.desc.mips {
            return None;
        }
        let start = usize::try_from(self.mip_offset(mip)?).ok()?;
        let length = usize::try_from(self.desc.mip_bytes(mip)?).ok()?;
        self.bytes.get(start..start.checked_add(length)?)
    }

    /// The texels of one mip level in the order of the bytes, with their
    /// places; none if there is no such mip.
    pub fn texels(&self, mip: u32) -> impl Iterator<Item = (TexelPosition, Texel)> {
        let format = self.desc.format;
        let bytes = self.mip(mip).unwrap_or(&[]);
        self.desc
            .positions(mip)
            .zip(bytes.chunks_exact(format.texel_bytes() as usize))
            .map(move |(position, bytes)| (position, format.decode(bytes)))
    }

    /// Where a mip level begins in the bytes.
    fn mip_offset(&self, mip: u32) -> Option<u64> {
        (0..mip).try_fold(0_u64, |sum, mip| sum.checked_add(self.desc.mip_bytes(mip)?))
    }
}

/// The place of a texel in an image.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
)]
pub struct TexelPosition {
    /// Mip level.
    pub mip: u32,
    /// Array layer or depth slice.
    pub layer: u32,
    /// Row, 0 at the top.
    pub y: u32,
    /// Column, 0 at the left.
    pub x: u32,
}

impl TextureDesc {
    /// The places of one mip level's texels in the order [`ImageData`] stores
    /// them.
    pub fn positions(&self, mip: u32) -> impl Iterator<Item = TexelPosition> + use<> {
        let extent = self.mip_extent(mip);
        (0..extent.depth_or_layers).flat_map(move |layer| {
            (0..extent.height).flat_map(move |y| {
                (0..extent.width).map(move |x| TexelPosition { mip, layer, y, x })
            })
        })
    }
}

/// An empty vector with room for `count` elements, or an error instead of an
/// abort when there is none.
fn reserve<T>(count: u64, bytes: u64) -> Result<Vec<T>, ImageError> {
    let mut vector = Vec::new();
    usize::try_from(count)
        .ok()
        .and_then(|count| vector.try_reserve_exact(count).ok())
        .ok_or(ImageError::OutOfMemory { bytes })?;
    Ok(vector)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resource::{Dimension, Extent};

    /// A description with several layers and mips of odd sizes.
    fn layered() -> TextureDesc {
        TextureDesc {
            dimension: Dimension::D2,
            extent: Extent {
                width: 5,
                height: 3,
                depth_or_layers: 2,
            },
            mips: 3,
            format: Format::R32Uint,
        }
    }

    #[test]
    fn texels_lie_in_mip_layer_row_order() {
        for desc in [
            layered(),
            TextureDesc {
                dimension: Dimension::D3,
                ..layered()
            },
        ] {
            let mut image = ImageData::zeroed(desc).unwrap();
            let count = image.bytes.len() / 4;
            for (index, bytes) in image.bytes.chunks_exact_mut(4).enumerate() {
                bytes.copy_from_slice(&(index as u32).to_le_bytes());
            }
            let mut expected = 0;
            for mip in 0..3 {
                let extent = desc.mip_extent(mip);
                for layer in 0..extent.depth_or_layers {
                    for y in 0..extent.height {
                        for x in 0..extent.width {
                            let texel = image.texel(x, y, layer, mip).unwrap();
                            assert_eq!(texel, Texel::Uint([expected, 0, 0, 1]));
                            expected += 1;
                        }
                    }
                }
            }
            assert_eq!(expected as usize, count);
            let listed: Vec<_> = (0..4).flat_map(|mip| image.texels(mip)).collect();
            assert_eq!(listed.len(), count);
            for (index, (TexelPosition { mip, layer, y, x }, texel)) in
                listed.into_iter().enumerate()
            {
                assert_eq!(texel, Texel::Uint([index as u32, 0, 0, 1]));
                assert_eq!(image.texel(x, y, layer, mip), Some(texel));
            }
        }
    }

    #[test]
    fn places_outside_are_refused() {
        let mut image = ImageData::zeroed(layered()).unwrap();
        for (x, y, layer, mip) in [
            (5, 0, 0, 0),
            (0, 3, 0, 0),
            (0, 0, 2, 0),
            (0, 0, 0, 3),
            (2, 0, 0, 1),
            (u32::MAX, u32::MAX, u32::MAX, u32::MAX),
        ] {
            assert_eq!(image.texel(x, y, layer, mip), None);
            let error = image
                .set_texel(x, y, layer, mip, Texel::Uint([1; 4]))
                .unwrap_err();
            assert_eq!(error, ImageError::OutOfRange { x, y, layer, mip });
        }
        assert_eq!(image.mip(3), None);
        assert!(image.bytes.iter().all(|&byte| byte == 0));
        image.set_texel(4, 2, 1, 0, Texel::Uint([7; 4])).unwrap();
        assert_eq!(image.texel(4, 2, 1, 0), Some(Texel::Uint([7, 0, 0, 1])));
    }

    #[test]
    fn fields_changed_behind_the_constructors_back_cause_no_panic() {
        let mut image = ImageData::zeroed(layered()).unwrap();
        image.bytes.truncate(6);
        assert_eq!(image.texel(0, 0, 0, 0), Some(Texel::Uint([0, 0, 0, 1])));
        assert_eq!(image.texel(1, 0, 0, 0), None);
        assert_eq!(image.texels(0).count(), 0);
        image.desc.extent = Extent {
            width: u32::MAX,
            height: u32::MAX,
            depth_or_layers: u32::MAX,
        };
        assert_eq!(
            image.texel(u32::MAX - 1, u32::MAX - 1, u32::MAX - 1, 0),
            None
        );
        assert_eq!(image.mip(1), None);
    }

    #[test]
    fn impossible_images_are_refused_before_allocation() {
        let huge = TextureDesc::d2(u32::MAX, u32::MAX, Format::Rgba32Float);
        assert!(matches!(
            ImageData::zeroed(huge),
            Err(ImageError::Description(ResourceError::OverLimit { .. }))
        ));
        // Within the address space, beyond any memory.
        let large = TextureDesc::d2(1 << 29, 1 << 29, Format::Rgba32Float);
        assert_eq!(
            ImageData::zeroed(large),
            Err(ImageError::OutOfMemory { bytes: 1 << 62 })
        );
        let empty = TextureDesc::d2(0, 4, Format::R8Unorm);
        assert!(matches!(
            ImageData::zeroed(empty),
            Err(ImageError::Description(ResourceError::Empty { .. }))
        ));
        assert!(matches!(
            ImageData::from_bytes(empty, Vec::new()),
            Err(ImageError::Description(_))
        ));
        let wrong = ImageData::from_bytes(layered(), vec![0; 3]).unwrap_err();
        assert!(
            matches!(
                wrong,
                ImageError::WrongLength {
                    expected: 144,
                    actual: 3,
                    ..
                }
            ),
            "{wrong:?}"
        );
        assert!(
            wrong
                .to_string()
                .contains("takes 144 bytes, but 3 are given"),
            "{wrong}"
        );
        let wrong = ImageData::from_rgba_f32(layered(), &[[0.0; 4]; 2]).unwrap_err();
        assert_eq!(
            wrong,
            ImageError::WrongTexelCount {
                expected: 36,
                actual: 2
            }
        );
    }

    #[test]
    fn rgba_goes_there_and_back() {
        let desc = TextureDesc::d2(2, 2, Format::Rg16Float);
        let texels = [
            [1.0, 2.0, 9.0, 9.0],
            [0.5, -0.25, 9.0, 9.0],
            [65504.0, 0.0, 9.0, 9.0],
            [3.0, 4.0, 9.0, 9.0],
        ];
        let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
        let back = image.to_rgba_f32().unwrap();
        for (texel, back) in texels.iter().zip(back) {
            assert_eq!(back, [texel[0], texel[1], 0.0, 1.0]);
        }
        assert_eq!(ImageData::from_bytes(desc, image.bytes.clone()), Ok(image));
    }
}

//! Textures.

use std::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering};

use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;

use crate::error::RunError;

/// Texels of all mips and layers, in the order of [`ImageData`].
#[derive(Debug)]
pub(crate) enum Texels {
    B1(Vec<AtomicU8>),
    B2(Vec<AtomicU16>),
    B4(Vec<AtomicU32>),
    B8(Vec<AtomicU64>),
    /// Two words per texel, low half first.
    B16(Vec<AtomicU64>),
}

/// A mip level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Level {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Depth, or array layers.
    pub(crate) depth: u32,
    /// Index of the first texel.
    pub(crate) start: u32,
}

/// A texture in the interpreter's memory.
#[derive(Debug)]
pub struct Texture {
    desc: TextureDesc,
    pub(crate) levels: Vec<Level>,
    pub(crate) texels: Texels,
}

macro_rules! each {
    ($texels:expr, $words:ident => $body:expr) => {
        match $texels {
            Texels::B1($words) => $body,
            Texels::B2($words) => $body,
            Texels::B4($words) => $body,
            Texels::B8($words) | Texels::B16($words) => $body,
        }
    };
}

fn reserve<T>(count: usize, bytes: u64, make: impl FnMut() -> T) -> Result<Vec<T>, RunError> {
    let mut words = Vec::new();
    words.try_reserve_exact(count).map_err(|_| RunError::OutOfMemory { what: "a texture".to_owned(), bytes })?;
    words.resize_with(count, make);
    Ok(words)
}

impl Texture {
    /// A texture of zero bytes.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it, or it has more
    /// than 2^32 - 1 texels.
    pub fn zeroed(desc: TextureDesc) -> Result<Self, RunError> {
        let bytes = desc.bytes().unwrap_or(u64::MAX);
        let out_of_memory = || RunError::OutOfMemory { what: "a texture".to_owned(), bytes };
        let texel = desc.format.texel_bytes();
        let count = bytes / u64::from(texel);
        if count >= u64::from(u32::MAX) {
            return Err(out_of_memory());
        }
        let count = usize::try_from(count).map_err(|_| out_of_memory())?;
        let mut levels = Vec::new();
        let mut start = 0_u32;
        for mip in 0..desc.mips {
            let extent = desc.mip_extent(mip);
            levels.push(Level { width: extent.width, height: extent.height, depth: extent.depth_or_layers, start });
            // The sum is at most `count`.
            start = start.wrapping_add(extent.width.wrapping_mul(extent.height).wrapping_mul(extent.depth_or_layers));
        }
        let texels = match texel {
            1 => Texels::B1(reserve(count, bytes, || AtomicU8::new(0))?),
            2 => Texels::B2(reserve(count, bytes, || AtomicU16::new(0))?),
            4 => Texels::B4(reserve(count, bytes, || AtomicU32::new(0))?),
            8 => Texels::B8(reserve(count, bytes, || AtomicU64::new(0))?),
            _ => Texels::B16(reserve(count.checked_mul(2).ok_or_else(out_of_memory)?, bytes, || AtomicU64::new(0))?),
        };
        Ok(Self { desc, levels, texels })
    }

    /// A texture with an image's texels.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn from_image(image: &ImageData) -> Result<Self, RunError> {
        let mut texture = Self::zeroed(image.desc)?;
        texture.write(&image.bytes);
        Ok(texture)
    }

    /// Shape and format.
    #[must_use]
    pub fn desc(&self) -> TextureDesc {
        self.desc
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.desc.bytes().unwrap_or(u64::MAX)
    }

    /// Sees the memory as another texture of as many bytes of the same texel size.
    /// Returns whether it could.
    pub(crate) fn reinterpret(&mut self, desc: TextureDesc) -> bool {
        if desc == self.desc {
            return true;
        }
        if desc.bytes() != self.desc.bytes() || desc.format.texel_bytes() != self.desc.format.texel_bytes() {
            return false;
        }
        self.levels.clear();
        let mut start = 0_u32;
        for mip in 0..desc.mips {
            let extent = desc.mip_extent(mip);
            self.levels.push(Level { width: extent.width, height: extent.height, depth: extent.depth_or_layers, start });
            start = start.wrapping_add(extent.width.wrapping_mul(extent.height).wrapping_mul(extent.depth_or_layers));
        }
        self.desc = desc;
        true
    }

    /// Overwrites the texels; bytes beyond the end are ignored.
    pub fn write(&mut self, bytes: &[u8]) {
        each!(&mut self.texels, words => {
            let size = words.first_mut().map_or(1, |word| size_of_val(word.get_mut()));
            for (word, chunk) in words.iter_mut().zip(bytes.chunks_exact(size)) {
                let mut value = word.get_mut().to_le_bytes();
                value.copy_from_slice(chunk);
                *word.get_mut() = from_bytes(value);
            }
        });
    }

    /// Sets every byte to zero.
    pub fn clear(&mut self) {
        each!(&mut self.texels, words => for word in words {
            *word.get_mut() = 0;
        });
    }

    /// A copy of the texels.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_image(&self) -> Result<ImageData, RunError> {
        let total = self.bytes();
        let mut bytes = Vec::new();
        let capacity = usize::try_from(total).unwrap_or(usize::MAX);
        bytes.try_reserve_exact(capacity).map_err(|_| RunError::OutOfMemory { what: "a copy of a texture".to_owned(), bytes: total })?;
        each!(&self.texels, words => for word in words {
            bytes.extend_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
        });
        Ok(ImageData { desc: self.desc, bytes })
    }
}

/// `T::from_le_bytes` for the word types.
trait FromBytes<const SIZE: usize> {
    fn from_le(bytes: [u8; SIZE]) -> Self;
}

macro_rules! from_bytes {
    ($($word:ty: $size:literal),*) => {
        $(impl FromBytes<$size> for $word {
            fn from_le(bytes: [u8; $size]) -> Self {
                Self::from_le_bytes(bytes)
            }
        })*
    };
}

from_bytes!(u8: 1, u16: 2, u32: 4, u64: 8);

fn from_bytes<T: FromBytes<SIZE>, const SIZE: usize>(bytes: [u8; SIZE]) -> T {
    T::from_le(bytes)
}

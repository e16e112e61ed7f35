//! Textures.

use std::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering};

use etalon_core::Format;
use etalon_core::graph::Subresources;
use etalon_core::image::ImageData;
use etalon_core::resource::{Dimension, Extent, TextureDesc};
use etalon_core::texel::Texel;

use super::wide::{WideTexels, can_be_wide, in_range, widened};
use super::written;
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    wide: Option<WideTexels>,
    /// Which texels something wrote, if that is of interest.
    shadow: Option<Texels>,
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

impl Texels {
    pub(crate) fn words(&self) -> usize {
        each!(self, words => words.len())
    }
}

fn reserve<T>(count: usize, bytes: u64, make: impl FnMut() -> T) -> Result<Vec<T>, RunError> {
    let mut words = Vec::new();
    words
        .try_reserve_exact(count)
        .map_err(|_| RunError::OutOfMemory {
            what: "a texture".to_owned(),
            bytes,
        })?;
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
        let out_of_memory = || RunError::OutOfMemory {
            what: "a texture".to_owned(),
            bytes,
        };
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
            levels.push(Level {
                width: extent.width,
                height: extent.height,
                depth: extent.depth_or_layers,
                start,
            });
            // The sum is at most `count`.
            start = start.wrapping_add(
                extent
                    .width
                    .wrapping_mul(extent.height)
                    .wrapping_mul(extent.depth_or_layers),
            );
        }
        let texels = match texel {
            1 => Texels::B1(reserve(count, bytes, || AtomicU8::new(0))?),
            2 => Texels::B2(reserve(count, bytes, || AtomicU16::new(0))?),
            4 => Texels::B4(reserve(count, bytes, || AtomicU32::new(0))?),
            8 => Texels::B8(reserve(count, bytes, || AtomicU64::new(0))?),
            _ => Texels::B16(reserve(
                count.checked_mul(2).ok_or_else(out_of_memory)?,
                bytes,
                || AtomicU64::new(0),
            )?),
        };
        Ok(Self {
            desc,
            levels,
            texels,
            wide: None,
            shadow: None,
        })
    }

    /// The texture with a wide plane: an `f64` beside each channel, for
    /// [number types](crate::NumberType) wider than `f32`. It starts with the
    /// values of the texels. Formats of integers stay as they are.
    ///
    /// A store in such a number type keeps all digits of the value there, within
    /// the range of the format (`[0, 1]` for normalised channels; floating-point
    /// ones lose neither digits nor range), and a load returns them. The texels
    /// get the value rounded, as ever. Everything else that writes texels
    /// writes the plane alike.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it: 8 bytes per
    /// channel.
    pub fn widen(mut self) -> Result<Self, RunError> {
        if can_be_wide(self.desc.format) && self.wide.is_none() {
            let texels =
                self.desc.bytes().unwrap_or(u64::MAX) / u64::from(self.desc.format.texel_bytes());
            self.wide = Some(WideTexels::zeroed(texels, self.desc.format.channels())?);
            self.refresh_wide();
        }
        Ok(self)
    }

    /// Whether textures of a format can have a wide plane: those that are read
    /// as `f32`.
    #[must_use]
    pub fn can_be_wide(format: Format) -> bool {
        can_be_wide(format)
    }

    /// Whether there is a wide plane.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.wide.is_some()
    }

    /// Sets the wide plane to the values of the texels.
    fn refresh_wide(&self) {
        let view = self.view();
        if let Some(wide) = view.wide {
            for index in view.indices().flatten() {
                if let Some(value) = view.texel(index).and_then(widened) {
                    wide.set(index, value);
                }
            }
        }
    }

    /// A texture that holds nothing yet: its texels are zero, and reading one
    /// before it is written is reported by programs that look for that
    /// ([`crate::Checks::uninitialised`]).
    ///
    /// # Errors
    /// As [`Texture::zeroed`].
    pub fn unwritten(desc: TextureDesc) -> Result<Self, RunError> {
        let mut texture = Self::zeroed(desc)?;
        texture.forget()?;
        Ok(texture)
    }

    /// From here on the texture counts as unwritten, whatever it holds.
    pub(crate) fn forget(&mut self) -> Result<(), RunError> {
        match self.shadow() {
            Some(shadow) => written::forget(shadow),
            None => {
                let count = self.bytes() / u64::from(self.desc.format.texel_bytes());
                // As many as there are, so the number fits.
                let shadow = written::unwritten(count as usize, "a texture")?;
                self.shadow = Some(Texels::B4(shadow));
            }
        }
        Ok(())
    }

    fn shadow(&self) -> Option<&[AtomicU32]> {
        shadow_words(self.shadow.as_ref()?)
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

    /// Bytes held, those of a wide plane included.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let wide = self.wide.as_ref().map_or(0, WideTexels::bytes);
        self.desc.bytes().unwrap_or(u64::MAX).saturating_add(wide)
    }

    /// All mips and layers.
    #[must_use]
    pub fn view(&self) -> TextureView<'_> {
        TextureView {
            desc: self.desc,
            levels: self.levels.clone(),
            texels: &self.texels,
            wide: self.wide.as_ref(),
            shadow: self.shadow.as_ref(),
        }
    }

    /// Some mips and layers as a texture of their own; `None` if there are no
    /// such ones.
    #[must_use]
    pub fn part(&self, range: Subresources) -> Option<TextureView<'_>> {
        let desc = part_desc(&self.desc, range)?;
        let levels = self.levels[range.mip as usize..][..range.mips as usize].iter();
        let levels = levels
            .map(|level| match self.desc.dimension {
                Dimension::D3 => *level,
                Dimension::D2 | Dimension::Cube => Level {
                    depth: range.layers,
                    start: level.start + range.layer * level.width * level.height,
                    ..*level
                },
            })
            .collect();
        Some(TextureView {
            desc,
            levels,
            texels: &self.texels,
            wide: self.wide.as_ref(),
            shadow: self.shadow.as_ref(),
        })
    }

    /// Overwrites the texels; bytes beyond the end are ignored.
    pub fn write(&mut self, bytes: &[u8]) {
        each!(&mut self.texels, words => {
            for (word, chunk) in words.iter_mut().zip(chunks(bytes)) {
                *word.get_mut() = from_bytes(*chunk);
            }
        });
        self.refresh_wide();
        if let Some(shadow) = self.shadow() {
            let texels = bytes.len() / self.desc.format.texel_bytes() as usize;
            written::write(&shadow[..texels.min(shadow.len())]);
        }
    }

    /// A copy of the texels.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_image(&self) -> Result<ImageData, RunError> {
        self.view().to_image()
    }
}

/// The shape that a part of a texture has as a texture of its own: some of a
/// cube's faces are layers.
fn part_desc(desc: &TextureDesc, range: Subresources) -> Option<TextureDesc> {
    let within = |first: u32, count: u32, all: u32| {
        count > 0 && first.checked_add(count).is_some_and(|end| end <= all)
    };
    if !within(range.mip, range.mips, desc.mips)
        || !within(range.layer, range.layers, desc.layers())
    {
        return None;
    }
    let size = desc.mip_extent(range.mip);
    let (dimension, depth_or_layers) = match desc.dimension {
        Dimension::D3 => (Dimension::D3, size.depth_or_layers),
        Dimension::Cube if range.layers.is_multiple_of(6) => (Dimension::Cube, range.layers),
        Dimension::D2 | Dimension::Cube => (Dimension::D2, range.layers),
    };
    Some(TextureDesc {
        dimension,
        extent: Extent {
            depth_or_layers,
            ..size
        },
        mips: range.mips,
        format: desc.format,
    })
}

/// Some mips and layers of a texture.
#[derive(Clone, Debug)]
pub struct TextureView<'a> {
    desc: TextureDesc,
    pub(crate) levels: Vec<Level>,
    pub(crate) texels: &'a Texels,
    pub(crate) wide: Option<&'a WideTexels>,
    shadow: Option<&'a Texels>,
}

/// The words of a texture's shadow.
fn shadow_words(shadow: &Texels) -> Option<&[AtomicU32]> {
    match shadow {
        Texels::B4(words) => Some(words),
        _ => None,
    }
}

impl<'a> TextureView<'a> {
    /// What is known of which texels of the whole texture are written; indices are
    /// those of [`Level`].
    pub(crate) fn shadow(&self) -> Option<&'a [AtomicU32]> {
        shadow_words(self.shadow?)
    }

    /// A texture of the same shape whose texels are above 0 where nothing wrote.
    pub(crate) fn shadow_view(&self) -> Option<Self> {
        Some(Self {
            desc: TextureDesc {
                format: etalon_core::Format::R32Float,
                ..self.desc
            },
            levels: self.levels.clone(),
            texels: self.shadow?,
            wide: None,
            shadow: None,
        })
    }
}

impl TextureView<'_> {
    /// Shape and format of the part.
    #[must_use]
    pub fn desc(&self) -> TextureDesc {
        self.desc
    }

    /// The words of each mip, which are consecutive: first and one past the last.
    fn runs(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let words = if matches!(self.texels, Texels::B16(_)) {
            2
        } else {
            1
        };
        self.texel_runs()
            .map(move |run| run.start * words..run.end * words)
    }

    /// The texels of each mip, which are consecutive: first and one past the last.
    fn texel_runs(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.levels.iter().map(|level| {
            let start = level.start as usize;
            start..start + level.width as usize * level.height as usize * level.depth as usize
        })
    }

    /// The texels of each mip by their index.
    fn indices(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.levels.iter().map(|level| {
            let start = level.start as usize;
            start..start + level.width as usize * level.height as usize * level.depth as usize
        })
    }

    /// A texel by its index.
    fn texel(&self, index: usize) -> Option<Texel> {
        Some(self.desc.format.decode(&self.texel_bytes(index)?))
    }

    /// The bytes of a texel by its index.
    pub(crate) fn texel_bytes(&self, index: usize) -> Option<[u8; 16]> {
        let mut bytes = [0; 16];
        match self.texels {
            Texels::B1(words) => bytes[0] = words.get(index)?.load(Ordering::Relaxed),
            Texels::B2(words) => {
                bytes[..2].copy_from_slice(&words.get(index)?.load(Ordering::Relaxed).to_le_bytes())
            }
            Texels::B4(words) => {
                bytes[..4].copy_from_slice(&words.get(index)?.load(Ordering::Relaxed).to_le_bytes())
            }
            Texels::B8(words) => {
                bytes[..8].copy_from_slice(&words.get(index)?.load(Ordering::Relaxed).to_le_bytes())
            }
            Texels::B16(words) => {
                let at = index.checked_mul(2)?;
                let words = words.get(at..at.checked_add(2)?)?;
                for (bytes, word) in bytes.chunks_exact_mut(8).zip(words) {
                    bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
                }
            }
        }
        Some(bytes)
    }

    /// Writes the bytes of a texel by its index, if there is one.
    pub(crate) fn set_texel_bytes(&self, index: usize, bytes: &[u8; 16]) {
        each!(self.texels, words => {
            let per = if matches!(self.texels, Texels::B16(_)) { 2 } else { 1 };
            let words = words.iter().skip(index.saturating_mul(per)).take(per);
            for (word, chunk) in words.zip(chunks(bytes)) {
                word.store(from_bytes(*chunk), Ordering::Relaxed);
            }
        });
    }

    /// Sets a texel of the wide plane, if there is one, to the texel's value.
    pub(crate) fn widen_texel(&self, index: usize) {
        if let Some(wide) = self.wide
            && let Some(value) = self.texel(index).and_then(widened)
        {
            wide.set(index, value);
        }
    }

    /// A texel by its index in `f64`: from the wide plane, or widened.
    fn wide_texel(&self, index: usize) -> Option<[f64; 4]> {
        match self.wide {
            Some(wide) => wide.get(index),
            None => self.texel(index).and_then(widened),
        }
    }

    /// The channels of all texels in `f64`, in the order of [`ImageData`], where
    /// channels that the format has not are 0, 0, 1: those of the wide plane, or
    /// the texels' own without one. `None` for formats of integers.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_f64(&self) -> Result<Option<Vec<[f64; 4]>>, RunError> {
        if !can_be_wide(self.desc.format) {
            return Ok(None);
        }
        let count = self.indices().map(|range| range.len()).sum();
        let mut texels = Vec::new();
        texels
            .try_reserve_exact(count)
            .map_err(|_| RunError::OutOfMemory {
                what: "a copy of a texture".to_owned(),
                bytes: (count as u64).saturating_mul(32),
            })?;
        texels.extend(
            self.indices()
                .flatten()
                .filter_map(|index| self.wide_texel(index)),
        );
        Ok(Some(texels))
    }

    /// Notes that all texels of the part are written.
    pub(crate) fn note_written(&self) {
        if let Some(shadow) = self.shadow() {
            for run in self.texel_runs() {
                written::write(&shadow[run]);
            }
        }
    }

    /// A copy of the texels.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_image(&self) -> Result<ImageData, RunError> {
        let total = self.desc.bytes().unwrap_or(u64::MAX);
        let mut bytes = Vec::new();
        let capacity = usize::try_from(total).unwrap_or(usize::MAX);
        bytes
            .try_reserve_exact(capacity)
            .map_err(|_| RunError::OutOfMemory {
                what: "a copy of a texture".to_owned(),
                bytes: total,
            })?;
        for run in self.runs() {
            each!(self.texels, words => for word in &words[run] {
                bytes.extend_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
            });
        }
        Ok(ImageData {
            desc: self.desc,
            bytes,
        })
    }

    /// Fills all texels with one.
    pub fn fill(&self, texel: Texel) {
        let mut bytes = [0; 16];
        self.desc.format.encode(texel, &mut bytes);
        for run in self.runs() {
            each!(self.texels, words => for (word, chunk) in words[run].iter().zip(chunks(&bytes[..self.desc.format.texel_bytes() as usize]).cycle()) {
                word.store(from_bytes(*chunk), Ordering::Relaxed);
            });
        }
        if let (Some(wide), Some(value)) = (self.wide, widened(texel)) {
            let encoding = self.desc.format.encoding();
            let value = value.map(|channel| in_range(encoding, channel));
            for index in self.indices().flatten() {
                wide.set(index, value);
            }
        }
        self.note_written();
    }

    /// Copies all texels of a part of equal shape; says whether it is one.
    pub fn copy_from(&self, source: &TextureView<'_>) -> bool {
        let shape = |desc: &TextureDesc| (desc.extent, desc.mips, desc.format);
        if shape(&self.desc) != shape(&source.desc) {
            return false;
        }
        for (to, from) in self.runs().zip(source.runs()) {
            match (self.texels, source.texels) {
                (Texels::B1(a), Texels::B1(b)) => a[to]
                    .iter()
                    .zip(&b[from])
                    .for_each(|(a, b)| a.store(b.load(Ordering::Relaxed), Ordering::Relaxed)),
                (Texels::B2(a), Texels::B2(b)) => a[to]
                    .iter()
                    .zip(&b[from])
                    .for_each(|(a, b)| a.store(b.load(Ordering::Relaxed), Ordering::Relaxed)),
                (Texels::B4(a), Texels::B4(b)) => a[to]
                    .iter()
                    .zip(&b[from])
                    .for_each(|(a, b)| a.store(b.load(Ordering::Relaxed), Ordering::Relaxed)),
                (Texels::B8(a) | Texels::B16(a), Texels::B8(b) | Texels::B16(b)) => {
                    a[to]
                        .iter()
                        .zip(&b[from])
                        .for_each(|(a, b)| a.store(b.load(Ordering::Relaxed), Ordering::Relaxed));
                }
                // One format has one texel size.
                _ => return false,
            }
        }
        if let Some(wide) = self.wide {
            for (to, from) in self.indices().flatten().zip(source.indices().flatten()) {
                if let Some(value) = source.wide_texel(from) {
                    wide.set(to, value);
                }
            }
        }
        if let Some(shadow) = self.shadow() {
            let from = source.shadow();
            for (to, at) in self.texel_runs().zip(source.texel_runs()) {
                for (word, i) in shadow[to].iter().zip(at) {
                    written::copy(word, from.and_then(|from| from.get(i)));
                }
            }
        }
        true
    }
}

fn chunks<const SIZE: usize>(bytes: &[u8]) -> std::slice::Iter<'_, [u8; SIZE]> {
    bytes.as_chunks().0.iter()
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

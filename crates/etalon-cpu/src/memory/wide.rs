//! The wide plane of a texture or buffer: an `f64` beside each channel or word.
//!
//! Programs that run in a wider number type than `f32` store what they computed
//! there, and read it back, so that nothing is rounded between passes. The
//! texels and words hold the same values in the resource's format, for whoever
//! knows nothing of the plane.

use std::sync::atomic::{AtomicU64, Ordering};

use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::texel::Texel;

use crate::error::RunError;

/// Marks a word that was not last written as a number. A signalling NaN, which
/// no arithmetic results in.
const NO_NUMBER: u64 = 0x7ff4_6e6f_206e_756d;

fn reserve(what: &str, count: u64, value: u64) -> Result<Vec<AtomicU64>, RunError> {
    let out_of_memory = || RunError::OutOfMemory {
        what: what.to_owned(),
        bytes: count.saturating_mul(8),
    };
    let length = usize::try_from(count).map_err(|_| out_of_memory())?;
    let mut values = Vec::new();
    values
        .try_reserve_exact(length)
        .map_err(|_| out_of_memory())?;
    values.resize_with(length, || AtomicU64::new(value));
    Ok(values)
}

/// Whether textures of a format can have a wide plane: those whose channels are
/// read as `f32`.
pub(crate) fn can_be_wide(format: Format) -> bool {
    matches!(format.sample_kind(), SampleKind::Float | SampleKind::Depth)
}

/// What a channel keeps of a number in a wide plane: all of its digits, within
/// the range that the encoding has by design. Floating-point encodings lose
/// neither digits nor range, those without a sign keep nothing negative.
#[inline(always)]
pub(crate) fn in_range(encoding: Encoding, value: f64) -> f64 {
    // NaN becomes 0 in the encodings that have none.
    let clamped = |low: f64, high: f64| {
        let value = if value > low { value } else { low };
        if value < high { value } else { high }
    };
    match encoding {
        Encoding::Unorm | Encoding::UnormSrgb => clamped(0.0, 1.0),
        Encoding::Snorm if value.is_nan() => 0.0,
        Encoding::Snorm => clamped(-1.0, 1.0),
        Encoding::Ufloat | Encoding::SharedExponent if value < 0.0 => 0.0,
        _ => value,
    }
}

/// The wide plane of a texture: all first channels, in the order of the texels,
/// then all second ones. What lanes next to each other read is so, too.
#[derive(Debug)]
pub(crate) struct WideTexels {
    values: Vec<AtomicU64>,
    texels: usize,
    channels: u32,
}

impl WideTexels {
    /// A plane of zeros.
    pub(crate) fn zeroed(texels: u64, channels: u32) -> Result<Self, RunError> {
        let what = "the wide plane of a texture";
        let values = reserve(what, texels.saturating_mul(channels.into()), 0)?;
        Ok(Self {
            texels: values.len() / channels.max(1) as usize,
            values,
            channels,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.values.len() as u64 * 8
    }

    /// A channel of all texels; of none if the format has it not.
    #[inline(always)]
    pub(crate) fn channel(&self, channel: u32) -> &[AtomicU64] {
        let from = channel as usize * self.texels;
        self.values.get(from..from + self.texels).unwrap_or(&[])
    }

    pub(crate) fn channels(&self) -> u32 {
        self.channels
    }

    /// One texel; channels that the format has not are 0, 0, 1.
    pub(crate) fn get(&self, texel: usize) -> Option<[f64; 4]> {
        let mut out = [0.0, 0.0, 0.0, 1.0];
        for (channel, out) in (0..self.channels).zip(&mut out) {
            let value = self.channel(channel).get(texel)?;
            *out = f64::from_bits(value.load(Ordering::Relaxed));
        }
        Some(out)
    }

    /// Sets one texel; nothing happens outside.
    pub(crate) fn set(&self, texel: usize, value: [f64; 4]) {
        for (channel, value) in (0..self.channels).zip(value) {
            if let Some(to) = self.channel(channel).get(texel) {
                to.store(value.to_bits(), Ordering::Relaxed);
            }
        }
    }
}

/// A texel's channels, widened; `None` for integers.
pub(crate) fn widened(texel: Texel) -> Option<[f64; 4]> {
    match texel {
        Texel::Float(channels) => Some(channels.map(f64::from)),
        Texel::Sint(_) | Texel::Uint(_) => None,
    }
}

/// The wide plane of a buffer: for each word the number it was last written as,
/// or a mark that it was written as something else.
#[derive(Debug)]
pub(crate) struct WideWords(Vec<AtomicU64>);

impl WideWords {
    /// A plane of words that are no numbers.
    pub(crate) fn new(words: u64) -> Result<Self, RunError> {
        reserve("the wide plane of a buffer", words, NO_NUMBER).map(Self)
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.0.len() as u64 * 8
    }

    /// What the word was written as, if that was a number.
    #[inline(always)]
    pub(crate) fn get(&self, word: usize) -> Option<f64> {
        let bits = self.0.get(word)?.load(Ordering::Relaxed);
        (bits != NO_NUMBER).then(|| f64::from_bits(bits))
    }

    /// The word is now a number.
    #[inline(always)]
    pub(crate) fn set(&self, word: usize, value: f64) {
        if let Some(to) = self.0.get(word) {
            to.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    /// The word is now bits.
    #[inline(always)]
    pub(crate) fn forget(&self, word: usize) {
        if let Some(to) = self.0.get(word) {
            to.store(NO_NUMBER, Ordering::Relaxed);
        }
    }

    pub(crate) fn forget_all(&self) {
        for to in &self.0 {
            to.store(NO_NUMBER, Ordering::Relaxed);
        }
    }

    /// As many words of another plane as both have.
    pub(crate) fn copy_from(&self, source: &Self) {
        for (to, from) in self.0.iter().zip(&source.0) {
            to.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_those_of_the_encodings() {
        for (encoding, value, kept) in [
            (Encoding::Unorm, 1.5, 1.0),
            (Encoding::Unorm, -0.5, 0.0),
            (Encoding::Unorm, f64::NAN, 0.0),
            (Encoding::Unorm, 0.1, 0.1),
            (Encoding::UnormSrgb, 2.0, 1.0),
            (Encoding::Snorm, -1.5, -1.0),
            (Encoding::Snorm, f64::NAN, 0.0),
            (Encoding::Snorm, 0.1, 0.1),
            (Encoding::Ufloat, -1.0, 0.0),
            (Encoding::Ufloat, 1.0e300, 1.0e300),
            (Encoding::Float, -1.0e300, -1.0e300),
            (Encoding::Float, f64::INFINITY, f64::INFINITY),
        ] {
            assert_eq!(in_range(encoding, value), kept, "{encoding:?} {value}");
        }
        assert!(in_range(Encoding::Float, f64::NAN).is_nan());
    }

    #[test]
    fn words_remember_numbers_until_they_are_written_as_bits() {
        let words = WideWords::new(2).unwrap();
        assert_eq!(words.get(0), None);
        words.set(0, 0.1);
        words.set(1, f64::NAN);
        assert_eq!(words.get(0), Some(0.1));
        assert!(words.get(1).is_some_and(f64::is_nan));
        words.forget(0);
        assert_eq!(words.get(0), None);
        assert_eq!(words.get(2), None);
        words.set(2, 1.0);
    }

    #[test]
    fn planes_too_large_for_memory_are_refused() {
        for texels in [u64::MAX, 1 << 60] {
            assert!(matches!(
                WideTexels::zeroed(texels, 4),
                Err(RunError::OutOfMemory { .. })
            ));
        }
        for words in [u64::MAX, 1 << 60] {
            assert!(matches!(
                WideWords::new(words),
                Err(RunError::OutOfMemory { .. })
            ));
        }
    }
}

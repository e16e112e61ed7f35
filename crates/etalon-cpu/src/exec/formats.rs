//! Formats that images mostly have: their texels are decoded a block of lanes at a
//! time, from words to registers, so that nothing of it goes through memory.

use std::sync::atomic::{AtomicU32, AtomicU64};

use etalon_core::Format;

use super::isa::Isa;
use super::lanes::BLOCK;
use crate::memory::{Texels, TextureView, unorm8};

/// Texels of such a format.
pub(super) trait BlockFormat: 'static {
    /// A texel in memory.
    type Word;

    /// The channels of the texels at `index`, if all are inside of `words`. The last
    /// may be anything where `alpha` is not set.
    fn read<I: Isa>(
        words: &[Self::Word],
        index: [u32; BLOCK],
        alpha: bool,
    ) -> Option<[[f32; BLOCK]; 4]>;
}

/// What is done with texels of a format that is known then.
pub(super) trait WithFormat {
    fn run<F: BlockFormat>(self, words: &[F::Word]);
}

/// Gives the texture's texels to `work`, or that back if they are of another format
/// or more than instruction sets can address.
#[inline(always)]
pub(super) fn with_format<W: WithFormat>(texture: &TextureView<'_>, work: W) -> Option<W> {
    if texture.texels.words() > i32::MAX as usize {
        return Some(work);
    }
    match (texture.texels, texture.desc().format) {
        (Texels::B8(words), Format::Rgba16Float) => work.run::<Rgba16Float>(words),
        (Texels::B4(words), Format::Rgba8Unorm) => work.run::<Rgba8Unorm>(words),
        (Texels::B4(words), Format::R32Float | Format::Depth32Float) => {
            work.run::<R32Float>(words);
        }
        _ => return Some(work),
    }
    None
}

/// How many words there are, none if they are more than can be addressed.
#[inline(always)]
fn addressable<W>(words: &[W]) -> u32 {
    i32::try_from(words.len()).unwrap_or(0) as u32
}

struct Rgba16Float;

impl BlockFormat for Rgba16Float {
    type Word = AtomicU64;

    #[inline(always)]
    fn read<I: Isa>(
        words: &[AtomicU64],
        index: [u32; BLOCK],
        alpha: bool,
    ) -> Option<[[f32; BLOCK]; 4]> {
        if !I::all_below(index, addressable(words)) {
            return None;
        }
        // SAFETY: all indices were seen to be inside, and atomics are laid out as
        // what they hold.
        Some(unsafe { I::load_halves(words.as_ptr().cast(), words.len(), index, alpha) })
    }
}

/// Words of 32 bits, if all are inside.
#[inline(always)]
fn words4<I: Isa>(words: &[AtomicU32], index: [u32; BLOCK]) -> Option<[u32; BLOCK]> {
    if !I::all_below(index, addressable(words)) {
        return None;
    }
    // SAFETY: as above.
    Some(unsafe { I::load4(words.as_ptr().cast(), words.len(), index) })
}

struct Rgba8Unorm;

impl BlockFormat for Rgba8Unorm {
    type Word = AtomicU32;

    #[inline(always)]
    fn read<I: Isa>(
        words: &[AtomicU32],
        index: [u32; BLOCK],
        _: bool,
    ) -> Option<[[f32; BLOCK]; 4]> {
        let words = words4::<I>(words, index)?;
        let mut channels = [[0.0; BLOCK]; 4];
        for k in 0..BLOCK {
            channels[0][k] = f32::from_bits(unorm8(words[k]));
        }
        for k in 0..BLOCK {
            channels[1][k] = f32::from_bits(unorm8(words[k] >> 8));
        }
        for k in 0..BLOCK {
            channels[2][k] = f32::from_bits(unorm8(words[k] >> 16));
        }
        for k in 0..BLOCK {
            channels[3][k] = f32::from_bits(unorm8(words[k] >> 24));
        }
        Some(channels)
    }
}

struct R32Float;

impl BlockFormat for R32Float {
    type Word = AtomicU32;

    #[inline(always)]
    fn read<I: Isa>(
        words: &[AtomicU32],
        index: [u32; BLOCK],
        _: bool,
    ) -> Option<[[f32; BLOCK]; 4]> {
        let words = words4::<I>(words, index)?;
        let mut red = [0.0; BLOCK];
        for k in 0..BLOCK {
            red[k] = f32::from_bits(words[k]);
        }
        Some([red, [0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]])
    }
}

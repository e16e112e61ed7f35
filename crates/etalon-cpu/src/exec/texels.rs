//! Many texels at once, between textures and lanes. Formats that images mostly
//! have are decoded and encoded as vectors; the codec of
//! [`etalon_core::texel`] serves all others, with the same bits.

use std::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering};

use etalon_core::Format;

use super::isa::Isa;
use super::lanes::BLOCK;
use crate::memory::{Channels, Texels, TextureView, decode, encode, unorm8, unorm8_codes};
use crate::num::f16_to_f32;

/// Stands for a texel outside: no texture has so many.
pub(crate) const OUTSIDE: u32 = u32::MAX;

/// A texel's bytes in memory, or half of them.
pub(super) trait Word: Sync {
    type Bits: Copy + Default;
    fn get(&self) -> Self::Bits;
    fn put(&self, bits: Self::Bits);
}

macro_rules! word {
    ($atomic:ty, $bits:ty) => {
        impl Word for $atomic {
            type Bits = $bits;
            #[inline(always)]
            fn get(&self) -> $bits {
                self.load(Ordering::Relaxed)
            }
            #[inline(always)]
            fn put(&self, bits: $bits) {
                self.store(bits, Ordering::Relaxed);
            }
        }
    };
}

word!(AtomicU8, u8);
word!(AtomicU16, u16);
word!(AtomicU32, u32);
word!(AtomicU64, u64);

/// Where a texel would be, whether or not it is there.
#[inline(always)]
pub(super) fn address(texels: &Texels, at: usize) -> *const u8 {
    match texels {
        Texels::B1(words) => words.as_ptr().wrapping_add(at).cast(),
        Texels::B2(words) => words.as_ptr().wrapping_add(at).cast(),
        Texels::B4(words) => words.as_ptr().wrapping_add(at).cast(),
        Texels::B8(words) => words.as_ptr().wrapping_add(at).cast(),
        Texels::B16(words) => words.as_ptr().wrapping_add(at.wrapping_mul(2)).cast(),
    }
}

/// Whether every index, `per` words each, is in `words`.
#[inline(always)]
fn all_inside<W, const K: usize>(words: &[W], index: &[u32; K], per: usize) -> bool {
    let count = u32::try_from(words.len() / per).unwrap_or(u32::MAX);
    let mut outside = false;
    for k in 0..K {
        outside |= index[k] >= count;
    }
    !outside
}

/// The words at `index`, zero outside.
#[inline(always)]
fn load<W: Word, const K: usize>(words: &[W], index: &[u32; K]) -> [W::Bits; K] {
    let mut bits = [W::Bits::default(); K];
    if all_inside(words, index, 1) {
        for k in 0..K {
            // SAFETY: all indices were seen to be inside.
            bits[k] = unsafe { words.get_unchecked(index[k] as usize) }.get();
        }
    } else {
        for k in 0..K {
            bits[k] = words.get(index[k] as usize).map_or(bits[k], Word::get);
        }
    }
    bits
}

/// Whether blocks of these indices can be reached by address: instruction sets
/// take signed ones.
#[inline(always)]
fn in_blocks<W, const K: usize>(words: &[W], index: &[u32; K]) -> bool {
    K.is_multiple_of(BLOCK) && words.len() <= i32::MAX as usize && all_inside(words, index, 1)
}

/// [`load`] and [`store`] as the instruction set has them.
macro_rules! in_words {
    ($load:ident, $store:ident, $atomic:ty, $bits:ty) => {
        /// The words at `index`, zero outside.
        #[inline(always)]
        pub(super) fn $load<I: Isa, const K: usize>(
            words: &[$atomic],
            index: &[u32; K],
        ) -> [$bits; K] {
            if !in_blocks(words, index) {
                return load(words, index);
            }
            let mut bits = [0; K];
            let (from, _) = index.as_chunks::<BLOCK>();
            let (to, _) = bits.as_chunks_mut::<BLOCK>();
            for (index, bits) in from.iter().zip(to) {
                // SAFETY: all indices were seen to be inside, and atomics are
                // laid out as what they hold.
                *bits = unsafe { I::$load(words.as_ptr().cast(), words.len(), *index) };
            }
            bits
        }

        /// Writes the words at `index`, those inside.
        #[inline(always)]
        pub(super) fn $store<I: Isa, const K: usize>(
            words: &[$atomic],
            index: &[u32; K],
            bits: &[$bits; K],
        ) {
            if !in_blocks(words, index) {
                return store(words, index, bits);
            }
            let (to, _) = index.as_chunks::<BLOCK>();
            let (from, _) = bits.as_chunks::<BLOCK>();
            for (index, bits) in to.iter().zip(from) {
                // SAFETY: all indices were seen to be inside; atomics may be
                // written behind shared references, and others use them as words.
                unsafe { I::$store(words.as_ptr().cast_mut().cast(), *index, *bits) };
            }
        }
    };
}

in_words!(load4, store4, AtomicU32, u32);
in_words!(load8, store8, AtomicU64, u64);

/// A block of words, if all are inside.
#[inline(always)]
pub(super) fn block8<I: Isa>(words: &[AtomicU64], index: [u32; BLOCK]) -> Option<[u64; BLOCK]> {
    let count = i32::try_from(words.len()).unwrap_or(0) as u32;
    if !I::all_below(index, count) {
        return None;
    }
    // SAFETY: all indices were seen to be inside, and atomics are laid out as what
    // they hold.
    Some(unsafe { I::load8(words.as_ptr().cast(), words.len(), index) })
}

/// [`load`] where a texel has two words.
#[inline(always)]
fn load_pairs<const K: usize>(words: &[AtomicU64], index: &[u32; K]) -> [[u64; K]; 2] {
    let (mut low, mut high) = ([0; K], [0; K]);
    if all_inside(words, index, 2) {
        for k in 0..K {
            let at = index[k] as usize * 2;
            // SAFETY: all indices were seen to be inside.
            unsafe {
                low[k] = words.get_unchecked(at).get();
                high[k] = words.get_unchecked(at + 1).get();
            }
        }
    } else {
        for k in 0..K {
            let at = index[k] as usize * 2;
            if let Some([l, h]) = words.get(at..at + 2) {
                (low[k], high[k]) = (l.get(), h.get());
            }
        }
    }
    [low, high]
}

/// Writes the words at `index`, those inside.
#[inline(always)]
fn store<W: Word, const K: usize>(words: &[W], index: &[u32; K], bits: &[W::Bits; K]) {
    if all_inside(words, index, 1) {
        for k in 0..K {
            // SAFETY: all indices were seen to be inside.
            unsafe { words.get_unchecked(index[k] as usize) }.put(bits[k]);
        }
    } else {
        for k in 0..K {
            if let Some(word) = words.get(index[k] as usize) {
                word.put(bits[k]);
            }
        }
    }
}

/// Values of binary16, as bits.
#[inline(always)]
fn from_halves<I: Isa, const K: usize>(bits: &[u16; K], out: &mut [u32; K]) {
    let (blocks, rest) = bits.as_chunks::<BLOCK>();
    let (to, last) = out.as_chunks_mut::<BLOCK>();
    for (block, to) in blocks.iter().zip(to) {
        let values = I::from_halves(*block);
        for k in 0..BLOCK {
            to[k] = values[k].to_bits();
        }
    }
    for (bits, to) in rest.iter().zip(last) {
        *to = f16_to_f32(u32::from(*bits)).to_bits();
    }
}

/// The wanted channels of texels of four binary16.
#[inline(always)]
fn fetch_halves<I: Isa, const K: usize>(
    texels: &[AtomicU64],
    index: &[u32; K],
    wanted: [bool; 4],
    out: &mut Channels<K>,
) {
    if !in_blocks(texels, index) {
        let word = load(texels, index);
        for channel in 0..4 {
            let mut bits = [0; K];
            for k in 0..K {
                bits[k] = (word[k] >> (16 * channel)) as u16;
            }
            if wanted[channel] {
                from_halves::<I, K>(&bits, &mut out[channel]);
            }
        }
        return;
    }
    let (blocks, _) = index.as_chunks::<BLOCK>();
    for (block, index) in blocks.iter().enumerate() {
        // SAFETY: all indices were seen to be inside, and atomics are laid out
        // as what they hold.
        let values =
            unsafe { I::load_halves(texels.as_ptr().cast(), texels.len(), *index, wanted[3]) };
        // Decoding all takes less time than asking which are wanted.
        for channel in 0..4 {
            let to = &mut out[channel][block * BLOCK..][..BLOCK];
            for k in 0..BLOCK {
                to[k] = values[channel][k].to_bits();
            }
        }
    }
}

/// Writes texels of four binary16.
#[inline(always)]
fn put_halves<I: Isa, const K: usize>(
    texels: &[AtomicU64],
    index: &[u32; K],
    channels: &Channels<K>,
) {
    let mut words = [0; K];
    let (to, _) = words.as_chunks_mut::<BLOCK>();
    for (block, to) in to.iter_mut().enumerate() {
        let mut parts = [[0; BLOCK]; 4];
        for (part, channel) in parts.iter_mut().zip(channels) {
            let mut values = [0.0; BLOCK];
            for k in 0..BLOCK {
                values[k] = f32::from_bits(channel[block * BLOCK + k]);
            }
            *part = I::to_halves(values);
        }
        *to = I::join(parts);
    }
    store8::<I, K>(texels, index, &words);
}

/// `$out[c] = $channel` for each channel that is wanted.
macro_rules! channels {
    ($wanted:ident, $out:ident, $($c:literal: |$k:ident| $channel:expr),*) => {
        $(if $wanted[$c] {
            for $k in 0..K {
                $out[$c][$k] = $channel;
            }
        })*
    };
}

/// `$out[c]` by [`from_halves`] for each channel that is wanted.
macro_rules! halves {
    ($wanted:ident, $out:ident, $($c:literal: |$k:ident| $bits:expr),*) => {
        $(if $wanted[$c] {
            let mut bits = [0; K];
            for $k in 0..K {
                bits[$k] = $bits;
            }
            from_halves::<I, K>(&bits, &mut $out[$c]);
        })*
    };
}

/// Reads the channels that `wanted` asks for; in the others is anything. All are
/// zero outside.
#[inline(always)]
pub(crate) fn fetch<I: Isa, const K: usize>(
    texture: &TextureView<'_>,
    index: &[u32; K],
    wanted: [bool; 4],
    out: &mut Channels<K>,
) {
    let format = texture.desc().format;
    // The channels that the loops below decode; the others are 0, 0, 1.
    let decoded = match (texture.texels, format) {
        (Texels::B8(texels), Format::Rgba16Float) => {
            fetch_halves::<I, K>(texels, index, wanted, out);
            4
        }
        (Texels::B4(texels), Format::Rgba8Unorm) => {
            let word = load4::<I, K>(texels, index);
            channels!(wanted, out,
                0: |k| unorm8(word[k]),
                1: |k| unorm8(word[k] >> 8),
                2: |k| unorm8(word[k] >> 16),
                3: |k| unorm8(word[k] >> 24));
            4
        }
        (
            Texels::B4(texels),
            Format::R32Float | Format::Depth32Float | Format::R32Uint | Format::R32Sint,
        ) => {
            if wanted[0] {
                out[0] = load4::<I, K>(texels, index);
            }
            1
        }
        (Texels::B4(texels), Format::Rg16Float) => {
            let word = load4::<I, K>(texels, index);
            halves!(wanted, out, 0: |k| word[k] as u16, 1: |k| (word[k] >> 16) as u16);
            2
        }
        (Texels::B2(texels), Format::R16Float) => {
            let word = load(texels, index);
            halves!(wanted, out, 0: |k| word[k]);
            1
        }
        (Texels::B8(texels), Format::Rg32Float | Format::Rg32Uint | Format::Rg32Sint) => {
            let word = load8::<I, K>(texels, index);
            channels!(wanted, out, 0: |k| word[k] as u32, 1: |k| (word[k] >> 32) as u32);
            2
        }
        (Texels::B16(texels), Format::Rgba32Float | Format::Rgba32Uint | Format::Rgba32Sint) => {
            let [low, high] = load_pairs(texels, index);
            channels!(wanted, out,
                0: |k| low[k] as u32,
                1: |k| (low[k] >> 32) as u32,
                2: |k| high[k] as u32,
                3: |k| (high[k] >> 32) as u32);
            4
        }
        (texels, _) => {
            decode(format, &words(texels, index), wanted, out);
            4
        }
    };
    let one = match format.sample_kind() {
        etalon_core::format::SampleKind::Uint | etalon_core::format::SampleKind::Sint => 1,
        _ => 1.0_f32.to_bits(),
    };
    for channel in decoded..4 {
        if wanted[channel] {
            out[channel] = [if channel == 3 { one } else { 0 }; K];
        }
    }
    // Nor are there constant channels outside.
    for channel in format.channels() as usize..4 {
        if wanted[channel] {
            for k in 0..K {
                out[channel][k] &= crate::num::mask(index[k] != OUTSIDE);
            }
        }
    }
}

#[inline(always)]
fn widened<T: Copy + Into<u64>, const K: usize>(words: [T; K]) -> [u64; K] {
    let mut wide = [0; K];
    for k in 0..K {
        wide[k] = words[k].into();
    }
    wide
}

/// Texels as words, whatever their size.
#[inline(always)]
fn words<const K: usize>(texels: &Texels, index: &[u32; K]) -> [[u64; K]; 2] {
    match texels {
        Texels::B1(texels) => [widened(load(texels, index)), [0; K]],
        Texels::B2(texels) => [widened(load(texels, index)), [0; K]],
        Texels::B4(texels) => [widened(load(texels, index)), [0; K]],
        Texels::B8(texels) => [load(texels, index), [0; K]],
        Texels::B16(texels) => load_pairs(texels, index),
    }
}

/// Writes texels where the index is inside; `K` is a multiple of [`BLOCK`].
#[inline(always)]
pub(crate) fn put<I: Isa, const K: usize>(
    texture: &TextureView<'_>,
    index: &[u32; K],
    channels: &Channels<K>,
) {
    let format = texture.desc().format;
    match (texture.texels, format) {
        (Texels::B8(texels), Format::Rgba16Float) => {
            put_halves::<I, K>(texels, index, channels);
        }
        (Texels::B4(texels), Format::Rgba8Unorm) => {
            let mut word = [0; K];
            unorm8_codes(channels, &mut word);
            store4::<I, K>(texels, index, &word);
        }
        (Texels::B4(texels), Format::R32Float | Format::R32Uint | Format::R32Sint) => {
            store4::<I, K>(texels, index, &channels[0]);
        }
        _ => {
            let mut words = [[0; K]; 2];
            encode(format, channels, &mut words);
            let [low, high] = words;
            match texture.texels {
                Texels::B1(texels) => {
                    let mut parts = [0; K];
                    for k in 0..K {
                        parts[k] = low[k] as u8;
                    }
                    store(texels, index, &parts);
                }
                Texels::B2(texels) => {
                    let mut parts = [0; K];
                    for k in 0..K {
                        parts[k] = low[k] as u16;
                    }
                    store(texels, index, &parts);
                }
                Texels::B4(texels) => {
                    let mut parts = [0; K];
                    for k in 0..K {
                        parts[k] = low[k] as u32;
                    }
                    store4::<I, K>(texels, index, &parts);
                }
                Texels::B8(texels) => store8::<I, K>(texels, index, &low),
                Texels::B16(texels) => {
                    for k in 0..K {
                        let at = index[k] as usize * 2;
                        if let Some([l, h]) = texels.get(at..at + 2) {
                            l.put(low[k]);
                            h.put(high[k]);
                        }
                    }
                }
            }
        }
    }
}

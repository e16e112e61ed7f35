//! Texels in number types wider than `f32`: between wide planes and lanes.

use std::sync::atomic::AtomicU64;

use etalon_core::Format;
use etalon_core::format::Encoding;

use super::isa::Isa;
use super::lanes::BLOCK;
use super::state::State;
use super::texels::{self, OUTSIDE};
use crate::code::{CodeInst, Slot};
use crate::memory::{WideTexels, in_range};
use crate::num::Number;
use crate::registers::LANES;

/// A channel of the texels at `index`; 0 outside.
#[inline(always)]
pub(super) fn channel<I: Isa, const K: usize>(
    wide: &WideTexels,
    index: &[u32; K],
    channel: u32,
) -> [f64; K] {
    let mut out = [0.0; K];
    if channel < wide.channels() {
        let bits = texels::load8::<I, K>(wide.channel(channel), index);
        for k in 0..K {
            out[k] = f64::from_bits(bits[k]);
        }
    } else if channel == 3 {
        for k in 0..K {
            out[k] = if index[k] == OUTSIDE { 0.0 } else { 1.0 };
        }
    }
    out
}

/// Asks for what the batch after this one, `width` invocations wide, will read or
/// write, if it is beside it.
#[inline(always)]
pub(super) fn ask_ahead<I: Isa, const K: usize>(wide: &WideTexels, index: &[u32; K], width: u32) {
    /// Numbers in a cache line.
    const LINE: usize = 8;
    for channel in 0..wide.channels() {
        let values = wide.channel(channel).as_ptr();
        for row in index.as_chunks::<LINE>().0 {
            if row[0] != OUTSIDE {
                let next = row[0].wrapping_add(width) as usize;
                I::prefetch(values.wrapping_add(next).cast());
            }
        }
    }
}

/// Sets the results of a load from the wide plane and, as far as the number
/// type keeps them, the texels' `singles`.
#[inline(always)]
pub(super) fn load<I: Isa, N: Number, const K: usize>(
    state: &mut State<'_, N>,
    inst: &CodeInst,
    wide: &WideTexels,
    index: &[u32; K],
    singles: &[[u32; K]; 4],
    chunk: usize,
) {
    for (c, result) in inst.results.iter().enumerate().take(4) {
        if let Some(to) = *result {
            let words = wide.channel(c as u32);
            if to.varying && load_blocks::<I, N, K>(state, words, index, &singles[c], to, chunk) {
                continue;
            }
            let doubles = channel::<I, K>(wide, index, c as u32);
            state.set_both(to, chunk, &singles[c], &doubles);
        }
    }
}

/// Loads a channel of all lanes block by block, so that nothing of it goes through
/// memory; or finds that some are outside.
#[inline(always)]
fn load_blocks<I: Isa, N: Number, const K: usize>(
    state: &mut State<'_, N>,
    words: &[AtomicU64],
    index: &[u32; K],
    singles: &[u32; K],
    to: Slot,
    chunk: usize,
) -> bool {
    let blocks = index.as_chunks::<BLOCK>().0.iter();
    for (block, (index, singles)) in blocks.zip(singles.as_chunks::<BLOCK>().0).enumerate() {
        let Some(doubles) = texels::block8::<I>(words, *index) else {
            return false;
        };
        state.set_both_block(to, chunk, block, *singles, doubles);
    }
    K == LANES
}

/// Stores channels in the wide plane, where the index is inside.
#[inline(always)]
pub(super) fn store<I: Isa, N: Number>(
    state: &State<'_, N>,
    wide: &WideTexels,
    format: Format,
    index: &[u32; LANES],
    values: &[Slot],
    chunk: usize,
) {
    let encoding = format.encoding();
    for (c, &slot) in (0..wide.channels()).zip(values) {
        let mut value: [f64; LANES] = state.doubles(slot, chunk);
        if encoding != Encoding::Float {
            for k in 0..LANES {
                value[k] = in_range(encoding, value[k]);
            }
        }
        let mut bits = [0; LANES];
        for k in 0..LANES {
            bits[k] = value[k].to_bits();
        }
        texels::store8::<I, LANES>(wide.channel(c), index, &bits);
    }
}

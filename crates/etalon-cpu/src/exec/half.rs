//! Handler of stores of `f16`s, which are half a word of a buffer.

use std::sync::atomic::Ordering;

use super::link::Instr;
use super::memory::{indices, words};
use super::state::State;
use super::tier::Step;
use crate::ir::Op;
use crate::num::Number;
use crate::registers::LANES;

pub(super) struct BufferStoreHalf;

impl<N: Number> Step<N> for BufferStoreHalf {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::BufferStoreHalf { buffer, offset }, [value, shift, index @ ..]) =
            (inst.op, &inst.operands[..])
        else {
            return;
        };
        let (words, _) = words(state, buffer);
        for chunk in 0..state.chunks {
            let mask = state.mask(inst, chunk);
            let value: [u32; LANES] = state.ints(*value, chunk);
            let shift: [u32; LANES] = state.ints(*shift, chunk);
            let index = indices::<N, LANES>(state, offset, index.first(), chunk);
            for k in (0..LANES).filter(|&k| mask[k] != 0) {
                let Some(word) = words.get(index[k]) else {
                    continue;
                };
                // Another worker may be storing the other half.
                let shift = shift[k] & 16;
                let kept = !(0xffff << shift);
                let new = (value[k] & 0xffff) << shift;
                let update = |old| Some(old & kept | new);
                let _ = word.fetch_update(Ordering::Relaxed, Ordering::Relaxed, update);
            }
        }
    }
}

//! Handler of read-modify-writes of texels.

use std::sync::atomic::Ordering;

use super::image::{addresses, texture};
use super::link::Instr;
use super::memory::combine;
use super::state::State;
use super::tier::Step;
use crate::ir::Op;
use crate::memory::Texels;
use crate::num::Number;
use crate::registers::LANES;

pub(super) struct ImageAtomic;

impl<N: Number> Step<N> for ImageAtomic {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageAtomic { access, function } = inst.op else {
            return;
        };
        let (Some(texture), Some((&value, coordinates))) =
            (texture(state, access.image), inst.operands.split_last())
        else {
            return;
        };
        // The formats that WGSL allows atomics on have one channel of 32 bits.
        let Texels::B4(texels) = texture.texels else {
            return;
        };
        for chunk in 0..state.chunks {
            let mask = state.mask(inst, chunk);
            let value: [u32; LANES] = state.ints(value, chunk);
            let index = addresses::<N, LANES>(state, texture, access, coordinates, None, chunk);
            for k in (0..LANES).filter(|&k| mask[k] != 0) {
                if let Some(texel) = texels.get(index[k] as usize) {
                    let update = |old| Some(combine(function, old, value[k], 0));
                    let _ = texel.fetch_update(Ordering::Relaxed, Ordering::Relaxed, update);
                }
            }
        }
    }
}

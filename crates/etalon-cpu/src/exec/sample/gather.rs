//! `textureGather`: Vulkan 1.3, §16.10 (image gather).

use super::{Place, Request};
use crate::exec::isa::Isa;
use crate::exec::link::Instr;
use crate::exec::memory::rounds;
use crate::exec::state::State;
use crate::exec::tier::TieredStep;
use crate::ir::Op;
use crate::memory::Channels;
use crate::num::Number;

/// The results' texels, as bits for the second one along x and y: WGSL's order
/// begins at the least u and the greatest v and goes around.
const ORDER: [usize; 4] = [0b10, 0b11, 0b01, 0b00];

pub(super) struct Gather<const K: usize>;

impl<N: Number, const K: usize> TieredStep<N> for Gather<K> {
    #[inline(always)]
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageGather {
            access,
            sampler,
            channel,
            offset: [x, y],
            compare,
            ..
        } = inst.op
        else {
            return;
        };
        let channel = usize::from(channel.min(3));
        let mut wanted = [false; 4];
        wanted[channel] = true;
        let offset = [i32::from(x), i32::from(y), 0];
        let Some(request) = Request::new(state, access, sampler, wanted, offset, compare) else {
            return;
        };
        let level = request.level(0);
        for chunk in 0..rounds::<N, K>(state) {
            let (place, _) = Place::<K>::read(state, &request, &inst.operands, chunk);
            let footprint = request.footprint(&[level; K], true, &place);
            let mut texels: [Channels<K>; 4] = [[[0; K]; 4]; 4];
            if access.cube {
                texels = request.cube_texels::<I, K>(&footprint, &place);
            } else {
                for (tap, texels) in texels.iter_mut().enumerate() {
                    let index = request.index(&footprint, &place, tap);
                    *texels = request.texels::<I, K>(&index, &place.reference);
                }
            }
            for (result, tap) in inst.results.iter().zip(ORDER) {
                if let Some(to) = *result {
                    state.set_bits(to, chunk, &texels[tap][channel]);
                }
            }
        }
    }
}

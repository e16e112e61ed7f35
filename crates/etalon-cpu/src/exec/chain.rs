//! Handlers of long superinstructions.

use std::marker::PhantomData;

use super::lanes::map_chain;
use super::link::Instr;
use super::state::State;
use super::tier::{Handler, Step, Tier};
use crate::ir::chain::{ChainVisitor, Chained};
use crate::num::Number;

/// Finds a chain's handler.
pub(super) struct Select {
    pub(super) tier: Tier,
}

impl<N: Number> ChainVisitor<N> for Select {
    type Output = Handler<N>;

    fn chain<const V: usize, const F: usize, const I: usize, O: Chained<N, V, F, I>>(
        self,
    ) -> Handler<N> {
        match self.tier {
            Tier::Baseline => Handler::plain::<ChainLanes<O, true, V, F, I>>(),
            tier => Handler::new::<ChainLanes<O, false, V, F, I>>(tier),
        }
    }
}

struct ChainLanes<O, const STEPS: bool, const V: usize, const F: usize, const I: usize>(
    PhantomData<O>,
);

impl<N, O, const STEPS: bool, const V: usize, const F: usize, const I: usize> Step<N>
    for ChainLanes<O, STEPS, V, F, I>
where
    N: Number,
    O: Chained<N, V, F, I>,
{
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        // A chain has all of its operands, in the order of the pattern.
        let code = state.code;
        let operands = code
            .operands
            .get(instr.chain_operands()..)
            .unwrap_or_default();
        let Some((lanes, rest)) = operands.split_first_chunk::<V>() else {
            return;
        };
        let Some((numbers, rest)) = rest.split_first_chunk::<F>() else {
            return;
        };
        let Some((bits, _)) = rest.split_first_chunk::<I>() else {
            return;
        };
        map_chain::<N, O, STEPS, V, F, I>(state, instr.d, lanes, numbers, bits);
    }
}

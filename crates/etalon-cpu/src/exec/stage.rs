//! Running vertex and fragment kernels: batches of lanes that others fill and read.

use super::Executor;
use super::dispatch::{DispatchFailure, Job};
use super::isa::Isa;
use super::link::{Instr, Linked};
use super::memory::rounds;
use super::profile::Unwatched;
use super::state::{Failure, LocalIds, Resource, State};
use super::tier::{Handler, Step, Tier, TieredStep};
use crate::code::Code;
use crate::ir::{Input, Op};
use crate::num::Number;
use crate::registers::LANES;

/// One worker's lanes of a vertex or fragment kernel.
pub(crate) struct Stage<'a> {
    state: State<'a, f32>,
    linked: &'a Linked<f32>,
    max_trips: u32,
}

/// Why a batch cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StageFailure {
    /// Bytes that cannot be had.
    OutOfMemory(u64),
    /// The loop of the number did not end.
    EndlessLoop(u32),
}

impl<'a> Stage<'a> {
    /// Lanes for batches of up to so many chunks; `local_ids` are of one workgroup
    /// of as many.
    pub(crate) fn new(
        code: &'a Code,
        linked: &'a Linked<f32>,
        resources: &'a [Resource<'a>],
        local_ids: &'a LocalIds,
        executor: &Executor,
    ) -> Result<Self, StageFailure> {
        let job = Job {
            code,
            linked,
            resources,
            local_ids,
            invocations: 0,
            shadows: &[],
            heat: None,
            workgroup_size: [0; 3],
            recording: None,
        };
        let state = job.state(executor, local_ids.active.len(), [1; 3]);
        Ok(Self {
            state: state.map_err(|failure| match failure {
                DispatchFailure::OutOfMemory(bytes) => StageFailure::OutOfMemory(bytes),
                _ => StageFailure::OutOfMemory(0),
            })?,
            linked,
            max_trips: executor.max_trips(),
        })
    }

    /// The lanes of an input, as bits.
    #[inline(always)]
    pub(crate) fn input(&mut self, slot: usize, chunk: usize) -> &mut [u32; LANES] {
        let stage = &mut self.state.stage;
        &mut stage.inputs[slot * stage.chunks + chunk].0
    }

    /// The lanes of an output, as bits.
    #[inline(always)]
    pub(crate) fn output(&self, slot: usize, chunk: usize) -> &[u32; LANES] {
        let stage = &self.state.stage;
        &stage.outputs[slot * stage.chunks + chunk].0
    }

    /// Runs the first chunks of the lanes.
    pub(crate) fn run(&mut self, chunks: usize) -> Result<(), StageFailure> {
        self.state.chunks = chunks.min(self.state.stage.chunks);
        let result = self
            .linked
            .run(&mut self.state, self.max_trips, &mut Unwatched);
        result.map_err(|failure| match failure {
            Failure::EndlessLoop { counter, .. } => StageFailure::EndlessLoop(counter),
            // Validation lets no barriers into these stages.
            Failure::DivergentBarrier { .. } => StageFailure::OutOfMemory(0),
        })
    }
}

/// Copies what an input's slot holds.
pub(super) struct StageInputStep;

impl<N: Number> Step<N> for StageInputStep {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Input(Input::Stage(slot)), Some(Some(to))) =
            (inst.op, inst.results.first().copied())
        else {
            return;
        };
        let first = usize::from(slot) * state.stage.chunks;
        if !to.varying {
            let lanes = state.stage.inputs[first].0;
            return state.set_bits(to, 0, &lanes);
        }
        for chunk in 0..state.chunks {
            let lanes = state.stage.inputs[first + chunk].0;
            state.set_bits(to, chunk, &lanes);
        }
    }
}

/// Fills an output's slot.
pub(super) struct Output;

impl<N: Number> Step<N> for Output {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::StageOutput { slot } = inst.op else {
            return;
        };
        for chunk in 0..state.chunks {
            let at = usize::from(slot) * state.stage.chunks + chunk;
            let lanes: [u32; LANES] = state.bits(inst.operands[0], chunk);
            state.stage.outputs[at].0 = lanes;
        }
    }
}

pub(super) fn derivative<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::tiered::<Derivative<LANES>>(tier)
    } else {
        Handler::portable::<Derivative<1>>()
    }
}

/// Differences within quads, whose lanes are the upper left, upper right, lower
/// left and lower right fragment.
struct Derivative<const K: usize>;

impl<N: Number, const K: usize> TieredStep<N> for Derivative<K> {
    #[inline(always)]
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Derivative { down, coarse }, Some(Some(to))) =
            (inst.op, inst.results.first().copied())
        else {
            return;
        };
        for chunk in 0..rounds::<N, K>(state) {
            let from: [N; K] = state.floats(inst.operands[0], chunk);
            let mut out = [N::default(); K];
            if K == 1 {
                // The same in all fragments.
                out[0] = from[0].sub(from[0]);
            } else {
                for quad in 0..K / 4 {
                    let first = quad * 4;
                    let [a, b, c, d] = [
                        from[first],
                        from[first + 1],
                        from[first + 2],
                        from[first + 3],
                    ];
                    let differences = match (down, coarse) {
                        (false, false) => [b.sub(a), b.sub(a), d.sub(c), d.sub(c)],
                        (true, false) => [c.sub(a), d.sub(b), c.sub(a), d.sub(b)],
                        (false, true) => [b.sub(a); 4],
                        (true, true) => [c.sub(a); 4],
                    };
                    out[first..first + 4].copy_from_slice(&differences);
                }
            }
            state.set_floats(to, chunk, &out);
        }
    }
}

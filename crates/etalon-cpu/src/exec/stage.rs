//! Running vertex and fragment kernels: batches of lanes that others fill and read.

use std::sync::{Mutex, PoisonError};

use etalon_core::Format;

use super::Executor;
use super::dispatch::{DispatchFailure, Job};
use super::isa::Isa;
use super::link::{Instr, Linked};
use super::links::Links;
use super::memory::rounds;
use super::probe::{Heat, StoreFormat, Tally, append_tallies};
use super::profile::Unwatched;
use super::state::{Failure, LocalIds, Resource, StageLanes, State};
use super::tier::{Handler, Step, Tier, TieredStep};
use crate::code::Code;
use crate::ir::{Input, Op};
use crate::num::{Number, NumberType, Shadow};
use crate::registers::LANES;

/// A vertex or fragment kernel and what it is run with.
#[derive(Clone, Copy)]
pub(crate) struct StageKernel<'a> {
    pub(crate) code: &'a Code,
    pub(crate) links: &'a Links,
    pub(crate) resources: &'a [Resource<'a>],
    /// Of one workgroup of as many lanes as a batch has at most.
    pub(crate) local_ids: &'a LocalIds,
    /// What it is computed in; inputs and outputs are `f32` in every type.
    pub(crate) number_type: NumberType,
    /// Formats of the colours that it gives.
    pub(crate) colours: &'a [Format],
    /// Where its probes note what they see.
    pub(crate) watch: &'a StageWatch,
}

/// What the probes of a kernel note.
#[derive(Debug, Default)]
pub(crate) struct StageWatch {
    pub(crate) heat: Heat,
    tallies: Mutex<Vec<Tally>>,
}

impl StageWatch {
    pub(crate) fn new(heat: Heat) -> Self {
        Self {
            heat,
            tallies: Mutex::default(),
        }
    }

    pub(crate) fn into_tallies(self) -> (Vec<Tally>, Heat) {
        let tallies = self.tallies.into_inner();
        (tallies.unwrap_or_else(PoisonError::into_inner), self.heat)
    }
}

/// Whose lanes those of a chunk are, for probes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Who {
    /// A bit for each lane that has an invocation, not only a helper of one.
    pub(crate) live: u64,
    /// The pixel or the vertex, by number.
    pub(crate) invocation: [u32; LANES],
}

impl Default for Who {
    fn default() -> Self {
        Self {
            live: 0,
            invocation: [0; LANES],
        }
    }
}

/// One worker's lanes of a vertex or fragment kernel.
pub(crate) struct Stage<'a> {
    /// Given to the state only while it runs, so that whoever fills and reads lanes
    /// need not know the number type.
    lanes: StageLanes,
    typed: Typed<'a>,
    watch: &'a StageWatch,
    max_trips: u32,
}

enum Typed<'a> {
    Singles(Box<Ready<'a, f32>>),
    Doubles(Box<Ready<'a, f64>>),
    Shadowed(Box<Ready<'a, Shadow>>),
}

struct Ready<'a, N: Number> {
    state: State<'a, N>,
    linked: &'a Linked<N>,
}

/// Why a batch cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StageFailure {
    /// Bytes that cannot be had.
    OutOfMemory(u64),
    /// The loop of the number did not end.
    EndlessLoop(u32),
}

impl<'a, N: Number> Ready<'a, N> {
    fn new(
        kernel: &StageKernel<'a>,
        linked: &'a Linked<N>,
        executor: &Executor,
    ) -> Result<(Box<Self>, StageLanes), StageFailure> {
        let job = Job {
            code: kernel.code,
            linked,
            resources: kernel.resources,
            local_ids: kernel.local_ids,
            invocations: 0,
            shadows: &[],
            heat: Some(&kernel.watch.heat),
            workgroup_size: [0; 3],
            recording: None,
        };
        let state = job.state(executor, kernel.local_ids.active.len(), [1; 3]);
        let mut state = state.map_err(|failure| match failure {
            DispatchFailure::OutOfMemory(bytes) => StageFailure::OutOfMemory(bytes),
            _ => StageFailure::OutOfMemory(0),
        })?;
        let mut lanes = std::mem::take(&mut state.stage);
        if state.prober.is_some() {
            lanes.who = vec![Who::default(); lanes.chunks];
            lanes.colours = kernel
                .colours
                .iter()
                .copied()
                .map(StoreFormat::of)
                .collect();
        }
        Ok((Box::new(Self { state, linked }), lanes))
    }

    fn run(
        &mut self,
        lanes: &mut StageLanes,
        chunks: usize,
        max_trips: u32,
    ) -> Result<(), StageFailure> {
        let state = &mut self.state;
        state.chunks = chunks.min(lanes.chunks);
        std::mem::swap(&mut state.stage, lanes);
        if let Some(prober) = &mut state.prober {
            prober.begin();
        }
        let result = self.linked.run(state, max_trips, &mut Unwatched);
        std::mem::swap(&mut state.stage, lanes);
        result.map_err(|failure| match failure {
            Failure::EndlessLoop { counter, .. } => StageFailure::EndlessLoop(counter),
            // Validation lets no barriers into these stages.
            Failure::DivergentBarrier { .. } => StageFailure::OutOfMemory(0),
        })
    }

    fn into_tallies(self) -> Vec<Tally> {
        self.state
            .prober
            .map(|prober| prober.tallies)
            .unwrap_or_default()
    }
}

impl<'a> Stage<'a> {
    /// Lanes for batches of up to as many chunks as the kernel's `local_ids` have.
    pub(crate) fn new(kernel: &StageKernel<'a>, executor: &Executor) -> Result<Self, StageFailure> {
        let (code, links, tier) = (kernel.code, kernel.links, executor.tier());
        let (typed, lanes) = match kernel.number_type {
            NumberType::F32 => {
                let (ready, lanes) = Ready::new(kernel, links.singles(code, tier), executor)?;
                (Typed::Singles(ready), lanes)
            }
            NumberType::F64 => {
                let (ready, lanes) = Ready::new(kernel, links.doubles(code, tier), executor)?;
                (Typed::Doubles(ready), lanes)
            }
            NumberType::Shadow => {
                let (ready, lanes) = Ready::new(kernel, links.shadowed(code, tier), executor)?;
                (Typed::Shadowed(ready), lanes)
            }
        };
        Ok(Self {
            lanes,
            typed,
            watch: kernel.watch,
            max_trips: executor.max_trips(),
        })
    }

    /// The lanes of an input, as bits.
    #[inline(always)]
    pub(crate) fn input(&mut self, slot: usize, chunk: usize) -> &mut [u32; LANES] {
        &mut self.lanes.inputs[slot * self.lanes.chunks + chunk].0
    }

    /// The lanes of an output, as bits.
    #[inline(always)]
    pub(crate) fn output(&self, slot: usize, chunk: usize) -> &[u32; LANES] {
        &self.lanes.outputs[slot * self.lanes.chunks + chunk].0
    }

    /// Whose a chunk's lanes are, to be filled if probes ask for it.
    #[inline(always)]
    pub(crate) fn who(&mut self, chunk: usize) -> Option<&mut Who> {
        self.lanes.who.get_mut(chunk)
    }

    /// Runs the first chunks of the lanes.
    pub(crate) fn run(&mut self, chunks: usize) -> Result<(), StageFailure> {
        let (lanes, max_trips) = (&mut self.lanes, self.max_trips);
        match &mut self.typed {
            Typed::Singles(ready) => ready.run(lanes, chunks, max_trips),
            Typed::Doubles(ready) => ready.run(lanes, chunks, max_trips),
            Typed::Shadowed(ready) => ready.run(lanes, chunks, max_trips),
        }
    }

    /// Hands over what probes have noted.
    pub(crate) fn finish(self) {
        let tallies = match self.typed {
            Typed::Singles(ready) => ready.into_tallies(),
            Typed::Doubles(ready) => ready.into_tallies(),
            Typed::Shadowed(ready) => ready.into_tallies(),
        };
        if !tallies.is_empty() {
            let all = self.watch.tallies.lock();
            append_tallies(&mut all.unwrap_or_else(PoisonError::into_inner), tallies);
        }
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

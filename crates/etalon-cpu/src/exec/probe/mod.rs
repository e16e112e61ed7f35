//! Handlers of probes, and what a worker knows for their sake: see
//! [`crate::sanitise`].

mod heat;
mod store;
mod tally;
mod twin;
mod value;

pub(crate) use heat::Heat;
pub(crate) use store::Format as StoreFormat;
pub(crate) use tally::{Tally, append_tallies};
pub(super) use twin::Twin;

use super::link::Instr;
use super::state::State;
use super::tier::Step;
use crate::code::{Code, CodeInst, Slot};
use crate::ir::{Op, Probed};
use crate::num::Number;
use crate::registers::{Class, LANES};

/// What a worker keeps for the probes of a program that has some.
pub(crate) struct Prober<'a> {
    /// One for each probe of the program.
    pub(crate) tallies: Vec<Tally>,
    twins: Vec<Option<Twin>>,
    /// Lanes of each chunk that have decided otherwise than their twins.
    diverged: Vec<u64>,
    workgroup_size: [u32; 3],
    heat: &'a Heat,
}

impl<'a> Prober<'a> {
    /// `None` if the program has no probes.
    pub(crate) fn new(
        code: &Code,
        chunks: usize,
        workgroup_size: [u32; 3],
        heat: &'a Heat,
    ) -> Option<Box<Self>> {
        let probes = &code.resources.probes;
        if probes.is_empty() {
            return None;
        }
        let twin = |probed| match probed {
            Probed::Arith(op) => Some(Twin::of(op)),
            Probed::Texel(_) | Probed::Colour(_) | Probed::Word => None,
        };
        Some(Box::new(Self {
            tallies: vec![Tally::default(); probes.len()],
            twins: probes.iter().map(|probe| twin(probe.probed)).collect(),
            diverged: vec![0; chunks],
            workgroup_size,
            heat,
        }))
    }

    /// New invocations agree with their twins.
    pub(crate) fn begin(&mut self) {
        self.diverged.fill(0);
    }
}

/// An operand in all lanes of a chunk, or once for all.
#[allow(clippy::large_enum_variant)]
enum Operand {
    Float {
        singles: [f32; LANES],
        doubles: [f64; LANES],
    },
    Int([u32; LANES]),
}

impl Operand {
    fn of<N: Number>(state: &State<'_, N>, slot: Slot, chunk: usize) -> Self {
        match slot.class {
            Class::Float => Self::Float {
                singles: state.singles(slot, chunk),
                doubles: state.doubles(slot, chunk),
            },
            Class::Int => Self::Int(state.ints(slot, chunk)),
        }
    }

    /// The operand of a lane.
    #[inline(always)]
    fn at(&self, lane: usize) -> Scalar {
        match self {
            Self::Float { singles, doubles } => Scalar {
                single: singles[lane],
                double: doubles[lane],
                int: 0,
                is_float: true,
            },
            Self::Int(ints) => Scalar {
                int: ints[lane],
                ..Scalar::default()
            },
        }
    }
}

/// An operand of an invocation, with its twin if it is a number.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Scalar {
    pub(crate) single: f32,
    double: f64,
    pub(crate) int: u32,
    is_float: bool,
}

impl Scalar {
    /// A number, or an integer, without a twin of its own.
    pub(crate) fn single(single: f32, int: u32) -> Self {
        Self {
            single,
            double: single.into(),
            int,
            is_float: true,
        }
    }
}

/// Some invocations that have the same numbers.
#[derive(Clone, Copy)]
struct Lane {
    /// The first of them.
    invocation: u64,
    /// How many.
    times: u64,
    /// Whether they have decided otherwise than their twins before.
    diverged: bool,
}

/// The most operands that a probe has with its result.
const MAX_OPERANDS: usize = 5;

/// Any probe.
pub(super) struct ProbeStep;

impl<N: Number> Step<N> for ProbeStep {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::Probe(site) = inst.op else {
            return;
        };
        // Out of the state while it is changed.
        let Some(mut prober) = state.prober.take() else {
            return;
        };
        if let Some(probe) = state.code.resources.probes.get(site as usize) {
            let uniform = inst.operands.iter().all(|slot| !slot.varying);
            for chunk in 0..state.chunks {
                prober.chunk(state, inst, (site as usize, probe.probed), chunk, uniform);
            }
        }
        state.prober = Some(prober);
    }
}

impl Prober<'_> {
    fn chunk<N: Number>(
        &mut self,
        state: &State<'_, N>,
        inst: &CodeInst,
        (site, probed): (usize, Probed),
        chunk: usize,
        uniform: bool,
    ) {
        let active = active(state, inst, chunk);
        if active == 0 {
            return;
        }
        let mut operands: [Option<Operand>; MAX_OPERANDS] = [const { None }; MAX_OPERANDS];
        for (operand, &slot) in operands.iter_mut().zip(&inst.operands) {
            *operand = Some(Operand::of(state, slot, chunk));
        }
        let before = self.diverged[chunk];
        let mut rest = active;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            // Of invocations that are the same, those that have diverged are apart.
            let same = if uniform {
                let diverged = before >> lane & 1 != 0;
                rest & if diverged { before } else { !before }
            } else {
                1 << lane
            };
            rest &= !same;
            let mut scalars = [Scalar::default(); MAX_OPERANDS];
            for (scalar, operand) in scalars.iter_mut().zip(operands.iter().flatten()) {
                *scalar = operand.at(lane);
            }
            let scalars = &scalars[..inst.operands.len().min(MAX_OPERANDS)];
            let who = Lane {
                invocation: self.invocation(state, chunk, lane),
                times: same.count_ones().into(),
                diverged: before >> lane & 1 != 0,
            };
            let seen = self.see(state, (site, probed), scalars, who);
            if seen.diverges {
                self.diverged[chunk] |= same;
            }
            if seen.heat > 0 {
                let mut lanes = same;
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    let invocation = self.invocation(state, chunk, lane);
                    self.heat.mark(site, invocation, seen.heat);
                    if seen.diverges {
                        self.heat.diverge(invocation);
                    }
                }
            }
        }
    }

    fn see<N: Number>(
        &mut self,
        state: &State<'_, N>,
        (site, probed): (usize, Probed),
        scalars: &[Scalar],
        who: Lane,
    ) -> Seen {
        let tally = &mut self.tallies[site];
        tally.executions += who.times;
        if who.diverged {
            tally.after_divergence += who.times;
        }
        match (probed, self.twins[site]) {
            (Probed::Arith(op), Some(twin)) => value::see(tally, op, twin, scalars, who),
            (Probed::Texel(access), _) => {
                let format = store::texture_format(state, access.image);
                store::see(tally, format, scalars, who)
            }
            (Probed::Colour(target), _) => {
                let format = state.stage.colours.get(target as usize);
                let format = format.copied().unwrap_or(store::Format::WORD);
                store::see(tally, format, scalars, who)
            }
            _ => store::see(tally, store::Format::WORD, scalars, who),
        }
    }

    /// The place of an invocation in the dispatch, x first; the number of a pixel or
    /// vertex.
    fn invocation<N: Number>(&self, state: &State<'_, N>, chunk: usize, lane: usize) -> u64 {
        if let Some(who) = state.stage.who.get(chunk) {
            return who.invocation[lane].into();
        }
        let local = state.local_chunk(chunk);
        let mut workgroup = state.workgroup;
        workgroup[0] += state.group_in_batch(chunk);
        let at = |axis: usize| {
            u64::from(workgroup[axis]) * u64::from(self.workgroup_size[axis])
                + u64::from(state.local_ids.ids[axis][local].0[lane])
        };
        let size =
            |axis: usize| u64::from(state.workgroups[axis]) * u64::from(self.workgroup_size[axis]);
        at(0) + size(0) * (at(1) + size(1) * at(2))
    }
}

/// What a probe makes of an invocation.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// From here on the invocation goes another way than its twin.
    diverges: bool,
    /// See [`crate::sanitise::Site::heat`].
    heat: u8,
}

/// The lanes of a chunk that hold an invocation that takes part.
fn active<N: Number>(state: &State<'_, N>, inst: &CodeInst, chunk: usize) -> u64 {
    let mask = state.mask(inst, chunk);
    let there = &state.local_ids.active[state.local_chunk(chunk)].0;
    let mut active = 0;
    for lane in 0..LANES {
        active |= u64::from(mask[lane] & there[lane] != 0) << lane;
    }
    match state.stage.who.get(chunk) {
        Some(who) => active & who.live,
        None => active,
    }
}

/// The unit in the last place of an `f32` that is nearest to `exact`.
#[inline]
pub(super) fn ulp(exact: f64) -> f64 {
    let exponent = ((exact.to_bits() >> 52) & 0x7ff) as i64 - 1023;
    let exponent = exponent.clamp(-126, 127) - 23;
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// Eighths of bits that are wrong.
fn heat_of(ulps: f64) -> u8 {
    ((1.0 + ulps).log2() * 8.0).ceil().min(253.0) as u8
}

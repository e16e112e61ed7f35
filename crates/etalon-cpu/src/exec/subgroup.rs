//! Handler of operations among the invocations of a subgroup.
//!
//! A subgroup is consecutive lanes; with 128 of them, those of two chunks. Only
//! active lanes take part, in the order of their numbers: sums of floats are
//! made from the first one on.

use super::link::Instr;
use super::state::State;
use super::tier::Step;
use crate::code::{CodeInst, Slot};
use crate::ir::Op;
use crate::ir::subgroup::{Combine, Scan, Source, SubgroupFunction};
use crate::num::Number;
use crate::registers::{Class, LANES};

/// The largest subgroup WGSL knows.
pub(super) const MAX_SUBGROUP: usize = 128;

pub(super) struct Subgroup;

impl<N: Number> Step<N> for Subgroup {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Subgroup { function, class }, Some(&value)) = (inst.op, inst.operands.first())
        else {
            return;
        };
        let size = (state.subgroup_size as usize).clamp(1, MAX_SUBGROUP);
        let lanes = state.chunks * LANES;
        for first in (0..lanes).step_by(size) {
            let group = Group {
                first,
                size: size.min(lanes - first),
            };
            let active = group.active(state, inst);
            match (function, class) {
                (SubgroupFunction::Ballot, _) => {
                    let mut words = [0_u32; 4];
                    for lane in group.lanes().filter(|&lane| active[lane]) {
                        if group.int(state, value, lane) != 0 {
                            words[lane / 32 % 4] |= 1 << (lane % 32);
                        }
                    }
                    for (word, to) in words.into_iter().zip(&inst.results) {
                        if let Some(to) = *to {
                            for lane in group.lanes() {
                                group.set_int(state, to, lane, word);
                            }
                        }
                    }
                }
                (SubgroupFunction::Combine(op, scan), Class::Float) => {
                    let values = group.all(|lane| group.float(state, value, lane));
                    let (identity, combine) = on_floats::<N>(op);
                    let results = group.scan(&active, &values, scan, identity, combine);
                    if let Some(to) = result(inst) {
                        group
                            .lanes()
                            .for_each(|lane| group.set_float(state, to, lane, results[lane]));
                    }
                }
                (SubgroupFunction::Combine(op, scan), Class::Int) => {
                    let values = group.all(|lane| group.int(state, value, lane));
                    let (identity, combine) = on_ints(op);
                    let results = group.scan(&active, &values, scan, identity, combine);
                    if let Some(to) = result(inst) {
                        group
                            .lanes()
                            .for_each(|lane| group.set_int(state, to, lane, results[lane]));
                    }
                }
                (SubgroupFunction::Gather(source), _) => {
                    let number = inst.operands.get(1);
                    let sources = group.all(|lane| {
                        let number = number.map_or(0, |&slot| group.int(state, slot, lane));
                        group.source(&active, source, lane, number)
                    });
                    let Some(to) = result(inst) else {
                        continue;
                    };
                    match class {
                        Class::Float => {
                            let values = group.all(|lane| group.float(state, value, lane));
                            for lane in group.lanes() {
                                let got = sources[lane].map_or(N::default(), |from| values[from]);
                                group.set_float(state, to, lane, got);
                            }
                        }
                        Class::Int => {
                            let values = group.all(|lane| group.int(state, value, lane));
                            for lane in group.lanes() {
                                let got = sources[lane].map_or(0, |from| values[from]);
                                group.set_int(state, to, lane, got);
                            }
                        }
                    }
                }
            }
        }
    }
}

fn result(inst: &CodeInst) -> Option<Slot> {
    inst.results.first().copied().flatten()
}

/// The lanes of a subgroup; they are numbered from 0 within it.
struct Group {
    first: usize,
    size: usize,
}

impl Group {
    fn lanes(&self) -> std::ops::Range<usize> {
        0..self.size
    }

    /// Chunk and lane in it.
    fn at(&self, lane: usize) -> (usize, usize) {
        ((self.first + lane) / LANES, (self.first + lane) % LANES)
    }

    fn all<T: Copy + Default>(&self, of: impl Fn(usize) -> T) -> [T; MAX_SUBGROUP] {
        let mut all = [T::default(); MAX_SUBGROUP];
        for lane in self.lanes() {
            all[lane] = of(lane);
        }
        all
    }

    fn active<N: Number>(&self, state: &State<'_, N>, inst: &CodeInst) -> [bool; MAX_SUBGROUP] {
        self.all(|lane| {
            inst.mask
                .is_none_or(|mask| self.int(state, mask, lane) != 0)
        })
    }

    fn int<N: Number>(&self, state: &State<'_, N>, slot: Slot, lane: usize) -> u32 {
        if !slot.varying {
            return state.registers.uniform_ints[usize::from(slot.number)];
        }
        let (chunk, lane) = self.at(lane);
        state.registers.ints[state.at(slot.number, chunk)].0[lane]
    }

    fn float<N: Number>(&self, state: &State<'_, N>, slot: Slot, lane: usize) -> N {
        if !slot.varying {
            return state.registers.uniform_floats[usize::from(slot.number)];
        }
        let (chunk, lane) = self.at(lane);
        state.registers.floats[state.at(slot.number, chunk)].0[lane]
    }

    /// Results always vary.
    fn set_int<N: Number>(&self, state: &mut State<'_, N>, slot: Slot, lane: usize, value: u32) {
        let (chunk, lane) = self.at(lane);
        let at = state.at(slot.number, chunk);
        state.registers.ints[at].0[lane] = value;
    }

    fn set_float<N: Number>(&self, state: &mut State<'_, N>, slot: Slot, lane: usize, value: N) {
        let (chunk, lane) = self.at(lane);
        let at = state.at(slot.number, chunk);
        state.registers.floats[at].0[lane] = value;
    }

    fn scan<T: Copy + Default>(
        &self,
        active: &[bool; MAX_SUBGROUP],
        values: &[T; MAX_SUBGROUP],
        scan: Scan,
        identity: T,
        combine: impl Fn(T, T) -> T,
    ) -> [T; MAX_SUBGROUP] {
        let mut results = [identity; MAX_SUBGROUP];
        let mut sum = None;
        for lane in self.lanes().filter(|&lane| active[lane]) {
            if let (Scan::Exclusive, Some(sum)) = (scan, sum) {
                results[lane] = sum;
            }
            let so_far = sum.map_or(values[lane], |sum| combine(sum, values[lane]));
            if scan == Scan::Inclusive {
                results[lane] = so_far;
            }
            sum = Some(so_far);
        }
        if scan == Scan::Reduce {
            results = [sum.unwrap_or(identity); MAX_SUBGROUP];
        }
        results
    }

    /// Which lane's number a lane gets: none where there is no such lane, or it
    /// is not active.
    fn source(
        &self,
        active: &[bool; MAX_SUBGROUP],
        source: Source,
        lane: usize,
        number: u32,
    ) -> Option<usize> {
        let number = number as usize;
        let from = match source {
            Source::First => self.lanes().find(|&lane| active[lane])?,
            Source::Number => number,
            Source::Before => lane.checked_sub(number)?,
            Source::After => lane.checked_add(number)?,
            Source::Xor => lane ^ number,
            Source::InQuad => (lane & !3) | (number & 3),
        };
        (from < self.size && active[from]).then_some(from)
    }
}

/// The neutral element, and the operation.
fn on_floats<N: Number>(op: Combine) -> (N, fn(N, N) -> N) {
    match op {
        Combine::Mul => (N::from_f32(1.0), N::mul),
        Combine::MinF => (N::from_f32(f32::INFINITY), N::min),
        Combine::MaxF => (N::from_f32(f32::NEG_INFINITY), N::max),
        _ => (N::default(), N::add),
    }
}

fn on_ints(op: Combine) -> (u32, fn(u32, u32) -> u32) {
    match op {
        Combine::Mul => (1, u32::wrapping_mul),
        Combine::MinS => (i32::MAX as u32, |a, b| (a as i32).min(b as i32) as u32),
        Combine::MaxS => (i32::MIN as u32, |a, b| (a as i32).max(b as i32) as u32),
        Combine::MinU => (u32::MAX, u32::min),
        Combine::MaxU => (0, u32::max),
        Combine::And => (u32::MAX, |a, b| a & b),
        Combine::Or => (0, |a, b| a | b),
        Combine::Xor => (0, |a, b| a ^ b),
        _ => (0, u32::wrapping_add),
    }
}

//! Handlers of inputs, buffers, and the memory of invocations and workgroups.

use std::sync::atomic::{AtomicU32, Ordering};

use super::link::Instr;
use super::state::{Resource, State};
use super::tier::{Handler, Step, Tier};
use crate::code::{CodeInst, Slot};
use crate::ir::{AtomicFunction, Input, Memory, Op};
use crate::memory::{Buffer, WideWords};
use crate::num::Number;
use crate::registers::{Class, LANES};

/// How many times a handler must run its `K` lanes to fill a result.
#[inline(always)]
pub(super) fn rounds<N: Number, const K: usize>(state: &State<'_, N>) -> usize {
    if K == LANES { state.chunks } else { 1 }
}

fn result(inst: &CodeInst) -> Option<Slot> {
    inst.results.first().copied().flatten()
}

pub(super) struct InputStep;

impl<N: Number> Step<N> for InputStep {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Input(input), Some(to)) = (inst.op, result(inst)) else {
            return;
        };
        let axis = |axis: u8| usize::from(axis.min(2));
        let local = state.local_ids;
        let (lanes, base): (_, [u32; 2]) = match input {
            // The first workgroup's, and the difference of one to the next.
            Input::BatchedWorkgroupX => (None, [state.workgroup[0], 1]),
            Input::GlobalId { axis: a, size } => {
                let first = state.workgroup[axis(a)].wrapping_mul(size);
                let step = if a == 0 { size } else { 0 };
                (Some(&local.ids[axis(a)]), [first, step])
            }
            Input::LocalId(a) => (Some(&local.ids[axis(a)]), [0; 2]),
            Input::LocalIndex => (Some(&local.ids[3]), [0; 2]),
            Input::ActiveLanes => (Some(&local.active), [0; 2]),
            Input::WorkgroupId(a) => return state.set_ints(to, 0, &[state.workgroup[axis(a)]]),
            Input::NumWorkgroups(a) => return state.set_ints(to, 0, &[state.workgroups[axis(a)]]),
            Input::SubgroupSize => return state.set_ints(to, 0, &[state.subgroup_size]),
            // A handler of their own.
            Input::Stage(_) => return,
        };
        let [first, step] = base;
        for chunk in 0..state.chunks {
            let base = first.wrapping_add(state.group_in_batch(chunk).wrapping_mul(step));
            let at = state.at(to.number, chunk);
            let local = state.local_chunk(chunk);
            let to = &mut state.registers.ints[at].0;
            match lanes {
                Some(lanes) => {
                    let lanes = &lanes[local].0;
                    for k in 0..LANES {
                        to[k] = base.wrapping_add(lanes[k]);
                    }
                }
                None => to.fill(base),
            }
        }
    }
}

/// Picks between all lanes and one for all.
macro_rules! by_width {
    ($name:ident, $step:ident) => {
        pub(super) fn $name<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
            if varying {
                Handler::new::<$step<LANES>>(tier)
            } else {
                Handler::plain::<$step<1>>()
            }
        }
    };
}

by_width!(table, Table);
by_width!(buffer_load, BufferLoad);
by_width!(memory_load, MemoryLoad);

struct Table<const K: usize>;

impl<N: Number, const K: usize> Step<N> for Table<K> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Table { table, .. }, Some(to)) = (inst.op, result(inst)) else {
            return;
        };
        let table = &state.code.resources.tables[table as usize];
        for chunk in 0..rounds::<N, K>(state) {
            let index: [u32; K] = state.ints(inst.operands[0], chunk);
            let mut bits = [0; K];
            for k in 0..K {
                bits[k] = table.get(index[k] as usize).copied().unwrap_or(0);
            }
            state.set_bits(to, chunk, &bits);
        }
    }
}

fn buffer<'a, N: Number>(state: &State<'a, N>, buffer: u16) -> Option<&'a Buffer> {
    match state.resources.get(usize::from(buffer)) {
        Some(&Resource::Buffer(buffer)) => Some(buffer),
        _ => None,
    }
}

pub(super) fn words<'a, N: Number>(state: &State<'a, N>, number: u16) -> &'a [AtomicU32] {
    buffer(state, number).map_or(&[], Buffer::words)
}

/// The wide plane of a buffer, in number types that need one.
#[inline(always)]
fn wide_words<'a, N: Number>(state: &State<'a, N>, number: u16) -> Option<&'a WideWords> {
    if N::WIDE {
        buffer(state, number)?.wide()
    } else {
        None
    }
}

/// The words' indices: a fixed part, and a computed one if there is an operand.
#[inline(always)]
pub(super) fn indices<N: Number, const K: usize>(
    state: &State<'_, N>,
    offset: u32,
    computed: Option<&Slot>,
    chunk: usize,
) -> [usize; K] {
    // Loops, here and below: what is passed a closure is not compiled for the tier.
    let mut indices = [offset as usize; K];
    if let Some(&slot) = computed {
        let index: [u32; K] = state.ints(slot, chunk);
        for k in 0..K {
            indices[k] += index[k] as usize;
        }
    }
    indices
}

struct BufferLoad<const K: usize>;

impl<N: Number, const K: usize> Step<N> for BufferLoad<K> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::BufferLoad { buffer, offset, .. }, Some(to)) = (inst.op, result(inst)) else {
            return;
        };
        let wide = match to.class {
            Class::Float => wide_words(state, buffer),
            Class::Int => None,
        };
        let words = words(state, buffer);
        for chunk in 0..rounds::<N, K>(state) {
            let index = indices::<N, K>(state, offset, inst.operands.first(), chunk);
            // Indices are clamped where they are computed; this is for buffers
            // that are smaller than declared.
            let mut bits = [0; K];
            for k in 0..K {
                if let Some(word) = words.get(index[k]) {
                    bits[k] = word.load(Ordering::Relaxed);
                }
            }
            match wide {
                None => state.set_bits(to, chunk, &bits),
                Some(wide) => {
                    let mut doubles = [0.0; K];
                    for k in 0..K {
                        let single = f64::from(f32::from_bits(bits[k]));
                        doubles[k] = wide.get(index[k]).unwrap_or(single);
                    }
                    state.set_both(to, chunk, &bits, &doubles);
                }
            }
        }
    }
}

pub(super) struct BufferStore;

impl<N: Number> Step<N> for BufferStore {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::BufferStore { buffer, offset, .. } = inst.op else {
            return;
        };
        let words = words(state, buffer);
        for chunk in 0..state.chunks {
            let mask = state.mask(inst, chunk);
            let value: [u32; LANES] = state.bits(inst.operands[0], chunk);
            let index = indices::<N, LANES>(state, offset, inst.operands.get(1), chunk);
            for k in 0..LANES {
                if mask[k] != 0
                    && let Some(word) = words.get(index[k])
                {
                    word.store(value[k], Ordering::Relaxed);
                }
            }
            if let Some(wide) = wide_words(state, buffer) {
                store_wide(state, wide, inst.operands[0], chunk, &mask, &index);
            }
        }
    }
}

/// What a store leaves in the wide plane: numbers, or that there are none.
fn store_wide<N: Number>(
    state: &State<'_, N>,
    wide: &WideWords,
    value: Slot,
    chunk: usize,
    mask: &[u32; LANES],
    index: &[usize; LANES],
) {
    match value.class {
        Class::Float => {
            let doubles: [f64; LANES] = state.doubles(value, chunk);
            for k in (0..LANES).filter(|&k| mask[k] != 0) {
                wide.set(index[k], doubles[k]);
            }
        }
        Class::Int => {
            for k in (0..LANES).filter(|&k| mask[k] != 0) {
                wide.forget(index[k]);
            }
        }
    }
}

pub(super) struct BufferLength;

impl<N: Number> Step<N> for BufferLength {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (
            Op::BufferLength {
                buffer,
                offset,
                stride,
            },
            Some(to),
        ) = (inst.op, result(inst))
        else {
            return;
        };
        let bytes = self::buffer(state, buffer).map_or(0, Buffer::len);
        let length = bytes.saturating_sub(offset.into()) / u64::from(stride.max(1));
        state.set_ints(to, 0, &[u32::try_from(length).unwrap_or(u32::MAX)]);
    }
}

pub(super) struct BufferAtomic;

impl<N: Number> Step<N> for BufferAtomic {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::BufferAtomic {
            buffer,
            offset,
            function,
        } = inst.op
        else {
            return;
        };
        let (words, wide) = (words(state, buffer), wide_words(state, buffer));
        atomic(state, inst, function, |_, index, first, second| {
            let index = offset as usize + index as usize;
            if let Some(wide) = wide {
                wide.forget(index);
            }
            Some(fetch(words.get(index)?, function, first, second))
        });
    }
}

pub(super) struct WorkgroupAtomic;

impl<N: Number> Step<N> for WorkgroupAtomic {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::WorkgroupAtomic { slot, function } = inst.op else {
            return;
        };
        atomic(state, inst, function, |state, index, first, second| {
            let word = state
                .workgroup_ints
                .get_mut(slot as usize + index as usize)?;
            let old = *word;
            *word = combine(function, old, first, second);
            Some(old)
        });
    }
}

/// One active lane after the other.
fn atomic<'a, N: Number>(
    state: &mut State<'a, N>,
    inst: &CodeInst,
    function: AtomicFunction,
    mut apply: impl FnMut(&mut State<'a, N>, u32, u32, u32) -> Option<u32>,
) {
    let values = if function == AtomicFunction::CompareExchange {
        2
    } else {
        1
    };
    for chunk in 0..state.chunks {
        let mask = state.mask(inst, chunk);
        let first: [u32; LANES] = state.ints(inst.operands[0], chunk);
        let second: [u32; LANES] = state.ints(inst.operands[values - 1], chunk);
        let index: [u32; LANES] = inst
            .operands
            .get(values)
            .map_or([0; LANES], |&slot| state.ints(slot, chunk));
        let mut old = [0; LANES];
        for k in 0..LANES {
            if mask[k] != 0 {
                old[k] = apply(state, index[k], first[k], second[k]).unwrap_or(0);
            }
        }
        if let Some(to) = result(inst) {
            state.set_ints(to, chunk, &old);
        }
    }
}

fn fetch(word: &AtomicU32, function: AtomicFunction, first: u32, second: u32) -> u32 {
    let update = |old| Some(combine(function, old, first, second));
    match word.fetch_update(Ordering::Relaxed, Ordering::Relaxed, update) {
        Ok(old) | Err(old) => old,
    }
}

/// The new value; `first` is the expected one of a comparison.
pub(super) fn combine(function: AtomicFunction, old: u32, first: u32, second: u32) -> u32 {
    match function {
        AtomicFunction::Add => old.wrapping_add(first),
        AtomicFunction::Sub => old.wrapping_sub(first),
        AtomicFunction::And => old & first,
        AtomicFunction::Or => old | first,
        AtomicFunction::Xor => old ^ first,
        AtomicFunction::MinS => (old as i32).min(first as i32) as u32,
        AtomicFunction::MaxS => (old as i32).max(first as i32) as u32,
        AtomicFunction::MinU => old.min(first),
        AtomicFunction::MaxU => old.max(first),
        AtomicFunction::Exchange => first,
        AtomicFunction::CompareExchange => {
            if old == first {
                second
            } else {
                old
            }
        }
    }
}

struct MemoryLoad<const K: usize>;

impl<N: Number, const K: usize> Step<N> for MemoryLoad<K> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (
            Op::MemoryLoad {
                memory,
                slot,
                class,
            },
            Some(to),
        ) = (inst.op, result(inst))
        else {
            return;
        };
        let chunks = state.chunks;
        for chunk in 0..rounds::<N, K>(state) {
            let index = indices::<N, K>(state, slot, inst.operands.first(), chunk);
            match (memory, class) {
                (Memory::Workgroup, Class::Float) => {
                    let mut lanes = [N::default(); K];
                    for k in 0..K {
                        if let Some(value) = state.workgroup_floats.get(index[k]) {
                            lanes[k] = *value;
                        }
                    }
                    state.set_floats(to, chunk, &lanes);
                }
                (Memory::Workgroup, Class::Int) => {
                    let mut lanes = [0; K];
                    for k in 0..K {
                        if let Some(value) = state.workgroup_ints.get(index[k]) {
                            lanes[k] = *value;
                        }
                    }
                    state.set_ints(to, chunk, &lanes);
                }
                (Memory::Private, Class::Float) => {
                    let mut lanes = [N::default(); K];
                    for k in 0..K {
                        if let Some(value) = state.private_floats.get(index[k] * chunks + chunk) {
                            lanes[k] = N::get(value, k);
                        }
                    }
                    state.set_floats(to, chunk, &lanes);
                }
                (Memory::Private, Class::Int) => {
                    let mut lanes = [0; K];
                    for k in 0..K {
                        if let Some(value) = state.private_ints.get(index[k] * chunks + chunk) {
                            lanes[k] = value.0[k];
                        }
                    }
                    state.set_ints(to, chunk, &lanes);
                }
            }
        }
    }
}

pub(super) struct MemoryStore;

impl<N: Number> Step<N> for MemoryStore {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::MemoryStore {
            memory,
            slot,
            class,
        } = inst.op
        else {
            return;
        };
        let chunks = state.chunks;
        for chunk in 0..chunks {
            let mask = state.mask(inst, chunk);
            let index = indices::<N, LANES>(state, slot, inst.operands.get(1), chunk);
            match class {
                Class::Float => {
                    let value: [N; LANES] = state.floats(inst.operands[0], chunk);
                    for k in (0..LANES).filter(|&k| mask[k] != 0) {
                        match memory {
                            Memory::Workgroup => {
                                if let Some(word) = state.workgroup_floats.get_mut(index[k]) {
                                    *word = value[k];
                                }
                            }
                            Memory::Private => {
                                let lanes = state.private_floats.get_mut(index[k] * chunks + chunk);
                                if let Some(lanes) = lanes {
                                    N::set(lanes, k, value[k]);
                                }
                            }
                        }
                    }
                }
                Class::Int => {
                    let value: [u32; LANES] = state.ints(inst.operands[0], chunk);
                    for k in (0..LANES).filter(|&k| mask[k] != 0) {
                        let word = match memory {
                            Memory::Workgroup => state.workgroup_ints.get_mut(index[k]),
                            Memory::Private => state
                                .private_ints
                                .get_mut(index[k] * chunks + chunk)
                                .map(|lanes| &mut lanes.0[k]),
                        };
                        if let Some(word) = word {
                            *word = value[k];
                        }
                    }
                }
            }
        }
    }
}

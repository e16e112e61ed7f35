//! Virtual registers to numbers in the register files, by linear scan over
//! live intervals.

use super::flat::{Flat, FlatInst, Reg};
use super::liveness::BitSet;
use crate::ir::Class;

/// Where each register lives.
#[derive(Clone, Debug, Default)]
pub(crate) struct Allocation {
    /// Number in the register's file; `None` if it is never used.
    pub(crate) numbers: Vec<Option<u32>>,
    /// Registers of the files of lanes.
    pub(crate) varying_float: u32,
    pub(crate) varying_int: u32,
    /// Registers of the files of single numbers.
    pub(crate) uniform_float: u32,
    pub(crate) uniform_int: u32,
}

pub(crate) fn allocate(flat: &Flat) -> Allocation {
    let mut allocation = Allocation {
        numbers: vec![None; flat.regs.len()],
        ..Allocation::default()
    };
    uniform(flat, &mut allocation);
    let mut intervals = intervals(flat);
    intervals.sort_by_key(|interval| (interval.start, interval.reg));
    for class in [Class::Float, Class::Int] {
        let of_class: Vec<&Interval> = intervals
            .iter()
            .filter(|interval| flat.regs[interval.reg.0 as usize].class == class)
            .collect();
        let used = scan(&of_class, &mut allocation.numbers);
        match class {
            Class::Float => allocation.varying_float = used,
            Class::Int => allocation.varying_int = used,
        }
    }
    allocation
}

fn mentioned(inst: &FlatInst) -> impl Iterator<Item = Reg> + '_ {
    inst.operands
        .iter()
        .chain(&inst.mask)
        .copied()
        .chain(inst.results.iter().flatten().copied())
}

/// There are few uniform registers and they are small: each gets its own.
fn uniform(flat: &Flat, allocation: &mut Allocation) {
    let ends = flat.blocks.iter().filter_map(|block| block.end.operand());
    let insts = flat
        .prologue
        .iter()
        .chain(flat.blocks.iter().flat_map(|block| &block.insts));
    for reg in insts.flat_map(mentioned).chain(ends) {
        let info = flat.regs[reg.0 as usize];
        let number = &mut allocation.numbers[reg.0 as usize];
        if !info.varying && number.is_none() {
            let next = match info.class {
                Class::Float => &mut allocation.uniform_float,
                Class::Int => &mut allocation.uniform_int,
            };
            *number = Some(*next);
            *next += 1;
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Interval {
    reg: Reg,
    start: u32,
    end: u32,
}

/// From the first to the last position where each varying register holds
/// something that is read later, ends included.
fn intervals(flat: &Flat) -> Vec<Interval> {
    let varying = |reg: &Reg| flat.regs[reg.0 as usize].varying;
    let count = flat.regs.len();
    // Read before written in the block, and written whole.
    let mut sets = Vec::with_capacity(flat.blocks.len());
    for block in &flat.blocks {
        let (mut reads, mut writes) = (BitSet::new(count), BitSet::new(count));
        for inst in &block.insts {
            // A masked move also keeps what was there.
            let kept = inst
                .results
                .iter()
                .flatten()
                .filter(|_| inst.mask.is_some());
            for reg in inst
                .operands
                .iter()
                .chain(&inst.mask)
                .chain(kept)
                .filter(|reg| varying(reg))
            {
                if !writes.contains(reg.0 as usize) {
                    reads.insert(reg.0 as usize);
                }
            }
            for reg in inst.results.iter().flatten().filter(|reg| varying(reg)) {
                writes.insert(reg.0 as usize);
            }
        }
        if let Some(reg) = block.end.operand()
            && varying(&reg)
            && !writes.contains(reg.0 as usize)
        {
            reads.insert(reg.0 as usize);
        }
        sets.push((reads, writes));
    }
    let mut live_in = vec![BitSet::new(count); flat.blocks.len()];
    let mut live_out = live_in.clone();
    let mut changed = true;
    while changed {
        changed = false;
        for b in (0..flat.blocks.len()).rev() {
            for next in flat.blocks[b].end.successors() {
                let (out, into) = (&mut live_out[b], &live_in[next.0 as usize]);
                changed |= out.union(into);
            }
            let (reads, writes) = &sets[b];
            let mut live = live_out[b].clone();
            for reg in writes.iter() {
                live.remove(reg);
            }
            live.union(reads);
            changed |= live_in[b].union(&live);
        }
    }
    let mut found: Vec<Option<Interval>> = vec![None; count];
    let mut touch = |reg: usize, position: u32| {
        let interval = found[reg].get_or_insert(Interval {
            reg: Reg(reg as u32),
            start: position,
            end: position,
        });
        interval.start = interval.start.min(position);
        interval.end = interval.end.max(position);
    };
    let mut position = 0;
    for (b, block) in flat.blocks.iter().enumerate() {
        for reg in live_in[b].iter() {
            touch(reg, position);
        }
        for inst in &block.insts {
            for reg in mentioned(inst).filter(varying) {
                touch(reg.0 as usize, position);
            }
            position += 1;
        }
        if let Some(reg) = block.end.operand()
            && varying(&reg)
        {
            touch(reg.0 as usize, position);
        }
        for reg in live_out[b].iter() {
            touch(reg, position);
        }
        position += 1;
    }
    found.into_iter().flatten().collect()
}

/// Gives intervals that overlap different numbers; ends included, so that a
/// result never overwrites an operand of its own instruction.
fn scan(intervals: &[&Interval], numbers: &mut [Option<u32>]) -> u32 {
    let mut active: Vec<(u32, u32)> = Vec::new();
    let mut free: Vec<u32> = Vec::new();
    let mut used = 0;
    for interval in intervals {
        active.retain(|&(end, number)| {
            let keep = end >= interval.start;
            if !keep {
                free.push(number);
            }
            keep
        });
        // The one freed last is the likeliest to be in cache.
        let number = free.pop().unwrap_or_else(|| {
            used += 1;
            used - 1
        });
        numbers[interval.reg.0 as usize] = Some(number);
        active.push((interval.end, number));
    }
    used
}

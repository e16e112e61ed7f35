//! Removes copies between variables and the values read from or set to them,
//! where both can be one register.

use super::flat::{Flat, Reg, Terminator};
use crate::ir::Op;

/// Where a register is written and read, as positions in the linear code.
#[derive(Clone, Debug, Default)]
struct Places {
    writes: Vec<usize>,
    reads: Vec<usize>,
}

struct Code<'a> {
    flat: &'a mut Flat,
    places: Vec<Places>,
    /// First and last position of each loop.
    loops: Vec<(usize, usize)>,
    /// Block and index of each position; the terminator's index is past the end.
    positions: Vec<(usize, usize)>,
    removed: Vec<bool>,
}

pub(super) fn coalesce(flat: &mut Flat) {
    let mut positions = Vec::new();
    let mut starts = Vec::new();
    for (b, block) in flat.blocks.iter().enumerate() {
        starts.push(positions.len());
        positions.extend((0..=block.insts.len()).map(|i| (b, i)));
    }
    let mut places = vec![Places::default(); flat.regs.len()];
    let mut loops = Vec::new();
    for (position, &(b, i)) in positions.iter().enumerate() {
        let block = &flat.blocks[b];
        if let Some(inst) = block.insts.get(i) {
            for operand in inst.operands.iter().chain(&inst.mask) {
                places[operand.0 as usize].reads.push(position);
            }
            for result in inst.results.iter().flatten() {
                places[result.0 as usize].writes.push(position);
            }
        } else {
            if let Some(operand) = block.end.operand() {
                places[operand.0 as usize].reads.push(position);
            }
            if let Terminator::Again { head, .. } = block.end {
                loops.push((starts[head.0 as usize], position));
            }
        }
    }
    let removed = vec![false; positions.len()];
    let mut code = Code {
        flat,
        places,
        loops,
        positions,
        removed,
    };
    for position in 0..code.positions.len() {
        code.try_copy(position);
    }
    code.finish();
}

impl Code<'_> {
    /// The last position that reads what is written to `reg` at `from`.
    fn last_read(&self, reg: Reg, from: usize) -> usize {
        let mut last = from;
        for &read in &self.places[reg.0 as usize].reads {
            // Read in a loop that the write is not in: until the loop's end.
            let end = self
                .loops
                .iter()
                .filter(|(start, end)| {
                    (*start..=*end).contains(&read) && !(*start..=*end).contains(&from)
                })
                .map(|(_, end)| *end)
                .max();
            last = last.max(end.unwrap_or(read));
        }
        last
    }

    fn try_copy(&mut self, position: usize) {
        let (b, i) = self.positions[position];
        let Some(inst) = self.flat.blocks[b].insts.get(i) else {
            return;
        };
        let (Op::Move(_), None, &[Some(to)], &[from]) =
            (inst.op, inst.mask, &inst.results[..], &inst.operands[..])
        else {
            return;
        };
        let (to_info, from_info) = (
            self.flat.regs[to.0 as usize],
            self.flat.regs[from.0 as usize],
        );
        if to == from {
            self.removed[position] = true;
            return;
        }
        if to_info.varying != from_info.varying || from_info.constant.is_some() {
            return;
        }
        if self.is_snapshot(to, from, position) {
            self.merge(to, from, position);
        } else if self.is_result(to, from, position) {
            self.merge(from, to, position);
        }
    }

    /// Whether the value `to`, a copy of the variable `from`, is read only
    /// while the variable still holds it.
    fn is_snapshot(&self, to: Reg, from: Reg, position: usize) -> bool {
        let places = &self.places[to.0 as usize];
        if places.writes.len() != 1 || places.reads.iter().any(|&read| read <= position) {
            return false;
        }
        let last = self.last_read(to, position);
        self.places[from.0 as usize].writes.iter().all(|&write| {
            write < position || write > last || (write == last && self.reads_at(to, last))
        })
    }

    /// Whether an instruction itself reads `reg` at `position`, before it writes.
    fn reads_at(&self, reg: Reg, position: usize) -> bool {
        let (b, i) = self.positions[position];
        // A masked move keeps lanes of its destination: reading and writing are not apart.
        self.flat.blocks[b]
            .insts
            .get(i)
            .is_some_and(|inst| inst.operands.contains(&reg) && inst.mask.is_none())
    }

    /// Whether the value `from`, computed in the same block, can be computed
    /// in the variable `to` at once.
    fn is_result(&self, to: Reg, from: Reg, position: usize) -> bool {
        let &[computed] = &self.places[from.0 as usize].writes[..] else {
            return false;
        };
        let same_block =
            computed < position && self.positions[computed].0 == self.positions[position].0;
        let last = self.last_read(from, position);
        let variable = &self.places[to.0 as usize];
        same_block
            && self.places[from.0 as usize]
                .reads
                .iter()
                .all(|&read| read > computed)
            && variable
                .reads
                .iter()
                .all(|&read| read <= computed || read > position)
            && variable
                .writes
                .iter()
                .all(|&write| write < computed || write == position || write > last)
            && !variable.writes.contains(&computed)
    }

    /// Makes `gone` the same register as `kept`, and the copy at `position` nothing.
    fn merge(&mut self, gone: Reg, kept: Reg, position: usize) {
        let places = std::mem::take(&mut self.places[gone.0 as usize]);
        for &at in places.writes.iter().chain(&places.reads) {
            let (b, i) = self.positions[at];
            let block = &mut self.flat.blocks[b];
            if let Some(inst) = block.insts.get_mut(i) {
                let operands = inst
                    .operands
                    .iter_mut()
                    .chain(&mut inst.mask)
                    .chain(inst.results.iter_mut().flatten());
                operands
                    .filter(|reg| **reg == gone)
                    .for_each(|reg| *reg = kept);
            } else if let Some(operand) = block.end.operand_mut()
                && *operand == gone
            {
                *operand = kept;
            }
        }
        let kept = &mut self.places[kept.0 as usize];
        kept.writes.extend(places.writes);
        kept.reads.extend(places.reads);
        kept.writes.retain(|&at| at != position);
        kept.reads.retain(|&at| at != position);
        self.removed[position] = true;
    }

    fn finish(self) {
        let mut removed = self.removed.iter();
        for block in &mut self.flat.blocks {
            block
                .insts
                .retain(|_| !removed.next().copied().unwrap_or(false));
            // The terminator's position.
            removed.next();
        }
    }
}

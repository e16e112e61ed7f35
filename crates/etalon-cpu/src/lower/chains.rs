//! Chains: instructions of a block that together are one of [`PATTERNS`] become it.
//! What lies between them is read by none other, and nothing they read changes
//! before the last of them.

use std::collections::HashMap;

use super::flat::{Block, Flat, FlatInst, Reg, RegInfo};
use super::fuse::uses;
use crate::ir::chain::{PATTERNS, Part, Pattern};
use crate::ir::{Arith, Class, Op};

pub(super) fn join(flat: &mut Flat) {
    let mut uses = uses(flat);
    let Flat { regs, blocks, .. } = flat;
    for block in blocks {
        join_block(regs, &mut uses, block);
    }
}

fn join_block(regs: &[RegInfo], uses: &mut [u32], block: &mut Block) {
    let mut writes: HashMap<Reg, Vec<usize>> = HashMap::new();
    for (i, inst) in block.insts.iter().enumerate() {
        for result in inst.results.iter().flatten() {
            writes.entry(*result).or_default().push(i);
        }
    }
    let mut dropped = vec![false; block.insts.len()];
    // From the end on, so that the longest chains are seen whole.
    for last in (0..block.insts.len()).rev() {
        let search = |pattern: &'static Pattern| {
            let search = Search {
                pattern,
                regs,
                uses,
                writes: &writes,
                insts: &block.insts,
                last,
            };
            let (operands, parts) = search.run()?;
            Some((pattern.chain, operands, parts))
        };
        if dropped[last] {
            continue;
        }
        let Some((chain, operands, parts)) = PATTERNS.iter().find_map(search) else {
            continue;
        };
        for &part in &parts {
            dropped[part] = part != last;
            for operand in &block.insts[part].operands {
                uses[operand.0 as usize] -= 1;
            }
        }
        for operand in &operands {
            uses[operand.0 as usize] += 1;
        }
        let inst = &mut block.insts[last];
        inst.op = Op::Chain(chain);
        inst.operands = operands;
    }
    let mut dropped = dropped.into_iter();
    block.insts.retain(|_| !dropped.next().unwrap_or(false));
}

/// Looks for a pattern whose last part is instruction `last` of a block.
struct Search<'a> {
    pattern: &'a Pattern,
    regs: &'a [RegInfo],
    /// How often each register is read in the whole program.
    uses: &'a [u32],
    /// Where in the block each register is written.
    writes: &'a HashMap<Reg, Vec<usize>>,
    insts: &'a [FlatInst],
    last: usize,
}

/// What is found so far.
#[derive(Clone)]
struct Found<'a> {
    /// The registers of the pattern's operands.
    operands: HashMap<&'a str, Reg>,
    /// The instructions of its parts.
    parts: Vec<Option<usize>>,
}

impl<'a> Search<'a> {
    /// The chain's operands, and the instructions it replaces.
    fn run(&self) -> Option<(Vec<Reg>, Vec<usize>)> {
        let Pattern {
            lanes,
            numbers,
            bits,
            parts,
            ..
        } = self.pattern;
        let nothing = Found {
            operands: HashMap::new(),
            parts: vec![None; parts.len()],
        };
        let found = self.part(nothing, parts.len() - 1, self.last)?;
        let names = lanes.iter().chain(*numbers).chain(*bits);
        let operands: Option<Vec<Reg>> = names
            .map(|name| found.operands.get(name).copied())
            .collect();
        let parts: Option<Vec<usize>> = found.parts.into_iter().collect();
        Some((operands?, parts?))
    }

    /// With instruction `at` as part `k`.
    fn part(&self, mut found: Found<'a>, k: usize, at: usize) -> Option<Found<'a>> {
        if let Some(known) = found.parts[k] {
            return (known == at).then_some(found);
        }
        let (part, inst): (&Part, _) = (&self.pattern.parts[k], &self.insts[at]);
        if inst.op != Op::Arith(part.op) || inst.operands.len() != part.operands.len() {
            return None;
        }
        found.parts[k] = Some(at);
        let mut operands = inst.operands.clone();
        if let Some(found) = self.operands(found.clone(), part, &operands, at) {
            return Some(found);
        }
        if !exchanges(part.op) {
            return None;
        }
        operands.swap(0, 1);
        self.operands(found, part, &operands, at)
    }

    fn operands(
        &self,
        found: Found<'a>,
        part: &'a Part,
        operands: &[Reg],
        at: usize,
    ) -> Option<Found<'a>> {
        let mut pairs = part.operands.iter().zip(operands);
        pairs.try_fold(found, |found, (name, reg)| {
            self.operand(found, name, *reg, at)
        })
    }

    /// With what `reg` holds before instruction `at` as the operand of a name.
    fn operand(
        &self,
        mut found: Found<'a>,
        name: &'a str,
        reg: Reg,
        at: usize,
    ) -> Option<Found<'a>> {
        let Pattern {
            lanes,
            numbers,
            parts,
            ..
        } = self.pattern;
        let written = self.written(reg, at);
        if let Some(k) = parts.iter().position(|part| part.result == name) {
            let reads = parts.iter().flat_map(|part| part.operands);
            let all = reads.filter(|read| **read == name).count();
            return if self.uses[reg.0 as usize] as usize == all {
                self.part(found, k, written?)
            } else {
                None
            };
        }
        let info = self.regs[reg.0 as usize];
        let wanted = if lanes.contains(&name) {
            (Class::Float, true)
        } else if numbers.contains(&name) {
            (Class::Float, false)
        } else {
            (Class::Int, false)
        };
        let unchanged = written == self.written(reg, self.last);
        let same = *found.operands.entry(name).or_insert(reg) == reg;
        ((info.class, info.varying) == wanted && unchanged && same).then_some(found)
    }

    /// Where in the block what a register holds before instruction `at` was written.
    fn written(&self, reg: Reg, at: usize) -> Option<usize> {
        let writes = self.writes.get(&reg)?;
        writes.iter().copied().rfind(|write| *write < at)
    }
}

/// Whether the first two operands may be exchanged.
fn exchanges(op: Arith) -> bool {
    op.commutes()
        || matches!(
            op,
            Arith::MulMulAddF | Arith::DivByMulAddF | Arith::Mul3F | Arith::Add3I
        )
}

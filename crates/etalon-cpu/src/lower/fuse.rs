//! A product that is used once, by a sum next to it, becomes one instruction
//! with it. Both are still rounded: this saves the trip through memory.

use super::flat::{Flat, FlatInst};
use crate::ir::{Arith, Op};

pub(super) fn multiply_add(flat: &mut Flat) {
    let mut uses = vec![0_u32; flat.regs.len()];
    for inst in flat
        .prologue
        .iter()
        .chain(flat.blocks.iter().flat_map(|block| &block.insts))
    {
        for operand in inst.operands.iter().chain(&inst.mask) {
            uses[operand.0 as usize] += 1;
        }
    }
    for block in &flat.blocks {
        if let Some(operand) = block.end.operand() {
            uses[operand.0 as usize] += 1;
        }
    }
    let mut product = vec![None::<usize>; flat.regs.len()];
    for block in &mut flat.blocks {
        let mut dropped = vec![false; block.insts.len()];
        for i in 0..block.insts.len() {
            let inst = &block.insts[i];
            let Some(Some(result)) = inst.results.first().copied() else {
                continue;
            };
            match inst.op {
                Op::Arith(Arith::MulF)
                    if uses[result.0 as usize] == 1 && flat.regs[result.0 as usize].varying =>
                {
                    product[result.0 as usize] = Some(i)
                }
                Op::Arith(op @ (Arith::AddF | Arith::SubF)) => {
                    let (a, b) = (inst.operands[0], inst.operands[1]);
                    // Only products of this block are noted, see below.
                    let (at, other, fused) =
                        match (product[a.0 as usize], product[b.0 as usize], op) {
                            (_, Some(at), Arith::AddF) => (at, a, Arith::MulAddF),
                            (_, Some(at), _) => (at, a, Arith::SubMulF),
                            (Some(at), _, Arith::AddF) => (at, b, Arith::MulAddF),
                            (Some(at), _, _) => (at, b, Arith::MulSubF),
                            (None, None, _) => continue,
                        };
                    let mut operands = block.insts[at].operands.clone();
                    // A uniform factor goes second.
                    if !flat.regs[operands[0].0 as usize].varying {
                        operands.swap(0, 1);
                    }
                    operands.push(other);
                    let inst = &mut block.insts[i];
                    *inst = FlatInst {
                        op: Op::Arith(fused),
                        operands,
                        ..inst.clone()
                    };
                    dropped[at] = true;
                }
                _ => {}
            }
        }
        for inst in &block.insts {
            for result in inst.results.iter().flatten() {
                product[result.0 as usize] = None;
            }
        }
        let mut dropped = dropped.into_iter();
        block.insts.retain(|_| !dropped.next().unwrap_or(false));
    }
}

//! Superinstructions: an instruction whose result is used once, by one after
//! it in the same block, becomes one instruction with that. Both still round:
//! what is saved is the trip through memory and the call of a handler.

use super::flat::{Block, Flat, FlatInst, Reg};
use crate::ir::{Arith, Op};

/// `outer(.., inner(operands), ..)`, the inner result being operand `at` of the
/// outer one, is `fused`. Its operands are those of the inner instruction, then
/// those of the outer one that remain.
struct Rule {
    inner: Arith,
    outer: Arith,
    at: usize,
    fused: Arith,
}

/// In the order they are tried. What profiles of kernels show: sums of
/// products, clamps, guards against what is not finite, bit fields.
const RULES: &[Rule] = &{
    use Arith::*;
    const fn rule(inner: Arith, outer: Arith, at: usize, fused: Arith) -> Rule {
        Rule {
            inner,
            outer,
            at,
            fused,
        }
    }
    [
        // Sums of products; what is added to a product comes third.
        rule(MulF, MulAddF, 2, MulMulAddF),
        rule(MulF, AddF, 1, MulAddF),
        rule(MulF, AddF, 0, MulAddF),
        rule(MulF, SubF, 1, SubMulF),
        rule(MulF, SubF, 0, MulSubF),
        rule(MulAddF, AddF, 1, MulAddAddF),
        rule(MulAddF, AddF, 0, MulAddAddF),
        rule(AddF, AddF, 1, Add3F),
        rule(AddF, AddF, 0, Add3F),
        rule(AddF, MulF, 0, AddMulF),
        rule(AddF, MulF, 1, AddMulF),
        rule(SubF, MulF, 0, SubMulByF),
        rule(SubF, MulF, 1, SubMulByF),
        rule(MulF, MulF, 0, Mul3F),
        rule(MulF, MulF, 1, Mul3F),
        // Rounding to an integer, and how far that was.
        rule(AddF, FloorF, 0, AddFloorF),
        rule(MulAddF, FloorF, 0, MulAddFloorF),
        // Quotients by a sum of products.
        rule(MulAddF, DivF, 1, DivByMulAddF),
        rule(SubF, AbsF, 0, AbsSubF),
        rule(AbsSubF, LtF, 0, LtAbsSubF),
        // Limits.
        rule(AtLeastF, AtMostF, 0, ClampF),
        rule(MaxF, MaxF, 0, Max3F),
        rule(AtLeastF, AtLeastF, 0, AtLeast2F),
        rule(LeU, SelectF, 0, SelectLeU),
        rule(MulF, AtMostF, 0, MulAtMostF),
        rule(AddF, AtLeastF, 0, AddAtLeastF),
        rule(AddAtLeastF, AtMostF, 0, AddClampF),
        rule(AddAtLeastF, AtMostF, 1, LimitAddAtLeastF),
        rule(Mul3F, AtLeastF, 0, Mul3AtLeastF),
        rule(MulF, SelectF, 1, SelectMulF),
        rule(MaxS, MinS, 1, ClampS),
        rule(MaxS, MinS, 0, ClampS),
        // Guards.
        rule(ZeroAboveU, MinU, 0, CapU),
        rule(ZeroAboveU, MinU, 1, CapU),
        rule(CapU, BitsToF, 0, CapUToBits),
        rule(FToBits, CapUToBits, 0, CapBits),
        rule(FToBits, And, 0, AndBits),
        rule(FToBits, And, 1, AndBits),
        rule(And, EqI, 0, EqAnd),
        rule(And, EqI, 1, EqAnd),
        rule(And, NeI, 0, NeAnd),
        rule(And, NeI, 1, NeAnd),
        rule(AndBits, EqI, 0, EqAndBits),
        rule(AndBits, EqI, 1, EqAndBits),
        rule(AndBits, NeI, 0, NeAndBits),
        rule(AndBits, NeI, 1, NeAndBits),
        rule(LeU, Or, 0, LeUOr),
        rule(LeU, Or, 1, LeUOr),
        rule(LeUOr, Not, 0, NotLeUOr),
        rule(LtF, And, 0, LtAnd),
        rule(LtF, And, 1, LtAnd),
        rule(LeF, And, 0, LeAnd),
        rule(LeF, And, 1, LeAnd),
        // Integers.
        rule(ShrU, And, 0, ShrAnd),
        rule(ShrU, And, 1, ShrAnd),
        rule(And, Or, 0, AndOr),
        rule(And, Or, 1, AndOr),
        rule(AddI, AddI, 0, Add3I),
        rule(AddI, AddI, 1, Add3I),
        rule(AddI, Shl, 0, AddShl),
        rule(And, AddI, 0, AndAdd),
        rule(And, AddI, 1, AndAdd),
        // What builds floating-point numbers from their parts.
        rule(AddShl, BitsToF, 0, AddShlToBits),
        rule(AndAdd, BitsToF, 0, AndAddToBits),
        rule(And, BitsToF, 0, AndToBits),
        rule(FToBits, SubI, 0, SubBits),
        rule(AndBits, Or, 0, BitsAndOr),
        rule(AndBits, Or, 1, BitsAndOr),
        rule(FToBits, BitsAndOr, 2, MergeBits),
        rule(MergeBits, BitsToF, 0, MergeToBits),
    ]
};

pub(super) fn superinstructions(flat: &mut Flat) {
    let mut fuser = Fuser {
        uses: uses(flat),
        varying: flat.regs.iter().map(|reg| reg.varying).collect(),
        written: vec![None; flat.regs.len()],
    };
    for block in &mut flat.blocks {
        fuser.block(block);
    }
}

struct Fuser {
    /// How often each register is read in the whole program.
    uses: Vec<u32>,
    varying: Vec<bool>,
    /// Where in the block each register was last written.
    written: Vec<Option<usize>>,
}

impl Fuser {
    fn block(&mut self, block: &mut Block) {
        let mut dropped = vec![false; block.insts.len()];
        for i in 0..block.insts.len() {
            while let Some((inner, inst)) = self.fused(block, i) {
                block.insts[i] = inst;
                for result in block.insts[inner].results.iter().flatten() {
                    let uses = &mut self.uses[result.0 as usize];
                    *uses = uses.saturating_sub(1);
                    dropped[inner] = *uses == 0;
                }
            }
            for result in block.insts[i].results.iter().flatten() {
                self.written[result.0 as usize] = Some(i);
            }
        }
        for inst in &block.insts {
            for result in inst.results.iter().flatten() {
                self.written[result.0 as usize] = None;
            }
        }
        let mut dropped = dropped.into_iter();
        block.insts.retain(|_| !dropped.next().unwrap_or(false));
    }

    /// What instruction `i` becomes with one before it, whose result it then does
    /// not read.
    fn fused(&mut self, block: &Block, i: usize) -> Option<(usize, FlatInst)> {
        let outer = &block.insts[i];
        let Op::Arith(op) = outer.op else { return None };
        if let Some(found) = self.zero_above(block, outer) {
            return Some(found);
        }
        RULES.iter().find_map(|rule| {
            if rule.outer != op {
                return None;
            }
            let at = self.computed(block, *outer.operands.get(rule.at)?, rule.inner)?;
            let mut operands = block.insts[at].operands.clone();
            // A uniform factor goes second: there are handlers for fewer cases then.
            if rule.inner.commutes() && !self.varying[operands[0].0 as usize] {
                operands.swap(0, 1);
            }
            let rest = outer.operands.iter().enumerate();
            operands.extend(rest.filter(|(k, _)| *k != rule.at).map(|(_, reg)| *reg));
            let inst = FlatInst {
                op: Op::Arith(rule.fused),
                operands,
                ..outer.clone()
            };
            Some((at, inst))
        })
    }

    /// `select(b, 0, b > k)`, which the translator writes as `b & !(k < b)`.
    fn zero_above(&mut self, block: &Block, outer: &FlatInst) -> Option<(usize, FlatInst)> {
        let (Op::Arith(Arith::AndNot), &[value, condition]) = (outer.op, &outer.operands[..])
        else {
            return None;
        };
        let at = self.computed(block, condition, Arith::LtU)?;
        let &[limit, compared] = &block.insts[at].operands[..] else {
            return None;
        };
        if value != compared {
            return None;
        }
        self.uses[value.0 as usize] -= 1;
        let inst = FlatInst {
            op: Op::Arith(Arith::ZeroAboveU),
            operands: vec![value, limit],
            ..outer.clone()
        };
        Some((at, inst))
    }

    /// Where in the block `reg` is computed by `op` from registers that still hold
    /// what they held there: for one reader only, unless by a mere move, which
    /// every reader can make for itself.
    fn computed(&self, block: &Block, reg: Reg, op: Arith) -> Option<usize> {
        let at = self.written[reg.0 as usize]?;
        let inst = &block.insts[at];
        let unchanged = |reg: &Reg| self.written[reg.0 as usize].is_none_or(|write| write < at);
        let fits = inst.op == Op::Arith(op)
            && (self.uses[reg.0 as usize] == 1 || op == Arith::FToBits)
            && self.varying[reg.0 as usize]
            && inst.operands.iter().all(unchanged);
        fits.then_some(at)
    }
}

/// How often each register is read.
pub(super) fn uses(flat: &Flat) -> Vec<u32> {
    let mut uses = vec![0_u32; flat.regs.len()];
    let insts = flat
        .prologue
        .iter()
        .chain(flat.blocks.iter().flat_map(|block| &block.insts));
    for operand in insts.flat_map(|inst| inst.operands.iter().chain(&inst.mask)) {
        uses[operand.0 as usize] += 1;
    }
    for operand in flat.blocks.iter().filter_map(|block| block.end.operand()) {
        uses[operand.0 as usize] += 1;
    }
    uses
}

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
        // Limits.
        rule(AtLeastF, AtMostF, 0, ClampF),
        rule(MaxF, MaxF, 0, Max3F),
        rule(MulF, AtMostF, 0, MulAtMostF),
        rule(AddF, AtLeastF, 0, AddAtLeastF),
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
    ]
};

pub(super) fn superinstructions(flat: &mut Flat) {
    know_limits(flat);
    let mut fuser = Fuser {
        uses: uses(flat),
        varying: flat.regs.iter().map(|reg| reg.varying).collect(),
        written: vec![None; flat.regs.len()],
    };
    for block in &mut flat.blocks {
        fuser.block(block);
    }
}

/// Limits that are literals, as most are, need no care for NaN, which costs more than
/// the comparison itself.
fn know_limits(flat: &mut Flat) {
    let is_number = |reg: &Reg| {
        let constant = flat.regs[reg.0 as usize].constant;
        constant.is_some_and(|bits| !f32::from_bits(bits).is_nan())
    };
    for inst in flat.blocks.iter_mut().flat_map(|block| &mut block.insts) {
        if inst.operands.get(1).is_some_and(is_number) {
            inst.op = match inst.op {
                Op::Arith(Arith::MinF) => Op::Arith(Arith::AtMostF),
                Op::Arith(Arith::MaxF) => Op::Arith(Arith::AtLeastF),
                other => other,
            };
        }
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
                dropped[inner] = true;
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

    /// What instruction `i` becomes with one before it, which is then dropped.
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

    /// Where in the block `reg` is computed by `op` for one reader only, from
    /// registers that still hold what they held there.
    fn computed(&self, block: &Block, reg: Reg, op: Arith) -> Option<usize> {
        let at = self.written[reg.0 as usize]?;
        let inst = &block.insts[at];
        let unchanged = |reg: &Reg| self.written[reg.0 as usize].is_none_or(|write| write < at);
        let fits = inst.op == Op::Arith(op)
            && self.uses[reg.0 as usize] == 1
            && self.varying[reg.0 as usize]
            && inst.operands.iter().all(unchanged);
        fits.then_some(at)
    }
}

fn uses(flat: &Flat) -> Vec<u32> {
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

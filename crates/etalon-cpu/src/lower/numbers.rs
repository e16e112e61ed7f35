//! Which registers are known to hold a number, never a NaN.
//!
//! `min` and `max` give the other operand when one is NaN. Where the second is
//! known to be none, a comparison alone does that, and costs half.

use super::flat::{Flat, FlatInst, Reg};
use crate::ir::{Arith, Op};

/// Known to hold a number, by register; what any write leaves open is not known.
struct Known {
    /// Floating point: anything but NaN.
    numbers: Vec<bool>,
    /// Bits of a positive floating-point number, infinity at most.
    positive: Vec<bool>,
    /// How often the code writes it.
    writes: Vec<u32>,
}

/// Bits of infinity: greater ones, but for the sign, are NaN.
const INFINITY: u32 = 0x7f80_0000;

/// Times that knowledge is passed on: through as many instructions in the
/// opposite order of the code, which loops alone have.
const PASSES: usize = 4;

/// Makes `min` and `max` comparisons where no NaN needs care.
pub(super) fn compare_numbers(flat: &mut Flat) {
    let known = Known::of(flat);
    for inst in flat.blocks.iter_mut().flat_map(|block| &mut block.insts) {
        if inst.operands.get(1).is_some_and(|reg| known.number(*reg)) {
            inst.op = match inst.op {
                Op::Arith(Arith::MinF) => Op::Arith(Arith::AtMostF),
                Op::Arith(Arith::MaxF) => Op::Arith(Arith::AtLeastF),
                other => other,
            };
        }
    }
}

fn insts(flat: &Flat) -> impl Iterator<Item = &FlatInst> {
    let blocks = flat.blocks.iter().flat_map(|block| &block.insts);
    flat.prologue.iter().chain(blocks)
}

impl Known {
    fn of(flat: &Flat) -> Self {
        let constant = |holds: fn(u32) -> bool| {
            flat.regs
                .iter()
                .map(|reg| reg.constant.is_some_and(holds))
                .collect()
        };
        let mut writes = vec![0_u32; flat.regs.len()];
        for result in insts(flat).flat_map(|inst| inst.results.iter().flatten()) {
            writes[result.0 as usize] += 1;
        }
        let mut known = Self {
            writes,
            numbers: constant(|bits| !f32::from_bits(bits).is_nan()),
            positive: constant(|bits| bits <= INFINITY),
        };
        for _ in 0..PASSES {
            if !known.pass(flat) {
                break;
            }
        }
        known
    }

    /// Whether anything new came to be known.
    fn pass(&mut self, flat: &Flat) -> bool {
        // Of registers that are written: whether every write so far leaves it known.
        let mut numbers: Vec<Option<bool>> = vec![None; flat.regs.len()];
        let mut positive = numbers.clone();
        let mut news = false;
        for inst in insts(flat) {
            let (number, bits) = (self.gives_number(inst), self.gives_positive(inst));
            for result in inst.results.iter().flatten() {
                let at = result.0 as usize;
                numbers[at] = Some(numbers[at].unwrap_or(true) & number);
                positive[at] = Some(positive[at].unwrap_or(true) & bits);
                // Known at once to what follows, as code mostly does.
                if self.writes[at] == 1 {
                    news |= number & !self.numbers[at] | bits & !self.positive[at];
                    self.numbers[at] |= number;
                    self.positive[at] |= bits;
                }
            }
        }
        for (known, found) in [(&mut self.numbers, numbers), (&mut self.positive, positive)] {
            for (known, found) in known.iter_mut().zip(found) {
                news |= !*known && found == Some(true);
                *known |= found == Some(true);
            }
        }
        news
    }

    fn number(&self, reg: Reg) -> bool {
        self.numbers[reg.0 as usize]
    }

    fn gives_number(&self, inst: &FlatInst) -> bool {
        let number = |at: usize| inst.operands.get(at).is_some_and(|reg| self.number(*reg));
        match inst.op {
            Op::Arith(op) => match op {
                Arith::MinF | Arith::MaxF => number(0) || number(1),
                Arith::AtMostF | Arith::AtLeastF => number(1),
                Arith::AbsF
                | Arith::NegF
                | Arith::FloorF
                | Arith::CeilF
                | Arith::TruncF
                | Arith::RoundF => number(0),
                Arith::SelectF => number(1) && number(2),
                Arith::SToF | Arith::UToF => true,
                Arith::BitsToF => inst
                    .operands
                    .first()
                    .is_some_and(|reg| self.positive[reg.0 as usize]),
                _ => false,
            },
            Op::Move(_) => number(0),
            _ => false,
        }
    }

    fn gives_positive(&self, inst: &FlatInst) -> bool {
        let positive = |at: usize| {
            let reg = inst.operands.get(at);
            reg.is_some_and(|reg| self.positive[reg.0 as usize])
        };
        match inst.op {
            Op::Arith(Arith::MinU | Arith::And) => positive(0) || positive(1),
            Op::Arith(Arith::SelectI) => positive(1) && positive(2),
            Op::Move(_) => positive(0),
            _ => false,
        }
    }
}

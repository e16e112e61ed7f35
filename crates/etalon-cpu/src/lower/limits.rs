//! Limits of numbers that kernels put on their bits.
//!
//! Guards against what a caller may provide test bits, since comparisons with NaN
//! prove nothing to a compiler: "0 where the bits are above those of infinity, and
//! at most those of a limit". Instruction by instruction that is a comparison and a
//! minimum of unsigned integers, which no instruction set before AVX-512 has both
//! of. On the number it is a limit to 0, which turns NaN, negative numbers and -0
//! into 0 alike, and one to the upper limit: half the steps, and a number type
//! wider than `f32` keeps its digits.

use std::collections::HashMap;

use super::flat::{Flat, Reg, RegInfo};
use crate::ir::{Arith, Class, Op};

/// Bits of infinity: of numbers that are not negative none are greater.
const INFINITY: u32 = f32::INFINITY.to_bits();

/// Makes limits of bits that are those of a number limits of that number.
pub(super) fn limit_numbers(flat: &mut Flat) {
    let Flat { regs, blocks, .. } = flat;
    let mut literals = Literals::of(regs);
    for inst in blocks.iter_mut().flat_map(|block| &mut block.insts) {
        let (Op::Arith(Arith::CapBits), &[number, zero_above, limit]) =
            (inst.op, &inst.operands[..])
        else {
            continue;
        };
        let constant = |reg: Reg| regs[reg.0 as usize].constant;
        if let (Some(INFINITY), Some(limit @ 0..=INFINITY)) =
            (constant(zero_above), constant(limit))
        {
            inst.op = Op::Arith(Arith::ClampF);
            inst.operands = vec![number, literals.get(regs, 0), literals.get(regs, limit)];
        }
    }
}

/// Registers of numbers that are known from the start, by their bits.
struct Literals(HashMap<u32, Reg>);

impl Literals {
    fn of(regs: &[RegInfo]) -> Self {
        let numbers = (0..).zip(regs).filter(|(_, reg)| reg.class == Class::Float);
        Self(
            numbers
                .filter_map(|(number, reg)| Some((reg.constant?, Reg(number))))
                .collect(),
        )
    }

    fn get(&mut self, regs: &mut Vec<RegInfo>, bits: u32) -> Reg {
        *self.0.entry(bits).or_insert_with(|| {
            regs.push(RegInfo {
                class: Class::Float,
                varying: false,
                constant: Some(bits),
            });
            Reg(regs.len() as u32 - 1)
        })
    }
}

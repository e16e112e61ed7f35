//! What an instruction makes of numbers in `f64`.

use super::{MAX_OPERANDS, Scalar};
use crate::ir::Arith;
use crate::ir::arith::{Binary, ClassOf, Lane, Quaternary, Ternary, Unary, Visitor};

/// Operands, the last ones unused if there are fewer.
type Operands = [(f64, u32); MAX_OPERANDS - 1];

/// An instruction as a function in `f64`. Of the result one part counts, the number or
/// the integer.
#[derive(Clone, Copy)]
pub(crate) struct Twin(fn(&Operands) -> (f64, u32));

impl Twin {
    pub(crate) fn of(op: Arith) -> Self {
        Self(op.visit::<f64, _>(AsFunction))
    }

    /// What it makes of the `f32` operands.
    #[inline]
    pub(crate) fn of_singles(self, operands: &[Scalar]) -> (f64, u32) {
        self.call(operands, |scalar| scalar.single.into())
    }

    /// What it makes of the `f64` operands.
    #[inline]
    pub(crate) fn of_doubles(self, operands: &[Scalar]) -> (f64, u32) {
        self.call(operands, |scalar| scalar.double)
    }

    #[inline]
    fn call(self, operands: &[Scalar], number: impl Fn(&Scalar) -> f64) -> (f64, u32) {
        let mut given = Operands::default();
        for (given, scalar) in given.iter_mut().zip(operands) {
            *given = (number(scalar), scalar.int);
        }
        (self.0)(&given)
    }
}

struct AsFunction;

#[inline(always)]
fn lane<C: ClassOf<f64>>(operands: &Operands, at: usize) -> Lane<f64, C> {
    C::pick(operands[at].0, operands[at].1)
}

impl Visitor<f64> for AsFunction {
    type Output = fn(&Operands) -> (f64, u32);

    fn unary<O: Unary<f64>>(self) -> Self::Output {
        |given| O::D::parts(O::eval(lane::<O::A>(given, 0)))
    }

    fn binary<O: Binary<f64>>(self) -> Self::Output {
        |given| O::D::parts(O::eval(lane::<O::A>(given, 0), lane::<O::B>(given, 1)))
    }

    fn ternary<O: Ternary<f64>>(self) -> Self::Output {
        |given| {
            O::D::parts(O::eval(
                lane::<O::A>(given, 0),
                lane::<O::B>(given, 1),
                lane::<O::C>(given, 2),
            ))
        }
    }

    fn quaternary<O: Quaternary<f64>>(self) -> Self::Output {
        |given| {
            O::D::parts(O::eval(
                lane::<O::A>(given, 0),
                lane::<O::B>(given, 1),
                lane::<O::C>(given, 2),
                lane::<O::E>(given, 3),
            ))
        }
    }
}

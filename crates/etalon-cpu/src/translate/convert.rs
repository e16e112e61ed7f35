//! Conversions between numbers, and of their bits.

use naga::{Expression, Handle, Scalar, ScalarKind};

use super::layout::{class_of, is_half};
use super::{Fail, Frame, Translator};
use crate::ir::{Arith, Class, Value};

impl<'a> Translator<'a> {
    /// A value as numbers of another kind: converted to `convert` bytes, or with
    /// the same bits.
    pub(super) fn cast(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
        to: ScalarKind,
        convert: Option<u8>,
    ) -> Result<Vec<Value>, Fail> {
        let from = self
            .ty(frame, expression)
            .scalar()
            .ok_or_else(|| Fail::invalid("a conversion of something other than numbers"))?;
        let to = Scalar {
            kind: to,
            width: convert.unwrap_or(from.width),
        };
        let values = self.scalars(frame, expression)?;
        if from == to {
            return Ok(values);
        }
        if convert.is_none() {
            return Ok(values
                .into_iter()
                .map(|value| self.cast_bits(value, from, to))
                .collect());
        }
        match (to.kind, to.width) {
            (ScalarKind::Bool, _) | (_, 4) | (ScalarKind::Float, 2) => {}
            (_, width) => {
                return Err(Fail::unsupported(format!(
                    "conversions to {}-bit scalars",
                    u32::from(width) * 8
                )));
            }
        }
        self.check_conversion(&values, from.kind, to.kind);
        Ok(values
            .into_iter()
            .map(|value| {
                let value = self.cast_scalar(value, from.kind, to.kind);
                if is_half(from) && class_of(to.kind) == Class::Int && to.kind != ScalarKind::Bool {
                    return self.at_most_half(value, to.kind);
                }
                // An integer's binary32 is rounded again; where that was rounded
                // already, it is beyond binary16.
                if is_half(to) && from.kind != ScalarKind::Bool {
                    self.builder.arith(Arith::RoundHalf, &[value])
                } else {
                    value
                }
            })
            .collect())
    }

    /// An integer that was an `f16`, of which only an infinity is beyond the
    /// largest one.
    fn at_most_half(&mut self, value: Value, kind: ScalarKind) -> Value {
        let b = &mut self.builder;
        let (low, high) = (b.int(-65504_i32 as u32), b.int(65504));
        if kind == ScalarKind::Uint {
            return b.arith(Arith::MinU, &[value, high]);
        }
        let value = b.arith(Arith::MaxS, &[value, low]);
        b.arith(Arith::MinS, &[value, high])
    }

    /// The number of another kind that has the same bits.
    fn cast_bits(&mut self, value: Value, from: Scalar, to: Scalar) -> Value {
        let b = &mut self.builder;
        let is_short = from.width == 2;
        let bits = match class_of(from.kind) {
            Class::Float if is_short => b.arith(Arith::FToHalf, &[value]),
            Class::Float => b.arith(Arith::FToBits, &[value]),
            Class::Int => value,
        };
        match to.kind {
            ScalarKind::Float if is_short => b.arith(Arith::HalfToF, &[bits]),
            ScalarKind::Float => b.arith(Arith::BitsToF, &[bits]),
            ScalarKind::Sint if is_short => {
                let sixteen = b.int(16);
                let high = b.arith(Arith::Shl, &[bits, sixteen]);
                b.arith(Arith::ShrS, &[high, sixteen])
            }
            ScalarKind::Uint if is_short => {
                let low = b.int(0xffff);
                b.arith(Arith::And, &[bits, low])
            }
            _ => bits,
        }
    }

    fn cast_scalar(&mut self, value: Value, from: ScalarKind, to: ScalarKind) -> Value {
        use ScalarKind as K;
        match (from, to) {
            (K::Float, K::Sint) => self.builder.arith(Arith::FToS, &[value]),
            (K::Float, K::Uint) => self.builder.arith(Arith::FToU, &[value]),
            (K::Sint, K::Float) => self.builder.arith(Arith::SToF, &[value]),
            (K::Uint, K::Float) => self.builder.arith(Arith::UToF, &[value]),
            (K::Bool, K::Float) => {
                let (one, zero) = (self.builder.float(1.0), self.builder.float(0.0));
                self.builder.select(value, one, zero)
            }
            (K::Bool, K::Sint | K::Uint) => {
                let one = self.builder.int(1);
                self.builder.arith(Arith::And, &[value, one])
            }
            (K::Float, K::Bool) => {
                let zero = self.builder.float(0.0);
                self.builder.arith(Arith::NeF, &[value, zero])
            }
            (K::Sint | K::Uint, K::Bool) => {
                let zero = self.builder.int(0);
                self.builder.arith(Arith::NeI, &[value, zero])
            }
            _ => value,
        }
    }
}

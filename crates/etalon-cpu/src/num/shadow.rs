//! `f32` with an `f64` beside it.

use super::Number;

/// A number as `f32`, which decides everything, and what it would be in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shadow {
    pub(crate) single: f32,
    pub(crate) double: f64,
}

/// Each half by itself.
macro_rules! both {
    ($($unary:ident)*; $($binary:ident)*) => {
        $(#[inline(always)]
        fn $unary(self) -> Self {
            Self {
                single: Number::$unary(self.single),
                double: Number::$unary(self.double),
            }
        })*
        $(#[inline(always)]
        fn $binary(self, other: Self) -> Self {
            Self {
                single: Number::$binary(self.single, other.single),
                double: Number::$binary(self.double, other.double),
            }
        })*
    };
}

impl Number for Shadow {
    const HAS_SINGLE: bool = true;
    const WIDE: bool = true;

    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        Self {
            single: value,
            double: value.into(),
        }
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self.single
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self.double
    }
    #[inline(always)]
    fn from_both(single: f32, double: f64) -> Self {
        Self { single, double }
    }

    both! {
        neg abs sign floor ceil trunc round sqrt exp exp2 log log2 sin cos tan
        asin acos atan sinh cosh tanh asinh acosh atanh;
        add sub mul div rem min max at_most at_least pow atan2
    }

    #[inline(always)]
    fn ldexp(self, exponent: i32) -> Self {
        Self {
            single: Number::ldexp(self.single, exponent),
            double: Number::ldexp(self.double, exponent),
        }
    }

    #[inline(always)]
    fn eq(self, other: Self) -> bool {
        self.single == other.single
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.single < other.single
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self.single <= other.single
    }

    #[inline(always)]
    fn to_i32(self) -> i32 {
        self.single.to_i32()
    }
    #[inline(always)]
    fn to_u32(self) -> u32 {
        self.single.to_u32()
    }
    #[inline(always)]
    fn from_i32(value: i32) -> Self {
        Self {
            single: Number::from_i32(value),
            double: Number::from_i32(value),
        }
    }
    #[inline(always)]
    fn from_u32(value: u32) -> Self {
        Self {
            single: Number::from_u32(value),
            double: Number::from_u32(value),
        }
    }

    #[inline(always)]
    fn select(mask: u32, yes: Self, no: Self) -> Self {
        Self {
            single: Number::select(mask, yes.single, no.single),
            double: Number::select(mask, yes.double, no.double),
        }
    }
}

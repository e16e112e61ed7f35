//! The number type `f64`.
//!
//! The same kernel in twice the precision: literals, uniforms and imported
//! textures are the `f32` they are in every number type, everything made of
//! them is `f64`, and its range is that of `f64`. What looks at bits sees the
//! nearest `f32`'s.

mod circular;
mod exponential;
mod hyperbolic;
mod logarithm;
#[cfg(test)]
mod reference;

use super::{Number, mask};

/// All ones for true.
#[inline(always)]
fn mask64(condition: bool) -> u64 {
    0_u64.wrapping_sub(u64::from(condition))
}

/// Without a branch, so that loops over lanes become vector code.
#[inline(always)]
fn choose(condition: bool, yes: f64, no: f64) -> f64 {
    let mask = mask64(condition);
    f64::from_bits((yes.to_bits() & mask) | (no.to_bits() & !mask))
}

#[inline(always)]
fn magnitude(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & !SIGN)
}

/// `magnitude`, which has no sign, with the sign of `sign`.
#[inline(always)]
fn signed(magnitude: f64, sign: f64) -> f64 {
    f64::from_bits(magnitude.to_bits() | (sign.to_bits() & SIGN))
}

const SIGN: u64 = 1 << 63;

/// Adding 1.5 · 2^52 to a number below 2^51 leaves the nearest integer in the
/// low bits of the sum.
const MAGIC: f64 = 6_755_399_441_055_744.0;

/// `2^k` for the sum of [`MAGIC`] and a whole number `k` in [-1022, 1023].
#[inline(always)]
fn power_of_two(shifted: f64) -> f64 {
    f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

/// The integer part of `|x|`, at most the largest `f32` below 2^32; anything for NaN.
#[inline(always)]
fn truncated_magnitude(x: f64) -> u32 {
    const LARGEST: f64 = 4_294_967_040.0;
    // From here on the unit of f64 is 1: adding rounds to the nearest integer.
    const UNIT: f64 = 4_503_599_627_370_496.0;
    let x = magnitude(x);
    let x = choose(x < LARGEST, x, LARGEST);
    let nearest = (x + UNIT) - UNIT;
    let below = nearest - choose(nearest > x, 1.0, 0.0);
    (below + UNIT).to_bits() as u32
}

impl Number for f64 {
    const HAS_SINGLE: bool = false;
    const WIDE: bool = true;

    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        value.into()
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn from_both(_: f32, double: f64) -> Self {
        double
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn rem(self, other: Self) -> Self {
        self - other * (self / other).trunc()
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        choose((self < other) | other.is_nan(), self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        choose((self > other) | other.is_nan(), self, other)
    }
    #[inline(always)]
    fn pow(self, other: Self) -> Self {
        exponential::pow(self, other)
    }
    #[inline(always)]
    fn atan2(self, other: Self) -> Self {
        circular::atan2(self, other)
    }
    #[inline(always)]
    fn ldexp(self, exponent: i32) -> Self {
        // Three factors reach from the largest number to the smallest.
        let exponent = exponent.clamp(-3000, 3000);
        let third = exponent.clamp(-1000, 1000);
        let rest = exponent - third;
        let second = rest.clamp(-1000, 1000);
        let power = |k: i32| power_of_two(MAGIC + f64::from(k));
        self * power(third) * power(second) * power(rest - second)
    }

    #[inline(always)]
    fn neg(self) -> Self {
        -self
    }
    #[inline(always)]
    fn abs(self) -> Self {
        magnitude(self)
    }
    #[inline(always)]
    fn sign(self) -> Self {
        let one = mask64(self > 0.0) & 1.0_f64.to_bits();
        let minus_one = mask64(self < 0.0) & (-1.0_f64).to_bits();
        f64::from_bits(one | minus_one)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        self.floor()
    }
    #[inline(always)]
    fn ceil(self) -> Self {
        self.ceil()
    }
    #[inline(always)]
    fn trunc(self) -> Self {
        self.trunc()
    }
    #[inline(always)]
    fn round(self) -> Self {
        self.round_ties_even()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn exp(self) -> Self {
        exponential::exp(self)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        exponential::exp2(self)
    }
    #[inline(always)]
    fn log(self) -> Self {
        logarithm::log(self)
    }
    #[inline(always)]
    fn log2(self) -> Self {
        logarithm::log2(self)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        circular::sin(self)
    }
    #[inline(always)]
    fn cos(self) -> Self {
        circular::cos(self)
    }
    #[inline(always)]
    fn tan(self) -> Self {
        circular::tan(self)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        circular::asin(self)
    }
    #[inline(always)]
    fn acos(self) -> Self {
        circular::acos(self)
    }
    #[inline(always)]
    fn atan(self) -> Self {
        circular::atan2(self, 1.0)
    }
    #[inline(always)]
    fn sinh(self) -> Self {
        hyperbolic::sinh(self)
    }
    #[inline(always)]
    fn cosh(self) -> Self {
        hyperbolic::cosh(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        hyperbolic::tanh(self)
    }
    #[inline(always)]
    fn asinh(self) -> Self {
        hyperbolic::asinh(self)
    }
    #[inline(always)]
    fn acosh(self) -> Self {
        hyperbolic::acosh(self)
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        hyperbolic::atanh(self)
    }

    #[inline(always)]
    fn eq(self, other: Self) -> bool {
        self == other
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn to_i32(self) -> i32 {
        let negative = mask(self < 0.0);
        let magnitude = truncated_magnitude(self).min(0x7fff_ff80 + (negative & 0x80));
        let value = (magnitude ^ negative).wrapping_sub(negative);
        (value & !mask(self.is_nan())) as i32
    }
    #[inline(always)]
    fn to_u32(self) -> u32 {
        truncated_magnitude(self) & mask(self > 0.0)
    }
    #[inline(always)]
    fn from_i32(value: i32) -> Self {
        value.into()
    }
    #[inline(always)]
    fn from_u32(value: u32) -> Self {
        value.into()
    }

    #[inline(always)]
    fn select(mask: u32, yes: Self, no: Self) -> Self {
        // The mask is all ones or all zeros, so its sign says which.
        let mask = i64::from(mask as i32) as u64;
        f64::from_bits((yes.to_bits() & mask) | (no.to_bits() & !mask))
    }
}

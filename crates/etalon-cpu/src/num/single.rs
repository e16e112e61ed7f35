//! The number type `f32`: what the kernels say, as devices compute it.

use super::elementary::{atan2, cos, exp, exp2, log, log2, pow, sin, tan};
use super::{Number, mask};

impl Number for f32 {
    const HAS_SINGLE: bool = true;
    const WIDE: bool = false;

    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self.into()
    }
    #[inline(always)]
    fn from_both(single: f32, _: f64) -> Self {
        single
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
        self - other * Number::trunc(self / other)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Number::select(mask((self < other) | other.is_nan()), self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Number::select(mask((self > other) | other.is_nan()), self, other)
    }
    #[inline(always)]
    fn pow(self, other: Self) -> Self {
        pow(self, other)
    }
    #[inline(always)]
    fn atan2(self, other: Self) -> Self {
        atan2(self, other)
    }
    #[inline(always)]
    fn ldexp(self, exponent: i32) -> Self {
        // Both factors are normal f64 for every exponent that can matter, and
        // the product of an f32 with them is exact, so there is one rounding.
        let exponent = exponent.clamp(-400, 400);
        let power = f64::from_bits(((exponent + 1023) as u64) << 52);
        (f64::from(self) * power) as f32
    }

    #[inline(always)]
    fn neg(self) -> Self {
        -self
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f32::from_bits(self.to_bits() & 0x7fff_ffff)
    }
    #[inline(always)]
    fn sign(self) -> Self {
        let one = mask(self > 0.0) & 1.0_f32.to_bits();
        let minus_one = mask(self < 0.0) & (-1.0_f32).to_bits();
        f32::from_bits(one | minus_one)
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
    fn floor_in_steps(self) -> Self {
        // A zero has the sign of the number: taking off 0 keeps it.
        let nearest = Number::round_in_steps(self);
        let above = f32::from_bits(mask(nearest > self) & 1.0_f32.to_bits());
        nearest - above
    }
    #[inline(always)]
    fn ceil_in_steps(self) -> Self {
        let nearest = Number::round_in_steps(self);
        let below = f32::from_bits(mask(nearest < self) & 1.0_f32.to_bits());
        with_sign_of(nearest + below, self)
    }
    #[inline(always)]
    fn trunc_in_steps(self) -> Self {
        let size = Number::abs(self);
        with_sign_of(Number::floor_in_steps(size), self)
    }
    #[inline(always)]
    fn round_in_steps(self) -> Self {
        // From here on every number is an integer: the sum rounds to one.
        const INTEGERS: f32 = 8_388_608.0;
        let size = Number::abs(self);
        let sign = self.to_bits() ^ size.to_bits();
        let nearest = f32::from_bits(((size + INTEGERS) - INTEGERS).to_bits() | sign);
        Number::select(mask(size < INTEGERS), nearest, self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn exp(self) -> Self {
        exp(self)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        exp2(self)
    }
    #[inline(always)]
    fn log(self) -> Self {
        log(self)
    }
    #[inline(always)]
    fn log2(self) -> Self {
        log2(self)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        sin(self)
    }
    #[inline(always)]
    fn cos(self) -> Self {
        cos(self)
    }
    #[inline(always)]
    fn tan(self) -> Self {
        tan(self)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        f64::from(self).asin() as f32
    }
    #[inline(always)]
    fn acos(self) -> Self {
        f64::from(self).acos() as f32
    }
    #[inline(always)]
    fn atan(self) -> Self {
        f64::from(self).atan() as f32
    }
    #[inline(always)]
    fn sinh(self) -> Self {
        f64::from(self).sinh() as f32
    }
    #[inline(always)]
    fn cosh(self) -> Self {
        f64::from(self).cosh() as f32
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        f64::from(self).tanh() as f32
    }
    #[inline(always)]
    fn asinh(self) -> Self {
        f64::from(self).asinh() as f32
    }
    #[inline(always)]
    fn acosh(self) -> Self {
        f64::from(self).acosh() as f32
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        f64::from(self).atanh() as f32
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
        truncated(self) & mask(!self.is_nan()) as i32
    }
    #[inline(always)]
    fn to_u32(self) -> u32 {
        const MIDDLE: f32 = 2_147_483_648.0;
        const LARGEST: f32 = 4_294_967_040.0;
        let value = if self > 0.0 { self } else { 0.0 };
        let value = if value < LARGEST { value } else { LARGEST };
        // What signed integers do not reach is brought down, exactly.
        let high = mask(value >= MIDDLE);
        let low = value - f32::from_bits(high & MIDDLE.to_bits());
        truncated(low) as u32 | (high & (1 << 31))
    }
    #[inline(always)]
    fn from_i32(value: i32) -> Self {
        value as f32
    }
    #[inline(always)]
    fn from_u32(value: u32) -> Self {
        value as f32
    }

    #[inline(always)]
    fn select(mask: u32, yes: Self, no: Self) -> Self {
        f32::from_bits((yes.to_bits() & mask) | (no.to_bits() & !mask))
    }
}

/// The magnitude of one number, the sign of another.
#[inline(always)]
fn with_sign_of(magnitude: f32, sign: f32) -> f32 {
    const SIGN: u32 = 0x8000_0000;
    f32::from_bits((magnitude.to_bits() & !SIGN) | (sign.to_bits() & SIGN))
}

/// The integer part, at least -2^31 and at most the largest `f32` below 2^31;
/// anything for NaN.
///
/// What `as` does, but as vector code: compilers leave saturating conversions
/// scalar.
#[inline(always)]
#[allow(unsafe_code)]
fn truncated(x: f32) -> i32 {
    const LEAST: f32 = -2_147_483_648.0;
    const LARGEST: f32 = 2_147_483_520.0;
    // Comparisons with NaN are false, so that it becomes the limit.
    let x = if x > LEAST { x } else { LEAST };
    let x = if x < LARGEST { x } else { LARGEST };
    // SAFETY: between the limits, which `i32` holds, and not NaN.
    unsafe { x.to_int_unchecked() }
}

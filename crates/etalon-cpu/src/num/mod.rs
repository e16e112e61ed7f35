//! What the interpreter computes with.
//!
//! Every handler of floating-point instructions is generic over [`Number`], so
//! that the same bytecode can run in other number types than the GPU's `f32`:
//! see [`NumberType`].

use std::fmt;

mod double;
mod elementary;
mod half;
mod shadow;
mod single;

pub(crate) use half::{f16_to_f32, f32_to_f16};
pub(crate) use shadow::Shadow;

use crate::exec::Operands;
use crate::registers::Lane;

/// The number type that a kernel's `f32` is computed in.
///
/// Literals and folded constants, uniforms, and the texels and words of
/// resources without a wide plane are the `f32` of the kernel in every type.
/// What is computed from them is kept in the type in registers and variables, in
/// the memory of invocations and workgroups, and in textures and storage
/// buffers that have a wide plane (see
/// [`Texture::widen`](crate::Texture::widen),
/// [`Buffer::widen`](crate::Buffer::widen)).
///
/// Integers are the same in every type, and so is whatever goes through them:
/// a bit cast, packing or conversion to `f16` sees the bits of the nearest `f32`
/// (in [`NumberType::Shadow`], of the `f32`), and a number made of bits is an
/// `f32`. A kernel that rounds by operations on bits therefore rounds in every
/// type, and one that takes numbers apart by them does so to `f32` accuracy. A
/// guard that only limits the bits of a number limits that number instead, which
/// keeps its digits.
///
/// Filtered reads are `f32` in every type: coordinates, weights, and the texels,
/// which are those in the format and not those of a wide plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum NumberType {
    /// As devices compute.
    #[default]
    F32,
    /// Twice the precision, and its own range: the reference for rounding error.
    ///
    /// Control flow, addresses and conversions to integers follow the `f64`
    /// values, so they may differ from those of the `f32` run. Transcendental
    /// functions are within 4 units in the last place of `f64`, `pow(x, y)`
    /// within `2 + |y| / 2`.
    F64,
    /// `f32` that decides everything, and beside it the `f64` that the same
    /// operations make of the same inputs.
    ///
    /// Control flow, addresses, conversions and stored texels and words are bit
    /// by bit those of the `f32` run. The other half follows: a comparison or
    /// select goes the way of the `f32` values, while `min`, `max`, `sign`,
    /// `floor` and the like are functions of the `f64` ones.
    Shadow,
}

impl NumberType {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::F32, Self::F64, Self::Shadow];

    /// Whether resources need a wide plane to hold its values.
    #[must_use]
    pub fn is_wide(self) -> bool {
        self != Self::F32
    }
}

impl fmt::Display for NumberType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::Shadow => "f32 with f64 shadow",
        })
    }
}

/// One lane of a floating-point register.
///
/// Integers, booleans and masks are the same in every number type; comparisons
/// and conversions are where the two meet.
pub(crate) trait Number: Lane + Operands {
    /// Whether there is more in a number than its `f32`: then memory has a wide
    /// plane beside the texels and words.
    const WIDE: bool;
    /// Whether the `f32` is kept by itself, not only as the nearest one.
    const HAS_SINGLE: bool;

    fn from_f32(value: f32) -> Self;
    /// The nearest one.
    fn to_f32(self) -> f32;
    fn to_f64(self) -> f64;
    /// The number whose texel or word is `single`, and which is `double` in the
    /// wide plane.
    fn from_both(single: f32, double: f64) -> Self;

    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// `x - y * trunc(x / y)`, WGSL's `%`.
    fn rem(self, other: Self) -> Self;
    /// The other operand when one is NaN, the second when they are equal.
    fn min(self, other: Self) -> Self;
    /// The other operand when one is NaN, the second when they are equal.
    fn max(self, other: Self) -> Self;
    /// [`Number::min`] for a limit that is not NaN.
    #[inline(always)]
    fn at_most(self, limit: Self) -> Self {
        if self.lt(limit) { self } else { limit }
    }
    /// [`Number::max`] for a limit that is not NaN.
    #[inline(always)]
    fn at_least(self, limit: Self) -> Self {
        if limit.lt(self) { self } else { limit }
    }
    fn pow(self, other: Self) -> Self;
    fn atan2(self, other: Self) -> Self;
    fn ldexp(self, exponent: i32) -> Self;

    fn neg(self) -> Self;
    fn abs(self) -> Self;
    fn sign(self) -> Self;
    fn floor(self) -> Self;
    fn ceil(self) -> Self;
    fn trunc(self) -> Self;
    /// To the nearest integer, ties to even.
    fn round(self) -> Self;
    /// [`Number::floor`] without an instruction for it.
    #[inline(always)]
    fn floor_in_steps(self) -> Self {
        self.floor()
    }
    /// [`Number::ceil`] without an instruction for it.
    #[inline(always)]
    fn ceil_in_steps(self) -> Self {
        self.ceil()
    }
    /// [`Number::trunc`] without an instruction for it.
    #[inline(always)]
    fn trunc_in_steps(self) -> Self {
        self.trunc()
    }
    /// [`Number::round`] without an instruction for it.
    #[inline(always)]
    fn round_in_steps(self) -> Self {
        self.round()
    }
    fn sqrt(self) -> Self;
    fn exp(self) -> Self;
    fn exp2(self) -> Self;
    fn log(self) -> Self;
    fn log2(self) -> Self;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
    fn tan(self) -> Self;
    fn asin(self) -> Self;
    fn acos(self) -> Self;
    fn atan(self) -> Self;
    fn sinh(self) -> Self;
    fn cosh(self) -> Self;
    fn tanh(self) -> Self;
    fn asinh(self) -> Self;
    fn acosh(self) -> Self;
    fn atanh(self) -> Self;

    fn eq(self, other: Self) -> bool;
    fn lt(self, other: Self) -> bool;
    fn le(self, other: Self) -> bool;

    /// Truncates; out of range gives the nearest value that `f32` has too (WGSL
    /// §15.7.6), so 2147483520 for all that is greater. NaN gives 0.
    fn to_i32(self) -> i32;
    /// Truncates; out of range gives the nearest value that `f32` has too, so
    /// 4294967040 for all that is greater. NaN gives 0.
    fn to_u32(self) -> u32;
    fn from_i32(value: i32) -> Self;
    fn from_u32(value: u32) -> Self;

    /// `self` where `mask` is all ones, `other` where it is all zeros.
    fn select(mask: u32, yes: Self, no: Self) -> Self;
}

/// All ones for true: how booleans are kept in integer registers.
#[inline(always)]
pub(crate) fn mask(condition: bool) -> u32 {
    0_u32.wrapping_sub(u32::from(condition))
}

#[cfg(test)]
mod tests {
    use super::Number;

    /// All exponents and signs, halves and their neighbours.
    #[test]
    fn rounding_in_steps_is_rounding() {
        let arbitrary = (0..400_000_u32).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b1)));
        let halves = (-2000..2000).flat_map(|i| {
            let half = i as f32 / 4.0;
            [half, half.next_up(), half.next_down(), half * 8192.0]
        });
        let special = [
            0.0,
            -0.0,
            f32::INFINITY,
            f32::NEG_INFINITY,
            8_388_607.5,
            -8_388_607.5,
        ];
        for x in arbitrary.chain(halves).chain(special) {
            let pairs = [
                (x.floor_in_steps(), x.floor()),
                (x.ceil_in_steps(), x.ceil()),
                (x.trunc_in_steps(), x.trunc()),
                (x.round_in_steps(), x.round_ties_even()),
            ];
            for (got, want) in pairs {
                assert!(
                    got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(),
                    "{x}: {got}, not {want}"
                );
            }
        }
    }
}

//! Transcendental functions, computed in `f64` and rounded once.
//!
//! Plain arithmetic without branches on the common range, so loops over lanes
//! become vector code, and without calls into the platform's library, so the
//! bits are the same on every machine. Polynomials are off by less than 1e-13,
//! hence results differ from the correctly rounded ones only where the exact
//! value lies within that of a rounding boundary; those of `pow` within that
//! times the binary logarithm of the result.

use std::f64::consts::{FRAC_PI_2, LN_2, LOG2_E};

/// `2^x` for |x| < 1000.
#[inline(always)]
fn exp2_f64(x: f64) -> f64 {
    // Adding 1.5 · 2^52 leaves the nearest integer in the low bits.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    let shifted = x + MAGIC;
    let n = shifted - MAGIC;
    let r = x - n;
    // (2^r - 1) / r for |r| ≤ ½ at Chebyshev's nodes: 2^r within 4e-14, and 1 at 0.
    let mut sum = 1.020_312_106_339_172_9e-7;
    sum = sum * r + 1.325_522_487_866_881_7e-6;
    sum = sum * r + 1.525_268_684_626_772e-5;
    sum = sum * r + 1.540_345_585_245_383_8e-4;
    sum = sum * r + 1.333_355_817_904_311_2e-3;
    sum = sum * r + 9.618_129_159_402_558e-3;
    sum = sum * r + 5.550_410_866_476_042_4e-2;
    sum = sum * r + 2.402_265_069_581_299e-1;
    sum = sum * r + LN_2;
    sum = sum * r + 1.0;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    sum * power
}

/// Anything beyond ±200 overflows or underflows `f32` all the same.
#[inline(always)]
fn exp2_clamped(x: f64) -> f32 {
    let x = if x > 200.0 { 200.0 } else { x };
    let x = if x < -200.0 { -200.0 } else { x };
    let result = exp2_f64(x) as f32;
    if x.is_nan() { f32::NAN } else { result }
}

#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    exp2_clamped(f64::from(x))
}

#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    exp2_clamped(f64::from(x) * LOG2_E)
}

/// `log2(x)` of a positive, finite `f32` in `f64`.
#[inline(always)]
fn log2_f64(x: f64) -> f64 {
    // x = m · 2^e with m in [1/√2, √2).
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (bits as i64) >> 52;
    let m = f64::from_bits((bits & 0x000f_ffff_ffff_ffff).wrapping_add(SQRT_HALF));
    // log2 m = 2 artanh(s) / ln 2, |s| ≤ 0.1716: over s, a series in s², within 3e-14 at
    // Chebyshev's nodes.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut sum = 0.282_887_182_630_735_65;
    sum = sum * z + 0.319_906_660_889_147_4;
    sum = sum * z + 0.412_209_227_330_524_45;
    sum = sum * z + 0.577_077_942_630_261_8;
    sum = sum * z + 0.961_796_694_112_359_5;
    sum = sum * z + 2.885_390_081_777_850_4;
    // The exponent as f64 by the 2^52 trick: there is no vector conversion
    // from 64-bit integers below AVX-512.
    const OFFSET: f64 = 4_503_599_627_370_496.0 + 2048.0;
    let exponent =
        f64::from_bits((exponent.wrapping_add(2048) as u64) | 0x4330_0000_0000_0000) - OFFSET;
    exponent + sum * s
}

/// `result` where `x` is positive and finite; the limits elsewhere.
#[inline(always)]
fn log_limits(x: f32, result: f32) -> f32 {
    let result = if x == f32::INFINITY {
        f32::INFINITY
    } else {
        result
    };
    let result = if x == 0.0 { f32::NEG_INFINITY } else { result };
    let negative_or_nan = (x < 0.0) | x.is_nan();
    if negative_or_nan { f32::NAN } else { result }
}

#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    log_limits(x, log2_f64(f64::from(x)) as f32)
}

#[inline(always)]
pub(crate) fn log(x: f32) -> f32 {
    log_limits(x, (log2_f64(f64::from(x)) * LN_2) as f32)
}

/// WGSL's `pow`: `exp2(y * log2(x))`, so NaN for negative `x`, without the
/// error of an intermediate rounding to `f32`. `pow(x, 0)` is 1 for positive
/// `x`, `pow(0, y)` is 0 for positive and infinity for negative `y`.
#[inline(always)]
pub(crate) fn pow(x: f32, y: f32) -> f32 {
    let (fx, fy) = (f64::from(x), f64::from(y));
    let result = exp2_clamped(fy * log2_f64(fx));
    let at_zero = if y > 0.0 { 0.0 } else { f32::INFINITY };
    let at_infinity = if y > 0.0 { f32::INFINITY } else { 0.0 };
    let result = if x == 0.0 { at_zero } else { result };
    let result = if x == f32::INFINITY {
        at_infinity
    } else {
        result
    };
    let result = if y == 0.0 { 1.0 } else { result };
    let invalid = (x < 0.0) | x.is_nan() | y.is_nan();
    if invalid { f32::NAN } else { result }
}

/// Angles beyond this lose bits in the reduction below and take the slow path.
const LARGE_ANGLE: f32 = 1.0e6;

/// sin and cos of `x - k π/2` with the quadrant `k`, for |x| ≤ [`LARGE_ANGLE`].
#[inline(always)]
fn sin_cos_reduced(x: f64) -> (f64, f64, u64) {
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    // π/2 in two parts; the high one has 33 bits, so its product with k < 2^20 is exact.
    const HIGH: f64 = f64::from_bits(FRAC_PI_2.to_bits() & !0xf_ffff);
    const LOW: f64 = (FRAC_PI_2 - HIGH) + 6.123_233_995_736_766e-17;
    let shifted = x * (1.0 / FRAC_PI_2) + MAGIC;
    let k = shifted - MAGIC;
    let r = (x - k * HIGH) - k * LOW;
    let z = r * r;
    // (sin r / r - 1) / r² and (cos r - 1) / r² for |r| ≤ π/4 at Chebyshev's nodes: sine
    // within 2e-14, cosine within 3e-16.
    let mut s = -2.480_539_094_576_606_7e-8;
    s = s * z + 2.755_598_828_002_141_6e-6;
    s = s * z - 1.984_126_690_822_479_6e-4;
    s = s * z + 8.333_333_331_070_21e-3;
    s = s * z - 1.666_666_666_666_387e-1;
    let sin = r + r * z * s;
    let mut c = 2.066_529_463_577_556e-9;
    c = c * z - 2.755_585_259_239_173_4e-7;
    c = c * z + 2.480_158_260_933_655_6e-5;
    c = c * z - 1.388_888_888_210_091_9e-3;
    c = c * z + 4.166_666_666_663_075e-2;
    c = c * z - 4.999_999_999_999_996_7e-1;
    let cos = 1.0 + z * c;
    (sin, cos, shifted.to_bits())
}

#[inline(always)]
fn select(condition: bool, yes: f64, no: f64) -> f64 {
    if condition { yes } else { no }
}

/// Whether `x` is small enough for [`sin_cos_reduced`] (false for NaN).
#[inline(always)]
pub(crate) fn is_small_angle(x: f32) -> bool {
    x.abs() <= LARGE_ANGLE
}

/// [`sin`] of small angles.
#[inline(always)]
pub(crate) fn sin_small(x: f32) -> f32 {
    let (sin, cos, quadrant) = sin_cos_reduced(f64::from(x));
    let value = select(quadrant & 1 == 0, sin, cos);
    let value = select(quadrant & 2 == 0, value, -value) as f32;
    // The sign of zero is lost in the reduction.
    if x == 0.0 { x } else { value }
}

/// [`cos`] of small angles.
#[inline(always)]
pub(crate) fn cos_small(x: f32) -> f32 {
    let (sin, cos, quadrant) = sin_cos_reduced(f64::from(x));
    let value = select(quadrant & 1 == 0, cos, sin);
    select(quadrant.wrapping_add(1) & 2 == 0, value, -value) as f32
}

#[inline(always)]
pub(crate) fn sin(x: f32) -> f32 {
    if is_small_angle(x) {
        sin_small(x)
    } else {
        f64::from(x).sin() as f32
    }
}

#[inline(always)]
pub(crate) fn cos(x: f32) -> f32 {
    if is_small_angle(x) {
        cos_small(x)
    } else {
        f64::from(x).cos() as f32
    }
}

#[inline(always)]
pub(crate) fn tan(x: f32) -> f32 {
    f64::from(x).tan() as f32
}

#[inline(always)]
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    f64::from(y).atan2(f64::from(x)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equal up to the last bit's neighbours, for every class of input.
    fn check(
        name: &str,
        inputs: impl Iterator<Item = f32>,
        ours: fn(f32) -> f32,
        reference: fn(f64) -> f64,
    ) {
        let mut inexact = 0_u32;
        for x in inputs {
            let (got, want) = (ours(x), reference(f64::from(x)) as f32);
            if want.is_nan() {
                assert!(got.is_nan(), "{name}({x}) = {got}, not NaN");
                continue;
            }
            // The reference is itself within 1 ulp of f64, so both round to the
            // same f32 except next to a rounding boundary.
            if got.to_bits() != want.to_bits() {
                inexact += 1;
                assert!(
                    got == want.next_up() || got == want.next_down(),
                    "{name}({x}) = {got}, not {want}"
                );
            }
        }
        assert!(
            inexact <= 2,
            "{name}: {inexact} results are not the rounded reference"
        );
    }

    /// All exponents and signs, with a varied mantissa.
    fn everything() -> impl Iterator<Item = f32> {
        let special = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            f32::MIN_POSITIVE,
            f32::from_bits(1),
            f32::MAX,
            f32::MIN,
        ];
        special
            .into_iter()
            .chain((0..400_000_u32).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b1))))
    }

    fn around(limit: f32) -> impl Iterator<Item = f32> {
        (0..200_000).map(move |i| (i as f32 / 100_000.0 - 1.0) * limit)
    }

    #[test]
    fn exponentials_are_the_rounded_f64_ones() {
        check("exp2", everything().chain(around(151.0)), exp2, f64::exp2);
        check("exp", everything().chain(around(105.0)), exp, f64::exp);
    }

    #[test]
    fn logarithms_are_the_rounded_f64_ones() {
        check("log2", everything().chain(around(3.0)), log2, f64::log2);
        check("log", everything().chain(around(3.0)), log, f64::ln);
    }

    #[test]
    fn circular_functions_are_the_rounded_f64_ones() {
        check(
            "sin",
            everything().chain(around(10.0)).chain(around(1.0e6)),
            sin,
            f64::sin,
        );
        check(
            "cos",
            everything().chain(around(10.0)).chain(around(1.0e6)),
            cos,
            f64::cos,
        );
    }

    #[test]
    fn powers_are_the_rounded_f64_ones() {
        for y in [0.0, 0.5, 1.0, 2.2, 1.0 / 2.4, -1.5, 7.0, 100.0] {
            for x in everything().filter(|x| *x > 0.0 && x.is_finite()) {
                let (got, want) = (pow(x, y), f64::from(x).powf(f64::from(y)) as f32);
                assert!(
                    got == want || got == want.next_up() || got == want.next_down(),
                    "{x}^{y}: {got}, not {want}"
                );
            }
        }
        assert_eq!(pow(0.0, 2.0), 0.0);
        assert_eq!(pow(0.0, -1.0), f32::INFINITY);
        assert_eq!(pow(f32::INFINITY, -1.0), 0.0);
        assert!(pow(-1.0, 2.0).is_nan());
    }
}

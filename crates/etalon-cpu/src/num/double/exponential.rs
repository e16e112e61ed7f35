//! Exponentials and powers.

use super::logarithm::log2_parts;
use super::{MAGIC, choose, magnitude, power_of_two};

pub(super) const LOG2E: f64 = std::f64::consts::LOG2_E;
/// ln 2 in two parts; the first has 40 bits, so that its product with a whole
/// number below 2^13 is exact.
pub(super) const LN2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fefa_2000);
pub(super) const LN2_LOW: f64 = 7.371_002_565_167_799e-13;

/// `e^(high + low) · 2^n` for |high| ≤ ln 2 / 2, `low` below the unit in its last place and a whole `n`
/// in [-2000, 2000]. Error: below 1 ulp beside that of the arguments.
#[inline(always)]
fn scaled_exponential(high: f64, low: f64, n: f64) -> f64 {
    // Taylor series: the first term left out is 0.35^14 / 14! < 2^-57.
    let mut sum = 1.0 / 6_227_020_800.0;
    sum = sum * high + 1.0 / 479_001_600.0;
    sum = sum * high + 1.0 / 39_916_800.0;
    sum = sum * high + 1.0 / 3_628_800.0;
    sum = sum * high + 1.0 / 362_880.0;
    sum = sum * high + 1.0 / 40_320.0;
    sum = sum * high + 1.0 / 5_040.0;
    sum = sum * high + 1.0 / 720.0;
    sum = sum * high + 1.0 / 120.0;
    sum = sum * high + 1.0 / 24.0;
    sum = sum * high + 1.0 / 6.0;
    sum = sum * high + 0.5;
    let value = 1.0 + (high + (low + high * high * sum));
    // Two factors: 2^n itself may be no number where the result is one.
    let half = n * 0.5 + MAGIC;
    let rest = n - (half - MAGIC);
    value * power_of_two(half) * power_of_two(rest + MAGIC)
}

/// `2^(high + low) · 2^n`, where `low` is much smaller than `high`.
#[inline(always)]
fn exp2_parts(high: f64, low: f64) -> f64 {
    // Beyond these limits the result is 0 or infinite; NaN stays what it is.
    let outside = magnitude(high) > 1100.0;
    let limit = choose(high > 0.0, 1100.0, -1100.0);
    let (high, low) = (choose(outside, limit, high), choose(outside, 0.0, low));
    let n = (high + MAGIC) - MAGIC;
    let r = high - n;
    let scaled = r * std::f64::consts::LN_2;
    // The rest of the constant is ln 2 - LN_2.
    let rest = r * 2.319_046_813_846_299_6e-17 + low * std::f64::consts::LN_2;
    let high = scaled + rest;
    scaled_exponential(high, (scaled - high) + rest, n)
}

/// `2^x`. Error: below 1.5 ulp.
#[inline(always)]
pub(super) fn exp2(x: f64) -> f64 {
    exp2_parts(x, 0.0)
}

/// `e^x · 2^shift` for a small whole `shift`. Error: below 1.5 ulp.
#[inline(always)]
pub(super) fn exp_shifted(x: f64, shift: f64) -> f64 {
    // Beyond these limits the result is 0 or infinite.
    let x = choose(x > 720.0, 720.0, x);
    let x = choose(x < -760.0, -760.0, x);
    let n = (x * LOG2E + MAGIC) - MAGIC;
    let reduced = x - n * LN2_HIGH;
    let high = reduced - n * LN2_LOW;
    let low = (reduced - high) - n * LN2_LOW;
    scaled_exponential(high, low, n + shift)
}

/// `e^x`. Error: below 1.5 ulp.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    exp_shifted(x, 0.0)
}

/// The upper 26 bits of the significand: products of two such numbers are exact.
#[inline(always)]
pub(super) fn upper_half(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0xffff_ffff_f800_0000)
}

/// WGSL's `pow`, with the special values of the `f32` one. Error: below
/// `2 + |y| / 2` ulp; it grows with `y` because the logarithm is carried to 55
/// bits behind the point.
#[inline(always)]
pub(super) fn pow(x: f64, y: f64) -> f64 {
    // So large an exponent makes 0 or infinity of all but 1 already.
    const MOST: f64 = 1.0e300;
    let exponent = choose(y > MOST, MOST, choose(y < -MOST, -MOST, y));
    let (log, rest) = log2_parts(x);
    // Both factors cut in halves, so that the leading product is exact.
    let log_upper = upper_half(log);
    let log_lower = (log - log_upper) + rest;
    let upper = upper_half(exponent);
    let lower = exponent - upper;
    let leading = upper * log_upper;
    let rest = lower * log_upper + exponent * log_lower;
    let sum = leading + rest;
    let result = exp2_parts(sum, (leading - sum) + rest);
    let at_zero = choose(y > 0.0, 0.0, f64::INFINITY);
    let at_infinity = choose(y > 0.0, f64::INFINITY, 0.0);
    let result = choose(x == 0.0, at_zero, result);
    let result = choose(x == f64::INFINITY, at_infinity, result);
    let result = choose(y == 0.0, 1.0, result);
    let undefined = (x == 1.0) & (y.abs() == f64::INFINITY);
    choose(
        (x < 0.0) | x.is_nan() | y.is_nan() | undefined,
        f64::NAN,
        result,
    )
}

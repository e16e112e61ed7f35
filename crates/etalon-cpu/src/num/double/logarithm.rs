//! Logarithms.
//!
//! With `x = 2^e (1 + f)`, `s = f / (2 + f)` and `h = f² / 2`,
//! `ln(1 + f) = f - h + s (h + R(s²))`, `R(z) = 2/3 z + 2/5 z² + …`, the
//! arrangement of K. C. Ng (FreeBSD's msun, `e_log.c`).

use super::choose;
use super::exponential::{LN2_HIGH, LN2_LOW, upper_half};

/// `e`, `f`, `h` and `s (h + R)` of a positive, finite number; |f| ≤ 0.42.
#[inline(always)]
fn reduced(x: f64) -> [f64; 4] {
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    // Subnormal numbers are made normal first.
    let subnormal = x < f64::MIN_POSITIVE;
    let bits = (x * choose(subnormal, 18_014_398_509_481_984.0, 1.0)).to_bits();
    let offset = bits.wrapping_sub(SQRT_HALF);
    let m = f64::from_bits((offset & 0x000f_ffff_ffff_ffff).wrapping_add(SQRT_HALF));
    // The exponent plus 1024, in the low bits of 2^52: there is no vector
    // conversion from 64-bit integers below AVX-512.
    let biased = offset.wrapping_add(1024 << 52) >> 52;
    let e = f64::from_bits(biased | 0x4330_0000_0000_0000)
        - choose(
            subnormal,
            4_503_599_627_370_496.0 + 1078.0,
            4_503_599_627_370_496.0 + 1024.0,
        );
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    // |s| ≤ 0.1716: the first term left out is below 2^-55 of ln(1 + f).
    let mut r = 2.0 / 19.0;
    r = r * z + 2.0 / 17.0;
    r = r * z + 2.0 / 15.0;
    r = r * z + 2.0 / 13.0;
    r = r * z + 2.0 / 11.0;
    r = r * z + 2.0 / 9.0;
    r = r * z + 2.0 / 7.0;
    r = r * z + 2.0 / 5.0;
    r = r * z + 2.0 / 3.0;
    let h = 0.5 * f * f;
    [e, f, h, s * (h + r * z)]
}

/// `ln(x)` of a positive, finite number. Error: below 1 ulp.
#[inline(always)]
pub(super) fn log_positive(x: f64) -> f64 {
    let [e, f, h, t] = reduced(x);
    e * LN2_HIGH - ((h - (t + e * LN2_LOW)) - f)
}

/// `log2(x)` of a positive, finite number as a sum of two, of which the second
/// is much smaller. Error: below 2^-55 absolute, and below 1 ulp.
#[inline(always)]
pub(super) fn log2_parts(x: f64) -> (f64, f64) {
    // log2(e) in two parts, the first of 26 bits.
    const HIGH: f64 = 1.442_695_021_629_333_5;
    const LOW: f64 = 1.925_962_991_126_617_5e-8;
    let [e, f, h, t] = reduced(x);
    let upper = upper_half(f - h);
    let lower = ((f - upper) - h) + t;
    // Exact, as is its sum with `e` in two parts: |e| ≥ 1 > |leading|, or e is 0.
    let leading = upper * HIGH;
    let sum = e + leading;
    let rest = (e - sum) + leading;
    (sum, rest + ((lower + upper) * LOW + lower * HIGH))
}

/// `result` where `x` is positive and finite; the limits elsewhere.
#[inline(always)]
pub(super) fn with_limits(x: f64, result: f64) -> f64 {
    let result = choose(x == f64::INFINITY, f64::INFINITY, result);
    let result = choose(x == 0.0, f64::NEG_INFINITY, result);
    choose((x < 0.0) | x.is_nan(), f64::NAN, result)
}

/// `ln(x)`. Error: below 1 ulp.
#[inline(always)]
pub(super) fn log(x: f64) -> f64 {
    with_limits(x, log_positive(x))
}

/// `log2(x)`. Error: below 1 ulp.
#[inline(always)]
pub(super) fn log2(x: f64) -> f64 {
    let (sum, rest) = log2_parts(x);
    with_limits(x, sum + rest)
}

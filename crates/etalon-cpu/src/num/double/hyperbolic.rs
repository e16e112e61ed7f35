//! Hyperbolic functions and their inverses.

use std::f64::consts::LN_2;

use super::exponential::exp_shifted;
use super::logarithm::{log_positive, with_limits};
use super::{choose, magnitude, signed};

/// sinh of |x| ≤ 1 by its Taylor series: the first term left out is below 2^-56.
#[inline(always)]
fn sinh_small(x: f64) -> f64 {
    let z = x * x;
    let mut sum = 1.0 / 355_687_428_096_000.0;
    sum = sum * z + 1.0 / 1_307_674_368_000.0;
    sum = sum * z + 1.0 / 6_227_020_800.0;
    sum = sum * z + 1.0 / 39_916_800.0;
    sum = sum * z + 1.0 / 362_880.0;
    sum = sum * z + 1.0 / 5_040.0;
    sum = sum * z + 1.0 / 120.0;
    sum = sum * z + 1.0 / 6.0;
    x + x * z * sum
}

/// sinh and cosh of `x ≥ 0`.
#[inline(always)]
fn sinh_cosh(x: f64) -> (f64, f64) {
    // Half the exponential: the whole one may be infinite where they are not.
    let half = exp_shifted(x, -1.0);
    let inverse = 0.25 / half;
    (
        choose(x < 1.0, sinh_small(x), half - inverse),
        half + inverse,
    )
}

/// Error: below 3 ulp.
#[inline(always)]
pub(super) fn sinh(x: f64) -> f64 {
    signed(sinh_cosh(magnitude(x)).0, x)
}

/// Error: below 2.5 ulp.
#[inline(always)]
pub(super) fn cosh(x: f64) -> f64 {
    sinh_cosh(magnitude(x)).1
}

/// Error: below 4 ulp.
#[inline(always)]
pub(super) fn tanh(x: f64) -> f64 {
    let a = magnitude(x);
    // From here on it is 1; NaN stays what it is.
    let (sinh, cosh) = sinh_cosh(choose(a > 20.0, 20.0, a));
    signed(sinh / cosh, x)
}

/// `ln(1 + u)` for u > -1, NaN below. Error: below 2 ulp.
#[inline(always)]
fn log_one_plus(u: f64) -> f64 {
    let w = 1.0 + u;
    // What the sum lost (Knuth's two-sum); nothing where it is infinite.
    let seen = w - 1.0;
    let lost = (1.0 - (w - seen)) + (u - seen);
    let result = log_positive(w) + lost / w;
    with_limits(w, result)
}

/// From here on the square of a number is its square plus one.
const LARGE: f64 = 1.0e9;

/// Error: below 4 ulp.
#[inline(always)]
pub(super) fn asinh(x: f64) -> f64 {
    let a = magnitude(x);
    let large = a > LARGE;
    let square = a * a;
    let u = a + square / (1.0 + (1.0 + square).sqrt());
    // There it is ln(2 a), within 2^-60.
    let value = log_one_plus(choose(large, a - 1.0, u)) + choose(large, LN_2, 0.0);
    signed(value, x)
}

/// Error: below 4 ulp. NaN below 1.
#[inline(always)]
pub(super) fn acosh(x: f64) -> f64 {
    let t = x - 1.0;
    let large = x > LARGE;
    let u = t + (t * (2.0 + t)).sqrt();
    let value = log_one_plus(choose(large, t, u)) + choose(large, LN_2, 0.0);
    choose(x < 1.0, f64::NAN, value)
}

/// Error: below 4 ulp. NaN outside of [-1, 1].
#[inline(always)]
pub(super) fn atanh(x: f64) -> f64 {
    let a = magnitude(x);
    let value = 0.5 * log_one_plus(2.0 * a / (1.0 - a));
    signed(value, x)
}

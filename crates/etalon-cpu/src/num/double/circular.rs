//! Circular functions and their inverses.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

use super::{MAGIC, SIGN, choose, magnitude, mask64, signed};

/// Angles beyond this lose bits in the reduction below and go to the platform's
/// library.
const LARGE_ANGLE: f64 = 1.0e5;

/// `x - k π/2` as a sum of two, of which the second is much smaller, and the
/// quadrant `k` in the low bits; for |x| ≤ [`LARGE_ANGLE`].
#[inline(always)]
fn reduced(x: f64) -> (f64, f64, u64) {
    // π/2 in three parts (Cody and Waite). The first two have 36 bits, so that
    // their products with |k| < 2^16 are exact; the third ends at 2^-129.
    const FIRST: f64 = f64::from_bits(0x3ff9_21fb_5444_0000);
    const SECOND: f64 = f64::from_bits(0x3d86_8c23_4c4c_0000);
    const THIRD: f64 = f64::from_bits(0x3b29_8a2e_0370_7345);
    let shifted = x * FRAC_2_PI + MAGIC;
    let k = shifted - MAGIC;
    // Exact: the two are within a factor of two of each other.
    let a = x - k * FIRST;
    let b = k * SECOND;
    let difference = a - b;
    // What the difference lost (Knuth's two-sum).
    let b_seen = difference - a;
    let lost = (a - (difference - b_seen)) - (b + b_seen);
    let rest = lost - k * THIRD;
    let high = difference + rest;
    (high, (difference - high) + rest, shifted.to_bits())
}

/// sin and cos of `high + low`, |high| ≤ π/4. Error: below 0.8 ulp.
#[inline(always)]
fn sin_cos(high: f64, low: f64) -> (f64, f64) {
    let z = high * high;
    // Taylor series: the first terms left out are below 2^-62 and 2^-58.
    let mut s = 1.0 / 355_687_428_096_000.0;
    s = s * z - 1.0 / 1_307_674_368_000.0;
    s = s * z + 1.0 / 6_227_020_800.0;
    s = s * z - 1.0 / 39_916_800.0;
    s = s * z + 1.0 / 362_880.0;
    s = s * z - 1.0 / 5_040.0;
    s = s * z + 1.0 / 120.0;
    s = s * z - 1.0 / 6.0;
    let half = 0.5 * z;
    let sin = high + (high * z * s + low * (1.0 - half));
    let mut c = 1.0 / 20_922_789_888_000.0;
    c = c * z - 1.0 / 87_178_291_200.0;
    c = c * z + 1.0 / 479_001_600.0;
    c = c * z - 1.0 / 3_628_800.0;
    c = c * z + 1.0 / 40_320.0;
    c = c * z - 1.0 / 720.0;
    c = c * z + 1.0 / 24.0;
    let near = 1.0 - half;
    let cos = near + (((1.0 - near) - half) + (z * z * c - high * low));
    (sin, cos)
}

/// Whether `x` is small enough for [`reduced`] (false for NaN).
#[inline(always)]
fn is_small(x: f64) -> bool {
    magnitude(x) <= LARGE_ANGLE
}

#[inline(always)]
fn negated_where(bit: u64, x: f64) -> f64 {
    f64::from_bits(x.to_bits() ^ (bit << 63))
}

#[inline(always)]
fn sin_small(x: f64) -> f64 {
    let (high, low, quadrant) = reduced(x);
    let (sin, cos) = sin_cos(high, low);
    let value = choose(quadrant & 1 == 0, sin, cos);
    // The sign of zero is lost in the reduction.
    choose(x == 0.0, x, negated_where(quadrant >> 1 & 1, value))
}

#[inline(always)]
fn cos_small(x: f64) -> f64 {
    let (high, low, quadrant) = reduced(x);
    let (sin, cos) = sin_cos(high, low);
    let value = choose(quadrant & 1 == 0, cos, sin);
    negated_where(quadrant.wrapping_add(1) >> 1 & 1, value)
}

#[inline(always)]
fn tan_small(x: f64) -> f64 {
    let (high, low, quadrant) = reduced(x);
    let (sin, cos) = sin_cos(high, low);
    let odd = quadrant & 1 != 0;
    let value = choose(odd, cos, sin) / choose(odd, sin, cos);
    choose(x == 0.0, x, negated_where(quadrant & 1, value))
}

/// Error: below 1 ulp.
#[inline(always)]
pub(super) fn sin(x: f64) -> f64 {
    if is_small(x) { sin_small(x) } else { x.sin() }
}

/// Error: below 1 ulp.
#[inline(always)]
pub(super) fn cos(x: f64) -> f64 {
    if is_small(x) { cos_small(x) } else { x.cos() }
}

/// Error: below 3 ulp.
#[inline(always)]
pub(super) fn tan(x: f64) -> f64 {
    if is_small(x) { tan_small(x) } else { x.tan() }
}

/// The angle of the point `(x, y)`, in [-π, π]. Error: below 3 ulp.
#[inline(always)]
pub(super) fn atan2(y: f64, x: f64) -> f64 {
    // tan(π/8): beyond it the angle is taken from the diagonal.
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    // What the constants leave of π/2 and π.
    const HALF_REST: f64 = 6.123_233_995_736_766e-17;
    const REST: f64 = 1.224_646_799_147_353_2e-16;
    let (ax, ay) = (magnitude(x), magnitude(y));
    let steep = ay > ax;
    let (short, long) = (choose(steep, ax, ay), choose(steep, ay, ax));
    // Two infinities are on the diagonal, two zeros on the axis; the sum of
    // large numbers must not be infinite.
    let both_infinite = short == f64::INFINITY;
    let scale = choose(long > 1.0e300, 2.0_f64.powi(-64), 1.0);
    let short = choose(both_infinite, 1.0, short * scale);
    let long = choose(both_infinite | (long == 0.0), 1.0, long * scale);
    let diagonal = short > TAN_PI_8 * long;
    let u = choose(diagonal, short - long, short) / choose(diagonal, short + long, long);
    let z = u * u;
    // Minimax on |u| ≤ tan(π/8): atan(u) = u + u z P(z) within 2^-57 of itself.
    let mut p = -0.019_176_738_872_388_188;
    p = p * z + 0.039_231_537_245_164_47;
    p = p * z - 0.050_854_455_478_168_435;
    p = p * z + 0.058_581_481_120_851_85;
    p = p * z - 0.066_645_113_552_076_2;
    p = p * z + 0.076_921_831_842_823_83;
    p = p * z - 0.090_909_045_778_422_25;
    p = p * z + 0.111_111_110_152_494_3;
    p = p * z - 0.142_857_142_846_664_56;
    p = p * z + 0.199_999_999_999_955_2;
    p = p * z - 0.333_333_333_333_333_3;
    let correction = u * z * p + choose(diagonal, 0.5 * HALF_REST, 0.0);
    let angle = choose(diagonal, FRAC_PI_4, 0.0) + (u + correction);
    let angle = choose(steep, FRAC_PI_2 - (angle - HALF_REST), angle);
    let angle = choose(x.to_bits() & SIGN != 0, PI - (angle - REST), angle);
    let invalid = mask64(x.is_nan() | y.is_nan());
    signed(
        f64::from_bits(angle.to_bits() | (invalid & f64::NAN.to_bits())),
        y,
    )
}

/// Error: below 4 ulp. NaN outside of [-1, 1].
#[inline(always)]
pub(super) fn asin(x: f64) -> f64 {
    atan2(x, ((1.0 - x) * (1.0 + x)).sqrt())
}

/// Error: below 4 ulp. NaN outside of [-1, 1].
#[inline(always)]
pub(super) fn acos(x: f64) -> f64 {
    atan2(((1.0 - x) * (1.0 + x)).sqrt(), x)
}

//! Functions in twice the precision of `f64`, and the comparison with them.
//!
//! Numbers are unevaluated sums of two `f64` (Dekker, 1971) with about 104
//! bits; functions are plain series and identities, slow and simple.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::super::Number;

#[derive(Clone, Copy, Debug)]
struct Pair(f64, f64);

fn two_sum(a: f64, b: f64) -> Pair {
    let sum = a + b;
    let seen = sum - a;
    Pair(sum, (a - (sum - seen)) + (b - seen))
}

impl From<f64> for Pair {
    fn from(value: f64) -> Self {
        Self(value, 0.0)
    }
}

impl Add for Pair {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (two_sum(self.0, other.0), two_sum(self.1, other.1));
        let sum = two_sum(high.0, high.1 + low.0);
        two_sum(sum.0, sum.1 + low.1)
    }
}

impl Neg for Pair {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Sub for Pair {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Pair {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = self.0 * other.0;
        let rest = self.0.mul_add(other.0, -product);
        two_sum(product, rest + (self.0 * other.1 + self.1 * other.0))
    }
}

impl Div for Pair {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        // Long division by three digits.
        let first = self.0 / other.0;
        let rest = self - other * first.into();
        let second = rest.0 / other.0;
        let rest = rest - other * second.into();
        two_sum(first, second) + (rest.0 / other.0).into()
    }
}

const LN2: Pair = Pair(std::f64::consts::LN_2, 2.319_046_813_846_299_6e-17);
/// π/2 to 159 bits.
const HALF_PI: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    6.123_233_995_736_766e-17,
    -1.497_384_904_859_169_8e-33,
];

impl Pair {
    fn sqrt(self) -> Self {
        if self.0 == 0.0 {
            return self;
        }
        let root: Self = self.0.sqrt().into();
        (root + self / root) * 0.5.into()
    }

    fn scaled(self, power: i32) -> Self {
        let factor = 2.0_f64.powi(power);
        Self(self.0 * factor, self.1 * factor)
    }

    /// `Σ c_n self^n`, where `c_n / c_(n-1)` is `ratio(n)` and `c_0` is 1.
    fn series(self, terms: u32, ratio: impl Fn(f64) -> Pair) -> Self {
        let mut sum: Self = 1.0.into();
        for n in (1..=terms).rev() {
            sum = Self::from(1.0) + self * ratio(n.into()) * sum;
        }
        sum
    }

    /// For results that are normal numbers.
    fn exp(self) -> Self {
        let n = (self.0 / std::f64::consts::LN_2).round();
        let r = self - LN2 * n.into();
        let sum = r.series(30, |n| Self::from(1.0) / n.into());
        let half = (n * 0.5) as i32;
        sum.scaled(half).scaled(n as i32 - half)
    }

    fn artanh_small(self) -> Self {
        let z = self * self;
        self * z.series(60, |n| {
            Self::from(2.0 * n - 1.0) / Self::from(2.0 * n + 1.0)
        })
    }

    fn ln(self) -> Self {
        let mut e = 0;
        let mut m = self;
        while m.0 >= std::f64::consts::SQRT_2 {
            (m, e) = (m.scaled(-1), e + 1);
        }
        while m.0 < std::f64::consts::FRAC_1_SQRT_2 {
            (m, e) = (m.scaled(1), e - 1);
        }
        let s = (m - 1.0.into()) / (m + 1.0.into());
        LN2 * f64::from(e).into() + s.artanh_small().scaled(1)
    }

    fn ln_1p(self) -> Self {
        if self.0.abs() < 0.3 {
            (self / (self + 2.0.into())).artanh_small().scaled(1)
        } else {
            (self + 1.0.into()).ln()
        }
    }

    fn sin_cos(self) -> (Self, Self) {
        let k = (self.0 / HALF_PI[0]).round();
        let r = HALF_PI
            .iter()
            .fold(self, |r, &part| r - Self::from(k) * part.into());
        let z = -(r * r);
        let sin = r * z.series(18, |n| Self::from(1.0) / (2.0 * n * (2.0 * n + 1.0)).into());
        let cos = z.series(18, |n| Self::from(1.0) / (2.0 * n * (2.0 * n - 1.0)).into());
        match (k as i64).rem_euclid(4) {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }

    /// The angle of `(x, self)`: one Newton step from the platform's.
    fn atan2(self, x: Self) -> Self {
        let guess: Self = self.0.atan2(x.0).into();
        let (sin, cos) = guess.sin_cos();
        guess + (self * cos - x * sin) / (x * cos + self * sin)
    }

    fn sinh(self) -> Self {
        if self.0.abs() < 1.0 {
            let z = self * self;
            self * z.series(18, |n| Self::from(1.0) / (2.0 * n * (2.0 * n + 1.0)).into())
        } else {
            (self.exp() - (-self).exp()).scaled(-1)
        }
    }

    fn cosh(self) -> Self {
        (self.exp() + (-self).exp()).scaled(-1)
    }
}

/// `|got - want|` in units of the last place of `want`, a normal number.
fn error(got: f64, want: Pair) -> f64 {
    let ulp = f64::from_bits(want.0.abs().to_bits() & 0x7ff0_0000_0000_0000) * f64::EPSILON;
    (((Pair::from(got) - want).0) / ulp).abs()
}

/// Numbers of either sign whose magnitudes are spread evenly in logarithm
/// between two powers of two.
fn spread(low: i32, high: i32, count: u64) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| {
        let random = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let random = (random ^ random >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let exponent = low + ((random >> 33) % (high - low) as u64) as i32;
        let significand = 1.0 + (random << 12 >> 12) as f64 * 2.0_f64.powi(-52);
        let sign = if random >> 20 & 1 == 1 { -1.0 } else { 1.0 };
        sign * significand * 2.0_f64.powi(exponent)
    })
}

/// The largest error; fails beyond `limit` ulp.
fn check(
    name: &str,
    limit: f64,
    inputs: impl Iterator<Item = f64>,
    ours: fn(f64) -> f64,
    exact: impl Fn(Pair) -> Pair,
) {
    let mut worst = (0.0, 0.0);
    let mut seen = 0;
    for x in inputs {
        let want = exact(x.into());
        let error = error(ours(x), want);
        // NaN is the largest error of all.
        if error > worst.0 || error.is_nan() {
            worst = (error, x);
        }
        seen += 1;
    }
    println!("{name}: {:.3} ulp at {:e}", worst.0, worst.1);
    assert!(seen > 1000, "{name}: too few inputs");
    assert!(
        worst.0 < limit,
        "{name}({:e}) = {:e} is off by {} ulp",
        worst.1,
        ours(worst.1),
        worst.0
    );
}

const COUNT: u64 = 40_000;

#[test]
fn exponentials_are_within_their_bounds() {
    let inputs = || spread(-60, 9, COUNT).chain(spread(-3, 9, COUNT));
    check("exp", 1.5, inputs(), Number::exp, Pair::exp);
    let inputs = || spread(-60, 9, COUNT).chain(spread(-3, 9, COUNT));
    check("exp2", 1.5, inputs(), Number::exp2, |x| (x * LN2).exp());
}

#[test]
fn logarithms_are_within_their_bounds() {
    let inputs = || {
        spread(-1000, 1000, COUNT)
            .chain(spread(-2, 2, COUNT))
            .map(f64::abs)
            .chain(spread(-50, -1, COUNT).map(|x| 1.0 + x))
            .filter(|&x| x != 1.0)
    };
    check("log", 1.0, inputs(), Number::log, Pair::ln);
    check("log2", 1.0, inputs(), Number::log2, |x| x.ln() / LN2);
}

#[test]
fn circular_functions_are_within_their_bounds() {
    // The last ones are next to multiples of π/2, where they nearly vanish.
    let inputs = || {
        spread(-30, 16, COUNT)
            .chain((1..60_000).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_2))
            .chain([1.0e5, -1.0e5])
    };
    check("sin", 1.0, inputs(), Number::sin, |x| x.sin_cos().0);
    check("cos", 1.0, inputs(), Number::cos, |x| x.sin_cos().1);
    check("tan", 3.0, inputs(), Number::tan, |x| {
        let (sin, cos) = x.sin_cos();
        sin / cos
    });
}

#[test]
fn inverse_circular_functions_are_within_their_bounds() {
    let one = |x: f64| (Pair::from(1.0) - Pair::from(x)) * (Pair::from(1.0) + Pair::from(x));
    let unit = || {
        spread(-40, 0, COUNT)
            .chain(spread(-50, 0, COUNT).map(|x| (1.0 - x.abs()).copysign(x)))
            .filter(|x| x.abs() < 1.0 && *x != 0.0)
    };
    check("asin", 4.0, unit(), Number::asin, |x| {
        x.atan2(one(x.0).sqrt())
    });
    check("acos", 4.0, unit(), Number::acos, |x| {
        one(x.0).sqrt().atan2(x)
    });
    check(
        "atan",
        3.0,
        spread(-60, 60, COUNT).chain(spread(-3, 3, COUNT)),
        Number::atan,
        |x| x.atan2(1.0.into()),
    );
    for (y, x) in spread(-8, 8, COUNT).zip(spread(-7, 9, COUNT).skip(5)) {
        let error = error(Number::atan2(y, x), Pair::from(y).atan2(x.into()));
        assert!(error < 3.0, "atan2({y}, {x}) is off by {error} ulp");
    }
}

#[test]
fn hyperbolic_functions_are_within_their_bounds() {
    let inputs = || spread(-40, 9, COUNT).chain(spread(-4, 4, COUNT));
    check("sinh", 3.0, inputs(), Number::sinh, Pair::sinh);
    check("cosh", 2.5, inputs(), Number::cosh, Pair::cosh);
    check("tanh", 4.0, spread(-40, 4, COUNT), Number::tanh, |x| {
        x.sinh() / x.cosh()
    });
    let one = Pair::from(1.0);
    check(
        "asinh",
        4.0,
        spread(-40, 400, COUNT).chain(spread(-4, 40, COUNT)),
        Number::asinh,
        |x| {
            let a = if x.0 < 0.0 { -x } else { x };
            let value = (a + a * a / (one + (one + a * a).sqrt())).ln_1p();
            if x.0 < 0.0 { -value } else { value }
        },
    );
    let above = spread(-40, 400, COUNT)
        .chain(spread(-40, 40, COUNT))
        .map(|x| 1.0 + x.abs());
    check(
        "acosh",
        4.0,
        above.filter(|&x| x > 1.0),
        Number::acosh,
        |x| {
            let t = x - one;
            (t + (t * (t + 2.0.into())).sqrt()).ln_1p()
        },
    );
    let unit = spread(-40, 0, COUNT)
        .chain(spread(-50, 0, COUNT).map(|x| (1.0 - x.abs()).copysign(x)))
        .filter(|x| x.abs() < 1.0 && *x != 0.0);
    check("atanh", 4.0, unit, Number::atanh, |x| {
        let a = if x.0 < 0.0 { -x } else { x };
        let value = (a.scaled(1) / (one - a)).ln_1p().scaled(-1);
        if x.0 < 0.0 { -value } else { value }
    });
}

#[test]
fn powers_are_within_their_bound() {
    let mut worst = 0.0_f64;
    for (x, y) in spread(-30, 30, 4 * COUNT).zip(spread(-8, 7, 4 * COUNT).skip(3)) {
        let x = x.abs();
        let exponent = Pair::from(x).ln() * y.into();
        if exponent.0.abs() > 700.0 {
            continue;
        }
        let error = error(Number::pow(x, y), exponent.exp()) / (2.0 + y.abs() / 2.0);
        assert!(error < 1.0, "{x}^{y} is off by {error} times the bound");
        worst = worst.max(error);
    }
    println!("pow: {worst:.3} of its bound");
}

#[test]
fn special_values_are_those_of_the_single_functions() {
    const SPECIAL: [f32; 14] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -2.0,
        3.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        1.0e30,
        -1.0e30,
        1.0e-30,
        7.5,
    ];
    type Unary = (&'static str, fn(f32) -> f32, fn(f64) -> f64);
    let functions: [Unary; 24] = [
        ("exp", Number::exp, Number::exp),
        ("exp2", Number::exp2, Number::exp2),
        ("log", Number::log, Number::log),
        ("log2", Number::log2, Number::log2),
        ("sin", Number::sin, Number::sin),
        ("cos", Number::cos, Number::cos),
        ("tan", Number::tan, Number::tan),
        ("asin", Number::asin, Number::asin),
        ("acos", Number::acos, Number::acos),
        ("atan", Number::atan, Number::atan),
        ("sinh", Number::sinh, Number::sinh),
        ("cosh", Number::cosh, Number::cosh),
        ("tanh", Number::tanh, Number::tanh),
        ("asinh", Number::asinh, Number::asinh),
        ("acosh", Number::acosh, Number::acosh),
        ("atanh", Number::atanh, Number::atanh),
        ("sign", Number::sign, Number::sign),
        ("abs", Number::abs, Number::abs),
        ("neg", Number::neg, Number::neg),
        ("floor", Number::floor, Number::floor),
        ("ceil", Number::ceil, Number::ceil),
        ("trunc", Number::trunc, Number::trunc),
        ("round", Number::round, Number::round),
        ("sqrt", Number::sqrt, Number::sqrt),
    ];
    // The f32 ones are the rounded f64 ones, within a unit.
    let alike = |single: f32, double: f64| {
        let rounded = double as f32;
        let near = |x: f32| single == x && single.is_sign_negative() == x.is_sign_negative();
        if single.is_nan() || rounded.is_nan() {
            single.is_nan() && rounded.is_nan()
        } else {
            near(rounded) || near(rounded.next_up()) || near(rounded.next_down())
        }
    };
    for (name, single, double) in functions {
        for x in SPECIAL {
            let (single, double) = (single(x), double(x.into()));
            assert!(alike(single, double), "{name}({x}) = {single} and {double}");
        }
    }
    type Binary = (&'static str, fn(f32, f32) -> f32, fn(f64, f64) -> f64);
    let functions: [Binary; 5] = [
        ("pow", Number::pow, Number::pow),
        ("atan2", Number::atan2, Number::atan2),
        ("min", Number::min, Number::min),
        ("max", Number::max, Number::max),
        ("rem", Number::rem, Number::rem),
    ];
    for (name, single, double) in functions {
        for x in SPECIAL {
            for y in SPECIAL {
                // Their quotient's rounding decides the remainder of large numbers.
                if name == "rem" && x.abs() > 1.0e6 * y.abs() {
                    continue;
                }
                let (single, double) = (single(x, y), double(x.into(), y.into()));
                assert!(
                    alike(single, double),
                    "{name}({x}, {y}) = {single} and {double}"
                );
            }
        }
    }
    for x in SPECIAL {
        let wide = f64::from(x);
        assert_eq!(Number::to_i32(x), wide.to_i32(), "{x}");
        assert_eq!(Number::to_u32(x), wide.to_u32(), "{x}");
        for exponent in [-150, -30, -1, 0, 1, 30, 150, i32::MIN, i32::MAX] {
            let (single, double) = (x.ldexp(exponent), wide.ldexp(exponent));
            assert!(
                alike(single, double),
                "{x} 2^{exponent} = {single} and {double}"
            );
        }
    }
    assert_eq!(Number::ldexp(1.0_f64, -1074), f64::from_bits(1));
    assert_eq!(Number::ldexp(f64::from_bits(1), 1074), 1.0);
    for value in [0, 1, -1, i32::MIN, 0x0100_0001, 0x7fff_ff80] {
        assert_eq!(<f64 as Number>::from_i32(value).to_i32(), value);
    }
    for value in [0, 1, 0x0100_0001, 0x8000_0000, 0xffff_ff00] {
        assert_eq!(<f64 as Number>::from_u32(value).to_u32(), value);
    }
    // Beyond what f32 and the integers have both.
    assert_eq!(<f64 as Number>::from_i32(i32::MAX).to_i32(), 0x7fff_ff80);
    assert_eq!(<f64 as Number>::from_u32(u32::MAX).to_u32(), 0xffff_ff00);
}

//! Real functions in about 100 bits: the truth that results are measured by.
//!
//! Numbers are unevaluated sums of two `f64` ("double-double", Dekker 1971).
//! Nothing here shares code, series or library calls with the interpreter; the
//! library's `ln` and `atan` only start Newton iterations, whose result does
//! not depend on them.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::float::power_of_two;

/// The sum `head + tail`, where `head` is the `f64` nearest to it. The relative
/// error of each function here is below 2⁻⁸⁰ where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exact {
    head: f64,
    tail: f64,
}

const LN_2: Exact = Exact {
    head: std::f64::consts::LN_2,
    tail: 2.319_046_813_846_299_6e-17,
};
/// π.
pub(crate) const PI: Exact = Exact {
    head: std::f64::consts::PI,
    tail: 1.224_646_799_147_353_2e-16,
};
/// π/2 in three parts, for the reduction of angles.
const HALF_PI: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    6.123_233_995_736_766e-17,
    -1.497_384_904_859_169_8e-33,
];

/// Angles up to this are reduced with enough bits to spare.
const LARGEST_ANGLE: f64 = 1_048_576.0;

/// The exact sum of two numbers.
fn two_sum(a: f64, b: f64) -> Exact {
    let head = a + b;
    if !head.is_finite() {
        return Exact::new(head);
    }
    let b_part = head - a;
    Exact {
        head,
        tail: (a - (head - b_part)) + (b - b_part),
    }
}

/// The exact product of two numbers.
fn two_product(a: f64, b: f64) -> Exact {
    let head = a * b;
    if !head.is_finite() {
        return Exact::new(head);
    }
    Exact {
        head,
        tail: a.mul_add(b, -head),
    }
}

impl Exact {
    /// An `f64` as it is.
    #[must_use]
    pub const fn new(value: f64) -> Self {
        Self {
            head: value,
            tail: 0.0,
        }
    }

    /// The nearest `f64`.
    #[must_use]
    pub const fn head(self) -> f64 {
        self.head
    }

    /// What the head leaves, at most half a unit in its last place.
    #[must_use]
    pub const fn tail(self) -> f64 {
        self.tail
    }

    /// -1, 0 or 1; NaN for NaN.
    pub(crate) fn signum(self) -> f64 {
        if self.head == 0.0 {
            0.0
        } else {
            self.head.signum()
        }
    }

    pub(crate) fn is_finite(self) -> bool {
        self.head.is_finite()
    }

    fn less_than(self, other: f64) -> bool {
        (self - Self::new(other)).signum() < 0.0
    }

    pub(crate) fn abs(self) -> Self {
        if self.head < 0.0 { -self } else { self }
    }

    /// Times a power of two, which is exact.
    fn scale(self, power: f64) -> Self {
        Self {
            head: self.head * power,
            tail: self.tail * power,
        }
    }

    fn is_tiny(self) -> bool {
        self.head.abs() < power_of_two(-20)
    }

    /// The largest integer that is not greater.
    pub(crate) fn floor(self) -> Self {
        let head = self.head.floor();
        if head == self.head {
            two_sum(head, self.tail.floor())
        } else {
            Self::new(head)
        }
    }

    /// The integer part.
    pub(crate) fn trunc(self) -> Self {
        if self.head < 0.0 {
            -(-self).floor()
        } else {
            self.floor()
        }
    }

    /// The square root; NaN below zero.
    pub(crate) fn sqrt(self) -> Self {
        if self.head == 0.0 || !self.head.is_finite() || self.head < 0.0 {
            return Self::new(self.head.sqrt());
        }
        let root = self.head.sqrt();
        let rest = self - two_product(root, root);
        two_sum(root, rest.head / (2.0 * root))
    }

    /// `e^(self + k ln 2) - 1` without the subtraction's loss, for |self| ≤ 0.4.
    fn exp_minus_one_small(self) -> Self {
        let x = self.scale(power_of_two(-8));
        // Taylor's series; the next term is below 0.0014^14 / 15! of the first.
        let mut sum = Self::new(1.0);
        for n in (2..=14).rev() {
            sum = Self::new(1.0) + x * sum / Self::new(f64::from(n));
        }
        let mut result = x * sum;
        for _ in 0..8 {
            // (1 + r)² - 1.
            result = result.scale(2.0) + result * result;
        }
        result
    }

    /// `e^self - 1`.
    fn exp_minus_one(self) -> Self {
        if self.head.abs() <= 0.4 {
            self.exp_minus_one_small()
        } else {
            self.exp() - Self::new(1.0)
        }
    }

    /// `e^self`; limits beyond ±600.
    pub(crate) fn exp(self) -> Self {
        if self.head.is_nan() {
            return self;
        }
        if self.head.abs() > 600.0 {
            return Self::new(if self.head > 0.0 { f64::INFINITY } else { 0.0 });
        }
        let count = (self.head / LN_2.head).round();
        let rest = self - LN_2 * Self::new(count);
        (rest.exp_minus_one_small() + Self::new(1.0)).scale(power_of_two(count as i32))
    }

    /// `2^self`, exact for integers; limits beyond ±800.
    pub(crate) fn exp2(self) -> Self {
        if self.head.is_nan() {
            return self;
        }
        if self.head.abs() > 800.0 {
            return Self::new(if self.head > 0.0 { f64::INFINITY } else { 0.0 });
        }
        let count = self.head.round();
        let rest = (self - Self::new(count)) * LN_2;
        (rest.exp_minus_one_small() + Self::new(1.0)).scale(power_of_two(count as i32))
    }

    /// The natural logarithm; `-∞` at zero, NaN below.
    pub(crate) fn ln(self) -> Self {
        if self.head <= 0.0 || !self.head.is_finite() {
            return Self::new(self.head.ln());
        }
        // x = m · 2^k; then Halley's iteration on e^y = m, which triples the digits.
        let count = (self.head.to_bits() >> 52) as i32 - 1023;
        let mut count = f64::from(count);
        let mut m = self.scale(power_of_two(-(count as i32)));
        if m.head > std::f64::consts::SQRT_2 {
            count += 1.0;
            m = m.scale(0.5);
        }
        let start = Self::new(m.head.ln());
        let power = start.exp();
        let step = ((m - power) / (m + power)).scale(2.0);
        start + step + LN_2 * Self::new(count)
    }

    /// The binary logarithm; as [`ln`](Self::ln).
    pub(crate) fn log2(self) -> Self {
        self.ln() / LN_2
    }

    /// The sine and the cosine; NaN beyond [`LARGEST_ANGLE`].
    fn sin_cos(self) -> (Self, Self) {
        if self.head.is_nan() || self.head.abs() > LARGEST_ANGLE {
            return (Self::new(f64::NAN), Self::new(f64::NAN));
        }
        let count = (self.head / HALF_PI[0]).round();
        let rest = HALF_PI
            .iter()
            .fold(self, |rest, part| rest - two_product(count, *part));
        let square = rest * rest;
        // Taylor's series on |x| ≤ π/4: the next terms are below 1e-33.
        let (mut sin, mut cos) = (Self::new(1.0), Self::new(1.0));
        for n in (1..=14).rev() {
            let n = f64::from(2 * n);
            sin = Self::new(1.0) - square * sin / Self::new(n * (n + 1.0));
            cos = Self::new(1.0) - square * cos / Self::new(n * (n - 1.0));
        }
        let sin = rest * sin;
        match count.rem_euclid(4.0) as i32 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }

    pub(crate) fn sin(self) -> Self {
        self.sin_cos().0
    }

    pub(crate) fn cos(self) -> Self {
        self.sin_cos().1
    }

    pub(crate) fn tan(self) -> Self {
        let (sin, cos) = self.sin_cos();
        sin / cos
    }

    /// The angle in (-π/2, π/2) whose tangent this is.
    pub(crate) fn atan(self) -> Self {
        if !self.is_finite() {
            return Self::new(self.head.atan());
        }
        if self.is_tiny() {
            let square = self * self;
            let series = Self::new(1.0) / Self::new(3.0) - square / Self::new(5.0)
                + square * square / Self::new(7.0);
            return self - self * square * series;
        }
        // tan(y - start) by the addition theorem, so small that it is y - start.
        let start = Self::new(self.head.atan());
        let (sin, cos) = start.sin_cos();
        start + (self * cos - sin) / (cos + self * sin)
    }

    /// The angle of the point (`x`, `self`), in [-π, π].
    pub(crate) fn atan2(self, x: Self) -> Self {
        let (y, zero) = (self, Self::new(0.0));
        if x.head == 0.0 {
            return if y.head == 0.0 {
                zero
            } else if y.head > 0.0 {
                PI.scale(0.5)
            } else {
                -PI.scale(0.5)
            };
        }
        let angle = (y / x).atan();
        if x.head > 0.0 {
            angle
        } else if y.head.is_sign_negative() {
            angle - PI
        } else {
            angle + PI
        }
    }

    /// NaN outside [-1, 1].
    pub(crate) fn asin(self) -> Self {
        let one = Self::new(1.0);
        self.atan2(((one - self) * (one + self)).sqrt())
    }

    /// NaN outside [-1, 1].
    pub(crate) fn acos(self) -> Self {
        let one = Self::new(1.0);
        ((one - self) * (one + self)).sqrt().atan2(self)
    }

    pub(crate) fn sinh(self) -> Self {
        let grown = self.exp_minus_one();
        if !grown.is_finite() || self.head < -600.0 {
            return Self::new(self.head.sinh());
        }
        (grown + grown / (grown + Self::new(1.0))).scale(0.5)
    }

    pub(crate) fn cosh(self) -> Self {
        (self.exp() + (-self).exp()).scale(0.5)
    }

    pub(crate) fn tanh(self) -> Self {
        if self.head.abs() > 100.0 {
            return Self::new(self.head.signum());
        }
        let grown = self.scale(2.0).exp_minus_one();
        grown / (grown + Self::new(2.0))
    }

    pub(crate) fn asinh(self) -> Self {
        if self.is_tiny() {
            let square = self * self;
            let series = Self::new(1.0) / Self::new(6.0)
                - square * Self::new(3.0) / Self::new(40.0)
                + square * square * Self::new(15.0) / Self::new(336.0);
            return self - self * square * series;
        }
        let magnitude = self.abs();
        let result = (magnitude + (magnitude * magnitude + Self::new(1.0)).sqrt()).ln();
        if self.head < 0.0 { -result } else { result }
    }

    /// NaN below 1.
    pub(crate) fn acosh(self) -> Self {
        if self.less_than(1.0) {
            return Self::new(f64::NAN);
        }
        let one = Self::new(1.0);
        (self + ((self - one) * (self + one)).sqrt()).ln()
    }

    /// NaN outside (-1, 1).
    pub(crate) fn atanh(self) -> Self {
        if self.is_tiny() {
            let square = self * self;
            let series = Self::new(1.0) / Self::new(3.0)
                + square / Self::new(5.0)
                + square * square / Self::new(7.0);
            return self + self * square * series;
        }
        let one = Self::new(1.0);
        ((one + self) / (one - self)).ln().scale(0.5)
    }
}

impl Neg for Exact {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            head: -self.head,
            tail: -self.tail,
        }
    }
}

impl Add for Exact {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let heads = two_sum(self.head, other.head);
        if !heads.head.is_finite() {
            return heads;
        }
        let tails = two_sum(self.tail, other.tail);
        let sum = two_sum(heads.head, heads.tail + tails.head);
        two_sum(sum.head, sum.tail + tails.tail)
    }
}

impl Sub for Exact {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Exact {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = two_product(self.head, other.head);
        if !product.head.is_finite() {
            return product;
        }
        two_sum(
            product.head,
            product.tail + (self.head * other.tail + self.tail * other.head),
        )
    }
}

impl Div for Exact {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let quotient = self.head / other.head;
        if !quotient.is_finite() || other.head.is_infinite() {
            return Self::new(quotient);
        }
        let rest = self - other * Self::new(quotient);
        let second = rest.head / other.head;
        let rest = rest - other * Self::new(second);
        two_sum(quotient, second) + Self::new(rest.head / other.head)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Digits computed with 400 bits by another program.
    #[test]
    fn functions_have_thirty_digits() {
        let of = Exact::new;
        for (name, got, (head, tail)) in [
            (
                "exp 1",
                of(1.0).exp(),
                (std::f64::consts::E, 1.445_646_891_729_250_2e-16),
            ),
            (
                "exp -20.25",
                of(-20.25).exp(),
                (1.605_228_055_185_611_6e-9, -3.657_643_988_865_463e-26),
            ),
            (
                "ln 10",
                of(10.0).ln(),
                (std::f64::consts::LN_10, -2.170_756_223_382_249_4e-16),
            ),
            (
                "ln (1 + 2^-20)",
                of(1.0 + power_of_two(-20)).ln(),
                (9.536_738_616_591_883e-7, -3.549_983_446_429_538e-23),
            ),
            (
                "sin 1",
                of(1.0).sin(),
                (0.841_470_984_807_896_5, 1.776_845_092_935_536e-18),
            ),
            (
                "cos 3",
                of(3.0).cos(),
                (-0.989_992_496_600_445_4, -4.206_026_156_609_973_4e-17),
            ),
            (
                "sin 1000",
                of(1000.0).sin(),
                (0.826_879_540_532_002_5, 3.867_581_909_641_312e-17),
            ),
            (
                "tan 1",
                of(1.0).tan(),
                (1.557_407_724_654_902_3, -6.186_464_176_037_592e-17),
            ),
            (
                "atan 2",
                of(2.0).atan(),
                (1.107_148_717_794_090_4, 9.404_471_373_566_38e-17),
            ),
            (
                "atan 2^-10",
                of(power_of_two(-10)).atan(),
                (0.000_976_562_189_559_319_5, -2.903_306_254_994_262_6e-20),
            ),
            (
                "sinh 2^-12",
                of(power_of_two(-12)).sinh(),
                (0.000_244_140_627_425_319_2, -1.084_202_171_459_734_8e-20),
            ),
            (
                "cosh 2",
                of(2.0).cosh(),
                (3.762_195_691_083_631_4, 7.146_584_908_813_439e-17),
            ),
            (
                "tanh 0.5",
                of(0.5).tanh(),
                (0.462_117_157_260_009_74, 2.191_660_323_826_092_8e-17),
            ),
            (
                "asinh 0.25",
                of(0.25).asinh(),
                (0.247_466_461_547_263_46, -2.511_265_604_468_889_5e-18),
            ),
            (
                "asinh 2^-22",
                of(power_of_two(-22)).asinh(),
                (2.384_185_791_015_602_5e-7, -8.823_259_867_174_518e-24),
            ),
            (
                "acosh 1.5",
                of(1.5).acosh(),
                (0.962_423_650_119_206_9, -4.651_563_402_692_547e-17),
            ),
            (
                "atanh 0.75",
                of(0.75).atanh(),
                (0.972_955_074_527_656_6, 3.661_793_103_952_453_4e-17),
            ),
            (
                "atanh 2^-22",
                of(power_of_two(-22)).atanh(),
                (2.384_185_791_015_67e-7, 1.764_651_973_461_866_3e-23),
            ),
            (
                "asin 0.5",
                of(0.5).asin(),
                (std::f64::consts::FRAC_PI_6, -5.360_408_832_255_455e-17),
            ),
            (
                "acos -0.25",
                of(-0.25).acos(),
                (1.823_476_581_936_975_4, -9.871_709_403_898_677e-17),
            ),
            (
                "exp2 0.375",
                of(0.375).exp2(),
                (1.296_839_554_651_009_6, 2.538_250_279_488_831_5e-17),
            ),
            (
                "log2 3",
                of(3.0).log2(),
                (1.584_962_500_721_156, 1.057_978_124_011_255_4e-16),
            ),
            (
                "sqrt 2",
                of(2.0).sqrt(),
                (std::f64::consts::SQRT_2, -9.667_293_313_452_913e-17),
            ),
            (
                "1/3",
                of(1.0) / of(3.0),
                (1.0 / 3.0, 1.850_371_707_708_594e-17),
            ),
        ] {
            let difference = (got - of(head) - of(tail)).head().abs();
            assert!(
                difference <= 1e-28 * head.abs(),
                "{name}: {got:?}, off by {difference:e}"
            );
        }
    }

    #[test]
    fn sums_products_and_integers_are_exact() {
        let tiny = power_of_two(-149);
        let sum = Exact::new(1.0) + Exact::new(tiny);
        assert_eq!((sum.head(), sum.tail()), (1.0, tiny));
        let product = Exact::new(1.0 + power_of_two(-52)) * Exact::new(1.0 - power_of_two(-52));
        assert_eq!((product.head(), product.tail()), (1.0, -power_of_two(-104)));
        assert_eq!(Exact::new(-7.0).exp2(), Exact::new(power_of_two(-7)));
        assert_eq!(Exact::new(-2.5).floor(), Exact::new(-3.0));
        assert_eq!(
            (Exact::new(2.0) - Exact::new(tiny)).floor(),
            Exact::new(1.0)
        );
        assert_eq!(Exact::new(-2.5).trunc(), Exact::new(-2.0));
        assert!(Exact::new(-1.0).sqrt().head().is_nan());
        assert!(Exact::new(1.5).asin().head().is_nan() && Exact::new(2.0).atanh().head().is_nan());
    }
}

//! WGSL's accuracy table as arithmetic (§15.7.4, "Floating Point Accuracy").
//!
//! [`Table`] evaluates operations on intervals: what goes in is what a value
//! may be, what comes out is what the result may be by the table. Accuracies
//! "inherited from" an expression follow by evaluating that expression, which
//! stands in [`formulas`](super::formulas), with these operations.
//!
//! Rules that hold for every operation:
//! * Rounding is to either neighbour: "WGSL does not specify a rounding mode".
//! * "Any inputs or outputs of operations listed […] may be flushed to zero"
//!   (§15.7.2): an interval with subnormal numbers also has zero.
//! * Where a value may overflow, "the final result will be an indeterminate
//!   value" (§15.7.2, §15.7.3): anything. So it is where NaN or infinity goes
//!   in, and outside the range for which the table states an accuracy.

use super::exact::{Exact, PI};
use super::float::{FloatType, power_of_two};
use super::interval::{Interval, enclose, extremes};

/// What formulas are evaluated with: real numbers, or intervals that the table
/// allows.
pub trait Arithmetic {
    /// A number, or what it may be.
    type Value: Copy;

    /// A literal.
    fn constant(&self, value: f64) -> Self::Value;
    /// `x + y`.
    fn add(&self, x: Self::Value, y: Self::Value) -> Self::Value;
    /// `x - y`.
    fn sub(&self, x: Self::Value, y: Self::Value) -> Self::Value;
    /// `x * y`.
    fn mul(&self, x: Self::Value, y: Self::Value) -> Self::Value;
    /// `x / y`.
    fn div(&self, x: Self::Value, y: Self::Value) -> Self::Value;
    /// `-x`.
    fn neg(&self, x: Self::Value) -> Self::Value;
    /// `inverseSqrt(x)`.
    fn inverse_sqrt(&self, x: Self::Value) -> Self::Value;
    /// `sqrt(x)`.
    fn sqrt(&self, x: Self::Value) -> Self::Value;
    /// `exp(x)`.
    fn exp(&self, x: Self::Value) -> Self::Value;
    /// `exp2(x)`.
    fn exp2(&self, x: Self::Value) -> Self::Value;
    /// `log(x)`.
    fn log(&self, x: Self::Value) -> Self::Value;
    /// `log2(x)`.
    fn log2(&self, x: Self::Value) -> Self::Value;
    /// `sin(x)`.
    fn sin(&self, x: Self::Value) -> Self::Value;
    /// `cos(x)`.
    fn cos(&self, x: Self::Value) -> Self::Value;
    /// `atan2(y, x)`.
    fn atan2(&self, y: Self::Value, x: Self::Value) -> Self::Value;
    /// `floor(x)`.
    fn floor(&self, x: Self::Value) -> Self::Value;
    /// `trunc(x)`.
    fn trunc(&self, x: Self::Value) -> Self::Value;
    /// `clamp(x, 0.0, 1.0)`.
    fn saturate(&self, x: Self::Value) -> Self::Value;
    /// The sum of `terms`, in any order.
    fn sum(&self, terms: &[Self::Value]) -> Self::Value;
    /// `select(no, yes, x < 0.0)`.
    fn if_negative(&self, x: Self::Value, yes: Self::Value, no: Self::Value) -> Self::Value;
}

/// The accuracy table for one type.
#[derive(Clone, Copy, Debug)]
pub struct Table(pub FloatType);

impl Table {
    /// Adds zero where subnormal numbers may be flushed; anything where there
    /// is overflow.
    fn settle(self, low: f64, high: f64) -> Interval {
        let (mut low, mut high) = (low, high);
        if !(-self.0.largest() <= low && high <= self.0.largest()) {
            return Interval::ANY;
        }
        let smallest = self.0.smallest_normal();
        if low > 0.0 && low < smallest {
            low = 0.0;
        }
        if high < 0.0 && high > -smallest {
            high = 0.0;
        }
        Interval::new(low, high)
    }

    /// The table's "correctly rounded": either neighbour of an exact value.
    #[must_use]
    pub fn rounded(self, low: Exact, high: Exact) -> Interval {
        self.settle(self.0.below(low), self.0.above(high))
    }

    /// The table's errors in ULP of the exact value.
    #[must_use]
    pub fn ulps(self, low: Exact, high: Exact, ulps: f64) -> Interval {
        let (low, high) = (enclose(low).0, enclose(high).1);
        self.settle(low - ulps * self.0.ulp(low), high + ulps * self.0.ulp(high))
    }

    /// The table's absolute errors.
    #[must_use]
    pub fn absolute(self, low: Exact, high: Exact, error: f64) -> Interval {
        self.settle(enclose(low).0 - error, enclose(high).1 + error)
    }

    /// The error bound of one type or the other.
    #[must_use]
    pub fn of(self, f32: f64, f16: f64) -> f64 {
        match self.0 {
            FloatType::F32 => f32,
            FloatType::F16 => f16,
        }
    }

    /// An increasing function, by its ends.
    fn increasing(
        self,
        x: Interval,
        f: impl Fn(Exact) -> Exact,
        widen: impl Fn(Exact, Exact) -> Interval,
    ) -> Interval {
        if x.is_any() {
            return x;
        }
        match extremes(&x.ends().map(f)) {
            Some((low, high)) => widen(low, high),
            None => Interval::ANY,
        }
    }

    /// A function of two numbers whose extremes are at the corners.
    fn corners(
        self,
        x: Interval,
        y: Interval,
        f: impl Fn(Exact, Exact) -> Exact,
        widen: impl Fn(Exact, Exact) -> Interval,
    ) -> Interval {
        if x.is_any() || y.is_any() {
            return Interval::ANY;
        }
        let ([a, b], [c, d]) = (x.ends(), y.ends());
        match extremes(&[f(a, c), f(a, d), f(b, c), f(b, d)]) {
            Some((low, high)) => widen(low, high),
            None => Interval::ANY,
        }
    }

    /// `exp` and `exp2`: 3 + 2·|x| ULP, in `f16` 1 + 2·|x|.
    fn exponential(self, x: Interval, f: impl Fn(Exact) -> Exact) -> Interval {
        let ulps = self.of(3.0, 1.0) + 2.0 * x.magnitude();
        self.increasing(x, f, |low, high| self.ulps(low, high, ulps))
    }

    /// `log` and `log2`: within [0.5, 2] an absolute error of 2⁻²¹, in `f16` of
    /// 2⁻⁷, outside 3 ULP.
    fn logarithm(self, x: Interval, f: impl Fn(Exact) -> Exact) -> Interval {
        if x.is_any() || x.low <= 0.0 {
            return Interval::ANY;
        }
        let error = self.of(power_of_two(-21), power_of_two(-7));
        let near = |low, high| self.absolute(low, high, error);
        let far = |low, high| self.ulps(low, high, 3.0);
        let part = |low: f64, high: f64, near_one: bool| {
            let part = Interval::new(x.low.max(low), x.high.min(high));
            (part.low <= part.high).then(|| {
                if near_one {
                    self.increasing(part, &f, near)
                } else {
                    self.increasing(part, &f, far)
                }
            })
        };
        // A point at 0.5 or 2 is inside.
        let (below, above) = (0.5_f64.next_down(), 2.0_f64.next_up());
        [
            part(0.0, below, false),
            part(0.5, 2.0, true),
            part(above, f64::MAX, false),
        ]
        .into_iter()
        .flatten()
        .reduce(Interval::hull)
        .unwrap_or(Interval::ANY)
    }

    /// `sin` and `cos`: an absolute error of 2⁻¹¹, in `f16` of 2⁻⁷, within
    /// [-π, π].
    fn circular(self, x: Interval, f: impl Fn(Exact) -> Exact) -> Interval {
        // They are only evaluated at points and at points flushed to zero,
        // between which they are monotonic.
        if x.is_any() || (Exact::new(x.magnitude()) - PI).signum() > 0.0 {
            return Interval::ANY;
        }
        let is_narrow = x.low == x.high || x.magnitude() < self.0.smallest_normal();
        if !is_narrow {
            return Interval::new(-1.5, 1.5);
        }
        let error = self.of(power_of_two(-11), power_of_two(-7));
        self.increasing(x, f, |low, high| self.absolute(low, high, error))
    }

    /// `atan`: 4096 ULP, in `f16` 5.
    #[must_use]
    pub fn atan(self, x: Interval) -> Interval {
        self.increasing(x, Exact::atan, |low, high| {
            self.ulps(low, high, self.of(4096.0, 5.0))
        })
    }

    /// Whether all of `x` lies in ±[2^-e, 2^e], the range that the table states
    /// for divisors.
    fn is_moderate(self, x: Interval) -> bool {
        let smallest = self.0.smallest_normal();
        let largest = 1.0 / smallest;
        !x.is_any() && x.magnitude() <= largest && (x.low >= smallest || x.high <= -smallest)
    }
}

impl Arithmetic for Table {
    type Value = Interval;

    fn constant(&self, value: f64) -> Interval {
        self.rounded(Exact::new(value), Exact::new(value))
    }

    fn add(&self, x: Interval, y: Interval) -> Interval {
        self.corners(x, y, |x, y| x + y, |low, high| self.rounded(low, high))
    }

    fn sub(&self, x: Interval, y: Interval) -> Interval {
        self.add(x, y.negated())
    }

    fn mul(&self, x: Interval, y: Interval) -> Interval {
        self.corners(x, y, |x, y| x * y, |low, high| self.rounded(low, high))
    }

    fn div(&self, x: Interval, y: Interval) -> Interval {
        if !self.is_moderate(y) {
            return Interval::ANY;
        }
        self.corners(x, y, |x, y| x / y, |low, high| self.ulps(low, high, 2.5))
    }

    fn neg(&self, x: Interval) -> Interval {
        x.negated()
    }

    fn inverse_sqrt(&self, x: Interval) -> Interval {
        if x.is_any() || x.low <= 0.0 {
            return Interval::ANY;
        }
        self.increasing(
            x,
            |x| Exact::new(1.0) / x.sqrt(),
            |low, high| self.ulps(low, high, 2.0),
        )
    }

    fn sqrt(&self, x: Interval) -> Interval {
        self.div(Interval::point(1.0), self.inverse_sqrt(x))
    }

    fn exp(&self, x: Interval) -> Interval {
        self.exponential(x, Exact::exp)
    }

    fn exp2(&self, x: Interval) -> Interval {
        self.exponential(x, Exact::exp2)
    }

    fn log(&self, x: Interval) -> Interval {
        self.logarithm(x, Exact::ln)
    }

    fn log2(&self, x: Interval) -> Interval {
        self.logarithm(x, Exact::log2)
    }

    fn sin(&self, x: Interval) -> Interval {
        self.circular(x, Exact::sin)
    }

    fn cos(&self, x: Interval) -> Interval {
        self.circular(x, Exact::cos)
    }

    fn atan2(&self, y: Interval, x: Interval) -> Interval {
        let smallest = self.0.smallest_normal();
        let y_is_normal = !y.is_any() && (y.low >= smallest || y.high <= -smallest);
        if !y_is_normal || !self.is_moderate(x) {
            return Interval::ANY;
        }
        // Away from the origin and the cut: monotonic in both.
        self.corners(y, x, Exact::atan2, |low, high| {
            self.ulps(low, high, self.of(4096.0, 5.0))
        })
    }

    fn floor(&self, x: Interval) -> Interval {
        self.increasing(x, Exact::floor, |low, high| self.rounded(low, high))
    }

    fn trunc(&self, x: Interval) -> Interval {
        self.increasing(x, Exact::trunc, |low, high| self.rounded(low, high))
    }

    fn saturate(&self, x: Interval) -> Interval {
        if x.is_any() {
            return x;
        }
        self.settle(x.low.clamp(0.0, 1.0), x.high.clamp(0.0, 1.0))
    }

    fn sum(&self, terms: &[Interval]) -> Interval {
        // "An implementation may reassociate operations" (§15.7.5): the hull
        // over all ways to halve the terms, again and again.
        match *terms {
            [] => Interval::point(0.0),
            [one] => one,
            _ => {
                let subsets = 1_u32 << (terms.len() - 1);
                let part = |set: u32, inside: bool| -> Vec<Interval> {
                    let chosen = |index: &usize| (set >> index & 1 == 1) == inside;
                    (0..terms.len()).filter(chosen).map(|i| terms[i]).collect()
                };
                // The last term is never in the set: each split comes once.
                (1..subsets)
                    .map(|set| self.add(self.sum(&part(set, true)), self.sum(&part(set, false))))
                    .reduce(Interval::hull)
                    .unwrap_or(Interval::ANY)
            }
        }
    }

    fn if_negative(&self, x: Interval, yes: Interval, no: Interval) -> Interval {
        if x.is_any() {
            Interval::ANY
        } else if x.high < 0.0 {
            yes
        } else if x.low >= 0.0 {
            no
        } else {
            yes.hull(no)
        }
    }
}

/// Arithmetic on real numbers: what an operation means.
#[derive(Clone, Copy, Debug)]
pub struct Reals;

impl Arithmetic for Reals {
    type Value = Exact;

    fn constant(&self, value: f64) -> Exact {
        Exact::new(value)
    }
    fn add(&self, x: Exact, y: Exact) -> Exact {
        x + y
    }
    fn sub(&self, x: Exact, y: Exact) -> Exact {
        x - y
    }
    fn mul(&self, x: Exact, y: Exact) -> Exact {
        x * y
    }
    fn div(&self, x: Exact, y: Exact) -> Exact {
        x / y
    }
    fn neg(&self, x: Exact) -> Exact {
        -x
    }
    fn inverse_sqrt(&self, x: Exact) -> Exact {
        Exact::new(1.0) / x.sqrt()
    }
    fn sqrt(&self, x: Exact) -> Exact {
        x.sqrt()
    }
    fn exp(&self, x: Exact) -> Exact {
        x.exp()
    }
    fn exp2(&self, x: Exact) -> Exact {
        x.exp2()
    }
    fn log(&self, x: Exact) -> Exact {
        x.ln()
    }
    fn log2(&self, x: Exact) -> Exact {
        x.log2()
    }
    fn sin(&self, x: Exact) -> Exact {
        x.sin()
    }
    fn cos(&self, x: Exact) -> Exact {
        x.cos()
    }
    fn atan2(&self, y: Exact, x: Exact) -> Exact {
        y.atan2(x)
    }
    fn floor(&self, x: Exact) -> Exact {
        x.floor()
    }
    fn trunc(&self, x: Exact) -> Exact {
        x.trunc()
    }
    fn saturate(&self, x: Exact) -> Exact {
        if x.signum() < 0.0 {
            Exact::new(0.0)
        } else if (x - Exact::new(1.0)).signum() > 0.0 {
            Exact::new(1.0)
        } else {
            x
        }
    }
    fn sum(&self, terms: &[Exact]) -> Exact {
        terms.iter().fold(Exact::new(0.0), |sum, &term| sum + term)
    }
    fn if_negative(&self, x: Exact, yes: Exact, no: Exact) -> Exact {
        if x.signum() < 0.0 { yes } else { no }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const F32: Table = Table(FloatType::F32);

    fn point(x: f32) -> Interval {
        Interval::point(f64::from(x))
    }

    fn ulp_at(x: f64) -> f64 {
        FloatType::F32.ulp(x)
    }

    #[test]
    fn sums_and_products_round_to_either_neighbour() {
        let sum = F32.add(point(1.0), point(1e-10));
        assert_eq!(sum, Interval::new(1.0, f64::from(1.0_f32.next_up())));
        let sum = F32.sub(point(1.0), point(1e-30));
        assert_eq!(sum, Interval::new(f64::from(1.0_f32.next_down()), 1.0));
        assert_eq!(F32.add(point(1.0), point(2.0)), point(3.0));
        assert!(F32.mul(point(3e38), point(2.0)).is_any());
        // A subnormal product may be flushed.
        let product = F32.mul(point(1e-20), point(1e-20));
        assert!(product.low == 0.0 && product.contains(1e-40));
    }

    #[test]
    fn quotients_have_two_and_a_half_ulps_where_the_table_says() {
        let third = F32.div(point(1.0), point(3.0));
        let ulp = ulp_at(1.0 / 3.0);
        assert!(third.contains(1.0 / 3.0 + 2.49 * ulp) && !third.contains(1.0 / 3.0 + 2.51 * ulp));
        assert!(F32.div(point(1.0), point(0.0)).is_any());
        assert!(F32.div(point(1.0), point(3e38)).is_any());
        assert!(F32.div(point(1.0), Interval::new(-1.0, 1.0)).is_any());
    }

    #[test]
    fn inherited_roots_follow_from_the_definition() {
        // 1 / inverseSqrt(x): 2 ULP in, 2.5 ULP more; the relative size of a
        // ULP varies by two.
        let root = F32.sqrt(point(2.0));
        let (exact, ulp) = (2.0_f64.sqrt(), ulp_at(2.0_f64.sqrt()));
        assert!(root.contains(exact + 4.0 * ulp) && !root.contains(exact + 7.0 * ulp));
        assert!(F32.sqrt(point(0.0)).is_any() && F32.sqrt(point(-1.0)).is_any());
    }

    #[test]
    fn logarithms_change_their_bound_at_one_half_and_two() {
        let near = F32.log2(point(1.0));
        assert_eq!(near, Interval::new(-power_of_two(-21), power_of_two(-21)));
        let far = F32.log2(point(8.0));
        assert!(far.contains(3.0 + 3.0 * ulp_at(3.0)) && !far.contains(3.0 + 3.1 * ulp_at(3.0)));
        let both = F32.log2(Interval::new(1.0, 8.0));
        assert!(both.contains(0.0) && both.contains(3.0) && !both.contains(3.1));
        assert!(F32.log(point(0.0)).is_any());
    }

    #[test]
    fn angles_beyond_pi_are_not_judged() {
        assert!(F32.sin(point(4.0)).is_any());
        // The f32 nearest to π lies above it.
        assert!(F32.cos(point(std::f32::consts::PI)).is_any());
        let sine = F32.sin(point(1.0));
        assert!(
            sine.contains(1.0_f64.sin() + 0.000_48) && !sine.contains(1.0_f64.sin() + 0.000_49)
        );
    }

    #[test]
    fn sums_may_come_in_any_order() {
        let terms = [point(1e8), point(1.0), point(-1e8)];
        let sum = F32.sum(&terms);
        // (1e8 + 1) - 1e8 is 0 or 8; (1e8 - 1e8) + 1 is 1.
        assert!(sum.contains(0.0) && sum.contains(1.0) && sum.contains(8.0));
        assert!(!sum.contains(9.0) && !sum.contains(-1.0));
        assert_eq!(
            Reals.sum(&terms.map(|term| Exact::new(term.low))).head(),
            1.0
        );
    }
}

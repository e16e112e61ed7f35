//! Sets of real numbers that results may be.

use super::exact::Exact;

/// A closed interval of real numbers, or every value there is, NaN included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The smallest number.
    pub low: f64,
    /// The largest number.
    pub high: f64,
}

impl Interval {
    /// What WGSL leaves open.
    pub const ANY: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// One number; anything for infinity and NaN.
    #[must_use]
    pub fn point(x: f64) -> Self {
        Self::new(x, x)
    }

    /// From `low` to `high`; anything unless both are finite.
    #[must_use]
    pub fn new(low: f64, high: f64) -> Self {
        if low.is_finite() && high.is_finite() {
            Self { low, high }
        } else {
            Self::ANY
        }
    }

    /// Whether this is [`Interval::ANY`].
    #[must_use]
    pub fn is_any(self) -> bool {
        self == Self::ANY
    }

    /// Whether a value may be the result. NaN is only where anything is.
    #[must_use]
    pub fn contains(self, x: f64) -> bool {
        self.is_any() || self.low <= x && x <= self.high
    }

    /// The smallest interval that contains both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// The mirror image.
    #[must_use]
    pub fn negated(self) -> Self {
        Self {
            low: -self.high,
            high: -self.low,
        }
    }

    /// The largest magnitude in it.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Both ends as exact numbers.
    pub(crate) fn ends(self) -> [Exact; 2] {
        [Exact::new(self.low), Exact::new(self.high)]
    }
}

/// The `f64` at most an exact number, and the one at least it.
pub(crate) fn enclose(x: Exact) -> (f64, f64) {
    let head = x.head();
    if x.tail() < 0.0 {
        (head.next_down(), head)
    } else if x.tail() > 0.0 {
        (head, head.next_up())
    } else {
        (head, head)
    }
}

/// The smallest and the largest of several numbers; `None` if one is NaN or
/// infinite.
pub(crate) fn extremes(values: &[Exact]) -> Option<(Exact, Exact)> {
    let mut all = values.iter().copied();
    let first = all.next().filter(|value| value.is_finite())?;
    all.try_fold((first, first), |(low, high), value| {
        value.is_finite().then(|| {
            (
                if (value - low).signum() < 0.0 {
                    value
                } else {
                    low
                },
                if (value - high).signum() > 0.0 {
                    value
                } else {
                    high
                },
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_anything_contains_nan() {
        let unit = Interval::new(0.0, 1.0);
        assert!(unit.contains(0.5) && unit.contains(-0.0) && unit.contains(1.0));
        assert!(!unit.contains(1.0_f64.next_up()) && !unit.contains(f64::NAN));
        assert!(Interval::ANY.contains(f64::NAN) && Interval::ANY.contains(f64::INFINITY));
        assert!(Interval::new(0.0, f64::INFINITY).is_any() && Interval::point(f64::NAN).is_any());
        assert_eq!(unit.hull(Interval::point(-2.0)), Interval::new(-2.0, 1.0));
        assert!(unit.hull(Interval::ANY).is_any());
    }

    #[test]
    fn extremes_need_finite_numbers() {
        let of = |x| Exact::new(x);
        assert_eq!(
            extremes(&[of(2.0), of(-1.0), of(0.5)]),
            Some((of(-1.0), of(2.0)))
        );
        assert_eq!(extremes(&[of(1.0), of(f64::NAN)]), None);
        assert_eq!(extremes(&[of(f64::INFINITY), of(1.0)]), None);
    }
}

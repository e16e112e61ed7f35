//! The two floating-point types of WGSL, as sets of real numbers.

use super::exact::Exact;

/// A binary floating-point type: `f32` is IEEE 754's binary32, `f16` its binary16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FloatType {
    /// 32 bits.
    F32,
    /// 16 bits, kept in the low half of a word.
    F16,
}

/// `2^exponent`, for exponents of normal `f64`.
pub(crate) fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent.clamp(-1022, 1023) + 1023) as u64) << 52)
}

impl FloatType {
    /// Bits of the significand, the implicit one included.
    const fn digits(self) -> i32 {
        match self {
            Self::F32 => 24,
            Self::F16 => 11,
        }
    }

    /// Exponent of the smallest normal number.
    pub(crate) const fn smallest_exponent(self) -> i32 {
        match self {
            Self::F32 => -126,
            Self::F16 => -14,
        }
    }

    /// The smallest positive normal number.
    #[must_use]
    pub fn smallest_normal(self) -> f64 {
        power_of_two(self.smallest_exponent())
    }

    /// The largest finite number.
    #[must_use]
    pub fn largest(self) -> f64 {
        match self {
            Self::F32 => f64::from(f32::MAX),
            Self::F16 => 65504.0,
        }
    }

    /// Whether a number is subnormal: not zero, and smaller than any normal one.
    #[must_use]
    pub fn is_subnormal(self, x: f64) -> bool {
        x != 0.0 && x.abs() < self.smallest_normal()
    }

    /// The distance between the numbers of this type that surround `x`, taken
    /// on the side away from zero where `x` is itself one.
    fn quantum(self, x: f64) -> f64 {
        let exponent = ((x.to_bits() >> 52 & 0x7ff) as i32 - 1023).max(self.smallest_exponent());
        power_of_two(exponent - (self.digits() - 1))
    }

    /// WGSL's ULP (§15.7.4): the smallest distance of two different finite
    /// numbers of this type with `x` between them or equal to one of them.
    #[must_use]
    pub fn ulp(self, x: f64) -> f64 {
        let x = x.abs().min(self.largest());
        let quantum = self.quantum(x);
        // Below a power of two the numbers are twice as dense.
        let is_power = x.to_bits() & ((1 << 52) - 1) == 0;
        if is_power && x > self.smallest_normal() {
            quantum / 2.0
        } else {
            quantum
        }
    }

    /// The largest number of this type that is at most `x`; `-∞` below all.
    #[must_use]
    pub fn below(self, x: Exact) -> f64 {
        let head = x.head();
        if !head.is_finite() {
            return head;
        }
        let quantum = self.quantum(head);
        let mut value = (head / quantum).floor() * quantum;
        if value == head && x.tail() < 0.0 {
            // Just below a number of this type, hence below a power of two at
            // the finer distance.
            value = if value > 0.0 {
                value - self.ulp(value)
            } else {
                value - self.quantum(value)
            };
        }
        if value > self.largest() {
            self.largest()
        } else if value < -self.largest() {
            f64::NEG_INFINITY
        } else {
            value
        }
    }

    /// The smallest number of this type that is at least `x`; `∞` above all.
    #[must_use]
    pub fn above(self, x: Exact) -> f64 {
        -self.below(-x)
    }

    /// The nearest number of this type, of two the one with an even
    /// significand, as IEEE 754's default rounding has it.
    #[must_use]
    pub fn nearest(self, x: Exact) -> f64 {
        let head = x.head();
        if !head.is_finite() {
            return head;
        }
        let (below, above) = (self.below(x), self.above(x));
        if below == above {
            // Zeros keep their sign.
            return head;
        }
        // Beyond the largest number the next one counts as if it were finite.
        let beyond = power_of_two(match self {
            Self::F32 => 128,
            Self::F16 => 16,
        });
        let finite = |value: f64| {
            if value.is_infinite() {
                beyond.copysign(value)
            } else {
                value
            }
        };
        if below.is_infinite() && head < -beyond || above.is_infinite() && head > beyond {
            return f64::INFINITY.copysign(head);
        }
        // Neighbours and their middle are exact in f64.
        let middle = finite(below) / 2.0 + finite(above) / 2.0;
        let side = (x - Exact::new(middle)).signum();
        let value = if side < 0.0 {
            below
        } else if side > 0.0 {
            above
        } else {
            let quantum = finite(above) - finite(below);
            let is_even = |value: f64| (finite(value) / quantum) % 2.0 == 0.0;
            if is_even(below) { below } else { above }
        };
        if value == 0.0 {
            0.0_f64.copysign(head)
        } else {
            value
        }
    }

    /// The number that bits mean.
    #[must_use]
    pub fn decode(self, bits: u32) -> f64 {
        match self {
            Self::F32 => f64::from(f32::from_bits(bits)),
            Self::F16 => {
                let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
                let (exponent, fraction) = ((bits >> 10 & 31) as i32, f64::from(bits & 0x3ff));
                sign * match exponent {
                    0 => fraction * power_of_two(-24),
                    31 if fraction == 0.0 => f64::INFINITY,
                    31 => f64::NAN,
                    _ => (1.0 + fraction / 1024.0) * power_of_two(exponent - 15),
                }
            }
        }
    }

    /// The bits of a number of this type.
    #[must_use]
    pub fn encode(self, value: f64) -> u32 {
        match self {
            Self::F32 => (value as f32).to_bits(),
            Self::F16 => {
                let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
                let magnitude = value.abs();
                sign | if magnitude.is_nan() {
                    0x7e00
                } else if magnitude.is_infinite() {
                    0x7c00
                } else if magnitude < self.smallest_normal() {
                    (magnitude * power_of_two(24)) as u32
                } else {
                    let exponent = (magnitude.to_bits() >> 52) as i32 - 1023;
                    let fraction = (magnitude / power_of_two(exponent) - 1.0) * 1024.0;
                    ((exponent + 15) as u32) << 10 | fraction as u32
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_to_f32_is_that_of_the_processor() {
        let mut state = 1_u64;
        for _ in 0..200_000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            // All exponents of f32 and some beyond, many values near the middle.
            let exponent = (state >> 20) % 330 + 1023 - 170;
            let mut fraction = state >> 12;
            if state & 3 == 0 {
                fraction &= !((1 << 28) - 1);
            }
            let x = f64::from_bits(state << 63 | exponent << 52 | fraction & ((1 << 52) - 1));
            let nearest = FloatType::F32.nearest(Exact::new(x));
            assert_eq!((nearest as f32).to_bits(), (x as f32).to_bits(), "{x:e}");
            let (below, above) = (
                FloatType::F32.below(Exact::new(x)),
                FloatType::F32.above(Exact::new(x)),
            );
            assert!(below <= x && x <= above);
            if below.is_finite() && above.is_finite() && below != above {
                assert_eq!((below as f32).next_up(), above as f32, "{x:e}");
            }
        }
    }

    #[test]
    fn the_tail_decides_next_to_numbers_and_middles() {
        let f32 = FloatType::F32;
        let just_below = |x: f64| Exact::new(x) - Exact::new(power_of_two(-200));
        let just_above = |x: f64| Exact::new(x) + Exact::new(power_of_two(-200));
        assert_eq!(f32.below(just_below(1.0)), f64::from(1.0_f32.next_down()));
        assert_eq!(f32.above(just_below(1.0)), 1.0);
        assert_eq!(
            f32.below(just_below(-1.0)),
            f64::from((-1.0_f32).next_down())
        );
        assert_eq!(f32.above(just_above(1.0)), f64::from(1.0_f32.next_up()));
        let middle = 1.0 + power_of_two(-24);
        assert_eq!(f32.nearest(Exact::new(middle)), 1.0);
        assert_eq!(
            f32.nearest(just_above(middle)),
            f64::from(1.0_f32.next_up())
        );
        assert_eq!(f32.nearest(just_below(middle)), 1.0);
    }

    #[test]
    fn ulps_are_those_of_the_finer_side() {
        let f32 = FloatType::F32;
        assert_eq!(f32.ulp(1.0), power_of_two(-24));
        assert_eq!(f32.ulp(1.5), power_of_two(-23));
        assert_eq!(f32.ulp(0.0), power_of_two(-149));
        assert_eq!(f32.ulp(f32.smallest_normal()), power_of_two(-149));
        assert_eq!(f32.ulp(f64::INFINITY), power_of_two(104));
        assert_eq!(FloatType::F16.ulp(1.25), power_of_two(-10));
    }

    #[test]
    fn every_f16_is_decoded_and_encoded() {
        for bits in 0..=0xffff_u32 {
            let value = FloatType::F16.decode(bits);
            if value.is_nan() {
                assert!(bits & 0x7fff > 0x7c00);
                continue;
            }
            assert_eq!(FloatType::F16.encode(value), bits);
            assert_eq!(FloatType::F16.nearest(Exact::new(value)), value);
        }
        assert_eq!(FloatType::F16.decode(0x3c00), 1.0);
        assert_eq!(FloatType::F16.decode(0x7bff), 65504.0);
        assert_eq!(FloatType::F16.decode(0x0001), power_of_two(-24));
    }
}

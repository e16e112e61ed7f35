//! Floats of fewer than 32 bits, and the shared-exponent format.

/// An IEEE-like binary float with a 5-bit exponent of bias 15.
#[derive(Clone, Copy, Debug)]
pub(super) struct SmallFloat {
    /// Width of the mantissa in bits.
    mantissa_bits: u32,
    /// Whether a sign bit precedes the exponent. Unsigned floats clamp as
    /// OpenGL 4.6 §2.3.4.3 says, signed ones overflow as IEEE 754 says.
    signed: bool,
}

/// IEEE 754 binary16.
pub(super) const HALF: SmallFloat = SmallFloat {
    mantissa_bits: 10,
    signed: true,
};
/// The unsigned 11-bit float of `B10G11R11_UFLOAT_PACK32`.
pub(super) const UFLOAT11: SmallFloat = SmallFloat {
    mantissa_bits: 6,
    signed: false,
};
/// The unsigned 10-bit float of `B10G11R11_UFLOAT_PACK32`.
pub(super) const UFLOAT10: SmallFloat = SmallFloat {
    mantissa_bits: 5,
    signed: false,
};

/// What an exponent of 5 bits is biased by.
const BIAS: i32 = 15;
/// The exponent code of infinities and NaN.
const SPECIAL: u32 = 31;

impl SmallFloat {
    /// The code of +∞; larger magnitudes are NaN.
    pub(super) const fn infinity(self) -> u32 {
        SPECIAL << self.mantissa_bits
    }

    /// The bits of a code that are not its sign.
    pub(super) const fn magnitude(self, code: u32) -> u32 {
        code & ((1 << (self.mantissa_bits + 5)) - 1)
    }

    /// Whether the code has its sign bit set; unsigned floats have none.
    pub(super) const fn negative(self, code: u32) -> bool {
        self.signed && code >> (self.mantissa_bits + 5) & 1 == 1
    }

    /// The number a code stands for. Exact; NaN payloads are kept, bit for bit.
    pub(super) fn decode(self, code: u32) -> f32 {
        let sign = u32::from(self.negative(code)) << 31;
        let magnitude = self.magnitude(code);
        let to_f32 = 23 - self.mantissa_bits;
        let exponent = magnitude >> self.mantissa_bits;
        let bits = match exponent {
            // Subnormal: an integer count of the smallest positive value, which
            // `f32` holds as a normal number.
            0 => {
                let unit = (-(BIAS - 1) - self.mantissa_bits as i32 + 127) as u32;
                (magnitude as f32 * f32::from_bits(unit << 23)).to_bits()
            }
            SPECIAL => 0x7f80_0000 | (magnitude << to_f32),
            _ => (magnitude << to_f32) + ((127 - BIAS as u32) << 23),
        };
        f32::from_bits(sign | bits)
    }

    /// The nearest code, ties to even.
    pub(super) fn encode(self, value: f32) -> u32 {
        let bits = value.to_bits();
        let magnitude = bits & 0x7fff_ffff;
        let negative = bits >> 31 == 1;
        let from_f32 = 23 - self.mantissa_bits;
        if magnitude > 0x7f80_0000 {
            // A NaN must stay one when the low bits of its payload are cut.
            let payload = (magnitude & 0x007f_ffff) >> from_f32;
            let quiet = 1 << (self.mantissa_bits - 1);
            return self.sign(negative)
                | self.infinity()
                | if payload == 0 { quiet } else { payload };
        }
        if negative && !self.signed {
            return 0;
        }
        if magnitude == 0x7f80_0000 {
            return self.sign(negative) | self.infinity();
        }
        let rounded = self.round(magnitude);
        let largest = self.infinity() - 1;
        self.sign(negative)
            | if self.signed {
                rounded.min(self.infinity())
            } else {
                rounded.min(largest)
            }
    }

    /// The sign bit in place, for those that have one.
    const fn sign(self, negative: bool) -> u32 {
        if self.signed && negative {
            1 << (self.mantissa_bits + 5)
        } else {
            0
        }
    }

    /// Rounds the magnitude bits of a finite `f32` to a magnitude code, which
    /// may come out beyond [`SmallFloat::infinity`].
    fn round(self, magnitude: u32) -> u32 {
        let exponent = (magnitude >> 23) as i32 - 127;
        let from_f32 = 23 - self.mantissa_bits;
        if exponent >= 1 - BIAS {
            // Normal. A carry out of the mantissa moves into the exponent,
            // which is what rounding up to the next power of two means.
            let rebased = magnitude - ((127 - BIAS as u32) << 23);
            return shift_right_ties_even(rebased, from_f32);
        }
        // Subnormal: the significand is shifted to the fixed last place.
        let significand = if magnitude >> 23 == 0 {
            0
        } else {
            (magnitude & 0x007f_ffff) | 0x0080_0000
        };
        let shift = from_f32 + (1 - BIAS - exponent) as u32;
        // With 25 places or more nothing is left, not even half a unit.
        if shift > 24 {
            0
        } else {
            shift_right_ties_even(significand, shift)
        }
    }
}

/// `value / 2^shift` rounded to nearest, ties to even. `shift` is 1 to 31.
const fn shift_right_ties_even(value: u32, shift: u32) -> u32 {
    let quotient = value >> shift;
    let remainder = value & ((1 << shift) - 1);
    let half = 1 << (shift - 1);
    if remainder > half || (remainder == half && quotient & 1 == 1) {
        quotient + 1
    } else {
        quotient
    }
}

/// Mantissa bits of the shared-exponent format, N of its specification.
const SHARED_MANTISSA_BITS: i32 = 9;

/// `2^exponent`; the exponents used here are far inside the range of `f64`.
fn exp2(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// `mantissa · 2^(exponent − 15 − 9)`, exact in `f32`.
pub(super) fn decode_shared_exponent(mantissa: u32, exponent: u32) -> f32 {
    (f64::from(mantissa) * exp2(exponent as i32 - BIAS - SHARED_MANTISSA_BITS)) as f32
}

/// Three mantissas and their exponent, by the algorithm of OpenGL 4.6 core
/// profile, §8.5.2 "Encoding of Special Internal Formats".
pub(super) fn encode_shared_exponent(channels: [f32; 3]) -> ([u32; 3], u32) {
    // (2^9 − 1) / 2^9 · 2^(31 − 15)
    const LARGEST: f64 = 65408.0;
    let clamped = channels.map(|channel| {
        if channel.is_nan() {
            0.0
        } else {
            f64::from(channel).clamp(0.0, LARGEST)
        }
    });
    let largest = clamped[0].max(clamped[1]).max(clamped[2]);
    // floor(log2(x)) is the exponent field of a normal f64; every positive f32
    // is one, and 0 gives a value far below the lower bound.
    let log2 = (largest.to_bits() >> 52) as i32 - 1023;
    let mut exponent = log2.max(-BIAS - 1) + 1 + BIAS;
    // Exact: a product with a power of two, and the sum needs 25 bits.
    let mantissa = |channel: f64, exponent: i32| {
        (channel * exp2(BIAS + SHARED_MANTISSA_BITS - exponent) + 0.5).floor()
    };
    if mantissa(largest, exponent) >= 512.0 {
        exponent += 1;
    }
    (
        clamped.map(|channel| mantissa(channel, exponent) as u32),
        exponent as u32,
    )
}

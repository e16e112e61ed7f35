//! binary16 to binary32 and back, without branches so that loops over lanes
//! become vector code on every instruction set.

/// The value of binary16 bits (in the low half of `bits`).
#[inline(always)]
pub(crate) fn f16_to_f32(bits: u32) -> f32 {
    let sign = (bits & 0x8000) << 16;
    // Read as binary32 the magnitude has an exponent that is 112 too small.
    let magnitude = (bits & 0x7fff) << 13;
    let normal = magnitude + (112 << 23);
    // A subnormal one is what its mantissa adds to 2^-14. Multiplying would give
    // it as well, but processors take a hundred times as long with subnormals.
    let subnormal = f32::from_bits(magnitude + (113 << 23)) - f32::from_bits(113 << 23);
    let is_subnormal = super::mask(magnitude < (1 << 23));
    let finite = (subnormal.to_bits() & is_subnormal) | (normal & !is_subnormal);
    // Infinity and NaN keep their mantissa, and get an exponent of all ones. A
    // NaN becomes a quiet one, as in processors.
    let special = super::mask(magnitude >= 0x0f80_0000) & 0x7f80_0000;
    let quiet = super::mask(magnitude > 0x0f80_0000) & 0x0040_0000;
    f32::from_bits(finite | special | quiet | sign)
}

/// Rounds to the nearest binary16, ties to even; overflow gives infinity, NaN
/// stays NaN with what fits of its payload.
#[inline(always)]
pub(crate) fn f32_to_f16(value: f32) -> u32 {
    let bits = value.to_bits();
    let sign = (bits >> 16) & 0x8000;
    let magnitude = bits & 0x7fff_ffff;
    // Normal result: subtract the difference of the exponent biases and round
    // away the low 13 bits to even. A carry into the exponent is right, and
    // into the exponent of all ones gives infinity.
    let odd = (magnitude >> 13) & 1;
    let normal = magnitude.wrapping_sub(112 << 23).wrapping_add(0xfff + odd) >> 13;
    // Subnormal result: adding 0.5 aligns the mantissa so that the unit of the
    // sum is 2^-24, the unit of subnormal binary16; the addition rounds to even.
    let subnormal = (f32::from_bits(magnitude) + 0.5)
        .to_bits()
        .wrapping_sub(0x3f00_0000);
    let is_subnormal = super::mask(magnitude < (113 << 23));
    // From 65520 on, half way between the largest finite value and 2^16.
    let is_infinite = super::mask(magnitude >= 0x477f_f000);
    let is_nan = super::mask(magnitude > 0x7f80_0000);
    let finite = (subnormal & is_subnormal) | (normal & !is_subnormal);
    // A NaN becomes a quiet one with what fits of its payload.
    let special = 0x7c00 | (is_nan & (magnitude >> 13 & 0x3ff | 0x200));
    (finite & !is_infinite) | (special & is_infinite) | sign
}

#[cfg(test)]
mod tests {
    use super::{f16_to_f32, f32_to_f16};

    #[test]
    fn every_half_converts_and_returns() {
        for bits in 0..=u16::MAX {
            let reference = half::f16::from_bits(bits);
            let value = f16_to_f32(bits.into());
            if reference.is_nan() {
                assert!(value.is_nan());
                assert_eq!(f32_to_f16(value), u32::from(bits) | 0x200);
            } else {
                assert_eq!(value.to_bits(), reference.to_f32().to_bits());
                assert_eq!(f32_to_f16(value), u32::from(bits));
            }
        }
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        // Every pair of neighbours, at the midpoint and one unit to each side.
        for bits in 0..0x7c00_u16 {
            let low = half::f16::from_bits(bits).to_f64();
            let high = if bits == 0x7bff {
                65536.0
            } else {
                half::f16::from_bits(bits + 1).to_f64()
            };
            let middle = ((low + high) / 2.0) as f32;
            for value in [middle, middle.next_up(), middle.next_down(), -middle] {
                let expected = half::f16::from_f32(value).to_bits();
                assert_eq!(f32_to_f16(value), u32::from(expected), "{value}");
            }
        }
        assert_eq!(f32_to_f16(f32::INFINITY), 0x7c00);
        assert_eq!(f32_to_f16(f32::MIN_POSITIVE), 0);
        assert_eq!(f32_to_f16(-0.0), 0x8000);
    }
}

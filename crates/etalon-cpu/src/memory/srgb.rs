//! 8-bit sRGB codes by tables, with the bits of the codec of [`etalon_core::texel`].

use std::sync::LazyLock;

use etalon_core::Format;
use etalon_core::texel::{Texel, TexelCodes};

/// From here on linear values have codes above 0.
const FIRST: f32 = 1.0 / 8192.0;

/// Bits of a number below those that choose a bucket: of each octave there are 256.
const SHIFT: u32 = 15;

/// Buckets from [`FIRST`] to 1.
const BUCKETS: usize = 13 * 256;

/// What the transfer function comes to.
pub(crate) struct Tables {
    /// The linear value of each code, as bits.
    linear: [u32; 256],
    /// The least linear value of each code.
    least: [f32; 257],
    /// The code of the first value of each bucket; no bucket is so wide that it has
    /// more than one more.
    codes: [u8; BUCKETS + 1],
}

static TABLES: LazyLock<Box<Tables>> = LazyLock::new(|| {
    let code = |value: f32| {
        let texel = Texel::Float([value, 0.0, 0.0, 1.0]);
        Format::Rgba8UnormSrgb.encode_codes(texel).channels[0]
    };
    let mut tables = Box::new(Tables {
        linear: [0; 256],
        least: [f32::INFINITY; 257],
        codes: [0; BUCKETS + 1],
    });
    for (i, linear) in tables.linear.iter_mut().enumerate() {
        let codes = TexelCodes {
            channels: [i as u32, 0, 0, 0],
            exponent: 0,
        };
        let [value, ..] = Format::Rgba8UnormSrgb.decode_codes(codes).to_f32();
        *linear = value.to_bits();
    }
    tables.least[0] = f32::NEG_INFINITY;
    for i in 1..256 {
        // Positive numbers are in the order of their bits.
        let (mut below, mut from) = (0, 1.0_f32.to_bits());
        while from - below > 1 {
            let middle = below + (from - below) / 2;
            if code(f32::from_bits(middle)) >= i {
                from = middle;
            } else {
                below = middle;
            }
        }
        tables.least[i as usize] = f32::from_bits(from);
    }
    for (i, bucket) in tables.codes.iter_mut().enumerate() {
        let bits = FIRST.to_bits() + ((i as u32) << SHIFT);
        *bucket = code(f32::from_bits(bits)) as u8;
    }
    tables
});

/// The tables, which are made when they are first asked for.
pub(crate) fn tables() -> &'static Tables {
    &TABLES
}

impl Tables {
    /// The linear value of the low 8 bits, as bits.
    #[inline(always)]
    pub(crate) fn linear(&self, code: u32) -> u32 {
        self.linear[(code & 0xff) as usize]
    }

    /// The code of a linear value, given as bits.
    #[inline(always)]
    pub(crate) fn code(&self, linear: u32) -> u32 {
        let value = f32::from_bits(linear);
        // NaN becomes 0.
        let value = if value > FIRST { value } else { FIRST };
        let value = if value < 1.0 { value } else { 1.0 };
        let bucket = (value.to_bits() - FIRST.to_bits()) >> SHIFT;
        let code = u32::from(self.codes[(bucket as usize).min(BUCKETS)]);
        code + u32::from(value >= self.least[code as usize + 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every value near where codes change, and some of all others.
    #[test]
    fn tables_are_the_codec() {
        let tables = tables();
        let check = |value: f32| {
            let want = Format::Rgba8UnormSrgb
                .encode_codes(Texel::Float([value, 0.0, 0.0, 1.0]))
                .channels[0];
            assert_eq!(tables.code(value.to_bits()), want, "{value:e}");
        };
        for code in 1..256 {
            let bits = tables.least[code].to_bits();
            for near in bits - 40..bits + 40 {
                check(f32::from_bits(near));
            }
        }
        for i in 0..(1_u32 << 17) {
            check(f32::from_bits(i << 15 | i & 0x7fff));
        }
        for value in [FIRST, 1.0, -1.0, f32::NAN, f32::INFINITY, 2.0, 1e-40] {
            check(value);
        }
        for i in 0..BUCKETS {
            let (a, b) = (tables.codes[i], tables.codes[i + 1]);
            assert!(b - a <= 1, "bucket {i}");
        }
        for code in 0..256_u32 {
            let codes = TexelCodes {
                channels: [code, 0, 0, 0],
                exponent: 0,
            };
            let [want, ..] = Format::Rgba8UnormSrgb.decode_codes(codes).to_f32();
            assert_eq!(tables.linear(code), want.to_bits());
        }
    }
}

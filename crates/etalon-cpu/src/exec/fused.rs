//! `a * b + c`, rounded once.

/// How a product and a sum are rounded together.
///
/// The planes of triangles are evaluated so ([`crate::raster`]): every tier gives
/// the same bits, these are only two ways to them.
pub(crate) trait Fused: 'static {
    fn mul_add(a: f32, b: f32, c: f32) -> f32;
}

/// By the processor's instruction, in functions compiled for it.
#[cfg(target_arch = "x86_64")]
pub(crate) struct Hardware;

#[cfg(target_arch = "x86_64")]
impl Fused for Hardware {
    #[inline(always)]
    fn mul_add(a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

/// By way of `f64`, where there is no such instruction.
pub(crate) struct Software;

impl Fused for Software {
    #[inline(always)]
    fn mul_add(a: f32, b: f32, c: f32) -> f32 {
        // The product is exact. The sum is rounded to odd: if it is not exact, its
        // last bit is made 1, so that rounding it again never sees a tie that was
        // none (Boldo and Melquiond, Emulation of FMA and correctly rounded sums,
        // 2008). Its error is exact as well (Knuth's TwoSum).
        let product = f64::from(a) * f64::from(b);
        let c = f64::from(c);
        let sum = product + c;
        let part = sum - product;
        let error = (product - (sum - part)) + (c - part);
        let bits = sum.to_bits();
        let even = bits & 1 == 0;
        let away = (error > 0.0) == (sum > 0.0);
        // Neither where the sum is infinite or NaN: then so is the error.
        let inexact = (error > 0.0) | (error < 0.0);
        let odd = if away {
            bits.wrapping_add(1)
        } else {
            bits.wrapping_sub(1)
        };
        f64::from_bits(if inexact & even { odd } else { bits }) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_rounds_once() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        for i in 0..2_000_000_u32 {
            let (x, y) = (next(), next());
            let mut bits = [x as u32, (x >> 32) as u32, y as u32];
            if i % 2 == 0 {
                // Exponents that are near each other, so that sums cancel and tie.
                for (i, bits) in bits.iter_mut().enumerate() {
                    *bits = (*bits & 0x80ff_f001) | ((120 + (y >> (32 + 3 * i)) as u32 % 16) << 23);
                }
            }
            let [a, b, c] = bits.map(f32::from_bits);
            let (got, want) = (Software::mul_add(a, b, c), a.mul_add(b, c));
            assert!(
                got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(),
                "{a:e} * {b:e} + {c:e}: {got:e}, not {want:e}"
            );
        }
    }
}

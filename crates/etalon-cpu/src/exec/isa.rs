//! What instruction sets have that compilers do not find by themselves.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU32, AtomicU64};

use super::lanes::BLOCK;
use crate::num::{f16_to_f32, f32_to_f16};

/// Operations on blocks of lanes, in the instructions of one tier.
///
/// Every tier gives the same bits; these are only other ways to them.
///
/// # Safety
/// Functions of a tier may be called only where the processor has its
/// instructions: from handlers that [`super::tier`] made for that tier.
pub(crate) unsafe trait Isa: 'static {
    /// `base[index]`, each word read at once.
    ///
    /// # Safety
    /// All indices are below 2^31 and inside of what `base` points to.
    #[inline(always)]
    unsafe fn gather4(base: *const u32, index: [u32; BLOCK]) -> [u32; BLOCK] {
        let mut words = [0; BLOCK];
        for k in 0..BLOCK {
            // SAFETY: the caller's promise. Others may write the word.
            words[k] = unsafe { (*base.add(index[k] as usize).cast::<AtomicU32>()).load(Relaxed) };
        }
        words
    }

    /// `base[index]`, each word read at once.
    ///
    /// # Safety
    /// As for [`Isa::gather4`].
    #[inline(always)]
    unsafe fn gather8(base: *const u64, index: [u32; BLOCK]) -> [u64; BLOCK] {
        let mut words = [0; BLOCK];
        for k in 0..BLOCK {
            // SAFETY: as above.
            words[k] = unsafe { (*base.add(index[k] as usize).cast::<AtomicU64>()).load(Relaxed) };
        }
        words
    }

    /// The values of the binary16 in the low halves.
    #[inline(always)]
    fn from_halves(bits: [u32; BLOCK]) -> [f32; BLOCK] {
        let mut values = [0.0; BLOCK];
        for k in 0..BLOCK {
            values[k] = f16_to_f32(bits[k] & 0xffff);
        }
        values
    }

    /// The nearest binary16, ties to even.
    #[inline(always)]
    fn to_halves(values: [f32; BLOCK]) -> [u32; BLOCK] {
        let mut bits = [0; BLOCK];
        for k in 0..BLOCK {
            bits[k] = f32_to_f16(values[k]);
        }
        bits
    }
}

/// No more than the architecture's baseline.
pub(crate) struct Portable;

// SAFETY: portable code.
unsafe impl Isa for Portable {}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;
    use std::mem::transmute;

    use super::{BLOCK, Isa};

    pub(crate) struct Avx2;

    // SAFETY: AVX2 and F16C, which the tier has.
    unsafe impl Isa for Avx2 {
        #[inline(always)]
        fn from_halves(bits: [u32; BLOCK]) -> [f32; BLOCK] {
            // SAFETY: the instructions are there, see the trait; the types are
            // plain numbers of the same sizes.
            unsafe {
                let [low, high]: [__m256i; 2] = transmute(bits);
                let field = _mm256_set1_epi32(0xffff);
                let (low, high) = (_mm256_and_si256(low, field), _mm256_and_si256(high, field));
                // Packs within 128-bit lanes: 0-3, 8-11, 4-7, 12-15.
                let packed = _mm256_packus_epi32(low, high);
                let packed = _mm256_permute4x64_epi64::<0b11_01_10_00>(packed);
                transmute([
                    _mm256_cvtph_ps(_mm256_castsi256_si128(packed)),
                    _mm256_cvtph_ps(_mm256_extracti128_si256::<1>(packed)),
                ])
            }
        }

        #[inline(always)]
        fn to_halves(values: [f32; BLOCK]) -> [u32; BLOCK] {
            // SAFETY: as above.
            unsafe {
                let [low, high]: [__m256; 2] = transmute(values);
                transmute([low, high].map(|half| {
                    let half = _mm256_cvtps_ph::<{ _MM_FROUND_TO_NEAREST_INT }>(half);
                    _mm256_cvtepu16_epi32(half)
                }))
            }
        }
    }

    pub(crate) struct Avx512;

    // SAFETY: AVX-512 F, which the tier has.
    //
    // Gathers read each word whole, as an atomic load does: where a kernel races
    // with itself, a lane gets the old or the new word.
    unsafe impl Isa for Avx512 {
        #[inline(always)]
        unsafe fn gather4(base: *const u32, index: [u32; BLOCK]) -> [u32; BLOCK] {
            // SAFETY: as for AVX2, and the caller's promise.
            unsafe {
                let index: __m512i = transmute(index);
                transmute(_mm512_i32gather_epi32::<4>(index, base.cast()))
            }
        }

        #[inline(always)]
        unsafe fn gather8(base: *const u64, index: [u32; BLOCK]) -> [u64; BLOCK] {
            // SAFETY: as above.
            unsafe {
                let [low, high]: [__m256i; 2] = transmute(index);
                let low = _mm512_i32gather_epi64::<8>(low, base.cast());
                let high = _mm512_i32gather_epi64::<8>(high, base.cast());
                transmute([low, high])
            }
        }

        #[inline(always)]
        fn from_halves(bits: [u32; BLOCK]) -> [f32; BLOCK] {
            // SAFETY: as for AVX2.
            unsafe {
                let bits: __m512i = transmute(bits);
                transmute(_mm512_cvtph_ps(_mm512_cvtepi32_epi16(bits)))
            }
        }

        #[inline(always)]
        fn to_halves(values: [f32; BLOCK]) -> [u32; BLOCK] {
            // SAFETY: as for AVX2.
            unsafe {
                let values: __m512 = transmute(values);
                let half = _mm512_cvtps_ph::<{ _MM_FROUND_TO_NEAREST_INT }>(values);
                transmute(_mm512_cvtepu16_epi32(half))
            }
        }
    }
}

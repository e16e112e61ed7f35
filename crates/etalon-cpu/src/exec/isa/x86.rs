//! The instruction sets of x86-64.

use std::arch::x86_64::*;
use std::mem::transmute;

use super::{BLOCK, Isa};

/// What all tiers have.
macro_rules! prefetches {
    () => {
        #[inline(always)]
        fn prefetch(address: *const u8) {
            // SAFETY: a hint, which no address makes fail.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) };
        }
    };
}

/// Stores of the lower tiers.
macro_rules! stores_in_runs {
    () => {
        #[inline(always)]
        unsafe fn store4(words: *mut u32, index: [u32; BLOCK], bits: [u32; BLOCK]) {
            // SAFETY: the caller's promise.
            unsafe { store_runs(words, index, bits) };
        }

        #[inline(always)]
        unsafe fn store8(words: *mut u64, index: [u32; BLOCK], bits: [u64; BLOCK]) {
            // SAFETY: the caller's promise.
            unsafe { store_runs(words, index, bits) };
        }
    };
}

/// Loads and stores without gathers or permutations across registers. Gathers of
/// AVX2 are no faster.
macro_rules! with_sse2 {
    () => {
        #[inline(always)]
        unsafe fn load4(words: *const u32, _: usize, index: [u32; BLOCK]) -> [u32; BLOCK] {
            // SAFETY: the caller's promise.
            unsafe { load_runs(words, index) }
        }

        #[inline(always)]
        unsafe fn load8(words: *const u64, _: usize, index: [u32; BLOCK]) -> [u64; BLOCK] {
            // SAFETY: the caller's promise.
            unsafe { load_pairs(words, index) }
        }

        prefetches!();

        stores_in_runs!();

        #[inline(always)]
        fn split(words: [u64; BLOCK]) -> [[u16; BLOCK]; 4] {
            split_by_unpacking(words)
        }

        #[inline(always)]
        fn join(parts: [[u16; BLOCK]; 4]) -> [u64; BLOCK] {
            join_by_unpacking(parts)
        }
    };
}

/// What every processor of the architecture has.
pub(crate) struct Sse2;

// SAFETY: every x86-64 processor has SSE2.
unsafe impl Isa for Sse2 {
    with_sse2!();
}

/// AVX2 and F16C.
pub(crate) struct Avx2;

// SAFETY: AVX2 and F16C, which the tier has.
unsafe impl Isa for Avx2 {
    with_sse2!();

    #[inline(always)]
    unsafe fn load_halves(
        words: *const u64,
        count: usize,
        index: [u32; BLOCK],
        _: bool,
    ) -> [[f32; BLOCK]; 4] {
        // SAFETY: the instructions are there; the caller's promise.
        unsafe {
            let [low, high]: [__m256i; 2] = transmute(index);
            let [r, g, b, a] = eight_halves(words, count, low);
            let [r2, g2, b2, a2] = eight_halves(words, count, high);
            transmute([[r, r2], [g, g2], [b, b2], [a, a2]])
        }
    }

    #[inline(always)]
    fn floor(values: [f32; BLOCK]) -> [f32; BLOCK] {
        // SAFETY: the instructions are there, see the trait; the types are plain
        // numbers of the same sizes.
        unsafe {
            let [low, high]: [__m256; 2] = transmute(values);
            transmute([_mm256_floor_ps(low), _mm256_floor_ps(high)])
        }
    }

    #[inline(always)]
    fn from_halves(bits: [u16; BLOCK]) -> [f32; BLOCK] {
        // SAFETY: the instructions are there, see the trait; the types are
        // plain numbers of the same sizes.
        unsafe {
            let halves: [__m128i; 2] = transmute(bits);
            transmute([_mm256_cvtph_ps(halves[0]), _mm256_cvtph_ps(halves[1])])
        }
    }

    #[inline(always)]
    fn to_halves(values: [f32; BLOCK]) -> [u16; BLOCK] {
        const NEAREST: i32 = _MM_FROUND_TO_NEAREST_INT;
        // SAFETY: as above.
        unsafe {
            let [low, high]: [__m256; 2] = transmute(values);
            transmute([
                _mm256_cvtps_ph::<NEAREST>(low),
                _mm256_cvtps_ph::<NEAREST>(high),
            ])
        }
    }
}

/// 0 to 7.
///
/// # Safety
/// There is AVX2.
#[inline(always)]
unsafe fn steps() -> __m256i {
    // SAFETY: the caller's promise.
    unsafe { _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7) }
}

/// Of eight words of four 16-bit parts, the first two parts and the last two.
///
/// # Safety
/// There is AVX2; the words are there.
#[inline(always)]
unsafe fn parts_of_run(words: *const u64) -> [__m256i; 2] {
    // SAFETY: the caller's promise.
    unsafe {
        let (near, far) = (two_pairs::<4>(words), two_pairs::<4>(words.add(2)));
        parts_of_twos(
            _mm256_unpacklo_epi16(near, far),
            _mm256_unpackhi_epi16(near, far),
        )
    }
}

/// [`parts_of_run`] of every other word.
///
/// # Safety
/// There is AVX2; the words are there, and the one after the last.
#[inline(always)]
unsafe fn parts_of_every_other(words: *const u64) -> [__m256i; 2] {
    // SAFETY: the caller's promise.
    unsafe {
        // The upper word of each pair is left.
        let [a, b] = [two_pairs::<8>(words), two_pairs::<8>(words.add(2))];
        let [c, d] = [two_pairs::<8>(words.add(4)), two_pairs::<8>(words.add(6))];
        parts_of_twos(_mm256_unpacklo_epi16(a, c), _mm256_unpacklo_epi16(b, d))
    }
}

/// Two words and two more `FAR` from them. From memory, which costs no shuffle.
///
/// # Safety
/// There is AVX2; the words are there.
#[inline(always)]
unsafe fn two_pairs<const FAR: usize>(words: *const u64) -> __m256i {
    // SAFETY: the caller's promise.
    unsafe {
        let near = _mm256_castsi128_si256(_mm_loadu_si128(words.cast()));
        _mm256_inserti128_si256::<1>(near, _mm_loadu_si128(words.add(FAR).cast()))
    }
}

/// Of eight words, the first two parts and the last two, from each part of words 0
/// and 2 next to each other, and of words 1 and 3; in the upper halves of words 4
/// to 7.
///
/// The shuffles stay within halves of registers but for the last, of quarters:
/// what compilers make of others that cross takes three times as long.
///
/// # Safety
/// There is AVX2.
#[inline(always)]
unsafe fn parts_of_twos(even: __m256i, odd: __m256i) -> [__m256i; 2] {
    const QUARTERS: i32 = 0b11_01_10_00;
    // SAFETY: the caller's promise.
    unsafe {
        [
            _mm256_permute4x64_epi64::<QUARTERS>(_mm256_unpacklo_epi16(even, odd)),
            _mm256_permute4x64_epi64::<QUARTERS>(_mm256_unpackhi_epi16(even, odd)),
        ]
    }
}

/// The four binary16 of the words at eight indices: mostly of one row of a texture,
/// next to each other, every other one where it is halved, or some of them twice
/// where it is doubled.
///
/// # Safety
/// As for [`Isa::load8`], where there are AVX2 and F16C.
#[inline(always)]
unsafe fn eight_halves(words: *const u64, count: usize, index: __m256i) -> [__m256; 4] {
    // SAFETY: the caller's promise. What is read beyond the last index was seen to
    // be there.
    unsafe {
        let from = _mm256_broadcastd_epi32(_mm256_castsi256_si128(index));
        let first = _mm256_cvtsi256_si32(index) as u32 as usize;
        let beyond = _mm256_sub_epi32(index, from);
        let single = _mm256_cmpeq_epi32(beyond, steps());
        let double = _mm256_cmpeq_epi32(beyond, _mm256_add_epi32(steps(), steps()));
        if _mm256_movemask_epi8(single) == -1 {
            halves_of_parts(parts_of_run(words.add(first)))
        } else if first + 16 > count {
            halves_of_any(words, index)
        } else if _mm256_movemask_epi8(double) == -1 {
            halves_of_parts(parts_of_every_other(words.add(first)))
        } else if _mm256_testz_si256(beyond, _mm256_set1_epi32(!7)) == 1 {
            let [r, g, b, a] = halves_of_parts(parts_of_run(words.add(first)));
            [
                _mm256_permutevar8x32_ps(r, beyond),
                _mm256_permutevar8x32_ps(g, beyond),
                _mm256_permutevar8x32_ps(b, beyond),
                _mm256_permutevar8x32_ps(a, beyond),
            ]
        } else {
            halves_of_any(words, index)
        }
    }
}

/// The values of four binary16 each, by [`parts_of_run`].
///
/// # Safety
/// There are AVX2 and F16C.
#[inline(always)]
unsafe fn halves_of_parts(parts: [__m256i; 2]) -> [__m256; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let [red_green, blue_alpha] = parts;
        [
            _mm256_cvtph_ps(_mm256_castsi256_si128(red_green)),
            _mm256_cvtph_ps(_mm256_extracti128_si256::<1>(red_green)),
            _mm256_cvtph_ps(_mm256_castsi256_si128(blue_alpha)),
            _mm256_cvtph_ps(_mm256_extracti128_si256::<1>(blue_alpha)),
        ]
    }
}

/// The four binary16 of the words at any eight indices.
///
/// # Safety
/// As for [`Isa::load8`], where there are AVX2 and F16C.
#[inline(always)]
unsafe fn halves_of_any(words: *const u64, index: __m256i) -> [__m256; 4] {
    // SAFETY: the caller's promise; the types are plain numbers of the same sizes.
    unsafe {
        let index: [u32; RUN] = transmute(index);
        let mut pairs = [_mm_setzero_si128(); RUN / 2];
        for k in 0..RUN / 2 {
            pairs[k] = load_pair(words, index[2 * k], index[2 * k + 1]);
        }
        let [r, g, b, a] = parts_of_pairs(pairs);
        [
            _mm256_cvtph_ps(r),
            _mm256_cvtph_ps(g),
            _mm256_cvtph_ps(b),
            _mm256_cvtph_ps(a),
        ]
    }
}

/// AVX-512 F, BW, DQ and VL.
pub(crate) struct Avx512;

// SAFETY: the instructions are those that the tier has.
unsafe impl Isa for Avx512 {
    prefetches!();

    /// As [`load_near`], for the two halves at once.
    #[inline(always)]
    unsafe fn load4(words: *const u32, count: usize, index: [u32; BLOCK]) -> [u32; BLOCK] {
        const NEAR: usize = 16;
        // SAFETY: as for AVX2, and the caller's promise.
        unsafe {
            let lanes: __m512i = transmute(index);
            let (first, second, from) = starts(lanes);
            let beyond = _mm512_sub_epi32(lanes, from);
            let near = _mm512_set1_epi32(NEAR as i32);
            let far = _mm512_cmpge_epu32_mask(beyond, near);
            if far != 0 || first + NEAR > count || second + NEAR > count {
                let gathered = _mm512_i32gather_epi32::<4>(lanes, words.cast());
                return transmute::<__m512i, [u32; BLOCK]>(gathered);
            }
            let order = _mm512_mask_add_epi32(beyond, SECOND, beyond, near);
            let first = _mm512_loadu_si512(words.add(first).cast());
            let second = _mm512_loadu_si512(words.add(second).cast());
            transmute(_mm512_permutex2var_epi32(first, order, second))
        }
    }

    /// Mostly they are of two rows of a texture, next to each other: two loads and a
    /// permutation for each then cost less than a gather.
    #[inline(always)]
    unsafe fn load8(words: *const u64, count: usize, index: [u32; BLOCK]) -> [u64; BLOCK] {
        const NEAR: usize = 16;
        // SAFETY: as for AVX2, and the caller's promise.
        unsafe {
            let lanes: __m512i = transmute(index);
            let (first, second, from) = starts(lanes);
            let beyond = _mm512_sub_epi32(lanes, from);
            let far = _mm512_cmpge_epu32_mask(beyond, _mm512_set1_epi32(NEAR as i32));
            let low = _mm512_castsi512_si256(beyond);
            let high = _mm512_extracti64x4_epi64::<1>(beyond);
            if far != 0 || first + NEAR > count || second + NEAR > count {
                let [low, high]: [__m256i; 2] = transmute(lanes);
                return transmute::<[__m512i; 2], [u64; BLOCK]>([
                    _mm512_i32gather_epi64::<8>(low, words.cast()),
                    _mm512_i32gather_epi64::<8>(high, words.cast()),
                ]);
            }
            transmute([
                load_window(words.add(first), low),
                load_window(words.add(second), high),
            ])
        }
    }

    #[inline(always)]
    fn all_below(index: [u32; BLOCK], count: u32) -> bool {
        // SAFETY: as for AVX2.
        unsafe {
            let count = _mm512_set1_epi32(count as i32);
            _mm512_cmpge_epu32_mask(transmute::<[u32; BLOCK], __m512i>(index), count) == 0
        }
    }

    #[inline(always)]
    fn floor(values: [f32; BLOCK]) -> [f32; BLOCK] {
        const DOWN: i32 = _MM_FROUND_TO_NEG_INF;
        // SAFETY: as for AVX2.
        unsafe {
            let values: __m512 = transmute(values);
            transmute(_mm512_roundscale_ps::<DOWN>(values))
        }
    }

    #[inline(always)]
    unsafe fn store4(words: *mut u32, index: [u32; BLOCK], bits: [u32; BLOCK]) {
        // SAFETY: the caller's promise; the runs' last indices are of them.
        unsafe {
            if let Some((first, second)) = runs(index) {
                let [low, high]: [__m256i; 2] = transmute(bits);
                _mm256_storeu_si256(words.add(first).cast(), low);
                _mm256_storeu_si256(words.add(second).cast(), high);
            } else {
                store_runs(words, index, bits);
            }
        }
    }

    #[inline(always)]
    unsafe fn store8(words: *mut u64, index: [u32; BLOCK], bits: [u64; BLOCK]) {
        // SAFETY: as above.
        unsafe {
            if let Some((first, second)) = runs(index) {
                let [low, high]: [__m512i; 2] = transmute(bits);
                _mm512_storeu_si512(words.add(first).cast(), low);
                _mm512_storeu_si512(words.add(second).cast(), high);
            } else {
                store_runs(words, index, bits);
            }
        }
    }

    #[inline(always)]
    fn from_halves(bits: [u16; BLOCK]) -> [f32; BLOCK] {
        // SAFETY: as for AVX2.
        unsafe { transmute(_mm512_cvtph_ps(transmute::<[u16; BLOCK], __m256i>(bits))) }
    }

    #[inline(always)]
    fn to_halves(values: [f32; BLOCK]) -> [u16; BLOCK] {
        const NEAREST: i32 = _MM_FROUND_TO_NEAREST_INT;
        // SAFETY: as for AVX2.
        unsafe {
            let values: __m512 = transmute(values);
            transmute(_mm512_cvtps_ph::<NEAREST>(values))
        }
    }

    #[inline(always)]
    fn split(words: [u64; BLOCK]) -> [[u16; BLOCK]; 4] {
        // Two parts of every word at a time.
        const fn parts(first: u16) -> [u16; 32] {
            let (mut order, mut k) = ([0; 32], 0);
            while k < 16 {
                order[k] = 4 * k as u16 + first;
                order[k + 16] = 4 * k as u16 + first + 1;
                k += 1;
            }
            order
        }
        const LOW: [u16; 32] = parts(0);
        const HIGH: [u16; 32] = parts(2);
        // SAFETY: as for AVX2.
        unsafe {
            let [first, second]: [__m512i; 2] = transmute(words);
            transmute([
                _mm512_permutex2var_epi16(first, transmute::<[u16; 32], __m512i>(LOW), second),
                _mm512_permutex2var_epi16(first, transmute::<[u16; 32], __m512i>(HIGH), second),
            ])
        }
    }

    #[inline(always)]
    fn join(parts: [[u16; BLOCK]; 4]) -> [u64; BLOCK] {
        // Eight words at a time, from parts 0 and 1, and 2 and 3.
        const fn words(first: u16) -> [u16; 32] {
            let (mut order, mut k) = ([0; 32], 0);
            while k < 8 {
                let word = first + k as u16;
                order[4 * k] = word;
                order[4 * k + 1] = word + 16;
                order[4 * k + 2] = word + 32;
                order[4 * k + 3] = word + 48;
                k += 1;
            }
            order
        }
        const FIRST: [u16; 32] = words(0);
        const SECOND: [u16; 32] = words(8);
        // SAFETY: as for AVX2.
        unsafe {
            let [low, high]: [__m512i; 2] = transmute(parts);
            transmute([
                _mm512_permutex2var_epi16(low, transmute::<[u16; 32], __m512i>(FIRST), high),
                _mm512_permutex2var_epi16(low, transmute::<[u16; 32], __m512i>(SECOND), high),
            ])
        }
    }
}

/// Lanes of the second run.
const SECOND: __mmask16 = 0xff00;

/// The first index of each half of the lanes: as numbers, and in every lane of
/// its half. Not by way of memory, where the lanes may have come just now.
///
/// # Safety
/// There is AVX-512.
#[inline(always)]
unsafe fn starts(lanes: __m512i) -> (usize, usize, __m512i) {
    // SAFETY: the caller's promise.
    unsafe {
        let high = _mm512_extracti64x4_epi64::<1>(lanes);
        let first = _mm512_cvtsi512_si32(lanes) as u32 as usize;
        let second = _mm256_cvtsi256_si32(high) as u32 as usize;
        let from = _mm512_broadcastd_epi32(_mm512_castsi512_si128(lanes));
        let from = _mm512_mask_broadcastd_epi32(from, SECOND, _mm256_castsi256_si128(high));
        (first, second, from)
    }
}

/// Where two runs of words next to each other begin, if the indices are such.
///
/// # Safety
/// There is AVX-512.
#[inline(always)]
unsafe fn runs(index: [u32; BLOCK]) -> Option<(usize, usize)> {
    const STEPS: [u32; BLOCK] = [0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7];
    // SAFETY: the caller's promise; the types are plain numbers of the same sizes.
    unsafe {
        let lanes: __m512i = transmute(index);
        let (first, second, from) = starts(lanes);
        let runs = _mm512_add_epi32(from, transmute::<[u32; BLOCK], __m512i>(STEPS));
        (_mm512_cmpneq_epi32_mask(runs, lanes) == 0).then_some((first, second))
    }
}

/// Eight of the sixteen words from an address on.
///
/// # Safety
/// There is AVX-512; the words are there, and all of `at` are below 16.
#[inline(always)]
unsafe fn load_window(words: *const u64, at: __m256i) -> __m512i {
    // SAFETY: the caller's promise.
    unsafe {
        let low = _mm512_loadu_si512(words.cast());
        let high = _mm512_loadu_si512(words.add(8).cast());
        _mm512_permutex2var_epi64(low, _mm512_cvtepu32_epi64(at), high)
    }
}

/// Words, two at a time into a register.
///
/// # Safety
/// As for [`Isa::load8`].
#[inline(always)]
unsafe fn load_pairs(words: *const u64, index: [u32; BLOCK]) -> [u64; BLOCK] {
    // SAFETY: the caller's promise.
    unsafe {
        let mut pairs = [_mm_setzero_si128(); BLOCK / 2];
        for k in 0..BLOCK / 2 {
            pairs[k] = load_pair(words, index[2 * k], index[2 * k + 1]);
        }
        transmute(pairs)
    }
}

/// Two words.
///
/// # Safety
/// As for [`Isa::load8`].
#[inline(always)]
unsafe fn load_pair(words: *const u64, low: u32, high: u32) -> __m128i {
    // SAFETY: the caller's promise.
    unsafe {
        let pair = _mm_loadl_epi64(words.add(low as usize).cast());
        let high = words.add(high as usize).cast();
        _mm_castpd_si128(_mm_loadh_pd(_mm_castsi128_pd(pair), high))
    }
}

/// Lanes that mostly are next to each other in a row of a texture.
const RUN: usize = 8;

/// Whether the indices from `first` on are of words next to each other.
#[inline(always)]
fn is_run(index: &[u32; BLOCK], first: usize) -> bool {
    let mut off = 0;
    for k in 0..RUN {
        off |= index[first + k].wrapping_sub(index[first]) ^ k as u32;
    }
    off == 0
}

/// Words, eight at once where they are next to each other.
///
/// # Safety
/// As for [`Isa::load4`].
#[inline(always)]
unsafe fn load_runs(words: *const u32, index: [u32; BLOCK]) -> [u32; BLOCK] {
    let mut bits = [0; BLOCK];
    for first in [0, RUN] {
        // SAFETY: the caller's promise; the run's last index is one of them.
        unsafe {
            if is_run(&index, first) {
                let run: [u32; RUN] = words.add(index[first] as usize).cast::<[u32; RUN]>().read();
                bits[first..first + RUN].copy_from_slice(&run);
            } else {
                for k in first..first + RUN {
                    bits[k] = words.add(index[k] as usize).read();
                }
            }
        }
    }
    bits
}

/// Writes words, eight at once where they are next to each other.
///
/// # Safety
/// As for [`Isa::store4`].
#[inline(always)]
unsafe fn store_runs<T: Copy>(words: *mut T, index: [u32; BLOCK], bits: [T; BLOCK]) {
    for first in [0, RUN] {
        // SAFETY: the caller's promise; the run's last index is one of them.
        unsafe {
            if is_run(&index, first) {
                let run = words.add(index[first] as usize);
                run.copy_from_nonoverlapping(bits.as_ptr().add(first), RUN);
            } else {
                for k in first..first + RUN {
                    words.add(index[k] as usize).write(bits[k]);
                }
            }
        }
    }
}

/// Parts of words, eight words at a time.
#[inline(always)]
fn split_by_unpacking(words: [u64; BLOCK]) -> [[u16; BLOCK]; 4] {
    // SAFETY: every x86-64 processor has SSE2; the types are plain numbers of
    // the same sizes.
    unsafe {
        let [first, second]: [[__m128i; RUN / 2]; 2] = transmute(words);
        let [r, g, b, a] = parts_of_pairs(first);
        let [r2, g2, b2, a2] = parts_of_pairs(second);
        transmute([[r, r2], [g, g2], [b, b2], [a, a2]])
    }
}

/// Parts of eight words, by interleaving words with those two further, then what is
/// next to each other.
///
/// # Safety
/// There is SSE2.
#[inline(always)]
unsafe fn parts_of_pairs(pairs: [__m128i; RUN / 2]) -> [__m128i; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        // Parts 0 and 1, and 2 and 3, of four words.
        let mut fours = [[_mm_setzero_si128(); 2]; 2];
        for four in 0..2 {
            let (first, second) = (pairs[2 * four], pairs[2 * four + 1]);
            let even = _mm_unpacklo_epi16(first, second);
            let odd = _mm_unpackhi_epi16(first, second);
            fours[four] = [_mm_unpacklo_epi16(even, odd), _mm_unpackhi_epi16(even, odd)];
        }
        let [near, far] = fours;
        [
            _mm_unpacklo_epi64(near[0], far[0]),
            _mm_unpackhi_epi64(near[0], far[0]),
            _mm_unpacklo_epi64(near[1], far[1]),
            _mm_unpackhi_epi64(near[1], far[1]),
        ]
    }
}

/// The reverse of [`split_by_unpacking`].
#[inline(always)]
fn join_by_unpacking(parts: [[u16; BLOCK]; 4]) -> [u64; BLOCK] {
    // SAFETY: as above.
    unsafe {
        let parts: [[__m128i; 2]; 4] = transmute(parts);
        let mut pairs = [_mm_setzero_si128(); BLOCK / 2];
        for half in 0..2 {
            let (a, b, c, d) = (
                parts[0][half],
                parts[1][half],
                parts[2][half],
                parts[3][half],
            );
            let (low, high) = (_mm_unpacklo_epi16(a, b), _mm_unpacklo_epi16(c, d));
            pairs[4 * half] = _mm_unpacklo_epi32(low, high);
            pairs[4 * half + 1] = _mm_unpackhi_epi32(low, high);
            let (low, high) = (_mm_unpackhi_epi16(a, b), _mm_unpackhi_epi16(c, d));
            pairs[4 * half + 2] = _mm_unpacklo_epi32(low, high);
            pairs[4 * half + 3] = _mm_unpackhi_epi32(low, high);
        }
        transmute(pairs)
    }
}

//! What instruction sets have that compilers do not find by themselves.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU32, AtomicU64};

use super::lanes::BLOCK;
use crate::num::{Number, f16_to_f32, f32_to_f16};

#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512, Sse2 as Baseline};

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use Portable as Baseline;

/// Operations on blocks of lanes, in the instructions of one tier.
///
/// Every tier gives the same bits; these are only other ways to them.
///
/// Reads and writes are of whole words, as relaxed atomic ones are: where a
/// kernel races with itself, a lane gets the old or the new word. x86-64 writes
/// and reads every aligned word of a vector at once.
///
/// # Safety
/// Functions of a tier may be called only where the processor has its
/// instructions: from handlers that [`super::tier`] made for that tier.
pub(crate) unsafe trait Isa: 'static {
    /// The words at `index`.
    ///
    /// # Safety
    /// `words` are `count` initialised words, fewer than 2^31, and all indices
    /// are below `count`.
    #[inline(always)]
    unsafe fn load4(words: *const u32, count: usize, index: [u32; BLOCK]) -> [u32; BLOCK] {
        let _ = count;
        let mut bits = [0; BLOCK];
        for k in 0..BLOCK {
            // SAFETY: the caller's promise. Others may write the word.
            bits[k] = unsafe { (*words.add(index[k] as usize).cast::<AtomicU32>()).load(Relaxed) };
        }
        bits
    }

    /// The words at `index`.
    ///
    /// # Safety
    /// As for [`Isa::load4`].
    #[inline(always)]
    unsafe fn load8(words: *const u64, count: usize, index: [u32; BLOCK]) -> [u64; BLOCK] {
        let _ = count;
        let mut bits = [0; BLOCK];
        for k in 0..BLOCK {
            // SAFETY: as above.
            bits[k] = unsafe { (*words.add(index[k] as usize).cast::<AtomicU64>()).load(Relaxed) };
        }
        bits
    }

    /// The four 16-bit parts of the words at `index`, from the lowest on.
    ///
    /// # Safety
    /// As for [`Isa::load4`].
    #[inline(always)]
    unsafe fn load_parts(
        words: *const u64,
        count: usize,
        index: [u32; BLOCK],
    ) -> [[u16; BLOCK]; 4] {
        // SAFETY: the caller's promise.
        Self::split(unsafe { Self::load8(words, count, index) })
    }

    /// The four binary16 of the words at `index`, from the lowest on. The last may
    /// be anything where it is not `wanted`.
    ///
    /// # Safety
    /// As for [`Isa::load4`].
    #[inline(always)]
    unsafe fn load_halves(
        words: *const u64,
        count: usize,
        index: [u32; BLOCK],
        wanted: bool,
    ) -> [[f32; BLOCK]; 4] {
        // SAFETY: the caller's promise.
        let [red, green, blue, alpha] = unsafe { Self::load_parts(words, count, index) };
        let last = if wanted {
            Self::from_halves(alpha)
        } else {
            [0.0; BLOCK]
        };
        [
            Self::from_halves(red),
            Self::from_halves(green),
            Self::from_halves(blue),
            last,
        ]
    }

    /// Writes the words at `index`; of the same ones, any.
    ///
    /// # Safety
    /// All indices are inside of `words`, which others only use word by word.
    #[inline(always)]
    unsafe fn store4(words: *mut u32, index: [u32; BLOCK], bits: [u32; BLOCK]) {
        for k in 0..BLOCK {
            // SAFETY: the caller's promise.
            unsafe { (*words.add(index[k] as usize).cast::<AtomicU32>()).store(bits[k], Relaxed) };
        }
    }

    /// Writes the words at `index`; of the same ones, any.
    ///
    /// # Safety
    /// As for [`Isa::store4`].
    #[inline(always)]
    unsafe fn store8(words: *mut u64, index: [u32; BLOCK], bits: [u64; BLOCK]) {
        for k in 0..BLOCK {
            // SAFETY: the caller's promise.
            unsafe { (*words.add(index[k] as usize).cast::<AtomicU64>()).store(bits[k], Relaxed) };
        }
    }

    /// Asks for what is at an address, which need not be anyone's: to be in the
    /// caches when it is read or written.
    #[inline(always)]
    fn prefetch(address: *const u8) {
        let _ = address;
    }

    /// Whether all of them are below `count`.
    #[inline(always)]
    fn all_below(index: [u32; BLOCK], count: u32) -> bool {
        let mut beyond = 0;
        for k in 0..BLOCK {
            beyond |= crate::num::mask(index[k] >= count);
        }
        beyond == 0
    }

    /// Rounded to integers, down.
    #[inline(always)]
    fn floor(values: [f32; BLOCK]) -> [f32; BLOCK] {
        let mut floors = [0.0; BLOCK];
        for k in 0..BLOCK {
            floors[k] = Number::floor_in_steps(values[k]);
        }
        floors
    }

    /// The values of binary16.
    #[inline(always)]
    fn from_halves(bits: [u16; BLOCK]) -> [f32; BLOCK] {
        halves_in_steps(bits)
    }

    /// The nearest binary16, ties to even.
    #[inline(always)]
    fn to_halves(values: [f32; BLOCK]) -> [u16; BLOCK] {
        let mut bits = [0; BLOCK];
        for k in 0..BLOCK {
            bits[k] = f32_to_f16(values[k]) as u16;
        }
        bits
    }

    /// The four 16-bit parts of words, from the lowest on.
    #[inline(always)]
    fn split(words: [u64; BLOCK]) -> [[u16; BLOCK]; 4] {
        let mut parts = [[0; BLOCK]; 4];
        for k in 0..BLOCK {
            for part in 0..4 {
                parts[part][k] = (words[k] >> (16 * part)) as u16;
            }
        }
        parts
    }

    /// Words of four 16-bit parts.
    #[inline(always)]
    fn join(parts: [[u16; BLOCK]; 4]) -> [u64; BLOCK] {
        let mut words = [0; BLOCK];
        for k in 0..BLOCK {
            for part in 0..4 {
                words[k] |= u64::from(parts[part][k]) << (16 * part);
            }
        }
        words
    }
}

/// No more than what every processor has.
#[cfg(any(test, not(target_arch = "x86_64")))]
pub(crate) struct Portable;

// SAFETY: portable code.
#[cfg(any(test, not(target_arch = "x86_64")))]
unsafe impl Isa for Portable {}

/// [`f16_to_f32`] of a block, mostly in fewer steps.
#[inline(always)]
fn halves_in_steps(bits: [u16; BLOCK]) -> [f32; BLOCK] {
    let mut odd = 0;
    for k in 0..BLOCK {
        let magnitude = (bits[k] & 0x7fff) as i16;
        let subnormal = (magnitude < 0x400) & (magnitude != 0);
        odd |= u16::from(subnormal | (magnitude >= 0x7c00));
    }
    let mut values = [0.0; BLOCK];
    if odd != 0 {
        for k in 0..BLOCK {
            values[k] = f16_to_f32(bits[k].into());
        }
    } else {
        for k in 0..BLOCK {
            // The sign stays at the top, exponent and mantissa come to where
            // those of binary32 are, with an exponent that is 112 too small.
            let top = (u32::from(bits[k]) << 16) as i32;
            let near = (top >> 3) as u32 & 0x8fff_e000;
            values[k] = f32::from_bits(near) * f32::from_bits((127 + 112) << 23);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    macro_rules! for_each_tier {
        ($check:ident) => {
            $check::<Portable>();
            $check::<Baseline>();
            #[cfg(target_arch = "x86_64")]
            {
                if crate::Tier::Avx2.is_available() {
                    $check::<Avx2>();
                }
                if crate::Tier::Avx512.is_available() {
                    $check::<Avx512>();
                }
            }
        };
    }

    /// Every block of neighbouring halves, so every half, by every tier.
    #[test]
    fn halves_are_those_of_the_scalar_way() {
        fn check<I: Isa>() {
            for first in (0..=u16::MAX).step_by(BLOCK) {
                let bits: [u16; BLOCK] = std::array::from_fn(|k| first + k as u16);
                let values = I::from_halves(bits);
                for k in 0..BLOCK {
                    let expected = f16_to_f32(bits[k].into());
                    assert_eq!(values[k].to_bits(), expected.to_bits(), "{:x}", bits[k]);
                }
                // The bit above the payload is set in what conversions give.
                let quiet = bits.map(|half| half | u16::from(half & 0x7fff > 0x7c00) << 9);
                assert_eq!(I::to_halves(values), quiet);
            }
        }
        for_each_tier!(check);
    }

    #[test]
    fn floors_and_limits_are_those_of_the_scalar_way() {
        fn check<I: Isa>() {
            let special = [
                0.0,
                -0.0,
                0.5,
                -0.5,
                1e-40,
                -1e-40,
                8_388_607.5,
                -8_388_607.5,
                8_388_609.0,
                2.5e9,
                -2.5e9,
                f32::MAX,
                f32::INFINITY,
                f32::NEG_INFINITY,
                -1.0,
                0.999_999_94,
            ];
            let floors = I::floor(special);
            for (floor, value) in floors.iter().zip(special) {
                assert_eq!(floor.to_bits(), value.floor().to_bits(), "of {value}");
            }
            for at in 0..BLOCK {
                let mut index = [6; BLOCK];
                assert!(I::all_below(index, 7) && !I::all_below(index, 6));
                for beyond in [7, 1 << 31, u32::MAX] {
                    index[at] = beyond;
                    assert!(!I::all_below(index, 7), "{beyond} at {at}");
                }
            }
        }
        for_each_tier!(check);
    }

    /// Every half as each of the four of a word, among ordinary ones and among its like.
    #[test]
    fn texels_of_halves_are_those_of_the_scalar_way() {
        fn check<I: Isa>() {
            const ORDINARY: u64 = 0x3c00_0000_b555_7bff;
            for bits in 0..=u16::MAX {
                let part = usize::from(bits % 4);
                let shift = 16 * part as u32;
                let odd = ORDINARY & !(0xffff << shift) | u64::from(bits) << shift;
                let mut words = [ORDINARY; BLOCK];
                words[usize::from(bits / 4 % 16)] = odd;
                for words in [words, [odd; BLOCK]] {
                    let index = std::array::from_fn(|k| k as u32);
                    // SAFETY: all indices are below the count; the tier is there.
                    let halves = unsafe { I::load_halves(words.as_ptr(), BLOCK, index, true) };
                    for (part, values) in halves.iter().enumerate() {
                        for (k, value) in values.iter().enumerate() {
                            let expected = f16_to_f32((words[k] >> (16 * part)) as u32 & 0xffff);
                            assert_eq!(value.to_bits(), expected.to_bits(), "{bits:x} in {part}");
                        }
                    }
                }
            }
        }
        for_each_tier!(check);
    }

    #[test]
    fn words_are_taken_apart_and_put_together() {
        fn check<I: Isa>() {
            let words: [u64; BLOCK] =
                std::array::from_fn(|k| 0x0123_4567_89ab_cdef_u64.rotate_left(k as u32 * 7));
            let parts = I::split(words);
            for (part, lanes) in parts.iter().enumerate() {
                for (k, &lane) in lanes.iter().enumerate() {
                    assert_eq!(lane, (words[k] >> (16 * part)) as u16, "{part} of {k}");
                }
            }
            assert_eq!(I::join(parts), words);
        }
        for_each_tier!(check);
    }

    /// Runs, strides, equal indices and any order, at both ends of the words.
    #[test]
    fn words_are_read_and_written_where_the_indices_say() {
        fn check<I: Isa>() {
            const COUNT: usize = 67;
            let last = COUNT as u32 - 1;
            let orders: [[u32; BLOCK]; 10] = [
                std::array::from_fn(|k| k as u32),
                std::array::from_fn(|k| 20 + k as u32 / 2),
                std::array::from_fn(|k| (20 + k as u32 / 2).min(23)),
                std::array::from_fn(|k| last - 15 + k as u32),
                std::array::from_fn(|k| k as u32 * 2),
                std::array::from_fn(|k| last - 30 + k as u32 * 2),
                std::array::from_fn(|k| (k as u32 % 8) + 40 * (k as u32 / 8)),
                std::array::from_fn(|k| (k as u32 * 29) % COUNT as u32),
                [last; BLOCK],
                std::array::from_fn(|k| last - k as u32),
            ];
            let words4: [u32; COUNT] =
                std::array::from_fn(|k| 0x9e37_79b9_u32.rotate_left(k as u32));
            let words8 = words4.map(|word| u64::from(word) << 32 | u64::from(!word));
            for index in orders {
                let four = index.map(|at| words4[at as usize]);
                let eight = index.map(|at| words8[at as usize]);
                let (mut to4, mut to8) = ([0; COUNT], [0; COUNT]);
                // SAFETY: all indices are below the count; the tier is there.
                unsafe {
                    assert_eq!(I::load4(words4.as_ptr(), COUNT, index), four);
                    assert_eq!(I::load8(words8.as_ptr(), COUNT, index), eight);
                    let parts = I::load_parts(words8.as_ptr(), COUNT, index);
                    assert_eq!(parts, I::split(eight));
                    let halves = I::load_halves(words8.as_ptr(), COUNT, index, true);
                    for (values, part) in halves.iter().zip(parts) {
                        assert_eq!(
                            values.map(f32::to_bits),
                            I::from_halves(part).map(f32::to_bits)
                        );
                    }
                    I::store4(to4.as_mut_ptr(), index, four);
                    I::store8(to8.as_mut_ptr(), index, eight);
                }
                for at in 0..COUNT {
                    let named = index.contains(&(at as u32));
                    assert_eq!(to4[at], if named { words4[at] } else { 0 });
                    assert_eq!(to8[at], if named { words8[at] } else { 0 });
                }
            }
        }
        for_each_tier!(check);
    }
}

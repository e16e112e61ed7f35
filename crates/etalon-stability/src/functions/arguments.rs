//! The numbers that functions are given.

/// Numbers of every exponent and both signs, ends of what functions take, and what are
/// no numbers.
pub(super) fn numbers() -> Vec<f32> {
    let bits = (0..=255_u32).flat_map(|exponent| {
        let mantissas = [0, 1, 0x2a_aaaa, 0x7f_e000, 0x7f_ffff];
        mantissas.map(|mantissa| exponent << 23 | mantissa)
    });
    let mut numbers: Vec<f32> = bits
        .flat_map(|bits| [bits, bits | 1 << 31].map(f32::from_bits))
        .collect();
    // In the range of exponents and of shares.
    numbers.extend((-640..=640).map(|i| i as f32 * 0.3125));
    numbers.extend((-40..=140).map(|i| i as f32 / 100.0));
    numbers
}

/// Four numbers for each texel; every number is the first of one.
pub(super) fn arguments() -> Vec<[f32; 4]> {
    let numbers = numbers();
    let at = |index: usize| numbers[index % numbers.len()];
    (0..numbers.len())
        .map(|i| [at(i), at(i * 7 + 3), at(i * 13 + 5), at(i * 29 + 11)])
        .collect()
}

/// A row of the arguments' image.
pub(super) const WIDTH: u32 = 64;

/// In place of arguments that are not taken: all functions take it.
pub(super) const FILLING: [f32; 4] = [1.0; 4];

//! Values that no renderer should hand over and every renderer does.

use etalon_core::image::ImageData;

use crate::frame::Frame;
use crate::trace::hash;

/// One texel in this many is replaced, independently in each image.
const RARITY: u32 = 16;

/// Half floats that are not ordinary numbers, and extremes of those that are.
const HALVES: [u16; 16] = [
    0x7e00, // NaN
    0xfe00, // NaN, negative
    0x7c01, // NaN, signalling
    0x7fff, // NaN, all ones
    0x7c00, // ∞
    0xfc00, // −∞
    0x7bff, // 65504, the largest
    0xfbff, // −65504
    0xbc00, // −1
    0xb800, // −0.5
    0x0001, // the least denormal
    0x8001, // minus that
    0x03ff, // the largest denormal
    0x0400, // the least normal
    0x8000, // −0
    0x0000, // 0
];

/// The same in single precision, with depths on and beyond both ends of the range.
const SINGLES: [u32; 16] = [
    0x7fc0_0000, // NaN
    0xffc0_0000, // NaN, negative
    0x7f80_0001, // NaN, signalling
    0x7f80_0000, // ∞
    0xff80_0000, // −∞
    0x7f7f_ffff, // the largest
    0xff7f_ffff, // minus that
    0x0000_0001, // the least denormal
    0x807f_ffff, // minus the largest denormal
    0x0080_0000, // the least normal
    0x8000_0000, // −0
    0x0000_0000, // 0: the sky
    0x3f80_0000, // 1: the near plane
    0x3f80_0001, // just beyond the near plane
    0x4000_0000, // 2
    0xbf00_0000, // −0.5
];

/// Replaces texels of every image in a fixed pseudo-random pattern.
///
/// Half the texels chosen get a special value in one channel, the others in all;
/// of the normals chosen, every fourth becomes zero with w left at 1. The first
/// texels of each image go through all the values in turn, so that small frames
/// have some as well.
pub(super) fn damage(frame: &mut Frame) {
    for (index, image) in [&mut frame.colour, &mut frame.normal, &mut frame.velocity]
        .into_iter()
        .enumerate()
    {
        replace::<2>(image, 1 + index as u32, |value| HALVES[value].to_le_bytes());
    }
    replace::<4>(&mut frame.depth, 4, |value| SINGLES[value].to_le_bytes());
    for (index, texel) in frame.normal.bytes.chunks_exact_mut(8).enumerate() {
        if hash(index as u32 ^ 0x5000_0000).is_multiple_of(4 * RARITY) {
            texel[..6].fill(0);
            texel[6..].copy_from_slice(&0x3c00_u16.to_le_bytes());
        }
    }
    // Eight bits have no special values but their extremes.
    for (index, texel) in frame.specular.bytes.chunks_exact_mut(4).enumerate() {
        let random = hash(index as u32 ^ 0x6000_0000);
        if random.is_multiple_of(RARITY) {
            texel.fill(if random & RARITY == 0 { 0 } else { 255 });
        }
    }
}

/// Writes special values of `N` bytes into an image with channels of that size.
fn replace<const N: usize>(image: &mut ImageData, seed: u32, special: impl Fn(usize) -> [u8; N]) {
    let channels = image.desc.format.channels() as usize;
    for (index, texel) in image.bytes.chunks_exact_mut(N * channels).enumerate() {
        let random = hash(index as u32 ^ (seed << 28));
        // Spread over the first rows, and leaving most of them as they were.
        let listed = index % 3 == 0 && index / 3 < 16;
        if !listed && !random.is_multiple_of(RARITY) {
            continue;
        }
        let value = if listed {
            index / 3
        } else {
            (random >> 8) as usize % 16
        };
        let whole = random & (1 << 16) != 0;
        let chosen = (random >> 20) as usize % channels;
        for (channel, bytes) in texel.chunks_exact_mut(N).enumerate() {
            if whole || channel == chosen {
                bytes.copy_from_slice(&special(value));
            }
        }
    }
}

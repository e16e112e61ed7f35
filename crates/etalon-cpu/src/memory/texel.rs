//! Texels to channels and back for many lanes at once.
//!
//! The common formats have loops without branches; they give the same bits as
//! the codec of [`etalon_core::texel`], which serves all others.

use etalon_core::Format;
use etalon_core::texel::Texel;

use super::srgb;
use crate::num::{f16_to_f32, f32_to_f16};

/// The words of `K` texels, low and high; formats of up to 8 bytes use the low one.
pub(crate) type Words<const K: usize> = [[u64; K]; 2];

/// Channels of `K` texels as bits: of `f32`, `i32` or `u32`.
pub(crate) type Channels<const K: usize> = [[u32; K]; 4];

// Loops as macros: a closure might not be inlined, and then would not be
// compiled for the instruction set of the handler around it.

macro_rules! each {
    ($wanted:expr, $out:expr, $k:ident, $channel:expr) => {
        if $wanted {
            for $k in 0..K {
                $out[$k] = $channel;
            }
        }
    };
}

macro_rules! words {
    ($out:expr, $k:ident, $word:expr) => {
        for $k in 0..K {
            $out[$k] = $word;
        }
    };
}

/// Reads the channels that `wanted` asks for; the others are left alone.
#[inline(always)]
pub(crate) fn decode<const K: usize>(
    format: Format,
    words: &Words<K>,
    wanted: [bool; 4],
    out: &mut Channels<K>,
) {
    let one = 1.0_f32.to_bits();
    let [low, high] = words;
    match format {
        Format::R32Float | Format::Depth32Float => {
            each!(wanted[0], out[0], k, low[k] as u32);
            fill(wanted, out, 1, 0, one);
        }
        Format::R32Uint | Format::R32Sint => {
            each!(wanted[0], out[0], k, low[k] as u32);
            fill(wanted, out, 1, 0, 1);
        }
        Format::Rg32Float => {
            each!(wanted[0], out[0], k, low[k] as u32);
            each!(wanted[1], out[1], k, (low[k] >> 32) as u32);
            fill(wanted, out, 2, 0, one);
        }
        Format::Rg32Uint | Format::Rg32Sint => {
            each!(wanted[0], out[0], k, low[k] as u32);
            each!(wanted[1], out[1], k, (low[k] >> 32) as u32);
            fill(wanted, out, 2, 0, 1);
        }
        Format::Rgba32Float | Format::Rgba32Uint | Format::Rgba32Sint => {
            each!(wanted[0], out[0], k, low[k] as u32);
            each!(wanted[1], out[1], k, (low[k] >> 32) as u32);
            each!(wanted[2], out[2], k, high[k] as u32);
            each!(wanted[3], out[3], k, (high[k] >> 32) as u32);
        }
        Format::R16Float => {
            each!(
                wanted[0],
                out[0],
                k,
                f16_to_f32(low[k] as u32 & 0xffff).to_bits()
            );
            fill(wanted, out, 1, 0, one);
        }
        Format::Rg16Float => {
            each!(
                wanted[0],
                out[0],
                k,
                f16_to_f32(low[k] as u32 & 0xffff).to_bits()
            );
            each!(
                wanted[1],
                out[1],
                k,
                f16_to_f32(low[k] as u32 >> 16).to_bits()
            );
            fill(wanted, out, 2, 0, one);
        }
        Format::Rgba16Float => {
            each!(
                wanted[0],
                out[0],
                k,
                f16_to_f32(low[k] as u32 & 0xffff).to_bits()
            );
            each!(
                wanted[1],
                out[1],
                k,
                f16_to_f32(low[k] as u32 >> 16).to_bits()
            );
            each!(
                wanted[2],
                out[2],
                k,
                f16_to_f32((low[k] >> 32) as u32 & 0xffff).to_bits()
            );
            each!(
                wanted[3],
                out[3],
                k,
                f16_to_f32((low[k] >> 32) as u32 >> 16).to_bits()
            );
        }
        Format::R8Unorm => {
            each!(wanted[0], out[0], k, unorm8(low[k] as u32));
            fill(wanted, out, 1, 0, one);
        }
        Format::Rg8Unorm => {
            each!(wanted[0], out[0], k, unorm8(low[k] as u32));
            each!(wanted[1], out[1], k, unorm8(low[k] as u32 >> 8));
            fill(wanted, out, 2, 0, one);
        }
        Format::Rgba8Unorm => {
            each!(wanted[0], out[0], k, unorm8(low[k] as u32));
            each!(wanted[1], out[1], k, unorm8(low[k] as u32 >> 8));
            each!(wanted[2], out[2], k, unorm8(low[k] as u32 >> 16));
            each!(wanted[3], out[3], k, unorm8(low[k] as u32 >> 24));
        }
        Format::Rgba8UnormSrgb => {
            let tables = srgb::tables();
            each!(wanted[0], out[0], k, tables.linear(low[k] as u32));
            each!(wanted[1], out[1], k, tables.linear(low[k] as u32 >> 8));
            each!(wanted[2], out[2], k, tables.linear(low[k] as u32 >> 16));
            each!(wanted[3], out[3], k, unorm8(low[k] as u32 >> 24));
        }
        _ => {
            for k in 0..K {
                let mut bytes = [0; 16];
                bytes[..8].copy_from_slice(&low[k].to_le_bytes());
                bytes[8..].copy_from_slice(&high[k].to_le_bytes());
                let channels = match format.decode(&bytes) {
                    Texel::Float(channels) => channels.map(f32::to_bits),
                    Texel::Sint(channels) => channels.map(|channel| channel as u32),
                    Texel::Uint(channels) => channels,
                };
                for (lanes, channel) in out.iter_mut().zip(channels) {
                    lanes[k] = channel;
                }
            }
        }
    }
}

/// Channels that the format has not, from `first` on: 0, 0, 1.
#[inline(always)]
fn fill<const K: usize>(
    wanted: [bool; 4],
    out: &mut Channels<K>,
    first: usize,
    zero: u32,
    one: u32,
) {
    for channel in first..4 {
        if wanted[channel] {
            out[channel] = [if channel == 3 { one } else { zero }; K];
        }
    }
}

/// The low 8 bits divided by 255, rounded once.
#[inline(always)]
pub(crate) fn unorm8(code: u32) -> u32 {
    // 1/255 is 257/65536 and its own 65536th part. The first product is exact
    // and the second within 2^-40 of the quotient, which is never so near to
    // half way between two numbers; dividing takes three times as long.
    const HIGH: f32 = 257.0 / 65536.0;
    const LOW: f32 = (1.0 / 255.0 / 65536.0) as f32;
    let code = (code & 0xff) as f32;
    (code * HIGH + code * LOW).to_bits()
}

/// Writes texels.
#[inline(always)]
pub(crate) fn encode<const K: usize>(format: Format, channels: &Channels<K>, out: &mut Words<K>) {
    let [r, g, b, a] = channels;
    match format {
        Format::R32Float | Format::R32Uint | Format::R32Sint => words!(out[0], k, u64::from(r[k])),
        Format::Rg32Float | Format::Rg32Uint | Format::Rg32Sint => {
            words!(out[0], k, pair(r[k], g[k]))
        }
        Format::Rgba32Float | Format::Rgba32Uint | Format::Rgba32Sint => {
            words!(out[0], k, pair(r[k], g[k]));
            words!(out[1], k, pair(b[k], a[k]));
        }
        Format::R16Float => words!(out[0], k, u64::from(half(r[k]))),
        Format::Rg16Float => words!(out[0], k, u64::from(half(r[k]) | (half(g[k]) << 16))),
        Format::Rgba16Float => words!(
            out[0],
            k,
            pair(
                half(r[k]) | (half(g[k]) << 16),
                half(b[k]) | (half(a[k]) << 16)
            )
        ),
        Format::R8Unorm => words!(out[0], k, u64::from(code8(r[k]))),
        Format::Rg8Unorm => words!(out[0], k, u64::from(code8(r[k]) | (code8(g[k]) << 8))),
        Format::Rgba8Unorm => {
            let mut codes = [0; K];
            unorm8_codes(channels, &mut codes);
            words!(out[0], k, u64::from(codes[k]));
        }
        Format::Rgba8UnormSrgb => {
            let tables = srgb::tables();
            words!(
                out[0],
                k,
                u64::from(
                    tables.code(r[k])
                        | tables.code(g[k]) << 8
                        | tables.code(b[k]) << 16
                        | code8(a[k]) << 24
                )
            );
        }
        _ => {
            for k in 0..K {
                let bits = [r[k], g[k], b[k], a[k]];
                let texel = match format.sample_kind() {
                    etalon_core::format::SampleKind::Uint => Texel::Uint(bits),
                    etalon_core::format::SampleKind::Sint => {
                        Texel::Sint(bits.map(|bits| bits as i32))
                    }
                    _ => Texel::Float(bits.map(f32::from_bits)),
                };
                let mut bytes = [0; 16];
                format.encode(texel, &mut bytes);
                let (mut low, mut high) = ([0; 8], [0; 8]);
                low.copy_from_slice(&bytes[..8]);
                high.copy_from_slice(&bytes[8..]);
                out[0][k] = u64::from_le_bytes(low);
                out[1][k] = u64::from_le_bytes(high);
            }
        }
    }
}

#[inline(always)]
fn pair(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

#[inline(always)]
fn half(bits: u32) -> u32 {
    f32_to_f16(f32::from_bits(bits))
}

/// Texels of four 8-bit normalised channels.
#[inline(always)]
pub(crate) fn unorm8_codes<const K: usize>(channels: &Channels<K>, out: &mut [u32; K]) {
    *out = [0; K];
    let mut near_half = false;
    for (c, lanes) in channels.iter().enumerate() {
        for k in 0..K {
            // From 2^23 on the unit of f32 is 1. The product is within 2^-17 of
            // the exact one, so that it rounds alike unless it is as near as
            // that to half way between two integers.
            const UNIT: f32 = 8_388_608.0;
            let value = f32::from_bits(lanes[k]);
            let value = if value > 0.0 { value } else { 0.0 };
            let value = if value < 1.0 { value } else { 1.0 };
            let scaled = value * 255.0;
            let shifted = scaled + UNIT;
            let off = (shifted - UNIT) - scaled;
            near_half |= off * off > 0.2499;
            out[k] |= (shifted.to_bits() & 0xff) << (8 * c);
        }
    }
    if near_half {
        let [r, g, b, a] = channels;
        for k in 0..K {
            out[k] = code8(r[k]) | code8(g[k]) << 8 | code8(b[k]) << 16 | code8(a[k]) << 24;
        }
    }
}

/// Clamped, scaled exactly, rounded to nearest even; NaN gives 0.
#[inline(always)]
fn code8(bits: u32) -> u32 {
    let value = f64::from(f32::from_bits(bits)) * 255.0;
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < 255.0 { value } else { 255.0 };
    // The sum's unit is 1, so adding rounds to the nearest integer, ties to
    // even, and leaves it in the low bits.
    (value + 4_503_599_627_370_496.0).to_bits() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(k: u32) -> u32 {
        k.wrapping_mul(0x9e37_79b1).rotate_left(k % 31)
    }

    /// Every format's loops against the codec, on arbitrary words.
    #[test]
    fn decoding_is_the_codec() {
        for &format in Format::ALL {
            for seed in 0..200 {
                let word = |i: u32| {
                    u64::from(bits(seed * 64 + i)) | u64::from(bits(seed * 64 + i + 32)) << 32
                };
                let words: Words<16> = [
                    std::array::from_fn(|k| word(k as u32)),
                    std::array::from_fn(|k| word(k as u32 + 16)),
                ];
                let mut channels = [[0; 16]; 4];
                decode(format, &words, [true; 4], &mut channels);
                for k in 0..16 {
                    let bytes: Vec<u8> = words[0][k]
                        .to_le_bytes()
                        .into_iter()
                        .chain(words[1][k].to_le_bytes())
                        .collect();
                    let expected = match format.decode(&bytes) {
                        Texel::Float(c) => c.map(f32::to_bits),
                        Texel::Sint(c) => c.map(|c| c as u32),
                        Texel::Uint(c) => c,
                    };
                    // The payload of a NaN is nobody's promise.
                    let float = format.sample_kind() == etalon_core::format::SampleKind::Float;
                    for (channel, expected) in channels.iter().zip(expected) {
                        let nans = [channel[k], expected].map(|bits| f32::from_bits(bits).is_nan());
                        assert!(
                            channel[k] == expected || float && nans == [true; 2],
                            "{format} {:x}: {:x}, not {expected:x}",
                            words[0][k],
                            channel[k]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn encoding_is_the_codec() {
        let special = [
            0.0,
            -0.0,
            1.0,
            0.5,
            0.1,
            2.0,
            -1.0,
            65504.0,
            65519.9,
            65520.0,
            1e-8,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            0.5 / 255.0,
            1.5 / 255.0,
        ];
        for &format in Format::ALL {
            for seed in 0..200 {
                let lane = |c: u32| -> [u32; 16] {
                    std::array::from_fn(|k| {
                        if seed == 0 {
                            special[(k + c as usize) % 16].to_bits()
                        } else {
                            bits(seed * 64 + k as u32 * 4 + c)
                        }
                    })
                };
                let channels: Channels<16> = [lane(0), lane(1), lane(2), lane(3)];
                let mut words = [[0; 16]; 2];
                encode(format, &channels, &mut words);
                for k in 0..16 {
                    let texel = channels.map(|c| c[k]);
                    let texel = match format.sample_kind() {
                        etalon_core::format::SampleKind::Uint => Texel::Uint(texel),
                        etalon_core::format::SampleKind::Sint => {
                            Texel::Sint(texel.map(|c| c as i32))
                        }
                        _ => Texel::Float(texel.map(f32::from_bits)),
                    };
                    let size = format.texel_bytes() as usize;
                    let mut expected = vec![0; size];
                    format.encode(texel, &mut expected);
                    let bytes: Vec<u8> = words[0][k]
                        .to_le_bytes()
                        .into_iter()
                        .chain(words[1][k].to_le_bytes())
                        .take(size)
                        .collect();
                    // The payload of a NaN is nobody's promise.
                    let codes = [&bytes, &expected].map(|bytes| format.codes(bytes).channels);
                    for channel in 0..format.channels() as usize {
                        let [code, wanted] = codes.map(|codes| codes[channel]);
                        let nans = [&bytes, &expected].map(|bytes| match format.decode(bytes) {
                            Texel::Float(channels) => channels[channel].is_nan(),
                            Texel::Sint(_) | Texel::Uint(_) => false,
                        });
                        assert!(
                            code == wanted || nans == [true; 2],
                            "{format} {texel:?}: {code:x}, not {wanted:x}"
                        );
                    }
                }
            }
        }
    }

    /// At every value half way between two codes, at its neighbours, and at
    /// codes, alone so that other lanes do not ask for more care.
    #[test]
    fn eight_bits_are_rounded_exactly() {
        let check = |value: f32| {
            let exact = (f64::from(value) * 255.0).clamp(0.0, 255.0);
            let expected = if value.is_nan() {
                0
            } else {
                exact.round_ties_even() as u32
            };
            let lane = [value.to_bits(); 1];
            let mut code = [0];
            unorm8_codes(&[lane, [0], lane, [0]], &mut code);
            assert_eq!(code[0], expected | expected << 16, "{value}");
        };
        for code in 0..=255_u32 {
            for value in [code as f32 / 255.0, (code as f32 + 0.5) / 255.0] {
                let (mut below, mut above) = (value, value);
                for _ in 0..40 {
                    check(below);
                    check(above);
                    (below, above) = (below.next_down(), above.next_up());
                }
            }
        }
        for value in [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            -0.0,
            1e-40,
            1e30,
        ] {
            check(value);
        }
    }

    #[test]
    fn eight_bits_are_divided_with_one_rounding() {
        for code in 0..=255_u32 {
            assert_eq!(unorm8(code), (code as f32 / 255.0).to_bits(), "{code}");
            assert_eq!(unorm8(code | 0xffff_ff00), unorm8(code));
        }
    }

    #[test]
    fn unwanted_channels_are_left_alone() {
        let mut channels = [[7; 4]; 4];
        decode(
            Format::Rgba32Uint,
            &[[u64::MAX; 4]; 2],
            [false, true, false, false],
            &mut channels,
        );
        assert_eq!(channels, [[7; 4], [u32::MAX; 4], [7; 4], [7; 4]]);
    }
}

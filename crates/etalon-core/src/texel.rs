//! Texels as numbers and as bytes: the one codec of the project.
//!
//! [`Format::decode`] and [`Format::encode`] translate between the bytes of a
//! texel and its channels in red, green, blue, alpha order. Everything that
//! turns numbers into texels on the host (the interpreter's stores, uploads,
//! read-backs, comparison) goes through these rules:
//!
//! * Rounding is to nearest, ties to even, except for the shared-exponent
//!   format, whose specification rounds halves up.
//! * Normalised and integer channels clamp to their range; NaN becomes 0.
//! * `f16` channels overflow to infinity as IEEE 754 says, and keep NaN.
//! * Unsigned floats turn negative values, −0 and −∞ into 0, keep +∞ and NaN,
//!   and turn finite values above their largest one into that largest one
//!   (OpenGL 4.6 core profile, §2.3.4.3 and §2.3.4.4; Vulkan refers to the same
//!   text in the Khronos Data Format Specification).
//! * Shared exponents follow OpenGL 4.6 core profile, §8.5.2: NaN and negative
//!   values become 0, +∞ and values above 65408 become 65408.
//! * sRGB channels use the transfer function of IEC 61966-2-1, computed in
//!   `f64`.
//!
//! Bytes are little endian, and packed formats have their first channel in the
//! lowest bits, as WebGPU and Vulkan have them on every supported machine.

mod small_float;
mod srgb;
#[cfg(test)]
mod tests;
mod ulp;

use serde::{Deserialize, Serialize};

use crate::format::{Encoding, Format, SampleKind};
use small_float::{HALF, SmallFloat, UFLOAT10, UFLOAT11};
pub use srgb::{linear_to_srgb, srgb_to_linear};
pub use ulp::INFINITE_ULPS;

/// The channels of one texel in red, green, blue, alpha order, as a shader's
/// load returns them: channels the format lacks read 0, and alpha reads 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Texel {
    /// Of a float, normalised or depth format.
    Float([f32; 4]),
    /// Of a signed integer format.
    Sint([i32; 4]),
    /// Of an unsigned integer format.
    Uint([u32; 4]),
}

impl Texel {
    /// The channels as `f32`. Integers beyond 2^24 are rounded to nearest even.
    #[must_use]
    pub fn to_f32(self) -> [f32; 4] {
        match self {
            Self::Float(channels) => channels,
            Self::Sint(channels) => channels.map(|channel| channel as f32),
            Self::Uint(channels) => channels.map(|channel| channel as f32),
        }
    }

    /// The channels as `f64`; exact for every format.
    #[must_use]
    pub fn to_f64(self) -> [f64; 4] {
        match self {
            Self::Float(channels) => channels.map(f64::from),
            Self::Sint(channels) => channels.map(f64::from),
            Self::Uint(channels) => channels.map(f64::from),
        }
    }

    /// One channel, in `f32` without rounding where it is one, else through
    /// `f64`, which holds every integer of 32 bits.
    fn float(self, channel: usize) -> f32 {
        self.to_f32()[channel]
    }

    /// One channel as an integer, rounded to nearest even; NaN gives 0. The
    /// range of `i64` holds both integer kinds, so clamping can follow.
    fn integer(self, channel: usize) -> i64 {
        match self {
            // `as` saturates and maps NaN to 0.
            Self::Float(channels) => channels[channel].round_ties_even() as i64,
            Self::Sint(channels) => channels[channel].into(),
            Self::Uint(channels) => channels[channel].into(),
        }
    }
}

/// The stored bits of a texel, cut into channels but not yet read as numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct TexelCodes {
    /// Each channel's bits, right-aligned, in red, green, blue, alpha order.
    /// Channels the format lacks are 0.
    pub channels: [u32; 4],
    /// The exponent that [`Encoding::SharedExponent`] channels share, else 0.
    pub exponent: u32,
}

/// Where the bits of one channel lie in a texel.
struct Field {
    shift: u32,
    mask: u32,
}

impl Format {
    /// The bit fields of the channels in red, green, blue, alpha order.
    fn fields(self) -> impl Iterator<Item = (usize, Field)> {
        let mut shift = 0;
        self.channel_bits()
            .iter()
            .enumerate()
            .map(move |(position, &bits)| {
                let field = Field {
                    shift,
                    mask: u32::MAX >> (32 - bits),
                };
                shift += bits;
                // Blue and red change places in memory, nowhere else.
                let channel = match (self, position) {
                    (Self::Bgra8Unorm, 0) => 2,
                    (Self::Bgra8Unorm, 2) => 0,
                    _ => position,
                };
                (channel, field)
            })
    }

    /// Cuts the bytes of one texel into channel codes. Bytes beyond
    /// [`Format::texel_bytes`] are ignored, missing ones read as 0.
    #[must_use]
    pub fn codes(self, bytes: &[u8]) -> TexelCodes {
        let mut word = [0; 16];
        let length = bytes.len().min(self.texel_bytes() as usize);
        word[..length].copy_from_slice(&bytes[..length]);
        let word = u128::from_le_bytes(word);
        let mut codes = TexelCodes::default();
        for (channel, field) in self.fields() {
            codes.channels[channel] = (word >> field.shift) as u32 & field.mask;
        }
        if self.encoding() == Encoding::SharedExponent {
            codes.exponent = (word >> 27) as u32 & 31;
        }
        codes
    }

    /// The bytes of one texel from channel codes, the inverse of
    /// [`Format::codes`]. Bits beyond a channel's width are ignored. If `out`
    /// is shorter than a texel, the bytes that fit are written.
    pub fn write_codes(self, codes: TexelCodes, out: &mut [u8]) {
        let mut word = 0_u128;
        for (channel, field) in self.fields() {
            word |= u128::from(codes.channels[channel] & field.mask) << field.shift;
        }
        if self.encoding() == Encoding::SharedExponent {
            word |= u128::from(codes.exponent & 31) << 27;
        }
        let length = out.len().min(self.texel_bytes() as usize);
        out[..length].copy_from_slice(&word.to_le_bytes()[..length]);
    }

    /// Reads one texel. Bytes beyond [`Format::texel_bytes`] are ignored,
    /// missing ones read as 0, so there is no input that fails.
    #[must_use]
    pub fn decode(self, bytes: &[u8]) -> Texel {
        self.decode_codes(self.codes(bytes))
    }

    /// Reads the numbers that channel codes stand for.
    #[must_use]
    pub fn decode_codes(self, codes: TexelCodes) -> Texel {
        let count = self.channels() as usize;
        let bits = self.channel_bits();
        match self.sample_kind() {
            SampleKind::Uint => {
                let mut channels = [0, 0, 0, 1];
                channels[..count].copy_from_slice(&codes.channels[..count]);
                Texel::Uint(channels)
            }
            SampleKind::Sint => {
                let mut channels = [0, 0, 0, 1];
                for (channel, &bits) in bits.iter().enumerate() {
                    channels[channel] = sign_extend(codes.channels[channel], bits);
                }
                Texel::Sint(channels)
            }
            SampleKind::Float | SampleKind::Depth => {
                let mut channels = [0.0, 0.0, 0.0, 1.0];
                for (channel, &bits) in bits.iter().enumerate() {
                    channels[channel] = self.decode_float(channel, bits, codes);
                }
                Texel::Float(channels)
            }
        }
    }

    /// Writes one texel by the rules of the [module](self). A texel of another
    /// kind than the format's is converted first: floats to integers by
    /// rounding to nearest even, integers to floats likewise. If `out` is
    /// shorter than a texel, the bytes that fit are written.
    pub fn encode(self, texel: Texel, out: &mut [u8]) {
        self.write_codes(self.encode_codes(texel), out);
    }

    /// The channel codes a texel is stored as, by the rules of the
    /// [module](self).
    #[must_use]
    pub fn encode_codes(self, texel: Texel) -> TexelCodes {
        let mut codes = TexelCodes::default();
        if self.encoding() == Encoding::SharedExponent {
            let [red, green, blue, _] = texel.to_f32();
            let (mantissas, exponent) = small_float::encode_shared_exponent([red, green, blue]);
            codes.channels[..3].copy_from_slice(&mantissas);
            codes.exponent = exponent;
            return codes;
        }
        for (channel, &bits) in self.channel_bits().iter().enumerate() {
            // Negative integers carry their sign beyond the channel's width.
            codes.channels[channel] =
                self.encode_channel(texel, channel, bits) & (u32::MAX >> (32 - bits));
        }
        codes
    }

    /// One channel of a format whose loads return `f32`.
    fn decode_float(self, channel: usize, bits: u32, codes: TexelCodes) -> f32 {
        let code = codes.channels[channel];
        match self.encoding() {
            // Both operands are exact, so the division is rounded once.
            Encoding::Unorm => code as f32 / largest_unorm(bits) as f32,
            Encoding::UnormSrgb if channel < 3 => srgb_to_linear(f64::from(code) / 255.0) as f32,
            Encoding::UnormSrgb => code as f32 / 255.0,
            Encoding::Snorm => {
                (sign_extend(code, bits) as f32 / largest_snorm(bits) as f32).max(-1.0)
            }
            Encoding::Float | Encoding::Ufloat => match small_float_of(self.encoding(), bits) {
                Some(float) => float.decode(code),
                None => f32::from_bits(code),
            },
            Encoding::SharedExponent => small_float::decode_shared_exponent(code, codes.exponent),
            Encoding::Uint => code as f32,
            Encoding::Sint => sign_extend(code, bits) as f32,
        }
    }

    /// The code of one channel of any format but the shared-exponent one.
    fn encode_channel(self, texel: Texel, channel: usize, bits: u32) -> u32 {
        let value = texel.float(channel);
        match self.encoding() {
            Encoding::UnormSrgb if channel < 3 => {
                encode_norm(linear_to_srgb(f64::from(value)), 0.0, largest_unorm(bits)) as u32
            }
            Encoding::Unorm | Encoding::UnormSrgb => {
                encode_norm(value.into(), 0.0, largest_unorm(bits)) as u32
            }
            Encoding::Snorm => encode_norm(value.into(), -1.0, largest_snorm(bits)) as u32,
            Encoding::Float | Encoding::Ufloat => match small_float_of(self.encoding(), bits) {
                Some(float) => float.encode(value),
                None => value.to_bits(),
            },
            Encoding::Uint => {
                let largest = if bits == 32 {
                    i64::from(u32::MAX)
                } else {
                    (1 << bits) - 1
                };
                texel.integer(channel).clamp(0, largest) as u32
            }
            Encoding::Sint => {
                let limit = 1_i64 << (bits - 1);
                texel.integer(channel).clamp(-limit, limit - 1) as u32
            }
            // Its channels are not independent: see `encode_codes`.
            Encoding::SharedExponent => 0,
        }
    }
}

/// The float format of fewer than 32 bits that channels of a width have.
fn small_float_of(encoding: Encoding, bits: u32) -> Option<SmallFloat> {
    match (encoding, bits) {
        (Encoding::Float, 16) => Some(HALF),
        (Encoding::Ufloat, 11) => Some(UFLOAT11),
        (Encoding::Ufloat, 10) => Some(UFLOAT10),
        _ => None,
    }
}

/// Reads the low `bits` bits (1 to 32) as two's complement.
const fn sign_extend(code: u32, bits: u32) -> i32 {
    let unused = 32 - bits;
    ((code << unused) as i32) >> unused
}

/// The code of 1 in an unsigned normalised channel. At most 16 bits.
const fn largest_unorm(bits: u32) -> u32 {
    (1 << bits) - 1
}

/// The code of 1 in a signed normalised channel. At most 16 bits.
const fn largest_snorm(bits: u32) -> u32 {
    (1 << (bits - 1)) - 1
}

/// A normalised channel's code: clamped to `[low, 1]`, scaled in `f64` (exact:
/// 24 significant bits times 16), rounded to nearest even. NaN gives 0.
fn encode_norm(value: f64, low: f64, largest: u32) -> i32 {
    // `clamp` lets NaN through, and `as` maps it to 0.
    (value.clamp(low, 1.0) * f64::from(largest)).round_ties_even() as i32
}

//! Distance between stored texels, in units of the last place the format has.

use super::{TexelCodes, sign_extend, small_float_of};
use crate::format::{Encoding, Format};

/// The distance of two values between which no count of steps means anything:
/// a NaN and a number, or an infinity and a finite number.
pub const INFINITE_ULPS: u64 = u64::MAX;

impl Format {
    /// How far apart two texels are, channel by channel, in units of the last
    /// place of the storage format. Channels the format lacks are 0.
    ///
    /// * Normalised and integer channels: the difference of their codes (the
    ///   two codes of −1 of a signed normalised channel are equal).
    /// * Float channels: the number of representable values passed on the way;
    ///   +0 and −0 are equal. Subnormal `f32` values count as 0, because
    ///   WGSL (§15.7.2) lets devices flush them.
    /// * Shared-exponent channels: the difference over the step of the texel
    ///   with the larger exponent, rounded up.
    /// * Two NaNs are equal, whatever their payloads. A NaN and a number, or an
    ///   infinity and anything but itself, are [`INFINITE_ULPS`] apart: an
    ///   overflow is never "one unit".
    #[must_use]
    pub fn ulps(self, a: TexelCodes, b: TexelCodes) -> [u64; 4] {
        let mut distances = [0; 4];
        for (channel, distance) in distances
            .iter_mut()
            .enumerate()
            .take(self.channels() as usize)
        {
            let (code_a, code_b) = (a.channels[channel], b.channels[channel]);
            *distance = if self.encoding() == Encoding::SharedExponent {
                let in_finest_steps = |code: u32, exponent: u32| i64::from(code) << exponent;
                let difference = in_finest_steps(code_a, a.exponent)
                    .abs_diff(in_finest_steps(code_b, b.exponent));
                difference.div_ceil(1 << a.exponent.max(b.exponent))
            } else {
                match (self.ordinal(channel, code_a), self.ordinal(channel, code_b)) {
                    (Ordinal::Finite(a), Ordinal::Finite(b)) => a.abs_diff(b),
                    (a, b) if a == b => 0,
                    _ => INFINITE_ULPS,
                }
            };
        }
        distances
    }

    /// Whether a channel's code is an infinity or a NaN.
    #[must_use]
    pub fn is_non_finite(self, channel: usize, code: u32) -> bool {
        !matches!(self.ordinal(channel, code), Ordinal::Finite(_))
    }

    /// The place of a code among the finite values the channel can hold,
    /// neighbours being one apart and 0 at 0.
    fn ordinal(self, channel: usize, code: u32) -> Ordinal {
        let bits = self.channel_bits().get(channel).copied().unwrap_or(32);
        match self.encoding() {
            Encoding::Unorm | Encoding::UnormSrgb | Encoding::Uint | Encoding::SharedExponent => {
                Ordinal::Finite(code.into())
            }
            Encoding::Sint => Ordinal::Finite(sign_extend(code, bits).into()),
            Encoding::Snorm => {
                let code = i64::from(sign_extend(code, bits));
                Ordinal::Finite(code.max(1 - (1 << (bits - 1))))
            }
            Encoding::Float | Encoding::Ufloat => {
                let (magnitude, infinity, negative) = match small_float_of(self.encoding(), bits) {
                    Some(float) => (
                        float.magnitude(code),
                        float.infinity(),
                        float.negative(code),
                    ),
                    None => {
                        let magnitude = code & 0x7fff_ffff;
                        // Subnormals become 0 and the smallest normal value 1;
                        // the shift leaves infinity and NaN above all others.
                        (
                            magnitude.saturating_sub(0x007f_ffff),
                            0x7f80_0000 - 0x007f_ffff,
                            code >> 31 == 1,
                        )
                    }
                };
                if magnitude > infinity {
                    Ordinal::Nan
                } else if magnitude == infinity {
                    Ordinal::Infinity { negative }
                } else {
                    Ordinal::Finite(if negative {
                        -i64::from(magnitude)
                    } else {
                        magnitude.into()
                    })
                }
            }
        }
    }
}

/// A channel's value as a place on the number line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ordinal {
    /// Steps from 0.
    Finite(i64),
    /// +∞ or −∞.
    Infinity { negative: bool },
    /// Not a number, whatever its payload.
    Nan,
}

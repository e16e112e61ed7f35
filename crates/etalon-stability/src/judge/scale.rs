//! What an error is relative to.
//!
//! A relative error says nothing about a number that happens to be near zero, such
//! as a coordinate at the left edge of the picture. Each channel has a scale below
//! which its error is absolute:
//!
//! * what is a share of something — coordinates and visibility of a reflection,
//!   alpha, channels of 8 bits — counts relative to 1;
//! * a sum of logarithms counts relative to the number of its terms, a stop each;
//! * what was once stored in a float with five bits of exponent has absolute steps
//!   below 2⁻¹⁴; `f32` has below 2⁻¹²⁶, where devices may flush (WGSL §15.7.2);
//! * a reflection is looked up between texels at a place in `f32`, so that it is off by
//!   the place's error, in texels, times what neighbouring texels differ by: at most
//!   the brightest light of the frame;
//! * bloom subtracts a threshold of the order of 1 from what it is given: an error
//!   that it inherits from a store before it stays as it is while the value shrinks.

use etalon_core::Format;
use etalon_core::format::Encoding;

use super::rounding::BOUND;

/// The least normal number of formats with five bits of exponent.
const LEAST_NORMAL_HALF: f64 = 1.0 / 16_384.0;

/// Roundings of a coordinate on its way through projection, march and look-up, each
/// of at most half a unit of the last place of 1.
const COORDINATE: f64 = 16.0 / 33_554_432.0;

/// A store, as far as its scale depends on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place<'a> {
    /// The pass.
    pub pass: &'a str,
    /// Of what it wrote.
    pub format: Format,
    /// Relative error of what it was given, from stores before it.
    pub inherited: f64,
    /// The brightest light that the frame gave.
    pub brightest: f64,
    /// The longer side of the frame in texels.
    pub side: u32,
    /// Relative error of the format that places of reflections are stored in.
    pub places: f64,
    /// Whether luminance is summed as it is and not by its logarithm.
    pub arithmetic_mean: bool,
}

impl Place<'_> {
    /// The scale of a channel of a texel.
    #[must_use]
    pub fn scale(&self, channel: usize, texel: &[f64; 4]) -> f64 {
        let kernel = self.pass.split(['#', ' ']).next().unwrap_or_default();
        let share = match kernel {
            "ssr/march" => channel < 3,
            "exposure/luminance" | "exposure/reduce" | "exposure/adapt" => false,
            _ => channel == 3,
        };
        if share
            || matches!(
                self.format.encoding(),
                Encoding::Unorm | Encoding::UnormSrgb
            )
        {
            return 1.0;
        }
        let sum = matches!(kernel, "exposure/luminance" | "exposure/reduce");
        if sum && channel == 0 && !self.arithmetic_mean {
            return texel[1].max(1.0);
        }
        if kernel.starts_with("bloom/") && self.inherited > 0.0 {
            return 1.0;
        }
        if kernel.starts_with("ssr/") && kernel != "ssr/march" {
            // What is allowed of this scale is what the place's error allows.
            let texels = f64::from(self.side) * (COORDINATE + 0.5 * self.places);
            return (texels * self.brightest / BOUND).max(LEAST_NORMAL_HALF);
        }
        if self.inherited > 0.0 || half_step(self.format, channel, 1.0) > 1e-6 {
            LEAST_NORMAL_HALF
        } else {
            f64::from(f32::MIN_POSITIVE)
        }
    }
}

/// Magnitudes below this say nothing in a format: its least normal number, and of fixed
/// point all.
#[must_use]
pub fn least(format: Format) -> f64 {
    match format.encoding() {
        Encoding::Float if half_step(format, 0, 1.0) < 1e-6 => f64::from(f32::MIN_POSITIVE),
        Encoding::Float | Encoding::Ufloat | Encoding::SharedExponent => LEAST_NORMAL_HALF,
        _ => 1.0,
    }
}

/// Half the distance of a format's neighbouring numbers at `value`: how far rounding
/// to nearest moves it.
#[must_use]
pub fn half_step(format: Format, channel: usize, value: f64) -> f64 {
    let bits = format.channel_bits().get(channel).copied().unwrap_or(32);
    let of_float = |mantissa: i32, least: i32| {
        // floor(log2 |value|): the exponent field; 0 and subnormals are below any.
        let exponent = ((value.abs().to_bits() >> 52) as i32 - 1023).max(least);
        f64::from(exponent - mantissa - 1).exp2()
    };
    match (format.encoding(), bits) {
        (Encoding::Unorm | Encoding::UnormSrgb, bits) => 0.5 / (f64::from(bits).exp2() - 1.0),
        (Encoding::Snorm, bits) => 0.5 / (f64::from(bits - 1).exp2() - 1.0),
        (Encoding::Float | Encoding::Ufloat, 16) => of_float(10, -14),
        (Encoding::Ufloat, 11) => of_float(6, -14),
        (Encoding::Ufloat, 10) => of_float(5, -14),
        (Encoding::Float, _) => of_float(23, -126),
        _ => 0.0,
    }
}

/// The relative error that storing to a format leaves for whoever reads it, the
/// largest of its channels; `f32`'s is as nothing.
#[must_use]
pub fn unit(format: Format) -> f64 {
    (0..format.channels() as usize)
        .map(|channel| half_step(format, channel, 1.0))
        .filter(|unit| *unit > 1e-6)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_steps_are_those_of_the_formats() {
        let half = Format::Rgba16Float;
        // Neighbours of 1 are 2^-10 above and 2^-11 below; of 0, 2^-24.
        assert_eq!(half_step(half, 0, 1.0), 2.0_f64.powi(-11));
        assert_eq!(half_step(half, 0, 65_504.0), 16.0);
        assert_eq!(half_step(half, 0, 0.0), 2.0_f64.powi(-25));
        assert_eq!(half_step(half, 0, -1e-7), 2.0_f64.powi(-25));
        assert_eq!(half_step(Format::R32Float, 0, 1.5), 2.0_f64.powi(-24));
        assert_eq!(half_step(Format::Rgba8Unorm, 2, 0.3), 0.5 / 255.0);
        let packed = Format::Rg11b10Ufloat;
        assert_eq!(half_step(packed, 1, 1.0), 2.0_f64.powi(-7));
        assert_eq!(half_step(packed, 2, 1.0), 2.0_f64.powi(-6));
        assert_eq!(unit(packed), 2.0_f64.powi(-6));
        assert_eq!(unit(half), 2.0_f64.powi(-11));
        assert_eq!(unit(Format::Rgba32Float), 0.0);
        // Rounding to nearest never moves a number further.
        for bits in 0..=u16::MAX / 64 {
            let value = f32::from_bits(u32::from(bits) << 22 | 0x1234);
            if value.abs() >= 65_504.0 || !value.is_finite() {
                continue;
            }
            let mut bytes = [0; 2];
            Format::R16Float.encode(etalon_core::texel::Texel::Float([value; 4]), &mut bytes);
            let stored = Format::R16Float.decode(&bytes).to_f64()[0];
            let moved = (stored - f64::from(value)).abs();
            assert!(
                moved <= half_step(Format::R16Float, 0, value.into()),
                "{value}"
            );
        }
    }

    #[test]
    fn shares_count_relative_to_one_and_light_relative_to_itself() {
        let place = |pass, format, inherited| Place {
            pass,
            format,
            inherited,
            brightest: 2.0,
            side: 1024,
            places: 0.0,
            arithmetic_mean: false,
        };
        let texel = [1e-9, 100.0, 0.0, 0.0];
        let march = place("ssr/march", Format::Rgba32Float, 0.0);
        assert_eq!(march.scale(0, &texel), 1.0);
        assert_eq!(march.scale(3, &texel), f64::from(f32::MIN_POSITIVE));
        let resolve = place("ssr/resolve", Format::Rgba16Float, 0.0);
        // 1024 · 2^-21 texels of light of 2.
        assert_eq!(resolve.scale(0, &texel) * BOUND, 2.0_f64.powi(-10));
        assert_eq!(resolve.scale(3, &texel), 1.0);
        let sums = place("exposure/reduce#2", Format::Rgba32Float, 0.0);
        assert_eq!(sums.scale(0, &texel), 100.0);
        let bloom = place("bloom/threshold", Format::Rgba16Float, 1e-3);
        assert_eq!(bloom.scale(0, &texel), 1.0);
    }
}

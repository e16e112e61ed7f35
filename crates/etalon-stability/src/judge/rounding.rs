//! How far is `f32` from `f64`?
//!
//! The shadow is the `f64` that takes the same branches as the `f32` beside it, so
//! that what is left is rounding. Its error at a store is the distance between what
//! was stored and the shadow, less the half step that storing to the format may move
//! it, relative to the shadow or to the channel's [scale]. Where a
//! strict kernel has rounded to whole codes itself, so has its shadow: a half step
//! each.
//!
//! Branches are not the only decisions. A texel's coordinate is a whole number, and
//! where `f32` and `f64` round to different ones the shadow reads one texel by the
//! weight of another: its value is none. There the `f64` run that decides for itself
//! says otherwise than the shadow, and the texel is counted apart
//! ([`Rounding::otherwise`]).
//!
//! Allowed is [`BOUND`], 2⁻¹¹, from which on an error shows in half floats, and what
//! stores of fewer bits in earlier passes of the frame have left: half a unit of
//! their format each. Sums of non-negative values with non-negative weights keep
//! relative errors as they are, so these add up and do not grow.

use etalon_core::Format;
use etalon_core::image::ImageData;
use serde::{Deserialize, Serialize};

use super::reflection::Reflection;
use super::scale::{self, half_step};
use crate::observe::{Place, Store};

/// Error at a store from which on it is one: half the step of a half float at 1.
pub const BOUND: f64 = 1.0 / 2048.0;

/// How far `f32` was from `f64`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rounding {
    /// The largest error, relative, of those that are closest to what is allowed
    /// there.
    #[serde(with = "crate::number")]
    pub max: f64,
    /// What is allowed there.
    #[serde(with = "crate::number")]
    pub allowed: f64,
    /// Where that is.
    pub at: Place,
    /// What was stored there.
    #[serde(with = "crate::number")]
    pub stored: f64,
    /// What the shadow has there.
    #[serde(with = "crate::number")]
    pub exact: f64,
    /// The error that 99.9 % of the texels of all passes do not exceed.
    #[serde(with = "crate::number")]
    pub p999: f64,
    /// Texels with an error that is not allowed.
    pub beyond: u64,
    /// Texels looked at.
    pub texels: u64,
    /// Texels left out: those that come out otherwise where `f64` decides for itself.
    pub otherwise: u64,
}

impl Rounding {
    /// The largest error as a share of what is allowed.
    #[must_use]
    pub fn strain(&self) -> f64 {
        if self.allowed > 0.0 {
            self.max / self.allowed
        } else {
            0.0
        }
    }
}

/// What a frame gave, as far as errors depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The brightest light, up to 65504.
    pub brightest: f64,
    /// The longer side in texels.
    pub side: u32,
    /// Width and height in texels.
    pub size: [u32; 2],
    /// Texels to either side that reflections are blurred over.
    pub blur: u32,
}

impl Shown {
    /// Of an image of light, whose reflections are blurred over so many texels to
    /// either side.
    #[must_use]
    pub fn of(colour: &ImageData, blur: u32) -> Self {
        let format = colour.desc.format;
        let texels = colour.bytes.chunks_exact(format.texel_bytes() as usize);
        let light = texels.flat_map(|texel| {
            let [r, g, b, _] = format.decode(texel).to_f64();
            [r, g, b]
        });
        Self {
            brightest: light.fold(0.0, f64::max).min(65_504.0),
            side: colour.desc.extent.width.max(colour.desc.extent.height),
            size: [colour.desc.extent.width, colour.desc.extent.height],
            blur,
        }
    }
}

/// What is gathered over the frames of a case.
#[derive(Clone, Debug)]
pub struct Gathering {
    /// In place of [`BOUND`].
    bound: f64,
    arithmetic_mean: bool,
    found: Rounding,
    errors: Vec<f32>,
}

impl Gathering {
    /// Nothing yet. `bound` is what a case declares in place of [`BOUND`];
    /// `arithmetic_mean` whether exposure sums luminance as it is.
    #[must_use]
    pub fn new(bound: Option<f64>, arithmetic_mean: bool) -> Self {
        Self {
            bound: bound.unwrap_or(BOUND),
            arithmetic_mean,
            found: Rounding::default(),
            errors: Vec::new(),
        }
    }

    /// Takes a frame's stores with their shadows, and those of the `f64` run that
    /// decides for itself, if there was one. `quantised` if kernels round to whole
    /// codes themselves.
    pub fn look(
        &mut self,
        frame: usize,
        stores: &[Store],
        double: &[Store],
        shown: &Shown,
        quantised: bool,
    ) {
        let mut inherited = 0.0;
        let mut reflection = Reflection::new(shown);
        let places = stores.iter().find(|store| store.pass == "ssr/march");
        let places = places
            .and_then(|store| store.image.as_ref())
            .map_or(0.0, |image| scale::unit(image.desc.format));
        for (number, store) in stores.iter().enumerate() {
            let (Some(image), Some(wide)) = (&store.image, &store.wide) else {
                continue;
            };
            let format = image.desc.format;
            let place = scale::Place {
                pass: &store.pass,
                format,
                inherited,
                brightest: shown.brightest,
                side: shown.side,
                places,
                arithmetic_mean: self.arithmetic_mean,
            };
            let allowed = self.bound + inherited;
            let steps = if quantised { 2.0 } else { 1.0 };
            let alone = double.get(number).and_then(|double| double.wide.as_ref());
            let bytes = image.bytes.chunks_exact(format.texel_bytes() as usize);
            for (index, (bytes, exact)) in bytes.zip(wide).enumerate() {
                self.found.texels += 1;
                let alone = alone.and_then(|alone| alone.get(index));
                let stored = format.decode(bytes).to_f64();
                let otherwise = alone.is_some_and(|alone| differ(&place, alone, exact));
                if reflection.leaves_out(&store.pass, index, otherwise, &stored, exact) {
                    self.found.otherwise += 1;
                    continue;
                }
                let (error, channel) = texel_error(&place, &stored, exact, steps);
                self.errors.push(error as f32);
                if error > allowed {
                    self.found.beyond += 1;
                }
                if error / allowed > self.found.strain() {
                    self.found.max = error;
                    self.found.allowed = allowed;
                    self.found.at = store.place(frame, index, channel);
                    self.found.stored = stored[channel];
                    self.found.exact = exact[channel];
                }
            }
            reflection.next(&store.pass);
            // The graph's outputs are stores of passes again.
            if store.pass != "output" {
                inherited += scale::unit(format);
            }
        }
    }

    /// Takes what a frame's passes that draw stored in `f32`, and what they stored where
    /// fragments compute in `f64`, both rounded to the format, and once more for each of
    /// the `layers` that a target blends.
    ///
    /// Errors are relative to the largest channel of a texel: what is drawn are colours
    /// and directions, of which a channel next to 0 shows nothing.
    pub fn look_at_drawn(
        &mut self,
        frame: usize,
        singles: &[Store],
        doubles: &[Store],
        layers: u32,
    ) {
        let steps = 2.0 * f64::from(1 + layers);
        for (single, double) in singles.iter().zip(doubles) {
            let (Some(image), Some(exact)) = (&single.image, &double.wide) else {
                continue;
            };
            let format = image.desc.format;
            let mut least = scale::least(format);
            if single.pass == "environment/irradiance" {
                // Factors of one function: of even light all but the first are sums that
                // cancel, and their errors count beside that one.
                least = exact
                    .iter()
                    .flatten()
                    .fold(least, |most, x| most.max(x.abs()));
            }
            let bytes = image.bytes.chunks_exact(format.texel_bytes() as usize);
            for (index, (bytes, exact)) in bytes.zip(exact).enumerate() {
                self.found.texels += 1;
                let stored = format.decode(bytes).to_f64();
                let (error, channel) = drawn_error((format, least), &stored, exact, steps);
                self.errors.push(error as f32);
                if error > self.bound {
                    self.found.beyond += 1;
                }
                if error / self.bound > self.found.strain() {
                    self.found.max = error;
                    self.found.allowed = self.bound;
                    self.found.at = single.place(frame, index, channel);
                    self.found.stored = stored[channel];
                    self.found.exact = exact[channel];
                }
            }
        }
    }

    /// What was found; `None` if nothing was looked at.
    #[must_use]
    pub fn finish(mut self) -> Option<Rounding> {
        let last = self.errors.len().checked_sub(1)?;
        let rank = (self.errors.len() * 999).div_ceil(1000).min(last + 1) - 1;
        let (_, p999, _) = self.errors.select_nth_unstable_by(rank, f32::total_cmp);
        self.found.p999 = f64::from(*p999);
        Some(self.found)
    }
}

/// The largest difference of a texel's channels beyond so many half steps of the format,
/// relative to the largest of them or a least magnitude, and which it is.
fn drawn_error(
    (format, least): (Format, f64),
    stored: &[f64; 4],
    exact: &[f64; 4],
    steps: f64,
) -> (f64, usize) {
    let channels = format.channels() as usize;
    let mut scale = least;
    for channel in 0..channels {
        scale = scale.max(exact[channel].abs()).max(stored[channel].abs());
    }
    let mut worst = (0.0, 0);
    for channel in 0..channels {
        let (stored, value) = (stored[channel], exact[channel]);
        let step = steps * half_step(format, channel, value.abs().max(stored.abs()));
        let distance = (stored - value).abs();
        let error = if stored == value || stored.is_nan() && value.is_nan() {
            0.0
        } else if distance.is_finite() {
            (distance - step).max(0.0) / scale
        } else {
            f64::INFINITY
        };
        if error > worst.0 {
            worst = (error, channel);
        }
    }
    worst
}

/// Whether two `f64` runs have taken different decisions, here or in what was read:
/// whether they are further apart than a small part, 1/16, of the error that is
/// looked for.
fn differ(place: &scale::Place<'_>, a: &[f64; 4], b: &[f64; 4]) -> bool {
    texel_error(place, a, b, 0.0).0 > (BOUND + place.inherited) / 16.0
}

/// The largest error of a texel's channels beyond so many half steps of the format,
/// and which it is; infinite, and never NaN, where one is a number and the other none.
fn texel_error(
    place: &scale::Place<'_>,
    stored: &[f64; 4],
    exact: &[f64; 4],
    steps: f64,
) -> (f64, usize) {
    let mut worst = (0.0, 0);
    for channel in 0..place.format.channels() as usize {
        let (stored, value) = (stored[channel], exact[channel]);
        let step = half_step(place.format, channel, value.abs().max(stored.abs()));
        let distance = (stored - value).abs();
        let scale = place.scale(channel, exact).max(value.abs());
        let error = if distance.is_finite() {
            (distance - steps * step).max(0.0) / scale
        } else {
            f64::INFINITY
        };
        if error > worst.0 {
            worst = (error, channel);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use etalon_core::resource::TextureDesc;
    use etalon_core::texel::Texel;

    use super::*;

    /// A texel of halves beside others, and what `f64` has of it.
    fn found(stored: [f32; 4], exact: [f64; 4], layers: u32) -> Rounding {
        let format = Format::Rgba16Float;
        let mut bytes = vec![0; 16];
        format.encode(Texel::Float([1.0; 4]), &mut bytes[..8]);
        format.encode(Texel::Float(stored), &mut bytes[8..]);
        let single = Store {
            image: Some(ImageData {
                desc: TextureDesc::d2(2, 1, format),
                bytes,
            }),
            ..Store::default()
        };
        let double = Store {
            wide: Some(vec![[1.0; 4], exact]),
            ..single.clone()
        };
        let mut errors = Gathering::new(None, false);
        errors.look_at_drawn(0, &[single], &[double], layers);
        errors.finish().unwrap()
    }

    #[test]
    fn what_is_drawn_may_be_off_by_what_stores_round() {
        let step = 1.0 / 1024.0;
        let [one, two, many] = [1.0, 2.0, 5.0].map(|steps| 1.0 + steps * step);
        let stored = [1.0, 0.5, 0.0, 1.0];
        assert_eq!(found(stored, [one, 0.5, 0.0, 1.0], 0).max, 0.0);
        let off = found(stored, [two, 0.5, 0.0, 1.0], 0);
        assert_eq!((off.beyond, off.at.x, off.at.channel), (1, 1, 0));
        assert!((off.max - step / two).abs() < 1e-9);
        // Two layers round twice more each.
        assert_eq!(found(stored, [two, 0.5, 0.0, 1.0], 2).beyond, 0);
        assert_eq!(found(stored, [many, 0.5, 0.0, 1.0], 2).beyond, 1);
    }

    #[test]
    fn a_channel_next_to_nothing_counts_relative_to_the_largest() {
        let stored = [1.0, 0.0, 0.0, 1.0];
        assert_eq!(found(stored, [1.0, 1e-4, 0.0, 1.0], 0).beyond, 0);
        assert_eq!(found(stored, [1.0, 1e-2, 0.0, 1.0], 0).beyond, 1);
    }

    #[test]
    fn what_is_no_number_is_off_unless_both_are() {
        let nan = f64::NAN;
        assert_eq!(found([1.0; 4], [nan, 1.0, 1.0, 1.0], 0).max, f64::INFINITY);
        let both = found([f32::NAN, 1.0, 1.0, 1.0], [nan, 1.0, 1.0, 1.0], 0);
        assert_eq!(both.beyond, 0);
    }
}

//! How far is `f32` from `f64`?
//!
//! The shadow is the `f64` that takes the same decisions as the `f32` beside it, so
//! that what is left is rounding. Its error at a store is the distance between what
//! was stored and the shadow, less the half step that storing to the format may move
//! it, relative to the shadow or to the channel's [scale](super::scale).
//!
//! Allowed is [`BOUND`], 2⁻¹¹, from which on an error shows in half floats, and what
//! stores of fewer bits in earlier passes of the frame have left: half a unit of
//! their format each. Sums of non-negative values with non-negative weights keep
//! relative errors as they are, so these add up and do not grow.

use serde::{Deserialize, Serialize};

use super::scale::{self, half_step};
use crate::observe::{Place, Store};

/// Error at a store from which on it is one: half the step of a half float at 1.
pub const BOUND: f64 = 1.0 / 2048.0;

/// How far `f32` was from `f64`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rounding {
    /// The largest error, relative, of those that are closest to what is allowed
    /// there.
    pub max: f64,
    /// What is allowed there.
    pub allowed: f64,
    /// Where that is.
    pub at: Place,
    /// What was stored there.
    pub stored: f64,
    /// What the shadow has there.
    pub exact: f64,
    /// The error that 99.9 % of the texels of all passes do not exceed.
    pub p999: f64,
    /// Texels with an error that is not allowed.
    pub beyond: u64,
    /// Texels looked at.
    pub texels: u64,
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

    /// Takes a frame's stores with their shadows.
    pub fn look(&mut self, frame: usize, stores: &[Store]) {
        let mut inherited = 0.0;
        for store in stores {
            let (Some(image), Some(wide)) = (&store.image, &store.wide) else {
                continue;
            };
            let format = image.desc.format;
            let place = scale::Place {
                pass: &store.pass,
                format,
                inherited,
                arithmetic_mean: self.arithmetic_mean,
            };
            let allowed = self.bound + inherited;
            let bytes = image.bytes.chunks_exact(format.texel_bytes() as usize);
            for (index, (bytes, exact)) in bytes.zip(wide).enumerate() {
                let stored = format.decode(bytes).to_f64();
                let (error, channel) = texel_error(&place, &stored, exact);
                self.errors.push(error as f32);
                self.found.texels += 1;
                if !(error <= allowed) {
                    self.found.beyond += 1;
                }
                if !(error / allowed <= self.found.strain()) {
                    self.found.max = error;
                    self.found.allowed = allowed;
                    self.found.at = store.place(frame, index, channel);
                    self.found.stored = stored[channel];
                    self.found.exact = exact[channel];
                }
            }
            // The graph's outputs are stores of passes again.
            if store.pass != "output" {
                inherited += scale::unit(format);
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

/// The largest error of a texel's channels, and which it is; infinite where one is
/// a number and the other none.
fn texel_error(place: &scale::Place<'_>, stored: &[f64; 4], exact: &[f64; 4]) -> (f64, usize) {
    let mut worst = (0.0, 0);
    for channel in 0..place.format.channels() as usize {
        let (stored, value) = (stored[channel], exact[channel]);
        let step = half_step(place.format, channel, value.abs().max(stored.abs()));
        let distance = (stored - value).abs();
        let scale = place.scale(channel, exact).max(value.abs());
        let error = if distance.is_finite() {
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

/// Texels of a frame that come out otherwise where `f64` decides for itself: where
/// two executors' wide values are further apart than rounding and storage explain.
#[must_use]
pub fn decided_otherwise(shadow: &[Store], double: &[Store]) -> u64 {
    let mut inherited = 0.0;
    let mut count = 0;
    for (shadow, double) in shadow.iter().zip(double) {
        let (Some(image), Some(a), Some(b)) = (&shadow.image, &shadow.wide, &double.wide) else {
            continue;
        };
        let place = scale::Place {
            pass: &shadow.pass,
            format: image.desc.format,
            inherited,
            arithmetic_mean: false,
        };
        let texels = a.iter().zip(b);
        count += texels
            .filter(|(a, b)| !(texel_error(&place, a, b).0 <= BOUND + inherited))
            .count() as u64;
        inherited += scale::unit(image.desc.format);
    }
    count
}

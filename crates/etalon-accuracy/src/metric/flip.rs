//! Perceived difference, by the FLIP metric.
//!
//! * [`ldr`]: Andersson et al., "FLIP: A Difference Evaluator for Alternating
//!   Images" (2020), of 8-bit sRGB pictures.
//! * [`hdr`]: Andersson et al., "Visualizing and Communicating Errors in Rendered
//!   Images" (2021), of linear light: the largest LDR error over exposures from the
//!   one that shows the brightest pixel to the one that shows the median.
//!
//! Both at 67 pixels per degree of the visual field, as the papers have it.
//!
//! The library behind both takes 8-bit pictures only, where the paper's own program
//! keeps tone-mapped light in `f32`. So at each exposure a difference below half a
//! step of 8-bit sRGB can vanish, and one that straddles a step counts as a whole
//! step. At the exposures where a pixel is best seen a step is about 1 % of its
//! light; what matters less than that is not seen here. Compare small rounding errors
//! by [`colour`](super::colour).

use etalon_core::texel::linear_to_srgb;
use rayon::prelude::*;

use super::{MetricError, Sum, same_size};

/// Smallest width and height that is measured: the filters span several pixels, and
/// a picture smaller than them shows an eye nothing.
pub const SMALLEST: u32 = 8;

/// Most exposures that are looked at. Enough for steps of one stop over all normal
/// numbers of `f32`; a wider range is looked at in wider steps.
pub const MOST_EXPOSURES: u32 = 256;

/// The error of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// From 0 (no visible difference) to 1, row by row from the top.
    pub values: Vec<f32>,
}

impl FlipMap {
    /// The mean error; what the authors recommend as the single number.
    #[must_use]
    pub fn mean(&self) -> f64 {
        // Summed here: the library's own mean is one of a histogram.
        let mut sum = Sum::default();
        for &value in &self.values {
            sum.add(value.into());
        }
        sum.value() / self.values.len().max(1) as f64
    }
}

/// The FLIP error between two 8-bit sRGB pictures: red, green, blue, row by row.
///
/// # Errors
/// If the pictures are not of that size, or it is smaller than [`SMALLEST`].
pub fn ldr(found: &[u8], truth: &[u8], size: [u32; 2]) -> Result<FlipMap, MetricError> {
    let [width, height] = size;
    let pixels = usize::try_from(measurable(size)?);
    let bytes = pixels.ok().and_then(|pixels| pixels.checked_mul(3));
    for picture in [found, truth] {
        if bytes != Some(picture.len()) {
            return Err(MetricError::Size {
                values: picture.len() / 3,
                width,
                height,
            });
        }
    }
    if found == truth {
        return Ok(FlipMap {
            values: vec![0.0; found.len() / 3],
        });
    }
    let image = |picture| nv_flip::FlipImageRgb8::with_data(width, height, picture);
    let errors = nv_flip::flip(
        image(truth),
        image(found),
        nv_flip::DEFAULT_PIXELS_PER_DEGREE,
    );
    Ok(FlipMap {
        values: errors.to_vec(),
    })
}

/// The number of pixels, if the filters fit and the library can count them.
fn measurable([width, height]: [u32; 2]) -> Result<u32, MetricError> {
    if width < SMALLEST || height < SMALLEST {
        return Err(MetricError::TooSmall {
            width,
            height,
            smallest: SMALLEST,
        });
    }
    // It counts the bytes of a picture in `int`.
    width
        .checked_mul(height)
        .filter(|pixels| *pixels <= i32::MAX as u32 / 3)
        .ok_or(MetricError::TooLarge { width, height })
}

/// Exposures to look at, in stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// At which the brightest pixel is shown as 0.85.
    pub start: f64,
    /// At which the median is.
    pub stop: f64,
    /// How many, evenly spaced, the first and last included.
    pub count: u32,
}

impl Exposures {
    /// The exposures that show a picture: from the one that shows its largest
    /// luminance as 0.85 to the one that does so to its median, in
    /// `max(2, ⌈stop − start⌉)` steps, as the paper has it.
    ///
    /// The median is that of the pixels with light, if the median of all is 0, for
    /// which no exposure exists. A black picture is looked at as it is, at 0 stops;
    /// one of a single luminance at one exposure.
    #[must_use]
    pub fn of(luminances: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = luminances
            .into_iter()
            // Sums of values near the largest there are.
            .map(|luminance| luminance.min(f64::MAX))
            .collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let upper_median = |values: &[f64]| values.get(values.len() / 2).copied();
        let lit = &sorted[sorted.partition_point(|&luminance| luminance <= 0.0)..];
        let median = upper_median(&sorted)
            .filter(|&median| median > 0.0)
            .or_else(|| upper_median(lit));
        let (Some(median), Some(&largest)) = (median, lit.last()) else {
            return Self {
                start: 0.0,
                stop: 0.0,
                count: 1,
            };
        };
        let shown = brightest_shown().log2();
        let (start, stop) = (shown - largest.log2(), shown - median.log2());
        let count = if start < stop {
            // At most 2100 stops, of which `f64` holds no more.
            ((stop - start).ceil() as u32).clamp(2, MOST_EXPOSURES)
        } else {
            1
        };
        Self { start, stop, count }
    }

    /// Each exposure, from the first.
    pub fn iter(self) -> impl Iterator<Item = f64> {
        let step = (self.stop - self.start) / f64::from(self.count.saturating_sub(1).max(1));
        (0..self.count).map(move |number| self.start + f64::from(number) * step)
    }
}

/// The error over all exposures.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// The largest error of each pixel.
    pub map: FlipMap,
    /// At which it was looked for.
    pub exposures: Exposures,
    /// Pixels that are not finite as found. Their error is 1; for their
    /// neighbours' sake they are looked at as if they were right.
    pub non_finite: usize,
}

/// The HDR-FLIP error between two pictures of linear light in the primaries of
/// sRGB, row by row. Light below 0 is none. Channels beyond the third are left out.
///
/// # Errors
/// If the pictures are not of that size, it is smaller than [`SMALLEST`], or the
/// truth is not finite everywhere.
pub fn hdr<const N: usize>(
    found: &[[f64; N]],
    truth: &[[f64; N]],
    size: [u32; 2],
) -> Result<HdrFlip, MetricError> {
    same_size(found.len(), truth.len(), size)?;
    measurable(size)?;
    let (found, truth) = (light(found), light(truth));
    let finite = |pixel: &[f64; 3]| pixel.iter().all(|value| value.is_finite());
    let count = truth.iter().filter(|pixel| !finite(pixel)).count();
    if count > 0 {
        return Err(MetricError::TruthNotFinite { count });
    }
    let broken: Vec<bool> = found.iter().map(|pixel| !finite(pixel)).collect();
    let mended: Vec<[f64; 3]> = found
        .iter()
        .zip(&truth)
        .map(|(&found, &truth)| if finite(&found) { found } else { truth })
        .collect();
    let exposures = Exposures::of(truth.iter().map(luminance));
    let none = || vec![0.0_f32; truth.len()];
    // Nothing to look for at any exposure.
    let mut values = if mended == truth {
        none()
    } else {
        // In any order: the largest is the largest.
        let steps: Vec<f64> = exposures.iter().collect();
        steps
            .into_par_iter()
            .map(|exposure| ldr(&shown(&mended, exposure), &shown(&truth, exposure), size))
            .try_fold(none, |largest, errors| {
                Ok(largest_of(largest, &errors?.values))
            })
            .try_reduce(none, |a, b| Ok(largest_of(a, &b)))?
    };
    for (value, &broken) in values.iter_mut().zip(&broken) {
        if broken {
            *value = 1.0;
        }
    }
    Ok(HdrFlip {
        map: FlipMap { values },
        exposures,
        non_finite: broken.iter().filter(|&&broken| broken).count(),
    })
}

fn largest_of(mut values: Vec<f32>, others: &[f32]) -> Vec<f32> {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = value.max(other);
    }
    values
}

/// Red, green and blue, none below 0: the tone mapper shows darkness less than black
/// as light. Grey of fewer channels.
fn light<const N: usize>(pixels: &[[f64; N]]) -> Vec<[f64; 3]> {
    let channel = |pixel: &[f64; N], channel: usize| {
        let value = pixel.get(channel.min(N.saturating_sub(1))).copied();
        // Not `max`, which drops NaN.
        value.map_or(0.0, |value| if value < 0.0 { 0.0 } else { value })
    };
    pixels
        .iter()
        .map(|pixel| [0, 1, 2].map(|number| channel(pixel, number)))
        .collect()
}

/// Luminance in the primaries of sRGB, to the digits that the authors' program takes.
fn luminance(pixel: &[f64; 3]) -> f64 {
    0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]
}

/// A picture at an exposure, tone-mapped, as 8-bit sRGB.
fn shown(pixels: &[[f64; 3]], exposure: f64) -> Vec<u8> {
    let scale = exposure.exp2();
    let shade = |value: f64| {
        let mapped = tone_map(value * scale);
        (linear_to_srgb(mapped) * 255.0).round() as u8
    };
    pixels.iter().flat_map(|pixel| pixel.map(shade)).collect()
}

/// Numerator and denominator of the tone mapper, from the square down: Narkowicz's
/// fit of ACES (2015), its argument scaled by 0.6 to undo the exposure in it.
const NUMERATOR: [f64; 3] = [0.36 * 2.51, 0.6 * 0.03, 0.0];
const DENOMINATOR: [f64; 3] = [0.36 * 2.43, 0.6 * 0.59, 0.14];

/// What light is shown as, from 0 to 1.
fn tone_map(value: f64) -> f64 {
    // Beyond what is shown as white, to keep the squares finite.
    let value = value.min(1e6);
    let polynomial = |factors: [f64; 3]| (factors[0] * value + factors[1]) * value + factors[2];
    (polynomial(NUMERATOR) / polynomial(DENOMINATOR)).clamp(0.0, 1.0)
}

/// The light that is shown as 0.85: the positive root of the tone mapper less that.
fn brightest_shown() -> f64 {
    let [a, b, c] = [0, 1, 2].map(|power| NUMERATOR[power] - 0.85 * DENOMINATOR[power]);
    let middle = -b / (2.0 * a);
    middle + (middle * middle - c / a).sqrt()
}

#[cfg(test)]
mod tests;

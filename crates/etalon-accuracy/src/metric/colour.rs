//! Colours of high dynamic range.

use super::quantile::{at, sorted};
use super::{MetricError, NonFinite, Sum, same_length};

/// What is added to the square of the truth before it divides: keeps black pixels
/// from deciding everything. Of light of which 1 is white.
pub const RELATIVE_EPSILON: f64 = 0.01;

/// Relative squared error over a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeError {
    /// The mean of all pixels that are finite in both, known as relMSE.
    pub mean: f64,
    /// One pixel in a thousand is worse.
    pub p999: f64,
    /// Of the worst pixel.
    pub largest: f64,
    /// Pixels measured.
    pub pixels: usize,
    /// Pixels not measured.
    pub non_finite: NonFinite,
}

/// The relative squared error of each pixel, the mean over its channels of
/// `(found − truth)² / (truth² + ε)`, ε being [`RELATIVE_EPSILON`]; `None` where
/// either is not finite.
///
/// This is the measure of Rousselle, Knaus and Zwicker, "Adaptive Sampling and
/// Reconstruction using Greedy Error Minimization" (2011). pbrt's MRSE divides by
/// `(truth + 0.01)²` instead. A fourth channel is coverage, not light, and left out.
///
/// # Errors
/// If the slices are empty or of different lengths.
pub fn relative_errors<const N: usize>(
    found: &[[f64; N]],
    truth: &[[f64; N]],
) -> Result<Vec<Option<f64>>, MetricError> {
    same_length(found.len(), truth.len())?;
    let channels = N.min(3);
    if channels == 0 {
        return Err(MetricError::Empty);
    }
    let pixel = |(found, truth): (&[f64; N], &[f64; N])| {
        let (found, truth) = (&found[..channels], &truth[..channels]);
        (finite(found) && finite(truth)).then(|| {
            let terms = found.iter().zip(truth).map(|(found, truth)| {
                // The root first, as the square of a large truth could overflow.
                let relative = (found - truth) / truth.hypot(RELATIVE_EPSILON.sqrt());
                relative * relative
            });
            terms.sum::<f64>() / channels as f64
        })
    };
    Ok(found.iter().zip(truth).map(pixel).collect())
}

/// Relative squared error over a picture, from [`relative_errors`].
///
/// # Errors
/// If the slices are empty or of different lengths, or no pixel is finite in both.
pub fn relative_error<const N: usize>(
    found: &[[f64; N]],
    truth: &[[f64; N]],
) -> Result<RelativeError, MetricError> {
    let errors: Vec<f64> = relative_errors(found, truth)?
        .into_iter()
        .flatten()
        .collect();
    let non_finite = non_finite(found, truth);
    if errors.is_empty() {
        return Err(nothing_finite(non_finite));
    }
    let mut sum = Sum::default();
    for &error in &errors {
        sum.add(error);
    }
    let sorted = sorted(&errors)?;
    Ok(RelativeError {
        mean: sum.value() / errors.len() as f64,
        p999: at(&sorted, 0.999)?,
        largest: at(&sorted, 1.0)?,
        pixels: errors.len(),
        non_finite,
    })
}

/// How much light there is against how much there should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// All channels found over all channels of the truth; 1 if none is lost or made.
    pub ratio: f64,
    /// Pixels added up.
    pub pixels: usize,
    /// Pixels that are in neither sum.
    pub non_finite: NonFinite,
}

impl Energy {
    /// How far the ratio is from 1, so that smaller is better.
    #[must_use]
    pub fn error(&self) -> f64 {
        (self.ratio - 1.0).abs()
    }
}

/// The sum of the first three channels over all pixels, found against truth. Of what
/// spreads light without losing any, such as bloom.
///
/// # Errors
/// If the slices are empty or of different lengths, no pixel is finite in both, or
/// the truth adds up to nothing.
pub fn energy<const N: usize>(
    found: &[[f64; N]],
    truth: &[[f64; N]],
) -> Result<Energy, MetricError> {
    same_length(found.len(), truth.len())?;
    let channels = N.min(3);
    let non_finite = non_finite(found, truth);
    let (mut of_found, mut of_truth) = (Sum::default(), Sum::default());
    let mut pixels = 0;
    for (found, truth) in found.iter().zip(truth) {
        let (found, truth) = (&found[..channels], &truth[..channels]);
        // In both or in neither, that the ratio is of the same pixels.
        if !(finite(found) && finite(truth)) {
            continue;
        }
        pixels += 1;
        found.iter().for_each(|&value| of_found.add(value));
        truth.iter().for_each(|&value| of_truth.add(value));
    }
    if pixels == 0 {
        return Err(nothing_finite(non_finite));
    }
    let whole = of_truth.value();
    if !(whole > 0.0 && whole.is_finite()) {
        return Err(MetricError::NoEnergy(whole));
    }
    Ok(Energy {
        ratio: of_found.value() / whole,
        pixels,
        non_finite,
    })
}

fn finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

fn non_finite<const N: usize>(found: &[[f64; N]], truth: &[[f64; N]]) -> NonFinite {
    let count = |values: &[[f64; N]]| {
        values
            .iter()
            .filter(|value| !finite(&value[..N.min(3)]))
            .count()
    };
    NonFinite {
        found: count(found),
        truth: count(truth),
    }
}

const fn nothing_finite(non_finite: NonFinite) -> MetricError {
    MetricError::NothingFinite {
        found: non_finite.found,
        truth: non_finite.truth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs().max(1e-300)
    }

    #[test]
    fn equal_pictures_have_no_error() {
        let picture = [[0.0, 1.0, 2.0], [1e300, -1.0, 0.5]];
        let error = relative_error(&picture, &picture).unwrap();
        assert_eq!((error.mean, error.p999, error.largest), (0.0, 0.0, 0.0));
        assert_eq!((error.pixels, error.non_finite), (2, NonFinite::default()));
    }

    #[test]
    fn one_channel_off_is_known_in_closed_form() {
        // (0.5)² / (1 + 0.01), over three channels, over two pixels.
        let error = relative_error(
            &[[1.5, 1.0, 1.0, 9.0], [0.0; 4]],
            &[[1.0, 1.0, 1.0, 0.0], [0.0; 4]],
        )
        .unwrap();
        let worst = 0.25 / 1.01 / 3.0;
        assert!(close(error.largest, worst), "{error:?}");
        assert!(close(error.mean, worst / 2.0), "{error:?}");
        // Where truth is black, ε alone divides: 0.1² / 0.01.
        let black = relative_error(&[[0.1]], &[[0.0]]).unwrap();
        assert!(close(black.mean, 1.0), "{black:?}");
    }

    #[test]
    fn the_percentile_sees_two_pixels_in_a_thousand_but_not_one() {
        let truth = vec![[1.0; 3]; 1001];
        let mut found = truth.clone();
        found[500] = [2.0; 3];
        let one = relative_error(&found, &truth).unwrap();
        assert_eq!(one.p999, 0.0);
        assert!(close(one.largest, 1.0 / 1.01) && close(one.mean, 1.0 / 1.01 / 1001.0));
        found[7] = [2.0; 3];
        let two = relative_error(&found, &truth).unwrap();
        assert!(close(two.p999, 1.0 / 1.01), "{two:?}");
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted() {
        let truth = [[1.0; 3], [1.0; 3], [f64::NAN; 3], [1.0; 3]];
        let found = [
            [1.0; 3],
            [1.0, f64::INFINITY, 1.0],
            [1.0; 3],
            [1.0, 1.0, f64::NAN],
        ];
        let error = relative_error(&found, &truth).unwrap();
        assert_eq!((error.mean, error.pixels), (0.0, 1));
        assert_eq!(error.non_finite, NonFinite { found: 2, truth: 1 });
        let map = relative_errors(&found, &truth).unwrap();
        assert_eq!(map, [Some(0.0), None, None, None]);
        assert_eq!(
            relative_error(&[[f64::NAN]], &[[1.0]]),
            Err(MetricError::NothingFinite { found: 1, truth: 0 })
        );
        // An alpha that is not finite is not light.
        assert!(relative_error(&[[1.0, 1.0, 1.0, f64::NAN]], &[[1.0; 4]]).is_ok());
    }

    #[test]
    fn extreme_values_do_not_become_nan() {
        let error = relative_error(&[[f64::MAX]], &[[-f64::MAX]]).unwrap();
        assert_eq!(error.mean, f64::INFINITY);
        let error = relative_error(&[[f64::MAX]], &[[f64::MAX / 2.0]]).unwrap();
        assert!(close(error.mean, 1.0), "{error:?}");
    }

    #[test]
    fn sizes_have_to_agree() {
        let lengths = MetricError::Lengths { found: 1, truth: 2 };
        assert_eq!(relative_error(&[[1.0]], &[[1.0]; 2]), Err(lengths));
        assert_eq!(energy(&[[1.0]], &[[1.0]; 2]), Err(lengths));
        assert_eq!(relative_error::<3>(&[], &[]), Err(MetricError::Empty));
        assert_eq!(energy::<3>(&[], &[]), Err(MetricError::Empty));
        assert_eq!(relative_error(&[[]], &[[]]), Err(MetricError::Empty));
    }

    #[test]
    fn light_that_is_lost_is_missed() {
        let truth = [[1.0, 2.0, 3.0, 1.0], [0.0, 0.0, 4.0, 1.0]];
        // The same light elsewhere.
        let moved = [[0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 7.0, 0.0]];
        assert_eq!(energy(&moved, &truth).unwrap().ratio, 1.0);
        let dim = truth.map(|pixel| pixel.map(|value| value * 0.75));
        let energy_dim = energy(&dim, &truth).unwrap();
        assert_eq!((energy_dim.ratio, energy_dim.error()), (0.75, 0.25));
        // A NaN takes its pixel out of both sums.
        let holed = [truth[0], [f64::NAN; 4]];
        let energy_holed = energy(&holed, &truth).unwrap();
        assert_eq!((energy_holed.ratio, energy_holed.pixels), (1.0, 1));
        assert_eq!(energy_holed.non_finite, NonFinite { found: 1, truth: 0 });
        assert_eq!(
            energy(&truth, &[[0.0; 4]; 2]),
            Err(MetricError::NoEnergy(0.0))
        );
    }
}

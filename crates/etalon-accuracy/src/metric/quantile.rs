//! Quantiles, exact.

use super::MetricError;
use crate::model::Spread;

/// The value below which a share of the values lies.
///
/// All values are sorted, by [`f64::total_cmp`]; the quantile of share `q` of `n`
/// values is at place `q (n − 1)`, counted from 0, and what lies between two places
/// is interpolated linearly (type 7 of Hyndman and Fan 1996; what R and NumPy do
/// unless told otherwise). The median of an even number of values is therefore the
/// mean of the middle two, shares 0 and 1 are the smallest and the largest.
///
/// # Errors
/// If there are no values, or NaN is among them, or the share is outside of 0 to 1.
pub fn quantile(values: &[f64], share: f64) -> Result<f64, MetricError> {
    at(&sorted(values)?, share)
}

/// Median and quartiles of times, each as [`quantile`] has it.
///
/// # Errors
/// If there are no values, or NaN is among them.
pub fn spread(times: &[f64]) -> Result<Spread, MetricError> {
    let sorted = sorted(times)?;
    Ok(Spread {
        median: at(&sorted, 0.5)?,
        lower: at(&sorted, 0.25)?,
        upper: at(&sorted, 0.75)?,
        frames: u32::try_from(sorted.len()).unwrap_or(u32::MAX),
    })
}

/// The values in order, for several quantiles.
pub(super) fn sorted(values: &[f64]) -> Result<Vec<f64>, MetricError> {
    if values.is_empty() {
        return Err(MetricError::Empty);
    }
    if values.iter().any(|value| value.is_nan()) {
        return Err(MetricError::Nan);
    }
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    Ok(sorted)
}

/// See [`quantile`], of values in order.
pub(super) fn at(sorted: &[f64], share: f64) -> Result<f64, MetricError> {
    if !(0.0..=1.0).contains(&share) {
        return Err(MetricError::NotAShare(share));
    }
    let last = sorted.len().checked_sub(1).ok_or(MetricError::Empty)?;
    let place = share * last as f64;
    let below = place.floor();
    let fraction = place - below;
    // In range: the share is at most 1, and rounding is monotonous.
    let index = (below as usize).min(last);
    let (low, high) = (sorted[index], sorted[(index + 1).min(last)]);
    // Neither infinity minus itself nor 0 times infinity is a number.
    if fraction == 0.0 || low == high {
        return Ok(low);
    }
    // Halves before their difference, which of numbers of both signs could overflow.
    Ok(low * (1.0 - fraction) + high * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_quantiles() {
        let values = [4.0, 1.0, 3.0, 2.0];
        for (share, quantile_known) in [
            (0.0, 1.0),
            (0.25, 1.75),
            (0.5, 2.5),
            (0.75, 3.25),
            (1.0, 4.0),
        ] {
            assert_eq!(quantile(&values, share), Ok(quantile_known));
        }
        assert_eq!(quantile(&[7.0], 0.3), Ok(7.0));
        // Of 0 to 1000 the 99.9th percentile is 999.
        let many: Vec<f64> = (0..=1000).rev().map(f64::from).collect();
        assert_eq!(quantile(&many, 0.999), Ok(999.0));
    }

    #[test]
    fn infinite_values_are_values() {
        let values = [f64::INFINITY, 1.0, f64::NEG_INFINITY];
        assert_eq!(quantile(&values, 0.5), Ok(1.0));
        assert_eq!(quantile(&values, 1.0), Ok(f64::INFINITY));
        assert_eq!(quantile(&values, 0.75), Ok(f64::INFINITY));
        assert_eq!(quantile(&[f64::INFINITY; 2], 0.5), Ok(f64::INFINITY));
        assert_eq!(quantile(&[f64::MAX, -f64::MAX], 0.5), Ok(0.0));
    }

    #[test]
    fn what_has_no_order_is_refused() {
        assert_eq!(quantile(&[], 0.5), Err(MetricError::Empty));
        assert_eq!(quantile(&[1.0, f64::NAN], 0.5), Err(MetricError::Nan));
        assert_eq!(quantile(&[-f64::NAN], 0.5), Err(MetricError::Nan));
        assert_eq!(quantile(&[1.0], 1.5), Err(MetricError::NotAShare(1.5)));
        assert!(matches!(
            quantile(&[1.0], f64::NAN),
            Err(MetricError::NotAShare(_))
        ));
    }

    #[test]
    fn times_are_spread_by_their_quartiles() {
        let spread = spread(&[5.0, 1.0, 2.0, 4.0, 3.0]).unwrap();
        assert_eq!(
            (spread.lower, spread.median, spread.upper, spread.frames),
            (2.0, 3.0, 4.0, 5)
        );
    }
}

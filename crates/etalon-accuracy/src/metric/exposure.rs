//! Exposure.

use super::MetricError;

/// How many stops brighter an exposure is than it should be: `log₂(found / truth)`,
/// of factors that colours are multiplied by. Negative where it is darker.
///
/// # Errors
/// If either is not a positive finite number.
pub fn stops(found: f64, truth: f64) -> Result<f64, MetricError> {
    for factor in [found, truth] {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(MetricError::NotPositive(factor));
        }
    }
    // The quotient could overflow, the difference cannot.
    Ok(found.log2() - truth.log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_a_factor_of_two() {
        assert_eq!(stops(8.0, 2.0), Ok(2.0));
        assert_eq!(stops(0.25, 0.5), Ok(-1.0));
        assert_eq!(stops(0.3, 0.3), Ok(0.0));
        assert_eq!(stops(f64::MAX, f64::MIN_POSITIVE), Ok(2046.0));
    }

    #[test]
    fn what_has_no_logarithm_is_refused() {
        for bad in [0.0, -1.0, f64::INFINITY] {
            assert_eq!(stops(bad, 1.0), Err(MetricError::NotPositive(bad)));
            assert_eq!(stops(1.0, bad), Err(MetricError::NotPositive(bad)));
        }
        assert!(stops(f64::NAN, 1.0).is_err());
    }
}

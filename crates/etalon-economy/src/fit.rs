//! A line through points, by least squares.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// `y = intercept + slope · x`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// At x = 0.
    pub intercept: f64,
    /// Per unit of x.
    pub slope: f64,
    /// The share of the variance of y that the line explains, at most 1; 1 where y does
    /// not vary.
    pub r_squared: f64,
}

impl Line {
    /// The line at a place.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

/// Why there is no line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FitError {
    /// Fewer than two different places.
    #[error("a line needs points at two different places at least")]
    TooFew,
    /// A coordinate is none.
    #[error("a point is NaN or infinite")]
    NotFinite,
}

/// The line for which the sum of squares of vertical distances is least.
///
/// # Errors
/// If the points are too few, or not finite.
pub fn line(points: &[(f64, f64)]) -> Result<Line, FitError> {
    if points.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return Err(FitError::NotFinite);
    }
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    // Of what is left of the means, which keeps digits where both are large.
    let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| {
        let each = points.iter().map(|(x, y)| of(x - mean_x, y - mean_y));
        each.sum::<f64>()
    };
    let spread = sum(&|x, _| x * x);
    if points.len() < 2 || spread <= 0.0 {
        return Err(FitError::TooFew);
    }
    let slope = sum(&|x, y| x * y) / spread;
    let total = sum(&|_, y| y * y);
    let left = sum(&|x, y| (y - slope * x) * (y - slope * x));
    Ok(Line {
        intercept: mean_y - slope * mean_x,
        slope,
        r_squared: if total > 0.0 { 1.0 - left / total } else { 1.0 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * a.abs().max(b.abs()).max(1.0)
    }

    #[test]
    fn points_of_a_line_give_the_line() {
        for (intercept, slope) in [(0.0, 1.0), (3.5, -2.0), (1e6, 1e-3), (-4.0, 0.0)] {
            let points: Vec<_> = [0.0, 0.1, 0.5, 1.0]
                .map(|x| (x, intercept + slope * x))
                .to_vec();
            let fit = line(&points).unwrap();
            assert!(near(fit.intercept, intercept), "{fit:?}");
            assert!((fit.slope - slope).abs() < 1e-8, "{fit:?}");
            assert!(fit.r_squared > 1.0 - 1e-8, "{fit:?}");
            assert!(near(fit.at(0.25), intercept + slope * 0.25));
        }
    }

    /// Anscombe's first quartet (F. Anscombe, "Graphs in Statistical Analysis", 1973),
    /// of which the line is known: 3 + x / 2, correlation 0.816.
    #[test]
    fn a_textbook_example() {
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [
            8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68,
        ];
        let points: Vec<_> = x.into_iter().zip(y).collect();
        let fit = line(&points).unwrap();
        assert!((fit.intercept - 3.000_090_9).abs() < 1e-6, "{fit:?}");
        assert!((fit.slope - 0.500_090_9).abs() < 1e-6, "{fit:?}");
        assert!((fit.r_squared - 0.666_542_5).abs() < 1e-6, "{fit:?}");
    }

    /// Three points by hand: (0, 0), (1, 0), (2, 3) have 1.5 x - 0.5, and of a total of
    /// 6 is 1.5 left.
    #[test]
    fn three_points_by_hand() {
        let fit = line(&[(0.0, 0.0), (1.0, 0.0), (2.0, 3.0)]).unwrap();
        assert!(near(fit.intercept, -0.5) && near(fit.slope, 1.5));
        assert!(near(fit.r_squared, 0.75));
    }

    #[test]
    fn what_is_no_line_is_refused() {
        for points in [&[][..], &[(1.0, 1.0)], &[(1.0, 1.0), (1.0, 2.0)]] {
            assert_eq!(line(points), Err(FitError::TooFew));
        }
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(line(&[(0.0, 1.0), (1.0, bad)]), Err(FitError::NotFinite));
            assert_eq!(line(&[(bad, 1.0), (1.0, 1.0)]), Err(FitError::NotFinite));
        }
    }
}

//! Measures of error.
//!
//! Each compares what was found with what is true, over slices of `f64`, and says
//! what it leaves out. Numbers that are not finite are never dropped: they are
//! counted beside the measure, or the measure refuses.

pub mod colour;
pub mod flip;
pub mod hits;
mod quantile;

use thiserror::Error;

pub use quantile::{quantile, spread};

/// Why there is no measure.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MetricError {
    /// What was found and what is true are of different lengths.
    #[error("{found} values were found, of which {truth} are known")]
    Lengths {
        /// Values found.
        found: usize,
        /// Values known.
        truth: usize,
    },
    /// The values do not fill the picture.
    #[error("{values} values are no picture of {width}×{height}")]
    Size {
        /// Values given.
        values: usize,
        /// Pixels in x.
        width: u32,
        /// Pixels in y.
        height: u32,
    },
    /// There is nothing to measure.
    #[error("there are no values")]
    Empty,
    /// The filters of the measure span more pixels than the picture has.
    #[error("{width}×{height} is smaller than {smallest}×{smallest}")]
    TooSmall {
        /// Pixels in x.
        width: u32,
        /// Pixels in y.
        height: u32,
        /// The least that is measured.
        smallest: u32,
    },
    /// More pixels than the measure can count.
    #[error("{width}×{height} is too large")]
    TooLarge {
        /// Pixels in x.
        width: u32,
        /// Pixels in y.
        height: u32,
    },
    /// What should be true is not finite, so it is not true.
    #[error("{count} values that should be the truth are not finite")]
    TruthNotFinite {
        /// How many.
        count: usize,
    },
    /// No pixel is finite in both.
    #[error("no pixel is finite in both: {found} are not as found, {truth} not in truth")]
    NothingFinite {
        /// Pixels not finite as found.
        found: usize,
        /// Pixels not finite in truth.
        truth: usize,
    },
    /// There is NaN among values to put in order.
    #[error("there is NaN among the values")]
    Nan,
    /// The truth adds up to nothing, or to less, so no ratio to it exists.
    #[error("the truth adds up to {0}, of which nothing is a share")]
    NoEnergy(f64),
    /// A share outside of 0 to 1.
    #[error("{0} is not a share from 0 to 1")]
    NotAShare(f64),
}

/// Pixels that no measure of distance can take in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NonFinite {
    /// Pixels that are not finite as found.
    pub found: usize,
    /// Pixels that are not finite in truth.
    pub truth: usize,
}

/// Refuses slices that cannot be compared.
const fn same_length(found: usize, truth: usize) -> Result<(), MetricError> {
    if found != truth {
        return Err(MetricError::Lengths { found, truth });
    }
    if found == 0 {
        return Err(MetricError::Empty);
    }
    Ok(())
}

/// Refuses slices that do not fill a picture; its number of pixels otherwise.
fn same_size(
    found: usize,
    truth: usize,
    [width, height]: [u32; 2],
) -> Result<(usize, usize), MetricError> {
    same_length(found, truth)?;
    let pixels = u64::from(width) * u64::from(height);
    if u64::try_from(found) != Ok(pixels) {
        return Err(MetricError::Size {
            values: found,
            width,
            height,
        });
    }
    // The slices exist, so both sides fit.
    Ok((width as usize, height as usize))
}

/// A sum that loses nothing to the number of its terms (Neumaier 1974).
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        let total = self.total + value;
        self.lost += if self.total.abs() >= value.abs() {
            (self.total - total) + value
        } else {
            (value - total) + self.total
        };
        self.total = total;
    }

    fn value(self) -> f64 {
        let value = self.total + self.lost;
        // What was lost of an infinite sum is not a number.
        if value.is_nan() { self.total } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_keeps_what_a_plain_one_loses() {
        let mut sum = Sum::default();
        for value in [1e16, 1.0, 1.0, -1e16] {
            sum.add(value);
        }
        assert_eq!(sum.value(), 2.0);
        sum.add(f64::INFINITY);
        assert_eq!(sum.value(), f64::INFINITY);
        sum.add(1.0);
        assert_eq!(sum.value(), f64::INFINITY);
    }

    #[test]
    fn sizes_have_to_agree() {
        assert_eq!(same_size(6, 6, [2, 3]), Ok((2, 3)));
        assert_eq!(same_size(0, 0, [0, 3]), Err(MetricError::Empty));
        assert_eq!(
            same_size(6, 5, [2, 3]),
            Err(MetricError::Lengths { found: 6, truth: 5 })
        );
        // Of which the product does not fit in 32 bits.
        assert_eq!(
            same_size(1, 1, [u32::MAX, u32::MAX]),
            Err(MetricError::Size {
                values: 1,
                width: u32::MAX,
                height: u32::MAX
            })
        );
    }
}

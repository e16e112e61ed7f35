//! From which share of the screen on tiles cost more than they save.
//!
//! The time of an effect on tiles is nearly a line, `idle + slope · coverage`, over the
//! share of the screen that its heavy tiles cover; without tiles it is the same whatever
//! the share. `cargo xtask economy --crossover FILE` measures both on a device.

use serde::{Deserialize, Serialize};

/// What an effect takes on a device, in any one unit of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// On tiles, where it concerns nothing.
    pub idle: f64,
    /// What the whole screen takes more than that.
    pub slope: f64,
    /// Without tiles.
    pub whole: f64,
}

/// Of [`ssr`](fn@crate::ssr::ssr) with its defaults, as multiples of its time without
/// tiles, on the interpreter: of what was measured, where tiles pay least (see
/// `docs/measurements/economy.md`).
pub const MEASURED: Cost = Cost {
    idle: 0.012,
    slope: 1.052,
    whole: 1.0,
};

impl Cost {
    /// The share of the screen, in `[0, 1]`, below which tiles are faster: 1 if they
    /// always are, 0 if they never are, or if a number is none.
    ///
    /// ```
    /// use etalon_effects::tiles::crossover::Cost;
    /// let cost = Cost { idle: 0.25, slope: 1.0, whole: 1.0 };
    /// assert_eq!(cost.crossover(), 0.75);
    /// ```
    #[must_use]
    pub fn crossover(&self) -> f64 {
        let saved = self.whole - self.idle;
        if saved.is_nan() || self.slope.is_nan() || saved <= 0.0 {
            return 0.0;
        }
        if saved >= self.slope {
            return 1.0;
        }
        saved / self.slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_cross_where_they_are_equal() {
        let crossover = |idle, slope, whole| Cost { idle, slope, whole }.crossover();
        assert_eq!(crossover(2.0, 16.0, 10.0), 0.5);
        // Always, and never.
        assert_eq!(crossover(1.0, 9.0, 10.0), 1.0);
        assert_eq!(crossover(1.0, -9.0, 10.0), 1.0);
        assert_eq!(crossover(1.0, 0.0, 10.0), 1.0);
        assert_eq!(crossover(10.0, 1.0, 10.0), 0.0);
        assert_eq!(crossover(11.0, 0.0, 10.0), 0.0);
        assert_eq!(crossover(11.0, -5.0, 10.0), 0.0);
        for broken in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for [idle, slope, whole] in [
                [broken, 1.0, 1.0],
                [0.5, broken, 1.0],
                [0.5, 1.0, broken],
                [broken; 3],
            ] {
                let share = crossover(idle, slope, whole);
                assert!((0.0..=1.0).contains(&share), "{idle} {slope} {whole}");
            }
        }
    }
}

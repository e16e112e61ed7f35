//! Time, as clocks on the wall and processors see it.

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

/// A moment.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    wall: Instant,
    processor: Duration,
}

/// What passed between two moments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elapsed {
    /// Seconds on the wall.
    pub wall: f64,
    /// Seconds that processors worked for this process, all threads together.
    /// Other processes on a shared machine add little to it.
    pub processor: f64,
}

impl Moment {
    /// This moment.
    #[must_use]
    pub fn now() -> Self {
        let time = clock_gettime(ClockId::ProcessCPUTime);
        // Neither is ever negative, nanoseconds are below 10⁹.
        let processor = Duration::new(
            u64::try_from(time.tv_sec).unwrap_or_default(),
            u32::try_from(time.tv_nsec).unwrap_or_default(),
        );
        Self {
            wall: Instant::now(),
            processor,
        }
    }

    /// What has passed since.
    #[must_use]
    pub fn elapsed(self) -> Elapsed {
        let now = Self::now();
        Elapsed {
            wall: now.wall.duration_since(self.wall).as_secs_f64(),
            processor: now.processor.saturating_sub(self.processor).as_secs_f64(),
        }
    }
}

/// The middle of some numbers: of two middle ones their mean; NaN for none.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        length if length % 2 == 1 => sorted[middle],
        _ => (sorted[middle - 1] + sorted[middle]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_in_the_middle() {
        assert!(median(&[]).is_nan());
        assert_eq!(median(&[3.0]), 3.0);
        assert_eq!(median(&[9.0, 1.0]), 5.0);
        assert_eq!(median(&[9.0, 1.0, 2.0]), 2.0);
    }

    #[test]
    fn work_takes_time_of_processors_and_sleep_does_not() {
        let start = Moment::now();
        std::thread::sleep(Duration::from_millis(30));
        let slept = start.elapsed();
        assert!(slept.wall >= 0.03);
        let start = Moment::now();
        let mut sum = 0_u64;
        while start.elapsed().processor < 0.01 {
            sum = std::hint::black_box(sum.wrapping_mul(31).wrapping_add(1));
        }
        let worked = start.elapsed();
        // Threads of other tests may add to it, never take away.
        assert!(worked.processor >= 0.01 && worked.wall > 0.0, "{worked:?}");
    }
}

//! What was found, as data.

use etalon_accuracy::model::{Executor, Spread};
use etalon_effects::tiles::crossover::Cost;
use serde::{Deserialize, Serialize};

use crate::fit::Line;
use crate::mask::Layout;

/// Everything that one command found. Times are in nanoseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Economy {
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// The scene's name.
    pub scene: String,
    /// Who executed.
    pub executors: Vec<Executor>,
    /// Reflections by the share of the screen that mirrors, for each executor and layout.
    pub sweeps: Vec<Sweep>,
    /// Whole frames of scenes that lack something.
    pub frames: Vec<LackingFrame>,
    /// What a reader should know: what was left out, and why.
    pub notes: Vec<String>,
}

impl Economy {
    /// The sweeps of one executor.
    #[must_use]
    pub fn of(&self, executor: &str) -> Vec<&Sweep> {
        let sweeps = self.sweeps.iter();
        sweeps.filter(|sweep| sweep.executor == executor).collect()
    }
}

/// Reflections on one executor, by the share of the screen that mirrors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// The executor's id.
    pub executor: String,
    /// How the mirroring texels lie.
    pub layout: Layout,
    /// From the smallest share to the largest.
    pub points: Vec<Point>,
    /// The time on tiles over the share that mirrors: the medians of the points.
    pub fit: Line,
    /// The same over the share that is marched, which is what takes the time.
    pub work: Line,
    /// What that says of when to use tiles.
    pub cost: Cost,
}

/// One share of the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Share of the texels that mirror.
    pub coverage: f64,
    /// Share of the texels in tiles that are marched.
    pub marched: f64,
    /// On tiles.
    pub tiled: Spread,
    /// Of that, marking tiles and making lists.
    pub classification: Spread,
    /// Without tiles.
    pub whole: Spread,
    /// The time on tiles over that without, frame by frame.
    pub ratio: Spread,
}

impl Sweep {
    /// The share of the screen that mirrors below which tiles are faster, by the line
    /// over that share.
    #[must_use]
    pub fn crossover(&self) -> f64 {
        let line = Cost {
            idle: self.fit.intercept,
            slope: self.fit.slope,
            whole: self.cost.whole,
        };
        line.crossover()
    }

    /// The point nearest to a share.
    #[must_use]
    pub fn near(&self, coverage: f64) -> Option<&Point> {
        let away = |point: &&Point| (point.coverage - coverage).abs();
        let mut points = self.points.iter();
        let first = points.next()?;
        Some(points.fold(first, |best, point| {
            if away(&point) < away(&best) {
                point
            } else {
                best
            }
        }))
    }
}

/// A whole frame, of a scene or settings that lack something.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LackingFrame {
    /// What is lacking, in a few words.
    pub lacking: String,
    /// What it is good for.
    pub why: String,
    /// Dispatches of the plan.
    pub dispatches: usize,
    /// Bytes of transient memory.
    pub bytes: u64,
    /// By executor: its id, and the time of a frame.
    pub times: Vec<(String, Spread)>,
}

/// The most that reflections on a hundredth of the screen may take of what they take
/// without tiles, where it is compact.
pub const MOST_AT_A_HUNDREDTH: f64 = 0.08;
/// The most that they may take where everything mirrors.
pub const MOST_AT_ALL: f64 = 1.05;

impl Sweep {
    /// What is aimed at, what it is, and whether it is met; nothing where nothing is.
    #[must_use]
    pub fn targets(&self) -> Vec<(String, f64, bool)> {
        if self.layout != Layout::Compact {
            return Vec::new();
        }
        let aims = [
            (0.01, MOST_AT_A_HUNDREDTH, "1 % of the screen at most 8 %"),
            (1.0, MOST_AT_ALL, "all of the screen at most 105 %"),
        ];
        let aims = aims.into_iter().filter_map(|(share, most, name)| {
            let ratio = self.near(share)?.ratio.median;
            Some((name.to_owned(), ratio, ratio <= most))
        });
        aims.collect()
    }
}

//! What a sweep found, as data: written as JSON, read again to resume, drawn by
//! the report.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Everything that one command found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// Who executed.
    pub executors: Vec<Executor>,
    /// Each effect on each scene.
    pub subjects: Vec<Subject>,
    /// What a reader should know: what was left out, and why.
    pub notes: Vec<String>,
}

/// A backend on a device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Executor {
    /// By which results name it, such as `ash`.
    pub id: String,
    /// What it drives: `vulkan`, or an instruction set.
    pub api: String,
    /// The device's name.
    pub device: String,
    /// The driver's name and version.
    pub driver: String,
}

/// One effect on one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Subject {
    /// The effect's name.
    pub effect: String,
    /// The scene's name.
    pub scene: String,
    /// The knobs that were turned.
    pub knobs: Vec<Knob>,
    /// The measures of error, the main one of each kind first.
    pub metrics: Vec<Metric>,
    /// What is true of the scene, whatever the settings.
    pub facts: Vec<Fact>,
    /// Every setting tried.
    pub points: Vec<Point>,
}

impl Subject {
    /// The main metric of each kind of error: the first there is.
    #[must_use]
    pub fn mains(&self) -> Vec<&Metric> {
        let mut mains: Vec<&Metric> = Vec::new();
        for metric in &self.metrics {
            if !mains.iter().any(|known| known.kind == metric.kind) {
                mains.push(metric);
            }
        }
        mains
    }
}

/// A knob that was turned.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Knob {
    /// Its name.
    pub name: String,
    /// What it does, in a few words.
    pub description: String,
    /// Of a quantity; empty for a share or a number of things.
    pub unit: String,
    /// What it is set to if nobody sets it.
    pub default: String,
}

/// What an error is made of. The three are never added up.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorKind {
    /// Of the same algorithm against itself in `f64`.
    Rounding,
    /// Against the exhaustive method on the same screen data, in `f64`.
    #[default]
    Algorithm,
    /// Against the scene itself.
    Model,
}

/// A measure of error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metric {
    /// By which results name it, such as `algorithm.hit-median`.
    pub id: String,
    /// What the error is made of.
    pub kind: ErrorKind,
    /// A few words: `hit position, median`.
    pub name: String,
    /// Its unit; empty for a ratio.
    pub unit: String,
    /// How it is computed, and what is left out.
    pub description: String,
    /// Whether larger is better, as of a share found; else smaller is.
    pub larger_is_better: bool,
}

/// Something that is true of a scene, whatever the settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fact {
    /// A few words: `rays that the screen cannot answer`.
    pub name: String,
    /// How much.
    pub value: f64,
    /// Its unit; empty for a share.
    pub unit: String,
}

/// One setting of an effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Unique within the subject, of letters that file names may have.
    pub id: String,
    /// Equal for points that plan to the very same work: kernels, settings, sizes.
    pub fingerprint: String,
    /// By knob, every one that was turned: as it was set here.
    pub settings: BTreeMap<String, String>,
    /// `strict` or `fast`.
    pub arithmetic: String,
    /// The preset it is, if it is one.
    pub preset: Option<String>,
    /// Device memory of the plan's own textures and buffers, in bytes.
    pub bytes: u64,
    /// What the interpreter counted.
    pub work: Work,
    /// One for each executor that ran it.
    pub results: Vec<Outcome>,
}

impl Point {
    /// How an executor did.
    #[must_use]
    pub fn on(&self, executor: &str) -> Option<&Outcome> {
        self.results
            .iter()
            .find(|result| result.executor == executor)
    }

    /// The median time of an executor, in nanoseconds, if it was measured.
    #[must_use]
    pub fn time_on(&self, executor: &str) -> Option<f64> {
        Some(self.on(executor)?.time?.median)
    }

    /// An error on an executor, by metric id, if it could be had.
    #[must_use]
    pub fn error_on(&self, executor: &str, metric: &str) -> Option<f64> {
        self.on(executor)?.errors.get(metric).copied()
    }
}

/// Work that depends on no hardware, of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Texels loaded or sampled, over all invocations.
    pub texel_fetches: u64,
    /// Operations executed, over all invocations.
    pub operations: u64,
    /// Texels looked at along a ray, in the mean over rays, of effects that march.
    pub steps_per_ray: Option<f64>,
}

/// How one executor did at one point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The executor's id.
    pub executor: String,
    /// The device's time for a frame; `None` until it was measured.
    pub time: Option<Spread>,
    /// By metric id. A number that cannot be had is missing.
    pub errors: BTreeMap<String, f64>,
    /// The result, a PNG beside the report.
    pub picture: Option<String>,
    /// How it differs from the truth, a PNG beside the report.
    pub difference: Option<String>,
}

/// Times of several frames, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Half were faster.
    pub median: f64,
    /// A quarter were faster.
    pub lower: f64,
    /// A quarter were slower.
    pub upper: f64,
    /// How many there were.
    pub frames: u32,
}

//! The result of a comparison of backends, as the JSON file has it and as the
//! table and the HTML report show it.

use std::fmt;
use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;

use crate::compare::{Comparison, Tolerance, Verdict};
use crate::drivers::{BadManifest, Driver};
use crate::execute::outcome::{Device, Time};

/// A backend of Etalon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackendKind {
    /// The interpreter: the reference of every comparison.
    Cpu,
    /// wgpu.
    Wgpu,
    /// Vulkan by ash.
    Ash,
}

impl fmt::Display for BackendKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Wgpu => "wgpu",
            Self::Ash => "ash",
        })
    }
}

/// What a backend runs on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Target {
    /// The processor itself.
    Host,
    /// A Vulkan driver.
    Vulkan(Driver),
    /// The system's OpenGL.
    Gl,
}

/// A backend on a target.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Executor {
    /// Short and unique: `cpu`, `ash/lavapipe`, `wgpu/gl`.
    pub id: String,
    /// The backend.
    pub backend: BackendKind,
    /// What it runs on.
    pub target: Target,
}

impl Executor {
    /// A backend on a target.
    #[must_use]
    pub fn new(backend: BackendKind, target: Target) -> Self {
        let id = match &target {
            Target::Host => backend.to_string(),
            Target::Vulkan(driver) => format!("{backend}/{}", driver.name),
            Target::Gl => format!("{backend}/gl"),
        };
        Self {
            id,
            backend,
            target,
        }
    }

    /// The driver's short name: `lavapipe`, `gl`; `host` for the processor.
    #[must_use]
    pub fn driver(&self) -> &str {
        match &self.target {
            Target::Host => "host",
            Target::Vulkan(driver) => &driver.name,
            Target::Gl => "gl",
        }
    }
}

/// What was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Frames run one after another, histories carried over.
    pub frames: u32,
    /// The effects applied, each by itself.
    pub effects: Vec<String>,
    /// Names of the scenes, or the file of the frame.
    pub scenes: Vec<String>,
    /// `strict`, `fast` or both.
    pub arithmetic: Vec<String>,
    /// Backends that have to run and agree.
    pub required: Vec<BackendKind>,
}

/// One effect on one scene in one arithmetic: what is compared with each other.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Case {
    /// The scene, or the file of the frame.
    pub scene: String,
    /// The effect.
    pub effect: String,
    /// `strict` or `fast`.
    pub arithmetic: String,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} on {}, {} arithmetic",
            self.effect, self.scene, self.arithmetic
        )
    }
}

/// How one executor did in one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// The case.
    #[serde(flatten)]
    pub case: Case,
    /// The executor's id.
    pub executor: String,
    /// How it went.
    #[serde(flatten)]
    pub status: Status,
}

/// How an execution went.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum Status {
    /// To its end.
    Ran {
        /// Who ran it.
        device: Device,
        /// Time of each step in the last frame; empty where the device cannot
        /// tell.
        times: Vec<Time>,
        /// What the interpreter's checks found, a line each.
        findings: Vec<String>,
    },
    /// There is no device behind the driver.
    NoDevice {
        /// What the backend says.
        reason: String,
    },
    /// The device lacks something that the passes need.
    Unsupported {
        /// What.
        reason: String,
    },
    /// It ended with an error.
    Failed {
        /// The error.
        reason: String,
    },
    /// The process ended without a word, as when a driver crashes.
    Crashed {
        /// How it ended, and the end of what it wrote to standard error.
        reason: String,
    },
}

impl Status {
    /// The reason of any status but [`Status::Ran`].
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Ran { .. } => None,
            Self::NoDevice { reason }
            | Self::Unsupported { reason }
            | Self::Failed { reason }
            | Self::Crashed { reason } => Some(reason),
        }
    }

    /// In one or two words.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Ran { .. } => "ran",
            Self::NoDevice { .. } => "no device",
            Self::Unsupported { .. } => "not supported",
            Self::Failed { .. } => "failed",
            Self::Crashed { .. } => "crashed",
        }
    }

    /// Whether something is wrong with the backend or the driver, rather than
    /// absent.
    #[must_use]
    pub const fn is_fault(&self) -> bool {
        matches!(self, Self::Failed { .. } | Self::Crashed { .. })
    }
}

/// Pictures of a comparison, as paths relative to the report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Pictures {
    /// Of the reference.
    pub reference: PathBuf,
    /// Of the image under test, shown as the reference is.
    pub subject: PathBuf,
    /// Where they differ; `None` where nothing does.
    pub difference: Option<PathBuf>,
}

/// One resource written by one pass, in two executions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonReport {
    /// The case.
    #[serde(flatten)]
    pub case: Case,
    /// Which frame, from 0.
    pub frame: u32,
    /// The pass's name.
    pub pass: String,
    /// The binding it wrote.
    pub binding: String,
    /// The resource's name in the plan.
    pub resource: String,
    /// Its shape and format.
    pub shape: String,
    /// The executor that is right by definition.
    pub reference: String,
    /// The executor under test.
    pub subject: String,
    /// Its backend.
    pub backend: BackendKind,
    /// Its driver.
    pub driver: String,
    /// The figures; `None` if there was nothing to compare with.
    pub figures: Option<Comparison>,
    /// What is tolerated.
    pub tolerance: Tolerance,
    /// Where the tolerance comes from.
    pub tolerance_reason: String,
    /// The outcome.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Pictures, if a report was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pictures: Option<Pictures>,
}

/// Everything.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Whether all required backends ran and agree.
    pub ok: bool,
    /// Why not, a line each: the executors that did not run, and for each that
    /// disagrees the first pass that does.
    pub problems: Vec<String>,
    /// What is no fault but worth knowing.
    pub notes: Vec<String>,
    /// What was asked for.
    pub settings: Settings,
    /// Who was there to ask.
    pub executors: Vec<Executor>,
    /// Driver manifests that are of no use.
    pub unusable_manifests: Vec<BadManifest>,
    /// How each executor did in each case.
    pub runs: Vec<RunReport>,
    /// What came out, in the order of cases, pairs of executors, and steps.
    pub comparisons: Vec<ComparisonReport>,
}

impl Report {
    /// The cases, each once, in order.
    #[must_use]
    pub fn cases(&self) -> Vec<&Case> {
        let mut cases: Vec<&Case> = Vec::new();
        for run in &self.runs {
            if !cases.contains(&&run.case) {
                cases.push(&run.case);
            }
        }
        cases
    }

    /// The run of an executor in a case.
    #[must_use]
    pub fn run(&self, case: &Case, executor: &str) -> Option<&RunReport> {
        self.runs
            .iter()
            .find(|run| run.case == *case && run.executor == executor)
    }

    /// How an executor did in all cases together, in a few words, and whether
    /// that is a fault.
    #[must_use]
    pub fn state(&self, executor: &str) -> (&'static str, bool) {
        let statuses = || {
            self.runs
                .iter()
                .filter(|run| run.executor == executor)
                .map(|run| &run.status)
        };
        if let Some(fault) = statuses().find(|status| status.is_fault()) {
            return (fault.word(), true);
        }
        let ran = |status: &Status| matches!(status, Status::Ran { .. });
        let word = match statuses().find(|status| !ran(status)) {
            Some(_) if statuses().any(ran) => "ran in part",
            Some(status) => status.word(),
            None if statuses().next().is_some() => "ran",
            None => "not run",
        };
        (word, false)
    }

    /// The device an executor ran on.
    #[must_use]
    pub fn device(&self, executor: &str) -> Option<&Device> {
        self.runs
            .iter()
            .filter(|run| run.executor == executor)
            .find_map(|run| match &run.status {
                Status::Ran { device, .. } => Some(device),
                _ => None,
            })
    }

    /// The comparisons of a case.
    pub fn comparisons_of<'a>(
        &'a self,
        case: &'a Case,
    ) -> impl Iterator<Item = &'a ComparisonReport> {
        self.comparisons
            .iter()
            .filter(move |comparison| comparison.case == *case)
    }
}

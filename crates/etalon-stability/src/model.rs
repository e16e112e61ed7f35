//! What was found, as data.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::judge::agreement::Difference;
use crate::judge::finite::NonFinite;
use crate::judge::rounding::Rounding;
use crate::judge::spread::{Outside, Width};
use crate::judge::truth::Untrue;
use crate::sanitise;

/// Everything that a run found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// How much was run.
    pub totals: Totals,
    /// Who ran it.
    pub executors: Vec<ExecutorInfo>,
    /// An entry for each case and effect, in the order they were run in.
    pub cases: Vec<CaseReport>,
    /// What the sanitiser found in kernels, over all cases: what counts against them
    /// first.
    pub sites: Vec<sanitise::Finding>,
    /// Where, for each of those that there was room for.
    #[serde(skip)]
    pub maps: Vec<Option<sanitise::HeatMap>>,
    /// What comments in kernels allow and was not found: file, line and fault.
    pub unused: Vec<(String, u32, String)>,
    /// What was said to values that are not allowed.
    pub refusals: Vec<Refusal>,
    /// Executors that were not there, and why.
    pub notes: Vec<String>,
    /// Processes that gave no report, and how they ended.
    pub failures: Vec<String>,
}

impl Report {
    /// All findings with their cases.
    pub fn findings(&self) -> impl Iterator<Item = (&CaseReport, &Finding)> {
        self.cases
            .iter()
            .flat_map(|case| case.findings.iter().map(move |finding| (case, finding)))
    }

    /// Values that should have been refused and were not.
    pub fn accepted(&self) -> impl Iterator<Item = &Refusal> {
        self.refusals
            .iter()
            .filter(|refusal| refusal.error.is_none())
    }

    /// Whether nothing was found that should not be.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.findings().next().is_none()
            && self.accepted().next().is_none()
            && self.failures.is_empty()
    }

    /// Counts what there is into [`Report::totals`].
    pub fn count(&mut self) {
        let names: BTreeSet<&str> = self.cases.iter().map(|case| case.name.as_str()).collect();
        let results = self.cases.iter().flat_map(|case| &case.results);
        self.totals = Totals {
            cases: names.len(),
            pairs: self.cases.len(),
            executions: results.map(|result| result.executions).sum(),
            refusals: self.refusals.len(),
            findings: self.findings().count() + self.accepted().count() + self.failures.len(),
        };
    }
}

/// How much was run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Totals {
    /// Named cases.
    pub cases: usize,
    /// Cases with an effect.
    pub pairs: usize,
    /// Frames executed, on all executors together.
    pub executions: u64,
    /// Values tried that are not allowed.
    pub refusals: usize,
    /// Findings, values that were not refused, and processes without a report.
    pub findings: usize,
}

/// Who executed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExecutorInfo {
    /// The executor's name.
    pub name: String,
    /// What it drives.
    pub api: String,
    /// Its device.
    pub device: String,
    /// The device's driver.
    pub driver: String,
}

/// What became of one effect on one case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseReport {
    /// The case.
    pub name: String,
    /// What it is hard about.
    pub family: String,
    /// The effect.
    pub effect: String,
    /// Why the case is hard.
    pub reason: String,
    /// Where that is known from.
    pub source: String,
    /// Width and height.
    pub size: [u32; 2],
    /// Frames in a row.
    pub frames: usize,
    /// Knobs that were set.
    pub knobs: BTreeMap<String, String>,
    /// A larger rounding error that is expected, and why.
    pub expected: Option<ExpectedError>,
    /// An entry for each executor.
    pub results: Vec<ExecutorResult>,
    /// What should not be.
    pub findings: Vec<Finding>,
    /// What should not be and a driver is known for.
    pub excused: Vec<Excused>,
}

impl CaseReport {
    /// The rounding error as a share of what is allowed, the largest of all; 0 where
    /// there is none to speak of.
    #[must_use]
    pub fn strain(&self) -> f64 {
        self.results
            .iter()
            .filter_map(|result| result.rounding.as_ref())
            .map(Rounding::strain)
            .fold(0.0, f64::max)
    }

    /// The result of an executor.
    #[must_use]
    pub fn on(&self, executor: &str) -> Option<&ExecutorResult> {
        self.results
            .iter()
            .find(|result| result.executor == executor)
    }
}

/// A rounding error that a case declares.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExpectedError {
    /// Largest, relative.
    pub bound: f64,
    /// Why.
    pub reason: String,
}

/// How an executor ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
pub enum Status {
    /// It ran.
    #[default]
    Ran,
    /// The device cannot do what the effect needs.
    Unsupported {
        /// What.
        reason: String,
    },
    /// It could not be run.
    Failed {
        /// Why.
        reason: String,
    },
}

/// What an executor made of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExecutorResult {
    /// The executor's name.
    pub executor: String,
    /// How it ended.
    pub status: Status,
    /// Frames executed.
    pub executions: u64,
    /// Captures looked at.
    pub stores: usize,
    /// Of all bits stored: equal in runs that stored the same. Of the interpreter.
    pub digest: Option<u64>,
    /// What is no number.
    pub non_finite: Option<NonFinite>,
    /// What is not as the effect's truth says; of the interpreter.
    pub untrue: Option<Untrue>,
    /// Where it is not the interpreter's bits; of devices.
    pub difference: Option<Difference>,
    /// How far `f32` is from `f64`; of the shadow.
    pub rounding: Option<Rounding>,
    /// How far perturbed executions are from each other; of those.
    pub spread: Option<Width>,
    /// Where fast arithmetic is outside of what they allow; of devices.
    pub outside: Option<Outside>,
    /// What the sanitiser counted; of the sanitiser.
    pub sanitised: Option<sanitise::Counts>,
}

/// What kind of thing should not be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// An infinity or NaN was stored.
    NonFinite,
    /// The effect's truth, computed in `f64` from its definition, says otherwise.
    Untrue,
    /// A device's bits are not the interpreter's.
    Disagreement,
    /// `f32` is too far from `f64`.
    Rounding,
    /// A device's fast arithmetic is outside of what perturbed executions allow.
    Outside,
    /// A kernel gave birth to a NaN or infinity.
    Birth,
    /// A kernel stores what rounding has made inaccurate.
    Inaccurate,
    /// The interpreter's checks saw an access out of bounds, an endless loop, a division
    /// by zero or the like.
    Check,
    /// A fault in one frame shows longer than it may.
    Recovery,
    /// It could not be run.
    Failure,
}

/// Something that should not be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What kind.
    pub kind: FindingKind,
    /// Who.
    pub executor: String,
    /// What and where.
    pub text: String,
}

/// A finding that an exception is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Excused {
    /// What was found.
    pub finding: Finding,
    /// Why the driver is known for it.
    pub reason: String,
}

/// What was said to a value that is not allowed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Refusal {
    /// The effect.
    pub effect: String,
    /// The knob.
    pub knob: String,
    /// As given.
    pub value: String,
    /// The error; `None` if there was none, which is a fault.
    pub error: Option<String>,
}

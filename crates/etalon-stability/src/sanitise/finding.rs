//! What the sanitiser found over many cases.

use std::collections::BTreeMap;

use etalon_cpu::StepSanitised;
use etalon_cpu::sanitise::{Count, Fault, Site};
use serde::{Deserialize, Serialize};

use super::allow::Allowances;
use super::heat::HeatMap;

/// A fault at a place of a kernel, over all cases.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// The kernel's file, line and column.
    pub file: String,
    /// From 1.
    pub line: u32,
    /// From 1.
    pub column: u32,
    /// The operation, as the interpreter lists it.
    pub operation: String,
    /// [`Fault::name`].
    pub fault: String,
    /// Whether a kernel must not have it: then it is an error unless it is allowed.
    pub is_error: bool,
    /// Why a comment in the kernel allows it.
    pub allowed: Option<String>,
    /// Times that an invocation did it.
    pub times: u64,
    /// Of so many, in the cases in which it happened.
    pub executions: u64,
    /// In how many cases.
    pub cases: u64,
    /// The most that was wrong: the relative error; of decisions the margin; of births
    /// and deaths their number.
    pub severity: f64,
    /// The largest error in units in the last place.
    pub max_ulps: f64,
    /// What 99 % of errors are at most, in the case that is worst.
    pub p99_ulps: f64,
    /// The part of it that the operation made itself.
    pub introduced_ulps: f64,
    /// Leading bits that cancelled.
    pub cancelled_bits: u32,
    /// The case in which it is worst, the step of it, and the invocation.
    pub worst_case: String,
    /// As the plan names it.
    pub worst_step: String,
    /// `global_invocation_id`.
    pub worst_invocation: [u32; 3],
    /// What that computed.
    pub value: f32,
    /// And what its twin did. Not a number where that is infinite or NaN.
    pub exact: Option<f64>,
    /// The file of its heat map in the report.
    pub heat: Option<String>,
}

impl Finding {
    /// Whether it counts against the kernel.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.is_error && self.allowed.is_none()
    }

    /// The place.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A finding, and where its invocations were in the worst case.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// What was found.
    pub finding: Finding,
    /// Where, if there was room to note it.
    pub map: Option<HeatMap>,
    last_case: String,
}

type Key = (String, u32, u32, String, Fault);

/// Collects over cases.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    found: BTreeMap<Key, Found>,
}

impl Findings {
    /// Adds what was found in the steps of a case.
    pub fn add(&mut self, case: &str, steps: &[StepSanitised], allowances: &mut Allowances) {
        for step in steps {
            for site in &step.found.sites {
                for (fault, count) in site.faults() {
                    self.add_fault((case, step), site, (fault, count), allowances);
                }
            }
        }
    }

    fn add_fault(
        &mut self,
        (case, step): (&str, &StepSanitised),
        site: &Site,
        (fault, count): (Fault, Count),
        allowances: &mut Allowances,
    ) {
        let place = &site.location;
        let severity = match fault {
            Fault::Birth | Fault::Death => count.times as f64,
            Fault::UnstableBranch | Fault::UnstableIndex => site.unstable_margin,
            Fault::Inaccurate | Fault::Cancellation | Fault::Amplification => site.max_relative,
        };
        let key = (
            place.file.clone(),
            place.line,
            place.column,
            site.operation.clone(),
            fault,
        );
        let found = self.found.entry(key).or_insert_with(|| Found {
            finding: Finding {
                file: place.file.clone(),
                line: place.line,
                column: place.column,
                operation: site.operation.clone(),
                fault: fault.name().to_owned(),
                is_error: fault.is_error(),
                allowed: allowances.reason(place, fault),
                times: 0,
                executions: 0,
                cases: 0,
                severity: -1.0,
                max_ulps: 0.0,
                p99_ulps: 0.0,
                introduced_ulps: 0.0,
                cancelled_bits: 0,
                worst_case: String::new(),
                worst_step: String::new(),
                worst_invocation: [0; 3],
                value: 0.0,
                exact: None,
                heat: None,
            },
            map: None,
            last_case: String::new(),
        });
        let finding = &mut found.finding;
        finding.times += count.times;
        finding.executions += site.executions;
        finding.max_ulps = finding.max_ulps.max(site.max_ulps);
        finding.introduced_ulps = finding.introduced_ulps.max(site.introduced_ulps);
        finding.cancelled_bits = finding.cancelled_bits.max(site.cancelled_bits);
        if found.last_case != case {
            found.last_case = case.to_owned();
            finding.cases += 1;
        }
        if severity > finding.severity {
            let worst = match fault {
                Fault::Inaccurate | Fault::Cancellation | Fault::Amplification => site.worst,
                _ => count.first,
            };
            finding.severity = severity;
            finding.p99_ulps = site.p99_ulps;
            finding.worst_case = case.to_owned();
            finding.worst_step.clone_from(&step.step);
            finding.worst_invocation = worst.invocation;
            finding.value = worst.value;
            finding.exact = worst.exact.is_finite().then_some(worst.exact);
            found.map = HeatMap::new(step.found.grid, &site.heat);
        }
    }

    /// All of them: what counts against a kernel first, then what is not allowed, each
    /// the worst first.
    #[must_use]
    pub fn sorted(self) -> Vec<Found> {
        let mut sorted: Vec<Found> = self.found.into_values().collect();
        let rank = |found: &Found| {
            let finding = &found.finding;
            (!finding.counts(), finding.allowed.is_some())
        };
        sorted.sort_by(|a, b| {
            let severity = b.finding.severity.total_cmp(&a.finding.severity);
            rank(a).cmp(&rank(b)).then(severity)
        });
        sorted
    }
}

//! What is made of what the sanitiser found in one case.

use etalon_cpu::sanitise::Fault;
use etalon_cpu::{Finding, FindingKind as CheckKind, StepFinding, StepSanitised};
use serde::{Deserialize, Serialize};

use super::allow::{AllowError, Allowances};
use super::effect::{Effect, effect};
use super::finding::{Findings, Found};
use crate::executors::Kind;
use crate::model::{Finding as CaseFinding, FindingKind};
use crate::observe::Store;

/// How often what happened in a case, in all of its steps and frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Operations followed, each in one invocation.
    pub executions: u64,
    /// NaN and infinities from finite operands.
    pub births: u64,
    /// Such that ended without a trace.
    pub deaths: u64,
    /// Texels stored whose error is visible.
    pub inaccurate: u64,
    /// Comparisons that turn out otherwise in `f64`.
    pub unstable_branches: u64,
    /// Integers that are others in `f64`.
    pub unstable_indices: u64,
    /// What these decisions do to what is stored, where that could be told.
    pub effect: Effect,
}

/// Follows a run.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    allowances: Allowances,
    findings: Findings,
}

impl Watch {
    /// With what the embedded kernels allow.
    ///
    /// # Errors
    /// If a comment in a kernel cannot be understood.
    pub fn new() -> Result<Self, AllowError> {
        Ok(Self {
            allowances: Allowances::of_kernels()?,
            findings: Findings::default(),
        })
    }

    /// Adds what was found in the steps of a case; what counts against kernels. Stores
    /// whose error is within `expected`, if the case declares one, do not.
    pub fn look(
        &mut self,
        case: &str,
        steps: &[StepSanitised],
        expected: Option<f64>,
        counts: &mut Counts,
    ) -> Vec<CaseFinding> {
        let mut found = Vec::new();
        for site in steps.iter().flat_map(|step| &step.found.sites) {
            counts.executions += site.executions;
            for (fault, count) in site.faults() {
                let total = match fault {
                    Fault::Birth => &mut counts.births,
                    Fault::Death => &mut counts.deaths,
                    Fault::Inaccurate => &mut counts.inaccurate,
                    Fault::UnstableBranch => &mut counts.unstable_branches,
                    Fault::UnstableIndex => &mut counts.unstable_indices,
                    Fault::Cancellation | Fault::Amplification => continue,
                };
                *total += count.times;
                if !fault.is_error() || self.allowances.reason(&site.location, fault).is_some() {
                    continue;
                }
                let (kind, worst) = match fault {
                    Fault::Birth => (FindingKind::Birth, count.first),
                    _ => (FindingKind::Inaccurate, site.worst),
                };
                if kind == FindingKind::Inaccurate
                    && expected.is_some_and(|bound| site.max_relative <= bound)
                {
                    continue;
                }
                found.push(CaseFinding {
                    kind,
                    executor: "sanitiser".to_owned(),
                    text: format!(
                        "{}: {fault} in {} of {} executions of {}, {:e} in place of {:e} in invocation {:?}",
                        site.location,
                        count.times,
                        site.executions,
                        site.operation,
                        worst.value,
                        worst.exact,
                        worst.invocation
                    ),
                });
            }
        }
        self.findings.add(case, steps, &mut self.allowances);
        found
    }

    /// What the interpreter's checks found, but for births that a comment allows.
    pub fn checked(&mut self, kind: Kind, found: Vec<StepFinding>) -> Vec<CaseFinding> {
        found
            .into_iter()
            .filter(|found| {
                let Finding { kind, location, .. } = &found.finding;
                *kind != CheckKind::NonFinite
                    || self.allowances.reason(location, Fault::Birth).is_none()
            })
            .map(|found| CaseFinding {
                kind: FindingKind::Check,
                executor: kind.to_string(),
                text: found.to_string(),
            })
            .collect()
    }

    /// Everything found, sorted, and what is allowed but was not found.
    #[must_use]
    pub fn finish(self) -> (Vec<Found>, Vec<(String, u32, String)>) {
        let unused = self.allowances.unused().into_iter();
        let unused = unused
            .map(|(file, line, fault)| (file.to_owned(), line, fault.name().to_owned()))
            .collect();
        (self.findings.sorted(), unused)
    }
}

impl Counts {
    /// Adds what decisions do to a frame: what its passes stored in `f32`, and in an
    /// `f64` that decides for itself.
    pub fn compare(&mut self, steps: &[StepSanitised], single: &[Store], double: &[Store]) {
        for step in steps {
            let diverged = &step.found.diverged;
            if !diverged.contains(&true) {
                continue;
            }
            let (Some(image), Some(wide)) = (
                find(single, &step.step).and_then(|store| store.image.as_ref()),
                find(double, &step.step).and_then(|store| store.wide.as_ref()),
            ) else {
                continue;
            };
            let Ok(texels) = image.to_rgba_f32() else {
                continue;
            };
            let found = effect(
                (step.found.grid, diverged),
                image.desc.extent.width,
                &texels,
                wide,
            );
            self.effect.texels += found.texels;
            self.effect.changed += found.changed;
            self.effect.largest = self.effect.largest.max(found.largest);
        }
    }
}

/// The first that a step wrote.
fn find<'a>(stores: &'a [Store], step: &str) -> Option<&'a Store> {
    stores.iter().find(|store| store.pass == step)
}

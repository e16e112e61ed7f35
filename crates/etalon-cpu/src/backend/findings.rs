//! What the checks of a backend's programs found.

use std::fmt;

use crate::finding::Finding;
use crate::sanitise::Sanitised;

/// A finding and the step of the plan it is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepFinding {
    /// The step's name.
    pub step: String,
    /// What was found.
    pub finding: Finding,
}

/// What the sanitiser found in a step of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct StepSanitised {
    /// The step's name.
    pub step: String,
    /// The kernel's.
    pub kernel: String,
    /// What was found.
    pub found: Sanitised,
}

impl fmt::Display for StepFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.step, self.finding)
    }
}

/// What was found since the last [`crate::CpuBackend::take_findings`], in the
/// order in which steps ran. The same kind at the same place in the same step is
/// one entry, whose count grows with every frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// At most [`Findings::MAX`] of them.
    pub list: Vec<StepFinding>,
    /// How often something was found that is not in the list because it is full.
    pub omitted: u64,
}

impl Findings {
    /// Most entries that are kept.
    pub const MAX: usize = 1024;

    /// Whether nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty() && self.omitted == 0
    }

    pub(super) fn add(&mut self, step: &str, found: Vec<Finding>) {
        for finding in found {
            let known = self.list.iter_mut().find(|known| {
                known.step == step
                    && known.finding.kind == finding.kind
                    && known.finding.location == finding.location
            });
            if let Some(known) = known {
                let count = &mut known.finding.count;
                *count = count.saturating_add(finding.count);
            } else if self.list.len() < Self::MAX {
                self.list.push(StepFinding {
                    step: step.to_owned(),
                    finding,
                });
            } else {
                self.omitted = self.omitted.saturating_add(finding.count);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Location;
    use crate::finding::FindingKind;

    fn finding(line: u32) -> Finding {
        Finding {
            kind: FindingKind::Shift,
            location: Location {
                file: "a.wgsl".to_owned(),
                line,
                column: 1,
            },
            message: String::new(),
            workgroup: [0; 3],
            invocation: [0; 3],
            count: 2,
        }
    }

    #[test]
    fn entries_are_joined_and_bounded_and_counts_exact() {
        let mut findings = Findings::default();
        assert!(findings.is_empty());
        let many = Findings::MAX as u32 + 3;
        for _ in 0..2 {
            findings.add("step", (0..many).map(finding).collect());
        }
        assert_eq!(findings.list.len(), Findings::MAX);
        assert!(findings.list.iter().all(|entry| entry.finding.count == 4));
        assert_eq!(findings.omitted, 3 * 2 * 2);
        findings.list.clear();
        assert!(!findings.is_empty());
        findings.add("one", vec![finding(0)]);
        findings.add("two", vec![finding(0)]);
        assert_eq!(findings.list.len(), 2);
        assert!(
            findings.list[1]
                .to_string()
                .starts_with("two: a.wgsl:0:1: ")
        );
    }
}

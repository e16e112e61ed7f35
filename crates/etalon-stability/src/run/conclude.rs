//! What of the results should not be.

use crate::model::{ExecutorResult, Finding, FindingKind, Status};

/// What should not be in a result.
pub(crate) fn conclusions(result: &ExecutorResult) -> Vec<Finding> {
    let finding = |kind, text| Finding {
        kind,
        executor: result.executor.clone(),
        text,
    };
    let mut found = Vec::new();
    if let Status::Failed { reason } = &result.status {
        found.push(finding(FindingKind::Failure, reason.clone()));
    }
    if let Some(wrong) = &result.non_finite {
        found.push(finding(
            FindingKind::NonFinite,
            format!(
                "{} channels are no numbers, the first: {}",
                wrong.channels, wrong.first
            ),
        ));
    }
    if let Some(wrong) = &result.untrue {
        found.push(finding(
            FindingKind::Untrue,
            format!(
                "{} texels are not what the effect's truth says, the first: {}, {}",
                wrong.texels, wrong.first, wrong.what
            ),
        ));
    }
    if let Some(wrong) = &result.difference {
        found.push(finding(
            FindingKind::Disagreement,
            format!(
                "{} texels differ, the first: {}, {:e} in place of {:e}",
                wrong.texels, wrong.first, wrong.subject, wrong.reference
            ),
        ));
    }
    if let Some(wrong) = &result.outside {
        found.push(finding(
            FindingKind::Outside,
            format!(
                "{} texels are outside of what perturbed executions allow, where {} may be, the first: {}, {:e}, \
                 not within {:e} of {:e}",
                wrong.texels, wrong.tolerated, wrong.first, wrong.subject, wrong.allowed, wrong.centre
            ),
        ));
    }
    if let Some(wrong) = result.rounding.as_ref().filter(|wrong| wrong.beyond > 0) {
        found.push(finding(
            FindingKind::Rounding,
            format!(
                "{} texels are off by more than {:.2e}, the worst by {:.2e}: {}, {:e} in place of {:e}",
                wrong.beyond, wrong.allowed, wrong.max, wrong.at, wrong.stored, wrong.exact
            ),
        ));
    }
    found
}

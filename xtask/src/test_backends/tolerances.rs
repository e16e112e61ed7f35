//! What is tolerated where.

use super::evaluate::Finished;
use super::model::Case;
use crate::compare::Tolerance;
use crate::execute::outcome::Capture;

/// The tolerances of a pair of executions in a case.
pub fn of(_case: &Case, _pair: (Finished<'_>, Finished<'_>)) -> impl Fn(&Capture) -> Tolerance {
    |_| Tolerance::BitEqual
}

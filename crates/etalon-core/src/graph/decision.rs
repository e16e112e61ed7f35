//! What was decided of an effect before its passes were declared.

use std::fmt;

use serde::Serialize;

/// Whether an effect runs, and why.
///
/// Planning culls passes that nothing needs; a decision is made earlier, by
/// whoever knows what is on the screen, and keeps the passes from being declared
/// at all. [`Graph::decide`](super::Graph::decide) notes it for the plan to tell.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Decision {
    /// Its passes are declared.
    Runs {
        /// What calls for it.
        reason: String,
    },
    /// There is no pass of it, and so nothing that it could cost.
    Absent {
        /// What would have called for it and is not there.
        reason: String,
    },
}

impl Decision {
    /// It runs.
    #[must_use]
    pub fn runs(reason: impl Into<String>) -> Self {
        Self::Runs {
            reason: reason.into(),
        }
    }

    /// It does not.
    #[must_use]
    pub fn absent(reason: impl Into<String>) -> Self {
        Self::Absent {
            reason: reason.into(),
        }
    }

    /// Whether it runs.
    #[must_use]
    pub const fn is_run(&self) -> bool {
        matches!(self, Self::Runs { .. })
    }

    /// Why, or why not.
    #[must_use]
    pub fn reason(&self) -> &str {
        match self {
            Self::Runs { reason } | Self::Absent { reason } => reason,
        }
    }
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.is_run() { "runs" } else { "absent" };
        write!(f, "{word}: {}", self.reason())
    }
}

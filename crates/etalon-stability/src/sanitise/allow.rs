//! What comments in kernels allow.
//!
//! A comment at the end of a line of code, or on lines of its own before it, allows
//! faults on that line:
//!
//! ```wgsl
//! // sanitiser allows cancellation: rounding to the unit is what is wanted
//! let whole = (x + unit) - unit;
//! ```
//!
//! The reason is required, and may go on over the comment lines that follow. Faults are
//! named as [`Fault::name`] does, several with commas between.

use std::collections::{BTreeMap, BTreeSet};

use etalon_cpu::Location;
use etalon_cpu::sanitise::Fault;
use thiserror::Error;

use crate::mutate;

/// What begins such a comment.
const MARK: &str = "// sanitiser allows ";

/// Why comments cannot be understood.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AllowError {
    /// A word is not the name of a fault.
    #[error("{file}:{line}: there is no fault `{name}`; there are {}", known())]
    Unknown {
        /// The kernel's file.
        file: String,
        /// Line, from 1.
        line: u32,
        /// The word.
        name: String,
    },
    /// There is no reason.
    #[error("{file}:{line}: `{MARK}` needs a reason after a colon")]
    NoReason {
        /// The kernel's file.
        file: String,
        /// Line, from 1.
        line: u32,
    },
    /// No code follows.
    #[error("{file}:{line}: no code follows what the sanitiser is to allow")]
    NoCode {
        /// The kernel's file.
        file: String,
        /// Line, from 1.
        line: u32,
    },
}

fn known() -> String {
    Fault::ALL.map(Fault::name).join(", ")
}

/// A fault on a line that is allowed.
type Key = (String, u32, Fault);

/// Everything that is allowed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Allowances {
    reasons: BTreeMap<Key, String>,
    used: BTreeSet<Key>,
}

impl Allowances {
    /// Of files, each by the name that places in it have and with its text.
    ///
    /// # Errors
    /// The first comment that cannot be understood.
    pub fn of<'a>(files: impl IntoIterator<Item = (String, &'a str)>) -> Result<Self, AllowError> {
        let mut allowances = Self::default();
        for (file, text) in files {
            allowances.read(&file, text)?;
        }
        Ok(allowances)
    }

    /// Of the kernels that are embedded.
    ///
    /// # Errors
    /// The first comment that cannot be understood.
    pub fn of_kernels() -> Result<Self, AllowError> {
        let sources = etalon_shaders::sources();
        Self::of(sources.map(|(path, text)| (format!("{path}.wesl"), text)))
    }

    fn read(&mut self, file: &str, text: &str) -> Result<(), AllowError> {
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate() {
            let Some((code, said)) = line.split_once(MARK) else {
                continue;
            };
            let number = |index: usize| u32::try_from(index + 1).unwrap_or(u32::MAX);
            let here = number(index);
            let no_reason = || AllowError::NoReason {
                file: file.to_owned(),
                line: here,
            };
            let (names, reason) = said.split_once(':').ok_or_else(no_reason)?;
            let mut reason = reason.trim().to_owned();
            let on_its_own = code.trim().is_empty();
            let mut at = index;
            if on_its_own {
                at = index + 1;
                while let Some(more) = lines.get(at).and_then(|line| comment(line)) {
                    if lines[at].contains(MARK) || lines[at].contains(mutate::MARK) {
                        // Another one for the same line, or another purpose.
                        at += 1;
                        continue;
                    }
                    reason = format!("{reason} {more}");
                    at += 1;
                }
                if lines.get(at).is_none_or(|line| line.trim().is_empty()) {
                    return Err(AllowError::NoCode {
                        file: file.to_owned(),
                        line: here,
                    });
                }
            }
            if reason.is_empty() {
                return Err(no_reason());
            }
            for name in names.split(',').map(str::trim) {
                let fault = Fault::ALL.into_iter().find(|fault| fault.name() == name);
                let fault = fault.ok_or_else(|| AllowError::Unknown {
                    file: file.to_owned(),
                    line: here,
                    name: name.to_owned(),
                })?;
                self.reasons
                    .insert((file.to_owned(), number(at), fault), reason.clone());
            }
        }
        Ok(())
    }

    /// The reason for which a fault is allowed where it is, if it is. It counts as used
    /// from then on.
    pub fn reason(&mut self, location: &Location, fault: Fault) -> Option<String> {
        let key = (location.file.clone(), location.line, fault);
        let reason = self.reasons.get(&key)?.clone();
        self.used.insert(key);
        Some(reason)
    }

    /// What is allowed and was never found: file, line and fault.
    #[must_use]
    pub fn unused(&self) -> Vec<(&str, u32, Fault)> {
        self.reasons
            .keys()
            .filter(|key| !self.used.contains(*key))
            .map(|(file, line, fault)| (file.as_str(), *line, *fault))
            .collect()
    }
}

/// The text of a line that is nothing but a comment.
fn comment(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix("//").map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allow(text: &str) -> Result<Allowances, AllowError> {
        Allowances::of([("a.wesl".to_owned(), text)])
    }

    fn place(line: u32) -> Location {
        Location {
            file: "a.wesl".to_owned(),
            line,
            column: 9,
        }
    }

    #[test]
    fn a_comment_allows_the_line_it_is_on_or_before() {
        let mut allowed = allow(
            "let a = b - c; // sanitiser allows cancellation: only its sign is used
// sanitiser allows birth, death: made
// to be caught
// sanitiser allows unstable-branch: either side will do
let d = 1.0 / e;
let f = 2.0;
",
        )
        .unwrap();
        let reason = |allowed: &mut Allowances, line, fault| allowed.reason(&place(line), fault);
        let cancels = reason(&mut allowed, 1, Fault::Cancellation);
        assert_eq!(cancels.as_deref(), Some("only its sign is used"));
        for fault in [Fault::Birth, Fault::Death] {
            let made = reason(&mut allowed, 5, fault);
            assert_eq!(made.as_deref(), Some("made to be caught"));
        }
        assert_eq!(reason(&mut allowed, 5, Fault::Cancellation), None);
        assert_eq!(reason(&mut allowed, 6, Fault::Birth), None);
        assert_eq!(allowed.unused(), [("a.wesl", 5, Fault::UnstableBranch)]);
    }

    #[test]
    fn comments_that_say_nothing_are_refused() {
        for (text, wanted) in [
            (
                "x // sanitiser allows magic: why not",
                "no fault `magic`; there are birth",
            ),
            (
                "x // sanitiser allows birth",
                "a.wesl:1: `// sanitiser allows ` needs a reason",
            ),
            (
                "\nx // sanitiser allows birth:  ",
                "a.wesl:2: `// sanitiser allows ` needs",
            ),
            (
                "// sanitiser allows birth: there is none\n",
                "a.wesl:1: no code follows",
            ),
        ] {
            let error = allow(text).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }

    #[test]
    fn the_kernels_comments_are_understood() {
        Allowances::of_kernels().unwrap();
    }
}

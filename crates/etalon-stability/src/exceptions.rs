//! What drivers are known to do otherwise, as data.
//!
//! The table is `exceptions.txt`: a line for each exception with the case, the effect, a
//! word of the device's name and the reason, separated by semicolons. Lines that are
//! empty or begin with `#` say nothing.

use thiserror::Error;

/// The table.
const TABLE: &str = include_str!("../exceptions.txt");

/// Something that a driver is known to do otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exception {
    /// The case.
    pub case: String,
    /// The effect.
    pub effect: String,
    /// A word of the device's name.
    pub device: String,
    /// Why.
    pub reason: String,
}

impl Exception {
    /// Whether it is about an effect on a case on a device.
    #[must_use]
    pub fn excuses(&self, case: &str, effect: &str, device: &str) -> bool {
        self.case == case && self.effect == effect && device.contains(&self.device)
    }
}

/// A line of the table that cannot be understood.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("exceptions.txt:{line}: a case, an effect, a device and a reason, separated by semicolons")]
pub struct BadLine {
    /// From 1.
    pub line: usize,
}

/// The table's exceptions.
///
/// # Errors
/// The first line that is none.
pub fn exceptions() -> Result<Vec<Exception>, BadLine> {
    parse(TABLE)
}

fn parse(table: &str) -> Result<Vec<Exception>, BadLine> {
    let lines = table.lines().zip(1..).filter(|(line, _)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let entry = |(text, line): (&str, usize)| {
        let parts: Vec<&str> = text.splitn(4, ';').map(str::trim).collect();
        match parts[..] {
            [case, effect, device, reason] if parts.iter().all(|part| !part.is_empty()) => {
                Ok(Exception {
                    case: case.to_owned(),
                    effect: effect.to_owned(),
                    device: device.to_owned(),
                    reason: reason.to_owned(),
                })
            }
            _ => Err(BadLine { line }),
        }
    };
    lines.map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::subjects;

    #[test]
    fn every_exception_is_about_a_case_that_there_is() {
        let subjects = subjects().unwrap();
        for exception in exceptions().unwrap() {
            let known = subjects.iter().any(|subject| {
                let mut effects = subject.effects.iter();
                subject.name == exception.case
                    && effects.any(|effect| effect.name() == exception.effect)
            });
            assert!(known, "{exception:?}");
            assert!(exception.reason.len() > 20, "{exception:?}");
        }
    }

    #[test]
    fn lines_are_understood_or_named() {
        let table = "# words\n\nsize-1x1; bloom; Swift; it is so; and so\n";
        let found = parse(table).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].reason, "it is so; and so");
        assert!(found[0].excuses("size-1x1", "bloom", "SwiftShader Device"));
        assert!(!found[0].excuses("size-1x1", "bloom", "llvmpipe"));
        assert!(!found[0].excuses("size-1x2", "bloom", "SwiftShader Device"));
        assert_eq!(
            parse("#\nsize-1x1; bloom; x").unwrap_err(),
            BadLine { line: 2 }
        );
        assert_eq!(parse("a; b; ; d").unwrap_err().line, 1);
    }
}

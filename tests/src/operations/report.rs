//! Judgements as a table, and what follows from them.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::exceptions::Exception;
use super::judge::Judgement;

/// How one executor did on one operation in one arithmetic.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The operation's name.
    pub operation: String,
    /// The executor's.
    pub executor: String,
    /// `strict` or `fast`.
    pub arithmetic: &'static str,
    /// How it did.
    pub judgement: Judgement,
}

/// Everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The executors, in the order of columns.
    pub executors: Vec<String>,
    /// How each did, operation by operation.
    pub entries: Vec<Entry>,
    /// Failures that are no exceptions, and exceptions that do not occur.
    pub problems: Vec<String>,
    /// Failures that are exceptions.
    pub excused: Vec<String>,
    /// What devices lack, and how many kernels were not run for that reason,
    /// which is no failure: by executor and feature.
    pub lacking: BTreeMap<(String, String), usize>,
}

impl Report {
    /// Whether every result is as it should be or known not to be.
    #[must_use]
    pub fn ok(&self) -> bool {
        self.problems.is_empty()
    }

    /// Takes note that an executor could not run an operation because its
    /// device lacks a feature.
    pub fn lacks(&mut self, executor: &str, feature: &str) {
        let key = (executor.to_owned(), feature.to_owned());
        *self.lacking.entry(key).or_default() += 1;
    }

    /// Weighs the entries' failures against the exceptions. Exceptions of
    /// executors or operations that were not run are left alone.
    pub fn conclude(&mut self, exceptions: &[Exception]) {
        for entry in &self.entries {
            for failure in &entry.judgement.failures {
                let exception = exceptions.iter().find(|exception| {
                    exception.excuses(&entry.operation, failure.check, &entry.executor)
                });
                let text = format!(
                    "{} on {}, {} arithmetic, {}: {} results, the first {}",
                    entry.operation,
                    entry.executor,
                    entry.arithmetic,
                    failure.check,
                    failure.count,
                    failure.first
                );
                match exception {
                    Some(exception) => self.excused.push(format!("{text}: {}", exception.reason)),
                    None => self.problems.push(text),
                }
            }
        }
        for exception in exceptions {
            for executor in self
                .executors
                .iter()
                .filter(|name| exception.is_about(name))
            {
                let mut ran = self
                    .entries
                    .iter()
                    .filter(|entry| {
                        entry.executor == *executor && entry.operation == exception.operation
                    })
                    .peekable();
                let was_run = ran.peek().is_some();
                let occurs = ran.any(|entry| {
                    let failures = &entry.judgement.failures;
                    failures
                        .iter()
                        .any(|failure| failure.check == exception.check)
                });
                if was_run && !occurs {
                    self.problems.push(format!(
                        "stale exception, exceptions.txt:{}: {} no longer fails `{}` on {executor}",
                        exception.line, exception.operation, exception.check
                    ));
                }
            }
        }
    }

    /// A row per operation, a column per executor with its largest error in
    /// ULP, `exact` where errors are not measured in ULP, `✗` where something
    /// failed, `(✗)` where that is an exception; and the verdict.
    #[must_use]
    pub fn table(&self, exceptions: &[Exception]) -> String {
        let mut operations: Vec<&str> = Vec::new();
        for entry in &self.entries {
            if operations.last() != Some(&entry.operation.as_str()) {
                operations.push(&entry.operation);
            }
        }
        operations.dedup();
        let mut header = vec!["operation".to_owned(), "judged".to_owned()];
        header.extend(self.executors.iter().cloned());
        header.push("verdict".to_owned());
        let mut rows = vec![header];
        for operation in operations {
            rows.push(self.row(operation, exceptions));
        }
        let mut text = align(&rows);
        let _ = writeln!(
            text,
            "\n{} results judged of {}; errors in ULP of the exact value.",
            self.entries
                .iter()
                .map(|entry| entry.judgement.judged)
                .sum::<usize>(),
            self.entries
                .iter()
                .map(|entry| entry.judgement.results)
                .sum::<usize>(),
        );
        for ((executor, feature), count) in &self.lacking {
            let _ = writeln!(
                text,
                "{executor} lacks `{feature}`: {count} kernels were not run on it."
            );
        }
        if !self.excused.is_empty() {
            let _ = writeln!(text, "\nExceptions");
            for excused in &self.excused {
                let _ = writeln!(text, "  {excused}");
            }
        }
        if self.ok() {
            text += "\nOK: every operation is as WGSL and strict arithmetic have it.\n";
        } else {
            text += "\nNOT OK\n";
            for problem in &self.problems {
                let _ = writeln!(text, "  {problem}");
            }
        }
        text
    }

    fn row(&self, operation: &str, exceptions: &[Exception]) -> Vec<String> {
        let entries: Vec<&Entry> = self
            .entries
            .iter()
            .filter(|entry| entry.operation == operation)
            .collect();
        let judged = entries
            .iter()
            .map(|entry| entry.judgement.judged)
            .max()
            .unwrap_or(0);
        let mut row = vec![operation.to_owned(), judged.to_string()];
        let mut verdict = "ok";
        for executor in &self.executors {
            let own: Vec<&&Entry> = entries
                .iter()
                .filter(|entry| entry.executor == *executor)
                .collect();
            let worst = own
                .iter()
                .filter_map(|entry| entry.judgement.worst)
                .fold(None, |worst: Option<f64>, error| {
                    Some(worst.map_or(error, |worst| worst.max(error)))
                });
            let mut cell = match (own.is_empty(), worst) {
                (true, _) => "–".to_owned(),
                (false, None) => "exact".to_owned(),
                (false, Some(worst)) => short(worst),
            };
            let failures = own.iter().flat_map(|entry| &entry.judgement.failures);
            let (mut excused, mut unexcused) = (false, false);
            for failure in failures {
                let is_known = exceptions
                    .iter()
                    .any(|exception| exception.excuses(operation, failure.check, executor));
                if is_known {
                    excused = true;
                } else {
                    unexcused = true;
                }
            }
            if unexcused {
                cell += " ✗";
                verdict = "FAIL";
            } else if excused {
                cell += " (✗)";
                if verdict == "ok" {
                    verdict = "exception";
                }
            }
            row.push(cell);
        }
        row.push(verdict.to_owned());
        row
    }
}

/// A figure in a few characters.
fn short(value: f64) -> String {
    if value < 1000.0 {
        format!("{value:.2}")
    } else if value < 100_000.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.1e}")
    }
}

/// Rows in columns, the first and the last to the left.
fn align(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            let _ = if column == 0 || column + 1 == columns {
                write!(line, "{cell:<width$}  ")
            } else {
                write!(line, "{cell:>width$}  ")
            };
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::exceptions::parse;
    use super::super::judge::{Check, Failure};
    use super::*;

    fn entry(operation: &str, executor: &str, failed: Option<Check>) -> Entry {
        let failures = failed.map(|check| Failure {
            check,
            count: 3,
            first: "of 0x1 (1): 0x2 (2), not 0x3 (3) (scalar)".to_owned(),
        });
        Entry {
            operation: operation.to_owned(),
            executor: executor.to_owned(),
            arithmetic: "strict",
            judgement: Judgement {
                results: 10,
                judged: 8,
                worst: Some(0.5),
                failures: failures.into_iter().collect(),
            },
        }
    }

    fn report(entries: Vec<Entry>) -> Report {
        let mut executors: Vec<String> = Vec::new();
        for entry in &entries {
            if !executors.contains(&entry.executor) {
                executors.push(entry.executor.clone());
            }
        }
        Report {
            executors,
            entries,
            ..Report::default()
        }
    }

    #[test]
    fn unlisted_failures_are_problems_that_say_everything() {
        let mut report = report(vec![
            entry("a + b, f32", "cpu", None),
            entry("a + b, f32", "ash/lavapipe", Some(Check::Bits)),
        ]);
        report.conclude(&[]);
        assert!(!report.ok());
        assert_eq!(
            report.problems,
            [
                "a + b, f32 on ash/lavapipe, strict arithmetic, bits: 3 results, \
              the first of 0x1 (1): 0x2 (2), not 0x3 (3) (scalar)"
            ]
        );
        let table = report.table(&[]);
        assert!(
            table.contains("0.50 ✗  FAIL") && table.contains("NOT OK"),
            "{table}"
        );
    }

    #[test]
    fn listed_failures_are_excused_and_only_those() {
        let exceptions = parse("a + b, f32; bits; lavapipe; it rounds down").unwrap();
        let mut listed = report(vec![
            entry("a + b, f32", "ash/lavapipe", Some(Check::Bits)),
            entry("a + b, f32", "wgpu/lavapipe", Some(Check::Bits)),
        ]);
        listed.conclude(&exceptions);
        assert!(listed.ok(), "{:?}", listed.problems);
        assert!(
            listed.excused[0].ends_with("it rounds down"),
            "{:?}",
            listed.excused
        );
        let table = listed.table(&exceptions);
        assert!(
            table.contains("0.50 (✗)  exception") && table.contains("\nOK:"),
            "{table}"
        );
        let mut other = report(vec![entry(
            "a + b, f32",
            "ash/lavapipe",
            Some(Check::Accuracy),
        )]);
        other.conclude(&exceptions);
        assert_eq!(
            other.problems.len(),
            2,
            "the failure, and the exception that is stale"
        );
    }

    #[test]
    fn what_a_device_lacks_is_said_and_no_failure() {
        let mut report = report(vec![entry("a + b, f16", "cpu", None)]);
        report.executors.push("ash/old".to_owned());
        report.lacks("ash/old", "shaderFloat16");
        report.lacks("ash/old", "shaderFloat16");
        report.conclude(&[]);
        assert!(report.ok());
        let table = report.table(&[]);
        assert!(
            table.contains("ash/old lacks `shaderFloat16`: 2 kernels were not run on it."),
            "{table}"
        );
        assert!(table.contains("–"), "{table}");
    }

    #[test]
    fn exceptions_that_no_longer_occur_are_stale_where_the_driver_is_there() {
        let exceptions = parse("a + b, f32; bits; lavapipe; once").unwrap();
        let mut fixed = report(vec![entry("a + b, f32", "wgpu/lavapipe", None)]);
        fixed.conclude(&exceptions);
        assert_eq!(
            fixed.problems,
            [
                "stale exception, exceptions.txt:1: a + b, f32 no longer fails `bits` on wgpu/lavapipe"
            ]
        );
        // Neither without the driver, nor without the operation.
        for elsewhere in [
            entry("a + b, f32", "ash/swiftshader", None),
            entry("a - b, f32", "ash/lavapipe", None),
        ] {
            let mut report = report(vec![elsewhere]);
            report.conclude(&exceptions);
            assert!(report.ok(), "{:?}", report.problems);
        }
    }
}

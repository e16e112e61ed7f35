//! What drivers are known to do otherwise, as data.
//!
//! The table is `tests/operations/exceptions.txt`: a line for each exception
//! with the operation's name, the check it fails, who fails it and why,
//! separated by semicolons. Who is a driver (`lavapipe`) or one backend on it
//! (`ash/lavapipe`). Lines that are empty or begin with `#` say nothing.

use super::judge::Check;

/// The table.
const TABLE: &str = include_str!("../../operations/exceptions.txt");

/// Something a driver is known to do otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exception {
    /// The operation's name.
    pub operation: String,
    /// The check that fails.
    pub check: Check,
    /// `driver` or `backend/driver`.
    pub executor: String,
    /// Why.
    pub reason: String,
    /// Its line in the table, from 1.
    pub line: usize,
}

/// A line of the table that says nothing that makes sense.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadLine {
    /// Its number, from 1.
    pub line: usize,
    /// What is wrong.
    pub reason: String,
}

impl std::fmt::Display for BadLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "exceptions.txt:{}: {}", self.line, self.reason)
    }
}

impl std::error::Error for BadLine {}

impl Exception {
    /// Whether it is about an executor.
    #[must_use]
    pub fn is_about(&self, executor: &str) -> bool {
        self.executor == executor
            || executor
                .split_once('/')
                .is_some_and(|(_, driver)| driver == self.executor)
    }

    /// Whether it excuses a failure.
    #[must_use]
    pub fn excuses(&self, operation: &str, check: Check, executor: &str) -> bool {
        self.operation == operation && self.check == check && self.is_about(executor)
    }
}

/// The exceptions of the table.
///
/// # Errors
/// At the first line that cannot be read.
pub fn known() -> Result<Vec<Exception>, BadLine> {
    parse(TABLE)
}

/// Reads a table.
///
/// # Errors
/// At the first line that cannot be read.
pub fn parse(table: &str) -> Result<Vec<Exception>, BadLine> {
    let mut exceptions: Vec<Exception> = Vec::new();
    for (index, text) in table.lines().enumerate() {
        let bad = |reason: String| BadLine {
            line: index + 1,
            reason,
        };
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = text.splitn(4, ';').map(str::trim).collect();
        let [operation, check, executor, reason] = fields[..] else {
            return Err(bad("operation; check; executor; reason".to_owned()));
        };
        if [operation, executor, reason].contains(&"") {
            return Err(bad("a field is empty".to_owned()));
        }
        let Some(check) = Check::ALL.into_iter().find(|known| known.name() == check) else {
            let names = Check::ALL.map(Check::name).join(", ");
            return Err(bad(format!(
                "there is no check `{check}`; there are {names}"
            )));
        };
        if executor == "cpu" {
            return Err(bad("the interpreter has no exceptions".to_owned()));
        }
        let exception = Exception {
            operation: operation.to_owned(),
            check,
            executor: executor.to_owned(),
            reason: reason.to_owned(),
            line: index + 1,
        };
        if exceptions
            .iter()
            .any(|other| other.excuses(operation, check, executor))
        {
            return Err(bad("this exception is there twice".to_owned()));
        }
        exceptions.push(exception);
    }
    Ok(exceptions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_can_be_read_and_is_about_operations_that_exist() {
        let operations = super::super::table::all();
        for exception in known().unwrap_or_else(|error| panic!("{error}")) {
            assert!(
                operations
                    .iter()
                    .any(|operation| operation.name == exception.operation),
                "line {}: there is no operation `{}`",
                exception.line,
                exception.operation
            );
        }
    }

    #[test]
    fn lines_that_make_no_sense_are_named() {
        let error = |table: &str| parse(table).unwrap_err().to_string();
        assert!(error("\na; bits").starts_with("exceptions.txt:2: operation;"));
        assert!(error("a; bit; x; y").contains("there is no check `bit`"));
        assert!(error("a; bits; cpu; y").contains("the interpreter has no exceptions"));
        assert!(error("a; bits; x; ").contains("empty"));
        assert!(error("a; bits; x; y\na; bits; ash/x; z").contains("twice"));
    }

    #[test]
    fn exceptions_are_of_a_driver_or_of_one_backend_on_it() {
        let table = "a, f32; bits; lavapipe; b; c\na, f32; accuracy; ash/swiftshader; d";
        let all = parse(table).unwrap();
        assert_eq!(all[0].reason, "b; c");
        assert!(all[0].excuses("a, f32", Check::Bits, "ash/lavapipe"));
        assert!(all[0].excuses("a, f32", Check::Bits, "wgpu/lavapipe"));
        assert!(!all[0].excuses("a, f32", Check::Accuracy, "wgpu/lavapipe"));
        assert!(!all[0].excuses("b, f32", Check::Bits, "wgpu/lavapipe"));
        assert!(!all[0].is_about("cpu") && !all[0].is_about("ash/swiftshader"));
        assert!(all[1].is_about("ash/swiftshader") && !all[1].is_about("wgpu/swiftshader"));
    }
}

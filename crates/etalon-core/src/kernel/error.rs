//! What can be wrong with a kernel, and how it is shown.

use std::fmt;

use thiserror::Error;

use super::files::SourceLocation;
use super::lint::Finding;

/// A message about a place in a kernel's source.
///
/// Shown as `bloom/threshold.wesl:12:9: message`, followed by the source line
/// with the place marked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Where.
    pub location: SourceLocation,
    /// What is wrong, and what would be right.
    pub message: String,
    /// The source line the location is in, without its line break.
    pub line: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.location, self.message)?;
        write_excerpt(f, &self.location, &self.line)
    }
}

/// The most characters of a source line that are shown.
const EXCERPT: usize = 120;

/// Writes the source line below a message, with a caret below the column. Of
/// a long line, the part around the column is shown.
pub(super) fn write_excerpt(
    f: &mut fmt::Formatter<'_>,
    location: &SourceLocation,
    line: &str,
) -> fmt::Result {
    if line.trim().is_empty() {
        return Ok(());
    }
    let column = location.column.saturating_sub(1) as usize;
    // As much before the column as behind it, if there is that much.
    let length = line.chars().count();
    let start = column
        .saturating_sub(EXCERPT / 2)
        .min(length.saturating_sub(EXCERPT));
    let shown: String = line.chars().skip(start).take(EXCERPT).collect();
    let before = if start > 0 { "…" } else { "" };
    let after = if start + EXCERPT < length { "…" } else { "" };
    // Tabs are kept, so that the caret stays below its column.
    let indent: String = before
        .chars()
        .chain(shown.chars().take(column - start))
        .map(|c| if c == '\t' { '\t' } else { ' ' })
        .collect();
    let number = location.line.to_string();
    let margin = " ".repeat(number.len());
    write!(
        f,
        "\n{number} | {before}{shown}{after}\n{margin} | {indent}^"
    )
}

/// Why a kernel could not be compiled.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum KernelError {
    /// No kernel has the path asked for.
    #[error("there is no kernel `{path}`{}", list("; similar: ", similar))]
    UnknownKernel {
        /// As asked.
        path: String,
        /// Existing paths that look like it.
        similar: Vec<String>,
    },
    /// The text is not WESL.
    #[error("{0}")]
    Syntax(Diagnostic),
    /// An import names a file or declaration that does not exist.
    #[error("{0}")]
    Import(Diagnostic),
    /// An `@if`, `@elif` or `@else` is not as it should be.
    #[error("{0}")]
    Condition(Diagnostic),
    /// The request sets a feature that no `@if` of the kernel or of what it
    /// imports mentions.
    #[error(
        "kernel `{kernel}` has no feature `{name}`; {}",
        exists("it has", known)
    )]
    UnknownFeature {
        /// Path of the kernel.
        kernel: String,
        /// As asked.
        name: String,
        /// The features there are, besides `strict`.
        known: Vec<String>,
    },
    /// The request sets the feature `strict`.
    #[error("kernel `{kernel}`: the feature `strict` is set by the arithmetic, not by the request")]
    ReservedFeature {
        /// Path of the kernel.
        kernel: String,
    },
    /// The request sets a constant that the kernel does not declare.
    #[error(
        "kernel `{kernel}` has no override `{name}`; {}",
        exists("it has", known)
    )]
    UnknownConstant {
        /// Path of the kernel.
        kernel: String,
        /// As asked.
        name: String,
        /// The overrides there are.
        known: Vec<String>,
    },
    /// The request sets a constant to a value its type does not have.
    #[error("{location}: override `{name}: {ty}` cannot be {value}: {reason}")]
    ConstantValue {
        /// Where the override is declared.
        location: SourceLocation,
        /// Name of the override.
        name: String,
        /// Its WGSL type.
        ty: &'static str,
        /// As asked.
        value: f64,
        /// Why not.
        reason: &'static str,
    },
    /// An override without initial value is not set by the request.
    #[error("{location}: override `{name}` has no initial value, so the request must set it")]
    MissingConstant {
        /// Where the override is declared.
        location: SourceLocation,
        /// Name of the override.
        name: String,
    },
    /// The text is WESL but not valid WGSL.
    #[error("{0}")]
    Wgsl(Diagnostic),
    /// There are not exactly the entry points of a compute or a raster kernel.
    #[error(
        "kernel `{kernel}` must have exactly one entry point, `@compute fn main`, or, to draw, `@vertex fn vertex` and perhaps `@fragment fn fragment`, but has {}",
        none_or(found)
    )]
    EntryPoint {
        /// Path of the kernel.
        kernel: String,
        /// What there is, e.g. `@compute fn blur (bloom/blur.wesl:3:1)`.
        found: Vec<String>,
    },
    /// A binding, or the uniform block, is of a kind that passes cannot fill.
    #[error("{0}")]
    Interface(Diagnostic),
    /// A strict kernel uses operations whose result is not exactly defined.
    #[error(
        "kernel `{kernel}` is not strict: {} operation(s) may differ between devices{}",
        findings.len(),
        each(findings)
    )]
    NotStrict {
        /// Path of the kernel.
        kernel: String,
        /// Every such operation.
        findings: Vec<Finding>,
    },
    /// A kernel has no translation to SPIR-V.
    #[error("kernel `{kernel}` cannot become SPIR-V: {message}")]
    Spirv {
        /// Path of the kernel.
        kernel: String,
        /// What stands in the way.
        message: String,
    },
    /// A compiler this one builds on failed where it should not have.
    #[error("kernel `{kernel}`: internal error while {stage}: {message}")]
    Internal {
        /// Path of the kernel.
        kernel: String,
        /// What was being done.
        stage: &'static str,
        /// What the compiler said.
        message: String,
    },
}

impl KernelError {
    /// The place in the source the error is about, if it is about one.
    #[must_use]
    pub fn location(&self) -> Option<&SourceLocation> {
        match self {
            Self::Syntax(diagnostic)
            | Self::Import(diagnostic)
            | Self::Condition(diagnostic)
            | Self::Wgsl(diagnostic)
            | Self::Interface(diagnostic) => Some(&diagnostic.location),
            Self::ConstantValue { location, .. } | Self::MissingConstant { location, .. } => {
                Some(location)
            }
            Self::NotStrict { findings, .. } => findings.first().map(|found| &found.location),
            Self::UnknownKernel { .. }
            | Self::UnknownFeature { .. }
            | Self::ReservedFeature { .. }
            | Self::UnknownConstant { .. }
            | Self::EntryPoint { .. }
            | Self::Spirv { .. }
            | Self::Internal { .. } => None,
        }
    }
}

fn quoted(names: &[String]) -> String {
    let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

fn list(before: &str, names: &[String]) -> String {
    if names.is_empty() {
        String::new()
    } else {
        format!("{before}{}", quoted(names))
    }
}

fn exists(before: &str, names: &[String]) -> String {
    if names.is_empty() {
        format!("{before} none")
    } else {
        format!("{before} {}", quoted(names))
    }
}

fn none_or(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

fn each(findings: &[Finding]) -> String {
    findings
        .iter()
        .map(|finding| format!("\n{finding}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(line: &str, column: u32) -> String {
        let location = SourceLocation {
            file: "a.wesl".to_owned(),
            line: 7,
            column,
        };
        let message = "no".to_owned();
        let line = line.to_owned();
        let diagnostic = Diagnostic {
            location,
            message,
            line,
        };
        diagnostic.to_string()
    }

    #[test]
    fn the_caret_is_below_the_column() {
        assert_eq!(
            shown("let é = 1;", 9),
            "a.wesl:7:9: no\n7 | let é = 1;\n  |         ^"
        );
        assert_eq!(shown("\tx", 2), "a.wesl:7:2: no\n7 | \tx\n  | \t^");
        assert_eq!(shown("  ", 1), "a.wesl:7:1: no");
        // Behind the end of the line.
        assert_eq!(shown("x", 2), "a.wesl:7:2: no\n7 | x\n  |  ^");
    }

    #[test]
    fn of_a_long_line_the_part_around_the_column_is_shown() {
        let line: String = (0..1000)
            .map(|i| if i == 500 { '#' } else { '.' })
            .collect();
        for (column, before, after) in [(501, true, true), (1, false, true), (1000, true, false)] {
            let shown = shown(&line, column);
            let lines: Vec<&str> = shown.lines().collect();
            assert!(lines[1].chars().count() <= EXCERPT + 6, "{shown}");
            assert_eq!(lines[1].starts_with("7 | …"), before, "{shown}");
            assert_eq!(lines[1].ends_with('…'), after, "{shown}");
            let caret = lines[2].chars().position(|c| c == '^').unwrap();
            let above = lines[1].chars().nth(caret).unwrap();
            assert_eq!(above == '#', column == 501, "{shown}");
        }
    }
}

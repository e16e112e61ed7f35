//! Tasks that measure. What is measured has to be built as it is released, so
//! a program of its own does it, the package `etalon-measure`.

use std::ffi::OsString;
use std::process::Command;

use clap::Args;
use thiserror::Error;

/// What the measuring program is given.
#[derive(Clone, Debug, Args)]
#[command(disable_help_flag = true)]
pub struct Forwarded {
    /// Options of the measuring program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Why nothing was measured.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// Cargo cannot be started.
    #[error("cargo cannot be started: {0}")]
    Cargo(std::io::Error),
}

/// Cargo, as this program was started by it.
fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Builds the measuring program in release profile and runs one of its tasks.
/// Returns whether it succeeded; it has said itself what went wrong.
///
/// # Errors
/// If there is no cargo.
pub fn run(task: &str, forwarded: &Forwarded) -> Result<bool, MeasureError> {
    let status = cargo()
        .args(["run", "--quiet", "--release", "--package", "etalon-measure"])
        .args(["--", task])
        .args(&forwarded.arguments)
        .status()
        .map_err(MeasureError::Cargo)?;
    Ok(status.success())
}

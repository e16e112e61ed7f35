//! Tasks that measure. What is measured has to be built as it is released, so
//! programs of their own do it, the packages `etalon-measure`, `etalon-accuracy`,
//! `etalon-economy` and `etalon-stability`.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use serde::Deserialize;
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
    /// The measuring program cannot be started.
    #[error("the measuring program cannot be started: {0}")]
    Start(std::io::Error),
    /// Cargo failed, and has said why.
    #[error("the measuring program cannot be built")]
    Build,
}

/// Cargo, as this program was started by it.
fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// The program that measures the interpreter.
pub const INTERPRETER: &str = "etalon-measure";
/// The program that measures what accuracy costs in time.
pub const ACCURACY: &str = "etalon-accuracy";
/// The program that measures what effects cost by the screen they concern.
pub const ECONOMY: &str = "etalon-economy";
/// The program that runs the hard cases.
pub const STABILITY: &str = "etalon-stability";

/// Builds a measuring program in release profile and runs it with `first`
/// arguments and those forwarded. Returns whether it succeeded; it has said itself
/// what went wrong.
///
/// # Errors
/// If it cannot be built or started.
pub fn run(program: &str, first: &[&str], forwarded: &Forwarded) -> Result<bool, MeasureError> {
    let status = Command::new(build(program)?)
        .args(first)
        .args(&forwarded.arguments)
        .status()
        .map_err(MeasureError::Start)?;
    Ok(status.success())
}

/// Builds a measuring program in release profile and says where it is.
///
/// # Errors
/// If it cannot be built.
pub fn build(program: &str) -> Result<PathBuf, MeasureError> {
    let output = cargo()
        .args(["build", "--release", "--package", program])
        .args(["--message-format", "json-render-diagnostics"])
        .stderr(Stdio::inherit())
        .output()
        .map_err(MeasureError::Cargo)?;
    if !output.status.success() {
        return Err(MeasureError::Build);
    }
    #[derive(Deserialize)]
    struct Message {
        executable: Option<PathBuf>,
    }
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .filter_map(|line| serde_json::from_str::<Message>(line).ok())
        .find_map(|message| message.executable)
        .ok_or(MeasureError::Build)
}

//! `count-instructions`: how many instructions the interpreter executes for
//! each kernel, held against what it was before.
//!
//! Time differs from run to run and machine to machine; the number of
//! instructions does not, and is what CI can hold. Callgrind counts them on the
//! AVX2 tier (it does not know AVX-512), on one thread and a small picture. The
//! numbers are kept in `instructions.json` with the margin by which they may
//! grow; a number that shrinks by more is reported too, so that it is kept.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::measure::{self, MeasureError};

/// Options of `count-instructions`.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// Keep the numbers counted instead of comparing with those kept.
    #[arg(long)]
    bless: bool,
}

/// Why instructions cannot be counted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CountError {
    /// The measuring program cannot be built.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// There is no valgrind (package `valgrind`).
    #[error("valgrind cannot be started: {0}")]
    Start(std::io::Error),
    /// The program failed under it.
    #[error("valgrind failed: {0}")]
    Failed(String),
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The numbers kept cannot be read.
    #[error("instructions.json: {0}")]
    Kept(#[from] serde_json::Error),
    /// Callgrind's files are not as expected.
    #[error("{kernels} kernels were run, {counts} counts were written")]
    Counts {
        /// Kernels that were run.
        kernels: usize,
        /// Counts found.
        counts: usize,
    },
}

/// What `instructions.json` holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// Part by which a count may differ, over all of it.
    pub margin: f64,
    /// The compiler the counts are of: another one makes other instructions.
    pub compiler: String,
    /// Instructions by kernel.
    pub instructions: BTreeMap<String, u64>,
}

impl Kept {
    /// What differs between these counts and others by more than the margin, in
    /// words.
    #[must_use]
    pub fn differences(&self, counted: &BTreeMap<String, u64>) -> Vec<String> {
        let mut differences = Vec::new();
        for (kernel, &kept) in &self.instructions {
            match counted.get(kernel) {
                None => differences.push(format!("{kernel}: is not run any more")),
                Some(&now) => {
                    let change = now as f64 - kept as f64;
                    if change.abs() > self.margin * kept as f64 + 0.5 {
                        differences.push(format!(
                            "{kernel}: {now} instructions against {kept}, {:+.1} %",
                            100.0 * change / kept.max(1) as f64
                        ));
                    }
                }
            }
        }
        let new = counted
            .keys()
            .filter(|kernel| !self.instructions.contains_key(*kernel));
        differences.extend(new.map(|kernel| format!("{kernel}: is new")));
        differences
    }
}

/// Kernels of fewer instructions are left out: starting them takes up to some thousand
/// instructions more or less each time, as threads meet or miss each other, and one
/// of 160,000 was seen to vary by 5 %.
const FEWEST: u64 = 250_000;

/// Part by which counts may differ from those kept.
const MARGIN: f64 = 0.03;

/// Where the numbers are kept.
fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("instructions.json")
}

/// Counts, and compares or keeps. Returns whether all is well.
///
/// # Errors
/// If nothing can be counted.
pub fn run(options: &Options) -> Result<bool, CountError> {
    let program = measure::build(measure::INTERPRETER)?;
    let instructions = count(&program)?;
    let path = path();
    let file = |source| CountError::File {
        path: path.clone(),
        source,
    };
    let compiler = compiler();
    if options.bless {
        let kept = Kept {
            margin: MARGIN,
            compiler,
            instructions,
        };
        let text = serde_json::to_string_pretty(&kept)? + "\n";
        std::fs::write(&path, text).map_err(file)?;
        println!("{} counts kept", kept.instructions.len());
        return Ok(true);
    }
    let text = std::fs::read_to_string(&path).map_err(file)?;
    let kept: Kept = serde_json::from_str(&text)?;
    for (kernel, count) in &instructions {
        println!("{count:>12}  {kernel}");
    }
    if kept.compiler != compiler {
        println!(
            "the counts kept are of {}, this is {compiler}: nothing is compared",
            kept.compiler
        );
        return Ok(true);
    }
    let differences = kept.differences(&instructions);
    for difference in &differences {
        println!("{difference}");
    }
    if !differences.is_empty() {
        println!(
            "over the margin of {:.0} %; `cargo xtask count-instructions --bless` keeps what was counted",
            100.0 * kept.margin
        );
    }
    Ok(differences.is_empty())
}

/// The compiler's version.
fn compiler() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    output.map_or_else(
        |_| "an unknown compiler".to_owned(),
        |output| String::from_utf8_lossy(&output.stdout).trim().to_owned(),
    )
}

/// Instructions of each kernel.
fn count(program: &Path) -> Result<BTreeMap<String, u64>, CountError> {
    let folder = tempfile::tempdir().map_err(|source| CountError::File {
        path: std::env::temp_dir(),
        source,
    })?;
    let out = folder.path().join("counts");
    let mut pattern = std::ffi::OsString::from("--callgrind-out-file=");
    pattern.push(&out);
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--dump-before=*count*mark*"])
        .arg(pattern)
        .arg(program)
        .arg("count")
        .output()
        .map_err(CountError::Start)?;
    if !output.status.success() {
        return Err(CountError::Failed(
            String::from_utf8_lossy(&output.stderr).into_owned(),
        ));
    }
    let names: Vec<String> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(str::to_owned)
        .collect();
    // The dump before a mark is of what came before it, numbered from 1. Four
    // marks to a kernel: the second and the fourth end what is counted.
    let mut counts = Vec::new();
    loop {
        let path = folder.path().join(format!("counts.{}", counts.len() + 1));
        match std::fs::read_to_string(&path) {
            Ok(text) => counts.push(total(&text)),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => break,
            Err(source) => return Err(CountError::File { path, source }),
        }
    }
    kernels(names, &counts)
}

/// The instructions of each kernel from what was counted before each mark.
fn kernels(names: Vec<String>, counts: &[u64]) -> Result<BTreeMap<String, u64>, CountError> {
    if names.is_empty() || counts.len() < 4 * names.len() {
        return Err(CountError::Counts {
            kernels: names.len(),
            counts: counts.len(),
        });
    }
    let kernel = |(name, counts): (String, &[u64])| (name, counts[3].saturating_sub(counts[1]));
    let kernels = names.into_iter().zip(counts.chunks_exact(4)).map(kernel);
    Ok(kernels.filter(|(_, count)| *count >= FEWEST).collect())
}

/// The sum in a file of callgrind: its line `summary:` or `totals:`.
fn total(text: &str) -> u64 {
    let number = |line: &str| {
        let rest = line
            .strip_prefix("summary:")
            .or_else(|| line.strip_prefix("totals:"))?;
        rest.trim().parse::<u64>().ok()
    };
    text.lines().filter_map(number).max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(of: &[(&str, u64)]) -> BTreeMap<String, u64> {
        of.iter()
            .map(|(name, count)| ((*name).to_owned(), *count))
            .collect()
    }

    #[test]
    fn growth_beyond_the_margin_is_found() {
        let kept = Kept {
            margin: 0.03,
            compiler: String::new(),
            instructions: counts(&[("a", 1000), ("b", 1000), ("c", 1000)]),
        };
        let same = counts(&[("a", 1030), ("b", 970), ("c", 1000)]);
        assert_eq!(kept.differences(&same), [""; 0]);
        let grown = counts(&[("a", 1031), ("b", 960), ("d", 1)]);
        assert_eq!(
            kept.differences(&grown),
            [
                "a: 1031 instructions against 1000, +3.1 %",
                "b: 960 instructions against 1000, -4.0 %",
                "c: is not run any more",
                "d: is new"
            ]
        );
    }

    #[test]
    fn the_work_is_what_doing_it_twice_adds() {
        let names: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        let counted = [
            7, 400_010, 3, 800_010, 9, 150_000, 2, 250_015, 1, 5, 4, 2_000_005, 8,
        ];
        // The second is too small to be counted well.
        assert_eq!(
            kernels(names.clone(), &counted).unwrap(),
            counts(&[("a", 400_000), ("c", 2_000_000)])
        );
        assert!(kernels(names, &counted[..11]).is_err());
        assert!(kernels(Vec::new(), &counted).is_err());
    }

    #[test]
    fn sums_are_read() {
        assert_eq!(
            total("events: Ir\nsummary: 123\n\nfn=x\n1 2\ntotals: 123\n"),
            123
        );
        assert_eq!(total("events: Ir\n"), 0);
    }

    #[test]
    fn the_counts_kept_can_be_read() {
        let kept: Kept = serde_json::from_str(include_str!("../instructions.json")).unwrap();
        assert!(kept.margin > 0.0 && kept.margin < 0.1);
        assert!(kept.instructions.values().all(|count| *count > 0));
    }
}

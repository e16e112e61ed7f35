//! The hidden command that runs every operation on one executor, in a process
//! of its own, and leaves the results in a folder.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use etalon_core::backend::BackendError;
use etalon_core::kernel::Arithmetic;
use etalon_tests::operations::operation::Operation;
use etalon_tests::operations::run::{RunError, executor_name, library, run};
use etalon_tests::operations::table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::execute::Api;
use crate::execute::backends::open;
use crate::test_backends::model::BackendKind;

/// Name of the JSON file.
const FILE: &str = "operations.json";

/// What to run, on what, and where to put the results.
#[derive(Clone, Debug, Args)]
pub struct Job {
    /// The backend.
    #[arg(long)]
    pub backend: BackendKind,
    /// The API that wgpu uses.
    #[arg(long, default_value = "vulkan")]
    pub api: Api,
    /// Whether ash runs under the validation layer, whose messages are errors.
    #[arg(long)]
    pub validate: bool,
    /// Only operations whose names contain this.
    #[arg(long)]
    pub operation: Option<String>,
    /// An existing folder for the results.
    #[arg(long)]
    pub out: PathBuf,
}

impl Job {
    /// The job as arguments of the hidden command.
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let name = |value: Option<clap::builder::PossibleValue>| {
            OsString::from(
                value
                    .map(|value| value.get_name().to_owned())
                    .unwrap_or_default(),
            )
        };
        let mut arguments: Vec<OsString> = vec![
            "--backend".into(),
            name(self.backend.to_possible_value()),
            "--api".into(),
            name(self.api.to_possible_value()),
            "--out".into(),
            (&self.out).into(),
        ];
        if let Some(operation) = &self.operation {
            arguments.extend(["--operation".into(), operation.into()]);
        }
        if self.validate {
            arguments.push("--validate".into());
        }
        arguments
    }
}

/// How a job ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub(super) enum Outcome {
    /// Every operation was tried.
    Ran {
        /// The executor, as exceptions call it.
        name: String,
        /// How each went, in the order of the table.
        runs: Vec<OperationRun>,
    },
    /// There is no device behind the driver.
    NoDevice {
        /// What the backend says.
        reason: String,
    },
    /// There should have been one.
    Failed {
        /// Why not.
        reason: String,
    },
}

/// How one operation went in one arithmetic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct OperationRun {
    /// The operation's name.
    pub(super) operation: String,
    /// Whether arithmetic was strict.
    pub(super) strict: bool,
    /// The file with the words of the results, or why there is none.
    pub(super) results: Result<String, String>,
    /// The feature that the device lacks, where that is why.
    pub(super) lacking: Option<String>,
}

/// Why results cannot be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Not the JSON it should be.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: serde_json::Error,
    },
}

impl Outcome {
    fn write(&self, folder: &Path) -> Result<(), ResultsError> {
        let path = folder.join(FILE);
        let text = serde_json::to_string(self).map_err(|source| ResultsError::Json {
            path: path.clone(),
            source,
        })?;
        std::fs::write(&path, text).map_err(|source| ResultsError::Io { path, source })
    }

    /// Reads what a job wrote to its folder.
    ///
    /// # Errors
    /// If there is nothing, or it is broken.
    pub(super) fn read(folder: &Path) -> Result<Self, ResultsError> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| ResultsError::Io {
            path: path.clone(),
            source,
        })?;
        serde_json::from_str(&text).map_err(|source| ResultsError::Json { path, source })
    }
}

impl OperationRun {
    /// The words of the results in the folder of the outcome.
    ///
    /// # Errors
    /// Why there are none.
    pub(super) fn read(&self, folder: &Path) -> Result<Vec<u32>, String> {
        let file = self.results.as_ref().map_err(Clone::clone)?;
        let bytes = std::fs::read(folder.join(file)).map_err(|error| format!("{file}: {error}"))?;
        let words = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        Ok(words.collect())
    }
}

/// The operations whose names contain a text.
#[must_use]
pub(super) fn chosen(text: Option<&str>) -> Vec<Operation> {
    let mut operations = table::all();
    operations.retain(|operation| text.is_none_or(|text| operation.name.contains(text)));
    operations
}

/// Runs the job and writes its outcome, whatever that is, to the folder.
///
/// # Errors
/// If the outcome itself cannot be written.
pub fn execute(job: &Job) -> Result<(), ResultsError> {
    let outcome = match open(job.backend, job.api, 0, job.validate) {
        Ok(mut backend) => {
            let operations = chosen(job.operation.as_deref());
            let kernels = library(&operations);
            let mut runs = Vec::new();
            for (index, operation) in operations.iter().enumerate() {
                for (strict, arithmetic) in [(true, Arithmetic::Strict), (false, Arithmetic::Fast)]
                {
                    if strict && !operation.strict {
                        continue;
                    }
                    let results = run(backend.as_mut(), &kernels, &operations, index, arithmetic);
                    let lacking = results.as_ref().err().and_then(RunError::lacking);
                    let results = match results {
                        Ok(words) => Ok(save(&job.out, runs.len(), &words)?),
                        Err(error) => Err(error.to_string()),
                    };
                    runs.push(OperationRun {
                        operation: operation.name.clone(),
                        strict,
                        results,
                        lacking: lacking.map(str::to_owned),
                    });
                }
            }
            Outcome::Ran {
                name: executor_name(&backend.info()),
                runs,
            }
        }
        Err(error) => {
            let reason = error.to_string();
            match error {
                BackendError::NoDevice { .. } => Outcome::NoDevice { reason },
                _ => Outcome::Failed { reason },
            }
        }
    };
    outcome.write(&job.out)
}

/// Writes words to a file of the folder and gives its name.
fn save(folder: &Path, number: usize, words: &[u32]) -> Result<String, ResultsError> {
    let file = format!("{number:04}.words");
    let path = folder.join(&file);
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    std::fs::write(&path, bytes).map_err(|source| ResultsError::Io { path, source })?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let run = |results| OperationRun {
            operation: "a + b, f32".into(),
            strict: true,
            results,
            lacking: None,
        };
        let words = [0, 1, 0x8000_0000, u32::MAX];
        let file = save(folder.path(), 7, &words).unwrap();
        let outcome = Outcome::Ran {
            name: "ash/lavapipe".into(),
            runs: vec![run(Ok(file)), run(Err("the device was lost".into()))],
        };
        outcome.write(folder.path()).unwrap();
        assert_eq!(Outcome::read(folder.path()).unwrap(), outcome);
        let Outcome::Ran { runs, .. } = outcome else {
            panic!("{outcome:?}");
        };
        assert_eq!(runs[0].read(folder.path()), Ok(words.to_vec()));
        assert_eq!(
            runs[1].read(folder.path()),
            Err("the device was lost".into())
        );
        std::fs::remove_file(folder.path().join("0007.words")).unwrap();
        assert!(
            runs[0]
                .read(folder.path())
                .unwrap_err()
                .contains("0007.words")
        );
    }

    #[test]
    fn damage_is_reported_with_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let missing = Outcome::read(folder.path()).unwrap_err();
        assert!(matches!(missing, ResultsError::Io { .. }), "{missing}");
        std::fs::write(folder.path().join(FILE), "{\"status\": \"ran\"}").unwrap();
        let broken = Outcome::read(folder.path()).unwrap_err();
        assert!(matches!(broken, ResultsError::Json { .. }), "{broken}");
        assert!(broken.to_string().contains(FILE), "{broken}");
    }

    #[test]
    fn operations_are_chosen_by_any_part_of_their_names() {
        assert_eq!(chosen(Some("a + b, f32")).len(), 1);
        assert!(chosen(Some("mat4x4")).len() > 3);
        assert!(chosen(Some("no such thing")).is_empty());
        assert!(chosen(None).len() > 200);
    }
}

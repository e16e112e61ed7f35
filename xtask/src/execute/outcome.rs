//! What one execution left behind: a folder with a JSON file and the captured
//! texels, written by the process that ran the backend, read by the one that
//! compares.

use std::io;
use std::path::{Path, PathBuf};

use etalon_core::backend::BackendInfo;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::resource::TextureDesc;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Name of the JSON file.
const FILE: &str = "outcome.json";

/// How an execution went.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum Outcome {
    /// To its end.
    Ran(Run),
    /// There is no device behind the driver, which is no fault.
    NoDevice {
        /// What the backend says.
        reason: String,
    },
    /// The device lacks something that the passes need.
    Unsupported {
        /// What.
        reason: String,
    },
    /// It should have run, and did not.
    Failed {
        /// Why.
        reason: String,
    },
}

/// A completed execution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Who ran it.
    pub device: Device,
    /// What was captured, in the order of frames and steps.
    pub captures: Vec<Capture>,
    /// Time of each step in the last frame.
    pub times: Vec<Time>,
    /// What the interpreter's checks found, a line each.
    #[serde(default)]
    pub findings: Vec<String>,
}

/// Who ran a plan. As [`BackendInfo`], but readable from JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Device {
    /// `cpu`, `wgpu` or `ash`.
    pub backend: String,
    /// The API or instruction set.
    pub api: String,
    /// The device's name.
    pub device: String,
    /// The driver's name and version.
    pub driver: String,
}

impl From<BackendInfo> for Device {
    fn from(info: BackendInfo) -> Self {
        Self {
            backend: info.backend.to_owned(),
            api: info.api,
            device: info.device,
            driver: info.driver,
        }
    }
}

/// How long a step took.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// The step.
    pub step: String,
    /// On the device.
    pub nanoseconds: u64,
}

/// A captured texture or buffer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capture {
    /// Which frame, from 0.
    pub frame: u32,
    /// The pass that wrote it.
    pub pass: String,
    /// The pass's binding.
    pub binding: String,
    /// The resource's name in the plan.
    pub resource: String,
    /// Its shape. A buffer is an image of one row of 32-bit numbers.
    pub desc: TextureDesc,
    /// Whether it is a buffer.
    pub buffer: bool,
    /// The file with its bytes, in the folder of the outcome.
    file: String,
    /// How far devices may be from it.
    #[serde(default)]
    spread: Option<SpreadFile>,
}

/// Where it is written how far devices may be from a capture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct SpreadFile {
    /// `rgba32float` of the capture's size, in the folder of the outcome.
    file: String,
    decided: u64,
}

/// How far devices may be from a capture, by executions that were perturbed.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// For each channel of each texel, in storage order.
    pub allowed: Vec<[f32; 4]>,
    /// Texels that may be anything, since a decision hangs on a rounding.
    pub decided: u64,
}

impl Capture {
    /// What the same capture of another execution has in common with this one.
    #[must_use]
    pub fn key(&self) -> (u32, &str, &str) {
        (self.frame, &self.pass, &self.binding)
    }

    /// Writes an image to the folder and describes it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(
        folder: &Path,
        label: Label<'_>,
        number: usize,
        image: &ImageData,
    ) -> Result<Self, OutcomeError> {
        let file = format!("{number:05}.texels");
        let path = folder.join(&file);
        std::fs::write(&path, &image.bytes).map_err(|source| OutcomeError::Io { path, source })?;
        Ok(Self {
            frame: label.frame,
            pass: label.pass.to_owned(),
            binding: label.binding.to_owned(),
            resource: label.resource.to_owned(),
            desc: image.desc,
            buffer: label.buffer,
            file,
            spread: None,
        })
    }

    /// Writes how far devices may be from it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_spread(&mut self, folder: &Path, spread: &Spread) -> Result<(), OutcomeError> {
        let file = format!("{}.spread", self.file);
        let path = folder.join(&file);
        let bytes: Vec<u8> = spread
            .allowed
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        std::fs::write(&path, bytes).map_err(|source| OutcomeError::Io { path, source })?;
        self.spread = Some(SpreadFile {
            file,
            decided: spread.decided,
        });
        Ok(())
    }

    /// Reads how far devices may be from it, if that was written.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read_spread(&self, folder: &Path) -> Result<Option<Spread>, OutcomeError> {
        let Some(written) = &self.spread else {
            return Ok(None);
        };
        let path = folder.join(&written.file);
        let bytes = std::fs::read(&path).map_err(|source| OutcomeError::Io { path, source })?;
        let (texels, _) = bytes.as_chunks::<16>();
        let channel = |texel: &[u8; 16], channel: usize| {
            let (channels, _) = texel.as_chunks::<4>();
            f32::from_le_bytes(channels[channel])
        };
        Ok(Some(Spread {
            allowed: texels
                .iter()
                .map(|texel| [0, 1, 2, 3].map(|number| channel(texel, number)))
                .collect(),
            decided: written.decided,
        }))
    }

    /// Reads the image back.
    ///
    /// # Errors
    /// If the file cannot be read or has another length than described.
    pub fn read(&self, folder: &Path) -> Result<ImageData, OutcomeError> {
        let path = folder.join(&self.file);
        let bytes = std::fs::read(&path).map_err(|source| OutcomeError::Io {
            path: path.clone(),
            source,
        })?;
        ImageData::from_bytes(self.desc, bytes)
            .map_err(|source| OutcomeError::Image { path, source })
    }
}

/// What a capture is called.
#[derive(Clone, Copy, Debug)]
pub struct Label<'a> {
    /// Which frame, from 0.
    pub frame: u32,
    /// The pass that wrote it.
    pub pass: &'a str,
    /// The pass's binding.
    pub binding: &'a str,
    /// The resource's name in the plan.
    pub resource: &'a str,
    /// Whether it is a buffer.
    pub buffer: bool,
}

/// Why an outcome cannot be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OutcomeError {
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
    /// Texels that are not as described.
    #[error("{}: {source}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: ImageError,
    },
}

impl Outcome {
    /// Writes the JSON file. It comes last, so that its presence means that
    /// all else is there.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), OutcomeError> {
        let path = folder.join(FILE);
        let text = serde_json::to_string(self).map_err(|source| OutcomeError::Json {
            path: path.clone(),
            source,
        })?;
        std::fs::write(&path, text).map_err(|source| OutcomeError::Io { path, source })
    }

    /// Reads the JSON file.
    ///
    /// # Errors
    /// If there is none, or it is broken.
    pub fn read(folder: &Path) -> Result<Self, OutcomeError> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| OutcomeError::Io {
            path: path.clone(),
            source,
        })?;
        serde_json::from_str(&text).map_err(|source| OutcomeError::Json { path, source })
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::Format;

    use super::*;

    fn run(folder: &Path) -> (Run, ImageData) {
        let desc = TextureDesc::d2(3, 2, Format::Rg16Float);
        let image = ImageData::from_bytes(desc, (0..24).collect()).unwrap();
        let label = Label {
            frame: 1,
            pass: "bloom/threshold",
            binding: "target",
            resource: "bright",
            buffer: false,
        };
        let run = Run {
            device: Device {
                backend: "ash".into(),
                api: "vulkan".into(),
                device: "llvmpipe".into(),
                driver: "Mesa".into(),
            },
            captures: vec![Capture::write(folder, label, 7, &image).unwrap()],
            times: vec![Time {
                step: "bloom/threshold".into(),
                nanoseconds: 1234,
            }],
            findings: vec!["pass: file:1:2: what".into()],
        };
        (run, image)
    }

    #[test]
    fn an_outcome_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let (run, image) = run(folder.path());
        assert_eq!(run.captures[0].read(folder.path()).unwrap(), image);
        for outcome in [
            Outcome::Ran(run),
            Outcome::NoDevice {
                reason: "none".into(),
            },
            Outcome::Unsupported {
                reason: "r8unorm stores".into(),
            },
            Outcome::Failed {
                reason: "lost".into(),
            },
        ] {
            outcome.write(folder.path()).unwrap();
            assert_eq!(Outcome::read(folder.path()).unwrap(), outcome);
        }
    }

    #[test]
    fn a_spread_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let (mut run, _) = run(folder.path());
        assert_eq!(run.captures[0].read_spread(folder.path()).unwrap(), None);
        let spread = Spread {
            allowed: vec![[0.5, 0.0, 1e-7, f32::INFINITY]; 6],
            decided: 3,
        };
        run.captures[0]
            .write_spread(folder.path(), &spread)
            .unwrap();
        let read = run.captures[0].read_spread(folder.path()).unwrap();
        assert_eq!(read, Some(spread));
    }

    #[test]
    fn damage_is_reported_with_the_file() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(
            Outcome::read(folder.path()),
            Err(OutcomeError::Io { .. })
        ));
        std::fs::write(folder.path().join(FILE), "{\"status\": \"ran\"}").unwrap();
        let error = Outcome::read(folder.path()).unwrap_err();
        assert!(matches!(error, OutcomeError::Json { .. }), "{error}");
        assert!(error.to_string().contains(FILE), "{error}");
        let (run, _) = run(folder.path());
        std::fs::write(folder.path().join(&run.captures[0].file), [1, 2, 3]).unwrap();
        let error = run.captures[0].read(folder.path()).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("takes 24 bytes, but 3 are given"),
            "{error}"
        );
    }
}

//! What an executor of plans offers.
//!
//! There are two ways to use one. An engine uses the backend crate's own
//! types, which adopt the engine's device and record into its command stream.
//! Tests, tools and offline users use the [`Backend`] trait, which takes images
//! from the host and gives images back.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use thiserror::Error;

pub use crate::counters::Counters;
use crate::image::ImageData;
use crate::kernel::Need;
use crate::plan::{MemoryModel, Plan, TightMemory};
use crate::resource::Limits;

/// Who executes.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct BackendInfo {
    /// `cpu`, `wgpu` or `ash`.
    pub backend: &'static str,
    /// What it drives: `vulkan`, `gl`, or an instruction set.
    pub api: String,
    /// The device's name.
    pub device: String,
    /// The driver's name and version.
    pub driver: String,
}

impl fmt::Display for BackendInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({}, {}, {})",
            self.backend, self.api, self.device, self.driver
        )
    }
}

/// What the plan's imports hold.
#[derive(Clone, Debug, Default)]
pub struct Inputs<'a> {
    /// Textures by import name.
    pub textures: BTreeMap<Cow<'a, str>, &'a ImageData>,
    /// Buffers by import name.
    pub buffers: BTreeMap<Cow<'a, str>, &'a [u8]>,
}

impl<'a> Inputs<'a> {
    /// No inputs.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a texture.
    #[must_use]
    pub fn texture(mut self, name: impl Into<Cow<'a, str>>, image: &'a ImageData) -> Self {
        self.textures.insert(name.into(), image);
        self
    }

    /// Adds a buffer.
    #[must_use]
    pub fn buffer(mut self, name: impl Into<Cow<'a, str>>, bytes: &'a [u8]) -> Self {
        self.buffers.insert(name.into(), bytes);
        self
    }
}

/// What was copied back.
#[derive(Clone, Debug, PartialEq)]
pub enum CapturedData {
    /// The mips and layers captured, as a texture of their own.
    Texture(ImageData),
    /// A whole buffer.
    Buffer(Vec<u8>),
}

/// One [`Capture`](crate::plan::Step::Capture) step's result.
#[derive(Clone, Debug, PartialEq)]
pub struct Captured {
    /// The pass that wrote it, or `output`.
    pub pass: String,
    /// The pass's binding, or the output's name.
    pub binding: String,
    /// The resource's name in the plan.
    pub resource: String,
    /// What it held.
    pub data: CapturedData,
}

/// How long one step took on the device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StepTime {
    /// The step's name.
    pub step: String,
    /// Nanoseconds between its start and its end.
    pub nanoseconds: u64,
}

/// The result of running a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Execution {
    /// What the plan captured, in its order.
    pub captures: Vec<Captured>,
    /// Times of the dispatches, draws, clears and copies, in the plan's order; empty
    /// where the device cannot tell.
    pub times: Vec<StepTime>,
}

impl Execution {
    /// The texture captured as this output, with [`Capture::Outputs`](crate::plan::Capture::Outputs).
    #[must_use]
    pub fn output(&self, name: &str) -> Option<&ImageData> {
        self.texture("output", name)
    }

    /// The texture captured from this pass's binding.
    #[must_use]
    pub fn texture(&self, pass: &str, binding: &str) -> Option<&ImageData> {
        self.captures
            .iter()
            .find_map(|captured| match &captured.data {
                CapturedData::Texture(image)
                    if captured.pass == pass && captured.binding == binding =>
                {
                    Some(image)
                }
                _ => None,
            })
    }
}

/// Why a backend cannot be had, or cannot run a plan.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BackendError {
    /// No device, driver or loader.
    #[error("no {backend} device: {reason}")]
    NoDevice {
        /// The backend.
        backend: &'static str,
        /// What was looked for and not found, and what would help.
        reason: String,
    },
    /// The plan imports something that was not given.
    #[error("the plan imports `{name}`, which is not among the inputs")]
    MissingInput {
        /// The import.
        name: String,
    },
    /// An input is not what the plan was made for.
    #[error("input `{name}` is {given}, the plan was made for {wanted}")]
    InputMismatch {
        /// The import.
        name: String,
        /// As given.
        given: String,
        /// As planned.
        wanted: String,
    },
    /// The device cannot do something the plan needs.
    #[error("step `{step}` needs {what}, which this device does not have")]
    Unsupported {
        /// The step.
        step: String,
        /// The missing thing.
        what: String,
    },
    /// The device lacks what a kernel needs beyond what every device has.
    #[error(
        "step `{step}`: kernel `{kernel}` needs {need}, but the device lacks, or was made without, \
         the feature `{feature}`"
    )]
    Lacking {
        /// The step.
        step: String,
        /// The kernel.
        kernel: String,
        /// What it needs.
        need: Need,
        /// The device's feature that would give it, as its API spells it.
        feature: &'static str,
    },
    /// A kernel cannot be translated for this backend.
    #[error("step `{step}`: {error}")]
    Kernel {
        /// The step.
        step: String,
        /// Why, with its place in the kernel.
        error: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Memory ran out.
    #[error("no memory for {bytes} bytes of {what}")]
    OutOfMemory {
        /// For what.
        what: String,
        /// How much.
        bytes: u64,
    },
    /// The device is gone; make a new backend.
    #[error("the device was lost: {reason}")]
    DeviceLost {
        /// What the driver says.
        reason: String,
    },
    /// The device's API refused a call.
    #[error("{call}: {reason}")]
    Api {
        /// The call.
        call: &'static str,
        /// What the driver says.
        reason: String,
    },
    /// The validation layer complained.
    #[error("{} validation messages, the first: {}", messages.len(), messages.first().map_or("", String::as_str))]
    Validation {
        /// Every message.
        messages: Vec<String>,
    },
}

/// An executor of plans, as tests, tools and offline users see it.
pub trait Backend {
    /// Who executes.
    fn info(&self) -> BackendInfo;

    /// What the device can do; plan with these.
    fn limits(&self) -> Limits;

    /// How the device lays out memory; plan with this.
    fn memory(&self) -> &dyn MemoryModel {
        &TightMemory
    }

    /// Runs a plan once and waits for it. Histories carry over to the next
    /// call.
    ///
    /// # Errors
    /// A [`BackendError`]; the backend can be used again after any but
    /// [`BackendError::DeviceLost`].
    fn execute(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Execution, BackendError>;

    /// Forgets all histories: the next frame is the first.
    fn reset_histories(&mut self);

    /// What has been made and done so far.
    fn counters(&self) -> Counters;
}

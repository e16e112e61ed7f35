//! What wgpu can come back with, and what it means here.

use etalon_core::backend::BackendError;

/// An error that wgpu reported within an error scope.
#[derive(Debug)]
pub(crate) enum Fault {
    /// Memory ran out.
    Memory,
    /// The call was refused, or failed inside the driver.
    Refused(String),
    /// The device is gone.
    Lost(String),
}

impl From<wgpu::Error> for Fault {
    fn from(error: wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { .. } => Self::Memory,
            wgpu::Error::Validation { description, .. }
            | wgpu::Error::Internal { description, .. } => Self::Refused(description),
        }
    }
}

impl Fault {
    /// As an error of the call that made `bytes` of `what`.
    pub(crate) fn of(self, call: &'static str, what: &str, bytes: u64) -> BackendError {
        match self {
            Self::Memory => BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes,
            },
            Self::Refused(reason) => BackendError::Api {
                call,
                reason: format!("{what}: {reason}"),
            },
            Self::Lost(reason) => BackendError::DeviceLost { reason },
        }
    }

    /// As an error of the translation of a step's kernel.
    pub(crate) fn of_kernel(self, step: &str) -> BackendError {
        match self {
            Self::Refused(reason) => BackendError::Kernel {
                step: step.to_owned(),
                error: reason.into(),
            },
            other => other.of("create_compute_pipeline", step, 0),
        }
    }
}

/// A step that this device cannot run.
pub(crate) fn unsupported(step: &str, what: impl Into<String>) -> BackendError {
    BackendError::Unsupported {
        step: step.to_owned(),
        what: what.into(),
    }
}

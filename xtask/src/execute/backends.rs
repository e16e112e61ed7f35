//! Opens the backend a job asks for.

use etalon::ash::{AshBackend, AshOptions, Validation};
use etalon::cpu::{CpuBackend, CpuOptions};
use etalon::wgpu::{WgpuBackend, WgpuOptions, wgpu::Backends};
use etalon_core::backend::{Backend, BackendError};

use super::{Api, Job};
use crate::test_backends::model::BackendKind;

/// The backend of a job, on the device its environment leaves it.
///
/// # Errors
/// If there is no such device.
pub(super) fn open(job: &Job) -> Result<Box<dyn Backend>, BackendError> {
    Ok(match job.backend {
        BackendKind::Cpu => Box::new(CpuBackend::new(&CpuOptions {
            threads: job.threads,
            ..CpuOptions::default()
        })?),
        BackendKind::Wgpu => {
            let backends = match job.api {
                Api::Vulkan => Backends::VULKAN,
                Api::Gl => Backends::GL,
            };
            Box::new(WgpuBackend::new(&WgpuOptions {
                backends,
                ..WgpuOptions::default()
            })?)
        }
        BackendKind::Ash => {
            let validation = if job.validate {
                Validation::Synchronization
            } else {
                Validation::Off
            };
            Box::new(AshBackend::new(AshOptions {
                validation,
                ..AshOptions::default()
            })?)
        }
    })
}

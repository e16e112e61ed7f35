//! Opens the backend a job asks for.

use etalon::ash::{AshBackend, AshOptions, Validation};
use etalon::cpu::{CpuBackend, CpuOptions};
use etalon::wgpu::{WgpuBackend, WgpuOptions, wgpu::Backends};
use etalon_core::backend::{Backend, BackendError};

use super::Api;
use crate::test_backends::model::BackendKind;

/// A backend on the device that the environment leaves it: `threads` are those
/// of the interpreter, 0 for as many as there are processors; with `validate`,
/// messages of the validation layer are errors of ash.
///
/// # Errors
/// If there is no such device.
pub(crate) fn open(
    backend: BackendKind,
    api: Api,
    threads: usize,
    validate: bool,
) -> Result<Box<dyn Backend>, BackendError> {
    Ok(match backend {
        BackendKind::Cpu => Box::new(CpuBackend::new(&CpuOptions {
            threads,
            ..CpuOptions::default()
        })?),
        BackendKind::Wgpu => {
            let backends = match api {
                Api::Vulkan => Backends::VULKAN,
                Api::Gl => Backends::GL,
            };
            Box::new(WgpuBackend::new(&WgpuOptions {
                backends,
                ..WgpuOptions::default()
            })?)
        }
        BackendKind::Ash => {
            let validation = if validate {
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

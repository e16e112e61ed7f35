//! Opens the backend a job asks for.

use etalon::ash::{AshBackend, AshOptions, Validation};
use etalon::cpu::{Checks, CpuBackend, CpuOptions};
use etalon::wgpu::{WgpuBackend, WgpuOptions, wgpu::Backends};
use etalon_core::backend::{Backend, BackendError};

use super::{Api, Job};
use crate::test_backends::model::BackendKind;

/// A backend, and the interpreter as what it is.
pub(super) enum Opened {
    Cpu(Box<CpuBackend>),
    Device(Box<dyn Backend>),
}

impl Opened {
    pub(super) fn backend(&mut self) -> &mut dyn Backend {
        match self {
            Self::Cpu(backend) => backend.as_mut(),
            Self::Device(backend) => backend.as_mut(),
        }
    }

    /// What checks found, a line each.
    pub(super) fn findings(&self) -> Vec<String> {
        let Self::Cpu(backend) = self else {
            return Vec::new();
        };
        let found = backend.findings();
        let mut lines: Vec<String> = found.list.iter().map(ToString::to_string).collect();
        if found.omitted > 0 {
            lines.push(format!("and {} more at other places", found.omitted));
        }
        lines
    }
}

/// The backend of a job, on the device its environment leaves it.
///
/// # Errors
/// If there is no such device.
pub(super) fn open_for(job: &Job) -> Result<Opened, BackendError> {
    if job.backend != BackendKind::Cpu {
        return open(job.backend, job.api, job.threads, job.validate).map(Opened::Device);
    }
    let options = CpuOptions {
        threads: job.threads,
        checks: if job.checks {
            Checks::all()
        } else {
            Checks::NONE
        },
        ..CpuOptions::default()
    };
    Ok(Opened::Cpu(Box::new(CpuBackend::new(&options)?)))
}

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

//! Who executes.

use std::fmt;
use std::str::FromStr;

use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::Graph;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions, NumberType};
use etalon_wgpu::{WgpuBackend, WgpuOptions, wgpu::Backends};

use crate::model;

/// A backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The interpreter.
    Cpu,
    /// wgpu on Vulkan.
    Wgpu,
    /// Vulkan.
    Ash,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Wgpu, Self::Ash];
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Cpu => "cpu",
            Self::Wgpu => "wgpu",
            Self::Ash => "ash",
        })
    }
}

impl FromStr for Kind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|kind| kind.to_string() == text);
        known.ok_or_else(|| format!("there is no backend `{text}`; there are cpu, wgpu, ash"))
    }
}

/// A backend on a device.
pub struct Executor {
    /// Which.
    pub kind: Kind,
    backend: Box<dyn Backend>,
}

impl fmt::Debug for Executor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Executor({})", self.backend.info())
    }
}

impl Executor {
    /// Opens a backend on the first device there is for it.
    ///
    /// # Errors
    /// If there is none.
    pub fn open(kind: Kind) -> Result<Self, BackendError> {
        let backend: Box<dyn Backend> = match kind {
            Kind::Cpu => Box::new(CpuBackend::new(&CpuOptions::default())?),
            Kind::Wgpu => Box::new(WgpuBackend::new(&WgpuOptions {
                backends: Backends::VULKAN,
                ..WgpuOptions::default()
            })?),
            Kind::Ash => Box::new(AshBackend::new(AshOptions {
                validation: Validation::Off,
                ..AshOptions::default()
            })?),
        };
        Ok(Self { kind, backend })
    }

    /// What a report says of it.
    #[must_use]
    pub fn model(&self) -> model::Executor {
        let info = self.backend.info();
        model::Executor {
            id: self.kind.to_string(),
            api: info.api,
            device: info.device,
            driver: info.driver,
        }
    }

    /// The backend.
    pub fn backend(&mut self) -> &mut dyn Backend {
        self.backend.as_mut()
    }

    /// Plans a graph for it.
    ///
    /// # Errors
    /// If the device cannot do what the graph asks for.
    pub fn plan(
        &self,
        graph: &Graph,
        kernels: &KernelLibrary,
        arithmetic: Arithmetic,
        capture: Capture,
    ) -> Result<Plan, PlanError> {
        plan(self.backend.as_ref(), graph, kernels, arithmetic, capture)
    }

    /// Nanoseconds that the device takes for a frame, all steps together; `None`
    /// if it cannot tell.
    ///
    /// # Errors
    /// If the plan cannot be run.
    pub fn time(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Option<f64>, BackendError> {
        let execution = self.backend.execute(plan, inputs)?;
        let times = execution.times.iter().map(|step| step.nanoseconds as f64);
        Ok((!execution.times.is_empty()).then(|| times.sum()))
    }
}

/// Plans a graph for a backend.
///
/// # Errors
/// If the backend cannot do what the graph asks for.
pub fn plan(
    backend: &dyn Backend,
    graph: &Graph,
    kernels: &KernelLibrary,
    arithmetic: Arithmetic,
    capture: Capture,
) -> Result<Plan, PlanError> {
    let options = PlanOptions {
        arithmetic,
        limits: backend.limits(),
        capture,
        memory: backend.memory(),
    };
    Plan::new(graph, kernels, &options)
}

/// The interpreter in `f64`: the same algorithm without rounding to speak of.
///
/// # Errors
/// If the system gives no threads.
pub fn exact() -> Result<CpuBackend, BackendError> {
    CpuBackend::new(&CpuOptions {
        number_type: NumberType::F64,
        ..CpuOptions::default()
    })
}

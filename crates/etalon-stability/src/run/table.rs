//! What all cases that are lit share.

use std::sync::Arc;

use etalon_core::backend::{Backend, BackendError};
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions};
use etalon_effects::EffectError;
use etalon_effects::environment::mirroring;
use thiserror::Error;

/// Why there is no table.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TableError {
    /// The effect refuses to make it.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// It cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The interpreter cannot make it.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

const NAME: &str = "mirroring";

/// How much of light from everywhere surfaces mirror, as the interpreter computes it:
/// without it each frame makes its own.
pub(super) fn table_of_mirroring(
    kernels: &KernelLibrary,
) -> Result<Option<Arc<ImageData>>, TableError> {
    let mut graph = Graph::new();
    let table = mirroring(&mut graph)?;
    graph.output(NAME, table).map_err(EffectError::from)?;
    let mut backend = CpuBackend::new(&CpuOptions::default())?;
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        limits: backend.limits(),
        memory: backend.memory(),
        capture: Capture::Outputs,
    };
    let plan = Plan::new(&graph, kernels, &options)?;
    let made = backend.execute(&plan, &Default::default())?;
    Ok(made.output(NAME).cloned().map(Arc::new))
}

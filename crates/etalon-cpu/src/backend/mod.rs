//! Running plans.

mod findings;
mod histories;
mod pool;
mod raster;
mod resources;
mod run;
mod wide;

use std::collections::HashMap;
use std::sync::Arc;

use etalon_core::backend::{Backend, BackendError, BackendInfo, Counters, Execution, Inputs};
use etalon_core::kernel::{Kernel, KernelId};
use etalon_core::plan::Plan;
use etalon_core::resource::Limits;

pub use self::findings::{Findings, StepFinding, StepSanitised};
use self::histories::Histories;
use self::pool::Pool;
pub use self::wide::{WideCapture, WideExecution};
use crate::error::RunError;
use crate::exec::{Executor, Profile, Tier};
use crate::finding::Checks;
use crate::num::NumberType;
use crate::program::{Program, TranslateOptions};

/// How plans are run on the CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CpuOptions {
    /// Number of threads; 0 for one per processor. Results do not depend on it.
    pub threads: usize,
    /// Instruction set; the best one there is without it. Results do not depend
    /// on it.
    pub tier: Option<Tier>,
    /// See [`Executor::with_lanes`]; chosen for each kernel without it.
    pub lanes: Option<u32>,
    /// See [`Executor::with_max_trips`].
    pub max_trips: u32,
    /// See [`Executor::with_profile`].
    pub profile: bool,
    /// What kernels compute in. In other types than `f32`, what passes write has
    /// a wide plane: see [`CpuBackend::execute_wide`].
    pub number_type: NumberType,
    /// What to watch for; what is found is in [`CpuBackend::findings`]. Looking for
    /// reads that nothing wrote also means that no two textures or buffers of a
    /// plan share memory.
    pub checks: Checks,
    /// Whether the [sanitiser](crate::sanitise) follows what kernels compute; what it
    /// finds is in [`CpuBackend::take_sanitised`]. Kernels then compute in
    /// [`NumberType::Shadow`] whatever `number_type` says, each from the `f32` that its
    /// resources hold, so that results are bit by bit those of `f32`. Of passes that draw
    /// it finds what their vertex and fragment kernels do.
    pub sanitise: bool,
    /// Whether results of compute passes can be moved within what WGSL allows, see
    /// [`CpuBackend::set_perturbation`].
    pub perturbs: bool,
}

impl Default for CpuOptions {
    fn default() -> Self {
        Self {
            threads: 0,
            tier: None,
            lanes: None,
            max_trips: Executor::DEFAULT_MAX_TRIPS,
            profile: false,
            number_type: NumberType::F32,
            checks: Checks::NONE,
            sanitise: false,
            perturbs: false,
        }
    }
}

/// The interpreter as a backend.
#[derive(Debug)]
pub struct CpuBackend {
    executor: Executor,
    raster_programs: raster::RasterPrograms,
    programs: HashMap<KernelId, Program>,
    pool: Pool,
    histories: Histories,
    counters: Counters,
    checks: Checks,
    findings: Findings,
    sanitise: bool,
    sanitised: Vec<StepSanitised>,
    perturbs: bool,
}

impl CpuBackend {
    /// Starts the threads.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if the system gives no threads.
    pub fn new(options: &CpuOptions) -> Result<Self, BackendError> {
        let executor = Executor::new(options.threads).map_err(|error| BackendError::NoDevice {
            backend: "cpu",
            reason: error.to_string(),
        })?;
        let executor = match options.lanes {
            Some(lanes) => executor.with_lanes(lanes),
            None => executor,
        };
        let executor = executor
            .with_max_trips(options.max_trips)
            .with_profile(options.profile)
            .with_number_type(if options.sanitise {
                NumberType::Shadow
            } else {
                options.number_type
            })
            .with_tier(options.tier.unwrap_or_else(Tier::best));
        Ok(Self {
            executor,
            raster_programs: raster::RasterPrograms::default(),
            programs: HashMap::new(),
            pool: Pool::new(options.number_type.is_wide() && !options.sanitise),
            histories: Histories::default(),
            counters: Counters::default(),
            checks: options.checks,
            findings: Findings::default(),
            sanitise: options.sanitise,
            sanitised: Vec::new(),
            perturbs: options.perturbs,
        })
    }

    /// What runs the programs.
    #[must_use]
    pub fn executor(&self) -> &Executor {
        &self.executor
    }

    /// What the instructions of every kernel run have cost since the backend
    /// was made, by name of kernel; all zero unless [`CpuOptions::profile`] was
    /// set.
    #[must_use]
    pub fn profiles(&self) -> Vec<Profile> {
        let mut programs: Vec<_> = self.programs.iter().collect();
        programs.sort_by(|(a, one), (b, other)| (one.name(), a).cmp(&(other.name(), b)));
        programs
            .into_iter()
            .map(|(_, program)| program.profile())
            .collect()
    }

    /// What was found so far.
    #[must_use]
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// What was found so far, which is forgotten.
    pub fn take_findings(&mut self) -> Findings {
        std::mem::take(&mut self.findings)
    }

    /// From now on another device that WGSL allows, or none: see
    /// [`Executor::with_perturbation`]. Of no effect unless [`CpuOptions::perturbs`] was
    /// set.
    pub fn set_perturbation(&mut self, seed: Option<u64>) {
        self.executor.set_perturbation(seed);
    }

    /// What the sanitiser found in the passes since this was last asked, in the order in
    /// which they ran; it grows with every frame until then.
    pub fn take_sanitised(&mut self) -> Vec<StepSanitised> {
        std::mem::take(&mut self.sanitised)
    }

    /// The bytecode of a kernel, for reading; translated at most once.
    ///
    /// # Errors
    /// [`BackendError::Kernel`] if the kernel uses what the interpreter does not have.
    pub fn program(&mut self, kernel: &Arc<Kernel>) -> Result<&Program, BackendError> {
        self.prepare(&kernel.name, kernel)?;
        self.programs
            .get(&kernel.id)
            .ok_or_else(|| BackendError::Api {
                call: "translate",
                reason: format!("kernel {} was not kept", kernel.name),
            })
    }

    /// [`Backend::execute`], and beside each capture its values in `f64`: what
    /// the passes computed in the backend's [number
    /// type](CpuOptions::number_type), before it was rounded to the storage
    /// format.
    ///
    /// # Errors
    /// Those of [`Backend::execute`].
    pub fn execute_wide(
        &mut self,
        plan: &Plan,
        inputs: &Inputs<'_>,
    ) -> Result<WideExecution, BackendError> {
        let mut captures = Vec::new();
        let execution = self.run(plan, inputs, Some(&mut captures))?;
        Ok(WideExecution {
            execution,
            captures,
        })
    }

    /// Translates a kernel unless that was done before.
    fn prepare(&mut self, step: &str, kernel: &Arc<Kernel>) -> Result<(), BackendError> {
        if let std::collections::hash_map::Entry::Vacant(entry) = self.programs.entry(kernel.id) {
            let options = TranslateOptions {
                checks: self.checks,
                sanitise: self.sanitise,
                perturb: self.perturbs,
            };
            let program = Program::translate_with(kernel, &options).map_err(|error| {
                BackendError::Kernel {
                    step: step.to_owned(),
                    error: Box::new(error),
                }
            })?;
            entry.insert(program);
            self.counters.kernels += 1;
            self.counters.pipelines += 1;
        }
        Ok(())
    }
}

/// A [`RunError`] of a step.
fn step_error(step: &str, error: RunError) -> BackendError {
    match error {
        RunError::OutOfMemory { what, bytes } => BackendError::OutOfMemory { what, bytes },
        other => BackendError::Kernel {
            step: step.to_owned(),
            error: Box::new(other),
        },
    }
}

/// A plan that contradicts itself.
fn malformed(step: &str, what: impl std::fmt::Display) -> BackendError {
    BackendError::Api {
        call: "plan",
        reason: format!("step `{step}`: {what}"),
    }
}

impl Backend for CpuBackend {
    fn info(&self) -> BackendInfo {
        BackendInfo {
            backend: "cpu",
            api: self.executor.tier().to_string(),
            device: format!(
                "{} threads of {}",
                self.executor.threads(),
                std::env::consts::ARCH
            ),
            driver: format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")),
        }
    }

    fn limits(&self) -> Limits {
        // Beyond what WebGPU guarantees, only memory limits the interpreter;
        // these are what large devices have.
        Limits {
            max_texture_2d: 16_384,
            max_texture_layers: 2048,
            max_workgroup_invocations: 1024,
            max_workgroup_bytes: 1 << 16,
            uniform_alignment: 16,
            extended_storage_formats: true,
            ..Limits::default()
        }
    }

    fn execute(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Execution, BackendError> {
        self.run(plan, inputs, None)
    }

    fn reset_histories(&mut self) {
        self.histories.reset(&mut self.pool);
    }

    fn counters(&self) -> Counters {
        let made = self.pool.counters();
        Counters {
            textures: made.textures,
            buffers: made.buffers,
            allocations: made.textures + made.buffers,
            bytes: made.bytes,
            ..self.counters
        }
    }
}

//! The backend: plans in, commands out.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use etalon_core::backend::{Backend, BackendError, BackendInfo, Counters, Execution, Inputs};
use etalon_core::plan::{MemoryModel, Plan, ResourceKind};
use etalon_core::resource::Limits;

use crate::commands::{Barriers, Commands};
use crate::device::Device;
use crate::error::{NAME, malformed};
use crate::history::{self, Histories, Pair};
use crate::host::{self, HostSide};
use crate::instance::Instance;
use crate::memory::DeviceMemory;
use crate::prepared::{Prepared, Shared};
use crate::queue::HostQueue;
use crate::run::Run;
use crate::sets::Parts;
use crate::validation::{Validation, ValidationLog};
use crate::{Resource, handover, physical};

/// How a backend is made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AshOptions {
    /// Part of the name of the device to use, in any case of letters. Without,
    /// the first of the kind most preferred: discrete, integrated, virtual,
    /// software. Of no use with an adopted device.
    pub device: Option<String>,
    /// What the Khronos validation layer checks. Of no use with an adopted
    /// device, whose instance is the engine's.
    pub validation: Validation,
    /// Whether [`Backend::execute`] fails with [`BackendError::Validation`]
    /// when the layer has said anything during it. Otherwise messages are
    /// only collected, see [`AshBackend::validation_log`].
    pub validation_fails: bool,
    /// The most recordings that are still to run or running on the GPU when
    /// another is recorded: the number of frames in flight times the number of
    /// plans recorded for each. At least 1.
    pub frames_in_flight: u32,
    /// How many structures of plans to keep prepared, the least recently used
    /// of more being dropped. At least 1.
    pub plans_kept: usize,
}

impl Default for AshOptions {
    /// Any device, no validation, two frames in flight, eight plans kept.
    fn default() -> Self {
        Self {
            device: None,
            validation: Validation::Off,
            validation_fails: true,
            frames_in_flight: 2,
            plans_kept: 8,
        }
    }
}

/// Runs plans on a Vulkan device. See the [crate documentation](crate).
pub struct AshBackend {
    pub(crate) options: AshOptions,
    memory: DeviceMemory,
    pub(crate) shared: Shared,
    /// By structure, the least recently used first.
    pub(crate) prepared: Vec<(u64, Prepared)>,
    pub(crate) histories: Histories,
    host: Option<HostQueue>,
    /// The engine's recordings that may not have left the GPU, oldest first.
    pub(crate) under_way: VecDeque<u64>,
    pub(crate) device: Arc<Device>,
}

impl std::fmt::Debug for AshBackend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AshBackend")
            .field("info", &self.info())
            .field("options", &self.options)
            .field("counters", &self.counters())
            .finish_non_exhaustive()
    }
}

impl AshBackend {
    /// A backend with an instance and a device of its own.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] without a Vulkan loader, a suitable device or
    /// the validation layer asked for; otherwise what Vulkan says.
    pub fn new(options: AshOptions) -> Result<Self, BackendError> {
        let instance = Instance::new(options.validation)?;
        let physical = physical::choose(&instance, options.device.as_deref())?;
        Ok(Self::with(Device::new(instance, physical)?, options))
    }

    pub(crate) fn with(device: Device, options: AshOptions) -> Self {
        let device = Arc::new(device);
        Self {
            options: AshOptions {
                frames_in_flight: options.frames_in_flight.max(1),
                plans_kept: options.plans_kept.max(1),
                ..options
            },
            memory: DeviceMemory::new(device.clone()),
            shared: Shared::default(),
            prepared: Vec::new(),
            histories: Histories::default(),
            host: None,
            under_way: VecDeque::new(),
            device,
        }
    }

    /// What the validation layer has said since the backend was made, if it is
    /// on. The log outlives the backend, and has the last word about leaks.
    #[must_use]
    pub fn validation_log(&self) -> Option<Arc<ValidationLog>> {
        self.device.instance.log.clone()
    }

    /// Finds what was made for plans of this structure, or makes it. Returns
    /// its index, which is good until the next call.
    pub(crate) fn prepare(&mut self, plan: &Plan) -> Result<usize, BackendError> {
        let structure = plan.structure();
        let found = self
            .prepared
            .iter()
            .position(|(candidate, _)| *candidate == structure);
        let prepared = match found {
            Some(index) => self.prepared.remove(index).1,
            None => {
                let frames = self.options.frames_in_flight;
                let made = Prepared::new(&self.device, plan, &mut self.shared, frames)?;
                if self.prepared.len() >= self.options.plans_kept {
                    self.prepared.remove(0);
                }
                made
            }
        };
        self.prepared.push((structure, prepared));
        Ok(self.prepared.len() - 1)
    }

    /// The texture or buffer behind each number of a plan. `outside` finds
    /// imports and outputs.
    pub(crate) fn resources(
        &mut self,
        plan: &Plan,
        prepared: usize,
        pairs: &[Pair],
        outside: impl Fn(&mut Prepared, &Arc<Device>, usize) -> Result<Resource, BackendError>,
    ) -> Result<Vec<Resource>, BackendError> {
        let device = self.device.clone();
        let prepared = &mut self.prepared[prepared].1;
        let of_history = |history: u32, previous: bool| {
            let pair = pairs.get(usize::try_from(history).ok()?)?;
            let image = if previous {
                &pair.previous
            } else {
                &pair.current
            };
            Some(Resource::Texture(image.clone()))
        };
        let mut resources = Vec::with_capacity(plan.resources.len());
        for (index, planned) in plan.resources.iter().enumerate() {
            let found = match planned.kind {
                ResourceKind::Import(_) | ResourceKind::Output(_) => {
                    Some(outside(prepared, &device, index)?)
                }
                ResourceKind::HistoryPrevious(history) => of_history(history, true),
                ResourceKind::HistoryCurrent(history) => of_history(history, false),
                ResourceKind::Transient(_) => {
                    prepared.heaps.transients.get(index).cloned().flatten()
                }
            };
            // The plan was checked, so there is one.
            resources.push(
                found.ok_or_else(|| {
                    malformed(format!("there is nothing behind `{}`", planned.name))
                })?,
            );
        }
        Ok(resources)
    }

    /// Runs a plan with inputs from the host, which have been checked.
    fn execute_checked(
        &mut self,
        plan: &Plan,
        inputs: &Inputs<'_>,
    ) -> Result<Execution, BackendError> {
        let prepared = self.prepare(plan)?;
        if self.host.is_none() {
            self.host = Some(HostQueue::new(&self.device)?);
        }
        if self.prepared[prepared].1.host.is_none() {
            self.prepared[prepared].1.host = Some(HostSide::new(&self.device, plan)?);
        }
        let pairs = self.histories.get(&self.device, plan)?;
        let resources = self.resources(plan, prepared, &pairs, |prepared, device, index| {
            let import = prepared.host.as_ref().and_then(|host| host.import(index));
            match import {
                Some(import) => Ok(import.clone()),
                None => prepared.output(device, index, &plan.resources[index]),
            }
        })?;
        let Some(queue) = &self.host else {
            return Err(malformed("there is no queue"));
        };
        let prepared = &mut self.prepared[prepared].1;
        if let Some(host) = &prepared.host {
            host.stage(plan, inputs)?;
        }
        let recording = self.device.begin_recording();
        let result = (|| {
            let commands = queue.begin()?;
            let mut before = Barriers::default();
            // Where engines' recordings have left outputs.
            for (resource, left) in resources.iter().zip(&prepared.left) {
                if let Some(left) = left {
                    handover::wait(&mut before, resource, *left);
                }
            }
            commands.barrier(&mut before);
            if let Some(host) = &prepared.host {
                host.upload(&commands);
            }
            run(
                &self.device,
                &commands,
                prepared,
                &self.shared,
                plan,
                &resources,
                &pairs,
                recording,
                true,
            )?;
            if let Some(host) = &prepared.host {
                host.show(&commands);
            }
            queue.submit()
        })();
        // Submitted and waited for, or never submitted.
        prepared.release(recording);
        if self.under_way.is_empty() {
            self.device.complete(recording);
        }
        result?;
        prepared.left.fill(None);
        self.histories.advance(plan);
        match &prepared.host {
            Some(host) => host.collect(plan),
            None => Ok(Execution::default()),
        }
    }
}

/// Records the plan itself, between what comes before and after.
#[expect(
    clippy::too_many_arguments,
    reason = "both callers borrow them from one struct, each separately"
)]
pub(crate) fn run(
    device: &Arc<Device>,
    commands: &Commands<'_>,
    prepared: &mut Prepared,
    shared: &Shared,
    plan: &Plan,
    resources: &[Resource],
    pairs: &[Pair],
    recording: u64,
    for_host: bool,
) -> Result<(), BackendError> {
    let transient = &device.tally.transient_bytes;
    transient.store(prepared.heaps.bytes, Ordering::Relaxed);
    let (uniforms, ring) = match &mut prepared.uniforms {
        Some(ring) => (
            ring.write(&plan.uniforms, recording, device.completed())?,
            Some(ring.raw()),
        ),
        None => (0, None),
    };
    let parts = Parts {
        plan,
        pipelines: &prepared.pipelines,
        resources,
        samplers: &shared.samplers,
        uniforms: ring,
    };
    let sets = prepared.bindings.get(device, &parts, recording)?;
    history::initialise(commands, pairs);
    let host = prepared.host.as_ref().filter(|_| for_host);
    Run {
        plan,
        resources,
        apart: &prepared.heaps.apart,
        pipelines: &prepared.pipelines,
        sets,
        uniforms,
        captures: host.and_then(HostSide::captures),
        queries: host.and_then(|host| host.queries(commands)),
    }
    .record(commands)
}

impl Backend for AshBackend {
    fn info(&self) -> BackendInfo {
        let info = &self.device.physical.info;
        BackendInfo {
            backend: NAME,
            api: format!("Vulkan {}", info.api_version),
            device: info.name.clone(),
            driver: info.driver.clone(),
        }
    }

    fn limits(&self) -> Limits {
        self.device.physical.limits(&self.device.features)
    }

    fn memory(&self) -> &dyn MemoryModel {
        &self.memory
    }

    fn execute(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Execution, BackendError> {
        host::check_inputs(plan, inputs)?;
        let log = self
            .validation_log()
            .filter(|_| self.options.validation_fails);
        let before = log.as_ref().map_or(0, |log| log.len());
        let result = self.execute_checked(plan, inputs);
        if let Some(log) = log {
            let messages: Vec<String> = log
                .messages()
                .iter()
                .skip(before)
                .map(ToString::to_string)
                .collect();
            if !messages.is_empty() {
                return Err(BackendError::Validation { messages });
            }
        }
        result
    }

    fn reset_histories(&mut self) {
        self.histories.clear();
    }

    fn counters(&self) -> Counters {
        self.device.tally.read()
    }
}

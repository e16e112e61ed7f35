//! The backend itself.

use etalon_core::backend::{
    Backend, BackendError, BackendInfo, Captured, Counters, Execution, Inputs,
};
use etalon_core::graph::ResourceDesc;
use etalon_core::plan::{Plan, ResourceKind, Step};
use etalon_core::resource::Limits;

use crate::bind::{Physical, Samplers};
use crate::bindings::{WgpuBindings, WgpuOutput, WgpuOutputs, whole_view};
use crate::check::first_capture;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::history::Histories;
use crate::open::{WgpuOptions, open};
use crate::prepare::{Pipelines, Prepared, PreparedStep};
use crate::record::{prepare_steps, record};
use crate::staging::Staging;
use crate::timing::Timing;

/// How many prepared plans are kept.
///
/// An engine whose frames alternate between a few structures, say with and
/// without an effect, prepares each once. Plans of a former window size go after
/// as many new structures, or at once with [`WgpuBackend::trim`].
pub const PREPARED_PLANS: usize = 4;

/// Runs plans through wgpu. See the [crate documentation](crate).
#[derive(Debug)]
pub struct WgpuBackend {
    gpu: Gpu,
    pipelines: Pipelines,
    samplers: Samplers,
    histories: Histories,
    staging: Staging,
    /// Most recently used first.
    prepared: Vec<Prepared>,
}

impl WgpuBackend {
    /// Opens a device of its own.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if there is none as asked for, saying which
    /// there are.
    pub fn new(options: &WgpuOptions) -> Result<Self, BackendError> {
        open(options).map(Self::on)
    }

    /// Uses an engine's device, and of it only what the engine has enabled.
    ///
    /// With [`TIMESTAMP_QUERY`](wgpu::Features::TIMESTAMP_QUERY) and
    /// [`TIMESTAMP_QUERY_INSIDE_ENCODERS`](wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
    /// executions are timed by the device, if it is not a software one; with
    /// [`PASSTHROUGH_SHADERS`](wgpu::Features::PASSTHROUGH_SHADERS) on Vulkan
    /// strict arithmetic is kept; with [`SHADER_F16`](wgpu::Features::SHADER_F16)
    /// kernels may have `f16`; with
    /// [`INDIRECT_FIRST_INSTANCE`](wgpu::Features::INDIRECT_FIRST_INSTANCE) plans
    /// may draw indirectly, which is refused without, since a record's first
    /// instance could not be kept; with
    /// [`TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES`](wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES),
    /// and the adapter given, the adapter's own formats can be stored to.
    ///
    /// Without its adapter the device is taken to have the texture formats that
    /// WebGPU guarantees. Whether the workgroup counts of indirect dispatches are
    /// held against the limits, and the records of indirect draws against their
    /// vertices and indices, is up to the
    /// [flags](wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL) of the engine's
    /// instance.
    ///
    /// The engine's error and device-loss callbacks stay the engine's: errors
    /// of the backend's own calls are caught in error scopes; that the device
    /// is lost is for the engine to notice.
    #[must_use]
    pub fn adopt(
        device: wgpu::Device,
        queue: wgpu::Queue,
        adapter: Option<&wgpu::Adapter>,
    ) -> Self {
        Self::on(Gpu::new(device, queue, adapter))
    }

    fn on(gpu: Gpu) -> Self {
        Self {
            gpu,
            pipelines: Pipelines::default(),
            samplers: Samplers::default(),
            histories: Histories::default(),
            staging: Staging::default(),
            prepared: Vec::new(),
        }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.gpu.device
    }

    /// Its queue.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.gpu.queue
    }

    /// Whether strict kernels reach the driver with every operation marked as
    /// not to be contracted. Otherwise a driver that contracts may round
    /// differently from the other executors.
    #[must_use]
    pub fn keeps_strict_arithmetic(&self) -> bool {
        self.gpu.passes_spirv()
    }

    /// Texture views made so far.
    #[must_use]
    pub fn views_created(&self) -> u64 {
        self.gpu.tally.views.get()
    }

    /// Frees all that the last plan has no need of: other prepared plans, their
    /// pipelines, bind groups that hold an engine's former textures, idle
    /// staging buffers. Histories stay.
    pub fn trim(&mut self) {
        self.prepared.truncate(1);
        self.pipelines.trim();
        self.staging.trim();
        for prepared in &mut self.prepared {
            prepared.views.clear();
            for step in &mut prepared.steps {
                match step {
                    PreparedStep::Dispatch { groups, .. } => *groups = Default::default(),
                    PreparedStep::Raster(raster) => raster.trim(),
                    PreparedStep::Clear(clear) => clear.trim(),
                    PreparedStep::Capture(_) | PreparedStep::Plain => {}
                }
            }
        }
    }

    /// Records a plan into an engine's encoder, reading and writing the
    /// engine's textures and buffers.
    ///
    /// Any number of recordings may go into one encoder or one submit; encoders
    /// must be submitted in the order they were recorded in. Uniforms are those
    /// of the plan at the time of recording. Histories advance with each
    /// recording; if the encoder is dropped instead of submitted, call
    /// [`reset_histories`](Backend::reset_histories).
    ///
    /// # Errors
    /// [`BackendError::MissingInput`] and [`BackendError::InputMismatch`] if
    /// what is given is not what the plan needs; [`BackendError::Unsupported`]
    /// if the plan captures (that takes [`execute`](Backend::execute)) or needs
    /// what the device has not. Nothing is in the encoder then, except if wgpu
    /// itself refused what was recorded ([`BackendError::Api`]).
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        plan: &Plan,
        bindings: &WgpuBindings<'_>,
    ) -> Result<WgpuOutputs, BackendError> {
        if let Some(step) = first_capture(plan) {
            return Err(unsupported(
                &step.name,
                "a copy for the host, which only `execute` makes",
            ));
        }
        self.select(plan)?;
        let given = bindings.resolve(&self.gpu, plan)?;
        let physicals = self.record_commands(encoder, plan, given, false)?;
        let outputs = self.outputs(plan, &physicals)?;
        self.histories.advance(plan);
        Ok(outputs)
    }

    /// Has everything for the structure of a plan at the front.
    fn select(&mut self, plan: &Plan) -> Result<(), BackendError> {
        let structure = plan.structure();
        let known = self
            .prepared
            .iter()
            .position(|prepared| prepared.structure == structure);
        match known {
            Some(index) => self.prepared[..=index].rotate_right(1),
            None => {
                // Room first, so that the new need not fit beside the oldest.
                self.prepared.truncate(PREPARED_PLANS - 1);
                let prepared =
                    Prepared::new(&self.gpu, plan, &mut self.pipelines, &mut self.samplers)?;
                self.prepared.insert(0, prepared);
            }
        }
        Ok(())
    }

    /// Records the selected plan. Every import must be given, unless the plan
    /// was prepared for runs from the host.
    fn record_commands(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        plan: &Plan,
        given: Vec<Option<Physical>>,
        timed: bool,
    ) -> Result<Vec<Physical>, BackendError> {
        let Self {
            gpu,
            samplers,
            histories,
            staging,
            prepared,
            ..
        } = self;
        let Some(prepared) = prepared.first_mut() else {
            return Ok(Vec::new());
        };
        let initial = histories.acquire(gpu, plan)?;
        let mut physicals = Vec::with_capacity(plan.resources.len());
        let given = given.into_iter().chain(std::iter::repeat(None));
        for ((index, resource), given) in (0..).zip(&plan.resources).zip(given) {
            let pair = |history: u32| {
                let planned = plan.histories.get(history as usize)?;
                histories.pair(&planned.name)
            };
            let physical = match (given, &resource.kind) {
                (Some(given), _) => Some(given),
                (None, ResourceKind::Import(_)) => prepared.import(index),
                (None, ResourceKind::Output(_)) => Some(prepared.output(gpu, index, resource)?),
                (None, ResourceKind::Transient(place)) => prepared.transient(place.slot),
                (None, ResourceKind::HistoryPrevious(history)) => {
                    pair(*history).map(|(previous, _)| previous)
                }
                (None, ResourceKind::HistoryCurrent(history)) => {
                    pair(*history).map(|(_, current)| current)
                }
            };
            physicals.push(physical.ok_or_else(|| BackendError::MissingInput {
                name: resource.name.clone(),
            })?);
        }
        prepare_steps(gpu, plan, prepared, &physicals, samplers)?;
        let staged = match &prepared.uniforms {
            Some(_) => Some(staging.fill(gpu, &plan.uniforms)?),
            None => None,
        };
        gpu.guarded(|| {
            for initial in &initial {
                initial.record(encoder);
            }
            if let (Some(staged), Some(uniforms)) = (staged, &prepared.uniforms) {
                let bytes = (plan.uniforms.len() as u64).next_multiple_of(4);
                staging.record(encoder, staged, uniforms, bytes);
            }
            let timing = match &prepared.offline {
                Some(offline) if timed => Some(&offline.timing),
                _ => None,
            };
            record(encoder, gpu, plan, prepared, &physicals, timing);
            gpu.tally.runs_with(prepared.transient_bytes());
        })
        .map_err(|fault| fault.of("record", "the plan", 0))?;
        Ok(physicals)
    }

    /// The outputs of the selected plan.
    fn outputs(
        &mut self,
        plan: &Plan,
        physicals: &[Physical],
    ) -> Result<WgpuOutputs, BackendError> {
        let Self { gpu, prepared, .. } = self;
        let mut outputs = Vec::new();
        let Some(prepared) = prepared.first_mut() else {
            return Ok(WgpuOutputs(outputs));
        };
        for ((index, resource), physical) in (0..).zip(&plan.resources).zip(physicals) {
            let ResourceKind::Output(names) = &resource.kind else {
                continue;
            };
            let output = match (physical, &resource.desc) {
                (Physical::Buffer(buffer), _) => WgpuOutput::Buffer(buffer.clone()),
                (Physical::Texture { texture, .. }, ResourceDesc::Texture(desc)) => {
                    let views = prepared.views.entry(index).or_default();
                    let view = views.select(std::iter::once(physical), || {
                        let Some(part) = physical.texture() else {
                            return Err(BackendError::Api {
                                call: "create_view",
                                reason: format!("`{}` is no texture", resource.name),
                            });
                        };
                        let (dimension, range) = whole_view(desc);
                        let view = gpu
                            .guarded(|| part.view(dimension, range))
                            .map_err(|fault| fault.of("create_view", &resource.name, 0))?;
                        gpu.tally.views.add(1);
                        Ok(view)
                    })?;
                    WgpuOutput::Texture {
                        texture: texture.clone(),
                        view: view.clone(),
                    }
                }
                (Physical::Texture { .. }, ResourceDesc::Buffer(_)) => continue,
            };
            for name in names {
                outputs.push((name.clone(), output.clone()));
            }
        }
        Ok(WgpuOutputs(outputs))
    }

    /// Copies everything captured, and the times, once the device is done.
    fn collect(&self, plan: &Plan) -> Result<Execution, BackendError> {
        let Some(prepared) = self.prepared.first() else {
            return Ok(Execution::default());
        };
        let timing = prepared.offline.as_ref().map(|offline| &offline.timing);
        let times = match timing {
            Some(Timing::Device(queries)) => Some((queries, queries.map(&self.gpu))),
            _ => None,
        };
        let mut readbacks = Vec::new();
        for (planned, step) in plan.steps.iter().zip(&prepared.steps) {
            if let (
                Step::Capture {
                    resource,
                    pass,
                    binding,
                    ..
                },
                PreparedStep::Capture(readback),
            ) = (&planned.step, step)
            {
                let name = plan
                    .resources
                    .get(*resource as usize)
                    .map_or("", |resource| &resource.name);
                readbacks.push((pass, binding, name, readback, readback.map(&self.gpu)));
            }
        }
        self.gpu.wait()?;
        let mut execution = Execution::default();
        for (pass, binding, resource, readback, mapped) in readbacks {
            execution.captures.push(Captured {
                pass: pass.clone(),
                binding: binding.clone(),
                resource: resource.to_owned(),
                data: readback.read(mapped)?,
            });
        }
        if let Some((queries, mapped)) = times {
            execution.times = queries.read(&self.gpu, &plan.steps, mapped)?;
        } else if let Some(Timing::Host(clock)) = timing {
            execution.times = clock.read();
        }
        Ok(execution)
    }
}

impl Backend for WgpuBackend {
    fn info(&self) -> BackendInfo {
        self.gpu.info().clone()
    }

    fn limits(&self) -> Limits {
        self.gpu.limits()
    }

    fn execute(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Execution, BackendError> {
        self.select(plan)?;
        if let Some(prepared) = self.prepared.first_mut() {
            prepared.offline(&self.gpu, plan)?;
        }
        let mut encoder = self
            .gpu
            .guarded(|| {
                self.gpu
                    .device
                    .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                        label: Some("etalon"),
                    })
            })
            .map_err(|fault| fault.of("create_command_encoder", "the plan", 0))?;
        if let Some(offline) = self
            .prepared
            .first()
            .and_then(|prepared| prepared.offline.as_ref())
        {
            // All are checked before any is written.
            let mut checked = Vec::with_capacity(offline.imports.len());
            for (index, import) in &offline.imports {
                if let Some(ResourceKind::Import(name)) =
                    plan.resources.get(*index as usize).map(|found| &found.kind)
                {
                    checked.push((import, name, import.check(name, inputs)?));
                }
            }
            for (import, name, contents) in checked {
                import.write(&self.gpu, &mut encoder, name, contents)?;
            }
        }
        self.record_commands(&mut encoder, plan, Vec::new(), true)?;
        self.gpu
            .guarded(|| {
                let commands = encoder.finish();
                self.gpu.queue.submit([commands]);
            })
            .map_err(|fault| fault.of("submit", "the plan", 0))?;
        let execution = self.collect(plan)?;
        if let Some(reason) = self.gpu.stray_errors().into_iter().next() {
            return Err(BackendError::Api {
                call: "submit",
                reason,
            });
        }
        self.histories.advance(plan);
        Ok(execution)
    }

    fn reset_histories(&mut self) {
        self.histories.reset();
    }

    fn counters(&self) -> Counters {
        self.gpu.tally.read()
    }
}

//! What is made for a plan once, and used by every frame of its structure.

use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::graph::ResourceDesc;
use etalon_core::kernel::KernelId;
use etalon_core::plan::{Bound, DrawForm, Plan, PlannedResource, ResourceKind, Step};
use etalon_core::resource::SamplerDesc;
use gpu_allocator::MemoryLocation;

use crate::buffer::Buffer;
use crate::device::Device;
use crate::draws::DrawPipelines;
use crate::engine::TextureState;
use crate::error::malformed;
use crate::heap::Heaps;
use crate::host::HostSide;
use crate::image::Image;
use crate::pipeline::{Pipeline, Sampler};
use crate::sets::{self, Bindings};
use crate::uniforms::UniformRing;
use crate::{Resource, check, usage};

/// Kernels and samplers, which plans share.
#[derive(Default)]
pub(crate) struct Shared {
    pipelines: HashMap<KernelId, Arc<Pipeline>>,
    drawing: DrawPipelines,
    pub(crate) samplers: Samplers,
}

/// Samplers by description.
#[derive(Default)]
pub(crate) struct Samplers(HashMap<SamplerDesc, Arc<Sampler>>);

impl Samplers {
    pub(crate) fn get(&self, desc: &SamplerDesc) -> Option<vk::Sampler> {
        self.0.get(desc).map(|sampler| sampler.raw)
    }
}

/// What a plan needs on the device, beside what is given to each run.
pub(crate) struct Prepared {
    pub(crate) heaps: Heaps,
    /// By dispatch and draw, in the plan's order.
    pub(crate) pipelines: Vec<Arc<Pipeline>>,
    /// By number in the plan: outputs for which the caller has no texture or
    /// buffer, made when first needed.
    outputs: Vec<Option<Resource>>,
    /// By number in the plan: how those outputs were left, if not at rest.
    pub(crate) left: Vec<Option<TextureState>>,
    pub(crate) uniforms: Option<UniformRing>,
    pub(crate) bindings: Bindings,
    /// For runs whose inputs come from the host.
    pub(crate) host: Option<HostSide>,
}

impl Prepared {
    /// Checks a plan and makes what it needs.
    pub(crate) fn new(
        device: &Arc<Device>,
        plan: &Plan,
        shared: &mut Shared,
        frames_in_flight: u32,
    ) -> Result<Self, BackendError> {
        check::plan(device, plan)?;
        let mut pipelines = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            match &step.step {
                Step::Dispatch { kernel, .. } => {
                    let pipeline = match shared.pipelines.get(&kernel.0.id) {
                        Some(pipeline) => pipeline.clone(),
                        None => {
                            let made = Pipeline::new(device, &kernel.0, step)?;
                            shared.pipelines.insert(kernel.0.id, made.clone());
                            made
                        }
                    };
                    pipelines.push(pipeline);
                }
                Step::Raster(raster) => {
                    for draw in &raster.draws {
                        let form = DrawForm::new(plan, raster, draw)
                            .ok_or_else(|| malformed("a target is no texture".to_owned()))?;
                        let (drawing, kernel) = (&mut shared.drawing, &draw.kernel.0);
                        pipelines.push(drawing.get(device, kernel, form, &step.name)?);
                    }
                }
                _ => {}
            }
        }
        for (_, bindings) in sets::uses(plan) {
            for bound in bindings {
                if let Bound::Sampler(desc) = bound
                    && !shared.samplers.0.contains_key(desc)
                {
                    let made = Sampler::new(device, desc)?;
                    shared.samplers.0.insert(*desc, made);
                }
            }
        }
        Ok(Self {
            heaps: Heaps::new(device, plan)?,
            pipelines,
            outputs: vec![None; plan.resources.len()],
            left: vec![None; plan.resources.len()],
            uniforms: UniformRing::new(device, plan.uniforms.len(), frames_in_flight)?,
            bindings: Bindings::default(),
            host: None,
        })
    }

    /// The texture or buffer of an output, of our own.
    pub(crate) fn output(
        &mut self,
        device: &Arc<Device>,
        index: usize,
        planned: &PlannedResource,
    ) -> Result<Resource, BackendError> {
        if let Some(Some(output)) = self.outputs.get(index) {
            return Ok(output.clone());
        }
        debug_assert!(matches!(planned.kind, ResourceKind::Output(_)));
        let name = &planned.name;
        // The caller may want to copy it.
        let made = match &planned.desc {
            ResourceDesc::Texture(desc) => {
                let flags = usage::image_flags(planned.usages) | vk::ImageUsageFlags::TRANSFER_SRC;
                Resource::Texture(Image::new(device, name, desc, flags)?)
            }
            ResourceDesc::Buffer(desc) => {
                let flags =
                    usage::buffer_flags(planned.usages) | vk::BufferUsageFlags::TRANSFER_SRC;
                let local = MemoryLocation::GpuOnly;
                Resource::Buffer(Buffer::new(device, name, desc.bytes, flags, local)?)
            }
        };
        if let Some(slot) = self.outputs.get_mut(index) {
            *slot = Some(made.clone());
        }
        Ok(made)
    }

    /// Takes note that a recording has left the GPU ahead of others.
    pub(crate) fn release(&mut self, recording: u64) {
        self.bindings.release(recording);
        if let Some(uniforms) = &mut self.uniforms {
            uniforms.release(recording);
        }
    }
}

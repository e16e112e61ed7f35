//! Everything a plan needs on a device, made once for its structure.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use etalon_core::backend::BackendError;
use etalon_core::graph::ResourceDesc;
use etalon_core::kernel::KernelId;
use etalon_core::plan::{Bound, Plan, PlannedResource, ResourceKind, Step, UsageSet};

use crate::bind::{PerPhysical, Physical, Samplers};
use crate::check;
use crate::clear::Clear;
use crate::convert;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::pipeline::Pipeline;
use crate::raster::{self, Raster};
use crate::readback::Readback;
use crate::tally::Owned;
use crate::timing::Timing;
use crate::upload::Import;

/// Every pipeline there is.
#[derive(Debug, Default)]
pub(crate) struct Pipelines {
    compute: HashMap<KernelId, Arc<Pipeline>>,
    raster: raster::Pipelines,
}

impl Pipelines {
    /// Drops what no prepared plan has.
    pub(crate) fn trim(&mut self) {
        self.compute
            .retain(|_, pipeline| Arc::strong_count(pipeline) > 1);
        self.raster.trim();
    }
}

/// A texture or buffer of our own.
#[derive(Debug)]
pub(crate) enum Own {
    Texture(Owned<wgpu::Texture>),
    Buffer(Owned<wgpu::Buffer>),
}

impl Own {
    fn new(
        gpu: &Gpu,
        step: &str,
        resource: &PlannedResource,
        usages: UsageSet,
    ) -> Result<Self, BackendError> {
        match &resource.desc {
            ResourceDesc::Texture(desc) => {
                let (format, _) = gpu
                    .format(desc.format)
                    .ok_or_else(|| unsupported(step, desc.format.name()))?;
                let usages = convert::texture_usages(usages, desc.format);
                gpu.texture(&resource.name, desc, format, usages)
                    .map(Self::Texture)
            }
            ResourceDesc::Buffer(desc) => {
                let usages = convert::buffer_usages(usages);
                gpu.buffer(&resource.name, desc.bytes, usages, None)
                    .map(Self::Buffer)
            }
        }
    }

    fn physical(&self) -> Physical {
        match self {
            Self::Texture(texture) => Physical::whole(texture),
            Self::Buffer(buffer) => Physical::Buffer((**buffer).clone()),
        }
    }
}

/// What a step needs beyond the plan.
#[derive(Debug)]
pub(crate) enum PreparedStep {
    Dispatch {
        pipeline: Arc<Pipeline>,
        groups: PerPhysical<wgpu::BindGroup>,
    },
    Raster(Raster),
    Clear(Clear),
    Capture(Readback),
    /// Nothing.
    Plain,
}

/// What only runs from the host need.
#[derive(Debug)]
pub(crate) struct Offline {
    /// By index of the resource.
    pub(crate) imports: BTreeMap<u32, Import>,
    pub(crate) timing: Timing,
}

/// Everything for one structure.
#[derive(Debug)]
pub(crate) struct Prepared {
    pub(crate) structure: u64,
    pub(crate) steps: Vec<PreparedStep>,
    pub(crate) uniforms: Option<Owned<wgpu::Buffer>>,
    pub(crate) offline: Option<Offline>,
    /// By slot.
    transients: BTreeMap<u32, Own>,
    /// By index of the resource; made when no engine gives its own.
    outputs: BTreeMap<u32, Own>,
    /// Views of outputs, by index of the resource.
    pub(crate) views: BTreeMap<u32, PerPhysical<wgpu::TextureView>>,
}

impl Prepared {
    /// Checks a plan and makes what it needs, whoever runs it.
    pub(crate) fn new(
        gpu: &Gpu,
        plan: &Plan,
        pipelines: &mut Pipelines,
        samplers: &mut Samplers,
    ) -> Result<Self, BackendError> {
        check::check(gpu, plan)?;
        let mut steps = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            steps.push(match &step.step {
                Step::Dispatch {
                    kernel, bindings, ..
                } => {
                    for bound in bindings {
                        if let Bound::Sampler(desc) = bound {
                            samplers.add(gpu, desc)?;
                        }
                    }
                    let pipeline = match pipelines.compute.get(&kernel.0.id) {
                        Some(pipeline) => pipeline.clone(),
                        None => {
                            let made = Arc::new(Pipeline::new(gpu, &kernel.0, &step.name)?);
                            pipelines.compute.insert(kernel.0.id, made.clone());
                            made
                        }
                    };
                    PreparedStep::Dispatch {
                        pipeline,
                        groups: PerPhysical::default(),
                    }
                }
                Step::Raster(raster) => PreparedStep::Raster(Raster::new(
                    gpu,
                    plan,
                    &step.name,
                    raster,
                    &mut pipelines.raster,
                    samplers,
                )?),
                Step::ClearTexture {
                    resource,
                    range,
                    value,
                } => match plan.resources.get(*resource as usize).map(|r| &r.desc) {
                    Some(ResourceDesc::Texture(desc)) => {
                        PreparedStep::Clear(Clear::new(gpu, &step.name, desc, *range, *value)?)
                    }
                    _ => PreparedStep::Plain,
                },
                Step::Capture {
                    resource, range, ..
                } => match plan.resources.get(*resource as usize) {
                    Some(resource) => PreparedStep::Capture(Readback::new(
                        gpu,
                        &step.name,
                        &resource.desc,
                        *range,
                    )?),
                    None => PreparedStep::Plain,
                },
                Step::ClearBuffer { .. } | Step::CopyTexture { .. } | Step::CopyBuffer { .. } => {
                    PreparedStep::Plain
                }
            });
        }
        let uniforms = if plan.uniforms.is_empty() {
            None
        } else {
            let bytes = (plan.uniforms.len() as u64).next_multiple_of(16);
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            Some(gpu.buffer("etalon uniforms", bytes, usage, None)?)
        };
        Ok(Self {
            structure: plan.structure(),
            steps,
            uniforms,
            offline: None,
            transients: transients(gpu, plan)?,
            outputs: BTreeMap::new(),
            views: BTreeMap::new(),
        })
    }

    /// Makes what a run from the host needs.
    pub(crate) fn offline(&mut self, gpu: &Gpu, plan: &Plan) -> Result<(), BackendError> {
        if self.offline.is_some() {
            return Ok(());
        }
        let mut imports = BTreeMap::new();
        for (index, resource) in (0..).zip(&plan.resources) {
            if matches!(resource.kind, ResourceKind::Import(_)) {
                imports.insert(index, Import::new(gpu, resource)?);
            }
        }
        self.offline = Some(Offline {
            imports,
            timing: Timing::new(gpu, &plan.steps)?,
        });
        Ok(())
    }

    /// What the transients take.
    pub(crate) fn transient_bytes(&self) -> u64 {
        let bytes = self.transients.values().map(|own| match own {
            Own::Texture(texture) => texture.bytes(),
            Own::Buffer(buffer) => buffer.bytes(),
        });
        bytes.sum()
    }

    /// The transient in a slot.
    pub(crate) fn transient(&self, slot: u32) -> Option<Physical> {
        self.transients.get(&slot).map(Own::physical)
    }

    /// What stands for an import in a run from the host.
    pub(crate) fn import(&self, index: u32) -> Option<Physical> {
        Some(match self.offline.as_ref()?.imports.get(&index)? {
            Import::Colour(texture, _) | Import::Depth(texture, _, _) => Physical::whole(texture),
            Import::Buffer(buffer, _) => Physical::Buffer((**buffer).clone()),
        })
    }

    /// Our own texture or buffer for an output.
    pub(crate) fn output(
        &mut self,
        gpu: &Gpu,
        index: u32,
        resource: &PlannedResource,
    ) -> Result<Physical, BackendError> {
        if let Some(own) = self.outputs.get(&index) {
            return Ok(own.physical());
        }
        let own = Own::new(gpu, &resource.name, resource, resource.usages)?;
        let physical = own.physical();
        self.outputs.insert(index, own);
        Ok(physical)
    }
}

/// One texture or buffer for each slot, fit for all that share it.
fn transients(gpu: &Gpu, plan: &Plan) -> Result<BTreeMap<u32, Own>, BackendError> {
    let mut slots: BTreeMap<u32, (&PlannedResource, UsageSet)> = BTreeMap::new();
    for resource in &plan.resources {
        let ResourceKind::Transient(place) = &resource.kind else {
            continue;
        };
        let (first, usages) = slots
            .entry(place.slot)
            .or_insert((resource, UsageSet::EMPTY));
        if first.desc != resource.desc {
            return Err(BackendError::Api {
                call: "plan",
                reason: format!(
                    "`{}` and `{}` share a slot but not a shape",
                    first.name, resource.name
                ),
            });
        }
        *usages = usages.union(resource.usages);
    }
    slots
        .into_iter()
        .map(|(slot, (resource, usages))| {
            let step = plan
                .steps
                .get(resource.first as usize)
                .map_or(resource.name.as_str(), |step| &step.name);
            Ok((slot, Own::new(gpu, step, resource, usages)?))
        })
        .collect()
}

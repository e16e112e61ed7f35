//! Descriptor sets of a plan.
//!
//! A *binding* of a plan is one descriptor set for each of its dispatches
//! and draws, for one choice of the resources behind the plan's numbers. That choice differs
//! between frames where histories swap and where an engine gives other
//! textures; each gets a binding of its own, found again by the identities of
//! the resources, so that a frame like an earlier one writes no descriptor.
//! Beyond a few the one unused longest is written anew, once the GPU has
//! finished with it.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{BindingKind, Kernel};
use etalon_core::plan::{Bound, Plan, Step, Usage};

use crate::device::{Device, Remains, count};
use crate::error::{failed, malformed};
use crate::pipeline::Pipeline;
use crate::prepared::Samplers;
use crate::{Resource, convert, layout, usage};

/// Bindings kept before old ones are used again: two for histories, times two
/// for engines that take turns with their textures.
const KEPT: usize = 4;

/// Descriptor sets for one choice of resources.
struct Binding {
    device: Arc<Device>,
    /// The resources' identities.
    key: Vec<u64>,
    pool: vk::DescriptorPool,
    /// By dispatch and draw of the plan, in order; null for kernels that bind
    /// nothing.
    sets: Vec<vk::DescriptorSet>,
    /// The recording that used it last.
    last_used: u64,
}

impl Drop for Binding {
    fn drop(&mut self) {
        self.device.bury(Remains::DescriptorPool(self.pool));
    }
}

/// The bindings of a plan.
#[derive(Default)]
pub(crate) struct Bindings {
    bindings: Vec<Binding>,
}

/// What descriptor sets are made of.
pub(crate) struct Parts<'a> {
    pub(crate) plan: &'a Plan,
    /// By dispatch and draw, in order.
    pub(crate) pipelines: &'a [Arc<Pipeline>],
    /// By number in the plan.
    pub(crate) resources: &'a [Resource],
    pub(crate) samplers: &'a Samplers,
    pub(crate) uniforms: Option<vk::Buffer>,
}

impl Bindings {
    /// The descriptor sets, by dispatch and draw, for a recording with these resources.
    pub(crate) fn get(
        &mut self,
        device: &Arc<Device>,
        parts: &Parts<'_>,
        recording: u64,
    ) -> Result<&[vk::DescriptorSet], BackendError> {
        let matches = |binding: &Binding| {
            binding.key.len() == parts.resources.len()
                && binding
                    .key
                    .iter()
                    .zip(parts.resources)
                    .all(|(id, resource)| *id == resource.id())
        };
        let index = match self.bindings.iter().position(matches) {
            Some(index) => index,
            None => {
                let index = match self.idle(device.completed()) {
                    Some(index) => index,
                    None => {
                        self.bindings.push(Binding::new(device, parts.pipelines)?);
                        self.bindings.len() - 1
                    }
                };
                // If this fails, nothing may find it.
                self.bindings[index].key.clear();
                self.bindings[index].write(parts)?;
                index
            }
        };
        let binding = &mut self.bindings[index];
        binding.last_used = recording;
        Ok(&binding.sets)
    }

    /// The binding to write anew, if there are enough: of those the GPU has
    /// finished with, the one unused longest.
    fn idle(&self, completed: u64) -> Option<usize> {
        if self.bindings.len() < KEPT {
            return None;
        }
        self.bindings
            .iter()
            .enumerate()
            .filter(|(_, binding)| binding.last_used <= completed)
            .min_by_key(|(_, binding)| binding.last_used)
            .map(|(index, _)| index)
    }

    /// Takes note that a recording has left the GPU ahead of others.
    pub(crate) fn release(&mut self, recording: u64) {
        for binding in &mut self.bindings {
            if binding.last_used == recording {
                binding.last_used = 0;
            }
        }
    }
}

impl Binding {
    /// Allocates the sets; nothing is in them yet.
    fn new(device: &Arc<Device>, pipelines: &[Arc<Pipeline>]) -> Result<Self, BackendError> {
        let mut sizes = Vec::new();
        let mut layouts = Vec::new();
        for pipeline in pipelines.iter().filter(|pipeline| binds(pipeline)) {
            layouts.push(pipeline.layout.set);
            for size in &pipeline.layout.pool_sizes {
                layout::add_pool_size(&mut sizes, *size);
            }
        }
        let mut this = Self {
            device: device.clone(),
            key: Vec::new(),
            pool: vk::DescriptorPool::null(),
            sets: vec![vk::DescriptorSet::null(); pipelines.len()],
            last_used: 0,
        };
        let Ok(count_of_sets) = u32::try_from(layouts.len()) else {
            return Err(malformed(
                "more dispatches and draws than there can be descriptor sets",
            ));
        };
        if count_of_sets == 0 {
            return Ok(this);
        }
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(count_of_sets)
            .pool_sizes(&sizes);
        // SAFETY: there is at least one set, and every size is at least one.
        this.pool = unsafe { device.raw.create_descriptor_pool(&info, None) }
            .map_err(failed("vkCreateDescriptorPool"))?;
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(this.pool)
            .set_layouts(&layouts);
        // SAFETY: the pool is new and was sized for these layouts, which the
        // pipelines keep.
        let allocated = unsafe { device.raw.allocate_descriptor_sets(&info) }
            .map_err(failed("vkAllocateDescriptorSets"))?;
        count(&device.tally.bind_groups, u64::from(count_of_sets));
        let slots = this.sets.iter_mut().zip(pipelines);
        for ((set, _), new) in slots.filter(|(_, pipeline)| binds(pipeline)).zip(allocated) {
            *set = new;
        }
        Ok(this)
    }

    /// Writes every descriptor.
    fn write(&mut self, parts: &Parts<'_>) -> Result<(), BackendError> {
        for ((kernel, bindings), set) in uses(parts.plan).zip(&self.sets) {
            let descriptors: Vec<_> = kernel
                .bindings
                .iter()
                .zip(bindings)
                .map(|(binding, bound)| {
                    Ok((
                        binding.binding,
                        layout::descriptor_type(&binding.kind),
                        descriptor(&binding.kind, bound, parts)?,
                    ))
                })
                .collect::<Result<_, BackendError>>()?;
            if !descriptors.is_empty() {
                self.update(*set, &descriptors);
            }
        }
        self.key = parts.resources.iter().map(Resource::id).collect();
        Ok(())
    }

    fn update(
        &self,
        set: vk::DescriptorSet,
        descriptors: &[(u32, vk::DescriptorType, Descriptor)],
    ) {
        let writes: Vec<_> = descriptors
            .iter()
            .map(|(binding, kind, descriptor)| {
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(*binding)
                    .descriptor_type(*kind);
                match descriptor {
                    Descriptor::Image(info) => write.image_info(std::slice::from_ref(info)),
                    Descriptor::Buffer(info) => write.buffer_info(std::slice::from_ref(info)),
                }
            })
            .collect();
        // SAFETY: the set is of the layout whose binding numbers and types
        // these are, no recording on the GPU uses it, and the views, buffers
        // and samplers live: they are used by the recording to come.
        unsafe { self.device.raw.update_descriptor_sets(&writes, &[]) };
    }
}

/// Whether a pipeline's kernel binds anything.
fn binds(pipeline: &Pipeline) -> bool {
    !pipeline.layout.pool_sizes.is_empty()
}

/// The kernels that a plan dispatches and draws with, in order, and what each
/// is given: what pipelines and descriptor sets are counted by.
pub(crate) fn uses(plan: &Plan) -> impl Iterator<Item = (&Kernel, &[Bound])> {
    plan.steps.iter().flat_map(|step| {
        let (dispatch, draws) = match &step.step {
            Step::Dispatch {
                kernel, bindings, ..
            } => (Some((&*kernel.0, &bindings[..])), &[][..]),
            Step::Raster(raster) => (None, &raster.draws[..]),
            _ => (None, &[][..]),
        };
        let draws = draws
            .iter()
            .map(|draw| (&*draw.kernel.0, &draw.bindings[..]));
        dispatch.into_iter().chain(draws)
    })
}

/// What one descriptor refers to.
enum Descriptor {
    Image(vk::DescriptorImageInfo),
    Buffer(vk::DescriptorBufferInfo),
}

/// Looks up what a binding of a kernel is given.
fn descriptor(
    kind: &BindingKind,
    bound: &Bound,
    parts: &Parts<'_>,
) -> Result<Descriptor, BackendError> {
    let get = |resource: u32| {
        usize::try_from(resource)
            .ok()
            .and_then(|index| parts.resources.get(index))
    };
    let found = match (bound, kind) {
        (
            Bound::Texture { resource, range },
            BindingKind::Texture { dimension, .. } | BindingKind::StorageTexture { dimension, .. },
        ) => {
            let layout = match kind {
                BindingKind::Texture { .. } => usage::row(Usage::Sampled).layout,
                _ => usage::row(Usage::StorageRead).layout,
            };
            match get(*resource) {
                Some(Resource::Texture(image)) => Some(Descriptor::Image(
                    vk::DescriptorImageInfo::default()
                        .image_view(image.view(*range, convert::view_type(*dimension))?)
                        .image_layout(layout),
                )),
                _ => None,
            }
        }
        (Bound::Buffer { resource }, _) => match get(*resource) {
            Some(Resource::Buffer(buffer)) => Some(Descriptor::Buffer(
                vk::DescriptorBufferInfo::default()
                    .buffer(buffer.raw)
                    .offset(buffer.offset)
                    .range(buffer.bytes),
            )),
            _ => None,
        },
        // Where in the buffer is said when the set is bound.
        (Bound::Uniform(_), BindingKind::Uniform(layout)) => parts.uniforms.map(|buffer| {
            Descriptor::Buffer(
                vk::DescriptorBufferInfo::default()
                    .buffer(buffer)
                    .offset(0)
                    .range(u64::from(layout.size)),
            )
        }),
        (Bound::Sampler(desc), _) => parts
            .samplers
            .get(desc)
            .map(|sampler| Descriptor::Image(vk::DescriptorImageInfo::default().sampler(sampler))),
        _ => None,
    };
    // The plan was checked, so this does not happen.
    found.ok_or_else(|| malformed(format!("nothing suits {bound:?}")))
}

//! What a kernel binds, as Vulkan has it.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{BindingKind, Kernel};

use crate::device::{Device, Remains};
use crate::error::failed;

/// The layout of a kernel's pipelines and of its descriptor set.
pub(crate) struct Layout {
    pub(crate) raw: vk::PipelineLayout,
    pub(crate) set: vk::DescriptorSetLayout,
    /// Descriptors of each type that one set takes; none if the kernel binds
    /// nothing, and needs no set.
    pub(crate) pool_sizes: Vec<vk::DescriptorPoolSize>,
    device: Arc<Device>,
}

/// The descriptor a binding takes. Uniform blocks lie in a ring, so their
/// place in it is given when the set is bound.
pub(crate) const fn descriptor_type(kind: &BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::Uniform(_) => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
        BindingKind::Texture { .. } => vk::DescriptorType::SAMPLED_IMAGE,
        BindingKind::StorageTexture { .. } => vk::DescriptorType::STORAGE_IMAGE,
        BindingKind::StorageBuffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::Sampler { .. } => vk::DescriptorType::SAMPLER,
    }
}

impl Layout {
    /// The layout of a kernel whose counts of bindings have been checked.
    pub(crate) fn new(
        device: &Arc<Device>,
        kernel: &Kernel,
        stages: vk::ShaderStageFlags,
    ) -> Result<Arc<Self>, BackendError> {
        let entries: Vec<_> = kernel
            .bindings
            .iter()
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.binding)
                    .descriptor_type(descriptor_type(&binding.kind))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        // From here on dropping it destroys what it has so far.
        let mut this = Self {
            raw: vk::PipelineLayout::null(),
            set: vk::DescriptorSetLayout::null(),
            pool_sizes: pool_sizes(kernel),
            device: device.clone(),
        };
        let raw = &device.raw;
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
        // SAFETY: binding numbers are unique within a kernel, and counts are
        // within the device's limits, which the caller has checked.
        this.set = unsafe { raw.create_descriptor_set_layout(&info, None) }
            .map_err(failed("vkCreateDescriptorSetLayout"))?;
        let layouts = [this.set];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        // SAFETY: the set layout was made above.
        this.raw = unsafe { raw.create_pipeline_layout(&info, None) }
            .map_err(failed("vkCreatePipelineLayout"))?;
        Ok(Arc::new(this))
    }
}

impl Drop for Layout {
    fn drop(&mut self) {
        self.device.bury(Remains::PipelineLayout(self.raw));
        self.device.bury(Remains::SetLayout(self.set));
    }
}

fn pool_sizes(kernel: &Kernel) -> Vec<vk::DescriptorPoolSize> {
    let mut sizes: Vec<vk::DescriptorPoolSize> = Vec::new();
    for binding in &kernel.bindings {
        add_pool_size(
            &mut sizes,
            vk::DescriptorPoolSize {
                ty: descriptor_type(&binding.kind),
                descriptor_count: 1,
            },
        );
    }
    sizes
}

/// Adds to the count of a type.
pub(crate) fn add_pool_size(sizes: &mut Vec<vk::DescriptorPoolSize>, more: vk::DescriptorPoolSize) {
    match sizes.iter_mut().find(|size| size.ty == more.ty) {
        Some(size) => size.descriptor_count += more.descriptor_count,
        None => sizes.push(more),
    }
}

//! Compute pipelines, one per kernel, and samplers.

use std::sync::Arc;

use ash::vk;
use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::format::StorageSupport;
use etalon_core::kernel::{BindingKind, Kernel, Need, SpirvOptions, ViewDimension, spirv};
use etalon_core::plan::PlannedStep;
use etalon_core::resource::SamplerDesc;

use crate::convert;
use crate::device::{Device, Remains, count};
use crate::error::{failed, unsupported};
use crate::physical::Features;

/// A kernel on the device.
pub(crate) struct Pipeline {
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    /// Descriptors of each type that one set takes.
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

/// Refuses a kernel that the device cannot run.
pub(crate) fn check(device: &Device, kernel: &Kernel, step: &str) -> Result<(), BackendError> {
    let features = &device.features;
    if let Some((need, feature)) = unmet(features, &kernel.needs) {
        return Err(BackendError::Lacking {
            step: step.to_owned(),
            kernel: kernel.name.clone(),
            need: need.clone(),
            feature,
        });
    }
    match lacking(features, &device.physical.limits, kernel) {
        Some(what) => Err(unsupported(step, what)),
        None => Ok(()),
    }
}

/// The first need that the features do not meet, and the one that would.
fn unmet<'a>(features: &Features, needs: &'a [Need]) -> Option<(&'a Need, &'static str)> {
    needs.iter().find_map(|need| {
        let (feature, enabled) = match need {
            Need::F16 => ("shaderFloat16", features.shader_float16),
            Need::F16Buffer { .. } => (
                "storageBuffer16BitAccess",
                features.storage_buffer_16bit_access,
            ),
            // One that this backend does not know.
            _ => ("none", false),
        };
        (!enabled).then_some((need, feature))
    })
}

/// What the device would have to be able to do for the bindings and workgroups
/// of a kernel but is not, or `None` if it can run it.
fn lacking(
    features: &Features,
    limits: &vk::PhysicalDeviceLimits,
    kernel: &Kernel,
) -> Option<String> {
    for binding in &kernel.bindings {
        let (dimension, stored) = match &binding.kind {
            BindingKind::Texture { dimension, .. } => (*dimension, None),
            BindingKind::StorageTexture {
                dimension, format, ..
            } => (*dimension, Some(*format)),
            _ => continue,
        };
        if dimension == ViewDimension::CubeArray && !features.image_cube_array {
            return Some(format!(
                "the feature `imageCubeArray`, for `{}`",
                binding.name
            ));
        }
        let Some(format) = stored else { continue };
        if format.storage() == StorageSupport::Extended && !features.storage_image_extended_formats
        {
            return Some(format!(
                "the feature `shaderStorageImageExtendedFormats`, for `{}` ({format})",
                binding.name
            ));
        }
        if format == Format::Bgra8Unorm && !features.storage_image_write_without_format {
            return Some(format!(
                "the feature `shaderStorageImageWriteWithoutFormat`, for `{}` ({format})",
                binding.name
            ));
        }
    }
    over_limit(limits, kernel)
}

/// The first limit that a kernel exceeds.
fn over_limit(limits: &vk::PhysicalDeviceLimits, kernel: &Kernel) -> Option<String> {
    let of = |wanted: fn(&BindingKind) -> bool| {
        let count = kernel
            .bindings
            .iter()
            .filter(|binding| wanted(&binding.kind))
            .count();
        u64::try_from(count).unwrap_or(u64::MAX)
    };
    let [x, y, z] = kernel
        .compute()
        .map_or([1; 3], |stage| stage.workgroup_size)
        .map(u64::from);
    let invocations = x.saturating_mul(y).saturating_mul(z);
    let max = limits.max_compute_work_group_size;
    let textures = of(|kind| matches!(kind, BindingKind::Texture { .. }));
    let images = of(|kind| matches!(kind, BindingKind::StorageTexture { .. }));
    let buffers = of(|kind| matches!(kind, BindingKind::StorageBuffer { .. }));
    let uniforms = of(|kind| matches!(kind, BindingKind::Uniform(_)));
    let samplers = of(|kind| matches!(kind, BindingKind::Sampler { .. }));
    let table: [(&str, u64, u32); 11] = [
        ("invocations of a workgroup in x", x, max[0]),
        ("invocations of a workgroup in y", y, max[1]),
        ("invocations of a workgroup in z", z, max[2]),
        (
            "invocations of a workgroup",
            invocations,
            limits.max_compute_work_group_invocations,
        ),
        (
            "bytes of workgroup memory",
            workgroup_bytes(kernel),
            limits.max_compute_shared_memory_size,
        ),
        (
            "sampled textures",
            textures,
            limits.max_per_stage_descriptor_sampled_images,
        ),
        (
            "storage textures",
            images,
            limits.max_per_stage_descriptor_storage_images,
        ),
        (
            "storage buffers",
            buffers,
            limits.max_per_stage_descriptor_storage_buffers,
        ),
        (
            "uniform blocks",
            uniforms,
            limits.max_descriptor_set_uniform_buffers_dynamic,
        ),
        (
            "samplers",
            samplers,
            limits.max_per_stage_descriptor_samplers,
        ),
        (
            "resources",
            textures + images + buffers + uniforms,
            limits.max_per_stage_resources,
        ),
    ];
    table
        .into_iter()
        .find(|(_, wanted, limit)| *wanted > u64::from(*limit))
        .map(|(what, wanted, limit)| {
            format!(
                "{wanted} {what} (at most {limit}) for kernel `{}`",
                kernel.name
            )
        })
}

/// Bytes of workgroup memory of a kernel, each variable rounded up to 16.
fn workgroup_bytes(kernel: &Kernel) -> u64 {
    let context = kernel.module.to_ctx();
    kernel
        .module
        .global_variables
        .iter()
        .filter(|(_, variable)| variable.space == naga::AddressSpace::WorkGroup)
        .map(|(_, variable)| {
            let size = kernel.module.types[variable.ty].inner.size(context);
            u64::from(size).next_multiple_of(16)
        })
        .sum()
}

/// How kernels become SPIR-V here: every access defined, whatever the index.
fn spirv_options() -> SpirvOptions {
    SpirvOptions::default()
}

impl Pipeline {
    /// Translates a kernel and makes a pipeline of it.
    pub(crate) fn new(
        device: &Arc<Device>,
        kernel: &Kernel,
        step: &PlannedStep,
    ) -> Result<Arc<Self>, BackendError> {
        check(device, kernel, &step.name)?;
        let words =
            spirv(kernel, naga::ShaderStage::Compute, &spirv_options()).map_err(|error| {
                BackendError::Kernel {
                    step: step.name.clone(),
                    error: Box::new(error),
                }
            })?;
        let words = crate::chains::flatten(&words);
        count(&device.tally.kernels, 1);
        let entries: Vec<_> = kernel
            .bindings
            .iter()
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.binding)
                    .descriptor_type(descriptor_type(&binding.kind))
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        // From here on dropping it destroys what it has so far.
        let mut this = Self {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            pool_sizes: pool_sizes(kernel),
            device: device.clone(),
        };
        let raw = &device.raw;
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
        // SAFETY: binding numbers are unique within a kernel, and counts are
        // within the device's limits, which `check` has checked.
        this.set_layout = unsafe { raw.create_descriptor_set_layout(&info, None) }
            .map_err(failed("vkCreateDescriptorSetLayout"))?;
        let layouts = [this.set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        // SAFETY: the set layout was made above.
        this.layout = unsafe { raw.create_pipeline_layout(&info, None) }
            .map_err(failed("vkCreatePipelineLayout"))?;
        this.raw = this.compile(kernel, &words)?;
        count(&device.tally.pipelines, 1);
        device.name(this.raw, &kernel.name);
        Ok(Arc::new(this))
    }

    fn compile(&self, kernel: &Kernel, words: &[u32]) -> Result<vk::Pipeline, BackendError> {
        let raw = &self.device.raw;
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words are what naga writes for a validated module, with
        // no capability beyond those `check` has found enabled.
        let module = unsafe { raw.create_shader_module(&info, None) }
            .map_err(failed("vkCreateShaderModule"))?;
        let entry_point = kernel.compute().map_or("main", |stage| &stage.entry_point);
        let name: Vec<u8> = entry_point.bytes().chain([0]).collect();
        let result = match std::ffi::CStr::from_bytes_with_nul(&name) {
            Ok(name) => {
                let stage = vk::PipelineShaderStageCreateInfo::default()
                    .stage(vk::ShaderStageFlags::COMPUTE)
                    .module(module)
                    .name(name);
                let info = vk::ComputePipelineCreateInfo::default()
                    .stage(stage)
                    .layout(self.layout);
                // SAFETY: module and layout were made for each other from one
                // kernel, whose workgroup is within the device's limits.
                unsafe { raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) }
                    .map_err(|(_, result)| failed("vkCreateComputePipelines")(result))
            }
            Err(_) => Err(BackendError::Api {
                call: "vkCreateComputePipelines",
                reason: format!("entry point {entry_point:?} has a NUL in it"),
            }),
        };
        // SAFETY: a pipeline does not need its module once it is made.
        unsafe { raw.destroy_shader_module(module, None) };
        result?.into_iter().next().ok_or_else(|| BackendError::Api {
            call: "vkCreateComputePipelines",
            reason: "no pipeline was returned".to_owned(),
        })
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

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.device.bury(Remains::Pipeline(self.raw));
        self.device.bury(Remains::PipelineLayout(self.layout));
        self.device.bury(Remains::SetLayout(self.set_layout));
    }
}

/// A sampler on the device.
pub(crate) struct Sampler {
    pub(crate) raw: vk::Sampler,
    device: Arc<Device>,
}

impl Sampler {
    pub(crate) fn new(device: &Arc<Device>, desc: &SamplerDesc) -> Result<Arc<Self>, BackendError> {
        // SAFETY: the description uses no feature and no anisotropy.
        let raw = unsafe { device.raw.create_sampler(&convert::sampler(desc), None) }
            .map_err(failed("vkCreateSampler"))?;
        Ok(Arc::new(Self {
            raw,
            device: device.clone(),
        }))
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        self.device.bury(Remains::Sampler(self.raw));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_need_has_its_feature() {
        let buffer = Need::F16Buffer {
            binding: "data".to_owned(),
        };
        let needs = [Need::F16, buffer.clone()];
        let none = Features::default();
        let arithmetic = Features {
            shader_float16: true,
            ..none
        };
        let both = Features {
            storage_buffer_16bit_access: true,
            ..arithmetic
        };
        assert_eq!(unmet(&none, &[]), None);
        assert_eq!(unmet(&none, &needs), Some((&Need::F16, "shaderFloat16")));
        assert_eq!(unmet(&arithmetic, &needs[..1]), None);
        assert_eq!(
            unmet(&arithmetic, &needs),
            Some((&buffer, "storageBuffer16BitAccess"))
        );
        assert_eq!(unmet(&both, &needs), None);
    }
}

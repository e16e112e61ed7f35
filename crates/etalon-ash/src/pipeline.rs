//! Compute pipelines, one per kernel, what they share with those that draw, and
//! samplers.

use std::ffi::CString;
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
use crate::layout::Layout;
use crate::physical::Features;

/// A kernel on the device: to be dispatched, or to be drawn with in one state.
pub(crate) struct Pipeline {
    pub(crate) raw: vk::Pipeline,
    pub(crate) point: vk::PipelineBindPoint,
    pub(crate) layout: Arc<Layout>,
    device: Arc<Device>,
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

/// A stage of a kernel that `check` has let pass, as SPIR-V.
pub(crate) fn translate(
    kernel: &Kernel,
    stage: naga::ShaderStage,
    step: &str,
) -> Result<Vec<u32>, BackendError> {
    let words = spirv(kernel, stage, &spirv_options()).map_err(|error| BackendError::Kernel {
        step: step.to_owned(),
        error: Box::new(error),
    })?;
    Ok(crate::chains::flatten(&words))
}

/// A shader module while pipelines are made of it.
pub(crate) struct Module<'a> {
    device: &'a Device,
    pub(crate) raw: vk::ShaderModule,
    name: CString,
}

impl<'a> Module<'a> {
    /// A module of what [`translate`] has written.
    pub(crate) fn new(
        device: &'a Device,
        words: &[u32],
        entry_point: &str,
    ) -> Result<Self, BackendError> {
        let name = CString::new(entry_point).map_err(|_| BackendError::Api {
            call: "vkCreateShaderModule",
            reason: format!("entry point {entry_point:?} has a NUL in it"),
        })?;
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words are what naga writes for a validated module, with
        // no capability beyond those `check` has found enabled.
        let raw = unsafe { device.raw.create_shader_module(&info, None) }
            .map_err(failed("vkCreateShaderModule"))?;
        Ok(Self { device, raw, name })
    }

    /// The module as a stage of a pipeline.
    pub(crate) fn stage(
        &self,
        stage: vk::ShaderStageFlags,
    ) -> vk::PipelineShaderStageCreateInfo<'_> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.raw)
            .name(&self.name)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: a pipeline does not need its module once it is made.
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}

impl Pipeline {
    /// Translates a kernel and makes a pipeline of it, to be dispatched.
    pub(crate) fn new(
        device: &Arc<Device>,
        kernel: &Kernel,
        step: &PlannedStep,
    ) -> Result<Arc<Self>, BackendError> {
        check(device, kernel, &step.name)?;
        let words = translate(kernel, naga::ShaderStage::Compute, &step.name)?;
        count(&device.tally.kernels, 1);
        let layout = Layout::new(device, kernel, vk::ShaderStageFlags::COMPUTE)?;
        let entry_point = kernel.compute().map_or("main", |stage| &stage.entry_point);
        let module = Module::new(device, &words, entry_point)?;
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(module.stage(vk::ShaderStageFlags::COMPUTE))
            .layout(layout.raw);
        // SAFETY: module and layout were made for each other from one kernel,
        // whose workgroup is within the device's limits.
        let made = unsafe {
            device
                .raw
                .create_compute_pipelines(vk::PipelineCache::null(), &[info], None)
        };
        let call = "vkCreateComputePipelines";
        Self::made(
            device,
            kernel,
            layout,
            vk::PipelineBindPoint::COMPUTE,
            call,
            made,
        )
    }

    /// Takes what a call to make one pipeline has returned.
    pub(crate) fn made(
        device: &Arc<Device>,
        kernel: &Kernel,
        layout: Arc<Layout>,
        point: vk::PipelineBindPoint,
        call: &'static str,
        made: Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
    ) -> Result<Arc<Self>, BackendError> {
        let made = made.map_err(|(_, result)| failed(call)(result))?;
        let raw = made.into_iter().next().ok_or_else(|| BackendError::Api {
            call,
            reason: "no pipeline was returned".to_owned(),
        })?;
        count(&device.tally.pipelines, 1);
        device.name(raw, &kernel.name);
        Ok(Arc::new(Self {
            raw,
            point,
            layout,
            device: device.clone(),
        }))
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // The layout is a field: it is dropped, and buried, after this.
        self.device.bury(Remains::Pipeline(self.raw));
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

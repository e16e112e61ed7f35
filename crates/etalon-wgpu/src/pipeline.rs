//! Compute pipelines, and the layouts that go with them.

use std::num::NonZeroU64;

use etalon_core::backend::BackendError;
use etalon_core::format::SampleKind;
use etalon_core::kernel::{Binding, BindingKind, Kernel, Need};

use crate::convert;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::spirv::{self, ModuleError};

/// A kernel on a device.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) raw: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

/// Bytes of a uniform block as it is bound. OpenGL's `std140` blocks are
/// multiples of 16 bytes, whatever WGSL says.
pub(crate) fn uniform_bytes(size: u32) -> u64 {
    u64::from(size).next_multiple_of(16)
}

impl Pipeline {
    /// Translates a kernel, which `step` needs.
    pub(crate) fn new(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<Self, BackendError> {
        check_needs(gpu, kernel, step)?;
        check_workgroup(gpu, kernel, step)?;
        let entries = kernel
            .bindings
            .iter()
            .map(|binding| layout_entry(gpu, binding, wgpu::ShaderStages::COMPUTE, step))
            .collect::<Result<Vec<_>, _>>()?;
        let module = if gpu.passes_spirv() {
            spirv::module(gpu, kernel, naga::ShaderStage::Compute)
        } else {
            translated(gpu, kernel)
        };
        let module = module.map_err(|error| error.of(step))?;
        gpu.tally.kernels.add(1);
        let (raw, layout) = gpu
            .guarded(|| {
                let layout =
                    gpu.device
                        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                            label: Some(&kernel.name),
                            entries: &entries,
                        });
                let pipeline_layout =
                    gpu.device
                        .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                            label: Some(&kernel.name),
                            bind_group_layouts: &[Some(&layout)],
                            immediate_size: 0,
                        });
                let raw = gpu
                    .device
                    .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                        label: Some(&kernel.name),
                        layout: Some(&pipeline_layout),
                        module: &module,
                        entry_point: kernel.compute().map(|stage| stage.entry_point.as_str()),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        cache: None,
                    });
                (raw, layout)
            })
            .map_err(|fault| fault.of_kernel(step))?;
        gpu.tally.pipelines.add(1);
        Ok(Self { raw, layout })
    }
}

/// The shader module of a kernel as wgpu translates it.
pub(crate) fn translated(gpu: &Gpu, kernel: &Kernel) -> Result<wgpu::ShaderModule, ModuleError> {
    gpu.guarded(|| {
        gpu.device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(&kernel.name),
                source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(kernel.module.clone())),
            })
    })
    .map_err(ModuleError::Fault)
}

/// The device has to have what the kernel needs beyond WebGPU's core.
pub(crate) fn check_needs(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<(), BackendError> {
    for need in &kernel.needs {
        let (feature, enabled) = match need {
            // wgpu's feature is arithmetic and buffers in one.
            Need::F16 | Need::F16Buffer { .. } => ("SHADER_F16", gpu.computes_f16()),
            // A need that this backend does not know.
            _ => ("none", false),
        };
        if !enabled {
            return Err(BackendError::Lacking {
                step: step.to_owned(),
                kernel: kernel.name.clone(),
                need: need.clone(),
                feature,
            });
        }
    }
    Ok(())
}

/// wgpu checks this only for modules that it translates itself.
fn check_workgroup(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<(), BackendError> {
    let limits = gpu.raw_limits();
    let [x, y, z] = kernel
        .compute()
        .map_or([1; 3], |stage| stage.workgroup_size);
    let invocations = u64::from(x)
        .saturating_mul(y.into())
        .saturating_mul(z.into());
    if x > limits.max_compute_workgroup_size_x
        || y > limits.max_compute_workgroup_size_y
        || z > limits.max_compute_workgroup_size_z
        || invocations > limits.max_compute_invocations_per_workgroup.into()
    {
        return Err(unsupported(
            step,
            format!(
                "workgroups of {x}×{y}×{z} (at most {} invocations, {}×{}×{})",
                limits.max_compute_invocations_per_workgroup,
                limits.max_compute_workgroup_size_x,
                limits.max_compute_workgroup_size_y,
                limits.max_compute_workgroup_size_z
            ),
        ));
    }
    let context = kernel.module.to_ctx();
    let bytes = kernel
        .module
        .global_variables
        .iter()
        .filter(|(_, variable)| variable.space == naga::AddressSpace::WorkGroup)
        .fold(0_u64, |sum, (_, variable)| {
            let size = kernel.module.types[variable.ty].inner.size(context);
            // Each variable may start at a multiple of 16.
            sum.saturating_add(u64::from(size).next_multiple_of(16))
        });
    if bytes > limits.max_compute_workgroup_storage_size.into() {
        return Err(unsupported(
            step,
            format!(
                "{bytes} bytes of workgroup memory (at most {})",
                limits.max_compute_workgroup_storage_size
            ),
        ));
    }
    Ok(())
}

/// What a binding is to the stages that see it.
pub(crate) fn layout_entry(
    gpu: &Gpu,
    binding: &Binding,
    visibility: wgpu::ShaderStages,
    step: &str,
) -> Result<wgpu::BindGroupLayoutEntry, BackendError> {
    if binding.group != 0 {
        return Err(unsupported(
            step,
            format!("`{}` in group {}", binding.name, binding.group),
        ));
    }
    let ty = match &binding.kind {
        BindingKind::Uniform(layout) => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: NonZeroU64::new(uniform_bytes(layout.size)),
        },
        BindingKind::StorageBuffer { access, min_size } => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage {
                read_only: !access.writes(),
            },
            has_dynamic_offset: false,
            min_binding_size: NonZeroU64::new(*min_size),
        },
        BindingKind::Texture {
            dimension,
            kind,
            filtered,
        } => wgpu::BindingType::Texture {
            sample_type: match kind {
                SampleKind::Float => wgpu::TextureSampleType::Float {
                    filterable: *filtered,
                },
                SampleKind::Sint => wgpu::TextureSampleType::Sint,
                SampleKind::Uint => wgpu::TextureSampleType::Uint,
                SampleKind::Depth => wgpu::TextureSampleType::Depth,
            },
            view_dimension: convert::view_dimension(*dimension),
            multisampled: false,
        },
        BindingKind::StorageTexture {
            dimension,
            format,
            access,
        } => {
            let access = convert::storage_access(*access);
            let raw = check_storage(gpu, *format, access)
                .map_err(|what| unsupported(step, format!("`{}` as {what}", binding.name)))?;
            wgpu::BindingType::StorageTexture {
                access,
                format: raw,
                view_dimension: convert::view_dimension(*dimension),
            }
        }
        BindingKind::Sampler { comparison } => wgpu::BindingType::Sampler(if *comparison {
            wgpu::SamplerBindingType::Comparison
        } else {
            wgpu::SamplerBindingType::Filtering
        }),
    };
    Ok(wgpu::BindGroupLayoutEntry {
        binding: binding.binding,
        visibility,
        ty,
        count: None,
    })
}

/// wgpu's name of a storage format, if the device has it with that access;
/// otherwise what it lacks.
fn check_storage(
    gpu: &Gpu,
    format: etalon_core::Format,
    access: wgpu::StorageTextureAccess,
) -> Result<wgpu::TextureFormat, String> {
    use wgpu::TextureFormatFeatureFlags as F;
    let (wanted, text) = match access {
        wgpu::StorageTextureAccess::ReadOnly => (F::STORAGE_READ_ONLY, "read-only"),
        wgpu::StorageTextureAccess::WriteOnly => (F::STORAGE_WRITE_ONLY, "write-only"),
        _ => (F::STORAGE_READ_WRITE, "read-write"),
    };
    match gpu.format(format) {
        Some((raw, features)) if features.flags.contains(wanted) => Ok(raw),
        _ => Err(format!("{text} {format} storage texture")),
    }
}

//! Finding adapters and opening devices.

use etalon_core::backend::{BackendError, BackendInfo};

use crate::fault::Fault;
use crate::gpu::{Gpu, info_of};

/// How [`WgpuBackend::new`](crate::WgpuBackend::new) finds its device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WgpuOptions {
    /// The APIs to look at. Vulkan is preferred where both are given.
    pub backends: wgpu::Backends,
    /// Take only an adapter whose name or driver contains this, whatever the case.
    pub adapter: Option<String>,
    /// Switch on the API's validation layer, whose messages wgpu logs.
    pub validation: bool,
    /// Hand SPIR-V to the driver untouched where that is possible, which
    /// [keeps strict arithmetic](crate::WgpuBackend::keeps_strict_arithmetic).
    /// Without, wgpu translates kernels itself.
    pub passthrough: bool,
}

impl Default for WgpuOptions {
    /// The best adapter of Vulkan or, failing that, OpenGL, without validation.
    fn default() -> Self {
        Self {
            backends: wgpu::Backends::VULKAN | wgpu::Backends::GL,
            adapter: None,
            validation: false,
            passthrough: true,
        }
    }
}

/// What is asked for beyond WebGPU where the adapter has it.
const WANTED: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
    .union(wgpu::Features::PASSTHROUGH_SHADERS)
    .union(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES)
    .union(wgpu::Features::FLOAT32_FILTERABLE)
    .union(wgpu::Features::BGRA8UNORM_STORAGE)
    .union(wgpu::Features::SHADER_F16)
    .union(wgpu::Features::INDIRECT_FIRST_INSTANCE);

fn instance(backends: wgpu::Backends, validation: bool) -> wgpu::Instance {
    // Checking indirect arguments costs a small dispatch each, and is what
    // keeps a wrong count in a buffer from being undefined behaviour.
    let mut flags = wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    if validation {
        flags |= wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG;
    }
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        flags,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

/// The adapters of an instance, best first.
fn adapters(instance: &wgpu::Instance, backends: wgpu::Backends) -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
    // Stable: equals stay in the order of the loader.
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

/// The APIs one by one, OpenGL last: what is not needed is not loaded.
fn by_preference(backends: wgpu::Backends) -> impl Iterator<Item = wgpu::Backends> {
    [
        backends.difference(wgpu::Backends::GL),
        backends.intersection(wgpu::Backends::GL),
    ]
    .into_iter()
    .filter(|backends| !backends.is_empty())
}

/// The adapters of the given APIs, best first.
#[must_use]
pub fn enumerate(backends: wgpu::Backends) -> Vec<BackendInfo> {
    by_preference(backends)
        .flat_map(|backends| adapters(&instance(backends, false), backends))
        .map(|adapter| info_of(&adapter.get_info()))
        .collect()
}

/// Opens a device.
pub(crate) fn open(options: &WgpuOptions) -> Result<Gpu, BackendError> {
    let none = |reason: String| BackendError::NoDevice {
        backend: "wgpu",
        reason,
    };
    let matches = |adapter: &wgpu::Adapter| match &options.adapter {
        Some(wanted) => {
            let info = info_of(&adapter.get_info());
            let wanted = wanted.to_lowercase();
            info.device.to_lowercase().contains(&wanted)
                || info.driver.to_lowercase().contains(&wanted)
        }
        None => true,
    };
    let mut names = Vec::new();
    let found = by_preference(options.backends).find_map(|backends| {
        let instance = instance(backends, options.validation);
        let found = adapters(&instance, backends);
        names.extend(
            found
                .iter()
                .map(|adapter| info_of(&adapter.get_info()).to_string()),
        );
        found.into_iter().find(matches)
    });
    let Some(adapter) = found else {
        return Err(none(if names.is_empty() {
            format!(
                "no adapter for {:?}; a Vulkan driver can be named in VK_DRIVER_FILES",
                options.backends
            )
        } else {
            format!(
                "no adapter named like `{}`; there are {}",
                options.adapter.as_deref().unwrap_or_default(),
                names.join(", ")
            )
        }));
    };
    let downlevel = adapter.get_downlevel_capabilities();
    if !downlevel
        .flags
        .contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    {
        return Err(none(format!(
            "{} cannot run compute shaders",
            info_of(&adapter.get_info())
        )));
    }
    let mut features = WANTED & adapter.features();
    if !options.passthrough {
        features.remove(wgpu::Features::PASSTHROUGH_SHADERS);
    }
    let request = adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("etalon"),
        required_features: features,
        required_limits: adapter.limits(),
        ..wgpu::DeviceDescriptor::default()
    });
    let (device, queue) = pollster::block_on(request).map_err(|error| none(error.to_string()))?;
    let gpu = Gpu::new(device, queue, Some(&adapter));
    gpu.watch();
    if let Some(Fault::Lost(reason)) = gpu.lost() {
        return Err(BackendError::DeviceLost { reason });
    }
    Ok(gpu)
}

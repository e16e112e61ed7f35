//! Physical devices: what there is, what it can do, and which to take.

use ash::{ext, vk};
use etalon_core::backend::BackendError;
use etalon_core::resource::Limits;

use crate::error::{failed, no_device};
use crate::instance::{Instance, VERSION, version_text};

/// The kind of a device, in the order in which they are preferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares memory with the host.
    Integrated,
    /// A GPU in a virtual machine.
    Virtual,
    /// A software implementation.
    Cpu,
    /// None of these.
    Other,
}

/// A device that [`enumerate`] found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// The device's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// The Vulkan version it implements, e.g. `1.3.239`.
    pub api_version: String,
    /// What it is.
    pub kind: DeviceKind,
    /// What this backend needs and the device lacks; empty if it can be used.
    pub missing: Vec<String>,
}

/// The features of a device that this backend asks for or makes use of.
///
/// An engine that lends its device states which of them it has enabled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// `VkPhysicalDeviceVulkan13Features::synchronization2`. Required.
    pub synchronization2: bool,
    /// `VkPhysicalDeviceVulkan13Features::maintenance4`. Required.
    pub maintenance4: bool,
    /// `VkPhysicalDeviceVulkan13Features::robustImageAccess`. Kernels that
    /// store outside a texture do nothing there, rather than what they will.
    pub robust_image_access: bool,
    /// `VkPhysicalDeviceFeatures::imageCubeArray`, for kernels with cube arrays.
    pub image_cube_array: bool,
    /// `VkPhysicalDeviceFeatures::shaderStorageImageExtendedFormats`, for
    /// kernels that store to formats of [`StorageSupport::Extended`](etalon_core::format::StorageSupport).
    pub storage_image_extended_formats: bool,
    /// `VkPhysicalDeviceFeatures::shaderStorageImageWriteWithoutFormat`, for
    /// kernels that store to `bgra8unorm`.
    pub storage_image_write_without_format: bool,
    /// `VkPhysicalDeviceVulkan12Features::shaderFloat16`, for kernels with `f16`.
    pub shader_float16: bool,
    /// `VkPhysicalDeviceVulkan11Features::storageBuffer16BitAccess`, for kernels
    /// whose storage buffers hold `f16`.
    pub storage_buffer_16bit_access: bool,
    /// `VkPhysicalDeviceVulkan13Features::dynamicRendering`, for plans that draw.
    pub dynamic_rendering: bool,
    /// `VkPhysicalDeviceFeatures::robustBufferAccess`, for draws whose vertices
    /// only the device knows, by indices or by records: where those are out of
    /// range, vertex kernels are fed zeros, or something else from the buffer.
    pub robust_buffer_access: bool,
    /// `VkPhysicalDeviceRobustness2FeaturesEXT::robustBufferAccess2`, of
    /// `VK_EXT_robustness2`. With it, records of indexed draws may ask for
    /// indices behind the end of their buffer; without it, they must not, and
    /// nobody checks.
    pub robust_buffer_access2: bool,
    /// `VkPhysicalDeviceFeatures::fullDrawIndexUint32`, for draws with indices
    /// of 32 bits.
    pub full_draw_index_uint32: bool,
    /// `VkPhysicalDeviceFeatures::independentBlend`, for draws that blend or
    /// mask their colour targets differently.
    pub independent_blend: bool,
    /// `VkPhysicalDeviceFeatures::depthBiasClamp`, for depth biases with a clamp.
    pub depth_bias_clamp: bool,
    /// `VkPhysicalDeviceFeatures::drawIndirectFirstInstance`, for indirect draws,
    /// whose records may begin at any instance.
    pub draw_indirect_first_instance: bool,
    /// `VkPhysicalDeviceFeatures::multiDrawIndirect`. Without it, each record of
    /// an indirect draw takes a call of its own.
    pub multi_draw_indirect: bool,
}

impl Features {
    /// The required features that are not on.
    pub(crate) fn missing(&self) -> Vec<&'static str> {
        [
            ("synchronization2", self.synchronization2),
            ("maintenance4", self.maintenance4),
        ]
        .into_iter()
        .filter_map(|(name, on)| (!on).then_some(name))
        .collect()
    }
}

/// What there is to know about a physical device before it is used.
pub(crate) struct Physical {
    pub(crate) handle: vk::PhysicalDevice,
    pub(crate) info: DeviceInfo,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    pub(crate) max_allocation: u64,
    pub(crate) max_buffer: u64,
    pub(crate) memory: vk::PhysicalDeviceMemoryProperties,
    /// What the device offers.
    pub(crate) features: Features,
    /// The queue family to make a device with: the first that computes and
    /// draws, or else the first that computes.
    pub(crate) family: Option<u32>,
    /// What the queue families can do.
    pub(crate) queue_flags: Vec<vk::QueueFlags>,
    /// Whether `VK_EXT_robustness2` is offered.
    pub(crate) robustness2: bool,
    /// Bits of a timestamp that count, by queue family.
    pub(crate) timestamp_bits: Vec<u32>,
}

impl Physical {
    /// Asks a device about itself.
    pub(crate) fn query(instance: &Instance, handle: vk::PhysicalDevice) -> Self {
        let raw = &instance.raw;
        // SAFETY: the handle is the instance's; no other preconditions.
        let basic = unsafe { raw.get_physical_device_properties(handle) };
        // SAFETY: as above.
        let memory = unsafe { raw.get_physical_device_memory_properties(handle) };
        // SAFETY: as above.
        let families = unsafe { raw.get_physical_device_queue_family_properties(handle) };
        let first = |wanted: vk::QueueFlags| {
            families
                .iter()
                .position(|family| family.queue_count > 0 && family.queue_flags.contains(wanted))
                .and_then(|index| u32::try_from(index).ok())
        };
        // A device that draws has a family that does both (Vulkan §5.3).
        let family = first(vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS)
            .or_else(|| first(vk::QueueFlags::COMPUTE));
        let mut this = Self {
            handle,
            info: DeviceInfo {
                name: text(basic.device_name_as_c_str()),
                driver: format!("driver {}", basic.driver_version),
                api_version: version_text(basic.api_version),
                kind: kind(basic.device_type),
                missing: Vec::new(),
            },
            limits: basic.limits,
            max_allocation: 0,
            max_buffer: 0,
            memory,
            features: Features::default(),
            family,
            queue_flags: families.iter().map(|family| family.queue_flags).collect(),
            robustness2: false,
            timestamp_bits: families
                .iter()
                .map(|family| family.timestamp_valid_bits)
                .collect(),
        };
        if family.is_none() {
            this.info.missing.push("a queue that computes".to_owned());
        }
        if basic.api_version < VERSION {
            this.info.missing.push("Vulkan 1.3".to_owned());
            return this;
        }
        this.query_1_3(instance);
        let missing = this.features.missing();
        this.info
            .missing
            .extend(missing.into_iter().map(|name| format!("feature `{name}`")));
        this
    }

    /// Asks what only devices of version 1.3 can answer.
    fn query_1_3(&mut self, instance: &Instance) {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut driver)
            .push_next(&mut maintenance3)
            .push_next(&mut maintenance4);
        // SAFETY: the device is of version 1.3, which has all three structures.
        unsafe {
            instance
                .raw
                .get_physical_device_properties2(self.handle, &mut properties);
        }
        let (name, info) = (
            text(driver.driver_name_as_c_str()),
            text(driver.driver_info_as_c_str()),
        );
        self.info.driver = format!("{name} {info}").trim().to_owned();
        self.max_allocation = maintenance3.max_memory_allocation_size;
        self.max_buffer = maintenance4.max_buffer_size;
        // SAFETY: as above.
        let offered = unsafe {
            instance
                .raw
                .enumerate_device_extension_properties(self.handle)
        };
        // One that does not answer offers none.
        self.robustness2 = offered.is_ok_and(|offered| {
            offered
                .iter()
                .any(|extension| extension.extension_name_as_c_str() == Ok(ext::robustness2::NAME))
        });
        let mut robustness2 = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
        let mut vulkan11 = vk::PhysicalDeviceVulkan11Features::default();
        let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut vulkan13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut vulkan11)
            .push_next(&mut vulkan12)
            .push_next(&mut vulkan13);
        if self.robustness2 {
            features = features.push_next(&mut robustness2);
        }
        // SAFETY: as above, and the extension is offered whose structure is there.
        unsafe {
            instance
                .raw
                .get_physical_device_features2(self.handle, &mut features);
        }
        let core = features.features;
        self.features = Features {
            synchronization2: vulkan13.synchronization2 == vk::TRUE,
            maintenance4: vulkan13.maintenance4 == vk::TRUE,
            robust_image_access: vulkan13.robust_image_access == vk::TRUE,
            image_cube_array: core.image_cube_array == vk::TRUE,
            storage_image_extended_formats: core.shader_storage_image_extended_formats == vk::TRUE,
            storage_image_write_without_format: core.shader_storage_image_write_without_format
                == vk::TRUE,
            shader_float16: vulkan12.shader_float16 == vk::TRUE,
            storage_buffer_16bit_access: vulkan11.storage_buffer16_bit_access == vk::TRUE,
            dynamic_rendering: vulkan13.dynamic_rendering == vk::TRUE,
            robust_buffer_access: core.robust_buffer_access == vk::TRUE,
            robust_buffer_access2: robustness2.robust_buffer_access2 == vk::TRUE,
            full_draw_index_uint32: core.full_draw_index_uint32 == vk::TRUE,
            independent_blend: core.independent_blend == vk::TRUE,
            depth_bias_clamp: core.depth_bias_clamp == vk::TRUE,
            draw_indirect_first_instance: core.draw_indirect_first_instance == vk::TRUE,
            multi_draw_indirect: core.multi_draw_indirect == vk::TRUE,
        };
    }

    /// The limits planning needs, given the features that are enabled.
    pub(crate) fn limits(&self, features: &Features) -> Limits {
        let limits = &self.limits;
        // Nothing larger than a heap of the device's own memory can exist.
        let heap = self
            .memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max()
            .unwrap_or(u64::MAX);
        let bytes = heap.min(self.max_allocation);
        let counts = limits.max_compute_work_group_count;
        Limits {
            max_texture_2d: limits
                .max_image_dimension2_d
                .min(limits.max_image_dimension_cube),
            max_texture_3d: limits.max_image_dimension3_d,
            max_texture_layers: limits.max_image_array_layers,
            max_texture_bytes: bytes,
            max_buffer_bytes: bytes
                .min(self.max_buffer)
                .min(limits.max_storage_buffer_range.into()),
            max_workgroups: counts.into_iter().min().unwrap_or(0),
            max_workgroup_invocations: limits.max_compute_work_group_invocations,
            max_workgroup_bytes: limits.max_compute_shared_memory_size,
            // A power of two between 1 and 256; blocks hold `vec4`s at most.
            uniform_alignment: u32::try_from(limits.min_uniform_buffer_offset_alignment)
                .unwrap_or(256)
                .max(16),
            extended_storage_formats: features.storage_image_extended_formats,
        }
    }
}

fn text<E>(name: Result<&std::ffi::CStr, E>) -> String {
    name.map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

const fn kind(kind: vk::PhysicalDeviceType) -> DeviceKind {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

/// Every physical device of an instance.
fn all(instance: &Instance) -> Result<Vec<Physical>, BackendError> {
    // SAFETY: no preconditions beyond a live instance.
    let handles = unsafe { instance.raw.enumerate_physical_devices() }.map_err(|result| {
        match result {
            // What the loader answers when no driver found hardware of its own.
            ash::vk::Result::ERROR_INITIALIZATION_FAILED => {
                no_device("the Vulkan drivers there are found no hardware of theirs")
            }
            other => failed("vkEnumeratePhysicalDevices")(other),
        }
    })?;
    Ok(handles
        .into_iter()
        .map(|handle| Physical::query(instance, handle))
        .collect())
}

/// Lists the Vulkan devices there are, usable or not.
///
/// # Errors
/// [`BackendError::NoDevice`] without a Vulkan loader or driver.
///
/// # Examples
/// ```
/// match etalon_ash::enumerate() {
///     Ok(devices) => {
///         for device in devices {
///             println!("{} ({}, Vulkan {})", device.name, device.driver, device.api_version);
///         }
///     }
///     Err(error) => println!("{error}"),
/// }
/// ```
pub fn enumerate() -> Result<Vec<DeviceInfo>, BackendError> {
    let instance = Instance::new(crate::Validation::Off)?;
    Ok(all(&instance)?
        .into_iter()
        .map(|device| device.info)
        .collect())
}

/// The device to use: of those that can be used and whose name contains
/// `filter`, in any case of letters, the first of the preferred kind.
pub(crate) fn choose(instance: &Instance, filter: Option<&str>) -> Result<Physical, BackendError> {
    let mut devices = all(instance)?;
    if devices.is_empty() {
        return Err(no_device(
            "the loader finds no Vulkan device; install a driver, or check VK_DRIVER_FILES",
        ));
    }
    let wanted = filter.unwrap_or("").to_lowercase();
    let found = devices
        .iter()
        .enumerate()
        .filter(|(_, device)| {
            device.info.missing.is_empty() && device.info.name.to_lowercase().contains(&wanted)
        })
        .min_by_key(|(_, device)| device.info.kind)
        .map(|(index, _)| index);
    match found {
        Some(index) => Ok(devices.swap_remove(index)),
        None => Err(no_device(none_found(filter, &devices))),
    }
}

/// Why none of the devices will do.
fn none_found(filter: Option<&str>, devices: &[Physical]) -> String {
    let list: Vec<String> = devices
        .iter()
        .map(|device| {
            let info = &device.info;
            if info.missing.is_empty() {
                format!("`{}`", info.name)
            } else {
                format!("`{}` (lacks {})", info.name, info.missing.join(", "))
            }
        })
        .collect();
    let wanted = filter.map_or_else(
        || "a device that can be used".to_owned(),
        |filter| format!("a device named like `{filter}` that can be used"),
    );
    format!("{wanted} is not among {}", list.join(", "))
}

//! The logical device: made or adopted, and the last to go.
//!
//! Everything that belongs to a device holds an `Arc` of it. Nothing is
//! destroyed on the spot: what is dropped goes to the [graveyard](Device::bury)
//! with the number of the newest recording, and is destroyed in the order in
//! which it came, once that recording has left the GPU.

use std::collections::VecDeque;
use std::ffi::{CStr, CString};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::{ext, khr, vk};
use etalon_core::backend::{BackendError, Counters};
use gpu_allocator::vulkan::{Allocation, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};

use crate::error::{failed, no_device, unallocated};
use crate::instance::Instance;
use crate::physical::{Features, Physical};

/// Memory comes from the driver in blocks of this size or larger.
const DEVICE_BLOCK: u64 = 64 << 20;
const HOST_BLOCK: u64 = 16 << 20;

/// An engine's device, lent to [`AshBackend::adopt`](crate::AshBackend::adopt).
#[derive(Clone)]
pub struct AdoptedDevice {
    /// The instance, made for Vulkan 1.3 or newer.
    pub instance: ash::Instance,
    /// The physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// The queue to which everything recorded will be submitted.
    pub queue: vk::Queue,
    /// Its family, which must be able to compute.
    pub queue_family: u32,
    /// What the device was made with.
    pub features: Features,
    /// Whether the instance was made with `VK_EXT_debug_utils`, so that passes
    /// may be labelled and objects named.
    pub debug_utils: bool,
}

impl std::fmt::Debug for AdoptedDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AdoptedDevice")
            .field("physical_device", &self.physical_device)
            .field("queue", &self.queue)
            .field("queue_family", &self.queue_family)
            .field("features", &self.features)
            .field("debug_utils", &self.debug_utils)
            .finish_non_exhaustive()
    }
}

/// What has been made and done, as it happens.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    pub(crate) kernels: AtomicU64,
    pub(crate) pipelines: AtomicU64,
    pub(crate) bind_groups: AtomicU64,
    pub(crate) textures: AtomicU64,
    pub(crate) buffers: AtomicU64,
    pub(crate) allocations: AtomicU64,
    pub(crate) bytes: AtomicU64,
    pub(crate) transient_bytes: AtomicU64,
    pub(crate) passes: AtomicU64,
    pub(crate) dispatches: AtomicU64,
    pub(crate) draws: AtomicU64,
    pub(crate) barriers: AtomicU64,
    pub(crate) invocations: AtomicU64,
}

/// Counts `amount` more.
pub(crate) fn count(counter: &AtomicU64, amount: u64) {
    counter.fetch_add(amount, Ordering::Relaxed);
}

impl Tally {
    pub(crate) fn read(&self) -> Counters {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counters {
            kernels: read(&self.kernels),
            pipelines: read(&self.pipelines),
            bind_groups: read(&self.bind_groups),
            textures: read(&self.textures),
            buffers: read(&self.buffers),
            allocations: read(&self.allocations),
            bytes: read(&self.bytes),
            transient_bytes: read(&self.transient_bytes),
            passes: read(&self.passes),
            dispatches: read(&self.dispatches),
            draws: read(&self.draws),
            barriers: read(&self.barriers),
            invocations: read(&self.invocations),
            // Only the device knows.
            indirect_invocations: 0,
        }
    }
}

/// What remains of something dropped: a handle that is nobody's any more.
pub(crate) enum Remains {
    View(vk::ImageView),
    Image(vk::Image),
    Buffer(vk::Buffer),
    Memory(Allocation),
    Pipeline(vk::Pipeline),
    PipelineLayout(vk::PipelineLayout),
    SetLayout(vk::DescriptorSetLayout),
    DescriptorPool(vk::DescriptorPool),
    Sampler(vk::Sampler),
    QueryPool(vk::QueryPool),
    CommandPool(vk::CommandPool),
    Fence(vk::Fence),
}

/// The things that wait to be destroyed, and what for.
#[derive(Default)]
struct Graveyard {
    /// The number of the newest recording.
    recorded: u64,
    /// The newest recording that is known to have left the GPU, as all before it.
    completed: u64,
    waiting: VecDeque<(u64, Remains)>,
}

/// A logical device with its queue and memory.
pub(crate) struct Device {
    pub(crate) raw: ash::Device,
    pub(crate) physical: Physical,
    pub(crate) features: Features,
    pub(crate) queue: vk::Queue,
    pub(crate) queue_family: u32,
    pub(crate) tally: Tally,
    labels: Option<ext::debug_utils::Device>,
    allocator: Mutex<Option<Allocator>>,
    graveyard: Mutex<Graveyard>,
    owned: bool,
    /// The last field: it is dropped after the device is destroyed.
    pub(crate) instance: Instance,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What the locks guard is changed by single calls that do not panic halfway.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Device {
    /// Makes a device of our own.
    pub(crate) fn new(instance: Instance, physical: Physical) -> Result<Self, BackendError> {
        let family = physical
            .family
            .ok_or_else(|| no_device("the device has no queue that computes"))?;
        let features = physical.features;
        let core = vk::PhysicalDeviceFeatures::default()
            .image_cube_array(features.image_cube_array)
            .shader_storage_image_extended_formats(features.storage_image_extended_formats)
            .shader_storage_image_write_without_format(features.storage_image_write_without_format)
            .robust_buffer_access(features.robust_buffer_access)
            .full_draw_index_uint32(features.full_draw_index_uint32)
            .independent_blend(features.independent_blend)
            .depth_bias_clamp(features.depth_bias_clamp)
            .draw_indirect_first_instance(features.draw_indirect_first_instance)
            .multi_draw_indirect(features.multi_draw_indirect);
        let mut robustness2 =
            vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
        let mut vulkan11 = vk::PhysicalDeviceVulkan11Features::default()
            .storage_buffer16_bit_access(features.storage_buffer_16bit_access);
        let mut vulkan12 =
            vk::PhysicalDeviceVulkan12Features::default().shader_float16(features.shader_float16);
        let mut vulkan13 = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(features.synchronization2)
            .maintenance4(features.maintenance4)
            .robust_image_access(features.robust_image_access)
            .dynamic_rendering(features.dynamic_rendering);
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(family)
            .queue_priorities(&[1.0])];
        // SAFETY: the physical device is the instance's.
        let offered = unsafe {
            instance
                .raw
                .enumerate_device_extension_properties(physical.handle)
        }
        .map_err(failed("vkEnumerateDeviceExtensionProperties"))?;
        // A device that has this extension must be made with it.
        let mut extensions: Vec<_> = [khr::portability_subset::NAME]
            .into_iter()
            .filter(|name| {
                offered
                    .iter()
                    .any(|extension| extension.extension_name_as_c_str() == Ok(*name))
            })
            .map(CStr::as_ptr)
            .collect();
        if features.robust_buffer_access2 {
            extensions.push(ext::robustness2::NAME.as_ptr());
        }
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .enabled_features(&core)
            .push_next(&mut vulkan11)
            .push_next(&mut vulkan12)
            .push_next(&mut vulkan13);
        if features.robust_buffer_access2 {
            info = info.push_next(&mut robustness2);
        }
        // SAFETY: the family exists and has a queue, features and extensions
        // are offered, and everything pointed to lives until the call returns.
        let raw = unsafe { instance.raw.create_device(physical.handle, &info, None) }
            .map_err(failed("vkCreateDevice"))?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { raw.get_device_queue(family, 0) };
        Self::with(instance, physical, raw, queue, family, features, true)
    }

    /// Takes an engine's device as it is.
    pub(crate) fn adopt(adopted: AdoptedDevice) -> Result<Self, BackendError> {
        let AdoptedDevice {
            instance,
            physical_device,
            device,
            queue,
            queue_family,
            features,
            debug_utils,
        } = adopted;
        let instance = Instance::adopted(instance, debug_utils);
        let physical = Physical::query(&instance, physical_device);
        if !physical.info.missing.is_empty() {
            return Err(no_device(format!(
                "`{}` lacks {}",
                physical.info.name,
                physical.info.missing.join(", ")
            )));
        }
        let missing = features.missing();
        if !missing.is_empty() {
            return Err(no_device(format!(
                "the engine's device was made without `{}`, which this backend needs",
                missing.join("`, `")
            )));
        }
        // SAFETY: the physical device is the instance's.
        let families = unsafe {
            instance
                .raw
                .get_physical_device_queue_family_properties(physical_device)
        };
        let computes = usize::try_from(queue_family)
            .ok()
            .and_then(|index| families.get(index))
            .is_some_and(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
        if !computes {
            return Err(no_device(format!(
                "queue family {queue_family} of `{}` cannot compute",
                physical.info.name
            )));
        }
        Self::with(
            instance,
            physical,
            device,
            queue,
            queue_family,
            features,
            false,
        )
    }

    fn with(
        instance: Instance,
        physical: Physical,
        raw: ash::Device,
        queue: vk::Queue,
        queue_family: u32,
        features: Features,
        owned: bool,
    ) -> Result<Self, BackendError> {
        let labels = instance
            .debug_utils
            .then(|| ext::debug_utils::Device::new(&instance.raw, &raw));
        let this = Self {
            raw,
            physical,
            features,
            queue,
            queue_family,
            tally: Tally::default(),
            labels,
            allocator: Mutex::new(None),
            graveyard: Mutex::default(),
            owned,
            instance,
        };
        let mut settings = AllocatorDebugSettings::default();
        settings.log_leaks_on_shutdown = false;
        // After the device has an owner, so that a failure destroys it.
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: this.instance.raw.clone(),
            device: this.raw.clone(),
            physical_device: this.physical.handle,
            debug_settings: settings,
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(DEVICE_BLOCK, HOST_BLOCK),
        })
        .map_err(unallocated("the allocator", 0))?;
        *lock(&this.allocator) = Some(allocator);
        Ok(this)
    }

    /// Calls `allocate` with the allocator.
    pub(crate) fn with_allocator<T>(
        &self,
        allocate: impl FnOnce(&mut Allocator) -> Result<T, BackendError>,
    ) -> Result<T, BackendError> {
        match &mut *lock(&self.allocator) {
            Some(allocator) => allocate(allocator),
            // Only while the device is made or goes.
            None => Err(no_device("the device is going away")),
        }
    }

    /// Leaves something to be destroyed once the GPU is done with it.
    pub(crate) fn bury(&self, remains: Remains) {
        let mut graveyard = lock(&self.graveyard);
        let newest = graveyard.recorded;
        graveyard.waiting.push_back((newest, remains));
    }

    /// Begins a recording and returns its number, counting from 1.
    pub(crate) fn begin_recording(&self) -> u64 {
        let mut graveyard = lock(&self.graveyard);
        graveyard.recorded += 1;
        graveyard.recorded
    }

    /// The newest recording that has left the GPU.
    pub(crate) fn completed(&self) -> u64 {
        lock(&self.graveyard).completed
    }

    /// Takes note that this recording and all before it have left the GPU, and
    /// destroys what waited for them.
    pub(crate) fn complete(&self, recording: u64) {
        let done: Vec<Remains> = {
            let mut graveyard = lock(&self.graveyard);
            graveyard.completed = graveyard.completed.max(recording);
            let completed = graveyard.completed;
            let count = graveyard
                .waiting
                .iter()
                .take_while(|(at, _)| *at <= completed)
                .count();
            graveyard
                .waiting
                .drain(..count)
                .map(|(_, remains)| remains)
                .collect()
        };
        for remains in done {
            self.destroy(remains);
        }
    }

    fn destroy(&self, remains: Remains) {
        let raw = &self.raw;
        if let Remains::Memory(allocation) = remains {
            self.tally
                .bytes
                .fetch_sub(allocation.size(), Ordering::Relaxed);
            if let Some(allocator) = &mut *lock(&self.allocator) {
                // It fails for memory of another allocator only, which this is not.
                let freed = allocator.free(allocation);
                debug_assert!(freed.is_ok());
            }
            return;
        }
        // SAFETY: all handles were made from this device by a wrapper that gave
        // up its only copy when dropped, so each is destroyed once. What they
        // were used by came here before them and went first, and the recordings
        // that used them have left the GPU.
        unsafe {
            match remains {
                Remains::View(handle) => raw.destroy_image_view(handle, None),
                Remains::Image(handle) => raw.destroy_image(handle, None),
                Remains::Buffer(handle) => raw.destroy_buffer(handle, None),
                Remains::Pipeline(handle) => raw.destroy_pipeline(handle, None),
                Remains::PipelineLayout(handle) => raw.destroy_pipeline_layout(handle, None),
                Remains::SetLayout(handle) => raw.destroy_descriptor_set_layout(handle, None),
                Remains::DescriptorPool(handle) => raw.destroy_descriptor_pool(handle, None),
                Remains::Sampler(handle) => raw.destroy_sampler(handle, None),
                Remains::QueryPool(handle) => raw.destroy_query_pool(handle, None),
                Remains::CommandPool(handle) => raw.destroy_command_pool(handle, None),
                Remains::Fence(handle) => raw.destroy_fence(handle, None),
                Remains::Memory(_) => {}
            }
        }
    }

    /// Whether the queue draws.
    pub(crate) fn draws(&self) -> bool {
        usize::try_from(self.queue_family)
            .ok()
            .and_then(|family| self.physical.queue_flags.get(family))
            .is_some_and(|flags| flags.contains(vk::QueueFlags::GRAPHICS))
    }

    /// Bits of the queue's timestamps that count; 0 if it takes none.
    pub(crate) fn timestamp_bits(&self) -> u32 {
        usize::try_from(self.queue_family)
            .ok()
            .and_then(|family| self.physical.timestamp_bits.get(family))
            .copied()
            .unwrap_or(0)
    }

    /// The time between two timestamps, which may have wrapped around.
    pub(crate) fn nanoseconds(&self, start: u64, end: u64) -> u64 {
        let mask = match self.timestamp_bits() {
            bits @ 1..64 => (1 << bits) - 1,
            _ => u64::MAX,
        };
        let ticks = end.wrapping_sub(start) & mask;
        // Times are far from where an `f64` cannot count nanoseconds.
        (ticks as f64 * f64::from(self.physical.limits.timestamp_period)) as u64
    }

    /// Names an object for capture tools and validation messages.
    pub(crate) fn name<T: vk::Handle>(&self, handle: T, name: &str) {
        if let Some(labels) = &self.labels {
            let name = c_string(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default()
                .object_handle(handle)
                .object_name(&name);
            // SAFETY: the extension is enabled, and the handle was just made
            // from this device and is known to this thread alone.
            // A name that cannot be given is no reason to fail.
            let _ = unsafe { labels.set_debug_utils_object_name(&info) };
        }
    }

    /// Opens a label around the commands of a pass.
    pub(crate) fn begin_label(&self, commands: vk::CommandBuffer, name: &str) {
        if let Some(labels) = &self.labels {
            let name = c_string(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the extension is enabled and the command buffer is being
            // recorded by the caller.
            unsafe { labels.cmd_begin_debug_utils_label(commands, &label) };
        }
    }

    /// Closes the label opened last.
    pub(crate) fn end_label(&self, commands: vk::CommandBuffer) {
        if let Some(labels) = &self.labels {
            // SAFETY: as for `begin_label`, which every call of this follows.
            unsafe { labels.cmd_end_debug_utils_label(commands) };
        }
    }
}

/// A name as C spells it; a NUL within ends it.
fn c_string(name: &str) -> CString {
    let bytes: Vec<u8> = name.bytes().take_while(|byte| *byte != 0).collect();
    CString::new(bytes).unwrap_or_default()
}

impl Drop for Device {
    fn drop(&mut self) {
        if self.owned {
            // SAFETY: nobody else has the device, so nobody else uses its
            // queue. A lost device reports so and is idle.
            let _ = unsafe { self.raw.device_wait_idle() };
        }
        // An adopted device's recordings have left the GPU by now: that is
        // the condition under which an engine may drop a backend.
        self.complete(u64::MAX);
        // Returns its blocks to the driver.
        *lock(&self.allocator) = None;
        if self.owned {
            // SAFETY: everything made from the device held an `Arc` of this
            // and has been buried and destroyed; the device is idle.
            unsafe { self.raw.destroy_device(None) };
        }
    }
}

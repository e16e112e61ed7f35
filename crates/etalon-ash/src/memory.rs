//! Device memory, and how much of it resources take.

use std::collections::HashMap;
use std::ptr::NonNull;
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::plan::{MemoryModel, MemoryNeed, TightMemory, UsageSet};
use etalon_core::resource::{BufferDesc, TextureDesc};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use crate::device::{Device, Remains, count};
use crate::error::{failed, unallocated};
use crate::{buffer, image};

/// A piece of device memory. Whatever is bound to it holds it.
pub(crate) struct Memory {
    device: Arc<Device>,
    /// `None` only while it is dropped.
    allocation: Option<Allocation>,
}

impl Memory {
    /// Allocates memory.
    pub(crate) fn new(
        device: &Arc<Device>,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
        scheme: AllocationScheme,
    ) -> Result<Arc<Self>, BackendError> {
        let allocation = device.with_allocator(|allocator| {
            allocator
                .allocate(&AllocationCreateDesc {
                    name,
                    requirements,
                    location,
                    linear,
                    allocation_scheme: scheme,
                })
                .map_err(unallocated(name, requirements.size))
        })?;
        count(&device.tally.allocations, 1);
        count(&device.tally.bytes, allocation.size());
        Ok(Arc::new(Self {
            device: device.clone(),
            allocation: Some(allocation),
        }))
    }

    fn place(&self, offset: u64) -> (vk::DeviceMemory, u64) {
        self.allocation
            .as_ref()
            .map_or((vk::DeviceMemory::null(), 0), |allocation| {
                // SAFETY: the memory is only bound to; it is freed after what
                // is bound to it, which holds this.
                (unsafe { allocation.memory() }, allocation.offset() + offset)
            })
    }

    /// Binds an image at an offset.
    pub(crate) fn bind_image(&self, image: vk::Image, offset: u64) -> Result<(), BackendError> {
        let (memory, offset) = self.place(offset);
        // SAFETY: the caller has just made the image and bound nothing to it,
        // and has asked for memory that suits it at this offset.
        unsafe { self.device.raw.bind_image_memory(image, memory, offset) }
            .map_err(failed("vkBindImageMemory"))
    }

    /// Binds a buffer at an offset.
    pub(crate) fn bind_buffer(&self, buffer: vk::Buffer, offset: u64) -> Result<(), BackendError> {
        let (memory, offset) = self.place(offset);
        // SAFETY: as for `bind_image`.
        unsafe { self.device.raw.bind_buffer_memory(buffer, memory, offset) }
            .map_err(failed("vkBindBufferMemory"))
    }

    /// Where the host sees the memory, and how many bytes of it.
    fn mapped(&self) -> Option<(NonNull<u8>, usize)> {
        let allocation = self.allocation.as_ref()?;
        let size = usize::try_from(allocation.size()).ok()?;
        Some((allocation.mapped_ptr()?.cast(), size))
    }

    /// Copies bytes to host-visible memory. Returns whether there is room.
    #[must_use]
    pub(crate) fn write(&self, offset: u64, bytes: &[u8]) -> bool {
        let Some((start, size)) = self.mapped() else {
            return false;
        };
        let Ok(offset) = usize::try_from(offset) else {
            return false;
        };
        if offset.checked_add(bytes.len()).is_none_or(|end| end > size) {
            return false;
        }
        // SAFETY: the range lies within the mapped allocation, which `self`
        // keeps. The GPU does not use it meanwhile: callers write only to
        // parts whose last recording has left the GPU.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), start.as_ptr().add(offset), bytes.len());
        }
        true
    }

    /// Copies bytes from host-visible memory. Returns whether there are so many.
    #[must_use]
    pub(crate) fn read(&self, offset: u64, bytes: &mut [u8]) -> bool {
        let Some((start, size)) = self.mapped() else {
            return false;
        };
        let Ok(offset) = usize::try_from(offset) else {
            return false;
        };
        if offset.checked_add(bytes.len()).is_none_or(|end| end > size) {
            return false;
        }
        // SAFETY: the range lies within the mapped allocation, which `self`
        // keeps, and `bytes` is memory of the host. The GPU has finished
        // writing: callers have waited for the recording that did.
        unsafe {
            std::ptr::copy_nonoverlapping(
                start.as_ptr().add(offset),
                bytes.as_mut_ptr(),
                bytes.len(),
            );
        }
        true
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if let Some(allocation) = self.allocation.take() {
            self.device.bury(Remains::Memory(allocation));
        }
    }
}

/// What a device says a resource needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Requirements {
    pub(crate) memory: vk::MemoryRequirements,
    /// Whether the driver wants an allocation for this resource alone.
    pub(crate) dedicated: bool,
}

/// The device's answers to planning, asked once per kind of resource.
pub(crate) struct DeviceMemory {
    device: Arc<Device>,
    textures: Mutex<HashMap<(TextureDesc, UsageSet), MemoryNeed>>,
    buffers: Mutex<HashMap<(u64, UsageSet), MemoryNeed>>,
}

impl DeviceMemory {
    pub(crate) fn new(device: Arc<Device>) -> Self {
        Self {
            device,
            textures: Mutex::default(),
            buffers: Mutex::default(),
        }
    }
}

/// Answers from the cache, or asks and remembers.
fn cached<K: std::hash::Hash + Eq>(
    cache: &Mutex<HashMap<K, MemoryNeed>>,
    key: K,
    ask: impl FnOnce() -> MemoryNeed,
) -> MemoryNeed {
    *cache
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .entry(key)
        .or_insert_with(ask)
}

fn need(requirements: &Requirements) -> MemoryNeed {
    MemoryNeed {
        bytes: requirements.memory.size,
        alignment: requirements.memory.alignment,
    }
}

impl MemoryModel for DeviceMemory {
    /// What `vkGetDeviceImageMemoryRequirements` says. Of a texture the device
    /// cannot have there is nothing to say; such a plan is refused when it is
    /// run, and takes the tight size until then.
    fn texture(&self, desc: &TextureDesc, usages: UsageSet) -> MemoryNeed {
        cached(&self.textures, (*desc, usages), || {
            image::requirements(&self.device, desc, crate::usage::image_flags(usages))
                .map_or_else(|_| TightMemory.texture(desc, usages), |found| need(&found))
        })
    }

    fn buffer(&self, desc: &BufferDesc, usages: UsageSet) -> MemoryNeed {
        cached(&self.buffers, (desc.bytes, usages), || {
            buffer::requirements(&self.device, desc.bytes, crate::usage::buffer_flags(usages))
                .map_or_else(|| TightMemory.buffer(desc, usages), |found| need(&found))
        })
    }
}

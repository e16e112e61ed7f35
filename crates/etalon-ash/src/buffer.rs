//! Buffers.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::AllocationScheme;

use crate::device::{Device, Remains, count};
use crate::error::refused;
use crate::image::unique_id;
use crate::memory::{Memory, Requirements};

/// A buffer, ours or an engine's.
pub(crate) struct Buffer {
    pub(crate) id: u64,
    pub(crate) raw: vk::Buffer,
    /// Where in `raw` it begins; not 0 only for an engine's.
    pub(crate) offset: u64,
    /// As described, which may be less than what was made.
    pub(crate) bytes: u64,
    pub(crate) usage: vk::BufferUsageFlags,
    device: Arc<Device>,
    /// What it is bound to; `None` for an engine's buffer, which is not ours to destroy.
    memory: Option<Arc<Memory>>,
}

/// How a buffer is made. Fills work on words, so the size is rounded up to one.
fn create_info(bytes: u64, usage: vk::BufferUsageFlags) -> Option<vk::BufferCreateInfo<'static>> {
    Some(
        vk::BufferCreateInfo::default()
            .size(bytes.checked_next_multiple_of(4)?)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE),
    )
}

/// The memory a buffer would need; `None` for one the device cannot have.
pub(crate) fn requirements(
    device: &Device,
    bytes: u64,
    usage: vk::BufferUsageFlags,
) -> Option<Requirements> {
    let info = create_info(bytes, usage)?;
    if bytes == 0 || usage.is_empty() || info.size > device.physical.max_buffer {
        return None;
    }
    let query = vk::DeviceBufferMemoryRequirements::default().create_info(&info);
    let mut dedicated = vk::MemoryDedicatedRequirements::default();
    let mut found = vk::MemoryRequirements2::default().push_next(&mut dedicated);
    // SAFETY: size and usage are not empty, the size is within the device's
    // limit, and the feature `maintenance4` is enabled.
    unsafe {
        device
            .raw
            .get_device_buffer_memory_requirements(&query, &mut found);
    }
    Some(Requirements {
        memory: found.memory_requirements,
        dedicated: dedicated.requires_dedicated_allocation == vk::TRUE,
    })
}

impl Buffer {
    fn create(
        device: &Arc<Device>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<vk::Buffer, BackendError> {
        let info = create_info(bytes, usage).ok_or_else(|| too_large(name, bytes))?;
        // SAFETY: the callers below have checked size and usage.
        let raw = unsafe { device.raw.create_buffer(&info, None) }.map_err(refused(
            "vkCreateBuffer",
            name,
            bytes,
        ))?;
        count(&device.tally.buffers, 1);
        device.name(raw, name);
        Ok(raw)
    }

    fn bound(
        device: &Arc<Device>,
        raw: vk::Buffer,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        memory: Arc<Memory>,
        offset: u64,
    ) -> Result<Arc<Self>, BackendError> {
        // From here on dropping it destroys it.
        let this = Arc::new(Self {
            id: unique_id(),
            raw,
            offset: 0,
            bytes,
            usage,
            device: device.clone(),
            memory: Some(memory.clone()),
        });
        memory.bind_buffer(raw, offset)?;
        Ok(this)
    }

    /// A buffer at an offset of memory that is large enough and of a suitable type.
    pub(crate) fn placed(
        device: &Arc<Device>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        memory: &Arc<Memory>,
        offset: u64,
    ) -> Result<Arc<Self>, BackendError> {
        let raw = Self::create(device, name, bytes, usage)?;
        Self::bound(device, raw, bytes, usage, memory.clone(), offset)
    }

    /// A buffer with memory of its own.
    pub(crate) fn new(
        device: &Arc<Device>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Arc<Self>, BackendError> {
        let needed = requirements(device, bytes, usage).ok_or_else(|| too_large(name, bytes))?;
        let memory = Memory::new(
            device,
            name,
            needed.memory,
            location,
            true,
            AllocationScheme::GpuAllocatorManaged,
        )?;
        let raw = Self::create(device, name, bytes, usage)?;
        Self::bound(device, raw, bytes, usage, memory, 0)
    }

    /// An engine's buffer.
    pub(crate) fn adopted(
        device: &Arc<Device>,
        raw: vk::Buffer,
        offset: u64,
        bytes: u64,
        usage: vk::BufferUsageFlags,
    ) -> Arc<Self> {
        Arc::new(Self {
            id: unique_id(),
            raw,
            offset,
            bytes,
            usage,
            device: device.clone(),
            memory: None,
        })
    }

    /// Copies bytes into a buffer that the host sees.
    pub(crate) fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), BackendError> {
        match &self.memory {
            Some(memory) if memory.write(offset, bytes) => Ok(()),
            _ => Err(unseen(offset, bytes.len())),
        }
    }

    /// Copies bytes out of a buffer that the host sees.
    pub(crate) fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), BackendError> {
        match &self.memory {
            Some(memory) if memory.read(offset, bytes) => Ok(()),
            _ => Err(unseen(offset, bytes.len())),
        }
    }
}

fn too_large(name: &str, bytes: u64) -> BackendError {
    BackendError::OutOfMemory {
        what: name.to_owned(),
        bytes,
    }
}

fn unseen(offset: u64, bytes: usize) -> BackendError {
    BackendError::Api {
        call: "vkMapMemory",
        reason: format!("bytes {offset} to {offset} + {bytes} are not mapped"),
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.memory.is_some() {
            self.device.bury(Remains::Buffer(self.raw));
        }
    }
}

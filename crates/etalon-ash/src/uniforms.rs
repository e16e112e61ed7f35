//! Uniform blocks: a ring of host-visible memory.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use gpu_allocator::MemoryLocation;

use crate::buffer::Buffer;
use crate::device::Device;
use crate::error::malformed;

/// A plan's uniform blocks, as often as recordings may be under way at once
/// and once more, so that there is always a copy the GPU has finished with.
pub(crate) struct UniformRing {
    buffer: Arc<Buffer>,
    /// Bytes from one copy to the next.
    stride: u32,
    /// The recording that used each copy last.
    last_used: Vec<u64>,
}

impl UniformRing {
    /// A ring of copies of so many bytes; `None` if there are none.
    pub(crate) fn new(
        device: &Arc<Device>,
        bytes: usize,
        frames_in_flight: u32,
    ) -> Result<Option<Self>, BackendError> {
        if bytes == 0 {
            return Ok(None);
        }
        let limits = &device.physical.limits;
        let alignment = limits.min_uniform_buffer_offset_alignment.max(16);
        let copies = u64::from(frames_in_flight) + 1;
        let stride = u64::try_from(bytes)
            .ok()
            .and_then(|bytes| bytes.checked_next_multiple_of(alignment));
        // Places within the ring are given to Vulkan as `u32`.
        let (Some(stride), Some(size)) = (
            stride.and_then(|stride| u32::try_from(stride).ok()),
            stride
                .and_then(|stride| stride.checked_mul(copies))
                .filter(|size| u32::try_from(*size).is_ok()),
        ) else {
            return Err(BackendError::OutOfMemory {
                what: "uniform blocks".to_owned(),
                bytes: u64::try_from(bytes).unwrap_or(u64::MAX),
            });
        };
        let buffer = Buffer::new(
            device,
            "uniform blocks",
            size,
            vk::BufferUsageFlags::UNIFORM_BUFFER,
            MemoryLocation::CpuToGpu,
        )?;
        Ok(Some(Self {
            buffer,
            stride,
            last_used: (0..copies).map(|_| 0).collect(),
        }))
    }

    /// The whole ring.
    pub(crate) fn raw(&self) -> vk::Buffer {
        self.buffer.raw
    }

    /// Writes the blocks to a copy nobody reads any more, and returns where in
    /// the ring it begins.
    pub(crate) fn write(
        &mut self,
        bytes: &[u8],
        recording: u64,
        completed: u64,
    ) -> Result<u32, BackendError> {
        let free = (0_u32..)
            .zip(&mut self.last_used)
            .find(|(_, last_used)| **last_used <= completed);
        // There is one more than recordings under way.
        let Some((index, last_used)) = free else {
            return Err(malformed(
                "more recordings are under way than frames in flight",
            ));
        };
        // Within the size of the ring, which fits `u32`.
        let offset = index * self.stride;
        self.buffer.write(u64::from(offset), bytes)?;
        *last_used = recording;
        Ok(offset)
    }

    /// Takes note that a recording has left the GPU ahead of others.
    pub(crate) fn release(&mut self, recording: u64) {
        for last_used in &mut self.last_used {
            if *last_used == recording {
                *last_used = 0;
            }
        }
    }
}

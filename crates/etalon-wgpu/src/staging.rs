//! Uniform data on its way into an encoder.
//!
//! `Queue::write_buffer` would run before *all* commands of the next submit, so
//! that of several recordings only the last would keep its values. Here each
//! recording copies its bytes from a mapped buffer of its own, in the encoder
//! and thus in order; the buffer is mapped again once the GPU is done with it.
//! There is no limit to how many recordings one submit may hold: the pool grows
//! to the number in flight and stays there.

use std::sync::mpsc::{Receiver, Sender, channel};

use etalon_core::backend::BackendError;

use crate::gpu::Gpu;
use crate::tally::Owned;

/// Buffers are rounded up to powers of two from here, so that plans can share
/// them.
const SMALLEST: u64 = 1 << 12;

/// Mapped buffers, and those that will be.
#[derive(Debug)]
pub(crate) struct Staging {
    free: Vec<Owned<wgpu::Buffer>>,
    returned: Receiver<Owned<wgpu::Buffer>>,
    give_back: Sender<Owned<wgpu::Buffer>>,
}

impl Default for Staging {
    fn default() -> Self {
        let (give_back, returned) = channel();
        Self {
            free: Vec::new(),
            returned,
            give_back,
        }
    }
}

impl Staging {
    /// A mapped buffer that holds `bytes`, unmapped and ready to be copied from.
    pub(crate) fn fill(
        &mut self,
        gpu: &Gpu,
        bytes: &[u8],
    ) -> Result<Owned<wgpu::Buffer>, BackendError> {
        self.free.extend(self.returned.try_iter());
        let size = (bytes.len() as u64).next_power_of_two().max(SMALLEST);
        let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
        let Some(index) = self.free.iter().position(|buffer| buffer.size() == size) else {
            // Filled as it is made; what is behind the bytes is never copied.
            let mut padded = bytes.to_vec();
            padded.resize(size as usize, 0);
            return gpu.buffer("etalon staging", size, usage, Some(&padded));
        };
        let buffer = self.free.swap_remove(index);
        let written = gpu.guarded(|| {
            let result = buffer
                .get_mapped_range_mut(..bytes.len() as u64)
                .map(|mut view| view.copy_from_slice(bytes));
            buffer.unmap();
            result
        });
        match written {
            Ok(Ok(())) => Ok(buffer),
            Ok(Err(error)) => Err(BackendError::Api {
                call: "get_mapped_range",
                reason: error.to_string(),
            }),
            Err(fault) => Err(fault.of("get_mapped_range", "uniforms", bytes.len() as u64)),
        }
    }

    /// Records the copy, and has the buffer come back when it has run. If the
    /// encoder is dropped instead, so is the buffer.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffer: Owned<wgpu::Buffer>,
        target: &wgpu::Buffer,
        bytes: u64,
    ) {
        encoder.copy_buffer_to_buffer(&buffer, 0, target, 0, bytes);
        let give_back = self.give_back.clone();
        let handle = (*buffer).clone();
        encoder.map_buffer_on_submit(&handle, wgpu::MapMode::Write, .., move |mapped| {
            // Nobody takes it if the backend is gone.
            if mapped.is_ok() {
                let _ = give_back.send(buffer);
            }
        });
    }

    /// Drops the buffers that are not in flight.
    pub(crate) fn trim(&mut self) {
        self.free.extend(self.returned.try_iter());
        self.free.clear();
    }
}

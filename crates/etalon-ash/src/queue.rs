//! Submitting to the queue and waiting for it.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;

use crate::commands::Commands;
use crate::device::{Device, Remains};
use crate::error::failed;

/// One command buffer, used again and again, and the fence that says when.
pub(crate) struct HostQueue {
    device: Arc<Device>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
}

impl HostQueue {
    pub(crate) fn new(device: &Arc<Device>) -> Result<Self, BackendError> {
        let mut this = Self {
            device: device.clone(),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
        };
        let raw = &device.raw;
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue_family);
        // SAFETY: the family is one the device was made with.
        this.pool = unsafe { raw.create_command_pool(&info, None) }
            .map_err(failed("vkCreateCommandPool"))?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(this.pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was made above and nobody else has it.
        let allocated = unsafe { raw.allocate_command_buffers(&info) }
            .map_err(failed("vkAllocateCommandBuffers"))?;
        this.commands = allocated.into_iter().next().unwrap_or_default();
        // SAFETY: no preconditions.
        this.fence = unsafe { raw.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(failed("vkCreateFence"))?;
        Ok(this)
    }

    /// Begins to record.
    pub(crate) fn begin(&self) -> Result<Commands<'_>, BackendError> {
        let raw = &self.device.raw;
        // SAFETY: the one command buffer of the pool is not on the GPU:
        // `submit` waits for it.
        unsafe { raw.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .map_err(failed("vkResetCommandPool"))?;
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: it has just been reset.
        unsafe { raw.begin_command_buffer(self.commands, &info) }
            .map_err(failed("vkBeginCommandBuffer"))?;
        // SAFETY: it is in the recording state now, and stays so until
        // `submit`; nobody else has it.
        Ok(unsafe { Commands::new(&self.device, self.commands) })
    }

    /// Ends the recording, submits it and waits until the GPU has run it.
    pub(crate) fn submit(&self) -> Result<(), BackendError> {
        let raw = &self.device.raw;
        // SAFETY: `begin` was called, and every label opened was closed.
        unsafe { raw.end_command_buffer(self.commands) }.map_err(failed("vkEndCommandBuffer"))?;
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
        let info = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
        // SAFETY: the fence is not signalled and in no submission. Nobody else
        // uses the queue: it is ours, or the engine has promised so.
        unsafe { raw.queue_submit2(self.device.queue, &info, self.fence) }
            .map_err(failed("vkQueueSubmit2"))?;
        // SAFETY: the fence was submitted above.
        unsafe { raw.wait_for_fences(&[self.fence], true, u64::MAX) }
            .map_err(failed("vkWaitForFences"))?;
        // SAFETY: the submission it was in has completed.
        unsafe { raw.reset_fences(&[self.fence]) }.map_err(failed("vkResetFences"))
    }
}

impl Drop for HostQueue {
    fn drop(&mut self) {
        self.device.bury(Remains::Fence(self.fence));
        // Its command buffer goes with it.
        self.device.bury(Remains::CommandPool(self.pool));
    }
}

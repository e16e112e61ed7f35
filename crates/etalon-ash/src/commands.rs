//! A command buffer being recorded.
//!
//! Every `vkCmd…` this backend calls is here or, of those that draw, in `draw`.

mod draw;

use ash::vk;
pub(crate) use draw::{Attachment, Extent};
use etalon_core::Format;
use etalon_core::format::SampleKind;
use etalon_core::graph::{ClearValue, Subresources};
use etalon_core::texel::Texel;

use crate::buffer::Buffer;
use crate::convert;
use crate::device::Device;
use crate::image::Image;
use crate::pipeline::Pipeline;

/// A command buffer in the recording state, outside a render pass.
///
/// The methods are safe to call with what this crate makes: images, buffers
/// and pipelines are destroyed only after the recordings that were under way
/// when they were dropped have left the GPU, and the numbers in plans are
/// checked before they are recorded.
pub(crate) struct Commands<'a> {
    pub(crate) device: &'a Device,
    raw: vk::CommandBuffer,
}

/// The layout change and wait of one barrier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transition {
    pub(crate) source: (vk::PipelineStageFlags2, vk::AccessFlags2),
    pub(crate) target: (vk::PipelineStageFlags2, vk::AccessFlags2),
    /// Old and new; of no meaning for buffers.
    pub(crate) layouts: (vk::ImageLayout, vk::ImageLayout),
}

/// Barriers recorded together.
#[derive(Debug, Default)]
pub(crate) struct Barriers {
    images: Vec<vk::ImageMemoryBarrier2<'static>>,
    buffers: Vec<vk::BufferMemoryBarrier2<'static>>,
    memory: Vec<vk::MemoryBarrier2<'static>>,
}

impl Barriers {
    pub(crate) fn image(&mut self, image: &Image, range: Subresources, by: Transition) {
        self.images.push(
            vk::ImageMemoryBarrier2::default()
                .src_stage_mask(by.source.0)
                .src_access_mask(by.source.1)
                .dst_stage_mask(by.target.0)
                .dst_access_mask(by.target.1)
                .old_layout(by.layouts.0)
                .new_layout(by.layouts.1)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(image.raw)
                .subresource_range(convert::range(image.desc.format, range)),
        );
    }

    pub(crate) fn buffer(&mut self, buffer: &Buffer, by: Transition) {
        self.buffers.push(
            vk::BufferMemoryBarrier2::default()
                .src_stage_mask(by.source.0)
                .src_access_mask(by.source.1)
                .dst_stage_mask(by.target.0)
                .dst_access_mask(by.target.1)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .buffer(buffer.raw)
                .offset(buffer.offset)
                .size(buffer.bytes),
        );
    }

    pub(crate) fn memory(
        &mut self,
        source: (vk::PipelineStageFlags2, vk::AccessFlags2),
        target: (vk::PipelineStageFlags2, vk::AccessFlags2),
    ) {
        self.memory.push(
            vk::MemoryBarrier2::default()
                .src_stage_mask(source.0)
                .src_access_mask(source.1)
                .dst_stage_mask(target.0)
                .dst_access_mask(target.1),
        );
    }

    fn is_empty(&self) -> bool {
        self.images.is_empty() && self.buffers.is_empty() && self.memory.is_empty()
    }

    fn clear(&mut self) {
        self.images.clear();
        self.buffers.clear();
        self.memory.clear();
    }
}

impl<'a> Commands<'a> {
    /// # Safety
    /// The command buffer must have been allocated from this device for a
    /// queue family that can compute, be in the recording state outside a
    /// render pass, and stay so, used by nobody else, for as long as this exists.
    pub(crate) unsafe fn new(device: &'a Device, raw: vk::CommandBuffer) -> Self {
        Self { device, raw }
    }

    /// Opens a label for capture tools.
    pub(crate) fn begin_label(&self, name: &str) {
        self.device.begin_label(self.raw, name);
    }

    /// Closes the label opened last.
    pub(crate) fn end_label(&self) {
        self.device.end_label(self.raw);
    }

    /// Records barriers, if any, in one call, and empties the list.
    pub(crate) fn barrier(&self, barriers: &mut Barriers) {
        if barriers.is_empty() {
            return;
        }
        let info = vk::DependencyInfo::default()
            .memory_barriers(&barriers.memory)
            .buffer_memory_barriers(&barriers.buffers)
            .image_memory_barriers(&barriers.images);
        // SAFETY: `new`'s condition; the feature `synchronization2` is enabled,
        // and the handles live, as the type's documentation explains.
        unsafe { self.device.raw.cmd_pipeline_barrier2(self.raw, &info) };
        barriers.clear();
    }

    /// Makes a kernel and what is bound to it current.
    pub(crate) fn bind(&self, pipeline: &Pipeline, set: vk::DescriptorSet, offsets: &[u32]) {
        let (raw, point) = (&self.device.raw, pipeline.point);
        // SAFETY: `new`'s condition; pipelines that draw are made on devices
        // whose queue does.
        unsafe { raw.cmd_bind_pipeline(self.raw, point, pipeline.raw) };
        // Kernels that bind nothing have none.
        if set == vk::DescriptorSet::null() {
            return;
        }
        let layout = pipeline.layout.raw;
        // SAFETY: `new`'s condition; the set was allocated with the layout that
        // the pipeline was made with, is not updated before this recording has
        // left the GPU, and there is one offset for each uniform block,
        // aligned and within its buffer.
        unsafe { raw.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set], offsets) };
    }

    /// Runs the current kernel.
    pub(crate) fn dispatch(&self, [x, y, z]: [u32; 3]) {
        // SAFETY: `new`'s condition; `bind` was called before, and the counts
        // are within the device's limits.
        unsafe { self.device.raw.cmd_dispatch(self.raw, x, y, z) };
    }

    /// Runs the current kernel as often as a buffer says.
    pub(crate) fn dispatch_indirect(&self, counts: &Buffer, offset: u64) {
        let offset = counts.offset + offset;
        // SAFETY: as for `dispatch`; the buffer may be used so, and 12 bytes at
        // the offset, a multiple of 4, are within it.
        unsafe {
            self.device
                .raw
                .cmd_dispatch_indirect(self.raw, counts.raw, offset);
        }
    }

    /// Fills part of a texture in the layout for copies.
    pub(crate) fn clear_image(&self, image: &Image, range: Subresources, value: ClearValue) {
        let format = image.desc.format;
        let ranges = [convert::range(format, range)];
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let value = storable(format, value);
        let raw = &self.device.raw;
        // SAFETY: `new`'s condition; the image may be copied to, the plan's
        // barrier has put the range into this layout, and the value is of the
        // format's kind.
        unsafe {
            match (format.sample_kind(), value) {
                (SampleKind::Depth, ClearValue::Float([depth, ..])) => {
                    let value = vk::ClearDepthStencilValue { depth, stencil: 0 };
                    raw.cmd_clear_depth_stencil_image(self.raw, image.raw, layout, &value, &ranges);
                }
                (_, value) => {
                    let value = clear_colour(value);
                    raw.cmd_clear_color_image(self.raw, image.raw, layout, &value, &ranges);
                }
            }
        }
    }

    /// Fills a buffer with zeros.
    pub(crate) fn clear_buffer(&self, buffer: &Buffer) {
        // A size beyond the last whole word exists in engines' buffers only.
        let size = buffer.bytes.next_multiple_of(4);
        // SAFETY: `new`'s condition; the buffer may be copied to and has the
        // size: ours are made in whole words, engines' are checked to be.
        unsafe {
            self.device
                .raw
                .cmd_fill_buffer(self.raw, buffer.raw, buffer.offset, size, 0);
        }
    }

    /// Copies mips and layers from one texture to another.
    pub(crate) fn copy_image(
        &self,
        (source, from): (&Image, Subresources),
        (target, to): (&Image, Subresources),
    ) {
        let regions: Vec<_> = (0..from.mips)
            .map(|mip| {
                let format = source.desc.format;
                vk::ImageCopy::default()
                    .src_subresource(convert::layers(format, from, from.mip + mip))
                    .dst_subresource(convert::layers(target.desc.format, to, to.mip + mip))
                    .extent(convert::copy_extent(&source.desc, from.mip + mip))
            })
            .collect();
        // SAFETY: `new`'s condition; the images may be copied from and to, the
        // plan's barriers have put the ranges into these layouts, and the
        // plan was checked for ranges of equal shape and format.
        unsafe {
            self.device.raw.cmd_copy_image(
                self.raw,
                source.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                target.raw,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &regions,
            );
        }
    }

    /// Copies `bytes` from the start of one buffer to an offset of another.
    pub(crate) fn copy_buffer(
        &self,
        (source, from): (&Buffer, u64),
        (target, to): (&Buffer, u64),
        bytes: u64,
    ) {
        let regions = [vk::BufferCopy::default()
            .src_offset(source.offset + from)
            .dst_offset(target.offset + to)
            .size(bytes)];
        // SAFETY: `new`'s condition; the buffers may be copied from and to, are
        // not the same, and have the bytes: sizes were checked or made to fit.
        unsafe {
            self.device
                .raw
                .cmd_copy_buffer(self.raw, source.raw, target.raw, &regions);
        }
    }

    /// Copies texels from a buffer to an image in the layout for copies.
    pub(crate) fn upload(&self, source: &Buffer, target: &Image, regions: &[vk::BufferImageCopy]) {
        // SAFETY: `new`'s condition; buffer and image may be copied from and
        // to, the image is in this layout, and the regions were computed from
        // its description, for a buffer made to hold them.
        unsafe {
            self.device.raw.cmd_copy_buffer_to_image(
                self.raw,
                source.raw,
                target.raw,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                regions,
            );
        }
    }

    /// Copies texels from an image in the layout for copies to a buffer.
    pub(crate) fn download(
        &self,
        source: &Image,
        target: &Buffer,
        regions: &[vk::BufferImageCopy],
    ) {
        // SAFETY: as for `upload`.
        unsafe {
            self.device.raw.cmd_copy_image_to_buffer(
                self.raw,
                source.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                target.raw,
                regions,
            );
        }
    }

    /// Makes `count` queries of a pool ready to be written.
    pub(crate) fn reset_queries(&self, pool: vk::QueryPool, count: u32) {
        // SAFETY: `new`'s condition; the pool has so many queries, none of
        // which a recording on the GPU uses.
        unsafe {
            self.device
                .raw
                .cmd_reset_query_pool(self.raw, pool, 0, count);
        }
    }

    /// Takes the time when everything recorded so far is done.
    pub(crate) fn timestamp(&self, pool: vk::QueryPool, query: u32) {
        // SAFETY: `new`'s condition; the query is the pool's, was reset in this
        // recording and is written once in it.
        unsafe {
            self.device.raw.cmd_write_timestamp2(
                self.raw,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                pool,
                query,
            );
        }
    }
}

/// A colour to fill with.
fn clear_colour(value: ClearValue) -> vk::ClearColorValue {
    match value {
        ClearValue::Float(float32) => vk::ClearColorValue { float32 },
        ClearValue::Sint(int32) => vk::ClearColorValue { int32 },
        ClearValue::Uint(uint32) => vk::ClearColorValue { uint32 },
    }
}

/// The value as the format stores it. Drivers round clear values as they
/// please; what needs no rounding comes out the same everywhere.
fn storable(format: Format, value: ClearValue) -> ClearValue {
    let mut bytes = [0; 16];
    let Some(bytes) = usize::try_from(format.texel_bytes())
        .ok()
        .and_then(|size| bytes.get_mut(..size))
    else {
        return value;
    };
    let texel = match value {
        ClearValue::Float(value) => Texel::Float(value),
        ClearValue::Sint(value) => Texel::Sint(value),
        ClearValue::Uint(value) => Texel::Uint(value),
    };
    format.encode(texel, bytes);
    match format.decode(bytes) {
        Texel::Float(value) => ClearValue::Float(value),
        Texel::Sint(value) => ClearValue::Sint(value),
        Texel::Uint(value) => ClearValue::Uint(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clear_values_need_no_rounding() {
        // 0.1 as a half float is 1638.4 × 2⁻¹⁴, stored as 1638 × 2⁻¹⁴.
        let stored = storable(Format::Rgba16Float, ClearValue::Float([0.1; 4]));
        let half = 1638.0 / 16384.0;
        assert_eq!(stored, ClearValue::Float([half; 4]));
        let exact = ClearValue::Uint([1, 2, 3, 4]);
        assert_eq!(storable(Format::Rgba32Uint, exact), exact);
    }
}

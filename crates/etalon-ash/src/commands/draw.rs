//! Commands that draw.

use ash::vk;
use etalon_core::format::SampleKind;
use etalon_core::graph::ClearValue;
use etalon_core::raster::{IndexFormat, Scissor, Viewport};

use super::{Commands, clear_colour, storable};
use crate::buffer::Buffer;
use crate::convert;
use crate::image::Image;

/// One mip and layer of an image that is drawn to.
pub(crate) struct Attachment<'a> {
    pub(crate) image: &'a Image,
    pub(crate) view: vk::ImageView,
    /// What it is filled with before.
    pub(crate) clear: Option<ClearValue>,
}

/// How much a draw draws.
pub(crate) enum Extent<'a> {
    /// So much.
    Direct {
        /// Vertices or indices: the first and how many.
        elements: (u32, u32),
        /// Is added to indices.
        base_vertex: i32,
        /// The first and how many.
        instances: (u32, u32),
    },
    /// As records from a byte of a buffer on say.
    Indirect {
        records: &'a Buffer,
        offset: u64,
        count: u32,
    },
}

/// Bytes of the record of an indirect draw.
const RECORD: u32 = 16;
const INDEXED_RECORD: u32 = 20;

impl Attachment<'_> {
    fn info(&self, layout: vk::ImageLayout) -> vk::RenderingAttachmentInfo<'static> {
        let info = vk::RenderingAttachmentInfo::default()
            .image_view(self.view)
            .image_layout(layout)
            .store_op(vk::AttachmentStoreOp::STORE);
        let Some(value) = self.clear else {
            return info.load_op(vk::AttachmentLoadOp::LOAD);
        };
        let format = self.image.desc.format;
        let clear_value = match (format.sample_kind(), storable(format, value)) {
            (SampleKind::Depth, ClearValue::Float([depth, ..])) => vk::ClearValue {
                depth_stencil: vk::ClearDepthStencilValue { depth, stencil: 0 },
            },
            (_, value) => vk::ClearValue {
                color: clear_colour(value),
            },
        };
        info.load_op(vk::AttachmentLoadOp::CLEAR)
            .clear_value(clear_value)
    }
}

impl Commands<'_> {
    /// Begins to draw to these targets; until [`end_drawing`](Self::end_drawing)
    /// only the methods of this module may be called, and `bind`.
    pub(crate) fn begin_drawing(
        &self,
        [width, height]: [u32; 2],
        colours: &[Attachment<'_>],
        depth: Option<&Attachment<'_>>,
    ) {
        let colours: Vec<_> = colours
            .iter()
            .map(|target| target.info(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL))
            .collect();
        let depth =
            depth.map(|target| target.info(vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL));
        let area = vk::Rect2D::default().extent(vk::Extent2D { width, height });
        let mut info = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&colours);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        // SAFETY: `new`'s condition; the plan was checked: the queue draws, the
        // feature `dynamicRendering` is enabled, and the views are of one mip
        // and layer, all of this size, of formats that can be drawn to. The
        // plan's barriers have put them into these layouts.
        unsafe { self.device.raw.cmd_begin_rendering(self.raw, &info) };
    }

    /// Ends to draw.
    pub(crate) fn end_drawing(&self) {
        // SAFETY: `begin_drawing` was called in this command buffer.
        unsafe { self.device.raw.cmd_end_rendering(self.raw) };
    }

    /// Maps clip space, in which +Y is up, to part of the targets, in which it
    /// is down: from the lower edge on, with a height below zero.
    pub(crate) fn viewport(&self, viewport: &Viewport, scissor: &Scissor) {
        let viewports = [vk::Viewport {
            x: viewport.x,
            y: viewport.y + viewport.height,
            width: viewport.width,
            height: -viewport.height,
            min_depth: viewport.near,
            max_depth: viewport.far,
        }];
        // Within the targets, so that it fits an `i32`.
        let at = |offset: u32| i32::try_from(offset).unwrap_or(i32::MAX);
        let scissors = [vk::Rect2D {
            offset: vk::Offset2D {
                x: at(scissor.x),
                y: at(scissor.y),
            },
            extent: vk::Extent2D {
                width: scissor.width,
                height: scissor.height,
            },
        }];
        // SAFETY: `new`'s condition; both were checked to lie in the targets,
        // whose size is within the device's limits.
        unsafe {
            self.device.raw.cmd_set_viewport(self.raw, 0, &viewports);
            self.device.raw.cmd_set_scissor(self.raw, 0, &scissors);
        }
    }

    /// Feeds vertex kernels from a buffer, from a byte on up to its end: what
    /// lies beyond, in an engine's buffer, is not theirs to see.
    pub(crate) fn vertices(&self, binding: u32, buffer: &Buffer, offset: u64) {
        let size = buffer.bytes.saturating_sub(offset);
        // SAFETY: `new`'s condition; the buffer may be used so, the offset was
        // checked to be within it, and the binding to be one the device has.
        unsafe {
            self.device.raw.cmd_bind_vertex_buffers2(
                self.raw,
                binding,
                &[buffer.raw],
                &[buffer.offset + offset],
                Some(&[size]),
                None,
            );
        }
    }

    /// Takes vertices in the order of indices, from a byte of a buffer on.
    pub(crate) fn indices(&self, buffer: &Buffer, offset: u64, format: IndexFormat) {
        // SAFETY: `new`'s condition; the buffer may be used so, and the offset
        // was checked to be within it and a multiple of an index's bytes.
        unsafe {
            self.device.raw.cmd_bind_index_buffer(
                self.raw,
                buffer.raw,
                buffer.offset + offset,
                convert::index_type(format),
            );
        }
    }

    /// Draws with what is current.
    pub(crate) fn draw(&self, extent: &Extent<'_>, indexed: bool) {
        let raw = &self.device.raw;
        match *extent {
            Extent::Direct {
                elements: (first, count),
                base_vertex,
                instances: (instance, instances),
            } => {
                // SAFETY: `new`'s condition; pipeline, sets, vertices and
                // indices are bound, and direct draws were checked to stay
                // within them. Vertices that indices name out of range are
                // made harmless by `robustBufferAccess`.
                unsafe {
                    if indexed {
                        raw.cmd_draw_indexed(
                            self.raw,
                            count,
                            instances,
                            first,
                            base_vertex,
                            instance,
                        );
                    } else {
                        raw.cmd_draw(self.raw, count, instances, first, instance);
                    }
                }
            }
            Extent::Indirect {
                records,
                offset,
                count,
            } => {
                let stride = if indexed { INDEXED_RECORD } else { RECORD };
                // So many records in one call.
                let most = if self.device.features.multi_draw_indirect {
                    self.device.physical.limits.max_draw_indirect_count.max(1)
                } else {
                    1
                };
                let mut done = 0;
                while done < count {
                    let now = most.min(count - done);
                    let at = records.offset + offset + u64::from(done) * u64::from(stride);
                    // SAFETY: as above; the buffer may be used so, the records
                    // were checked to be within it at a multiple of 4, and any
                    // first instance is fine with `drawIndirectFirstInstance`.
                    unsafe {
                        if indexed {
                            raw.cmd_draw_indexed_indirect(self.raw, records.raw, at, now, stride);
                        } else {
                            raw.cmd_draw_indirect(self.raw, records.raw, at, now, stride);
                        }
                    }
                    done += now;
                }
            }
        }
    }
}

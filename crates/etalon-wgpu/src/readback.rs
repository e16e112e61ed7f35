//! Copying resources back to the host.

use std::sync::mpsc::{Receiver, channel};

use etalon_core::backend::{BackendError, CapturedData};
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::image::ImageData;
use etalon_core::resource::{Dimension, Extent, TextureDesc};

use crate::bind::Physical;
use crate::clear::pitch;
use crate::convert;
use crate::gpu::Gpu;
use crate::tally::Owned;

/// One capture of a plan.
#[derive(Debug)]
pub(crate) struct Readback {
    buffer: Owned<wgpu::Buffer>,
    layout: Layout,
}

#[derive(Debug)]
enum Layout {
    /// The whole buffer.
    Buffer { bytes: u64 },
    /// The texture that the range makes, and where its mips are.
    Texture {
        desc: TextureDesc,
        mips: Vec<MipLayout>,
    },
}

/// Where a mip is in the buffer: its rows are `pitch` bytes apart, its layers
/// follow each other.
#[derive(Clone, Copy, Debug)]
struct MipLayout {
    offset: u64,
    pitch: u64,
    row: usize,
    rows: u64,
}

/// A range of a texture as a texture of its own.
fn captured_desc(desc: &TextureDesc, range: Subresources) -> TextureDesc {
    let size = desc.mip_extent(range.mip);
    let (dimension, depth_or_layers) = match desc.dimension {
        Dimension::D3 => (Dimension::D3, size.depth_or_layers),
        Dimension::Cube if range.layers == desc.layers() => (Dimension::Cube, range.layers),
        Dimension::D2 | Dimension::Cube => (Dimension::D2, range.layers),
    };
    TextureDesc {
        dimension,
        extent: Extent {
            depth_or_layers,
            ..size
        },
        mips: range.mips,
        format: desc.format,
    }
}

impl Readback {
    /// Prepares to copy back part of a resource.
    pub(crate) fn new(
        gpu: &Gpu,
        step: &str,
        desc: &ResourceDesc,
        range: Subresources,
    ) -> Result<Self, BackendError> {
        let (layout, bytes) = match desc {
            ResourceDesc::Buffer(desc) => (Layout::Buffer { bytes: desc.bytes }, desc.bytes),
            ResourceDesc::Texture(desc) => {
                let desc = captured_desc(desc, range);
                let mut end = 0_u64;
                let mips = (0..desc.mips)
                    .map(|mip| {
                        let size = desc.mip_extent(mip);
                        let pitch = pitch(desc.format, size.width);
                        let rows = u64::from(size.height) * u64::from(size.depth_or_layers);
                        let offset = end;
                        // Rows are padded to 256 bytes, so that every mip
                        // begins at a multiple of that.
                        end = end.saturating_add(pitch.saturating_mul(rows));
                        MipLayout {
                            offset,
                            pitch,
                            row: size.width as usize * desc.format.texel_bytes() as usize,
                            rows,
                        }
                    })
                    .collect();
                (Layout::Texture { desc, mips }, end)
            }
        };
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let buffer = gpu.buffer(step, bytes, usage, None)?;
        Ok(Self { buffer, layout })
    }

    /// Records the copy.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        source: &Physical,
        range: Subresources,
    ) {
        match (&self.layout, source) {
            (Layout::Buffer { bytes }, Physical::Buffer(source)) => {
                encoder.copy_buffer_to_buffer(source, 0, &self.buffer, 0, *bytes);
            }
            (Layout::Texture { desc, mips }, source) => {
                let Some(part) = source.texture() else { return };
                for (mip, layout) in (0..).zip(mips) {
                    let size = convert::extent(desc, mip);
                    encoder.copy_texture_to_buffer(
                        part.origin(range.mip + mip, 0, range.layer),
                        wgpu::TexelCopyBufferInfo {
                            buffer: &self.buffer,
                            layout: wgpu::TexelCopyBufferLayout {
                                offset: layout.offset,
                                bytes_per_row: u32::try_from(layout.pitch).ok(),
                                rows_per_image: Some(size.height),
                            },
                        },
                        size,
                    );
                }
            }
            _ => {}
        }
    }

    /// Asks for the bytes; they can be read once the device was waited for.
    pub(crate) fn map<'a>(&'a self, gpu: &'a Gpu) -> Mapped<'a> {
        Mapped::new(gpu, &self.buffer)
    }

    /// What was copied, without the padding.
    pub(crate) fn read(&self, mapped: Mapped<'_>) -> Result<CapturedData, BackendError> {
        let what = "a copy for the host";
        match &self.layout {
            Layout::Buffer { bytes } => mapped.read(what, |mapped| {
                let length = (*bytes as usize).min(mapped.len());
                host_copy(what, std::iter::once(&mapped[..length]), length)
                    .map(CapturedData::Buffer)
            })?,
            Layout::Texture { desc, mips } => {
                let length = mips
                    .iter()
                    .fold(0_u64, |sum, mip| sum + mip.row as u64 * mip.rows)
                    as usize;
                let bytes = mapped.read(what, |mapped| {
                    let rows = mips.iter().flat_map(|mip| {
                        (0..mip.rows).filter_map(|row| {
                            let start = (mip.offset + row * mip.pitch) as usize;
                            mapped.get(start..start + mip.row)
                        })
                    });
                    host_copy(what, rows, length)
                })??;
                let image =
                    ImageData::from_bytes(*desc, bytes).map_err(|error| BackendError::Api {
                        call: "map",
                        reason: error.to_string(),
                    })?;
                Ok(CapturedData::Texture(image))
            }
        }
    }
}

/// The pieces joined, if the host has the memory.
fn host_copy<'a>(
    what: &str,
    pieces: impl Iterator<Item = &'a [u8]>,
    length: usize,
) -> Result<Vec<u8>, BackendError> {
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(length)
        .map_err(|_| BackendError::OutOfMemory {
            what: what.to_owned(),
            bytes: length as u64,
        })?;
    for piece in pieces {
        bytes.extend_from_slice(piece);
    }
    Ok(bytes)
}

/// A buffer that is being mapped. Unmapped when dropped, also if it is never read.
#[derive(Debug)]
pub(crate) struct Mapped<'a> {
    gpu: &'a Gpu,
    buffer: &'a wgpu::Buffer,
    done: Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl<'a> Mapped<'a> {
    pub(crate) fn new(gpu: &'a Gpu, buffer: &'a wgpu::Buffer) -> Self {
        let (send, done) = channel();
        // Whatever is wrong also reaches the callback, or drops it.
        let _ = gpu.guarded(|| {
            buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                // The receiver may have given up.
                let _ = send.send(result);
            });
        });
        Self { gpu, buffer, done }
    }

    /// Reads what is mapped, after the device was waited for.
    pub(crate) fn read<T>(
        &self,
        what: &str,
        read: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, BackendError> {
        let fail = |reason: String| BackendError::Api {
            call: "map_async",
            reason: format!("{what}: {reason}"),
        };
        match self.done.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(fail(error.to_string())),
            Err(error) => return Err(fail(error.to_string())),
        }
        let view = self
            .buffer
            .get_mapped_range(..)
            .map_err(|error| fail(error.to_string()))?;
        Ok(read(&view))
    }
}

impl Drop for Mapped<'_> {
    fn drop(&mut self) {
        // Refused if it was never mapped, which is as good.
        let _ = self.gpu.guarded(|| self.buffer.unmap());
    }
}

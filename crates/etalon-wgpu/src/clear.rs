//! Filling textures with one value.
//!
//! wgpu's own `clear_texture` knows zero only and needs a feature; a kernel
//! would need storage access, which many formats lack. So colours are copied
//! from a small buffer that holds the value over and over, band by band: that
//! works for every format, and stores exactly the bits that
//! [`Format::encode`] gives. Float depth cannot be copied to from a buffer in
//! WebGPU and is cleared by render passes that draw nothing.

use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::graph::{ClearValue, Subresources};
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;

use crate::bind::{PerPhysical, Physical, TexturePart};
use crate::convert;
use crate::depth;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::tally::Owned;

/// Bytes that the buffer of a band should not exceed, unless one row does.
const BAND: u64 = 1 << 18;

/// Rows of copies between buffers and textures begin at multiples of this.
pub(crate) const ROW_ALIGNMENT: u64 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as u64;

/// A clear, ready to be recorded for any texture of one shape.
#[derive(Debug)]
pub(crate) enum Clear {
    /// By copies from a buffer of repeated texels.
    Colour(Owned<wgpu::Buffer>),
    /// By render passes.
    Depth {
        value: f32,
        views: PerPhysical<Vec<wgpu::TextureView>>,
    },
}

impl Clear {
    /// Prepares to fill a range of textures of the given shape.
    pub(crate) fn new(
        gpu: &Gpu,
        step: &str,
        desc: &TextureDesc,
        range: Subresources,
        value: ClearValue,
    ) -> Result<Self, BackendError> {
        let texel = match value {
            ClearValue::Float(value) => Texel::Float(value),
            ClearValue::Sint(value) => Texel::Sint(value),
            ClearValue::Uint(value) => Texel::Uint(value),
        };
        if desc.format == Format::Depth32Float {
            let Texel::Float([value, ..]) = texel else {
                return Err(unsupported(step, "a clear of depth to an integer"));
            };
            depth::check(value).map_err(|what| unsupported(step, what))?;
            return Ok(Self::Depth {
                value,
                views: PerPhysical::default(),
            });
        }
        let size = convert::copy_extent(desc, range.mip, range);
        let pitch = pitch(desc.format, size.width);
        let layer = pitch.saturating_mul(size.height.into());
        let bytes = if desc.format == Format::Depth16Unorm {
            // Depth is copied by whole layers only.
            layer
        } else {
            layer
                .saturating_mul(size.depth_or_array_layers.into())
                .min(BAND.max(pitch))
        };
        // A row's alignment is a multiple of every texel's size, so that a
        // buffer of repeated texels has the right one wherever a row begins.
        let mut texels = vec![0; ROW_ALIGNMENT as usize];
        for bytes in texels.chunks_exact_mut(desc.format.texel_bytes() as usize) {
            desc.format.encode(texel, bytes);
        }
        let buffer = gpu.buffer(step, bytes, wgpu::BufferUsages::COPY_SRC, Some(&texels))?;
        Ok(Self::Colour(buffer))
    }

    /// Makes what recording for this texture needs.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        step: &str,
        target: &Physical,
        range: Subresources,
    ) -> Result<(), BackendError> {
        match (self, target.texture()) {
            (Self::Depth { views, .. }, Some(part)) => {
                views.select(std::iter::once(target), || {
                    depth::views(gpu, step, part, range)
                })?;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Forgets the textures it was prepared for.
    pub(crate) fn trim(&mut self) {
        if let Self::Depth { views, .. } = self {
            *views = PerPhysical::default();
        }
    }

    /// Records the clear.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        desc: &TextureDesc,
        target: TexturePart<'_>,
        range: Subresources,
    ) {
        match self {
            Self::Depth { value, views } => {
                for view in views.selected().into_iter().flatten() {
                    depth::clear(encoder, view, *value);
                }
            }
            Self::Colour(buffer) => {
                for mip in range.mip..range.mip + range.mips {
                    clear_mip(encoder, buffer, desc, target, range, mip);
                }
            }
        }
    }
}

/// Bytes from one row to the next in a buffer that is copied from or to.
pub(crate) fn pitch(format: Format, width: u32) -> u64 {
    (u64::from(width) * u64::from(format.texel_bytes())).next_multiple_of(ROW_ALIGNMENT)
}

/// Copies one mip from the buffer, as many rows or layers at a time as it has.
fn clear_mip(
    encoder: &mut wgpu::CommandEncoder,
    buffer: &wgpu::Buffer,
    desc: &TextureDesc,
    target: TexturePart<'_>,
    range: Subresources,
    mip: u32,
) {
    let size = convert::copy_extent(desc, mip, range);
    let pitch = pitch(desc.format, size.width);
    // A buffer holds at least a row of the largest mip.
    let rows = u32::try_from(buffer.size() / pitch)
        .unwrap_or(u32::MAX)
        .max(1);
    let (band, slices) = if rows >= size.height {
        (size.height, rows / size.height)
    } else {
        (rows, 1)
    };
    let end = size.depth_or_array_layers;
    for layer in (0..end).step_by(slices as usize) {
        for y in (0..size.height).step_by(band as usize) {
            let height = band.min(size.height - y);
            encoder.copy_buffer_to_texture(
                wgpu::TexelCopyBufferInfo {
                    buffer,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: u32::try_from(pitch).ok(),
                        rows_per_image: Some(height),
                    },
                },
                target.origin(mip, y, range.layer + layer),
                wgpu::Extent3d {
                    width: size.width,
                    height,
                    depth_or_array_layers: slices.min(end - layer),
                },
            );
        }
    }
}

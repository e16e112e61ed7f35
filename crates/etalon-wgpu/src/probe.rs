//! Trying out what OpenGL does not tell.
//!
//! wgpu copies from textures through framebuffers on OpenGL. Which formats a
//! framebuffer takes depends on the context and is in none of the capabilities
//! that wgpu reports (it knows OpenGL ES's rules only), and a copy that does
//! not work reports no error. So a few texels are sent around once.

use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;

use crate::clear::ROW_ALIGNMENT;
use crate::convert;
use crate::fault::Fault;
use crate::gpu::Gpu;
use crate::readback::Mapped;

const WIDTH: u32 = 3;
const HEIGHT: u32 = 2;

/// Texels that are all different and exact in every format of the kind.
fn texels(format: Format) -> Vec<u8> {
    let size = format.texel_bytes() as usize;
    let mut bytes = vec![0; size * (WIDTH * HEIGHT) as usize];
    for (index, bytes) in (0_u8..).zip(bytes.chunks_exact_mut(size)) {
        let texel = match format.sample_kind() {
            SampleKind::Float | SampleKind::Depth => {
                let x = f32::from(index + 1) / 8.0;
                let y = match format.encoding() {
                    Encoding::Snorm | Encoding::Float => -x,
                    _ => 1.0 - x,
                };
                Texel::Float([y, x, x / 2.0, 1.0])
            }
            SampleKind::Sint => {
                let x = i32::from(index) + 1;
                Texel::Sint([x, -x, 10 * x, 100])
            }
            SampleKind::Uint => {
                let x = u32::from(index) + 1;
                Texel::Uint([x, 2 * x, 10 * x, 100])
            }
        };
        format.encode(texel, bytes);
    }
    bytes
}

/// Whether texels of a format survive an upload, a copy to another texture and
/// the way back.
pub(crate) fn copies(gpu: &Gpu, format: Format) -> bool {
    let Some((raw, _)) = gpu.format(format) else {
        return false;
    };
    attempt(gpu, format, raw).unwrap_or(false)
}

fn attempt(gpu: &Gpu, format: Format, raw: wgpu::TextureFormat) -> Option<bool> {
    let desc = TextureDesc::d2(WIDTH, HEIGHT, format);
    let size = convert::extent(&desc, 0);
    let texels = texels(format);
    let usage = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST;
    let texture = || gpu.texture("etalon probe", &desc, raw, usage).ok();
    let (first, second) = (texture()?, texture()?);
    let readable = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let bytes = ROW_ALIGNMENT * u64::from(HEIGHT);
    let buffer = gpu.buffer("etalon probe", bytes, readable, None).ok()?;
    let row = WIDTH * format.texel_bytes();
    let recorded: Result<(), Fault> = gpu.guarded(|| {
        gpu.queue.write_texture(
            first.as_image_copy(),
            &texels,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row),
                rows_per_image: None,
            },
            size,
        );
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_texture(first.as_image_copy(), second.as_image_copy(), size);
        encoder.copy_texture_to_buffer(
            second.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: u32::try_from(ROW_ALIGNMENT).ok(),
                    rows_per_image: None,
                },
            },
            size,
        );
        gpu.queue.submit([encoder.finish()]);
    });
    recorded.ok()?;
    let mapped = Mapped::new(gpu, &buffer);
    gpu.wait().ok()?;
    let rows = texels.chunks_exact(row as usize);
    mapped
        .read("probe", |bytes| {
            bytes
                .chunks(ROW_ALIGNMENT as usize)
                .zip(rows)
                .all(|(bytes, row)| bytes.starts_with(row))
        })
        .ok()
}

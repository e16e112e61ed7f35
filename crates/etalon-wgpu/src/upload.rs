//! Images and bytes from the host into the textures and buffers that stand for
//! imports when no engine gives its own.

use etalon_core::Format;
use etalon_core::backend::{BackendError, Inputs};
use etalon_core::graph::ResourceDesc;
use etalon_core::image::ImageData;
use etalon_core::plan::PlannedResource;
use etalon_core::resource::TextureDesc;

use crate::check::{check_buffer_copy, check_texture};
use crate::convert;
use crate::depth::{self, DepthUpload};
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::tally::Owned;

/// What stands for an import.
#[derive(Debug)]
pub(crate) enum Import {
    /// A texture that can be written to.
    Colour(Owned<wgpu::Texture>, TextureDesc),
    /// A texture that can only be rendered to.
    Depth(Owned<wgpu::Texture>, TextureDesc, DepthUpload),
    /// A buffer.
    Buffer(Owned<wgpu::Buffer>, u64),
}

/// What an import is to hold.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Contents<'a> {
    /// Of a texture.
    Image(&'a ImageData),
    /// Of a buffer.
    Bytes(&'a [u8]),
}

/// A description in words.
pub(crate) fn describe(desc: &ResourceDesc) -> String {
    match desc {
        ResourceDesc::Buffer(desc) => format!("a buffer of {} bytes", desc.bytes),
        ResourceDesc::Texture(desc) => format!(
            "a {:?} texture {}×{}×{} of {} with {} mips",
            desc.dimension,
            desc.extent.width,
            desc.extent.height,
            desc.extent.depth_or_layers,
            desc.format,
            desc.mips
        ),
    }
}

impl Import {
    /// Makes what stands for an import.
    pub(crate) fn new(gpu: &Gpu, resource: &PlannedResource) -> Result<Self, BackendError> {
        let name = &resource.name;
        let step = format!("upload of `{name}`");
        match &resource.desc {
            ResourceDesc::Buffer(desc) => {
                let usages = convert::buffer_usages(resource.usages) | wgpu::BufferUsages::COPY_DST;
                let buffer = gpu.buffer(name, desc.bytes, usages, None)?;
                Ok(Self::Buffer(buffer, desc.bytes))
            }
            ResourceDesc::Texture(desc) => {
                let render = desc.format == Format::Depth32Float;
                let usages = convert::texture_usages(resource.usages, desc.format)
                    | if render {
                        wgpu::TextureUsages::RENDER_ATTACHMENT
                    } else {
                        wgpu::TextureUsages::COPY_DST
                    };
                let checked = check_texture(gpu, desc, usages).and_then(|()| {
                    if render && gpu.is_gl() && desc.layers() > 1 {
                        // Layers are loaded from views of one each.
                        Err(format!("{} layers of {}", desc.layers(), desc.format))
                    } else if render {
                        Ok(())
                    } else {
                        check_buffer_copy(gpu, desc, false)
                    }
                });
                checked.map_err(|what| unsupported(&step, what))?;
                let (format, _) = gpu
                    .format(desc.format)
                    .ok_or_else(|| unsupported(&step, desc.format.name()))?;
                let texture = gpu.texture(name, desc, format, usages)?;
                Ok(if render {
                    let upload = DepthUpload::new(gpu, name, desc, &texture)?;
                    Self::Depth(texture, *desc, upload)
                } else {
                    Self::Colour(texture, *desc)
                })
            }
        }
    }

    /// Finds the contents among the inputs and holds them against the plan.
    pub(crate) fn check<'i>(
        &self,
        name: &str,
        inputs: &Inputs<'i>,
    ) -> Result<Contents<'i>, BackendError> {
        let missing = || BackendError::MissingInput {
            name: name.to_owned(),
        };
        let differs = |given: String, wanted: String| BackendError::InputMismatch {
            name: name.to_owned(),
            given,
            wanted,
        };
        let (Self::Colour(_, desc) | Self::Depth(_, desc, _)) = self else {
            let given = *inputs.buffers.get(name).ok_or_else(missing)?;
            let Self::Buffer(_, bytes) = self else {
                return Err(missing());
            };
            if given.len() as u64 != *bytes {
                return Err(differs(
                    format!("{} bytes", given.len()),
                    format!("{bytes} bytes"),
                ));
            }
            return Ok(Contents::Bytes(given));
        };
        let image = *inputs.textures.get(name).ok_or_else(missing)?;
        if image.desc != *desc {
            return Err(differs(
                describe(&ResourceDesc::Texture(image.desc)),
                describe(&ResourceDesc::Texture(*desc)),
            ));
        }
        let bytes = desc.bytes().unwrap_or(u64::MAX);
        if image.bytes.len() as u64 != bytes {
            return Err(differs(
                format!("{} bytes of texels", image.bytes.len()),
                format!("{bytes} bytes of texels"),
            ));
        }
        if matches!(self, Self::Depth(..)) {
            depth::check_image(image)
                .map_err(|given| differs(given, "depths from 0 to 1".to_owned()))?;
        }
        Ok(Contents::Image(image))
    }

    /// Schedules contents that were checked to be written before the encoder's
    /// commands.
    pub(crate) fn write(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        name: &str,
        contents: Contents<'_>,
    ) -> Result<(), BackendError> {
        match (self, contents) {
            (Self::Buffer(buffer, bytes), Contents::Bytes(given)) => gpu
                .guarded(|| gpu.queue.write_buffer(buffer, 0, given))
                .map_err(|fault| fault.of("write_buffer", name, *bytes)),
            (Self::Colour(texture, _), Contents::Image(image)) => {
                write_texture(gpu, name, texture, image)
            }
            (Self::Depth(_, _, upload), Contents::Image(image)) => {
                write_texture(gpu, name, upload.staging(), image)?;
                gpu.guarded(|| upload.record(encoder))
                    .map_err(|fault| fault.of("write_texture", name, image.bytes.len() as u64))
            }
            _ => Ok(()),
        }
    }
}

/// Schedules an image to be written to a texture of its shape.
fn write_texture(
    gpu: &Gpu,
    name: &str,
    texture: &wgpu::Texture,
    image: &ImageData,
) -> Result<(), BackendError> {
    gpu.guarded(|| {
        for mip in 0..image.desc.mips {
            let size = convert::extent(&image.desc, mip);
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: mip,
                    origin: wgpu::Origin3d::ZERO,
                    aspect: wgpu::TextureAspect::All,
                },
                image.mip(mip).unwrap_or_default(),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: size.width.checked_mul(image.desc.format.texel_bytes()),
                    rows_per_image: Some(size.height),
                },
                size,
            );
        }
    })
    .map_err(|fault| fault.of("write_texture", name, image.bytes.len() as u64))
}

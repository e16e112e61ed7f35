//! What an engine has: textures and buffers in their states, and what a
//! recording leaves behind.
//!
//! # States
//! A plan finds imports *at rest* and leaves imports and outputs so: textures in
//! `SHADER_READ_ONLY_OPTIMAL`, with all writes visible to sampled reads by
//! compute shaders; buffers visible to storage reads by compute shaders. That
//! is so of plans that draw as well: they make it visible to their other
//! shaders themselves, and wait for those before they end.
//! [`TextureState::REST`] and [`BufferState::REST`] say just that. A binding
//! in any other state says so, and is taken from there before the first step
//! and back after the last.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::resource::TextureDesc;

use crate::buffer::Buffer;
use crate::device::Device;
use crate::image::Image;
use crate::{Resource, convert};

/// The layout a texture is in, and by whom it was or will be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureState {
    /// Layout of all mips and layers.
    pub layout: vk::ImageLayout,
    /// Stages that used it last, or will next.
    pub stages: vk::PipelineStageFlags2,
    /// Their accesses.
    pub access: vk::AccessFlags2,
}

impl TextureState {
    /// At rest: sampled by compute shaders.
    pub const REST: Self = Self {
        layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
        stages: vk::PipelineStageFlags2::COMPUTE_SHADER,
        access: vk::AccessFlags2::SHADER_SAMPLED_READ,
    };

    /// Sampled by fragment shaders, which is what a plan's output often is next.
    pub const FRAGMENT_SAMPLED: Self = Self {
        layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
        stages: vk::PipelineStageFlags2::FRAGMENT_SHADER,
        access: vk::AccessFlags2::SHADER_SAMPLED_READ,
    };

    /// Drawn to, which is what a plan's input often was before.
    pub const COLOR_ATTACHMENT: Self = Self {
        layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        stages: vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        access: vk::AccessFlags2::from_raw(
            vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw(),
        ),
    };
}

impl Default for TextureState {
    fn default() -> Self {
        Self::REST
    }
}

/// By whom a buffer was or will be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferState {
    /// Stages that used it last, or will next.
    pub stages: vk::PipelineStageFlags2,
    /// Their accesses.
    pub access: vk::AccessFlags2,
}

impl BufferState {
    /// At rest: read by compute shaders.
    pub const REST: Self = Self {
        stages: vk::PipelineStageFlags2::COMPUTE_SHADER,
        access: vk::AccessFlags2::SHADER_STORAGE_READ,
    };
}

impl Default for BufferState {
    fn default() -> Self {
        Self::REST
    }
}

/// An engine's image, to be made known with
/// [`AshBackend::adopt_texture`](crate::AshBackend::adopt_texture).
#[derive(Clone, Copy, Debug)]
pub struct AdoptedTexture {
    /// The image: optimally tiled, of one sample, cubes with
    /// `VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT`.
    pub image: vk::Image,
    /// Its shape and format.
    pub desc: TextureDesc,
    /// What it was made for.
    pub usage: vk::ImageUsageFlags,
}

/// Part of an engine's buffer, to be made known with
/// [`AshBackend::adopt_buffer`](crate::AshBackend::adopt_buffer).
#[derive(Clone, Copy, Debug)]
pub struct AdoptedBuffer {
    /// The buffer.
    pub buffer: vk::Buffer,
    /// Where in it the part begins: a multiple of
    /// `minStorageBufferOffsetAlignment` and of 4.
    pub offset: u64,
    /// Bytes of the part, a multiple of 4.
    pub bytes: u64,
    /// What it was made for.
    pub usage: vk::BufferUsageFlags,
}

/// An engine's image, known to a backend.
///
/// It keeps the views of the image that plans need. Make it once for each
/// image, not once for each frame, and drop it before the image is destroyed.
#[derive(Clone)]
pub struct AshTexture {
    pub(crate) image: Arc<Image>,
    pub(crate) device: Arc<Device>,
}

impl AshTexture {
    /// Its shape and format.
    #[must_use]
    pub fn desc(&self) -> TextureDesc {
        self.image.desc
    }
}

impl std::fmt::Debug for AshTexture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AshTexture")
            .field("image", &self.image.raw)
            .field("desc", &self.image.desc)
            .finish_non_exhaustive()
    }
}

/// An engine's buffer, known to a backend.
#[derive(Clone)]
pub struct AshBuffer {
    pub(crate) buffer: Arc<Buffer>,
    pub(crate) device: Arc<Device>,
}

impl std::fmt::Debug for AshBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AshBuffer")
            .field("buffer", &self.buffer.raw)
            .field("offset", &self.buffer.offset)
            .field("bytes", &self.buffer.bytes)
            .finish_non_exhaustive()
    }
}

impl From<BufferState> for TextureState {
    /// A buffer has no layout; the one here means nothing.
    fn from(state: BufferState) -> Self {
        Self {
            layout: vk::ImageLayout::UNDEFINED,
            stages: state.stages,
            access: state.access,
        }
    }
}

/// A texture that a recording leaves behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputTexture {
    /// The image, the engine's or the backend's.
    pub image: vk::Image,
    /// A view of all of it.
    pub view: vk::ImageView,
    /// Its shape and format.
    pub desc: TextureDesc,
    /// The state it is left in.
    pub state: TextureState,
}

/// A buffer that a recording leaves behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputBuffer {
    /// The buffer, the engine's or the backend's.
    pub buffer: vk::Buffer,
    /// Where in it the output begins.
    pub offset: u64,
    /// Its size.
    pub bytes: u64,
    /// The state it is left in.
    pub state: BufferState,
}

/// What a recording leaves behind, by name of the output.
///
/// What belongs to the backend holds its contents until the next recording of
/// a plan of the same structure, and is destroyed when the backend lets go of
/// that plan: after as many plans of other structures as it keeps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AshOutputs {
    /// Textures.
    pub textures: BTreeMap<String, OutputTexture>,
    /// Buffers.
    pub buffers: BTreeMap<String, OutputBuffer>,
}

impl AshOutputs {
    pub(crate) fn add(
        &mut self,
        names: &[String],
        resource: &Resource,
        state: TextureState,
    ) -> Result<(), BackendError> {
        match resource {
            Resource::Texture(image) => {
                let output = OutputTexture {
                    image: image.raw,
                    view: image.view(
                        convert::whole(&image.desc),
                        convert::whole_view_type(&image.desc),
                    )?,
                    desc: image.desc,
                    state,
                };
                for name in names {
                    self.textures.insert(name.clone(), output);
                }
            }
            Resource::Buffer(buffer) => {
                let output = OutputBuffer {
                    buffer: buffer.raw,
                    offset: buffer.offset,
                    bytes: buffer.bytes,
                    state: BufferState {
                        stages: state.stages,
                        access: state.access,
                    },
                };
                for name in names {
                    self.buffers.insert(name.clone(), output);
                }
            }
        }
        Ok(())
    }
}

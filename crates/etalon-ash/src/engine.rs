//! What an engine gives a recording, and gets back from it.
//!
//! # States
//! A plan finds imports *at rest* and leaves imports and outputs so: textures in
//! `SHADER_READ_ONLY_OPTIMAL`, with all writes visible to sampled reads by
//! compute shaders; buffers visible to storage reads by compute shaders.
//! [`TextureState::REST`] and [`BufferState::REST`] say just that. A binding
//! in any other state says so, and is taken from there before the first step
//! and back after the last.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::plan::{PlannedResource, Usage};
use etalon_core::resource::{BufferDesc, TextureDesc};

use crate::buffer::Buffer;
use crate::commands::{Barriers, Transition};
use crate::device::Device;
use crate::image::Image;
use crate::{Resource, convert, usage};

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

/// A texture, the state it arrives in and the one to leave it in.
#[derive(Clone, Debug)]
struct TextureBinding<'a> {
    texture: Option<&'a AshTexture>,
    arrives: TextureState,
    returns: TextureState,
}

/// A buffer, the state it arrives in and the one to leave it in.
#[derive(Clone, Debug)]
struct BufferBinding<'a> {
    buffer: Option<&'a AshBuffer>,
    arrives: BufferState,
    returns: BufferState,
}

/// What an engine gives a recording: textures and buffers by name.
///
/// Every import of the plan must be among them. Outputs may be: one that is
/// not is written to a texture or buffer of the backend.
#[derive(Clone, Debug, Default)]
pub struct AshBindings<'a> {
    textures: BTreeMap<Cow<'a, str>, TextureBinding<'a>>,
    buffers: BTreeMap<Cow<'a, str>, BufferBinding<'a>>,
    output_textures: BTreeMap<Cow<'a, str>, TextureBinding<'a>>,
    output_buffers: BTreeMap<Cow<'a, str>, BufferBinding<'a>>,
}

impl<'a> AshBindings<'a> {
    /// No bindings.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives the texture imported under `name`, which is at rest.
    #[must_use]
    pub fn texture(self, name: impl Into<Cow<'a, str>>, texture: &'a AshTexture) -> Self {
        self.texture_in(name, texture, TextureState::REST, TextureState::REST)
    }

    /// Gives the texture imported under `name`, which arrives in one state and
    /// is to be left in another.
    #[must_use]
    pub fn texture_in(
        mut self,
        name: impl Into<Cow<'a, str>>,
        texture: &'a AshTexture,
        arrives: TextureState,
        returns: TextureState,
    ) -> Self {
        let binding = TextureBinding {
            texture: Some(texture),
            arrives,
            returns,
        };
        self.textures.insert(name.into(), binding);
        self
    }

    /// Gives the buffer imported under `name`, which is at rest.
    #[must_use]
    pub fn buffer(self, name: impl Into<Cow<'a, str>>, buffer: &'a AshBuffer) -> Self {
        self.buffer_in(name, buffer, BufferState::REST, BufferState::REST)
    }

    /// Gives the buffer imported under `name`, which arrives in one state and
    /// is to be left in another.
    #[must_use]
    pub fn buffer_in(
        mut self,
        name: impl Into<Cow<'a, str>>,
        buffer: &'a AshBuffer,
        arrives: BufferState,
        returns: BufferState,
    ) -> Self {
        let binding = BufferBinding {
            buffer: Some(buffer),
            arrives,
            returns,
        };
        self.buffers.insert(name.into(), binding);
        self
    }

    /// Has the output `name` written to an engine's texture. Its contents are
    /// not kept, so of the state it arrives in only stages and access matter.
    #[must_use]
    pub fn output_to(
        mut self,
        name: impl Into<Cow<'a, str>>,
        texture: &'a AshTexture,
        arrives: TextureState,
        returns: TextureState,
    ) -> Self {
        let binding = TextureBinding {
            texture: Some(texture),
            arrives,
            returns,
        };
        self.output_textures.insert(name.into(), binding);
        self
    }

    /// Has the output `name` left in this state, in the backend's own texture.
    #[must_use]
    pub fn output_in(mut self, name: impl Into<Cow<'a, str>>, returns: TextureState) -> Self {
        let binding = TextureBinding {
            texture: None,
            arrives: TextureState::REST,
            returns,
        };
        self.output_textures.insert(name.into(), binding);
        self
    }

    /// Has the output `name` written to an engine's buffer.
    #[must_use]
    pub fn output_to_buffer(
        mut self,
        name: impl Into<Cow<'a, str>>,
        buffer: &'a AshBuffer,
        arrives: BufferState,
        returns: BufferState,
    ) -> Self {
        let binding = BufferBinding {
            buffer: Some(buffer),
            arrives,
            returns,
        };
        self.output_buffers.insert(name.into(), binding);
        self
    }

    /// Has the output `name` left in this state, in the backend's own buffer.
    #[must_use]
    pub fn output_buffer_in(mut self, name: impl Into<Cow<'a, str>>, returns: BufferState) -> Self {
        let binding = BufferBinding {
            buffer: None,
            arrives: BufferState::REST,
            returns,
        };
        self.output_buffers.insert(name.into(), binding);
        self
    }
}

/// A resource of the plan as an engine's binding has it.
pub(crate) struct Given {
    /// `None` for an output left to the backend.
    pub(crate) resource: Option<Resource>,
    pub(crate) arrives: TextureState,
    pub(crate) returns: TextureState,
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

impl AshBindings<'_> {
    /// What is given as the import `name`.
    pub(crate) fn import(
        &self,
        device: &Arc<Device>,
        name: &str,
        planned: &PlannedResource,
    ) -> Result<Given, BackendError> {
        find(&self.textures, &self.buffers, device, name, planned)?.ok_or_else(|| {
            BackendError::MissingInput {
                name: name.to_owned(),
            }
        })
    }

    /// What is given for an output that has these names.
    pub(crate) fn output(
        &self,
        device: &Arc<Device>,
        names: &[String],
        planned: &PlannedResource,
    ) -> Result<Given, BackendError> {
        let (textures, buffers) = (&self.output_textures, &self.output_buffers);
        let mut given = None;
        for name in names {
            if let Some(found) = find(textures, buffers, device, name, planned)?
                && given.replace(found).is_some()
            {
                return Err(BackendError::InputMismatch {
                    name: name.clone(),
                    given: "given again under another of its names".to_owned(),
                    wanted: "one texture or buffer, or the backend's own".to_owned(),
                });
            }
        }
        Ok(given.unwrap_or(Given {
            resource: None,
            arrives: TextureState::REST,
            returns: TextureState::REST,
        }))
    }
}

/// Finds what is given under a name, and holds it against the plan.
fn find(
    textures: &BTreeMap<Cow<'_, str>, TextureBinding<'_>>,
    buffers: &BTreeMap<Cow<'_, str>, BufferBinding<'_>>,
    device: &Arc<Device>,
    name: &str,
    planned: &PlannedResource,
) -> Result<Option<Given>, BackendError> {
    use etalon_core::graph::ResourceDesc;
    let mismatch = |given: String, wanted: String| BackendError::InputMismatch {
        name: name.to_owned(),
        given,
        wanted,
    };
    let foreign = || {
        mismatch(
            "of another device".to_owned(),
            "this backend's device".to_owned(),
        )
    };
    let (resource, arrives, returns) = match &planned.desc {
        ResourceDesc::Texture(desc) => {
            let Some(binding) = textures.get(name) else {
                return Ok(None);
            };
            if let Some(texture) = binding.texture {
                if !Arc::ptr_eq(&texture.device, device) {
                    return Err(foreign());
                }
                let (image, flags) = (&texture.image, usage::image_flags(planned.usages));
                if image.desc != *desc {
                    return Err(mismatch(
                        convert::describe(&image.desc),
                        convert::describe(desc),
                    ));
                }
                if !image.usage.contains(flags) {
                    return Err(mismatch(
                        format!("made for {:?}", image.usage),
                        format!("{flags:?}"),
                    ));
                }
            }
            let resource = binding
                .texture
                .map(|texture| Resource::Texture(texture.image.clone()));
            (resource, binding.arrives, binding.returns)
        }
        ResourceDesc::Buffer(BufferDesc { bytes }) => {
            let Some(binding) = buffers.get(name) else {
                return Ok(None);
            };
            if let Some(given) = binding.buffer {
                if !Arc::ptr_eq(&given.device, device) {
                    return Err(foreign());
                }
                let (buffer, flags) = (&given.buffer, usage::buffer_flags(planned.usages));
                if buffer.bytes != *bytes {
                    return Err(mismatch(
                        format!("a buffer of {} bytes", buffer.bytes),
                        format!("a buffer of {bytes} bytes"),
                    ));
                }
                if !buffer.usage.contains(flags) {
                    return Err(mismatch(
                        format!("made for {:?}", buffer.usage),
                        format!("{flags:?}"),
                    ));
                }
            }
            let resource = binding
                .buffer
                .map(|given| Resource::Buffer(given.buffer.clone()));
            (resource, binding.arrives.into(), binding.returns.into())
        }
    };
    Ok(Some(Given {
        resource,
        arrives,
        returns,
    }))
}

/// The state in which a plan finds and leaves a resource.
fn rest(resource: &Resource) -> TextureState {
    let row = match resource {
        Resource::Texture(_) => usage::row(Usage::Sampled),
        Resource::Buffer(_) => usage::row(Usage::StorageRead),
    };
    TextureState {
        layout: row.layout,
        stages: row.stages,
        access: row.access,
    }
}

fn transition(from: TextureState, to: TextureState) -> Transition {
    Transition {
        source: (from.stages, from.access),
        target: (to.stages, to.access),
        layouts: (from.layout, to.layout),
    }
}

/// Whether a resource has to be taken from one state to another. The layouts
/// of buffers mean nothing.
fn differ(resource: &Resource, a: TextureState, b: TextureState) -> bool {
    (a.stages, a.access) != (b.stages, b.access)
        || (matches!(resource, Resource::Texture(_)) && a.layout != b.layout)
}

/// Adds what takes an import to rest.
pub(crate) fn arrive(barriers: &mut Barriers, resource: &Resource, from: TextureState) {
    change(barriers, resource, from, rest(resource));
}

/// Adds what takes an import or output from rest.
pub(crate) fn leave(barriers: &mut Barriers, resource: &Resource, to: TextureState) {
    change(barriers, resource, rest(resource), to);
}

fn change(barriers: &mut Barriers, resource: &Resource, from: TextureState, to: TextureState) {
    if !differ(resource, from, to) {
        return;
    }
    match resource {
        Resource::Texture(image) => {
            barriers.image(image, convert::whole(&image.desc), transition(from, to));
        }
        Resource::Buffer(buffer) => barriers.buffer(buffer, transition(from, to)),
    }
}

/// Adds what makes an output's first write wait for those who used it. Its
/// contents are not kept, so its layout does not matter.
pub(crate) fn wait(barriers: &mut Barriers, resource: &Resource, from: TextureState) {
    let rest = rest(resource);
    if (from.stages, from.access) != (rest.stages, rest.access) {
        barriers.memory((from.stages, from.access), (rest.stages, rest.access));
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

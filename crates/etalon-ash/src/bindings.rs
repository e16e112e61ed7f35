//! What an engine gives a recording, by name.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use etalon_core::backend::BackendError;
use etalon_core::graph::ResourceDesc;
use etalon_core::plan::PlannedResource;
use etalon_core::resource::BufferDesc;

use crate::device::Device;
use crate::engine::{AshBuffer, AshTexture, BufferState, TextureState};
use crate::{Resource, convert, usage};

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
#[derive(Default)]
pub(crate) struct Given {
    /// `None` for an output left to the backend.
    pub(crate) resource: Option<Resource>,
    /// `None` is at rest.
    pub(crate) arrives: Option<TextureState>,
    /// `None` is at rest.
    pub(crate) returns: Option<TextureState>,
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
        Ok(given.unwrap_or_default())
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
        arrives: Some(arrives),
        returns: Some(returns),
    }))
}

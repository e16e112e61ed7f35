//! Which texture or buffer stands for each resource, and bind groups of them.

use etalon_core::backend::BackendError;
use etalon_core::graph::Subresources;
use etalon_core::kernel::{BindingKind, Kernel};
use etalon_core::plan::{Bound, Plan};
use etalon_core::resource::SamplerDesc;

use crate::convert;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::pipeline::uniform_bytes;

/// How many bind groups are kept for each dispatch and draw of a prepared plan.
///
/// Each has one for every combination of the textures it has met: two where
/// it uses a history, times those an engine alternates between. Past this many
/// the least recently used is dropped.
pub const BIND_GROUPS_PER_STEP: usize = 8;

/// What stands for a resource of the plan in this frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Physical {
    /// The part of a texture that begins at a mip and a layer.
    Texture {
        texture: wgpu::Texture,
        mip: u32,
        layer: u32,
    },
    /// The beginning of a buffer.
    Buffer(wgpu::Buffer),
}

impl Physical {
    /// All of a texture.
    pub(crate) fn whole(texture: &wgpu::Texture) -> Self {
        Self::Texture {
            texture: texture.clone(),
            mip: 0,
            layer: 0,
        }
    }

    pub(crate) fn texture(&self) -> Option<TexturePart<'_>> {
        match self {
            Self::Texture {
                texture,
                mip,
                layer,
            } => Some(TexturePart {
                texture,
                mip: *mip,
                layer: *layer,
            }),
            Self::Buffer(_) => None,
        }
    }

    pub(crate) fn buffer(&self) -> Option<&wgpu::Buffer> {
        match self {
            Self::Buffer(buffer) => Some(buffer),
            Self::Texture { .. } => None,
        }
    }
}

/// The part of a texture that stands for a resource.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexturePart<'a> {
    pub(crate) texture: &'a wgpu::Texture,
    mip: u32,
    layer: u32,
}

impl<'a> TexturePart<'a> {
    /// A view of a range of the resource.
    pub(crate) fn view(
        &self,
        dimension: wgpu::TextureViewDimension,
        range: Subresources,
    ) -> wgpu::TextureView {
        let layered = self.texture.dimension() == wgpu::TextureDimension::D2;
        self.texture.create_view(&wgpu::TextureViewDescriptor {
            label: None,
            format: None,
            dimension: Some(dimension),
            usage: None,
            aspect: convert::aspect(self.texture.format()),
            base_mip_level: self.mip + range.mip,
            mip_level_count: Some(range.mips),
            base_array_layer: self.layer + range.layer,
            array_layer_count: layered.then_some(range.layers),
        })
    }

    /// One mip of the resource from a row and a layer (or slice) on, as copies
    /// name it.
    pub(crate) fn origin(&self, mip: u32, y: u32, layer: u32) -> wgpu::TexelCopyTextureInfo<'a> {
        wgpu::TexelCopyTextureInfo {
            texture: self.texture,
            mip_level: self.mip + mip,
            origin: wgpu::Origin3d {
                x: 0,
                y,
                z: self.layer + layer,
            },
            aspect: wgpu::TextureAspect::All,
        }
    }

    /// Whether OpenGL can view the texture so: it knows a texture only as what
    /// wgpu guesses from its shape when it is created.
    pub(crate) fn gl_views_as(&self, dimension: wgpu::TextureViewDimension) -> bool {
        use wgpu::TextureViewDimension as V;
        let size = self.texture.size();
        let layers = size.depth_or_array_layers;
        let cubic = size.width == size.height && layers.is_multiple_of(6);
        dimension
            == match self.texture.dimension() {
                wgpu::TextureDimension::D3 => V::D3,
                _ if cubic && layers == 6 => V::Cube,
                _ if cubic => V::CubeArray,
                _ if layers == 1 => V::D2,
                _ => V::D2Array,
            }
    }
}

/// Things made for particular textures and buffers, most recently used first.
#[derive(Debug)]
pub(crate) struct PerPhysical<T>(Vec<(Vec<Physical>, T)>);

impl<T> Default for PerPhysical<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> PerPhysical<T> {
    /// Puts what was made for these first; if there is none, makes it.
    pub(crate) fn select<'p, I>(
        &mut self,
        key: I,
        make: impl FnOnce() -> Result<T, BackendError>,
    ) -> Result<&T, BackendError>
    where
        I: Iterator<Item = &'p Physical> + Clone,
    {
        match self
            .0
            .iter()
            .position(|(known, _)| known.iter().eq(key.clone()))
        {
            Some(index) => self.0[..=index].rotate_right(1),
            None => {
                let made = make()?;
                self.0.truncate(BIND_GROUPS_PER_STEP - 1);
                self.0.insert(0, (key.cloned().collect(), made));
            }
        }
        Ok(&self.0[0].1)
    }

    /// What was selected last.
    pub(crate) fn selected(&self) -> Option<&T> {
        self.0.first().map(|(_, value)| value)
    }
}

/// The samplers there are.
#[derive(Debug, Default)]
pub(crate) struct Samplers(Vec<(SamplerDesc, wgpu::Sampler)>);

impl Samplers {
    /// Makes a sampler unless there is one.
    pub(crate) fn add(&mut self, gpu: &Gpu, desc: &SamplerDesc) -> Result<(), BackendError> {
        if self.get(desc).is_none() {
            let sampler = gpu
                .guarded(|| gpu.device.create_sampler(&convert::sampler(desc)))
                .map_err(|fault| fault.of("create_sampler", "a sampler", 0))?;
            self.0.push((*desc, sampler));
        }
        Ok(())
    }

    fn get(&self, desc: &SamplerDesc) -> Option<&wgpu::Sampler> {
        self.0
            .iter()
            .find(|(known, _)| known == desc)
            .map(|(_, sampler)| sampler)
    }
}

/// What a dispatch or draw binds, in the order of the kernel's bindings.
pub(crate) fn touched<'a>(
    bindings: &'a [Bound],
    physicals: &'a [Physical],
) -> impl Iterator<Item = &'a Physical> + Clone {
    bindings.iter().filter_map(|bound| match bound {
        Bound::Texture { resource, .. } | Bound::Buffer { resource } => {
            physicals.get(*resource as usize)
        }
        Bound::Uniform(_) | Bound::Sampler(_) => None,
    })
}

/// Everything a bind group is made of but the step.
pub(crate) struct BindContext<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) plan: &'a Plan,
    pub(crate) physicals: &'a [Physical],
    pub(crate) uniforms: Option<&'a wgpu::Buffer>,
    pub(crate) samplers: &'a Samplers,
}

impl BindContext<'_> {
    /// The bind group of a dispatch or draw.
    pub(crate) fn group(
        &self,
        step: &str,
        kernel: &Kernel,
        layout: &wgpu::BindGroupLayout,
        bindings: &[Bound],
    ) -> Result<wgpu::BindGroup, BackendError> {
        // Views first, since the entries borrow them.
        let mut views = Vec::with_capacity(bindings.len());
        for (binding, bound) in kernel.bindings.iter().zip(bindings) {
            views.push(self.view(step, &binding.name, &binding.kind, bound)?);
        }
        let mut entries = Vec::with_capacity(bindings.len());
        for ((binding, bound), view) in kernel.bindings.iter().zip(bindings).zip(&views) {
            let resource = match (bound, view) {
                (_, Some(view)) => wgpu::BindingResource::TextureView(view),
                (bound, None) => self.resource(bound).ok_or_else(|| BackendError::Api {
                    call: "create_bind_group",
                    reason: format!("step `{step}`: nothing stands for `{}`", binding.name),
                })?,
            };
            entries.push(wgpu::BindGroupEntry {
                binding: binding.binding,
                resource,
            });
        }
        let group = self
            .gpu
            .guarded(|| {
                self.gpu
                    .device
                    .create_bind_group(&wgpu::BindGroupDescriptor {
                        label: Some(step),
                        layout,
                        entries: &entries,
                    })
            })
            .map_err(|fault| fault.of("create_bind_group", step, 0))?;
        let binds = !entries.is_empty();
        self.gpu.tally.bind_groups.add(u64::from(binds));
        Ok(group)
    }

    fn view(
        &self,
        step: &str,
        name: &str,
        kind: &BindingKind,
        bound: &Bound,
    ) -> Result<Option<wgpu::TextureView>, BackendError> {
        let (
            Bound::Texture { resource, range },
            BindingKind::Texture { dimension, .. } | BindingKind::StorageTexture { dimension, .. },
        ) = (bound, kind)
        else {
            return Ok(None);
        };
        let Some(part) = self
            .physicals
            .get(*resource as usize)
            .and_then(Physical::texture)
        else {
            return Ok(None);
        };
        let raw = convert::view_dimension(*dimension);
        if self.gpu.is_gl() && !part.gl_views_as(raw) {
            return Err(unsupported(
                step,
                format!(
                    "a {dimension} view of `{name}`, whose texture has another shape to OpenGL"
                ),
            ));
        }
        let view = self
            .gpu
            .guarded(|| part.view(raw, *range))
            .map_err(|fault| fault.of("create_view", step, 0))?;
        self.gpu.tally.views.add(1);
        Ok(Some(view))
    }

    fn resource(&self, bound: &Bound) -> Option<wgpu::BindingResource<'_>> {
        let (buffer, offset, size) = match bound {
            Bound::Uniform(slice) => (
                self.uniforms?,
                u64::from(slice.offset),
                uniform_bytes(slice.size),
            ),
            Bound::Buffer { resource } => {
                let etalon_core::graph::ResourceDesc::Buffer(desc) =
                    self.plan.resources.get(*resource as usize)?.desc
                else {
                    return None;
                };
                let buffer = self.physicals.get(*resource as usize)?.buffer()?;
                (buffer, 0, desc.bytes)
            }
            Bound::Sampler(desc) => {
                return Some(wgpu::BindingResource::Sampler(self.samplers.get(desc)?));
            }
            Bound::Texture { .. } => return None,
        };
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer,
            offset,
            size: wgpu::BufferSize::new(size),
        }))
    }
}

//! What an engine hands over, and what it gets back.

use std::borrow::Cow;
use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::plan::{Plan, PlannedResource, ResourceKind, Usage};
use etalon_core::resource::{Dimension, TextureDesc};

use crate::bind::Physical;
use crate::check::output_names;
use crate::convert;
use crate::gpu::Gpu;
use crate::upload::describe;

/// An engine's textures and buffers for a plan's imports and outputs.
///
/// Textures are taken as they are, not as views: a plan makes the views it
/// needs. Where an import is only part of a texture, say one layer of an array,
/// [`texture_part`](Self::texture_part) says where it begins.
///
/// Each must have the format, size and usage flags that the plan needs;
/// [`WgpuBackend::record`](crate::WgpuBackend::record) checks. A depth buffer of
/// `depth24plus`, `depth24plus-stencil8` or `depth32float-stencil8` can stand
/// for a `depth32float` import that is only sampled.
///
/// Names of imports that the plan has no need for are ignored: what is culled
/// needs no input.
///
/// All must belong to the device the backend has adopted, or to another of the
/// same [`wgpu::Instance`], which is refused; wgpu cannot tell objects of
/// different instances apart. A surface's texture is a new one each frame, for
/// which new bind groups are made each time: better to write into a texture
/// that stays and draw that to the surface.
#[derive(Clone, Debug, Default)]
pub struct WgpuBindings<'a> {
    imports: BTreeMap<Cow<'a, str>, Given<'a>>,
    outputs: BTreeMap<Cow<'a, str>, Given<'a>>,
}

#[derive(Clone, Copy, Debug)]
enum Given<'a> {
    Texture {
        texture: &'a wgpu::Texture,
        mip: u32,
        layer: u32,
    },
    Buffer(&'a wgpu::Buffer),
}

impl<'a> WgpuBindings<'a> {
    /// Nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives a texture for an import.
    #[must_use]
    pub fn texture(self, name: impl Into<Cow<'a, str>>, texture: &'a wgpu::Texture) -> Self {
        self.texture_part(name, texture, 0, 0)
    }

    /// Gives the part of a texture that begins at a mip and a layer.
    #[must_use]
    pub fn texture_part(
        mut self,
        name: impl Into<Cow<'a, str>>,
        texture: &'a wgpu::Texture,
        mip: u32,
        layer: u32,
    ) -> Self {
        let given = Given::Texture {
            texture,
            mip,
            layer,
        };
        self.imports.insert(name.into(), given);
        self
    }

    /// Gives a buffer for an import; it may be larger than the plan needs.
    #[must_use]
    pub fn buffer(mut self, name: impl Into<Cow<'a, str>>, buffer: &'a wgpu::Buffer) -> Self {
        self.imports.insert(name.into(), Given::Buffer(buffer));
        self
    }

    /// Has an output written into the engine's texture instead of one of the
    /// backend's.
    #[must_use]
    pub fn output(self, name: impl Into<Cow<'a, str>>, texture: &'a wgpu::Texture) -> Self {
        self.output_part(name, texture, 0, 0)
    }

    /// Has an output written into the part of a texture that begins at a mip
    /// and a layer.
    #[must_use]
    pub fn output_part(
        mut self,
        name: impl Into<Cow<'a, str>>,
        texture: &'a wgpu::Texture,
        mip: u32,
        layer: u32,
    ) -> Self {
        let given = Given::Texture {
            texture,
            mip,
            layer,
        };
        self.outputs.insert(name.into(), given);
        self
    }

    /// Has an output written into the engine's buffer.
    #[must_use]
    pub fn output_buffer(
        mut self,
        name: impl Into<Cow<'a, str>>,
        buffer: &'a wgpu::Buffer,
    ) -> Self {
        self.outputs.insert(name.into(), Given::Buffer(buffer));
        self
    }

    /// Holds everything given against the plan. The result has an entry for
    /// each resource of the plan: every import, and the outputs that are given.
    pub(crate) fn resolve(
        &self,
        gpu: &Gpu,
        plan: &Plan,
    ) -> Result<Vec<Option<Physical>>, BackendError> {
        for name in self.outputs.keys() {
            if plan.output(name).is_none() {
                return Err(BackendError::InputMismatch {
                    name: name.to_string(),
                    given: "something to be written".to_owned(),
                    wanted: format!("these outputs: {}", output_names(plan)),
                });
            }
        }
        let mut resolved: Vec<Option<Physical>> = Vec::with_capacity(plan.resources.len());
        for resource in &plan.resources {
            resolved.push(match &resource.kind {
                ResourceKind::Import(name) => {
                    let given = self.imports.get(name.as_str());
                    let given =
                        given.ok_or_else(|| BackendError::MissingInput { name: name.clone() })?;
                    Some(physical(gpu, name, resource, *given)?)
                }
                ResourceKind::Output(names) => {
                    let mut chosen: Option<Physical> = None;
                    for name in names {
                        let Some(given) = self.outputs.get(name.as_str()) else {
                            continue;
                        };
                        let physical = physical(gpu, name, resource, *given)?;
                        if chosen.as_ref().is_some_and(|chosen| *chosen != physical) {
                            return Err(BackendError::InputMismatch {
                                name: name.clone(),
                                given: "a texture or buffer of its own".to_owned(),
                                wanted: format!("one for all of {names:?}, which are one resource"),
                            });
                        }
                        chosen = Some(physical);
                    }
                    chosen
                }
                _ => None,
            });
        }
        check_overlaps(plan, &resolved)?;
        Ok(resolved)
    }
}

/// What stands for a resource, if it suits.
fn physical(
    gpu: &Gpu,
    name: &str,
    resource: &PlannedResource,
    given: Given<'_>,
) -> Result<Physical, BackendError> {
    let differs = |given: String, wanted: String| BackendError::InputMismatch {
        name: name.to_owned(),
        given,
        wanted,
    };
    match (given, &resource.desc) {
        (Given::Buffer(buffer), ResourceDesc::Buffer(desc)) => {
            if buffer.size() < desc.bytes {
                return Err(differs(
                    format!("a buffer of {} bytes", buffer.size()),
                    format!("at least {} bytes", desc.bytes),
                ));
            }
            let wanted = convert::buffer_usages(resource.usages);
            if !buffer.usage().contains(wanted) {
                return Err(differs(
                    format!("a buffer for {:?}", buffer.usage()),
                    format!("{wanted:?}"),
                ));
            }
            Ok(Physical::Buffer(buffer.clone()))
        }
        (
            Given::Texture {
                texture,
                mip,
                layer,
            },
            ResourceDesc::Texture(desc),
        ) => {
            check_texture(gpu, resource, desc, texture, mip, layer)
                .map_err(|(given, wanted)| differs(given, wanted))?;
            Ok(Physical::Texture {
                texture: texture.clone(),
                mip,
                layer,
            })
        }
        (Given::Buffer(_), wanted) => Err(differs("a buffer".to_owned(), describe(wanted))),
        (Given::Texture { .. }, wanted) => Err(differs("a texture".to_owned(), describe(wanted))),
    }
}

/// Whether an engine's texture is what the plan was made for; what it is and
/// what it ought to be otherwise.
fn check_texture(
    gpu: &Gpu,
    resource: &PlannedResource,
    desc: &TextureDesc,
    texture: &wgpu::Texture,
    mip: u32,
    layer: u32,
) -> Result<(), (String, String)> {
    let wanted = gpu.format(desc.format).map(|(format, _)| format);
    let only_sampled = resource.usages.iter().all(|usage| usage == Usage::Sampled);
    let suits = wanted.is_some_and(|wanted| {
        texture.format() == wanted || (only_sampled && convert::reads_as(texture.format(), wanted))
    });
    if !suits {
        return Err((
            format!("a texture of {:?}", texture.format()),
            desc.format.to_string(),
        ));
    }
    if texture.sample_count() != 1 {
        return Err((
            format!("a texture with {} samples", texture.sample_count()),
            "one sample; resolve it first".to_owned(),
        ));
    }
    let whole = texture.size();
    let shrink = |size: u32| size.checked_shr(mip).unwrap_or(0).max(1);
    let deep = texture.dimension() == wgpu::TextureDimension::D3;
    let depth = if deep {
        shrink(whole.depth_or_array_layers)
    } else {
        whole.depth_or_array_layers.saturating_sub(layer)
    };
    let size = desc.extent;
    let depth_suits = if deep {
        depth == size.depth_or_layers && layer == 0
    } else {
        depth >= size.depth_or_layers
    };
    let mips = texture.mip_level_count().saturating_sub(mip);
    if texture.dimension() != convert::texture_dimension(desc.dimension)
        || (shrink(whole.width), shrink(whole.height)) != (size.width, size.height)
        || !depth_suits
        || mips < desc.mips
    {
        return Err((
            format!(
                "a {:?} texture {}×{}×{depth} with {mips} mips (from mip {mip}, layer {layer} on)",
                texture.dimension(),
                shrink(whole.width),
                shrink(whole.height),
            ),
            describe(&ResourceDesc::Texture(*desc)),
        ));
    }
    let wanted = convert::texture_usages(resource.usages, desc.format);
    if !texture.usage().contains(wanted) {
        return Err((
            format!("a texture for {:?}", texture.usage()),
            format!("{wanted:?}"),
        ));
    }
    Ok(())
}

/// Refuses one texture or buffer for two resources, unless both are only ever
/// sampled (or, for buffers, read): a plan's order knows nothing of it.
fn check_overlaps(plan: &Plan, resolved: &[Option<Physical>]) -> Result<(), BackendError> {
    let given: Vec<(&PlannedResource, &Physical)> = plan
        .resources
        .iter()
        .zip(resolved)
        .filter_map(|(resource, physical)| Some((resource, physical.as_ref()?)))
        .collect();
    for (index, (first, a)) in given.iter().enumerate() {
        for (second, b) in &given[index + 1..] {
            let harmless = match a {
                Physical::Buffer(_) => first
                    .usages
                    .union(second.usages)
                    .iter()
                    .all(|usage| !usage.writes()),
                Physical::Texture { .. } => first
                    .usages
                    .union(second.usages)
                    .iter()
                    .all(|usage| usage == Usage::Sampled),
            };
            if !harmless && overlap(first, a, second, b) {
                return Err(BackendError::InputMismatch {
                    name: second.name.clone(),
                    given: format!("what `{}` is given too", first.name),
                    wanted: "one of its own, since it is written or copied".to_owned(),
                });
            }
        }
    }
    Ok(())
}

/// Whether two resources share texels or bytes.
fn overlap(first: &PlannedResource, a: &Physical, second: &PlannedResource, b: &Physical) -> bool {
    let part = |resource: &PlannedResource, physical: &Physical| match (&resource.desc, physical) {
        (ResourceDesc::Texture(desc), Physical::Texture { mip, layer, .. }) => Subresources {
            mip: *mip,
            mips: desc.mips,
            layer: *layer,
            layers: desc.layers(),
        },
        _ => Subresources::ALL,
    };
    let meet = |a: u32, n: u32, b: u32, m: u32| {
        u64::from(a) < u64::from(b) + u64::from(m) && u64::from(b) < u64::from(a) + u64::from(n)
    };
    match (a, b) {
        (Physical::Buffer(a), Physical::Buffer(b)) => a == b,
        (Physical::Texture { texture: x, .. }, Physical::Texture { texture: y, .. }) => {
            let (p, q) = (part(first, a), part(second, b));
            x == y
                && meet(p.mip, p.mips, q.mip, q.mips)
                && meet(p.layer, p.layers, q.layer, q.layers)
        }
        _ => false,
    }
}

/// An output, as it will be once the encoder's commands have run.
#[derive(Clone, Debug)]
pub enum WgpuOutput {
    /// A texture.
    Texture {
        /// The texture, the engine's if it gave one.
        texture: wgpu::Texture,
        /// A view of all its mips and layers (of the part given, if it was
        /// one): 2D, 2D array, cube, cube array or 3D after its shape.
        view: wgpu::TextureView,
    },
    /// A buffer, the engine's if it gave one.
    Buffer(wgpu::Buffer),
}

/// The outputs of a recorded plan by name.
///
/// Textures and buffers of the backend's own belong to the plan: the next
/// recording of a plan of the same structure writes over them. Outputs that are
/// an import or a history as it is are not among them.
#[derive(Clone, Debug, Default)]
pub struct WgpuOutputs(pub(crate) Vec<(String, WgpuOutput)>);

impl WgpuOutputs {
    /// The output of the given name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&WgpuOutput> {
        self.0
            .iter()
            .find(|(candidate, _)| candidate == name)
            .map(|(_, output)| output)
    }

    /// The view of the texture of the given name.
    #[must_use]
    pub fn view(&self, name: &str) -> Option<&wgpu::TextureView> {
        match self.get(name)? {
            WgpuOutput::Texture { view, .. } => Some(view),
            WgpuOutput::Buffer(_) => None,
        }
    }

    /// The texture of the given name.
    #[must_use]
    pub fn texture(&self, name: &str) -> Option<&wgpu::Texture> {
        match self.get(name)? {
            WgpuOutput::Texture { texture, .. } => Some(texture),
            WgpuOutput::Buffer(_) => None,
        }
    }

    /// The buffer of the given name.
    #[must_use]
    pub fn buffer(&self, name: &str) -> Option<&wgpu::Buffer> {
        match self.get(name)? {
            WgpuOutput::Buffer(buffer) => Some(buffer),
            WgpuOutput::Texture { .. } => None,
        }
    }

    /// All outputs in the plan's order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &WgpuOutput)> {
        self.0.iter().map(|(name, output)| (name.as_str(), output))
    }
}

/// The natural view of a whole resource.
pub(crate) const fn whole_view(desc: &TextureDesc) -> (wgpu::TextureViewDimension, Subresources) {
    let dimension = match (desc.dimension, desc.layers()) {
        (Dimension::D3, _) => wgpu::TextureViewDimension::D3,
        (Dimension::Cube, 6) => wgpu::TextureViewDimension::Cube,
        (Dimension::Cube, _) => wgpu::TextureViewDimension::CubeArray,
        (Dimension::D2, 1) => wgpu::TextureViewDimension::D2,
        (Dimension::D2, _) => wgpu::TextureViewDimension::D2Array,
    };
    let all = Subresources {
        mip: 0,
        mips: desc.mips,
        layer: 0,
        layers: desc.layers(),
    };
    (dimension, all)
}

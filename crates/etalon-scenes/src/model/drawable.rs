//! A model as buffers and textures that every backend takes.

use std::collections::HashMap;

use etalon_core::Format;
use etalon_core::backend::Inputs;
use etalon_core::graph::{Buffer, Graph, GraphError, Texture};
use etalon_core::image::{ImageData, ImageError};
use etalon_core::raster::{IndexFormat, StepMode, VertexAttribute, VertexFormat, VertexLayout};
use etalon_core::resource::{AddressMode, BufferDesc, SamplerDesc, TextureDesc};
use etalon_effects::geometry::{Item, Maps, Surface, View};
use etalon_effects::lighting::PunctualLight;
use etalon_effects::{CameraParams, DepthRange};
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::derive::tangents;
use super::material::{AlphaMode, Material, TextureUse, UvTransform};
use super::mesh::Mesh;
use super::moment::{Instance, Snapshot};
use super::parts::Model;
use super::texture::{Filter, Sampler, Wrap};
use crate::camera::{Camera, CameraError};
use crate::frame::FrameSize;

/// Bytes of a vertex: position, normal, tangent, texture coordinates.
const STRIDE: u32 = 48;

/// How texture coordinates are made, compared bit by bit.
type UvKey = (u8, [u32; 5]);

/// The contents of a model's buffers and textures.
///
/// Each mesh has one vertex buffer for every way in which its materials ask for
/// texture coordinates: those of a material's first map serve all its maps.
/// Skinned meshes are as their vertices stand.
#[derive(Clone, Debug)]
pub struct Drawable {
    buffers: Vec<(String, Vec<u8>)>,
    images: Vec<(String, ImageData)>,
    /// Per vertex buffer, of which mesh and with which texture coordinates.
    vertices: HashMap<(usize, UvKey), usize>,
    /// Per mesh, its buffer of indices.
    indices: Vec<usize>,
    /// Per texture's image, and whether its colours are sRGB: which image.
    maps: HashMap<(usize, bool), usize>,
}

/// A [`Drawable`] that a graph imports.
#[derive(Clone, Debug)]
pub struct Imported<'d> {
    drawable: &'d Drawable,
    buffers: Vec<Buffer>,
    textures: Vec<Texture>,
}

impl Drawable {
    /// Writes the buffers and images of a model.
    ///
    /// # Errors
    /// If an image does not fit into memory.
    pub fn new(model: &Model) -> Result<Self, ImageError> {
        let parts = model.parts();
        let mut this = Self {
            buffers: Vec::new(),
            images: Vec::new(),
            vertices: HashMap::new(),
            indices: Vec::with_capacity(parts.meshes.len()),
            maps: HashMap::new(),
        };
        for (number, mesh) in parts.meshes.iter().enumerate() {
            let bytes = mesh.triangles().iter().flatten();
            let bytes = bytes.flat_map(|index| index.to_le_bytes()).collect();
            this.indices.push(this.buffers.len());
            this.buffers.push((format!("mesh {number} indices"), bytes));
        }
        for part in parts.nodes.iter().flat_map(|node| &node.parts) {
            let material = &parts.materials[part.material];
            let first = first_map(material);
            let key = (part.mesh, uv_key(first));
            if !this.vertices.contains_key(&key) {
                let name = format!("mesh {} vertices {}", part.mesh, this.vertices.len());
                let bytes = vertex_bytes(&parts.meshes[part.mesh], first);
                this.vertices.insert(key, this.buffers.len());
                this.buffers.push((name, bytes));
            }
            for (used, srgb) in maps(material) {
                let image = parts.textures[used.texture].image;
                if this.maps.contains_key(&(image, srgb)) {
                    continue;
                }
                let pixels = &parts.images[image];
                let format = if srgb {
                    Format::Rgba8UnormSrgb
                } else {
                    Format::Rgba8Unorm
                };
                let desc = TextureDesc::d2(pixels.width(), pixels.height(), format);
                let data = ImageData::from_bytes(desc, pixels.rgba().to_vec())?;
                let name = format!("image {image}{}", if srgb { " srgb" } else { "" });
                this.maps.insert((image, srgb), this.images.len());
                this.images.push((name, data));
            }
        }
        Ok(this)
    }

    /// Everything under the names that [`import`](Self::import) uses.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        let buffers = self.buffers.iter();
        let inputs = buffers.fold(Inputs::new(), |inputs, (name, bytes)| {
            inputs.buffer(name.as_str(), bytes)
        });
        let images = self.images.iter();
        images.fold(inputs, |inputs, (name, image)| {
            inputs.texture(name.as_str(), image)
        })
    }

    /// Imports everything into a graph.
    ///
    /// # Errors
    /// If the graph has imports of these names already.
    pub fn import(&self, graph: &mut Graph) -> Result<Imported<'_>, GraphError> {
        let buffers = self.buffers.iter().map(|(name, bytes)| {
            let bytes = bytes.len() as u64;
            graph.import_buffer(name, BufferDesc { bytes })
        });
        let buffers = buffers.collect::<Result<_, _>>()?;
        let images = self.images.iter();
        let textures = images.map(|(name, image)| graph.import_texture(name, image.desc));
        Ok(Imported {
            drawable: self,
            buffers,
            textures: textures.collect::<Result<_, _>>()?,
        })
    }
}

impl Imported<'_> {
    /// What of a snapshot is opaque, to be drawn by
    /// [`etalon_effects::geometry`]. What is blended or lets light pass is not
    /// among it.
    ///
    /// `model` is the one that the buffers were made of, `snapshot` one of its.
    #[must_use]
    pub fn opaque_items(&self, model: &Model, snapshot: &Snapshot) -> Vec<Item> {
        let instances = snapshot.instances.all().iter();
        let opaque = instances.filter(|instance| !is_blended(model, instance));
        opaque.map(|instance| self.item(model, instance)).collect()
    }

    /// What of a snapshot is blended or lets light pass, from far to near as seen
    /// from `eye`: to be drawn by [`etalon_effects::forward::glass`]. Of what lets
    /// light pass, opacity is the part that does not.
    ///
    /// Distances are those of the centres of bounds.
    #[must_use]
    pub fn blended_items(&self, model: &Model, snapshot: &Snapshot, eye: DVec3) -> Vec<Item> {
        let instances = snapshot.instances.all().iter();
        let blended = instances.filter(|instance| is_blended(model, instance));
        let mut far: Vec<_> = blended
            .map(|instance| {
                let [low, high] = model.parts().meshes[instance.mesh].bounds();
                let centre =
                    0.5 * (DVec3::from(low.map(f64::from)) + DVec3::from(high.map(f64::from)));
                let placed = instance.world.as_dmat4().transform_point3(centre);
                (placed.distance_squared(eye), instance)
            })
            .collect();
        far.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let items = far.into_iter().map(|(_, instance)| {
            let mut item = self.item(model, instance);
            item.surface.base.w *= 1.0 - model.parts().materials[instance.material].transmission;
            item
        });
        items.collect()
    }

    fn item(&self, model: &Model, instance: &Instance) -> Item {
        let parts = model.parts();
        let material = &parts.materials[instance.material];
        let key = (instance.mesh, uv_key(first_map(material)));
        let vertices = self
            .drawable
            .vertices
            .get(&key)
            .copied()
            .unwrap_or_default();
        let indices = self.buffers[self.drawable.indices[instance.mesh]];
        let elements = 3 * parts.meshes[instance.mesh].triangles().len() as u32;
        Item {
            vertices: vec![(self.buffers[vertices], 0, layout())],
            indices: Some((indices, 0, IndexFormat::Uint32)),
            elements: 0..elements,
            world: instance.world.as_dmat4(),
            previous: instance.previous.as_dmat4(),
            class: instance.class,
            surface: self.surface(model, material),
        }
    }

    fn surface(&self, model: &Model, material: &Material) -> Surface {
        let textures = &model.parts().textures;
        let map = |used: Option<TextureUse>, srgb| {
            let image = textures[used?.texture].image;
            let number = self.drawable.maps.get(&(image, srgb))?;
            self.textures.get(*number).copied()
        };
        let first = first_map(material).map(|used| textures[used.texture].sampler);
        let f0 = (material.ior - 1.0) / (material.ior + 1.0);
        Surface {
            base: Vec4::from(material.base_colour),
            cutoff: match material.alpha {
                AlphaMode::Mask { cutoff } => cutoff.min(1.0),
                AlphaMode::Opaque | AlphaMode::Blend => 0.0,
            },
            metalness: material.metallic,
            roughness: material.roughness,
            mirrored: f0 * f0,
            emission: (Vec3::from(material.emissive) * material.emissive_strength)
                .min(Vec3::splat(65504.0)),
            bend: material.normal_scale.clamp(0.0, 16.0),
            two_sided: material.double_sided,
            maps: Maps {
                base: map(material.base_colour_texture, true),
                surface: map(material.metallic_roughness_texture, false),
                normal: map(material.normal_texture, false),
                emission: map(material.emissive_texture, true),
            },
            sampler: sampler(first.unwrap_or_default()),
        }
    }
}

pub(crate) fn is_blended(model: &Model, instance: &Instance) -> bool {
    let material = &model.parts().materials[instance.material];
    material.alpha == AlphaMode::Blend || material.transmission > 0.0
}

/// The view of a camera for a picture of `size`.
///
/// # Errors
/// If the camera has no projection for this size.
pub fn view(camera: &Camera, size: FrameSize) -> Result<View, CameraError> {
    let projection = camera.projection(size)?;
    Ok(View {
        camera: CameraParams {
            scale: projection.scale().as_vec2(),
            centre: Vec2::ZERO,
            near: projection.near() as f32,
            depth: DepthRange::ReversedInfinite,
        },
        view: camera.pose().view_matrix(),
        previous: camera.previous_pose().view_matrix(),
    })
}

/// The lights of a snapshot, in units of `unit`: lux for directional ones, candela
/// for the others.
#[must_use]
pub fn lights(model: &Model, snapshot: &Snapshot, unit: f32) -> Vec<PunctualLight> {
    let placed = snapshot.lights.iter();
    placed
        .map(|placed| {
            let light = &model.parts().lights[placed.light];
            PunctualLight {
                kind: light.kind,
                position: placed.position.as_dvec3(),
                direction: placed.direction.as_dvec3(),
                power: (Vec3::from(light.colour) * (light.intensity / unit)).min(Vec3::splat(1e6)),
                reach: light.range,
            }
        })
        .collect()
}

/// The maps of a material that are drawn, and whether their colours are sRGB.
fn maps(material: &Material) -> impl Iterator<Item = (TextureUse, bool)> {
    [
        (material.base_colour_texture, true),
        (material.metallic_roughness_texture, false),
        (material.normal_texture, false),
        (material.emissive_texture, true),
    ]
    .into_iter()
    .filter_map(|(used, srgb)| Some((used?, srgb)))
}

fn first_map(material: &Material) -> Option<TextureUse> {
    maps(material).next().map(|(used, _)| used)
}

fn uv_key(used: Option<TextureUse>) -> UvKey {
    let (set, transform) = used.map_or_else(Default::default, |used| (used.set, used.transform));
    let UvTransform {
        offset,
        rotation,
        scale,
    } = transform;
    let [u, v] = offset;
    let [w, h] = scale;
    (set, [u, v, rotation, w, h].map(f32::to_bits))
}

fn layout() -> VertexLayout {
    let attribute = |name: &'static str, format, offset| VertexAttribute {
        name: name.into(),
        format,
        offset,
    };
    VertexLayout {
        stride: STRIDE,
        step: StepMode::Vertex,
        attributes: vec![
            attribute("position", VertexFormat::Float32x3, 0),
            attribute("normal", VertexFormat::Float32x3, 12),
            attribute("tangent", VertexFormat::Float32x4, 24),
            attribute("uv", VertexFormat::Float32x2, 40),
        ],
    }
}

fn vertex_bytes(mesh: &Mesh, used: Option<TextureUse>) -> Vec<u8> {
    let vertices = mesh.vertices();
    let (set, transform) = used.map_or_else(Default::default, |used| (used.set, used.transform));
    let uv = &vertices.uv[usize::from(set).min(1)];
    let computed;
    let tangents = if vertices.tangents.is_empty() && !uv.is_empty() {
        computed = tangents(vertices, mesh.triangles(), set.into());
        &computed
    } else {
        &vertices.tangents
    };
    let mut bytes = Vec::with_capacity(vertices.positions.len() * STRIDE as usize);
    let streams = vertices.positions.iter().zip(&vertices.normals);
    for (number, (position, normal)) in streams.enumerate() {
        let tangent = tangents
            .get(number)
            .copied()
            .unwrap_or([1.0, 0.0, 0.0, 1.0]);
        let uv = transform.apply(uv.get(number).copied().unwrap_or_default());
        for value in position.iter().chain(normal).chain(&tangent).chain(&uv) {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

fn sampler(sampler: Sampler) -> SamplerDesc {
    use etalon_core::resource::Filter as F;
    let address = |wrap| match wrap {
        Wrap::Repeat => AddressMode::Repeat,
        Wrap::Mirror => AddressMode::MirrorRepeat,
        Wrap::Clamp => AddressMode::ClampToEdge,
    };
    let filter = |filter| match filter {
        Filter::Nearest => F::Nearest,
        Filter::Linear => F::Linear,
    };
    SamplerDesc {
        address: [
            address(sampler.wrap_u),
            address(sampler.wrap_v),
            AddressMode::Repeat,
        ],
        mag_filter: filter(sampler.magnify),
        min_filter: filter(sampler.minify),
        mip_filter: filter(sampler.mip.unwrap_or(Filter::Nearest)),
        ..SamplerDesc::default()
    }
}

//! Meshes: glTF 2.0, section 3.7.

use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Accessor, Index};

use super::accessor::Allowed;
use super::{GltfError, Reader, named};
use crate::model::derive::{flat_normals, mend_normals, mend_tangents, tangents};
use crate::model::error::{Check, Place};
use crate::model::material::Material;
use crate::model::mesh::{Mesh, Vertices};
use crate::model::node::Part;
use crate::model::parts::ModelParts;

/// By mesh of the file, what stands for its primitives.
pub(super) fn meshes(
    reader: &mut Reader<'_>,
    parts: &mut ModelParts,
) -> Result<Vec<Vec<Part>>, GltfError> {
    let root = reader.root;
    let mut all = Vec::new();
    let mut default = None;
    for (i, mesh) in root.meshes.iter().enumerate() {
        let mut of_mesh = Vec::new();
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {i}, primitive {j}");
            let material = match primitive.material {
                Some(material) if material.value() < root.materials.len() => material.value(),
                Some(material) => {
                    return Err(GltfError::Index {
                        what: format!("the material of {place}"),
                        target: "material",
                        index: material.value(),
                        count: root.materials.len(),
                    });
                }
                None => *default.get_or_insert_with(|| parts.material(Material::default())),
            };
            let mut name = named(mesh.name.as_ref());
            if mesh.primitives.len() > 1 {
                name = format!("{name}/{j}");
            }
            let normal_map = parts.materials[material].normal_texture;
            let set = normal_map.map_or(0, |texture| usize::from(texture.set));
            let mesh = read(reader, primitive, &place, name, set)?;
            of_mesh.push(Part {
                mesh: parts.mesh(mesh),
                material,
            });
        }
        all.push(of_mesh);
    }
    Ok(all)
}

fn read(
    reader: &mut Reader<'_>,
    primitive: &Primitive,
    place: &str,
    name: String,
    set: usize,
) -> Result<Mesh, GltfError> {
    let attribute = |semantic: Semantic| -> Option<Index<Accessor>> {
        primitive.attributes.get(&Checked::Valid(semantic)).copied()
    };
    let what = |attribute: &str| format!("{attribute} of {place}");
    let Some(positions) = attribute(Semantic::Positions) else {
        return Err(GltfError::Unsupported(format!("{place} has no positions")));
    };
    if attribute(Semantic::Joints(1)).is_some() || attribute(Semantic::Weights(1)).is_some() {
        return Err(GltfError::Unsupported(format!(
            "{place} has more than four joints a vertex"
        )));
    }
    let mut vertices = Vertices {
        positions: reader.floats(positions, &what("positions"), Allowed::Float)?,
        ..Vertices::default()
    };
    let count = vertices.positions.len();
    if let Some(normals) = attribute(Semantic::Normals) {
        vertices.normals = reader.floats(normals, &what("normals"), Allowed::Float)?;
    }
    if let Some(tangents) = attribute(Semantic::Tangents) {
        vertices.tangents = reader.floats(tangents, &what("tangents"), Allowed::Float)?;
    }
    for (i, name) in [(0, "texture coordinates 0"), (1, "texture coordinates 1")] {
        if let Some(uv) = attribute(Semantic::TexCoords(i)) {
            vertices.uv[i as usize] = reader.floats(uv, &what(name), Allowed::FloatOrNormalized)?;
        }
    }
    if let Some(colours) = attribute(Semantic::Colors(0)) {
        vertices.colours = self::colours(reader, colours, &what("colours"))?;
    }
    if let Some(joints) = attribute(Semantic::Joints(0)) {
        let joints = reader.integers(joints, &what("joints"))?;
        // Of 32 bits there are none (section 3.7.2.1); they become the highest index.
        let narrow = |joint: u32| u16::try_from(joint).unwrap_or(u16::MAX);
        vertices.joints = joints.iter().map(|joints| joints.map(narrow)).collect();
    }
    if let Some(weights) = attribute(Semantic::Weights(0)) {
        let weights = reader.floats(weights, &what("weights"), Allowed::FloatOrNormalized)?;
        vertices.weights = weights.into_iter().map(scaled).collect();
    }
    let triangles = triangles(reader, primitive, place, count)?;
    let mesh = Place::loose("mesh", &name);
    for (i, triangle) in triangles.iter().enumerate() {
        for &corner in triangle {
            if corner as usize >= count {
                let what = format!("triangle {i}");
                Check(&mesh).index(what, "vertex", corner as usize, count)?;
            }
        }
    }
    let (mut vertices, triangles) = if vertices.normals.is_empty() {
        // A vertex has at most 112 bytes, and each triangle gets three.
        let bytes = (triangles.len() as u64).saturating_mul(3 * 112 + 12);
        reader
            .budget
            .take(format!("a mesh with flat normals for {place}"), bytes)?;
        flat_normals(&vertices, &triangles)
    } else {
        mend_normals(&mut vertices, &triangles);
        (vertices, triangles)
    };
    if vertices.tangents.is_empty() {
        let bytes = (vertices.positions.len() as u64).saturating_mul(64 + 16);
        reader.budget.take(format!("tangents for {place}"), bytes)?;
        vertices.tangents = tangents(&vertices, &triangles, set);
    } else {
        mend_tangents(&mut vertices);
    }
    Ok(Mesh::new(name, vertices, triangles)?)
}

/// RGB or RGBA.
fn colours(
    reader: &mut Reader<'_>,
    index: Index<Accessor>,
    what: &str,
) -> Result<Vec<[f32; 4]>, GltfError> {
    use gltf::json::accessor::Type;
    let accessor = super::get(&reader.root.accessors, index, "accessor", || what.into())?;
    let allowed = Allowed::FloatOrNormalized;
    if accessor.type_ == Checked::Valid(Type::Vec3) {
        let rgb: Vec<[f32; 3]> = reader.floats(index, what, allowed)?;
        let bytes = rgb.len() as u64 * 16;
        reader.budget.take(what, bytes)?;
        Ok(rgb.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
    } else {
        reader.floats(index, what, allowed)
    }
}

/// Weights of sum 1, if they have a sum.
fn scaled(weights: [f32; 4]) -> [f32; 4] {
    let sum: f32 = weights.iter().sum();
    if sum > 0.0 && sum.is_finite() {
        weights.map(|weight| weight / sum)
    } else {
        weights
    }
}

fn triangles(
    reader: &mut Reader<'_>,
    primitive: &Primitive,
    place: &str,
    vertices: usize,
) -> Result<Vec<[u32; 3]>, GltfError> {
    let indices: Vec<u32> = match primitive.indices {
        Some(indices) => {
            let indices = reader.integers::<1>(indices, &format!("indices of {place}"))?;
            indices.into_iter().flatten().collect()
        }
        None => {
            let what = format!("indices for {place}");
            reader.budget.take(what, vertices as u64 * 4)?;
            (0..u32::try_from(vertices).unwrap_or(u32::MAX)).collect()
        }
    };
    reader
        .budget
        .take(format!("triangles of {place}"), indices.len() as u64 * 12)?;
    match primitive.mode {
        Checked::Valid(Mode::Triangles) => {
            let (triangles, rest) = indices.as_chunks::<3>();
            if !rest.is_empty() {
                return Err(GltfError::Malformed(format!(
                    "{place} has {} indices; for triangles there must be a multiple of 3",
                    indices.len()
                )));
            }
            Ok(triangles.to_vec())
        }
        // Every other one is turned around, so that all wind alike (section 3.7.2.1).
        Checked::Valid(Mode::TriangleStrip) => Ok((indices.array_windows().enumerate())
            .map(|(i, &[a, b, c])| if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
            .collect()),
        Checked::Valid(Mode::TriangleFan) => {
            Ok((indices.iter().skip(1).zip(indices.iter().skip(2)))
                .map(|(&b, &c)| [b, c, indices[0]])
                .collect())
        }
        Checked::Valid(mode) => Err(GltfError::Unsupported(format!(
            "{place} is of {mode:?}; it must be of triangles"
        ))),
        Checked::Invalid => Err(GltfError::Malformed(format!("{place} has no valid mode"))),
    }
}

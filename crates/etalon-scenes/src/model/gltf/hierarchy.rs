//! Nodes, scenes, cameras and lights: glTF 2.0, sections 3.5 and 3.10.

use ::gltf::json::Root;
use ::gltf::json::camera::Type as CameraType;
use ::gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use ::gltf::json::validation::Checked;

use super::{GltfError, Reader, get, named};
use crate::model::light::{Light, LightKind};
use crate::model::moment::Instance;
use crate::model::node::{Node, Part, Transform};
use crate::model::parts::{ModelParts, Viewpoint};

pub(super) fn lights(reader: &Reader<'_>, parts: &mut ModelParts) -> Result<(), GltfError> {
    let extensions = reader.root.extensions.as_ref();
    let lights = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    for (i, light) in lights.into_iter().flat_map(|l| &l.lights).enumerate() {
        let kind = match (light.type_, &light.spot) {
            (Checked::Valid(LightType::Directional), _) => LightKind::Directional,
            (Checked::Valid(LightType::Point), _) => LightKind::Point,
            (Checked::Valid(LightType::Spot), Some(spot)) => LightKind::Spot {
                inner: spot.inner_cone_angle,
                outer: spot.outer_cone_angle,
            },
            (Checked::Valid(LightType::Spot), None) | (Checked::Invalid, _) => {
                return Err(GltfError::Malformed(format!(
                    "light {i} has no valid type, or is a spot light without a cone"
                )));
            }
        };
        parts.lights.push(Light {
            name: named(light.name.as_ref()),
            colour: light.color,
            intensity: light.intensity,
            range: light.range,
            kind,
        });
    }
    Ok(())
}

pub(super) fn nodes(
    reader: &mut Reader<'_>,
    meshes: &[Vec<Part>],
    parts: &mut ModelParts,
) -> Result<(), GltfError> {
    let root = reader.root;
    let parents = parents(root)?;
    let shown = shown(root, &parents)?;
    for (i, json) in root.nodes.iter().enumerate() {
        let what = |property: &str| format!("the {property} of node {i}");
        let mut node = Node {
            name: named(json.name.as_ref()),
            parent: parents[i],
            transform: match json.matrix {
                Some(matrix) => Transform::Matrix(affine(matrix)),
                None => Transform::Trs {
                    translation: json.translation.unwrap_or([0.0; 3]),
                    rotation: json.rotation.map_or([0.0, 0.0, 0.0, 1.0], |q| q.0),
                    scale: json.scale.unwrap_or([1.0; 3]),
                },
            },
            ..Node::default()
        };
        let of_mesh = match json.mesh {
            Some(mesh) => meshes.get(mesh.value()).ok_or_else(|| GltfError::Index {
                what: what("mesh"),
                target: "mesh",
                index: mesh.value(),
                count: meshes.len(),
            })?,
            None => &Vec::new(),
        };
        let light = json
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        if shown[i] {
            // Many nodes may show many primitives each; instances are larger.
            let bytes = of_mesh.len() as u64 * size_of::<Instance>() as u64;
            reader.budget.take(what("instances"), bytes)?;
            node.parts.clone_from(of_mesh);
            node.skin = json.skin.map(|skin| skin.value());
            node.light = light.map(|light| light.light.value());
            if let Some(camera) = json.camera {
                let camera = get(&root.cameras, camera, "camera", || what("camera"))?;
                if let (Checked::Valid(CameraType::Perspective), Some(lens)) =
                    (camera.type_, &camera.perspective)
                {
                    parts.viewpoints.push(Viewpoint::Node {
                        node: i,
                        vertical_fov: f64::from(lens.yfov),
                        near: f64::from(lens.znear),
                    });
                }
            }
        }
        parts.node(node);
    }
    Ok(())
}

/// The last row as it should be, if it is off by rounding only.
fn affine(mut matrix: [f32; 16]) -> [f32; 16] {
    for (i, exact) in [(3, 0.0), (7, 0.0), (11, 0.0), (15, 1.0)] {
        if (matrix[i] - exact).abs() < 1e-5 {
            matrix[i] = exact;
        }
    }
    matrix
}

fn parents(root: &Root) -> Result<Vec<Option<usize>>, GltfError> {
    let count = root.nodes.len();
    let mut parents = vec![None; count];
    for (i, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            get(&root.nodes, *child, "node", || {
                format!("a child of node {i}")
            })?;
            if let Some(other) = parents[child.value()].replace(i) {
                return Err(GltfError::Malformed(format!(
                    "node {} is a child of node {other} and of node {i}",
                    child.value()
                )));
            }
        }
    }
    Ok(parents)
}

/// By node, whether it is in the file's scene: the one it names, else the first,
/// else all.
fn shown(root: &Root, parents: &[Option<usize>]) -> Result<Vec<bool>, GltfError> {
    let scene = match root.scene {
        Some(scene) => Some(get(&root.scenes, scene, "scene", || "the scene".into())?),
        None => root.scenes.first(),
    };
    let Some(scene) = scene else {
        return Ok(vec![true; parents.len()]);
    };
    let mut shown = vec![false; parents.len()];
    let mut open = Vec::new();
    for node in &scene.nodes {
        get(&root.nodes, *node, "node", || "a node of the scene".into())?;
        open.push(node.value());
    }
    // Each node is entered once, so that cycles end; they are refused later.
    while let Some(i) = open.pop() {
        if !std::mem::replace(&mut shown[i], true) {
            let children = root.nodes[i].children.iter().flatten();
            open.extend(children.map(|child| child.value()));
        }
    }
    Ok(shown)
}

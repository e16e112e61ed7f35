//! A model: what there is, checked as a whole.

use etalon_effects::geometry::DrawClass;

use super::animation::{Animation, Values};
use super::error::{Check, ModelError, Place};
use super::light::Light;
use super::material::Material;
use super::mesh::Mesh;
use super::node::{Node, Skin, Transform};
use super::texture::{Image, Texture};
use crate::camera::Camera;

/// Most instances of a model.
pub const MAX_INSTANCES: usize = 1 << 20;

/// Who looks at a model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Viewpoint {
    /// A camera with the pose that it had one frame earlier.
    Fixed(Camera),
    /// A camera at a node, looking down its −Z, wherever it moves.
    Node {
        /// Index of the model's node.
        node: usize,
        /// Vertical field of view in radians, in (0, π).
        vertical_fov: f64,
        /// Distance of the near plane, over 0.
        near: f64,
    },
}

/// What makes up a [`Model`]: lists whose elements refer to each other by index.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelParts {
    /// Triangles.
    pub meshes: Vec<Mesh>,
    /// Images of textures.
    pub images: Vec<Image>,
    /// Images with samplers.
    pub textures: Vec<Texture>,
    /// What surfaces are made of.
    pub materials: Vec<Material>,
    /// What shines.
    pub lights: Vec<Light>,
    /// Where things are.
    pub nodes: Vec<Node>,
    /// What moves vertices.
    pub skins: Vec<Skin>,
    /// What moves nodes.
    pub animations: Vec<Animation>,
    /// Who looks; the first is the one to begin with.
    pub viewpoints: Vec<Viewpoint>,
}

impl ModelParts {
    /// Adds a mesh and says its index.
    pub fn mesh(&mut self, mesh: Mesh) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// Adds an image with a sampler and says the texture's index.
    pub fn texture(&mut self, image: Image, sampler: super::Sampler) -> usize {
        self.images.push(image);
        self.textures.push(Texture {
            image: self.images.len() - 1,
            sampler,
        });
        self.textures.len() - 1
    }

    /// Adds a material and says its index.
    pub fn material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a node and says its index.
    pub fn node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Adds a light at a node of its own and says the node's index.
    pub fn light(&mut self, light: Light, transform: Transform) -> usize {
        let name = light.name.clone();
        self.lights.push(light);
        self.node(Node {
            name,
            transform,
            light: Some(self.lights.len() - 1),
            ..Node::default()
        })
    }
}

/// Something to draw. It was checked when it was made: every index in it has
/// its element, every number is in its range, no node is its own ancestor.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    parts: ModelParts,
    /// Nodes, parents before children.
    order: Vec<usize>,
    /// By node.
    classes: Vec<DrawClass>,
}

impl Model {
    /// Checks everything.
    ///
    /// # Errors
    /// At the first number out of its range, index without its element, node
    /// that is its own ancestor, track that moves a node with a matrix, or part
    /// whose mesh lacks what its material or skin needs: texture coordinates of
    /// the sets that textures use, tangents for a normal map, joints.
    pub fn new(parts: ModelParts) -> Result<Self, ModelError> {
        for (i, texture) in parts.textures.iter().enumerate() {
            let place = Place::new("texture", i, "");
            Check(&place).index("image", "image", texture.image, parts.images.len())?;
        }
        for (i, material) in parts.materials.iter().enumerate() {
            material.check(i, parts.textures.len())?;
        }
        for (i, light) in parts.lights.iter().enumerate() {
            light.check(i)?;
        }
        for (i, skin) in parts.skins.iter().enumerate() {
            skin.check(i, parts.nodes.len())?;
        }
        for (i, node) in parts.nodes.iter().enumerate() {
            node.check(i)?;
            check_references(&parts, i, node)?;
        }
        for (i, animation) in parts.animations.iter().enumerate() {
            animation.check(i, parts.nodes.len())?;
            check_targets(&parts, i, animation)?;
        }
        let instances: usize = parts.nodes.iter().map(|node| node.parts.len()).sum();
        Check(&Place::loose("model", "")).count(
            "instances",
            instances,
            format!("at most {MAX_INSTANCES}"),
            instances <= MAX_INSTANCES,
        )?;
        check_viewpoints(&parts)?;
        let order = order(&parts.nodes)?;
        let classes = classes(&parts, &order);
        Ok(Self {
            parts,
            order,
            classes,
        })
    }

    /// Everything that it is made of.
    #[must_use]
    pub const fn parts(&self) -> &ModelParts {
        &self.parts
    }

    /// The nodes' indices, each after its parent's.
    #[must_use]
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// When the parts of a node are drawn; `None` if there is no such node.
    #[must_use]
    pub fn class(&self, node: usize) -> Option<DrawClass> {
        self.classes.get(node).copied()
    }

    /// All triangles of all meshes, each mesh counted once.
    #[must_use]
    pub fn triangles(&self) -> usize {
        let meshes = self.parts.meshes.iter();
        meshes.map(|mesh| mesh.triangles().len()).sum()
    }
}

fn check_references(parts: &ModelParts, index: usize, node: &Node) -> Result<(), ModelError> {
    let place = Place::new("node", index, &node.name);
    let check = Check(&place);
    if let Some(parent) = node.parent {
        check.index("parent", "node", parent, parts.nodes.len())?;
    }
    if let Some(light) = node.light {
        check.index("light", "light", light, parts.lights.len())?;
    }
    if let Some(skin) = node.skin {
        check.index("skin", "skin", skin, parts.skins.len())?;
    }
    for part in &node.parts {
        check.index("part", "mesh", part.mesh, parts.meshes.len())?;
        check.index("part", "material", part.material, parts.materials.len())?;
        let mesh = &parts.meshes[part.mesh];
        let material = &parts.materials[part.material];
        let conflict = |problem: String| ModelError::Conflict {
            place: place.clone(),
            problem,
        };
        let mesh_place = || Place::new("mesh", part.mesh, mesh.name());
        let material_place = || Place::new("material", part.material, &material.name);
        for (what, texture) in material.textures() {
            if mesh.vertices().uv[usize::from(texture.set)].is_empty() {
                return Err(conflict(format!(
                    "the {what} of {} uses set {} of texture coordinates, which {} does not have",
                    material_place(),
                    texture.set,
                    mesh_place()
                )));
            }
        }
        if material.normal_texture.is_some() && mesh.vertices().tangents.is_empty() {
            return Err(conflict(format!(
                "{} has a normal map, but {} has no tangents",
                material_place(),
                mesh_place()
            )));
        }
        if let Some(skin) = node.skin {
            let joints = parts.skins[skin].joints.len();
            if mesh.joints() == 0 || mesh.joints() > joints {
                return Err(conflict(format!(
                    "{} needs {} joints; it must need from 1 to {joints}, as many as {} has",
                    mesh_place(),
                    mesh.joints(),
                    Place::new("skin", skin, &parts.skins[skin].name)
                )));
            }
        }
    }
    Ok(())
}

fn check_targets(
    parts: &ModelParts,
    index: usize,
    animation: &Animation,
) -> Result<(), ModelError> {
    for (i, track) in animation.tracks.iter().enumerate() {
        if matches!(parts.nodes[track.node].transform, Transform::Matrix(_)) {
            let property = match track.values {
                Values::Translation(_) => "translation",
                Values::Rotation(_) => "rotation",
                Values::Scale(_) => "scale",
            };
            return Err(ModelError::Conflict {
                place: Place::new("animation", index, &animation.name),
                problem: format!(
                    "track {i} moves the {property} of node {}, whose transform is a matrix",
                    track.node
                ),
            });
        }
    }
    Ok(())
}

fn check_viewpoints(parts: &ModelParts) -> Result<(), ModelError> {
    for (i, viewpoint) in parts.viewpoints.iter().enumerate() {
        let Viewpoint::Node {
            node,
            vertical_fov,
            near,
        } = *viewpoint
        else {
            continue;
        };
        let place = Place::new("viewpoint", i, "");
        let check = Check(&place);
        check.index("place", "node", node, parts.nodes.len())?;
        check.value(
            "vertical field of view",
            vertical_fov,
            "over 0 and under π",
            vertical_fov > 0.0 && vertical_fov < std::f64::consts::PI,
        )?;
        check.value(
            "near plane",
            near,
            "finite and over 0",
            near > 0.0 && near.is_finite(),
        )?;
    }
    Ok(())
}

/// Indices, parents first; of several possible orders the one level by level,
/// by index within a level.
fn order(nodes: &[Node]) -> Result<Vec<usize>, ModelError> {
    let mut children = vec![Vec::new(); nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    for (i, node) in nodes.iter().enumerate() {
        match node.parent {
            Some(parent) => children[parent].push(i),
            None => order.push(i),
        }
    }
    let mut next = 0;
    while let Some(&node) = order.get(next) {
        order.append(&mut children[node]);
        next += 1;
    }
    // What no root leads to hangs on a cycle.
    if order.len() < nodes.len() {
        let mut reached = vec![false; nodes.len()];
        for &node in &order {
            reached[node] = true;
        }
        let lost = (0..nodes.len()).find(|&i| !reached[i]).unwrap_or(0);
        // Going up for as long as there are nodes ends within the cycle.
        let inside = (0..nodes.len()).fold(lost, |node, _| nodes[node].parent.unwrap_or(node));
        return Err(ModelError::Cycle(Place::new(
            "node",
            inside,
            &nodes[inside].name,
        )));
    }
    Ok(order)
}

fn classes(parts: &ModelParts, order: &[usize]) -> Vec<DrawClass> {
    let mut moving = vec![false; parts.nodes.len()];
    for track in parts.animations.iter().flat_map(|a| &a.tracks) {
        moving[track.node] = true;
    }
    for &node in order {
        if let Some(parent) = parts.nodes[node].parent {
            moving[node] |= moving[parent];
        }
    }
    (parts.nodes.iter().zip(moving))
        .map(|(node, moving)| {
            node.class.unwrap_or(if moving || node.skin.is_some() {
                DrawClass::Dynamic
            } else {
                DrawClass::Static
            })
        })
        .collect()
}

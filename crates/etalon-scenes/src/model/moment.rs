//! A model at a time: what a renderer iterates over.

use glam::{DMat4, DVec3, Mat4, Vec3};

use etalon_effects::geometry::DrawClass;

use super::animation::Pose;
use super::error::{Check, ModelError, Place};
use super::node::{Transform, compose, quaternion};
use super::parts::{Model, Viewpoint};
use crate::camera::{self, Camera, CameraError};

/// A time, and what happens then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Index of the model's animation that runs; `None` for none.
    pub animation: Option<usize>,
    /// In seconds.
    pub time: f64,
    /// Seconds since the frame before.
    pub step: f64,
}

/// A mesh with a material in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the model's node that it is at.
    pub node: usize,
    /// Index of the model's mesh.
    pub mesh: usize,
    /// Index of the model's material.
    pub material: usize,
    /// Index of the model's skin, if joints move the vertices.
    pub skin: Option<usize>,
    /// When in a frame it is drawn.
    pub class: DrawClass,
    /// From the mesh's space to the world. Affine.
    pub world: Mat4,
    /// The same one frame earlier.
    pub previous: Mat4,
}

impl Instance {
    /// Whether the matrix turns left hands into right ones, so that front
    /// faces wind clockwise in the world (glTF 2.0, section 3.7.4).
    #[must_use]
    pub fn mirrored(&self) -> bool {
        self.world.as_dmat4().determinant() < 0.0
    }
}

/// All instances, by class, then by node, then by part. This order is the same
/// at any time, so an instance's place in it serves as its id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instances(Vec<Instance>);

impl Instances {
    /// The instances in order.
    #[must_use]
    pub fn all(&self) -> &[Instance] {
        &self.0
    }

    /// Those of one class; they stand together.
    #[must_use]
    pub fn of(&self, class: DrawClass) -> &[Instance] {
        let start = self.0.partition_point(|instance| instance.class < class);
        let end = self.0.partition_point(|instance| instance.class <= class);
        &self.0[start..end]
    }
}

/// A light in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedLight {
    /// Index of the model's light.
    pub light: usize,
    /// Index of the model's node that it is at.
    pub node: usize,
    /// Where it is.
    pub position: Vec3,
    /// Unit direction in which it shines; −Z where the node is scaled to nothing.
    pub direction: Vec3,
}

/// A model at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// What is drawn.
    pub instances: Instances,
    /// What shines, by node.
    pub lights: Vec<PlacedLight>,
    /// Who looks, in the order of the model's viewpoints.
    pub cameras: Vec<Camera>,
    /// By node, its matrix to the world.
    pub nodes: Vec<Mat4>,
    /// The same one frame earlier.
    pub previous: Vec<Mat4>,
}

impl Model {
    /// The model at a time in seconds, while its first animation runs, if it
    /// has one; the frame before was 1/60 s earlier.
    ///
    /// # Errors
    /// As [`Model::at_moment`].
    pub fn at(&self, time: f64) -> Result<Snapshot, ModelError> {
        self.at_moment(Moment {
            animation: (!self.parts().animations.is_empty()).then_some(0),
            time,
            step: 1.0 / 60.0,
        })
    }

    /// The model at a moment. Matrices are composed in f64 and rounded to f32
    /// once, at the end.
    ///
    /// # Errors
    /// If a time is not finite, there is no such animation, a matrix leaves the
    /// range of f32, or a node with a camera is scaled to nothing.
    pub fn at_moment(&self, moment: Moment) -> Result<Snapshot, ModelError> {
        let place = Place::loose("moment", "");
        let check = Check(&place);
        let Moment {
            animation,
            time,
            step,
        } = moment;
        check.value("time", time, "finite", time.is_finite())?;
        check.value("step", step, "finite", (time - step).is_finite())?;
        if let Some(animation) = animation {
            let count = self.parts().animations.len();
            check.index("running animation", "animation", animation, count)?;
        }
        let now = self.worlds(animation, time);
        let before = self.worlds(animation, time - step);
        let nodes = self.rounded(&now)?;
        let previous = self.rounded(&before)?;
        let mut instances = Vec::new();
        let mut lights = Vec::new();
        for (i, node) in self.parts().nodes.iter().enumerate() {
            for part in &node.parts {
                instances.push(Instance {
                    node: i,
                    mesh: part.mesh,
                    material: part.material,
                    skin: node.skin,
                    class: self.class(i).unwrap_or(DrawClass::Static),
                    world: nodes[i],
                    previous: previous[i],
                });
            }
            if let Some(light) = node.light {
                let direction = (-now[i].z_axis.truncate()).try_normalize();
                lights.push(PlacedLight {
                    light,
                    node: i,
                    position: nodes[i].w_axis.truncate(),
                    direction: direction.unwrap_or(DVec3::NEG_Z).as_vec3(),
                });
            }
        }
        // Stable, so nodes and parts stay in their order.
        instances.sort_by_key(|instance| instance.class);
        Ok(Snapshot {
            instances: Instances(instances),
            lights,
            cameras: self.cameras(&now, &before)?,
            nodes,
            previous,
        })
    }

    /// By node, its matrix to the world.
    fn worlds(&self, animation: Option<usize>, time: f64) -> Vec<DMat4> {
        let nodes = &self.parts().nodes;
        let mut poses: Vec<Option<Pose>> = nodes
            .iter()
            .map(|node| match node.transform {
                Transform::Trs {
                    translation,
                    rotation,
                    scale,
                } => Some(Pose {
                    translation: DVec3::from_array(translation.map(f64::from)),
                    rotation: quaternion(rotation),
                    scale: DVec3::from_array(scale.map(f64::from)),
                }),
                Transform::Matrix(_) => None,
            })
            .collect();
        let running = animation.and_then(|i| self.parts().animations.get(i));
        for track in running.into_iter().flat_map(|animation| &animation.tracks) {
            if let Some(pose) = &mut poses[track.node] {
                track.apply(time, pose);
            }
        }
        let mut worlds = vec![DMat4::IDENTITY; nodes.len()];
        for &i in self.order() {
            let local = match poses[i] {
                Some(pose) => compose(pose.translation, pose.rotation, pose.scale),
                None => nodes[i].transform.matrix(),
            };
            worlds[i] = match nodes[i].parent {
                Some(parent) => worlds[parent] * local,
                None => local,
            };
        }
        worlds
    }

    fn rounded(&self, worlds: &[DMat4]) -> Result<Vec<Mat4>, ModelError> {
        (worlds.iter().enumerate())
            .map(|(i, world)| {
                let rounded = world.as_mat4();
                let place = || Place::new("node", i, &self.parts().nodes[i].name);
                if !rounded.is_finite() {
                    Check(&place()).value(
                        "matrix to the world",
                        world.to_cols_array(),
                        "within the range of f32",
                        false,
                    )?;
                }
                Ok(rounded)
            })
            .collect()
    }

    fn cameras(&self, now: &[DMat4], before: &[DMat4]) -> Result<Vec<Camera>, ModelError> {
        (self.parts().viewpoints.iter().enumerate())
            .map(|(i, viewpoint)| match *viewpoint {
                Viewpoint::Fixed(camera) => Ok(camera),
                Viewpoint::Node {
                    node,
                    vertical_fov,
                    near,
                } => (|| {
                    let pose = camera::Pose::placed(now[node])?;
                    let previous = camera::Pose::placed(before[node])?;
                    let camera = Camera::new(pose, vertical_fov)?.with_near(near)?;
                    Ok(camera.moved_from(previous))
                })()
                .map_err(|source: CameraError| ModelError::Camera {
                    place: Place::new("viewpoint", i, ""),
                    source: Box::new(source),
                }),
            })
            .collect()
    }
}

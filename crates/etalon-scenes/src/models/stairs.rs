//! Steps to the horizon.
//!
//! For depth: reversed and infinite, it has to tell steps apart at 2 m as well
//! as at 10 km, where a step is 2 km deep.

use super::camera;
use crate::model::{Material, Model, ModelError, ModelParts, Node, Transform, Viewpoint, shapes};

/// How many steps there are.
const STEPS: i32 = 48;
/// How much further each one is.
const GROWTH: f32 = 1.2;

pub(super) fn build() -> Result<Model, ModelError> {
    let mut parts = ModelParts::default();
    let step = parts.mesh(shapes::cuboid("step", [0.5; 3])?);
    let colours = [[0.7, 0.7, 0.68], [0.35, 0.4, 0.5], [0.55, 0.3, 0.25]];
    let materials =
        colours.map(|colour| parts.material(Material::dielectric("stone", colour, 0.8)));
    // From 2 m on; 2 · 1.2⁴⁷ m are 10.5 km.
    let mut near = 2.0_f32;
    for i in 0..STEPS {
        let far = near * GROWTH;
        // All seem as wide, and each a little higher than the one before.
        let (width, height) = (1.6 * near, 0.45 * near * (i as f32 / STEPS as f32));
        let transform = Transform::Trs {
            translation: [0.0, 0.5 * height - 1.0, -0.5 * (near + far)],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [width, height + 0.05, far - near],
        };
        let material = materials[i as usize % 3];
        parts.node(Node::with_part(
            &format!("step {i}"),
            transform,
            step,
            material,
        ));
        near = far;
    }
    parts.viewpoints.push(Viewpoint::Fixed(camera(
        [[0.0, 1.0, 0.1], [0.0, 1.0, -10.0]],
        [[0.0, 1.0, 0.0], [0.0, 1.0, -10.0]],
        60.0,
    )?));
    Model::new(parts)
}

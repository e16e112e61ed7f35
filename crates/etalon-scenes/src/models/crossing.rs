//! Triangles that clipping has to cut.
//!
//! For clipping: corners behind the eye project to the wrong side, corners at
//! the eye to nowhere, and what covers the screen has all its corners outside.

use super::{camera, quad, soup};
use crate::model::{Material, Model, ModelError, ModelParts, Node, Transform, Viewpoint, shapes};

pub(super) fn build() -> Result<Model, ModelError> {
    let mut parts = ModelParts::default();
    let both = |name: &str, colour| Material {
        double_sided: true,
        ..Material::dielectric(name, colour, 0.6)
    };
    let grey = parts.material(both("grey", [0.5; 3]));
    let blue = parts.material(both("blue", [0.1, 0.2, 0.7]));
    let green = parts.material(both("green", [0.1, 0.6, 0.2]));
    let red = parts.material(Material::dielectric("red", [0.8, 0.1, 0.05], 0.6));

    // A floor from 500 m behind the eye to 500 m before it, of two triangles.
    let floor = parts.mesh(shapes::grid("floor", [1000.0, 1000.0], [1, 1])?);
    parts.node(Node::with_part(
        "floor",
        Transform::at([0.0, -1.0, 0.0]),
        floor,
        grey,
    ));

    // One corner before the near plane, two behind the eye; then the reverse.
    let shards = [
        [[-0.6, 0.4, -2.0], [-0.8, -0.3, 1.0], [-0.3, 0.2, 1.5]],
        [[0.7, 0.5, 0.8], [0.4, -0.4, -1.5], [1.0, 0.1, -2.5]],
        // Through the near plane at a shallow angle, and with a corner in the
        // plane of the eye.
        [[-0.2, -0.2, 0.0], [0.25, -0.25, -0.9], [0.1, -0.15, -0.11]],
    ];
    let shards = parts.mesh(soup("shards", &shards)?);
    parts.node(Node::with_part(
        "shards",
        Transform::default(),
        shards,
        blue,
    ));

    // Wholly behind the camera, and wholly between eye and near plane.
    let unseen: Vec<_> = quad([-1.0, -1.0, 2.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0])
        .into_iter()
        .chain(quad(
            [-0.02, -0.02, -0.05],
            [0.04, 0.0, 0.0],
            [0.0, 0.04, 0.0],
        ))
        .collect();
    let unseen = parts.mesh(soup("unseen", &unseen)?);
    parts.node(Node::with_part(
        "unseen",
        Transform::default(),
        unseen,
        green,
    ));

    // A triangle that covers the whole screen from 60 m away.
    let backdrop = [[
        [-900.0, -500.0, -60.0],
        [900.0, -500.0, -60.0],
        [0.0, 1500.0, -60.0],
    ]];
    let backdrop = parts.mesh(soup("backdrop", &backdrop)?);
    parts.node(Node::with_part(
        "backdrop",
        Transform::default(),
        backdrop,
        green,
    ));

    // Boxes that the camera is in: one-sided, seen from inside it is culled.
    let around = parts.mesh(shapes::cuboid("around", [5.0, 0.9, 5.0])?);
    parts.node(Node::with_part("around", Transform::default(), around, red));
    let edge = parts.mesh(shapes::cuboid("edge", [0.3, 0.3, 0.3])?);
    let beside = Transform::turned([0.6, 0.5, -0.45], 0.5);
    parts.node(Node::with_part("beside", beside, edge, red));
    parts.viewpoints.push(Viewpoint::Fixed(camera(
        [[0.0, 0.0, 0.01], [0.0, 0.0, -5.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, -5.0]],
        75.0,
    )?));
    Model::new(parts)
}

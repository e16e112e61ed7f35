//! Geometry as bad tools make it.
//!
//! For robustness: triangles without area draw nothing, doubled ones fight for
//! their depth, T-junctions crack, and an instance may be a mirror image, flat
//! or a point.

use super::{camera, quad, soup};
use crate::model::{
    Material, Mesh, Model, ModelError, ModelParts, Node, Transform, Vertices, Viewpoint, shapes,
};

pub(super) fn build() -> Result<Model, ModelError> {
    let mut parts = ModelParts::default();
    let grey = parts.material(Material::dielectric("grey", [0.5; 3], 0.7));
    let red = parts.material(Material::dielectric("red", [0.8, 0.1, 0.05], 0.6));

    let collapsed = parts.mesh(collapsed()?);
    parts.node(Node::with_part(
        "collapsed",
        Transform::at([-1.6, 0.4, -4.0]),
        collapsed,
        grey,
    ));

    // Two coplanar squares that overlap by a half, in different colours.
    let square = quad([-0.5, -0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let square = parts.mesh(soup("square", &square)?);
    parts.node(Node::with_part(
        "overlap",
        Transform::at([0.0, 0.4, -4.0]),
        square,
        grey,
    ));
    parts.node(Node::with_part(
        "overlap",
        Transform::at([0.5, 0.4, -4.0]),
        square,
        red,
    ));

    // One edge against two halves of it: the corner between is on the edge only
    // up to rounding.
    let junction = [
        [[0.0, 0.0, 0.0], [1.0, 0.3, 0.0], [0.1, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.2, -0.8, 0.0], [1.0 / 3.0, 0.1, 0.0]],
        [[1.0 / 3.0, 0.1, 0.0], [0.2, -0.8, 0.0], [1.0, 0.3, 0.0]],
    ];
    let junction = parts.mesh(soup("junction", &junction)?);
    parts.node(Node::with_part(
        "junction",
        Transform::at([1.4, 0.4, -4.0]),
        junction,
        grey,
    ));

    let ball = parts.mesh(shapes::icosphere("ball", 0.4, 2)?);
    let scaled = |translation, scale| Transform::Trs {
        translation,
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale,
    };
    for (name, x, scale) in [
        ("mirrored", -1.6, [-1.0, 1.0, 1.0]),
        ("inside out twice", -0.6, [-1.0, -1.0, 1.0]),
        ("flat", 0.4, [1.0, 1.0, 0.0]),
        ("line", 1.2, [0.0, 1.0, 0.0]),
        ("point", 1.6, [0.0; 3]),
        ("tiny", 2.0, [1e-6; 3]),
    ] {
        parts.node(Node::with_part(
            name,
            scaled([x, -0.8, -4.0], scale),
            ball,
            grey,
        ));
    }
    parts.viewpoints.push(Viewpoint::Fixed(camera(
        [[0.0, 0.0, 0.02], [0.0, -0.1, -4.0]],
        [[0.0, 0.0, 0.0], [0.0, -0.1, -4.0]],
        45.0,
    )?));
    Model::new(parts)
}

/// A square with every kind of triangle that draws nothing.
fn collapsed() -> Result<Mesh, ModelError> {
    let vertices = Vertices {
        positions: vec![
            [-0.5, -0.5, 0.0],
            [0.5, -0.5, 0.0],
            [0.5, 0.5, 0.0],
            [-0.5, 0.5, 0.0],
            // A copy of the first, and the middle of an edge.
            [-0.5, -0.5, 0.0],
            [0.0, -0.5, 0.0],
        ],
        normals: vec![[0.0, 0.0, 1.0]; 6],
        ..Vertices::default()
    };
    let triangles = vec![
        [0, 1, 2],
        [4, 2, 3],
        // One corner three times, two corners, a copy, and three on a line.
        [1, 1, 1],
        [0, 0, 2],
        [0, 4, 1],
        [0, 5, 1],
    ];
    Mesh::new("collapsed", vertices, triangles)
}

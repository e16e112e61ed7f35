//! Procedural models for backends to draw, each made for something that
//! rasterisers, or who compares them, get wrong.

mod crossing;
mod degenerate;
mod gallery;
mod stairs;
mod thin;

use crate::camera::{Camera, CameraError, Pose};
use crate::model::{Mesh, Model, ModelError, Place, Vertices};

/// A model of the registry. It has at least one viewpoint.
#[derive(Clone, Copy, Debug)]
pub struct ModelEntry {
    /// By which it is known: lower case and hyphens.
    pub name: &'static str,
    /// What it shows and what it is for.
    pub description: &'static str,
    /// Makes the model.
    pub build: fn() -> Result<Model, ModelError>,
}

/// All models.
#[must_use]
pub const fn models() -> &'static [ModelEntry] {
    &[
        ModelEntry {
            name: "gallery",
            description: "Metal, plastic, a normal map, glowing and glass things under three lights, a rolling ball, a weapon before a moving camera",
            build: gallery::build,
        },
        ModelEntry {
            name: "stairs",
            description: "A flight of steps from 2 m to 10 km away, whose depths span nearly four decades",
            build: stairs::build,
        },
        ModelEntry {
            name: "thin",
            description: "Posts thinner than a pixel, needles that meet in one point, slivers between pixel centres",
            build: thin::build,
        },
        ModelEntry {
            name: "crossing",
            description: "Triangles across the near plane, behind the camera, around it, and larger than the screen",
            build: crossing::build,
        },
        ModelEntry {
            name: "degenerate",
            description: "Triangles without area, doubled vertices and surfaces, T-junctions, mirrored and flattened instances",
            build: degenerate::build,
        },
    ]
}

/// The model of a name.
#[must_use]
pub fn model(name: &str) -> Option<&'static ModelEntry> {
    models().iter().find(|entry| entry.name == name)
}

/// A camera that moved from `before` to `now` in a frame's time.
fn camera(
    before: [[f64; 3]; 2],
    now: [[f64; 3]; 2],
    vertical_fov_degrees: f64,
) -> Result<Camera, ModelError> {
    let pose = |[position, target]: [[f64; 3]; 2]| {
        Pose::look_at(position.into(), target.into(), glam::DVec3::Y)
    };
    let made = || -> Result<Camera, CameraError> {
        Ok(Camera::new(pose(now)?, vertical_fov_degrees.to_radians())?.moved_from(pose(before)?))
    };
    made().map_err(|source| ModelError::Camera {
        place: Place {
            kind: "viewpoint",
            index: None,
            name: String::new(),
        },
        source: Box::new(source),
    })
}

/// A mesh of single triangles with flat normals and no texture coordinates.
fn soup(name: &str, triangles: &[[[f32; 3]; 3]]) -> Result<Mesh, ModelError> {
    let vertices = Vertices {
        positions: triangles.as_flattened().to_vec(),
        ..Vertices::default()
    };
    let indices: Vec<_> = (0..triangles.len() as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    let (vertices, indices) = crate::model::flat_normals(&vertices, &indices);
    Mesh::new(name, vertices, indices)
}

/// Both triangles of a parallelogram, seen from where `u × v` points.
fn quad(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> [[[f32; 3]; 3]; 2] {
    let add = |a: [f32; 3], b: [f32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let (b, d) = (add(corner, u), add(corner, v));
    let c = add(b, v);
    [[corner, b, c], [corner, c, d]]
}

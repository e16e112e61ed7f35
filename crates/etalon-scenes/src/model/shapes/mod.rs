//! Meshes by closed forms, each with normals, tangents and one set of texture
//! coordinates. Front faces are outside; seen from there an image is upright
//! and not mirrored. Seams have vertices on both sides at the same bits, so
//! that welding by position closes what is closed.
//!
//! Lengths are in metres and over 0, counts at least what the shape needs; every
//! function refuses others, and meshes of over [`MAX_SHAPE_VERTICES`] vertices
//! before making any.

mod flat;
mod icosphere;
mod round;

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::error::{Check, ModelError, Place};
use super::mesh::{Mesh, Vertices};

pub use flat::{cuboid, grid, panes};
pub use icosphere::icosphere;
pub use round::{cone, cylinder, torus, uv_sphere};

/// Most vertices of a shape.
pub const MAX_SHAPE_VERTICES: u64 = 1 << 22;

/// One vertex of a shape.
#[derive(Clone, Copy)]
struct Corner {
    position: DVec3,
    normal: DVec3,
    /// Along growing u.
    tangent: DVec3,
    uv: DVec2,
}

/// Collects vertices and triangles.
struct Shell {
    vertices: Vertices,
    triangles: Vec<[u32; 3]>,
}

impl Shell {
    /// A shell that will have about `vertices` of them, if that is not too many.
    fn new(place: &Place, vertices: u64) -> Result<Self, ModelError> {
        if vertices > MAX_SHAPE_VERTICES {
            return Err(ModelError::Count {
                place: place.clone(),
                what: "vertices",
                count: vertices,
                need: format!("at most {MAX_SHAPE_VERTICES}"),
            });
        }
        Ok(Self {
            vertices: Vertices::default(),
            triangles: Vec::new(),
        })
    }

    fn corner(&mut self, corner: Corner) -> u32 {
        let index = self.vertices.positions.len() as u32;
        let Corner {
            position,
            normal,
            tangent,
            uv,
        } = corner;
        self.vertices.positions.push(position.as_vec3().to_array());
        self.vertices.normals.push(normal.as_vec3().to_array());
        self.vertices
            .tangents
            .push(tangent.as_vec3().extend(1.0).to_array());
        self.vertices.uv[0].push(uv.as_vec2().to_array());
        index
    }

    /// A surface over `columns × rows` cells; `at(i, j)` is the corner in
    /// column `i` from the left and row `j` from the top, seen from outside.
    fn patch(&mut self, columns: u32, rows: u32, at: impl Fn(u32, u32) -> Corner) {
        let first = self.vertices.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                self.corner(at(i, j));
            }
        }
        let index = |i: u32, j: u32| first + j * (columns + 1) + i;
        for j in 0..rows {
            for i in 0..columns {
                let (a, b) = (index(i, j), index(i, j + 1));
                let (c, d) = (index(i + 1, j + 1), index(i + 1, j));
                self.triangles.push([a, b, c]);
                self.triangles.push([a, c, d]);
            }
        }
    }

    fn finish(self, place: &Place) -> Result<Mesh, ModelError> {
        Mesh::new(place.name.clone(), self.vertices, self.triangles)
    }
}

/// Sine and cosine of `count` equal parts of a turn; the sine is x and the
/// cosine z of directions that go to the right, seen from outside.
fn circle(count: u32) -> Vec<DVec2> {
    (0..count)
        .map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(count)).sin_cos();
            DVec2::new(sin, cos)
        })
        .collect()
}

fn lengths<const N: usize>(
    place: &Place,
    values: [(&'static str, f32); N],
) -> Result<[f64; N], ModelError> {
    for (what, value) in values {
        Check(place).value(
            what,
            value,
            "finite and over 0",
            value > 0.0 && value.is_finite(),
        )?;
    }
    Ok(values.map(|(_, value)| f64::from(value)))
}

fn counts(place: &Place, values: &[(&'static str, u32, u32)]) -> Result<(), ModelError> {
    for &(what, count, least) in values {
        Check(place).count(
            what,
            count as usize,
            format!("at least {least}"),
            count >= least,
        )?;
    }
    Ok(())
}

/// One more than a count, to multiply without overflow.
fn more(count: u32) -> u64 {
    u64::from(count) + 1
}

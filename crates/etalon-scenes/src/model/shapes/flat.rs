//! Shapes of flat faces.

use glam::{DVec2, DVec3};

use super::{Corner, Shell, circle, counts, lengths, more};
use crate::model::error::{ModelError, Place};
use crate::model::mesh::Mesh;

/// A rectangle in the plane y = 0, facing up, around the origin: `size` along x
/// and z, cut into `cells` along either. u grows with x, v with z.
///
/// # Errors
/// If a size is not positive, or there are no cells or too many.
pub fn grid(name: &str, size: [f32; 2], cells: [u32; 2]) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [width, depth] = lengths(&place, [("width", size[0]), ("depth", size[1])])?;
    let [columns, rows] = cells;
    counts(&place, &[("columns", columns, 1), ("rows", rows, 1)])?;
    let mut shell = Shell::new(&place, more(columns).saturating_mul(more(rows)))?;
    shell.patch(columns, rows, |i, j| {
        let u = f64::from(i) / f64::from(columns);
        let v = f64::from(j) / f64::from(rows);
        Corner {
            position: DVec3::new((u - 0.5) * width, 0.0, (v - 0.5) * depth),
            normal: DVec3::Y,
            tangent: DVec3::X,
            uv: DVec2::new(u, v),
        }
    });
    shell.finish(&place)
}

/// A box around the origin with half its edge lengths; each face shows the
/// whole image.
///
/// # Errors
/// If an edge is not positive.
pub fn cuboid(name: &str, half: [f32; 3]) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let half = lengths(
        &place,
        [
            ("half edge along x", half[0]),
            ("half edge along y", half[1]),
            ("half edge along z", half[2]),
        ],
    )?;
    let half = DVec3::from_array(half);
    let mut shell = Shell::new(&place, 24)?;
    // Outward, and to the right as seen from outside.
    for (normal, right) in [
        (DVec3::X, DVec3::NEG_Z),
        (DVec3::NEG_X, DVec3::Z),
        (DVec3::Y, DVec3::X),
        (DVec3::NEG_Y, DVec3::X),
        (DVec3::Z, DVec3::X),
        (DVec3::NEG_Z, DVec3::NEG_X),
    ] {
        let up = normal.cross(right);
        shell.patch(1, 1, |i, j| {
            let (u, v) = (f64::from(i), f64::from(j));
            Corner {
                position: (normal + right * (2.0 * u - 1.0) + up * (1.0 - 2.0 * v)) * half,
                normal,
                tangent: right,
                uv: DVec2::new(u, v),
            }
        });
    }
    shell.finish(&place)
}

/// Upright rectangles of `size` (width, height), `count` of them in a ring of
/// `radius` around the y axis, facing outward, from y = 0 up. They are seen from
/// outside; a material that is double sided shows them from both.
///
/// # Errors
/// If a length is not positive, or there are no panes or too many.
pub fn panes(name: &str, radius: f32, count: u32, size: [f32; 2]) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [radius, width, height] = lengths(
        &place,
        [("radius", radius), ("width", size[0]), ("height", size[1])],
    )?;
    counts(&place, &[("panes", count, 1)])?;
    let mut shell = Shell::new(&place, u64::from(count) * 4)?;
    for direction in circle(count) {
        let normal = DVec3::new(direction.x, 0.0, direction.y);
        let right = DVec3::Y.cross(normal);
        shell.patch(1, 1, |i, j| {
            let (u, v) = (f64::from(i), f64::from(j));
            Corner {
                position: normal * radius
                    + right * ((u - 0.5) * width)
                    + DVec3::Y * ((1.0 - v) * height),
                normal,
                tangent: right,
                uv: DVec2::new(u, v),
            }
        });
    }
    shell.finish(&place)
}

//! A sphere of nearly equal triangles.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{Corner, Shell, lengths};
use crate::model::error::{Check, ModelError, Place};
use crate::model::mesh::Mesh;

/// A sphere around the origin from an icosahedron, each of whose triangles is
/// cut into four `subdivisions` times, at most 9: `20 · 4^subdivisions`
/// triangles. Texture coordinates are those of [`super::uv_sphere`], with u up to 1.5
/// where a triangle crosses the seam.
///
/// # Errors
/// If the radius is not positive or there are too many subdivisions.
pub fn icosphere(name: &str, radius: f32, subdivisions: u32) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [radius] = lengths(&place, [("radius", radius)])?;
    Check(&place).value("subdivisions", subdivisions, "at most 9", subdivisions <= 9)?;
    let faces = 20_u64 << (2 * subdivisions);
    // Euler: half as many vertices as triangles, and 2; seams add some.
    let mut shell = Shell::new(&place, faces / 2 + 2)?;
    let (directions, triangles) = directions(subdivisions);
    // One vertex for each direction and u that it is seen at.
    let mut known: BTreeMap<(u32, u64), u32> = BTreeMap::new();
    for triangle in triangles {
        let at = triangle.map(|i| directions[i as usize]);
        for (i, u) in columns(at).into_iter().enumerate() {
            let index = *known.entry((triangle[i], u.to_bits())).or_insert_with(|| {
                let (sin, cos) = (u * TAU).sin_cos();
                shell.corner(Corner {
                    position: at[i] * radius,
                    normal: at[i],
                    tangent: DVec3::new(cos, 0.0, -sin),
                    uv: DVec2::new(u, at[i].y.clamp(-1.0, 1.0).acos() / PI),
                })
            });
            if i == 0 {
                shell.triangles.push([index; 3]);
            } else if let Some(last) = shell.triangles.last_mut() {
                last[i] = index;
            }
        }
    }
    shell.finish(&place)
}

/// The u of three directions, without a jump between them.
fn columns(at: [DVec3; 3]) -> [f64; 3] {
    let u = at.map(|d| {
        let u = d.x.atan2(d.z) / TAU;
        if u < 0.0 { u + 1.0 } else { u }
    });
    let pole = at.map(|d| d.x == 0.0 && d.z == 0.0);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in (0..3).filter(|&i| !pole[i]) {
        (least, most) = (least.min(u[i]), most.max(u[i]));
    }
    let u = if most - least > 0.5 {
        u.map(|u| if u < 0.5 { u + 1.0 } else { u })
    } else {
        u
    };
    // A pole is in the middle of its triangle's column.
    std::array::from_fn(|i| {
        if pole[i] {
            0.5 * (u[(i + 1) % 3] + u[(i + 2) % 3])
        } else {
            u[i]
        }
    })
}

fn directions(subdivisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let ball = crate::trace::Mesh::icosahedron(DVec3::ZERO, 1.0);
    let mut directions: Vec<_> = ball.positions.iter().map(|p| p.normalize()).collect();
    let mut triangles: Vec<[u32; 3]> = ball
        .triangles
        .iter()
        .map(|&[a, b, c]| {
            let [p, q, r] = [a, b, c].map(|i| directions[i as usize]);
            if (q - p).cross(r - p).dot(p) > 0.0 {
                [a, b, c]
            } else {
                [a, c, b]
            }
        })
        .collect();
    for _ in 0..subdivisions {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = directions[a as usize] + directions[b as usize];
                directions.push(sum.normalize());
                directions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (directions, triangles)
}

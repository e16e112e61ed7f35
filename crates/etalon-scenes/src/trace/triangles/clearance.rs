//! Whether a pixel shows one triangle and nothing else.
//!
//! Not by trying rays, between which slivers pass, but by clipping: the square
//! around the pixel's centre and the eye make a pyramid, and every triangle that
//! reaches into it is found through the hierarchy and clipped against it.

use glam::{DVec2, DVec3};

use super::{Faces, TriangleScene, area_vector};
use crate::camera::{Camera, Projection};

/// What is seen around a pixel's centre: a pyramid from the eye, without its tip
/// before the near plane.
pub(super) struct Pyramid {
    eye: DVec3,
    /// Directions of its edges, around; each has length 1 along the view axis.
    edges: [DVec3; 4],
    /// Inward normals of its sides, which pass through the eye.
    sides: [DVec3; 4],
    forward: DVec3,
    near: f64,
}

impl Pyramid {
    /// Around the place `uv` of the picture, `reach` in uv units to each side.
    pub(super) fn new(camera: &Camera, projection: &Projection, uv: DVec2, reach: DVec2) -> Self {
        let orientation = camera.pose().orientation();
        let around = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let edges =
            around.map(|(x, y)| orientation * projection.direction(uv + reach * DVec2::new(x, y)));
        let middle = orientation * projection.direction(uv);
        let sides = [0, 1, 2, 3].map(|i| {
            let normal = edges[i].cross(edges[(i + 1) % 4]).normalize_or_zero();
            if normal.dot(middle) < 0.0 {
                -normal
            } else {
                normal
            }
        });
        Self {
            eye: camera.pose().position(),
            edges,
            sides,
            forward: -orientation.z_axis,
            near: projection.near(),
        }
    }

    /// Whether a triangle, relative to the eye, is met by every ray within.
    fn is_covered_by(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let det = a.dot(b.cross(c));
        let normal = (b - a).cross(c - a);
        let planes = [a.cross(b), b.cross(c), c.cross(a)];
        self.edges.iter().all(|&edge| {
            // Within the cone of the triangle, and met in front of the eye from
            // the near plane on. No comparison holds for NaN.
            planes
                .iter()
                .all(|plane| plane.dot(edge) * det.signum() > 0.0)
                && det / normal.dot(edge) >= self.near
        })
    }

    /// Planes, relative to the eye, that everything within is on the inner side of.
    fn planes(&self) -> [(DVec3, f64); 5] {
        let [a, b, c, d] = self.sides.map(|side| (side, 0.0));
        [a, b, c, d, (self.forward, self.near)]
    }
}

impl TriangleScene<'_> {
    /// Whether all rays within the pyramid hit the triangle `seen`, or nothing
    /// if it is `None`, and no other surface is in front of it or behind it by
    /// under `separation`, in parts of the distance.
    pub(super) fn is_clear(
        &self,
        pyramid: &Pyramid,
        seen: Option<u32>,
        separation: f64,
        faces: Faces,
    ) -> bool {
        let eye = pyramid.eye;
        let relative = |index: u32| {
            self.triangles[index as usize]
                .corners
                .map(|corner| corner - eye)
        };
        // Five planes of the pyramid, and that of the triangle seen.
        let mut region = [(DVec3::ZERO, 0.0); 6];
        region[..5].copy_from_slice(&pyramid.planes());
        let mut count = 5;
        if let Some(seen) = seen {
            let corners = relative(seen);
            if !pyramid.is_covered_by(corners) {
                return false;
            }
            let Some(normal) = area_vector(&corners).try_normalize() else {
                return false;
            };
            let distance = normal.dot(corners[0]);
            // Towards the eye, which is at 0.
            let (normal, distance) = if distance > 0.0 {
                (-normal, -distance)
            } else {
                (normal, distance)
            };
            let furthest = (pyramid.edges.iter())
                .map(|edge| distance / normal.dot(*edge) * edge.length())
                .fold(0.0, f64::max);
            region[5] = (normal, distance - separation * furthest);
            count = 6;
        }
        let region = &region[..count];
        let mut world = [(DVec3::ZERO, 0.0); 6];
        for (world, &(normal, distance)) in world.iter_mut().zip(region) {
            *world = (normal, distance + normal.dot(eye));
        }
        let mut clear = true;
        self.bvh.overlapping(&world[..count], |index| {
            if Some(index) != seen {
                let corners = relative(index);
                let towards = -area_vector(&corners).dot(corners[0]) > 0.0;
                clear = !(self.counts(&self.triangles[index as usize], towards, faces)
                    && reaches_into(corners, region));
            }
            clear
        });
        clear
    }
}

/// Whether any point of a triangle is on the inner side of all planes
/// (Sutherland and Hodgman, “Reentrant Polygon Clipping”, CACM 17(1), 1974).
fn reaches_into(corners: [DVec3; 3], region: &[(DVec3, f64)]) -> bool {
    // Each plane adds one corner at most.
    let mut polygon = [DVec3::ZERO; 16];
    polygon[..3].copy_from_slice(&corners);
    let mut count = 3;
    for &(normal, distance) in region {
        let height = |p: DVec3| normal.dot(p) - distance;
        let mut clipped = [DVec3::ZERO; 16];
        let mut kept = 0;
        let mut keep = |p: DVec3| {
            if kept < clipped.len() {
                clipped[kept] = p;
                kept += 1;
            }
        };
        for i in 0..count {
            let (p, q) = (polygon[i], polygon[(i + 1) % count]);
            let (a, b) = (height(p), height(q));
            if a >= 0.0 {
                keep(p);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                keep(p + (q - p) * (a / (a - b)));
            }
        }
        if kept == 0 {
            return false;
        }
        (polygon, count) = (clipped, kept);
    }
    true
}

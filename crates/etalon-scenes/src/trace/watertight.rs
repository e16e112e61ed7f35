//! Rays and triangles that share edges.

use glam::DVec3;

use super::ray::Ray;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub(crate) t: f64,
    /// Weights of the corners; none is negative, and their sum is 1.
    pub(crate) weights: [f64; 3],
    /// Whether the corners wind counter-clockwise, seen from the ray's start.
    pub(crate) counter_clockwise: bool,
}

/// Watertight intersection after Woop, Benthin and Wald, “Watertight
/// Ray/Triangle Intersection”, JCGT 2(1), 2013: two triangles that share an
/// edge compute the same value for it, so no ray passes between them. Of a
/// difference of two products, each rounded, the sign is right or 0, and 0
/// counts as inside: a ray through an edge or corner hits all that share it.
///
/// `None` for rays within the triangle's plane, triangles without area, and
/// where a NaN is involved.
pub(crate) fn cross(ray: &Ray, corners: &[DVec3; 3]) -> Option<Crossing> {
    let d = ray.direction();
    let kz = d.abs().max_position();
    let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
    // Keeps the winding, and with it the signs below.
    if d[kz] < 0.0 {
        std::mem::swap(&mut kx, &mut ky);
    }
    let (sx, sy, sz) = (d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]);
    let [a, b, c] = corners.map(|corner| corner - ray.origin());
    let shear = |p: DVec3| (p[kx] - sx * p[kz], p[ky] - sy * p[kz]);
    let ((ax, ay), (bx, by), (cx, cy)) = (shear(a), shear(b), shear(c));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let any_negative = u < 0.0 || v < 0.0 || w < 0.0;
    let any_positive = u > 0.0 || v > 0.0 || w > 0.0;
    let det = u + v + w;
    if (any_negative && any_positive) || det == 0.0 {
        return None;
    }
    let t = (u * sz * a[kz] + v * sz * b[kz] + w * sz * c[kz]) / det;
    if !(t > ray.start() && t.is_finite()) {
        return None;
    }
    Some(Crossing {
        t,
        weights: [u / det, v / det, w / det],
        // In the paper's axes the ray runs along +z, so that seen from its
        // start x and y are mirrored.
        counter_clockwise: det > 0.0,
    })
}

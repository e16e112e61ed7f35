//! The shapes a scene is made of, as its author describes them.

use glam::{DMat3, DVec3};

/// A surface in world space. Units are metres by convention.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// An infinite plane.
    Plane {
        /// Any of its points.
        point: DVec3,
        /// Its normal, of any length but zero.
        normal: DVec3,
    },
    /// A rectangle, seen from both sides.
    Rectangle {
        /// Its middle.
        center: DVec3,
        /// From the middle to the middle of one edge.
        half_u: DVec3,
        /// From the middle to the middle of a neighbouring edge, at a right angle to `half_u`.
        half_v: DVec3,
    },
    /// A disc, seen from both sides.
    Disc {
        /// Its middle.
        center: DVec3,
        /// Its normal, of any length but zero.
        normal: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// A sphere.
    Sphere {
        /// Its middle.
        center: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// A box with edges in any three orthogonal directions.
    Box {
        /// Its middle.
        center: DVec3,
        /// Half its edge lengths.
        half: DVec3,
        /// The directions of its edges: a rotation, columns in world space.
        orientation: DMat3,
    },
    /// Triangles.
    Mesh(Mesh),
}

impl Shape {
    /// A box with edges along the world's axes.
    #[must_use]
    pub const fn aligned_box(center: DVec3, half: DVec3) -> Self {
        Self::Box {
            center,
            half,
            orientation: DMat3::IDENTITY,
        }
    }

    /// A box turned about the vertical through its middle, `angle` in radians.
    #[must_use]
    pub fn turned_box(center: DVec3, half: DVec3, angle: f64) -> Self {
        Self::Box {
            center,
            half,
            orientation: DMat3::from_rotation_y(angle),
        }
    }
}

/// Triangles with shared corners. Each is flat and seen from both sides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners.
    pub positions: Vec<DVec3>,
    /// Three indices into `positions` each.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The regular icosahedron of the given circumradius.
    #[must_use]
    pub fn icosahedron(center: DVec3, radius: f64) -> Self {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let scale = radius / (1.0 + golden * golden).sqrt();
        let mut positions = Vec::with_capacity(12);
        for (a, b) in [
            (-1.0, -golden),
            (1.0, -golden),
            (-1.0, golden),
            (1.0, golden),
        ] {
            positions.push(center + DVec3::new(a, b, 0.0) * scale);
            positions.push(center + DVec3::new(0.0, a, b) * scale);
            positions.push(center + DVec3::new(b, 0.0, a) * scale);
        }
        // Faces are the triples of corners at one edge length, 2 · scale, of each other.
        let neighbours = |a: usize, b: usize| {
            (positions[a].distance(positions[b]) / (2.0 * scale) - 1.0).abs() < 1e-6
        };
        let mut triangles = Vec::with_capacity(20);
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    if neighbours(a, b) && neighbours(b, c) && neighbours(a, c) {
                        triangles.push([a as u32, b as u32, c as u32]);
                    }
                }
            }
        }
        Self {
            positions,
            triangles,
        }
    }

    /// A tube of circular section around a (2, 3) torus knot standing on its
    /// side: `around` steps along the knot, `across` around the tube, of either
    /// at most 4096.
    #[must_use]
    pub fn knot(center: DVec3, size: f64, tube: f64, around: u32, across: u32) -> Self {
        let (around, across) = (around.min(4096), across.min(4096));
        let turn = std::f64::consts::TAU;
        let point = |s: f64| {
            let (p, q) = (2.0 * turn * s, 3.0 * turn * s);
            let r = 1.0 + 0.45 * q.cos();
            center + DVec3::new(r * p.cos(), r * p.sin(), 0.45 * q.sin()) * size
        };
        let mut positions = Vec::new();
        for i in 0..around {
            let s = f64::from(i) / f64::from(around);
            let step = 1e-4;
            let tangent = (point(s + step) - point(s - step)).normalize_or(DVec3::X);
            // The direction from the knot's axis varies smoothly and is never
            // along the curve, so the frame does not twist suddenly.
            let outward = (point(s) - center)
                .reject_from_normalized(tangent)
                .normalize_or(DVec3::Y);
            let side = tangent.cross(outward);
            for j in 0..across {
                let (sin, cos) = (turn * f64::from(j) / f64::from(across)).sin_cos();
                positions.push(point(s) + (outward * cos + side * sin) * tube);
            }
        }
        let mut triangles = Vec::new();
        for i in 0..around {
            for j in 0..across {
                let index = |i: u32, j: u32| (i % around) * across + j % across;
                let (a, b, c, d) = (
                    index(i, j),
                    index(i + 1, j),
                    index(i + 1, j + 1),
                    index(i, j + 1),
                );
                triangles.push([a, b, c]);
                triangles.push([a, c, d]);
            }
        }
        Self {
            positions,
            triangles,
        }
    }
}

//! Cutting triangles off where they reach out of what can be drawn.
//!
//! In `f64`, between the vertex that is inside and the one that is not, whichever
//! way round the edge is: triangles that share an edge share the cut.

use super::planes::{GUARD_END, GUARD_START, ViewportMap};

/// A vertex of a polygon in clip space.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ClipVertex {
    pub(super) position: [f64; 4],
    /// How much of each of the triangle's corners is in it.
    pub(super) weights: [f64; 3],
}

/// Most vertices: each of the six planes adds one at most.
pub(super) const MAX_VERTICES: usize = 9;

/// A convex polygon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polygon {
    vertices: [ClipVertex; MAX_VERTICES],
    count: usize,
}

impl Polygon {
    pub(super) fn vertices(&self) -> &[ClipVertex] {
        &self.vertices[..self.count]
    }

    fn push(&mut self, vertex: ClipVertex) {
        if let Some(place) = self.vertices.get_mut(self.count) {
            *place = vertex;
            self.count += 1;
        }
    }

    /// Cuts off where a linear function of the position is negative.
    fn cut(&mut self, plane: [f64; 4]) {
        let distance = |vertex: &ClipVertex| {
            let [x, y, z, w] = vertex.position;
            plane[0] * x + plane[1] * y + plane[2] * z + plane[3] * w
        };
        let before = *self;
        self.count = 0;
        for (i, vertex) in before.vertices().iter().enumerate() {
            let next = &before.vertices[(i + 1) % before.count];
            let (here, there) = (distance(vertex), distance(next));
            if here >= 0.0 {
                self.push(*vertex);
            }
            if (here >= 0.0) != (there >= 0.0) {
                let ((inside, a), (outside, b)) = if here >= 0.0 {
                    ((vertex, here), (next, there))
                } else {
                    ((next, there), (vertex, here))
                };
                let t = a / (a - b);
                let mut cut = ClipVertex::default();
                for (k, cut) in cut.position.iter_mut().enumerate() {
                    *cut = inside.position[k] + t * (outside.position[k] - inside.position[k]);
                }
                // On the plane whatever was rounded, so that it stays inside of it.
                if let Some(axis) = (0..3).find(|axis| plane[*axis] != 0.0) {
                    cut.position[axis] = -plane[3] / plane[axis] * cut.position[3];
                }
                for (k, cut) in cut.weights.iter_mut().enumerate() {
                    *cut = inside.weights[k] * (1.0 - t) + outside.weights[k] * t;
                }
                self.push(cut);
            }
        }
    }
}

/// The part of a triangle that is between the near and the far plane and can be
/// held by fixed-point positions; fewer than three vertices if there is none.
pub(super) fn clip(positions: &[[f32; 4]; 3], map: &ViewportMap) -> Polygon {
    let mut polygon = Polygon {
        vertices: [ClipVertex::default(); MAX_VERTICES],
        count: 3,
    };
    for (i, (vertex, position)) in polygon.vertices.iter_mut().zip(positions).enumerate() {
        vertex.position = position.map(f64::from);
        vertex.weights[i] = 1.0;
    }
    // 0 <= z <= w, from which w >= 0.
    polygon.cut([0.0, 0.0, 1.0, 0.0]);
    polygon.cut([0.0, 0.0, -1.0, 1.0]);
    for axis in 0..2 {
        let scale = f64::from(map.scale[axis]);
        let offset = f64::from(map.offset[axis]);
        let mut plane = [0.0; 4];
        (plane[axis], plane[3]) = (scale, offset - f64::from(GUARD_START));
        polygon.cut(plane);
        (plane[axis], plane[3]) = (-scale, f64::from(GUARD_END) - offset);
        polygon.cut(plane);
    }
    polygon
}

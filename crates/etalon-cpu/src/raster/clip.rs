//! Cutting triangles off where they reach out of the picture.
//!
//! As llvmpipe does (Mesa, `draw_pipe_clip.c`), so that what it draws of such
//! triangles can come out with the same bits: one plane after the other, all four
//! sides of the viewport among them, in `f32`, each product and sum rounded. A new
//! vertex is measured from the end of its edge that is nearer to the plane. The guard
//! band has no width: one would leave corners far outside where they are, which costs
//! depth its digits, since it is interpolated from there.
//!
//! Where `f32` moves a cut by more than [`MOST_MOVED`], the same is done in `f64`:
//! the other end of an edge may be many kilometres away.

use super::planes::ViewportMap;

/// By how many pixels rounding may move a cut. In `f32` it does so by about 2⁻²⁴ of
/// the edge's length.
const MOST_MOVED: f64 = 1.0 / 16.0;

/// What is kept is where `dot(plane, position)` is not negative, in the order in which
/// it is cut: the right, left, top and bottom side, the near and the far plane.
pub(super) const PLANES: [[f64; 4]; 6] = [
    [-1.0, 0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0, 1.0],
    [0.0, -1.0, 0.0, 1.0],
    [0.0, 1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0, 1.0],
];

/// Most vertices of a polygon: each plane adds one.
const MAX_VERTICES: usize = 9;

/// Most vertices made: two for each plane.
pub(super) const MAX_CUTS: usize = 12;

/// A vertex on the edge between two others, which are numbered as in [`Polygon`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cut {
    pub(super) position: [f64; 4],
    pub(super) from: u8,
    pub(super) to: u8,
    /// How far it is on the way in clip space.
    pub(super) share: f64,
    /// The same in the picture.
    pub(super) linear_share: f64,
}

/// How results are rounded. Those of `f32` are had from `f64`: its sums, products and
/// quotients of such numbers are close enough to be rounded twice (S. Figueroa, "When
/// is double rounding innocuous?", 1995).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Arithmetic {
    F32,
    F64,
}

impl Arithmetic {
    fn rounded(self, value: f64) -> f64 {
        match self {
            Self::F32 => f64::from(value as f32),
            Self::F64 => value,
        }
    }

    /// `from + share · (to − from)`.
    fn between(self, from: f64, to: f64, share: f64) -> f64 {
        let way = self.rounded(to - from);
        self.rounded(from + self.rounded(share * way))
    }
}

/// A convex polygon: what is left of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polygon {
    arithmetic: Arithmetic,
    given: [[f32; 4]; 3],
    cuts: [Cut; MAX_CUTS],
    made: usize,
    vertices: [u8; MAX_VERTICES],
    count: usize,
}

impl Polygon {
    /// Cuts a triangle off at the planes whose bits are set. Its positions are finite.
    pub(super) fn clipped(given: [[f32; 4]; 3], planes: u32, map: &ViewportMap) -> Self {
        let [rounded, exact] = [Arithmetic::F32, Arithmetic::F64]
            .map(|arithmetic| Self::cut_by(given, planes, arithmetic));
        if rounded.is_near(&exact, map) {
            rounded
        } else {
            exact
        }
    }

    fn cut_by(given: [[f32; 4]; 3], planes: u32, arithmetic: Arithmetic) -> Self {
        let mut polygon = Self {
            arithmetic,
            given,
            cuts: [Cut::default(); MAX_CUTS],
            made: 0,
            vertices: [0, 1, 2, 0, 0, 0, 0, 0, 0],
            count: 3,
        };
        for (bit, plane) in PLANES.iter().enumerate() {
            if planes >> bit & 1 != 0 && polygon.cut(plane).is_none() {
                polygon.count = 0;
            }
        }
        polygon
    }

    /// Whether it is the same polygon but for [`MOST_MOVED`].
    fn is_near(&self, exact: &Self, map: &ViewportMap) -> bool {
        let near = |axis: usize, a: [f64; 4], b: [f64; 4]| {
            let moved = a[axis] / a[3] - b[axis] / b[3];
            moved.abs() * f64::from(map.scale[axis].abs()) <= MOST_MOVED
        };
        self.vertices() == exact.vertices()
            && self.vertices().iter().all(|&vertex| {
                let (a, b) = (self.position(vertex), exact.position(vertex));
                vertex < 3 || (near(0, a, b) && near(1, a, b))
            })
    }

    /// A number of a vertex made, of those of the two that it lies between.
    pub(super) fn between(&self, from: f32, to: f32, share: f64) -> f32 {
        let [from, to] = [from, to].map(f64::from);
        self.arithmetic.between(from, to, share) as f32
    }

    /// The vertices going round: 0 to 2 are the triangle's own, and 3 is the first of
    /// [`Polygon::cuts`]. Fewer than three if nothing is left.
    pub(super) fn vertices(&self) -> &[u8] {
        &self.vertices[..self.count]
    }

    /// The vertices made, each after those that it lies between.
    pub(super) fn cuts(&self) -> &[Cut] {
        &self.cuts[..self.made]
    }

    fn position(&self, vertex: u8) -> [f64; 4] {
        match usize::from(vertex) {
            own @ 0..3 => self.given[own].map(f64::from),
            made => self.cuts[made - 3].position,
        }
    }

    /// Cuts off where a plane is negative; `None` if it is no number, or if rounding
    /// made more vertices than a convex polygon has.
    fn cut(&mut self, plane: &[f64; 4]) -> Option<()> {
        let before = *self;
        let arithmetic = self.arithmetic;
        let round = |value| arithmetic.rounded(value);
        let distance = |vertex: u8| {
            let [x, y, z, w] = before.position(vertex);
            // At most two are not zero, so that one sum is rounded.
            let distance = plane[0] * x + plane[1] * y + plane[2] * z + plane[3] * w;
            Some(round(distance)).filter(|distance| distance.is_finite())
        };
        self.count = 0;
        for (i, &here) in before.vertices().iter().enumerate() {
            let next = before.vertices[(i + 1) % before.count];
            let (inner, outer) = (distance(here)?, distance(next)?);
            if inner >= 0.0 {
                self.push(here)?;
            }
            if (inner >= 0.0) == (outer >= 0.0) {
                continue;
            }
            let length = round(outer - inner);
            let from_next = if outer < 0.0 {
                -outer < inner
            } else {
                -inner >= outer
            };
            let (from, to, share) = if from_next {
                (next, here, round(outer / length))
            } else {
                (here, next, round(-inner / length))
            };
            let made = self.make(from, to, share)?;
            self.push(made)?;
        }
        Some(())
    }

    fn push(&mut self, vertex: u8) -> Option<()> {
        *self.vertices.get_mut(self.count)? = vertex;
        self.count += 1;
        Some(())
    }

    fn make(&mut self, from: u8, to: u8, share: f64) -> Option<u8> {
        let arithmetic = self.arithmetic;
        let (start, end) = (self.position(from), self.position(to));
        let mut position = [0.0; 4];
        for (axis, position) in position.iter_mut().enumerate() {
            *position = arithmetic.between(start[axis], end[axis], share);
        }
        // Along the axis on which the ends are further from each other in the picture.
        let along = |axis: usize| {
            let place = |position: [f64; 4]| position[axis] / position[3];
            [position, end].map(|to| place(to) - place(start))
        };
        let [[x, width], [y, height]] = [along(0), along(1)];
        let linear_share = if width.abs() >= height.abs() {
            x / width
        } else {
            y / height
        };
        let linear_share = if linear_share.is_finite() {
            linear_share
        } else {
            share
        };
        *self.cuts.get_mut(self.made)? = Cut {
            position,
            from,
            to,
            share,
            linear_share,
        };
        self.made += 1;
        Some(self.made as u8 + 2)
    }
}

//! Triangles made ready to be drawn, and sorted into tiles.

use std::sync::{Mutex, PoisonError};

use etalon_core::Format;
use etalon_core::raster::{CullMode, DepthBias, FrontFace};

use super::clip::{MAX_CUTS, Polygon};
use super::error::RasterError;
use super::indices::Assembly;
use super::planes::{Corner, Gradients, MAX_TARGET, Plane, SUB_PIXELS, Shape, ViewportMap, snap};
use super::vertex::{BAD, CORNER, FLAGS, HEAD, Vertices};
use super::{RasterProgram, StageOutput};
use crate::exec::Executor;
use crate::ir::{Interpolation, StageInput};

/// Pixels of a tile along each axis.
pub(super) const TILE: u32 = 64;

/// Triangles of a chunk, which one worker makes ready.
const CHUNK: usize = 2048;

/// Triangles over more tiles than this are kept in a list that all tiles look
/// through: what is kept for a triangle is bounded.
const LARGE: u32 = 64;

/// Marks a vertex of the chunk's own, not of the vertex kernel.
const CUT: u32 = 1 << 31;

/// A triangle that covers something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// `a · x + b · y + c >= 0` for each edge at the pixels `(x, y)` inside.
    pub(super) a: [i32; 3],
    pub(super) b: [i32; 3],
    pub(super) c: [i64; 3],
    /// First and last pixels in x and y.
    pub(super) bounds: [u16; 4],
    /// Depth, from the first pixel of the target.
    pub(super) z: Plane,
    /// Added to depth.
    pub(super) bias: f32,
    /// 1 / w, around the first corner.
    pub(super) w: Plane,
    pub(super) gradients: Gradients,
    /// 1 / w at the corners.
    pub(super) corner_w: [f32; 3],
    vertices: [u32; 3],
    provoking: u32,
    pub(super) front: bool,
}

/// Some triangles in their order.
#[derive(Default)]
pub(super) struct Chunk {
    pub(super) triangles: Vec<Triangle>,
    /// Words of the vertices that clipping made.
    cut: Vec<u32>,
    /// Triangles by tile; those of tile `t` are from `starts[t]` on.
    starts: Vec<u32>,
    list: Vec<u32>,
    /// Triangles over many tiles.
    pub(super) large: Vec<u32>,
}

impl Chunk {
    /// The triangles of a tile in their order, but for the large ones.
    pub(super) fn in_tile(&self, tile: usize) -> &[u32] {
        match self.starts.get(tile..tile + 2) {
            Some(&[start, end]) => self.list.get(start as usize..end as usize).unwrap_or(&[]),
            _ => &[],
        }
    }

    /// The words of a vertex.
    fn vertex<'a>(&'a self, vertices: &'a Vertices, vertex: u32) -> &'a [u32] {
        let stride = vertices.stride;
        let (words, number) = if vertex & CUT == 0 {
            (&vertices.words, vertex as usize)
        } else {
            (&self.cut, (vertex & !CUT) as usize)
        };
        words
            .get(number * stride..(number + 1) * stride)
            .unwrap_or(&[])
    }

    /// The varyings of a triangle's corners, and of the first one it was given with.
    pub(super) fn varyings<'a>(
        &'a self,
        vertices: &'a Vertices,
        triangle: &Triangle,
    ) -> ([&'a [u32]; 3], &'a [u32]) {
        let of = |vertex| self.vertex(vertices, vertex).get(HEAD..).unwrap_or(&[]);
        (triangle.vertices.map(of), of(triangle.provoking))
    }
}

/// The pixels that are drawn to: from the first to one past the last in x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Region {
    pub(super) x: [u32; 2],
    pub(super) y: [u32; 2],
}

impl Region {
    pub(super) fn is_empty(&self) -> bool {
        self.x[0] >= self.x[1] || self.y[0] >= self.y[1]
    }

    /// First and one past the last tile in x and y.
    pub(super) fn tiles(&self) -> [[u32; 2]; 2] {
        [self.x, self.y].map(|[first, end]| [first / TILE, end.div_ceil(TILE)])
    }

    pub(super) fn tile_count(&self) -> usize {
        let [[x0, x1], [y0, y1]] = self.tiles();
        (x1 - x0) as usize * (y1 - y0) as usize
    }
}

/// What triangles are made ready with.
pub(super) struct Setup<'a> {
    pub(super) executor: &'a Executor,
    pub(super) assembly: &'a Assembly,
    pub(super) vertices: &'a Vertices,
    pub(super) map: &'a ViewportMap,
    pub(super) region: Region,
}

/// The corners of one triangle, as its vertices' words.
struct Given<'a> {
    vertices: [u32; 3],
    words: [&'a [u32]; 3],
}

/// Where a vertex is in the picture.
fn corner_of(words: &[u32]) -> Corner {
    let [x, y, z, w] = [0, 1, 2, 3].map(|axis| f32::from_bits(words[CORNER + axis]));
    Corner { x, y, z, w }
}

impl RasterProgram {
    /// Makes some triangles ready, by their numbers over the instances of `setup`.
    pub(super) fn triangles(
        &self,
        setup: &Setup<'_>,
        range: std::ops::Range<usize>,
    ) -> Result<Vec<Chunk>, RasterError> {
        let mut chunks = Vec::new();
        let count = range.len().div_ceil(CHUNK);
        self.reserve(&mut chunks, count)?;
        chunks.resize_with(count, Chunk::default);
        let places = Mutex::new(chunks.iter_mut().enumerate());
        let failure = Mutex::new(None);
        let next = || {
            let mut places = places.lock().unwrap_or_else(PoisonError::into_inner);
            places.next()
        };
        let interpolations = self.interpolations();
        let threads = setup.executor.threads().min(count.max(1));
        setup.executor.everywhere(threads, || {
            while let Some((number, chunk)) = next() {
                let first = range.start + number * CHUNK;
                let last = (first + CHUNK).min(range.end);
                let mut builder = ChunkBuilder {
                    program: self,
                    setup,
                    interpolations: &interpolations,
                    bias: self
                        .state
                        .depth
                        .map_or(DepthBias::default(), |depth| depth.bias),
                    chunk,
                    entries: Vec::new(),
                };
                if let Err(error) = builder.fill(first..last) {
                    let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
                    *failure = Some(error);
                    return;
                }
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(chunks),
        }
    }

    /// How each word of the varyings is interpolated.
    pub(super) fn interpolations(&self) -> Vec<Interpolation> {
        let inputs = self
            .fragment
            .as_ref()
            .map_or(&[][..], |fragment| &fragment.inputs);
        let of = |output| {
            let StageOutput::Varying {
                location: l,
                component: c,
            } = output
            else {
                return Interpolation::Flat;
            };
            let found = inputs.iter().find_map(|(_, input)| match *input {
                StageInput::Varying {
                    location,
                    component,
                    interpolation,
                } if (location, component) == (l, c) => Some(interpolation),
                _ => None,
            });
            found.unwrap_or(Interpolation::Flat)
        };
        self.varyings().map(|(_, output)| of(output)).collect()
    }
}

struct ChunkBuilder<'a> {
    program: &'a RasterProgram,
    setup: &'a Setup<'a>,
    interpolations: &'a [Interpolation],
    bias: DepthBias,
    chunk: &'a mut Chunk,
    /// Tiles and the triangles in them.
    entries: Vec<(u32, u32)>,
}

impl<'a> ChunkBuilder<'a> {
    fn fill(&mut self, range: std::ops::Range<usize>) -> Result<(), RasterError> {
        let setup = self.setup;
        let program = self.program;
        program.reserve(&mut self.chunk.triangles, range.len())?;
        let (triangles, each) = (setup.assembly.triangles(), setup.assembly.vertices());
        for number in range {
            let first = (number / triangles * each) as u32;
            let corners = setup.assembly.corners(number % triangles);
            let vertices = corners.map(|slot| first + slot);
            let stride = setup.vertices.stride;
            let words = vertices.map(|vertex| {
                let start = vertex as usize * stride;
                setup
                    .vertices
                    .words
                    .get(start..start + stride)
                    .unwrap_or(&[0; HEAD])
            });
            self.triangle(&Given { vertices, words })?;
        }
        self.sort()
    }

    fn triangle(&mut self, given: &Given<'a>) -> Result<(), RasterError> {
        let [f0, f1, f2] = given.words.map(|words| words[FLAGS]);
        let (all, any) = (f0 & f1 & f2, f0 | f1 | f2);
        if any & BAD != 0 || all != 0 {
            return Ok(());
        }
        if any != 0 {
            return self.clipped(given, any);
        }
        let corners = given.words.map(corner_of);
        self.visible(corners, given.vertices, given.vertices[0])
    }

    /// A triangle that reaches beyond some of the planes.
    fn clipped(&mut self, given: &Given<'a>, planes: u32) -> Result<(), RasterError> {
        let positions = given
            .words
            .map(|words| [0, 1, 2, 3].map(|axis| f32::from_bits(words[axis])));
        let polygon = Polygon::clipped(positions, planes, self.setup.map);
        let vertices = polygon.vertices();
        if vertices.len() < 3 {
            return Ok(());
        }
        let stride = self.setup.vertices.stride;
        let first = self.chunk.cut.len() / stride;
        self.program
            .reserve(&mut self.chunk.cut, polygon.cuts().len() * stride)?;
        let mut corners = [Corner::default(); 3 + MAX_CUTS];
        for (corner, words) in corners.iter_mut().zip(given.words) {
            *corner = corner_of(words);
        }
        for (corner, cut) in corners[3..].iter_mut().zip(polygon.cuts()) {
            *corner = self
                .setup
                .map
                .cut_corner(cut.position.map(|axis| axis as f32));
            self.chunk.cut.extend([0; HEAD]);
            for (i, interpolation) in self.interpolations.iter().enumerate() {
                let number = |vertex: u8| {
                    let word = match usize::from(vertex) {
                        own @ 0..3 => given.words[own].get(HEAD + i),
                        made => self.chunk.cut.get((first + made - 3) * stride + HEAD + i),
                    };
                    f32::from_bits(word.copied().unwrap_or(0))
                };
                let share = match interpolation {
                    Interpolation::Linear => cut.linear_share,
                    _ => cut.share,
                };
                let number = polygon.between(number(cut.from), number(cut.to), share);
                self.chunk.cut.push(number.to_bits());
            }
        }
        let number = |vertex: u8| match usize::from(vertex) {
            own @ 0..3 => given.vertices[own],
            made => (first + made - 3) as u32 | CUT,
        };
        for pair in vertices[1..].windows(2) {
            let fan = [vertices[0], pair[0], pair[1]];
            let corners = fan.map(|vertex| corners[usize::from(vertex)]);
            self.visible(corners, fan.map(number), given.vertices[0])?;
        }
        Ok(())
    }

    /// A triangle between the planes.
    fn visible(
        &mut self,
        mut corners: [Corner; 3],
        mut vertices: [u32; 3],
        provoking: u32,
    ) -> Result<(), RasterError> {
        // In the viewport but for cuts that are rounded.
        let (low, high) = (-1.0, (MAX_TARGET + 1) as f32);
        for Corner { x, y, z, w } in corners {
            let inside = |at: f32| low <= at && at <= high;
            if !(inside(x) && inside(y) && z.is_finite() && w.is_finite()) {
                return Ok(());
            }
        }
        let mut at = corners.map(|corner| [snap(corner.x), snap(corner.y)]);
        let wide = at.map(|at| at.map(i64::from));
        let [[x0, y0], [x1, y1], [x2, y2]] = wide;
        // Positive where corners go round counter-clockwise as seen, y down.
        let area = (x0 - x1) * (y2 - y0) - (x2 - x0) * (y0 - y1);
        if area == 0 {
            return Ok(());
        }
        let state = &self.program.state;
        let front = (area > 0) == (state.front == FrontFace::CounterClockwise);
        let culled = match state.cull {
            CullMode::None => false,
            CullMode::Front => front,
            CullMode::Back => !front,
        };
        if culled {
            return Ok(());
        }
        let Some(bounds) = self.bounds(&at) else {
            return Ok(());
        };
        if area < 0 {
            at.swap(1, 2);
            corners.swap(1, 2);
            vertices.swap(1, 2);
        }
        let (mut a, mut b, mut c) = ([0; 3], [0; 3], [0; 3]);
        for edge in 0..3 {
            let ([px, py], [qx, qy]) = (at[edge], at[(edge + 1) % 3]);
            // Left edges go down and top ones to the left.
            (a[edge], b[edge]) = (qy - py, px - qx);
            let top_left = a[edge] > 0 || (a[edge] == 0 && b[edge] > 0);
            let value = -(i64::from(a[edge]) * i64::from(px) + i64::from(b[edge]) * i64::from(py));
            let value = value - i64::from(!top_left);
            // At pixels the rest is a multiple of this.
            c[edge] = value.div_euclid(i64::from(SUB_PIXELS));
        }
        let shape = Shape::new(&corners, &at);
        let fixed = self.program.depth == Some(Format::Depth16Unorm);
        let corner_w = corners.map(|corner| corner.w);
        let triangle = Triangle {
            a,
            b,
            c,
            bounds,
            z: shape
                .gradients
                .around_target(corners.map(|corner| corner.z)),
            bias: shape.bias(&self.bias, &corners, fixed),
            w: shape.gradients.around_corner(corner_w),
            gradients: shape.gradients,
            corner_w,
            vertices,
            provoking,
            front,
        };
        self.bin(triangle)
    }

    /// The pixels whose centres may be inside; none if there are none to draw to.
    fn bounds(&self, at: &[[i32; 2]; 3]) -> Option<[u16; 4]> {
        let region = self.setup.region;
        let along = |axis: usize, [first, end]: [u32; 2]| {
            let all = at.map(|at| at[axis]);
            let low = all.iter().fold(i32::MAX, |low, at| low.min(*at));
            let high = all.iter().fold(i32::MIN, |high, at| high.max(*at));
            // Targets are smaller than 2^14.
            let low = (low + SUB_PIXELS - 1)
                .div_euclid(SUB_PIXELS)
                .max(first as i32);
            let high = high.div_euclid(SUB_PIXELS).min(end as i32 - 1);
            (low <= high).then_some([low as u16, high as u16])
        };
        let [x0, x1] = along(0, region.x)?;
        let [y0, y1] = along(1, region.y)?;
        Some([x0, y0, x1, y1])
    }

    fn bin(&mut self, triangle: Triangle) -> Result<(), RasterError> {
        let number = self.chunk.triangles.len() as u32;
        let [x0, y0, x1, y1] = triangle.bounds.map(|at| u32::from(at) / TILE);
        let [[first_x, end_x], [first_y, _]] = self.setup.region.tiles();
        let columns = end_x - first_x;
        self.program.reserve(&mut self.chunk.triangles, 1)?;
        self.chunk.triangles.push(triangle);
        let count = (x1 - x0 + 1) * (y1 - y0 + 1);
        if count > LARGE {
            self.program.reserve(&mut self.chunk.large, 1)?;
            self.chunk.large.push(number);
            return Ok(());
        }
        self.program.reserve(&mut self.entries, count as usize)?;
        for y in y0..=y1 {
            for x in x0..=x1 {
                if count == 1 || triangle.reaches(x * TILE, y * TILE) {
                    let tile = (y - first_y) * columns + (x - first_x);
                    self.entries.push((tile, number));
                }
            }
        }
        Ok(())
    }

    /// Sorts the entries by tile, those of a tile in their order.
    fn sort(&mut self) -> Result<(), RasterError> {
        let tiles = self.setup.region.tile_count();
        let chunk = &mut *self.chunk;
        self.program.reserve(&mut chunk.starts, tiles + 1)?;
        chunk.starts.resize(tiles + 1, 0);
        for (tile, _) in &self.entries {
            chunk.starts[*tile as usize + 1] += 1;
        }
        for tile in 0..tiles {
            chunk.starts[tile + 1] += chunk.starts[tile];
        }
        self.program.reserve(&mut chunk.list, self.entries.len())?;
        chunk.list.resize(self.entries.len(), 0);
        // Each start moves to its end, and so to the next one's start.
        for (tile, triangle) in &self.entries {
            let place = &mut chunk.starts[*tile as usize];
            chunk.list[*place as usize] = *triangle;
            *place += 1;
        }
        for tile in (1..=tiles).rev() {
            chunk.starts[tile] = chunk.starts[tile - 1];
        }
        if let Some(first) = chunk.starts.first_mut() {
            *first = 0;
        }
        Ok(())
    }
}

impl Triangle {
    /// An edge's value at a pixel, limited to what it takes to know its sign in the
    /// whole tile that begins there: steps are below 2^23, so it changes by less than
    /// 2^30.
    #[inline(always)]
    pub(super) fn edge(&self, edge: usize, x: u32, y: u32) -> i32 {
        const LIMIT: i64 = 1 << 30;
        let value = self.c[edge]
            + i64::from(self.a[edge]) * i64::from(x)
            + i64::from(self.b[edge]) * i64::from(y);
        value.clamp(-LIMIT, LIMIT) as i32
    }

    /// Whether it may cover pixels of the tile that begins there.
    #[inline]
    pub(super) fn reaches(&self, x: u32, y: u32) -> bool {
        const LAST: i64 = TILE as i64 - 1;
        (0..3).all(|edge| {
            let (a, b) = (i64::from(self.a[edge]), i64::from(self.b[edge]));
            let value = self.c[edge] + a * i64::from(x) + b * i64::from(y);
            value + a.max(0) * LAST + b.max(0) * LAST >= 0
        })
    }
}

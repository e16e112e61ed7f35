//! Which pixels of a tile triangles cover, and the depth test before shading.
//!
//! Blocks of 8×2 pixels, four quads, are looked at together. Edges are integers that
//! 32 bits hold: [`Triangle::edge`] says why.

use etalon_core::raster::DepthState;
use etalon_core::resource::Compare;

use super::depth::{PIXELS, compare_lanes, quantised};
use super::planes::ViewportMap;
use super::setup::{Chunk, Region, TILE, Triangle};
use crate::exec::{Fused, Isa, Work};

/// Pixels of a block.
const BLOCK: usize = 16;

/// Quads of a tile's row.
const ROW: u32 = TILE / 2;

/// A bit for each pixel of a block.
const BITS: [u32; BLOCK] = {
    let mut bits = [0; BLOCK];
    let mut k = 0;
    while k < BLOCK {
        bits[k] = 1 << k;
        k += 1;
    }
    bits
};

/// Four neighbouring pixels of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Quad {
    /// Of which chunk.
    pub(super) chunk: u32,
    pub(super) triangle: u32,
    /// The upper left pixel.
    pub(super) x: u16,
    pub(super) y: u16,
    /// A bit for each pixel that is covered.
    pub(super) mask: u8,
}

/// How depth is tested before shading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EarlyTest {
    pub(super) compare: Compare,
    pub(super) write: bool,
}

impl EarlyTest {
    pub(super) fn of(depth: &DepthState, write: bool) -> Self {
        Self {
            compare: depth.compare,
            write: depth.write && write,
        }
    }
}

/// A walk over the triangles of a tile that stops when there are enough quads.
pub(super) struct Scan<'a> {
    pub(super) chunks: &'a [Chunk],
    /// Number of the tile in the region.
    pub(super) tile: usize,
    /// The tile's first pixel.
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) region: Region,
    pub(super) map: &'a ViewportMap,
    /// Without one every pixel covered is drawn.
    pub(super) test: Option<EarlyTest>,
    /// Depth16Unorm.
    pub(super) fixed: bool,
    pub(super) depth: &'a mut [f32; PIXELS],
    /// The chunk and the places in its lists where the walk goes on.
    pub(super) chunk: usize,
    pub(super) next: usize,
    pub(super) next_large: usize,
    /// Stops at so many, and less than a tile's more.
    pub(super) enough: usize,
    pub(super) quads: Vec<Quad>,
}

impl Scan<'_> {
    /// Whether every triangle was seen.
    pub(super) fn is_done(&self) -> bool {
        self.chunk >= self.chunks.len()
    }

    #[inline(always)]
    fn triangle<F: Fused>(&mut self, number: u32, is_whole: bool) {
        let chunks = self.chunks;
        let Some(triangle) = chunks[self.chunk].triangles.get(number as usize) else {
            return;
        };
        let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
        let (x, y) = (self.x, self.y);
        // Within the tile; it reaches into it.
        let first_x = x0.max(x) - x;
        let last_x = x1.min(x + TILE - 1).wrapping_sub(x);
        let first_y = y0.max(y) - y;
        let last_y = y1.min(y + TILE - 1).wrapping_sub(y);
        if last_x >= TILE || last_y >= TILE {
            return;
        }
        let mut steps = [[0; BLOCK]; 3];
        let mut edges = [0; 3];
        for edge in 0..3 {
            let (a, b) = (triangle.a[edge], triangle.b[edge]);
            for k in 0..BLOCK {
                let (right, down) = ((k / 4 * 2 + k % 2) as i32, (k / 2 % 2) as i32);
                steps[edge][k] = a.wrapping_mul(right).wrapping_add(b.wrapping_mul(down));
            }
            edges[edge] = triangle.edge(edge, x, y);
        }
        for row in first_y / 2..=last_y / 2 {
            for block in first_x / 8..=last_x / 8 {
                let mut outside = [0; BLOCK];
                for edge in 0..3 {
                    let (right, down) = ((block * 8) as i32, (row * 2) as i32);
                    let start = edges[edge]
                        .wrapping_add(triangle.a[edge].wrapping_mul(right))
                        .wrapping_add(triangle.b[edge].wrapping_mul(down));
                    for k in 0..BLOCK {
                        outside[k] |= start.wrapping_add(steps[edge][k]);
                    }
                }
                let mut mask = [0_u32; BLOCK];
                let mut any = 0;
                for k in 0..BLOCK {
                    mask[k] = crate::num::mask(outside[k] >= 0);
                    any |= mask[k];
                }
                if any == 0 {
                    continue;
                }
                let (px, py) = (x + block * 8, y + row * 2);
                if !is_whole {
                    self.limit(px, py, &mut mask);
                }
                if self.test.is_some() {
                    self.early::<F>(triangle, row, block, px, py, &mut mask);
                }
                let mut bits = 0;
                for k in 0..BLOCK {
                    bits |= mask[k] & BITS[k];
                }
                if bits != 0 {
                    self.push(number, px, py, bits);
                }
            }
        }
    }

    /// Takes out what is not drawn to.
    #[inline(always)]
    fn limit(&self, x: u32, y: u32, mask: &mut [u32; BLOCK]) {
        let Region {
            x: columns,
            y: rows,
        } = self.region;
        for k in 0..BLOCK {
            let at_x = x + (k / 4 * 2 + k % 2) as u32;
            let at_y = y + (k / 2 % 2) as u32;
            let inside =
                (at_x >= columns[0]) & (at_x < columns[1]) & (at_y >= rows[0]) & (at_y < rows[1]);
            mask[k] &= crate::num::mask(inside);
        }
    }

    #[inline(always)]
    fn early<F: Fused>(
        &mut self,
        triangle: &Triangle,
        row: u32,
        block: u32,
        x: u32,
        y: u32,
        mask: &mut [u32; BLOCK],
    ) {
        let Some(test) = self.test else {
            return;
        };
        let mut z = [0.0; BLOCK];
        for k in 0..BLOCK {
            let at_x = (x + (k / 4 * 2 + k % 2) as u32) as f32;
            let at_y = (y + (k / 2 % 2) as u32) as f32;
            z[k] = self
                .map
                .clamp(triangle.z.at::<F>(at_x, at_y) + triangle.bias);
        }
        if self.fixed {
            for k in 0..BLOCK {
                z[k] = quantised(z[k]);
            }
        }
        let start = ((row * ROW + block * 4) * 4) as usize;
        let Some(old) = self.depth[start..].first_chunk_mut::<BLOCK>() else {
            return;
        };
        let mut passed = *mask;
        compare_lanes!(test.compare, passed, z, old, BLOCK);
        *mask = passed;
        if test.write {
            for k in 0..BLOCK {
                old[k] = if passed[k] != 0 { z[k] } else { old[k] };
            }
        }
    }

    #[inline(always)]
    fn push(&mut self, triangle: u32, x: u32, y: u32, bits: u32) {
        for quad in 0..4 {
            let mask = (bits >> (quad * 4)) as u8 & 15;
            if mask != 0 {
                // There is room: see `enough`.
                self.quads.push(Quad {
                    chunk: self.chunk as u32,
                    triangle,
                    x: (x + quad * 2) as u16,
                    y: y as u16,
                    mask,
                });
            }
        }
    }
}

impl Work for Scan<'_> {
    #[inline(always)]
    fn run<I: Isa, F: Fused>(&mut self) {
        let Region { x, y } = self.region;
        let is_whole =
            self.x >= x[0] && self.x + TILE <= x[1] && self.y >= y[0] && self.y + TILE <= y[1];
        let chunks = self.chunks;
        while let Some(chunk) = chunks.get(self.chunk) {
            let list = chunk.in_tile(self.tile);
            loop {
                if self.quads.len() >= self.enough {
                    return;
                }
                // Both lists ascend.
                let small = list.get(self.next).copied().unwrap_or(u32::MAX);
                let large = chunk.large.get(self.next_large).copied();
                let large = large.unwrap_or(u32::MAX);
                let number = small.min(large);
                if number == u32::MAX {
                    break;
                }
                if number == small {
                    self.next += 1;
                } else {
                    self.next_large += 1;
                    let reaches = chunk.triangles.get(number as usize);
                    if !reaches.is_some_and(|triangle| triangle.reaches(self.x, self.y)) {
                        continue;
                    }
                }
                self.triangle::<F>(number, is_whole);
            }
            self.chunk += 1;
            (self.next, self.next_large) = (0, 0);
        }
    }
}

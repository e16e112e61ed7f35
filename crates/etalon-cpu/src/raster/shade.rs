//! The fragment kernel over batches of quads.

use super::depth::{PIXELS, quantised};
use super::planes::{Plane, ViewportMap};
use super::setup::{Chunk, TILE};
use super::tile::Quad;
use super::vertex::Vertices;
use crate::exec::{Fused, Isa, Stage, Work};
use crate::ir::Interpolation;
use crate::registers::LANES;

/// Quads in a chunk of lanes.
pub(super) const QUADS: usize = LANES / 4;

/// What an input of the fragment kernel is filled with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Feed {
    Position(u8),
    FrontFacing,
    Covered,
    /// The word of the varyings, and how it is interpolated.
    Varying(usize, Interpolation),
}

/// Lanes of a batch that others than the kernel look at.
pub(super) struct BatchLanes {
    /// All ones in lanes whose pixels are covered.
    pub(super) covered: Vec<[u32; LANES]>,
    /// Depth as it is stored, where it is tested after shading.
    pub(super) depth: Vec<[f32; LANES]>,
}

/// Fills the inputs of a batch.
pub(super) struct Fill<'a, 's> {
    pub(super) stage: Option<&'a mut Stage<'s>>,
    pub(super) feeds: &'a [(usize, Feed)],
    pub(super) chunks: &'a [Chunk],
    pub(super) vertices: &'a Vertices,
    pub(super) map: &'a ViewportMap,
    pub(super) quads: &'a [Quad],
    pub(super) lanes: &'a mut BatchLanes,
    /// Planes of a triangle's varyings, in the order of the feeds.
    pub(super) planes: &'a mut Vec<Plane>,
    pub(super) wants_depth: bool,
    /// Depth16Unorm.
    pub(super) fixed: bool,
    /// Of the targets.
    pub(super) width: u32,
}

impl Work for Fill<'_, '_> {
    #[inline(always)]
    fn run<I: Isa, F: Fused>(&mut self) {
        let Some(&last) = self.quads.last() else {
            return;
        };
        let total = self.quads.len().next_multiple_of(QUADS);
        let mut known = (u32::MAX, u32::MAX);
        for at in 0..total {
            // Quads past the end are helpers of the last.
            let quad = self.quads.get(at).copied();
            let quad = quad.unwrap_or(Quad { mask: 0, ..last });
            let Some(chunk) = self.chunks.get(quad.chunk as usize) else {
                continue;
            };
            let Some(triangle) = chunk.triangles.get(quad.triangle as usize) else {
                continue;
            };
            if known != (quad.chunk, quad.triangle) {
                known = (quad.chunk, quad.triangle);
                let (corners, first) = chunk.varyings(self.vertices, triangle);
                self.planes.clear();
                for (_, feed) in self.feeds {
                    let Feed::Varying(word, interpolation) = *feed else {
                        continue;
                    };
                    let mut values = [0.0; 3];
                    for (value, words) in values.iter_mut().zip(corners) {
                        *value = f32::from_bits(words.get(word).copied().unwrap_or(0));
                    }
                    self.planes.push(match interpolation {
                        Interpolation::Flat => Plane {
                            a: f32::from_bits(first.get(word).copied().unwrap_or(0)),
                            ..Plane::default()
                        },
                        Interpolation::Linear => triangle.gradients.around_corner(values),
                        Interpolation::Perspective => {
                            for k in 0..3 {
                                values[k] *= triangle.corner_w[k];
                            }
                            triangle.gradients.around_corner(values)
                        }
                    });
                }
            }
            let (number, lane) = (at / QUADS, at % QUADS * 4);
            let (mut x, mut y) = ([0.0; 4], [0.0; 4]);
            let (mut from_x, mut from_y) = ([0.0; 4], [0.0; 4]);
            let (mut w, mut back) = ([0.0; 4], [0.0; 4]);
            let [origin_x, origin_y] = triangle.gradients.origin;
            for k in 0..4 {
                x[k] = f32::from(quad.x + k as u16 % 2);
                y[k] = f32::from(quad.y + k as u16 / 2);
                from_x[k] = x[k] - origin_x;
                from_y[k] = y[k] - origin_y;
                w[k] = triangle.w.at::<F>(from_x[k], from_y[k]);
                back[k] = 1.0 / w[k];
            }
            for k in 0..4 {
                let covered = crate::num::mask(quad.mask >> k & 1 != 0);
                self.lanes.covered[number][lane + k] = covered;
            }
            let mut z = [0.0; 4];
            for k in 0..4 {
                z[k] = self
                    .map
                    .clamp(triangle.z.at::<F>(x[k], y[k]) + triangle.bias);
            }
            if self.wants_depth {
                for k in 0..4 {
                    self.lanes.depth[number][lane + k] =
                        if self.fixed { quantised(z[k]) } else { z[k] };
                }
            }
            let Some(stage) = &mut self.stage else {
                continue;
            };
            if let Some(who) = stage.who(number) {
                who.live = who.live & !(0xf << lane) | u64::from(quad.mask & 0xf) << lane;
                for k in 0..4 {
                    let (column, row) = (u32::from(quad.x) + k % 2, u32::from(quad.y) + k / 2);
                    who.invocation[lane + k as usize] = row * self.width + column;
                }
            }
            let mut varying = 0;
            for &(slot, feed) in self.feeds {
                let lanes = stage.input(slot, number);
                let Some(to) = lanes[lane..].first_chunk_mut::<4>() else {
                    continue;
                };
                match feed {
                    Feed::Position(0) => {
                        for k in 0..4 {
                            to[k] = (x[k] + 0.5).to_bits();
                        }
                    }
                    Feed::Position(1) => {
                        for k in 0..4 {
                            to[k] = (y[k] + 0.5).to_bits();
                        }
                    }
                    Feed::Position(2) => *to = z.map(f32::to_bits),
                    Feed::Position(_) => *to = w.map(f32::to_bits),
                    Feed::FrontFacing => *to = [crate::num::mask(triangle.front); 4],
                    Feed::Covered => {
                        for k in 0..4 {
                            to[k] = crate::num::mask(quad.mask >> k & 1 != 0);
                        }
                    }
                    Feed::Varying(_, interpolation) => {
                        let plane = self.planes.get(varying).copied().unwrap_or_default();
                        varying += 1;
                        match interpolation {
                            Interpolation::Flat => *to = [plane.a.to_bits(); 4],
                            Interpolation::Linear => {
                                for k in 0..4 {
                                    to[k] = plane.at::<F>(from_x[k], from_y[k]).to_bits();
                                }
                            }
                            Interpolation::Perspective => {
                                for k in 0..4 {
                                    let value = plane.at::<F>(from_x[k], from_y[k]) * back[k];
                                    to[k] = value.to_bits();
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The first run of quads of which no two are in the same place, at most `most`.
/// `stamps` has a number for each of the tile's quads, `stamp` none of them.
pub(super) fn apart(quads: &[Quad], most: usize, stamps: &mut [u32], stamp: u32) -> usize {
    for (i, quad) in quads.iter().take(most).enumerate() {
        let (x, y) = (u32::from(quad.x) % TILE / 2, u32::from(quad.y) % TILE / 2);
        let place = &mut stamps[(y * (TILE / 2) + x) as usize];
        if *place == stamp {
            return i;
        }
        *place = stamp;
    }
    quads.len().min(most)
}

/// Quads of a tile.
pub(super) const TILE_QUADS: usize = PIXELS / 4;

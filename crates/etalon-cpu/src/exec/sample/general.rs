//! Texels of textures of any shape, each lane at a level of its own.

use super::axis::{unnormalised, wrap};
use super::{Place, Request, cube};
use crate::exec::isa::Isa;
use crate::memory::{Channels, Level};
use crate::num::Number;

/// Where lanes are in the texels of their levels.
pub(super) struct Footprint<const K: usize> {
    levels: [Level; K],
    /// Position of the first texel along each axis.
    first: [[i32; K]; 3],
    /// Weight of the second texel along each axis.
    weight: [[f32; K]; 3],
    /// Of the cube.
    face: [u32; K],
}

impl Request<'_> {
    /// The axes along which texels are filtered: of a cube, those of a face.
    #[inline(always)]
    fn filtered_axes(&self) -> usize {
        if self.cube { 2 } else { self.axes }
    }

    #[inline(always)]
    pub(super) fn footprint<const K: usize>(
        &self,
        levels: &[Level; K],
        linear: bool,
        place: &Place<K>,
    ) -> Footprint<K> {
        let mut at = place.at;
        let mut face = [0; K];
        if self.cube {
            for k in 0..K {
                let (f, [s, t]) = cube::face(at.map(|axis| axis[k]));
                (face[k], at[0][k], at[1][k]) = (f, s, t);
            }
        }
        let mut footprint = Footprint {
            levels: *levels,
            first: [[0; K]; 3],
            weight: [[0.0; K]; 3],
            face,
        };
        for axis in 0..self.filtered_axes() {
            let mut size = [0.0; K];
            for k in 0..K {
                let Level {
                    width,
                    height,
                    depth,
                    ..
                } = levels[k];
                size[k] = [width, height, depth][axis] as f32;
            }
            let (floors, weight) = unnormalised(&at[axis], &size, linear);
            let offset = self.offset[axis];
            for k in 0..K {
                footprint.first[axis][k] = Number::to_i32(floors[k]).saturating_add(offset);
            }
            footprint.weight[axis] = weight;
        }
        footprint
    }

    /// Adds what levels have, times `scale`.
    #[inline(always)]
    pub(super) fn add_general<I: Isa, const K: usize>(
        &self,
        levels: &[Level; K],
        linear: bool,
        scale: &[f32; K],
        place: &Place<K>,
        sum: &mut [[f32; K]; 4],
    ) {
        let footprint = self.footprint(levels, linear, place);
        if self.cube && linear {
            let texels = self.cube_texels::<I, K>(&footprint, place);
            for (tap, channels) in texels.iter().enumerate() {
                let weight = self.weights(&footprint, tap, scale);
                self.add_weighted(channels, &weight, sum);
            }
            return;
        }
        let taps = if linear { 1 << self.filtered_axes() } else { 1 };
        for tap in 0..taps {
            let index = self.index(&footprint, place, tap);
            let weight = if linear {
                self.weights(&footprint, tap, scale)
            } else {
                *scale
            };
            let channels = self.texels::<I, K>(&index, &place.reference);
            self.add_weighted(&channels, &weight, sum);
        }
    }

    /// The weights of one of the texels of a footprint.
    #[inline(always)]
    fn weights<const K: usize>(
        &self,
        footprint: &Footprint<K>,
        tap: usize,
        scale: &[f32; K],
    ) -> [f32; K] {
        let mut weight = *scale;
        for axis in 0..self.filtered_axes() {
            let second = &footprint.weight[axis];
            for k in 0..K {
                weight[k] *= if tap >> axis & 1 == 1 {
                    second[k]
                } else {
                    1.0 - second[k]
                };
            }
        }
        weight
    }

    /// The indices of one of the texels of a footprint: bit `axis` of `tap`
    /// asks for the second one along an axis.
    #[inline(always)]
    pub(super) fn index<const K: usize>(
        &self,
        footprint: &Footprint<K>,
        place: &Place<K>,
        tap: usize,
    ) -> [u32; K] {
        let mut index = [0; K];
        for k in 0..K {
            let Level {
                width,
                height,
                depth,
                start,
            } = footprint.levels[k];
            let [x, y, z]: [i32; 3] = std::array::from_fn(|axis| {
                footprint.first[axis][k].saturating_add((tap >> axis & 1) as i32)
            });
            let [u, v, w] = self.sampler.address;
            let (x, y, layer) = if self.cube {
                let (face, x, y) = cube::texel(footprint.face[k], x, y, width as i32);
                let cubes = depth / 6;
                (x, y, self.cube_of(place.layer[k], cubes) * 6 + face)
            } else {
                let y = if self.axes > 1 { wrap(v, y, height) } else { 0 };
                let layer = if self.axes > 2 {
                    wrap(w, z, depth)
                } else {
                    (place.layer[k] as i32).clamp(0, depth as i32 - 1) as u32
                };
                (wrap(u, x, width), y, layer)
            };
            index[k] = start + (layer * height + y) * width + x;
        }
        index
    }

    #[inline(always)]
    fn cube_of(&self, layer: u32, cubes: u32) -> u32 {
        (layer as i32).clamp(0, cubes.max(1) as i32 - 1) as u32
    }

    /// The four texels around each lane's place on a cube. Beyond a corner,
    /// where three faces meet, the fourth is the mean of the other three, as
    /// Vulkan recommends.
    #[inline(always)]
    pub(super) fn cube_texels<I: Isa, const K: usize>(
        &self,
        footprint: &Footprint<K>,
        place: &Place<K>,
    ) -> [Channels<K>; 4] {
        // No closure here: it would not be compiled for the instruction set.
        let mut texels = [[[0; K]; 4]; 4];
        for (tap, texels) in texels.iter_mut().enumerate() {
            *texels = self.texels::<I, K>(&self.index(footprint, place, tap), &place.reference);
        }
        for k in 0..K {
            let (x, y) = (footprint.first[0][k], footprint.first[1][k]);
            let size = footprint.levels[k].width as i32;
            let corner = (0..4).find(|&tap| {
                let beyond = |first: i32, bit: usize| first.saturating_add((tap >> bit & 1) as i32);
                cube::is_corner(beyond(x, 0), beyond(y, 1), size)
            });
            if let Some(corner) = corner
                && self.is_float()
            {
                for channel in 0..4 {
                    let sum: f32 = (0..4)
                        .filter(|&tap| tap != corner)
                        .map(|tap| f32::from_bits(texels[tap][channel][k]))
                        .sum();
                    texels[corner][channel][k] = (sum / 3.0).to_bits();
                }
            }
        }
        texels
    }

    /// Whether texels are numbers of which a mean can be taken.
    #[inline(always)]
    fn is_float(&self) -> bool {
        use etalon_core::format::SampleKind;
        !matches!(
            self.texture.desc().format.sample_kind(),
            SampleKind::Sint | SampleKind::Uint
        )
    }
}

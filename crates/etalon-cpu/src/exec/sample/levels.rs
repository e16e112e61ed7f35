//! Texels of flat textures, each lane at a level of its own: what implicit levels of
//! detail mostly come to. The same bits as [`super::general`]'s, which has texels of
//! any shape.

use etalon_core::resource::AddressMode;

use super::axis::{AxisTexels, unnormalised, wrap};
use super::{Place, Request};
use crate::exec::isa::Isa;
use crate::memory::Level;
use crate::num::Number;

impl Request<'_> {
    /// Adds what levels have, times `scale`.
    #[inline(always)]
    pub(super) fn add_levels<I: Isa, const K: usize>(
        &self,
        levels: &[Level; K],
        linear: bool,
        scale: &[f32; K],
        place: &Place<K>,
        sum: &mut [[f32; K]; 4],
    ) {
        let (mut width, mut height, mut start) = ([0; K], [0; K], [0; K]);
        for k in 0..K {
            let level = levels[k];
            (width[k], height[k], start[k]) = (level.width, level.height, level.start);
        }
        if self.layered {
            for k in 0..K {
                let last = levels[k].depth as i32 - 1;
                let layer = (place.layer[k] as i32).clamp(0, last.max(0)) as u32;
                start[k] += layer * height[k] * width[k];
            }
        }
        let [mode_x, mode_y, _] = self.sampler.address;
        let [dx, dy, _] = self.offset;
        let x = along(mode_x, &place.at[0], &width, dx, linear);
        let y = along(mode_y, &place.at[1], &height, dy, linear);
        for tap in 0..if linear { 4 } else { 1 } {
            let (right, down) = (tap & 1, tap >> 1);
            let (mut index, mut weight) = ([0; K], *scale);
            for k in 0..K {
                index[k] = start[k] + y.texels[down][k] * width[k] + x.texels[right][k];
            }
            if linear {
                for k in 0..K {
                    let horizontal = if right == 1 {
                        x.weight[k]
                    } else {
                        1.0 - x.weight[k]
                    };
                    let vertical = if down == 1 {
                        y.weight[k]
                    } else {
                        1.0 - y.weight[k]
                    };
                    weight[k] = scale[k] * horizontal * vertical;
                }
            }
            let channels = self.texels::<I, K>(&index, &place.reference);
            self.add_weighted(&channels, &weight, sum);
        }
    }
}

/// The texels along an axis of levels of different sizes.
#[inline(always)]
fn along<const K: usize>(
    mode: AddressMode,
    coordinate: &[f32; K],
    size: &[u32; K],
    offset: i32,
    linear: bool,
) -> AxisTexels<K> {
    let mut sizes = [0.0; K];
    for k in 0..K {
        sizes[k] = size[k] as f32;
    }
    let (floors, weight) = unnormalised(coordinate, &sizes, linear);
    let mut at = [0_i32; K];
    for k in 0..K {
        at[k] = Number::to_i32(floors[k]).saturating_add(offset);
    }
    let (mut first, mut second) = ([0; K], [0; K]);
    match mode {
        AddressMode::ClampToEdge => {
            for k in 0..K {
                let last = size[k] as i32 - 1;
                first[k] = at[k].max(0).min(last) as u32;
                second[k] = at[k].saturating_add(1).max(0).min(last) as u32;
            }
        }
        AddressMode::Repeat => {
            let mut odd = 0;
            for k in 0..K {
                odd |= size[k] & size[k].wrapping_sub(1);
            }
            if odd == 0 {
                for k in 0..K {
                    first[k] = at[k] as u32 & size[k].wrapping_sub(1);
                }
            } else {
                for k in 0..K {
                    // The quotient is nowhere so near to an integer that rounding it
                    // to f64 would make it one.
                    let quotient = (f64::from(at[k]) / f64::from(size[k])) as i32;
                    let rest = at[k].wrapping_sub(quotient.wrapping_mul(size[k] as i32));
                    first[k] = (rest + if rest < 0 { size[k] as i32 } else { 0 }) as u32;
                }
            }
            for k in 0..K {
                let next = first[k] + 1;
                second[k] = if next == size[k] { 0 } else { next };
            }
        }
        AddressMode::MirrorRepeat => {
            for k in 0..K {
                first[k] = wrap(mode, at[k], size[k]);
                second[k] = wrap(mode, at[k].saturating_add(1), size[k]);
            }
        }
    }
    AxisTexels {
        texels: [first, second],
        weight,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_those_of_the_general_way() {
        let coordinates: [f32; 16] = [
            -1.0e9,
            -3.0,
            -0.51,
            -0.01,
            0.0,
            0.01,
            0.24,
            0.5,
            0.76,
            0.99,
            1.0,
            1.01,
            7.3,
            1.0e6,
            f32::NAN,
            -1.25,
        ];
        let modes = [
            AddressMode::ClampToEdge,
            AddressMode::Repeat,
            AddressMode::MirrorRepeat,
        ];
        for sizes in [[1, 2, 64, 4096], [3, 17, 1000, 5]] {
            let size: [u32; 16] = std::array::from_fn(|k| sizes[k % 4]);
            for (mode, offset) in modes.into_iter().flat_map(|mode| [(mode, 0), (mode, -3)]) {
                for linear in [false, true] {
                    let got = along(mode, &coordinates, &size, offset, linear);
                    for k in 0..16 {
                        let half = if linear { 0.5 } else { 0.0 };
                        let scaled = coordinates[k] * size[k] as f32 - half;
                        let at = (scaled.floor() as i32).saturating_add(offset);
                        let want = [at, at.saturating_add(1)].map(|at| wrap(mode, at, size[k]));
                        assert_eq!(
                            got.texels.map(|texels| texels[k]),
                            want,
                            "{mode:?} {} of {}",
                            coordinates[k],
                            size[k]
                        );
                    }
                }
            }
        }
    }
}

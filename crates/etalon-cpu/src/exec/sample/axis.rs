//! Texels along an axis: Vulkan 1.3, §16.8 (unnormalised coordinates) and
//! §16.9 (wrapping, texel selection).

use etalon_core::resource::AddressMode;

use crate::exec::isa::Isa;
use crate::exec::lanes::BLOCK;
use crate::num::Number;

/// Up to here positions of texels are exact in [`small_int`].
pub(super) const MAX_FAST_SIZE: u32 = 1 << 22;

/// The texels that lanes read along an axis.
pub(super) struct AxisTexels<const K: usize> {
    /// Positions of the first and, with a linear filter, the second texel.
    pub(super) texels: [[u32; K]; 2],
    /// Weight of the second texel.
    pub(super) weight: [f32; K],
}

impl<const K: usize> AxisTexels<K> {
    #[inline(always)]
    pub(super) fn new(
        mode: AddressMode,
        coordinate: &[f32; K],
        size: u32,
        offset: i32,
        linear: bool,
    ) -> Self {
        let mut result = Self {
            texels: [[0; K]; 2],
            weight: [0.0; K],
        };
        let (floors, weight) = unnormalised(coordinate, &[size as f32; K], linear);
        result.weight = weight;
        if mode == AddressMode::ClampToEdge && size <= MAX_FAST_SIZE {
            result.texels = clamped(&floors, size, offset);
        } else {
            let [first, second] = &mut result.texels;
            for k in 0..K {
                let at = Number::to_i32(floors[k]).saturating_add(offset);
                first[k] = wrap(mode, at, size);
                second[k] = wrap(mode, at.saturating_add(1), size);
            }
        }
        result
    }
}

impl AxisTexels<BLOCK> {
    /// What [`AxisTexels::new`] gives for a linear filter clamped to the edge, in the
    /// instruction set's own way; for sizes up to [`MAX_FAST_SIZE`].
    #[inline(always)]
    pub(super) fn linear<I: Isa>(coordinate: &[f32; BLOCK], size: u32, offset: i32) -> Self {
        let mut scaled = [0.0; BLOCK];
        for k in 0..BLOCK {
            scaled[k] = coordinate[k] * size as f32 - 0.5;
        }
        let floors = I::floor(scaled);
        let mut weight = [0.0; BLOCK];
        for k in 0..BLOCK {
            weight[k] = scaled[k] - floors[k];
        }
        Self {
            texels: clamped(&floors, size, offset),
            weight,
        }
    }
}

/// Texels at whole positions and the ones after them, the edge repeated outside.
#[inline(always)]
fn clamped<const K: usize>(floors: &[f32; K], size: u32, offset: i32) -> [[u32; K]; 2] {
    let mut texels = [[0; K]; 2];
    let last = size as i32 - 1;
    let (low, high) = (-1.0, last as f32);
    let offset = offset as f32;
    for k in 0..K {
        let floor = floors[k] + offset;
        let floor = if floor > low { floor } else { low };
        let floor = if floor < high { floor } else { high };
        let at = small_int(floor);
        texels[0][k] = at.max(0) as u32;
        texels[1][k] = (at + 1).min(last) as u32;
    }
    texels
}

/// Scales coordinates to texels: the whole part of the first texel's, and the
/// weight of the second texel.
#[inline(always)]
pub(super) fn unnormalised<const K: usize>(
    coordinate: &[f32; K],
    size: &[f32; K],
    linear: bool,
) -> ([f32; K], [f32; K]) {
    let (mut floors, mut weight) = ([0.0; K], [0.0; K]);
    let half = if linear { 0.5 } else { 0.0 };
    for k in 0..K {
        let scaled = coordinate[k] * size[k] - half;
        floors[k] = Number::floor_in_steps(scaled);
        weight[k] = scaled - floors[k];
    }
    if !linear {
        weight = [0.0; K];
    }
    (floors, weight)
}

/// Brings a texel's position into the texture.
#[inline(always)]
pub(super) fn wrap(mode: AddressMode, at: i32, size: u32) -> u32 {
    // No texture is so wide that doubling matters.
    let size = size as i32;
    (match mode {
        AddressMode::ClampToEdge => at.clamp(0, size - 1),
        AddressMode::Repeat => at.rem_euclid(size),
        AddressMode::MirrorRepeat => {
            let at = i64::from(at).rem_euclid(2 * i64::from(size));
            at.min(2 * i64::from(size) - 1 - at) as i32
        }
    }) as u32
}

/// The integer that a whole number of magnitude up to 2^22 is.
#[inline(always)]
fn small_int(x: f32) -> i32 {
    // The sum's unit is 1, and its low bits count units.
    const UNIT: f32 = 12_582_912.0;
    (x + UNIT).to_bits().wrapping_sub(UNIT.to_bits()) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::isa::Baseline;

    #[test]
    fn small_integers_are_exact() {
        for at in (-1..1 << 22).step_by(7).chain([(1 << 22) - 1, 0, 1]) {
            assert_eq!(small_int(at as f32), at);
        }
    }

    #[test]
    fn clamped_texels_are_those_of_the_general_way() {
        let coordinates: [f32; 16] = [
            -1.0e30,
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
            1.0e9,
            f32::INFINITY,
            f32::NEG_INFINITY,
        ];
        for size in [1, 2, 3, 17, 4096, MAX_FAST_SIZE] {
            for offset in [-8, -1, 0, 3] {
                for linear in [false, true] {
                    let mode = AddressMode::ClampToEdge;
                    let fast = AxisTexels::new(mode, &coordinates, size, offset, linear);
                    if linear {
                        let block = AxisTexels::linear::<Baseline>(&coordinates, size, offset);
                        assert_eq!(block.texels, fast.texels);
                        let bits =
                            [block.weight, fast.weight].map(|weight| weight.map(f32::to_bits));
                        assert_eq!(bits[0], bits[1]);
                    }
                    for (k, coordinate) in coordinates.into_iter().enumerate() {
                        let scaled = coordinate * size as f32 - if linear { 0.5 } else { 0.0 };
                        let at = (f64::from(scaled).floor() as i64).clamp(-1 << 40, 1 << 40)
                            + i64::from(offset);
                        let last = i64::from(size) - 1;
                        let want = [at.clamp(0, last), (at + 1).clamp(0, last)];
                        let got = fast.texels.map(|texels| i64::from(texels[k]));
                        assert_eq!(got, want, "{coordinate} of {size}, {offset}");
                    }
                }
            }
        }
    }
}

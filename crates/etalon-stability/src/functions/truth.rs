//! Closed forms in `f64` of what functions promise, and what they are given beside
//! numbers.

use etalon_effects::CameraParams;
use etalon_effects::truth::Plane;
pub(super) use etalon_effects::truth::{radiance, smooth, unit_interval};
use glam::{DVec2, DVec3};

pub(super) fn first(value: f64) -> [f64; 4] {
    [value, 0.0, 0.0, 0.0]
}

/// 2^x of an `f32`'s range: 0 below its normal numbers, its largest above.
pub(super) fn in_range(exponent: f64, value: f64) -> f64 {
    if exponent >= 128.0 {
        f32::MAX.into()
    } else if exponent < -126.0 {
        0.0
    } else {
        value
    }
}

/// Rounded to the nearest half float, ties to even, and never to an infinity.
pub(super) fn half(x: f64) -> f64 {
    if x.is_nan() {
        return 0.0;
    }
    let x = x.clamp(-65_504.0, 65_504.0);
    // Of the next power of two below; subnormal numbers have the least one's.
    let exponent = (((x.to_bits() >> 52) & 0x7ff) as i32 - 1023).max(-14);
    let step = f64::from(exponent - 10).exp2();
    (x / step).round_ties_even() * step
}

/// The camera that distances are computed for: 0.1 is nearest, depth reversed.
pub(super) fn camera() -> CameraParams {
    CameraParams::perspective(1.0, 1.5, NEAR)
}

pub(super) const NEAR: f32 = 0.1;

pub(super) fn distance(depth: f64) -> f64 {
    let distance = f64::from(NEAR) / depth;
    let nearest = f64::from(NEAR) * 0.999_999;
    if (nearest..2_f64.powi(40)).contains(&distance) {
        distance
    } else {
        0.0
    }
}

/// What is interpolated.
pub(super) const PICTURE: [[f32; 4]; 6] = [
    [0.0, 1.0, 0.5, 0.25],
    [1.0, 0.0, 0.5, 0.5],
    [0.25, 0.75, 1.0, 0.0],
    [0.5, 0.125, 0.0, 1.0],
    [0.0, 0.625, 0.25, 0.5],
    [1.0, 1.0, 0.75, 0.75],
];
pub(super) const PICTURE_SIZE: [u32; 2] = [3, 2];

pub(super) fn interpolated(v: [f64; 4]) -> [f64; 4] {
    let [width, height] = PICTURE_SIZE;
    let texels = PICTURE.map(|texel| texel.map(f64::from)).to_vec();
    let place = DVec2::new(v[0] * f64::from(width), v[1] * f64::from(height));
    Plane::new(width, height, texels)
        .map_or([f64::NAN; 4], |plane| plane.bilinear(place).to_array())
}

pub(super) fn direction([x, y, z, _]: [f64; 4]) -> [f64; 4] {
    let v = DVec3::new(x, y, z);
    let largest = v.abs().max_element();
    let known = !v.is_nan() && (2_f64.powi(-50)..=2_f64.powi(50)).contains(&largest);
    let v = if known {
        v / largest / (v / largest).length()
    } else {
        DVec3::new(0.0, 0.0, -7.0)
    };
    v.extend(0.0).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_rounded_to_nearest_even() {
        for (x, expected) in [
            (1.0 + 1.0 / 2048.0, 1.0),
            (1.0 + 3.0 / 2048.0, 1.0 + 2.0 / 1024.0),
            (2_f64.powi(-25), 0.0),
            (3.0 * 2_f64.powi(-25), 2.0 * 2_f64.powi(-24)),
            (65_519.0, 65_504.0),
            (1e30, 65_504.0),
            (-2_f64.powi(-14), -2_f64.powi(-14)),
        ] {
            assert_eq!(half(x), expected, "{x}");
        }
    }
}

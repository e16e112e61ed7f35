//! Normals that are none, that are too long or short, or point the wrong way.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec3;

use super::paint::{Canvas, Spot, Texel};
use super::{Case, CaseError, Step};

/// A wall to the left and a mirror to the right whose normal is made of the one
/// that reflects the wall.
fn changed(change: impl Fn(&Spot, DVec3) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    mirrored(Canvas::small(), change)
}

/// The same in 32 bits.
fn changed_wide(change: impl Fn(&Spot, DVec3) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    mirrored(Canvas::small().wide(), change)
}

fn mirrored(
    canvas: Canvas,
    change: impl Fn(&Spot, DVec3) -> [f32; 4],
) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| {
        if spot.uv.x < 0.5 {
            return spot.wall(3.9);
        }
        let good = DVec3::NEG_X - spot.ray.normalize();
        Texel {
            normal: change(spot, good.normalize()),
            ..spot.mirror(4.0, DVec3::NEG_X)
        }
    })
}

const fn all(value: f32) -> [f32; 4] {
    [value, value, value, 1.0]
}

fn of(normal: DVec3) -> [f32; 4] {
    [normal.x as f32, normal.y as f32, normal.z as f32, 1.0]
}

pub(super) const CASES: &[Case] = &[
    Case::new(
        "normal-zero",
        "isnan(length(N)) fires only where the driver's length(0) is NaN; else N / 0",
        "Blender T51979; bevyengine/bevy#10905",
        || changed(|_, _| all(0.0)),
    ),
    Case::new(
        "normal-minus-zero",
        "a zero with its sign bit set is not 0 to a test of bits",
        "bevyengine/bevy#10905 (zero normals at cone apexes)",
        || changed(|_, _| all(-0.0)),
    ),
    Case::new(
        "normal-zero-in-one-texel-of-each-tile",
        "single texels without a normal, as at the apexes of cones, may not spread",
        "bevyengine/bevy#10905 (zero normals at cone apexes)",
        || {
            changed(|spot, good| {
                if spot.x % 8 == 3 && spot.y % 8 == 5 {
                    all(0.0)
                } else {
                    of(good)
                }
            })
        },
    ),
    Case::new(
        "normal-a-thousandth-long",
        "interpolated normals get short: a reflection by them is none without normalising",
        "Khronos glTF 2.0, appendix B (normals are renormalised after interpolation)",
        || changed(|_, good| of(good * 1e-3)),
    ),
    Case::new(
        "normal-of-the-least-half-floats",
        "6e-8 per channel: squared it is below what f16 holds, and its direction has one bit",
        "IEEE 754 binary16 (least subnormal 2^-24)",
        || changed(|_, good| of(good * 1.2e-7)),
    ),
    Case::new(
        "normal-too-short-to-square",
        "1e-20 long: the squared length leaves f32's precision before the quotient is taken",
        "J. Demmel, Effects of Underflow on Solving Linear Systems, 1984",
        || changed_wide(|_, good| of(good * 1e-20)),
    ),
    Case::new(
        "normal-of-denormals",
        "1e-40 per channel: a device may flush it to zero where the interpreter does not",
        "WGSL §15.7.2 (subnormal values may be flushed)",
        || changed_wide(|_, good| of(good * 1e-40)),
    ),
    Case::new(
        "normal-a-thousand-long",
        "a matrix with scale leaves normals as long as it scales: mirroring by them overshoots by its square",
        "Khronos glTF 2.0, 3.7.2.1 (unit normals)",
        || changed(|_, good| of(good * 1000.0)),
    ),
    Case::new(
        "normal-of-the-largest-half-floats",
        "65504 per channel: the squared length is 1.3e10, out of range for a kernel in f16",
        "IEEE 754 binary16 (largest 65504)",
        || changed(|_, good| of(good * 37_000.0)),
    ),
    Case::new(
        "normal-too-long-to-square",
        "1e30 long: the squared length is infinite and the unit vector 0 or NaN",
        "N. Higham, Accuracy and Stability of Numerical Algorithms, 27.5",
        || changed_wide(|_, good| of(good * 1e30)),
    ),
    Case::new(
        "normal-back-facing",
        "turned over: a mirror seen from behind has no reflection, and its ray goes into it",
        "AMD FidelityFX SSSR classifier (back-facing pixels are rejected)",
        || changed(|_, good| of(-good)),
    ),
    Case::new(
        "normal-edge-on",
        "N·V is 0 to the last bit or not quite: the mirrored ray is the view ray itself",
        "E. Heitz, Sampling the GGX Distribution of Visible Normals, JCGT 7(4), 2018 (Vh.xy = 0)",
        || changed_wide(|spot, _| of(spot.ray.cross(DVec3::Y).normalize())),
    ),
    Case::new(
        "normal-grazing",
        "a hundredth of a degree above edge-on: the ray runs along the surface for the whole picture",
        "E. Heitz, JCGT 7(4), 2018; Filament, N·V clamped to 1e-4",
        || {
            changed_wide(|spot, _| {
                let edge = spot.ray.cross(DVec3::Y).normalize();
                of((edge - spot.ray.normalize() * 1.7e-4).normalize())
            })
        },
    ),
    Case::new(
        "normal-mapped-below-the-horizon",
        "N·V is positive and the mirrored ray still goes into the surface that was there before mapping",
        "Blender EEVEE (ensure_valid_reflection)",
        || changed(|_, _| of(DVec3::new(-0.95, 0.0, 0.31))),
    ),
    Case::new(
        "normal-facing-the-eye-plane",
        "exactly +z everywhere, as of a full-screen quad: rays spread from the eye and meet nothing",
        "mirror-planes: a plane does not reflect itself",
        || changed(|_, _| [0.0, 0.0, 1.0, 1.0]),
    ),
    Case::new(
        "normal-nan-in-x",
        "NaN in one channel poisons the squared length: comparisons with it decide nothing",
        "gpuweb/gpuweb#5192 (min, max and clamp may lose NaN)",
        || changed(|_, good| [f32::NAN, good.y as f32, good.z as f32, 1.0]),
    ),
    Case::new(
        "normal-nan",
        "NaN in all channels, as from normalize(0) in a geometry pass",
        "bevyengine/bevy#8925 (NaN from ambient occlusion)",
        || changed(|_, _| all(f32::NAN)),
    ),
    Case::new(
        "normal-infinite",
        "an infinite channel: infinity over infinity is NaN where zero was to come out",
        "gpuweb/gpuweb#5192",
        || changed(|_, good| [f32::INFINITY, good.y as f32, good.z as f32, 1.0]),
    ),
    Case::new(
        "normal-infinite-both-ways",
        "infinities of both signs: their sum in a dot product is NaN",
        "gpuweb/gpuweb#5192",
        || changed(|_, _| [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, 1.0]),
    ),
    Case::new(
        "normal-quantised-to-a-byte",
        "steps of 1/127 in each channel: neighbouring rays part by several texels",
        "B. Karis, normals in a G-buffer; Z. Cigolle et al., Survey of Unit Vectors, JCGT 3(2), 2014",
        || {
            changed(|_, good| {
                let step = |value: f64| (value * 127.0).round() / 127.0;
                of(DVec3::new(step(good.x), step(good.y), step(good.z)))
            })
        },
    ),
    Case::new(
        "normal-interpolated-to-nothing",
        "between two opposite vertices: the interpolated normal passes through 0 in the middle",
        "Khronos glTF 2.0, appendix B; bevyengine/bevy#10905",
        || {
            changed(|spot, good| {
                let across = 4.0 * (spot.uv.x - 0.75);
                of(good * across)
            })
        },
    ),
    Case::new(
        "normal-turning-from-texel-to-texel",
        "left and right in turn: neighbouring texels have nothing in common that a blur could keep",
        "AMD FidelityFX Denoiser (disocclusion by normals)",
        || {
            changed(|spot, good| {
                if (spot.x + spot.y) % 2 == 0 {
                    of(good)
                } else {
                    of(DVec3::new(-good.x, good.y, good.z))
                }
            })
        },
    ),
    Case::new(
        "normal-with-any-fourth-channel",
        "the fourth channel is no part of the normal: packed material ids live there, NaN among them",
        "Unity HDRP and Unreal G-buffer layouts",
        || {
            changed(|spot, good| {
                let fourth = [f32::NAN, f32::INFINITY, -65_504.0, 0.0][spot.index as usize % 4];
                [good.x as f32, good.y as f32, good.z as f32, fourth]
            })
        },
    ),
    Case::new(
        "normal-at-half-a-right-angle",
        "rays leave at exactly a right angle to the view axis from the picture's middle column",
        "M. McGuire and M. Mara, JCGT 3(4), 2014",
        || changed(|_, _| of(DVec3::new(-FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2))),
    ),
];

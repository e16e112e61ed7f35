//! Maps of light from all directions that are hard to blur.

use etalon_core::Format;

use super::{DrawnCase, LightMap};

/// The largest half float.
const MOST: f32 = 65504.0;

pub(super) const CASES: &[DrawnCase] = &[
    DrawnCase::new(
        "map-black",
        "no light: sums of nothing over sums of weights",
        "B. Karis, Real Shading in Unreal Engine 4, 2013",
        || LightMap::uniform([0.0; 3])?.staged(),
    ),
    DrawnCase::new(
        "map-of-one",
        "the same light from everywhere stays as it is, to the last bit",
        "R. Ramamoorthi and P. Hanrahan, An Efficient Representation for Irradiance Environment Maps, 2001",
        || LightMap::uniform([1.0; 3])?.staged(),
    ),
    DrawnCase::new(
        "map-all-65504",
        "the most light from everywhere: a mean one rounding above is infinite as a half float",
        "Wicked Engine #1667 (sums of half floats)",
        || LightMap::uniform([MOST; 3])?.sampled(1024).staged(),
    ),
    DrawnCase::new(
        "map-subnormal",
        "6e-8 from everywhere: the least half float, whose half is none",
        "IEEE 754 binary16",
        || LightMap::uniform([6e-8; 3])?.staged(),
    ),
    DrawnCase::new(
        "map-one-hot-texel",
        "a sun of 65504 in one texel of black: it shows as spots where directions are few",
        "J. Křivánek and M. Colbert, Real-time Shading with Filtered Importance Sampling, 2008",
        || {
            LightMap::painted([64, 32], 32, |x, y| {
                if (x, y) == (40, 9) {
                    [MOST; 3]
                } else {
                    [0.0; 3]
                }
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-hot-pole",
        "a sun straight above, where every column of the picture meets: its solid angle goes to 0",
        "M. Pharr et al., Physically Based Rendering, 4th ed., §12.5 (sin θ at the poles)",
        || {
            LightMap::painted([32, 16], 32, |_, y| {
                if y == 0 { [MOST, 0.0, 1.0] } else { [0.01; 3] }
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-hot-fold",
        "a sun straight below, at the four corners of the octahedron: one direction, four texels",
        "Z. Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors, 2014",
        || {
            LightMap::painted(
                [32, 16],
                32,
                |_, y| {
                    if y == 15 { [MOST; 3] } else { [0.0; 3] }
                },
            )?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-nan-and-infinite",
        "a picture in which every third texel is NaN or infinite, as renderers of fireflies write",
        "OpenEXR, on NaN and infinity in images",
        || {
            LightMap::painted([24, 12], 32, |x, y| match (x + 5 * y) % 9 {
                0 => [f32::NAN; 3],
                3 => [f32::INFINITY; 3],
                6 => [f32::NEG_INFINITY; 3],
                _ => [1.0, 2.0, 3.0],
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-negative",
        "negative light, as filters with lobes leave it: a sum of both signs cancels",
        "D. P. Mitchell and A. N. Netravali, Reconstruction Filters in Computer Graphics, 1988",
        || {
            LightMap::painted([24, 12], 32, |x, _| {
                if x % 2 == 0 { [-100.0; 3] } else { [100.0; 3] }
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-beyond-half",
        "1e30 from one side: as a half float it would be infinite",
        "Filament #2362",
        || {
            LightMap::painted(
                [24, 12],
                32,
                |x, _| {
                    if x < 3 { [1e30; 3] } else { [1.0; 3] }
                },
            )?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-of-one-texel",
        "a picture of 1 × 1: every neighbour of a texel is itself",
        "Godot #96758 (sizes of 0 and 1)",
        || LightMap::painted([1, 1], 32, |_, _| [0.5, 1.0, 2.0])?.staged(),
    ),
    DrawnCase::new(
        "map-of-one-row",
        "a picture of 257 × 1: no up and down to interpolate, and an odd width to go around",
        "Bevy #22603 (odd sizes)",
        || LightMap::painted([257, 1], 32, |x, _| [x as f32 / 64.0, 1.0, 0.0])?.staged(),
    ),
    DrawnCase::new(
        "map-of-odd-size",
        "101 × 51: no column at the seam, no row at the horizon",
        "Bevy #22603 (odd sizes)",
        || LightMap::painted([101, 51], 32, |x, y| [x as f32, y as f32, 1.0])?.staged(),
    ),
    DrawnCase::new(
        "map-chequered",
        "black and 65504 in turn: every interpolation is a difference of the two",
        "J. Křivánek and M. Colbert, Real-time Shading with Filtered Importance Sampling, 2008",
        || {
            LightMap::painted([64, 32], 64, |x, y| {
                if (x + y) % 2 == 0 {
                    [MOST; 3]
                } else {
                    [0.0; 3]
                }
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-of-most-directions",
        "1024 directions: the finest Hammersley's points, the angle between two 0.006",
        "J. M. Hammersley, Monte Carlo Methods for Solving Multivariable Problems, 1960",
        || {
            LightMap::painted([64, 32], 32, |x, y| [x as f32 / 8.0, y as f32, 0.25])?
                .sampled(1024)
                .staged()
        },
    ),
    DrawnCase::new(
        "map-with-nan-in-its-image",
        "an image that no host has looked at: NaN, infinite and negative texels among the mips",
        "WGSL §15.7.2 (implementations may assume that there are none)",
        || {
            LightMap::raw(32, Format::Rgba32Float, |index| match index % 7 {
                0 => [f32::NAN; 4],
                2 => [f32::INFINITY; 4],
                4 => [f32::NEG_INFINITY, -1.0, -0.0, 1.0],
                _ => [1.0, 0.5, 0.25, 1.0],
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "map-with-every-exponent-in-its-image",
        "floats of all exponents and both signs, subnormal ones among them",
        "IEEE 754 binary32",
        || {
            LightMap::raw(32, Format::Rgba32Float, |index| {
                let number = f32::from_bits(index.wrapping_mul(0x9e37_79b9));
                [number, -number, number, 1.0]
            })?
            .staged()
        },
    ),
    DrawnCase::new(
        "mirroring-at-grazing-angles",
        "the table of what is mirrored, whose first column looks along the surface: tangents of 1e4",
        "E. Heitz, Sampling the GGX Distribution of Visible Normals, 2018",
        || LightMap::uniform([1.0; 3])?.with_table().staged(),
    ),
];

//! Every bit pattern, and all combinations of the special ones.

use half::f16;

use super::paint::{Canvas, SMALL, Spot, Texel};
use super::{Case, CaseError, FrameSource, Step};

/// The side of a picture with a texel for each pattern of 16 bits.
const SIDE: u32 = 256;

const CODES: &str = "gpuweb/gpuweb#5192 (min, max and clamp may lose NaN); IEEE 754 binary16";

/// Each of the 65,536 half floats once.
fn every_half(place: fn(f32, Texel) -> Texel) -> Result<Vec<Step>, CaseError> {
    Canvas::new((SIDE, SIDE)).paint(|spot| {
        let value = f16::from_bits(spot.index as u16).to_f32();
        place(value, spot.room())
    })
}

/// The upper half of each f32's bits once: all signs and exponents, seven bits of
/// mantissa, and random bits below those.
fn every_upper_half(
    canvas: Canvas,
    place: fn(f32, Texel) -> Texel,
) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| {
        let below = spot.random(3) & 0xffff;
        place(f32::from_bits(spot.index << 16 | below), spot.room())
    })
}

/// NaNs, infinities, zeros and ends of ranges, of both signs.
const SPECIAL: [f32; 16] = [
    f32::NAN,
    -f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    0.0,
    -0.0,
    1.0,
    -1.0,
    65_504.0,
    -65_504.0,
    5.960_464_5e-8,
    -5.960_464_5e-8,
    6.103_515_6e-5,
    0.5,
    2.0,
    1e-3,
];

/// The special value that a pixel has in the `place`-th of several inputs.
fn special(spot: &Spot, place: u32) -> f32 {
    SPECIAL[(spot.index >> (4 * place) & 15) as usize]
}

pub(super) const CASES: &[Case] = &[
    Case::new(
        "bits-half-red",
        "all 65,536 half floats in red: 2046 NaNs, both infinities, 2046 subnormals",
        CODES,
        || {
            every_half(|value, room| Texel {
                colour: [value, room.colour[1], room.colour[2], 1.0],
                ..room
            })
        },
    ),
    Case::new(
        "bits-half-green",
        "all 65,536 half floats in green, which has most of luminance",
        CODES,
        || {
            every_half(|value, room| Texel {
                colour: [room.colour[0], value, room.colour[2], 1.0],
                ..room
            })
        },
    ),
    Case::new(
        "bits-half-blue",
        "all 65,536 half floats in blue, which has least of luminance",
        CODES,
        || {
            every_half(|value, room| Texel {
                colour: [room.colour[0], room.colour[1], value, 1.0],
                ..room
            })
        },
    ),
    Case::new(
        "bits-half-alpha",
        "all 65,536 half floats in alpha, which is copied, limited and never mixed in",
        CODES,
        || {
            every_half(|value, room| Texel {
                colour: [room.colour[0], room.colour[1], room.colour[2], value],
                ..room
            })
        },
    ),
    Case::new(
        "bits-half-normal-x",
        "all 65,536 half floats in the normal's x",
        CODES,
        || {
            every_half(|value, room| Texel {
                normal: [value, room.normal[1], room.normal[2], 1.0],
                ..room
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-half-normal-y",
        "all 65,536 half floats in the normal's y",
        CODES,
        || {
            every_half(|value, room| Texel {
                normal: [room.normal[0], value, room.normal[2], 1.0],
                ..room
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-half-normal-z",
        "all 65,536 half floats in the normal's z",
        CODES,
        || {
            every_half(|value, room| Texel {
                normal: [room.normal[0], room.normal[1], value, 1.0],
                ..room
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-half-velocity",
        "all 65,536 half floats in velocity, which nothing may read that does not ask for it",
        CODES,
        || {
            every_half(|value, room| Texel {
                velocity: [value, -value],
                ..room
            })
        },
    )
    .on(&["chain"]),
    Case::new(
        "bits-single-depth",
        "every sign and exponent of f32 in depth, with all upper bits of its mantissa",
        CODES,
        || {
            every_upper_half(Canvas::new((SIDE, SIDE)), |value, room| Texel {
                depth: value,
                ..room
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-single-colour",
        "every sign and exponent of f32 in a colour of 32 bits",
        CODES,
        || {
            every_upper_half(Canvas::new((SIDE, SIDE)).wide(), |value, room| Texel {
                colour: [value, 0.5 * value, room.colour[2], value],
                ..room
            })
        },
    ),
    Case::new(
        "bits-single-specular",
        "every sign and exponent of f32 in a specular map of 32 bits",
        CODES,
        || {
            every_upper_half(Canvas::new((SIDE, SIDE)).wide(), |value, room| Texel {
                specular: [value, 1.0, value, value],
                ..room
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-special-colours",
        "NaN, infinity, zero and the ends against each other in three channels",
        CODES,
        || {
            Canvas::new((64, 64)).paint(|spot| Texel {
                colour: [special(spot, 0), special(spot, 1), special(spot, 2), 1.0],
                ..spot.room()
            })
        },
    ),
    Case::new(
        "bits-special-normals",
        "the same in three channels of the normal: inf - inf, 0 · inf and NaN in one dot product",
        CODES,
        || {
            Canvas::new((64, 64)).paint(|spot| Texel {
                normal: [special(spot, 0), special(spot, 1), special(spot, 2), 1.0],
                ..spot.room()
            })
        },
    )
    .on(&["ssr", "chain"]),
    Case::new(
        "bits-special-depth-normal-and-colour",
        "special values in three images at one texel: each is made finite where it is read, or none is",
        CODES,
        || {
            Canvas::new((64, 64)).wide().paint(|spot| Texel {
                colour: [special(spot, 1); 4],
                depth: special(spot, 0),
                normal: [special(spot, 2), 0.3, 0.9, 1.0],
                ..spot.room()
            })
        },
    ),
    Case::new(
        "bits-hard-inputs",
        "one texel in sixteen of every image replaced by something special",
        "godotengine/godot#80992; bevyengine/bevy#8925",
        || FrameSource("hard-inputs").steps(SMALL),
    ),
    Case::new(
        "bits-hard-inputs-odd",
        "the same at a prime size, where the special ones meet the edges",
        "godotengine/godot#80992; bevyengine/bevy#8925",
        || FrameSource("hard-inputs").steps((61, 37)),
    ),
    Case::new(
        "bits-random",
        "random bits in all images: what uninitialised memory looks like",
        "gfx-rs/wgpu (uninitialised textures); bevyengine/bevy#8925",
        || {
            let bits = |spot: &Spot, seed: u32| f32::from_bits(spot.random(seed));
            Canvas::small().wide().paint(|spot| Texel {
                colour: [bits(spot, 1), bits(spot, 2), bits(spot, 3), bits(spot, 4)],
                depth: bits(spot, 5),
                normal: [bits(spot, 6), bits(spot, 7), bits(spot, 8), bits(spot, 9)],
                specular: [
                    bits(spot, 10),
                    bits(spot, 11),
                    bits(spot, 12),
                    bits(spot, 13),
                ],
                velocity: [bits(spot, 14), bits(spot, 15)],
            })
        },
    ),
];

//! Widths and heights that tiles, mips and workgroups do not divide.

use super::paint::{Canvas, Spot};
use super::{Case, CaseError, Step};

fn room(width: u32, height: u32) -> Result<Vec<Step>, CaseError> {
    Canvas::new((width, height)).paint(Spot::room)
}

const MIPS: &str = "godotengine/godot#96758 (mip sizes of 0 divide)";
const NPOT: &str = "bevyengine/bevy#22603 (pyramids of sizes that are no powers of two)";

pub(super) const CASES: &[Case] = &[
    Case::new(
        "size-1x1",
        "one texel: no mip below it, no neighbour, no ray across it",
        MIPS,
        || room(1, 1),
    ),
    Case::new(
        "size-1x2",
        "two texels: the first mip is the last, and halves one axis only",
        MIPS,
        || room(1, 2),
    ),
    Case::new(
        "size-2x1",
        "the same on its side: axes may not be mixed up",
        MIPS,
        || room(2, 1),
    ),
    Case::new(
        "size-2x2",
        "exactly one mip, of one texel that has four parents",
        NPOT,
        || room(2, 2),
    ),
    Case::new(
        "size-3x3",
        "three parents across: 2 × 2 of them miss the last row",
        NPOT,
        || room(3, 3),
    ),
    Case::new("size-5x5", "odd at every level: 5, 3, 2, 1", NPOT, || {
        room(5, 5)
    }),
    Case::new(
        "size-7x13",
        "two primes: no workgroup, tile or mip divides it",
        NPOT,
        || room(7, 13),
    ),
    Case::new(
        "size-8x8",
        "one workgroup to the last invocation",
        "WGSL §15 (workgroups)",
        || room(8, 8),
    ),
    Case::new(
        "size-9x9",
        "four workgroups, three of them with one row or column to do",
        "WGSL §15 (workgroups)",
        || room(9, 9),
    ),
    Case::new(
        "size-15x17",
        "one less and one more than a tile of the sum of luminance",
        "etalon: exposure/luminance",
        || room(15, 17),
    ),
    Case::new(
        "size-16x16",
        "one tile: the sum ends after one pass",
        "etalon: exposure/luminance",
        || room(16, 16),
    ),
    Case::new(
        "size-17x31",
        "primes beside powers of two: three tiles hang over",
        NPOT,
        || room(17, 31),
    ),
    Case::new(
        "size-31x33",
        "fractional size·0.5^mip and floored mips part by one texel",
        "FFX SSSR (fractional mip sizes); bevyengine/bevy#22603",
        || room(31, 33),
    ),
    Case::new(
        "size-64x64",
        "a power of two: every level has as many parents as it expects",
        NPOT,
        || room(64, 64),
    ),
    Case::new(
        "size-97x55",
        "odd and composite, as a resized window is",
        NPOT,
        || room(97, 55),
    ),
    Case::new(
        "size-127x3",
        "long and flat: one axis runs out of mips five levels before the other",
        MIPS,
        || room(127, 3),
    ),
    Case::new(
        "size-3x127",
        "high and narrow: the same with rows",
        MIPS,
        || room(3, 127),
    ),
    Case::new("size-257x1", "a row just over a power of two", MIPS, || {
        room(257, 1)
    }),
    Case::new(
        "size-1x4096",
        "a column of 4096: twelve levels of one texel's width",
        MIPS,
        || room(1, 4096),
    ),
    Case::new(
        "size-4096x1",
        "a row of 4096: rays along x only",
        MIPS,
        || room(4096, 1),
    ),
    Case::new(
        "size-8192x1",
        "the widest picture that every device has to take",
        "WebGPU, 3.6.2 (maxTextureDimension2D 8192)",
        || room(8192, 1),
    ),
    Case::new(
        "size-1x8192",
        "the highest picture that every device has to take",
        "WebGPU, 3.6.2 (maxTextureDimension2D 8192)",
        || room(1, 8192),
    ),
];

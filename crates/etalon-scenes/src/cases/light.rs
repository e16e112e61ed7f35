//! Amounts of light: none, all that there is, in a single texel, around the
//! thresholds of bloom.

use super::paint::{Canvas, Spot, Texel};
use super::{Case, CaseError, Step};

/// Largest half float.
const MOST: f32 = 65_504.0;

/// The room's surfaces in colours of their own.
fn lit(colour: impl Fn(&Spot) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    painted(Canvas::small(), colour)
}

fn painted(canvas: Canvas, colour: impl Fn(&Spot) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| Texel {
        colour: colour(spot),
        ..spot.room()
    })
}

const fn grey(value: f32) -> [f32; 4] {
    [value, value, value, 1.0]
}

/// One texel of the most light there is, in black.
fn hot(at: (u32, u32), value: [f32; 4]) -> Result<Vec<Step>, CaseError> {
    lit(move |spot| {
        if (spot.x, spot.y) == at {
            value
        } else {
            grey(0.0)
        }
    })
}

const FIREFLY: &str = "B. Karis, Tone Mapping, 2013; J. Jimenez, SIGGRAPH 2014 (fireflies)";
const PARITY: &str = "J. Jimenez, Next Generation Post Processing in Call of Duty, SIGGRAPH 2014 (13 taps between texels)";
const BLACK: &str = "bevyengine/bevy#13446, #25798 (all-black frames)";
const RANGE: &str =
    "google/filament#2362 (clamp to the largest f16); wickedengine/WickedEngine#1667";
const KNEE: &str = "Unity post-processing v2, bloom (quadratic knee); bevyengine/bevy bloom";

pub(super) const CASES: &[Case] = &[
    Case::new(
        "light-none",
        "all black: the logarithm of the average, and every weight's divisor, is of 0",
        BLACK,
        || lit(|_| grey(0.0)),
    ),
    Case::new(
        "light-minus-zero",
        "black with the sign bit set: 1/x of it is minus infinity",
        "IEEE 754, 6.3",
        || lit(|_| grey(-0.0)),
    ),
    Case::new(
        "light-most",
        "all 65504: any sum of two of them is out of f16's range",
        RANGE,
        || lit(|_| grey(MOST)),
    ),
    Case::new(
        "light-most-on-mirrors",
        "65504 seen in a mirror that shines as much: colour + reflection is 131008",
        RANGE,
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.5 {
                    spot.wall(3.9).coloured([MOST; 3])
                } else {
                    spot.mirror(4.0, glam::DVec3::NEG_X).coloured([MOST; 3])
                }
            })
        },
    ),
    Case::new(
        "light-infinite",
        "a whole picture of infinity: Karis' weight makes infinity times 0 of it",
        "bevyengine/bevy bloom.wgsl (weight before clamp)",
        || lit(|_| [f32::INFINITY; 4]),
    ),
    Case::new(
        "light-nan",
        "a whole picture of NaN: nothing to measure, nothing to glow, and still a picture",
        "bevyengine/bevy#25798",
        || lit(|_| [f32::NAN; 4]),
    ),
    Case::new(
        "light-negative",
        "negative colours, as of a sharpening filter or a gamut matrix",
        "darktable-org/darktable#8753; godotengine/godot#66462",
        || lit(|spot| [-1.0, -0.25, 0.5 * (spot.uv.x as f32), 1.0]),
    ),
    Case::new(
        "light-most-negative",
        "-65504: its luminance is negative, and 1 + luminance is no divisor",
        "B. Karis, Tone Mapping, 2013 (1 / (1 + luminance))",
        || lit(|_| grey(-MOST)),
    ),
    Case::new(
        "light-whose-luminance-is-minus-one",
        "1 + luminance is 0: Reinhard's and Karis' quotient",
        "B. Karis, Tone Mapping, 2013 (1 / (1 + luminance))",
        || lit(|_| grey(-1.0)),
    ),
    Case::new(
        "light-denormal-half",
        "all channels of subnormal half floats: steps are as large as the values",
        "IEEE 754 binary16",
        || lit(|spot| grey(f32::from(half::f16::from_bits((spot.index % 1024) as u16)))),
    ),
    Case::new(
        "light-denormal-single",
        "1e-40 in 32 bits: flushed on one device and not on the next",
        "WGSL §15.7.2",
        || painted(Canvas::small().wide(), |_| grey(1e-40)),
    ),
    Case::new(
        "light-largest-single",
        "3.4e38 in 32 bits: finite, and any product with it is not",
        RANGE,
        || painted(Canvas::small().wide(), |_| grey(f32::MAX)),
    ),
    Case::new(
        "light-over-f16",
        "1e5 in 32 bits: finite until it is stored",
        RANGE,
        || painted(Canvas::small().wide(), |_| grey(1e5)),
    ),
    Case::new(
        "light-hot-texel-even-even",
        "one texel of 65504 at even x and y: the first of the two that halving pairs",
        PARITY,
        || hot((24, 16), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-odd-even",
        "at odd x and even y: the second of a pair in one axis",
        PARITY,
        || hot((25, 16), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-even-odd",
        "at even x and odd y: the second of a pair in the other axis",
        PARITY,
        || hot((24, 17), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-odd-odd",
        "at odd x and y: the second of a pair in both axes",
        PARITY,
        || hot((25, 17), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-odd-in-mip-1",
        "even in the picture, odd in its first mip",
        PARITY,
        || hot((22, 18), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-odd-in-mip-2",
        "odd in the second mip only",
        PARITY,
        || hot((20, 12), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-odd-in-every-mip",
        "bits all ones: the second of a pair at every level",
        PARITY,
        || hot((31, 15), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-in-a-corner",
        "three quarters of the filter repeat it: edges may not add light",
        PARITY,
        || hot((0, 0), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-in-the-last-corner",
        "the last texel of both axes, repeated on the other side",
        PARITY,
        || hot((47, 31), grey(MOST)),
    ),
    Case::new(
        "light-hot-texel-of-infinity",
        "one infinite texel: weighted by 1 / infinity it is NaN, and the mips spread it",
        "bevyengine/bevy bloom.wgsl (weight before clamp)",
        || hot((24, 16), grey(f32::INFINITY)),
    ),
    Case::new(
        "light-hot-texel-of-nan",
        "one texel of NaN: 13 taps, then 64 texels, then the screen",
        "godotengine/godot#80992; wickedengine/WickedEngine#1667",
        || hot((24, 16), [f32::NAN; 4]),
    ),
    Case::new(
        "light-hot-texel-of-one-channel",
        "blue alone: its luminance is a fourteenth, so weights by luminance hardly see it",
        FIREFLY,
        || hot((24, 16), [0.0, 0.0, MOST, 1.0]),
    ),
    Case::new(
        "light-chequer-of-most-and-none",
        "65504 and 0 in turn: each average has as many of each, in no order",
        FIREFLY,
        || {
            lit(|spot| {
                grey(if (spot.x + spot.y) % 2 == 0 {
                    MOST
                } else {
                    0.0
                })
            })
        },
    ),
    Case::new(
        "light-columns-of-most-and-none",
        "in turn by columns: rows and columns of a filter see different pictures",
        FIREFLY,
        || lit(|spot| grey(if spot.x % 2 == 0 { MOST } else { 0.0 })),
    ),
    Case::new(
        "light-fireflies",
        "one texel in a hundred of 65504 over grey",
        FIREFLY,
        || {
            lit(|spot| {
                grey(if spot.random(7).is_multiple_of(100) {
                    MOST
                } else {
                    0.18
                })
            })
        },
    ),
    Case::new(
        "light-half-and-half",
        "an edge between nothing and the most there is",
        RANGE,
        || lit(|spot| grey(if spot.uv.x < 0.5 { 0.0 } else { MOST })),
    ),
    Case::new(
        "light-ramp-over-all-half-floats",
        "2^-24 to 2^16 from left to right: forty stops in one average",
        "E. Reinhard et al., Photographic Tone Reproduction, 2002 (equation 1)",
        || lit(|spot| grey((40.0 * spot.uv.x - 24.0).exp2() as f32)),
    ),
    Case::new(
        "light-ones",
        "the mean of ones is 1: a running sum of 8192 texels in f16 stops at 2048",
        "wickedengine/WickedEngine#1667 (sums in f16)",
        || painted(Canvas::new((128, 64)), |_| grey(1.0)),
    ),
    Case::new(
        "light-at-the-threshold",
        "exactly white, and an ulp to either side: bloom's threshold is a subtraction",
        KNEE,
        || lit(|spot| grey([1.0, 1.000_976_6, 0.999_511_7][spot.index as usize % 3])),
    ),
    Case::new(
        "light-at-the-foot-of-the-knee",
        "half the threshold, and an ulp to either side: the square of a difference near 0",
        KNEE,
        || lit(|spot| grey([0.5, 0.500_488_3, 0.499_755_9][spot.index as usize % 3])),
    ),
    Case::new(
        "light-at-the-head-of-the-knee",
        "where the quadratic meets the line: both are to give the same",
        KNEE,
        || lit(|spot| grey([1.5, 1.500_976_6, 1.499_023_4][spot.index as usize % 3])),
    ),
    Case::new(
        "light-without-threshold",
        "threshold 0 and a knee of 0: the slope of the knee is 0.25 / 0",
        KNEE,
        || lit(|spot| grey(spot.uv.x as f32)),
    )
    .on(&["bloom"])
    .with(&[("threshold", etalon_effects::knob::KnobValue::Real(0.0))]),
    Case::new(
        "light-with-a-step-for-a-knee",
        "threshold 1 and a knee of 0: the slope of the knee is 0.25 / 0",
        KNEE,
        || lit(|spot| grey(2.0 * spot.uv.x as f32)),
    )
    .on(&["bloom"])
    .with(&[("knee", etalon_effects::knob::KnobValue::Real(0.0))]),
    Case::new(
        "light-most-in-packed-floats",
        "65504 in a format that ends at 65024 and 64512",
        "bevyengine/bevy bloom (Rg11b10Ufloat, bound 3.4e37)",
        || lit(|spot| grey(if spot.x % 3 == 0 { MOST } else { 65_000.0 })),
    )
    .on(&["bloom"])
    .with(&[(
        "storage",
        etalon_effects::knob::KnobValue::Choice("rg11b10ufloat"),
    )]),
    Case::new(
        "light-hues-in-packed-floats",
        "steps of 1/64 in red and green and 1/32 in blue: hues drift over the mips",
        "Khronos Data Format Specification, 10 (unsigned 11- and 10-bit floats)",
        || lit(|spot| [3.0 + spot.uv.x as f32, 3.0 + spot.uv.y as f32, 3.5, 1.0]),
    )
    .on(&["bloom"])
    .with(&[(
        "storage",
        etalon_effects::knob::KnobValue::Choice("rg11b10ufloat"),
    )]),
    Case::new(
        "light-grey-in-every-average",
        "middle grey: geometric and arithmetic mean are one number",
        "E. Reinhard et al., 2002",
        || lit(|_| grey(0.18)),
    ),
    Case::new(
        "light-under-the-darkest-adapted-to",
        "1e-5: below the floor, the exposure must end and not grow on",
        BLACK,
        || lit(|_| grey(1e-5)),
    ),
    Case::new(
        "light-one-lit-texel-in-the-dark",
        "1535 texels without a logarithm and one with",
        "E. Reinhard et al., 2002 (delta in the logarithm)",
        || hot((7, 3), grey(1.0)),
    )
    .on(&["exposure", "chain"]),
    Case::new(
        "light-arithmetic-mean-of-most",
        "an arithmetic mean of 65504: a plain sum of 1536 of them is 1e8, past every f32 integer",
        RANGE,
        || lit(|_| grey(MOST)),
    )
    .on(&["exposure"])
    .with(&[(
        "metering",
        etalon_effects::knob::KnobValue::Choice("arithmetic"),
    )]),
    Case::new(
        "light-with-any-alpha",
        "alpha NaN, infinite, negative, 2: coverage is what later passes weigh by",
        "godotengine/godot#66462",
        || {
            lit(|spot| {
                let alpha = [f32::NAN, f32::INFINITY, -1.0, 2.0, f32::NEG_INFINITY, 0.5]
                    [spot.index as usize % 6];
                [0.5, 0.5, 0.5, alpha]
            })
        },
    ),
    Case::new(
        "light-of-saturated-primaries",
        "one channel at a time at 65504: matrices of tone curves make negatives of it",
        "godotengine/godot#101515, #51439 (AgX)",
        || {
            lit(|spot| {
                let mut colour = [0.0, 0.0, 0.0, 1.0];
                colour[spot.index as usize % 3] = MOST;
                colour
            })
        },
    ),
];

//! Where tone curves begin, bend, end and divide.

use etalon_effects::knob::KnobValue::Choice;

use super::paint::{Canvas, Spot, Texel};
use super::{Case, CaseError, Step};

const COMPOSITE: &[&str] = &["composite"];

/// A picture of flat patches, each of one of these numbers in every channel, the
/// last in one channel only.
fn patches(values: &'static [f32]) -> Result<Vec<Step>, CaseError> {
    Canvas::new((32, 16)).paint(|spot| {
        let value = values[spot.index as usize % values.len()];
        let colour = match (spot.y / 4) % 4 {
            0 => [value; 3],
            1 => [value, 0.0, 0.0],
            2 => [0.0, value, 0.5],
            _ => [1.0, 0.18, value],
        };
        Texel {
            colour: [colour[0], colour[1], colour[2], 1.0],
            ..spot.room()
        }
    })
}

/// Grey from 2^-14 to 2^6 over the picture, each texel another.
fn ramp() -> Result<Vec<Step>, CaseError> {
    Canvas::new((64, 16)).paint(|spot| {
        let value = (20.0 * f64::from(spot.index) / 1024.0 - 14.0).exp2() as f32;
        spot.room().coloured([value; 3])
    })
}

/// Grey around a number, an ulp of a half float at a time.
fn around(value: f32) -> Result<Vec<Step>, CaseError> {
    let grey = move |spot: &Spot| {
        let code = half::f16::from_f32(value).to_bits() + spot.x as u16;
        half::f16::from_bits(code - 16).to_f32()
    };
    Canvas::new((32, 4)).paint(|spot| spot.room().coloured([grey(spot); 3]))
}

const ZERO: &[f32] = &[0.0, -0.0, 5.960_464_5e-8, 6.103_515_6e-5];
const NEGATIVE: &[f32] = &[-1e-4, -0.22, -0.5, -1.0, -4.0, -65_504.0];
const LARGEST: &[f32] = &[65_504.0, 32_768.0, 1_000.0, 64.0];

pub(super) const CASES: &[Case] = &[
    Case::new("tone-linear-zero", "black through the plain limit: nothing may be added to it, as 0.00014 is in tony-mc-mapface", "WGSL 17.5 (clamp with NaN)", || patches(ZERO))
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-linear-negative", "negatives through the plain limit: max() alone decides what NaN and -0 become", "WGSL 17.5 (clamp with NaN)", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-linear-largest", "65504 through the plain limit: exactly white, code 255", "WGSL 17.5 (clamp with NaN)", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-linear-ramp", "twenty stops of grey through linear: a neutral ramp has to stay neutral and rising", "WGSL 17.5 (clamp with NaN)", ramp)
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-reinhard-zero", "black through Reinhard: 0 over 1, if luminance is not divided by first", "E. Reinhard et al., 2002, equation 4", || patches(ZERO))
        .on(COMPOSITE)
        .with(&[("output", Choice("reinhard"))]),
    Case::new("tone-reinhard-negative", "a luminance of -1 through Reinhard: its denominator 1 + L is 0", "E. Reinhard et al., 2002, equation 4", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("reinhard"))]),
    Case::new("tone-reinhard-largest", "65504 through Reinhard: L² is 4e9, fine in f32 and infinite in f16", "E. Reinhard et al., 2002, equation 4", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("reinhard"))]),
    Case::new("tone-reinhard-ramp", "twenty stops of grey through reinhard: a neutral ramp has to stay neutral and rising", "E. Reinhard et al., 2002, equation 4", ramp)
        .on(COMPOSITE)
        .with(&[("output", Choice("reinhard"))]),
    Case::new("tone-aces-zero", "black through ACES: the numerator is negative there, -0.00009", "S. Hill, BakingLab ACES.hlsl, 2016", || patches(ZERO))
        .on(COMPOSITE)
        .with(&[("output", Choice("aces"))]),
    Case::new("tone-aces-negative", "negatives through ACES: the denominator has a zero at -0.22", "S. Hill, BakingLab ACES.hlsl, 2016", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("aces"))]),
    Case::new("tone-aces-largest", "65504 through ACES: a quotient of two numbers of 4e9 that has to end at its asymptote", "S. Hill, BakingLab ACES.hlsl, 2016", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("aces"))]),
    Case::new("tone-aces-ramp", "twenty stops of grey through aces: a neutral ramp has to stay neutral and rising", "S. Hill, BakingLab ACES.hlsl, 2016", ramp)
        .on(COMPOSITE)
        .with(&[("output", Choice("aces"))]),
    Case::new("tone-neutral-zero", "black through PBR Neutral: low - 6.25 low² subtracts 0 from 0, and peak is no divisor", "Khronos PBR Neutral Tone Mapper, 2024", || patches(ZERO))
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-neutral-negative", "negatives through PBR Neutral: the toe's offset is a parabola that goes the other way", "Khronos PBR Neutral Tone Mapper, 2024", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-neutral-largest", "65504 through PBR Neutral: 1 - room²/(peak + ...) is 1 but for rounding", "Khronos PBR Neutral Tone Mapper, 2024", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-neutral-ramp", "twenty stops of grey through neutral: a neutral ramp has to stay neutral and rising", "Khronos PBR Neutral Tone Mapper, 2024", ramp)
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-agx-zero", "black through AgX: log2(0)", "T. Sobotka, AgX, 2022; godotengine/godot#101515, #51439", || patches(ZERO))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-agx-negative", "negatives through AgX: log2 of a negative number, and pow of one after the matrix", "T. Sobotka, AgX, 2022; godotengine/godot#101515, #51439", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-agx-largest", "65504 through AgX: 12 stops above where its logarithm is limited", "T. Sobotka, AgX, 2022; godotengine/godot#101515, #51439", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-agx-ramp", "twenty stops of grey through agx: a neutral ramp has to stay neutral and rising", "T. Sobotka, AgX, 2022; godotengine/godot#101515, #51439", ramp)
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-neutral-start", "where PBR Neutral's compression begins, at a peak of 0.8: two formulas that meet", "Khronos PBR Neutral Tone Mapper, 2024", || around(0.8))
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-neutral-toe", "where PBR Neutral's toe ends, at 0.08: a parabola that meets a constant", "Khronos PBR Neutral Tone Mapper, 2024", || around(0.08))
        .on(COMPOSITE)
        .with(&[("output", Choice("neutral"))]),
    Case::new("tone-agx-lower-end", "2^-12.47393, where AgX cuts its logarithm off: a corner at a value of f16's subnormals", "T. Sobotka, AgX, 2022", || around(1.757e-4))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-agx-upper-end", "2^4.026069, where AgX's logarithm ends: the curve has to be flat beyond it", "T. Sobotka, AgX, 2022", || around(16.29))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx"))]),
    Case::new("tone-srgb-knee", "0.0031308, where sRGB goes from a line to a power: the two meet but for 1e-7", "IEC 61966-2-1", || around(0.003_130_8))
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-srgb-white", "around 1, where encoding ends: a power's rounding may not exceed white", "IEC 61966-2-1", || around(1.0))
        .on(COMPOSITE)
        .with(&[("output", Choice("linear"))]),
    Case::new("tone-hdr-largest", "no curve, into half floats: 65504 may not round to infinity", "google/filament#2362", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("hdr"))]),
    Case::new("tone-hdr-negative", "no curve, negatives: linear light for a display pipeline that takes logarithms", "darktable-org/darktable#8753", || patches(NEGATIVE))
        .on(COMPOSITE)
        .with(&[("output", Choice("hdr"))]),
    Case::new("tone-hdr-at-a-million-stops-up", "no curve and an exposure of 1e6: products of 6.5e10 have to end at 65504", "google/filament#2362", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("hdr")), ("exposure", etalon_effects::knob::KnobValue::Real(1e6))]),
    Case::new("tone-agx-at-exposure-none", "a factor of 0 on any light: 0 times 65504, and then a logarithm", "T. Sobotka, AgX, 2022", || patches(LARGEST))
        .on(COMPOSITE)
        .with(&[("output", Choice("agx")), ("exposure", etalon_effects::knob::KnobValue::Real(0.0))]),
];

//! The truth of the composite: exposure, glow, tone curve and encoding in f64,
//! from the published formulas, and not rounded to 8 bits.
//!
//! # Definition
//! Light, sanitised, times the exposure, plus the glow doubled in size times its
//! intensity, limited to 65504, goes through the tone curve, is limited to
//! `[0, 1]`, and encoded as sRGB. For a display that has its own curve it stays
//! as it is before that.
//!
//! # Source
//! * Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002,
//!   equation 4, on luminance.
//! * S. Hill's fit of ACES, "ACES.hlsl" of BakingLab, 2016.
//! * "Khronos PBR Neutral Tone Mapper", specification of 2024.
//! * T. Sobotka's AgX, 2022, in B. Wrensch's "Minimal AgX Implementation", 2023.
//! * sRGB: IEC 61966-2-1.

use etalon_core::texel::linear_to_srgb;
use glam::{DMat3, DVec2, DVec3, Vec4Swizzles as _};

use super::{Composite, Output, ToneCurve};
use crate::EffectError;
use crate::check::{Settings, same_size};
use crate::truth::{MOST_LIGHT, Plane, light, luminance, not_negative, unit_interval};

/// A bloom to be added, and how much of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glow<'a> {
    /// Half the size of the picture, rounded up; exposed already. Values that are
    /// no light count as [`radiance`](crate::truth::radiance) says.
    pub bloom: &'a Plane,
    /// Factor on it, in `[0, 16]`.
    pub intensity: f32,
}

/// A matrix from its rows, as they are published.
fn rows(rows: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// What a tone curve makes of linear light that is not negative: linear, in
/// `[0, 1]`.
#[must_use]
pub fn tone(curve: ToneCurve, colour: DVec3) -> DVec3 {
    let shown = match curve {
        ToneCurve::Linear => colour,
        ToneCurve::Reinhard { white } => reinhard(colour, white.into()),
        ToneCurve::Aces => aces(colour),
        ToneCurve::Neutral => neutral(colour),
        ToneCurve::AgX => agx(colour),
    };
    shown.clamp(DVec3::ZERO, DVec3::ONE)
}

/// `L' = L (1 + L / white²) / (1 + L)`, hue and saturation kept.
fn reinhard(colour: DVec3, white: f64) -> DVec3 {
    let l = luminance(colour);
    colour * ((1.0 + l / white.powi(2)) / (1.0 + l))
}

/// `RRTAndODTFit` between the two matrices.
fn aces(colour: DVec3) -> DVec3 {
    let input = rows([
        [0.59719, 0.35458, 0.04823],
        [0.07600, 0.90834, 0.01566],
        [0.02840, 0.13383, 0.83777],
    ]);
    let output = rows([
        [1.60475, -0.53108, -0.07367],
        [-0.10208, 1.10813, -0.00605],
        [-0.00327, -0.07276, 1.07602],
    ]);
    let v = input * colour;
    let a = v * (v + 0.024_578_6) - 0.000_090_537;
    let b = v * (v * 0.983_729 + 0.432_951) + 0.238_081;
    output * (a / b)
}

/// In the symbols of the specification.
fn neutral(colour: DVec3) -> DVec3 {
    let (f90, ks, kd) = (0.04, 0.8 - 0.04, 0.15);
    let x = colour.min_element();
    let f = if x <= 2.0 * f90 {
        x - x * x / (4.0 * f90)
    } else {
        f90
    };
    let base = colour - f;
    let p = base.max_element();
    if p <= ks {
        return base;
    }
    let pn = 1.0 - (1.0 - ks).powi(2) / (p + 1.0 - 2.0 * ks);
    let g = 1.0 / (kd * (p - pn) + 1.0);
    base * (pn / p) * g + DVec3::splat(pn) * (1.0 - g)
}

/// Inset, logarithm, sigmoid, outset, and from a display of gamma 2.2 to light.
fn agx(colour: DVec3) -> DVec3 {
    let inset = rows([
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]);
    let outset = rows([
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ]);
    let (least, most) = (-12.47393, 4.026069);
    let sigmoid = |light: f64| {
        let x = (light.log2().clamp(least, most) - least) / (most - least);
        let [x2, x4] = [x * x, x.powi(4)];
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x
            - 0.00232
    };
    let display = outset * (inset * colour).map(sigmoid);
    display
        .clamp(DVec3::ZERO, DVec3::ONE)
        .map(|channel| channel.powf(2.2))
}

/// sRGB's encoding of linear light limited to `[0, 1]`; 0 for NaN.
#[must_use]
pub fn srgb_encoded(linear: f64) -> f64 {
    linear_to_srgb(unit_interval(linear))
}

/// Texel `(x, y)` of a picture doubled in size: bilinear interpolation, smoothed
/// by a tent of `¼ ½ ¼` texels of the small picture in each axis.
fn doubled(small: &Plane, x: u32, y: u32) -> DVec3 {
    let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / 2.0;
    let tent = [(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)];
    tent.iter()
        .flat_map(|&(dx, a)| tent.iter().map(move |&(dy, b)| (DVec2::new(dx, dy), a * b)))
        .map(|(offset, weight)| small.bilinear(place + offset).xyz() * weight)
        .sum()
}

/// The final picture of `colour`, of its size: tone-mapped and encoded values in
/// `[0, 1]`, or linear light for [`Output::Hdr`]; alpha is that of `colour`.
///
/// `adaptation` is the factor that [`exposure`](crate::exposure::truth::exposure)
/// found, which comes on top of `settings.exposure`; 1 without.
///
/// # Errors
/// If a setting is out of range, `adaptation` is negative or no number, the glow
/// is not half the size of `colour`, or memory runs out.
pub fn composite(
    colour: &Plane,
    adaptation: f64,
    glow: Option<Glow<'_>>,
    settings: &Composite,
) -> Result<Plane, EffectError> {
    settings.validate()?;
    not_negative("composite", "adaptation", adaptation)?;
    if let Some(glow) = glow {
        Settings("composite").range("intensity", glow.intensity, 0.0, 16.0)?;
        same_size(
            "composite",
            ("half of colour", colour.size().map(|side| side.div_ceil(2))),
            ("bloom", glow.bloom.size()),
        )?;
    }
    let glow = glow.map(|glow| (glow.bloom.clone().sanitised(), f64::from(glow.intensity)));
    let exposure = f64::from(settings.exposure);
    Ok(Plane::from_fn(colour.width(), colour.height(), |x, y| {
        let scene = colour.at(x.into(), y.into());
        // One factor after the other: their product may be infinite, and without
        // light there would then be no number.
        let mut exposed = light(scene) * exposure * adaptation;
        if let Some((bloom, intensity)) = &glow {
            exposed += doubled(bloom, x, y) * *intensity;
        }
        let exposed = exposed.min(DVec3::splat(MOST_LIGHT));
        let shown = match settings.output {
            Output::Sdr(curve) => tone(curve, exposed).map(srgb_encoded),
            Output::Hdr => exposed,
        };
        shown.extend(unit_interval(scene[3])).to_array()
    })?)
}

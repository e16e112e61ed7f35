//! The truth of exposure: the exact average and the exact lag.
//!
//! # Definition
//! The average of the luminance, arithmetic or geometric, is over the texels
//! whose three colours are finite; negative light counts as none, light beyond
//! 65504 as that, and in the geometric mean what is darker than `min_luminance`
//! as `min_luminance`. The luminance adapted to, `L`, follows the average `A`
//! within `[min_luminance, max_luminance]` by `dL/dt = speed · (A − L)`, whose
//! solution is `L + (A − L)(1 − e^(−speed · t))`; and the exposure is
//! `key · 2^compensation / L`.
//!
//! The sum is rounded once ([`exact_sum`]), so its error does not depend on the
//! order or the number of the texels; what is left is one rounding each of the
//! luminance's products and of the logarithm, parts in 10¹⁶.

use super::{Exposure, Metering};
use crate::truth::{Plane, exact_sum, light, luminance, reserved};
use crate::{EffectError, SettingError};

/// What a picture averages to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// The average luminance, before it is limited; `None` if no texel is finite.
    pub luminance: Option<f64>,
    /// Texels that were finite and so took part.
    pub texels: u64,
}

/// What the eye sees after a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// The luminance adapted to, from `min_luminance` to `max_luminance`; 0, which is
    /// none, where nothing was measured and nothing was held.
    pub luminance: f64,
    /// The factor on the light that brings it to the key.
    pub factor: f64,
}

/// The average that `settings.metering` asks for.
///
/// # Errors
/// If a setting is out of range or memory runs out.
pub fn measure(colour: &Plane, settings: &Exposure) -> Result<Measured, EffectError> {
    settings.validate()?;
    let floor = f64::from(settings.min_luminance);
    let mut metered = reserved(colour.texels().len())?;
    for texel in colour.texels() {
        if texel[..3].iter().all(|channel| channel.is_finite()) {
            let luminance = luminance(light(*texel));
            metered.push(match settings.metering {
                Metering::Arithmetic => luminance,
                Metering::Logarithmic => luminance.max(floor).log2(),
            });
        }
    }
    let count = metered.len();
    if count == 0 {
        return Ok(Measured::default());
    }
    let average = exact_sum(metered) / count as f64;
    Ok(Measured {
        luminance: Some(match settings.metering {
            Metering::Arithmetic => average,
            Metering::Logarithmic => average.exp2(),
        }),
        texels: count as u64,
    })
}

/// What the eye adapts to from `previous`, the luminance that it was adapted to
/// `delta_time` seconds earlier, when the picture averages to `measured`.
///
/// A `previous` that is no positive number is none, as before the first frame:
/// the average is then adapted to at once. Where nothing was measured, nothing
/// changes: where nothing was held either there is none to adapt to, and the light
/// is exposed as the darkest that is adapted to.
///
/// # Errors
/// If a setting is out of range or `delta_time` is not from 0 to 10⁶.
pub fn adapt(
    measured: Option<f64>,
    previous: Option<f64>,
    delta_time: f64,
    settings: &Exposure,
) -> Result<Adapted, EffectError> {
    settings.validate()?;
    if !(0.0..=1e6).contains(&delta_time) {
        return Err(SettingError {
            effect: "exposure",
            field: "delta_time",
            value: delta_time,
            min: 0.0,
            max: 1e6,
        }
        .into());
    }
    let [darkest, brightest] = [settings.min_luminance, settings.max_luminance].map(f64::from);
    let limited = |luminance: f64| luminance.clamp(darkest, brightest);
    let previous = previous
        .filter(|luminance| luminance.is_finite() && *luminance > 0.0)
        .map(limited);
    let wanted = measured.map(limited).or(previous).unwrap_or(darkest);
    let luminance = previous.map_or(wanted, |previous| {
        let speed = if wanted > previous {
            settings.speed_up
        } else {
            settings.speed_down
        };
        // 1 − e^−x, exact for small x as well.
        previous - (wanted - previous) * (-f64::from(speed) * delta_time).exp_m1()
    });
    let key = f64::from(settings.key) * f64::from(settings.compensation).exp2();
    let known = measured.is_some() || previous.is_some();
    Ok(Adapted {
        luminance: if known { luminance } else { 0.0 },
        factor: key / luminance,
    })
}

/// Meters a picture and adapts to it: [`measure`] and then [`adapt`].
///
/// # Errors
/// As theirs.
pub fn exposure(
    colour: &Plane,
    previous: Option<f64>,
    delta_time: f64,
    settings: &Exposure,
) -> Result<Adapted, EffectError> {
    let measured = measure(colour, settings)?;
    adapt(measured.luminance, previous, delta_time, settings)
}

/// How many stops brighter `a` is than `b`: `log2(a / b)`, of two luminances or
/// two factors. `None` unless both are positive and finite.
#[must_use]
pub fn ev_between(a: f64, b: f64) -> Option<f64> {
    let proper = |value: f64| value.is_finite() && value > 0.0;
    // The quotient could leave the range of f64.
    (proper(a) && proper(b)).then(|| {
        let quotient = a / b;
        if quotient.is_normal() {
            quotient.log2()
        } else {
            a.log2() - b.log2()
        }
    })
}

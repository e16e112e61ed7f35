//! Probes of what is written: what a format makes of an error.

use etalon_core::Format as TexelFormat;

use super::tally::{Place, Tally};
use super::{Lane, Scalar, Seen, heat_of, ulp};
use crate::exec::state::{Resource, State};
use crate::num::Number;
use crate::sanitise::{HEAT_BIRTH, VISIBLE};

/// What a format can tell apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Format {
    channels: usize,
    /// The largest number, by channel.
    largest: [f64; 4],
    /// The least normal number; 0 for fixed point.
    least: f64,
    /// Magnitudes below this count as this.
    pub(crate) floor: f64,
}

/// The largest and the least normal of 16-bit floats.
const HALF: (f64, f64) = (65504.0, 1.0 / 16384.0);

impl Format {
    /// Of words of buffers.
    pub(crate) const WORD: Self = Self {
        channels: 1,
        largest: [f32::MAX as f64; 4],
        least: f32::MIN_POSITIVE as f64,
        floor: 1.0 / 2_097_152.0,
    };

    pub(crate) fn of(format: TexelFormat) -> Self {
        use TexelFormat as F;
        let floats = |largest, least| Self {
            channels: format.channels() as usize,
            largest,
            least,
            floor: least,
        };
        match format {
            F::R32Float | F::Rg32Float | F::Rgba32Float | F::Depth32Float => Self {
                channels: format.channels() as usize,
                ..Self::WORD
            },
            F::R16Float | F::Rg16Float | F::Rgba16Float => floats([HALF.0; 4], HALF.1),
            // Their mantissas have six and five bits (Vulkan, "Unsigned 11-Bit
            // Floating-Point Numbers").
            F::Rg11b10Ufloat => floats([65024.0, 65024.0, 64512.0, 1.0], HALF.1),
            _ => Self {
                channels: format.channels() as usize,
                largest: [1.0; 4],
                least: 0.0,
                floor: 1.0,
            },
        }
    }
}

/// The format of a texture that is written.
pub(super) fn texture_format<N: Number>(state: &State<'_, N>, image: u16) -> Format {
    match state.resources.get(usize::from(image)) {
        Some(&Resource::Texture(texture)) => Format::of(texture.desc().format),
        _ => Format::WORD,
    }
}

/// Notes the numbers that an invocation writes.
pub(super) fn see(tally: &mut Tally, format: Format, scalars: &[Scalar], who: Lane) -> Seen {
    let (mut seen, mut most) = (Seen::default(), 0.0_f64);
    let mut worst: Option<(f64, Place)> = None;
    tally.floor = format.floor;
    for (channel, scalar) in scalars.iter().enumerate().take(format.channels) {
        if !scalar.is_float {
            continue;
        }
        let place = Place {
            invocation: who.invocation,
            value: scalar.single,
            exact: scalar.double,
        };
        let magnitude = f64::from(scalar.single.abs());
        if !magnitude.is_finite() {
            tally.propagated += who.times;
            seen.heat = HEAT_BIRTH;
            continue;
        }
        tally.of_range = tally
            .of_range
            .max(magnitude / format.largest[channel.min(3)]);
        if magnitude > 0.0 && magnitude < format.least {
            tally.subnormal += who.times;
        }
        if who.diverged || !scalar.double.is_finite() {
            continue;
        }
        let difference = (f64::from(scalar.single) - scalar.double).abs();
        if difference > 0.0 {
            most = most.max(difference / ulp(scalar.double));
            let scale = magnitude.max(scalar.double.abs());
            let relative = difference / scale.max(format.floor);
            if worst.is_none_or(|(worst, _)| relative > worst) {
                worst = Some((relative, place));
            }
        }
    }
    if let Some((relative, place)) = worst {
        tally.error(who.times, most);
        tally.relative.see(relative, place);
        if relative > VISIBLE {
            tally.lost.add(who.times, place);
        }
        seen.heat = seen.heat.max(heat_of(most));
    }
    seen
}

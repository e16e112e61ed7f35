//! What calls for bloom.

use etalon_core::graph::Decision;

use crate::demand::{Calls, Need, Region, off, unseen};
use crate::{exposure, ssr};

/// Nothing but the light.
pub(crate) const NEEDS: &[Need] = &[];

/// What light, factors and sums are rounded by on the way to the threshold: some
/// roundings to half floats, 2⁻¹¹ each, and a power of two that fast arithmetic has to
/// 2⁻²⁰ or so.
const MARGIN: f32 = 1.0 + 1.0 / 256.0;

/// Something has to pass the threshold, once it has been reflected and exposed.
pub(crate) fn decide(calls: &Calls<'_>) -> Decision {
    let Some(settings) = &calls.settings.bloom else {
        return off();
    };
    if !calls.outputs.picture {
        return unseen("picture");
    }
    if settings.intensity == 0.0 {
        return Decision::absent("its intensity is 0");
    }
    let Some(bright) = &calls.demands.bright else {
        return Decision::absent("there is no light on screen");
    };
    let reflected = match &calls.settings.ssr {
        Some(settings) if ssr::demand::decide(calls).is_run() => {
            ssr::demand::gain(settings, calls.demands)
        }
        _ => 1.0,
    };
    let factor = reflected * exposure::demand::largest_factor(calls.settings) * MARGIN;
    // Below the knee nothing is kept, up to roundings of differences from the threshold.
    let least = 1.0 - settings.knee - 4.0 * f32::EPSILON;
    let limit = settings.threshold * least.max(0.0);
    let (peak, floor) = (bright.peak * factor, bright.floor * factor);
    if peak <= limit {
        return Decision::absent(format!(
            "no light on screen passes the threshold, which begins at {limit}; exposed, the \
             brightest has at most {peak}"
        ));
    }
    // Reflections show light anywhere.
    let region = if floor > limit || reflected > 1.0 {
        Region::FULL
    } else {
        bright.region
    };
    Decision::runs(format!(
        "exposed light of up to {peak} passes the threshold, which begins at {limit}, on {region}"
    ))
}

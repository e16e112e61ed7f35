//! What calls for automatic exposure.

use etalon_core::graph::Decision;

use crate::ChainSettings;
use crate::demand::{Calls, Need, off, unseen};

/// Nothing but the light.
pub(crate) const NEEDS: &[Need] = &[];

/// Any picture does: it is exposed for whatever light there is.
pub(crate) fn decide(calls: &Calls<'_>) -> Decision {
    if calls.settings.exposure.is_none() {
        off()
    } else if calls.outputs.picture {
        Decision::runs("the picture is exposed by its own light")
    } else {
        unseen("picture")
    }
}

/// The largest factor that light is multiplied by before the threshold and the tone
/// curve: that of the darkest luminance which is adapted to.
pub(crate) fn largest_factor(settings: &ChainSettings) -> f32 {
    let adapted = match &settings.exposure {
        Some(exposure) => exposure.key * exposure.compensation.exp2() / exposure.min_luminance,
        None => 1.0,
    };
    settings.composite.exposure * adapted
}

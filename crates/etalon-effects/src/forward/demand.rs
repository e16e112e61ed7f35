//! What calls for surfaces that are lit as they are drawn.

use etalon_core::graph::Decision;

use crate::demand::{Calls, unseen};

/// Light, where it does not come from the G-buffer.
pub(crate) fn opaque(calls: &Calls<'_>, deferred: bool) -> Decision {
    if deferred {
        Decision::absent("surfaces are lit from the G-buffer")
    } else if calls.outputs.lit() {
        Decision::runs("surfaces are lit as they are drawn")
    } else {
        unseen("light")
    }
}

/// Glass: light, and something to see it through.
pub(crate) fn glass(calls: &Calls<'_>) -> Decision {
    if !calls.outputs.lit() {
        return unseen("light");
    }
    match &calls.demands.transparent {
        Some(region) => Decision::runs(format!("light passes through surfaces on {region}")),
        None => Decision::absent("nothing on screen lets light pass"),
    }
}

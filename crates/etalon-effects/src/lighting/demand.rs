//! What calls for light from the G-buffer.

use etalon_core::graph::Decision;

use crate::demand::{Calls, unseen};

/// Light, where surfaces are not lit as they are drawn.
pub(crate) fn decide(calls: &Calls<'_>, deferred: bool) -> Decision {
    if !deferred {
        Decision::absent("surfaces are lit as they are drawn")
    } else if calls.outputs.lit() {
        Decision::runs("surfaces are lit from the G-buffer")
    } else {
        unseen("light")
    }
}

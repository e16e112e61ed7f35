//! What calls for the composite.

use etalon_core::graph::Decision;

use crate::demand::{Calls, Need, unseen};

/// Nothing but the light.
pub(crate) const NEEDS: &[Need] = &[];

/// A picture.
pub(crate) fn decide(calls: &Calls<'_>) -> Decision {
    if calls.outputs.picture {
        Decision::runs("every picture needs it")
    } else {
        unseen("picture")
    }
}

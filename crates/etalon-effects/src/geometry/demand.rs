//! What calls for geometry passes.

use etalon_core::graph::Decision;

use crate::demand::Calls;

/// The prepass: something opaque, or someone who asks for what is drawn with it, which
/// is there of an empty screen as well.
pub(crate) fn decide(calls: &Calls<'_>) -> Decision {
    match &calls.demands.surfaces {
        Some(region) => Decision::runs(format!("opaque surfaces are on {region}")),
        None if velocity(calls).is_run() => Decision::runs("velocity is drawn with it"),
        None if calls.outputs.depth => Decision::runs("depth is asked for"),
        None => Decision::absent("no opaque surface is on screen"),
    }
}

/// Velocity beside depth: something that moves, and someone who asks.
pub(crate) fn velocity(calls: &Calls<'_>) -> Decision {
    if !calls.outputs.velocity {
        return Decision::absent("velocity is not asked for");
    }
    match calls.demands.moving {
        Some(moving) if moving.camera => Decision::runs("the camera moves"),
        Some(moving) => match moving.objects {
            Some(region) => Decision::runs(format!("something moves on {region}")),
            None => Decision::absent("nothing on screen moves, nor does the camera"),
        },
        None => Decision::absent("nothing on screen moves, nor does the camera"),
    }
}

/// The G-buffer, or the thin one of forward shading: someone who reads it, where it is
/// not the other one that is read.
pub(crate) fn surfaces(readers: &[&str], other: Option<&str>) -> Decision {
    match (readers, other) {
        ([], _) => Decision::absent("nobody reads normals or what is mirrored"),
        (_, Some(other)) => Decision::absent(format!("`{other}` writes what is read of it")),
        (readers, None) => Decision::runs(format!("read by {}", readers.join(", "))),
    }
}

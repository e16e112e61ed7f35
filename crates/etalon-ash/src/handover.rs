//! Between an engine's states and the one in which plans find and leave things.

use etalon_core::plan::Usage;

use crate::commands::{Barriers, Transition};
use crate::engine::TextureState;
use crate::{Resource, convert, usage};

/// The state in which a plan finds and leaves a resource.
pub(crate) fn rest(resource: &Resource) -> TextureState {
    let row = match resource {
        Resource::Texture(_) => usage::row(Usage::Sampled),
        Resource::Buffer(_) => usage::row(Usage::StorageRead),
    };
    TextureState {
        layout: row.layout,
        stages: row.stages,
        access: row.access,
    }
}

/// Adds what takes an import from a state to rest.
pub(crate) fn arrive(barriers: &mut Barriers, resource: &Resource, from: TextureState) {
    change(barriers, resource, from, rest(resource));
}

/// Adds what takes an import or output from rest to a state.
pub(crate) fn leave(barriers: &mut Barriers, resource: &Resource, to: TextureState) {
    change(barriers, resource, rest(resource), to);
}

fn change(barriers: &mut Barriers, resource: &Resource, from: TextureState, to: TextureState) {
    let same_users = (from.stages, from.access) == (to.stages, to.access);
    let by = Transition {
        source: (from.stages, from.access),
        target: (to.stages, to.access),
        layouts: (from.layout, to.layout),
    };
    match resource {
        Resource::Texture(image) if !same_users || from.layout != to.layout => {
            barriers.image(image, convert::whole(&image.desc), by);
        }
        // Layouts of buffers mean nothing.
        Resource::Buffer(buffer) if !same_users => barriers.buffer(buffer, by),
        _ => {}
    }
}

/// Adds what makes an output's first write wait for those who used it. Its
/// contents are not kept, so its layout does not matter.
pub(crate) fn wait(barriers: &mut Barriers, resource: &Resource, from: TextureState) {
    let rest = rest(resource);
    if (from.stages, from.access) != (rest.stages, rest.access) {
        barriers.memory((from.stages, from.access), (rest.stages, rest.access));
    }
}

//! Is what is drawn, and its light, as it should be?
//!
//! * [`Rules`]: is a device's picture the interpreter's, as far as rasterisers are free?
//! * `solids`: does a pixel show the triangle that a ray through it meets first, at its
//!   depth, with its normal, moving as it does?
//! * `light`: does a surface send what the reflection model says?
//! * `map`: does light that is the same from everywhere stay as it is?

mod light;
mod map;
mod rules;
mod solids;

use etalon_scenes::cases::drawn::Stage;

pub use self::rules::{Rules, layers};
use super::truth::Wrong;
use crate::observe::Store;

/// The texels that are not what the stage's truth says; `None` if there is none to be
/// held to.
pub(super) fn wrong<'a>(stage: &Stage, stores: &'a [Store]) -> Option<Vec<Wrong<'a>>> {
    match stage {
        Stage::Solids(solids) => solids::wrong(solids, stores),
        Stage::Surfaces(surfaces) => light::wrong(surfaces, stores),
        Stage::LightMap(map) => map::wrong(map, stores),
    }
}

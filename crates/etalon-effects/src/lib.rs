//! The effects of Etalon.
//!
//! An effect is a function: it takes a [`Graph`](etalon_core::graph::Graph),
//! handles to what it reads and its settings, declares its passes, and returns
//! handles to what they write. It knows no device; whoever executes the planned
//! graph decides where it runs.
//!
//! | Effect | What it does | Kernels |
//! |---|---|---|
//! | [`geometry`](mod@geometry) | depth, velocity and G-buffer, drawn | `shaders/geometry` |
//! | [`lighting`](mod@lighting) | lights added up from the G-buffer | `shaders/lighting` |
//! | [`environment`](mod@environment) | light from everywhere, blurred by roughness | `shaders/environment` |
//! | [`probes`] | light captured nearby, looked up on the walls of rooms | `shaders/lib/probes.wesl` |
//! | [`forward`](mod@forward) | surfaces lit as they are drawn, glass over them | `shaders/forward` |
//! | [`ssr`](mod@ssr) | screen-space reflection | `shaders/ssr` |
//! | [`exposure`](mod@exposure) | average luminance and adaptation | `shaders/exposure` |
//! | [`bloom`](mod@bloom) | glow of bright light | `shaders/bloom` |
//! | [`composite`](mod@composite) | tone curve and encoding | `shaders/composite` |
//!
//! [`chain`](mod@chain) runs those that are on; [`frame`](mod@frame) runs those of them
//! that what is on the screen calls for, as [`demand`] says it. [`registry`] knows all
//! of them by name.
//!
//! [`tiles`] lets heavy kernels run only where the picture needs them
//! (`shaders/tiles`), [`hiz`] has pyramids of distances for those that search the screen
//! (`shaders/hiz`).
//!
//! # Settings
//! Settings are plain structs. Each field says what it does to the picture, its
//! range, and its cost. A value outside of its range, NaN included, is a
//! [`SettingError`]; none is clamped in silence.
//!
//! Beside each struct stands a table of its [`knob`]s: ranges, and values worth
//! trying. [`quality`] has presets, [`budget`] picks settings for a time, and the
//! `truth` of each effect says in f64 what an ideal implementation would give.
//!
//! # Any input
//! Kernels make imported values finite where they first read them, so a NaN in
//! one texel costs that texel and not the picture. Every effect gives finite
//! results for every bit pattern of its inputs.

#![forbid(unsafe_code)]

pub mod bloom;
pub mod budget;
pub mod chain;
mod check;
pub mod composite;
pub mod demand;
pub mod environment;
mod error;
pub mod exposure;
pub mod forward;
pub mod frame;
pub mod geometry;
pub mod hiz;
pub mod knob;
pub mod lighting;
pub mod probes;
pub mod quality;
pub mod registry;
mod scene;
pub mod ssr;
pub mod tiles;
pub mod truth;

pub use chain::{Chain, ChainSettings, chain};
pub use error::{EffectError, SettingError};
pub use quality::Quality;
pub use registry::{EffectEntry, MapEntry, effect, effects, map_effects};
pub use scene::{Beyond, CameraParams, DepthRange, SceneInputs};

/// A library of the kernels of all effects, to plan graphs with and to add one's own
/// to.
#[must_use]
pub fn kernels() -> etalon_core::kernel::KernelLibrary {
    etalon_core::kernel::KernelLibrary::of(etalon_shaders::sources())
}

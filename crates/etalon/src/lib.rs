//! Rendering effects that run on any backend: each kernel is written once, in
//! WGSL, and runs on a CPU interpreter, on wgpu and on Vulkan.
//!
//! * [`effects`]: geometry and its light, reflections, exposure, bloom, tone
//!   mapping; each a function from texture handles to texture handles, with a
//!   plain settings struct.
//! * [`graph`]: what effects declare. Building a graph touches no device.
//! * [`raster`]: the state of draws, and what vertex kernels are fed.
//! * [`plan`]: what a graph becomes: only the passes that the requested outputs
//!   need, in order, with memory shared and barriers placed.
//! * [`kernel`]: where WESL sources become validated modules.
//! * [`backend`]: the interface all executors share, for tools and tests.
//!
//! # Backends
//! Each is a feature, so an engine compiles only its own:
//!
//! | feature | module | runs on |
//! |---|---|---|
//! | `cpu` (default) | `etalon::cpu` | any processor; the standard the others are held against |
//! | `wgpu` | `etalon::wgpu` | a wgpu device, the engine's or its own |
//! | `ash` | `etalon::ash` | a Vulkan 1.3 device, the engine's or its own |
//!
//! # A frame
//! 1. Make a [`Graph`](graph::Graph), import the engine's textures, call the
//!    effects, ask for outputs.
//! 2. Make a [`Plan`](plan::Plan) of it. Both are cheap enough to do anew in
//!    every frame; kernels are compiled once, by a
//!    [`KernelLibrary`](kernel::KernelLibrary) such as [`effects::kernels`] makes.
//! 3. Have the backend record the plan into the engine's own command stream.
//!    Frames whose plans differ only in the values of settings create nothing.

#![forbid(unsafe_code)]

pub use etalon_core::{
    Format, backend, format, graph, image, kernel, plan, raster, resource, texel,
};
pub use etalon_effects as effects;

#[cfg(feature = "ash")]
pub use etalon_ash as ash;
#[cfg(feature = "cpu")]
pub use etalon_cpu as cpu;
#[cfg(feature = "wgpu")]
pub use etalon_wgpu as wgpu;

/// The examples of the README, compiled.
#[cfg(all(doctest, feature = "cpu", feature = "wgpu", feature = "ash"))]
#[doc = include_str!("../../../README.md")]
pub struct Readme;

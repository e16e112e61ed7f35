//! The effect IR of Etalon, its kernels, and the planning of passes.
//!
//! * [`graph`]: effects declare passes over versioned textures and buffers.
//! * [`kernel`]: WESL sources become validated, reflected naga modules.
//! * [`raster`]: the state of draws, and what vertex kernels are fed.
//! * [`plan`]: a graph becomes a list of steps with memory and barriers.
//! * [`backend`]: what an executor of plans offers.
//! * [`mod@format`], [`texel`], [`resource`], [`image`]: texels and their shapes.
//!
//! No GPU crate is among the dependencies: executors are crates of their own.

#![forbid(unsafe_code)]

pub mod backend;
mod counters;
pub mod format;
pub mod graph;
pub mod image;
pub mod kernel;
pub mod plan;
pub mod raster;
pub mod resource;
pub mod texel;

pub use format::Format;

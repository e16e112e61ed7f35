//! Runs plans of [`etalon_core`] through wgpu.
//!
//! [`WgpuBackend`] can be used in two ways:
//!
//! * An **engine** hands over its own device with [`WgpuBackend::adopt`] and
//!   records plans into its own command encoder with [`WgpuBackend::record`],
//!   giving its own textures and buffers by import name and, if it likes, its
//!   own textures to write outputs into. See [`WgpuBindings`].
//! * **Tests, tools and offline users** let it open a device of its own with
//!   [`WgpuBackend::new`] and use it through
//!   [`Backend`](etalon_core::backend::Backend).
//!
//! ```no_run
//! use etalon_core::backend::BackendError;
//! use etalon_core::plan::Plan;
//! use etalon_wgpu::{WgpuBackend, WgpuBindings, wgpu};
//!
//! /// Records a frame's effects; `plan` was made with `backend.limits()`.
//! fn effects(
//!     backend: &mut WgpuBackend,
//!     plan: &Plan,
//!     encoder: &mut wgpu::CommandEncoder,
//!     colour: &wgpu::Texture,
//!     target: &wgpu::Texture,
//! ) -> Result<(), BackendError> {
//!     let bindings = WgpuBindings::new()
//!         .texture("colour", colour)
//!         .output("image", target);
//!     backend.record(encoder, plan, &bindings)?;
//!     Ok(())
//! }
//! ```
//!
//! # Draws
//! Each raster step is a render pass of its own. Records of indirect draws are
//! drawn one by one or at once, as the device can; for their first instances the
//! device must have
//! [`INDIRECT_FIRST_INSTANCE`](wgpu::Features::INDIRECT_FIRST_INSTANCE). A record
//! that names vertices, indices or instances that are not there draws nothing
//! where wgpu
//! [looks at it](wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL); vertices that
//! indices name and that are not there read as whatever WebGPU lets them.
//!
//! WebGPU draws to colours of as many numbers as the target has channels, or
//! more; other draws are refused.
//!
//! # What is kept between frames
//! Pipelines are kept by kernel, those of draws also by their state, vertex
//! layouts and the formats of targets. Everything else a plan needs (transient
//! textures by [slot](etalon_core::plan::Placement::slot), uniform buffers,
//! bind groups) is kept by [`Plan::structure`](etalon_core::plan::Plan::structure)
//! for the [`PREPARED_PLANS`] most recent plans. A frame whose structure was
//! run before, with the same engine textures, creates no pipeline, bind group,
//! texture, buffer or view; [`counters`](etalon_core::backend::Backend::counters)
//! tells.
//!
//! # Arithmetic
//! Strict kernels give the same bits everywhere only if the driver is told not
//! to contract `a * b + c`. wgpu's own translation cannot say so; SPIR-V handed
//! through untouched can. Where the device has
//! [`PASSTHROUGH_SHADERS`](wgpu::Features::PASSTHROUGH_SHADERS) on Vulkan, the
//! very words that the Vulkan backend of Etalon runs are used, see
//! [`WgpuBackend::keeps_strict_arithmetic`].
//!
//! # OpenGL
//! wgpu's OpenGL has no views of single layers or of part of a texture's mips,
//! copies from what it can render to only, and binds and copies 3D textures by
//! their first slice. It has no restart of strips, so that indexed strips are
//! refused. Steps that would need more are refused; most effects' kernels run.
//!
//! # Errors
//! What a device cannot do is a [`BackendError`](etalon_core::backend::BackendError)
//! that names the step, before wgpu sees it wherever it can be known; what wgpu
//! still refuses is caught in error scopes. No wgpu error reaches the default
//! handler, which panics. Messages of the Vulkan validation layer, if asked
//! for, go to the `log` crate, where wgpu puts them.

// One call needs `unsafe`: handing SPIR-V through to the driver, see `spirv`.
#![deny(unsafe_code)]

mod backend;
mod bind;
mod bindings;
mod check;
mod clear;
mod convert;
mod depth;
mod fault;
mod gl;
mod gpu;
mod history;
mod open;
mod pipeline;
mod prepare;
mod probe;
mod raster;
mod readback;
mod record;
mod spirv;
mod staging;
mod tally;
mod timing;
mod upload;

pub use backend::{PREPARED_PLANS, WgpuBackend};
pub use bind::BIND_GROUPS_PER_STEP;
pub use bindings::{WgpuBindings, WgpuOutput, WgpuOutputs};
pub use open::{WgpuOptions, enumerate};
pub use wgpu;

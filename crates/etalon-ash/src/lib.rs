//! The Vulkan backend of Etalon, on [`ash`].
//!
//! # In an engine
//! [`AshBackend::adopt`] takes the engine's device; [`AshBackend::record`]
//! records a [`Plan`](etalon_core::plan::Plan) into the engine's command
//! buffer, reading and writing the engine's own images and buffers. Nothing is
//! submitted, waited for or destroyed that is the engine's.
//!
//! ```no_run
//! # use ash::vk;
//! # use etalon_ash::{AdoptedDevice, AdoptedTexture, AshBackend, AshBindings, AshOptions, TextureState};
//! # use etalon_core::{Format, backend::BackendError, plan::Plan, resource::TextureDesc};
//! # fn example(lent: AdoptedDevice, scene: vk::Image, commands: vk::CommandBuffer, plan: &Plan)
//! # -> Result<(), BackendError> {
//! // Once:
//! // SAFETY: the handles are valid, and outlive the backend.
//! let mut backend = unsafe { AshBackend::adopt(lent, AshOptions::default()) }?;
//! let scene = AdoptedTexture {
//!     image: scene,
//!     desc: TextureDesc::d2(1920, 1080, Format::Rgba16Float),
//!     usage: vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED,
//! };
//! // SAFETY: the image is as described, and outlives the texture.
//! let scene = unsafe { backend.adopt_texture(scene) }?;
//!
//! // In every frame:
//! let drawn = TextureState::COLOR_ATTACHMENT;
//! let bindings = AshBindings::new()
//!     .texture_in("scene", &scene, drawn, drawn)
//!     .output_in("picture", TextureState::FRAGMENT_SAMPLED);
//! // SAFETY: the command buffer is being recorded, and the scene was drawn before.
//! let outputs = unsafe { backend.record(commands, plan, &bindings) }?;
//! let picture: vk::ImageView = outputs.textures["picture"].view;
//! # Ok(())
//! # }
//! ```
//!
//! # On its own
//! [`AshBackend::new`] makes an instance and a device, and the
//! [`Backend`](etalon_core::backend::Backend) trait runs plans with inputs
//! from the host.
//!
//! # Frames in flight
//! [`AshOptions::frames_in_flight`] is a promise: when a recording begins, the
//! one that many before it has left the GPU. Host-visible memory for uniform
//! blocks is a ring of one copy more than that, descriptor sets are written anew
//! only after it, and what is no longer needed is destroyed after it.
//!
//! # What a frame costs
//! Everything but the values of uniforms is made once per
//! [`Plan::structure`](etalon_core::plan::Plan::structure) and kept for the
//! [`AshOptions::plans_kept`] structures used last. A frame whose structure is
//! among them allocates no memory, and creates no pipeline and no descriptor
//! set; [`counters`](etalon_core::backend::Backend::counters) shows it.
//! Pipelines are kept for as long as the backend. Counters of memory count what
//! was asked of the allocator, which takes it from the driver in larger blocks.
//!
//! # Barriers and memory
//! Both are the plan's. How usages become stages, accesses and layouts is one
//! table in the source of `usage`; one `vkCmdPipelineBarrier2` before each step
//! has the barriers of that step and no others. Transient textures live in one
//! allocation and transient buffers in another, at the offsets planned; plan
//! with [`Backend::memory`](etalon_core::backend::Backend::memory), so that
//! these are the device's own sizes.
//!
//! # Draws
//! Raster passes are recorded by dynamic rendering, one `vkCmdBeginRendering`
//! for each, with viewports of negative height: +Y is up in clip space, as in
//! WebGPU, and a front is what it is there. Pipelines are kept by kernel, vertex
//! layouts, state and formats of targets; viewport and scissor are dynamic.
//!
//! Vertices that indices or records name out of range do no harm, with
//! `robustBufferAccess`: kernels are fed zeros or something else from the same
//! buffer, and draws that could name any are refused on a lent device without.
//! Records of indexed draws must not ask for indices behind the end of their
//! buffer but on devices with `robustBufferAccess2`. See [`Features`].
//!
//! # Unsafe code
//! Vulkan's calls are in the modules that `lib.rs` allows to make them, each
//! block with the reason why its conditions hold: wrappers own what they make
//! and keep what they need, plans are checked before anything is made for
//! them, and nothing is destroyed before the GPU has finished with it. What
//! only an engine can know is a condition of the four functions it calls.
//!
//! # Devices
//! Vulkan 1.3 with `synchronization2` and `maintenance4`, which every 1.3
//! device has, and a queue that computes. [`enumerate`] lists what there is.
//! Plans that draw also need a queue that does, and `dynamicRendering`; those
//! that do not are the same without.

#![deny(unsafe_code)]

mod backend;
mod bindings;
#[allow(unsafe_code)]
mod buffer;
mod chains;
#[allow(unsafe_code)]
mod check;
#[allow(unsafe_code)]
mod commands;
mod convert;
#[allow(unsafe_code)]
mod device;
#[allow(unsafe_code)]
mod draws;
mod engine;
mod error;
mod handover;
mod heap;
mod history;
#[allow(unsafe_code)]
mod host;
#[allow(unsafe_code)]
mod image;
#[allow(unsafe_code)]
mod instance;
#[allow(unsafe_code)]
mod layout;
#[allow(unsafe_code)]
mod memory;
#[allow(unsafe_code)]
mod physical;
#[allow(unsafe_code)]
mod pipeline;
mod prepared;
#[allow(unsafe_code)]
mod queue;
#[allow(unsafe_code)]
mod record;
mod run;
#[allow(unsafe_code)]
mod sets;
mod stages;
mod texels;
mod uniforms;
mod usage;
#[allow(unsafe_code)]
mod validation;

use std::sync::Arc;

pub use backend::{AshBackend, AshOptions};
pub use bindings::AshBindings;
pub use device::AdoptedDevice;
pub use engine::{
    AdoptedBuffer, AdoptedTexture, AshBuffer, AshOutputs, AshTexture, BufferState, OutputBuffer,
    OutputTexture, TextureState,
};
pub use physical::{DeviceInfo, DeviceKind, Features, enumerate};
pub use validation::{Validation, ValidationLog, ValidationMessage};

/// A texture or buffer behind a number in a plan.
#[derive(Clone)]
enum Resource {
    Texture(Arc<image::Image>),
    Buffer(Arc<buffer::Buffer>),
}

impl Resource {
    /// Its identity, which no other ever has.
    fn id(&self) -> u64 {
        match self {
            Self::Texture(image) => image.id,
            Self::Buffer(buffer) => buffer.id,
        }
    }
}

//! Scenes, frames and exact reference answers.
//!
//! * [`camera`]: the camera and the one projection every frame uses.
//! * [`frame`]: what a rendered frame hands to the effects.
//! * [`trace`](mod@trace): an exact f64 ray caster, and the true reflections in a scene.
//! * [`model`](mod@model): meshes, materials, lights and movements that backends draw.
//! * [`models`](mod@models): a registry of procedural models.
//! * [`scenes`](mod@scenes): a registry of procedural scenes.
//! * [`skies`](mod@skies): a registry of procedural pictures of all directions.
//! * [`cases`](mod@cases): inputs that are known to be hard, with their reasons.
//! * [`demand`](mod@demand): what scenes call for, told before they are drawn.
//! * [`exr_frame`]: OpenEXR files as frames, and back.
//! * [`environment_file`]: pictures of all directions from OpenEXR and Radiance files.
//! * [`picture`]: images as PNG files to look at.
//!
//! ```
//! use etalon_scenes::{FrameSize, scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let entry = scene("mirror-planes").ok_or("no such scene")?;
//! let size = FrameSize::new(64, 36)?;
//! let frame = entry.frame(size)?;
//! assert_eq!(frame.colour.desc.extent.width, 64);
//!
//! // What a perfect mirror would show at the pixel in the middle.
//! let world = (entry.build)()?;
//! println!("{:?}", world.reflection(size)?.at(32, 18));
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod camera;
pub mod cases;
pub mod demand;
pub mod environment_file;
pub mod exr_frame;
pub mod frame;
mod import;
pub mod model;
pub mod models;
pub mod picture;
pub mod scenes;
pub mod skies;
pub mod trace;

pub use camera::{Camera, Pose, Projection};
pub use frame::{Frame, FrameCamera, FrameSize};
pub use models::{ModelEntry, model, models};
pub use scenes::{SceneEntry, World, scene, scenes};
pub use skies::{SkyEntry, skies, sky};

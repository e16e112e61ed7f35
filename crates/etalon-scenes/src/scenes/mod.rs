//! Procedural scenes, each made for something that effects get wrong.

mod corridor;
mod dark_room;
mod hard_inputs;
mod mirror_planes;
mod wet_floor;

use thiserror::Error;

use crate::camera::{Camera, CameraError, Pose};
use crate::frame::{Frame, FrameError, FrameSize};
use crate::trace::{Reflection, Scene, SceneError, trace, true_reflection};

pub use mirror_planes::{MIRROR_HEIGHT, WALL_DISTANCE};

/// A scene and the camera that looks at it.
#[derive(Clone, Debug)]
pub struct World {
    /// What there is.
    pub scene: Scene,
    /// Who looks at it, and where it was one frame earlier.
    pub camera: Camera,
}

impl World {
    /// What the camera sees: see [`trace`].
    ///
    /// # Errors
    /// As [`trace`].
    pub fn frame(&self, size: FrameSize) -> Result<Frame, FrameError> {
        trace(&self.scene, &self.camera, size)
    }

    /// The true mirror reflection of every pixel: see [`true_reflection`].
    ///
    /// # Errors
    /// As [`true_reflection`].
    pub fn reflection(&self, size: FrameSize) -> Result<Reflection, FrameError> {
        true_reflection(&self.scene, &self.camera, size)
    }
}

/// Why a scene of the registry cannot be shown.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum WorldError {
    /// Its objects or lights are invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its camera is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// It cannot be rendered.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// A scene of the registry.
#[derive(Clone, Copy, Debug)]
pub struct SceneEntry {
    /// By which it is known: lower case and hyphens.
    pub name: &'static str,
    /// What it shows and what it is for.
    pub description: &'static str,
    /// Makes the scene.
    pub build: fn() -> Result<World, WorldError>,
    /// What is done to the rendered frame, if anything.
    pub alter: Option<fn(&mut Frame)>,
}

impl SceneEntry {
    /// Builds and renders the scene.
    ///
    /// # Errors
    /// If the frame does not fit into memory.
    pub fn frame(&self, size: FrameSize) -> Result<Frame, WorldError> {
        let mut frame = (self.build)()?.frame(size)?;
        if let Some(alter) = self.alter {
            alter(&mut frame);
        }
        Ok(frame)
    }
}

/// All scenes.
#[must_use]
pub const fn scenes() -> &'static [SceneEntry] {
    &[
        SceneEntry {
            name: "wet-floor",
            description: "A courtyard at night: coloured solids and neon over a floor of wet and dry patches",
            build: wet_floor::build,
            alter: None,
        },
        SceneEntry {
            name: "corridor-grazing",
            description: "A long corridor over a polished floor, seen from just above it",
            build: corridor::build,
            alter: None,
        },
        SceneEntry {
            name: "dark-room-lights",
            description: "A nearly black room with tiny lamps of up to 60000 in radiance",
            build: dark_room::build,
            alter: None,
        },
        SceneEntry {
            name: "mirror-planes",
            description: "A perfect mirror below a chequered wall, whose reflections have a closed form",
            build: mirror_planes::build,
            alter: None,
        },
        SceneEntry {
            name: "hard-inputs",
            description: "The wet floor with NaN, infinite, negative, denormal and zero values in every image",
            build: wet_floor::build,
            alter: Some(hard_inputs::damage),
        },
    ]
}

/// The scene of a name.
#[must_use]
pub fn scene(name: &str) -> Option<&'static SceneEntry> {
    scenes().iter().find(|entry| entry.name == name)
}

/// A camera that looks at a target after having moved there in a frame's time.
fn moving_camera(
    before: [glam::DVec3; 2],
    now: [glam::DVec3; 2],
    vertical_fov_degrees: f64,
) -> Result<Camera, CameraError> {
    let pose =
        |[position, target]: [glam::DVec3; 2]| Pose::look_at(position, target, glam::DVec3::Y);
    Ok(Camera::new(pose(now)?, vertical_fov_degrees.to_radians())?.moved_from(pose(before)?))
}

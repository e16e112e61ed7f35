//! Light captured at points of a scene, and looked up as if on the walls of a room.
//!
//! A [`Probe`] is a map of the light around one point, the [`Room`] whose walls it shows,
//! and the part of the room in which it counts. A mirrored direction is followed to the
//! room's wall and looked up from the point of capture (S. Lagarde and A. Zanuttini,
//! "Local Image-based Lighting with Parallax-corrected Cubemaps", SIGGRAPH 2012): exact
//! for what is on the walls, and off by its parallax for what is not.
//!
//! Maps are those of an [`environment`](mod@crate::environment), octahedral and blurred by
//! roughness; [`ProbeMaps`] keep one in each layer of a texture, with what surfaces
//! scatter of it. [`capture`] draws them from the scene itself. [`Probes`] are what
//! [`lighting`](fn@crate::lighting::lighting), [`forward`](mod@crate::forward) shading
//! and, where the screen has no answer, [`ssr`](mod@crate::ssr) read:
//! [`Surroundings::probes`](crate::lighting::Surroundings::probes).
//!
//! How far off that is, `the_models_error_grows_with_the_depth_of_what_is_in_the_room`
//! says of mirrors on the floor of a room of 8 × 3 × 6 metres: what stands 10 cm before the
//! wall is seen 0.7° beside where it is, 50 cm 3.6°, one metre 7.4°. Without the room it
//! would be 24° for the wall itself.
//!
//! # Blending
//! The first probe of a list has its influence as its share, the next its own of what
//! that leaves, and so on; the world has the rest. Shares are smooth and sum to 1. Of
//! rooms within rooms the inner one comes first.
//!
//! # Cost
//! For each pixel and probe of the list 128 bytes and some 40 operations, twice where
//! light is scattered and mirrored; for each that counts there, 8 texels of its map and 9
//! of its irradiance. A probe that counts in full ends the list. At a side of 128 a map
//! takes 200 KB.

pub mod capture;
mod maps;
pub mod truth;

use etalon_core::graph::{Buffer, Graph};
use etalon_core::resource::BufferDesc;
use glam::{DMat3, DMat4, DQuat, DVec3, Vec3, Vec4};

pub use maps::{MAX_MAPS, ProbeMaps, probe_map};

use crate::check::Settings;
use crate::geometry::View;
use crate::{EffectError, SettingError};

/// Most probes of a list: each costs every pixel a look at where it counts.
pub const MAX_PROBES: u32 = 16;

/// Bytes of a probe in a list: the rows of `lib/probes`.
const PROBE_BYTES: u64 = 128;

/// A box in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Its middle.
    pub centre: DVec3,
    /// From its axes to the world's; of length 1.
    pub turn: DQuat,
    /// Half of its size along its axes, each in `[1e-3, 1e6]`.
    pub half: DVec3,
}

impl Room {
    /// A point of the world in the room's axes, from its middle.
    #[must_use]
    pub fn place(&self, point: DVec3) -> DVec3 {
        self.turn.inverse() * (point - self.centre)
    }
}

/// Light captured at a point, and where it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Where the map was captured, in the world: within the room.
    pub position: DVec3,
    /// The walls that the map shows. A point outside of it sees them from the nearest
    /// point of the room.
    pub room: Room,
    /// Half of the size of the part of the room in which the probe counts, along the
    /// room's axes and around its middle, each in `[falloff, 1e6]`.
    pub influence: DVec3,
    /// Width in which it fades out before that ends, in `[1e-3, 1e6]`: its share is the
    /// product over the axes of a smooth step.
    pub falloff: f32,
    /// Its layer of the [`ProbeMaps`], less than [`MAX_MAPS`].
    pub layer: u32,
}

impl Probe {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("probes");
        let Room { centre, turn, half } = self.room;
        for value in centre.to_array() {
            check.range("centre", value as f32, -1e12, 1e12)?;
        }
        check.range("turn", turn.length() as f32, 0.999, 1.001)?;
        for value in half.to_array() {
            check.range("half", value as f32, 1e-3, 1e6)?;
        }
        check.range("falloff", self.falloff, 1e-3, 1e6)?;
        for value in self.influence.to_array() {
            check.range("influence", value as f32, self.falloff, 1e6)?;
        }
        let place = self.normalised().room.place(self.position);
        for (value, most) in place.to_array().into_iter().zip(half.to_array()) {
            check.range("position", value as f32, -most as f32, most as f32)?;
        }
        check.count("layer", self.layer, 0, MAX_MAPS - 1)
    }

    /// With a turn of length 1 to the last digit.
    fn normalised(&self) -> Self {
        let turn = self.room.turn.normalize();
        Self {
            room: Room { turn, ..self.room },
            ..*self
        }
    }

    /// The rows of `lib/probes`, for one view.
    fn rows(&self, view: &View) -> [Vec4; 8] {
        let Self {
            position,
            room,
            influence,
            falloff,
            layer,
        } = self.normalised();
        let to_room = DMat4::from_quat(room.turn.inverse())
            * DMat4::from_translation(-room.centre)
            * view.view.inverse();
        let to_world = DMat3::from_quat(room.turn);
        let capture = room.place(position).to_array();
        let row = |k: usize| to_room.row(k).as_vec4();
        let back = |k: usize| to_world.row(k).extend(capture[k]).as_vec4();
        [
            row(0),
            row(1),
            row(2),
            room.half.as_vec3().extend(1.0 / falloff),
            influence.as_vec3().extend(layer as f32),
            back(0),
            back(1),
            back(2),
        ]
    }
}

/// Probes as kernels read them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probes {
    /// Their maps.
    pub maps: ProbeMaps,
    /// [`probe_bytes`] of the view that looks at them: 128 for each.
    pub list: Buffer,
    /// How many there are, in `[1, MAX_PROBES]`.
    pub count: u32,
}

impl Probes {
    /// Imports a list of so many probes, or `None` for 0.
    ///
    /// # Errors
    /// If there are more than [`MAX_PROBES`], or the name is taken.
    pub fn import(
        graph: &mut Graph,
        name: &str,
        maps: ProbeMaps,
        count: u32,
    ) -> Result<Option<Self>, EffectError> {
        Settings("probes").count("probes", count, 0, MAX_PROBES)?;
        if count == 0 {
            return Ok(None);
        }
        let bytes = PROBE_BYTES * u64::from(count);
        let list = graph.import_buffer(name, BufferDesc { bytes })?;
        Ok(Some(Self { maps, list, count }))
    }

    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        Settings("probes").count("probes", self.count, 1, MAX_PROBES)
    }
}

/// Probes as the list of [`Probes`] holds them, for one view, the first first.
///
/// # Errors
/// If a number is out of its range, or there are more than [`MAX_PROBES`].
pub fn probe_bytes(view: &View, probes: &[Probe]) -> Result<Vec<u8>, SettingError> {
    view.validate()?;
    let count = u32::try_from(probes.len()).unwrap_or(u32::MAX);
    Settings("probes").count("probes", count, 0, MAX_PROBES)?;
    let mut bytes = Vec::with_capacity(probes.len() * PROBE_BYTES as usize);
    for probe in probes {
        probe.validate()?;
        let numbers = probe.rows(view).into_iter().flat_map(|row| row.to_array());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
    }
    Ok(bytes)
}

/// A room that is not turned.
impl From<(Vec3, Vec3)> for Room {
    /// Of its least and its largest corner.
    fn from((least, largest): (Vec3, Vec3)) -> Self {
        let (least, largest) = (least.as_dvec3(), largest.as_dvec3());
        Self {
            centre: 0.5 * (least + largest),
            turn: DQuat::IDENTITY,
            half: 0.5 * (largest - least),
        }
    }
}

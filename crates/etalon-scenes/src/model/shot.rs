//! A model before a camera: what is drawn of it in one frame.

use etalon_core::backend::Inputs;
use etalon_core::graph::{Graph, GraphError, Texture};
use etalon_core::image::ImageError;
use etalon_effects::environment::{
    CubePicture, EnvironmentMap, Prefilter, Surroundings, mirroring,
};
use etalon_effects::forward::{Lamps, Lighting, forward, glass, lamp_bytes};
use etalon_effects::frame::{self, Drawables, Request, Shading};
use etalon_effects::geometry::{GBuffer, Geometry, Prepass, gbuffer, prepass};
use etalon_effects::lighting::{LightKind, PunctualLight, lighting};
use etalon_effects::probes::{Probe, ProbeMaps, Probes, Room, probe_bytes, probe_map};
use etalon_effects::{EffectError, SceneInputs};
use glam::{DQuat, DVec3, Vec3};
use thiserror::Error;

use super::drawable::{Drawable, lights, view};
use super::error::ModelError;
use super::moment::Snapshot;
use super::parts::Model;
use crate::camera::{Camera, CameraError, Pose};
use crate::frame::{FrameError, FrameSize};

/// Lux and candela that count as 1: what a dim room has, so that exposures of
/// lit models are near 1.
const UNIT: f32 = 100.0;

/// The name of the list of lights among the graph's imports.
const LAMPS: &str = "lamps";

/// Why a model cannot be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShotError {
    /// It cannot be posed.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A picture of no size.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// It cannot be looked at.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// An image does not fit into memory.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The graph has imports of the model's names already.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// An effect refuses it.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

/// The names of the list of rooms, and of the map of light in them.
const ROOMS: &str = "rooms";
const ROOM_LIGHT: &str = "room light";

/// Texels of that map's height.
const ROOM_SIDE: u32 = 32;

/// A model at a time, before a camera.
#[derive(Clone, Debug)]
pub struct Shot {
    model: Model,
    snapshot: Snapshot,
    camera: Camera,
    drawable: Drawable,
    lights: Vec<PunctualLight>,
    /// The lights as the camera sees them.
    lamps: Vec<u8>,
    /// Rooms around it, and around its middle, as the camera sees them.
    rooms: Vec<u8>,
    room_light: EnvironmentMap,
}

/// The passes that draw a [`Shot`], and what they hand to the effects.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Depth and velocity.
    pub prepass: Prepass,
    /// What of it is opaque.
    pub surfaces: GBuffer,
    /// Its light by the G-buffer, `rgba16float`.
    pub deferred: Texture,
    /// Its light as it was drawn, with glass over it.
    pub light: Texture,
    /// What effects take, with the latter light.
    pub inputs: SceneInputs,
}

impl Shot {
    /// The model at a time in seconds, seen by its first camera, or from before
    /// all of it if it has none; lit by its lights, or by one from above if it has
    /// none.
    ///
    /// # Errors
    /// As [`Model::at`]; if the model cannot be looked at, as one without size;
    /// if its images do not fit into memory.
    pub fn new(model: Model, time: f64) -> Result<Self, ShotError> {
        let snapshot = model.at(time)?;
        let camera = match snapshot.cameras.first() {
            Some(camera) => *camera,
            None => before(&model, &snapshot)?,
        };
        let drawable = Drawable::new(&model)?;
        let mut lights = lights(&model, &snapshot, UNIT);
        if lights.is_empty() {
            lights.push(PunctualLight {
                kind: LightKind::Directional,
                position: DVec3::ZERO,
                direction: DVec3::new(-0.5, -1.0, -0.8),
                power: Vec3::splat(3.0),
                reach: None,
            });
        }
        // Where lights are in view space is the same for every size.
        let square = FrameSize::new(1, 1)?;
        let seen = view(&camera, square)?;
        let lamps = lamp_bytes(&seen, &lights).map_err(EffectError::from)?;
        let rooms = rooms(&model, &snapshot);
        let rooms = probe_bytes(&seen, &rooms).map_err(EffectError::from)?;
        let light = CubePicture::of_directions(ROOM_SIDE, lamp_light)?;
        Ok(Self {
            rooms,
            room_light: EnvironmentMap::of_cube(&light, ROOM_SIDE)?,
            model,
            snapshot,
            camera,
            drawable,
            lights,
            lamps,
        })
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }

    /// The model at the time.
    #[must_use]
    pub const fn snapshot(&self) -> &Snapshot {
        &self.snapshot
    }

    /// Who looks.
    #[must_use]
    pub const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// What lights it: the model's own lights, or the one it is given for want of such.
    #[must_use]
    pub fn lights(&self) -> &[PunctualLight] {
        &self.lights
    }

    /// What a graph with the shot's passes is given.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        let inputs = self.drawable.inputs().buffer(LAMPS, &self.lamps);
        inputs
            .buffer(ROOMS, &self.rooms)
            .texture(ROOM_LIGHT, self.room_light.image())
    }

    /// A grey sky, with its table of what is mirrored.
    ///
    /// # Errors
    /// If the graph refuses the table's pass.
    pub fn sky(graph: &mut Graph) -> Result<Surroundings, ShotError> {
        Ok(Surroundings {
            above: Vec3::new(0.5, 0.6, 0.8),
            below: Vec3::splat(0.15),
            background: Vec3::new(0.05, 0.06, 0.08),
            mirroring: Some(mirroring(graph)?),
            ..Surroundings::default()
        })
    }

    /// The [sky](Shot::sky), with two rooms of one light in it: one around the model, and
    /// one within that.
    ///
    /// # Errors
    /// If the graph refuses a pass.
    pub fn among_rooms(&self, graph: &mut Graph) -> Result<Surroundings, ShotError> {
        let base = graph.import_texture(ROOM_LIGHT, self.room_light.image().desc)?;
        let maps = ProbeMaps::new(graph, ROOM_SIDE, 1)?;
        let maps = probe_map(graph, maps, 0, base, &Prefilter { samples: 16 })?;
        Ok(Surroundings {
            probes: Probes::import(graph, ROOMS, maps, 2)?,
            ..Self::sky(graph)?
        })
    }

    /// Draws it: a prepass with velocity, a G-buffer with a light map, and once more
    /// lit as it is drawn, with glass over that. `delta_time` is the seconds since the
    /// frame before.
    ///
    /// # Errors
    /// If the camera has no projection for the size, or an effect or the graph
    /// refuses the model.
    pub fn draw(
        &self,
        graph: &mut Graph,
        size: FrameSize,
        surroundings: Surroundings,
        delta_time: f32,
    ) -> Result<Drawn, ShotError> {
        let view = view(&self.camera, size)?;
        let imported = self.drawable.import(graph)?;
        let opaque = imported.opaque_items(&self.model, &self.snapshot);
        let eye = self.camera.pose().position();
        let blended = imported.blended_items(&self.model, &self.snapshot, eye);
        let solid = Geometry {
            items: &opaque,
            view,
            size: [size.width(), size.height()],
        };
        let prepass = prepass(graph, &solid, true)?;
        let surfaces = gbuffer(graph, &solid, Some(&prepass))?;
        let deferred = lighting(graph, &view, &surfaces, &self.lights, &surroundings)?;
        let lit = Lighting {
            lamps: Lamps::import(graph, LAMPS, self.lights.len() as u32)?,
            surroundings,
        };
        let shaded = forward(graph, &solid, Some(&prepass), &lit, false)?;
        let mut light = shaded.light;
        if !blended.is_empty() {
            let panes = Geometry {
                items: &blended,
                ..solid
            };
            light = glass(graph, &panes, light, shaded.depth, &lit)?;
        }
        Ok(Drawn {
            prepass,
            surfaces,
            deferred,
            light,
            inputs: SceneInputs {
                colour: light,
                depth: surfaces.depth,
                normal: surfaces.normal,
                specular: surfaces.specular,
                velocity: prepass.velocity,
                camera: view.camera,
                delta_time,
                beyond: None,
            },
        })
    }
}

impl Shot {
    /// Declares what a frame of it calls for, with everything that reads it: see
    /// [`of_geometry`](etalon_effects::frame::of_geometry). For the request's demands
    /// there is [`Shot::demands`].
    ///
    /// # Errors
    /// If the camera has no projection for the size, or an effect or the graph
    /// refuses the model.
    pub fn frame(
        &self,
        graph: &mut Graph,
        size: FrameSize,
        surroundings: Surroundings,
        shading: Shading,
        delta_time: f32,
        request: &Request,
    ) -> Result<frame::Frame, ShotError> {
        let imported = self.drawable.import(graph)?;
        let opaque = imported.opaque_items(&self.model, &self.snapshot);
        let eye = self.camera.pose().position();
        let blended = imported.blended_items(&self.model, &self.snapshot, eye);
        let drawables = Drawables {
            opaque: &opaque,
            blended: &blended,
            view: view(&self.camera, size)?,
            size: [size.width(), size.height()],
            lights: &self.lights,
            lamps: Lamps::import(graph, LAMPS, self.lights.len() as u32)?,
            surroundings,
            shading,
            delta_time,
        };
        Ok(frame::of_geometry(graph, &drawables, request)?)
    }
}

/// Light of one soft lamp in a dim room.
fn lamp_light(at: DVec3) -> DVec3 {
    let lamp = at.dot(DVec3::new(0.6, 0.64, 0.48)).max(0.0).powi(16);
    DVec3::new(0.2, 0.22, 0.25) * (1.2 + at.y) + DVec3::new(4.0, 3.0, 2.0) * lamp
}

/// A room around a model, and before it one of half its size.
fn rooms(model: &Model, snapshot: &Snapshot) -> [Probe; 2] {
    let (low, high) = bounds(model, snapshot);
    let least = DVec3::splat(1e-2);
    let half = (0.525 * (high - low)).clamp(least, DVec3::splat(1e6));
    [0.5, 1.0].map(|size| {
        let half = (half * size).max(least);
        let centre = 0.5 * (low + high);
        Probe {
            position: centre + half * DVec3::new(0.2, 0.5, -0.1),
            room: Room {
                centre,
                turn: DQuat::IDENTITY,
                half,
            },
            influence: half,
            falloff: (0.5 * half.min_element()) as f32,
            layer: 0,
        }
    })
}

/// The least and the largest corner of all of a model; the origin for nothing.
fn bounds(model: &Model, snapshot: &Snapshot) -> (DVec3, DVec3) {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for instance in snapshot.instances.all() {
        let bounds = model.parts().meshes[instance.mesh].bounds();
        for corner in 0..8 {
            let pick = |axis: usize| f64::from(bounds[corner >> axis & 1][axis]);
            let corner = DVec3::new(pick(0), pick(1), pick(2));
            let placed = instance.world.as_dmat4().transform_point3(corner);
            (low, high) = (low.min(placed), high.max(placed));
        }
    }
    if low.is_finite() && high.is_finite() {
        (low, high)
    } else {
        (DVec3::ZERO, DVec3::ZERO)
    }
}

/// A camera before all of a model.
fn before(model: &Model, snapshot: &Snapshot) -> Result<Camera, CameraError> {
    let (low, high) = bounds(model, snapshot);
    let (centre, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let eye = centre + DVec3::new(0.5, 0.3, 1.0).normalize() * 2.2 * radius;
    let pose = Pose::look_at(eye, centre, DVec3::Y)?;
    Camera::new(pose, 45_f64.to_radians())?.with_near(0.02 * radius)
}

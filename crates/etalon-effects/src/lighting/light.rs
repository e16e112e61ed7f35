//! Lights without extent.

use etalon_core::graph::Draw;
use etalon_core::raster::{Blend, RasterState, TargetState};
use glam::{DVec3, Vec3};

use crate::SettingError;
use crate::check::Settings;
use crate::geometry::{GBuffer, View};

/// Of what kind a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Light from infinitely far away; `power` is its irradiance on a plane that
    /// faces it.
    Directional,
    /// Light from a point in all directions; `power` is its intensity.
    Point,
    /// Light from a point within a cone; `power` is its intensity. It falls from the
    /// inner to the outer angle by the square of a linear step in cosines
    /// (`KHR_lights_punctual`).
    Spot {
        /// Half angle in radians up to which it has all its power, in `[0, outer)`.
        inner: f32,
        /// Half angle from which on it has none, in `(inner, π/2]`.
        outer: f32,
    },
}

/// A light in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Of what kind it is.
    pub kind: LightKind,
    /// Where it is; of no concern to directional ones. What is nearer than a millimetre
    /// is lit as from a millimetre.
    pub position: DVec3,
    /// In which direction it shines: any length but zero; of no concern to points.
    pub direction: DVec3,
    /// Each channel in `[0, 1e6]`.
    pub power: Vec3,
    /// Distance from which on it has no effect, in `[1e-3, 1e6]`.
    pub reach: Option<f32>,
}

/// A light as `lib/light` has it, in view space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Packed {
    pub(crate) directional: bool,
    pub(crate) place: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) power: Vec3,
    pub(crate) reach: f32,
    pub(crate) cone_scale: f32,
    pub(crate) cone_edge: f32,
}

impl PunctualLight {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("lighting");
        for value in self.power.to_array() {
            check.range("power", value, 0.0, 1e6)?;
        }
        for value in self.position.to_array() {
            check.range("position", value as f32, -1e12, 1e12)?;
        }
        if self.kind != LightKind::Point {
            check.range("direction", self.direction.length() as f32, 1e-6, 1e6)?;
        }
        if let Some(reach) = self.reach {
            check.range("reach", reach, 1e-3, 1e6)?;
        }
        if let LightKind::Spot { inner, outer } = self.kind {
            check.range("outer", outer, 1e-3, std::f32::consts::FRAC_PI_2)?;
            check.range("inner", inner, 0.0, outer * 0.9999)?;
        }
        Ok(())
    }

    /// In the space of a view.
    pub(crate) fn packed(&self, view: &View) -> Packed {
        // 1 - cos a is 2 sin² (a / 2), at most 2: an edge of 3 has all directions within.
        let (scale, edge) = match self.kind {
            LightKind::Directional | LightKind::Point => (1.0, 3.0),
            LightKind::Spot { inner, outer } => {
                let versine = |angle: f32| 2.0 * (0.5 * f64::from(angle)).sin().powi(2);
                let edge = versine(outer);
                ((1.0 / (edge - versine(inner))) as f32, edge as f32)
            }
        };
        let direction = view
            .view
            .transform_vector3(self.direction)
            .normalize_or(DVec3::NEG_Z);
        Packed {
            directional: self.kind == LightKind::Directional,
            place: view.view.transform_point3(self.position).as_vec3(),
            direction: direction.as_vec3(),
            power: self.power,
            reach: self.reach.unwrap_or(0.0),
            cone_scale: scale,
            cone_edge: edge,
        }
    }

    /// Its layer of a light map.
    pub(super) fn draw(&self, view: &View, surfaces: &GBuffer) -> Draw {
        let camera = &view.camera;
        let light = self.packed(view);
        Draw::new("lighting/light")
            .constant("DIRECTIONAL", f64::from(light.directional))
            .elements(0..3)
            .state(RasterState {
                targets: vec![TargetState {
                    blend: Some(Blend::ADD),
                    ..TargetState::default()
                }],
                ..RasterState::default()
            })
            .read("depth", surfaces.depth)
            .read("colour", surfaces.colour)
            .read("normal", surfaces.normal)
            .read("specular", surfaces.specular)
            .set("projection_scale", camera.scale)
            .set("projection_centre", camera.centre)
            .set("depth_bias_slope", camera.depth_bias_slope())
            .set("distance_range", camera.distance_range())
            .set("place", light.place)
            .set("direction", light.direction)
            .set("power", light.power)
            .set("reach", light.reach)
            .set("cone_scale", light.cone_scale)
            .set("cone_edge", light.cone_edge)
    }
}

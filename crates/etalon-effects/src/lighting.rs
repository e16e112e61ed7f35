//! Deferred lighting: the light of each light, added up in a light map.
//!
//! Each light is a pass over the picture that reads the G-buffer, so that its cost
//! does not depend on how much was drawn: texels times lights. The first layer
//! holds what needs no light: emission, light from everywhere, the background.
//!
//! The light map is `rgba16float`; every layer is rounded to it before it is added,
//! and the sum once more by the target.

use etalon_core::Format;
use etalon_core::graph::{ClearValue, Draw, Graph, Load, Texture};
use etalon_core::raster::{Blend, RasterState, TargetState};
use etalon_core::resource::TextureDesc;
use glam::{DVec3, Vec3};

use crate::check::{Settings, size};
use crate::geometry::{GBuffer, View};
use crate::{EffectError, SettingError};

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
    /// Where it is; of no concern to directional ones.
    pub position: DVec3,
    /// In which direction it shines: any length but zero; of no concern to points.
    pub direction: DVec3,
    /// Each channel in `[0, 1e6]`.
    pub power: Vec3,
    /// Distance from which on it has no effect, in `[1e-3, 1e6]`.
    pub reach: Option<f32>,
}

/// Light that comes from everywhere, and what is behind everything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Radiance from above, each channel in `[0, 65504]`.
    pub above: Vec3,
    /// Radiance from below, each channel in `[0, 65504]`.
    pub below: Vec3,
    /// Radiance where there is no surface, each channel in `[0, 65504]`.
    pub background: Vec3,
}

/// Adds up the light that a G-buffer's surfaces send to the camera.
///
/// # Errors
/// If a number is out of its range, or the graph refuses a pass.
pub fn lighting(
    graph: &mut Graph,
    view: &View,
    surfaces: &GBuffer,
    lights: &[PunctualLight],
    surroundings: &Surroundings,
) -> Result<Texture, EffectError> {
    view.validate()?;
    surroundings.validate()?;
    for light in lights {
        light.validate()?;
    }
    let [width, height] = size(graph, surfaces.colour);
    let target = graph.texture("light", TextureDesc::d2(width, height, Format::Rgba16Float));
    let up = view.view.transform_vector3(DVec3::Y).as_vec3();
    let first = Draw::new("lighting/ambient")
        .elements(0..3)
        .read("colour", surfaces.colour)
        .read("normal", surfaces.normal)
        .read("specular", surfaces.specular)
        .read("emission", surfaces.emission)
        .set("up", up)
        .set("above", surroundings.above)
        .set("below", surroundings.below)
        .set("background", surroundings.background);
    let layers = lights.iter().map(|light| light.draw(view, surfaces));
    let written = graph
        .raster("lighting/light map")
        .colour("light", target, Load::Clear(ClearValue::Float([0.0; 4])))
        .draw(first)
        .draws(layers)
        .finish()?;
    Ok(written.texture("light")?)
}

impl Surroundings {
    fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("lighting");
        for (field, colour) in [
            ("above", self.above),
            ("below", self.below),
            ("background", self.background),
        ] {
            for value in colour.to_array() {
                check.range(field, value, 0.0, 65504.0)?;
            }
        }
        Ok(())
    }
}

impl PunctualLight {
    fn validate(&self) -> Result<(), SettingError> {
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

    fn draw(&self, view: &View, surfaces: &GBuffer) -> Draw {
        let camera = &view.camera;
        // An intensity of 1 everywhere, or a step in cosines from outer to inner.
        let (scale, offset) = match self.kind {
            LightKind::Directional | LightKind::Point => (0.0, 1.0),
            LightKind::Spot { inner, outer } => {
                let (inner, outer) = (f64::from(inner).cos(), f64::from(outer).cos());
                let scale = 1.0 / (inner - outer);
                (scale as f32, (-outer * scale) as f32)
            }
        };
        let direction = view
            .view
            .transform_vector3(self.direction)
            .normalize_or(DVec3::NEG_Z);
        Draw::new("lighting/light")
            .constant(
                "DIRECTIONAL",
                f64::from(self.kind == LightKind::Directional),
            )
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
            .set("place", view.view.transform_point3(self.position).as_vec3())
            .set("direction", direction.as_vec3())
            .set("power", self.power)
            .set("reach", self.reach.unwrap_or(0.0))
            .set("cone_scale", scale)
            .set("cone_offset", offset)
    }
}

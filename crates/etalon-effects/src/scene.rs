//! What a scene hands to the effects.

use etalon_core::graph::{ComputePass, Texture};
use glam::{DMat4, Vec2};

use crate::SettingError;
use crate::check::Settings;
use crate::environment::Surroundings;

/// How distances from the view plane become device depth.
///
/// All four are `depth = bias + slope / distance`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum DepthRange {
    /// 1 at the near plane, 0 at infinity: `near / distance`. The densest in
    /// floating point where it is needed, and the default.
    #[default]
    ReversedInfinite,
    /// 1 at the near plane, 0 at the far plane.
    Reversed {
        /// Distance of the far plane.
        far: f32,
    },
    /// 0 at the near plane, 1 at the far plane.
    Standard {
        /// Distance of the far plane.
        far: f32,
    },
    /// 0 at the near plane, 1 at infinity.
    StandardInfinite,
}

/// The projection that made the scene's images.
///
/// View space is right-handed with the camera looking down −Z and +Y up. The
/// view position `(x, y, −d)` is seen at the normalised device coordinates
/// `scale · (x, y) / d + centre`, whose y points up, and at the device depth
/// that `depth` and `near` say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraParams {
    /// The first two diagonal elements of the projection matrix, in
    /// `[1e-3, 1e6]`: `1 / tan(fov / 2)` per axis.
    pub scale: Vec2,
    /// Where the view axis is seen, in normalised device coordinates within
    /// `[−4, 4]`: zero but for off-centre or jittered projections.
    pub centre: Vec2,
    /// Distance of the near plane in view units, in `[1e-6, 1e6]`.
    pub near: f32,
    /// Device depth of a distance.
    pub depth: DepthRange,
}

/// Distance from which on a surface counts as background where there is no far
/// plane: 2⁴⁰ view units, so that squares of positions stay far inside f32's range.
pub(crate) const HORIZON: f32 = 1_099_511_627_776.0;

impl CameraParams {
    /// A symmetric perspective with reversed-Z depth and no far plane.
    ///
    /// `vertical_fov` is the angle in radians between the upper and lower edge
    /// of the picture, `aspect` its width over its height.
    #[must_use]
    pub fn perspective(vertical_fov: f32, aspect: f32, near: f32) -> Self {
        let y = 1.0 / (0.5 * vertical_fov).tan();
        Self {
            scale: Vec2::new(y / aspect, y),
            centre: Vec2::ZERO,
            near,
            depth: DepthRange::ReversedInfinite,
        }
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("camera");
        check.range("scale.x", self.scale.x, 1e-3, 1e6)?;
        check.range("scale.y", self.scale.y, 1e-3, 1e6)?;
        check.range("centre.x", self.centre.x, -4.0, 4.0)?;
        check.range("centre.y", self.centre.y, -4.0, 4.0)?;
        check.range("near", self.near, 1e-6, 1e6)?;
        match self.depth {
            DepthRange::ReversedInfinite | DepthRange::StandardInfinite => Ok(()),
            DepthRange::Reversed { far } | DepthRange::Standard { far } => {
                check.range("far", far, self.near * 1.001, HORIZON)
            }
        }
    }

    /// `bias` and `slope` of `depth = bias + slope / distance`, computed in f64
    /// because the difference of two near planes is a small one of large numbers.
    #[must_use]
    pub fn depth_bias_slope(&self) -> Vec2 {
        let near = f64::from(self.near);
        let (bias, slope) = match self.depth {
            DepthRange::ReversedInfinite => (0.0, near),
            DepthRange::StandardInfinite => (1.0, -near),
            DepthRange::Reversed { far } => {
                let far = f64::from(far);
                (-near / (far - near), near * far / (far - near))
            }
            DepthRange::Standard { far } => {
                let far = f64::from(far);
                (far / (far - near), -near * far / (far - near))
            }
        };
        Vec2::new(bias as f32, slope as f32)
    }

    /// Distances of the near plane and of where the background begins. A
    /// cleared depth reads as the far plane itself, give or take the rounding
    /// of `bias`; for standard depth one step of it is far in distance.
    #[must_use]
    pub fn distance_range(&self) -> Vec2 {
        let end = match self.depth {
            DepthRange::ReversedInfinite | DepthRange::StandardInfinite => f64::from(HORIZON),
            DepthRange::Reversed { far } | DepthRange::Standard { far } => {
                // The distance whose depth lies four roundings of the largest
                // term before the far plane's.
                let [bias, slope] = self.depth_bias_slope().as_dvec2().to_array();
                let cleared = bias + slope / f64::from(far);
                let margin = 4.0 * f64::from(f32::EPSILON) * bias.abs().max(cleared.abs());
                slope / (cleared - bias + slope.signum() * margin)
            }
        };
        Vec2::new(self.near, end as f32)
    }

    /// Sets the members that `lib/camera` asks of a kernel's uniform block.
    pub(crate) fn set<'g>(&self, pass: ComputePass<'g>) -> ComputePass<'g> {
        pass.set("projection_scale", self.scale)
            .set("projection_centre", self.centre)
            .set("depth_bias_slope", self.depth_bias_slope())
            .set("distance_range", self.distance_range())
    }
}

/// The images of one frame of a scene, all of one size, and how they were made.
#[derive(Clone, Copy, Debug)]
pub struct SceneInputs {
    /// Linear Rec. 709 light, scene-referred, without reflections; alpha is kept.
    pub colour: Texture,
    /// Device depth in one channel, as `camera.depth` says.
    pub depth: Texture,
    /// View-space normals in xyz, toward the camera; zero where there is no surface.
    pub normal: Texture,
    /// rgb: how much of each colour is mirrored; a: shininess, 1 − roughness.
    pub specular: Texture,
    /// Screen position now less that one frame earlier, in uv, if there is any.
    pub velocity: Option<Texture>,
    /// The projection.
    pub camera: CameraParams,
    /// Seconds since the frame before, in `[0, 1e6]`.
    pub delta_time: f32,
    /// What is beyond the screen, if reflections are to show it: light that `colour`
    /// does not hold, see [`Mirrored`](crate::environment::Mirrored).
    pub beyond: Option<Beyond>,
}

/// What reflections show where the screen has no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Light of probes, and of the world for the rest.
    pub surroundings: Surroundings,
    /// From the world to view space: a rotation and a translation, as a
    /// [`View`](crate::geometry::View) has it.
    pub view: DMat4,
}

//! Cameras and the one projection that every frame uses.
//!
//! # Conventions
//! * World and view space are right-handed with +Y up; in view space the camera
//!   sits at the origin and looks down −Z, +X to the right of the picture.
//! * `uv` is (0, 0) at the top left corner of the picture and (1, 1) at the
//!   bottom right one. The centre of pixel `(x, y)` of a `w × h` picture is
//!   `((x + ½) / w, (y + ½) / h)`.
//! * With `s_y = 1 / tan(fov / 2)`, `s_x = s_y · h / w` and the near plane at
//!   distance `n`, the view position `(x, y, z)`, `z < 0`, is seen at
//!
//!   ```text
//!   u = ½ + ½ s_x x / −z        v = ½ − ½ s_y y / −z        depth = n / −z
//!   ```
//!
//!   This is reversed-Z with the far plane at infinity: device depth is 1 on the
//!   near plane and 0 at infinity, where floating point is densest (Reed, “Depth
//!   Precision Visualized”, 2015).

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};
use thiserror::Error;

use crate::frame::FrameSize;
use crate::trace::Ray;

/// Why a camera cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A position or direction holds a NaN or an infinity.
    #[error("the camera's {what} is {value}; it must be finite")]
    NotFinite {
        /// Which one.
        what: &'static str,
        /// As given.
        value: DVec3,
    },
    /// The point looked at is the camera's own position, or straight along the up direction.
    #[error(
        "a camera at {position} looking at {target} with up direction {up} has no orientation: the view direction must be neither zero nor parallel to up"
    )]
    NoOrientation {
        /// Where the camera is.
        position: DVec3,
        /// What it should look at.
        target: DVec3,
        /// Which direction should be up.
        up: DVec3,
    },
    /// The vertical field of view is not between 0 and π.
    #[error("the vertical field of view is {0} rad; it must be over 0 and under π")]
    FieldOfView(f64),
    /// The near plane is not in front of the camera.
    #[error("the near plane is at {0}; it must be finite and over 0")]
    NearPlane(f64),
    /// A projection scale is not a positive number.
    #[error("the projection scale is ({}, {}); both must be finite and over 0", .0.x, .0.y)]
    ProjectionScale(DVec2),
}

/// Where a camera is and which way it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    position: DVec3,
    /// Columns: right, up, backward (view +X, +Y, +Z) in world space.
    orientation: DMat3,
}

impl Pose {
    /// At `position`, looking at `target`, with `up` upward in the picture.
    ///
    /// # Errors
    /// If an argument is not finite, or the view direction is zero or parallel
    /// to `up`.
    pub fn look_at(position: DVec3, target: DVec3, up: DVec3) -> Result<Self, CameraError> {
        for (what, value) in [
            ("position", position),
            ("target", target),
            ("up direction", up),
        ] {
            if !value.is_finite() {
                return Err(CameraError::NotFinite { what, value });
            }
        }
        let none = CameraError::NoOrientation {
            position,
            target,
            up,
        };
        let backward = (position - target).try_normalize().ok_or(none.clone())?;
        let up = up.try_normalize().ok_or(none.clone())?;
        let right = up.cross(backward);
        // Both are unit vectors, so this is the sine of their angle.
        if right.length() < 1e-9 {
            return Err(none);
        }
        let right = right.normalize();
        Ok(Self {
            position,
            orientation: DMat3::from_cols(right, backward.cross(right), backward),
        })
    }

    /// The pose of something placed by an affine matrix: at its translation,
    /// looking down its −Z axis, with its +Y axis upward. Scale does not count.
    ///
    /// # Errors
    /// If the matrix is not finite or its axes do not give an orientation.
    pub fn placed(matrix: DMat4) -> Result<Self, CameraError> {
        let position = matrix.w_axis.truncate();
        let turned = Self::look_at(
            DVec3::ZERO,
            -matrix.z_axis.truncate(),
            matrix.y_axis.truncate(),
        )?;
        if !position.is_finite() {
            return Err(CameraError::NotFinite {
                what: "position",
                value: position,
            });
        }
        Ok(Self { position, ..turned })
    }

    /// World position.
    #[must_use]
    pub const fn position(&self) -> DVec3 {
        self.position
    }

    /// Rotation from view to world space.
    #[must_use]
    pub const fn orientation(&self) -> DMat3 {
        self.orientation
    }

    /// A world position in view space.
    #[must_use]
    pub fn to_view(&self, world: DVec3) -> DVec3 {
        self.orientation.transpose() * (world - self.position)
    }

    /// A world direction in view space.
    #[must_use]
    pub fn direction_to_view(&self, world: DVec3) -> DVec3 {
        self.orientation.transpose() * world
    }

    /// A view position in world space.
    #[must_use]
    pub fn to_world(&self, view: DVec3) -> DVec3 {
        self.position + self.orientation * view
    }

    /// The world-to-view matrix.
    #[must_use]
    pub fn view_matrix(&self) -> DMat4 {
        let rotation = self.orientation.transpose();
        let translation = rotation * -self.position;
        DMat4::from_cols(
            rotation.x_axis.extend(0.0),
            rotation.y_axis.extend(0.0),
            rotation.z_axis.extend(0.0),
            translation.extend(1.0),
        )
    }
}

/// Where a view position is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Place in the picture; outside `[0, 1]` off screen.
    pub uv: DVec2,
    /// Device depth: over 1 in front of the near plane.
    pub depth: f64,
}

/// The reversed-Z, infinite-far perspective projection of a picture; see the
/// [module](self) for its formulas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    scale: DVec2,
    near: f64,
}

impl Projection {
    /// A projection from `s_x`, `s_y` and the distance of the near plane.
    ///
    /// # Errors
    /// If one of them is not a positive number.
    pub fn new(scale: DVec2, near: f64) -> Result<Self, CameraError> {
        if !(scale.is_finite() && scale.x > 0.0 && scale.y > 0.0) {
            return Err(CameraError::ProjectionScale(scale));
        }
        if !(near.is_finite() && near > 0.0) {
            return Err(CameraError::NearPlane(near));
        }
        Ok(Self { scale, near })
    }

    /// A projection with square pixels from the vertical field of view in radians.
    ///
    /// # Errors
    /// If the field of view is not in (0, π) or the near plane not positive.
    pub fn perspective(vertical_fov: f64, near: f64, size: FrameSize) -> Result<Self, CameraError> {
        if !(vertical_fov > 0.0 && vertical_fov < std::f64::consts::PI) {
            return Err(CameraError::FieldOfView(vertical_fov));
        }
        let y = 1.0 / (0.5 * vertical_fov).tan();
        Self::new(
            DVec2::new(y * f64::from(size.height()) / f64::from(size.width()), y),
            near,
        )
    }

    /// `(s_x, s_y)`: the diagonal of the projection matrix.
    #[must_use]
    pub const fn scale(&self) -> DVec2 {
        self.scale
    }

    /// Distance of the near plane.
    #[must_use]
    pub const fn near(&self) -> f64 {
        self.near
    }

    /// The projection matrix from view to clip space:
    /// `clip = (s_x x, s_y y, n, −z)`.
    #[must_use]
    pub const fn matrix(&self) -> DMat4 {
        DMat4::from_cols(
            DVec4::new(self.scale.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, self.scale.y, 0.0, 0.0),
            DVec4::new(0.0, 0.0, 0.0, -1.0),
            DVec4::new(0.0, 0.0, self.near, 0.0),
        )
    }

    /// Where a view position is seen; `None` unless it is in front of the eye.
    #[must_use]
    pub fn project(&self, view: DVec3) -> Option<Projected> {
        let w = -view.z;
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        Some(Projected {
            uv: DVec2::new(
                0.5 + 0.5 * self.scale.x * view.x / w,
                0.5 - 0.5 * self.scale.y * view.y / w,
            ),
            depth: self.near / w,
        })
    }

    /// The point at view distance 1 (`z = −1`) that is seen at `uv`.
    #[must_use]
    pub fn direction(&self, uv: DVec2) -> DVec3 {
        DVec3::new(
            (2.0 * uv.x - 1.0) / self.scale.x,
            (1.0 - 2.0 * uv.y) / self.scale.y,
            -1.0,
        )
    }

    /// The view position seen at `uv` with a device depth over 0.
    #[must_use]
    pub fn unproject(&self, uv: DVec2, depth: f64) -> DVec3 {
        self.direction(uv) * (self.near / depth)
    }
}

/// A perspective camera, with the pose it had one frame earlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pose: Pose,
    previous: Pose,
    vertical_fov: f64,
    near: f64,
}

impl Camera {
    /// Distance of the near plane where none is asked for.
    pub const DEFAULT_NEAR: f64 = 0.1;

    /// A camera at rest with the vertical field of view in radians and the near
    /// plane at [`Camera::DEFAULT_NEAR`].
    ///
    /// # Errors
    /// If the field of view is not in (0, π).
    pub fn new(pose: Pose, vertical_fov: f64) -> Result<Self, CameraError> {
        if !(vertical_fov > 0.0 && vertical_fov < std::f64::consts::PI) {
            return Err(CameraError::FieldOfView(vertical_fov));
        }
        Ok(Self {
            pose,
            previous: pose,
            vertical_fov,
            near: Self::DEFAULT_NEAR,
        })
    }

    /// The same camera with its near plane elsewhere.
    ///
    /// # Errors
    /// If the distance is not a positive number.
    pub fn with_near(self, near: f64) -> Result<Self, CameraError> {
        if near.is_finite() && near > 0.0 {
            Ok(Self { near, ..self })
        } else {
            Err(CameraError::NearPlane(near))
        }
    }

    /// The same camera, having been at `previous` one frame earlier.
    #[must_use]
    pub const fn moved_from(self, previous: Pose) -> Self {
        Self { previous, ..self }
    }

    /// Where the camera is.
    #[must_use]
    pub const fn pose(&self) -> Pose {
        self.pose
    }

    /// Where the camera was one frame earlier.
    #[must_use]
    pub const fn previous_pose(&self) -> Pose {
        self.previous
    }

    /// Vertical field of view in radians.
    #[must_use]
    pub const fn vertical_fov(&self) -> f64 {
        self.vertical_fov
    }

    /// Distance of the near plane.
    #[must_use]
    pub const fn near(&self) -> f64 {
        self.near
    }

    /// The camera of the frame before, at rest.
    #[must_use]
    pub const fn previous(&self) -> Self {
        Self {
            pose: self.previous,
            ..*self
        }
    }

    /// The projection for a picture of `size`.
    ///
    /// # Errors
    /// If the field of view is so narrow or wide, or the picture so elongated,
    /// that the scale is no longer a number.
    pub fn projection(&self, size: FrameSize) -> Result<Projection, CameraError> {
        Projection::perspective(self.vertical_fov, self.near, size)
    }

    /// The ray through a place in the picture. It starts at the eye, but hits
    /// count only from the near plane on; its direction is a unit vector.
    #[must_use]
    pub fn ray(&self, projection: &Projection, uv: DVec2) -> Ray {
        let direction = projection.direction(uv);
        let length = direction.length();
        Ray::new(
            self.pose.position,
            self.pose.orientation * (direction / length),
        )
        .starting_at(self.near * length)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_3;

    use super::*;

    fn camera() -> Camera {
        let pose = Pose::look_at(
            DVec3::new(3.0, 2.0, 5.0),
            DVec3::new(-1.0, 0.5, -2.0),
            DVec3::Y,
        );
        Camera::new(pose.unwrap(), FRAC_PI_3)
            .unwrap()
            .with_near(0.25)
            .unwrap()
    }

    #[test]
    fn projecting_undoes_unprojecting() {
        let projection = camera()
            .projection(FrameSize::new(257, 129).unwrap())
            .unwrap();
        for (u, v, depth) in [
            (0.5, 0.5, 1.0),
            (0.0, 0.0, 0.5),
            (1.0, 0.25, 1e-6),
            (0.125, 0.875, 1e-12),
        ] {
            let view = projection.unproject(DVec2::new(u, v), depth);
            let seen = projection.project(view).unwrap();
            // Three rounded operations each way, on values of at most 1.
            assert!((seen.uv - DVec2::new(u, v)).abs().max_element() < 1e-15);
            assert!((seen.depth / depth - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn matrices_agree_with_the_formulas() {
        let camera = camera();
        let projection = camera
            .projection(FrameSize::new(640, 360).unwrap())
            .unwrap();
        let world = DVec3::new(-0.5, 1.25, 0.75);
        let view = camera.pose().to_view(world);
        let by_matrix = camera.pose().view_matrix() * world.extend(1.0);
        assert!((by_matrix.truncate() - view).length() < 1e-14);
        assert!((camera.pose().to_world(view) - world).length() < 1e-14);

        let clip = projection.matrix() * view.extend(1.0);
        let seen = projection.project(view).unwrap();
        let ndc = clip / clip.w;
        assert!((0.5 + 0.5 * ndc.x - seen.uv.x).abs() < 1e-15);
        assert!((0.5 - 0.5 * ndc.y - seen.uv.y).abs() < 1e-15);
        assert!((ndc.z - seen.depth).abs() < 1e-15);
    }

    #[test]
    fn the_target_is_in_the_middle_and_up_is_up() {
        let camera = camera();
        let projection = camera.projection(FrameSize::new(64, 64).unwrap()).unwrap();
        let target = DVec3::new(-1.0, 0.5, -2.0);
        let middle = projection.project(camera.pose().to_view(target)).unwrap();
        assert!((middle.uv - DVec2::splat(0.5)).length() < 1e-15);
        let above = projection
            .project(camera.pose().to_view(target + DVec3::Y))
            .unwrap();
        assert!(above.uv.y < 0.5 && (above.uv.x - 0.5).abs() < 1e-15);
        // Of two points, the one further from the eye has the smaller depth.
        let beyond = target + (target - camera.pose().position());
        assert!(
            projection
                .project(camera.pose().to_view(beyond))
                .unwrap()
                .depth
                < middle.depth
        );
    }

    #[test]
    fn rays_pass_through_what_they_see() {
        let camera = camera();
        let projection = camera.projection(FrameSize::new(31, 17).unwrap()).unwrap();
        let uv = DVec2::new(0.2, 0.9);
        let ray = camera.ray(&projection, uv);
        assert!((ray.direction().length() - 1.0).abs() < 1e-15);
        for t in [ray.start(), 1.0, 1e3] {
            let seen = projection
                .project(camera.pose().to_view(ray.at(t)))
                .unwrap();
            assert!((seen.uv - uv).length() < 1e-14);
        }
        // The ray begins on the near plane, where depth is 1.
        let start = projection
            .project(camera.pose().to_view(ray.at(ray.start())))
            .unwrap();
        assert!((start.depth - 1.0).abs() < 1e-14);
    }

    #[test]
    fn nothing_behind_the_eye_is_seen() {
        let projection = Projection::new(DVec2::ONE, 0.1).unwrap();
        for z in [0.0, -0.0, 1.0, f64::NAN] {
            assert_eq!(projection.project(DVec3::new(0.0, 0.0, z)), None);
        }
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let here = DVec3::ONE;
        assert!(matches!(
            Pose::look_at(here, here, DVec3::Y),
            Err(CameraError::NoOrientation { .. })
        ));
        assert!(matches!(
            Pose::look_at(here, here + DVec3::Y, DVec3::Y),
            Err(CameraError::NoOrientation { .. })
        ));
        assert!(matches!(
            Pose::look_at(DVec3::new(f64::NAN, 0.0, 0.0), here, DVec3::Y),
            Err(CameraError::NotFinite {
                what: "position",
                ..
            })
        ));
        let pose = Pose::look_at(here, DVec3::ZERO, DVec3::Y).unwrap();
        for fov in [0.0, -1.0, std::f64::consts::PI, f64::NAN] {
            assert!(matches!(
                Camera::new(pose, fov),
                Err(CameraError::FieldOfView(_))
            ));
        }
        for near in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            let camera = Camera::new(pose, 1.0).unwrap();
            assert!(matches!(
                camera.with_near(near),
                Err(CameraError::NearPlane(_))
            ));
        }
        assert!(Projection::new(DVec2::new(0.0, 1.0), 0.1).is_err());
    }
}

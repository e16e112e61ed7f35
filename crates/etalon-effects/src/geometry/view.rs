//! Who looks, and from where.

use glam::{DMat3, DMat4};

use crate::check::Settings;
use crate::{CameraParams, SettingError};

/// A camera in the world, and where it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// How view space becomes the picture.
    pub camera: CameraParams,
    /// From the world to view space: a rotation and a translation.
    pub view: DMat4,
    /// The same one frame earlier.
    pub previous: DMat4,
}

impl View {
    /// Checks the camera, and that the matrices are finite and can be undone.
    ///
    /// # Errors
    /// The first number that cannot be.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.camera.validate()?;
        let check = Settings("geometry");
        for (field, matrix) in [("view", self.view), ("previous view", self.previous)] {
            // A rotation's is 1; NaN and infinities fail as well.
            check.range(field, matrix.determinant().abs() as f32, 0.5, 2.0)?;
            let largest = matrix.to_cols_array().into_iter().fold(0.0, f64::max);
            check.range(field, largest as f32, 0.0, 1e12)?;
        }
        Ok(())
    }

    /// What is added to a point in view space to have it in that of one frame earlier.
    /// The difference comes first: where the camera stands still it is 0.
    pub(super) fn change(&self) -> DMat4 {
        (self.previous - self.view) * self.view.inverse()
    }

    /// Turns normals of something in the world into view space: the inverse
    /// transpose, which keeps them at right angles to what is stretched, times the
    /// determinant's magnitude, so that something flattened has the normal of its
    /// plane.
    pub(super) fn normal_matrix(&self, world: DMat4) -> DMat4 {
        let linear = DMat3::from_mat4(self.view * world);
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        // Only the direction counts; of the size of one it stays inside f32.
        let entries = cofactors.to_cols_array();
        let size = entries.into_iter().map(f64::abs).fold(0.0, f64::max);
        let sign = if linear.determinant() < 0.0 {
            -1.0
        } else {
            1.0
        };
        let scale = if size.is_normal() { sign / size } else { sign };
        DMat4::from_mat3(cofactors * scale)
    }
}

//! From shapes, whose numbers may be anything, to primitives that can be traced.

use glam::{DMat3, DVec3};

use super::primitive::Primitive;
use super::scene::SceneError;
use super::shape::Shape;

/// Cuts a shape into primitives, after checking it.
pub(super) fn split(
    index: usize,
    shape: &Shape,
    primitives: &mut Vec<Primitive>,
) -> Result<(), SceneError> {
    let check = Check {
        which: "object",
        index,
    };
    let positive = |what, x| check.number(what, x, "finite and over 0", |x| x > 0.0);
    primitives.push(match *shape {
        Shape::Plane { point, normal } => {
            check.finite("point", point)?;
            Primitive::Plane {
                point,
                normal: check.direction("normal", normal)?,
            }
        }
        Shape::Rectangle {
            center,
            half_u,
            half_v,
        } => {
            check.finite("center", center)?;
            let u = check.direction("half_u", half_u)?;
            let v = check.direction("half_v", half_v)?;
            check.number(
                "cosine between half_u and half_v",
                u.dot(v),
                "0: a right angle",
                |x| x.abs() < 1e-9,
            )?;
            Primitive::Rectangle {
                center,
                half_u,
                half_v,
                inverse_u: half_u / half_u.length_squared(),
                inverse_v: half_v / half_v.length_squared(),
                normal: u.cross(v).normalize(),
            }
        }
        Shape::Disc {
            center,
            normal,
            radius,
        } => {
            check.finite("center", center)?;
            positive("radius", radius)?;
            Primitive::Disc {
                center,
                normal: check.direction("normal", normal)?,
                radius,
            }
        }
        Shape::Sphere { center, radius } => {
            check.finite("center", center)?;
            positive("radius", radius)?;
            Primitive::Sphere { center, radius }
        }
        Shape::Box {
            center,
            half,
            orientation,
        } => {
            check.finite("center", center)?;
            for axis in 0..3 {
                positive("half edge", half[axis])?;
            }
            let error = orientation.transpose() * orientation - DMat3::IDENTITY;
            let error = error
                .to_cols_array()
                .into_iter()
                .fold(0.0, |most: f64, x| most.max(x.abs()));
            let error = if orientation.is_finite() {
                error
            } else {
                f64::NAN
            };
            check.number("orientation's distance from a rotation", error, "0", |x| {
                x < 1e-9
            })?;
            Primitive::Box {
                center,
                half,
                orientation,
            }
        }
        Shape::Mesh(ref mesh) => {
            for &position in &mesh.positions {
                check.finite("corner", position)?;
            }
            for (triangle, corners) in mesh.triangles.iter().enumerate() {
                let corner = |corner: u32| {
                    mesh.positions
                        .get(corner as usize)
                        .copied()
                        .ok_or(SceneError::Corner {
                            object: index,
                            triangle,
                            corner,
                            corners: mesh.positions.len(),
                        })
                };
                let corners = [
                    corner(corners[0])?,
                    corner(corners[1])?,
                    corner(corners[2])?,
                ];
                let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                // A triangle without area has no normal, and no ray can hit it.
                if let Some(normal) = area.try_normalize() {
                    primitives.push(Primitive::Triangle { corners, normal });
                }
            }
            return Ok(());
        }
    });
    Ok(())
}

/// Names the object or light whose numbers are checked.
pub(super) struct Check {
    pub(super) which: &'static str,
    pub(super) index: usize,
}

impl Check {
    fn error(&self, what: &'static str, value: impl ToString, need: &'static str) -> SceneError {
        SceneError::Value {
            which: self.which,
            index: self.index,
            what,
            value: value.to_string(),
            need,
        }
    }

    pub(super) fn finite(&self, what: &'static str, value: DVec3) -> Result<(), SceneError> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(self.error(what, value, "finite"))
        }
    }

    pub(super) fn direction(&self, what: &'static str, value: DVec3) -> Result<DVec3, SceneError> {
        self.finite(what, value)?;
        value
            .try_normalize()
            .ok_or_else(|| self.error(what, value, "longer than 0"))
    }

    pub(super) fn number(
        &self,
        what: &'static str,
        value: f64,
        need: &'static str,
        holds: impl Fn(f64) -> bool,
    ) -> Result<(), SceneError> {
        if value.is_finite() && holds(value) {
            Ok(())
        } else {
            Err(self.error(what, value, need))
        }
    }
}

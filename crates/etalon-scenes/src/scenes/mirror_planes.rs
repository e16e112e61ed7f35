//! A mirror below a chequered wall.
//!
//! The mirror is the plane `y = `[`MIRROR_HEIGHT`], the wall the plane
//! `z = −`[`WALL_DISTANCE`], so a ray from the eye `e` towards `d` with
//! `d.y < 0` meets the mirror at `m = e − d (e.y − MIRROR_HEIGHT) / d.y`, and its
//! mirror image, with `d.y` negated, meets the wall at
//! `m + d' (−WALL_DISTANCE − m.z) / d'.z`. The camera looks
//! down, so parts of the wall that the mirror shows are above the picture.

use glam::DVec3;

use super::{World, WorldError, moving_camera};
use crate::trace::{Ambient, Material, Pattern, Property, SceneBuilder, Shape, Sky};

/// The height of the mirror, in world space.
pub const MIRROR_HEIGHT: f64 = -0.25;
/// The distance of the wall from the world's origin, along −Z.
pub const WALL_DISTANCE: f64 = 6.0;

pub(super) fn build() -> Result<World, WorldError> {
    let mut scene = SceneBuilder::new();
    scene.sky(Sky {
        horizon: DVec3::new(0.4, 0.5, 0.7),
        zenith: DVec3::new(0.1, 0.2, 0.5),
    });
    // Nothing but ambient light: the wall's colour is the same from everywhere.
    scene.ambient(Ambient {
        above: DVec3::ONE,
        below: DVec3::ONE,
    });
    scene.object(
        Shape::Plane {
            point: DVec3::new(0.0, MIRROR_HEIGHT, 0.0),
            normal: DVec3::Y,
        },
        Material::metal(DVec3::ONE, 0.0),
    );
    scene.object(
        Shape::Plane {
            point: DVec3::new(0.0, 0.0, -WALL_DISTANCE),
            normal: DVec3::Z,
        },
        Material::matte(Property::Varying {
            low: DVec3::new(0.9, 0.35, 0.1),
            high: DVec3::new(0.05, 0.2, 0.6),
            pattern: Pattern::Checker {
                origin: DVec3::ZERO,
                u: DVec3::X * 0.5,
                v: DVec3::Y * 0.5,
            },
        }),
    );
    let camera = moving_camera(
        [DVec3::new(0.0, 1.0, 1.05), DVec3::new(0.0, 0.2, -1.0)],
        [DVec3::new(0.0, 1.0, 1.0), DVec3::new(0.0, 0.2, -1.0)],
        60.0,
    )?;
    Ok(World {
        scene: scene.build()?,
        camera,
    })
}

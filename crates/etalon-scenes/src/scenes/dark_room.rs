//! A nearly black room with tiny, very bright lamps.
//!
//! For bloom, exposure and everything that averages: six orders of magnitude
//! between neighbouring pixels, lamps of about a pixel, and radiance close
//! to the largest half float.

use glam::DVec3;

use super::{World, WorldError, moving_camera};
use crate::trace::{Ambient, Light, Material, SceneBuilder, Shape};

pub(super) fn build() -> Result<World, WorldError> {
    let mut scene = SceneBuilder::new();
    scene.ambient(Ambient {
        above: DVec3::splat(2e-4),
        below: DVec3::splat(2e-4),
    });
    // A room is the inside of a box.
    scene.object(
        Shape::aligned_box(DVec3::new(0.0, 2.0, 0.0), DVec3::new(5.0, 2.0, 6.0)),
        Material::matte(DVec3::new(0.05, 0.045, 0.04)),
    );
    scene.object(
        Shape::Disc {
            center: DVec3::new(0.0, 0.001, -1.0),
            normal: DVec3::Y,
            radius: 2.4,
        },
        Material {
            roughness: 0.08.into(),
            ..Material::plastic(DVec3::splat(0.02), 0.08)
        },
    );
    let (table, leg) = (DVec3::new(0.10, 0.06, 0.03), 0.04);
    scene.object(
        Shape::aligned_box(DVec3::new(0.0, 0.78, -1.0), DVec3::new(1.2, 0.03, 0.6)),
        Material::plastic(table, 0.3),
    );
    for (x, z) in [(-1.1, -1.5), (1.1, -1.5), (-1.1, -0.5), (1.1, -0.5)] {
        scene.object(
            Shape::aligned_box(DVec3::new(x, 0.375, z), DVec3::new(leg, 0.375, leg)),
            Material::plastic(table, 0.5),
        );
    }
    scene.object(
        Shape::Sphere {
            center: DVec3::new(0.55, 0.99, -1.05),
            radius: 0.18,
        },
        Material::plastic(DVec3::new(0.3, 0.02, 0.02), 0.1),
    );
    // Shaded lamps: they look far brighter than the light they give. All but
    // the last two are larger than a pixel of a picture 180 pixels high.
    for (position, radius, radiance, intensity) in [
        (
            [-0.5, 1.10, -1.0],
            0.030,
            DVec3::new(60_000.0, 52_000.0, 40_000.0),
            6.0,
        ),
        (
            [-2.4, 2.3, -4.6],
            0.040,
            DVec3::new(9_000.0, 14_000.0, 30_000.0),
            12.0,
        ),
        (
            [2.7, 1.5, -5.0],
            0.045,
            DVec3::new(2_400.0, 600.0, 90.0),
            4.0,
        ),
        ([3.4, 3.2, -2.0], 0.050, DVec3::new(12.0, 90.0, 24.0), 0.3),
        ([-3.6, 0.7, -2.5], 0.060, DVec3::new(6.0, 0.4, 9.0), 0.2),
        (
            [0.9, 0.86, -0.7],
            0.006,
            DVec3::new(0.0, 0.0, 60_000.0),
            0.6,
        ),
        ([1.6, 2.9, -5.8], 0.010, DVec3::new(60_000.0, 0.0, 0.0), 1.5),
    ] {
        let center = DVec3::from_array(position);
        scene.object(Shape::Sphere { center, radius }, Material::light(radiance));
        let intensity = radiance * (intensity / radiance.max_element());
        scene.light(Light::Point {
            position: center,
            intensity,
            body: radius * 1.001,
        });
    }
    let camera = moving_camera(
        [DVec3::new(-0.4, 1.6, 4.2), DVec3::new(0.0, 1.25, -2.0)],
        [DVec3::new(-0.3, 1.6, 4.2), DVec3::new(0.0, 1.25, -2.0)],
        55.0,
    )?;
    Ok(World {
        scene: scene.build()?,
        camera,
    })
}

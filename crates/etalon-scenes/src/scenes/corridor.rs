//! A long corridor seen from just above its polished floor.
//!
//! For reflections at grazing angles: rays that run along the surface for a
//! long way, depth that changes little from step to step, thin pillars, and a
//! Fresnel term near 1.

use glam::DVec3;

use super::{World, WorldError, moving_camera};
use crate::trace::{Ambient, Material, Pattern, Property, SceneBuilder, Shape};

const LENGTH: f64 = 64.0;
const HALF_WIDTH: f64 = 2.2;
const HEIGHT: f64 = 3.0;

pub(super) fn build() -> Result<World, WorldError> {
    let mut scene = SceneBuilder::new();
    scene.ambient(Ambient {
        above: DVec3::splat(0.05),
        below: DVec3::new(0.06, 0.055, 0.05),
    });
    let middle = -0.5 * LENGTH + 4.0;
    let floor = Pattern::Checker {
        origin: DVec3::ZERO,
        u: DVec3::X * 1.1,
        v: DVec3::Z * 1.1,
    };
    scene.object(
        Shape::Rectangle {
            center: DVec3::new(0.0, 0.0, middle),
            half_u: DVec3::X * HALF_WIDTH,
            half_v: DVec3::Z * (0.5 * LENGTH),
        },
        Material {
            base: Property::Varying {
                low: DVec3::splat(0.05),
                high: DVec3::new(0.20, 0.18, 0.16),
                pattern: floor,
            },
            specular: DVec3::splat(0.30).into(),
            roughness: 0.06.into(),
            emission: DVec3::ZERO,
        },
    );
    scene.object(
        Shape::Rectangle {
            center: DVec3::new(0.0, HEIGHT, middle),
            half_u: DVec3::X * HALF_WIDTH,
            half_v: DVec3::Z * (0.5 * LENGTH),
        },
        Material::matte(DVec3::splat(0.5)),
    );
    for side in [-1.0, 1.0] {
        let colour = if side < 0.0 {
            DVec3::new(0.18, 0.30, 0.34)
        } else {
            DVec3::new(0.42, 0.26, 0.17)
        };
        scene.object(
            Shape::Rectangle {
                center: DVec3::new(side * HALF_WIDTH, 0.5 * HEIGHT, middle),
                half_u: DVec3::Z * (0.5 * LENGTH),
                half_v: DVec3::Y * (0.5 * HEIGHT),
            },
            Material {
                base: Property::Varying {
                    low: colour,
                    high: colour * 0.55,
                    pattern: Pattern::Stripes {
                        origin: DVec3::ZERO,
                        across: DVec3::Y * 0.5,
                    },
                },
                ..Material::matte(DVec3::ZERO)
            },
        );
    }
    let end = middle - 0.5 * LENGTH;
    scene.object(
        Shape::Rectangle {
            center: DVec3::new(0.0, 0.5 * HEIGHT, end),
            half_u: DVec3::X * HALF_WIDTH,
            half_v: DVec3::Y * (0.5 * HEIGHT),
        },
        Material {
            emission: DVec3::new(0.9, 0.75, 0.5),
            ..Material::matte(DVec3::new(0.7, 0.6, 0.4))
        },
    );
    for i in 0..12 {
        let z = 0.5 - 5.0 * f64::from(i);
        for side in [-1.0, 1.0] {
            scene.object(
                Shape::aligned_box(
                    DVec3::new(side * (HALF_WIDTH - 0.22), 0.5 * HEIGHT, z),
                    DVec3::new(0.12, 0.5 * HEIGHT, 0.12),
                ),
                Material::plastic(DVec3::splat(0.55), 0.4),
            );
        }
        // Lamps on alternating sides, so that the floor shows which is whose.
        let side = if i % 2 == 0 { -1.0 } else { 1.0 };
        let colour = if i % 3 == 0 {
            DVec3::new(1.0, 0.45, 0.25)
        } else {
            DVec3::new(0.75, 0.85, 1.0)
        };
        scene.lamp(
            DVec3::new(side * 0.9, HEIGHT - 0.35, z - 2.5),
            0.12,
            colour * 110.0,
        );
    }
    for (x, z, radius, colour) in [
        (0.35, -2.2, 0.30, DVec3::new(0.75, 0.12, 0.10)),
        (-0.75, -4.6, 0.45, DVec3::new(0.12, 0.55, 0.22)),
        (0.95, -9.0, 0.55, DVec3::new(0.15, 0.25, 0.70)),
        (-0.4, -17.0, 0.60, DVec3::new(0.80, 0.65, 0.10)),
    ] {
        scene.object(
            Shape::Sphere {
                center: DVec3::new(x, radius, z),
                radius,
            },
            Material::plastic(colour, 0.25),
        );
    }
    let camera = moving_camera(
        [DVec3::new(0.1, 0.28, 3.6), DVec3::new(0.0, 0.50, -20.0)],
        [DVec3::new(0.1, 0.28, 3.4), DVec3::new(0.0, 0.50, -20.0)],
        50.0,
    )?;
    Ok(World {
        scene: scene.build()?,
        camera,
    })
}

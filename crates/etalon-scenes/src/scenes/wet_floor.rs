//! A courtyard at night after rain.
//!
//! For reflections: many objects in contact with the reflecting floor, thin and
//! bright things to be reflected, occlusion in front of occlusion, a floor whose
//! roughness goes from mirror to matte, and reflections that leave the picture.

use glam::DVec3;

use super::{World, WorldError, moving_camera};
use crate::trace::{Ambient, Light, Material, Mesh, Pattern, Property, SceneBuilder, Shape, Sky};

const CYAN: DVec3 = DVec3::new(0.10, 0.85, 1.0);
const MAGENTA: DVec3 = DVec3::new(1.0, 0.12, 0.55);
const AMBER: DVec3 = DVec3::new(1.0, 0.55, 0.16);

pub(super) fn build() -> Result<World, WorldError> {
    let mut scene = SceneBuilder::new();
    scene.sky(Sky {
        horizon: DVec3::new(0.035, 0.040, 0.085),
        zenith: DVec3::new(0.002, 0.004, 0.016),
    });
    scene.ambient(Ambient {
        above: DVec3::new(0.034, 0.042, 0.080),
        below: DVec3::new(0.016, 0.014, 0.014),
    });
    // The moon, from behind the camera's left shoulder.
    scene.light(Light::Directional {
        towards: DVec3::new(-0.55, 0.75, 0.62),
        irradiance: DVec3::new(0.34, 0.44, 0.72),
    });
    // A street lamp out of the picture, to the right of the camera.
    scene.light(Light::Point {
        position: DVec3::new(4.6, 5.2, 5.6),
        intensity: DVec3::new(1.0, 0.80, 0.58) * 62.0,
        body: 0.0,
    });
    ground(&mut scene);
    walls(&mut scene);
    solids(&mut scene);
    neon(&mut scene);
    let camera = moving_camera(
        [DVec3::new(-0.56, 1.46, 7.62), DVec3::new(0.02, 0.86, -1.0)],
        [DVec3::new(-0.50, 1.45, 7.50), DVec3::new(0.05, 0.85, -1.0)],
        46.0,
    )?;
    Ok(World {
        scene: scene.build()?,
        camera,
    })
}

/// Flagstones, dark and wet in patches.
fn ground(scene: &mut SceneBuilder) {
    let puddles = Pattern::Patches {
        u: DVec3::new(2.2, 0.0, 0.9),
        v: DVec3::new(-0.8, 0.0, 1.7),
        low: 0.44,
        high: 0.52,
        seed: 9,
    };
    let stones = Pattern::Grid {
        origin: DVec3::new(0.3, 0.0, 0.2),
        u: DVec3::X * 1.1,
        v: DVec3::Z * 1.1,
        line: 0.022,
    };
    scene.object(
        Shape::Plane {
            point: DVec3::ZERO,
            normal: DVec3::Y,
        },
        Material {
            base: Property::Varying {
                low: DVec3::new(0.075, 0.078, 0.088),
                high: DVec3::splat(0.016),
                pattern: stones,
            },
            specular: Property::Varying {
                low: DVec3::splat(0.05),
                high: DVec3::splat(0.42),
                pattern: puddles,
            },
            roughness: Property::Varying {
                low: 0.62,
                high: 0.02,
                pattern: puddles,
            },
            emission: DVec3::ZERO,
        },
    );
}

fn walls(scene: &mut SceneBuilder) {
    let courses = Pattern::Grid {
        origin: DVec3::new(0.0, 0.0, -5.0),
        u: DVec3::X * 0.9,
        v: DVec3::Y * 0.45,
        line: 0.045,
    };
    scene.object(
        Shape::aligned_box(DVec3::new(0.0, 2.1, -5.25), DVec3::new(12.0, 2.1, 0.25)),
        Material {
            base: Property::Varying {
                low: DVec3::new(0.33, 0.24, 0.20),
                high: DVec3::new(0.12, 0.10, 0.10),
                pattern: courses,
            },
            ..Material::matte(DVec3::ZERO)
        },
    );
    // A capping of lighter stone.
    scene.object(
        Shape::aligned_box(DVec3::new(0.0, 4.27, -5.2), DVec3::new(12.0, 0.07, 0.38)),
        Material::matte(DVec3::splat(0.42)),
    );
    // A side wall with slanted stripes, turned towards the camera.
    scene.object(
        Shape::turned_box(
            DVec3::new(-5.6, 1.25, -1.6),
            DVec3::new(0.15, 1.25, 2.9),
            -0.18,
        ),
        Material {
            base: Property::Varying {
                low: DVec3::new(0.30, 0.33, 0.36),
                high: DVec3::new(0.07, 0.12, 0.20),
                pattern: Pattern::Stripes {
                    origin: DVec3::ZERO,
                    across: DVec3::new(0.0, 0.22, 0.22),
                },
            },
            ..Material::matte(DVec3::ZERO)
        },
    );
    // Columns on the other side, one behind the other.
    for i in 0..3 {
        let z = 0.4 - 2.1 * f64::from(i);
        let x = 4.55 + 0.12 * f64::from(i);
        let stone = Material::plastic(DVec3::new(0.40, 0.38, 0.36), 0.5);
        scene.object(
            Shape::aligned_box(DVec3::new(x, 1.55, z), DVec3::new(0.26, 1.55, 0.26)),
            stone,
        );
        scene.object(
            Shape::aligned_box(DVec3::new(x, 0.09, z), DVec3::new(0.38, 0.09, 0.38)),
            stone,
        );
        scene.object(
            Shape::aligned_box(DVec3::new(x, 3.18, z), DVec3::new(0.38, 0.08, 0.38)),
            stone,
        );
    }
}

/// Boxes, balls, a gem and a knot, on the ground and on one another.
fn solids(scene: &mut SceneBuilder) {
    let plastic = |r, g, b, roughness| Material::plastic(DVec3::new(r, g, b), roughness);
    let ball = |x, z, radius| Shape::Sphere {
        center: DVec3::new(x, radius, z),
        radius,
    };
    let block = |x, z, half: [f64; 3], angle| {
        let half = DVec3::from_array(half);
        Shape::turned_box(DVec3::new(x, half.y, z), half, angle)
    };
    scene.object(
        block(-2.45, -1.15, [0.72, 0.95, 0.72], 0.42),
        plastic(0.72, 0.09, 0.05, 0.35),
    );
    scene.object(ball(-1.02, 0.55, 0.52), plastic(0.95, 0.62, 0.08, 0.25));
    scene.object(
        block(0.42, -2.35, [0.60, 1.55, 0.60], -0.30),
        plastic(0.08, 0.28, 0.62, 0.4),
    );
    scene.object(ball(1.28, -0.30, 0.68), plastic(0.85, 0.86, 0.88, 0.18));
    scene.object(
        block(2.62, 1.20, [0.42, 0.42, 0.42], 0.65),
        plastic(0.06, 0.52, 0.28, 0.35),
    );
    scene.object(ball(-2.95, 1.75, 0.34), plastic(0.10, 0.45, 0.75, 0.2));
    scene.object(ball(0.12, 2.35, 0.24), plastic(0.85, 0.16, 0.12, 0.2));
    // One on top of the green block.
    scene.object(
        Shape::Sphere {
            center: DVec3::new(2.62, 0.84 + 0.21, 1.20),
            radius: 0.21,
        },
        plastic(0.90, 0.80, 0.12, 0.2),
    );
    // A low plinth with the knot on it.
    scene.object(
        block(2.75, -2.45, [0.85, 0.16, 0.85], 0.2),
        plastic(0.36, 0.34, 0.33, 0.5),
    );
    scene.object(
        Shape::Mesh(Mesh::knot(
            DVec3::new(2.75, 1.36, -2.45),
            0.62,
            0.17,
            384,
            32,
        )),
        Material {
            base: DVec3::new(0.48, 0.26, 0.07).into(),
            ..Material::metal(DVec3::new(0.90, 0.62, 0.28), 0.28)
        },
    );
    // A gem afloat over the tall block, so that its reflection is far from it.
    scene.object(
        Shape::Mesh(Mesh::icosahedron(DVec3::new(-2.45, 2.46, -1.15), 0.50)),
        Material {
            base: DVec3::new(0.22, 0.62, 0.52).into(),
            ..plastic(0.0, 0.0, 0.0, 0.15)
        },
    );
    // Sticks: thin things that coarse depth tests miss.
    for i in 0..5 {
        let x = -0.55 + 0.16 * f64::from(i);
        let half = DVec3::new(0.022, 0.36 + 0.07 * f64::from(i), 0.022);
        scene.object(
            Shape::turned_box(DVec3::new(x, half.y, 1.42 - 0.12 * f64::from(i)), half, 0.3),
            plastic(0.75, 0.75, 0.78, 0.4),
        );
    }
}

/// Glowing tubes on the walls, each with the lights that it stands for.
fn neon(scene: &mut SceneBuilder) {
    let mut tube = |center: DVec3,
                    half: DVec3,
                    colour: DVec3,
                    radiance: f64,
                    lights: i32,
                    out: DVec3,
                    power: f64| {
        scene.object(
            Shape::aligned_box(center, half),
            Material::light(colour * radiance),
        );
        for i in 0..lights {
            let along = (f64::from(i) + 0.5) / f64::from(lights) * 2.0 - 1.0;
            let longest = half.max_position();
            let mut position = center + out;
            position[longest] += along * half[longest];
            scene.light(Light::Point {
                position,
                intensity: colour * (power / f64::from(lights)),
                body: 0.0,
            });
        }
    };
    let out = DVec3::new(0.0, 0.0, 0.45);
    tube(
        DVec3::new(-2.1, 3.62, -4.94),
        DVec3::new(2.6, 0.04, 0.04),
        CYAN,
        7.0,
        4,
        out,
        15.0,
    );
    tube(
        DVec3::new(-2.1, 3.30, -4.94),
        DVec3::new(2.6, 0.04, 0.04),
        MAGENTA,
        7.0,
        4,
        out,
        13.0,
    );
    for i in 0..3 {
        let x = 1.75 + 0.45 * f64::from(i);
        let half = DVec3::new(0.04, 1.05 - 0.22 * f64::from(i), 0.04);
        tube(DVec3::new(x, 2.65, -4.94), half, AMBER, 8.0, 1, out, 5.0);
    }
    // A lantern in front of the columns, and one behind the tall block.
    scene.lamp(DVec3::new(3.72, 1.05, 1.9), 0.09, AMBER * 130.0);
    scene.lamp(DVec3::new(-4.4, 0.55, -3.4), 0.11, CYAN * 70.0);
}

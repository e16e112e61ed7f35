//! The hard cases of marching: rays with no place on the screen, rays past the
//! eye, surfaces that must not meet themselves, and inputs that are no numbers.

use crate::common;

use common::{PLAIN_SSR as PLAIN, Run, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::ssr::{Ssr, march};
use etalon_effects::{CameraParams, DepthRange};
use glam::{Vec2, Vec3};

fn marched(
    depth: &ImageData,
    normal: &ImageData,
    camera: &CameraParams,
    settings: &Ssr,
) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    let (depth, normal) = (run.import("depth", depth), run.import("normal", normal));
    let result = march(&mut run.graph, depth, normal, camera, settings).expect("valid settings");
    texels(&run.output(result))
}

/// A wall at twice `unit` in the left half of the picture, and in the right
/// half, at four times `unit`, a mirror whose normal leans left by `angle`:
/// its rays come back toward the eye and enter the wall from behind.
fn mirror_behind_a_wall(
    side: u32,
    unit: f32,
    near: f32,
    normal: [f32; 4],
) -> (ImageData, ImageData) {
    let left = |x: u32| x < side / 2;
    let depth = image(Format::R32Float, side, side, |x, _| {
        [
            near / (unit * if left(x) { 2.0 } else { 4.0 }),
            0.0,
            0.0,
            0.0,
        ]
    });
    let normals = image(Format::Rgba32Float, side, side, |x, _| {
        if left(x) {
            [0.0, 0.0, 1.0, 1.0]
        } else {
            normal
        }
    });
    (depth, normals)
}

#[test]
fn a_plane_does_not_reflect_itself() {
    // A floor seen at every slope down to grazing, with nothing on it, whatever
    // the thickness: its mirror rays meet nothing.
    let (width, height) = (120, 80);
    let camera = CameraParams::perspective(1.2, 1.5, 0.1);
    for tilt in [0.0, 0.3, -0.7] {
        let up = Vec3::new(tilt, 1.0, 0.1 * tilt).normalize();
        let plane = |x: u32, y: u32| {
            let u = (x as f32 + 0.5) / width as f32 * 2.0 - 1.0;
            let v = 1.0 - (y as f32 + 0.5) / height as f32 * 2.0;
            let ray = Vec3::new(u / camera.scale.x, v / camera.scale.y, -1.0);
            // up · (ray t) = -0.4
            let t = -0.4 / up.dot(ray);
            if t > 0.1 && t < 1e4 { t } else { 0.0 }
        };
        let depth = image(Format::R32Float, width, height, |x, y| {
            let distance = plane(x, y);
            [
                if distance > 0.0 {
                    camera.near / distance
                } else {
                    0.0
                },
                0.0,
                0.0,
                0.0,
            ]
        });
        for format in [Format::Rgba16Float, Format::Rgba32Float] {
            let normal = image(format, width, height, |_, _| [up.x, up.y, up.z, 1.0]);
            for thickness in [0.01, 1.0, 1e6] {
                let settings = Ssr {
                    thickness,
                    max_distance: 1000.0,
                    ..PLAIN
                };
                let hits = marched(&depth, &normal, &camera, &settings)
                    .iter()
                    .filter(|texel| texel[2] > 0.0)
                    .count();
                assert_eq!(hits, 0, "tilt {tilt}, {format}, thickness {thickness}");
            }
        }
    }
}

#[test]
fn rays_toward_the_eye_fade() {
    // A mirror faced head on throws its rays straight back at the eye: the far
    // half of the picture mirrors the near half, a wall behind the mirror's
    // plane that the rays run into.
    let (width, height) = (32, 32);
    let camera = CameraParams::perspective(1.0, 1.0, 0.1);
    // Left: a wall at 2. Right: a mirror at 4 turned by 40° toward the wall.
    let left = |x: u32| x < width / 2;
    let depth = image(Format::R32Float, width, height, |x, _| {
        [0.1 / if left(x) { 2.0 } else { 4.0 }, 0.0, 0.0, 0.0]
    });
    let angle = 0.7_f32;
    let normal = image(Format::Rgba32Float, width, height, |x, _| {
        if left(x) {
            [0.0, 0.0, 1.0, 1.0]
        } else {
            [-angle.sin(), 0.0, angle.cos(), 1.0]
        }
    });
    let settings = Ssr {
        thickness: 10.0,
        ..PLAIN
    };
    let sum = |settings: &Ssr| {
        marched(&depth, &normal, &camera, settings)
            .iter()
            .map(|texel| texel[2])
            .sum::<f32>()
    };
    let (plain, faded) = (
        sum(&settings),
        sum(&Ssr {
            camera_fade: 1.0,
            ..settings
        }),
    );
    assert!(plain > 10.0, "{plain}");
    assert!(faded < 0.9 * plain, "{faded} of {plain}");
}

#[test]
fn rays_without_a_direction_on_screen_are_misses() {
    // One texel: no other to be met. Odd sizes: the middle texel's ray goes
    // straight back or straight away, and those beside it along one axis only.
    let camera = CameraParams::perspective(1.0, 1.0, 0.1);
    for side in [1_u32, 3, 9] {
        let depth = image(Format::R32Float, side, side, |_, _| [0.02, 0.0, 0.0, 0.0]);
        for normal in [
            [0.0, 0.0, 1.0, 1.0],  // facing the eye: rays turn back
            [0.0, 0.0, -1.0, 1.0], // facing away
            [1.0, 0.0, 0.0, 1.0],  // edge-on
            [0.0, 1e-20, 0.0, 1.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1e-3, 1.0], // not a unit vector, but a direction
            [0.0, 0.0, 1e30, 1.0], // too long to be squared
            [f32::NAN, 0.0, 1.0, 1.0],
            [0.0, f32::INFINITY, 0.0, 1.0],
        ] {
            let normals = image(Format::Rgba32Float, side, side, |_, _| normal);
            for texel in marched(&depth, &normals, &camera, &PLAIN) {
                assert!(
                    texel.iter().all(|channel| channel.is_finite()),
                    "{normal:?}: {texel:?}"
                );
                // A flat mirror parallel to the picture shows nothing but itself.
                assert_eq!(texel, [0.0; 4], "{normal:?}");
            }
        }
    }
}

#[test]
fn any_bit_pattern_gives_finite_reflections() {
    let (width, height) = (64, 48);
    let bits = |seed: u32| move |x: u32, y: u32| common::hash(x ^ (y << 10) ^ (seed << 24));
    for seed in 0..4 {
        // Depths of every magnitude, and bit patterns of every kind.
        let depth = image(Format::R32Float, width, height, |x, y| {
            let random = bits(seed)(x, y);
            let value = if random.is_multiple_of(3) {
                f32::from_bits(random)
            } else {
                (random % 1000) as f32 / 1000.0
            };
            [value, 0.0, 0.0, 0.0]
        });
        let normal = image(Format::Rgba32Float, width, height, |x, y| {
            let channel = |c: u32| {
                let random = bits(seed + 7 * c)(x, y);
                if random.is_multiple_of(5) {
                    f32::from_bits(random)
                } else {
                    random as f32 / u32::MAX as f32 * 2.0 - 1.0
                }
            };
            [channel(1), channel(2), channel(3), 1.0]
        });
        for camera in [
            CameraParams::perspective(1.0, 1.33, 0.1),
            CameraParams {
                centre: Vec2::new(4.0, -4.0),
                ..CameraParams::perspective(3.0, 50.0, 1e-6)
            },
            CameraParams {
                scale: Vec2::new(1e6, 1e-3),
                ..CameraParams::perspective(1.0, 1.0, 1e6)
            },
            CameraParams {
                depth: DepthRange::Standard { far: 100.0 },
                ..CameraParams::perspective(1.0, 1.0, 0.1)
            },
            CameraParams {
                depth: DepthRange::Reversed { far: 100.0 },
                ..CameraParams::perspective(1.0, 1.0, 0.1)
            },
        ] {
            for settings in [
                Ssr::default(),
                Ssr {
                    max_distance: 1e6,
                    thickness: 1e6,
                    resolution: 0.01,
                    ..PLAIN
                },
                Ssr {
                    max_distance: 1e-3,
                    thickness: 1e-6,
                    steps: 24,
                    ..PLAIN
                },
            ] {
                for [u, v, visibility, length] in marched(&depth, &normal, &camera, &settings) {
                    let uv = (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v);
                    assert!(
                        uv && (0.0..=1.0).contains(&visibility),
                        "{u} {v} {visibility}"
                    );
                    assert!(length.is_finite() && length >= 0.0, "{length}");
                }
            }
        }
    }
}

#[test]
fn rays_past_the_eye_are_cut_before_they_are_projected() {
    let side = 64;
    let angle = 0.6_f64;
    let normal = glam::DVec3::new(-angle.sin(), 0.0, angle.cos());
    let lean = [normal.x as f32, 0.0, normal.z as f32, 1.0];
    // The second is a scene so large that f32 has no place for its near plane.
    for (unit, near) in [(1.0_f32, 0.1_f32), (1e5, 1e-6)] {
        let camera = CameraParams::perspective(1.0, 1.0, near);
        let thickness = 0.1 * unit;
        let settings = Ssr {
            thickness,
            max_distance: (50.0 * unit).min(1e6),
            steps: 16,
            ..PLAIN
        };
        let (depth, normals) = mirror_behind_a_wall(side, unit, near, lean);
        let found = marched(&depth, &normals, &camera, &settings);
        let scale = f64::from(camera.scale.x);
        let mut checked = 0;
        for y in 0..side {
            for x in side / 2..side {
                let ndc = |i: u32| f64::from(2 * i + 1) / f64::from(side) - 1.0;
                let start =
                    glam::DVec3::new(ndc(x) / scale, -ndc(y) / scale, -1.0) * 4.0 * f64::from(unit);
                let view = start.normalize();
                let ray = view - normal * (2.0 * view.dot(normal));
                assert!(ray.z > 0.0);
                // Behind the wall all the way, until within its thickness.
                let t = (2.0 * f64::from(unit) + f64::from(thickness) + start.z) / -ray.z;
                let hit = start + ray * t;
                let u = 0.5 + 0.5 * scale * hit.x / -hit.z;
                let v = 0.5 - 0.5 * scale * hit.y / -hit.z;
                let inside = |x: f64| (0.03..0.97).contains(&x);
                // Where that point is not before the wall, or at its edge, the
                // answer is another one.
                if !(u < 0.47 && inside(u) && inside(v)) {
                    continue;
                }
                checked += 1;
                let texel = found[(y * side + x) as usize];
                let error = (f64::from(texel[0]) - u)
                    .abs()
                    .max((f64::from(texel[1]) - v).abs());
                assert!(texel[2] == 1.0, "{unit}: ({x}, {y}) misses ({u}, {v})");
                assert!(
                    error * f64::from(side) <= 1.0,
                    "{unit}: ({x}, {y}): {texel:?} for ({u}, {v})"
                );
            }
        }
        assert!(checked > 100, "{checked}");
    }
}

#[test]
fn surfaces_seen_from_behind_mirror_nothing() {
    let lean = [-(0.6_f32.sin()), 0.0, 0.6_f32.cos(), 1.0];
    let camera = CameraParams::perspective(1.0, 1.0, 0.1);
    let settings = Ssr {
        thickness: 3.0,
        ..PLAIN
    };
    let hits = |normal: [f32; 4]| {
        let (depth, normals) = mirror_behind_a_wall(32, 1.0, 0.1, normal);
        marched(&depth, &normals, &camera, &settings)
            .iter()
            .filter(|texel| texel[2] > 0.0)
            .count()
    };
    assert!(hits(lean) > 100);
    // The same plane with its normal turned over, and with none.
    assert_eq!(hits([-lean[0], 0.0, -lean[2], 1.0]), 0);
    assert_eq!(hits([0.0; 4]), 0);
}

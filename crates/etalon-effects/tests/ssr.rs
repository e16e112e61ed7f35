//! Screen-space reflection against the closed form of a mirror below a wall,
//! and its hard cases.

mod common;

use common::{Run, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::ssr::{Blend, Ssr, blur, march, mix, resolve};
use etalon_effects::{CameraParams, DepthRange};
use etalon_scenes::trace::MirrorRay;
use etalon_scenes::{Frame, FrameSize, World, scene};
use glam::{Vec2, Vec3};

/// No fade: visibility is 1 where there is a hit.
const PLAIN: Ssr = Ssr {
    max_distance: 50.0,
    resolution: 1.0,
    steps: 8,
    thickness: 0.25,
    march_limit: 4096,
    camera_fade: 0.0,
    depth_fade: 0.0,
    distance_fade: 0.0,
    border: 0.0,
    blur_radius: 0,
    blend: Blend::Add,
};

fn camera_of(frame: &Frame) -> CameraParams {
    CameraParams {
        scale: frame.camera.projection.scale().as_vec2(),
        centre: Vec2::ZERO,
        near: frame.camera.projection.near() as f32,
        depth: DepthRange::ReversedInfinite,
    }
}

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

fn mirror_world() -> World {
    (scene("mirror-planes").expect("registered").build)().expect("a valid scene")
}

/// How the reflections found compare with the true ones.
#[derive(Debug, Default)]
struct Score {
    /// Pixels whose true reflection is in the picture, and those of them found.
    visible: usize,
    found: usize,
    /// Reflections found where there is none to be seen.
    invented: usize,
    /// Largest and mean error of place in pixels, and of length in view units.
    worst: f64,
    mean: f64,
    length: f64,
}

fn score(size: FrameSize, settings: &Ssr) -> Score {
    let world = mirror_world();
    let frame = world.frame(size).expect("small");
    let truth = world.reflection(size).expect("small");
    let found = marched(&frame.depth, &frame.normal, &camera_of(&frame), settings);
    let pixels = glam::DVec2::new(size.width().into(), size.height().into());
    let mut score = Score::default();
    for (ray, texel) in truth.rays.iter().zip(&found) {
        let hit = texel[2] > 0.0;
        match ray {
            MirrorRay::Hit(true_hit) if true_hit.visible => {
                score.visible += 1;
                if hit {
                    score.found += 1;
                    let uv = true_hit.uv.expect("visible");
                    let error = ((glam::DVec2::new(texel[0].into(), texel[1].into()) - uv)
                        * pixels)
                        .abs()
                        .max_element();
                    score.worst = score.worst.max(error);
                    score.mean += error;
                    let length = (true_hit.position - true_hit.from).length();
                    score.length = score.length.max((f64::from(texel[3]) - length).abs());
                }
            }
            MirrorRay::Hit(_) | MirrorRay::Miss { .. } => score.invented += usize::from(hit),
            // The wall is no mirror, which the march does not know.
            MirrorRay::None => {}
        }
    }
    score.mean /= score.found.max(1) as f64;
    score
}

#[test]
fn reflections_are_where_mirrors_put_them() {
    for (width, height) in [(160, 90), (97, 61)] {
        let size = FrameSize::new(width, height).expect("small");
        let score = score(size, &PLAIN);
        println!("{width}×{height}: {score:?}");
        assert!(score.visible > 1000, "{score:?}");
        // Every one is found, but for those so near the edge of the picture that
        // the normal's rounding moves them out of it.
        assert!(
            score.found as f64 >= 0.998 * score.visible as f64,
            "{score:?}"
        );
        // The wall's distance is one number for all of it, so what is left is the
        // normal's f16 rounding, up to 2^-11 of an angle and doubled by mirroring:
        // 0.001 of a picture 2 / scale wide, well under a pixel; and the last
        // bracket, 2^-8 of a step.
        assert!(score.worst <= 1.0, "{score:?}");
        assert!(score.mean <= 0.25, "{score:?}");
        // What is not in the picture is not found, with the same exception.
        assert!(
            score.invented as f64 <= 0.002 * score.visible as f64,
            "{score:?}"
        );
    }
}

#[test]
fn refinement_halves_the_error_of_coarse_steps() {
    let size = FrameSize::new(160, 90).expect("small");
    let coarse = Ssr {
        resolution: 0.25,
        thickness: 1.0,
        ..PLAIN
    };
    let mut previous = f64::INFINITY;
    for steps in [0, 2, 4, 6] {
        let score = score(size, &Ssr { steps, ..coarse });
        // Without refinement hits lie up to a step of four texels too far.
        assert!(
            score.worst <= 4.0 / f64::from(1 << steps) + 1.0,
            "{steps}: {score:?}"
        );
        assert!(score.mean < previous, "{steps}: {score:?}");
        previous = score.mean;
    }
}

#[test]
fn a_spent_budget_is_a_miss() {
    let size = FrameSize::new(64, 36).expect("small");
    let all = score(size, &PLAIN);
    let none = score(
        size,
        &Ssr {
            march_limit: 1,
            ..PLAIN
        },
    );
    let some = score(
        size,
        &Ssr {
            march_limit: 12,
            ..PLAIN
        },
    );
    assert!(
        none.found < some.found && some.found < all.found,
        "{none:?} {some:?} {all:?}"
    );
    // What the budget allows is as right as before.
    assert!(
        some.worst <= 1.0 && some.invented <= all.invented,
        "{some:?}"
    );
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
fn every_fade_takes_away_and_stays_in_range() {
    let world = mirror_world();
    let frame = world
        .frame(FrameSize::new(96, 54).expect("small"))
        .expect("small");
    let camera = camera_of(&frame);
    let run = |settings: &Ssr| marched(&frame.depth, &frame.normal, &camera, settings);
    let plain = run(&PLAIN);
    assert!(plain.iter().all(|texel| texel[2] == 0.0 || texel[2] == 1.0));
    type Fade = (&'static str, fn(f32) -> Ssr);
    let fades: [Fade; 4] = [
        ("camera", |s| Ssr {
            camera_fade: s,
            ..PLAIN
        }),
        ("depth", |s| Ssr {
            depth_fade: s,
            ..PLAIN
        }),
        ("distance", |s| Ssr {
            distance_fade: s,
            max_distance: 12.0,
            ..PLAIN
        }),
        ("border", |s| Ssr {
            border: 0.5 * s,
            ..PLAIN
        }),
    ];
    for (name, settings) in fades {
        let none = run(&settings(0.0));
        let half = run(&settings(0.5));
        let full = run(&settings(1.0));
        let mut taken = 0.0;
        for ((none, half), full) in none.iter().zip(&half).zip(&full) {
            for texel in [none, half, full] {
                assert!((0.0..=1.0).contains(&texel[2]), "{name}: {texel:?}");
            }
            // A stronger fade never shows more. (A hit that faded to 0 still
            // has its place.)
            assert!(
                full[2] <= half[2] && half[2] <= none[2],
                "{name}: {none:?} {half:?} {full:?}"
            );
            assert_eq!(none[..2], half[..2]);
            taken += none[2] - full[2];
        }
        if name != "camera" {
            assert!(taken > 1.0, "{name} takes nothing away");
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
fn depth_conventions_agree() {
    let world = mirror_world();
    let frame = world
        .frame(FrameSize::new(96, 54).expect("small"))
        .expect("small");
    let reference = camera_of(&frame);
    let expected = marched(&frame.depth, &frame.normal, &reference, &PLAIN);
    let found = expected.iter().filter(|texel| texel[2] > 0.0).count();
    assert!(found > 500);
    let far = 200.0;
    for depth in [
        DepthRange::Reversed { far },
        DepthRange::Standard { far },
        DepthRange::StandardInfinite,
    ] {
        let camera = CameraParams { depth, ..reference };
        let [bias, slope] = camera.depth_bias_slope().to_array();
        let size = frame.depth.desc.extent;
        let depths = texels(&frame.depth);
        let converted = image(Format::R32Float, size.width, size.height, |x, y| {
            let reversed = depths[(y * size.width + x) as usize][0];
            let cleared = match depth {
                DepthRange::Reversed { .. } => 0.0,
                _ => 1.0,
            };
            // depth = near / distance
            let value = if reversed > 0.0 {
                bias + slope * reversed / reference.near
            } else {
                cleared
            };
            [value, 0.0, 0.0, 0.0]
        });
        let got = marched(&converted, &frame.normal, &camera, &PLAIN);
        // Standard depth at 6 of 0.1 … 200 has 2^-24 / (0.1 / 36) = 2e-5 of
        // resolution; hits move by far less than a pixel, and none appear or
        // vanish but those within that of an edge.
        let agree = |a: &[f32; 4], b: &[f32; 4]| {
            (a[2] > 0.0) == (b[2] > 0.0) && (0..2).all(|c| (a[c] - b[c]).abs() < 2e-3)
        };
        let differ = expected
            .iter()
            .zip(&got)
            .filter(|(a, b)| !agree(a, b))
            .count();
        assert!(differ * 50 <= found, "{depth:?}: {differ} of {found}");
    }
}

#[test]
fn one_march_serves_several_colours() {
    // The reflection buffer is looked up bilinearly and weighted by visibility.
    let reflection = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [0.25, 0.5, 1.0, 1.0], // centre of texel 0 of 2
        1 => [0.5, 0.5, 1.0, 1.0],  // halfway between the two
        2 => [0.75, 0.5, 0.5, 1.0], // centre of texel 1, half visible
        _ => [0.75, 0.5, 0.0, 1.0], // not visible
    });
    let first = image(Format::Rgba16Float, 2, 1, |x, _| {
        if x == 0 {
            [1.0, 2.0, 4.0, 1.0]
        } else {
            [3.0, 0.0, 8.0, 1.0]
        }
    });
    let second = image(Format::Rgba16Float, 2, 1, |x, _| {
        if x == 0 {
            [f32::NAN, -1.0, f32::INFINITY, 1.0]
        } else {
            [0.5; 4]
        }
    });
    let resolved = |colour: &ImageData| {
        let mut run = Run::new();
        let (reflection, colour) = (
            run.import("reflection", &reflection),
            run.import("colour", colour),
        );
        let result = resolve(&mut run.graph, reflection, colour).expect("valid handles");
        texels(&run.output(result))
    };
    assert_eq!(
        resolved(&first),
        [
            [1.0, 2.0, 4.0, 1.0],
            [2.0, 1.0, 6.0, 1.0],
            [1.5, 0.0, 4.0, 0.5],
            [0.0; 4]
        ]
    );
    // A texel that is no number is none of its neighbours' business.
    let second = resolved(&second);
    assert_eq!(second[0], [0.0, 0.0, 65_504.0, 1.0]);
    assert_eq!(second[2], [0.25, 0.25, 0.25, 0.5]);
}

#[test]
fn the_blur_is_a_box() {
    let (width, height) = (23_usize, 11_usize);
    let value = |x: usize, y: usize| (common::hash((x + 31 * y) as u32) % 256) as f32;
    let source = image(Format::Rgba16Float, width as u32, height as u32, |x, y| {
        [value(x as usize, y as usize), 1.0, 0.0, 0.5]
    });
    for radius in [0_i64, 1, 3, 30] {
        let mut run = Run::new();
        let handle = run.import("source", &source);
        let result = blur(&mut run.graph, handle, radius as u32).expect("a valid radius");
        let result = texels(&run.output(result));
        let n = (2 * radius + 1) as f64;
        for y in 0..height as i64 {
            for x in 0..width as i64 {
                let mut sum = 0.0;
                for dy in -radius..=radius {
                    for dx in -radius..=radius {
                        let (x, y) = (
                            (x + dx).clamp(0, width as i64 - 1),
                            (y + dy).clamp(0, height as i64 - 1),
                        );
                        sum += f64::from(value(x as usize, y as usize));
                    }
                }
                let exact = sum / (n * n);
                let texel = result[y as usize * width + x as usize];
                // Rounded to f16 after each axis, 2^-11 each.
                assert!(
                    (f64::from(texel[0]) - exact).abs() <= exact * 0.000_98 + 1e-6,
                    "{radius}: {texel:?} for {exact}"
                );
                assert_eq!(texel[1..], [1.0, 0.0, 0.5]);
            }
        }
    }
    let mut run = Run::new();
    let handle = run.import("source", &source);
    assert!(blur(&mut run.graph, handle, 65).is_err());
}

#[test]
fn the_specular_map_says_how_much_and_how_sharp() {
    let scene = image(Format::Rgba16Float, 4, 1, |_, _| [1.0, 1.0, 1.0, 0.25]);
    let specular = image(Format::Rgba8Unorm, 4, 1, |x, _| match x {
        0 => [0.0, 0.0, 0.0, 1.0],
        1 => [1.0, 1.0, 1.0, 1.0],
        2 => [1.0, 0.2, 0.0, 0.0],
        _ => [1.0, 1.0, 1.0, 0.6],
    });
    let sharp = image(Format::Rgba16Float, 4, 1, |_, _| [4.0, 4.0, 4.0, 0.5]);
    let blurred = image(Format::Rgba16Float, 4, 1, |_, _| [2.0, 2.0, 2.0, 0.25]);
    let mixed = |with_blur: bool, blend: Blend| {
        let mut run = Run::new();
        let handles = [
            ("scene", &scene),
            ("specular", &specular),
            ("sharp", &sharp),
            ("blurred", &blurred),
        ]
        .map(|(name, image)| run.import(name, image));
        let blurred = with_blur.then_some(handles[3]);
        let result = mix(
            &mut run.graph,
            handles[0],
            handles[1],
            handles[2],
            blurred,
            blend,
        )
        .expect("equal sizes");
        texels(&run.output(result))
    };
    let close = |got: &[f32; 4], expected: [f32; 4]| {
        // One rounding to f16.
        let near = got
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() <= b * 0.000_5);
        assert!(near, "{got:?} for {expected:?}");
    };
    let added = mixed(true, Blend::Add);
    close(&added[0], [1.0, 1.0, 1.0, 0.25]);
    close(&added[1], [5.0, 5.0, 5.0, 0.25]);
    close(&added[2], [3.0, 1.4, 1.0, 0.25]);
    // Shininess 0.6: 0.6 · 4 + 0.4 · 2 = 3.2.
    close(&added[3], [4.2, 4.2, 4.2, 0.25]);
    let replaced = mixed(true, Blend::Replace);
    close(&replaced[0], [1.0, 1.0, 1.0, 0.25]);
    close(&replaced[1], [4.5, 4.5, 4.5, 0.25]);
    // Visibility 0.25: 1 - 0.25 + 2, and 1 - 0.2 · 0.25 + 0.2 · 2.
    close(&replaced[2], [2.75, 1.35, 1.0, 0.25]);
    // Without a blurred reflection every surface is sharp.
    close(&mixed(false, Blend::Add)[2], [5.0, 1.8, 1.0, 0.25]);
}

#[test]
fn a_specular_map_of_any_kind_is_read_alike() {
    let scene = image(Format::Rgba16Float, 4, 1, |_, _| [1.0; 4]);
    let sharp = image(Format::Rgba16Float, 4, 1, |_, _| [4.1, 0.3, 700.0, 0.5]);
    let blurred = image(Format::Rgba16Float, 4, 1, |_, _| [2.3, 0.7, 90.0, 0.25]);
    let mixed = |specular: &ImageData| {
        let mut run = Run::new();
        let handles = [
            ("scene", &scene),
            ("specular", specular),
            ("sharp", &sharp),
            ("blurred", &blurred),
        ]
        .map(|(name, image)| run.import(name, image));
        let result = mix(
            &mut run.graph,
            handles[0],
            handles[1],
            handles[2],
            Some(handles[3]),
            Blend::Add,
        );
        texels(&run.output(result.expect("equal sizes")))
    };
    // What is no share of anything counts as the nearest that is.
    let odd = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [f32::NAN, -1.0, f32::INFINITY, 1.0],
        1 => [0.5, 0.5, 0.5, f32::NAN],
        2 => [0.5, 0.5, 0.5, 7.0],
        _ => [f32::NEG_INFINITY; 4],
    });
    let meant = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [0.0, 0.0, 1.0, 1.0],
        1 => [0.5, 0.5, 0.5, 0.0],
        2 => [0.5, 0.5, 0.5, 1.0],
        _ => [0.0; 4],
    });
    assert_eq!(mixed(&odd), mixed(&meant));
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

#[test]
fn eight_bit_shares_give_the_same_bits_however_they_are_decoded() {
    // Every code against every f16 mantissa: some products lie so near a
    // boundary of f16 that the last bit of the share decides.
    let (width, height) = (1024, 255);
    let black = image(Format::Rgba16Float, width, height, |_, _| [0.0; 4]);
    let sharp = image(Format::Rgba16Float, width, height, |x, _| {
        let value = 1.0 + x as f32 / 1024.0;
        [value, value, value, 1.0]
    });
    let mixed = |specular: &ImageData| {
        let mut run = Run::new();
        let handles = [("scene", &black), ("specular", specular), ("sharp", &sharp)]
            .map(|(name, image)| run.import(name, image));
        let result = mix(
            &mut run.graph,
            handles[0],
            handles[1],
            handles[2],
            None,
            Blend::Add,
        );
        texels(&run.output(result.expect("equal sizes")))
    };
    let exact = image(Format::Rgba8Unorm, width, height, |_, y| {
        [(y + 1) as f32 / 255.0; 4]
    });
    let off = image(Format::Rgba32Float, width, height, |_, y| {
        let share = (y + 1) as f32 / 255.0;
        [share.next_down(), share, share.next_up().min(1.0), 1.0]
    });
    let (exact, off) = (mixed(&exact), mixed(&off));
    assert!(exact.iter().zip(&off).all(|(a, b)| a[..3] == b[..3]));
}

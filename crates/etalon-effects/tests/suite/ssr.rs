//! Screen-space reflection against the closed form of a mirror below a wall.

use crate::common;

use common::{PLAIN_SSR as PLAIN, Run, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::ssr::{Ssr, march};
use etalon_effects::{CameraParams, DepthRange};
use etalon_scenes::trace::MirrorRay;
use etalon_scenes::{Frame, FrameSize, World, scene};
use glam::Vec2;

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

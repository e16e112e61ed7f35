//! The kernels of screen-space reflection against its truth, on frames of scenes.

use crate::common;

use common::{Run, texels};
use etalon_effects::ssr::truth::{ScreenData, TrueHit, hits, picture};
use etalon_effects::ssr::{Blend, HitStorage, Search, Ssr, march, ssr};
use etalon_effects::truth::Plane;
use etalon_effects::{CameraParams, DepthRange, EffectError};
use etalon_scenes::{Frame, FrameSize, scene};
use glam::{DVec2, Vec2};

/// Without fades, so that visibility is 1 where there is a hit.
fn plain() -> Ssr {
    Ssr {
        max_distance: 50.0,
        camera_fade: 0.0,
        depth_fade: 0.0,
        distance_fade: 0.0,
        border: 0.0,
        blur_radius: 0,
        ..Ssr::default()
    }
}

fn frame(name: &str, width: u32, height: u32) -> Frame {
    let world = (scene(name).expect("registered").build)().expect("a valid scene");
    let size = FrameSize::new(width, height).expect("small");
    world.frame(size).expect("small")
}

fn camera_of(frame: &Frame) -> CameraParams {
    CameraParams {
        scale: frame.camera.projection.scale().as_vec2(),
        centre: Vec2::ZERO,
        near: frame.camera.projection.near() as f32,
        depth: DepthRange::ReversedInfinite,
    }
}

fn screen(frame: &Frame) -> ScreenData {
    let plane = |image| Plane::of(image).expect("small");
    ScreenData {
        colour: plane(&frame.colour),
        depth: plane(&frame.depth),
        normal: plane(&frame.normal),
        specular: plane(&frame.specular),
    }
}

fn marched(frame: &Frame, settings: &Ssr) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    let (depth, normal) = (
        run.import("depth", &frame.depth),
        run.import("normal", &frame.normal),
    );
    let camera = camera_of(frame);
    let result = march(&mut run.graph, depth, normal, &camera, settings).expect("valid settings");
    texels(&run.output(result))
}

/// How the kernel's hits compare with the true ones.
#[derive(Debug)]
struct Agreement {
    /// Of all texels, the share on which both find a hit or none.
    both: f64,
    /// True hits, and those of them found.
    true_hits: usize,
    found: usize,
    /// Distance of places in texels: median, 99th percentile, largest.
    place: [f64; 3],
    /// Share of hits found that are within a twentieth of a texel.
    close: f64,
}

fn agreement(truth: &[Option<TrueHit>], kernel: &[[f32; 4]], size: [u32; 2]) -> Agreement {
    let extent = DVec2::new(size[0].into(), size[1].into());
    let mut errors = Vec::new();
    let mut both = 0;
    for (hit, texel) in truth.iter().zip(kernel) {
        let found = texel[2] > 0.0;
        both += usize::from(found == hit.is_some());
        if let (Some(hit), true) = (hit, found) {
            let place = DVec2::new(texel[0].into(), texel[1].into());
            errors.push(((place - hit.uv) * extent).length());
        }
    }
    errors.sort_by(f64::total_cmp);
    let quantile = |share: f64| errors[((errors.len() - 1) as f64 * share) as usize];
    Agreement {
        both: both as f64 / truth.len() as f64,
        true_hits: truth.iter().flatten().count(),
        found: errors.len(),
        place: [quantile(0.5), quantile(0.99), quantile(1.0)],
        close: errors.iter().filter(|error| **error <= 0.05).count() as f64 / errors.len() as f64,
    }
}

#[test]
fn the_kernel_converges_to_it() {
    // With every texel along the longer axis looked at and 24 halvings, what is
    // left is f32, and cells that a ray passes between two looks.
    let size = [160, 90];
    for name in ["mirror-planes", "wet-floor", "corridor-grazing"] {
        let frame = frame(name, size[0], size[1]);
        let settings = Ssr {
            steps: 24,
            march_limit: 23_171,
            ..plain()
        };
        let screen = screen(&frame);
        let truth = hits(&screen.depth, &screen.normal, &camera_of(&frame), &settings);
        let truth = truth.expect("valid");
        let agreement = agreement(&truth, &marched(&frame, &settings), size);
        println!("{name}: {agreement:?}");
        assert!(agreement.true_hits > 1000, "{name}: {agreement:?}");
        // Halved 24 times and stored in f32, a place is within some 2^-24 of the
        // picture's width where both find the same crossing, which is the rule.
        assert!(agreement.place[0] < 1e-4, "{name}: {agreement:?}");
        // The kernel looks at each cell once, about its middle. A ray toward the
        // eye can be behind a cell's surface where it enters the cell and before
        // it again in the middle, and a thin thing can be passed at its corner:
        // the first of those hits are found later or not at all, at outlines and
        // on surfaces that are steps of one texel.
        let share = agreement.found as f64 / agreement.true_hits as f64;
        assert!(share > 0.95, "{name}: {agreement:?}");
        assert!(agreement.close > 0.9, "{name}: {agreement:?}");
        let alike = if name == "mirror-planes" { 0.99 } else { 0.95 };
        assert!(agreement.both > alike, "{name}: {agreement:?}");
    }
}

#[test]
fn settings_of_accuracy_do_not_enter() {
    let frame = frame("wet-floor", 96, 54);
    let screen = screen(&frame);
    let camera = camera_of(&frame);
    let of =
        |settings: &Ssr| hits(&screen.depth, &screen.normal, &camera, settings).expect("valid");
    let crude = Ssr {
        resolution: 0.0,
        search: Search::Linear,
        steps: 0,
        march_limit: 1,
        storage: HitStorage::Half,
        ..Ssr::default()
    };
    assert_eq!(of(&Ssr::default()), of(&crude));
}

#[test]
fn the_picture_is_the_effect_rounded() {
    // Storage in f16 rounds four times on the way, 2^-11 each, relative to the
    // light but for the darkest. Where the hits are the same, that is all.
    for (name, blend) in [("mirror-planes", Blend::Add), ("wet-floor", Blend::Replace)] {
        let frame = frame(name, 160, 90);
        let settings = Ssr {
            steps: 24,
            blend,
            ..Ssr::default()
        };
        let truth = picture(&screen(&frame), &camera_of(&frame), &settings).expect("valid");
        let mut run = Run::new();
        let inputs = run.import_frame(&frame);
        let result = ssr(&mut run.graph, &inputs, &settings).expect("valid");
        let mut errors: Vec<f64> = truth
            .texels()
            .iter()
            .zip(texels(&run.output(result)))
            .map(|(truth, kernel)| {
                let relative =
                    |c: usize| (truth[c] - f64::from(kernel[c])).abs() / (truth[c] + 0.01);
                (0..4).map(relative).fold(0.0, f64::max)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| errors[((errors.len() - 1) as f64 * share) as usize];
        let quantiles = [0.5, 0.9, 0.99, 1.0].map(quantile);
        println!("{name}: {quantiles:?}");
        // In the one scene all hits that show are the same; in the other most.
        let share = if name == "mirror-planes" { 3 } else { 0 };
        assert!(quantiles[share] <= 4.0 / 2048.0, "{name}: {quantiles:?}");
        assert!(quantiles[1] <= 0.05, "{name}: {quantiles:?}");
    }
}

#[test]
fn mixing_is_as_documented_on_a_screen_of_one_colour() {
    // Whatever is hit has the same colour, so the closed form needs only the
    // visibilities, and their mean over the blur.
    let frame = frame("mirror-planes", 64, 36);
    let mut data = screen(&frame);
    let one = |texel| Plane::from_fn(64, 36, |_, _| texel).expect("small");
    data.colour = one([2.0, f64::NAN, 1e9, 0.5]);
    data.specular = one([0.5, 1.0, 0.25, 0.75]);
    let camera = camera_of(&frame);
    for blend in [Blend::Add, Blend::Replace] {
        let settings = Ssr {
            blur_radius: 3,
            blend,
            ..Ssr::default()
        };
        let found = hits(&data.depth, &data.normal, &camera, &settings).expect("valid");
        let visibility = |x: i64, y: i64| {
            let (x, y) = (x.clamp(0, 63) as usize, y.clamp(0, 35) as usize);
            found[y * 64 + x].map_or(0.0, |hit| hit.visibility)
        };
        let result = picture(&data, &camera, &settings).expect("valid");
        for y in 0..36 {
            for x in 0..64 {
                let around = (-3..=3).flat_map(|dy| (-3..=3).map(move |dx| (x + dx, y + dy)));
                let soft = around.map(|(x, y)| visibility(x, y)).sum::<f64>() / 49.0;
                let seen = 0.75 * visibility(x, y) + 0.25 * soft;
                for (c, (light, amount)) in [(2.0, 0.5), (0.0, 1.0), (65_504.0, 0.25)]
                    .into_iter()
                    .enumerate()
                {
                    let kept = match blend {
                        Blend::Add => 1.0,
                        Blend::Replace => 1.0 - amount * seen,
                    };
                    let expected = light * (kept + amount * seen);
                    let got = result.at(x, y)[c];
                    assert!(
                        (got - expected).abs() <= 1e-10 * (1.0 + light),
                        "{got} {expected}"
                    );
                }
                assert_eq!(result.at(x, y)[3], 0.5);
            }
        }
    }
    let small = Plane::from_fn(64, 35, |_, _| [0.0; 4]).expect("small");
    let odd = ScreenData {
        specular: small,
        ..data
    };
    assert!(matches!(
        picture(&odd, &camera, &Ssr::default()),
        Err(EffectError::SizeMismatch {
            second: "specular",
            ..
        })
    ));
}

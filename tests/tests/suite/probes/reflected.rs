//! Screen-space reflection that shows probes and the world where the screen has no answer.

use etalon::backend::Backend;
use etalon::effects::Beyond;
use etalon::effects::ssr::{Blend, Ssr, march, ssr};
use etalon::effects::tiles::Tiling;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon_tests::{difference, executors, non_finite};
use glam::{DVec3, Vec3};

use super::room::{Bench, Light, With, colour, planted, uniform};

/// In place of what it covers.
fn settings() -> Ssr {
    Ssr {
        blend: Blend::Replace,
        ..Ssr::default()
    }
}

/// Rays so short that the screen has hardly any answer.
fn blind() -> Ssr {
    Ssr {
        max_distance: 1e-3,
        thickness: 1e-6,
        blur_radius: 0,
        ..settings()
    }
}

/// Where rays find nothing.
fn unanswered(bench: &Bench, settings: &Ssr) -> ImageData {
    let with = With {
        kernels: &etalon::effects::kernels(),
        arithmetic: Arithmetic::Strict,
    };
    let mut interpreter = etalon_tests::cpu().unwrap();
    bench.run(interpreter.as_mut(), &with, |graph, _| {
        let inputs = bench.frame.import(graph, 1.0 / 60.0)?;
        march(graph, inputs.depth, inputs.normal, &inputs.camera, settings)
    })
}

fn picture(
    bench: &Bench,
    executor: &mut dyn Backend,
    (kernels, arithmetic): (&KernelLibrary, Arithmetic),
    settings: &Ssr,
) -> ImageData {
    let with = With {
        kernels,
        arithmetic,
    };
    bench.run(executor, &with, |graph, surroundings| {
        let mut inputs = bench.frame.import(graph, 1.0 / 60.0)?;
        inputs.beyond = Some(Beyond {
            surroundings,
            view: bench.view.view,
        });
        ssr(graph, &inputs, settings)
    })
}

/// How many pixels are held to the definition, and by how much the worst is off in units
/// of what is allowed.
///
/// Of light linear in the direction a map of 64 keeps all but what bends within a texel
/// of h = 2 / 62. On an octahedron's face directions bend by up to 18 in each axis, over 8
/// between texels and over 24 in their mean: 0.006. Across its edges they have a kink: the
/// slope jumps by up to 2 √2, of which h / 4 is lost between texels and h / 8 in their
/// mean: 0.034. And two roundings to f16, of the map and of the picture.
fn apart(bench: &Bench, image: &ImageData) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0_f64);
    let found = unanswered(bench, &blind());
    let slopes = bench.lights.iter().chain([&bench.world]);
    let slope = slopes.fold(DVec3::ZERO, |most, light| {
        let size = light.slope.transpose();
        most.max(DVec3::new(
            size.x_axis.length(),
            size.y_axis.length(),
            size.z_axis.length(),
        ))
    });
    for (x, y) in bench.pixels() {
        let Some((point, way)) = bench.mirrored(x, y) else {
            continue;
        };
        if colour(&found, x, y).z > 0.0 {
            continue;
        }
        let want = bench.light(point, way);
        let allowed = slope * 0.04 + want * (1.0 / 1024.0);
        let off = (colour(image, x, y) - want).abs() / allowed;
        if off.max_element() > worst.max(1.0) {
            println!("{x}, {y}: {} in place of {want}", colour(image, x, y));
        }
        worst = worst.max(off.max_element());
        count += 1;
    }
    (count, worst)
}

#[test]
fn without_the_screen_it_is_what_rooms_and_the_world_show() {
    let bench = Bench::coloured(|_, _| [1.0; 4]);
    let kernels = etalon::effects::kernels();
    let mut first: Option<ImageData> = None;
    for executor in &mut executors() {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let image = picture(&bench, executor.as_mut(), (&kernels, arithmetic), &blind());
            let (count, worst) = apart(&bench, &image);
            let who = format!("{} {arithmetic:?}: {count}, {worst}", executor.info());
            println!("{who}");
            assert!(count > 2000 && worst <= 1.0, "{who}");
            if arithmetic == Arithmetic::Strict {
                let first = first.get_or_insert_with(|| image.clone());
                assert_eq!(difference(first, &image), None, "{who}");
            }
        }
    }
    // The comparison must be able to fail: without parallax, with a probe's share doubled,
    // and with the world's directions left in view space.
    for (path, part, by) in [
        (
            "lib/probes",
            "let seen = box_projected(place, turned, probe_list[row + 3u].xyz, vec3<f32>(x.w, y.w, z.w));",
            "let seen = turned;",
        ),
        ("lib/around", "rest -= share;", "rest -= 0.9 * share;"),
        ("lib/around", "turned(world.to_world, way)", "way"),
    ] {
        let kernels = planted(path, part, by);
        let mut interpreter = etalon_tests::cpu().unwrap();
        let strict = (&kernels, Arithmetic::Strict);
        let image = picture(&bench, interpreter.as_mut(), strict, &blind());
        let (_, worst) = apart(&bench, &image);
        assert!(worst > 2.0, "{path}: {worst}");
    }
}

/// Mirrors of all kinds: none, smooth, rough, dim.
fn mixed(x: u32, y: u32) -> [f32; 4] {
    match (x / 5 + 3 * (y / 4)) % 5 {
        0 => [0.0; 4],
        1 => [1.0, 1.0, 1.0, 1.0],
        2 => [0.5, 1.0, 0.25, 0.25],
        3 => [1.0, 1.0, 1.0, 0.6],
        _ => [0.04, 0.04, 0.04, 0.0],
    }
}

/// The same light on every surface, in every room and from the world.
fn of_one_light(light: Vec3) -> Bench {
    let world = Light::uniform(light.as_dvec3());
    let mut bench = Bench::new(mixed, uniform(light), world);
    let texel = light.extend(1.0).to_array();
    let desc = bench.frame.colour.desc;
    let texels = vec![texel; (desc.extent.width * desc.extent.height) as usize];
    bench.frame.colour = ImageData::from_rgba_f32(desc, &texels).unwrap();
    bench
}

/// By how much the worst pixel differs from the light, in units of f16's step at it.
fn seam(image: &ImageData, bench: &Bench, light: Vec3) -> f64 {
    let off = |(x, y)| {
        ((colour(image, x, y) / light.as_dvec3() - 1.0) * 1024.0)
            .abs()
            .max_element()
    };
    bench.pixels().map(off).fold(0.0, f64::max)
}

/// Of one light everywhere nothing shows where the screen ends. Light times visibility and
/// visibility are rounded apart: once by the look-up and twice by the blur, each by half a
/// step; and the picture once.
#[test]
fn where_the_screen_ends_is_not_seen() {
    let kernels = etalon::effects::kernels();
    for light in [Vec3::ONE, Vec3::new(0.7, 3.1, 117.0)] {
        // As an f16 has it.
        let light = Vec3::from(light.to_array().map(half));
        let bench = of_one_light(light);
        for quarter_from in [Ssr::NO_QUARTER, 0.5, 0.0] {
            let asked = Ssr {
                quarter_from,
                ..settings()
            };
            for executor in &mut executors() {
                let strict = (&kernels, Arithmetic::Strict);
                let image = picture(&bench, executor.as_mut(), strict, &asked);
                let worst = seam(&image, &bench, light);
                let who = format!("{light}, {quarter_from} on {}: {worst}", executor.info());
                println!("{who}");
                assert!(worst <= 3.5, "{who}");
            }
        }
        // There is a seam: texels on which the screen has a part of the answer.
        let found = unanswered(&bench, &settings());
        let part = |(x, y): &(u32, u32)| (0.05..0.95).contains(&colour(&found, *x, *y).z);
        let seams = bench.pixels().filter(part).count();
        assert!(seams > 100, "{seams}");
        // A tenth of the screen's answer counted twice.
        let mut interpreter = etalon_tests::cpu().unwrap();
        let planted = planted(
            "lib/reflected",
            "limited01(1.0 - reflection.w)",
            "limited01(1.0 - 0.9 * reflection.w)",
        );
        let strict = (&planted, Arithmetic::Strict);
        let image = picture(&bench, interpreter.as_mut(), strict, &settings());
        assert!(seam(&image, &bench, light) > 20.0);
    }
}

/// The nearest number that an f16 holds.
fn half(x: f32) -> f32 {
    let bits = x.to_bits();
    f32::from_bits((bits + 0x1000) & !0x1fff)
}

#[test]
fn tiles_and_rates_show_the_same() {
    let kernels = etalon::effects::kernels();
    let bench = Bench::coloured(|x, y| match (x * 7 + y * 13) % 29 {
        0 => [1.0, 0.7, 0.2, 1.0],
        1 => [0.6, 0.8, 1.0, 0.25],
        _ => [0.0; 4],
    });
    for executor in &mut executors() {
        for (quarter_from, blend) in [
            (Ssr::NO_QUARTER, Blend::Replace),
            (Ssr::NO_QUARTER, Blend::Add),
            (0.5, Blend::Replace),
            (0.0, Blend::Add),
        ] {
            let asked = |tiles| Ssr {
                quarter_from,
                blend,
                tiles,
                ..settings()
            };
            for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
                let mut of = |tiles| {
                    picture(
                        &bench,
                        executor.as_mut(),
                        (&kernels, arithmetic),
                        &asked(tiles),
                    )
                };
                let whole = of(Tiling::Off);
                assert_eq!(non_finite(&whole), 0);
                for tiles in [Tiling::Texels8, Tiling::Texels32] {
                    let found = difference(&whole, &of(tiles));
                    assert_eq!(found, None, "{quarter_from}, {blend:?}, {tiles:?}");
                }
            }
        }
    }
}

/// What has no room in it and no light is as without anything beyond the screen, and no
/// pass is more.
#[test]
fn nothing_beyond_adds_nothing() {
    use etalon::effects::lighting::Surroundings;
    use etalon::graph::Graph;
    use etalon::plan::Capture;
    use etalon_tests::plan_for;

    let bench = Bench::coloured(mixed);
    let mut interpreter = etalon_tests::cpu().unwrap();
    let mut run = |beyond: Option<Beyond>| {
        let mut graph = Graph::new();
        let mut inputs = bench.frame.import(&mut graph, 1.0 / 60.0).unwrap();
        inputs.beyond = beyond;
        let asked = Ssr {
            blend: Blend::Add,
            ..settings()
        };
        let result = ssr(&mut graph, &inputs, &asked).unwrap();
        graph.output("result", result).unwrap();
        let (kernels, strict) = (etalon::effects::kernels(), Arithmetic::Strict);
        let plan = plan_for(
            interpreter.as_mut(),
            &graph,
            &kernels,
            strict,
            Capture::Outputs,
        )
        .unwrap();
        let execution = interpreter.execute(&plan, &bench.frame.inputs()).unwrap();
        (
            execution.output("result").unwrap().clone(),
            plan.steps.len(),
        )
    };
    let (without, passes) = run(None);
    let (dark, as_many) = run(Some(Beyond {
        surroundings: Surroundings::default(),
        view: bench.view.view,
    }));
    assert_eq!(difference(&without, &dark), None);
    assert_eq!(passes, as_many);
}

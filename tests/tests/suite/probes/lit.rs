//! Surfaces lit by probes: from a G-buffer, and as they are drawn.

use etalon::backend::Backend;
use etalon::effects::EffectError;
use etalon::effects::environment::Mirrored;
use etalon::effects::forward::{Lighting, forward};
use etalon::effects::geometry::{GBuffer, Geometry, View, gbuffer};
use etalon::effects::lighting::{Surroundings, lighting};
use etalon::effects::probes::{Probe, Room, truth};
use etalon::graph::{Graph, Texture};
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::model::{Drawable, view};
use etalon_scenes::{FrameSize, models};
use etalon_tests::{difference, executors, plan_for};
use glam::{DQuat, DVec3, Vec3};

use super::room::{Bench, Light, With, colour, planted};

/// Numbers that f16 has, so that maps hold them exactly.
const LIGHTS: [DVec3; 4] = [
    DVec3::new(0.5, 2.0, 1.0),
    DVec3::new(4.0, 0.25, 1.0),
    DVec3::new(0.125, 1.5, 8.0),
    DVec3::new(1.0, 1.0, 0.5),
];

fn bench(lights: [DVec3; 4]) -> Bench {
    let [a, b, c, world] = lights.map(Light::uniform);
    // Mirrors, plastics and what is rough.
    let mask = |x: u32, y: u32| match (x / 3 + y / 5) % 3 {
        0 => [1.0, 1.0, 1.0, 0.9],
        1 => [0.04, 0.04, 0.04, 0.5],
        _ => [0.5, 0.25, 0.75, 0.0],
    };
    Bench::new(mask, [a, b, c], world)
}

fn lit(
    bench: &Bench,
    executor: &mut dyn Backend,
    kernels: &KernelLibrary,
    mirrored: Mirrored,
) -> ImageData {
    let with = With {
        kernels,
        arithmetic: Arithmetic::Strict,
    };
    bench.run(executor, &with, |graph, surroundings| {
        let inputs = bench.frame.import(graph, 1.0 / 60.0)?;
        let surfaces = GBuffer {
            colour: inputs.colour,
            normal: inputs.normal,
            specular: inputs.specular,
            // Taken off again, what surfaces give.
            emission: inputs.colour,
            depth: inputs.depth,
        };
        let around = Surroundings {
            mirrored,
            ..surroundings
        };
        lighting(graph, &bench.view, &surfaces, &[], &around)
    })
}

/// A surface shows light in proportion to it, so light over that of 1 from everywhere is
/// the blend of the rooms' lights. Both are rounded to f16 with what surfaces give beside,
/// and a probe's nine factors are sums over 62 × 62 texels, see
/// `environment/irradiance`: a thousandth.
fn apart(bench: &Bench, image: &ImageData, ones: &ImageData) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0_f64);
    for (x, y) in bench.pixels() {
        let Some((point, _)) = bench.mirrored(x, y) else {
            continue;
        };
        let own = colour(&bench.frame.colour, x, y);
        let (shares, rest) = truth::shares(&bench.probes, point);
        let lit = bench.probes.iter().zip(shares);
        let blend: DVec3 = lit
            .map(|(probe, share)| bench.lights[probe.layer as usize].middle * share)
            .sum();
        let blend = blend + bench.world.middle * rest;
        let of_one = colour(ones, x, y) - own;
        let want = of_one * blend;
        let allowed = want * 2e-3 + (want + own + (of_one + own) * blend) / 1024.0;
        let off = (colour(image, x, y) - own - want).abs() / allowed.max(DVec3::splat(1e-9));
        worst = worst.max(off.max_element());
        count += 1;
    }
    (count, worst)
}

#[test]
fn a_g_buffer_is_lit_by_the_blend_of_rooms() {
    let kernels = etalon::effects::kernels();
    let (many, one) = (bench(LIGHTS), bench([DVec3::ONE; 4]));
    for mirrored in [Mirrored::Lit, Mirrored::Reflected] {
        let mut first: Option<ImageData> = None;
        for executor in &mut executors() {
            let image = lit(&many, executor.as_mut(), &kernels, mirrored);
            let ones = lit(&one, executor.as_mut(), &kernels, mirrored);
            let (count, worst) = apart(&many, &image, &ones);
            let who = format!("{mirrored:?} on {}: {count}, {worst}", executor.info());
            println!("{who}");
            assert!(count > 2000 && worst <= 1.0, "{who}");
            let first = first.get_or_insert_with(|| image.clone());
            assert_eq!(difference(first, &image), None, "{who}");
        }
    }
    // Probes that count a tenth less for what is scattered.
    let planted = planted(
        "lib/surroundings",
        "light += probe_irradiance_at(probe, n) * share;",
        "light += probe_irradiance_at(probe, n) * (0.9 * share);",
    );
    let mut interpreter = etalon_tests::cpu().unwrap();
    let mut of = |bench, kernels: &_| lit(bench, interpreter.as_mut(), kernels, Mirrored::Lit);
    let (image, ones) = (of(&many, &planted), of(&one, &kernels));
    let (_, worst) = apart(&many, &image, &ones);
    assert!(worst > 4.0, "{worst}");
}

/// What is left to reflections is left out: less light, by what white mirrors of it.
#[test]
fn what_is_reflected_later_is_not_lit() {
    let kernels = etalon::effects::kernels();
    let bench = bench(LIGHTS);
    let mut interpreter = etalon_tests::cpu().unwrap();
    let mut of = |mirrored| lit(&bench, interpreter.as_mut(), &kernels, mirrored);
    let (all, scattered) = (of(Mirrored::Lit), of(Mirrored::Reflected));
    let mut mirrors = 0;
    for (x, y) in bench.pixels() {
        let Some(_) = bench.mirrored(x, y) else {
            continue;
        };
        let own = colour(&bench.frame.colour, x, y);
        let (all, scattered) = (colour(&all, x, y), colour(&scattered, x, y));
        assert!(all.cmpge(scattered).all(), "{x}, {y}: {all}, {scattered}");
        // What mirrors all scatters none.
        let specular = bench.frame.specular.texel(x, y, 0, 0).unwrap().to_f64();
        if specular[0] == 1.0 {
            let off = (scattered - own).abs().max_element();
            assert!(off <= own.max_element() / 1024.0, "{x}, {y}: {scattered}");
            mirrors += 1;
        }
    }
    assert!(mirrors > 500);
}

/// Forward light is that of the light map, to what the G-buffer's formats lose.
#[test]
fn a_model_is_lit_alike_as_it_is_drawn() {
    let kernels = etalon::effects::kernels();
    let model = (models()[0].build)().unwrap();
    let snapshot = model.at(0.5).unwrap();
    let camera = snapshot.cameras[0];
    let size = FrameSize::new(96, 54).unwrap();
    let mut bench = bench(LIGHTS);
    let view = view(&camera, size).unwrap();
    // Rooms before the eye.
    let to_world = view.view.inverse();
    let rooms: Vec<Probe> = [(2.0, 1.5), (5.0, 4.0), (8.0, 12.0)]
        .into_iter()
        .zip(0..)
        .map(|((distance, half), layer)| {
            let centre = to_world.transform_point3(DVec3::new(0.0, 0.0, -distance));
            Probe {
                position: centre,
                room: Room {
                    centre,
                    turn: DQuat::from_rotation_y(f64::from(layer)),
                    half: DVec3::splat(half),
                },
                influence: DVec3::splat(half),
                falloff: (0.5 * half) as f32,
                layer,
            }
        })
        .collect();
    bench.watch(view, rooms);
    let drawable = Drawable::new(&model).unwrap();
    let mut first: Option<[ImageData; 2]> = None;
    for executor in &mut executors() {
        let mut graph = Graph::new();
        let surroundings = Surroundings {
            mirrored: Mirrored::Lit,
            background: Vec3::ZERO,
            ..bench.surroundings(&mut graph).unwrap()
        };
        let imported = drawable.import(&mut graph).unwrap();
        let items = imported.opaque_items(&model, &snapshot);
        let geometry = Geometry {
            items: &items,
            view,
            size: [size.width(), size.height()],
        };
        let [deferred, drawn] = both(&mut graph, &geometry, &view, surroundings).unwrap();
        graph.output("deferred", deferred).unwrap();
        graph.output("drawn", drawn).unwrap();
        let (strict, outputs) = (Arithmetic::Strict, Capture::Outputs);
        let plan = plan_for(executor.as_ref(), &graph, &kernels, strict, outputs).unwrap();
        let inputs = bench.give(drawable.inputs());
        let execution = executor.execute(&plan, &inputs).unwrap();
        let images = ["deferred", "drawn"].map(|name| execution.output(name).unwrap().clone());
        let (mut lit, mut worst) = (0, 0_f64);
        for (x, y) in (0..54).flat_map(|y| (0..96).map(move |x| (x, y))) {
            let [a, b] = [0, 1].map(|k| colour(&images[k], x, y));
            lit += u32::from(a != DVec3::ZERO);
            // A step of a roughness or of what is mirrored in 8 bits is 0.004, of which at
            // grazing angles some per cent of light depend.
            worst = worst.max(((a - b).abs() / (a + b + 1e-3)).max_element());
        }
        println!("{}: {lit} lit, {worst}", executor.info());
        assert!(lit > 1000 && worst < 0.02, "{lit}, {worst}");
        // Normals are interpolated to some ulps, which moves light by steps of f16; on
        // another grid than the interpreter's outlines are elsewhere by a pixel.
        let first = first.get_or_insert_with(|| images.clone());
        for (a, b) in first.iter().zip(&images) {
            let pixels = (0..54).flat_map(|y| (0..96).map(move |x| (x, y)));
            let moved = pixels.map(|(x, y)| {
                let (a, b) = (colour(a, x, y), colour(b, x, y));
                ((a - b).abs() / (a + b + 1e-3)).max_element()
            });
            let moved = moved.filter(|moved| *moved > 2e-3).count();
            assert!(moved < 96 * 54 / 8, "{moved} on {}", executor.info());
        }
    }
}

fn both(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    view: &View,
    surroundings: Surroundings,
) -> Result<[Texture; 2], EffectError> {
    let surfaces = gbuffer(graph, geometry, None)?;
    let deferred = lighting(graph, view, &surfaces, &[], &surroundings)?;
    let lighting = Lighting {
        lamps: None,
        surroundings,
    };
    let shaded = forward(graph, geometry, None, &lighting, false)?;
    Ok([deferred, shaded.light])
}

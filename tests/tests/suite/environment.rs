//! Light from everywhere: its harmonics, its blurred map and the table of what is
//! mirrored are what sums in f64 say, and the same bits on every backend.

use crate::shading;

use std::f64::consts::PI;

use etalon::backend::{Backend, Execution, Inputs};
use etalon::effects::environment::{EnvironmentMap, Irradiance, Prefilter, environment, mirroring};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_tests::{cpu, executors, first_difference, plan_for};
use glam::{DVec2, DVec3};
use shading::{LEAST_ROUGHNESS, blurred, irradiance, mirrored_parts, picture};

/// A sky brighter to one side, and a soft lamp.
fn sky(at: DVec3) -> DVec3 {
    let lamp = at.dot(DVec3::new(0.6, 0.48, -0.64)).max(0.0).powi(24);
    let glow = 0.5 + 0.3 * at.y + 0.15 * at.x;
    DVec3::new(0.4, 0.5, 0.7) * glow + DVec3::new(5.0, 4.0, 3.0) * lamp
}

fn run(
    executor: &mut dyn Backend,
    map: &EnvironmentMap,
    samples: u32,
    kernels: &KernelLibrary,
    capture: Capture,
) -> Execution {
    let mut graph = Graph::new();
    let base = graph.import_texture("base", map.image().desc).unwrap();
    let settings = Prefilter { samples };
    let around = environment(&mut graph, base, map.irradiance(), &settings).unwrap();
    graph.output("radiance", around.radiance).unwrap();
    let table = mirroring(&mut graph).unwrap();
    graph.output("mirroring", table).unwrap();
    let plan = plan_for(executor, &graph, kernels, Arithmetic::Strict, capture).unwrap();
    let inputs = Inputs::new().texture("base", map.image());
    executor.execute(&plan, &inputs).unwrap()
}

/// What the interpreter makes, which is what all make.
fn made(map: &EnvironmentMap, samples: u32) -> Execution {
    let kernels = etalon::effects::kernels();
    let mut interpreter = cpu().unwrap();
    run(
        interpreter.as_mut(),
        map,
        samples,
        &kernels,
        Capture::Outputs,
    )
}

#[test]
fn maps_and_tables_are_bit_equal_on_every_backend() {
    let map = EnvironmentMap::of_equirectangular(&picture(128, &sky), 64).unwrap();
    let (kernels, all) = (etalon::effects::kernels(), Capture::EveryPass);
    let mut executors = executors();
    let first = run(executors[0].as_mut(), &map, 64, &kernels, all);
    for executor in &mut executors[1..] {
        let other = run(executor.as_mut(), &map, 64, &kernels, all);
        let found = first_difference(&first, &other);
        assert_eq!(found, None, "{}", executor.info());
    }
    // The comparison must be able to fail: lobes a little too wide.
    let mut planted = etalon::effects::kernels();
    let kernel = planted.source("environment/prefilter").unwrap().to_string();
    let changed = kernel.replacen("alpha * alpha", "alpha * 0.26", 1);
    assert_ne!(kernel, changed);
    planted.add_source("environment/prefilter", &changed);
    let other = run(executors[0].as_mut(), &map, 64, &planted, all);
    assert!(first_difference(&first, &other).is_some());
}

/// Interpolation of a map's mip, frame included.
fn looked_up(map: &ImageData, mip: u32, at: DVec3) -> DVec3 {
    let height = map.desc.extent.height;
    let side = f64::from(height >> mip);
    let mut p = DVec2::new(at.x, at.z) / at.abs().element_sum();
    if at.y < 0.0 {
        p = DVec2::new(
            (1.0 - p.y.abs()) * 1_f64.copysign(p.x),
            (1.0 - p.x.abs()) * 1_f64.copysign(p.y),
        );
    }
    // All but the largest are right of it, one below the other.
    let corner = match mip {
        0 => DVec2::ZERO,
        _ => DVec2::new(f64::from(height), f64::from(height - (height >> (mip - 1)))),
    };
    interpolated(map, corner + (0.5 * p + 0.5) * (side - 2.0) + 0.5)
}

fn interpolated(map: &ImageData, place: DVec2) -> DVec3 {
    let corner = place.floor().max(DVec2::ZERO);
    let part = place - corner;
    let extent = map.desc.extent;
    let texel = |x: u32, y: u32| {
        let at = |corner: f64, step: u32, size: u32| (corner as u32 + step).min(size - 1);
        let (x, y) = (
            at(corner.x, x, extent.width),
            at(corner.y, y, extent.height),
        );
        let texel = map.texel(x, y, 0, 0);
        let [r, g, b, _] = texel.unwrap().to_f64();
        DVec3::new(r, g, b)
    };
    let upper = texel(0, 0).lerp(texel(1, 0), part.x);
    let lower = texel(0, 1).lerp(texel(1, 1), part.x);
    upper.lerp(lower, part.y)
}

/// Directions spread over all (R. Swinbank and R. J. Purser's spiral).
fn directions(count: u32) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |k| {
        let y = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let turn = f64::from(k) * PI * (3.0 - 5_f64.sqrt());
        let across = (1.0 - y * y).sqrt();
        DVec3::new(across * turn.cos(), y, across * turn.sin())
    })
}

/// Products of two cosines are what nine harmonics hold, and only the picture's
/// texels and the sum are off. Of a lamp they leave out what the fourth band adds,
/// of which irradiance keeps a 24th times π, and less of all higher ones.
#[test]
fn harmonics_give_the_irradiance_of_a_sum_over_the_hemisphere() {
    let squares = |at: DVec3| {
        DVec3::new(
            1.0 + at.x * at.y,
            1.0 + at.z * at.z - 0.5 * at.x,
            1.5 - at.y,
        )
    };
    for (name, radiance, most) in [
        ("squares", &squares as &dyn Fn(DVec3) -> DVec3, 5e-4),
        ("sky", &sky, 0.04),
    ] {
        let light = Irradiance::of_equirectangular(&picture(256, radiance)).unwrap();
        let (mut worst, mut largest) = (0_f64, 0_f64);
        for normal in directions(64) {
            let want = irradiance(normal, 192, radiance);
            largest = largest.max(want.max_element());
            worst = worst.max((light.at(normal) - want).abs().max_element());
        }
        println!("{name}: {worst} of {largest}");
        assert!(worst <= most * largest, "{name}: {worst} of {largest}");
    }
}

#[test]
fn mips_are_blurred_as_roughness_does() {
    let map = EnvironmentMap::of_equirectangular(&picture(512, &sky), 128).unwrap();
    let execution = made(&map, 256);
    let radiance = execution.output("radiance").unwrap();
    let largest = sky(DVec3::new(0.6, 0.48, -0.64)).max_element();
    for mip in 0..4 {
        let roughness = f64::from(mip) / 3.0;
        let mut worst = 0_f64;
        for at in directions(200) {
            let want = match mip {
                0 => sky(at),
                _ => blurred(at, roughness, 160, &sky),
            };
            let got = looked_up(radiance, mip, at);
            worst = worst.max((got - want).abs().max_element());
        }
        println!("mip {mip}: {worst} of {largest}");
        // A texel of the last mip sees 13 degrees, over which a lobe as wide as
        // that of the roughest surface bends by some hundredths.
        assert!(worst <= 0.03 * largest, "mip {mip}: {worst} of {largest}");
    }
}

#[test]
fn uniform_light_stays_as_it_is() {
    let map = EnvironmentMap::of_equirectangular(&picture(64, &|_| DVec3::new(1.0, 0.5, 2.0)), 32);
    let map = map.unwrap();
    let execution = made(&map, 16);
    let radiance = execution.output("radiance").unwrap();
    for (mip, at) in (0..2).flat_map(|mip| directions(50).map(move |at| (mip, at))) {
        // A few roundings of f32, and one to f16 of a number that f16 has.
        let got = looked_up(radiance, mip, at);
        assert_eq!(got, DVec3::new(1.0, 0.5, 2.0), "{at} of mip {mip}");
    }
    for normal in directions(20) {
        let off = map.irradiance().at(normal) / PI - DVec3::new(1.0, 0.5, 2.0);
        assert!(off.length() < 1e-3, "{off}");
    }
}

/// The two numbers of the table at a cosine of view and a roughness, as a kernel
/// looks them up.
fn table_at(table: &ImageData, cosine: f64, roughness: f64) -> [f64; 2] {
    let size = f64::from(table.desc.extent.width);
    let least = LEAST_ROUGHNESS.sqrt();
    let part = DVec2::new(
        1.1 * cosine / (cosine + 0.1),
        (roughness.sqrt() - least) / (1.0 - least),
    );
    let found = interpolated(table, part * (size - 1.0));
    [found.x, found.y]
}

#[test]
fn the_table_is_within_its_error_of_the_integral() {
    let map = EnvironmentMap::of_equirectangular(&picture(64, &sky), 32).unwrap();
    let execution = made(&map, 16);
    let table = execution.output("mirroring").unwrap();
    let mut worst = [0_f64; 2];
    for (i, j) in (0..41).flat_map(|i| (0..37).map(move |j| (i, j))) {
        // From 89.4 degrees to straight above, denser towards the first.
        let part = f64::from(i) / 40.0;
        let cosine = 0.01 + 0.99 * part * part;
        let roughness = LEAST_ROUGHNESS + (1.0 - LEAST_ROUGHNESS) * f64::from(j) / 36.0;
        let [all, fifth] = mirrored_parts(cosine, roughness, 128);
        let got = table_at(table, cosine, roughness);
        for (worst, (got, want)) in worst
            .iter_mut()
            .zip([(got[0], all - fifth), (got[1], fifth)])
        {
            *worst = worst.max((got - want).abs());
        }
    }
    println!("largest errors of the table: {worst:?}");
    // What `mirroring` says of it.
    assert!(worst[0] <= 0.002 && worst[1] <= 0.002, "{worst:?}");
}

/// The sum that the table is held to is right where the integral is known: a smooth
/// surface mirrors all, by Fresnel's term at the angle of view.
#[test]
fn the_integral_is_that_of_a_mirror_where_there_is_no_roughness() {
    for cosine in [0.2_f64, 0.5, 0.9] {
        let [all, fifth] = mirrored_parts(cosine, LEAST_ROUGHNESS, 64);
        assert!((all - 1.0).abs() < 1e-3, "{all}");
        assert!((fifth - (1.0 - cosine).powi(5)).abs() < 1e-3, "{fifth}");
    }
}

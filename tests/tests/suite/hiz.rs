//! Pyramids of distances are what they cover on every backend, bit for bit.

use etalon::Format;
use etalon::backend::{Backend, Inputs};
use etalon::effects::CameraParams;
use etalon::effects::hiz::truth::{Bounds, levels};
use etalon::effects::hiz::{Build, Layout, pyramid};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_tests::{executors, plan_for};

const NEAR: f32 = 0.1;

fn camera() -> CameraParams {
    CameraParams::perspective(1.0, 1.5, NEAR)
}

/// Depths that look random (C. Wellons, `lowbias32`), one in eight of nothing.
fn scattered([width, height]: [u32; 2]) -> ImageData {
    let texels: Vec<[f32; 4]> = (0..width * height)
        .map(|mut x| {
            x ^= x >> 16;
            x = x.wrapping_mul(0x7feb_352d);
            x ^= x >> 15;
            x = x.wrapping_mul(0x846c_a68b);
            x ^= x >> 16;
            let depth = if x.is_multiple_of(8) {
                0.0
            } else {
                0.5 + (x >> 8) as f32 * 1e-8
            };
            [depth, 0.0, 0.0, 0.0]
        })
        .collect();
    let desc = TextureDesc::d2(width, height, Format::R32Float);
    ImageData::from_rgba_f32(desc, &texels).unwrap()
}

fn truth(depth: &ImageData) -> Vec<Vec<Bounds>> {
    let size = [depth.desc.extent.width, depth.desc.extent.height];
    let depths = depth.to_rgba_f32().unwrap();
    levels(size, |x, y| {
        let [depth, ..] = depths[(y * size[0] + x) as usize];
        (depth > 0.0).then(|| NEAR / depth)
    })
    .unwrap()
}

fn made(
    executor: &mut dyn Backend,
    kernels: &KernelLibrary,
    depth: &ImageData,
    build: Build,
) -> Vec<Vec<Bounds>> {
    let mut graph = Graph::new();
    let input = graph.import_texture("depth", depth.desc).unwrap();
    let made = pyramid(&mut graph, input, &camera(), build).unwrap();
    graph.output("pyramid", made.texture).unwrap();
    let plan = plan_for(
        executor,
        &graph,
        kernels,
        Arithmetic::Strict,
        Capture::Outputs,
    )
    .unwrap();
    let run = executor
        .execute(&plan, &Inputs::new().texture("depth", depth))
        .unwrap();
    let texels = run.output("pyramid").unwrap().to_rgba_f32().unwrap();
    let layout: Layout = made.layout;
    let columns = layout.extent()[0];
    let level = |level: u32| {
        let ([width, height], [left, top]) = (layout.level_size(level), layout.corner(level));
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (left + x, top + y)));
        let bounds = places.map(|(x, y)| {
            let [nearest, farthest, ..] = texels[(y * columns + x) as usize];
            [nearest, farthest]
        });
        bounds.collect()
    };
    (1..=layout.levels()).map(level).collect()
}

#[test]
fn both_builds_are_every_texels_least_and_greatest_on_every_backend() {
    let kernels = etalon::effects::kernels();
    let mut executors = executors();
    for size in [
        [1, 1],
        [2, 3],
        [5, 1],
        [63, 64],
        [65, 129],
        [130, 67],
        [513, 3],
        [3, 400],
        [321, 181],
        [4097, 3],
    ] {
        let depth = scattered(size);
        let truth = truth(&depth);
        for executor in &mut executors {
            for build in [Build::PerLevel, Build::SinglePass] {
                let made = made(executor.as_mut(), &kernels, &depth, build);
                assert!(made == truth, "{size:?}, {build:?}: {}", executor.info());
            }
        }
    }
}

/// What one workgroup wrote need not have reached the last one: it then makes it again, on
/// devices as well.
#[test]
fn what_does_not_arrive_is_made_again_on_every_backend() {
    let mut kernels = etalon::effects::kernels();
    let source = kernels.source("hiz/single").unwrap().to_string();
    let line = "        publish(1u, tile, area);";
    let lossy = source.replace(line, "if (tile % 3u != 0u) { publish(1u, tile, area); }");
    assert_ne!(source, lossy);
    kernels.add_source("hiz/single", &lossy);
    let depth = scattered([321, 181]);
    let truth = truth(&depth);
    for executor in &mut executors() {
        let made = made(executor.as_mut(), &kernels, &depth, Build::SinglePass);
        assert!(made == truth, "{}", executor.info());
    }
}

/// The comparison must be able to fail: a pyramid that leaves out the last column.
#[test]
fn a_dropped_column_is_seen_on_every_backend() {
    let mut kernels = etalon::effects::kernels();
    let source = kernels.source("hiz/single").unwrap().to_string();
    let line = "let inside = min(texel, textureDimensions(depth) - 1u);";
    let short = source.replace(
        line,
        "let inside = min(texel, textureDimensions(depth) - vec2<u32>(2u, 1u));",
    );
    assert_ne!(source, short);
    kernels.add_source("hiz/single", &short);
    let depth = scattered([129, 67]);
    let truth = truth(&depth);
    for executor in &mut executors() {
        let made = made(executor.as_mut(), &kernels, &depth, Build::SinglePass);
        assert!(made != truth, "{}", executor.info());
    }
}

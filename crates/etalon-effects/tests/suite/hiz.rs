//! Pyramids of distances against every texel that they cover.

use etalon_core::Format;
use etalon_core::backend::{Backend, Inputs};
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_cpu::{Checks, CpuBackend, CpuOptions};
use etalon_effects::hiz::truth::{Bounds, levels};
use etalon_effects::hiz::{Build, Layout, NOTHING, pyramid};
use etalon_effects::{CameraParams, DepthRange};

use crate::common::{hash, image, texels};

const BUILDS: [Build; 2] = [Build::PerLevel, Build::SinglePass];

fn camera(depth: DepthRange) -> CameraParams {
    CameraParams {
        depth,
        ..CameraParams::perspective(1.0, 1.5, 0.1)
    }
}

/// Depths that look random; one in five texels shows nothing, in one way or another.
fn scattered(size: [u32; 2], camera: &CameraParams) -> ImageData {
    let [bias, slope] = camera.depth_bias_slope().to_array();
    let cleared = match camera.depth {
        DepthRange::ReversedInfinite | DepthRange::Reversed { .. } => 0.0,
        DepthRange::StandardInfinite | DepthRange::Standard { .. } => 1.0,
    };
    image(Format::R32Float, size[0], size[1], |x, y| {
        let random = hash(x ^ hash(y ^ hash(size[0])));
        let depth = match random % 20 {
            0 => cleared,
            1 => f32::NAN,
            2 => f32::INFINITY,
            3 => -5.0,
            _ => {
                let distance = 0.1 + (random >> 8) as f32 * 1e-6;
                bias + slope / distance
            }
        };
        [depth, 0.0, 0.0, 0.0]
    })
}

/// The distance that `lib/camera` gives a depth, each operation rounded as there.
fn distance(depth: f32, camera: &CameraParams) -> Option<f32> {
    let [bias, slope] = camera.depth_bias_slope().to_array();
    let [near, end] = camera.distance_range().to_array();
    let distance = slope / (depth - bias);
    (distance >= near * 0.999_999 && distance < end).then_some(distance)
}

struct Bench {
    kernels: KernelLibrary,
    backend: CpuBackend,
    arithmetic: Arithmetic,
}

impl Bench {
    fn new() -> Self {
        Self::with(&CpuOptions::default())
    }

    fn with(options: &CpuOptions) -> Self {
        Self {
            kernels: etalon_effects::kernels(),
            backend: CpuBackend::new(options).unwrap(),
            arithmetic: Arithmetic::Strict,
        }
    }

    /// With a line of a kernel replaced.
    fn replacing(path: &str, line: &str, other: &str) -> Self {
        let mut bench = Self::new();
        let source = bench.kernels.source(path).unwrap().to_string();
        let replaced = source.replace(line, other);
        assert_ne!(source, replaced, "{path}");
        bench.kernels.add_source(path, &replaced);
        bench
    }

    /// Each level from 1 on.
    fn made(&mut self, depth: &ImageData, camera: &CameraParams, build: Build) -> Vec<Vec<Bounds>> {
        let mut graph = Graph::new();
        let input = graph.import_texture("depth", depth.desc).unwrap();
        let made = pyramid(&mut graph, input, camera, build).unwrap();
        graph.output("pyramid", made.texture).unwrap();
        let options = PlanOptions {
            arithmetic: self.arithmetic,
            limits: self.backend.limits(),
            capture: Capture::Outputs,
            ..PlanOptions::default()
        };
        let plan = Plan::new(&graph, &self.kernels, &options).unwrap_or_else(|e| panic!("{e}"));
        let inputs = Inputs::new().texture("depth", depth);
        let run = self.backend.execute(&plan, &inputs).unwrap();
        split(run.output("pyramid").unwrap(), made.layout)
    }
}

fn split(texture: &ImageData, layout: Layout) -> Vec<Vec<Bounds>> {
    let texels = texels(texture);
    let [columns, _] = layout.extent();
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

fn truth(depth: &ImageData, camera: &CameraParams) -> Vec<Vec<Bounds>> {
    let size = [depth.desc.extent.width, depth.desc.extent.height];
    let depths = texels(depth);
    levels(size, |x, y| {
        distance(depths[(y * size[0] + x) as usize][0], camera)
    })
    .unwrap()
}

/// Where two pyramids differ in a bit: the level, and the texel in it.
fn difference(a: &[Vec<Bounds>], b: &[Vec<Bounds>]) -> Option<(usize, usize)> {
    assert_eq!(a.len(), b.len());
    let bits = |bounds: &Bounds| bounds.map(f32::to_bits);
    a.iter().zip(b).enumerate().find_map(|(level, (a, b))| {
        assert_eq!(a.len(), b.len());
        let texel = a.iter().zip(b).position(|(a, b)| bits(a) != bits(b))?;
        Some((level + 1, texel))
    })
}

/// Below, at and above every power of two, and long ones.
fn sizes() -> Vec<[u32; 2]> {
    let sides = [1, 2, 3, 4, 5, 7, 8, 9, 31, 63, 64, 65, 127, 129];
    let mut sizes: Vec<[u32; 2]> = sides
        .iter()
        .flat_map(|&width| sides.map(|height| [width, height]))
        .collect();
    sizes.extend([[4097, 3], [3, 4097], [1, 8192], [321, 181], [640, 127]]);
    sizes
}

#[test]
fn both_builds_are_every_texels_least_and_greatest_at_every_size() {
    let camera = camera(DepthRange::ReversedInfinite);
    let mut bench = Bench::new();
    let sizes = sizes();
    assert!(sizes.len() > 200);
    for size in sizes {
        let depth = scattered(size, &camera);
        let truth = truth(&depth, &camera);
        for build in BUILDS {
            let made = bench.made(&depth, &camera, build);
            assert_eq!(difference(&made, &truth), None, "{size:?}, {build:?}");
        }
    }
}

#[test]
fn near_is_near_in_every_range_of_depth() {
    let mut bench = Bench::new();
    for range in [
        DepthRange::ReversedInfinite,
        DepthRange::StandardInfinite,
        DepthRange::Reversed { far: 500.0 },
        DepthRange::Standard { far: 500.0 },
    ] {
        let camera = camera(range);
        let depth = scattered([131, 70], &camera);
        let truth = truth(&depth, &camera);
        let all: Vec<Bounds> = truth.concat();
        let empty = |bounds: &Bounds| *bounds == [NOTHING, 0.0];
        assert!(all.iter().all(|b| b[0] <= b[1] || empty(b)));
        for build in BUILDS {
            let made = bench.made(&depth, &camera, build);
            assert_eq!(difference(&made, &truth), None, "{range:?}, {build:?}");
        }
    }
}

#[test]
fn where_there_is_nothing_it_is_beyond_all_and_before_all() {
    let camera = camera(DepthRange::ReversedInfinite);
    // A surface, 8 away, at one texel.
    let depth = image(Format::R32Float, 100, 70, |x, y| {
        [
            if (x, y) == (99, 69) { 0.1 / 8.0 } else { 0.0 },
            0.0,
            0.0,
            0.0,
        ]
    });
    for build in BUILDS {
        let levels = Bench::new().made(&depth, &camera, build);
        for (index, level) in levels.iter().enumerate() {
            let (last, others) = level.split_last().unwrap();
            assert_eq!(*last, [8.0, 8.0], "level {}", index + 1);
            assert!(others.iter().all(|bounds| *bounds == [NOTHING, 0.0]));
        }
    }
}

#[test]
fn threads_order_and_arithmetic_change_no_bit() {
    let camera = camera(DepthRange::ReversedInfinite);
    let depth = scattered([333, 517], &camera);
    let truth = truth(&depth, &camera);
    for threads in [1, 2, 5] {
        let mut bench = Bench::with(&CpuOptions {
            threads,
            ..CpuOptions::default()
        });
        for _ in 0..3 {
            for build in BUILDS {
                let made = bench.made(&depth, &camera, build);
                assert_eq!(difference(&made, &truth), None, "{threads}, {build:?}");
            }
        }
    }
    let mut fast = Bench::new();
    fast.arithmetic = Arithmetic::Fast;
    let [a, b] = BUILDS.map(|build| fast.made(&depth, &camera, build));
    assert_eq!(difference(&a, &b), None);
}

/// What a device may do: let the last workgroup not see what another wrote before it
/// counted itself.
#[test]
fn what_does_not_arrive_is_made_again() {
    let camera = camera(DepthRange::ReversedInfinite);
    for (lost, least) in [
        // One in three, all, and one of the two words.
        ("if (tile % 3u != 0u) { publish(1u, tile, area); }", 6),
        (
            "if (tile > groups.x * groups.y) { publish(1u, tile, area); }",
            6,
        ),
        (
            "atomicStore(&shared_words[1u + 2u * tile + (tile & 1u)], WRITTEN);",
            6,
        ),
    ] {
        let mut bench = Bench::replacing("hiz/single", "        publish(1u, tile, area);", lost);
        for size in [[200, 131], [64, 65], [513, 3]] {
            let depth = scattered(size, &camera);
            let made = bench.made(&depth, &camera, Build::SinglePass);
            assert!(made.len() > least);
            assert_eq!(difference(&made, &truth(&depth, &camera)), None, "{size:?}");
        }
    }
    // That the words are what is read otherwise.
    let lie = "publish(1u, tile, vec2<f32>(1.0));";
    let mut bench = Bench::replacing("hiz/single", "        publish(1u, tile, area);", lie);
    let depth = scattered([200, 131], &camera);
    let made = bench.made(&depth, &camera, Build::SinglePass);
    let found = difference(&made, &truth(&depth, &camera));
    assert_eq!(found.map(|(level, _)| level), Some(7));
}

#[test]
fn a_pyramid_that_drops_the_odd_edge_is_caught() {
    let camera = camera(DepthRange::ReversedInfinite);
    // The nearest and the farthest surface of all are in the last column and row.
    let depth = image(Format::R32Float, 129, 67, |x, y| {
        let distance = match (x, y) {
            (128, 5) => 1.0,
            (7, 66) => 90.0,
            _ => 5.0,
        };
        [0.1 / distance, 0.0, 0.0, 0.0]
    });
    let truth = truth(&depth, &camera);
    assert_eq!(truth[7], [[1.0, 90.0]]);
    let faults = [
        // Rounded down, as mips are.
        (
            Build::PerLevel,
            "hiz/level",
            "let low = id.xy * 2u;",
            "let low = min(id.xy * 2u, (textureDimensions(finer) / 2u) * 2u - 2u);",
        ),
        (
            Build::SinglePass,
            "hiz/single",
            "let inside = min(texel, textureDimensions(depth) - 1u);",
            "let inside = min(texel, (textureDimensions(depth) / 2u) * 2u - 1u);",
        ),
    ];
    for (build, path, line, other) in faults {
        let right = Bench::new().made(&depth, &camera, build);
        assert_eq!(difference(&right, &truth), None);
        let wrong = Bench::replacing(path, line, other).made(&depth, &camera, build);
        assert!(difference(&wrong, &truth).is_some(), "{build:?}");
    }
}

#[test]
fn nothing_is_read_or_written_that_is_not_there() {
    let camera = camera(DepthRange::ReversedInfinite);
    let mut bench = Bench::with(&CpuOptions {
        checks: Checks::all(),
        ..CpuOptions::default()
    });
    for size in [[1, 1], [2, 1], [5, 3], [64, 64], [65, 1], [131, 70]] {
        let depth = image(Format::R32Float, size[0], size[1], |x, y| {
            [0.1 / (1.0 + (hash(x ^ hash(y)) % 90) as f32), 0.0, 0.0, 0.0]
        });
        for build in BUILDS {
            bench.made(&depth, &camera, build);
            let findings = bench.backend.findings();
            assert!(findings.is_empty(), "{size:?}, {build:?}: {findings:?}");
        }
    }
}

#[test]
fn a_camera_out_of_range_is_refused() {
    let mut graph = Graph::new();
    let desc = etalon_core::resource::TextureDesc::d2(4, 4, Format::R32Float);
    let depth = graph.import_texture("depth", desc).unwrap();
    let wrong = CameraParams {
        near: f32::NAN,
        ..camera(DepthRange::ReversedInfinite)
    };
    for build in BUILDS {
        assert!(pyramid(&mut graph, depth, &wrong, build).is_err());
    }
}

//! Reflections on tiles are those on the whole picture, bit for bit, on every backend.

use etalon::Format;
use etalon::backend::Backend;
use etalon::effects::ssr::{Search, Ssr, ssr};
use etalon::effects::tiles::Tiling;
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::{Frame, FrameSize, scene};
use etalon_tests::{executors, plan_for};

const ROUGH: [f32; 4] = [0.6, 0.8, 1.0, 0.25];
const SMOOTH: [f32; 4] = [1.0, 0.7, 0.2, 1.0];

/// A number that looks random: C. Wellons, "Prospecting for Hash Functions", 2018, the
/// hash `lowbias32`.
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

fn frame([width, height]: [u32; 2], mask: impl Fn(u32, u32) -> [f32; 4]) -> Frame {
    let size = FrameSize::new(width, height).unwrap();
    let mut frame = scene("corridor-grazing").unwrap().frame(size).unwrap();
    let texels: Vec<[f32; 4]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| mask(x, y))
        .collect();
    let desc = TextureDesc::d2(width, height, Format::Rgba8Unorm);
    frame.specular = ImageData::from_rgba_f32(desc, &texels).unwrap();
    frame
}

/// One texel in so many, half of them smooth.
fn sparse(size: [u32; 2], seed: u32, one_in: u32) -> Frame {
    frame(size, |x, y| {
        let random = hash(seed ^ hash(x ^ hash(y)));
        match random % one_in {
            0 if random & 1 << 20 == 0 => ROUGH,
            0 => SMOOTH,
            _ => [0.0; 4],
        }
    })
}

/// Kernels that leave a number in every texel between the passes: what an executor
/// would otherwise find there, if it looked where nothing was written, is what an
/// earlier picture left.
fn poison() -> KernelLibrary {
    let mut kernels = etalon::effects::kernels();
    for (path, stored) in [
        (
            "ssr/resolve",
            "textureStore(result, texel, f16_rounded(vec4<f32>(colour, visibility)))",
        ),
        (
            "ssr/blur",
            "textureStore(result, texel, f16_rounded(sum / f32(2 * radius + 1)))",
        ),
    ] {
        let source = kernels.source(path).unwrap().to_string();
        let poisoned = source.replace(stored, "textureStore(result, texel, vec4<f32>(1234.0))");
        assert_ne!(source, poisoned, "{path}");
        kernels.add_source(path, &poisoned);
    }
    kernels
}

fn picture(
    executor: &mut dyn Backend,
    kernels: &KernelLibrary,
    frame: &Frame,
    settings: &Ssr,
    arithmetic: Arithmetic,
) -> ImageData {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
    let result = ssr(&mut graph, &inputs, settings).unwrap();
    graph.output("result", result).unwrap();
    let plan = plan_for(executor, &graph, kernels, arithmetic, Capture::Outputs).unwrap();
    let execution = executor.execute(&plan, &frame.inputs()).unwrap();
    execution.output("result").unwrap().clone()
}

#[test]
fn tiles_change_no_bit_on_any_backend() {
    let scenes = [
        (
            "a corner",
            frame([131, 70], |x, y| {
                if (x, y) == (130, 69) { ROUGH } else { [0.0; 4] }
            }),
        ),
        (
            "beside a tile",
            frame(
                [131, 70],
                |x, y| if (x, y) == (64, 63) { ROUGH } else { [0.0; 4] },
            ),
        ),
        ("nothing", frame([97, 55], |_, _| [0.0; 4])),
        ("everything", frame([97, 55], |_, _| ROUGH)),
        ("smooth", frame([97, 55], |_, _| SMOOTH)),
        ("sparse", sparse([131, 70], 7, 900)),
        ("dense", sparse([97, 55], 8, 9)),
        ("a row", sparse([301, 1], 9, 40)),
        ("a texel", sparse([1, 1], 10, 1)),
    ];
    let (kernels, poison) = (etalon::effects::kernels(), poison());
    for executor in &mut executors() {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            for (number, (name, frame)) in scenes.iter().enumerate() {
                let settings = Ssr {
                    resolution: 0.25,
                    blur_radius: [6, 9, 0][number % 3],
                    quarter_from: [2.0, 0.5, 0.0][number / 3 % 3],
                    search: [Search::Refined, Search::HiZ, Search::Dda][(number + number / 3) % 3],
                    ..Ssr::default()
                };
                let mut on = |kernels: &KernelLibrary, tiles| {
                    let settings = Ssr { tiles, ..settings };
                    picture(executor.as_mut(), kernels, frame, &settings, arithmetic)
                };
                let whole = on(&kernels, Tiling::Off);
                for tiles in &Tiling::ALL[1..] {
                    on(&poison, Tiling::Off);
                    let tiled = on(&kernels, *tiles);
                    assert!(
                        tiled == whole,
                        "{name}, {tiles:?}, {arithmetic:?}: {}",
                        executor.info()
                    );
                }
            }
        }
    }
}

/// The comparison must be able to fail: marks that spread a tile less than the blur
/// reaches.
#[test]
fn a_spread_that_is_too_small_is_seen_on_every_backend() {
    let mut kernels = etalon::effects::kernels();
    let source = kernels.source("tiles/spread").unwrap().to_string();
    let short = source.replacen("params.reach, 0)", "params.reach - 1, 0)", 1);
    assert_ne!(source, short);
    kernels.add_source("tiles/spread", &short);
    let (frame, poison) = (sparse([131, 70], 7, 900), poison());
    for executor in &mut executors() {
        let mut on = |kernels: &KernelLibrary, tiles| {
            let settings = Ssr {
                tiles,
                camera_fade: 0.0,
                border: 0.0,
                ..Ssr::default()
            };
            let strict = Arithmetic::Strict;
            picture(executor.as_mut(), kernels, &frame, &settings, strict)
        };
        let whole = on(&kernels, Tiling::Off);
        on(&poison, Tiling::Off);
        let tiled = on(&kernels, Tiling::Texels8);
        assert!(whole != tiled, "{}", executor.info());
    }
}

//! Reflections of which one texel in four is marched.

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::kernel::Arithmetic;
use etalon_cpu::CpuOptions;
use etalon_effects::ssr::{Blend, HitStorage, Ssr};
use etalon_effects::tiles::Tiling;
use etalon_scenes::{Frame, FrameSize, scene};

use super::reflection::{Bench, Mask, frame, settings, single, sparse};
use crate::common::{Run, hash, image, texels};

/// As many roughnesses as there are, at random; some texels mirror nothing.
fn every_roughness(seed: u32) -> Mask {
    Box::new(move |x, y| {
        let random = hash(seed ^ hash(x ^ hash(y)));
        if random.is_multiple_of(5) {
            return [0.0; 4];
        }
        [1.0, 0.7, 0.4, (random >> 8 & 255) as f32 / 255.0]
    })
}

fn roughness(frame: &Frame) -> Vec<f32> {
    texels(&frame.specular)
        .iter()
        .map(|texel| 1.0 - texel[3])
        .collect()
}

fn bytes(picture: &ImageData) -> Vec<&[u8]> {
    picture.bytes.chunks(8).collect()
}

/// Texels of the half size are read across the borders of tiles by the mix, and further
/// by the blur.
#[test]
fn tiles_change_no_bit() {
    let places = [
        (0, 0),
        (130, 69),
        (15, 15),
        (16, 15),
        (15, 16),
        (16, 16),
        (17, 31),
        (63, 63),
        (64, 64),
        (127, 40),
        (128, 63),
    ];
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        for (number, place) in places.into_iter().enumerate() {
            let texel = [0.6, 0.8, 1.0, 0.25];
            let frame = frame("corridor-grazing", 131, 70, &single(place, texel));
            let settings = Ssr {
                quarter_from: [0.0, 0.5, 0.75, 1.0][number % 4],
                ..settings([0, 1, 15, 16, 17, 40][number % 6])
            };
            bench.hold(&frame, &settings, &format!("at {place:?}, {settings:?}"));
        }
        let sizes = [
            (1, 1),
            (1, 40),
            (41, 1),
            (2, 2),
            (3, 3),
            (16, 16),
            (17, 15),
            (97, 55),
            (200, 3),
        ];
        for (number, (width, height)) in sizes.into_iter().enumerate() {
            for one_in in [1, 40, 1000] {
                let seed = hash(number as u32 ^ one_in);
                let settings = Ssr {
                    quarter_from: [0.0, 0.25, 0.75][seed as usize % 3],
                    storage: [HitStorage::Full, HitStorage::Half][seed as usize / 4 % 2],
                    blend: [Blend::Add, Blend::Replace][seed as usize / 8 % 2],
                    ..settings([0, 6, 13][seed as usize / 16 % 3])
                };
                let mask = if one_in == 1 {
                    every_roughness(seed)
                } else {
                    sparse(seed, one_in)
                };
                let frame = frame("corridor-grazing", width, height, &mask);
                let what = format!("{width}×{height}, one in {one_in}, {settings:?}");
                bench.hold(&frame, &settings, &what);
            }
        }
        let size = FrameSize::new(97, 55).unwrap();
        let hard = scene("hard-inputs").unwrap().frame(size).unwrap();
        for quarter_from in [0.0, 0.5] {
            let settings = Ssr {
                quarter_from,
                ..settings(6)
            };
            bench.hold(&hard, &settings, "hard inputs");
        }
    }
}

/// The comparison must be able to fail: without the texel before a tile, which reads half
/// of itself from there, marks miss tiles.
#[test]
fn marks_without_their_margin_are_seen() {
    let mut bench = Bench::with(Arithmetic::Strict, CpuOptions::default());
    let source = bench.kernels.source("ssr/classify").unwrap();
    let without = source.replacen("vec2<u32>(1u)) - 1u", "vec2<u32>(1u))", 1);
    assert_ne!(source, without);
    let frame = frame("corridor-grazing", 131, 70, &sparse(5, 60));
    let settings = Ssr {
        quarter_from: 0.0,
        ..settings(0)
    };
    assert_eq!(bench.difference(&frame, &settings, Tiling::Texels8), None);
    bench.kernels.add_source("ssr/classify", &without);
    let found = bench.difference(&frame, &settings, Tiling::Texels8);
    assert!(found.is_some());
}

/// Surfaces that are marched at every texel are those of a picture that is marched so
/// everywhere, bit for bit; and so is every fourth texel of the others, if nothing is
/// blurred.
#[test]
fn what_is_marched_is_what_it_would_be() {
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        for (radius, tiles) in [
            (0, Tiling::Off),
            (0, Tiling::Texels8),
            (6, Tiling::Texels16),
        ] {
            let (width, height) = (97, 55);
            let frame = frame("corridor-grazing", width, height, &every_roughness(radius));
            let settings = Ssr {
                tiles,
                ..settings(radius)
            };
            let full = bench.picture(&frame, &settings);
            let roughness = roughness(&frame);
            let mut others = 0;
            for quarter_from in [0.0, 0.5, 1.0] {
                let settings = Ssr {
                    quarter_from,
                    ..settings
                };
                let quarter = bench.picture(&frame, &settings);
                for (k, (full, quarter)) in bytes(&full).iter().zip(bytes(&quarter)).enumerate() {
                    let (x, y) = (k as u32 % width, k as u32 / width);
                    let fourth = x % 2 == 0 && y % 2 == 0 && radius == 0;
                    if roughness[k] < quarter_from || fourth {
                        assert_eq!(*full, quarter, "({x}, {y}), {settings:?}");
                    } else {
                        others += u32::from(*full != quarter);
                    }
                }
            }
            assert!(
                others > 100,
                "{others} texels at a quarter of the rate differ"
            );
        }
    }
}

/// Where all surfaces are on one side of the limit, the rate of that side alone gives the
/// same picture: what planning makes of it changes no bit.
#[test]
fn one_rate_does_where_no_surface_asks_for_two() {
    let mut bench = Bench::new(Arithmetic::Strict);
    for (shine, one_rate) in [(0.2, 0.0), (0.8, Ssr::NO_QUARTER)] {
        let mask: Mask = Box::new(move |x, y| {
            let mirrors = !hash(x ^ hash(y)).is_multiple_of(3);
            if mirrors {
                [1.0, 0.5, 0.25, shine]
            } else {
                [0.0; 4]
            }
        });
        let frame = frame("corridor-grazing", 97, 55, &mask);
        for tiles in [Tiling::Off, Tiling::Texels8] {
            let mut at = |quarter_from| {
                let settings = Ssr {
                    quarter_from,
                    tiles,
                    ..settings(6)
                };
                bench.picture(&frame, &settings)
            };
            assert!(at(0.5) == at(one_rate), "{shine}, {tiles:?}");
        }
    }
}

/// Of a roughness over 1 there is nothing: the passes are the ones without.
#[test]
fn no_quarter_has_no_passes() {
    let frame = frame("corridor-grazing", 64, 36, &sparse(1, 9));
    let steps = |quarter_from| -> Vec<String> {
        let mut run = Run::new();
        let inputs = run.import_frame(&frame);
        let settings = Ssr {
            quarter_from,
            ..Ssr::default()
        };
        let result = etalon_effects::ssr::ssr(&mut run.graph, &inputs, &settings).unwrap();
        run.graph.output("result", result).unwrap();
        let steps = run.plan().steps.into_iter().map(|step| step.name);
        steps.filter(|name| name.starts_with("ssr/")).collect()
    };
    assert!(steps(1.001).iter().all(|name| !name.contains("quarter")));
    let all = steps(0.0);
    assert_eq!(
        all,
        [
            "ssr/classify quarter",
            "ssr/march quarter",
            "ssr/resolve quarter",
            "ssr/blur x quarter",
            "ssr/blur y quarter",
            "ssr/mix_quarter",
            "ssr/keep",
        ]
    );
    assert!(steps(0.5).len() > all.len());
}

/// Light from a small picture, brought to each texel of the full one by the kernels'
/// library.
fn brought(depth: &ImageData, normal: &ImageData, small: &ImageData) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    run.kernels.add_source(
        "test/upsample",
        "import package::lib::camera::Camera;
         import package::lib::upsample::{surface_at, taps, upsampled};
         @group(0) @binding(0) var depth: texture_2d<f32>;
         @group(0) @binding(1) var normal: texture_2d<f32>;
         @group(0) @binding(2) var small: texture_2d<f32>;
         @group(0) @binding(3) var result: texture_storage_2d<rgba32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let extent = textureDimensions(result);
             if (id.x >= extent.x || id.y >= extent.y) { return; }
             let view = Camera(vec2<f32>(1.0), vec2<f32>(0.0), vec2<f32>(0.0, 1.0), vec2<f32>(1.0, 1000.0));
             let own = surface_at(view, depth, normal, id.xy);
             let at = taps(view, depth, normal, id.xy, own);
             textureStore(result, id.xy, upsampled(small, at));
         }",
    );
    let [d, n, s] = [
        run.import("depth", depth),
        run.import("normal", normal),
        run.import("small", small),
    ];
    let extent = depth.desc.extent;
    let desc =
        etalon_core::resource::TextureDesc::d2(extent.width, extent.height, Format::Rgba32Float);
    let result = run.graph.texture("result", desc);
    let result = run
        .graph
        .compute("test/upsample")
        .read("depth", d)
        .read("normal", n)
        .read("small", s)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    texels(&run.output(result))
}

/// Of a plane, however it lies, texels in between are the mean of those next to them: a
/// closed form. Everything in one plane is alike, so nothing but the shares counts.
#[test]
fn within_a_plane_it_is_bilinear() {
    let (width, height) = (12, 7);
    // 1/distance of a plane is linear on the screen; depth is 1/distance here.
    let depth = image(Format::R32Float, width, height, |x, y| {
        [0.3 + 0.02 * x as f32 + 0.05 * y as f32, 0.0, 0.0, 1.0]
    });
    // With a projection scale of 1, p = (ndc, -1) / depth: depth = a + b ndc.x + c ndc.y
    // is the plane b x + c y - a z = 1.
    let step = |per_texel: f64, side: u32| per_texel * f64::from(side) / 2.0;
    let (b, c) = (step(0.02, width), -step(0.05, height));
    let a = 0.3 - 0.01 - 0.025 + b - c;
    let length = (a * a + b * b + c * c).sqrt();
    let normal = [b, c, -a].map(|part| (-part / length) as f32);
    let normal = image(Format::Rgba32Float, width, height, |_, _| {
        [normal[0], normal[1], normal[2], 0.0]
    });
    let value = |x: u32, y: u32| f64::from(hash(x ^ hash(y)) % 1000) / 7.0;
    let small = image(Format::Rgba32Float, 6, 4, |x, y| {
        [value(x, y) as f32, 1.0, 0.0, 0.0]
    });
    for (k, texel) in brought(&depth, &normal, &small).iter().enumerate() {
        let (x, y) = (k as u32 % width, k as u32 / width);
        let ends = |at: u32, last: u32| [at / 2, (at / 2 + at % 2).min(last)];
        let mut mean = 0.0;
        for sy in ends(y, 3) {
            for sx in ends(x, 5) {
                mean += value(sx, sy) / 4.0;
            }
        }
        // Likeness differs from 1 by the square of what rounding takes off the plane,
        // some 2^-24 of 100 times SAME_PLANE's inverse: nothing.
        let error = (f64::from(texel[0]) - mean).abs();
        assert!(
            error <= 1e-4 * (1.0 + mean),
            "({x}, {y}): {} for {mean}",
            texel[0]
        );
        assert!((texel[1] - 1.0).abs() < 1e-6, "weights sum to 1");
    }
}

/// Beside an edge nothing of the other surface is taken: there LEAST_WEIGHT, 1/1024, stands
/// against a likeness of 1.
#[test]
fn nothing_bleeds_over_an_edge() {
    let (width, height) = (16, 8);
    let near = |x: u32| x < 7;
    let depth = image(Format::R32Float, width, height, |x, _| {
        [if near(x) { 0.5 } else { 0.05 }, 0.0, 0.0, 1.0]
    });
    let normal = image(Format::Rgba32Float, width, height, |_, _| {
        [0.0, 0.0, 1.0, 0.0]
    });
    let small = image(Format::Rgba32Float, 8, 4, |x, _| {
        [if near(2 * x) { 1.0 } else { 0.0 }, 0.0, 0.0, 0.0]
    });
    for (k, texel) in brought(&depth, &normal, &small).iter().enumerate() {
        let x = k as u32 % width;
        let own = if near(x) { 1.0 } else { 0.0 };
        assert!((texel[0] - own).abs() <= 2.0 / 1024.0, "{x}: {}", texel[0]);
    }
    // Nor around a corner, where depth is one and the normals turn.
    let flat = image(Format::R32Float, width, height, |_, _| [0.1, 0.0, 0.0, 1.0]);
    let corner = image(Format::Rgba32Float, width, height, |x, _| {
        if near(x) {
            [0.0, 0.0, 1.0, 0.0]
        } else {
            [1.0, 0.0, 0.0, 0.0]
        }
    });
    for (k, texel) in brought(&flat, &corner, &small).iter().enumerate() {
        let x = k as u32 % width;
        if near(x) {
            assert!((texel[0] - 1.0).abs() <= 2.0 / 1024.0, "{x}: {}", texel[0]);
        }
    }
}

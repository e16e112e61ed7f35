//! What fragment kernels do: discard, derivatives, sampling, memory.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::raster::{CullMode, DepthState};
use etalon_core::resource::{AddressMode, Filter, SamplerDesc, TextureDesc};
use etalon_cpu::{BoundResource, Executor, RasterError, Texture};

const WHOLE: [[f32; 4]; 3] = [
    [-1.0, -1.0, 0.5, 1.0],
    [3.0, -1.0, 0.5, 1.0],
    [-1.0, 3.0, 0.5, 1.0],
];

fn fragment(body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> data: array<atomic<u32>>;
         @group(0) @binding(1) var colours: texture_2d<f32>;
         @group(0) @binding(2) var filtering: sampler;
         @vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> {{ return position; }}
         @fragment fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {{ {body} }}"
    )
}

/// Fragments discarded are not stored, and their neighbours' derivatives go on.
#[test]
fn discarded_fragments_help_their_neighbours() {
    let wgsl = fragment(
        "let x = at.x * at.x + at.y * 3.0;
         if (u32(at.x) + u32(at.y)) % 2u == 1u { discard; }
         return vec4(dpdx(x), dpdy(x), fwidth(x), at.x);",
    );
    let targets = Scene::new(&wgsl, [20, 12], &WHOLE).draw();
    for (i, got) in targets.colour(0).iter().enumerate() {
        let (x, y) = (i % 20, i / 20);
        if (x + y) % 2 == 1 {
            assert_eq!(*got, [0.0; 4]);
        } else {
            // Of the pair: (x + 1.5)² - (x + 0.5)², x even.
            let even = (x / 2 * 2) as f32;
            let dx = 2.0 * even + 2.0;
            assert_eq!(*got, [dx, 3.0, dx + 3.0, x as f32 + 0.5]);
        }
    }
}

#[test]
fn discarding_in_functions_and_loops() {
    let wgsl = "
        @vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> { return position; }
        fn odd(x: u32) -> f32 {
            if x % 3u == 0u { discard; }
            return f32(x);
        }
        @fragment fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
            var sum = 0.0;
            for (var i = 0u; i < u32(at.y); i++) {
                if i == 4u && at.x > 10.0 { discard; }
                sum += 1.0;
            }
            return vec4(odd(u32(at.x)), sum, 0.0, 1.0);
        }";
    let targets = Scene::new(wgsl, [16, 9], &WHOLE).draw();
    for (i, got) in targets.colour(0).iter().enumerate() {
        let (x, y) = (i % 16, i / 16);
        let gone = x % 3 == 0 || (x >= 10 && y > 4);
        let want = if gone {
            [0.0; 4]
        } else {
            [x as f32, y as f32, 0.0, 1.0]
        };
        assert_eq!(*got, want, "{x} {y}");
    }
}

#[test]
fn derivatives_of_linear_functions_are_constants() {
    let wgsl = "
        struct Varyings { @builtin(position) position: vec4<f32>, @location(0) at: vec2<f32> }
        @vertex fn vertex(@location(0) position: vec4<f32>) -> Varyings { return Varyings(position, position.xy); }
        @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> {
            let value = in.position.x * 3.0 - in.position.y * 0.25;
            return vec4(dpdxFine(value), dpdyCoarse(value), dpdx(in.at.x), dpdyFine(in.at).y);
        }";
    // Sizes are powers of two, so that everything is exact.
    let targets = Scene::new(wgsl, [64, 32], &WHOLE).draw();
    let want = [3.0, -0.25, 2.0 / 64.0, -2.0 / 32.0];
    assert!(targets.colour(0).iter().all(|got| *got == want));
    // Coarse ones are of a quad's upper left fragment, the others of each row and column.
    let wgsl = fragment(
        "let value = at.x * at.y;
         return vec4(dpdxCoarse(value), dpdxFine(value), dpdyCoarse(value), dpdy(value));",
    );
    for (i, got) in Scene::new(&wgsl, [8, 6], &WHOLE)
        .draw()
        .colour(0)
        .iter()
        .enumerate()
    {
        let (x, y) = (i % 8, i / 8);
        let [left, top] = [x / 2 * 2, y / 2 * 2].map(|at| at as f32 + 0.5);
        let want = [top, y as f32 + 0.5, left, x as f32 + 0.5];
        assert_eq!(*got, want, "{x} {y}");
    }
}

/// Helpers of a triangle's edge are given its numbers beyond it.
#[test]
fn derivatives_at_edges_are_those_inside() {
    let wgsl = fragment("return vec4(dpdx(at.x), dpdy(at.y), fwidth(at.x + at.y), 1.0);");
    let mut random = Random(2);
    let positions: Vec<[f32; 4]> = (0..300)
        .map(|_| [random.range(-1.5, 1.5), random.range(-1.5, 1.5), 0.5, 1.0])
        .collect();
    let targets = Scene::new(&wgsl, [61, 47], &positions).draw_once();
    let colours = targets.colour(0);
    assert!(
        colours
            .iter()
            .all(|got| *got == [0.0; 4] || *got == [1.0, 1.0, 2.0, 1.0])
    );
    assert!(colours.iter().any(|got| got[3] == 1.0));
}

/// The level of detail of implicit sampling is that of explicit gradients.
#[test]
fn implicit_levels_are_those_of_the_derivatives() {
    let desc = TextureDesc {
        mips: 7,
        ..TextureDesc::d2(64, 64, Format::Rgba8Unorm)
    };
    let bytes = (0..desc.bytes().unwrap()).map(|i| (i.wrapping_mul(2_654_435_761) >> 9) as u8);
    let image = etalon_core::image::ImageData::from_bytes(desc, bytes.collect()).unwrap();
    let texture = Texture::from_image(&image).unwrap();
    let sampler = SamplerDesc::new(AddressMode::Repeat, Filter::Linear, Filter::Linear);
    let bound = [
        BoundResource::Texture(texture.view()),
        BoundResource::Sampler(sampler),
    ];
    let draw = |sampled: &str| {
        let wgsl = fragment(&format!(
            "let uv = vec2(at.x * 0.07 + at.y * 0.01, at.x * at.y * 0.001);
             let dx = dpdxCoarse(uv); let dy = dpdyCoarse(uv);
             return {sampled};"
        ));
        Scene::new(&wgsl, [50, 40], &WHOLE)
            .draw_with(&bound)
            .bytes()
    };
    let plain = draw("textureSample(colours, filtering, uv)");
    assert!(plain == draw("textureSampleGrad(colours, filtering, uv, dx, dy)"));
    let biased = draw("textureSampleBias(colours, filtering, uv, 1.0)");
    assert!(biased == draw("textureSampleGrad(colours, filtering, uv, dx * 2.0, dy * 2.0)"));
    assert!(plain != biased);
}

#[test]
fn memory_is_written_by_fragments_that_are_alive() {
    let wgsl = fragment(
        "if at.x > 7.0 { discard; }
         let old = atomicAdd(&data[u32(at.y)], 1u);
         atomicMax(&data[8], u32(at.x));
         return vec4(f32(old), 0.0, 0.0, 1.0);",
    );
    let mut first: Option<(Vec<u32>, Vec<Vec<u8>>)> = None;
    // A triangle whose quads have helpers.
    let corners = [
        [-1.0, 1.0, 0.5, 1.0],
        [-1.0, -1.0, 0.5, 1.0],
        [1.0, 1.0, 0.5, 1.0],
    ];
    let scene = Scene::new(&wgsl, [9, 8], &corners);
    let program = scene.program();
    for (name, executor) in ways() {
        let data = common::buffer(&[0; 9]);
        let targets = scene.targets();
        let bound = [BoundResource::Buffer(&data)];
        scene
            .try_draw(&program, &executor, &targets, &bound)
            .unwrap();
        let colours = targets.colour(0);
        let words = common::words(&data);
        for y in 0..8 {
            let alive = (0..9).filter(|x| colours[y * 9 + x][3] == 1.0).count();
            assert_eq!(words[y] as usize, alive, "{name}");
        }
        assert!(words[8] <= 6);
        let now = (words, targets.bytes());
        assert!(first.as_ref().is_none_or(|first| *first == now), "{name}");
        first = Some(now);
    }
}

/// A fragment that is hidden runs, and is seen to, if it writes memory.
#[test]
fn hidden_fragments_write_memory_but_no_target() {
    let wgsl = fragment("atomicAdd(&data[0], 1u); return vec4(1.0);");
    let mut scene = Scene::new(&wgsl, [4, 4], &WHOLE);
    scene.depth = Some(Format::Depth32Float);
    scene.state.depth = Some(DepthState::STANDARD);
    scene.clear_depth = 0.25;
    let data = common::buffer(&[0]);
    let targets = scene.targets();
    let executor = Executor::new(2).unwrap();
    let bound = [BoundResource::Buffer(&data)];
    scene
        .try_draw(&scene.program(), &executor, &targets, &bound)
        .unwrap();
    assert_eq!(common::words(&data), [16]);
    assert!(targets.colour(0).iter().all(|got| *got == [0.0; 4]));
}

#[test]
fn endless_loops_end() {
    let wgsl = fragment("var x = 1.0; loop { x += at.x; if x < 0.0 { break; } } return vec4(x);");
    let scene = Scene::new(&wgsl, [4, 4], &WHOLE);
    let executor = Executor::new(2).unwrap().with_max_trips(100);
    let error = scene
        .try_draw(&scene.program(), &executor, &scene.targets(), &[])
        .unwrap_err();
    assert!(
        matches!(error, RasterError::EndlessLoop { limit: 100, .. }),
        "{error}"
    );
}

/// Quantities that are written beside each other are of the same fragment, whichever
/// triangle drew last: many layers, early and late.
#[test]
fn layers_are_drawn_in_their_order() {
    let mut random = Random(77);
    let mut positions = Vec::new();
    for _ in 0..400 {
        for _ in 0..3 {
            positions.push([
                random.range(-1.3, 1.3),
                random.range(-1.3, 1.3),
                (random.below(4) as f32) * 0.25,
                1.0,
            ]);
        }
    }
    let kernel = |last: &str| {
        format!(
            "struct Varyings {{ @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) i: u32 }}
             @vertex fn vertex(@location(0) position: vec4<f32>, @builtin(vertex_index) i: u32) -> Varyings {{
                 return Varyings(position, i / 3u);
             }}
             @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> {{
                 {last}
                 return vec4(f32(in.i), f32(in.i) * 2.0, 0.0, 1.0);
             }}"
        )
    };
    let (early, late) = (kernel(""), kernel("if in.i > 100000u { discard; }"));
    for depth in [None, Some(DepthState::STANDARD), Some(DepthState::REVERSED)] {
        let draw = |wgsl: &str| {
            let mut scene = Scene::new(wgsl, [90, 70], &positions);
            scene.state.cull = CullMode::None;
            scene.state.depth = depth;
            scene.depth = depth.map(|_| Format::Depth32Float);
            scene.clear_depth = 0.5;
            scene.draw()
        };
        let (early, late) = (draw(&early), draw(&late));
        assert!(early.bytes() == late.bytes(), "{depth:?}");
        if depth.is_none() {
            // The last one that covers a pixel: drawn one by one.
            let wgsl = kernel("");
            let mut scene = Scene::new(&wgsl, [90, 70], &positions);
            let (program, executor) = (scene.program(), Executor::new(1).unwrap());
            let targets = scene.targets();
            for i in 0..400 {
                scene.range.first = i * 3;
                scene.range.count = 3;
                scene.try_draw(&program, &executor, &targets, &[]).unwrap();
            }
            assert!(targets.bytes() == early.bytes());
        }
    }
}

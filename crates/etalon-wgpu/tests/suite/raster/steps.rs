//! Steps of draws among other steps, frame by frame.

use super::{CLEAR, Scene, colours, flat, kernels, on_routes, rectangle};
use crate::common::{on_vulkan, plan, words};
use etalon_core::Format;
use etalon_core::backend::{Backend, Inputs};
use etalon_core::graph::{ClearValue, Draw, Graph, Load};
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::Capture;
use etalon_core::raster::{Blend, TargetState};
use etalon_core::resource::{BufferDesc, TextureDesc};
use glam::Vec4;

#[test]
fn each_draw_has_its_own_uniforms() {
    let scene = || {
        let mut scene = Scene::default();
        let size = (8, 1);
        let draws: Vec<Draw> = ["a", "b", "c", "d", "e", "f", "g", "h"]
            .into_iter()
            .enumerate()
            .map(|(index, name)| {
                let x = index as f32;
                let corners = rectangle(size, (x, 0.0), (x + 1.0, 1.0), 0.0);
                let buffer = scene.floats(name, &corners);
                flat(buffer, [x, 2.0 * x, -x, 1.0]).elements(0..6)
            })
            .collect();
        scene.draw(size, Format::Rgba16Float, draws);
        scene
    };
    on_routes(&kernels(), scene, |execution| {
        for (x, _, colour) in colours(execution, "image") {
            let x = x as f32;
            assert_eq!(colour, [x, 2.0 * x, -x, 1.0]);
        }
    });
}

fn mixed_kernels() -> KernelLibrary {
    let mut library = kernels();
    library.add_source(
        "test/corners",
        "@group(0) @binding(0) var<storage, read_write> corners: array<vec4f>;
         @compute @workgroup_size(3)
         fn main(@builtin(local_invocation_index) index: u32) {
             corners[index] = vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
         }",
    );
    library.add_source(
        "test/sum",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
         @compute @workgroup_size(1) fn main() {
             var sum = 0.0;
             for (var y = 0; y < 4; y++) {
                 for (var x = 0; x < 8; x++) { sum += textureLoad(source, vec2i(x, y), 0).x; }
             }
             sums[0] = u32(sum);
         }",
    );
    library.add_source(
        "test/textured",
        "@group(0) @binding(4) var source: texture_2d<f32>;
         @group(0) @binding(1) var near: sampler;
         @group(0) @binding(7) var<storage, read> scales: array<f32>;
         struct Corner { @builtin(position) clip: vec4f, @location(0) scale: f32 }
         @vertex fn vertex(@location(0) position: vec4f) -> Corner { return Corner(position, scales[1]); }
         @fragment fn fragment(corner: Corner) -> @location(0) vec4f {
             let size = vec2f(textureDimensions(source));
             return corner.scale * textureSampleLevel(source, near, corner.clip.xy / size, 0.0);
         }",
    );
    library
}

/// A dispatch makes the vertices, draws make the colours, a dispatch reads them.
#[test]
fn draws_come_after_dispatches_and_before() {
    let scene = || {
        let mut scene = Scene::default();
        let graph = &mut scene.graph;
        let corners = graph.buffer("corners", BufferDesc { bytes: 48 });
        let corners = graph
            .compute("test/corners")
            .write_buffer("corners", corners)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("corners")
            .unwrap();
        let target = scene.target((8, 4), Format::Rgba8Unorm);
        let draw = flat(corners, [1.0; 4]).elements(0..3);
        let pass = scene.graph.raster("draws").colour("colour", target, CLEAR);
        let written = pass.draw(draw).finish().unwrap();
        let sums = scene.graph.buffer("sums", BufferDesc { bytes: 4 });
        let sums = scene
            .graph
            .compute("test/sum")
            .read("source", written.texture("colour").unwrap())
            .write_buffer("sums", sums)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("sums")
            .unwrap();
        scene.graph.output_buffer("sums", sums).unwrap();
        scene
    };
    on_routes(&mixed_kernels(), scene, |execution| {
        assert_eq!(words(execution, "sums"), [32]);
    });
}

/// Textures, samplers and storage buffers, at binding numbers with gaps.
#[test]
fn draws_read_what_other_draws_have_drawn() {
    let scene = || {
        let mut scene = Scene {
            fast: true,
            ..Scene::default()
        };
        let size = (8, 4);
        let first = scene.target(size, Format::Rgba16Float);
        let draw = Draw::new("test/centres").elements(0..3);
        let pass = scene.graph.raster("first").colour("colour", first, CLEAR);
        let first = pass.draw(draw).finish().unwrap().texture("colour").unwrap();
        let corners = scene.floats("corners", &rectangle(size, (2.0, 0.0), (8.0, 4.0), 0.0));
        let scales = scene.floats("scales", &[100.0, 2.0]);
        let second = scene.target(size, Format::Rgba16Float);
        let draw = Draw::new("test/textured")
            .vertices(corners, 0, super::positions())
            .read("source", first)
            .read_buffer("scales", scales)
            .sampler("near", etalon_core::resource::SamplerDesc::default())
            .elements(0..6);
        let pass = scene.graph.raster("second").colour("colour", second, CLEAR);
        let second = pass.draw(draw).finish().unwrap().texture("colour").unwrap();
        scene.graph.output("image", second).unwrap();
        scene
    };
    on_routes(&mixed_kernels(), scene, |execution| {
        for (x, y, colour) in colours(execution, "image") {
            let wanted = if x < 2 {
                [0.0; 4]
            } else {
                [2.0 * x as f32 + 1.0, 2.0 * y as f32 + 1.0, 14.0, 2.0]
            };
            assert_eq!(colour, wanted, "at {x}, {y}");
        }
    });
}

#[test]
fn draws_are_timed_as_other_steps_are() {
    on_vulkan(|backend| {
        let mut scene = Scene::default();
        let draw = Draw::new("test/centres").elements(0..3);
        scene.draw((16, 16), Format::Rgba16Float, [draw]);
        let execution = scene.run(backend, &kernels());
        let steps: Vec<&str> = execution
            .times
            .iter()
            .map(|time| time.step.as_str())
            .collect();
        assert_eq!(steps, ["draws"]);
    });
}

/// A history that each frame draws into, additively, over a copy of the last.
fn accumulating(colour: f32) -> Graph {
    let desc = TextureDesc::d2(8, 4, Format::Rgba16Float);
    let mut graph = Graph::new();
    let history = graph
        .history("sum", desc, ClearValue::Float([0.0; 4]))
        .unwrap();
    let copied = graph.copy(history.previous, history.current).unwrap();
    let corners = graph
        .import_buffer("corners", BufferDesc { bytes: 6 * 16 })
        .unwrap();
    let state = super::with_target(TargetState {
        blend: Some(Blend::ADD),
        ..TargetState::default()
    });
    let draw = flat(corners, [colour; 4]).elements(0..6).state(state);
    let pass = graph.raster("draws").colour("colour", copied, Load::Keep);
    let written = pass.draw(draw).finish().unwrap();
    graph
        .output("sum", written.texture("colour").unwrap())
        .unwrap();
    graph
}

#[test]
fn histories_are_drawn_into_and_steady_frames_make_nothing() {
    on_vulkan(|backend| {
        let corners: Vec<u8> = rectangle((8, 4), (0.0, 0.0), (8.0, 4.0), 0.0)
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let (mut sum, mut made) = (0.0, None);
        for frame in 1..8_u8 {
            let value = f32::from(frame);
            sum += value;
            let plan = plan(backend, &accumulating(value), &kernels(), Capture::Outputs);
            let inputs = Inputs::new().buffer("corners", &corners);
            let execution = backend.execute(&plan, &inputs).unwrap();
            for (_, _, colour) in colours(&execution, "sum") {
                assert_eq!(colour, [sum; 4]);
            }
            let counters = backend.counters();
            assert_eq!(counters.draws, u64::from(frame));
            let now = (counters.made(), backend.views_created());
            if frame > 2 {
                assert_eq!(now, *made.get_or_insert(now));
            }
        }
        backend.trim();
        let made = backend.counters();
        let plan = plan(backend, &accumulating(1.0), &kernels(), Capture::Outputs);
        let inputs = Inputs::new().buffer("corners", &corners);
        backend.execute(&plan, &inputs).unwrap();
        let after = backend.counters();
        assert_eq!(
            (after.pipelines, after.kernels, after.textures),
            (made.pipelines, made.kernels, made.textures)
        );
    });
}

#[test]
fn pipelines_are_shared_by_draws_that_are_alike() {
    on_vulkan(|backend| {
        let run = |backend: &mut etalon_wgpu::WgpuBackend, format| {
            let mut scene = Scene::default();
            let corners = scene.floats("corners", &rectangle((4, 4), (0.0, 0.0), (4.0, 4.0), 0.0));
            let blended = super::with_target(TargetState {
                blend: Some(Blend::OVER),
                ..TargetState::default()
            });
            let draw = || flat(corners, [0.5; 4]).elements(0..6);
            scene.draw((4, 4), format, [draw(), draw().state(blended), draw()]);
            scene.run(backend, &kernels());
            let counters = backend.counters();
            (counters.kernels, counters.pipelines)
        };
        let library = run(backend, Format::Rgba8Unorm);
        assert_eq!(library, (1, 2));
        assert_eq!(run(backend, Format::Rgba8Unorm), (1, 2));
        // Another format makes other pipelines, of the same shaders.
        assert_eq!(run(backend, Format::Rg16Float), (1, 4));
    });
}

#[test]
fn uniforms_change_from_frame_to_frame() {
    on_vulkan(|backend| {
        for frame in 0..3_u8 {
            let mut scene = Scene::default();
            let corners = scene.floats("corners", &rectangle((2, 2), (0.0, 0.0), (2.0, 2.0), 0.0));
            let colour = Vec4::splat(f32::from(frame));
            let draw = flat(corners, colour.into()).elements(0..6);
            scene.draw((2, 2), Format::Rgba16Float, [draw]);
            let execution = scene.run(backend, &kernels());
            for (_, _, seen) in colours(&execution, "image") {
                assert_eq!(Vec4::from(seen), colour);
            }
        }
    });
}

//! Targets of every kind, several at once, cleared, kept and left alone.

use super::{CLEAR, Scene, kernels, on_routes, pixels, positions, rectangle};
use crate::common::on_vulkan;
use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::graph::{ClearValue, Draw, Load};
use etalon_core::texel::Texel;

/// Values that every format of the kind holds without rounding.
fn exact(format: Format) -> ClearValue {
    match (format.sample_kind(), format.encoding()) {
        (SampleKind::Uint, _) => ClearValue::Uint([200, 3, 255, 1]),
        (SampleKind::Sint, _) => ClearValue::Sint([-100, 3, 127, -1]),
        (_, Encoding::Float) => ClearValue::Float([0.5, -2.0, 0.25, 1.0]),
        _ => ClearValue::Float([1.0, 0.0, 1.0, 1.0]),
    }
}

fn texel(value: ClearValue) -> Texel {
    match value {
        ClearValue::Float(value) => Texel::Float(value),
        ClearValue::Sint(value) => Texel::Sint(value),
        ClearValue::Uint(value) => Texel::Uint(value),
    }
}

#[test]
fn a_pass_without_draws_clears() {
    for format in Format::ALL
        .iter()
        .copied()
        .filter(|format| format.renderable())
    {
        let depth = format.sample_kind() == SampleKind::Depth;
        let value = if depth {
            ClearValue::Float([1.0; 4])
        } else {
            exact(format)
        };
        let scene = || {
            let mut scene = Scene::default();
            let target = scene.target((5, 3), format);
            let pass = scene.graph.raster("clear");
            let image = if depth {
                pass.depth(target, Load::Clear(value))
            } else {
                pass.colour("depth", target, Load::Clear(value))
            };
            let image = image.finish().unwrap().texture("depth").unwrap();
            scene.graph.output("image", image).unwrap();
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            let image = execution.output("image").unwrap();
            let mut wanted = vec![0; format.texel_bytes() as usize];
            format.encode(texel(value), &mut wanted);
            for bytes in image.bytes.chunks_exact(wanted.len()) {
                assert_eq!(bytes, wanted, "{format}");
            }
        });
    }
}

#[test]
fn integers_are_cleared_to_their_limits() {
    for (format, value) in [
        (Format::R32Uint, ClearValue::Uint([u32::MAX; 4])),
        (Format::R32Sint, ClearValue::Sint([i32::MIN; 4])),
        (
            Format::Rgba32Sint,
            ClearValue::Sint([i32::MAX, i32::MIN, -1, 16_777_217]),
        ),
    ] {
        let scene = || {
            let mut scene = Scene::default();
            let target = scene.target((2, 2), format);
            let pass = scene
                .graph
                .raster("clear")
                .colour("id", target, Load::Clear(value));
            let image = pass.finish().unwrap().texture("id").unwrap();
            scene.graph.output("image", image).unwrap();
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            let mut wanted = vec![0; format.texel_bytes() as usize];
            format.encode(texel(value), &mut wanted);
            for bytes in execution
                .output("image")
                .unwrap()
                .bytes
                .chunks_exact(wanted.len())
            {
                assert_eq!(bytes, wanted, "{format}");
            }
        });
    }
}

const MANY: &str = "
    struct Params { id: u32, change: i32 }
    @group(0) @binding(0) var<uniform> params: Params;
    @vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
    struct Targets {
        @location(2) change: i32,
        @location(0) colour: vec4f,
        @location(1) id: u32,
        @location(3) motion: vec2f,
    }
    @fragment fn fragment(@builtin(position) position: vec4f) -> Targets {
        return Targets(params.change, vec4f(1.0, 0.0, 1.0, 0.0), params.id + u32(position.x),
            vec2f(position.y, -position.x));
    }";

/// Puts out for the second target alone.
const ONE: &str = "
    @vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
    struct Targets { @location(1) id: u32 }
    @fragment fn fragment() -> Targets { return Targets(5u); }";

/// Puts out nothing.
const NONE: &str = "
    @vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }";

#[test]
fn each_target_gets_its_output_and_those_without_stay() {
    let mut library = kernels();
    for (path, source) in [("test/many", MANY), ("test/one", ONE), ("test/none", NONE)] {
        library.add_source(path, source);
    }
    let scene = || {
        let mut scene = Scene::default();
        let size = (8, 2);
        let targets = [
            ("colour", Format::Rgba8Unorm, CLEAR),
            ("id", Format::R32Uint, Load::Clear(ClearValue::Uint([0; 4]))),
            (
                "change",
                Format::R16Sint,
                Load::Clear(ClearValue::Sint([0; 4])),
            ),
            ("motion", Format::Rg16Float, CLEAR),
        ];
        let all = scene.floats("all", &rectangle(size, (0.0, 0.0), (8.0, 2.0), 0.0));
        let left = scene.floats("left", &rectangle(size, (0.0, 0.0), (4.0, 2.0), 0.0));
        let textures = targets.map(|(_, format, _)| scene.target(size, format));
        let mut pass = scene.graph.raster("draws");
        for ((name, _, load), texture) in targets.iter().zip(textures) {
            pass = pass.colour(*name, texture, *load);
        }
        let draw = |path, corners| {
            Draw::new(path)
                .vertices(corners, 0, positions())
                .elements(0..6)
        };
        let written = pass
            .draw(
                draw("test/many", all)
                    .set("id", 4_000_000_000_u32)
                    .set("change", -3),
            )
            .draw(draw("test/one", left))
            .draw(draw("test/none", all))
            .finish()
            .unwrap();
        for (name, _, _) in targets {
            scene
                .graph
                .output(name, written.texture(name).unwrap())
                .unwrap();
        }
        scene
    };
    on_routes(&library, scene, |execution| {
        for (_, _, texel) in pixels(execution, "colour") {
            assert_eq!(texel, Texel::Float([1.0, 0.0, 1.0, 0.0]));
        }
        for (x, _, texel) in pixels(execution, "id") {
            let wanted = if x < 4 { 5 } else { 4_000_000_000 + x };
            assert_eq!(texel, Texel::Uint([wanted, 0, 0, 1]));
        }
        for (_, _, texel) in pixels(execution, "change") {
            assert_eq!(texel, Texel::Sint([-3, 0, 0, 1]));
        }
        for (x, y, texel) in pixels(execution, "motion") {
            let wanted = [y as f32 + 0.5, -(x as f32) - 0.5, 0.0, 1.0];
            assert_eq!(texel, Texel::Float(wanted));
        }
    });
}

#[test]
fn a_kernel_may_put_out_its_own_depth_and_drop_fragments() {
    on_vulkan(|backend| {
        let mut library = kernels();
        library.add_source(
            "test/own",
            "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
             struct Out { @builtin(frag_depth) depth: f32, @location(0) colour: vec4f }
             @fragment fn fragment(@builtin(position) position: vec4f) -> Out {
                 if position.x > 2.0 { discard; }
                 return Out(0.5 * position.x, vec4f(1.0));
             }",
        );
        let mut scene = Scene::default();
        let size = (4, 1);
        let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (4.0, 1.0), 0.0));
        let colour = scene.target(size, Format::Rgba8Unorm);
        let depth = scene.target(size, Format::Depth32Float);
        let state = etalon_core::raster::RasterState {
            depth: Some(etalon_core::raster::DepthState::REVERSED),
            ..Default::default()
        };
        let draw = Draw::new("test/own")
            .vertices(corners, 0, positions())
            .elements(0..6);
        let written = scene
            .graph
            .raster("draws")
            .colour("colour", colour, CLEAR)
            .depth(depth, CLEAR)
            .draw(draw.state(state))
            .finish()
            .unwrap();
        for name in ["colour", "depth"] {
            scene
                .graph
                .output(name, written.texture(name).unwrap())
                .unwrap();
        }
        let execution = scene.run(backend, &library);
        let depths: Vec<f32> = super::colours(&execution, "depth")
            .iter()
            .map(|(_, _, depth)| depth[0])
            .collect();
        assert_eq!(depths, [0.25, 0.75, 0.0, 0.0]);
        let reds: Vec<f32> = super::colours(&execution, "colour")
            .iter()
            .map(|(_, _, colour)| colour[0])
            .collect();
        assert_eq!(reds, [1.0, 1.0, 0.0, 0.0]);
    });
}

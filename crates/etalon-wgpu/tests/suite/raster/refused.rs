//! Draws that cannot be drawn, and how that is said.

use super::{CLEAR, Scene, flat, kernels, positions, rectangle};
use crate::common::{Route, on_vulkan, open, plan};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::{Buffer, ClearValue, Draw, ResourceDesc};
use etalon_core::plan::{Capture, DrawExtent, Plan, RasterStep, Step};
use etalon_core::raster::{Blend, DepthState, IndexFormat, RasterState, TargetState, VertexFormat};
use etalon_wgpu::WgpuBackend;

#[test]
fn outputs_with_too_few_numbers_are_refused() {
    on_vulkan(|backend| {
        let mut library = kernels();
        library.add_source(
            "test/short",
            "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
             @fragment fn fragment() -> @location(0) vec2f { return vec2f(1.0); }",
        );
        let mut scene = Scene::default();
        let corners = scene.floats("corners", &rectangle((2, 2), (0.0, 0.0), (2.0, 2.0), 0.0));
        let draw = Draw::new("test/short")
            .vertices(corners, 0, positions())
            .elements(0..6);
        scene.draw((2, 2), Format::Rgba8Unorm, [draw]);
        unsupported(&scene.attempt(backend, &library).unwrap_err(), "2 numbers");
    });
}

fn unsupported(error: &BackendError, text: &str) {
    let BackendError::Unsupported { step, what } = error else {
        panic!("{error}");
    };
    assert_eq!(step, "draws");
    assert!(what.contains(text), "no `{text}` in: {error}");
}

/// A pass with a colour and a depth target and two draws, one of them indirect.
fn busy() -> Scene {
    let mut scene = Scene::default();
    let size = (4, 4);
    let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (4.0, 4.0), 0.5));
    let indices = scene.words("indices", &[0, 1, 2, 3, 4, 5]);
    let records = scene.words("records", &[6, 1, 0, 0]);
    let colour = scene.target(size, Format::Rgba8Unorm);
    let depth = scene.target(size, Format::Depth32Float);
    let state = RasterState {
        depth: Some(DepthState::REVERSED),
        ..RasterState::default()
    };
    let indexed =
        |corners: Buffer| flat(corners, [1.0; 4]).indices(indices, 0, IndexFormat::Uint32);
    let written = scene
        .graph
        .raster("draws")
        .colour("colour", colour, CLEAR)
        .depth(depth, CLEAR)
        .draw(indexed(corners).elements(0..6).state(state))
        .draw(flat(corners, [1.0; 4]).indirect(records, 0, 1))
        .finish()
        .unwrap();
    let image = written.texture("colour").unwrap();
    scene.graph.output("image", image).unwrap();
    scene
}

fn raster(plan: &mut Plan) -> &mut RasterStep {
    match &mut plan.steps[0].step {
        Step::Raster(step) => step,
        other => panic!("{other:?}"),
    }
}

#[test]
fn plans_of_draws_that_contradict_themselves_are_refused() {
    type Spoil = fn(&mut RasterStep);
    let spoils: [Spoil; 27] = [
        |step| step.colours[0].resource = 99,
        |step| step.colours[0].range.layers = 2,
        |step| step.colours[0].clear = Some(ClearValue::Uint([0; 4])),
        |step| step.size = [5, 4],
        |step| step.colours.push(step.colours[0].clone()),
        |step| step.depth = Some(step.colours[0].clone()),
        |step| step.depth = None,
        |step| {
            step.colours.clear();
            step.depth = None;
        },
        |step| step.viewport.width = f32::NAN,
        |step| step.scissor.x = 3,
        |step| {
            step.draws[0].bindings.pop();
        },
        |step| step.draws[0].state.targets.clear(),
        |step| {
            let depth = &mut step.draws[0].state.depth;
            *depth = depth.map(|mut depth| {
                depth.bias.slope = f32::INFINITY;
                depth
            });
        },
        |step| step.draws[0].vertices.clear(),
        |step| step.draws[0].vertices[0].layout.attributes[0].location = 7,
        |step| step.draws[0].vertices[0].layout.attributes[0].format = VertexFormat::Uint32x4,
        |step| step.draws[0].vertices[0].layout.attributes[0].offset = 4,
        |step| step.draws[0].vertices[0].offset = 2,
        |step| step.draws[0].vertices[0].layout.stride = 17,
        |step| step.draws[0].vertices[0].layout.stride = u32::MAX - 3,
        |step| step.draws[0].vertices[0].buffer = 99,
        |step| step.draws[1].vertices[0].offset = 1 << 40,
        |step| {
            if let Some(indices) = &mut step.draws[0].indices {
                indices.offset = 1;
            }
        },
        |step| {
            if let DrawExtent::Direct { elements, .. } = &mut step.draws[0].extent {
                elements.end = u32::MAX;
            }
        },
        |step| {
            if let DrawExtent::Indirect { draws, .. } = &mut step.draws[1].extent {
                *draws = u32::MAX;
            }
        },
        |step| {
            if let DrawExtent::Indirect { offset, .. } = &mut step.draws[1].extent {
                *offset = u64::MAX - 3;
            }
        },
        |step| {
            if let DrawExtent::Indirect { buffer, .. } = &mut step.draws[1].extent {
                *buffer = 0;
                step.draws[1].vertices[0].buffer = u32::MAX;
            }
        },
    ];
    on_vulkan(|backend| {
        let scene = busy();
        let good = plan(backend, &scene.graph, &kernels(), Capture::Outputs);
        for (index, spoil) in spoils.iter().enumerate() {
            let mut plan = good.clone();
            spoil(raster(&mut plan));
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            assert!(
                matches!(
                    error,
                    BackendError::Api { call: "plan", .. } | BackendError::Unsupported { .. }
                ),
                "{index}: {error}"
            );
        }
        let execution = scene.run(backend, &kernels());
        for (_, _, colour) in super::colours(&execution, "image") {
            assert_eq!(colour, [1.0; 4]);
        }
    });
}

#[test]
fn formats_that_a_device_does_not_draw_to_or_blend_are_refused() {
    let Some(opened) = open(Route::Vulkan) else {
        return;
    };
    // Without its adapter a device is taken to have what WebGPU guarantees.
    let (device, queue) = (opened.device().clone(), opened.queue().clone());
    let mut backend = WgpuBackend::adopt(device, queue, None);
    let mut scene = Scene::default();
    let corners = scene.floats("corners", &rectangle((4, 4), (0.0, 0.0), (4.0, 4.0), 0.5));
    let state = super::with_target(TargetState {
        blend: Some(Blend::ADD),
        ..TargetState::default()
    });
    let draw = flat(corners, [1.0; 4]).elements(0..6).state(state);
    let target = scene.target((4, 4), Format::Rgba8Unorm);
    let pass = scene.graph.raster("draws").colour("colour", target, CLEAR);
    let written = pass.draw(draw).finish().unwrap();
    let image = written.texture("colour").unwrap();
    scene.graph.output("image", image).unwrap();
    let good = plan(&backend, &scene.graph, &kernels(), Capture::None);
    for (format, text) in [
        (Format::Rgba8Snorm, "rgba8snorm"),
        (Format::Rgb9e5Ufloat, "rgb9e5ufloat"),
        (Format::Rgba32Float, "blending with rgba32float"),
    ] {
        let mut plan = good.clone();
        for resource in &mut plan.resources {
            if let ResourceDesc::Texture(desc) = &mut resource.desc {
                desc.format = format;
            }
        }
        let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
        unsupported(&error, text);
    }
}

#[test]
fn targets_over_the_limits_are_refused() {
    on_vulkan(|backend| {
        // Eight times sixteen bytes are over what most devices hold for a pixel.
        let most = backend
            .device()
            .limits()
            .max_color_attachment_bytes_per_sample;
        let mut scene = Scene::default();
        let targets: Vec<_> = (0..8)
            .map(|_| scene.target((2, 2), Format::Rgba32Float))
            .collect();
        let mut pass = scene.graph.raster("draws");
        for (index, target) in targets.into_iter().enumerate() {
            pass = pass.colour(format!("c{index}"), target, CLEAR);
        }
        let written = pass.finish().unwrap();
        scene
            .graph
            .output("image", written.texture("c7").unwrap())
            .unwrap();
        match scene.attempt(backend, &kernels()) {
            Ok(_) => assert!(most >= 128),
            Err(error) => unsupported(&error, "bytes a pixel"),
        }
    });
}

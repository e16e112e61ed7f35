//! Draws on devices that engines lend.

use crate::common;

use ash::vk;
use common::draw::{Scene, ZERO, corners, quad, state, tinted};
use common::engine::{DRAWING, Engine, REQUIRED};
use common::plan;
use etalon_ash::{
    AdoptedBuffer, AshBackend, AshBindings, AshOptions, BufferState, Features, TextureState,
};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError};
use etalon_core::graph::{ClearValue, Draw, Graph, Load};
use etalon_core::plan::Capture;
use etalon_core::raster::{Blend, DepthBias, DepthState, IndexFormat, TargetState};
use etalon_core::resource::{BufferDesc, TextureDesc};

const SIZE: [u32; 2] = [8, 6];
const DESC: TextureDesc = TextureDesc::d2(8, 6, Format::R32Float);

/// As copies want it.
const COPIED: TextureState = TextureState {
    layout: vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
    stages: vk::PipelineStageFlags2::COPY,
    access: vk::AccessFlags2::TRANSFER_READ,
};

fn on_each(features: Features, test: impl Fn(&Engine, &mut AshBackend)) {
    for device in common::devices() {
        println!("on {device}");
        let engine = Engine::with(&device, features);
        // SAFETY: the backend is dropped before the engine, and the tests wait
        // for what they submit.
        let mut backend =
            unsafe { AshBackend::adopt(engine.lend(), AshOptions::default()) }.unwrap();
        test(&engine, &mut backend);
        drop(backend);
        let messages = engine.finish();
        assert!(messages.is_empty(), "{}", messages.join("\n\n"));
    }
}

/// A colour target and what is to be drawn to it.
fn drawing(draws: impl FnOnce(&mut Scene) -> Vec<Draw>) -> Scene {
    let mut scene = Scene::new();
    let draws = draws(&mut scene);
    let colour = scene.target("colour", SIZE, Format::Rgba16Float);
    let second = scene.target("second", SIZE, Format::Rgba16Float);
    let depth = scene.target("depth", SIZE, Format::Depth32Float);
    let written = scene
        .graph
        .raster("pass")
        .colour("colour", colour, ZERO)
        .colour("second", second, ZERO)
        .depth(depth, ZERO)
        .draws(draws)
        .finish()
        .unwrap();
    let texture = written.texture("colour").unwrap();
    scene.graph.output("colour", texture).unwrap();
    scene
}

/// One kind of draw for each feature.
fn needing(feature: &str) -> Scene {
    drawing(|scene| {
        let mesh = scene.floats("mesh", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
        let shorts = scene.shorts("shorts", &[0, 1, 2, 3, 4, 5]);
        let words = scene.words("words", &[0, 1, 2, 3, 4, 5]);
        let records = scene.words("records", &[3, 1, 0, 0, 3, 1, 0, 0]);
        let same = state(|state| {
            let target = TargetState {
                blend: Some(Blend::ADD),
                writes: etalon_core::raster::ColourWrites::NONE,
            };
            state.targets = vec![target; 2];
        });
        // Without vertices and outputs but for what is asked for.
        let nothing = Draw::new("draw/depth").vertices(mesh, 0, corners());
        let biased = |clamp| {
            let bias = DepthBias {
                constant: 1,
                slope: 0.0,
                clamp,
            };
            state(|state| {
                state.depth = Some(DepthState {
                    bias,
                    ..DepthState::REVERSED
                });
            })
        };
        vec![match feature {
            "independentBlend" => tinted(mesh, [1.0; 4]).elements(0..6).state(same),
            "depthBiasClamp" => nothing.elements(0..6).state(biased(0.5)),
            "a bias without clamp" => nothing.elements(0..6).state(biased(0.0)),
            "robustBufferAccess" => nothing
                .indices(shorts, 0, IndexFormat::Uint16)
                .elements(0..6),
            "fullDrawIndexUint32" => nothing
                .indices(words, 0, IndexFormat::Uint32)
                .elements(0..6),
            "drawIndirectFirstInstance" => nothing.indirect(records, 0, 2),
            _ => nothing.elements(0..6),
        }]
    })
}

#[test]
fn features_are_missed_by_the_draws_that_need_them() {
    type Without = fn(&mut Features);
    let cases: [(&str, Without); 6] = [
        ("dynamicRendering", |it| it.dynamic_rendering = false),
        ("independentBlend", |it| it.independent_blend = false),
        ("depthBiasClamp", |it| it.depth_bias_clamp = false),
        ("robustBufferAccess", |it| it.robust_buffer_access = false),
        ("fullDrawIndexUint32", |it| {
            it.full_draw_index_uint32 = false;
        }),
        ("drawIndirectFirstInstance", |it| {
            it.draw_indirect_first_instance = false;
        }),
    ];
    for (name, without) in cases {
        let mut features = DRAWING;
        without(&mut features);
        on_each(features, |_, backend| {
            for asked in cases
                .map(|(name, _)| name)
                .into_iter()
                .chain(["a bias without clamp", "nothing more"])
            {
                let scene = needing(asked);
                let plan = plan(backend, &scene.graph, Capture::Outputs);
                let found = backend.execute(&plan, &scene.inputs());
                // Records name vertices that only the device knows as well.
                let needs = asked == name
                    || name == "dynamicRendering"
                    || (name, asked) == ("robustBufferAccess", "fullDrawIndexUint32")
                    || (name, asked) == ("robustBufferAccess", "drawIndirectFirstInstance");
                match found {
                    Ok(_) if !needs => {}
                    Err(BackendError::Unsupported { step, what }) if needs => {
                        assert_eq!(step, "pass");
                        assert!(what.contains(&format!("`{name}`")), "{what}");
                    }
                    other => panic!("{asked} without {name}: {other:?}"),
                }
            }
            // What does not draw needs none of them.
            let mut graph = Graph::new();
            let cleared = graph.texture("cleared", DESC);
            let cleared = graph.clear(cleared, ClearValue::Float([1.0; 4])).unwrap();
            graph.output("cleared", cleared).unwrap();
            let plan = plan(backend, &graph, Capture::Outputs);
            let inputs = etalon_core::backend::Inputs::new();
            backend.execute(&plan, &inputs).unwrap();
        });
    }
}

/// Without `multiDrawIndirect` each record has a call of its own.
#[test]
fn records_are_drawn_one_by_one_where_they_must_be() {
    for multi_draw_indirect in [true, false] {
        let features = Features {
            multi_draw_indirect,
            ..DRAWING
        };
        on_each(features, |_, backend| {
            let scene = drawing(|scene| {
                let mesh = scene.floats("mesh", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
                let records = [3, 1, 0, 0, 0, 1, 0, 0, 3, 1, 3, 0, 6, 2, 0, 0];
                let records = scene.words("records", &records);
                let add = TargetState {
                    blend: Some(Blend::ADD),
                    ..TargetState::default()
                };
                let draw = tinted(mesh, [1.0; 4]).indirect(records, 0, 4);
                vec![draw.state(state(|state| state.targets = vec![add; 2]))]
            });
            let plan = plan(backend, &scene.graph, Capture::Outputs);
            let execution = backend.execute(&plan, &scene.inputs()).unwrap();
            let found = common::reds(execution.output("colour").unwrap());
            assert_eq!(found, vec![3.0; 48]);
        });
    }
}

/// Plans that draw and plans that do not take turns with one texture in one
/// command buffer, each finding it at rest and leaving it so.
#[test]
fn plans_that_draw_meet_plans_that_do_not_at_rest() {
    let computing = || {
        let mut graph = Graph::new();
        let source = graph.import_texture("source", DESC).unwrap();
        let result = graph.texture("result", DESC);
        let result = graph
            .compute("test/add")
            .read("source", source)
            .write("result", result)
            .set("offset", 1.0_f32)
            .per_texel("result")
            .unwrap();
        graph.output("result", result).unwrap();
        graph
    };
    let copying = || {
        let mut graph = Graph::new();
        let source = graph.import_texture("source", DESC).unwrap();
        let result = graph.texture("result", DESC);
        let result = graph
            .raster("copy")
            .colour("colour", result, Load::Clear(ClearValue::Float([9.0; 4])))
            .draw(Draw::new("draw/copy").read("source", source).elements(0..3))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        graph.output("result", result).unwrap();
        graph
    };
    on_each(DRAWING, |engine, backend| {
        let usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::STORAGE
            | vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let images = [engine.image(DESC, usage), engine.image(DESC, usage)];
        // SAFETY: as described, and dropped before the engine.
        let textures =
            [0, 1].map(|index| unsafe { backend.adopt_texture(images[index].adopted()).unwrap() });
        let plans = [computing(), copying()].map(|graph| plan(backend, &graph, Capture::None));
        let seen = engine.buffer(DESC.bytes().unwrap());
        let commands = engine.begin();
        engine.fill(commands, &images[0], 2.0);
        let cleared = TextureState {
            layout: vk::ImageLayout::TRANSFER_DST_OPTIMAL,
            stages: vk::PipelineStageFlags2::CLEAR,
            access: vk::AccessFlags2::TRANSFER_WRITE,
        };
        let rest = TextureState::REST;
        for round in 0..6 {
            let (from, to) = (round % 2, 1 - round % 2);
            let arrives = if round == 0 { cleared } else { rest };
            let leaves = if round == 5 { COPIED } else { rest };
            // Compute, draw, draw, compute, compute, draw.
            let plan = &plans[[0, 1, 1, 0, 0, 1][round]];
            let bindings = AshBindings::new()
                .texture_in("source", &textures[from], arrives, rest)
                .output_to("result", &textures[to], rest, leaves);
            // SAFETY: the command buffer is being recorded, and the states are
            // those of the round before.
            unsafe { backend.record(commands, plan, &bindings) }.unwrap();
        }
        engine.download(commands, images[0].image, DESC, &seen);
        engine.wait(engine.submit(commands));
        assert_eq!(engine.floats(&seen), vec![5.0; 48]);
    });
}

/// A buffer that draws read may be written by the next plan.
#[test]
fn vertices_and_records_are_written_again_after_they_were_drawn() {
    let making = |name: &'static str, kernel: &'static str, binding: &'static str, bytes| {
        let mut graph = Graph::new();
        let made = graph.buffer(name, BufferDesc { bytes });
        let made = graph
            .compute(kernel)
            .write_buffer(binding, made)
            .groups([1, 1, 1])
            .unwrap()
            .buffer(binding)
            .unwrap();
        graph.output_buffer(name, made).unwrap();
        graph
    };
    on_each(DRAWING, |engine, backend| {
        let mut graph = Graph::new();
        let mut buffer = |name, bytes| graph.import_buffer(name, BufferDesc { bytes }).unwrap();
        let (corners_of, records) = (buffer("corners", 96), buffer("records", 16));
        let target = graph.texture("target", DESC);
        let drawn = graph
            .raster("tint")
            .colour("colour", target, ZERO)
            .draw(tinted(corners_of, [2.0; 4]).indirect(records, 0, 1))
            .finish()
            .unwrap();
        let texture = drawn.texture("colour").unwrap();
        graph.output("result", texture).unwrap();
        let draws = plan(backend, &graph, Capture::None);
        let makes = [
            making("corners", "draw/make_corners", "corners", 96),
            making("records", "draw/make_records", "records", 16),
        ]
        .map(|graph| plan(backend, &graph, Capture::None));
        let lent = [("corners", 96), ("records", 16)].map(|(name, bytes)| {
            let made = engine.buffer(bytes);
            let adopted = AdoptedBuffer {
                buffer: made.buffer,
                offset: 0,
                bytes,
                usage: vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::VERTEX_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER,
            };
            // SAFETY: as described, and dropped before the engine.
            (name, unsafe { backend.adopt_buffer(adopted) }.unwrap())
        });
        let rest = BufferState::REST;
        let commands = engine.begin();
        let seen = engine.buffer(DESC.bytes().unwrap());
        for round in 0..3 {
            for (plan, (name, buffer)) in makes.iter().zip(&lent) {
                let bindings = AshBindings::new().output_to_buffer(*name, buffer, rest, rest);
                // SAFETY: the command buffer is being recorded, and the buffers
                // are at rest.
                unsafe { backend.record(commands, plan, &bindings) }.unwrap();
            }
            let bindings = lent
                .iter()
                .fold(AshBindings::new(), |bindings, (name, buffer)| {
                    bindings.buffer(*name, buffer)
                });
            let leaves = if round == 2 {
                COPIED
            } else {
                TextureState::REST
            };
            let bindings = bindings.output_in("result", leaves);
            // SAFETY: as above.
            let outputs = unsafe { backend.record(commands, &draws, &bindings) }.unwrap();
            if round == 2 {
                engine.download(commands, outputs.textures["result"].image, DESC, &seen);
            }
        }
        engine.wait(engine.submit(commands));
        assert_eq!(engine.floats(&seen), vec![2.0; 48]);
    });
}

#[test]
fn targets_that_the_engine_did_not_make_for_it_are_refused() {
    on_each(DRAWING, |engine, backend| {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        let image = engine.image(DESC, usage);
        // SAFETY: as described, and dropped before the engine.
        let texture = unsafe { backend.adopt_texture(image.adopted()) }.unwrap();
        let mut graph = Graph::new();
        let target = graph.texture("target", DESC);
        let drawn = graph
            .raster("full")
            .colour("colour", target, ZERO)
            .draw(Draw::new("draw/full").elements(0..3))
            .finish()
            .unwrap();
        graph
            .output("result", drawn.texture("colour").unwrap())
            .unwrap();
        let plan = plan(backend, &graph, Capture::None);
        let commands = engine.begin();
        let rest = TextureState::REST;
        let bindings = AshBindings::new().output_to("result", &texture, rest, rest);
        // SAFETY: as in the other tests.
        match unsafe { backend.record(commands, &plan, &bindings) } {
            Err(BackendError::InputMismatch { name, wanted, .. }) => {
                assert_eq!(name, "result");
                assert!(wanted.contains("COLOR_ATTACHMENT"), "{wanted}");
            }
            other => panic!("{other:?}"),
        }
        engine.wait(engine.submit(commands));
    });
}

#[test]
fn the_features_of_draws_are_not_required() {
    on_each(REQUIRED, |_, backend| {
        assert_eq!(backend.info().backend, "ash");
    });
}

//! Draws in plans with other work, and plans that a device refuses.

use crate::common;

use common::draw::{Scene, ZERO, corners, quad, state, tinted};
use common::{on_each, plan};
use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::{ClearValue, Draw, Graph, Load};
use etalon_core::plan::{Capture, DrawExtent, Plan, RasterStep, Step};
use etalon_core::raster::{DepthState, IndexFormat, TargetState, Viewport};
use etalon_core::resource::{BufferDesc, Dimension, TextureDesc};

const SIZE: [u32; 2] = [8, 6];
const DESC: TextureDesc = TextureDesc::d2(8, 6, Format::R32Float);

/// Compute kernels make corners, records and a texture; a pass draws what they
/// made; a compute kernel and another pass read what was drawn.
fn mixed(rounds: u32) -> Graph {
    let mut graph = Graph::new();
    let base = graph.texture("base", DESC);
    let mut newest = graph.clear(base, ClearValue::Float([1.0; 4])).unwrap();
    for round in 0..rounds {
        let made = graph.buffer(format!("corners {round}"), BufferDesc { bytes: 96 });
        let made = graph
            .compute("draw/make_corners")
            .write_buffer("corners", made)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("corners")
            .unwrap();
        let records = graph.buffer(format!("records {round}"), BufferDesc { bytes: 16 });
        let records = graph
            .compute("draw/make_records")
            .write_buffer("records", records)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("records")
            .unwrap();
        let target = graph.texture(format!("drawn {round}"), DESC);
        let copied = graph
            .raster(format!("copy {round}"))
            .colour("colour", target, ZERO)
            .draw(Draw::new("draw/copy").read("source", newest).elements(0..3))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        let added = graph.texture(format!("added {round}"), DESC);
        let added = graph
            .compute("test/add")
            .read("source", copied)
            .write("result", added)
            .set("offset", 1.0_f32)
            .per_texel("result")
            .unwrap();
        let over = graph.texture(format!("over {round}"), DESC);
        let drawn = graph
            .raster(format!("over {round}"))
            .colour("colour", over, Load::Clear(ClearValue::Float([-1.0; 4])))
            .draw(
                Draw::new("draw/depth")
                    .vertices(made, 0, corners())
                    .indirect(records, 0, 1),
            )
            .draw(Draw::new("draw/copy").read("source", added).elements(0..3))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        let tint = graph.texture(format!("tint {round}"), DESC);
        let tint = graph
            .raster(format!("tint {round}"))
            .colour("colour", tint, ZERO)
            .draw(tinted(made, [0.5, 0.0, 0.0, 0.0]).indirect(records, 0, 1))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        let sum = graph.texture(format!("sum {round}"), DESC);
        newest = graph
            .compute("test/sum_of")
            .read("first", drawn)
            .read("second", tint)
            .write("result", sum)
            .per_texel("result")
            .unwrap();
    }
    graph.output("result", newest).unwrap();
    graph
}

#[test]
fn draws_and_dispatches_read_what_the_others_wrote() {
    on_each(|backend| {
        let plan = plan(backend, &mixed(4), Capture::Outputs);
        assert!(plan.texture_heap < plan.unaliased_bytes);
        for _ in 0..3 {
            let execution = backend.execute(&plan, &Inputs::new()).unwrap();
            let result = execution.output("result").unwrap();
            assert_eq!(common::reds(result), vec![7.0; 48]);
            if !execution.times.is_empty() {
                assert_eq!(execution.times.len(), plan.steps.len() - 1);
            }
        }
    });
}

#[test]
fn a_frame_like_an_earlier_one_makes_nothing() {
    on_each(|backend| {
        let first = plan(backend, &mixed(2), Capture::Outputs);
        backend.execute(&first, &Inputs::new()).unwrap();
        let before = backend.counters();
        // Planned anew, as an engine does in every frame.
        let again = plan(backend, &mixed(2), Capture::Outputs);
        backend.execute(&again, &Inputs::new()).unwrap();
        let after = backend.counters();
        assert_eq!(before.made(), after.made());
        let done = after.since(&before);
        assert_eq!(done.dispatches, again.dispatch_count() as u64);
        assert_eq!(done.draws, again.draw_count() as u64);
        // A longer plan of the same draws makes no kernel and no pipeline.
        let longer = plan(backend, &mixed(3), Capture::Outputs);
        backend.execute(&longer, &Inputs::new()).unwrap();
        assert_eq!(backend.counters().pipelines, after.pipelines);
        assert_eq!(backend.counters().kernels, after.kernels);
    });
}

/// Vertex kernels read what compute kernels wrote, and depth that was drawn is
/// read by fragments, by a compute kernel, and drawn to once more.
#[test]
fn buffers_and_depth_are_read_by_every_kind_of_shader() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let half = quad(SIZE, [0.0, 0.0], [4.0, 6.0], 0.25);
        let half = scene.floats("half", &half);
        let depth = scene.target("depth", SIZE, Format::Depth32Float);
        let graph = &mut scene.graph;
        let made = graph.buffer("corners", BufferDesc { bytes: 96 });
        let made = graph
            .compute("draw/make_corners")
            .write_buffer("corners", made)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("corners")
            .unwrap();
        let nearer = || state(|state| state.depth = Some(DepthState::REVERSED));
        let over = Draw::new("draw/depth").vertices(half, 0, corners());
        let over = over.elements(0..6).state(nearer());
        let all = Draw::new("draw/depth").vertices(made, 0, corners());
        let all = all.elements(0..3).state(nearer());
        let depth = graph.raster("half").depth(depth, ZERO).draw(over);
        let depth = depth.finish().unwrap().texture("depth").unwrap();
        let seen = graph.texture("seen", DESC);
        let seen = graph
            .raster("see")
            .colour("colour", seen, ZERO)
            .draw(
                Draw::new("draw/pulled")
                    .read_buffer("corners", made)
                    .read("depths", depth)
                    .elements(0..3),
            )
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        let read = |graph: &mut Graph, name: &'static str, depth| {
            let read = graph.texture(name, DESC);
            let read = graph
                .compute("draw/read_depth")
                .named(name)
                .read("depths", depth)
                .write("result", read)
                .per_texel("result")
                .unwrap();
            graph.output(name, read).unwrap();
        };
        read(graph, "before", depth);
        let depth = graph.raster("all").depth(depth, Load::Keep).draw(all);
        let depth = depth.finish().unwrap().texture("depth").unwrap();
        read(graph, "after", depth);
        graph.output("seen", seen).unwrap();
        for _ in 0..2 {
            let execution = scene.run(backend);
            let row = |name: &str| common::reds(execution.output(name).unwrap())[..8].to_vec();
            let half = [[0.25; 4], [0.0; 4]].concat();
            assert_eq!((row("seen"), row("before")), (half.clone(), half));
            assert_eq!(row("after"), [0.5; 8]);
        }
    });
}

/// A history that is drawn to, and read by fragments in the next frame.
#[test]
fn histories_are_drawn_to() {
    on_each(|backend| {
        let mut graph = Graph::new();
        let history = graph
            .history("drawn", DESC, ClearValue::Float([3.0; 4]))
            .unwrap();
        let added = graph.texture("added", DESC);
        let added = graph
            .compute("test/add")
            .read("source", history.previous)
            .write("result", added)
            .set("offset", 1.0_f32)
            .per_texel("result")
            .unwrap();
        let kept = graph
            .raster("keep")
            .colour("colour", history.current, ZERO)
            .draw(Draw::new("draw/copy").read("source", added).elements(0..3))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        let seen = graph.texture("seen", DESC);
        let seen = graph
            .raster("see")
            .colour("colour", seen, ZERO)
            .draw(
                Draw::new("draw/copy")
                    .read("source", history.previous)
                    .elements(0..3),
            )
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        graph.output("kept", kept).unwrap();
        graph.output("seen", seen).unwrap();
        let plan = plan(backend, &graph, Capture::Outputs);
        for frame in 0..3 {
            let execution = backend.execute(&plan, &Inputs::new()).unwrap();
            let value = |name: &str| common::reds(execution.output(name).unwrap())[20];
            assert_eq!(value("seen"), 3.0 + frame as f32);
            assert_eq!(value("kept"), 4.0 + frame as f32);
        }
    });
}

/// One layer and one mip of textures that have more.
#[test]
fn parts_of_textures_are_drawn_to() {
    on_each(|backend| {
        let mut graph = Graph::new();
        let desc = TextureDesc {
            extent: etalon_core::resource::Extent {
                width: 16,
                height: 12,
                depth_or_layers: 3,
            },
            mips: 2,
            ..DESC
        };
        let all = graph.texture("all", desc);
        let cleared = graph.clear(all, ClearValue::Float([2.0; 4])).unwrap();
        let drawn = graph
            .raster("part")
            .colour("colour", cleared.mip(1).layer(2), ZERO)
            .draw(Draw::new("draw/full").elements(0..3))
            .finish()
            .unwrap()
            .texture("colour")
            .unwrap();
        graph.output("all", drawn).unwrap();
        let execution = common::execute(backend, &graph, &Inputs::new());
        let image = execution.output("all").unwrap();
        for mip in 0..2 {
            for layer in 0..3 {
                let expected = if (mip, layer) == (1, 2) { 5.5 } else { 2.0 };
                let texel = image.texel(5, 3, layer, mip).unwrap();
                assert_eq!(texel.to_f32()[0], expected, "mip {mip}, layer {layer}");
            }
        }
    });
}

fn raster(plan: &mut Plan) -> &mut RasterStep {
    plan.steps
        .iter_mut()
        .find_map(|step| match &mut step.step {
            Step::Raster(raster) => Some(raster),
            _ => None,
        })
        .unwrap()
}

/// A pass with everything that can be tampered with.
fn scene() -> Scene {
    let mut scene = Scene::new();
    let mesh = scene.floats("mesh", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
    let indices = scene.words("indices", &[0, 1, 2, 3, 4, 5]);
    let records = scene.words("records", &[6, 1, 0, 0, 0]);
    let colour = scene.target("colour", SIZE, Format::R32Float);
    let depth = scene.target("depth", SIZE, Format::Depth32Float);
    let draw = || {
        tinted(mesh, [1.0; 4])
            .indices(indices, 0, IndexFormat::Uint32)
            .state(state(|state| state.depth = Some(DepthState::REVERSED)))
    };
    let written = scene
        .graph
        .raster("pass")
        .colour("colour", colour, ZERO)
        .depth(depth, ZERO)
        .draw(draw().elements(0..6))
        .draw(draw().indirect(records, 0, 1))
        .finish()
        .unwrap();
    let texture = written.texture("colour").unwrap();
    scene.graph.output("colour", texture).unwrap();
    scene
}

#[test]
fn plans_that_were_tampered_with_are_refused() {
    on_each(|backend| {
        let scene = scene();
        let good = plan(backend, &scene.graph, Capture::Outputs);
        type Change = fn(&mut RasterStep);
        let changes: [(&str, Change); 20] = [
            ("size", |raster| raster.size[0] = 7),
            ("no targets", |raster| {
                raster.colours.clear();
                raster.depth = None;
                raster.draws.clear();
            }),
            ("viewport", |raster| raster.viewport = Viewport::of(9, 6)),
            ("not a number", |raster| raster.viewport.near = f32::NAN),
            ("scissor", |raster| raster.scissor.x = u32::MAX),
            ("mips", |raster| raster.colours[0].range.mip = 1),
            ("twice", |raster| {
                let again = raster.colours[0].clone();
                raster.colours.push(again);
            }),
            ("clear", |raster| {
                raster.colours[0].clear = Some(ClearValue::Uint([1; 4]));
            }),
            ("depth as colour", |raster| {
                raster.colours[0].resource = raster.depth.as_ref().unwrap().resource;
            }),
            ("depth that is not there", |raster| raster.depth = None),
            ("states", |raster| {
                raster.draws[0].state.targets = vec![TargetState::default(); 3];
            }),
            ("bindings", |raster| raster.draws[0].bindings.clear()),
            ("a buffer that is not there", |raster| {
                raster.draws[0].vertices[0].buffer = 1000;
            }),
            ("a texture for vertices", |raster| {
                raster.draws[0].vertices[0].buffer = raster.colours[0].resource;
            }),
            ("inputs", |raster| raster.draws[0].vertices.clear()),
            ("a stride", |raster| {
                raster.draws[0].vertices[0].layout.stride = 6
            }),
            ("attributes out of the element", |raster| {
                raster.draws[0].vertices[0].layout.attributes[0].offset = u32::MAX - 3;
            }),
            ("vertices behind the end", |raster| {
                raster.draws[0].vertices[0].offset = 96;
            }),
            ("indices behind the end", |raster| {
                let DrawExtent::Direct { elements, .. } = &mut raster.draws[0].extent else {
                    panic!("direct");
                };
                elements.end = u32::MAX;
            }),
            ("records behind the end", |raster| {
                let DrawExtent::Indirect { draws, .. } = &mut raster.draws[1].extent else {
                    panic!("indirect");
                };
                *draws = u32::MAX;
            }),
        ];
        for (what, change) in changes {
            let mut bad = good.clone();
            change(raster(&mut bad));
            let before = backend.counters().pipelines;
            match backend.execute(&bad, &scene.inputs()) {
                Err(BackendError::Api { .. } | BackendError::Unsupported { .. }) => {}
                other => panic!("{what}: {other:?}"),
            }
            assert_eq!(backend.counters().pipelines, before, "{what}");
        }
        let execution = backend.execute(&good, &scene.inputs()).unwrap();
        assert_eq!(common::reds(execution.output("colour").unwrap()), [1.0; 48]);
    });
}

#[test]
fn stages_that_pass_on_more_than_the_device_can_are_refused() {
    on_each(|backend| {
        let mut graph = Graph::new();
        let target = graph.texture("target", DESC);
        let drawn = graph
            .raster("pass")
            .colour("colour", target, ZERO)
            .draw(Draw::new("draw/too_much").elements(0..3))
            .finish()
            .unwrap();
        let texture = drawn.texture("colour").unwrap();
        graph.output("result", texture).unwrap();
        let plan = plan(backend, &graph, Capture::Outputs);
        let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
        assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
        let part = "components of vertices (at most";
        assert!(error.to_string().contains(part), "{error}");
    });
}

#[test]
fn slices_of_volumes_are_refused() {
    on_each(|backend| {
        let mut graph = Graph::new();
        let desc = TextureDesc {
            dimension: Dimension::D3,
            ..DESC
        };
        let volume = graph.texture("volume", desc);
        let written = graph.raster("pass").colour("colour", volume, ZERO).finish();
        let Ok(written) = written else {
            // Refused before there is a plan.
            return;
        };
        let texture = written.texture("colour").unwrap();
        graph.output("volume", texture).unwrap();
        let plan = plan(backend, &graph, Capture::Outputs);
        match backend.execute(&plan, &Inputs::new()) {
            Err(BackendError::Unsupported { step, what }) => {
                assert_eq!(step, "pass");
                assert!(what.contains("3D"), "{what}");
            }
            other => panic!("{other:?}"),
        }
    });
}

/// Planted faults: without each of these barriers a hazard is reported.
#[test]
fn a_missing_barrier_is_an_error() {
    for device in common::devices() {
        let options = AshOptions {
            device: Some(device.clone()),
            validation: Validation::Synchronization,
            ..AshOptions::default()
        };
        let mut backend = match AshBackend::new(options) {
            Ok(backend) => backend,
            Err(error) => {
                assert!(!common::required("validation"), "{error}");
                println!("not tested: {error}");
                return;
            }
        };
        let good = plan(&backend, &mixed(1), Capture::Outputs);
        backend.execute(&good, &Inputs::new()).unwrap();
        // A vertex buffer and records that compute kernels write, and a target
        // that one reads.
        for (step, resource) in [
            ("over 0", "corners 0"),
            ("over 0", "records 0"),
            ("test/sum_of", "tint 0"),
        ] {
            let mut bad = good.clone();
            let number = bad
                .resources
                .iter()
                .position(|planned| planned.name == resource)
                .unwrap() as u32;
            // Of whichever step needs it first.
            let mut planted = 0;
            for planned in &mut bad.steps {
                let before = planned.barriers.len();
                if planned.name == step || resource != "tint 0" {
                    let written = |name: &str| name.starts_with("draw/make");
                    if !written(&planned.name) {
                        planned.barriers.retain(|it| it.resource != number);
                    }
                }
                planted += before - planned.barriers.len();
            }
            assert!(planted > 0, "{resource}");
            match backend.execute(&bad, &Inputs::new()) {
                Err(BackendError::Validation { messages }) => assert!(
                    messages
                        .iter()
                        .any(|it| it.contains("SYNC-HAZARD") || it.contains("layout")),
                    "{messages:?}"
                ),
                other => panic!("{device}: without the barrier of `{resource}`: {other:?}"),
            }
        }
        backend.execute(&good, &Inputs::new()).unwrap();
    }
}

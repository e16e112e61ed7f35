//! An engine lends its device, its images and its command buffers.

use crate::common;

use std::collections::VecDeque;

use ash::vk;
use common::engine::{Engine, EngineBuffer};
use etalon_ash::{
    AdoptedBuffer, AdoptedTexture, AshBackend, AshBindings, AshOptions, BufferState, Features,
    TextureState,
};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::kernel::{KernelLibrary, Need};
use etalon_core::plan::{Capture, Plan, PlanOptions, TightMemory};
use etalon_core::resource::{BufferDesc, TextureDesc};

/// As clears leave it.
const CLEARED: TextureState = TextureState {
    layout: vk::ImageLayout::TRANSFER_DST_OPTIMAL,
    stages: vk::PipelineStageFlags2::CLEAR,
    access: vk::AccessFlags2::TRANSFER_WRITE,
};

/// As copies want it.
const COPIED: TextureState = TextureState {
    layout: vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
    stages: vk::PipelineStageFlags2::COPY,
    access: vk::AccessFlags2::TRANSFER_READ,
};

const DESC: TextureDesc = TextureDesc::d2(20, 12, Format::R32Float);

/// Adopts the engine's device.
fn adopt(engine: &Engine, options: AshOptions) -> AshBackend {
    // SAFETY: the tests drop the backend before they finish the engine, and
    // wait for what they submit.
    unsafe { AshBackend::adopt(engine.lend(), options) }.unwrap()
}

/// Runs a test with an engine on each device, and fails if the validation
/// layer has anything to say until the engine is gone.
fn on_each(test: impl Fn(&Engine)) {
    for device in common::devices() {
        println!("on {device}");
        let engine = Engine::new(&device);
        test(&engine);
        let messages = engine.finish();
        assert!(messages.is_empty(), "{}", messages.join("\n\n"));
    }
}

/// result = source + offset + what the history holds; the history holds that.
fn accumulate(offset: f32) -> Graph {
    let mut graph = Graph::new();
    let source = graph.import_texture("source", DESC).unwrap();
    let history = graph
        .history("sum", DESC, ClearValue::Float([0.0; 4]))
        .unwrap();
    let shifted = graph.texture("shifted", DESC);
    let shifted = graph
        .compute("test/add")
        .read("source", source)
        .write("result", shifted)
        .set("offset", offset)
        .per_texel("result")
        .unwrap();
    let sum = graph
        .compute("test/sum_of")
        .read("first", shifted)
        .read("second", history.previous)
        .write("result", history.current)
        .per_texel("result")
        .unwrap();
    let result = graph.texture("result", DESC);
    let result = graph
        .compute("test/add")
        .named("hand over")
        .read("source", sum)
        .write("result", result)
        .set("offset", 0.0_f32)
        .per_texel("result")
        .unwrap();
    graph.output("result", result).unwrap();
    graph
}

fn bytes(desc: TextureDesc) -> u64 {
    desc.bytes().unwrap()
}

#[test]
fn images_of_the_engine_go_in_and_out() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let input = engine.image(
            DESC,
            vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::TRANSFER_DST
                | vk::ImageUsageFlags::TRANSFER_SRC,
        );
        let output = engine.image(
            DESC,
            vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::STORAGE
                | vk::ImageUsageFlags::TRANSFER_SRC,
        );
        // SAFETY: as described, and dropped before the engine.
        let (source, result) = unsafe {
            (
                backend.adopt_texture(input.adopted()).unwrap(),
                backend.adopt_texture(output.adopted()).unwrap(),
            )
        };
        let (seen, kept) = (engine.buffer(bytes(DESC)), engine.buffer(bytes(DESC)));
        for (frame, total) in [(1, 3.5), (2, 8.5)] {
            let plan = common::plan(&backend, &accumulate(0.5 * frame as f32), Capture::None);
            let commands = engine.begin();
            engine.fill(commands, &input, 2.0 + frame as f32);
            let bindings = AshBindings::new()
                .texture_in("source", &source, CLEARED, COPIED)
                .output_to("result", &result, COPIED, COPIED);
            // SAFETY: the command buffer is being recorded, and the states are
            // those `fill` and the frame before have left.
            let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
            let left = outputs.textures["result"];
            assert_eq!(left.image, output.image);
            assert_eq!((left.desc, left.state), (DESC, COPIED));
            engine.download(commands, output.image, DESC, &seen);
            engine.download(commands, input.image, DESC, &kept);
            engine.wait(engine.submit(commands));
            assert_eq!(engine.floats(&seen), vec![total; 240]);
            assert_eq!(engine.floats(&kept), vec![2.0 + frame as f32; 240]);
        }
    });
}

#[test]
fn outputs_can_be_the_backends_own() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let input = engine.image(
            DESC,
            vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
        );
        // SAFETY: as described, and dropped before the engine.
        let source = unsafe { backend.adopt_texture(input.adopted()) }.unwrap();
        let seen = engine.buffer(bytes(DESC));
        // What the engine does between frames, and which barriers it leaves to
        // the backend.
        for (state, total) in [
            (COPIED, 2.0),
            (TextureState::FRAGMENT_SAMPLED, 4.0),
            (TextureState::REST, 6.0),
        ] {
            let plan = common::plan(&backend, &accumulate(1.0), Capture::None);
            let commands = engine.begin();
            engine.fill(commands, &input, 1.0);
            let bindings = AshBindings::new()
                .texture_in("source", &source, CLEARED, TextureState::REST)
                .output_in("result", state);
            // SAFETY: as in the other tests.
            let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
            let left = outputs.textures["result"];
            assert_eq!(left.state, state);
            assert_ne!(left.view, vk::ImageView::null());
            let to = |state: TextureState| (state.stages, state.access);
            if state.layout != COPIED.layout {
                engine.barrier(
                    commands,
                    left.image,
                    (state.layout, COPIED.layout),
                    to(state),
                    to(COPIED),
                );
            }
            engine.download(commands, left.image, DESC, &seen);
            if state.layout != COPIED.layout {
                engine.barrier(
                    commands,
                    left.image,
                    (COPIED.layout, state.layout),
                    to(COPIED),
                    to(state),
                );
            }
            engine.wait(engine.submit(commands));
            assert_eq!(engine.floats(&seen), vec![total; 240], "{state:?}");
        }
    });
}

/// Runs frames with so many in flight, on images that take turns.
fn overlap(engine: &Engine, frames_in_flight: u32, images: usize) {
    let options = AshOptions {
        frames_in_flight,
        ..AshOptions::default()
    };
    let mut backend = adopt(engine, options);
    let inputs: Vec<_> = (0..images)
        .map(|_| {
            engine.image(
                DESC,
                vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            )
        })
        .collect();
    let sources: Vec<_> = inputs
        .iter()
        // SAFETY: as described, and dropped before the engine.
        .map(|image| unsafe { backend.adopt_texture(image.adopted()) }.unwrap())
        .collect();
    let frames: u32 = 20;
    let seen: Vec<EngineBuffer> = (0..frames).map(|_| engine.buffer(bytes(DESC))).collect();
    let mut under_way = VecDeque::new();
    let mut counters = Vec::new();
    for frame in 0..frames {
        if under_way.len() == frames_in_flight as usize {
            engine.wait(under_way.pop_front().unwrap());
        }
        let turn = frame as usize % images;
        let plan = common::plan(&backend, &accumulate(frame as f32), Capture::None);
        let commands = engine.begin();
        engine.fill(commands, &inputs[turn], 100.0 * turn as f32);
        let bindings = AshBindings::new()
            .texture_in("source", &sources[turn], CLEARED, TextureState::REST)
            .output_in("result", COPIED);
        // SAFETY: no more than the promised number are under way.
        let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
        let image = outputs.textures["result"].image;
        engine.download(commands, image, DESC, &seen[frame as usize]);
        under_way.push_back(engine.submit(commands));
        counters.push(backend.counters());
    }
    for fence in under_way {
        engine.wait(fence);
    }
    let mut total = 0.0;
    for (frame, seen) in seen.iter().enumerate() {
        total += (100 * (frame % images) + frame) as f32;
        assert_eq!(engine.floats(seen), vec![total; 240], "frame {frame}");
    }
    // By now each side of the history has met enough of the images.
    let (warm, last) = (counters[10], counters[19]);
    assert_eq!(warm.allocations, last.allocations);
    assert_eq!(warm.bytes, last.bytes);
    assert_eq!(warm.pipelines, last.pipelines);
    assert_eq!(warm.bind_groups, last.bind_groups);
    assert_eq!((warm.textures, warm.buffers), (last.textures, last.buffers));
    assert_eq!(last.dispatches - warm.dispatches, 27);
}

#[test]
fn frames_in_flight_do_not_disturb_each_other() {
    on_each(|engine| {
        overlap(engine, 3, 2);
        // More choices of resources than descriptor sets are kept for.
        overlap(engine, 6, 7);
    });
}

/// Within one command buffer, synchronization validation sees what one frame
/// leaves to the next.
#[test]
fn frames_wait_for_those_before() {
    on_each(|engine| {
        for tight in [false, true] {
            let mut backend = adopt(engine, AshOptions::default());
            let input = engine.image(
                DESC,
                vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            );
            // SAFETY: as described, and dropped before the engine.
            let source = unsafe { backend.adopt_texture(input.adopted()) }.unwrap();
            let seen = [engine.buffer(bytes(DESC)), engine.buffer(bytes(DESC))];
            let commands = engine.begin();
            engine.fill(commands, &input, 1.0);
            let mut arrives = CLEARED;
            for (frame, seen) in seen.iter().enumerate() {
                let graph = accumulate(frame as f32);
                let options = PlanOptions {
                    limits: backend.limits(),
                    memory: if tight {
                        &TightMemory
                    } else {
                        backend.memory()
                    },
                    ..PlanOptions::default()
                };
                let plan = Plan::new(&graph, &common::kernels(), &options).unwrap();
                let bindings = AshBindings::new()
                    .texture_in("source", &source, arrives, TextureState::REST)
                    .output_in("result", COPIED);
                // SAFETY: as in the other tests.
                let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
                engine.download(commands, outputs.textures["result"].image, DESC, seen);
                arrives = TextureState::REST;
            }
            engine.wait(engine.submit(commands));
            assert_eq!(engine.floats(&seen[0]), vec![1.0; 240]);
            assert_eq!(engine.floats(&seen[1]), vec![3.0; 240]);
        }
    });
}

/// A transient with memory of its own waits for its own last use in the frame
/// before, which the plan's barriers do not name.
#[test]
fn transients_apart_wait_for_themselves() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let mut graph = Graph::new();
        let mut newest = graph.import_texture("source", DESC).unwrap();
        for _ in 0..3 {
            let result = graph.texture("link", DESC);
            newest = graph
                .compute("test/add")
                .read("source", newest)
                .write("result", result)
                .set("offset", 1.0_f32)
                .per_texel("result")
                .unwrap();
        }
        let result = graph.texture("result", DESC);
        let result = graph.copy(newest, result).unwrap();
        graph.output("result", result).unwrap();
        let mut plan = common::plan(&backend, &graph, Capture::None);
        assert!(
            plan.texture_heap < plan.unaliased_bytes,
            "one shares memory"
        );
        // As if planned for a device without alignments.
        plan.heap_alignment = 1;
        let input = engine.image(
            DESC,
            vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
        );
        // SAFETY: as described, and dropped before the engine.
        let source = unsafe { backend.adopt_texture(input.adopted()) }.unwrap();
        let seen = engine.buffer(bytes(DESC));
        let commands = engine.begin();
        engine.fill(commands, &input, 1.0);
        let before = backend.counters().allocations;
        for arrives in [CLEARED, TextureState::REST] {
            let bindings =
                AshBindings::new().texture_in("source", &source, arrives, TextureState::REST);
            // SAFETY: as in the other tests.
            let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
            if arrives == TextureState::REST {
                let left = outputs.textures["result"];
                engine.barrier(
                    commands,
                    left.image,
                    (left.state.layout, COPIED.layout),
                    (left.state.stages, left.state.access),
                    (COPIED.stages, COPIED.access),
                );
                engine.download(commands, left.image, DESC, &seen);
            }
        }
        // Three transients, an output and uniforms, none of them shared.
        assert_eq!(backend.counters().allocations - before, 5);
        engine.wait(engine.submit(commands));
        assert_eq!(engine.floats(&seen), vec![4.0; 240]);
    });
}

#[test]
fn textures_made_anew_in_every_frame_do_not_pile_up() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let mut warm = None;
        let seen = engine.buffer(bytes(DESC));
        for frame in 0..12 {
            let input = engine.image(
                DESC,
                vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            );
            // SAFETY: as described, and dropped before the engine.
            let source = unsafe { backend.adopt_texture(input.adopted()) }.unwrap();
            backend.reset_histories();
            let plan = common::plan(&backend, &accumulate(1.0), Capture::None);
            let commands = engine.begin();
            engine.fill(commands, &input, frame as f32);
            let bindings = AshBindings::new()
                .texture_in("source", &source, CLEARED, TextureState::REST)
                .output_in("result", COPIED);
            // SAFETY: as in the other tests.
            let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
            engine.download(commands, outputs.textures["result"].image, DESC, &seen);
            engine.wait(engine.submit(commands));
            assert_eq!(engine.floats(&seen), vec![frame as f32 + 1.0; 240]);
            let counters = backend.counters();
            if frame == 6 {
                warm = Some(counters);
            }
            if let Some(warm) = warm {
                assert_eq!(
                    counters.bind_groups, warm.bind_groups,
                    "sets are used again"
                );
                assert_eq!(counters.bytes, warm.bytes, "histories are let go");
            }
        }
    });
}

#[test]
fn buffers_of_the_engine_go_in_and_out() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let mut graph = Graph::new();
        let desc = BufferDesc { bytes: 256 };
        let source = graph.import_buffer("source", desc).unwrap();
        let ramp = graph
            .compute("test/ramp")
            .write_buffer("values", source)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("values")
            .unwrap();
        let result = graph.buffer("result", desc);
        let result = graph
            .compute("test/copy_values")
            .read_buffer("source", ramp)
            .write_buffer("result", result)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("result")
            .unwrap();
        graph.output_buffer("result", result).unwrap();
        // SAFETY: the physical device is the engine's.
        let limits = unsafe {
            engine
                .instance
                .get_physical_device_properties(engine.physical)
        }
        .limits;
        let offset = limits.min_storage_buffer_offset_alignment.max(4);
        let memory = engine.buffer(offset + 256);
        let target = engine.buffer(256);
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let part = AdoptedBuffer {
            buffer: memory.buffer,
            offset,
            bytes: 256,
            usage,
        };
        let whole = AdoptedBuffer {
            buffer: target.buffer,
            offset: 0,
            ..part
        };
        // SAFETY: as described, and dropped before the engine.
        let (source, result) = unsafe {
            (
                backend.adopt_buffer(part).unwrap(),
                backend.adopt_buffer(whole).unwrap(),
            )
        };
        let host = BufferState {
            stages: vk::PipelineStageFlags2::HOST,
            access: vk::AccessFlags2::HOST_READ,
        };
        let plan = common::plan(&backend, &graph, Capture::None);
        let commands = engine.begin();
        let bindings = AshBindings::new()
            .buffer_in("source", &source, host, host)
            .output_to_buffer("result", &result, host, host);
        // SAFETY: as in the other tests.
        let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
        assert_eq!(outputs.buffers["result"].buffer, target.buffer);
        engine.wait(engine.submit(commands));
        let expected: Vec<u8> = (0..64_u32)
            .flat_map(|i| (3 * i + 1).to_le_bytes())
            .collect();
        assert_eq!(engine.read(&target), expected);
        assert_eq!(engine.read(&memory)[offset as usize..], expected);

        // SAFETY: they are refused.
        unsafe {
            for wrong in [
                AdoptedBuffer { offset: 2, ..part },
                AdoptedBuffer { bytes: 0, ..part },
                AdoptedBuffer { bytes: 255, ..part },
                AdoptedBuffer {
                    bytes: u64::MAX - 3,
                    ..part
                },
            ] {
                assert!(backend.adopt_buffer(wrong).is_err(), "{wrong:?}");
            }
        }
    });
}

#[test]
fn wrong_bindings_are_named_before_anything_is_made() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let other_backend = adopt(engine, AshOptions::default());
        let usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::STORAGE
            | vk::ImageUsageFlags::TRANSFER_DST;
        let fine = engine.image(DESC, usage);
        let wide = engine.image(TextureDesc::d2(21, 12, Format::R32Float), usage);
        let opaque = engine.image(DESC, vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: as described, and dropped before the engine.
        let (fine, wide, opaque, foreign) = unsafe {
            (
                backend.adopt_texture(fine.adopted()).unwrap(),
                backend.adopt_texture(wide.adopted()).unwrap(),
                backend.adopt_texture(opaque.adopted()).unwrap(),
                other_backend.adopt_texture(fine.adopted()).unwrap(),
            )
        };
        let plan = common::plan(&backend, &accumulate(1.0), Capture::None);
        let before = backend.counters();
        let commands = engine.begin();
        let mut error = |plan: &Plan, bindings: &AshBindings<'_>| {
            // SAFETY: as in the other tests.
            unsafe { backend.record(commands, plan, bindings) }.unwrap_err()
        };
        let missing = error(&plan, &AshBindings::new());
        assert!(
            matches!(&missing, BackendError::MissingInput { name } if name == "source"),
            "{missing}"
        );
        for (texture, given, wanted) in [
            (&wide, "21×12", "20×12"),
            (&opaque, "TRANSFER_DST", "SAMPLED"),
            (&foreign, "another device", "this backend"),
        ] {
            let mismatch = error(&plan, &AshBindings::new().texture("source", texture));
            let text = mismatch.to_string();
            assert!(
                matches!(mismatch, BackendError::InputMismatch { .. }),
                "{text}"
            );
            assert!(text.contains(given) && text.contains(wanted), "{text}");
        }
        let rest = TextureState::REST;
        let twice = AshBindings::new()
            .texture("source", &fine)
            .output_to("result", &fine, rest, rest);
        let twice = error(&plan, &twice).to_string();
        assert!(
            twice.contains("source") && twice.contains("result"),
            "{twice}"
        );
        let mut captured = plan.clone();
        captured.steps.push(etalon_core::plan::PlannedStep {
            name: "capture it".to_owned(),
            effect: String::new(),
            reason: String::new(),
            goal: String::new(),
            barriers: Vec::new(),
            step: etalon_core::plan::Step::Capture {
                resource: 0,
                range: etalon_core::graph::Subresources {
                    mip: 0,
                    mips: 1,
                    layer: 0,
                    layers: 1,
                },
                pass: String::new(),
                binding: String::new(),
            },
        });
        let refused = error(&captured, &AshBindings::new().texture("source", &fine));
        assert!(
            matches!(&refused, BackendError::Unsupported { step, .. } if step == "capture it"),
            "{refused}"
        );
        assert_eq!(backend.counters(), before);
        engine.wait(engine.submit(commands));
    });
}

#[test]
fn half_floats_are_refused_where_the_engine_has_not_enabled_them() {
    on_each(|engine| {
        // It states no feature beyond those required.
        let mut backend = adopt(engine, AshOptions::default());
        let mut library = KernelLibrary::new();
        library.add_source(
            "test/half",
            "enable f16;
             @group(0) @binding(0) var<storage, read_write> halves: array<f16>;
             @compute @workgroup_size(1) fn main() { halves[0] *= 3.0h; }",
        );
        let mut graph = Graph::new();
        let halves = graph.buffer("halves", BufferDesc { bytes: 4 });
        let halves = graph.clear_buffer(halves).unwrap();
        let halves = graph
            .compute("test/half")
            .update_buffer("halves", halves)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("halves")
            .unwrap();
        graph.output_buffer("halves", halves).unwrap();
        let plan = Plan::new(&graph, &library, &PlanOptions::default()).unwrap();
        let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
        let BackendError::Lacking {
            step,
            kernel,
            need,
            feature,
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!((step.as_str(), kernel.as_str()), ("test/half", "test/half"));
        assert_eq!((need, *feature), (&Need::F16, "shaderFloat16"));
    });
}

#[test]
fn features_that_are_missing_are_named() {
    on_each(|engine| {
        let mut lent = engine.lend();
        lent.features = Features::default();
        // SAFETY: it is refused.
        let error = unsafe { AshBackend::adopt(lent, AshOptions::default()) }.unwrap_err();
        let BackendError::NoDevice { reason, .. } = error else {
            panic!("{error}");
        };
        assert!(reason.contains("synchronization2"), "{reason}");
        assert!(reason.contains("maintenance4"), "{reason}");
        let mut lent = engine.lend();
        lent.queue_family = 77;
        // SAFETY: it is refused.
        let error = unsafe { AshBackend::adopt(lent, AshOptions::default()) }.unwrap_err();
        assert!(error.to_string().contains("77"), "{error}");

        // Lent without the formats beyond WebGPU's.
        let mut backend = adopt(engine, AshOptions::default());
        assert!(!backend.limits().extended_storage_formats);
        let mut graph = Graph::new();
        let result = graph.texture("result", DESC.with_format(Format::R16Float));
        let result = graph
            .compute("test/half")
            .write("result", result)
            .per_texel("result")
            .unwrap();
        graph.output("result", result).unwrap();
        let mut options = PlanOptions {
            limits: backend.limits(),
            ..PlanOptions::default()
        };
        let kernels = common::kernels();
        assert!(Plan::new(&graph, &kernels, &options).is_err());
        options.limits.extended_storage_formats = true;
        let plan = Plan::new(&graph, &kernels, &options).unwrap();
        let error = backend
            .execute(&plan, &etalon_core::backend::Inputs::new())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("shaderStorageImageExtendedFormats") && error.contains("test/half"),
            "{error}"
        );
    });
}

#[test]
fn an_image_no_device_can_have_is_refused() {
    on_each(|engine| {
        let backend = adopt(engine, AshOptions::default());
        let impossible = AdoptedTexture {
            image: vk::Image::null(),
            desc: TextureDesc::d2(u32::MAX, 1, Format::R32Float),
            usage: vk::ImageUsageFlags::SAMPLED,
        };
        // SAFETY: it is refused.
        let error = unsafe { backend.adopt_texture(impossible) }.unwrap_err();
        assert!(
            matches!(error, BackendError::InputMismatch { .. }),
            "{error}"
        );
    });
}

#[test]
fn a_lent_device_also_runs_plans_from_the_host() {
    on_each(|engine| {
        let mut backend = adopt(engine, AshOptions::default());
        let source = common::image(20, 12, |x, _| x as f32);
        let input = engine.image(
            DESC,
            vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
        );
        // SAFETY: as described, and dropped before the engine.
        let texture = unsafe { backend.adopt_texture(input.adopted()) }.unwrap();
        let seen = engine.buffer(bytes(DESC));
        // By turns, with one history between them.
        for frame in 0..6 {
            let total = if frame % 2 == 0 {
                let graph = accumulate(1.0);
                let inputs = etalon_core::backend::Inputs::new().texture("source", &source);
                let execution = common::execute(&mut backend, &graph, &inputs);
                common::reds(execution.output("result").unwrap())[5]
            } else {
                let plan = common::plan(&backend, &accumulate(1.0), Capture::None);
                let commands = engine.begin();
                engine.fill(commands, &input, 5.0);
                let bindings = AshBindings::new()
                    .texture_in("source", &texture, CLEARED, TextureState::REST)
                    .output_in("result", COPIED);
                // SAFETY: as in the other tests.
                let outputs = unsafe { backend.record(commands, &plan, &bindings) }.unwrap();
                engine.download(commands, outputs.textures["result"].image, DESC, &seen);
                engine.wait(engine.submit(commands));
                engine.floats(&seen)[5]
            };
            assert_eq!(total, 6.0 * (frame + 1) as f32, "frame {frame}");
        }
    });
}

#[test]
fn a_backend_can_move_between_threads() {
    fn sent<T: Send>() {}
    fn shared<T: Send + Sync>() {}
    sent::<AshBackend>();
    shared::<etalon_ash::AshTexture>();
    shared::<etalon_ash::AshBuffer>();
    shared::<etalon_ash::ValidationLog>();
}

//! What is kept between frames, and what is freed.

use super::{Engine, OUTPUT, ROW, accumulate, add, adder, row, sums};
use crate::common::plan;
use etalon_core::Format;
use etalon_core::backend::Backend;
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::{Capture, Plan};
use etalon_core::resource::TextureDesc;
use etalon_wgpu::{BIND_GROUPS_PER_STEP, WgpuBackend, WgpuBindings, wgpu};

/// A row and a history that it is added to, with a clear and a copy besides.
fn everything(backend: &WgpuBackend, library: &KernelLibrary, by: u32) -> Plan {
    let mut graph = Graph::new();
    let source = graph.import_texture("row", ROW).unwrap();
    let history = graph
        .history("last", ROW, ClearValue::Uint([0; 4]))
        .unwrap();
    let current = graph.copy(source, history.current).unwrap();
    let between = graph.texture("between", ROW);
    let between = graph
        .compute("test/add")
        .read("source", history.previous)
        .write("result", between)
        .set("by", by)
        .per_texel("result")
        .unwrap();
    let result = graph.texture("result", ROW);
    let result = graph.clear(result, ClearValue::Uint([9; 4])).unwrap();
    let result = graph
        .compute("test/copy")
        .read("source", between)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("delayed", result).unwrap();
    let shown = graph.texture("shown", ROW);
    let shown = graph
        .compute("test/copy")
        .read("source", current)
        .write("result", shown)
        .per_texel("result")
        .unwrap();
    graph.output("shown", shown).unwrap();
    plan(backend, &graph, library, Capture::None)
}

#[test]
fn a_steady_state_makes_nothing() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let library = adder();
    // The engine's textures alternate out of step with each other and the
    // history, and uniforms differ every frame.
    let images = [row(5), row(6)];
    let sources = images
        .each_ref()
        .map(|image| engine.filled_for(image, OUTPUT));
    let results = [(); 3].map(|()| engine.texture((64, 1, 1), 1, OUTPUT));
    let frame = |backend: &mut WgpuBackend, index: usize| {
        let mut encoder = engine.encoder();
        let plan = everything(backend, &library, index as u32);
        let bindings = WgpuBindings::new()
            .texture("row", &sources[index % 2])
            .output("delayed", &results[index % 3]);
        let outputs = backend.record(&mut encoder, &plan, &bindings).unwrap();
        assert!(outputs.view("shown").is_some());
        engine.queue.submit([encoder.finish()]);
        engine.wait();
    };
    for index in 0..6 {
        frame(&mut backend, index);
    }
    let made = backend.counters();
    assert_eq!((made.kernels, made.pipelines), (2, 2));
    assert!(made.textures > 0 && made.buffers > 0 && made.bytes > 0);
    let (views, allocations) = (backend.views_created(), engine.allocations());
    for index in 6..30 {
        frame(&mut backend, index);
    }
    let later = backend.counters();
    assert_eq!(later.dispatches, made.dispatches + 24 * 3);
    assert_eq!(later.made(), made.made());
    assert_eq!(backend.views_created(), views);
    // What wgpu says of itself, if it does.
    assert_eq!(engine.allocations(), allocations);
    // And it was not for nothing.
    assert_eq!(
        engine.read_row(&results[29 % 3], 0, 0),
        sums(&images[28 % 2], 29)
    );
}

#[test]
fn bind_groups_and_plans_are_kept_in_a_documented_number() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let library = adder();
    let plan = add(&backend, &library, 1);
    let record = |backend: &mut WgpuBackend, source: &wgpu::Texture| {
        let mut encoder = engine.encoder();
        let bindings = WgpuBindings::new().texture("row", source);
        backend.record(&mut encoder, &plan, &bindings).unwrap();
        engine.queue.submit([encoder.finish()]);
        engine.wait();
    };
    let sources: Vec<_> = (0..=BIND_GROUPS_PER_STEP as u32)
        .map(|seed| engine.filled(&row(seed)))
        .collect();
    for source in &sources {
        record(&mut backend, source);
    }
    let made = backend.counters().bind_groups;
    // The newest are known, the oldest is not.
    for source in &sources[1..] {
        record(&mut backend, source);
    }
    assert_eq!(backend.counters().bind_groups, made);
    record(&mut backend, &sources[0]);
    assert_eq!(backend.counters().bind_groups, made + 1);

    // As many structures as there are sizes; then the memory is that of a few.
    let sized = |backend: &mut WgpuBackend, width: u32| {
        let mut graph = Graph::new();
        let desc = TextureDesc::d2(width, 64, Format::R32Uint);
        let texture = graph.texture("cleared", desc);
        let cleared = graph.clear(texture, ClearValue::Uint([1; 4])).unwrap();
        graph.output("cleared", cleared).unwrap();
        let plan = crate::common::plan(backend, &graph, &library, Capture::None);
        let mut encoder = engine.encoder();
        backend
            .record(&mut encoder, &plan, &WgpuBindings::new())
            .unwrap();
        engine.queue.submit([encoder.finish()]);
        engine.wait();
    };
    for width in 0..20 {
        sized(&mut backend, 64 + width);
    }
    let held = backend.counters().bytes;
    for width in 0..20 {
        sized(&mut backend, 64 + width);
    }
    assert_eq!(backend.counters().bytes, held);
    backend.trim();
    assert!(backend.counters().bytes < held / 2);
    let made = backend.counters().made();
    sized(&mut backend, 83);
    let then = backend.counters().made();
    assert_eq!(then, made, "trimming keeps the last plan");
}

#[test]
fn what_is_dropped_is_freed() {
    let Some(engine) = Engine::new() else { return };
    // Whatever a device makes for itself when it is first used.
    engine.filled(&row(1));
    engine.queue.submit([]);
    engine.wait();
    let before = engine.allocations();
    let mut backend = engine.backend();
    let library = adder();
    let plan = accumulate(&backend, &library, 1);
    // An encoder that is never submitted takes its staging buffer with it.
    let mut encoder = engine.encoder();
    backend
        .record(&mut encoder, &plan, &WgpuBindings::new())
        .unwrap();
    let held = backend.counters().bytes;
    drop(encoder);
    engine.wait();
    assert!(backend.counters().bytes < held);
    drop(backend);
    // Buffers filled as they are made are copied by the next submit.
    engine.queue.submit([]);
    engine.wait();
    assert_eq!(engine.allocations(), before);
}

//! What the interpreter needs beside the images themselves.
//!
//! The allocator of this program notes the most that was ever held. Of that,
//! what was held before and what the backend says its images and buffers take
//! is taken off; the rest is bytecode, registers, memory of invocations and
//! workgroups, uniforms and bookkeeping.

use std::sync::{Mutex, PoisonError};

use etalon_core::backend::{Backend, Inputs};
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Plan, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions};
use etalon_measure::subjects::{Size, frame, library, names, subject};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// The most that is allowed beside the images.
const BOUND: u64 = 64 << 20;

/// One measurement at a time: the allocator is everybody's.
static ALONE: Mutex<()> = Mutex::new(());

/// The most bytes that `work` held beside what it held before it and the
/// images that the backend made during it.
fn beside_images(backend: &mut CpuBackend, work: impl FnOnce(&mut CpuBackend)) -> u64 {
    let held = ALLOCATOR.current_usage() as u64;
    let images = backend.counters().bytes;
    ALLOCATOR.reset_peak_usage();
    work(backend);
    let peak = ALLOCATOR.peak_usage() as u64;
    let made = backend.counters().bytes.saturating_sub(images);
    peak.saturating_sub(held).saturating_sub(made)
}

#[test]
fn every_effect_works_in_little_memory() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let size = Size {
        width: 1920,
        height: 1080,
    };
    let frame = frame(size).unwrap();
    let kernels = library();
    for name in names() {
        let subject = subject(name).unwrap();
        let graph = subject.graph(&frame).unwrap();
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            if !subject.has(arithmetic) {
                continue;
            }
            let mut backend = CpuBackend::new(&CpuOptions::default()).unwrap();
            let options = PlanOptions {
                arithmetic,
                limits: backend.limits(),
                ..PlanOptions::default()
            };
            let plan = Plan::new(&graph, &kernels, &options).unwrap();
            let bytes = beside_images(&mut backend, |backend| {
                backend.execute(&plan, &frame.inputs()).unwrap();
            });
            assert!(bytes > 0, "{name} cannot have worked in no memory");
            assert!(
                bytes < BOUND,
                "{name} ({arithmetic}) took {:.1} MiB beside its images",
                bytes as f64 / f64::from(1 << 20)
            );
            println!(
                "{name} ({arithmetic}): {:.2} MiB",
                bytes as f64 / f64::from(1 << 20)
            );
        }
    }
}

/// A kernel that wants much memory per invocation is seen to take it.
#[test]
fn memory_of_invocations_is_counted() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut kernels = library();
    // 1024 invocations with 8192 numbers each: 32 MiB for every thread.
    kernels.add_source(
        "measure/greedy",
        "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size(1024)
         fn main(@builtin(local_invocation_index) lane: u32) {
             var numbers: array<u32, 8192>;
             for (var i = 0u; i < 8192u; i++) { numbers[(i * lane) % 8192u] = i + lane; }
             result[lane] = numbers[result[lane] % 8192u];
         }",
    );
    let mut graph = etalon_core::graph::Graph::new();
    let buffer = graph.buffer("result", etalon_core::resource::BufferDesc { bytes: 4096 });
    let cleared = graph.clear_buffer(buffer).unwrap();
    let written = graph
        .compute("measure/greedy")
        .update_buffer("result", cleared)
        .groups([1, 1, 1])
        .unwrap();
    graph
        .output_buffer("result", written.buffer("result").unwrap())
        .unwrap();
    let mut backend = CpuBackend::new(&CpuOptions {
        threads: 1,
        lanes: Some(1024),
        ..CpuOptions::default()
    })
    .unwrap();
    let options = PlanOptions {
        limits: backend.limits(),
        ..PlanOptions::default()
    };
    let plan = Plan::new(&graph, &kernels, &options).unwrap();
    let bytes = beside_images(&mut backend, |backend| {
        backend.execute(&plan, &Inputs::new()).unwrap();
    });
    let least = 1024 * 8192 * 4;
    assert!(
        (least..2 * least).contains(&bytes),
        "{bytes} bytes beside buffers, {least} at the least"
    );
    // A second such thread would be beyond the bound of the test above.
    assert!(2 * least >= BOUND);
}

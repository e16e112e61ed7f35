//! Kernel translation, and each effect on each backend at 640×360 and 1280×720.
//!
//! Figures are of whole executions from host images to host images (`execute`);
//! the times of the passes alone, by the device's own clock, are in the report
//! of `cargo xtask test-backends`. Compare within one run only.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use etalon::effects::registry::{EffectEntry, effects};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::{Capture, Plan, Step};
use etalon_scenes::{Frame, FrameSize, scene};
use etalon_tests::{executors, plan_for};

fn graph(frame: &Frame, effect: &EffectEntry) -> Graph {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, 1.0 / 60.0).expect("a fresh graph");
    let result = effect.build(&mut graph, &inputs).expect("default settings");
    graph.output("result", result).expect("the only output");
    graph
}

fn frame(width: u32, height: u32) -> Frame {
    let size = FrameSize::new(width, height).expect("a possible size");
    scene("wet-floor")
        .expect("a known scene")
        .frame(size)
        .expect("memory for a frame")
}

/// From WESL to a validated module, and from there to bytecode and SPIR-V.
fn translation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("translation");
    let frame = frame(64, 36);
    let cpu = etalon_tests::cpu().expect("the interpreter");
    for effect in effects() {
        let graph = graph(&frame, effect);
        let plan = |kernels: &KernelLibrary| {
            plan_for(
                cpu.as_ref(),
                &graph,
                kernels,
                Arithmetic::Fast,
                Capture::None,
            )
            .expect("a valid graph")
        };
        group.bench_function(BenchmarkId::new("compile", effect.name), |bencher| {
            bencher.iter(|| black_box(plan(&etalon::effects::kernels())));
        });
        let compiled: Plan = plan(&etalon::effects::kernels());
        group.bench_function(BenchmarkId::new("bytecode", effect.name), |bencher| {
            bencher.iter(|| {
                for step in &compiled.steps {
                    if let Step::Dispatch { kernel, .. } = &step.step {
                        black_box(
                            etalon::cpu::Program::translate(&kernel.0).expect("a supported kernel"),
                        );
                    }
                }
            });
        });
    }
    group.finish();
}

fn execution(criterion: &mut Criterion) {
    let kernels = etalon::effects::kernels();
    for (width, height) in [(640, 360), (1280, 720)] {
        let frame = frame(width, height);
        for effect in effects() {
            let mut group = criterion.benchmark_group(format!("{} {width}×{height}", effect.name));
            group.sample_size(10);
            let graph = graph(&frame, effect);
            for executor in &mut executors() {
                for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
                    let plan = plan_for(
                        executor.as_ref(),
                        &graph,
                        &kernels,
                        arithmetic,
                        Capture::None,
                    )
                    .expect("a valid graph");
                    let id = BenchmarkId::new(
                        executor.info().backend,
                        format!("{arithmetic:?}").to_lowercase(),
                    );
                    group.bench_function(id, |bencher| {
                        bencher.iter(|| executor.execute(&plan, &frame.inputs()).expect("a run"));
                    });
                }
            }
            group.finish();
        }
    }
}

criterion_group!(benches, translation, execution);
criterion_main!(benches);

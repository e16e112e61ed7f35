//! How long planning takes, from 10 to 1,000 passes. It should grow linearly
//! and stay under 5 ms for 1,000 passes once their kernel is compiled.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etalon::Format;
use etalon::graph::{Graph, Texture};
use etalon::kernel::KernelLibrary;
use etalon::plan::{Plan, PlanOptions};
use etalon::resource::TextureDesc;

const KERNEL: &str = "
struct Settings { gain: f32, bias: vec4<f32> }
@group(0) @binding(0) var near: texture_2d<f32>;
@group(0) @binding(1) var far: texture_2d<f32>;
@group(0) @binding(2) var result: texture_storage_2d<rgba16float, write>;
@group(0) @binding(3) var<uniform> settings: Settings;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let sum = textureLoad(near, id.xy, 0) + textureLoad(far, id.xy, 0);
    textureStore(result, id.xy, sum * settings.gain + settings.bias);
}";

/// Passes that read the newest image and one from a while ago, as a frame does.
fn frame(passes: usize) -> Graph {
    let desc = TextureDesc::d2(1920, 1080, Format::Rgba16Float);
    let mut graph = Graph::new();
    let import = graph
        .import_texture("input", desc)
        .expect("the only import");
    let mut images = vec![import];
    for index in 0..passes {
        let (near, far): (Texture, Texture) = (images[index], images[index.saturating_sub(7)]);
        let target = graph.texture("image", desc);
        let written = graph
            .compute("bench/step")
            .read("near", near)
            .read("far", far)
            .write("result", target)
            .set("gain", 0.5)
            .set("bias", glam::Vec4::ZERO)
            .per_texel("result")
            .expect("a valid pass");
        images.push(written);
    }
    graph
        .output("output", images[passes])
        .expect("the only output");
    graph
}

fn planning(criterion: &mut Criterion) {
    let mut kernels = KernelLibrary::new();
    kernels.add_source("bench/step", KERNEL);
    let mut group = criterion.benchmark_group("planning");
    for passes in [10, 100, 1000] {
        let graph = frame(passes);
        group.throughput(Throughput::Elements(passes as u64));
        group.bench_with_input(
            BenchmarkId::new("declare", passes),
            &passes,
            |bencher, &passes| {
                bencher.iter(|| black_box(frame(passes)));
            },
        );
        group.bench_with_input(
            BenchmarkId::new("plan", passes),
            &graph,
            |bencher, graph| {
                bencher.iter(|| {
                    Plan::new(black_box(graph), &kernels, &PlanOptions::default())
                        .expect("a valid graph")
                });
            },
        );
    }
    group.finish();
}

criterion_group!(benches, planning);
criterion_main!(benches);

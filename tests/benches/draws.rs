//! Models drawn by each backend at 1280×720: the prepass alone, with a G-buffer and its
//! light map, and lit as they are drawn.
//!
//! The registry's gallery, and the flight helmet of glTF's sample models where
//! `ETALON_INPUTS` names a folder that has it. Figures are of whole executions, the
//! upload of vertices and the download of the result included, which are the same for
//! all; compare within one run only.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use etalon::backend::Backend;
use etalon::graph::Graph;
use etalon::kernel::Arithmetic;
use etalon::plan::{Capture, Plan};
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{Model, Shot};
use etalon_scenes::{FrameSize, model};
use etalon_tests::{executors, plan_for};

const HELMET: &str = "gltf/flight-helmet/FlightHelmet.gltf";

fn shots() -> Vec<(&'static str, Shot)> {
    let gallery = model("gallery").expect("a model of the registry");
    let mut models: Vec<(&str, Model)> = vec![("gallery", (gallery.build)().expect("a model"))];
    match std::env::var_os("ETALON_INPUTS") {
        Some(folder) => {
            let path = Path::new(&folder).join(HELMET);
            let helmet = load_gltf(&path, &GltfOptions::default());
            models.push(("flight helmet", helmet.expect("a glTF file")));
        }
        None => eprintln!("without the flight helmet: ETALON_INPUTS is not set"),
    }
    let shot = |(name, model)| (name, Shot::new(model, 0.5).expect("a model to look at"));
    models.into_iter().map(shot).collect()
}

#[derive(Clone, Copy)]
enum Part {
    Prepass,
    Deferred,
    Forward,
}

fn plan(executor: &dyn Backend, shot: &Shot, part: Part) -> Plan {
    let size = FrameSize::new(1280, 720).expect("a possible size");
    let mut graph = Graph::new();
    let sky = Shot::sky(&mut graph).expect("a sky");
    let drawn = shot
        .draw(&mut graph, size, sky, 1.0 / 60.0)
        .expect("a shot");
    let result = match part {
        Part::Prepass => drawn.prepass.depth,
        Part::Deferred => drawn.deferred,
        Part::Forward => drawn.light,
    };
    graph.output("result", result).expect("the only output");
    let kernels = etalon::effects::kernels();
    plan_for(executor, &graph, &kernels, Arithmetic::Fast, Capture::None).expect("a valid graph")
}

fn draws(criterion: &mut Criterion) {
    for (name, shot) in shots() {
        for (label, part) in [
            ("prepass", Part::Prepass),
            ("G-buffer and light map", Part::Deferred),
            ("forward", Part::Forward),
        ] {
            let mut group = criterion.benchmark_group(format!("{name}, {label}, 1280×720"));
            group.sample_size(10);
            for executor in &mut executors() {
                let plan = plan(executor.as_ref(), &shot, part);
                let id = BenchmarkId::from_parameter(executor.info().backend);
                group.bench_function(id, |bencher| {
                    bencher.iter(|| executor.execute(&plan, &shot.inputs()).expect("a run"));
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, draws);
criterion_main!(benches);

//! Every effect on every scene, watched for what a GPU hides.

use crate::common;

use std::collections::BTreeMap;

use common::Run;
use etalon_core::Format;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Capture;
use etalon_cpu::{Checks, CpuBackend, CpuOptions};
use etalon_effects::effects;
use etalon_effects::environment::{EnvironmentMap, Prefilter, environment, mirroring};
use etalon_scenes::{FrameSize, scenes};

#[test]
fn effects_hide_nothing() {
    let mut all = BTreeMap::new();
    for scene in scenes() {
        // Odd, so that the last workgroups and the smallest levels overhang.
        let frame = scene.frame(FrameSize::new(97, 55).unwrap()).unwrap();
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            for effect in effects() {
                let mut backend = CpuBackend::new(&CpuOptions {
                    checks: Checks::all(),
                    ..CpuOptions::default()
                })
                .unwrap();
                let mut run = Run::new();
                run.arithmetic = arithmetic;
                let inputs = run.import_frame(&frame);
                let result = effect.build(&mut run.graph, &inputs).unwrap();
                run.graph.output("result", result).unwrap();
                // The second frame has histories.
                for _ in 0..2 {
                    run.execute(&mut backend, Capture::Outputs);
                }
                let found = backend.take_findings();
                assert_eq!(found.omitted, 0);
                for entry in found.list {
                    let key = (entry.finding.location.clone(), entry.finding.kind);
                    all.entry(key).or_insert(format!(
                        "{}, {arithmetic:?}, {}: {entry}",
                        scene.name, effect.name
                    ));
                }
            }
        }
    }
    let found: Vec<String> = all.into_values().collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The same of the kernels that make light from everywhere.
#[test]
fn surroundings_hide_nothing() {
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut backend = CpuBackend::new(&CpuOptions {
            checks: Checks::all(),
            ..CpuOptions::default()
        })
        .unwrap();
        let sky = common::image(Format::Rgba32Float, 64, 32, |x, y| {
            [x as f32, 8.0, y as f32, 1.0]
        });
        let map = EnvironmentMap::of_equirectangular(&sky, 64).unwrap();
        let mut run = Run::new();
        run.arithmetic = arithmetic;
        let base = run.import("base", map.image());
        let settings = Prefilter::default();
        let around = environment(&mut run.graph, base, map.irradiance(), &settings).unwrap();
        run.graph.output("radiance", around.radiance).unwrap();
        let table = mirroring(&mut run.graph).unwrap();
        run.graph.output("mirroring", table).unwrap();
        run.execute(&mut backend, Capture::Outputs);
        let found = backend.take_findings();
        let entries: Vec<String> = found.list.iter().map(ToString::to_string).collect();
        assert!(entries.is_empty() && found.omitted == 0, "{entries:?}");
    }
}

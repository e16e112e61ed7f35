//! What the effects declare, before anything runs: every variant of every
//! kernel compiles, and what is off is not there.

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Plan, PlanOptions, Step};
use etalon_core::resource::TextureDesc;
use etalon_effects::bloom::Bloom;
use etalon_effects::composite::{Composite, Output, ToneCurve};
use etalon_effects::exposure::{Exposure, Metering};
use etalon_effects::ssr::{Blend, Search, Ssr, ssr};
use etalon_effects::{CameraParams, ChainSettings, EffectError, SceneInputs, chain, effects};

/// Inputs of a scene of `width × height` texels.
fn inputs(graph: &mut Graph, width: u32, height: u32) -> SceneInputs {
    let mut import = |name: &str, format| {
        graph
            .import_texture(name, TextureDesc::d2(width, height, format))
            .expect("every name is used once")
    };
    SceneInputs {
        colour: import("colour", Format::Rgba16Float),
        depth: import("depth", Format::R32Float),
        normal: import("normal", Format::Rgba16Float),
        specular: import("specular", Format::Rgba8Unorm),
        velocity: None,
        camera: CameraParams::perspective(1.0, 1.5, 0.1),
        delta_time: 1.0 / 60.0,
        beyond: None,
    }
}

fn plan(graph: &Graph, kernels: &KernelLibrary, arithmetic: Arithmetic) -> Plan {
    let options = PlanOptions {
        arithmetic,
        ..PlanOptions::default()
    };
    Plan::new(graph, kernels, &options).unwrap_or_else(|error| panic!("{arithmetic}: {error}"))
}

/// Kernel paths of a plan's dispatches, in order.
fn kernels_of(plan: &Plan) -> Vec<String> {
    let paths = plan.steps.iter().filter_map(|step| match &step.step {
        Step::Dispatch { kernel, .. } => Some(kernel.0.name.clone()),
        _ => None,
    });
    paths.collect()
}

const BOTH: [Arithmetic; 2] = [Arithmetic::Strict, Arithmetic::Fast];

#[test]
fn every_registered_effect_plans_strict_and_fast() {
    let kernels = etalon_effects::kernels();
    for entry in effects() {
        for (width, height) in [(64, 48), (1, 1), (1, 37), (4096, 1), (31, 17)] {
            let mut graph = Graph::new();
            let inputs = inputs(&mut graph, width, height);
            let result = entry.build(&mut graph, &inputs).expect(entry.name);
            graph.output("result", result).expect(entry.name);
            for arithmetic in BOTH {
                let plan = plan(&graph, &kernels, arithmetic);
                assert!(plan.culled.is_empty(), "{}: {:?}", entry.name, plan.culled);
            }
        }
    }
}

#[test]
fn every_variant_of_every_kernel_plans_strict_and_fast() {
    let kernels = etalon_effects::kernels();
    let mut all = Vec::new();
    for curve in ToneCurve::ALL {
        all.push(ChainSettings {
            composite: Composite {
                output: Output::Sdr(curve),
                ..Composite::default()
            },
            ..ChainSettings::full()
        });
    }
    for output in [Output::Hdr, Output::default()] {
        for exposure in [
            None,
            Some(Metering::Arithmetic),
            Some(Metering::Logarithmic),
        ] {
            for bloom in [None, Some(true), Some(false)] {
                for ssr in [None, Some((0, Blend::Add)), Some((4, Blend::Replace))] {
                    all.push(ChainSettings {
                        ssr: ssr.map(|(blur_radius, blend)| Ssr {
                            blur_radius,
                            blend,
                            ..Ssr::default()
                        }),
                        exposure: exposure.map(|metering| Exposure {
                            metering,
                            ..Exposure::default()
                        }),
                        bloom: bloom.map(|suppress_fireflies| Bloom {
                            suppress_fireflies,
                            ..Bloom::default()
                        }),
                        composite: Composite {
                            output,
                            ..Composite::default()
                        },
                    });
                }
            }
        }
    }
    for settings in all {
        let mut graph = Graph::new();
        let inputs = inputs(&mut graph, 70, 30);
        let result = chain(&mut graph, &inputs, &settings).expect("valid settings");
        graph.output("picture", result.picture).expect("written");
        for arithmetic in BOTH {
            plan(&graph, &kernels, arithmetic);
        }
    }
}

#[test]
fn an_effect_that_is_off_leaves_nothing_behind() {
    let kernels = etalon_effects::kernels();
    let mut graph = Graph::new();
    let inputs = inputs(&mut graph, 64, 48);
    let result = chain(&mut graph, &inputs, &ChainSettings::default()).expect("valid settings");
    assert_eq!(result.light, inputs.colour);
    assert_eq!((result.adaptation, result.bloom), (None, None));
    graph.output("picture", result.picture).expect("written");
    let plan = plan(&graph, &kernels, Arithmetic::Strict);
    assert_eq!(kernels_of(&plan), ["composite/composite"]);
    // One variant of one kernel was compiled, and only what it imports read.
    assert_eq!(kernels.stats().compiled, 1);
    assert!(plan.histories.is_empty());
    assert_eq!(plan.texture_heap, 0);
}

#[test]
fn a_resolution_of_zero_is_off() {
    let mut graph = Graph::new();
    let inputs = inputs(&mut graph, 64, 48);
    let settings = ChainSettings {
        ssr: Some(Ssr {
            resolution: 0.0,
            ..Ssr::default()
        }),
        ..ChainSettings::default()
    };
    let result = chain(&mut graph, &inputs, &settings).expect("valid settings");
    assert_eq!(result.light, inputs.colour);
}

#[test]
fn a_pyramid_is_there_once_if_a_search_goes_over_it_and_not_otherwise() {
    let kernels = etalon_effects::kernels();
    let planned = |search, quarter_from| {
        let mut graph = Graph::new();
        let inputs = inputs(&mut graph, 640, 360);
        let settings = Ssr {
            search,
            quarter_from,
            ..Ssr::default()
        };
        let result = ssr(&mut graph, &inputs, &settings).expect("valid settings");
        graph.output("picture", result).expect("written");
        plan(&graph, &kernels, Arithmetic::Strict)
    };
    // One rate, both, the slower alone.
    for quarter_from in [Ssr::NO_QUARTER, 0.5, 0.0] {
        let plain = planned(Search::Refined, quarter_from);
        for search in [Search::Linear, Search::Refined, Search::Dda] {
            let plan = planned(search, quarter_from);
            let paths = kernels_of(&plan);
            assert!(
                paths.iter().all(|path| !path.starts_with("hiz/")),
                "{paths:?}"
            );
            let heaps = [plan.texture_heap, plan.buffer_heap];
            assert_eq!(heaps, [plain.texture_heap, plain.buffer_heap], "{search:?}");
        }
        let plan = planned(Search::HiZ, quarter_from);
        let made = kernels_of(&plan)
            .iter()
            .filter(|path| path.starts_with("hiz/"))
            .count();
        // Levels of 320×180 to 1×1.
        assert_eq!(made, 10);
        assert_eq!(plan.steps.len(), plain.steps.len() + made);
    }
}

#[test]
fn the_chain_runs_its_passes_in_order() {
    let kernels = etalon_effects::kernels();
    let mut graph = Graph::new();
    let inputs = inputs(&mut graph, 64, 48);
    let settings = ChainSettings {
        bloom: Some(Bloom {
            levels: 2,
            ..Bloom::default()
        }),
        ..ChainSettings::full()
    };
    let result = chain(&mut graph, &inputs, &settings).expect("valid settings");
    graph.output("picture", result.picture).expect("written");
    let plan = plan(&graph, &kernels, Arithmetic::Strict);
    // Each list of tiles is made right before it is needed.
    let expected = [
        "ssr/classify",
        "tiles/spread",
        "tiles/spread",
        "tiles/list",
        "ssr/march",
        "ssr/resolve",
        "tiles/list",
        "ssr/blur",
        "tiles/list",
        "ssr/blur",
        "ssr/mix",
        "tiles/list",
        "ssr/mix",
        "tiles/list",
        "ssr/keep",
        "exposure/luminance",
        "exposure/reduce",
        "exposure/adapt",
        "bloom/threshold",
        "bloom/downsample",
        "bloom/upsample",
        "composite/composite",
    ];
    assert_eq!(kernels_of(&plan), expected);
}

#[test]
fn bloom_stops_halving_at_one_texel() {
    let kernels = etalon_effects::kernels();
    // Sizes per level: 5×1 → 3×1 → 2×1 → 1×1, so three levels at most.
    let mut graph = Graph::new();
    let inputs = inputs(&mut graph, 5, 1);
    let entry = etalon_effects::effect("bloom").expect("registered");
    let result = entry.build(&mut graph, &inputs).expect("valid");
    graph.output("bloom", result).expect("written");
    let plan = plan(&graph, &kernels, Arithmetic::Strict);
    let downs = kernels_of(&plan)
        .iter()
        .filter(|path| *path == "bloom/downsample")
        .count();
    assert_eq!(downs, 2);
    let extent = graph.desc(result).extent;
    assert_eq!((extent.width, extent.height), (3, 1));
}

/// What `build` says of inputs of which one has another size.
fn mismatch(alter: impl Fn(&mut SceneInputs, Texture)) -> (&'static str, &'static str) {
    let mut graph = Graph::new();
    let mut inputs = inputs(&mut graph, 64, 48);
    let odd = graph
        .import_texture("odd", TextureDesc::d2(64, 47, Format::Rgba16Float))
        .expect("a new name");
    alter(&mut inputs, odd);
    match chain(&mut graph, &inputs, &ChainSettings::full()) {
        Err(EffectError::SizeMismatch {
            first,
            second,
            first_size,
            second_size,
            ..
        }) => {
            assert_ne!(first_size, second_size);
            (first, second)
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn inputs_of_different_sizes_are_refused_by_name() {
    assert_eq!(
        mismatch(|inputs, odd| inputs.normal = odd),
        ("depth", "normal")
    );
    assert_eq!(
        mismatch(|inputs, odd| inputs.specular = odd),
        ("colour", "specular")
    );
    assert_eq!(
        mismatch(|inputs, odd| inputs.colour = odd),
        ("colour", "specular")
    );
}

#[test]
fn handles_of_another_graph_are_refused() {
    let mut other = Graph::new();
    let foreign = inputs(&mut other, 64, 48);
    for entry in effects() {
        let mut graph = Graph::new();
        let result = entry.build(&mut graph, &foreign);
        assert!(
            matches!(result, Err(EffectError::Graph(_))),
            "{}: {result:?}",
            entry.name
        );
    }
}

//! What is not asked for costs nothing, and what is asked for again costs
//! nothing anew.

use etalon::backend::{Backend, Counters, Execution};
use etalon::effects::composite::Composite;
use etalon::effects::exposure::Exposure;
use etalon::effects::frame::{Request, of_images};
use etalon::effects::ssr::Ssr;
use etalon::effects::{ChainSettings, bloom, chain, ssr};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary, KernelStats};
use etalon::plan::{Capture, Plan};
use etalon_scenes::model::Shot;
use etalon_scenes::{Frame, FrameSize, scene};
use etalon_tests::{executors, first_difference, plan_for};

fn frame() -> Frame {
    scene("wet-floor")
        .unwrap()
        .frame(FrameSize::new(96, 54).unwrap())
        .unwrap()
}

/// The chain with `settings`, and with `unasked`, effects whose results nothing uses.
fn plan(
    executor: &dyn Backend,
    kernels: &KernelLibrary,
    frame: &Frame,
    settings: &ChainSettings,
    unasked: bool,
) -> Plan {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
    if unasked {
        ssr::ssr(&mut graph, &inputs, &Ssr::default()).unwrap();
        bloom::bloom(
            &mut graph,
            inputs.colour,
            Default::default(),
            &Default::default(),
        )
        .unwrap();
        etalon::effects::exposure::exposure(&mut graph, inputs.colour, 0.1, &Exposure::default())
            .unwrap();
    }
    let result = chain(&mut graph, &inputs, settings).unwrap();
    graph.output("picture", result.picture).unwrap();
    plan_for(
        executor,
        &graph,
        kernels,
        Arithmetic::Strict,
        Capture::Outputs,
    )
    .unwrap()
}

#[test]
fn effects_nobody_asks_for_leave_no_pass_kernel_pipeline_or_byte() {
    let frame = frame();
    let settings = ChainSettings {
        composite: Composite::default(),
        ..ChainSettings::default()
    };
    let names: Vec<String> = executors()
        .iter()
        .map(|executor| executor.info().to_string())
        .collect();
    for (index, name) in names.iter().enumerate() {
        // A fresh executor and library each, so that the counters are of one plan.
        let run = |unasked: bool| -> (Plan, KernelStats, Counters, Execution) {
            let mut executor = executors().remove(index);
            let kernels = etalon::effects::kernels();
            let plan = plan(executor.as_ref(), &kernels, &frame, &settings, unasked);
            let execution = executor.execute(&plan, &frame.inputs()).unwrap();
            (plan, kernels.stats(), executor.counters(), execution)
        };
        let (without, kernels_without, counters_without, image_without) = run(false);
        let (with, kernels_with, counters_with, image_with) = run(true);
        assert!(
            with.culled.len() >= 10,
            "{name}: the effects must have been declared"
        );
        assert_eq!(with.steps, without.steps, "{name}");
        assert_eq!(with.resources, without.resources, "{name}");
        assert_eq!(with.structure(), without.structure(), "{name}");
        assert_eq!(kernels_with, kernels_without, "{name}");
        assert_eq!(kernels_with.compiled, 1, "{name}: one kernel runs");
        assert_eq!(counters_with, counters_without, "{name}");
        assert_eq!(counters_with.pipelines, 1, "{name}");
        assert_eq!(
            first_difference(&image_with, &image_without),
            None,
            "{name}"
        );
    }
}

#[test]
fn a_steady_frame_creates_nothing() {
    let frame = frame();
    let kernels = etalon::effects::kernels();
    for executor in &mut executors() {
        let mut settings = ChainSettings::full();
        let mut counters = Vec::new();
        for number in 0..6 {
            // What changes from frame to frame in an engine: values of settings.
            settings.composite.exposure = 1.0 + number as f32 * 0.125;
            let plan = plan(executor.as_ref(), &kernels, &frame, &settings, false);
            executor.execute(&plan, &frame.inputs()).unwrap();
            counters.push(executor.counters());
        }
        // Both halves of the histories have been used after two frames.
        let (early, late) = (counters[2], counters[5]);
        assert_eq!(early.made(), late.made(), "{}", executor.info());
        assert!(late.dispatches > early.dispatches);
    }
}

/// Runs a graph on a fresh backend of each kind, with a library of its own.
fn run_fresh(
    index: usize,
    frame: &Frame,
    build: impl Fn(&mut Graph),
) -> (Plan, KernelStats, Counters, Execution) {
    let mut executor = executors().remove(index);
    let kernels = etalon::effects::kernels();
    let mut graph = Graph::new();
    build(&mut graph);
    let plan = plan_for(
        executor.as_ref(),
        &graph,
        &kernels,
        Arithmetic::Strict,
        Capture::Outputs,
    )
    .unwrap();
    let execution = executor.execute(&plan, &frame.inputs()).unwrap();
    (plan, kernels.stats(), executor.counters(), execution)
}

/// Frames that lack what calls for an effect, the settings they are shown with, and the
/// same with the effect off.
fn frames_that_lack_something() -> Vec<(&'static str, Frame, ChainSettings, ChainSettings)> {
    let full = ChainSettings::full();
    let mut matte = frame();
    for texel in matte.specular.bytes.chunks_exact_mut(4) {
        texel[..3].fill(0);
    }
    // Light of up to 0.25, where bloom begins at 0.5; adapted to nothing.
    let fixed = ChainSettings {
        exposure: None,
        ..full
    };
    let mut dim = frame();
    let texels: Vec<[f32; 4]> = dim
        .colour
        .to_rgba_f32()
        .unwrap()
        .iter()
        .map(|&[r, g, b, a]| [r.min(0.25), g.min(0.25), b.min(0.25), a])
        .collect();
    dim.colour = etalon::image::ImageData::from_rgba_f32(dim.colour.desc, &texels).unwrap();
    let mut smooth = frame();
    for texel in smooth.specular.bytes.chunks_exact_mut(4) {
        texel[3] = 255;
    }
    vec![
        (
            "nothing mirrors",
            matte,
            full,
            ChainSettings { ssr: None, ..full },
        ),
        (
            "nothing is bright",
            dim,
            fixed,
            ChainSettings {
                bloom: None,
                ..fixed
            },
        ),
        (
            "all is smooth",
            smooth,
            full,
            ChainSettings {
                ssr: Some(Ssr {
                    blur_radius: 0,
                    ..Ssr::default()
                }),
                ..full
            },
        ),
    ]
}

/// What nothing on the screen calls for costs what it costs in a graph without it, and
/// its absence changes no bit of the picture.
#[test]
fn what_the_screen_does_not_call_for_costs_nothing_and_changes_nothing() {
    let names: Vec<String> = executors()
        .iter()
        .map(|executor| executor.info().to_string())
        .collect();
    for (what, frame, settings, without) in frames_that_lack_something() {
        for (index, name) in names.iter().enumerate() {
            let name = format!("{what}, {name}");
            let chained = |settings: ChainSettings| {
                run_fresh(index, &frame, |graph| {
                    let inputs = frame.import(graph, 1.0 / 60.0).unwrap();
                    let result = chain(graph, &inputs, &settings).unwrap();
                    graph.output("picture", result.picture).unwrap();
                })
            };
            let called_for = run_fresh(index, &frame, |graph| {
                let inputs = frame.import(graph, 1.0 / 60.0).unwrap();
                let request = Request {
                    demands: frame.demands(),
                    settings,
                    ..Request::default()
                };
                of_images(graph, &inputs, &request).unwrap();
            });
            let (always_on, built_without) = (chained(settings), chained(without));
            assert_eq!(called_for.0.steps, built_without.0.steps, "{name}");
            assert_eq!(called_for.0.structure(), built_without.0.structure());
            assert_eq!(called_for.1, built_without.1, "{name}: kernels");
            assert_eq!(called_for.2, built_without.2, "{name}: counters");
            assert!(
                called_for.2.dispatches < always_on.2.dispatches
                    && called_for.2.kernels < always_on.2.kernels,
                "{name}: something must have been left out"
            );
            for other in [&built_without, &always_on] {
                let (a, b) = (called_for.3.output("picture"), other.3.output("picture"));
                assert_eq!(a.unwrap().bytes, b.unwrap().bytes, "{name}");
            }
        }
    }
}

/// Of chains that begin with geometry, by every backend's own idea of memory.
#[test]
fn transient_memory_of_drawn_frames_is_within_a_tenth_of_the_least() {
    use etalon::effects::demand::Outputs;
    use etalon::effects::frame::Shading;
    use etalon_scenes::models;
    let kernels = etalon::effects::kernels();
    let executors = executors();
    let mut worst = 0.0_f64;
    for entry in models() {
        let shot = Shot::new((entry.build)().unwrap(), 0.5).unwrap();
        for (width, height) in [(64, 36), (333, 77), (1920, 1080)] {
            let size = FrameSize::new(width, height).unwrap();
            for shading in [Shading::Forward, Shading::Deferred] {
                for outputs in [Outputs::PICTURE, Outputs::ALL] {
                    let mut graph = Graph::new();
                    let sky = Shot::sky(&mut graph).unwrap();
                    let request = Request {
                        demands: shot.demands(size, &sky).unwrap(),
                        outputs,
                        ..Request::default()
                    };
                    shot.frame(&mut graph, size, sky, shading, 1.0 / 60.0, &request)
                        .unwrap();
                    for executor in &executors {
                        let plan = plan_for(
                            executor.as_ref(),
                            &graph,
                            &kernels,
                            Arithmetic::Strict,
                            Capture::None,
                        )
                        .unwrap();
                        let memory = plan.transient_memory();
                        worst = worst.max(memory.excess());
                        assert!(
                            memory.excess() <= 0.1,
                            "{}, {width}×{height}, {shading:?}, {outputs:?}, {}: {memory:?}",
                            entry.name,
                            executor.info()
                        );
                    }
                }
            }
        }
    }
    println!("at most {:.1} % over the least", 100.0 * worst);
}

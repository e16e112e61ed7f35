//! What is not asked for costs nothing, and what is asked for again costs
//! nothing anew.

use etalon::backend::{Backend, Counters, Execution};
use etalon::effects::composite::Composite;
use etalon::effects::exposure::Exposure;
use etalon::effects::ssr::Ssr;
use etalon::effects::{ChainSettings, bloom, chain, ssr};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary, KernelStats};
use etalon::plan::{Capture, Plan};
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
            let kernels = KernelLibrary::new();
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
    let kernels = KernelLibrary::new();
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

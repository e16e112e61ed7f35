//! What a plan says that it makes and does, against what each backend counted.

use std::collections::BTreeMap;

use etalon::backend::{Backend, Counters, Inputs};
use etalon::effects::{ChainSettings, chain};
use etalon::graph::{Graph, ResourceDesc};
use etalon::kernel::Arithmetic;
use etalon::plan::{Capture, Plan};
use etalon::resource::BufferDesc;
use etalon_scenes::model::Shot;
use etalon_scenes::{FrameSize, model, scene};
use etalon_tests::{executors, plan_for};

/// Bytes behind one resource of every slot, without alignment.
fn slot_bytes(plan: &Plan) -> u64 {
    let mut slots = BTreeMap::new();
    for resource in &plan.resources {
        if let Some(place) = resource.placement() {
            let bytes = match resource.desc {
                ResourceDesc::Texture(desc) => desc.bytes().unwrap(),
                ResourceDesc::Buffer(desc) => desc.bytes,
            };
            slots.insert(place.slot, bytes);
        }
    }
    slots.values().sum()
}

/// Runs a plan twice on a fresh backend and holds its counters against the plan's.
fn check(executor: &mut dyn Backend, plan: &Plan, inputs: &Inputs<'_>) {
    let who = executor.info();
    let before = executor.counters();
    executor.execute(plan, inputs).unwrap();
    let first = executor.counters().since(&before);
    executor.execute(plan, inputs).unwrap();
    let second = executor.counters().since(&before).since(&first);
    let said = plan.counters();
    let made = |counters: &Counters| (counters.kernels, counters.pipelines);
    assert_eq!(made(&first), made(&said), "{who}");
    assert_eq!(made(&second), (0, 0), "{who}: made twice");
    let groups = if who.backend == "cpu" {
        0
    } else {
        said.bind_groups
    };
    assert_eq!(first.bind_groups, groups, "{who}");
    let done = |counters: &Counters| {
        [
            ("passes", counters.passes),
            ("dispatches", counters.dispatches),
            ("draws", counters.draws),
            ("barriers", counters.barriers),
            ("invocations", counters.invocations),
        ]
    };
    for counted in [&first, &second] {
        assert_eq!(done(counted), done(&said), "{who}");
    }
    let transient = match who.backend {
        // Bytes are shared by all that live at other times.
        "ash" => said.transient_bytes,
        // Whole resources are.
        _ => slot_bytes(plan),
    };
    assert_eq!(first.transient_bytes, transient, "{who}");
    assert!(first.bytes > first.transient_bytes, "{who}: inputs persist");
    assert_eq!(
        first.persistent_bytes(),
        first.bytes - first.transient_bytes
    );
}

#[test]
fn backends_count_what_the_plan_of_a_chain_says() {
    let frame = scene("wet-floor")
        .unwrap()
        .frame(FrameSize::new(96, 54).unwrap())
        .unwrap();
    for executor in &mut executors() {
        let kernels = etalon::effects::kernels();
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
        let result = chain(&mut graph, &inputs, &ChainSettings::full()).unwrap();
        graph.output("picture", result.picture).unwrap();
        let plan = plan_for(
            executor.as_ref(),
            &graph,
            &kernels,
            Arithmetic::Strict,
            Capture::Outputs,
        )
        .unwrap();
        assert!(plan.counters().dispatches > 20);
        check(executor.as_mut(), &plan, &frame.inputs());
    }
}

#[test]
fn backends_count_what_the_plan_of_draws_says() {
    let model = (model("gallery").unwrap().build)().unwrap();
    let shot = Shot::new(model, 0.5).unwrap();
    let size = FrameSize::new(64, 36).unwrap();
    for executor in &mut executors() {
        let kernels = etalon::effects::kernels();
        let mut graph = Graph::new();
        let sky = Shot::sky(&mut graph).unwrap();
        let drawn = shot.draw(&mut graph, size, sky, 1.0 / 60.0).unwrap();
        graph.output("light", drawn.light).unwrap();
        graph.output("deferred", drawn.deferred).unwrap();
        let plan = plan_for(
            executor.as_ref(),
            &graph,
            &kernels,
            Arithmetic::Strict,
            Capture::Outputs,
        )
        .unwrap();
        assert!(plan.counters().draws > 20);
        check(executor.as_mut(), &plan, &shot.inputs());
    }
}

/// Workgroups that only the device knows are counted by the interpreter alone.
#[test]
fn indirect_invocations_are_counted_apart() {
    let mut kernels = etalon::effects::kernels();
    kernels.add_source(
        "test/arguments",
        "@group(0) @binding(0) var<storage, read_write> groups: array<u32>;
         @compute @workgroup_size(1) fn main() { groups[0] = 3u; groups[1] = 2u; groups[2] = 1u; }",
    );
    kernels.add_source(
        "test/work",
        "@group(0) @binding(0) var<storage, read_write> seen: array<u32>;
         @compute @workgroup_size(4, 4) fn main() { seen[0] = 7u; }",
    );
    for executor in &mut executors() {
        let mut graph = Graph::new();
        let arguments = graph.buffer("arguments", BufferDesc { bytes: 16 });
        let arguments = graph.clear_buffer(arguments).unwrap();
        let arguments = graph
            .compute("test/arguments")
            .update_buffer("groups", arguments)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("groups")
            .unwrap();
        let seen = graph.buffer("seen", BufferDesc { bytes: 16 });
        let seen = graph.clear_buffer(seen).unwrap();
        let seen = graph
            .compute("test/work")
            .update_buffer("seen", seen)
            .indirect(arguments, 0)
            .unwrap()
            .buffer("seen")
            .unwrap();
        graph.output_buffer("seen", seen).unwrap();
        let plan = plan_for(
            executor.as_ref(),
            &graph,
            &kernels,
            Arithmetic::Strict,
            Capture::Outputs,
        )
        .unwrap();
        assert_eq!(plan.counters().invocations, 1);
        executor.execute(&plan, &Inputs::new()).unwrap();
        let counted = executor.counters();
        assert_eq!((counted.dispatches, counted.passes), (2, 4));
        assert_eq!(counted.invocations, 1);
        let indirect = if executor.info().backend == "cpu" {
            3 * 2 * 16
        } else {
            0
        };
        assert_eq!(counted.indirect_invocations, indirect);
    }
}

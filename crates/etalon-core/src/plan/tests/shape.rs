//! What runs, in what order, and what it says of itself.

use super::{R32, library, plan, plan_with};
use crate::graph::{ClearValue, Graph, GraphError, Texture};
use crate::plan::{Capture, Plan, PlanError, ResourceKind, Step};

fn write(graph: &mut Graph, name: &str, inputs: &[Texture], target: Texture) -> Texture {
    let kernel = format!("test/write{}", inputs.len());
    let mut pass = graph.compute(kernel).named(name);
    for (index, input) in inputs.iter().enumerate() {
        pass = pass.read(format!("in{index}"), *input);
    }
    pass.write("result", target).per_texel("result").unwrap()
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.steps.iter().map(|step| step.name.as_str()).collect()
}

#[test]
fn what_nothing_asks_for_is_culled_with_its_reason() {
    let mut graph = Graph::new();
    let source = graph.import_texture("source", R32).unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| graph.texture(name, R32));
    let a = write(&mut graph, "wanted", &[source], a);
    let b = write(&mut graph, "feeds the unwanted", &[source], b);
    let _ = write(&mut graph, "unwanted", &[b], c);
    graph.output("result", a).unwrap();
    let plan = plan(&graph).unwrap();
    assert_eq!(names(&plan), ["wanted"]);
    assert_eq!(plan.steps[0].reason, "writes output `result`");
    assert_eq!(plan.steps[0].goal, "result");
    let culled: Vec<_> = plan
        .culled
        .iter()
        .map(|pass| (pass.name.as_str(), pass.reason.as_str()))
        .collect();
    assert_eq!(
        culled,
        [
            (
                "feeds the unwanted",
                "writes `b` for `unwanted`, which does not run either"
            ),
            (
                "unwanted",
                "writes `c`, which nothing reads and no output asks for"
            ),
        ]
    );
    assert!(
        plan.resources
            .iter()
            .all(|resource| resource.name != "b" && resource.name != "c")
    );
}

#[test]
fn every_pass_tells_its_effect_and_for_which_output_it_runs() {
    let mut graph = Graph::new();
    let source = graph.import_texture("source", R32).unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| graph.texture(name, R32));
    let a = write(&mut graph, "blur/first", &[source], a);
    let b = write(&mut graph, "blur/second", &[a], b);
    let c = write(&mut graph, "grade/only", &[b], c);
    graph.output("picture", c).unwrap();
    let plan = plan(&graph).unwrap();
    let told: Vec<_> = plan
        .steps
        .iter()
        .map(|step| [&step.effect, &step.reason, &step.goal].map(String::as_str))
        .collect();
    assert_eq!(
        told,
        [
            ["blur", "`blur/second` reads what it writes", "picture"],
            ["blur", "`grade/only` reads what it writes", "picture"],
            ["grade", "writes output `picture`", "picture"],
        ]
    );
    let text = plan.to_string();
    assert!(
        text.contains("`blur/second` reads what it writes, for `picture`"),
        "{text}"
    );
}

#[test]
fn decisions_are_told_and_change_nothing_else() {
    use crate::graph::Decision;
    let build = |decided: bool| {
        let mut graph = Graph::new();
        let source = graph.import_texture("source", R32).unwrap();
        let [a, b] = ["a", "b"].map(|name| graph.texture(name, R32));
        let a = write(&mut graph, "blur/only", &[source], a);
        write(&mut graph, "grain/only", &[source], b);
        graph.output("picture", a).unwrap();
        if decided {
            graph.decide("ssr", Decision::absent("nothing mirrors"));
            graph.decide("blur", Decision::runs("whatever"));
            graph.decide("blur", Decision::runs("the picture is to be soft"));
            graph.decide("blur/only", Decision::runs("it is all there is of it"));
        }
        plan(&graph).unwrap()
    };
    let (with, without) = (build(true), build(false));
    let told: Vec<_> = with
        .effects
        .iter()
        .map(|effect| {
            let decision = effect.decision.to_string();
            (effect.name.as_str(), decision, effect.passes, effect.culled)
        })
        .collect();
    let undecided = "runs: its passes were declared, and nothing was decided of it";
    assert_eq!(
        told,
        [
            ("blur", "runs: the picture is to be soft".to_owned(), 1, 0),
            (
                "blur/only",
                "runs: it is all there is of it".to_owned(),
                1,
                0
            ),
            ("grain", undecided.to_owned(), 0, 1),
            ("ssr", "absent: nothing mirrors".to_owned(), 0, 0),
        ]
    );
    assert!(with.to_string().contains("ssr absent: nothing mirrors"));
    assert_eq!(with.structure(), without.structure());
    assert_eq!(
        Plan {
            effects: without.effects.clone(),
            ..with
        },
        without
    );
}

#[test]
fn a_culled_pass_has_no_kernel_parsed() {
    let library = library();
    let mut graph = Graph::new();
    let source = graph.import_texture("source", R32).unwrap();
    let [a, b] = ["a", "b"].map(|name| graph.texture(name, R32));
    let _ = write(&mut graph, "unwanted", &[source, source], a);
    let b = write(&mut graph, "wanted", &[source], b);
    let before = library.stats().parsed;
    graph.output("result", b).unwrap();
    plan_with(&graph, &library, Capture::None).unwrap();
    assert_eq!(library.stats().parsed - before, 1);
}

#[test]
fn a_reader_of_old_contents_runs_before_they_are_written_over() {
    let mut graph = Graph::new();
    let [a, b] = ["a", "b"].map(|name| graph.texture(name, R32));
    let first = graph.clear(a, ClearValue::Float([1.0; 4])).unwrap();
    let second = write(&mut graph, "over", &[], first);
    // Declared after `over`, yet it must see what was there before.
    let old = write(&mut graph, "old", &[first], b);
    graph.output("new", second).unwrap();
    graph.output("old", old).unwrap();
    let plan = plan(&graph).unwrap();
    assert_eq!(names(&plan), ["clear a", "old", "over"]);
}

#[test]
fn contradictory_versions_are_a_cycle_that_names_its_passes() {
    let mut graph = Graph::new();
    let [a, b] = ["a", "b"].map(|name| graph.texture(name, R32));
    let first = graph.clear(a, ClearValue::Float([1.0; 4])).unwrap();
    let second = write(&mut graph, "over", &[], first);
    // Wants the contents both before and after `over`.
    let both = write(&mut graph, "both", &[first, second], b);
    graph.output("both", both).unwrap();
    let Err(PlanError::Cycle { passes }) = plan(&graph) else {
        panic!("no cycle found")
    };
    assert_eq!(passes, ["both", "over"]);
}

#[test]
fn an_output_that_is_written_over_is_refused() {
    let mut graph = Graph::new();
    let a = graph.texture("a", R32);
    let first = write(&mut graph, "first", &[], a);
    let b = graph.texture("b", R32);
    let reader = write(&mut graph, "reader", &[first], b);
    let second = write(&mut graph, "second", &[reader], first);
    graph.output("first", first).unwrap();
    graph.output("second", second).unwrap();
    match plan(&graph) {
        Err(PlanError::OutputOverwritten {
            output,
            resource,
            by,
        }) => {
            assert_eq!(
                (output.as_str(), resource.as_str(), by.as_str()),
                ("first", "a", "second")
            );
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_plan_does_not_depend_on_the_order_in_which_unrelated_effects_were_added() {
    let build = |order: [usize; 3]| {
        let mut graph = Graph::new();
        let source = graph.import_texture("source", R32).unwrap();
        for effect in order {
            let mut last = source;
            for pass in 0..3 {
                let target = graph.texture(format!("effect {effect}, {pass}"), R32);
                last = write(
                    &mut graph,
                    &format!("effect {effect}, pass {pass}"),
                    &[last],
                    target,
                );
            }
            graph.output(&format!("output {effect}"), last).unwrap();
        }
        plan(&graph).unwrap()
    };
    let reference = build([0, 1, 2]);
    assert_eq!(reference.steps.len(), 9);
    for order in [[2, 1, 0], [1, 0, 2], [2, 0, 1]] {
        let other = build(order);
        assert_eq!(reference, other);
        assert_eq!(reference.structure(), other.structure());
    }
}

#[test]
fn a_history_that_is_read_must_be_written_and_is_then_kept_alive() {
    use crate::Format;
    let mut graph = Graph::new();
    let history = graph
        .history("exposure", R32, ClearValue::Float([1.0; 4]))
        .unwrap();
    let target = graph.texture("result", R32);
    let shown = write(&mut graph, "show", &[history.previous], target);
    graph.output("shown", shown).unwrap();
    match plan(&graph) {
        Err(PlanError::HistoryNotWritten { history }) => assert_eq!(history, "exposure"),
        other => panic!("{other:?}"),
    }
    // Written, though no output of this frame depends on it.
    write(&mut graph, "adapt", &[history.previous], history.current);
    let kept = plan(&graph).unwrap();
    assert_eq!(names(&kept), ["show", "adapt"]);
    assert_eq!(
        kept.steps[1].reason,
        "writes history `exposure` for the next frame"
    );
    assert_eq!(kept.histories.len(), 1);
    let [previous, current] = [kept.histories[0].previous, kept.histories[0].current]
        .map(|r| &kept.resources[r as usize]);
    assert_eq!(previous.kind, ResourceKind::HistoryPrevious(0));
    assert_eq!(current.kind, ResourceKind::HistoryCurrent(0));

    let wrong = Graph::new()
        .history(
            "h",
            R32.with_format(Format::R32Uint),
            ClearValue::Float([0.0; 4]),
        )
        .map(|_| ());
    assert!(matches!(wrong, Err(GraphError::ClearMismatch { .. })));
}

#[test]
fn a_history_nobody_reads_costs_nothing() {
    let mut graph = Graph::new();
    let history = graph
        .history("exposure", R32, ClearValue::Float([1.0; 4]))
        .unwrap();
    write(&mut graph, "adapt", &[history.previous], history.current);
    let target = graph.texture("result", R32);
    let shown = write(&mut graph, "show", &[], target);
    graph.output("shown", shown).unwrap();
    let plan = plan(&graph).unwrap();
    assert_eq!(names(&plan), ["show"]);
    assert!(plan.histories.is_empty());
}

#[test]
fn every_pass_can_be_captured_even_where_it_is_written_over_later() {
    let mut graph = Graph::new();
    let a = graph.texture("a", R32);
    let first = write(&mut graph, "first", &[], a);
    let second = graph
        .compute("test/update0")
        .named("second")
        .update("result", first)
        .per_texel("result")
        .unwrap();
    graph.output("result", second).unwrap();
    let plan = plan_with(&graph, &library(), Capture::EveryPass).unwrap();
    assert_eq!(
        names(&plan),
        [
            "first",
            "capture first/result",
            "second",
            "capture second/result"
        ]
    );
    let plan = plan_with(&graph, &library(), Capture::Outputs).unwrap();
    assert_eq!(names(&plan), ["first", "second", "capture output/result"]);
    assert!(matches!(&plan.steps[2].step, Step::Capture { binding, .. } if binding == "result"));
}

#[test]
fn per_mip_makes_a_pass_for_each_mip_reading_the_one_above() {
    let mut graph = Graph::new();
    let chain = graph.texture("chain", R32.with_mips(5));
    let mut chain = graph
        .clear(chain.mip(0), ClearValue::Float([1.0; 4]))
        .unwrap();
    chain = graph
        .compute("test/write1")
        .named("down")
        .per_mip("in0", "result", chain)
        .unwrap();
    graph.output("chain", chain).unwrap();
    let plan = plan(&graph).unwrap();
    assert_eq!(
        names(&plan),
        [
            "clear chain",
            "down mip 1",
            "down mip 2",
            "down mip 3",
            "down mip 4"
        ]
    );
    let groups: Vec<_> = plan
        .steps
        .iter()
        .filter_map(|step| match &step.step {
            Step::Dispatch {
                groups: crate::plan::Groups::Direct(groups),
                ..
            } => Some(groups[0]),
            _ => None,
        })
        .collect();
    assert_eq!(groups, [1, 1, 1, 1]); // 8, 4, 2, 1 texels in groups of 8
}

#[test]
fn mistakes_in_declarations_are_named() {
    let mut graph = Graph::new();
    let mut other = Graph::new();
    let foreign = other.texture("foreign", R32);
    let [a, b] = ["a", "b"].map(|name| graph.texture(name, R32));

    let error = graph
        .compute("test/write1")
        .read("in0", foreign)
        .write("result", a)
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::ForeignHandle { binding, .. } if binding == "in0"),
        "{error}"
    );

    let error = graph
        .compute("test/write1")
        .read("in0", b)
        .write("result", a)
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::ReadBeforeWrite { resource, .. } if resource == "b"),
        "{error}"
    );

    let error = graph
        .compute("test/write0")
        .write("result", a.mip(1))
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(
            &error,
            GraphError::NoSuchSubresource {
                mips: 1,
                first_mip: 1,
                ..
            }
        ),
        "{error}"
    );

    let written = write(&mut graph, "first", &[], a);
    let error = graph
        .compute("test/write0")
        .write("result", a)
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::StaleWrite { by, .. } if by == "first"),
        "{error}"
    );

    let error = graph
        .compute("test/write1")
        .read("in0", written)
        .write("result", written)
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::Hazard { resource, .. } if resource == "a"),
        "{error}"
    );

    let error = graph
        .compute("test/write0")
        .write("result", b)
        .per_texel("goal")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::NoSuchWrite { binding, .. } if binding == "goal"),
        "{error}"
    );

    let error = graph
        .compute("test/write0")
        .set("x", 1.0)
        .set("x", 2.0)
        .write("result", b)
        .per_texel("result")
        .unwrap_err();
    assert!(
        matches!(&error, GraphError::GivenTwice { name, .. } if name == "x"),
        "{error}"
    );

    graph.output("a", written).unwrap();
    assert!(matches!(
        graph.output("a", written),
        Err(GraphError::DuplicateName { what: "output", .. })
    ));
    graph.import_texture("i", R32).unwrap();
    assert!(matches!(
        graph.import_texture("i", R32),
        Err(GraphError::DuplicateName { what: "import", .. })
    ));

    let big = graph.texture(
        "big",
        crate::resource::TextureDesc::d2(17, 16, crate::Format::R32Float),
    );
    assert!(matches!(
        graph.copy(written, big),
        Err(GraphError::CopyMismatch { .. })
    ));
    assert!(matches!(
        graph.clear(big, ClearValue::Uint([0; 4])),
        Err(GraphError::ClearMismatch { .. })
    ));
}

#[test]
fn impossible_sizes_are_refused_before_anything_is_made() {
    use crate::resource::{ResourceError, TextureDesc};
    for (desc, wanted) in [
        (TextureDesc::d2(0, 0, crate::Format::R32Float), "zero"),
        (
            TextureDesc::d2(u32::MAX, 1, crate::Format::R32Float),
            "limit",
        ),
        (
            TextureDesc::d2(1 << 31, 1 << 31, crate::Format::Rgba32Float),
            "limit",
        ),
        (
            TextureDesc::d2(4, 4, crate::Format::R32Float).with_mips(9),
            "at most 3",
        ),
        (
            TextureDesc::cube(u32::MAX, crate::Format::R32Float).with_mips(u32::MAX),
            "limit",
        ),
    ] {
        let mut graph = Graph::new();
        let target = graph.texture("result", desc);
        let target = graph.clear(target, ClearValue::Float([0.0; 4])).unwrap();
        graph.output("result", target).unwrap();
        match plan(&graph) {
            Err(PlanError::Resource { resource, error }) => {
                assert_eq!(resource, "result");
                assert!(error.to_string().contains(wanted), "{error}");
                assert!(!matches!(error, ResourceError::NotACube { .. }));
            }
            other => panic!("{desc:?}: {other:?}"),
        }
    }
}

#[test]
fn a_plan_prints_and_serialises() {
    let mut graph = Graph::new();
    let source = graph.import_texture("source", R32).unwrap();
    let a = graph.texture("a", R32);
    let a = write(&mut graph, "pass", &[source], a);
    graph.output("result", a).unwrap();
    let plan = plan(&graph).unwrap();
    let text = plan.to_string();
    assert!(
        text.contains("pass (test/write1") && text.contains("writes output `result`"),
        "{text}"
    );
    let json: serde_json::Value = serde_json::from_str(&plan.to_json().unwrap()).unwrap();
    assert_eq!(json["steps"][0]["name"], "pass");
    assert_eq!(
        json["steps"][0]["step"]["Dispatch"]["kernel"],
        "test/write1"
    );
}

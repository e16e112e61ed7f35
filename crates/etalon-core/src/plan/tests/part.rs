//! Passes that write a part of a texture and keep the rest.

use super::{R32, library, plan, plan_with};
use crate::graph::{Graph, GraphError, Texture};
use crate::plan::{Capture, Plan, Step, Usage};

fn part(graph: &mut Graph, name: &str, target: Texture) -> Texture {
    let pass = graph.compute("test/write0").named(name);
    let pass = pass.write_part("result", target);
    pass.per_texel("result").unwrap()
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.steps.iter().map(|step| step.name.as_str()).collect()
}

#[test]
fn what_is_kept_is_needed() {
    let mut graph = Graph::new();
    let texture = graph.texture("a", R32);
    let first = part(&mut graph, "first", texture);
    let second = part(&mut graph, "second", first);
    let third = part(&mut graph, "third", second);
    graph.output("result", third).unwrap();
    let planned = plan(&graph).unwrap();
    assert_eq!(names(&planned), ["first", "second", "third"]);
    assert!(planned.culled.is_empty());
    // The first finds nothing that has to be kept; each other waits for the one before
    // and keeps its contents.
    let layouts: Vec<Vec<_>> = planned
        .steps
        .iter()
        .map(|step| {
            let layouts = step.barriers.iter().map(|barrier| barrier.layout);
            layouts.collect::<Vec<_>>()
        })
        .collect();
    let kept = vec![Some(Usage::StorageWrite)];
    let expected = [vec![None], kept.clone(), kept];
    assert_eq!(layouts, expected);
}

/// A whole write keeps nothing: what was written in part before it is not needed.
#[test]
fn a_whole_write_needs_no_part() {
    let mut graph = Graph::new();
    let texture = graph.texture("a", R32);
    let first = part(&mut graph, "part", texture);
    let pass = graph.compute("test/write0").named("whole");
    let whole = pass.write("result", first).per_texel("result").unwrap();
    graph.output("result", whole).unwrap();
    assert_eq!(names(&plan(&graph).unwrap()), ["whole"]);
}

#[test]
fn only_captures_of_every_pass_clear_and_only_what_nothing_wrote() {
    let mut graph = Graph::new();
    let texture = graph.texture("a", R32);
    let first = part(&mut graph, "first", texture);
    let second = part(&mut graph, "second", first);
    graph.output("result", second).unwrap();
    let captured = plan_with(&graph, &library(), Capture::EveryPass).unwrap();
    assert_eq!(
        names(&captured),
        [
            "clear first/result",
            "first",
            "capture first/result",
            "second",
            "capture second/result"
        ]
    );
    assert!(matches!(captured.steps[0].step, Step::ClearTexture { .. }));
    for capture in [Capture::None, Capture::Outputs] {
        let plain = plan_with(&graph, &library(), capture).unwrap();
        assert_eq!(names(&plain)[..2], ["first", "second"], "{capture:?}");
    }
}

#[test]
fn an_import_written_in_part_is_never_cleared() {
    let mut graph = Graph::new();
    let import = graph.import_texture("import", R32).unwrap();
    let written = part(&mut graph, "part", import);
    graph.output("result", written).unwrap();
    let captured = plan_with(&graph, &library(), Capture::EveryPass).unwrap();
    assert_eq!(names(&captured), ["part", "capture part/result"]);
}

#[test]
fn a_part_is_written_over_the_newest_version_only() {
    let mut graph = Graph::new();
    let texture = graph.texture("a", R32);
    let _ = part(&mut graph, "first", texture);
    let pass = graph.compute("test/write0").named("late");
    let refused = pass.write_part("result", texture).per_texel("result");
    assert!(matches!(refused, Err(GraphError::StaleWrite { .. })));
}

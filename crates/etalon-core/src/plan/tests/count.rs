//! What a plan says that it makes and does, on graphs small enough to count by hand.

use super::{R32, library, plan_with};
use crate::graph::{ClearValue, Graph};
use crate::plan::{Capture, Groups};
use crate::resource::BufferDesc;

#[test]
fn a_plan_counts_what_it_makes_and_does() {
    let mut library = library();
    library.add_source(
        "test/count",
        "@group(0) @binding(0) var<storage, read_write> seen: array<u32>;
         @compute @workgroup_size(4, 2) fn main() { seen[0] = 1u; }",
    );
    let mut graph = Graph::new();
    let [a, b, c] = ["a", "b", "c"].map(|name| graph.texture(name, R32));
    let a = graph.clear(a, ClearValue::Float([0.0; 4])).unwrap();
    let mut last = a;
    for target in [b, c] {
        last = graph
            .compute("test/write1")
            .read("in0", last)
            .write("result", target)
            .per_texel("result")
            .unwrap();
    }
    graph.output("result", last).unwrap();
    let seen = graph.buffer("seen", BufferDesc { bytes: 16 });
    let seen = graph.clear_buffer(seen).unwrap();
    let seen = graph
        .compute("test/count")
        .update_buffer("seen", seen)
        .groups([3, 0, 5])
        .unwrap()
        .buffer("seen")
        .unwrap();
    let seen = graph
        .compute("test/count")
        .update_buffer("seen", seen)
        .groups([3, 2, 5])
        .unwrap()
        .buffer("seen")
        .unwrap();
    graph.output_buffer("seen", seen).unwrap();
    let plan = plan_with(&graph, &library, Capture::Outputs).unwrap();
    let counters = plan.counters();
    // `write1` and `count`, two dispatches of each, one of which does nothing.
    assert_eq!((counters.kernels, counters.pipelines), (2, 2));
    assert_eq!((counters.dispatches, counters.draws), (3, 0));
    assert_eq!(counters.bind_groups, 3);
    // Two clears as well; the captures are not counted.
    assert_eq!(counters.passes, 5);
    // 16 × 16 texels twice, and 30 workgroups of 8.
    assert_eq!(counters.invocations, 2 * 256 + 30 * 8);
    assert_eq!(counters.indirect_invocations, 0);
    assert_eq!(counters.barriers, plan.barrier_count() as u64);
    // `a` and `b` follow each other and overlap for a step.
    assert_eq!(counters.transient_bytes, 2 * R32.bytes().unwrap());
}

#[test]
fn invocations_that_nobody_can_count_do_not_overflow() {
    let most = Groups::Direct([u32::MAX; 3]);
    assert_eq!(most.invocations([u32::MAX; 3]), Some(u64::MAX));
    assert_eq!(Groups::Direct([2, 0, 7]).invocations([8, 8, 1]), Some(0));
    let indirect = Groups::Indirect {
        buffer: 0,
        offset: 0,
    };
    assert_eq!(indirect.invocations([8, 8, 1]), None);
    assert!(!indirect.is_none());
}

#[test]
fn what_was_made_and_what_was_done_are_told_apart() {
    use crate::backend::Counters;
    let earlier = Counters {
        kernels: 1,
        bytes: 10,
        transient_bytes: 4,
        dispatches: 7,
        ..Counters::default()
    };
    let later = Counters {
        dispatches: 9,
        barriers: 3,
        ..earlier
    };
    assert_eq!(earlier.made(), later.made());
    assert_eq!(later.persistent_bytes(), 6);
    let between = later.since(&earlier);
    assert_eq!((between.kernels, between.dispatches), (0, 2));
    assert_eq!((between.barriers, between.bytes), (3, 10));
}

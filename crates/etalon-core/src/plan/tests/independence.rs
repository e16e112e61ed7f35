//! The plan follows from the shape of a graph, not from the order in which it was
//! written down.

use proptest::prelude::*;

use super::{R32, plan_with};
use crate::graph::{Decision, Graph, Texture};
use crate::kernel::KernelLibrary;
use crate::plan::{Capture, Plan};

fn library() -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for reads in 1..3_u32 {
        let mut source = String::from("struct Params { amount: f32 }\n");
        for read in 0..reads {
            source += &format!("@group(0) @binding({read}) var in{read}: texture_2d<f32>;\n");
        }
        source += "@group(0) @binding(8) var<uniform> params: Params;\n\
                   @group(0) @binding(9) var result: texture_storage_2d<r32float, write>;\n\
                   @compute @workgroup_size(8, 8)\n\
                   fn main(@builtin(global_invocation_id) id: vec3<u32>) {\n\
                   var sum = params.amount;\n";
        for read in 0..reads {
            source += &format!("sum = sum + textureLoad(in{read}, id.xy, 0).x;\n");
        }
        source += "textureStore(result, id.xy, vec4f(sum)); }\n";
        library.add_source(&format!("test/tuned{reads}"), &source);
    }
    library
}

/// One effect: passes that read earlier ones of it, or what all effects read.
fn effect(graph: &mut Graph, number: usize, choices: &[u32], shared: Texture) {
    let mut written = vec![shared];
    for (index, choice) in choices.iter().enumerate() {
        let target = graph.texture(format!("{number} {index}"), R32);
        let pick = |factor: u32| written[choice.wrapping_mul(factor) as usize % written.len()];
        let mut inputs = vec![pick(1), pick(7)];
        inputs.dedup();
        let mut pass = graph
            .compute(format!("test/tuned{}", inputs.len()))
            .named(format!("effect {number}/pass {index}"))
            .set("amount", *choice as f32);
        for (position, input) in inputs.iter().enumerate() {
            pass = pass.read(format!("in{position}"), *input);
        }
        written.push(pass.write("result", target).per_texel("result").unwrap());
    }
    // The last one, and one that may be needed for it or not at all.
    let half = written[written.len() / 2];
    graph
        .output(&format!("{number} last"), written[written.len() - 1])
        .unwrap();
    graph.output(&format!("{number} half"), half).unwrap();
    graph.decide(format!("effect {number}"), Decision::runs("asked for"));
}

fn plan(effects: &[Vec<u32>], order: &[usize], library: &KernelLibrary) -> Plan {
    let mut graph = Graph::new();
    let source = graph.import_texture("source", R32).unwrap();
    let before = graph.texture("before all", R32);
    let shared = graph
        .compute("test/tuned1")
        .named("shared/only")
        .set("amount", 0.5)
        .read("in0", source)
        .write("result", before)
        .per_texel("result")
        .unwrap();
    for &number in order {
        effect(&mut graph, number, &effects[number], shared);
    }
    plan_with(&graph, library, Capture::Outputs).unwrap()
}

#[test]
fn the_order_of_unrelated_effects_changes_nothing() {
    let config = ProptestConfig {
        cases: 200,
        failure_persistence: None,
        rng_seed: prop::test_runner::RngSeed::Fixed(11),
        ..ProptestConfig::default()
    };
    let library = library();
    let effects = prop::collection::vec(prop::collection::vec(any::<u32>(), 1..8), 1..6);
    let shuffled = effects.prop_flat_map(|effects| {
        let order: Vec<usize> = (0..effects.len()).collect();
        (Just(effects), Just(order).prop_shuffle())
    });
    prop::test_runner::TestRunner::new(config)
        .run(&shuffled, |(effects, order)| {
            let straight: Vec<usize> = (0..effects.len()).collect();
            let (one, other) = (
                plan(&effects, &straight, &library),
                plan(&effects, &order, &library),
            );
            prop_assert_eq!(one.structure(), other.structure());
            prop_assert_eq!(one.to_json().unwrap(), other.to_json().unwrap());
            prop_assert!(one == other);
            Ok(())
        })
        .unwrap();
}

/// What compares plans must see a difference: one value, one read, one effect less.
#[test]
fn plans_that_differ_are_told_apart() {
    let library = library();
    let effects = [vec![1, 2, 3], vec![4, 5]];
    let reference = plan(&effects, &[0, 1], &library);
    let value = [vec![1, 2, 6], vec![4, 5]];
    let other = plan(&value, &[0, 1], &library);
    assert_ne!(reference.uniforms, other.uniforms);
    assert!(reference != other);
    let fewer = plan(&effects, &[0], &library);
    assert!(reference != fewer && reference.structure() != fewer.structure());
}

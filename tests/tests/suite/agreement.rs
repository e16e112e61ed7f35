//! Under strict arithmetic every backend gives the same bits, on every pass of
//! every effect, in the first frame and with history.

use etalon::backend::{Backend, CapturedData};
use etalon::effects::knob::{Domain, KnobValue};
use etalon::effects::{EffectEntry, effect, effects};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::{Frame, FrameSize, scene, scenes};
use etalon_tests::{executors, first_difference, plan_for};

/// Runs an effect with some knobs set on every executor, the first frame and one
/// with history, and holds each to the interpreter.
fn hold(
    executors: &mut [Box<dyn Backend>],
    kernels: &KernelLibrary,
    frame: &Frame,
    effect: &EffectEntry,
    values: &[(&str, KnobValue)],
    what: &str,
) {
    let mut reference = Vec::new();
    for executor in executors {
        // Stores of packed floats are for devices that say so.
        let packed = |&(_, value): &(&str, KnobValue)| value == KnobValue::Choice("rg11b10ufloat");
        if values.iter().any(packed) && !executor.limits().extended_storage_formats {
            continue;
        }
        executor.reset_histories();
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
        let result = effect.build_with(&mut graph, &inputs, values).unwrap();
        graph.output("result", result).unwrap();
        let strict = Arithmetic::Strict;
        let plan = plan_for(
            executor.as_ref(),
            &graph,
            kernels,
            strict,
            Capture::EveryPass,
        )
        .unwrap();
        for number in 0..2 {
            let execution = executor.execute(&plan, &frame.inputs()).unwrap();
            assert!(!execution.captures.is_empty());
            match reference.get(number) {
                None => reference.push(execution),
                Some(reference) => {
                    let found = first_difference(reference, &execution);
                    assert_eq!(
                        found,
                        None,
                        "{what}, {}, frame {number}: {} against the interpreter",
                        effect.name,
                        executor.info()
                    );
                }
            }
        }
    }
}

#[test]
fn every_pass_of_every_effect_is_bit_equal_on_every_backend() {
    let kernels = etalon::effects::kernels();
    let mut executors = executors();
    for scene in scenes() {
        let frame = scene.frame(FrameSize::new(97, 55).unwrap()).unwrap();
        for effect in effects() {
            hold(&mut executors, &kernels, &frame, effect, &[], scene.name);
        }
    }
}

/// Choices make other kernels; so does every one of them agree.
#[test]
fn every_choice_of_every_knob_is_bit_equal_on_every_backend() {
    let kernels = etalon::effects::kernels();
    let mut executors = executors();
    let scene = scene("wet-floor").unwrap();
    let frame = scene.frame(FrameSize::new(97, 55).unwrap()).unwrap();
    for effect in effects() {
        for knob in effect.knobs() {
            let Domain::Choice(names) = knob.domain else {
                continue;
            };
            for &name in names
                .iter()
                .filter(|name| knob.default != KnobValue::Choice(name))
            {
                hold(
                    &mut executors,
                    &kernels,
                    &frame,
                    effect,
                    &[(knob.name, KnobValue::Choice(name))],
                    &format!("{} {name}", knob.name),
                );
            }
        }
    }
}

/// The comparison must be able to fail: one kernel with one changed constant on
/// one backend, and one bit of one texel.
#[test]
fn a_changed_constant_in_one_backends_kernel_is_found() {
    let mut executors = executors();
    let last = executors.len() - 1;
    let frame = scene("wet-floor").unwrap();
    let frame = frame.frame(FrameSize::new(64, 36).unwrap()).unwrap();
    let mut planted = etalon::effects::kernels();
    let colour = planted.source("lib/colour").unwrap().to_string();
    let changed = colour.replacen("0.7152", "0.7153", 1);
    assert_ne!(colour, changed);
    planted.add_source("lib/colour", &changed);
    let mut run = |index: usize, kernels: &KernelLibrary| {
        let executor = executors[index].as_mut();
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
        let result = effect("bloom").unwrap().build(&mut graph, &inputs).unwrap();
        graph.output("result", result).unwrap();
        let strict = Arithmetic::Strict;
        let plan = plan_for(executor, &graph, kernels, strict, Capture::EveryPass).unwrap();
        executor.execute(&plan, &frame.inputs()).unwrap()
    };
    let good = run(0, &etalon::effects::kernels());
    assert_eq!(
        first_difference(&good, &run(last, &etalon::effects::kernels())),
        None
    );
    let found = first_difference(&good, &run(last, &planted)).unwrap();
    assert!(found.starts_with("pass `bloom/threshold`"), "{found}");

    let mut noisy = good.clone();
    let CapturedData::Texture(image) = &mut noisy.captures[2].data else {
        panic!("bloom writes textures")
    };
    image.bytes[5 * 8] ^= 1;
    let found = first_difference(&good, &noisy).unwrap();
    assert!(found.contains("texel (5, 0)"), "{found}");
    assert!(found.contains("and 0 more"), "{found}");
}

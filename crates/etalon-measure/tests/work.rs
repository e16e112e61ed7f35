//! A kernel cut out of its effect does there what it does in the effect.

use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::backend::{Backend, Captured, Inputs};
use etalon_core::image::ImageData;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Plan, PlanOptions, PlannedStep, Step};
use etalon_core::resource::Limits;
use etalon_cpu::CpuBackend;
use etalon_measure::compare::interpreter;
use etalon_measure::subjects::{Size, frame, library, subject, subjects};
use etalon_measure::work::Work;

const SIZE: Size = Size {
    width: 67,
    height: 41,
};

/// The captures of an effect's second frame, each with its step in the plan.
fn of_effect(
    backend: &mut CpuBackend,
    name: &str,
    arithmetic: Arithmetic,
) -> Vec<(Step, Captured)> {
    let frame = frame(SIZE).unwrap();
    let graph = subject(name).unwrap().graph(&frame).unwrap();
    let options = PlanOptions {
        arithmetic,
        limits: Limits::default(),
        capture: Capture::EveryPass,
        ..PlanOptions::default()
    };
    let plan = Plan::new(&graph, &library(), &options).unwrap();
    backend.reset_histories();
    backend.execute(&plan, &frame.inputs()).unwrap();
    let captures = backend.execute(&plan, &frame.inputs()).unwrap().captures;
    backend.reset_histories();
    let steps = plan.steps.into_iter().map(|planned| planned.step);
    let steps = steps.filter(|step| matches!(step, Step::Capture { .. }));
    steps.zip(captures).collect()
}

/// What a work leaves in the resources that `effect` captured of its steps,
/// and what the effect left there.
fn outcomes(
    backend: &mut CpuBackend,
    work: &Work,
    inputs: &Inputs<'_>,
    effect: &[(Step, Captured)],
) -> Vec<(Captured, Captured)> {
    let mut plan = work.repeated(2);
    let mut wanted = Vec::new();
    for (step, captured) in effect {
        let Step::Capture {
            range,
            pass,
            binding,
            ..
        } = step
        else {
            continue;
        };
        if !work.steps.contains(pass) {
            continue;
        }
        let resource = plan
            .resources
            .iter()
            .position(|resource| resource.name == captured.resource)
            .unwrap();
        plan.steps.push(PlannedStep {
            name: format!("capture {pass} {binding}"),
            effect: String::new(),
            reason: String::new(),
            goal: String::new(),
            barriers: Vec::new(),
            step: Step::Capture {
                resource: resource as u32,
                range: *range,
                pass: pass.clone(),
                binding: binding.clone(),
            },
        });
        wanted.push(captured.clone());
    }
    let got = backend.execute(&plan, inputs).unwrap().captures;
    assert_eq!(got.len(), wanted.len());
    got.into_iter().zip(wanted).collect()
}

#[test]
fn works_leave_what_the_effect_leaves() {
    let mut backend = interpreter(None, 2).unwrap();
    let frame = frame(SIZE).unwrap();
    for subject in subjects() {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            if !subject.has(arithmetic) {
                continue;
            }
            let effect = of_effect(&mut backend, subject.name, arithmetic);
            let works = subject.works(&frame, arithmetic, &mut backend).unwrap();
            let mut steps = 0;
            for work in &works {
                let outcomes = outcomes(&mut backend, work, &work.inputs(), &effect);
                assert!(!outcomes.is_empty(), "{}", work.kernel);
                steps += work.steps.len();
                for (got, wanted) in outcomes {
                    // Whole images are too much to print.
                    assert!(got == wanted, "{} `{}`", wanted.pass, wanted.binding);
                }
            }
            let dispatched = effect
                .iter()
                .filter(|(_, captured)| captured.pass != "output")
                .count();
            assert!(steps > 0 && steps <= dispatched, "{}", subject.name);
        }
    }
}

/// The comparison above would see one wrong texel of an input.
#[test]
fn a_changed_input_changes_the_outcome() {
    let mut backend = interpreter(None, 2).unwrap();
    let frame = frame(SIZE).unwrap();
    let effect = of_effect(&mut backend, "composite", Arithmetic::Strict);
    let works = subject("composite")
        .unwrap()
        .works(&frame, Arithmetic::Strict, &mut backend)
        .unwrap();
    let inputs = works[0].inputs();
    let changed: Vec<(String, ImageData)> = inputs
        .textures
        .iter()
        .map(|(name, image)| {
            let mut image = (*image).clone();
            let middle = (image.bytes.len() / 2) & !7;
            // A half float of 64 in the first channel.
            image.bytes[middle..middle + 2].copy_from_slice(&[0x00, 0x54]);
            (name.to_string(), image)
        })
        .collect();
    let mut inputs = Inputs::new();
    for (name, image) in &changed {
        inputs = inputs.texture(name.as_str(), image);
    }
    let outcomes = outcomes(&mut backend, &works[0], &inputs, &effect);
    assert!(outcomes.iter().any(|(got, wanted)| got != wanted));
}

/// The plans are in order for Vulkan too: the validation layer, with
/// synchronization, says nothing.
#[test]
fn works_are_valid_plans() {
    let required = |name: &str| {
        std::env::var("ETALON_REQUIRE")
            .is_ok_and(|list| list.split(',').any(|required| required.trim() == name))
    };
    let mut vulkan = match AshBackend::new(AshOptions {
        validation: Validation::Synchronization,
        ..AshOptions::default()
    }) {
        Ok(vulkan) => vulkan,
        Err(error) => {
            assert!(
                !required("ash") && !required("validation"),
                "a device under validation is required: {error}"
            );
            eprintln!("not run: {error}");
            return;
        }
    };
    let mut backend = interpreter(None, 2).unwrap();
    let frame = frame(SIZE).unwrap();
    for subject in subjects() {
        for work in subject
            .works(&frame, Arithmetic::Fast, &mut backend)
            .unwrap()
        {
            for times in [0, 1, 3] {
                let plan = work.repeated(times);
                let execution = vulkan
                    .execute(&plan, &work.inputs())
                    .unwrap_or_else(|error| panic!("{} × {times}: {error}", work.kernel));
                assert!(execution.captures.is_empty());
                assert!(
                    [0, times * work.steps.len()].contains(&execution.times.len()),
                    "{}",
                    work.kernel
                );
            }
        }
    }
}

//! Number types on every pass of every effect.

use etalon_core::backend::{Backend, Execution};
use etalon_core::graph::Graph;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions, NumberType, Tier, WideCapture, WideExecution};
use etalon_effects::registry::{EffectEntry, effects};
use etalon_scenes::{Frame, FrameSize, scene};

fn backend(number_type: NumberType, tier: Tier, threads: usize) -> CpuBackend {
    CpuBackend::new(&CpuOptions {
        threads,
        tier: Some(tier),
        number_type,
        ..CpuOptions::default()
    })
    .unwrap()
}

fn plan(backend: &CpuBackend, frame: &Frame, effect: &EffectEntry, arithmetic: Arithmetic) -> Plan {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
    let result = effect.build(&mut graph, &inputs).unwrap();
    graph.output("result", result).unwrap();
    let options = PlanOptions {
        arithmetic,
        limits: backend.limits(),
        capture: Capture::EveryPass,
        memory: backend.memory(),
    };
    Plan::new(&graph, &etalon_effects::kernels(), &options).unwrap()
}

/// Two frames, so that histories take part.
fn run(backend: &mut CpuBackend, plan: &Plan, frame: &Frame) -> Vec<WideExecution> {
    (0..2)
        .map(|_| backend.execute_wide(plan, &frame.inputs()).unwrap())
        .collect()
}

fn tiers() -> impl Iterator<Item = Tier> {
    Tier::ALL.into_iter().filter(|tier| tier.is_available())
}

fn small() -> Frame {
    let size = FrameSize::new(61, 37).unwrap();
    scene("wet-floor").unwrap().frame(size).unwrap()
}

/// Values as bits, with NaNs alike.
fn wide_bits(captures: &[WideCapture]) -> Vec<Vec<u64>> {
    let bits = |value: f64| {
        if value.is_nan() {
            u64::MAX
        } else {
            value.to_bits()
        }
    };
    let of_capture = |capture: &WideCapture| match capture {
        WideCapture::Texture(texels) => texels.iter().flatten().copied().map(bits).collect(),
        WideCapture::Buffer(words) => words
            .iter()
            .map(|word| word.map_or(1, bits))
            .collect::<Vec<u64>>(),
        WideCapture::None => Vec::new(),
    };
    captures.iter().map(of_capture).collect()
}

fn assert_same(a: &Execution, b: &Execution, what: &str) {
    assert_eq!(a.captures.len(), b.captures.len(), "{what}");
    for (a, b) in a.captures.iter().zip(&b.captures) {
        assert!(a == b, "{what}: pass `{}`, `{}` differs", a.pass, a.binding);
    }
}

#[test]
fn the_shadow_leaves_every_pass_of_every_effect_as_it_is() {
    let frame = small();
    for effect in effects() {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            for tier in tiers() {
                let mut single = backend(NumberType::F32, tier, 1);
                let mut shadow = backend(NumberType::Shadow, tier, 2);
                let plan = plan(&single, &frame, effect, arithmetic);
                let expected = run(&mut single, &plan, &frame);
                let got = run(&mut shadow, &plan, &frame);
                for (expected, got) in expected.iter().zip(&got) {
                    let what = format!("{}, {arithmetic:?}, {tier}", effect.name);
                    assert!(!got.captures.is_empty());
                    assert_same(&expected.execution, &got.execution, &what);
                }
            }
        }
    }
}

#[test]
fn wide_results_are_the_same_on_every_tier_and_number_of_threads() {
    let frame = small();
    for effect in effects() {
        for number_type in [NumberType::F64, NumberType::Shadow] {
            for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
                let mut first: Option<Vec<WideExecution>> = None;
                for (threads, tier) in (1..).zip(tiers()) {
                    let mut backend = backend(number_type, tier, threads);
                    let plan = plan(&backend, &frame, effect, arithmetic);
                    let got = run(&mut backend, &plan, &frame);
                    let Some(first) = &first else {
                        first = Some(got);
                        continue;
                    };
                    for (first, got) in first.iter().zip(&got) {
                        let what =
                            format!("{}, {number_type}, {arithmetic:?}, {tier}", effect.name);
                        assert_same(&first.execution, &got.execution, &what);
                        assert!(
                            wide_bits(&first.captures) == wide_bits(&got.captures),
                            "{what}: wide planes differ"
                        );
                    }
                }
            }
        }
    }
}

/// Where every pixel goes the same way, the f64 run, the shadow and the f32 run
/// are one program in three precisions: the shadow is the f64 run, and the f32
/// run is off by rounding.
#[test]
fn exposure_in_f64_is_its_shadow_and_near_its_f32() {
    let frame = small();
    let exposure = etalon_effects::registry::effect("exposure").unwrap();
    let wide = |number_type| {
        let mut backend = backend(number_type, Tier::best(), 1);
        let plan = plan(&backend, &frame, exposure, Arithmetic::Fast);
        run(&mut backend, &plan, &frame).remove(0)
    };
    let [single, double, shadow] = NumberType::ALL.map(wide);
    assert!(wide_bits(&double.captures) == wide_bits(&shadow.captures));
    let mut rounded = 0;
    for (i, captured) in double.execution.captures.iter().enumerate() {
        let texels = |execution: &WideExecution| match &execution.captures[i] {
            WideCapture::Texture(texels) => texels.clone(),
            other => panic!("{}: {other:?}", captured.pass),
        };
        for (single, double) in texels(&single).iter().zip(&texels(&double)) {
            for c in 0..4 {
                // Sums are trees of eight additions of some ten operations each,
                // in three passes and of one sign, and the logarithm of the mean
                // is below 16: all in all less than 1000 units of f32.
                let bound = 1000.0 * 2.0_f64.powi(-24) * double[c].abs().max(1.0);
                assert!(
                    (single[c] - double[c]).abs() <= bound,
                    "{}: {} and {}",
                    captured.pass,
                    single[c],
                    double[c]
                );
                rounded += usize::from(single[c] != double[c]);
            }
        }
    }
    assert!(rounded > 10, "{rounded} values rounded");
}

#[test]
fn wide_planes_are_counted_as_memory() {
    let frame = small();
    let bytes = |number_type| {
        let mut backend = backend(number_type, Tier::best(), 1);
        let bloom = etalon_effects::registry::effect("bloom").unwrap();
        let plan = plan(&backend, &frame, bloom, Arithmetic::Fast);
        run(&mut backend, &plan, &frame);
        backend.counters().bytes
    };
    let [single, double, shadow] = NumberType::ALL.map(bytes);
    assert_eq!(double, shadow);
    // Passes write rgba16float: 8 bytes, and 32 in the plane. What is imported
    // has none.
    assert!(
        double > 2 * single && double < 5 * single,
        "{single}, {double}"
    );
}

#[test]
fn wide_results_are_found_by_name() {
    let frame = small();
    let mut backend = backend(NumberType::F64, Tier::best(), 1);
    let composite = etalon_effects::registry::effect("composite").unwrap();
    let plan = plan(&backend, &frame, composite, Arithmetic::Fast);
    let result = run(&mut backend, &plan, &frame).remove(0);
    let pass = &result.execution.captures[0];
    let texels = result.texture(&pass.pass, &pass.binding).unwrap();
    assert_eq!(texels.len(), 61 * 37);
    assert_eq!(result.texture(&pass.pass, "no such binding"), None);
    assert_eq!(result.output("no such output"), None);
}

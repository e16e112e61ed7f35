//! Perturbed executions stay within what WGSL allows, and show how much of a result is
//! not the kernel's.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Executor, TranslateOptions};

/// [`kernel`] without functions of its own.
fn body(body: &str) -> String {
    kernel("", body)
}

fn perturbed(wgsl: &str, data: &[f32], executor: &Executor) -> Vec<f32> {
    let options = TranslateOptions {
        perturb: true,
        ..TranslateOptions::default()
    };
    let program = translate_as(wgsl, &options).unwrap();
    let input = floats(data);
    let output = buffer(&vec![0; data.len()]);
    let bound: Vec<BoundResource<'_>> = program
        .bindings()
        .iter()
        .map(|binding| BoundResource::Buffer([&input, &output][binding.binding as usize]))
        .collect();
    program
        .dispatch(executor, [data.len() as u32 / 64, 1, 1], &bound)
        .unwrap_or_else(|error| panic!("{error}\n{program}"));
    words(&output).into_iter().map(f32::from_bits).collect()
}

fn seeded(seed: u64) -> Executor {
    Executor::new(1).unwrap().with_perturbation(Some(seed))
}

fn plain(wgsl: &str, data: &[f32]) -> Vec<f32> {
    let bits: Vec<u32> = data.iter().map(|x| x.to_bits()).collect();
    let words = run_buffers(wgsl, &bits, data.len(), data.len() as u32 / 64);
    words.into_iter().map(f32::from_bits).collect()
}

/// The largest distance of eight executions from the plain one, relative to it.
fn spread(wgsl: &str, data: &[f32]) -> f64 {
    let plain = plain(wgsl, data);
    let mut widest = 0.0_f64;
    for seed in 0..8 {
        for (moved, plain) in perturbed(wgsl, data, &seeded(seed)).iter().zip(&plain) {
            let plain = f64::from(*plain);
            widest = widest.max((f64::from(*moved) - plain).abs() / plain.abs());
        }
    }
    widest
}

fn data() -> Vec<f32> {
    (0..128).map(|i| 1.0 + i as f32 / 37.0).collect()
}

const LONG: &str = "    var s = x;
    for (var k = 0u; k < 8u; k++) { s = s * 1.01 + exp(-s) / (1.0 + x); }
    result[i] = s;";

#[test]
fn without_a_seed_nothing_moves() {
    let wgsl = body(LONG);
    let still = perturbed(&wgsl, &data(), &Executor::new(1).unwrap());
    assert_eq!(still, plain(&wgsl, &data()));
}

#[test]
fn a_seed_is_a_device_on_any_number_of_threads_and_lanes() {
    let wgsl = body(LONG);
    let first = perturbed(&wgsl, &data(), &seeded(5));
    assert_ne!(first, plain(&wgsl, &data()));
    assert_ne!(first, perturbed(&wgsl, &data(), &seeded(6)));
    for (name, executor) in executors() {
        let executor = executor.with_perturbation(Some(5));
        assert_eq!(perturbed(&wgsl, &data(), &executor), first, "{name}");
    }
}

#[test]
fn equal_operands_give_equal_results_in_all_invocations() {
    let wgsl = body("    let y = 1.1 + 0.0 * x;\n    result[i] = sin(y) / 3.0;");
    for seed in 0..4 {
        let results = perturbed(&wgsl, &data(), &seeded(seed));
        assert!(results.iter().all(|&result| result == results[0]));
    }
}

#[test]
fn what_is_exact_stays() {
    let wgsl = body(
        "    let n = f32(i);
    result[i] = max(floor((n * 2.0 + 1.0) * 0.5), 1.0) - n + abs(-n) * 4.0;",
    );
    for seed in 0..8 {
        assert_eq!(
            perturbed(&wgsl, &data(), &seeded(seed)),
            plain(&wgsl, &data())
        );
    }
}

#[test]
fn spread_is_that_of_the_table() {
    // Two roundings to either side.
    let sum = spread(&body("    result[i] = (x + 0.3) * 1.7;"), &data());
    assert!(sum > 5e-8 && sum <= 2.5 * f64::from(f32::EPSILON), "{sum}");
    // 2.5 units of a quotient (WGSL §15.7.4.1).
    let quotient = spread(&body("    result[i] = x / 3.0;"), &data());
    assert!(
        quotient > 1e-7 && quotient <= 3.0 * f64::from(f32::EPSILON),
        "{quotient}"
    );
}

#[test]
fn unstable_formulas_spread_widely_and_stable_ones_do_not() {
    let unstable = spread(
        &body("    let a = x * 1000.0;\n    result[i] = a - sqrt(a * a - 1.0);"),
        &data(),
    );
    let stable = spread(
        &body("    let a = x * 1000.0;\n    result[i] = 1.0 / (a + sqrt(a * a - 1.0));"),
        &data(),
    );
    assert!(unstable > 0.1 && stable < 2e-6, "{unstable}, {stable}");
}

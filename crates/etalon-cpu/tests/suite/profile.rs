//! The profile counts what the kernel says it does.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Cost, Executor, Profile, Tier};

const GROUPS: u32 = 3;

/// Runs a kernel on storage buffers `data` (binding 0) and `result` (binding
/// 1); returns its profile and what it wrote.
fn run(wgsl: &str, executor: &Executor, invocations: u32) -> (Profile, Vec<u32>) {
    let program = program(wgsl);
    let input = buffer(&(0..invocations).map(|i| i * 7 + 1).collect::<Vec<_>>());
    let output = buffer(&vec![0; invocations as usize]);
    let bound = [
        BoundResource::Buffer(&input),
        BoundResource::Buffer(&output),
    ];
    program
        .dispatch(executor, [GROUPS, 1, 1], &bound)
        .unwrap_or_else(|error| panic!("{error}\n{program}"));
    (program.profile(), words(&output))
}

/// The executors of all tiers, with one thread and with three, profiling.
fn profilers() -> Vec<Executor> {
    Tier::ALL
        .into_iter()
        .filter(|tier| tier.is_available())
        .flat_map(|tier| [(tier, 1), (tier, 3)])
        .map(|(tier, threads)| {
            Executor::new(threads)
                .unwrap()
                .with_tier(tier)
                .with_profile(true)
        })
        .collect()
}

/// The costs of the instructions of one mnemonic on the line that contains `text`.
fn costs(profile: &Profile, wgsl: &str, text: &str, operation: &str) -> Vec<Cost> {
    let line = wgsl.lines().position(|line| line.contains(text)).unwrap() + 1;
    let found: Vec<Cost> = profile
        .instructions
        .iter()
        .filter(|instruction| {
            instruction.location.line as usize == line && instruction.operation == operation
        })
        .map(|instruction| instruction.cost)
        .collect();
    assert!(
        !found.is_empty(),
        "no {operation} at line {line}:\n{profile}"
    );
    found
}

fn kernel(size: u32) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read> data: array<u32>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size({size})
         fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {{
             var sum = data[id.x];
             for (var i = 0u; i < 5u; i++) {{
                 sum = sum * (sum ^ i);
             }}
             for (var i = 0u; i < lane % 8u; i++) {{
                 sum = (sum | 1u) * (sum & 1023u);
             }}
             if lane % 4u == 0u {{
                 result[id.x] = sum;
             }}
             for (var i = 0u; ; i++) {{
                 if i >= lane / 8u {{ break; }}
                 sum = sum - (sum >> 3u);
             }}
             result[id.x] += sum;
         }}"
    )
}

#[test]
fn counts_and_active_lanes_are_exact() {
    for size in [64_u32, 40] {
        let wgsl = kernel(size);
        for executor in profilers() {
            let (profile, _) = run(&wgsl, &executor, size * GROUPS);
            let all = u64::from(size * GROUPS);
            let groups = u64::from(GROUPS);
            let sum = |f: fn(u64) -> u64| (0..u64::from(size)).map(f).sum::<u64>() * groups;
            let active = |text: &str, operation: &str| {
                let costs = costs(&profile, &wgsl, text, operation);
                costs.iter().map(|cost| cost.active_lanes).max().unwrap()
            };
            assert_eq!(active("sum * (sum ^ i)", "mul.i"), 5 * all, "{profile}");
            assert_eq!(
                active("(sum | 1u) * (sum & 1023u)", "mul.i"),
                sum(|lane| lane % 8),
                "{profile}"
            );
            assert_eq!(
                active("result[id.x] = sum", "store.i"),
                sum(|lane| u64::from(lane % 4 == 0)),
                "{profile}"
            );
            assert_eq!(
                active("sum - (sum >> 3u)", "sub.i"),
                sum(|lane| lane / 8),
                "{profile}"
            );
            assert_eq!(active("result[id.x] += sum", "store.i"), all, "{profile}");
            // A uniform loop of 5 rounds.
            for cost in costs(&profile, &wgsl, "sum * (sum ^ i)", "mul.i") {
                assert_eq!(cost.executions, 5 * profile.batches);
            }
        }
    }
}

#[test]
fn times_are_of_what_ran() {
    let wgsl = kernel(64);
    let executor = Executor::new(1).unwrap().with_profile(true);
    let (profile, _) = run(&wgsl, &executor, 64 * GROUPS);
    let total = profile.total();
    assert!(total.nanoseconds > 0.0, "{profile}");
    let lines = profile.by_line();
    let operations = profile.by_operation();
    for costs in [&lines, &operations] {
        let sum: f64 = costs.iter().map(|(_, cost)| cost.nanoseconds).sum();
        assert!((sum - total.nanoseconds).abs() <= 1e-9 * sum, "{costs:?}");
        let executions: u64 = costs.iter().map(|(_, cost)| cost.executions).sum();
        assert_eq!(executions, total.executions);
        assert!(costs.is_sorted_by(|(_, a), (_, b)| a.nanoseconds >= b.nanoseconds));
    }
    assert!(operations.iter().any(|(name, _)| name == "mul.i"));
    assert!(lines.iter().any(|(line, _)| line == "test:7"), "{lines:?}");
    assert!(total.active_share() > 0.0 && total.active_share() <= 1.0);
}

#[test]
fn without_profiling_nothing_is_recorded_and_the_bits_are_the_same() {
    let wgsl = kernel(64);
    let plain = Executor::new(2).unwrap();
    assert!(!plain.profiles());
    let (profile, expected) = run(&wgsl, &plain, 64 * GROUPS);
    assert_eq!(profile.batches, 0);
    assert_eq!(profile.total(), Cost::default());
    for executor in profilers() {
        let (_, words) = run(&wgsl, &executor, 64 * GROUPS);
        assert_eq!(words, expected);
    }
}

#[test]
fn recordings_add_up_over_dispatches() {
    let wgsl = kernel(64);
    let program = program(&wgsl);
    let input = buffer(&[1; 64]);
    let output = buffer(&[0; 64]);
    let bound = [
        BoundResource::Buffer(&input),
        BoundResource::Buffer(&output),
    ];
    let executor = Executor::new(1).unwrap().with_profile(true);
    let mut executions = Vec::new();
    for _ in 0..3 {
        program.dispatch(&executor, [1, 1, 1], &bound).unwrap();
        executions.push(program.profile().total().executions);
    }
    assert_eq!(executions[1], 2 * executions[0]);
    assert_eq!(executions[2], 3 * executions[0]);
}

//! Subgroup built-ins against a simulation of each subgroup.

// Invocations index several arrays alike.
#![allow(clippy::needless_range_loop)]

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Executor, Tier};

/// The kernel: each invocation stores `RESULTS` words, in a branch that only
/// those take for which `active` holds.
const RESULTS: usize = 36;

fn wgsl(workgroup: u32, condition: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read> data: array<u32>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size({workgroup})
         fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) w: vec3<u32>,
                 @builtin(subgroup_size) size: u32, @builtin(subgroup_invocation_id) lane: u32,
                 @builtin(subgroup_id) group: u32, @builtin(num_subgroups) groups: u32) {{
             let x = data[w.x * {workgroup}u + i];
             let s = bitcast<i32>(x);
             let f = f32(x % 1000u) * 0.25;
             let at = (w.x * {workgroup}u + i) * {RESULTS}u;
             result[at] = size;
             result[at + 1u] = lane;
             result[at + 2u] = group;
             result[at + 3u] = groups;
             if {condition} {{
                 let ballot = subgroupBallot((x & 1u) == 1u);
                 result[at + 4u] = ballot.x;
                 result[at + 5u] = ballot.y;
                 result[at + 6u] = ballot.z;
                 result[at + 7u] = ballot.w;
                 result[at + 8u] = u32(subgroupAll((x & 3u) != 0u));
                 result[at + 9u] = u32(subgroupAny((x & 63u) == 5u));
                 result[at + 10u] = subgroupAdd(x);
                 result[at + 11u] = subgroupMul(x | 1u);
                 result[at + 12u] = subgroupMin(x);
                 result[at + 13u] = subgroupMax(x);
                 result[at + 14u] = bitcast<u32>(subgroupMin(s));
                 result[at + 15u] = bitcast<u32>(subgroupMax(s));
                 result[at + 16u] = subgroupAnd(x | 0xff00u);
                 result[at + 17u] = subgroupOr(x & 0x0ff0u);
                 result[at + 18u] = subgroupXor(x);
                 result[at + 19u] = subgroupInclusiveAdd(x);
                 result[at + 20u] = subgroupExclusiveAdd(x);
                 result[at + 21u] = subgroupInclusiveMul(x | 1u);
                 result[at + 22u] = subgroupExclusiveMul(x | 1u);
                 result[at + 23u] = bitcast<u32>(subgroupAdd(f));
                 result[at + 24u] = bitcast<u32>(subgroupMax(vec2(f, -f)).y);
                 result[at + 25u] = bitcast<u32>(subgroupInclusiveAdd(f));
                 result[at + 26u] = subgroupBroadcastFirst(x);
                 result[at + 27u] = subgroupBroadcast(x, 3u);
                 result[at + 28u] = subgroupShuffle(x, (lane * 7u + 1u) % size);
                 result[at + 29u] = subgroupShuffleUp(x, 2u);
                 result[at + 30u] = subgroupShuffleDown(x, x % 5u);
                 result[at + 31u] = subgroupShuffleXor(x, 5u);
                 result[at + 32u] = quadBroadcast(x, 2u);
                 result[at + 33u] = quadSwapX(x);
                 result[at + 34u] = quadSwapY(x);
                 result[at + 35u] = bitcast<u32>(quadSwapDiagonal(vec3(f, 1.0, f)).z);
             }}
         }}"
    )
}

/// The words of one invocation that took the branch.
fn simulate(x: &[u32], active: &[bool], lane: usize, size: usize) -> Vec<u32> {
    let lanes: Vec<usize> = (0..x.len()).filter(|&lane| active[lane]).collect();
    let all = |of: &dyn Fn(u32, u32) -> u32, map: &dyn Fn(u32) -> u32| {
        lanes.iter().map(|&l| map(x[l])).reduce(of).unwrap()
    };
    let before = |inclusive: bool| {
        lanes
            .iter()
            .copied()
            .filter(move |&l| l < lane || (inclusive && l == lane))
    };
    let f = |x: u32| (x % 1000) as f32 * 0.25;
    let from = |lane: usize| {
        if lane < x.len() && active[lane] {
            x[lane]
        } else {
            0
        }
    };
    let bit = |word: usize| {
        lanes
            .iter()
            .filter(|&&l| l / 32 == word && x[l] & 1 == 1)
            .fold(0, |bits, l| bits | 1 << (l % 32))
    };
    let shuffled = (lane * 7 + 1) % size;
    let diagonal = lane ^ 3;
    vec![
        bit(0),
        bit(1),
        bit(2),
        bit(3),
        u32::from(lanes.iter().all(|&l| x[l] & 3 != 0)),
        u32::from(lanes.iter().any(|&l| x[l] & 63 == 5)),
        all(&u32::wrapping_add, &|x| x),
        all(&u32::wrapping_mul, &|x| x | 1),
        all(&u32::min, &|x| x),
        all(&u32::max, &|x| x),
        all(&|a, b| (a as i32).min(b as i32) as u32, &|x| x),
        all(&|a, b| (a as i32).max(b as i32) as u32, &|x| x),
        all(&|a, b| a & b, &|x| x | 0xff00),
        all(&|a, b| a | b, &|x| x & 0x0ff0),
        all(&|a, b| a ^ b, &|x| x),
        before(true).fold(0, |sum, l| sum.wrapping_add(x[l])),
        before(false).fold(0, |sum, l| sum.wrapping_add(x[l])),
        before(true).fold(1, |sum, l| sum.wrapping_mul(x[l] | 1)),
        before(false).fold(1, |sum, l| sum.wrapping_mul(x[l] | 1)),
        // Multiples of a quarter below 2^15: sums are exact in any order.
        lanes.iter().map(|&l| f(x[l])).sum::<f32>().to_bits(),
        lanes
            .iter()
            .map(|&l| -f(x[l]))
            .fold(f32::MIN, f32::max)
            .to_bits(),
        before(true).map(|l| f(x[l])).sum::<f32>().to_bits(),
        x[lanes[0]],
        from(3),
        from(shuffled),
        lane.checked_sub(2).map_or(0, from),
        from(lane + x[lane] as usize % 5),
        from(lane ^ 5),
        from(lane & !3 | 2),
        from(lane ^ 1),
        from(lane ^ 2),
        if diagonal < x.len() && active[diagonal] {
            f(x[diagonal]).to_bits()
        } else {
            0
        },
    ]
}

/// An expression, and whether it holds for an invocation with a value.
type Condition = (&'static str, fn(usize, u32) -> bool);

#[test]
fn every_operation_is_the_simulation() {
    let conditions: [Condition; 3] = [
        ("true", |_, _| true),
        ("i % 3u != 1u", |i, _| i % 3 != 1),
        ("(x & 8u) == 0u", |_, x| x & 8 == 0),
    ];
    for workgroup in [4_usize, 64, 100, 256] {
        for (condition, holds) in conditions {
            let program = program(&wgsl(workgroup as u32, condition));
            let data: Vec<u32> = (0..3 * workgroup as u32)
                .map(|i| i.wrapping_mul(0x9e37_79b1) ^ 0x55)
                .collect();
            let input = buffer(&data);
            for size in [4_usize, 8, 16, 32, 64, 128] {
                for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
                    let executor = Executor::new(2)
                        .unwrap()
                        .with_tier(tier)
                        .with_subgroup_size(size as u32);
                    assert_eq!(executor.subgroup_size(), size as u32);
                    let result = buffer(&vec![0; data.len() * RESULTS]);
                    let bound = [
                        BoundResource::Buffer(&input),
                        BoundResource::Buffer(&result),
                    ];
                    program.dispatch(&executor, [3, 1, 1], &bound).unwrap();
                    let got = words(&result);
                    for (g, x) in data.chunks(workgroup).enumerate() {
                        let active: Vec<bool> =
                            x.iter().enumerate().map(|(i, &x)| holds(i, x)).collect();
                        for i in 0..workgroup {
                            let first = i / size * size;
                            let end = (first + size).min(workgroup);
                            let mut want = vec![
                                size as u32,
                                (i % size) as u32,
                                (i / size) as u32,
                                workgroup.div_ceil(size) as u32,
                            ];
                            if active[i] {
                                want.extend(simulate(
                                    &x[first..end],
                                    &active[first..end],
                                    i - first,
                                    size,
                                ));
                            }
                            want.resize(RESULTS, 0);
                            let at = (g * workgroup + i) * RESULTS;
                            assert_eq!(
                                &got[at..at + RESULTS],
                                want,
                                "{workgroup} {condition} {size} {tier} group {g} invocation {i}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn loops_are_left_one_by_one() {
    // Lanes leave the loop after as many rounds as their number says: each
    // round counts those that are still there.
    let program = program(
        "@group(0) @binding(1) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) i: u32, @builtin(subgroup_invocation_id) lane: u32) {
             var sum = 0u;
             for (var round = 0u; round <= lane % 5u; round++) {
                 sum = sum * 100u + subgroupAdd(1u);
                 subgroupBarrier();
             }
             result[i] = sum;
         }",
    );
    let executor = Executor::new(1).unwrap().with_subgroup_size(16);
    let result = buffer(&[0; 64]);
    program
        .dispatch(&executor, [1, 1, 1], &[BoundResource::Buffer(&result)])
        .unwrap();
    // Of 16 lanes, 13 have a number above 0 modulo 5 left, and so on.
    let left = |round: u32| (0..16).filter(|lane| lane % 5 >= round).count() as u32;
    for (i, got) in words(&result).into_iter().enumerate() {
        let rounds = i as u32 % 16 % 5;
        let want = (0..=rounds).fold(0, |sum, round| sum * 100 + left(round));
        assert_eq!(got, want, "{i}");
    }
}

#[test]
fn sizes_are_powers_of_two_that_wgsl_knows() {
    for (asked, size) in [(0, 4), (5, 8), (32, 32), (65, 128), (u32::MAX, 128)] {
        let executor = Executor::new(1).unwrap().with_subgroup_size(asked);
        assert_eq!(executor.subgroup_size(), size);
    }
}

//! Buffers, workgroup memory, barriers, atomics, arrays, and what lies outside.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Executor, RunError};

const HEAD: &str = "
    @group(0) @binding(0) var<storage, read> data: array<u32>;
    @group(0) @binding(1) var<storage, read_write> result: array<u32>;
";

#[test]
fn reductions_in_workgroup_memory_are_exact() {
    for size in [32_u32, 64, 128, 256] {
        let wgsl = format!(
            "{HEAD}
             var<workgroup> partial: array<u32, {size}>;
             var<workgroup> total: u32;
             @compute @workgroup_size({size})
             fn main(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {{
                 partial[lane] = data[group.x * {size}u + lane];
                 workgroupBarrier();
                 for (var half = {size}u / 2u; half > 0u; half /= 2u) {{
                     if lane < half {{ partial[lane] += partial[lane + half]; }}
                     workgroupBarrier();
                 }}
                 if lane == 0u {{ total = partial[0]; }}
                 let all = workgroupUniformLoad(&total);
                 result[group.x * {size}u + lane] = all + lane;
             }}"
        );
        let groups = 5;
        let data: Vec<u32> = (0..size * groups)
            .map(|i| i.wrapping_mul(2_654_435_761) >> 8)
            .collect();
        let result = run_buffers(&wgsl, &data, (size * groups) as usize, groups);
        for (group, values) in data.chunks(size as usize).enumerate() {
            let sum: u32 = values.iter().fold(0, |sum, v| sum.wrapping_add(*v));
            for lane in 0..size {
                assert_eq!(
                    result[group * size as usize + lane as usize],
                    sum.wrapping_add(lane),
                    "size {size}, group {group}, lane {lane}"
                );
            }
        }
    }
}

#[test]
fn workgroup_memory_starts_as_zero() {
    let wgsl = format!(
        "{HEAD}
         struct Cell {{ weight: f32, at: vec3<u32>, on: bool }}
         var<workgroup> cells: array<Cell, 3>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {{
             let cell = cells[lane % 3u];
             result[group.x * 64u + lane] = u32(cell.weight) + cell.at.z + u32(cell.on) + data[0];
             workgroupBarrier();
             cells[lane % 3u] = Cell(4.0, vec3<u32>(lane), true);
         }}"
    );
    assert_eq!(run_buffers(&wgsl, &[0], 64 * 4, 4), vec![0; 64 * 4]);
}

#[test]
fn shuffles_through_workgroup_memory_see_other_lanes() {
    let wgsl = format!(
        "{HEAD}
         var<workgroup> tile: array<array<vec2<f32>, 16>, 16>;
         @compute @workgroup_size(16, 16)
         fn main(@builtin(local_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {{
             tile[id.y][id.x] = vec2<f32>(f32(lane), f32(data[lane]));
             workgroupBarrier();
             let other = tile[id.x][id.y];
             result[2u * lane] = u32(other.x);
             result[2u * lane + 1u] = u32(other.y);
         }}"
    );
    let data: Vec<u32> = (0..256).map(|i| i * 3 + 1).collect();
    let result = run_buffers(&wgsl, &data, 512, 1);
    for lane in 0..256_u32 {
        let other = lane % 16 * 16 + lane / 16;
        assert_eq!(result[2 * lane as usize..][..2], [other, other * 3 + 1]);
    }
}

#[test]
fn atomics_add_up() {
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<u32>;
        struct Result { sum: atomic<u32>, least: atomic<i32>, bits: atomic<u32>, histogram: array<atomic<u32>, 8> }
        @group(0) @binding(1) var<storage, read_write> result: Result;
        var<workgroup> local: atomic<u32>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
            let value = data[id.x];
            atomicAdd(&result.sum, value);
            atomicMin(&result.least, i32(value) - 50);
            if value > 90u { atomicOr(&result.bits, 1u << (value & 7u)); }
            atomicAdd(&result.histogram[value & 7u], 1u);
            atomicMax(&local, value);
            workgroupBarrier();
            if lane == 0u { atomicXor(&result.bits, atomicLoad(&local) << 16u); }
        }";
    let data: Vec<u32> = (0..64 * 6)
        .map(|i: u32| i.wrapping_mul(40_503) % 101)
        .collect();
    let result = run_buffers(wgsl, &data, 11, 6);
    assert_eq!(result[0], data.iter().sum::<u32>());
    assert_eq!(
        result[1] as i32,
        data.iter().map(|&v| v as i32 - 50).min().unwrap()
    );
    let low = data
        .iter()
        .filter(|v| **v > 90)
        .fold(0, |bits, v| bits | 1 << (v & 7));
    let high = data
        .chunks(64)
        .fold(0, |bits, group| bits ^ group.iter().max().unwrap() << 16);
    assert_eq!(result[2], low | high);
    for bin in 0..8 {
        assert_eq!(
            result[3 + bin as usize],
            data.iter().filter(|v| **v & 7 == bin).count() as u32
        );
    }
}

#[test]
fn lists_made_with_atomics_do_not_depend_on_threads() {
    // Each place in the list depends on who came first; `run_buffers` compares
    // runs on different numbers of threads.
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<u32>;
        struct List { count: atomic<u32>, items: array<u32> }
        @group(0) @binding(1) var<storage, read_write> list: List;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            if data[id.x] % 3u == 0u { list.items[atomicAdd(&list.count, 1u)] = id.x; }
        }";
    let data: Vec<u32> = (0..64 * 40)
        .map(|i: u32| i.wrapping_mul(2_654_435_761) >> 12)
        .collect();
    let expected: Vec<u32> = (0..64 * 40)
        .filter(|&i| data[i as usize].is_multiple_of(3))
        .collect();
    let result = run_buffers(wgsl, &data, 64 * 40 + 1, 40);
    assert_eq!(result[0] as usize, expected.len());
    assert_eq!(result[1..=expected.len()], expected);
}

#[test]
fn compare_exchange_takes_turns() {
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<u32>;
        @group(0) @binding(1) var<storage, read_write> result: array<atomic<u32>, 65>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            let turn = atomicCompareExchangeWeak(&result[64], lane, lane + data[0]);
            atomicStore(&result[lane], turn.old_value * 2u + u32(turn.exchanged));
        }";
    let result = run_buffers(wgsl, &[1], 65, 1);
    for (lane, value) in (0..64).zip(&result) {
        assert_eq!(*value, lane * 2 + 1);
    }
    assert_eq!(result[64], 64);
}

/// naga's `Restrict`: an index is unsigned, and at most the last one.
#[test]
fn indices_outside_are_the_last_ones() {
    let wgsl = format!(
        "{HEAD}
         const TABLE = array<u32, 6>(10u, 11u, 12u, 13u, 14u, 15u);
         var<private> own: array<u32, 5>;
         var<workgroup> shared_array: array<u32, 7>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {{
             let index = i32(lane) - 20;
             var local = array<u32, 4>(1u, 2u, 3u, 4u);
             for (var i = 0; i < 5; i++) {{ own[i] = u32(i) + lane; }}
             if lane < 7u {{ shared_array[lane] = lane * 3u; }}
             workgroupBarrier();
             let vector = vec3<u32>(7u, 8u, 9u);
             local[index] += 100u;
             result[8u * lane] = data[index];
             result[8u * lane + 1u] = local[index];
             result[8u * lane + 2u] = TABLE[index];
             result[8u * lane + 3u] = own[index];
             result[8u * lane + 4u] = shared_array[index];
             result[8u * lane + 5u] = vector[index];
             result[8u * lane + 6u] = local[3];
             result[8u * lane + 7u] = arrayLength(&data);
         }}"
    );
    let data: Vec<u32> = (0..30).map(|i| 1000 + i).collect();
    let result = run_buffers(&wgsl, &data, 64 * 8, 1);
    for lane in 0..64_u32 {
        let index = (lane as i32 - 20) as u32;
        let at = |length: u32| index.min(length - 1);
        let local = |i: u32| i + 1 + if i == at(4) { 100 } else { 0 };
        let expected = [
            1000 + at(30),
            local(at(4)),
            10 + at(6),
            at(5) + lane,
            3 * at(7),
            7 + at(3),
            local(3),
            30,
        ];
        assert_eq!(result[8 * lane as usize..][..8], expected, "lane {lane}");
    }
}

#[test]
fn stores_outside_go_to_the_last_element_and_no_further() {
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<u32>;
        @group(0) @binding(1) var<storage, read_write> result: array<vec2<u32>>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            if lane != data[0] { result[lane * 1000000000u] = vec2<u32>(lane, 7u); }
        }";
    // Nine words: four whole elements, and one that belongs to none.
    let result = run_buffers(wgsl, &[0], 9, 1);
    assert_eq!(result[..6], [0; 6]);
    assert_eq!(result[7], 7);
    assert_eq!(result[8], 0);
}

#[test]
fn uniform_blocks_are_read_by_layout() {
    let wgsl = "
        struct Light { position: vec3<f32>, power: f32, tint: vec2<f32> }
        struct Block { turn: mat3x3<f32>, lights: array<Light, 2>, small: mat2x2<f32>, count: u32, offset: i32 }
        @group(0) @binding(0) var<uniform> block: Block;
        @group(0) @binding(1) var<storage, read_write> result: array<f32>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            let v = block.turn * vec3<f32>(1.0, 10.0, 100.0);
            let light = block.lights[lane % block.count];
            result[lane * 8u] = v.x;
            result[lane * 8u + 1u] = v.z;
            result[lane * 8u + 2u] = light.position.y;
            result[lane * 8u + 3u] = light.power;
            result[lane * 8u + 4u] = light.tint.y;
            result[lane * 8u + 5u] = block.small[1][0];
            result[lane * 8u + 6u] = block.turn[lane % 3u].y;
            result[lane * 8u + 7u] = f32(block.offset);
        }";
    // Columns of a mat3x3 are 16 bytes apart, lights 32, and the mat2x2's 8.
    let mut words = vec![0_u32; 36];
    let mut put = |at: usize, value: f32| words[at] = value.to_bits();
    for column in 0..3 {
        for row in 0..3 {
            put(column * 4 + row, (column * 3 + row) as f32);
        }
    }
    for light in 0..2 {
        for i in 0..6 {
            put(12 + light * 8 + i, (100 + light * 10 + i) as f32);
        }
    }
    for i in 0..4 {
        put(28 + i, (200 + i) as f32);
    }
    words[32] = 2;
    words[33] = -5_i32 as u32;
    let result = run_buffers(wgsl, &words, 64 * 8, 1);
    for lane in 0..64 {
        let light = (100 + lane % 2 * 10) as f32;
        let expected = [
            630.0,
            852.0,
            light + 1.0,
            light + 3.0,
            light + 5.0,
            202.0,
            (lane % 3 * 3 + 1) as f32,
            -5.0,
        ];
        let got: Vec<f32> = result[lane * 8..][..8]
            .iter()
            .map(|&bits| f32::from_bits(bits))
            .collect();
        assert_eq!(got, expected, "lane {lane}");
    }
}

#[test]
fn pointers_reach_the_caller() {
    let wgsl = format!(
        "{HEAD}
         struct State {{ sum: u32, trail: array<u32, 4>, step: u32 }}
         fn note(state: ptr<function, State>, value: u32) {{
             (*state).sum += value;
             (*state).trail[(*state).step & 3u] = value;
             (*state).step++;
         }}
         fn swap(a: ptr<function, u32>, b: ptr<function, u32>) {{ let t = *a; *a = *b; *b = t; }}
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {{
             var state: State;
             for (var i = 0u; i < lane % 7u; i++) {{ note(&state, data[i] + lane); }}
             var a = lane; var b = lane * 2u;
             if (lane & 1u) == 1u {{ swap(&a, &b); }}
             result[4u * lane] = state.sum;
             result[4u * lane + 1u] = state.trail[lane & 3u];
             result[4u * lane + 2u] = a;
             result[4u * lane + 3u] = b;
         }}"
    );
    let data: Vec<u32> = (0..8).map(|i| i * i + 1).collect();
    let result = run_buffers(&wgsl, &data, 64 * 4, 1);
    for lane in 0..64_u32 {
        let (mut sum, mut trail) = (0, [0; 4]);
        for i in 0..lane % 7 {
            sum += data[i as usize] + lane;
            trail[(i & 3) as usize] = data[i as usize] + lane;
        }
        let (a, b) = if lane & 1 == 1 {
            (lane * 2, lane)
        } else {
            (lane, lane * 2)
        };
        assert_eq!(
            result[4 * lane as usize..][..4],
            [sum, trail[(lane & 3) as usize], a, b],
            "lane {lane}"
        );
    }
}

#[test]
fn endless_loops_end() {
    let program = program(&format!(
        "{HEAD}
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {{
             var i = lane;
             loop {{
                 if i == 1000000u {{ break; }}
                 i = i * 2u + data[0];
             }}
             result[lane] = i;
         }}"
    ));
    let executor = Executor::new(2).unwrap().with_max_trips(5000);
    let (data, result) = (buffer(&[0]), buffer(&[0; 64]));
    let error = program
        .dispatch(
            &executor,
            [100, 1, 1],
            &[BoundResource::Buffer(&data), BoundResource::Buffer(&result)],
        )
        .unwrap_err();
    let RunError::EndlessLoop {
        location,
        limit: 5000,
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!((location.line, location.column), (8, 14));
}

#[test]
fn barriers_in_divergent_control_flow_are_refused() {
    let program = program(&format!(
        "{HEAD}
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {{
             if lane < data[0] {{
                 workgroupBarrier();
             }}
             result[lane] = lane;
         }}"
    ));
    let executor = Executor::new(1).unwrap();
    let result = buffer(&[0; 64]);
    let run = |limit: u32| {
        program.dispatch(
            &executor,
            [1, 1, 1],
            &[
                BoundResource::Buffer(&buffer(&[limit])),
                BoundResource::Buffer(&result),
            ],
        )
    };
    // Whether it diverges is seen as it runs.
    assert!(run(0).is_ok() && run(64).is_ok());
    let error = run(10).unwrap_err();
    let RunError::DivergentBarrier { location, .. } = error else {
        panic!("{error}")
    };
    assert_eq!(location.line, 8);
}

/// A barrier holds back all of a workgroup, also one that shares storage only and
/// is larger than what runs together otherwise.
#[test]
fn storage_is_ordered_by_barriers() {
    let got = run_buffers(
        &format!(
            "{HEAD} @compute @workgroup_size(128)
            fn main(@builtin(local_invocation_index) i: u32) {{
                result[i] = i + 1u;
                storageBarrier();
                let other = result[(i + 70u) % 128u];
                storageBarrier();
                result[i] = other;
            }}"
        ),
        &[0],
        128,
        1,
    );
    let expected: Vec<u32> = (0..128).map(|i| (i + 70) % 128 + 1).collect();
    assert_eq!(got, expected);
}

#[test]
fn bindings_are_checked() {
    let program = program(&format!(
        "{HEAD} @compute @workgroup_size(1) fn main() {{ result[0] = data[0]; }}"
    ));
    let executor = Executor::new(1).unwrap();
    let (small, texture) = (buffer(&[]), empty(1, 1, etalon_core::Format::R32Float));
    let cases = [
        (vec![], "nothing"),
        (vec![BoundResource::Buffer(&small)], "0 bytes"),
        (vec![BoundResource::Texture(texture.view())], "a texture"),
    ];
    for (bound, found) in cases {
        let error = program.dispatch(&executor, [1, 1, 1], &bound).unwrap_err();
        assert!(
            matches!(error, RunError::Binding { .. }) && error.to_string().contains(found),
            "{error}"
        );
    }
    let good = buffer(&[0]);
    let bound = [BoundResource::Buffer(&good), BoundResource::Buffer(&good)];
    assert!(program.dispatch(&executor, [0, 1, 1], &bound).is_ok());
    assert!(matches!(
        program.dispatch(&executor, [u32::MAX; 3], &bound),
        Err(RunError::TooManyWorkgroups { .. })
    ));
}

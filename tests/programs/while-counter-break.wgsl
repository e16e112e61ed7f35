// Found by seed 9356 of the generator on lavapipe.
// result 4 of workgroup 0, lane 0 is 0x00000000 and not 0x3f800000 (as floats 0.0 and 1.0)
//: lanes 1
//: groups 1 1 1
//: data 6 8 5 30c7aaea 5 1 6 1 4 80000001 1 5e2c6ae0 1fb84cab 0 4 9d7516dd 0 8 fffffffe 7fffffff 6ac10889 fc2c5d7c 100 6 2 6 4 2 9 fffffffe bd694e68 ff
//: reals c2ccb696 bf800000 3a83126f 43626451 bf200000 3f600000 bf400000 bfa00000 3f000000 bf400000 42c88000 3fd00000 c349ccdd 431e8c62 c2832a13 3fc00000 c0280000 bf000000 4344da2d bf400000 bf400000 4353403a 3a83126f 40000000 40000000 40000000 3dcccccd c0200000 437fd535 c15b8dc2 c0780000 bf000000
//: slots uuuufuuuuuuuuuuuu
//: results 0 0 0 0 3f800000 0 0 0 0 0 0 0 0 0 0 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
struct S1 { m0: array<f32, 4>, m1: f32, m2: vec2<u32>, m3: f32, }
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
@compute @workgroup_size(1, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 17u + lane * 17u;
    var v1: S1;
    {
        {
            var v5 = 0u;
            while v5 < 1u && (f32(v5) != 1.0f) {
                v5++;
                if all((vec3<bool>((v5 > 0u)) == vec3<bool>())) {
                    break;
                }
                v1 = S1(array<f32, 4>(0.0f, 1.0f, 0.0f, 0.0f), 0.0f, vec2<u32>(), 0.0f);
            }
        }
    }
    storageBarrier(); workgroupBarrier();
    results[base + 4u] = bitcast<u32>(v1.m0[1]);
}

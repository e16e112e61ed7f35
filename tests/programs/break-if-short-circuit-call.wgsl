// Found by seed 75 of the generator on lavapipe.
// result 12 of workgroup 0, lane 0 is 0x00000002 and not 0x00000001 (as floats 3e-45 and 1e-45)
//: lanes 1
//: groups 1 1 1
//: data 1020408 4 6 2 1020408 73d6d71f aaaaaaaa 5 8c0cf738 100 9 8 9 0 5 0 3 6 0 5 9 5 0 7 b7c85c40 d420671f 646bf28 6 ffffffff 8dbfa082 8 3
//: reals bf400000 be000000 40400000 c0e9999a 0 c0100000 c0300000 40000000 40400000 42c88000 40780000 bf900000 0 c36f14f9 42971bd9 42c88000 436210a0 c2f05cfe 40100000 3a83126f 3fc00000 0 41e4dcce 3f000000 3fc00000 3dcccccd 3fd00000 c30d8740 0 c0e9999a bfd00000 3dcccccd
//: slots uuuuuuuuuuuuiuu
//: results 0 0 0 0 0 0 0 0 0 0 0 0 1 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
var<private> g0: vec4<i32> = vec4<i32>(0i, 0i, 0i, 0i);
var<workgroup> w1: array<atomic<u32>, 1>;
fn f0(v0: u32, v1: ptr<private, vec4<i32>>, v2: ptr<function, i32>, v3: f32) -> u32 {
    (*v1).y = i32(clamp(reals[0], f32(-2147483648.0f), f32(2147483520.0f)));
    return 0u;
}
fn f2(v0: u32, v1: ptr<function, f32>, v2: ptr<function, f32>) {
    g0.w += 1i;
}
@compute @workgroup_size(1, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 15u + lane * 15u;
    var v4: i32;
    var v6: f32;
    var v7: f32;
    {
        let v9 = atomicMin(&w1[lane], f0(0u, &g0, &v4, 0.0f));
    }
    storageBarrier(); workgroupBarrier();
    {
        var v17 = 0u;
        loop {
            continuing {
                f2(0u, &v6, &v7);
                v17++;
                break if v17 >= 2u || (lane <= 0u);
            }
        }
    }
    results[base + 12u] = bitcast<u32>(g0.w);
}

// Found by seed 8902 of the generator on lavapipe.
// result 8 of workgroup 0, lane 0 is 0x00000002 and not 0x00000001 (as floats 3e-45 and 1e-45)
//: lanes 1
//: groups 1 1 1
//: data 5 7 8 9 8 7 8 6 4 fffffffe 5 0 1f 7fffffff ffff 0 fffffffe 7fffffff 0 8eb5c7e5 80000001 c7883c4c c3fa16ce aaaaaaaa 7 4 1 7 8 3 6 4
//: reals bf200000 c2c16bdc c0580000 40400000 4350f8e4 c1ba2f04 c0100000 4361a684 bf800000 4349a7e4 c3543a36 3a83126f 3a83126f 3f000000 bf400000 bf800000 40400000 3f000000 4350b5c0 410ce09e 40000000 c0e9999a be000000 3f600000 40000000 3a83126f 42c7cc06 40000000 43308fce c2845a3d bf400000 c33b10ae
//: slots uuuuuuuuuuuuuuuuuuu
//: results 0 0 0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
struct S0 { m0: f32, }
struct S1 { m0: f32, m1: S0, m2: vec4<u32>, m3: vec4<i32>, }
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
@compute @workgroup_size(1, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 19u + lane * 19u;
    var v0: S1;
    v0.m2.z += lane;
    {
        var v5 = 0u;
        loop {
            v0.m2.w++;
            continuing {
                v5++;
                break if (v5 >= 2u) | ((reals[0] == 0.0f) != true);
            }
        }
    }
    results[base + 8u] = v0.m2.w;
}

// Found by seed 2665 of the generator on lavapipe.
// result 15 of workgroup 0, lane 1 is 0x00000000 and not 0x3f000000 (as floats 0.0 and 0.5)
//: lanes 2
//: groups 1 1 1
//: data 1 9 7 5 2 5 1f f32b50fe 5 f1c0210d 375d485c 7fffffff 5 1020408 d0d32533 2 feeb5176 27e91b92 8 80000001 0 8 14d62a63 5 6 0 6 7fffffff 5 83991d59 ffffffff edf13d63
//: reals 3f000000 3f000000 3dcccccd 40400000 bf400000 c0180000 40400000 bf400000 3f000000 3dcccccd 3fc00000 c3302959 40f844f5 40000000 c2b3b603 3f800000 3fc6ff73 43162310 4339520c bf400000 0 40400000 3f000000 3fc00000 0 c1357ba6 3f800000 be800000 3fc00000 bfb00000 c2a60637 3fc00000
//: slots uuuuuuuuuuuuuuufuuuuu
//: results 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 3f000000 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 3f000000 0 0 0 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
@compute @workgroup_size(2, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 42u + lane * 21u;
    var v5: f32;
    {
        var v7 = 0u;
        loop {
            continuing {
                v5 = reals[0];
                v7++;
                break if (v7 >= 2u) | (lane > 0u);
            }
        }
    }
    results[base + 15u] = bitcast<u32>(v5);
}

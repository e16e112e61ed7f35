// Found by seed 26 of the generator on swiftshader.
// result 5 of workgroup 0, lane 0 is 0x00000000 and not 0x40000000 (as floats 0.0 and 2.0)
//: lanes 2
//: groups 1 1 1
//: data 2 7fffffff 2 0 1f 8 4 100 5 897b1e95 1020408 2 7 8 8 1 3 a8b5a133 6c29c073 ffff ff 9 5 4 100 3 7c3d0347 0 6 9 a4ca92d3 80000001
//: reals 3fd00000 0 0 c3180a32 3fc00000 4331dffb 3f600000 bf400000 0 bf800000 430f6001 3dcccccd 41707353 c0280000 3f000000 0 3dcccccd c1f9436d c0e9999a c3141396 c0e9999a 3f800000 bf900000 bf800000 c35daf91 3a83126f 0 c0e9999a bfe00000 bf800000 c36bee70 c2c14c7e
//: slots uuuuufuuuuuuuuuuuuuuuu
//: results 0 0 0 0 0 40000000 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 40000000 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
fn f0(v0: u32, v1: ptr<function, bool>, v2: ptr<function, i32>) -> f32 {
    return f32(v0);
}
@compute @workgroup_size(2, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 44u + lane * 22u;
    var v0: i32;
    var v1: f32;
    var v2: vec2<bool> = vec2<bool>(true, false);
    var v4: bool;
    {
        {
            var v6 = 0u;
            loop {
                v1 = f0(data[0], &v4, &v0);
                continuing {
                    v6++;
                    break if v6 >= 2u || v2[lane % 2u];
                }
            }
        }
    }
    workgroupBarrier();
    results[base + 5u] = bitcast<u32>(v1);
}

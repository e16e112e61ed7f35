// Found by seed 326 of the generator on SwiftShader.
// result 5 of workgroup 0, lane 0 is 0x7f7f7f7f and not 0x00000000 (as floats 3.3961514e38 and 0.0)
//: lanes 1
//: groups 1 1 1
//: data 9 8 5 69e7e630 4f819b69 a5269736 c406c49d 1 0 9 6 8 bb6b1c65 9 5 6 0 20 33b6989f 3 82d9a389 4f80a8a 9733a340 1020408 1 de315f8b 145b9805 3 9 eb2461c2 4b37fda4 ab8074d
//: reals 3fc00000 3f800000 c0480000 0 3f800000 bf200000 424c239e be800000 c0800000 40000000 3f000000 40000000 4310bdfd 4299cf4f bf800000 3a83126f 3a83126f 3f800000 40380000 4272ca16 40400000 c0000000 bf600000 be800000 40180000 42c88000 c0400000 c0380000 c2434efc c36a4525 bfc00000 3f000000
//: slots uuuuuuuuuuuuuuuu
//: results 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
//: tallies 0 ffffffff 0 ffffffff 0 0 0
//: signed 0 7fffffff 80000000 ffffffff 0 0 0
@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read> reals: array<f32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;
@compute @workgroup_size(1, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,
        @builtin(num_workgroups) groups: vec3<u32>) {
    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * 16u + lane * 16u;
    var v3: vec2<u32> = vec2<u32>(pack4xI8Clamp(vec4<i32>(0i, 0i, 0i, 0i)), 0u);
    results[base + 5u] = v3.x;
}

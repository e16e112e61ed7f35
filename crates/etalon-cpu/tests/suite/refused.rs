//! What the interpreter does not have is said, with its place.

use crate::common;

use common::*;
use etalon_cpu::{Executor, Program, TranslateError};

#[test]
fn unsupported_constructs_are_named_and_placed() {
    let main = "@compute @workgroup_size(1) fn main() {\n  ";
    let cases = [
        (
            format!("var<private> a: f64;\n{main}a = 1.0lf;\n}}"),
            "64-bit",
            1,
        ),
        (
            format!(
                "@group(0) @binding(0) var t: texture_multisampled_2d<f32>;\n{main}_ = textureLoad(t, vec2<i32>(0), 0);\n}}"
            ),
            "multisampled",
            1,
        ),
        (
            format!(
                "@group(0) @binding(0) var t: texture_depth_multisampled_2d;\n{main}_ = textureNumSamples(t);\n}}"
            ),
            "multisampled",
            1,
        ),
        (
            format!(
                "@group(0) @binding(0)\nvar t: texture_external;\n{main}_ = textureDimensions(t);\n}}"
            ),
            "external",
            2,
        ),
        (
            format!("{main}let a = 5li;\n  _ = a * 3li;\n}}"),
            "64-bit",
            3,
        ),
        (format!("{main}var a = 5lu;\n}}"), "64-bit", 2),
        (
            format!(
                "enable wgpu_ray_query;\n@group(0) @binding(0) var scene: acceleration_structure;\n{main}var q: ray_query;\n  rayQueryInitialize(&q, scene, RayDesc(0u, 0xffu, 0.0, 1.0, vec3(0.0), vec3(1.0)));\n}}"
            ),
            "ray",
            2,
        ),
        (
            format!(
                "@group(0) @binding(0)\nvar t: texture_storage_2d<r64uint, atomic>;\n{main}textureAtomicMax(t, vec2(0, 0), 1lu);\n}}"
            ),
            "R64Uint",
            2,
        ),
        (
            format!(
                "@group(0) @binding(0)\nvar t: texture_storage_2d<r16unorm, write>;\n{main}textureStore(t, vec2(0, 0), vec4(1.0));\n}}"
            ),
            "R16Unorm",
            2,
        ),
    ];
    for (wgsl, construct, line) in cases {
        match translate(&wgsl) {
            Err(TranslateError::Unsupported {
                construct: found,
                location,
            }) => {
                assert!(found.contains(construct), "{found}, not {construct}");
                assert_eq!(location.line, line, "{found}: {location}\n{wgsl}");
                assert!(location.column > 0);
            }
            other => panic!("{construct}: {other:?}"),
        }
    }
}

#[test]
fn overrides_must_be_resolved() {
    for wgsl in [
        "override n: u32;\n@group(0) @binding(0) var<storage, read_write> r: array<u32>;\n@compute @workgroup_size(1) fn main() { r[0] = n; }",
        "override n: u32 = 4;\n@compute @workgroup_size(n) fn main() {}",
        "override n: u32 = 4;\nvar<workgroup> a: array<u32, n>;\n@compute @workgroup_size(1) fn main() { a[0] = 1u; }",
    ] {
        match translate(wgsl) {
            Err(TranslateError::Invalid { what, location }) => {
                assert!(what.contains("override"), "{what}");
                assert!(location.line > 0, "{wgsl}: {location}");
            }
            other => panic!("{wgsl}: {other:?}"),
        }
    }
}

#[test]
fn texel_offsets_are_in_range() {
    let wgsl = |offset: &str| {
        format!(
            "@group(0) @binding(0) var t: texture_2d<f32>; @group(0) @binding(1) var s: sampler;
             @group(0) @binding(2) var<storage, read_write> r: array<f32>;
             @compute @workgroup_size(1) fn main() {{
               r[0] = textureSampleLevel(t, s, vec2(0.5), 0.0, {offset}).x;
             }}"
        )
    };
    translate(&wgsl("vec2(-8, 7)")).unwrap();
    for offset in ["vec2(8, 0)", "vec2(0, -9)"] {
        match translate(&wgsl(offset)) {
            Err(TranslateError::Invalid { what, location }) => {
                assert!(what.contains("-8 to 7"), "{what}");
                assert_eq!(location.line, 4);
            }
            other => panic!("{offset}: {other:?}"),
        }
    }
}

#[test]
fn sizes_are_bounded_before_anything_is_made() {
    let big = "var<private> a: array<f32, 1000000>; @compute @workgroup_size(1) fn main(@builtin(local_invocation_index) i: u32) { a[i] = 1.0; }";
    assert!(matches!(
        translate(big),
        Err(TranslateError::TooLarge { .. })
    ));
    // Calls that double with each level: 2^30 instructions once inlined.
    let mut wgsl = "@group(0) @binding(0) var<storage, read_write> r: array<u32>; fn f0(x: u32) { r[x] += x; }\n".to_owned();
    for level in 1..30 {
        wgsl += &format!(
            "fn f{level}(x: u32) {{ f{p}(x); f{p}(x + 1u); }}\n",
            p = level - 1
        );
    }
    wgsl += "@compute @workgroup_size(1) fn main() { f29(0u); }";
    assert!(matches!(
        translate(&wgsl),
        Err(TranslateError::TooLarge { .. })
    ));
}

#[test]
fn entry_points_are_found_by_name() {
    let wgsl = "@compute @workgroup_size(1) fn other() {}";
    assert!(matches!(
        translate(wgsl),
        Err(TranslateError::NoEntryPoint { .. })
    ));
    let module = naga::front::wgsl::parse_str(wgsl).unwrap();
    let info = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    )
    .validate(&module)
    .unwrap();
    let program = Program::from_module("test", wgsl, &module, &info, "other").unwrap();
    let counters = program
        .dispatch(&Executor::new(1).unwrap(), [2, 3, 4], &[])
        .unwrap()
        .counters;
    assert_eq!((counters.workgroups, counters.invocations), (24, 24));
}

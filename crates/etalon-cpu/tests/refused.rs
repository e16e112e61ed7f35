//! What the interpreter does not have is said, with its place.

mod common;

use common::*;
use etalon_cpu::{Executor, Program, TranslateError};

#[test]
fn unsupported_constructs_are_named_and_placed() {
    let texture =
        "@group(0) @binding(0) var t: texture_2d<f32>; @group(0) @binding(1) var s: sampler;";
    let main = "@compute @workgroup_size(1) fn main() {\n  ";
    let cases = [
        (
            format!("{texture}\n{main}_ = textureGather(0, t, s, vec2<f32>(0.5));\n}}"),
            "textureGather",
            3,
        ),
        (
            format!(
                "{texture}\n{main}_ = textureSampleGrad(t, s, vec2<f32>(0.5), vec2<f32>(0.1), vec2<f32>(0.1));\n}}"
            ),
            "textureSampleGrad",
            3,
        ),
        (
            format!(
                "{texture}\n{main}_ = textureSampleLevel(t, s, vec2<f32>(0.5), 0.0, vec2<i32>(1, 0));\n}}"
            ),
            "offset",
            3,
        ),
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
                "@group(0) @binding(0) var t: texture_depth_2d; @group(0) @binding(1)\nvar s: sampler_comparison;\n{main}_ = textureSampleCompareLevel(t, s, vec2<f32>(0.5), 0.5);\n}}"
            ),
            "comparison",
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

//! Checks of memory, barriers and loops: planted faults are found at their place,
//! correct twins are silent.

use crate::common;

use common::checks::*;
use common::*;
use etalon_cpu::{BoundResource, Buffer, Checks, Executor, Finding, FindingKind as K, RunError};

/// A kernel of workgroups of 10×9 invocations.
fn kernel(declarations: &str, body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
{declarations}
@compute @workgroup_size(10, 9)
fn main(
    @builtin(workgroup_id) w: vec3<u32>,
    @builtin(local_invocation_index) i: u32,
) {{
    let g = w.x * 90u + i;
    {body}
}}"
    )
}

/// What is found in three workgroups; `result` is 270 words that are written,
/// and as many that nothing wrote.
fn run(wgsl: &str, checks: Checks) -> Vec<Finding> {
    let program = checked(wgsl, checks);
    find(&program, &all_executors(), [3, 1, 1], |dispatch| {
        let output = buffer(&[0; 270]);
        let scratch = Buffer::unwritten(270 * 4).unwrap();
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(if binding.name == "result" {
                    &output
                } else {
                    &scratch
                })
            })
            .collect();
        dispatch(&bound);
    })
}

/// A finding: kind, mark, workgroup, invocation, count, part of the message.
type Expected<'a> = (K, usize, [u32; 3], [u32; 3], u64, &'a str);

fn expect(declarations: &str, body: &str, expected: &[Expected<'_>]) {
    let wgsl = kernel(declarations, body);
    let found = run(&wgsl, Checks::all());
    let got: Vec<_> = found
        .iter()
        .map(|f| {
            (
                f.kind,
                f.location.clone(),
                f.workgroup,
                f.invocation,
                f.count,
            )
        })
        .collect();
    let wanted: Vec<_> = expected
        .iter()
        .map(|e| (e.0, place(&wgsl, e.1), e.2, e.3, e.4))
        .collect();
    assert_eq!(got, wanted, "{}\n{wgsl}", list(&found));
    for (finding, e) in found.iter().zip(expected) {
        assert!(finding.message.contains(e.5), "{finding}");
        // By itself, and not without it.
        let same_kind = |f: &&Finding| f.kind == e.0;
        let alone = run(&wgsl, only(e.0));
        let of_kind: Vec<&Finding> = found.iter().filter(same_kind).collect();
        assert_eq!(alone.iter().collect::<Vec<_>>(), of_kind, "{wgsl}");
        // Without their checks these fail.
        if ![K::DivergentBarrier, K::EndlessLoop].contains(&e.0) {
            let others = run(&wgsl, all_but(e.0));
            assert!(!others.iter().any(|f| f.kind == e.0), "{wgsl}");
        }
    }
}

fn silent(declarations: &str, body: &str) {
    expect(declarations, body, &[]);
}

const WG: &str = "workgroup memory";

#[test]
fn arrays_of_invocations() {
    // Indexed by computed values, and by constants alone.
    for (write, read) in [
        ("a[i % 3u] = i;", "a[(i + 1u) % 3u]"),
        ("a[1] = i;", "a[2]"),
    ] {
        expect(
            "",
            &format!("var a: array<u32, 3>;\n{write}\nresult[g] = 1u + /*!*/{read};"),
            &[(
                K::Uninitialised,
                0,
                [0; 3],
                [0; 3],
                270,
                "nothing wrote an element of the variable",
            )],
        );
    }
    silent(
        "",
        "var a: array<u32, 3>; a[i % 3u] = i; result[g] = a[i % 3u];",
    );
    silent("", "var a: array<u32, 3>; a[1] = i; result[g] = a[1];");
    // With an initial value all of it is written.
    silent("", "var a = array<u32, 3>(); result[g] = a[i % 3u];");
    silent(
        "",
        "var a: array<u32, 3>; a = array<u32, 3>(); result[g] = a[i % 3u];",
    );
    // Only by those that went the other way; and a whole array at once counts once.
    expect(
        "struct S { n: f32, a: array<vec2<f32>, 3> }",
        "/*!*/var s: S;
        if i >= 20u { s.n = 1.0; s.a[0] = vec2(1.0); s.a[1].x = 1.0; s.a[1].y = 1.0; s.a[i - i + 2u] = vec2(2.0); }
        if i < 22u { let copy = s; result[g] = u32(copy.a[i % 3u].x); }",
        &[(K::Uninitialised, 0, [0; 3], [0; 3], 60, "nothing wrote")],
    );
    // `var<private>`, and through a pointer.
    let declarations = "var<private> a: array<u32, 4>;
fn put(p: ptr<private, array<u32, 4>>, at: u32) { (*p)[at] = 1u; }";
    expect(
        declarations,
        "put(&a, i % 4u); if i == 11u { result[g] = /*!*/a[2]; } else { result[g] = a[i % 4u]; }",
        &[(K::Uninitialised, 0, [0; 3], [1, 1, 0], 3, "nothing wrote")],
    );
}

#[test]
fn arrays_begin_anew() {
    // In each iteration, and in each call.
    expect(
        "",
        "for (var k = 0u; k < 3u; k++) { var a: array<u32, 3>; if k != 1u { a[i % 3u] = k; } result[g] = /*!*/a[i % 3u]; }",
        &[(K::Uninitialised, 0, [0; 3], [0; 3], 270, "nothing wrote")],
    );
    silent(
        "",
        "for (var k = 0u; k < 3u; k++) { var a = array<u32, 3>(); result[g] = a[i % 3u]; }",
    );
    expect(
        "fn f(n: u32, write: bool) -> u32 { var a: array<u32, 3>; if write { a[n] = 1u; } return /*!*/a[n]; }",
        "result[g] = f(i % 3u, true) + f(i % 3u, i != 5u);",
        &[(K::Uninitialised, 0, [0; 3], [5, 0, 0], 3, "nothing wrote")],
    );
}

#[test]
fn workgroup_memory() {
    let shared = "var<workgroup> shared_words: array<u32, 90>;";
    expect(
        shared,
        "if i != 44u { shared_words[i] = i; } workgroupBarrier(); result[g] = /*!*/shared_words[(i + 2u) % 90u];",
        &[(
            K::Uninitialised,
            0,
            [0; 3],
            [2, 4, 0],
            3,
            "nothing wrote workgroup memory",
        )],
    );
    silent(
        shared,
        "shared_words[i] = i; workgroupBarrier(); result[g] = shared_words[(i + 2u) % 90u];",
    );
    // Atomics read what is there, too; storing is no read.
    expect(
        "var<workgroup> count: atomic<u32>;",
        "/*!*/atomicAdd(&count, 1u); workgroupBarrier(); result[g] = atomicLoad(&count);",
        &[(K::Uninitialised, 0, [0; 3], [0; 3], 3, WG)],
    );
    silent(
        "var<workgroup> count: atomic<u32>;",
        "if i == 0u { atomicStore(&count, 0u); } workgroupBarrier(); atomicAdd(&count, 1u); workgroupBarrier(); result[g] = atomicLoad(&count);",
    );
    expect(
        "var<workgroup> flag: u32;",
        "result[g] = /*!*/workgroupUniformLoad(&flag);",
        &[(K::Uninitialised, 0, [0; 3], [0; 3], 270, WG)],
    );
}

#[test]
fn storage_that_nothing_wrote() {
    let scratch = "@group(0) @binding(1) var<storage, read_write> scratch: array<u32>;";
    // Read before it is written by the same invocation.
    expect(
        scratch,
        "let old = /*!*/scratch[g]; scratch[g] = old + 1u; result[g] = old;",
        &[(
            K::Uninitialised,
            0,
            [0; 3],
            [0; 3],
            270,
            "nothing wrote word 0 of `scratch`",
        )],
    );
    silent(scratch, "scratch[g] = i; result[g] = scratch[g];");
    expect(
        scratch,
        "if i < 30u { scratch[g] = i; } storageBarrier(); result[g] = /*!*/scratch[w.x * 90u + i / 2u];",
        &[(
            K::Uninitialised,
            0,
            [0; 3],
            [0, 6, 0],
            90,
            "nothing wrote word 30 of `scratch`",
        )],
    );
    // Written by another workgroup: which comes first is not to be known.
    silent(
        scratch,
        "if w.x == 2u { scratch[i] = i; } if w.x == 0u { result[g] = scratch[i]; }",
    );
    // A binding that cannot be written.
    expect(
        "@group(0) @binding(1) var<storage, read> given: array<vec2<u32>>;",
        "if w.x == 1u && i == 89u { result[g] = /*!*/given[3].y; }",
        &[(
            K::Uninitialised,
            0,
            [1, 0, 0],
            [9, 8, 0],
            1,
            "nothing wrote word 7 of `given`",
        )],
    );
}

/// What a dispatch wrote is written for the next, by a program that watches or not.
#[test]
fn buffers_remember_what_is_written() {
    let write = "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
@compute @workgroup_size(8) fn main(@builtin(local_invocation_index) i: u32) { result[i] = i; }";
    let read = "@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read_write> result: array<u32>;
@compute @workgroup_size(16) fn main(@builtin(local_invocation_index) i: u32) { result[i] = /*!*/data[i]; }";
    let executor = Executor::new(1).unwrap();
    let reader = checked(read, Checks::all());
    let count = |data: &Buffer| {
        let output = buffer(&[0; 16]);
        let bound = [BoundResource::Buffer(data), BoundResource::Buffer(&output)];
        let report = reader.dispatch(&executor, [1, 1, 1], &bound).unwrap();
        report
            .findings
            .iter()
            .map(|finding| finding.count)
            .sum::<u64>()
    };
    for (checks, unknown) in [(Checks::all(), 8), (Checks::NONE, 0)] {
        let data = Buffer::unwritten(64).unwrap();
        assert_eq!(count(&data), 16);
        let bound = [BoundResource::Buffer(&data)];
        checked(write, checks)
            .dispatch(&executor, [1, 1, 1], &bound)
            .unwrap();
        // Without checks nobody knows which words were written.
        assert_eq!(count(&data), unknown, "{checks:?}");
    }
    let mut data = Buffer::unwritten(64).unwrap();
    data.write(&[0; 20]);
    assert_eq!(count(&data), 11);
    let other = Buffer::unwritten(64).unwrap();
    other.copy_from(&data);
    assert_eq!(count(&other), 11);
    other.clear();
    assert_eq!(count(&other), 0);
}

#[test]
fn races_in_workgroup_memory() {
    let shared = "var<workgroup> words: array<u32, 90>;";
    // Written by one, read by another without a barrier.
    expect(
        shared,
        "words[i] = i;\n result[g] = /*!*/words[(i + 1u) % 90u];",
        &[(
            K::Race,
            0,
            [0; 3],
            [0; 3],
            270,
            "is read here and written by invocation (1,0,0) at test:",
        )],
    );
    silent(
        shared,
        "words[i] = i; workgroupBarrier(); result[g] = words[(i + 1u) % 90u];",
    );
    // A barrier for other memory does not help.
    expect(
        shared,
        "words[i] = i; storageBarrier();\n result[g] = /*!*/words[(i + 1u) % 90u];",
        &[(K::Race, 0, [0; 3], [0; 3], 270, WG)],
    );
    // Read first, then written by another.
    expect(
        shared,
        "words[i] = 1u; workgroupBarrier(); result[g] = words[(i + 1u) % 90u];\n /*!*/words[i] = 2u;",
        &[(
            K::Race,
            0,
            [0; 3],
            [0; 3],
            270,
            "is written here and read by invocation (9,8,0)",
        )],
    );
    // In a loop the second barrier is missing.
    let looped = |last: &str| {
        format!(
            "words[i] = i; workgroupBarrier(); var sum = 0u;
            for (var k = 0u; k < 3u; k++) {{
                sum += words[(i + 1u) % 90u]; {last}
                /*!*/words[i] = sum; workgroupBarrier();
            }}
            result[g] = sum;"
        )
    };
    expect(
        shared,
        &looped(""),
        &[(
            K::Race,
            0,
            [0; 3],
            [0; 3],
            810,
            "is written here and read by",
        )],
    );
    silent(shared, &looped("workgroupBarrier();"));
    // Two writers, even of the same value: all but the first are second.
    expect(
        shared,
        "/*!*/words[0] = 7u; workgroupBarrier(); result[g] = words[0];",
        &[(
            K::Race,
            0,
            [0; 3],
            [1, 0, 0],
            267,
            "is written here and written by invocation (0,0,0)",
        )],
    );
    silent(
        shared,
        "if i == 3u { words[0] = 7u; } workgroupBarrier(); result[g] = words[0];",
    );
    // Alone on a word one may do as one likes; different words are different.
    silent(
        shared,
        "words[i] = i; words[i] += 1u; result[g] = words[i];",
    );
    // `workgroupUniformLoad` has barriers of its own.
    silent(
        shared,
        "if i == 5u { words[0] = 7u; } result[g] = workgroupUniformLoad(&words[0]); if i == 6u { words[0] = 8u; }",
    );
    // Atomic operations do not race.
    silent(
        "var<workgroup> count: atomic<u32>;",
        "atomicStore(&count, 0u); atomicMax(&count, i); result[g] = atomicLoad(&count);",
    );
}

#[test]
fn races_in_storage() {
    let scratch = "@group(0) @binding(1) var<storage, read_write> scratch: array<u32>;";
    let at = |i: &str| format!("scratch[w.x * 90u + {i}]");
    expect(
        scratch,
        &format!(
            "{} = i;\n result[g] = /*!*/{};",
            at("i"),
            at("(i + 1u) % 90u")
        ),
        &[(
            K::Race,
            0,
            [0; 3],
            [0; 3],
            270,
            "word 1 of `scratch` is read here and written by invocation (1,0,0) at test:",
        )],
    );
    silent(
        scratch,
        &format!(
            "{} = i; storageBarrier(); result[g] = {};",
            at("i"),
            at("(i + 1u) % 90u")
        ),
    );
    expect(
        scratch,
        &format!(
            "{} = i; workgroupBarrier();\n result[g] = /*!*/{};",
            at("i"),
            at("(i + 1u) % 90u")
        ),
        &[(K::Race, 0, [0; 3], [0; 3], 270, "word 1 of `scratch`")],
    );
}

#[test]
fn barriers_in_divergent_control_flow() {
    let body = "if i < 80u && w.x == 1u { /*!*/workgroupBarrier(); } result[g] = i;";
    expect(
        "",
        body,
        &[(
            K::DivergentBarrier,
            0,
            [1, 0, 0],
            [0, 8, 0],
            10,
            "a barrier is reached by 80 of 90 invocations",
        )],
    );
    silent("", "if w.x == 1u { workgroupBarrier(); } result[g] = i;");
    silent(
        "",
        "workgroupBarrier(); if i < 80u { return; } result[g] = i;",
    );
    expect(
        "",
        "if i < 80u { return; } result[g] = i; /*!*/storageBarrier();",
        &[(K::DivergentBarrier, 0, [0; 3], [0; 3], 240, "10 of 90")],
    );
    // Without the check it is a failure, of the same workgroup and invocation.
    let wgsl = kernel("", body);
    let program = program(&wgsl);
    for (name, executor) in all_executors() {
        let output = buffer(&[0; 270]);
        let bound = [BoundResource::Buffer(&output)];
        let error = program.dispatch(&executor, [3, 1, 1], &bound).unwrap_err();
        let RunError::DivergentBarrier {
            location,
            workgroup,
            invocation,
            ..
        } = &error
        else {
            panic!("{name}: {error}")
        };
        assert_eq!(
            (location, workgroup, invocation),
            (&place(&wgsl, 0), &[1, 0, 0], &[0, 8, 0]),
            "{name}"
        );
        assert!(error.to_string().contains("workgroup (1,0,0)"), "{error}");
    }
}

#[test]
fn loops_that_do_not_end() {
    // 12 invocations of two workgroups, in a loop that varies; all of a workgroup;
    // and some in a loop whose counter is the same for all.
    let cases = [
        (
            "var n = 0u; /*!*/loop { if n == 10u && !(w.x > 0u && i >= 78u) { break; } n++; } result[g] = n;",
            [8, 7, 0],
            24,
        ),
        (
            "var n = 0u; /*!*/while n < 10u || w.x > 0u { n++; } result[g] = n;",
            [0, 0, 0],
            180,
        ),
        (
            "var n = 0u; if i >= 50u && w.x != 0u { /*!*/for (var k = 0u; k < 10u || w.y == 0u; k++) { n += 2u; } } result[g] = n;",
            [0, 5, 0],
            80,
        ),
    ];
    for (body, invocation, count) in cases {
        expect(
            "",
            body,
            &[(
                K::EndlessLoop,
                0,
                [1, 0, 0],
                invocation,
                count,
                "a loop ran 100 times without ending",
            )],
        );
        let wgsl = kernel("", body);
        let program = program(&wgsl);
        for (name, executor) in all_executors() {
            let output = buffer(&[0; 270]);
            let bound = [BoundResource::Buffer(&output)];
            let error = program.dispatch(&executor, [3, 1, 1], &bound).unwrap_err();
            let RunError::EndlessLoop {
                location,
                workgroup,
                invocation: found,
                limit: 100,
                ..
            } = &error
            else {
                panic!("{name}: {error}")
            };
            assert_eq!(
                (location, workgroup, found),
                (&place(&wgsl, 0), &[1, 0, 0], &invocation),
                "{name}: {error}"
            );
        }
    }
    silent("", "var n = 0u; while n < 99u { n++; } result[g] = n;");
}

/// A loop that is left goes on with what it had: others are not disturbed.
#[test]
fn what_is_reported_goes_on() {
    let wgsl = kernel(
        "fn never(n: u32) -> u32 { loop { if n < 85u { return n; } } return 41u; }",
        "result[g] = never(i) + 1u;",
    );
    let program = checked(&wgsl, only(K::EndlessLoop));
    for (name, executor) in all_executors() {
        let output = buffer(&[0; 270]);
        let bound = [BoundResource::Buffer(&output)];
        let report = program.dispatch(&executor, [3, 1, 1], &bound).unwrap();
        assert_eq!(report.findings[0].count, 15, "{name}");
        let words = words(&output);
        for (g, &word) in words.iter().enumerate() {
            let i = g as u32 % 90;
            assert_eq!(word, if i < 85 { i + 1 } else { 42 }, "{name}: {g}");
        }
    }
}

/// The lowest workgroup that fails is the one that is named.
#[test]
fn failures_do_not_depend_on_speed() {
    // Workgroup 40 fails late, those after it at once.
    let wgsl = kernel(
        "",
        "var n = 0u; let limit = select(50u, 1000u, w.x >= 40u); while n < limit { n++; } result[g % 270u] = n;",
    );
    let program = program(&wgsl);
    for (name, executor) in all_executors() {
        let output = buffer(&[0; 270]);
        let bound = [BoundResource::Buffer(&output)];
        let error = program
            .dispatch(&executor, [200, 1, 1], &bound)
            .unwrap_err();
        assert!(
            matches!(
                error,
                RunError::EndlessLoop {
                    workgroup: [40, 0, 0],
                    ..
                }
            ),
            "{name}: {error}"
        );
    }
}

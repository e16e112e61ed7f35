//! Checks of operands: every kind of planted fault is found at its place, by the
//! right invocation and as often as it happens, and nothing else is.

use crate::common;

use common::checks::*;
use common::*;
use etalon_cpu::{BoundResource, Checks, Finding, FindingKind as K};

/// What each `data[i]` is.
const ZERO: usize = 0;
const ONE: usize = 1;
const EIGHT: usize = 2;
const TWELVE: usize = 3;
const BIG: usize = 4;
const MINUS_ONE: usize = 5;
const LOWEST: usize = 6;
const ONE_F: usize = 7;
const MINUS_ONE_F: usize = 8;
const BILLIONS_F: usize = 9;
const NAN: usize = 10;
const HUGE_F: usize = 11;
const HUNDRED_F: usize = 12;

fn data() -> Vec<u32> {
    vec![
        0,
        1,
        8,
        12,
        1000,
        u32::MAX,
        1 << 31,
        1.0_f32.to_bits(),
        (-1.0_f32).to_bits(),
        5.0e9_f32.to_bits(),
        f32::NAN.to_bits(),
        3.0e38_f32.to_bits(),
        100.0_f32.to_bits(),
        2,
    ]
}

/// A way to go wrong: `x` is a `u32` from the data.
struct Case {
    /// At module scope.
    declarations: &'static str,
    /// Before the statement.
    before: &'static str,
    /// With a mark before what is to be found.
    statement: &'static str,
    good: usize,
    bad: usize,
    kind: K,
    message: &'static str,
}

const CASES: &[Case] = &[
    // Indices.
    Case {
        declarations: "",
        before: "var a = array<u32, 9>();",
        statement: "result[g] = /*!*/a[x];",
        good: EIGHT,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of an array of 9",
    },
    Case {
        declarations: "",
        before: "var a = array<u32, 9>();",
        statement: "result[g] = 1u + /*!*/a[i32(x)];",
        good: EIGHT,
        bad: MINUS_ONE,
        kind: K::Index,
        message: "index -1 is outside of an array of 9",
    },
    Case {
        declarations: "",
        before: "var a = array<u32, 9>();",
        statement: "/*!*/a[x] = g;",
        good: EIGHT,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of an array of 9",
    },
    Case {
        declarations: "struct S { a: f32, b: array<vec2<f32>, 9> } var<private> p = S();",
        before: "",
        statement: "result[g] = u32(/*!*/p.b[x].y);",
        good: EIGHT,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of an array of 9",
    },
    Case {
        declarations: "fn at(p: ptr<function, array<u32, 9>>, x: u32) -> u32 {\n  return /*!*/(*p)[x]; }",
        before: "var a = array<u32, 9>();",
        statement: "result[g] = at(&a, x);",
        good: EIGHT,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of an array of 9",
    },
    Case {
        declarations: "",
        before: "let a = array<u32, 9>(1, 2, 3, 4, 5, 6, 7, 8, 9);",
        statement: "result[g] = /*!*/a[x];",
        good: EIGHT,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of an array of 9",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = /*!*/data[x];",
        good: EIGHT,
        bad: BIG,
        kind: K::Index,
        message: "index 1000 is outside of an array of 14",
    },
    Case {
        declarations: "",
        before: "var v = vec3<u32>(g, 1u, 2u);",
        statement: "result[g] = /*!*/v[x];",
        good: ONE,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of a vector of 3",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = /*!*/vec3<u32>(g, 1u, 2u)[x];",
        good: ONE,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of a vector of 3",
    },
    Case {
        declarations: "",
        before: "var m = mat3x3<f32>();",
        statement: "result[g] = u32(/*!*/m[x].y);",
        good: ONE,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of the columns of a matrix of 3",
    },
    Case {
        declarations: "",
        before: "var m = mat3x3<f32>();",
        statement: "result[g] = u32(/*!*/m[1][x]);",
        good: ONE,
        bad: TWELVE,
        kind: K::Index,
        message: "index 12 is outside of a vector of 3",
    },
    // Division.
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = 1u + /*!*/g / x;",
        good: ONE,
        bad: ZERO,
        kind: K::DivisionByZero,
        message: "250 is divided by 0",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = /*!*/g % x;",
        good: ONE,
        bad: ZERO,
        kind: K::DivisionByZero,
        message: "250 is divided by 0",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = u32(/*!*/-i32(g) % i32(x));",
        good: ONE,
        bad: ZERO,
        kind: K::DivisionByZero,
        message: "-250 is divided by 0",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = (/*!*/vec3<u32>(1u, g, g) / vec3<u32>(3u, x, x)).y;",
        good: ONE,
        bad: ZERO,
        kind: K::DivisionByZero,
        message: "250 is divided by 0",
    },
    Case {
        declarations: "",
        before: "let lowest = i32(data[6]);",
        statement: "result[g] = u32(/*!*/lowest / i32(x));",
        good: ONE,
        bad: MINUS_ONE,
        kind: K::DivisionOverflow,
        message: "-2147483648 is divided by -1",
    },
    Case {
        declarations: "",
        before: "let minus_one = i32(data[5]);",
        statement: "result[g] = u32(/*!*/i32(x) % minus_one);",
        good: ONE,
        bad: LOWEST,
        kind: K::DivisionOverflow,
        message: "-2147483648 is divided by -1",
    },
    // Shifts.
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = /*!*/g << (x + 24u);",
        good: ONE,
        bad: EIGHT,
        kind: K::Shift,
        message: "a number of 32 bits is shifted by 32",
    },
    Case {
        declarations: "",
        before: "",
        statement: "result[g] = u32(/*!*/i32(g) >> x);",
        good: ONE,
        bad: BIG,
        kind: K::Shift,
        message: "a number of 32 bits is shifted by 1000",
    },
    // Conversions.
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = 1u + /*!*/u32(f);",
        good: ONE_F,
        bad: MINUS_ONE_F,
        kind: K::Conversion,
        message: "-1 is converted to u32, which does not have it",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = u32(vec2<u32>(/*!*/vec2<i32>(vec2<f32>(0.0, f))).y);",
        good: MINUS_ONE_F,
        bad: BILLIONS_F,
        kind: K::Conversion,
        message: "5000000000 is converted to i32, which does not have it",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = u32(/*!*/i32(f));",
        good: MINUS_ONE_F,
        bad: NAN,
        kind: K::Conversion,
        message: "NaN is converted to i32, which does not have it",
    },
    // NaN and infinity.
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(/*!*/2.0 / f);",
        good: ONE_F,
        bad: ZERO,
        kind: K::NonFinite,
        message: "inf comes of finite operands (2, 0)",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(1.0 + /*!*/f * f);",
        good: ONE_F,
        bad: HUGE_F,
        kind: K::NonFinite,
        message: "inf comes of finite operands",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(/*!*/sqrt(f));",
        good: ONE_F,
        bad: MINUS_ONE_F,
        kind: K::NonFinite,
        message: "NaN comes of finite operands (-1)",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(/*!*/log(f));",
        good: ONE_F,
        bad: ZERO,
        kind: K::NonFinite,
        message: "-inf comes of finite operands (0)",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(/*!*/exp(f));",
        good: ONE_F,
        bad: HUNDRED_F,
        kind: K::NonFinite,
        message: "inf comes of finite operands (100)",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>(/*!*/normalize(vec3<f32>(0.0, f, 0.0)).x);",
        good: ONE_F,
        bad: ZERO,
        kind: K::NonFinite,
        message: "NaN comes of finite operands (0, 0, 0)",
    },
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x);",
        statement: "result[g] = bitcast<u32>((/*!*/mat2x2<f32>(f, f, f, f) * vec2<f32>(1.0, 1.0)).x);",
        good: ONE_F,
        bad: HUGE_F,
        kind: K::NonFinite,
        message: "inf comes of finite operands",
    },
    // Only the second component is new, the first was a NaN before.
    Case {
        declarations: "",
        before: "let f = bitcast<f32>(x); let v = vec2<f32>(bitcast<f32>(data[10]), f);",
        statement: "result[g] = bitcast<u32>((/*!*/v / vec2<f32>(1.0, f)).y);",
        good: ONE_F,
        bad: ZERO,
        kind: K::NonFinite,
        message: "NaN comes of finite operands (0, 0)",
    },
];

/// A kernel of 3×2 workgroups of 90 invocations, in which the last 20 of four
/// workgroups are `bad`.
fn kernel(case: &Case, body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read> data: array<u32>;
@group(0) @binding(1) var<storage, read_write> result: array<u32>;
{}
@compute @workgroup_size(10, 9)
fn main(
    @builtin(workgroup_id) w: vec3<u32>,
    @builtin(num_workgroups) n: vec3<u32>,
    @builtin(local_invocation_index) i: u32,
) {{
    let g = (w.y * n.x + w.x) * 90u + i;
    let bad = (w.x == 2u || w.y == 1u) && i >= 70u;
    {body}
}}",
        case.declarations
    )
}

/// The statement where `x` is `data[index]`.
fn with(case: &Case, x: &str) -> String {
    format!("let x = {x};\n    {}\n    {}", case.before, case.statement)
}

fn chosen(case: &Case) -> String {
    format!("select(data[{}u], data[{}u], bad)", case.good, case.bad)
}

fn run(wgsl: &str, checks: Checks, executors: &[(String, etalon_cpu::Executor)]) -> Vec<Finding> {
    let program = checked(wgsl, checks);
    let input = buffer(&data());
    find(&program, executors, [3, 2, 1], |dispatch| {
        let output = buffer(&[0; 540]);
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(if binding.binding == 0 {
                    &input
                } else {
                    &output
                })
            })
            .collect();
        dispatch(&bound);
    })
}

/// Exactly one thing is found.
fn expect(case: &Case, wgsl: &str, found: &[Finding], count: u64) {
    let [finding] = found else {
        panic!("{}\n{wgsl}", list(found));
    };
    assert_eq!(finding.kind, case.kind, "{finding}\n{wgsl}");
    assert_eq!(finding.location, place(wgsl, 0), "{finding}\n{wgsl}");
    assert_eq!(finding.workgroup, [2, 0, 0], "{finding}\n{wgsl}");
    assert_eq!(finding.invocation, [0, 7, 0], "{finding}\n{wgsl}");
    assert_eq!(finding.count, count, "{finding}\n{wgsl}");
    assert!(finding.message.contains(case.message), "{finding}\n{wgsl}");
}

#[test]
fn faults_are_found_where_they_are() {
    let executors = all_executors();
    for case in CASES {
        let selected = kernel(case, &with(case, &chosen(case)));
        expect(
            case,
            &selected,
            &run(&selected, Checks::all(), &executors),
            80,
        );

        let branch = format!(
            "if bad {{ {} }}",
            with(case, &format!("data[{}u]", case.bad))
        );
        let masked = kernel(case, &branch);
        expect(case, &masked, &run(&masked, Checks::all(), &executors), 80);

        // As often as it happens.
        let repeated = format!(
            "for (var k = 0; k < 3; k++) {{ {} }}",
            with(case, &chosen(case))
        );
        let looped = kernel(case, &repeated);
        expect(case, &looped, &run(&looped, Checks::all(), &executors), 240);

        // After some invocations have left.
        let left = format!("if i >= 80u {{ return; }}\n{}", with(case, &chosen(case)));
        let returned = kernel(case, &left);
        expect(
            case,
            &returned,
            &run(&returned, Checks::all(), &executors),
            40,
        );
    }
}

#[test]
fn correct_twins_and_inactive_invocations_are_silent() {
    let executors = all_executors();
    for case in CASES {
        let good = with(case, &format!("data[{}u]", case.good));
        let bad = with(case, &format!("data[{}u]", case.bad));
        let silent = [
            good,
            format!("if data[0] != 0u {{ {bad} }}"),
            format!("if !bad {{ {} }}", with(case, &chosen(case))),
            format!("if bad {{ return; }}\n{}", with(case, &chosen(case))),
            format!(
                "for (var k = 0; k < 3; k++) {{ if bad {{ continue; }} {} }}",
                with(case, &chosen(case))
            ),
        ];
        for body in silent {
            let wgsl = kernel(case, &body);
            let found = run(&wgsl, Checks::all(), &executors);
            assert!(found.is_empty(), "{}\n{wgsl}", list(&found));
        }
    }
}

#[test]
fn each_check_is_on_or_off_by_itself() {
    let executors = &all_executors()[..1];
    for case in CASES {
        let wgsl = kernel(case, &with(case, &chosen(case)));
        expect(case, &wgsl, &run(&wgsl, only(case.kind), executors), 80);
        let others = run(&wgsl, all_but(case.kind), executors);
        assert!(others.is_empty(), "{}\n{wgsl}", list(&others));
    }
}

/// What is not a number stays one: only its birth is reported.
#[test]
fn propagation_is_not_birth() {
    let executors = all_executors();
    let births = CASES.iter().filter(|case| case.kind == K::NonFinite);
    for case in births {
        let wgsl = kernel(case, &with(case, &format!("data[{NAN}u]")));
        let found = run(&wgsl, Checks::all(), &executors);
        assert!(found.is_empty(), "{}\n{wgsl}", list(&found));
    }
}

/// What is stored out of bounds goes to the last element, as on a GPU, where it
/// also races.
#[test]
fn stores_to_runtime_sized_arrays_are_watched() {
    let case = Case {
        declarations: "",
        before: "",
        statement: "/*!*/result[select(g, x, x == 1000u)] = g;",
        good: ONE,
        bad: BIG,
        kind: K::Index,
        message: "index 1000 is outside of an array of 540",
    };
    let executors = all_executors();
    let wgsl = kernel(&case, &with(&case, &chosen(&case)));
    expect(&case, &wgsl, &run(&wgsl, only(K::Index), &executors), 80);
    let found = run(&wgsl, Checks::all(), &executors);
    let kinds: Vec<K> = found.iter().map(|finding| finding.kind).collect();
    assert_eq!(kinds, [K::Index, K::Race], "{}", list(&found));
    let good = kernel(&case, &with(&case, "data[1]"));
    assert!(run(&good, Checks::all(), &executors).is_empty());
}

/// Two places, two findings, in the order of the source; a function that is
/// called twice is one place.
#[test]
fn places_are_told_apart_and_joined() {
    let case = Case {
        declarations: "fn divide(a: u32, b: u32) -> u32 {\n  return /*!*/a / b;\n}",
        before: "",
        statement: "result[g] = divide(g, x) + divide(1u, x) + /*!*/g % x;",
        good: ONE,
        bad: ZERO,
        kind: K::DivisionByZero,
        message: "",
    };
    let wgsl = kernel(&case, &with(&case, &chosen(&case)));
    let found = run(&wgsl, Checks::all(), &all_executors());
    let places: Vec<_> = found
        .iter()
        .map(|finding| (finding.location.clone(), finding.count))
        .collect();
    assert_eq!(
        places,
        [(place(&wgsl, 0), 160), (place(&wgsl, 1), 80)],
        "{}",
        list(&found)
    );
}

#[test]
fn findings_say_everything_in_one_line() {
    let case = &CASES[0];
    let wgsl = kernel(case, &with(case, &chosen(case)));
    let found = run(&wgsl, Checks::all(), &all_executors()[..1]);
    let at = place(&wgsl, 0);
    assert_eq!(
        found[0].to_string(),
        format!(
            "test:{}:{}: index 12 is outside of an array of 9 (workgroup (2,0,0), invocation (0,7,0), and 79 more)",
            at.line, at.column
        )
    );
    // A single one has no others.
    let single = kernel(
        case,
        &format!(
            "if g == 250u {{ {} }}",
            with(case, &format!("data[{}u]", case.bad))
        ),
    );
    let found = run(&single, Checks::all(), &all_executors()[..1]);
    assert!(
        found[0].to_string().ends_with("invocation (0,7,0))"),
        "{}",
        found[0]
    );
}

/// Without checks there is nothing of them in the code, and with them results
/// are the same.
#[test]
fn checks_change_no_result_and_cost_nothing_when_off() {
    let executors = all_executors();
    for case in CASES {
        let wgsl = kernel(case, &with(case, &chosen(case)));
        let plain = program(&wgsl);
        assert!(!plain.to_string().contains("check."), "{plain}");
        let off = checked(&wgsl, Checks::default());
        assert_eq!(plain.to_string(), off.to_string());
        let on = checked(&wgsl, Checks::all());
        assert!(on.to_string().contains("check."), "{on}");
        let results: Vec<Vec<u32>> = [&plain, &on]
            .iter()
            .map(|program| {
                let (input, output) = (buffer(&data()), buffer(&[0; 540]));
                let bound: Vec<BoundResource<'_>> = program
                    .bindings()
                    .iter()
                    .map(|binding| {
                        BoundResource::Buffer(if binding.binding == 0 {
                            &input
                        } else {
                            &output
                        })
                    })
                    .collect();
                let report = program
                    .dispatch(&executors[0].1, [3, 2, 1], &bound)
                    .unwrap();
                assert_eq!(report.counters.workgroups, 6);
                words(&output)
            })
            .collect();
        assert_eq!(results[0], results[1], "{wgsl}");
    }
}

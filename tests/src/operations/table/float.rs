//! Operators and functions on floating-point numbers that are exact or nearly
//! so.

use super::super::accuracy::{Arithmetic, Table};
use super::super::exact::Exact;
use super::super::float::{FloatType, power_of_two};
use super::super::inputs;
use super::super::interval::Interval;
use super::super::operation::{Float, Meaning, Operation, Scalar, Words};
use super::super::{formulas, operation};
use super::{componentwise, inexact, nearest, rounded, words};

const ROUNDED: &str = "§15.7.4.1: correctly rounded";

/// Adds all of them for a type.
pub(super) fn add(all: &mut Vec<Operation>, ty: FloatType) {
    operators(all, ty);
    comparisons(all, ty);
    steps(all, ty);
    choices(all, ty);
    parts(all, ty);
    blends(all, ty);
}

fn operators(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let name = |text: &str| format!("{text}, {}", s.name());
    let two = |code: &str, accuracy: &str, meaning: Meaning| {
        componentwise(
            name(code),
            accuracy,
            &[s, s],
            vec![(code, s, meaning)],
            inputs::several(ty, 2, 11),
        )
    };
    all.push(
        two(
            "a + b",
            ROUNDED,
            rounded(ty, |x| x[0] + x[1], |x| x[0] + x[1]),
        )
        .strict(),
    );
    all.push(
        two(
            "a - b",
            ROUNDED,
            rounded(ty, |x| x[0] - x[1], |x| x[0] - x[1]),
        )
        .strict(),
    );
    all.push(
        two(
            "a * b",
            ROUNDED,
            rounded(ty, |x| x[0] * x[1], |x| x[0] * x[1]),
        )
        .strict(),
    );
    let divided = nearest(
        ty,
        |t, x| t.div(x[0], x[1]),
        |x| x[0] / x[1],
        |x| x[0] / x[1],
    );
    let accuracy = "§15.7.4.1: 2.5 ULP for |b| in [2^-126, 2^126], in f16 in [2^-14, 2^14]";
    all.push(two("a / b", accuracy, divided).strict());
    let remainder = inexact(
        ty,
        |t, x| formulas::remainder(&t, x[0], x[1]),
        |x| x[0] - x[1] * (x[0] / x[1]).trunc(),
    );
    all.push(two(
        "a % b",
        "§15.7.4.1: inherited from a - b * trunc(a / b)",
        remainder,
    ));
    all.push(
        componentwise(
            name("-a"),
            ROUNDED,
            &[s],
            vec![("-a", s, rounded(ty, |x| -x[0], |x| -x[0]))],
            inputs::one(ty, (-4.0, 4.0), 12),
        )
        .strict(),
    );
    let fused = inexact(
        ty,
        |t, x| formulas::fma(&t, x[0], x[1], x[2]),
        |x| x[0] * x[1] + x[2],
    );
    all.push(componentwise(
        name("fma(a, b, c)"),
        "§15.7.4.1: inherited from a * b + c",
        &[s, s, s],
        vec![("fma(a, b, c)", s, fused)],
        inputs::several(ty, 3, 13),
    ));
}

fn comparisons(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    type Compare = fn(f64, f64) -> bool;
    let kinds: [(&str, Compare); 6] = [
        ("a == b", |a, b| a == b),
        ("a != b", |a, b| a != b),
        ("a < b", |a, b| a < b),
        ("a <= b", |a, b| a <= b),
        ("a > b", |a, b| a > b),
        ("a >= b", |a, b| a >= b),
    ];
    for (code, compare) in kinds {
        let meaning = words(move |x| {
            let (a, b) = (ty.decode(x[0]), ty.decode(x[1]));
            let own = u32::from(compare(a, b));
            if a.is_finite() && b.is_finite() {
                Words::exactly(own)
            } else {
                Words::open(own)
            }
        });
        all.push(
            componentwise(
                format!("{code}, {}", s.name()),
                "§15.7.4.1: correct result",
                &[s, s],
                vec![(code, Scalar::Bool, meaning)],
                inputs::several(ty, 2, 14),
            )
            .strict(),
        );
    }
}

/// To the nearest integer, of two to the even one.
fn round(x: Exact) -> Exact {
    let below = x.floor();
    let rest = (x - below) - Exact::new(0.5);
    let is_even = (below.head() / 2.0).floor() * 2.0 == below.head();
    if rest.signum() < 0.0 || rest.signum() == 0.0 && is_even {
        below
    } else {
        below + Exact::new(1.0)
    }
}

/// Functions of one number that are correctly rounded.
fn steps(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let mut one = |code: &str, meaning: Meaning, strict: bool| {
        let operation = componentwise(
            format!("{code}, {}", s.name()),
            ROUNDED,
            &[s],
            vec![(code, s, meaning)],
            inputs::one(ty, (-40.0, 40.0), 15),
        );
        all.push(Operation {
            strict,
            ..operation
        });
    };
    one("abs(a)", rounded(ty, |x| x[0].abs(), |x| x[0].abs()), true);
    one(
        "floor(a)",
        rounded(ty, |x| x[0].floor(), |x| x[0].floor()),
        true,
    );
    one(
        "ceil(a)",
        rounded(ty, |x| -(-x[0]).floor(), |x| x[0].ceil()),
        true,
    );
    one(
        "trunc(a)",
        rounded(ty, |x| x[0].trunc(), |x| x[0].trunc()),
        true,
    );
    one(
        "round(a)",
        rounded(ty, |x| round(x[0]), |x| x[0].round_ties_even()),
        true,
    );
    let sign = |x: &[Exact]| Exact::new(x[0].signum());
    let ieee = |x: &[f32]| {
        if x[0] > 0.0 {
            1.0
        } else if x[0] < 0.0 {
            -1.0
        } else {
            0.0
        }
    };
    one("sign(a)", rounded(ty, sign, ieee), true);
    let saturate = |x: &[Exact]| clamp(x[0], Exact::new(0.0), Exact::new(1.0));
    one(
        "saturate(a)",
        rounded(ty, saturate, |x| max(x[0], 0.0).min(1.0)),
        true,
    );
}

fn less(a: Exact, b: Exact) -> bool {
    (a - b).signum() < 0.0
}

fn clamp(x: Exact, low: Exact, high: Exact) -> Exact {
    let x = if less(x, low) { low } else { x };
    if less(high, x) { high } else { x }
}

/// The other operand when one is NaN, the second when they are equal.
fn max(a: f32, b: f32) -> f32 {
    if a > b || b.is_nan() { a } else { b }
}

/// As [`max`].
fn min(a: f32, b: f32) -> f32 {
    if a < b || b.is_nan() { a } else { b }
}

/// `min`, `max`, `clamp`, `step`, `select`.
fn choices(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let accuracy = "§15.7.4.1: correctly rounded; of two subnormal numbers either";
    let either = |choose: fn(Exact, Exact) -> Exact, ieee: fn(&[f32]) -> f32| {
        Meaning::Float(Float {
            ty,
            table: Box::new(move |table, x| {
                let chosen = choose(Exact::new(x[0]), Exact::new(x[1]));
                let mut allowed = vec![table.rounded(chosen, chosen)];
                if x.iter().all(|&x| ty.is_subnormal(x)) {
                    allowed.extend(x.iter().map(|&x| Interval::point(x)));
                }
                allowed
            }),
            exact: Box::new(move |x| choose(x[0], x[1])),
            ieee: Some(Box::new(ieee)),
        })
    };
    let smaller = either(|a, b| if less(a, b) { a } else { b }, |x| min(x[0], x[1]));
    let larger = either(|a, b| if less(a, b) { b } else { a }, |x| max(x[0], x[1]));
    for (code, meaning) in [("min(a, b)", smaller), ("max(a, b)", larger)] {
        all.push(
            componentwise(
                format!("{code}, {}", s.name()),
                accuracy,
                &[s, s],
                vec![(code, s, meaning)],
                inputs::several(ty, 2, 16),
            )
            .strict(),
        );
    }
    let clamped = move || {
        Meaning::Float(Float {
            ty,
            table: Box::new(move |table, x| {
                let [value, low, high] = [0, 1, 2].map(|i| Exact::new(x[i]));
                // The median differs where the bounds are out of order.
                let median = if less(high, low) {
                    clamp(value, high, low)
                } else {
                    clamp(value, low, high)
                };
                let mut allowed: Vec<Interval> = [clamp(value, low, high), median]
                    .map(|value| table.rounded(value, value))
                    .to_vec();
                let is_subnormal = |i: usize| ty.is_subnormal(x[i]);
                if is_subnormal(0) && (is_subnormal(1) || is_subnormal(2)) {
                    let smallest = ty.smallest_normal();
                    allowed.push(Interval::new(-smallest, smallest));
                }
                allowed
            }),
            exact: Box::new(|x| clamp(x[0], x[1], x[2])),
            ieee: Some(Box::new(|x: &[f32]| min(max(x[0], x[1]), x[2]))),
        })
    };
    let accuracy = "§15.7.4.1: correctly rounded min(max(a, b), c) or median";
    let cases = inputs::several(ty, 3, 17);
    let ordered = cases
        .iter()
        .filter(|case| {
            let (low, high) = (ty.decode(case[1]), ty.decode(case[2]));
            low <= high || low.is_nan() || high.is_nan()
        })
        .cloned()
        .collect();
    all.push(
        componentwise(
            format!("clamp(a, b, c) with b <= c, {}", s.name()),
            accuracy,
            &[s, s, s],
            vec![("clamp(a, b, c)", s, clamped())],
            ordered,
        )
        .strict(),
    );
    all.push(componentwise(
        format!("clamp(a, b, c), {}", s.name()),
        accuracy,
        &[s, s, s],
        vec![("clamp(a, b, c)", s, clamped())],
        cases,
    ));
    let step = rounded(
        ty,
        |x| Exact::new(if less(x[1], x[0]) { 0.0 } else { 1.0 }),
        |x| if x[0] <= x[1] { 1.0 } else { 0.0 },
    );
    all.push(
        componentwise(
            format!("step(a, b), {}", s.name()),
            ROUNDED,
            &[s, s],
            vec![("step(a, b)", s, step)],
            inputs::several(ty, 2, 18),
        )
        .strict(),
    );
    let mut selected = componentwise(
        format!("select(a, b, c), {}", s.name()),
        "§17.3: one of the operands, subnormal numbers preserved (§15.7.2)",
        &[s, s, Scalar::Bool],
        vec![(
            "select(a, b, c)",
            s,
            super::word(|x| x[if x[2] == 0 { 0 } else { 1 }]),
        )],
        inputs::several(ty, 2, 19)
            .into_iter()
            .enumerate()
            .map(|(index, mut case)| {
                case.push(index as u32 & 1);
                case
            })
            .collect(),
    )
    .strict();
    // Nothing is computed, so nothing is flushed: the operands are but words.
    selected.rule = operation::rule(
        vec![Scalar::U32, Scalar::U32, Scalar::Bool],
        vec![(s, super::word(|x| x[if x[2] == 0 { 0 } else { 1 }]))],
    );
    all.push(selected);
}

/// `fract`, `modf`, `frexp`, `ldexp`.
fn parts(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let fract = nearest(
        ty,
        |t, x| formulas::fract(&t, x[0]),
        |x| x[0] - x[0].floor(),
        |x| x[0] - x[0].floor(),
    );
    all.push(componentwise(
        format!("fract(a), {}", s.name()),
        "§15.7.4.1: inherited from a - floor(a)",
        &[s],
        vec![("fract(a)", s, fract)],
        inputs::one(ty, (-4.0, 4.0), 20),
    ));
    all.push(componentwise(
        format!("modf(a), {}", s.name()),
        ROUNDED,
        &[s],
        vec![
            (
                "modf(a).fract",
                s,
                rounded(ty, |x| x[0] - x[0].trunc(), |x| x[0] - x[0].trunc()),
            ),
            (
                "modf(a).whole",
                s,
                rounded(ty, |x| x[0].trunc(), |x| x[0].trunc()),
            ),
        ],
        inputs::one(ty, (-4.0, 4.0), 21),
    ));
    // naga makes the exponent of an `f16` an integer of 16 bits, which no kernel
    // can have; the interpreter's own tests have it.
    if ty == FloatType::F32 {
        all.push(frexp(ty));
    }
    all.push(ldexp(ty));
}

fn frexp(ty: FloatType) -> Operation {
    let s = Scalar::from(ty);
    let fraction = words(move |x| {
        let value = ty.decode(x[0]);
        let own = ty.encode(normalised(value).0);
        if is_zero_or_normal(ty, value) {
            Words {
                allowed: Some(vec![own]),
                own: Some(own),
            }
        } else {
            Words::open(own)
        }
    });
    let exponent = words(move |x| {
        let value = ty.decode(x[0]);
        let own = normalised(value).1 as u32;
        if is_zero_or_normal(ty, value) {
            Words::exactly(own)
        } else {
            Words::open(own)
        }
    });
    componentwise(
        format!("frexp(a), {}", s.name()),
        "§15.7.4.1: correctly rounded for zero and normal numbers",
        &[s],
        vec![
            ("frexp(a).fract", s, fraction),
            ("frexp(a).exp", Scalar::I32, exponent),
        ],
        inputs::one(ty, (-4.0, 4.0), 22),
    )
}

/// `ldexp`.
fn ldexp(ty: FloatType) -> Operation {
    let s = Scalar::from(ty);
    let bias = 1 - ty.smallest_exponent();
    let times = |x: &[f64]| x[0] * power_of_two((x[1] as i32).clamp(-400, 400));
    let scaled = Meaning::Float(Float {
        ty,
        table: Box::new(move |table, x| {
            // §17.5: "if e2 is greater than bias + 1, the result may be
            // indeterminate"; "if e2 + bias is at most zero, it may be flushed".
            if x[1] > f64::from(bias + 1) {
                return vec![Interval::ANY];
            }
            let exact = Exact::new(times(x));
            let mut allowed = vec![table.rounded(exact, exact)];
            if x[1] + f64::from(bias) <= 0.0 {
                allowed.push(Interval::point(0.0));
            }
            allowed
        }),
        exact: Box::new(move |x| Exact::new(times(&[x[0].head(), x[1].head()]))),
        // Zero, infinity and NaN.
        ieee: Some(Box::new(|x: &[f32]| x[0])),
    });
    let mut random = inputs::Random::new(23);
    let exponents: Vec<u32> = inputs::integers()
        .into_iter()
        .chain((-180..180).map(|e: i32| e as u32))
        .collect();
    let cases = inputs::one(ty, (-4.0, 4.0), 24)
        .into_iter()
        .flat_map(|case| {
            let exponent = random.pick(&exponents);
            let small = (random.word() % 360).wrapping_sub(180);
            [vec![case[0], exponent], vec![case[0], small]]
        })
        .collect();
    componentwise(
        format!("ldexp(a, b), {}", s.name()),
        "§15.7.4.1: correctly rounded; §17.5: limits of b",
        &[s, Scalar::I32],
        vec![("ldexp(a, b)", s, scaled)],
        cases,
    )
}

fn is_zero_or_normal(ty: FloatType, value: f64) -> bool {
    value.is_finite() && !ty.is_subnormal(value)
}

/// The fraction in [0.5, 1) and the exponent; what has none is itself.
fn normalised(value: f64) -> (f64, i32) {
    if value == 0.0 || !value.is_finite() {
        return (value, 0);
    }
    let exponent = (value.to_bits() >> 52 & 0x7ff) as i32 - 1022;
    (value * power_of_two(-exponent), exponent)
}

/// Functions inherited from sums, products and quotients; roots.
fn blends(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let root = nearest(ty, |t, x| t.sqrt(x[0]), |x| x[0].sqrt(), |x| x[0].sqrt());
    all.push(
        componentwise(
            format!("sqrt(a), {}", s.name()),
            "§15.7.4.1: inherited from 1.0 / inverseSqrt(a)",
            &[s],
            vec![("sqrt(a)", s, root)],
            inputs::one(ty, (0.0, 16.0), 25),
        )
        .strict(),
    );
    let mut one = |code: &str, accuracy: &str, meaning: Meaning| {
        all.push(componentwise(
            format!("{code}, {}", s.name()),
            accuracy,
            &[s],
            vec![(code, s, meaning)],
            inputs::one(ty, (0.0, 16.0), 26),
        ));
    };
    one(
        "inverseSqrt(a)",
        "§15.7.4.1: 2 ULP",
        inexact(
            ty,
            |t, x| t.inverse_sqrt(x[0]),
            |x| Exact::new(1.0) / x[0].sqrt(),
        ),
    );
    let reals = super::super::accuracy::Reals;
    one(
        "degrees(a)",
        "§15.7.4.1: inherited from a * 57.295779513082322865",
        inexact(
            ty,
            |t, x| formulas::degrees(&t, x[0]),
            move |x| formulas::degrees(&reals, x[0]),
        ),
    );
    one(
        "radians(a)",
        "§15.7.4.1: inherited from a * 0.017453292519943295474",
        inexact(
            ty,
            |t, x| formulas::radians(&t, x[0]),
            move |x| formulas::radians(&reals, x[0]),
        ),
    );
    let mix = inexact(
        ty,
        |t, x| formulas::mix(&t, x[0], x[1], x[2]),
        move |x| formulas::mix(&reals, x[0], x[1], x[2]),
    );
    let smoothstep = inexact(
        ty,
        |t: Table, x| formulas::smoothstep(&t, x[0], x[1], x[2]),
        move |x| formulas::smoothstep(&reals, x[0], x[1], x[2]),
    );
    for (code, accuracy, meaning) in [
        (
            "mix(a, b, c)",
            "§15.7.4.1: inherited from a * (1.0 - c) + b * c",
            mix,
        ),
        (
            "smoothstep(a, b, c)",
            "§15.7.4.1: inherited from t * t * (3.0 - 2.0 * t) with t = clamp((c - a) / (b - a), 0.0, 1.0)",
            smoothstep,
        ),
    ] {
        all.push(componentwise(
            format!("{code}, {}", s.name()),
            accuracy,
            &[s, s, s],
            vec![(code, s, meaning)],
            inputs::several(ty, 3, 27),
        ));
    }
}

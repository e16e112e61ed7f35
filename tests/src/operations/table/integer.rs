//! Operators and functions on integers, all exact (WGSL §8.7, §17.5).

use super::super::inputs;
use super::super::operation::{Operation, Scalar, Shape, rule};
use super::{componentwise, whole, word};

use Scalar::{Bool, I32, U32};

/// What is computed for unsigned and signed operands.
type Two = (fn(u32, u32) -> u32, fn(i32, i32) -> i32);

/// Adds all of them.
pub(super) fn add(all: &mut Vec<Operation>) {
    arithmetic(all);
    comparisons(all);
    functions(all);
    dots(all);
}

fn binary(all: &mut Vec<Operation>, code: &str, accuracy: &str, (unsigned, signed): Two) {
    for (scalar, meaning) in [
        (U32, word(move |x| unsigned(x[0], x[1]))),
        (I32, word(move |x| signed(x[0] as i32, x[1] as i32) as u32)),
    ] {
        all.push(
            componentwise(
                format!("{code}, {}", scalar.name()),
                accuracy,
                &[scalar, scalar],
                vec![(code, scalar, meaning)],
                inputs::integer_cases(2, 81),
            )
            .strict(),
        );
    }
}

fn arithmetic(all: &mut Vec<Operation>) {
    let wraps = "§8.7: modulo 2^32";
    binary(all, "a + b", wraps, (u32::wrapping_add, i32::wrapping_add));
    binary(all, "a - b", wraps, (u32::wrapping_sub, i32::wrapping_sub));
    binary(all, "a * b", wraps, (u32::wrapping_mul, i32::wrapping_mul));
    binary(
        all,
        "a / b",
        "§8.7: truncated; a where b is zero or the quotient overflows",
        (
            |a, b| a.checked_div(b).unwrap_or(a),
            |a, b| a.checked_div(b).unwrap_or(a),
        ),
    );
    binary(
        all,
        "a % b",
        "§8.7: a - b * (a / b); zero where b is zero or the quotient overflows",
        (
            |a, b| a.checked_rem(b).unwrap_or(0),
            |a, b| a.checked_rem(b).unwrap_or(0),
        ),
    );
    binary(all, "min(a, b)", "§17.5", (u32::min, i32::min));
    binary(all, "max(a, b)", "§17.5", (u32::max, i32::max));
    all.push(
        componentwise(
            "-a, i32",
            "§8.7: modulo 2^32",
            &[I32],
            vec![("-a", I32, word(|x| x[0].wrapping_neg()))],
            inputs::integer_cases(1, 82),
        )
        .strict(),
    );
}

fn comparisons(all: &mut Vec<Operation>) {
    type Compare = (fn(&u32, &u32) -> bool, fn(&i32, &i32) -> bool);
    let kinds: [(&str, Compare); 6] = [
        ("a == b", (u32::eq, i32::eq)),
        ("a != b", (u32::ne, i32::ne)),
        ("a < b", (u32::lt, i32::lt)),
        ("a <= b", (u32::le, i32::le)),
        ("a > b", (u32::gt, i32::gt)),
        ("a >= b", (u32::ge, i32::ge)),
    ];
    for (code, (unsigned, signed)) in kinds {
        for (scalar, meaning) in [
            (U32, word(move |x| u32::from(unsigned(&x[0], &x[1])))),
            (
                I32,
                word(move |x| u32::from(signed(&(x[0] as i32), &(x[1] as i32)))),
            ),
        ] {
            all.push(
                componentwise(
                    format!("{code}, {}", scalar.name()),
                    "§8.8: correct result",
                    &[scalar, scalar],
                    vec![(code, Bool, meaning)],
                    inputs::integer_cases(2, 83),
                )
                .strict(),
            );
        }
    }
}

fn functions(all: &mut Vec<Operation>) {
    let mut one = |code: &str, scalar: Scalar, accuracy: &str, value: fn(u32) -> u32| {
        all.push(
            componentwise(
                format!("{code}, {}", scalar.name()),
                accuracy,
                &[scalar],
                vec![(code, scalar, word(move |x| value(x[0])))],
                inputs::integer_cases(1, 84),
            )
            .strict(),
        );
    };
    one(
        "abs(a)",
        I32,
        "§17.5: the most negative number is its own",
        |x| (x as i32).wrapping_abs() as u32,
    );
    one("abs(a)", U32, "§17.5", |x| x);
    one("sign(a)", I32, "§17.5", |x| (x as i32).signum() as u32);
    for (scalar, meaning) in [
        (U32, word(|x| x[0].max(x[1]).min(x[2]))),
        (
            I32,
            word(|x| (x[0] as i32).max(x[1] as i32).min(x[2] as i32) as u32),
        ),
    ] {
        all.push(
            componentwise(
                format!("clamp(a, b, c), {}", scalar.name()),
                "§17.5: min(max(a, b), c)",
                &[scalar; 3],
                vec![("clamp(a, b, c)", scalar, meaning)],
                inputs::integer_cases(3, 85),
            )
            .strict(),
        );
    }
    for scalar in [U32, I32] {
        let mut cases = inputs::integer_cases(2, 86);
        for (index, case) in cases.iter_mut().enumerate() {
            case.push(index as u32 & 1);
        }
        all.push(
            componentwise(
                format!("select(a, b, c), {}", scalar.name()),
                "§17.3: b where c, else a",
                &[scalar, scalar, Bool],
                vec![(
                    "select(a, b, c)",
                    scalar,
                    word(|x| if x[2] == 0 { x[0] } else { x[1] }),
                )],
                cases,
            )
            .strict(),
        );
    }
}

/// Dot products modulo 2^32.
fn dots(all: &mut Vec<Operation>) {
    for scalar in [U32, I32] {
        for n in 2..=4 {
            let product = word(move |x| {
                (0..n).fold(0_u32, |sum, i| {
                    sum.wrapping_add(x[i].wrapping_mul(x[n + i]))
                })
            });
            all.push(
                whole(
                    format!("dot(a, b), vec{n}<{}>", scalar.name()),
                    "§17.5: modulo 2^32",
                    vec![(Shape::Vector(n), scalar); 2],
                    vec![("dot(a, b)", Shape::Scalar, scalar)],
                    inputs::integer_cases(2 * n, 87),
                    rule(vec![scalar; 2 * n], vec![(scalar, product)]),
                )
                .strict(),
            );
        }
    }
}

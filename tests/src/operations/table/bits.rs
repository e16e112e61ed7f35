//! Bits and booleans, all exact (WGSL §8.6, §8.9, §17.5).

use super::super::inputs;
use super::super::operation::{Operation, Scalar, Shape, rule};
use super::{componentwise, whole, word};

use Scalar::{Bool, I32, U32};

/// What is computed from two words.
type Two = fn(u32, u32) -> u32;

/// Adds all of them.
pub(super) fn add(all: &mut Vec<Operation>) {
    logic(all);
    shifts(all);
    counts(all);
    fields(all);
    booleans(all);
}

fn logic(all: &mut Vec<Operation>) {
    let kinds: [(&str, Two); 3] = [
        ("a & b", |a, b| a & b),
        ("a | b", |a, b| a | b),
        ("a ^ b", |a, b| a ^ b),
    ];
    for scalar in [U32, I32] {
        for (code, value) in kinds {
            all.push(
                componentwise(
                    format!("{code}, {}", scalar.name()),
                    "§8.9",
                    &[scalar, scalar],
                    vec![(code, scalar, word(move |x| value(x[0], x[1])))],
                    inputs::integer_cases(2, 91),
                )
                .strict(),
            );
        }
        all.push(
            componentwise(
                format!("~a, {}", scalar.name()),
                "§8.9",
                &[scalar],
                vec![("~a", scalar, word(|x| !x[0]))],
                inputs::integer_cases(1, 92),
            )
            .strict(),
        );
    }
}

fn shifts(all: &mut Vec<Operation>) {
    let accuracy = "§8.9: by b modulo 32";
    for (code, scalar, value) in [
        ("a << b", U32, (|a, b| a << (b & 31)) as Two),
        ("a << b", I32, |a, b| a << (b & 31)),
        ("a >> b", U32, |a, b| a >> (b & 31)),
        ("a >> b", I32, |a, b| (a as i32 >> (b & 31)) as u32),
    ] {
        all.push(
            componentwise(
                format!("{code}, {}", scalar.name()),
                accuracy,
                &[scalar, U32],
                vec![(code, scalar, word(move |x| value(x[0], x[1])))],
                inputs::integer_cases(2, 93),
            )
            .strict(),
        );
    }
}

/// The position of the highest bit that differs from the sign; all ones for none.
fn first_leading(x: u32, signed: bool) -> u32 {
    let x = if signed && x >> 31 == 1 { !x } else { x };
    (0..32)
        .rev()
        .find(|&bit| x >> bit & 1 == 1)
        .unwrap_or(u32::MAX)
}

fn counts(all: &mut Vec<Operation>) {
    let lowest = |x: u32| (0..32).find(|&bit| x >> bit & 1 == 1);
    for scalar in [U32, I32] {
        let mut one = |code: &str, accuracy: &str, meaning| {
            all.push(
                componentwise(
                    format!("{code}, {}", scalar.name()),
                    accuracy,
                    &[scalar],
                    vec![(code, scalar, meaning)],
                    inputs::integer_cases(1, 94),
                )
                .strict(),
            );
        };
        one(
            "countLeadingZeros(a)",
            "§17.5",
            word(|x| match first_leading(x[0], false) {
                u32::MAX => 32,
                bit => 31 - bit,
            }),
        );
        one(
            "countTrailingZeros(a)",
            "§17.5",
            word(move |x| lowest(x[0]).unwrap_or(32)),
        );
        one(
            "countOneBits(a)",
            "§17.5",
            word(|x| (0..32).map(|bit| x[0] >> bit & 1).sum()),
        );
        one(
            "reverseBits(a)",
            "§17.5",
            word(|x| (0..32).fold(0, |sum, bit| sum | (x[0] >> bit & 1) << (31 - bit))),
        );
        one(
            "firstLeadingBit(a)",
            "§17.5",
            word(move |x| first_leading(x[0], scalar == I32)),
        );
        one(
            "firstTrailingBit(a)",
            "§17.5",
            word(move |x| lowest(x[0]).unwrap_or(u32::MAX)),
        );
    }
}

/// The bits `offset` to `offset + count` of 32, both limited.
fn field(offset: u32, count: u32) -> std::ops::Range<u32> {
    let offset = offset.min(32);
    offset..offset + count.min(32 - offset)
}

/// `extractBits` and `insertBits`, whose offset and count are scalars.
fn fields(all: &mut Vec<Operation>) {
    let mut random = inputs::Random::new(95);
    let mut cases = |words: usize| -> Vec<Vec<u32>> {
        inputs::integer_cases(words, 96)
            .into_iter()
            .enumerate()
            .map(|(index, mut case)| {
                // Mostly in the word, sometimes beyond.
                let limit = if index % 4 == 0 { 70 } else { 33 };
                let offset = random.word() % limit;
                let count = random.word() % limit;
                let extreme = [u32::MAX, 0x8000_0000, 32][index % 3];
                case.push(if index % 32 == 0 { extreme } else { offset });
                case.push(if index % 32 == 1 { extreme } else { count });
                case
            })
            .collect()
    };
    for scalar in [U32, I32] {
        let extract = word(move |x| {
            let range = field(x[1], x[2]);
            let mut value = 0;
            for bit in range.clone() {
                value |= (x[0] >> bit & 1) << (bit - range.start);
            }
            let width = range.end - range.start;
            let negative = scalar == I32 && width > 0 && x[0] >> (range.end - 1) & 1 == 1;
            if negative {
                for bit in width..32 {
                    value |= 1 << bit;
                }
            }
            value
        });
        all.push(
            whole(
                format!("extractBits(a, b, c), {}", scalar.name()),
                "§17.5: offset and count limited to the word",
                vec![
                    (Shape::Scalar, scalar),
                    (Shape::Scalar, U32),
                    (Shape::Scalar, U32),
                ],
                vec![("extractBits(a, b, c)", Shape::Scalar, scalar)],
                cases(1),
                rule(vec![scalar, U32, U32], vec![(scalar, extract)]),
            )
            .strict(),
        );
        let insert = word(|x| {
            let range = field(x[2], x[3]);
            (0..32).fold(0, |value, bit| {
                let source = if range.contains(&bit) {
                    x[1] >> (bit - range.start)
                } else {
                    x[0] >> bit
                };
                value | (source & 1) << bit
            })
        });
        all.push(
            whole(
                format!("insertBits(a, b, c, d), {}", scalar.name()),
                "§17.5: offset and count limited to the word",
                vec![
                    (Shape::Scalar, scalar),
                    (Shape::Scalar, scalar),
                    (Shape::Scalar, U32),
                    (Shape::Scalar, U32),
                ],
                vec![("insertBits(a, b, c, d)", Shape::Scalar, scalar)],
                cases(2),
                rule(vec![scalar, scalar, U32, U32], vec![(scalar, insert)]),
            )
            .strict(),
        );
    }
}

/// All combinations of so many booleans, often enough for several workgroups.
fn combinations(count: usize) -> Vec<Vec<u32>> {
    (0..512_u32)
        .map(|index| (0..count).map(|bit| index >> bit & 1).collect())
        .collect()
}

fn booleans(all: &mut Vec<Operation>) {
    all.push(
        componentwise(
            "!a, bool",
            "§8.6",
            &[Bool],
            vec![("!a", Bool, word(|x| 1 - x[0]))],
            combinations(1),
        )
        .strict(),
    );
    let kinds: [(&str, Two); 4] = [
        ("a & b", |a, b| a & b),
        ("a | b", |a, b| a | b),
        ("a == b", |a, b| u32::from(a == b)),
        ("a != b", |a, b| u32::from(a != b)),
    ];
    for (code, value) in kinds {
        all.push(
            componentwise(
                format!("{code}, bool"),
                "§8.6, §8.8",
                &[Bool, Bool],
                vec![(code, Bool, word(move |x| value(x[0], x[1])))],
                combinations(2),
            )
            .strict(),
        );
    }
    // These have no vector form.
    for (code, value) in [("a && b", (|a, b| a & b) as Two), ("a || b", |a, b| a | b)] {
        all.push(
            whole(
                format!("{code}, bool"),
                "§8.6",
                vec![(Shape::Scalar, Bool); 2],
                vec![(code, Shape::Scalar, Bool)],
                combinations(2),
                rule(
                    vec![Bool; 2],
                    vec![(Bool, word(move |x| value(x[0], x[1])))],
                ),
            )
            .strict(),
        );
    }
    for n in 2..=4 {
        for (code, meaning) in [
            ("all(a)", word(|x| u32::from(x.iter().all(|&x| x == 1)))),
            ("any(a)", word(|x| u32::from(x.contains(&1)))),
        ] {
            all.push(
                whole(
                    format!("{code}, vec{n}<bool>"),
                    "§17.3",
                    vec![(Shape::Vector(n), Bool)],
                    vec![(code, Shape::Scalar, Bool)],
                    combinations(n),
                    rule(vec![Bool; n], vec![(Bool, meaning)]),
                )
                .strict(),
            );
        }
    }
    all.push(
        componentwise(
            "select(a, b, c), bool",
            "§17.3: b where c, else a",
            &[Bool; 3],
            vec![(
                "select(a, b, c)",
                Bool,
                word(|x| if x[2] == 0 { x[0] } else { x[1] }),
            )],
            combinations(3),
        )
        .strict(),
    );
}

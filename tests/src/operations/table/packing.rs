//! Packing numbers into words, and unpacking them (WGSL §17.9, §17.10).

use super::super::accuracy::{Arithmetic, Table};
use super::super::exact::Exact;
use super::super::float::FloatType;
use super::super::inputs;
use super::super::interval::Interval;
use super::super::operation::{Meaning, Operation, Scalar, Shape, Words, rule};
use super::convert::halves;
use super::{nearest, whole, word, words};

const F32: FloatType = FloatType::F32;

/// A normalised format: so many fields of so many bits.
#[derive(Clone, Copy)]
struct Normalised {
    name: &'static str,
    bits: u32,
    signed: bool,
}

const NORMALISED: [Normalised; 4] = [
    Normalised {
        name: "4x8snorm",
        bits: 8,
        signed: true,
    },
    Normalised {
        name: "4x8unorm",
        bits: 8,
        signed: false,
    },
    Normalised {
        name: "2x16snorm",
        bits: 16,
        signed: true,
    },
    Normalised {
        name: "2x16unorm",
        bits: 16,
        signed: false,
    },
];

impl Normalised {
    fn scale(self) -> f64 {
        f64::from((1_u32 << (self.bits - u32::from(self.signed))) - 1)
    }

    /// `floor(0.5 + scale * clamp(x))`, where the clamped value is exact and
    /// the intermediate results are correctly rounded.
    fn pack(self, word: u32) -> Words {
        let (low, mask) = (
            if self.signed { -1.0 } else { 0.0 },
            (1_u32 << self.bits) - 1,
        );
        let value = F32.decode(word);
        let clamped = if value.is_nan() {
            low
        } else {
            value.clamp(low, 1.0)
        };
        let product = F32.nearest(Exact::new(clamped) * Exact::new(self.scale()));
        let sum = F32.nearest(Exact::new(product) + Exact::new(0.5));
        let own = sum.floor() as i64 as u32 & mask;
        if !value.is_finite() {
            return Words::open(own);
        }
        let table = Table(F32);
        let product = table.mul(Interval::point(clamped), Interval::point(self.scale()));
        let sum = table.add(product, Interval::point(0.5));
        let allowed = (sum.low.floor() as i64..=sum.high.floor() as i64)
            .map(|field| field as u32 & mask)
            .collect();
        Words {
            allowed: Some(allowed),
            own: Some(own),
        }
    }

    /// `max(field / scale, -1)`.
    fn unpack(self, field: usize) -> Meaning {
        let exact = move |word: f64| {
            let up = 32 - self.bits * (field as u32 + 1);
            let high = (word as u32) << up;
            let value = if self.signed {
                f64::from(high as i32 >> (32 - self.bits))
            } else {
                f64::from(high >> (32 - self.bits))
            };
            Exact::new(value.max(-self.scale())) / Exact::new(self.scale())
        };
        nearest(
            F32,
            move |table, x| {
                let exact = exact(x[0].low);
                table.ulps(exact, exact, 3.0)
            },
            move |x| exact(x[0].head()),
            |_| 0.0,
        )
    }
}

/// Adds all of them.
pub(super) fn add(all: &mut Vec<Operation>) {
    for format in NORMALISED {
        normalised(all, format);
    }
    floats(all);
    integers(all);
}

/// WGSL of each field of the packed word.
fn fields(function: &str, bits: u32) -> Vec<String> {
    let mask = (1_u32 << bits) - 1;
    (0..32 / bits)
        .map(|field| format!("({function}(a) >> {}u) & {mask}u", field * bits))
        .collect()
}

fn outputs(codes: &[String]) -> Vec<(&str, Shape, Scalar)> {
    codes
        .iter()
        .map(|code| (code.as_str(), Shape::Scalar, Scalar::U32))
        .collect()
}

fn normalised(all: &mut Vec<Operation>, format: Normalised) {
    let count = (32 / format.bits) as usize;
    let function = format!("pack{}", format.name);
    let codes = fields(&function, format.bits);
    // Values near the middle between two fields decide about rounding.
    let mut random = inputs::Random::new(71);
    let near = |random: &mut inputs::Random| {
        let field = (random.word() % (2 << format.bits)) as f64 / 2.0 - format.scale();
        F32.encode(F32.below(Exact::new(field / format.scale()))) + random.word() % 3
    };
    let mut cases = inputs::several(F32, count, 72);
    cases.extend((0..3000).map(|_| (0..count).map(|_| near(&mut random)).collect()));
    let meanings = (0..count)
        .map(|field| (Scalar::U32, words(move |x: &[u32]| format.pack(x[field]))))
        .collect();
    all.push(whole(
        format!("{function}(a)"),
        "§15.7.4.1: correctly rounded intermediate value, correct result",
        vec![(Shape::Vector(count), Scalar::F32)],
        outputs(&codes),
        cases,
        rule(vec![Scalar::F32; count], meanings),
    ));
    let function = format!("unpack{}", format.name);
    let meanings = (0..count)
        .map(|field| (Scalar::F32, format.unpack(field)))
        .collect();
    all.push(whole(
        format!("{function}(a)"),
        "§15.7.4.1: 3 ULP",
        vec![(Shape::Scalar, Scalar::U32)],
        vec![(&format!("{function}(a)"), Shape::Vector(count), Scalar::F32)],
        words_of_fields(format.bits),
        rule(vec![Scalar::U32], meanings),
    ));
}

/// Words whose fields have every value of a byte, and many of a half.
fn words_of_fields(bits: u32) -> Vec<Vec<u32>> {
    let mut cases = inputs::integer_cases(1, 73);
    cases.extend(
        (0..0x1_0000_u32)
            .step_by(if bits == 8 { 257 } else { 29 })
            .map(|low| {
                let high = low.wrapping_mul(0x9e3) & 0xffff;
                vec![low | high << 16]
            }),
    );
    cases
}

fn floats(all: &mut Vec<Operation>) {
    let f16 = FloatType::F16;
    let in_range = move |word: u32| F32.decode(word).abs() <= f16.largest();
    let pack = move |words: &[u32], field: usize| {
        let value = F32.decode(words[field]);
        if value.is_nan() {
            return Words::ANYTHING;
        }
        let own = f16.encode(f16.nearest(Exact::new(value)));
        // A number out of range makes the whole word indeterminate.
        if !words.iter().all(|&word| in_range(word)) {
            return Words::open(own);
        }
        Words {
            allowed: Some(
                halves(value)
                    .into_iter()
                    .map(|half| f16.encode(half))
                    .collect(),
            ),
            own: Some(own),
        }
    };
    let mut random = inputs::Random::new(74);
    let mut cases = inputs::several(F32, 2, 75);
    cases.extend((0..3000).map(|_| {
        let mut near = || {
            let low = f16.decode(random.word() & 0x7bff);
            (F32.encode(low + f16.ulp(low) * 0.5) + random.word() % 3).wrapping_sub(1)
        };
        vec![near(), near()]
    }));
    let codes = fields("pack2x16float", 16);
    all.push(whole(
        "pack2x16float(a)",
        "§15.7.4.1: correctly rounded intermediate value, correct result; a number out of range leaves the word open",
        vec![(Shape::Vector(2), Scalar::F32)],
        outputs(&codes),
        cases,
        rule(
            vec![Scalar::F32; 2],
            (0..2)
                .map(|field| (Scalar::U32, words(move |x: &[u32]| pack(x, field))))
                .collect(),
        ),
    ));
    let unpack = move |half: u32| {
        let value = f16.decode(half);
        let own = F32.encode(value);
        if !value.is_finite() {
            Words::open(own)
        } else if f16.is_subnormal(value) {
            Words {
                allowed: Some(vec![own, 0, 0x8000_0000]),
                own: Some(own),
            }
        } else {
            Words::exactly(own)
        }
    };
    all.push(whole(
        "unpack2x16float(a)",
        "§15.7.4.1: correctly rounded; §15.7.2: subnormal intermediate values may be flushed",
        vec![(Shape::Scalar, Scalar::U32)],
        vec![("unpack2x16float(a)", Shape::Vector(2), Scalar::F32)],
        words_of_fields(16),
        rule(
            vec![Scalar::U32],
            (0..2)
                .map(|field| {
                    let meaning = words(move |x: &[u32]| unpack(x[0] >> (16 * field) & 0xffff));
                    (Scalar::F32, meaning)
                })
                .collect(),
        ),
    ));
}

fn byte(word: u32, field: u32) -> u32 {
    word >> (8 * field) & 0xff
}

fn signed_byte(word: u32, field: u32) -> i32 {
    i32::from(byte(word, field) as u8 as i8)
}

/// Functions on four bytes in a word, all exact.
fn integers(all: &mut Vec<Operation>) {
    use Scalar::{I32, U32};
    let join = |x: &[u32], of: fn(u32) -> u32| -> u32 {
        (0..4).fold(0, |word, field| word | (of(x[field]) & 0xff) << (8 * field))
    };
    let clamped = |x: u32| (x as i32).clamp(-128, 127) as u32;
    let exact = "§17.9: exact";
    for (code, scalar, of) in [
        ("pack4xI8(a)", I32, (|x| x) as fn(u32) -> u32),
        ("pack4xU8(a)", U32, |x| x),
        ("pack4xI8Clamp(a)", I32, clamped),
        ("pack4xU8Clamp(a)", U32, |x| x.min(255)),
    ] {
        all.push(
            whole(
                code,
                exact,
                vec![(Shape::Vector(4), scalar)],
                vec![(code, Shape::Scalar, U32)],
                inputs::integer_cases(4, 76),
                rule(vec![scalar; 4], vec![(U32, word(move |x| join(x, of)))]),
            )
            .strict(),
        );
    }
    for (code, scalar, of) in [
        (
            "unpack4xI8(a)",
            I32,
            (|w, field| signed_byte(w, field) as u32) as fn(u32, u32) -> u32,
        ),
        ("unpack4xU8(a)", U32, byte),
    ] {
        all.push(
            whole(
                code,
                "§17.10: exact",
                vec![(Shape::Scalar, U32)],
                vec![(code, Shape::Vector(4), scalar)],
                words_of_fields(8),
                rule(
                    vec![U32],
                    (0..4)
                        .map(|field| (scalar, word(move |x: &[u32]| of(x[0], field))))
                        .collect(),
                ),
            )
            .strict(),
        );
    }
    let unsigned = |x: &[u32]| {
        (0..4)
            .map(|field| byte(x[0], field) * byte(x[1], field))
            .sum()
    };
    let signed = |x: &[u32]| {
        let product = |field| signed_byte(x[0], field) * signed_byte(x[1], field);
        (0..4).map(product).sum::<i32>() as u32
    };
    for (code, scalar, meaning) in [
        ("dot4U8Packed(a, b)", U32, word(unsigned)),
        ("dot4I8Packed(a, b)", I32, word(signed)),
    ] {
        all.push(
            whole(
                code,
                "§17.5: exact",
                vec![(Shape::Scalar, U32), (Shape::Scalar, U32)],
                vec![(code, Shape::Scalar, scalar)],
                inputs::integer_cases(2, 77),
                rule(vec![U32; 2], vec![(scalar, meaning)]),
            )
            .strict(),
        );
    }
}

//! Conversions between numbers, and of their bits.

use super::super::exact::Exact;
use super::super::float::FloatType;
use super::super::inputs;
use super::super::operation::{Operation, Scalar, Words};
use super::{componentwise, rounded, word, words};

const F32: FloatType = FloatType::F32;

/// Adds all of them.
pub(super) fn add(all: &mut Vec<Operation>) {
    from_floats(all);
    from_integers(all);
    bits(all);
    half(all);
}

/// "The value in T closest to truncate(X) and also exactly representable in
/// the original floating point type."
fn truncated(x: f64, low: f64, high: f64) -> f64 {
    if x.is_nan() {
        0.0
    } else {
        x.trunc().clamp(low, high)
    }
}

fn from_floats(all: &mut Vec<Operation>) {
    let to_integer = |low: f64, high: f64| {
        words(move |x| {
            let value = F32.decode(x[0]);
            let own = truncated(value, low, high) as i64 as u32;
            if value.is_finite() {
                Words::exactly(own)
            } else {
                Words::open(own)
            }
        })
    };
    let accuracy = "§15.7.6: truncated, then the nearest value that both types have";
    for (code, scalar, meaning) in [
        (
            "$i32(a)",
            Scalar::I32,
            to_integer(-2_147_483_648.0, 2_147_483_520.0),
        ),
        ("$u32(a)", Scalar::U32, to_integer(0.0, 4_294_967_040.0)),
    ] {
        all.push(
            componentwise(
                format!("{}(a), f32", scalar.name()),
                accuracy,
                &[Scalar::F32],
                vec![(code, scalar, meaning)],
                inputs::one(F32, (-4e9, 8e9), 61),
            )
            .strict(),
        );
    }
    let to_bool = words(|x| {
        let value = F32.decode(x[0]);
        let own = u32::from(value != 0.0);
        if value.is_finite() {
            Words::exactly(own)
        } else {
            Words::open(own)
        }
    });
    all.push(
        componentwise(
            "bool(a), f32",
            "§17.1.2.3: false for zero",
            &[Scalar::F32],
            vec![("$bool(a)", Scalar::Bool, to_bool)],
            inputs::one(F32, (-1.0, 1.0), 62),
        )
        .strict(),
    );
}

fn from_integers(all: &mut Vec<Operation>) {
    use Scalar::{Bool, F32 as Float, I32, U32};
    let number = || rounded(F32, |x: &[Exact]| x[0], |x: &[f32]| x[0]);
    let accuracy = "§15.7.6: exact or one of the neighbours";
    for from in [I32, U32] {
        all.push(
            componentwise(
                format!("f32(a), {}", from.name()),
                accuracy,
                &[from],
                vec![("$f32(a)", Float, number())],
                inputs::integer_cases(1, 63),
            )
            .strict(),
        );
        all.push(
            componentwise(
                format!("bool(a), {}", from.name()),
                "§17.1.2.3: false for zero",
                &[from],
                vec![("$bool(a)", Bool, word(|x| u32::from(x[0] != 0)))],
                inputs::integer_cases(1, 64),
            )
            .strict(),
        );
    }
    let exact = "§17.1.2: reinterpretation of bits";
    for (from, to, code) in [(I32, U32, "$u32(a)"), (U32, I32, "$i32(a)")] {
        all.push(
            componentwise(
                format!("{}(a), {}", to.name(), from.name()),
                exact,
                &[from],
                vec![(code, to, word(|x| x[0]))],
                inputs::integer_cases(1, 65),
            )
            .strict(),
        );
    }
    let booleans: Vec<Vec<u32>> = (0..256_u32).map(|i| vec![((i * 37) >> 3) & 1]).collect();
    for (to, code, one) in [
        (Float, "$f32(a)", 1.0_f32.to_bits()),
        (I32, "$i32(a)", 1),
        (U32, "$u32(a)", 1),
    ] {
        all.push(
            componentwise(
                format!("{}(a), bool", to.name()),
                "§17.1.2: one for true, zero for false",
                &[Bool],
                vec![(code, to, word(move |x| x[0] * one))],
                booleans.clone(),
            )
            .strict(),
        );
    }
}

/// Bit casts.
fn bits(all: &mut Vec<Operation>) {
    use Scalar::{F32 as Float, I32, U32};
    let accuracy = "§17.2.1: the same bits; §15.7.2: subnormal numbers may be flushed";
    let float_cases = || inputs::one(F32, (-1.0, 1.0), 66);
    for (to, code) in [(I32, "bitcast<$i32>(a)"), (U32, "bitcast<$u32>(a)")] {
        let same = words(|x| {
            if F32.decode(x[0]).is_finite() {
                Words::exactly(x[0])
            } else {
                Words::open(x[0])
            }
        });
        all.push(
            componentwise(
                format!("bitcast<{}>(a), f32", to.name()),
                accuracy,
                &[Float],
                vec![(code, to, same)],
                float_cases(),
            )
            .strict(),
        );
    }
    for from in [I32, U32] {
        let same = words(|x| {
            let value = F32.decode(x[0]);
            if F32.is_subnormal(value) {
                Words {
                    allowed: Some(vec![x[0], 0, 0x8000_0000]),
                    own: Some(x[0]),
                }
            } else if value.is_finite() {
                Words::exactly(x[0])
            } else {
                Words::open(x[0])
            }
        });
        all.push(
            componentwise(
                format!("bitcast<f32>(a), {}", from.name()),
                accuracy,
                &[from],
                vec![("bitcast<$f32>(a)", Float, same)],
                float_cases(),
            )
            .strict(),
        );
    }
    for (from, to, code) in [
        (I32, U32, "bitcast<$u32>(a)"),
        (U32, I32, "bitcast<$i32>(a)"),
    ] {
        all.push(
            componentwise(
                format!("bitcast<{}>(a), {}", to.name(), from.name()),
                "§17.2.1: the same bits",
                &[from],
                vec![(code, to, word(|x| x[0]))],
                inputs::integer_cases(1, 67),
            )
            .strict(),
        );
    }
}

/// The binary16 numbers that WGSL allows for an `f32`, which has to be in
/// their range; a subnormal one may be flushed.
pub(super) fn halves(value: f64) -> Vec<f64> {
    let f16 = FloatType::F16;
    let exact = Exact::new(value);
    let mut all = vec![f16.below(exact), f16.above(exact)];
    if all.iter().any(|&half| f16.is_subnormal(half)) {
        all.extend([0.0, -0.0]);
    }
    all
}

fn half(all: &mut Vec<Operation>) {
    let f16 = FloatType::F16;
    let quantized = words(move |x| {
        let value = F32.decode(x[0]);
        let own = if value.is_finite() {
            F32.encode(f16.nearest(Exact::new(value)))
        } else {
            x[0]
        };
        if value.is_finite() && value.abs() <= f16.largest() {
            let allowed = halves(value)
                .into_iter()
                .map(|half| F32.encode(half))
                .collect();
            Words {
                allowed: Some(allowed),
                own: Some(own),
            }
        } else {
            Words::open(own)
        }
    });
    let mut cases = inputs::one(F32, (-2.0, 2.0), 68);
    // Every binary16 exponent, and around the middle between neighbours.
    let mut random = inputs::Random::new(69);
    for _ in 0..3000 {
        let low = f16.decode(random.word() & 0x7bff);
        let middle = F32.encode(low + f16.ulp(low) * 0.5);
        cases.push(vec![(middle + random.word() % 3).wrapping_sub(1)]);
    }
    all.push(componentwise(
        "quantizeToF16(a), f32",
        "§15.7.4.1: correctly rounded; subnormal f16 may be flushed, out of range is open",
        &[Scalar::F32],
        vec![("quantizeToF16(a)", Scalar::F32, quantized)],
        cases,
    ));
}

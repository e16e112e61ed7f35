//! Conversions between numbers, and of their bits.

use super::super::exact::Exact;
use super::super::float::FloatType;
use super::super::inputs;
use super::super::operation::{Operation, Scalar, Words};
use super::{componentwise, rounded, word, words};

const F32: FloatType = FloatType::F32;

/// Adds all of them.
pub(super) fn add(all: &mut Vec<Operation>) {
    from_floats(all, F32);
    from_floats(all, FloatType::F16);
    between_floats(all);
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

fn from_floats(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let to_integer = |low: f64, high: f64| {
        words(move |x| {
            let value = ty.decode(x[0]);
            let own = truncated(value, low, high) as i64 as u32;
            if value.is_finite() {
                Words::exactly(own)
            } else {
                Words::open(own)
            }
        })
    };
    let accuracy = "§15.7.6: truncated, then the nearest value that both types have";
    let (low, high, unsigned_high) = match ty {
        FloatType::F32 => (-2_147_483_648.0, 2_147_483_520.0, 4_294_967_040.0),
        FloatType::F16 => (-ty.largest(), ty.largest(), ty.largest()),
    };
    for (code, scalar, meaning) in [
        ("$i32(a)", Scalar::I32, to_integer(low, high)),
        ("$u32(a)", Scalar::U32, to_integer(0.0, unsigned_high)),
    ] {
        all.push(
            componentwise(
                format!("{}(a), {}", scalar.name(), s.name()),
                accuracy,
                &[s],
                vec![(code, scalar, meaning)],
                inputs::one(ty, (-4e9, 8e9), 61),
            )
            .strict(),
        );
    }
    let to_bool = words(move |x| {
        let value = ty.decode(x[0]);
        let own = u32::from(value != 0.0);
        if value.is_finite() {
            Words::exactly(own)
        } else {
            Words::open(own)
        }
    });
    all.push(
        componentwise(
            format!("bool(a), {}", s.name()),
            "§17.1.2.3: false for zero",
            &[s],
            vec![("$bool(a)", Scalar::Bool, to_bool)],
            inputs::one(ty, (-1.0, 1.0), 62),
        )
        .strict(),
    );
}

/// Between the two floating-point types.
fn between_floats(all: &mut Vec<Operation>) {
    use Scalar::{F16, F32 as Float};
    let accuracy = "§15.7.6: exact or one of the neighbours; what is out of range is open";
    all.push(
        componentwise(
            "f16(a), f32",
            accuracy,
            &[Float],
            vec![("$f16(a)", F16, rounded(FloatType::F16, |x| x[0], |x| x[0]))],
            around_halves(69),
        )
        .strict(),
    );
    all.push(
        componentwise(
            "f32(a), f16",
            accuracy,
            &[F16],
            vec![("$f32(a)", Float, rounded(F32, |x| x[0], |x| x[0]))],
            (0..=0xffff).map(|half| vec![half]).collect(),
        )
        .strict(),
    );
}

fn from_integers(all: &mut Vec<Operation>) {
    use Scalar::{Bool, F16, F32 as Float, I32, U32};
    let accuracy = "§15.7.6: exact or one of the neighbours; what is out of range is open";
    for from in [I32, U32] {
        for (to, code, ty) in [(Float, "$f32(a)", F32), (F16, "$f16(a)", FloatType::F16)] {
            let number = rounded(ty, |x: &[Exact]| x[0], |x: &[f32]| x[0]);
            all.push(
                componentwise(
                    format!("{}(a), {}", to.name(), from.name()),
                    accuracy,
                    &[from],
                    vec![(code, to, number)],
                    inputs::integer_cases(1, 63),
                )
                .strict(),
            );
        }
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
        (F16, "$f16(a)", 0x3c00),
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

/// Cases of an `f32` that becomes an `f16`: every exponent of those, and around
/// the middle between neighbours.
fn around_halves(seed: u64) -> Vec<Vec<u32>> {
    let f16 = FloatType::F16;
    let mut cases = inputs::one(F32, (-2.0, 2.0), 68);
    let mut random = inputs::Random::new(seed);
    for _ in 0..3000 {
        let low = f16.decode(random.word() & 0x7bff);
        let middle = F32.encode(low + f16.ulp(low) * 0.5);
        cases.push(vec![(middle + random.word() % 3).wrapping_sub(1)]);
    }
    cases
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
    all.push(componentwise(
        "quantizeToF16(a), f32",
        "§15.7.4.1: correctly rounded; subnormal f16 may be flushed, out of range is open",
        &[Scalar::F32],
        vec![("quantizeToF16(a)", Scalar::F32, quantized)],
        around_halves(69),
    ));
}

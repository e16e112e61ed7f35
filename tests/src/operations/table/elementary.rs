//! Exponential, logarithmic, circular and hyperbolic functions.

use super::super::accuracy::{Arithmetic, Table};
use super::super::exact::Exact;
use super::super::float::FloatType;
use super::super::interval::Interval;
use super::super::operation::{Operation, Scalar};
use super::super::{formulas, inputs};
use super::{componentwise, inexact};

/// The interpreter computes these in `f64` and rounds once; what it computes
/// is off by less than 1e-11 relative, which is 2^-12.6 ULP of `f32`.
const ROUNDED_ONCE: f64 = 0.5 + 1.0 / 4096.0;

/// Adds all of them for a type.
pub(super) fn add(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let mut one = |code: &str,
                   accuracy: &str,
                   range: (f64, f64),
                   table: fn(Table, Interval) -> Interval,
                   exact: fn(Exact) -> Exact| {
        let meaning = inexact(ty, move |t, x| table(t, x[0]), move |x| exact(x[0]));
        all.push(
            componentwise(
                format!("{code}, {}", s.name()),
                &format!("§15.7.4.1: {accuracy}"),
                &[s],
                vec![(code, s, meaning)],
                inputs::one(ty, range, 31),
            )
            .within(ROUNDED_ONCE),
        );
    };
    let pi = std::f64::consts::PI;
    one(
        "exp(a)",
        "3 + 2 * |a| ULP, in f16 1 + 2 * |a|",
        (-90.0, 90.0),
        |t, x| t.exp(x),
        Exact::exp,
    );
    one(
        "exp2(a)",
        "3 + 2 * |a| ULP, in f16 1 + 2 * |a|",
        (-128.0, 128.0),
        |t, x| t.exp2(x),
        Exact::exp2,
    );
    let logarithm = "absolute error 2^-21 in [0.5, 2.0], in f16 2^-7; 3 ULP outside";
    one("log(a)", logarithm, (0.25, 4.0), |t, x| t.log(x), Exact::ln);
    one(
        "log2(a)",
        logarithm,
        (0.25, 4.0),
        |t, x| t.log2(x),
        Exact::log2,
    );
    let circular = "absolute error 2^-11 in [-π, π], in f16 2^-7";
    one("sin(a)", circular, (-pi, pi), |t, x| t.sin(x), Exact::sin);
    one("cos(a)", circular, (-pi, pi), |t, x| t.cos(x), Exact::cos);
    one(
        "tan(a)",
        "inherited from sin(a) / cos(a)",
        (-pi, pi),
        |t, x| formulas::tan(&t, x),
        Exact::tan,
    );
    one(
        "asin(a)",
        "the worse of absolute error 6.81e-5, in f16 3.91e-3, and inherited from atan2(a, sqrt(1.0 - a * a))",
        (-1.0, 1.0),
        |t, x| {
            worse(
                t,
                x,
                Exact::asin,
                t.of(6.81e-5, 3.91e-3),
                formulas::asin(&t, x),
            )
        },
        Exact::asin,
    );
    one(
        "acos(a)",
        "the worse of absolute error 6.77e-5, in f16 3.91e-3, and inherited from atan2(sqrt(1.0 - a * a), a)",
        (-1.0, 1.0),
        |t, x| {
            worse(
                t,
                x,
                Exact::acos,
                t.of(6.77e-5, 3.91e-3),
                formulas::acos(&t, x),
            )
        },
        Exact::acos,
    );
    one(
        "atan(a)",
        "4096 ULP, in f16 5",
        (-8.0, 8.0),
        Table::atan,
        Exact::atan,
    );
    one(
        "sinh(a)",
        "inherited from (exp(a) - exp(-a)) * 0.5",
        (-8.0, 8.0),
        |t, x| formulas::sinh(&t, x),
        Exact::sinh,
    );
    one(
        "cosh(a)",
        "inherited from (exp(a) + exp(-a)) * 0.5",
        (-8.0, 8.0),
        |t, x| formulas::cosh(&t, x),
        Exact::cosh,
    );
    one(
        "tanh(a)",
        "the worse of absolute error 1.0e-5 and inherited from sinh(a) / cosh(a)",
        (-8.0, 8.0),
        |t, x| worse(t, x, Exact::tanh, 1.0e-5, formulas::tanh(&t, x)),
        Exact::tanh,
    );
    one(
        "asinh(a)",
        "inherited from log(a + sqrt(a * a + 1.0))",
        (-8.0, 8.0),
        |t, x| formulas::asinh(&t, x),
        Exact::asinh,
    );
    one(
        "acosh(a)",
        "inherited from log(a + sqrt(a * a - 1.0))",
        (1.0, 8.0),
        |t, x| formulas::acosh(&t, x),
        Exact::acosh,
    );
    one(
        "atanh(a)",
        "inherited from log((1.0 + a) / (1.0 - a)) * 0.5",
        (-1.0, 1.0),
        |t, x| formulas::atanh(&t, x),
        Exact::atanh,
    );

    let pow = inexact(
        ty,
        |t, x| formulas::pow(&t, x[0], x[1]),
        |x| (x[1] * x[0].log2()).exp2(),
    );
    let atan2 = inexact(ty, |t, x| t.atan2(x[0], x[1]), |x| x[0].atan2(x[1]));
    for (code, accuracy, meaning) in [
        (
            "pow(a, b)",
            "§15.7.4.1: inherited from exp2(b * log2(a))",
            pow,
        ),
        (
            "atan2(a, b)",
            "§15.7.4.1: 4096 ULP, in f16 5, for |b| in [2^-126, 2^126] and normal a",
            atan2,
        ),
    ] {
        all.push(
            componentwise(
                format!("{code}, {}", s.name()),
                accuracy,
                &[s, s],
                vec![(code, s, meaning)],
                inputs::several(ty, 2, 32),
            )
            .within(ROUNDED_ONCE),
        );
    }
}

/// "The worse of" an absolute error and an inherited one.
fn worse(
    table: Table,
    x: Interval,
    exact: fn(Exact) -> Exact,
    error: f64,
    inherited: Interval,
) -> Interval {
    let value = exact(Exact::new(x.low));
    if x.is_any() || !value.is_finite() {
        return Interval::ANY;
    }
    table.absolute(value, value, error).hull(inherited)
}

//! Functions of whole vectors.

use super::super::accuracy::{Reals, Table};
use super::super::exact::Exact;
use super::super::float::FloatType;
use super::super::interval::Interval;
use super::super::operation::{Allowed, Expectation, Operation, Rule, Scalar, Shape};
use super::super::{formulas, inputs};
use super::whole;

/// Adds all of them for a type.
pub(super) fn add(all: &mut Vec<Operation>, ty: FloatType) {
    reductions(all, ty);
    directions(all, ty);
}

/// Functions whose results all follow from the same formula.
pub(super) fn inherited(
    ty: FloatType,
    table: impl Fn(Table, &[Interval]) -> Vec<Interval> + Send + Sync + 'static,
    exact: impl Fn(&[Exact]) -> Vec<Exact> + Send + Sync + 'static,
) -> Rule {
    Box::new(move |case| {
        let values: Vec<f64> = case.iter().map(|&word| ty.decode(word)).collect();
        let finite = values.iter().all(|value| value.is_finite());
        // A subnormal number is itself or zero.
        let may_be: Vec<Interval> = values
            .iter()
            .map(|&value| {
                let point = Interval::point(value);
                if ty.is_subnormal(value) {
                    point.hull(Interval::point(0.0))
                } else {
                    point
                }
            })
            .collect();
        let exact = exact(
            &values
                .iter()
                .map(|&value| Exact::new(value))
                .collect::<Vec<_>>(),
        );
        let measurable = finite && !values.iter().any(|&value| ty.is_subnormal(value));
        table(Table(ty), &may_be)
            .into_iter()
            .zip(exact)
            .map(|(interval, exact)| {
                let exact = exact.head();
                let is_normal = exact.abs() >= ty.smallest_normal() && exact.abs() <= ty.largest();
                Expectation {
                    allowed: if interval.is_any() || !finite {
                        Allowed::Anything
                    } else {
                        Allowed::Numbers(vec![interval])
                    },
                    bits: None,
                    flushed: Vec::new(),
                    exact: (measurable && is_normal).then_some(exact),
                    special: !finite,
                }
            })
            .collect()
    })
}

/// `dot`, `length`, `distance`.
fn reductions(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    for n in 2..=4 {
        let vector = Shape::Vector(n);
        all.push(whole(
            format!("dot(a, b), vec{n}<{}>", s.name()),
            "§15.7.4.1: inherited from the sum of a[i] * b[i], in any order (§15.7.5)",
            vec![(vector, s), (vector, s)],
            vec![("dot(a, b)", Shape::Scalar, s)],
            inputs::several(ty, 2 * n, 41),
            inherited(
                ty,
                move |t, x| vec![formulas::dot(&t, &x[..n], &x[n..])],
                move |x| vec![formulas::dot(&Reals, &x[..n], &x[n..])],
            ),
        ));
    }
    for n in 1..=4 {
        let shape = if n == 1 {
            Shape::Scalar
        } else {
            Shape::Vector(n)
        };
        all.push(whole(
            format!("length(a), {}", shape.of(s)),
            "§15.7.4.1: inherited from sqrt(dot(a, a)), of a scalar from sqrt(a * a)",
            vec![(shape, s)],
            vec![("length(a)", Shape::Scalar, s)],
            inputs::several(ty, n, 42),
            inherited(
                ty,
                |t, x| vec![formulas::length(&t, x)],
                |x| vec![formulas::length(&Reals, x)],
            ),
        ));
        all.push(whole(
            format!("distance(a, b), {}", shape.of(s)),
            "§15.7.4.1: inherited from length(a - b)",
            vec![(shape, s), (shape, s)],
            vec![("distance(a, b)", Shape::Scalar, s)],
            inputs::several(ty, 2 * n, 43),
            inherited(
                ty,
                move |t, x| vec![formulas::distance(&t, &x[..n], &x[n..])],
                move |x| vec![formulas::distance(&Reals, &x[..n], &x[n..])],
            ),
        ));
    }
}

/// Functions with vectors as results.
fn directions(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let cross = |code, accuracy, rule| {
        whole(
            format!("{code}, vec3<{}>", s.name()),
            accuracy,
            vec![(Shape::Vector(3), s), (Shape::Vector(3), s)],
            vec![(code, Shape::Vector(3), s)],
            inputs::several(ty, 6, 44),
            rule,
        )
    };
    all.push(cross(
        "cross(a, b)",
        "§15.7.4.1: inherited from a[i] * b[j] - a[j] * b[i]",
        inherited(
            ty,
            |t, x| formulas::cross(&t, &x[..3], &x[3..]),
            |x| formulas::cross(&Reals, &x[..3], &x[3..]),
        ),
    ));
    for n in 2..=4 {
        let vector = Shape::Vector(n);
        let mut add = |code: &str, accuracy: &str, parameters: usize, eta: bool, rule: Rule| {
            let mut shapes = vec![(vector, s); parameters];
            if eta {
                shapes.push((Shape::Scalar, s));
            }
            let count = shapes.iter().map(|(shape, _)| shape.count()).sum();
            all.push(whole(
                format!("{code}, vec{n}<{}>", s.name()),
                accuracy,
                shapes,
                vec![(code, vector, s)],
                inputs::several(ty, count, 45),
                rule,
            ));
        };
        add(
            "normalize(a)",
            "§15.7.4.1: inherited from a / length(a)",
            1,
            false,
            inherited(
                ty,
                |t, x| formulas::normalize(&t, x),
                |x| formulas::normalize(&Reals, x),
            ),
        );
        add(
            "faceForward(a, b, c)",
            "§15.7.4.1: inherited from select(-a, a, dot(c, b) < 0.0)",
            3,
            false,
            inherited(
                ty,
                move |t, x| formulas::face_forward(&t, &x[..n], &x[n..2 * n], &x[2 * n..]),
                move |x| formulas::face_forward(&Reals, &x[..n], &x[n..2 * n], &x[2 * n..]),
            ),
        );
        add(
            "reflect(a, b)",
            "§15.7.4.1: inherited from a - 2.0 * dot(a, b) * b",
            2,
            false,
            inherited(
                ty,
                move |t, x| formulas::reflect(&t, &x[..n], &x[n..]),
                move |x| formulas::reflect(&Reals, &x[..n], &x[n..]),
            ),
        );
        add(
            "refract(a, b, c)",
            "§15.7.4.1: inherited from c * a - (c * dot(b, a) + sqrt(k)) * b with k = 1.0 - c * c * (1.0 - dot(b, a) * dot(b, a))",
            2,
            true,
            inherited(
                ty,
                move |t, x| formulas::refract(&t, &x[..n], &x[n..2 * n], x[2 * n]),
                move |x| formulas::refract(&Reals, &x[..n], &x[n..2 * n], x[2 * n]),
            ),
        );
    }
}

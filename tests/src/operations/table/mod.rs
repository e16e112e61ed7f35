//! The operations: for each what it is called, where WGSL says how accurate it
//! is, its kernel, its inputs, and what its results may be.

mod bits;
mod convert;
mod elementary;
mod float;
mod integer;
mod matrix;
mod packing;
mod vector;

use super::accuracy::Table;
use super::exact::Exact;
use super::float::FloatType;
use super::interval::Interval;
use super::operation::{Float, Form, Meaning, Operation, Output, Rule, Scalar, Shape, Words, rule};

/// Every operation on numbers and booleans.
#[must_use]
pub fn all() -> Vec<Operation> {
    let mut all = Vec::new();
    for ty in [FloatType::F32, FloatType::F16] {
        float::add(&mut all, ty);
        elementary::add(&mut all, ty);
        vector::add(&mut all, ty);
        matrix::add(&mut all, ty);
    }
    convert::add(&mut all);
    packing::add(&mut all);
    integer::add(&mut all);
    bits::add(&mut all);
    all
}

/// A componentwise operation, to which strictness and promises may be added.
fn componentwise(
    name: impl Into<String>,
    accuracy: &str,
    parameters: &[Scalar],
    outputs: Vec<(&str, Scalar, Meaning)>,
    cases: Vec<Vec<u32>>,
) -> Operation {
    let (mut described, mut meanings) = (Vec::new(), Vec::new());
    for (code, scalar, meaning) in outputs {
        described.push(Output {
            code: code.to_owned(),
            shape: Shape::Scalar,
            scalar,
        });
        meanings.push((scalar, meaning));
    }
    Operation {
        name: name.into(),
        accuracy: accuracy.to_owned(),
        parameters: parameters
            .iter()
            .map(|&scalar| (Shape::Scalar, scalar))
            .collect(),
        outputs: described,
        form: Form::Componentwise,
        strict: false,
        own_ulps: None,
        cases,
        rule: rule(parameters.to_vec(), meanings),
    }
}

impl Operation {
    /// One that strict kernels may have.
    fn strict(self) -> Self {
        Self {
            strict: true,
            ..self
        }
    }

    /// One that the interpreter computes within so many ULP.
    fn within(self, ulps: f64) -> Self {
        Self {
            own_ulps: Some(ulps),
            ..self
        }
    }
}

/// A result that is the exact one, rounded to either neighbour by WGSL and to
/// the nearest by the interpreter.
fn rounded(
    ty: FloatType,
    exact: impl Fn(&[Exact]) -> Exact + Send + Sync + Copy + 'static,
    ieee: impl Fn(&[f32]) -> f32 + Send + Sync + 'static,
) -> Meaning {
    let table = move |table: Table, x: &[f64]| {
        let exact = exact(&reals(x));
        vec![table.rounded(exact, exact)]
    };
    Meaning::Float(Float {
        ty,
        table: Box::new(table),
        exact: Box::new(exact),
        ieee: Some(Box::new(ieee)),
    })
}

/// A result that the table allows an error.
fn inexact(
    ty: FloatType,
    table: impl Fn(Table, &[Interval]) -> Interval + Send + Sync + 'static,
    exact: impl Fn(&[Exact]) -> Exact + Send + Sync + 'static,
) -> Meaning {
    Meaning::Float(Float {
        ty,
        table: Box::new(move |arithmetic, x| vec![table(arithmetic, &points(x))]),
        exact: Box::new(exact),
        ieee: None,
    })
}

/// A result that the table allows an error, but that the interpreter rounds to
/// the nearest.
fn nearest(
    ty: FloatType,
    table: impl Fn(Table, &[Interval]) -> Interval + Send + Sync + 'static,
    exact: impl Fn(&[Exact]) -> Exact + Send + Sync + 'static,
    ieee: impl Fn(&[f32]) -> f32 + Send + Sync + 'static,
) -> Meaning {
    Meaning::Float(Float {
        ty,
        table: Box::new(move |arithmetic, x| vec![table(arithmetic, &points(x))]),
        exact: Box::new(exact),
        ieee: Some(Box::new(ieee)),
    })
}

/// A result that is one word.
fn word(value: impl Fn(&[u32]) -> u32 + Send + Sync + 'static) -> Meaning {
    words(move |x| Words::exactly(value(x)))
}

/// A result that may be one of several words.
fn words(value: impl Fn(&[u32]) -> Words + Send + Sync + 'static) -> Meaning {
    Meaning::Words(Box::new(value))
}

/// An operation on vectors and matrices, whose rule takes all scalars of the
/// parameters in order.
fn whole(
    name: impl Into<String>,
    accuracy: &str,
    parameters: Vec<(Shape, Scalar)>,
    outputs: Vec<(&str, Shape, Scalar)>,
    cases: Vec<Vec<u32>>,
    rule: Rule,
) -> Operation {
    Operation {
        name: name.into(),
        accuracy: accuracy.to_owned(),
        parameters,
        outputs: outputs
            .into_iter()
            .map(|(code, shape, scalar)| Output {
                code: code.to_owned(),
                shape,
                scalar,
            })
            .collect(),
        form: Form::Whole,
        strict: false,
        own_ulps: None,
        cases,
        rule,
    }
}

fn reals(x: &[f64]) -> Vec<Exact> {
    x.iter().map(|&x| Exact::new(x)).collect()
}

fn points(x: &[f64]) -> Vec<Interval> {
    x.iter().map(|&x| Interval::point(x)).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_unique_and_cases_have_the_right_size() {
        let all = all();
        let names: BTreeSet<&str> = all
            .iter()
            .map(|operation| operation.name.as_str())
            .collect();
        assert_eq!(names.len(), all.len());
        for operation in &all {
            let width = operation.input_scalars().count();
            assert!(operation.cases.len() >= 100, "{}", operation.name);
            assert!(
                operation.cases.iter().all(|case| case.len() == width),
                "{}",
                operation.name
            );
            let halves = operation
                .output_scalars()
                .filter(|&scalar| scalar == Scalar::F16)
                .count();
            assert!(
                [0, operation.output_scalars().count()].contains(&halves),
                "{}",
                operation.name
            );
            let expected = (operation.rule)(&operation.cases[0]);
            assert_eq!(
                expected.len(),
                operation.output_scalars().count(),
                "{}",
                operation.name
            );
        }
    }

    /// A table that leaves everything open would find nothing wrong.
    #[test]
    fn enough_cases_of_every_operation_are_judged() {
        for operation in &all() {
            let judged = operation
                .cases
                .iter()
                .filter(|case| {
                    (operation.rule)(case).iter().any(|expected| {
                        expected.allowed != super::super::operation::Allowed::Anything
                    })
                })
                .count();
            assert!(
                judged >= 100 && judged * 20 >= operation.cases.len(),
                "{}: {judged} of {}",
                operation.name,
                operation.cases.len()
            );
        }
    }
}

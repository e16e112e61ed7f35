//! Results held against expectations.

use std::fmt;

use super::kernel::position;
use super::operation::{Allowed, Expectation, Operation};

/// What a result failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Check {
    /// WGSL's accuracy.
    Accuracy,
    /// The bits that the interpreter's semantics, or strict arithmetic, promise
    /// of finite numbers.
    Bits,
    /// The same where NaN or infinity goes in or comes out.
    Special,
    /// The same, but only in the sign of a zero.
    ZeroSign,
    /// The error in ULP that the interpreter's semantics promise.
    OwnAccuracy,
    /// There is no result.
    Run,
}

impl Check {
    /// Every check.
    pub const ALL: [Self; 6] = [
        Self::Accuracy,
        Self::Bits,
        Self::Special,
        Self::ZeroSign,
        Self::OwnAccuracy,
        Self::Run,
    ];

    /// As the table of exceptions has it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Bits => "bits",
            Self::Special => "special",
            Self::ZeroSign => "zero sign",
            Self::OwnAccuracy => "own accuracy",
            Self::Run => "run",
        }
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Who computed, and what that is held to besides WGSL.
#[derive(Clone, Copy, Debug)]
pub enum Who<'a> {
    /// The interpreter: to its own semantics.
    Interpreter,
    /// A driver under strict arithmetic: to these results of the interpreter.
    Strict(&'a [u32]),
    /// A driver under fast arithmetic: to nothing else.
    Fast,
}

/// The failures of one check.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// The check.
    pub check: Check,
    /// How many results fail it.
    pub count: usize,
    /// The first of them: inputs, result, and what was allowed.
    pub first: String,
}

/// How an executor did on an operation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// Results looked at.
    pub results: usize,
    /// Those of which WGSL or the semantics say anything.
    pub judged: usize,
    /// The largest error in ULP, where errors can be measured.
    pub worst: Option<f64>,
    /// What failed.
    pub failures: Vec<Failure>,
}

impl Judgement {
    /// One that failed before there were results.
    #[must_use]
    pub fn without_results(reason: String) -> Self {
        Self {
            failures: vec![Failure {
                check: Check::Run,
                count: 1,
                first: reason,
            }],
            ..Self::default()
        }
    }

    fn fail(&mut self, check: Check, first: impl FnOnce() -> String) {
        match self.failures.iter_mut().find(|failure| failure.check == check) {
            Some(failure) => failure.count += 1,
            None => self.failures.push(Failure {
                check,
                count: 1,
                first: first(),
            }),
        }
    }
}

/// What is expected of an operation's cases.
#[must_use]
pub fn expectations(operation: &Operation) -> Vec<Vec<Expectation>> {
    operation
        .cases
        .iter()
        .map(|case| (operation.rule)(case))
        .collect()
}

/// Judges the results of an operation.
#[must_use]
pub fn judge(
    operation: &Operation,
    expectations: &[Vec<Expectation>],
    results: &[u32],
    who: Who<'_>,
) -> Judgement {
    let scalars: Vec<_> = operation.output_scalars().collect();
    let mut judgement = Judgement::default();
    for (form, form_name) in operation.forms().iter().enumerate() {
        for (case, expected) in expectations.iter().enumerate() {
            for (index, (expected, &scalar)) in expected.iter().zip(&scalars).enumerate() {
                let at = position(operation, form, index, case);
                let word = results.get(at).copied();
                let Some(word) = word else {
                    judgement.fail(Check::Run, || format!("{} results only", results.len()));
                    continue;
                };
                judgement.results += 1;
                let detail = |wanted: String| {
                    let of = if scalars.len() > 1 {
                        format!(", component {index}")
                    } else {
                        String::new()
                    };
                    format!(
                        "of {}: {}, not {wanted} ({form_name}{of})",
                        operation.show_case(&operation.cases[case]),
                        scalar.show(word),
                    )
                };
                let mut is_judged = expected.allowed != Allowed::Anything;
                if !expected.allowed.contains(scalar, word) {
                    judgement.fail(Check::Accuracy, || detail(expected.allowed.show(scalar)));
                }
                let promised = match who {
                    Who::Interpreter => expected.bits.map(|bits| (bits, &[] as &[u32])),
                    Who::Strict(interpreter) => interpreter
                        .get(at)
                        .map(|&bits| (bits, expected.flushed.as_slice())),
                    Who::Fast => None,
                };
                if let Some((bits, others)) = promised {
                    is_judged = true;
                    let matches = |&other: &u32| scalar.same(word, other);
                    if !matches(&bits) && !others.iter().any(matches) {
                        let check = if scalar.differ_in_sign_of_zero(word, bits) {
                            Check::ZeroSign
                        } else if expected.special {
                            Check::Special
                        } else {
                            Check::Bits
                        };
                        judgement.fail(check, || detail(scalar.show(bits)));
                    }
                }
                if let (Some(exact), Some(ty)) = (expected.exact, scalar.float()) {
                    let error = (ty.decode(word) - exact).abs() / ty.ulp(exact);
                    if error.is_finite() {
                        judgement.worst = Some(judgement.worst.unwrap_or(0.0).max(error));
                    }
                    let own = operation.own_ulps.filter(|_| matches!(who, Who::Interpreter));
                    if own.is_some_and(|own| !(error <= own)) {
                        judgement.fail(Check::OwnAccuracy, || {
                            detail(format!("{exact:e}, which is {error:.3} ULP away"))
                        });
                    }
                }
                judgement.judged += usize::from(is_judged);
            }
        }
    }
    judgement
}

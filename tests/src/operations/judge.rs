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
    /// The largest error in ULP, where errors can be measured and WGSL says
    /// anything about the result.
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
        match self
            .failures
            .iter_mut()
            .find(|failure| failure.check == check)
        {
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
                    if error.is_finite() && expected.allowed != Allowed::Anything {
                        judgement.worst = Some(judgement.worst.unwrap_or(0.0).max(error));
                    }
                    let own = operation
                        .own_ulps
                        .filter(|_| matches!(who, Who::Interpreter));
                    if own.is_some_and(|own| error.is_nan() || error > own) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operations::float::FloatType;
    use crate::operations::kernel::result_words;
    use crate::operations::table;

    fn operation(name: &str) -> Operation {
        table::all()
            .into_iter()
            .find(|operation| operation.name == name)
            .unwrap_or_else(|| panic!("no operation `{name}`"))
    }

    /// What an executor gives that computes what the semantics say.
    fn right(operation: &Operation, expected: &[Vec<Expectation>]) -> Vec<u32> {
        let scalars: Vec<_> = operation.output_scalars().collect();
        let mut results = vec![0; result_words(operation)];
        for form in 0..operation.forms().len() {
            for (case, expected) in expected.iter().enumerate() {
                for (index, expected) in expected.iter().enumerate() {
                    let exact = || {
                        let ty = scalars[index].float().unwrap_or(FloatType::F32);
                        let inside = match &expected.allowed {
                            Allowed::Numbers(all) => {
                                all.first().map_or(0.0, |one| (one.low + one.high) / 2.0)
                            }
                            _ => 0.0,
                        };
                        let value = expected.exact.unwrap_or(inside);
                        ty.encode(ty.nearest(crate::operations::exact::Exact::new(value)))
                    };
                    results[position(operation, form, index, case)] =
                        expected.bits.unwrap_or_else(exact);
                }
            }
        }
        results
    }

    /// The first case that `wanted` is true of.
    fn case(expected: &[Vec<Expectation>], wanted: impl Fn(&Expectation) -> bool) -> usize {
        expected
            .iter()
            .position(|expected| wanted(&expected[0]))
            .unwrap_or_else(|| panic!("no such case"))
    }

    /// The only failure.
    fn failure(judgement: &Judgement) -> &Failure {
        match &judgement.failures[..] {
            [failure] => failure,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn right_results_pass() {
        for name in [
            "a + b, f32",
            "a / b, f32",
            "frexp(a), f32",
            "a % b, i32",
            "unpack4x8snorm(a)",
        ] {
            let operation = operation(name);
            let expected = expectations(&operation);
            let results = right(&operation, &expected);
            for who in [Who::Interpreter, Who::Strict(&results), Who::Fast] {
                let judgement = judge(&operation, &expected, &results, who);
                assert_eq!(judgement.failures, [], "{name}, {who:?}");
                assert!(judgement.judged > 0 && judgement.judged <= judgement.results);
            }
        }
    }

    #[test]
    fn one_ulp_is_caught_where_the_result_is_rounded() {
        let operation = operation("a / b, f32");
        let expected = expectations(&operation);
        let interpreter = right(&operation, &expected);
        let at = case(&expected, |expected| {
            expected.exact.is_some() && expected.flushed.len() == 1
        });
        let mut results = interpreter.clone();
        results[at] += 1;
        let judgement = judge(&operation, &expected, &results, Who::Interpreter);
        let failed = failure(&judgement);
        assert_eq!((failed.check, failed.count), (Check::Bits, 1));
        // The message has inputs, result and what it should have been.
        let inputs = operation.show_case(&operation.cases[at]);
        assert!(failed.first.contains(&inputs), "{}", failed.first);
        assert!(
            failed.first.contains(&format!("{:#010x}", results[at])),
            "{}",
            failed.first
        );
        assert!(
            failed.first.contains(&format!("{:#010x}", interpreter[at])),
            "{}",
            failed.first
        );
        let judgement = judge(&operation, &expected, &results, Who::Strict(&interpreter));
        assert_eq!(failure(&judgement).check, Check::Bits);
        // WGSL gives a quotient 2.5 ULP, and a sum none beyond its neighbours.
        let judgement = judge(&operation, &expected, &results, Who::Fast);
        assert_eq!(judgement.failures, []);
        let sum = super::tests::operation("a + b, f32");
        let expected = expectations(&sum);
        let mut results = right(&sum, &expected);
        let at = case(&expected, |expected| {
            let exact = |exact: f64| exact == f64::from(exact as f32);
            expected.exact.is_some_and(exact)
        });
        results[at] += 1;
        let judgement = judge(&sum, &expected, &results, Who::Fast);
        assert_eq!(failure(&judgement).check, Check::Accuracy);
    }

    #[test]
    fn values_outside_the_interval_are_caught_in_both_forms() {
        let operation = operation("exp(a), f32");
        let expected = expectations(&operation);
        let results = right(&operation, &expected);
        let at = case(&expected, |expected| {
            expected
                .exact
                .is_some_and(|exact| exact > 1.5 && exact < 2.0)
        });
        for form in 0..2 {
            let mut results = results.clone();
            // 3 + 2 · |x| ULP is less than 5 here.
            results[position(&operation, form, 0, at)] += 5;
            let judgement = judge(&operation, &expected, &results, Who::Fast);
            let failed = failure(&judgement);
            assert_eq!(failed.check, Check::Accuracy);
            assert!(
                failed.first.contains(operation.forms()[form]),
                "{}",
                failed.first
            );
            assert!(judgement.worst.is_some_and(|worst| worst > 4.0));
            // Inside WGSL's interval, but not where the interpreter has to be.
            results[position(&operation, form, 0, at)] -= 3;
            let judgement = judge(&operation, &expected, &results, Who::Interpreter);
            assert_eq!(failure(&judgement).check, Check::OwnAccuracy);
            assert_eq!(
                judge(&operation, &expected, &results, Who::Fast).failures,
                []
            );
        }
    }

    #[test]
    fn flushing_is_for_drivers_only_and_zeros_have_signs() {
        let operation = operation("a * b, f32");
        let expected = expectations(&operation);
        let interpreter = right(&operation, &expected);
        let subnormal = |word: u32| word & 0x7f80_0000 == 0 && word & 0x7f_ffff != 0;
        let at = case(&expected, |expected| expected.bits.is_some_and(subnormal));
        let mut results = interpreter.clone();
        results[at] = 0;
        let judgement = judge(&operation, &expected, &results, Who::Interpreter);
        assert_eq!(failure(&judgement).check, Check::Bits);
        let judgement = judge(&operation, &expected, &results, Who::Strict(&interpreter));
        assert_eq!(judgement.failures, []);
        let at = case(&expected, |expected| {
            expected.bits == Some(0) && !expected.special && expected.flushed == [0]
        });
        let mut results = interpreter.clone();
        results[at] = 0x8000_0000;
        let judgement = judge(&operation, &expected, &results, Who::Strict(&interpreter));
        assert_eq!(failure(&judgement).check, Check::ZeroSign);
        assert_eq!(
            judge(&operation, &expected, &results, Who::Fast).failures,
            []
        );
    }

    #[test]
    fn nan_is_only_held_to_strict_arithmetic() {
        let operation = operation("a + b, f32");
        let expected = expectations(&operation);
        let interpreter = right(&operation, &expected);
        let is_nan = |word: u32| f32::from_bits(word).is_nan();
        let at = case(&expected, |expected| expected.bits.is_some_and(is_nan));
        let mut results = interpreter.clone();
        // Another NaN is as good.
        results[at] = 0xffc0_1234;
        let judgement = judge(&operation, &expected, &results, Who::Strict(&interpreter));
        assert_eq!(judgement.failures, []);
        results[at] = 0;
        let judgement = judge(&operation, &expected, &results, Who::Strict(&interpreter));
        assert_eq!(failure(&judgement).check, Check::Special);
        assert_eq!(
            judge(&operation, &expected, &results, Who::Fast).failures,
            []
        );
    }

    #[test]
    fn missing_results_are_failures() {
        let operation = operation("!a, bool");
        let expected = expectations(&operation);
        let judgement = judge(&operation, &expected, &[], Who::Fast);
        assert_eq!(failure(&judgement).check, Check::Run);
        assert_eq!(judgement.judged, 0);
    }
}

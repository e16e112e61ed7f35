//! Probes of arithmetic: the result against its twin, and what the operands explain.

use super::tally::{Place, Tally};
use super::twin::Twin;
use super::{Lane, Scalar, Seen, heat_of, ulp};
use crate::ir::Arith;
use crate::sanitise::{HEAT_BIRTH, HEAT_UNSTABLE, VISIBLE};

/// Notes what an invocation has computed: `scalars` are the result and the operands.
#[inline]
pub(super) fn see(tally: &mut Tally, op: Arith, twin: Twin, scalars: &[Scalar], who: Lane) -> Seen {
    let Some((&result, operands)) = scalars.split_first() else {
        return Seen::default();
    };
    let place = Place {
        invocation: who.invocation,
        value: result.single,
        exact: result.double,
    };
    if result.is_float {
        number(tally, op, twin, result, operands, (who, place))
    } else {
        decision(tally, op, twin, result, operands, who)
    }
}

/// Whether an operand is NaN or infinite.
fn any_wild(operands: &[Scalar]) -> bool {
    operands
        .iter()
        .any(|operand| operand.is_float && !operand.single.is_finite())
}

fn number(
    tally: &mut Tally,
    op: Arith,
    twin: Twin,
    result: Scalar,
    operands: &[Scalar],
    (who, place): (Lane, Place),
) -> Seen {
    if !result.single.is_finite() {
        if any_wild(operands) {
            tally.propagated += who.times;
            return Seen::default();
        }
        tally.births.add(who.times, place);
        return Seen {
            heat: HEAT_BIRTH,
            ..Seen::default()
        };
    }
    if any_wild(operands) {
        // A select has not looked at what it does not give.
        if op != Arith::SelectF {
            tally.deaths.add(who.times, place);
        }
        return Seen::default();
    }
    let exact = result.double;
    if who.diverged || f64::from(result.single) == exact || !exact.is_finite() {
        return Seen::default();
    }
    let difference = (f64::from(result.single) - exact).abs();
    if op.drops_digits() && difference >= 1.0 {
        return unstable(tally, who, place, difference / exact.abs().max(1.0));
    }
    let unit = ulp(exact);
    let ulps = difference / unit;
    tally.error(who.times, ulps);
    let relative = relative(result.single, exact);
    tally.relative.see(relative, place);
    if !op.chooses() {
        let (alone, _) = twin.of_singles(operands);
        if alone.is_finite() {
            let introduced = (f64::from(result.single) - alone).abs() / ulp(alone);
            tally.introduced = tally.introduced.max(introduced);
        }
        given(tally, op, (relative, result.single), operands, (who, place));
    }
    Seen {
        diverges: false,
        heat: heat_of(ulps),
    }
}

/// How much larger than that of its operands an error must be to be blamed on the
/// operation: products and powers double what they are given, and are not the reason.
const GROWS: f64 = 4.0;

/// Notes what the operands have to do with the error.
fn given(
    tally: &mut Tally,
    op: Arith,
    (error, result): (f64, f32),
    operands: &[Scalar],
    (who, place): (Lane, Place),
) {
    let numbers = || operands.iter().filter(|operand| operand.is_float);
    if error > VISIBLE {
        let given = numbers()
            .map(|operand| relative(operand.single, operand.double))
            .fold(0.0, f64::max);
        if given * GROWS <= error {
            tally.lost.add(who.times, place);
        }
    }
    let carries = || numbers().any(|operand| f64::from(operand.single) != operand.double);
    if matches!(op, Arith::AddF | Arith::SubF) && carries() {
        let largest = numbers()
            .map(|operand| exponent(operand.single))
            .max()
            .unwrap_or_default();
        let cancelled = largest.saturating_sub(exponent(result));
        tally.cancelled = tally.cancelled.max(cancelled);
    }
}

/// The biased exponent.
fn exponent(value: f32) -> u32 {
    value.to_bits() >> 23 & 0xff
}

/// Relative to the larger of the two results, or to the least normal number: next to
/// nothing is all digits lost, however near to it the exact result is.
#[inline]
fn relative(single: f32, exact: f64) -> f64 {
    let single = f64::from(single);
    let scale = single.abs().max(exact.abs());
    (single - exact).abs() / scale.max(f32::MIN_POSITIVE.into())
}

/// A comparison or a conversion to an integer.
fn decision(
    tally: &mut Tally,
    op: Arith,
    twin: Twin,
    result: Scalar,
    operands: &[Scalar],
    who: Lane,
) -> Seen {
    let first = operands.first().copied().unwrap_or_default();
    let second = operands.get(1).copied().unwrap_or_default();
    // What is decided on: a number, or how two of them differ.
    let place = Place {
        invocation: who.invocation,
        value: first.single - second.single,
        exact: first.double - second.double,
    };
    if any_wild(operands) {
        tally.deaths.add(who.times, place);
        return Seen::default();
    }
    let (_, other) = twin.of_doubles(operands);
    if who.diverged || other == result.int {
        return Seen::default();
    }
    let scale = if op.decides() {
        first.double.abs().max(second.double.abs())
    } else {
        first.double.abs().max(1.0)
    };
    let distance = if op.decides() {
        place.exact.abs()
    } else {
        (f64::from(first.single) - first.double).abs()
    };
    let margin = if scale > 0.0 { distance / scale } else { 0.0 };
    unstable(tally, who, place, margin)
}

fn unstable(tally: &mut Tally, who: Lane, place: Place, margin: f64) -> Seen {
    if who.diverged {
        return Seen::default();
    }
    tally.unstable.add(who.times, place);
    tally.margin = tally.margin.max(margin);
    Seen {
        diverges: true,
        heat: HEAT_UNSTABLE,
    }
}

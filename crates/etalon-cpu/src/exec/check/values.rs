//! Checks of operands alone: indices, division, shifts, conversions, the birth of
//! NaNs and infinities.

use super::{Checker, Detail, Lane, Site, float, int, lanes};
use crate::code::CodeInst;
use crate::exec::state::State;
use crate::ir::Check;
use crate::num::Number;

pub(super) fn check<N: Number>(
    state: &State<'_, N>,
    checker: &mut Checker<'_>,
    inst: &CodeInst,
    check: Check,
    site: Site,
) {
    for at in lanes(state, inst) {
        for detail in faults(state, inst, check, at) {
            checker.report(site, at.invocation, || detail);
        }
    }
}

/// At most one of each kind: an expression counts once, however many components
/// it has.
fn faults<N: Number>(
    state: &State<'_, N>,
    inst: &CodeInst,
    check: Check,
    at: Lane,
) -> impl Iterator<Item = Detail> {
    let operands = &inst.operands;
    let number = |value: u32, signed: bool| {
        if signed {
            i64::from(value as i32)
        } else {
            i64::from(value)
        }
    };
    let (mut first, mut second) = (None, None);
    match check {
        Check::Index { of, signed } => {
            let (index, length) = (int(state, operands[0], at), int(state, operands[1], at));
            first = (index >= length).then(|| Detail::Index {
                of,
                index: number(index, signed),
                length,
            });
        }
        Check::Division { signed } => {
            for pair in operands.chunks_exact(2) {
                let (dividend, divisor) = (int(state, pair[0], at), int(state, pair[1], at));
                if divisor == 0 && first.is_none() {
                    first = Some(Detail::DivisionByZero {
                        dividend: number(dividend, signed),
                    });
                }
                if signed && dividend == 1 << 31 && divisor == u32::MAX {
                    second = Some(Detail::DivisionOverflow);
                }
            }
        }
        Check::Shift => {
            first = operands
                .iter()
                .map(|&slot| int(state, slot, at))
                .find(|&amount| amount >= 32)
                .map(|amount| Detail::Shift { amount });
        }
        Check::Conversion { signed } => {
            first = operands
                .iter()
                .map(|&slot| float(state, slot, at))
                .find(|&value| !converts(value, signed))
                .map(|value| Detail::Conversion {
                    value: value.to_f32(),
                    signed,
                });
        }
        Check::NonFinite { group } => {
            let is_finite = |slot| match slot {
                crate::code::Slot {
                    class: crate::registers::Class::Float,
                    ..
                } => finite(float(state, slot, at)),
                _ => true,
            };
            let mut groups = operands.chunks_exact(usize::from(group.max(1)));
            first = groups
                .find(|group| !is_finite(group[0]) && group[1..].iter().all(|&s| is_finite(s)))
                .map(|group| Detail::NonFinite {
                    result: float(state, group[0], at).to_f32(),
                    operands: group[1..]
                        .iter()
                        .map(|&slot| match slot.class {
                            crate::registers::Class::Float => float(state, slot, at).to_f32(),
                            crate::registers::Class::Int => int(state, slot, at) as i32 as f32,
                        })
                        .collect(),
                });
        }
        _ => {}
    }
    first.into_iter().chain(second)
}

/// Whether a number is neither infinite nor NaN, in any number type.
fn finite<N: Number>(value: N) -> bool {
    value.sub(value).eq(N::default())
}

/// Whether truncating gives a number that the integer type has.
fn converts<N: Number>(value: N, signed: bool) -> bool {
    let whole = value.trunc();
    // The bounds are powers of two, hence exact in every number type.
    let (low, high) = if signed {
        (-2_147_483_648.0, 2_147_483_648.0)
    } else {
        (0.0, 4_294_967_296.0)
    };
    N::from_f32(low).le(whole) && whole.lt(N::from_f32(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_integers_end_where_they_should() {
        let ok = [-0.9, 0.0, 0.9, 2_147_483_520.0];
        for value in ok {
            assert!(converts(value, true) && converts(value, false), "{value}");
        }
        assert!(converts(-2_147_483_648.0_f32, true));
        assert!(!converts(-2_147_483_904.0_f32, true));
        assert!(!converts(2_147_483_648.0_f32, true));
        assert!(converts(4_294_967_040.0_f32, false));
        assert!(!converts(4_294_967_296.0_f32, false));
        assert!(!converts(-1.0_f32, false));
        for signed in [true, false] {
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                assert!(!converts(value, signed), "{value}");
            }
        }
    }

    #[test]
    fn finite_means_neither_infinite_nor_nan() {
        for value in [0.0, -0.0, f32::MAX, f32::MIN, 1e-45] {
            assert!(finite(value), "{value}");
        }
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(!finite(value), "{value}");
        }
    }
}

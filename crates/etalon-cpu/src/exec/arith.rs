//! Handlers of arithmetic and of copies.

use std::marker::PhantomData;

use super::link::Instr;
use super::state::State;
use super::tier::{Handler, Step, Tier};
use crate::ir::arith::{Binary, Lane, Ternary, Unary, Visitor};
use crate::num::Number;
use crate::registers::{Class, ClassOf, LANES, Lanes, Registers};

/// Finds the handler for operands that are varying or uniform as given.
pub(super) struct Select<'a> {
    pub(super) tier: Tier,
    pub(super) varying: &'a [bool],
}

impl<N: Number> Visitor<N> for Select<'_> {
    type Output = Handler<N>;

    fn unary<O: Unary<N> + 'static>(self) -> Handler<N> {
        match self.varying {
            [true] => Handler::new::<UnaryLanes<O>>(self.tier),
            _ => Handler::plain::<UnaryUniform<O>>(),
        }
    }

    fn binary<O: Binary<N> + 'static>(self) -> Handler<N> {
        match self.varying {
            [true, true] => Handler::new::<BinaryLanes<O, true, true>>(self.tier),
            [true, false] => Handler::new::<BinaryLanes<O, true, false>>(self.tier),
            [false, true] => Handler::new::<BinaryLanes<O, false, true>>(self.tier),
            _ => Handler::plain::<BinaryUniform<O>>(),
        }
    }

    fn ternary<O: Ternary<N> + 'static>(self) -> Handler<N> {
        match self.varying {
            [true, true, true] => Handler::new::<TernaryLanes<O, true, true, true>>(self.tier),
            [true, true, false] => Handler::new::<TernaryLanes<O, true, true, false>>(self.tier),
            [true, false, true] => Handler::new::<TernaryLanes<O, true, false, true>>(self.tier),
            [true, false, false] => Handler::new::<TernaryLanes<O, true, false, false>>(self.tier),
            [false, true, true] => Handler::new::<TernaryLanes<O, false, true, true>>(self.tier),
            [false, true, false] => Handler::new::<TernaryLanes<O, false, true, false>>(self.tier),
            [false, false, true] => Handler::new::<TernaryLanes<O, false, false, true>>(self.tier),
            _ => Handler::plain::<TernaryUniform<O>>(),
        }
    }
}

/// Whether an instruction writes a register that it also reads. Its loop over
/// lanes then works on a copy, so that loops need never fear overlap.
#[inline(always)]
fn overlaps<N: Number, A: ClassOf<N>, D: ClassOf<N>>(
    varying: bool,
    operand: u16,
    result: u16,
) -> bool {
    varying && A::CLASS == D::CLASS && operand == result
}

struct UnaryLanes<O>(PhantomData<O>);

impl<N: Number, O: Unary<N>> Step<N> for UnaryLanes<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let overlap = overlaps::<N, O::A, O::D>(true, instr.a, instr.d);
        for chunk in 0..state.chunks {
            let (d, a) = (state.at(instr.d, chunk), state.at(instr.a, chunk));
            if overlap {
                let a = *O::A::lanes(&state.registers, a);
                map1(
                    &mut O::D::lanes_mut(&mut state.registers, d).0,
                    &a.0,
                    O::eval,
                );
            } else {
                let (d, rest) = O::D::split(&mut state.registers, d);
                map1(&mut d.0, &O::A::other(&rest, a).0, O::eval);
            }
        }
    }
}

struct UnaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Unary<N>> Step<N> for UnaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = O::A::uniform(&state.registers, instr.a.into());
        O::D::set_uniform(&mut state.registers, instr.d.into(), O::eval(a));
    }
}

/// An operand that is varying or not: its lanes, or its one number.
#[inline(always)]
fn uniform_unless<N: Number, C: ClassOf<N>, const VARYING: bool>(
    registers: &Registers<N>,
    number: u16,
) -> Lane<N, C> {
    if VARYING {
        C::Lane::default()
    } else {
        C::uniform(registers, number.into())
    }
}

struct BinaryLanes<O, const AV: bool, const BV: bool>(PhantomData<O>);

impl<N: Number, O: Binary<N>, const AV: bool, const BV: bool> Step<N> for BinaryLanes<O, AV, BV> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let one_a = uniform_unless::<N, O::A, AV>(&state.registers, instr.a);
        let one_b = uniform_unless::<N, O::B, BV>(&state.registers, instr.b);
        let overlap = overlaps::<N, O::A, O::D>(AV, instr.a, instr.d)
            || overlaps::<N, O::B, O::D>(BV, instr.b, instr.d);
        for chunk in 0..state.chunks {
            let (d, a, b) = (
                state.at(instr.d, chunk),
                state.at(instr.a, chunk),
                state.at(instr.b, chunk),
            );
            if overlap {
                let a = if AV {
                    *O::A::lanes(&state.registers, a)
                } else {
                    Lanes([one_a; LANES])
                };
                let b = if BV {
                    *O::B::lanes(&state.registers, b)
                } else {
                    Lanes([one_b; LANES])
                };
                map2(
                    &mut O::D::lanes_mut(&mut state.registers, d).0,
                    &a.0,
                    &b.0,
                    O::eval,
                );
                continue;
            }
            let (d, rest) = O::D::split(&mut state.registers, d);
            if AV && BV {
                map2(
                    &mut d.0,
                    &O::A::other(&rest, a).0,
                    &O::B::other(&rest, b).0,
                    O::eval,
                );
            } else if AV {
                map1(&mut d.0, &O::A::other(&rest, a).0, |a| O::eval(a, one_b));
            } else {
                map1(&mut d.0, &O::B::other(&rest, b).0, |b| O::eval(one_a, b));
            }
        }
    }
}

struct BinaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Binary<N>> Step<N> for BinaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = O::A::uniform(&state.registers, instr.a.into());
        let b = O::B::uniform(&state.registers, instr.b.into());
        O::D::set_uniform(&mut state.registers, instr.d.into(), O::eval(a, b));
    }
}

struct TernaryLanes<O, const AV: bool, const BV: bool, const CV: bool>(PhantomData<O>);

impl<N: Number, O: Ternary<N>, const AV: bool, const BV: bool, const CV: bool> Step<N>
    for TernaryLanes<O, AV, BV, CV>
{
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let one_a = uniform_unless::<N, O::A, AV>(&state.registers, instr.a);
        let one_b = uniform_unless::<N, O::B, BV>(&state.registers, instr.b);
        let one_c = uniform_unless::<N, O::C, CV>(&state.registers, instr.c);
        let overlap = overlaps::<N, O::A, O::D>(AV, instr.a, instr.d)
            || overlaps::<N, O::B, O::D>(BV, instr.b, instr.d)
            || overlaps::<N, O::C, O::D>(CV, instr.c, instr.d);
        for chunk in 0..state.chunks {
            let (d, a, b, c) = (
                state.at(instr.d, chunk),
                state.at(instr.a, chunk),
                state.at(instr.b, chunk),
                state.at(instr.c, chunk),
            );
            if overlap {
                let a = if AV {
                    *O::A::lanes(&state.registers, a)
                } else {
                    Lanes([one_a; LANES])
                };
                let b = if BV {
                    *O::B::lanes(&state.registers, b)
                } else {
                    Lanes([one_b; LANES])
                };
                let c = if CV {
                    *O::C::lanes(&state.registers, c)
                } else {
                    Lanes([one_c; LANES])
                };
                map3(
                    &mut O::D::lanes_mut(&mut state.registers, d).0,
                    &a.0,
                    &b.0,
                    &c.0,
                    O::eval,
                );
                continue;
            }
            let (d, rest) = O::D::split(&mut state.registers, d);
            match (AV, BV, CV) {
                (true, true, true) => map3(
                    &mut d.0,
                    &O::A::other(&rest, a).0,
                    &O::B::other(&rest, b).0,
                    &O::C::other(&rest, c).0,
                    O::eval,
                ),
                (true, true, false) => map2(
                    &mut d.0,
                    &O::A::other(&rest, a).0,
                    &O::B::other(&rest, b).0,
                    |a, b| O::eval(a, b, one_c),
                ),
                (true, false, true) => map2(
                    &mut d.0,
                    &O::A::other(&rest, a).0,
                    &O::C::other(&rest, c).0,
                    |a, c| O::eval(a, one_b, c),
                ),
                (false, true, true) => map2(
                    &mut d.0,
                    &O::B::other(&rest, b).0,
                    &O::C::other(&rest, c).0,
                    |b, c| O::eval(one_a, b, c),
                ),
                (true, false, false) => map1(&mut d.0, &O::A::other(&rest, a).0, |a| {
                    O::eval(a, one_b, one_c)
                }),
                (false, true, false) => map1(&mut d.0, &O::B::other(&rest, b).0, |b| {
                    O::eval(one_a, b, one_c)
                }),
                (false, false, _) => map1(&mut d.0, &O::C::other(&rest, c).0, |c| {
                    O::eval(one_a, one_b, c)
                }),
            }
        }
    }
}

struct TernaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Ternary<N>> Step<N> for TernaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = O::A::uniform(&state.registers, instr.a.into());
        let b = O::B::uniform(&state.registers, instr.b.into());
        let c = O::C::uniform(&state.registers, instr.c.into());
        O::D::set_uniform(&mut state.registers, instr.d.into(), O::eval(a, b, c));
    }
}

#[inline(always)]
fn map1<A: Copy, D>(d: &mut [D; LANES], a: &[A; LANES], f: impl Fn(A) -> D) {
    for k in 0..LANES {
        d[k] = f(a[k]);
    }
}

#[inline(always)]
fn map2<A: Copy, B: Copy, D>(
    d: &mut [D; LANES],
    a: &[A; LANES],
    b: &[B; LANES],
    f: impl Fn(A, B) -> D,
) {
    for k in 0..LANES {
        d[k] = f(a[k], b[k]);
    }
}

#[inline(always)]
fn map3<A: Copy, B: Copy, C: Copy, D>(
    d: &mut [D; LANES],
    a: &[A; LANES],
    b: &[B; LANES],
    c: &[C; LANES],
    f: impl Fn(A, B, C) -> D,
) {
    for k in 0..LANES {
        d[k] = f(a[k], b[k], c[k]);
    }
}

/// Finds the handler of a copy: `masked` if only some lanes take part.
pub(super) fn copy<N: Number>(
    tier: Tier,
    class: Class,
    from_varying: bool,
    to_varying: bool,
    masked: bool,
) -> Handler<N> {
    use crate::registers::{Float, Int};
    match (class, to_varying, from_varying, masked) {
        (Class::Float, false, ..) => Handler::plain::<CopyUniform<Float>>(),
        (Class::Int, false, ..) => Handler::plain::<CopyUniform<Int>>(),
        (Class::Float, true, true, false) => Handler::new::<CopyLanes<Float, true>>(tier),
        (Class::Float, true, false, false) => Handler::new::<CopyLanes<Float, false>>(tier),
        (Class::Int, true, true, false) => Handler::new::<CopyLanes<Int, true>>(tier),
        (Class::Int, true, false, false) => Handler::new::<CopyLanes<Int, false>>(tier),
        (Class::Float, true, true, true) => Handler::new::<CopyMaskedFloats<true>>(tier),
        (Class::Float, true, false, true) => Handler::new::<CopyMaskedFloats<false>>(tier),
        (Class::Int, true, true, true) => Handler::new::<CopyMaskedInts<true>>(tier),
        (Class::Int, true, false, true) => Handler::new::<CopyMaskedInts<false>>(tier),
    }
}

struct CopyUniform<C>(PhantomData<C>);

impl<N: Number, C: ClassOf<N>> Step<N> for CopyUniform<C> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = C::uniform(&state.registers, instr.a.into());
        C::set_uniform(&mut state.registers, instr.d.into(), a);
    }
}

struct CopyLanes<C, const VARYING: bool>(PhantomData<C>);

impl<N: Number, C: ClassOf<N>, const VARYING: bool> Step<N> for CopyLanes<C, VARYING> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        for chunk in 0..state.chunks {
            let a = if VARYING {
                *C::lanes(&state.registers, state.at(instr.a, chunk))
            } else {
                Lanes([C::uniform(&state.registers, instr.a.into()); LANES])
            };
            let d = state.at(instr.d, chunk);
            *C::lanes_mut(&mut state.registers, d) = a;
        }
    }
}

struct CopyMaskedFloats<const VARYING: bool>;

impl<N: Number, const VARYING: bool> Step<N> for CopyMaskedFloats<VARYING> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        use crate::registers::{Float, Int};
        let one = uniform_unless::<N, Float, VARYING>(&state.registers, instr.a);
        for chunk in 0..state.chunks {
            let (d, a, mask) = (
                state.at(instr.d, chunk),
                state.at(instr.a, chunk),
                state.at(instr.c, chunk),
            );
            if VARYING && a == d {
                continue;
            }
            let (d, rest) = Float::split(&mut state.registers, d);
            let mask = <Int as ClassOf<N>>::other(&rest, mask);
            if VARYING {
                let a = <Float as ClassOf<N>>::other(&rest, a);
                update2(&mut d.0, &a.0, &mask.0, |d, a, mask| N::select(mask, a, d));
            } else {
                update1(&mut d.0, &mask.0, |d, mask| N::select(mask, one, d));
            }
        }
    }
}

struct CopyMaskedInts<const VARYING: bool>;

impl<N: Number, const VARYING: bool> Step<N> for CopyMaskedInts<VARYING> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        use crate::registers::Int;
        let one = uniform_unless::<N, Int, VARYING>(&state.registers, instr.a);
        for chunk in 0..state.chunks {
            let (d, a, mask) = (
                state.at(instr.d, chunk),
                state.at(instr.a, chunk),
                state.at(instr.c, chunk),
            );
            if VARYING && a == d {
                continue;
            }
            let mask = *<Int as ClassOf<N>>::lanes(&state.registers, mask);
            let (d, rest) = <Int as ClassOf<N>>::split(&mut state.registers, d);
            if VARYING {
                let a = <Int as ClassOf<N>>::other(&rest, a);
                update2(&mut d.0, &a.0, &mask.0, |d, a, mask| {
                    (a & mask) | (d & !mask)
                });
            } else {
                update1(&mut d.0, &mask.0, |d, mask| (one & mask) | (d & !mask));
            }
        }
    }
}

#[inline(always)]
fn update1<D: Copy, A: Copy>(d: &mut [D; LANES], a: &[A; LANES], f: impl Fn(D, A) -> D) {
    for k in 0..LANES {
        d[k] = f(d[k], a[k]);
    }
}

#[inline(always)]
fn update2<D: Copy, A: Copy, B: Copy>(
    d: &mut [D; LANES],
    a: &[A; LANES],
    b: &[B; LANES],
    f: impl Fn(D, A, B) -> D,
) {
    for k in 0..LANES {
        d[k] = f(d[k], a[k], b[k]);
    }
}

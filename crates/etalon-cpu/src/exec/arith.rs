//! Handlers of arithmetic and of copies.

use std::marker::PhantomData;

use super::lanes::{Operands, Source, map1, map2, map3, map4, update2};
use super::link::Instr;
use super::state::State;
use super::tier::{Handler, Step, Tier};
use crate::ir::arith::{Binary, Quaternary, Ternary, Unary, Visitor};
use crate::num::Number;
use crate::registers::{Class, ClassOf, Float, Int};

/// Finds the handler for operands that are varying or uniform as given.
pub(super) struct Select<'a> {
    pub(super) tier: Tier,
    pub(super) varying: &'a [bool],
}

type V<N, C> = <N as Operands>::Varying<C>;
type U<N, C> = <N as Operands>::Uniform<C>;

impl<N: Number> Visitor<N> for Select<'_> {
    type Output = Handler<N>;

    fn unary<O: Unary<N> + 'static>(self) -> Handler<N> {
        match self.varying {
            [true] => Handler::new::<UnaryLanes<O>>(self.tier),
            _ => Handler::plain::<UnaryUniform<O>>(),
        }
    }

    fn binary<O: Binary<N> + 'static>(self) -> Handler<N> {
        let tier = self.tier;
        match self.varying {
            [true, true] => Handler::new::<BinaryLanes<O, V<N, O::A>, V<N, O::B>>>(tier),
            [true, false] => Handler::new::<BinaryLanes<O, V<N, O::A>, U<N, O::B>>>(tier),
            [false, true] => Handler::new::<BinaryLanes<O, U<N, O::A>, V<N, O::B>>>(tier),
            _ => Handler::plain::<BinaryUniform<O>>(),
        }
    }

    fn ternary<O: Ternary<N> + 'static>(self) -> Handler<N> {
        let tier = self.tier;
        type L<O, A, B, C> = TernaryLanes<O, A, B, C>;
        match self.varying {
            [true, true, true] => Handler::new::<L<O, V<N, O::A>, V<N, O::B>, V<N, O::C>>>(tier),
            [true, true, false] => Handler::new::<L<O, V<N, O::A>, V<N, O::B>, U<N, O::C>>>(tier),
            [true, false, true] => Handler::new::<L<O, V<N, O::A>, U<N, O::B>, V<N, O::C>>>(tier),
            [true, false, false] => Handler::new::<L<O, V<N, O::A>, U<N, O::B>, U<N, O::C>>>(tier),
            [false, true, true] => Handler::new::<L<O, U<N, O::A>, V<N, O::B>, V<N, O::C>>>(tier),
            [false, true, false] => Handler::new::<L<O, U<N, O::A>, V<N, O::B>, U<N, O::C>>>(tier),
            [false, false, true] => Handler::new::<L<O, U<N, O::A>, U<N, O::B>, V<N, O::C>>>(tier),
            _ => Handler::plain::<TernaryUniform<O>>(),
        }
    }

    fn quaternary<O: Quaternary<N> + 'static>(self) -> Handler<N> {
        let tier = self.tier;
        type L<O, A, B, C, E> = QuaternaryLanes<O, A, B, C, E>;
        match self.varying {
            [true, true, true, true] => {
                Handler::new::<L<O, V<N, O::A>, V<N, O::B>, V<N, O::C>, V<N, O::E>>>(tier)
            }
            [true, true, true, false] => {
                Handler::new::<L<O, V<N, O::A>, V<N, O::B>, V<N, O::C>, U<N, O::E>>>(tier)
            }
            [true, true, false, true] => {
                Handler::new::<L<O, V<N, O::A>, V<N, O::B>, U<N, O::C>, V<N, O::E>>>(tier)
            }
            [true, true, false, false] => {
                Handler::new::<L<O, V<N, O::A>, V<N, O::B>, U<N, O::C>, U<N, O::E>>>(tier)
            }
            [true, false, true, true] => {
                Handler::new::<L<O, V<N, O::A>, U<N, O::B>, V<N, O::C>, V<N, O::E>>>(tier)
            }
            [true, false, true, false] => {
                Handler::new::<L<O, V<N, O::A>, U<N, O::B>, V<N, O::C>, U<N, O::E>>>(tier)
            }
            [true, false, false, true] => {
                Handler::new::<L<O, V<N, O::A>, U<N, O::B>, U<N, O::C>, V<N, O::E>>>(tier)
            }
            [true, false, false, false] => {
                Handler::new::<L<O, V<N, O::A>, U<N, O::B>, U<N, O::C>, U<N, O::E>>>(tier)
            }
            [false, true, true, true] => {
                Handler::new::<L<O, U<N, O::A>, V<N, O::B>, V<N, O::C>, V<N, O::E>>>(tier)
            }
            [false, true, true, false] => {
                Handler::new::<L<O, U<N, O::A>, V<N, O::B>, V<N, O::C>, U<N, O::E>>>(tier)
            }
            [false, true, false, true] => {
                Handler::new::<L<O, U<N, O::A>, V<N, O::B>, U<N, O::C>, V<N, O::E>>>(tier)
            }
            [false, true, false, false] => {
                Handler::new::<L<O, U<N, O::A>, V<N, O::B>, U<N, O::C>, U<N, O::E>>>(tier)
            }
            [false, false, true, true] => {
                Handler::new::<L<O, U<N, O::A>, U<N, O::B>, V<N, O::C>, V<N, O::E>>>(tier)
            }
            [false, false, true, false] => {
                Handler::new::<L<O, U<N, O::A>, U<N, O::B>, V<N, O::C>, U<N, O::E>>>(tier)
            }
            [false, false, false, true] => {
                Handler::new::<L<O, U<N, O::A>, U<N, O::B>, U<N, O::C>, V<N, O::E>>>(tier)
            }
            _ => Handler::plain::<QuaternaryUniform<O>>(),
        }
    }
}

struct UnaryLanes<O>(PhantomData<O>);

impl<N: Number, O: Unary<N>> Step<N> for UnaryLanes<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = <V<N, O::A> as Source<N, O::A>>::open(state, instr.operand(0));
        map1::<N, O::A, O::D, _>(state, instr.d, a, O::eval);
    }
}

struct UnaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Unary<N>> Step<N> for UnaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = uniform::<N, O::A>(state, instr.a);
        set_uniform::<N, O::D>(state, instr.d, O::eval(a));
    }
}

#[inline(always)]
fn uniform<N: Number, C: ClassOf<N>>(state: &mut State<'_, N>, number: u16) -> C::Lane {
    C::uniforms(&mut state.registers)[usize::from(number)]
}

#[inline(always)]
fn set_uniform<N: Number, C: ClassOf<N>>(state: &mut State<'_, N>, number: u16, lane: C::Lane) {
    C::uniforms(&mut state.registers)[usize::from(number)] = lane;
}

struct BinaryLanes<O, A, B>(PhantomData<(O, A, B)>);

impl<N, O, A, B> Step<N> for BinaryLanes<O, A, B>
where
    N: Number,
    O: Binary<N>,
    A: Source<N, O::A>,
    B: Source<N, O::B>,
{
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = A::open(state, instr.operand(0));
        let b = B::open(state, instr.operand(1));
        map2::<N, O::A, O::B, O::D, _, _>(state, instr.d, a, b, O::eval);
    }
}

struct BinaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Binary<N>> Step<N> for BinaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = uniform::<N, O::A>(state, instr.a);
        let b = uniform::<N, O::B>(state, instr.b);
        set_uniform::<N, O::D>(state, instr.d, O::eval(a, b));
    }
}

struct TernaryLanes<O, A, B, C>(PhantomData<(O, A, B, C)>);

impl<N, O, A, B, C> Step<N> for TernaryLanes<O, A, B, C>
where
    N: Number,
    O: Ternary<N>,
    A: Source<N, O::A>,
    B: Source<N, O::B>,
    C: Source<N, O::C>,
{
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = A::open(state, instr.operand(0));
        let b = B::open(state, instr.operand(1));
        let c = C::open(state, instr.operand(2));
        map3::<N, O::A, O::B, O::C, O::D, _, _, _>(state, instr.d, a, b, c, O::eval);
    }
}

struct TernaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Ternary<N>> Step<N> for TernaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = uniform::<N, O::A>(state, instr.a);
        let b = uniform::<N, O::B>(state, instr.b);
        let c = uniform::<N, O::C>(state, instr.c);
        set_uniform::<N, O::D>(state, instr.d, O::eval(a, b, c));
    }
}

struct QuaternaryLanes<O, A, B, C, E>(PhantomData<(O, A, B, C, E)>);

impl<N, O, A, B, C, E> Step<N> for QuaternaryLanes<O, A, B, C, E>
where
    N: Number,
    O: Quaternary<N>,
    A: Source<N, O::A>,
    B: Source<N, O::B>,
    C: Source<N, O::C>,
    E: Source<N, O::E>,
{
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = A::open(state, instr.operand(0));
        let b = B::open(state, instr.operand(1));
        let c = C::open(state, instr.operand(2));
        let e = E::open(state, instr.operand(3));
        map4::<N, O::A, O::B, O::C, O::E, O::D, _, _, _, _>(state, instr.d, a, b, c, e, O::eval);
    }
}

struct QuaternaryUniform<O>(PhantomData<O>);

impl<N: Number, O: Quaternary<N>> Step<N> for QuaternaryUniform<O> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = uniform::<N, O::A>(state, instr.a);
        let b = uniform::<N, O::B>(state, instr.b);
        let c = uniform::<N, O::C>(state, instr.c);
        let e = uniform::<N, O::E>(state, instr.e);
        set_uniform::<N, O::D>(state, instr.d, O::eval(a, b, c, e));
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
    match (class, to_varying) {
        (Class::Float, false) => Handler::plain::<CopyUniform<Float>>(),
        (Class::Int, false) => Handler::plain::<CopyUniform<Int>>(),
        (Class::Float, true) => copy_lanes::<N, Float>(tier, from_varying, masked),
        (Class::Int, true) => copy_lanes::<N, Int>(tier, from_varying, masked),
    }
}

fn copy_lanes<N: Number, C: Selects<N> + 'static>(
    tier: Tier,
    from_varying: bool,
    masked: bool,
) -> Handler<N> {
    match (from_varying, masked) {
        (true, false) => Handler::new::<CopyLanes<C, V<N, C>>>(tier),
        (false, false) => Handler::new::<CopyLanes<C, U<N, C>>>(tier),
        (true, true) => Handler::new::<CopyMasked<C, V<N, C>>>(tier),
        (false, true) => Handler::new::<CopyMasked<C, U<N, C>>>(tier),
    }
}

/// A class whose lanes can be chosen by a mask.
trait Selects<N: Number>: ClassOf<N> {
    fn select(mask: u32, yes: Self::Lane, no: Self::Lane) -> Self::Lane;
}

impl<N: Number> Selects<N> for Float {
    #[inline(always)]
    fn select(mask: u32, yes: N, no: N) -> N {
        N::select(mask, yes, no)
    }
}

impl<N: Number> Selects<N> for Int {
    #[inline(always)]
    fn select(mask: u32, yes: u32, no: u32) -> u32 {
        (yes & mask) | (no & !mask)
    }
}

struct CopyUniform<C>(PhantomData<C>);

impl<N: Number, C: ClassOf<N>> Step<N> for CopyUniform<C> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = uniform::<N, C>(state, instr.a);
        set_uniform::<N, C>(state, instr.d, a);
    }
}

struct CopyLanes<C, A>(PhantomData<(C, A)>);

impl<N: Number, C: ClassOf<N>, A: Source<N, C>> Step<N> for CopyLanes<C, A> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = A::open(state, instr.operand(0));
        map1::<N, C, C, _>(state, instr.d, a, |a| a);
    }
}

struct CopyMasked<C, A>(PhantomData<(C, A)>);

impl<N: Number, C: Selects<N>, A: Source<N, C>> Step<N> for CopyMasked<C, A> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let a = A::open(state, instr.operand(0));
        let mask = <V<N, Int> as Source<N, Int>>::open(state, instr.operand(2));
        update2::<N, C, Int, C, _, _>(state, instr.d, a, mask, |d, a, mask| C::select(mask, a, d));
    }
}

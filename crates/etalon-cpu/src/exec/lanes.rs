//! Registers as loops over lanes see them.
//!
//! Every loop works on blocks of lanes by value: a block of each operand is
//! read, then a block of the result is written. So a result may be in the same
//! register as an operand, and compilers see neither aliasing nor bounds: a
//! loop becomes straight vector code. A block is small enough that functions of
//! many steps keep theirs in vector registers.
//!
//! Registers are reached by address and not by index, since checking indices
//! takes longer than a short instruction's work. What makes that sound is
//! checked where programs are made and where the files are allocated: `Code`
//! numbers registers below the sizes it states, and every worker's files have
//! those sizes for each chunk of its batches.

use super::link::Operand;
use super::state::State;
use crate::ir::chain::Chained;
use crate::num::{Number, Shadow};
pub(super) use crate::registers::BLOCK;
use crate::registers::{ClassOf, Float, Int, LANES, Lane};

type LanesOf<L> = <L as Lane>::Lanes;
type BlockOf<L> = <L as Lane>::Block;

/// An operand of class `C` that loops over lanes read.
pub(crate) trait Source<N: Number, C: ClassOf<N>>: Copy {
    /// A register that the program has.
    fn open(state: &mut State<'_, N>, operand: Operand) -> Self;

    /// A block of lanes; `entry` is where the chunk's registers begin.
    ///
    /// # Safety
    /// `entry` is a multiple of the files' stride below their end, and `lane` a
    /// multiple of [`BLOCK`] below [`LANES`].
    unsafe fn block(self, entry: usize, lane: usize) -> BlockOf<C::Lane>;
}

/// A register of lanes.
#[derive(Clone, Copy)]
pub(crate) struct Varying<L: Lane>(*const LanesOf<L>);

impl<N: Number, C: ClassOf<N>> Source<N, C> for Varying<C::Lane> {
    #[inline(always)]
    fn open(state: &mut State<'_, N>, operand: Operand) -> Self {
        let file = C::file(&mut state.registers);
        debug_assert!(operand.varying && usize::from(operand.number) < file.len());
        Self(file.as_ptr().wrapping_add(usize::from(operand.number)))
    }

    #[inline(always)]
    unsafe fn block(self, entry: usize, lane: usize) -> BlockOf<C::Lane> {
        // SAFETY: the register's number is below the stride (see the module's
        // documentation), so the register is in the file, which is initialised
        // and which nothing writes while the reference lives.
        let lanes = unsafe { &*self.0.add(entry) };
        C::Lane::block(lanes, lane)
    }
}

/// A register of one number.
#[derive(Clone, Copy)]
pub(crate) struct Uniform<L>(L);

impl<N: Number, C: ClassOf<N>> Source<N, C> for Uniform<C::Lane> {
    #[inline(always)]
    fn open(state: &mut State<'_, N>, operand: Operand) -> Self {
        let file = C::uniforms(&mut state.registers);
        debug_assert!(!operand.varying && usize::from(operand.number) < file.len());
        // SAFETY: `Code` states how many uniform registers it numbers, and the
        // file has that many.
        Self(unsafe { *file.get_unchecked(usize::from(operand.number)) })
    }

    #[inline(always)]
    unsafe fn block(self, _: usize, _: usize) -> BlockOf<C::Lane> {
        self.0.splat()
    }
}

/// Either, as the instruction says when it runs.
#[derive(Clone, Copy)]
pub(crate) struct Either<L: Lane> {
    /// Null where it is one number.
    lanes: *const LanesOf<L>,
    one: L,
}

impl<N: Number, C: ClassOf<N>> Source<N, C> for Either<C::Lane> {
    #[inline(always)]
    fn open(state: &mut State<'_, N>, operand: Operand) -> Self {
        if operand.varying {
            Self {
                lanes: <Varying<C::Lane> as Source<N, C>>::open(state, operand).0,
                one: C::Lane::default(),
            }
        } else {
            Self {
                lanes: std::ptr::null(),
                one: <Uniform<C::Lane> as Source<N, C>>::open(state, operand).0,
            }
        }
    }

    #[inline(always)]
    unsafe fn block(self, entry: usize, lane: usize) -> BlockOf<C::Lane> {
        if self.lanes.is_null() {
            self.one.splat()
        } else {
            // SAFETY: as the caller promises.
            unsafe { <Varying<C::Lane> as Source<N, C>>::block(Varying(self.lanes), entry, lane) }
        }
    }
}

/// How a number type's handlers of arithmetic read their operands.
///
/// `f32` has a handler for every combination of registers of lanes and of one
/// number. The other types have one for all: they are compiled in a third of
/// the time, and a test per block is little beside their work.
pub(crate) trait Operands: Lane {
    type Varying<C: ClassOf<Self>>: Source<Self, C> + 'static
    where
        Self: Number;
    type Uniform<C: ClassOf<Self>>: Source<Self, C> + 'static
    where
        Self: Number;
}

impl Operands for f32 {
    type Varying<C: ClassOf<Self>> = Varying<C::Lane>;
    type Uniform<C: ClassOf<Self>> = Uniform<C::Lane>;
}

impl Operands for f64 {
    type Varying<C: ClassOf<Self>> = Either<C::Lane>;
    type Uniform<C: ClassOf<Self>> = Either<C::Lane>;
}

impl Operands for Shadow {
    type Varying<C: ClassOf<Self>> = Either<C::Lane>;
    type Uniform<C: ClassOf<Self>> = Either<C::Lane>;
}

/// Runs `$body` for each block of the lanes of register `$number`, which it
/// makes a value of from the block's place.
macro_rules! blocks {
    ($state:ident, $class:ty, $number:ident, |$entry:ident, $lane:ident, $old:ident| $body:expr) => {{
        let (chunks, stride) = ($state.chunks, $state.registers.stride);
        let file = <$class as ClassOf<N>>::file(&mut $state.registers);
        debug_assert!(chunks * stride <= file.len() && usize::from($number) < stride);
        let first = file.as_mut_ptr().wrapping_add(usize::from($number));
        let (mut $entry, mut left) = (0, chunks);
        while left > 0 {
            let mut $lane = 0;
            while $lane < LANES {
                // SAFETY: as in `Varying::block`. Nothing else refers to the
                // files: what the body reads, it reads by value.
                unsafe {
                    let $old = || <$class as ClassOf<N>>::Lane::block(&*first.add($entry), $lane);
                    let new = $body;
                    <$class as ClassOf<N>>::Lane::set_block(&mut *first.add($entry), $lane, new);
                }
                $lane += BLOCK;
            }
            left -= 1;
            if left > 0 {
                // Opaque, or compilers make vectors of what several chunks have
                // in the same lane, out of memory that is far apart.
                $entry += std::hint::black_box(stride);
            }
        }
    }};
}

/// `d = f(a)`, lane by lane.
#[inline(always)]
pub(super) fn map1<N, CA, CD, A>(
    state: &mut State<'_, N>,
    d: u16,
    a: A,
    f: impl Fn(CA::Lane) -> CD::Lane,
) where
    N: Number,
    CA: ClassOf<N>,
    CD: ClassOf<N>,
    A: Source<N, CA>,
{
    blocks!(state, CD, d, |entry, lane, _old| {
        let a = a.block(entry, lane);
        let mut new = CD::Lane::default().splat();
        for k in 0..BLOCK {
            CD::Lane::set_in_block(&mut new, k, f(CA::Lane::of_block(&a, k)));
        }
        new
    });
}

/// `d = f(a, b)`, lane by lane.
#[inline(always)]
pub(super) fn map2<N, CA, CB, CD, A, B>(
    state: &mut State<'_, N>,
    d: u16,
    a: A,
    b: B,
    f: impl Fn(CA::Lane, CB::Lane) -> CD::Lane,
) where
    N: Number,
    CA: ClassOf<N>,
    CB: ClassOf<N>,
    CD: ClassOf<N>,
    A: Source<N, CA>,
    B: Source<N, CB>,
{
    blocks!(state, CD, d, |entry, lane, _old| {
        let (a, b) = (a.block(entry, lane), b.block(entry, lane));
        let mut new = CD::Lane::default().splat();
        for k in 0..BLOCK {
            let value = f(CA::Lane::of_block(&a, k), CB::Lane::of_block(&b, k));
            CD::Lane::set_in_block(&mut new, k, value);
        }
        new
    });
}

/// `d = f(a, b, c)`, lane by lane.
#[inline(always)]
pub(super) fn map3<N, CA, CB, CC, CD, A, B, C>(
    state: &mut State<'_, N>,
    d: u16,
    a: A,
    b: B,
    c: C,
    f: impl Fn(CA::Lane, CB::Lane, CC::Lane) -> CD::Lane,
) where
    N: Number,
    CA: ClassOf<N>,
    CB: ClassOf<N>,
    CC: ClassOf<N>,
    CD: ClassOf<N>,
    A: Source<N, CA>,
    B: Source<N, CB>,
    C: Source<N, CC>,
{
    blocks!(state, CD, d, |entry, lane, _old| {
        let (a, b, c) = (
            a.block(entry, lane),
            b.block(entry, lane),
            c.block(entry, lane),
        );
        let mut new = CD::Lane::default().splat();
        for k in 0..BLOCK {
            let value = f(
                CA::Lane::of_block(&a, k),
                CB::Lane::of_block(&b, k),
                CC::Lane::of_block(&c, k),
            );
            CD::Lane::set_in_block(&mut new, k, value);
        }
        new
    });
}

/// `d = f(a, b, c, e)`, lane by lane.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn map4<N, CA, CB, CC, CE, CD, A, B, C, E>(
    state: &mut State<'_, N>,
    d: u16,
    a: A,
    b: B,
    c: C,
    e: E,
    f: impl Fn(CA::Lane, CB::Lane, CC::Lane, CE::Lane) -> CD::Lane,
) where
    N: Number,
    CA: ClassOf<N>,
    CB: ClassOf<N>,
    CC: ClassOf<N>,
    CE: ClassOf<N>,
    CD: ClassOf<N>,
    A: Source<N, CA>,
    B: Source<N, CB>,
    C: Source<N, CC>,
    E: Source<N, CE>,
{
    blocks!(state, CD, d, |entry, lane, _old| {
        let (a, b) = (a.block(entry, lane), b.block(entry, lane));
        let (c, e) = (c.block(entry, lane), e.block(entry, lane));
        let mut new = CD::Lane::default().splat();
        for k in 0..BLOCK {
            let value = f(
                CA::Lane::of_block(&a, k),
                CB::Lane::of_block(&b, k),
                CC::Lane::of_block(&c, k),
                CE::Lane::of_block(&e, k),
            );
            CD::Lane::set_in_block(&mut new, k, value);
        }
        new
    });
}

/// `d = f(d, a, b)`, lane by lane.
#[inline(always)]
pub(super) fn update2<N, CA, CB, CD, A, B>(
    state: &mut State<'_, N>,
    d: u16,
    a: A,
    b: B,
    f: impl Fn(CD::Lane, CA::Lane, CB::Lane) -> CD::Lane,
) where
    N: Number,
    CA: ClassOf<N>,
    CB: ClassOf<N>,
    CD: ClassOf<N>,
    A: Source<N, CA>,
    B: Source<N, CB>,
{
    blocks!(state, CD, d, |entry, lane, old| {
        let (a, b) = (a.block(entry, lane), b.block(entry, lane));
        let mut new = old();
        for k in 0..BLOCK {
            let value = f(
                CD::Lane::of_block(&new, k),
                CA::Lane::of_block(&a, k),
                CB::Lane::of_block(&b, k),
            );
            CD::Lane::set_in_block(&mut new, k, value);
        }
        new
    });
}

/// What a chain computes of the registers of these numbers, lane by lane.
#[inline(always)]
pub(super) fn map_chain<N, O, const STEPS: bool, const V: usize, const F: usize, const I: usize>(
    state: &mut State<'_, N>,
    d: u16,
    lanes: &[u16; V],
    numbers: &[u16; F],
    bits: &[u16; I],
) where
    N: Number,
    O: Chained<N, V, F, I>,
{
    let number = |number, varying| Operand { number, varying };
    let none = Varying::<N>(std::ptr::null());
    let (mut sources, mut same, mut same_bits) = ([none; V], [N::default(); F], [0; I]);
    for k in 0..V {
        sources[k] = <Varying<N> as Source<N, Float>>::open(state, number(lanes[k], true));
    }
    for k in 0..F {
        let one = <Uniform<N> as Source<N, Float>>::open(state, number(numbers[k], false));
        same[k] = one.0;
    }
    for k in 0..I {
        let one = <Uniform<u32> as Source<N, Int>>::open(state, number(bits[k], false));
        same_bits[k] = one.0;
    }
    blocks!(state, Float, d, |entry, lane, _old| {
        let mut from = [N::default().splat(); V];
        for k in 0..V {
            from[k] = <Varying<N> as Source<N, Float>>::block(sources[k], entry, lane);
        }
        let mut new = N::default().splat();
        for k in 0..BLOCK {
            let mut values = [N::default(); V];
            for v in 0..V {
                values[v] = N::of_block(&from[v], k);
            }
            N::set_in_block(&mut new, k, O::eval::<STEPS>(values, same, same_bits));
        }
        new
    });
}

//! Register files: many lanes of one number each.

use crate::num::{Number, Shadow};

/// Lanes of a register, or of a part of one where a workgroup is larger.
pub(crate) const LANES: usize = 64;

/// Lanes that a loop handles together.
pub(crate) const BLOCK: usize = 16;

/// What a register has one of per lane.
///
/// How lanes lie in memory is the type's choice, so that loops over numbers of
/// several parts are vector code for each part.
pub(crate) trait Lane: Copy + Default + Send + Sync + 'static {
    /// [`LANES`] of them.
    type Lanes: Copy + Default + Send + Sync + 'static;
    /// [`BLOCK`] of them.
    type Block: Copy;

    fn get(lanes: &Self::Lanes, lane: usize) -> Self;
    fn set(lanes: &mut Self::Lanes, lane: usize, value: Self);
    /// The lanes from `lane` on, a multiple of [`BLOCK`].
    fn block(lanes: &Self::Lanes, lane: usize) -> Self::Block;
    fn set_block(lanes: &mut Self::Lanes, lane: usize, block: Self::Block);

    fn splat(self) -> Self::Block;
    fn of_block(block: &Self::Block, at: usize) -> Self;
    fn set_in_block(block: &mut Self::Block, at: usize, value: Self);
}

macro_rules! simple_lane {
    ($($lane:ty),*) => {
        $(impl Lane for $lane {
            type Lanes = Lanes<Self>;
            type Block = [Self; BLOCK];

            #[inline(always)]
            fn get(lanes: &Lanes<Self>, lane: usize) -> Self {
                lanes.0[lane]
            }
            #[inline(always)]
            fn set(lanes: &mut Lanes<Self>, lane: usize, value: Self) {
                lanes.0[lane] = value;
            }
            #[inline(always)]
            fn block(lanes: &Lanes<Self>, lane: usize) -> Self::Block {
                lanes.0.as_chunks().0[lane / BLOCK]
            }
            #[inline(always)]
            fn set_block(lanes: &mut Lanes<Self>, lane: usize, block: Self::Block) {
                lanes.0.as_chunks_mut().0[lane / BLOCK] = block;
            }

            #[inline(always)]
            fn splat(self) -> Self::Block {
                [self; BLOCK]
            }
            #[inline(always)]
            fn of_block(block: &Self::Block, at: usize) -> Self {
                block[at]
            }
            #[inline(always)]
            fn set_in_block(block: &mut Self::Block, at: usize, value: Self) {
                block[at] = value;
            }
        })*
    };
}

simple_lane!(u32, f32, f64);

/// The parts of [`Shadow`] lanes, apart.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Parts<S, D> {
    single: S,
    double: D,
}

impl Lane for Shadow {
    type Lanes = Parts<Lanes<f32>, Lanes<f64>>;
    type Block = Parts<[f32; BLOCK], [f64; BLOCK]>;

    #[inline(always)]
    fn get(lanes: &Self::Lanes, lane: usize) -> Self {
        Self {
            single: lanes.single.0[lane],
            double: lanes.double.0[lane],
        }
    }
    #[inline(always)]
    fn set(lanes: &mut Self::Lanes, lane: usize, value: Self) {
        lanes.single.0[lane] = value.single;
        lanes.double.0[lane] = value.double;
    }
    #[inline(always)]
    fn block(lanes: &Self::Lanes, lane: usize) -> Self::Block {
        Parts {
            single: f32::block(&lanes.single, lane),
            double: f64::block(&lanes.double, lane),
        }
    }
    #[inline(always)]
    fn set_block(lanes: &mut Self::Lanes, lane: usize, block: Self::Block) {
        f32::set_block(&mut lanes.single, lane, block.single);
        f64::set_block(&mut lanes.double, lane, block.double);
    }

    #[inline(always)]
    fn splat(self) -> Self::Block {
        Parts {
            single: self.single.splat(),
            double: self.double.splat(),
        }
    }
    #[inline(always)]
    fn of_block(block: &Self::Block, at: usize) -> Self {
        Self {
            single: block.single[at],
            double: block.double[at],
        }
    }
    #[inline(always)]
    fn set_in_block(block: &mut Self::Block, at: usize, value: Self) {
        block.single[at] = value.single;
        block.double[at] = value.double;
    }
}

/// One register, or a chunk of one: cache lines of lanes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Lanes<T>(pub(crate) [T; LANES]);

impl<T: Copy + Default> Default for Lanes<T> {
    fn default() -> Self {
        Self([T::default(); LANES])
    }
}

/// Which register file a value lives in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Class {
    /// Floating point, in the number type of the execution.
    Float,
    /// 32-bit integers, and booleans as all zeros or all ones.
    Int,
}

/// All registers of one worker.
///
/// A register of lanes has as many entries in its file as a batch has chunks,
/// `stride` apart, so that the registers of the first chunk, usually the only
/// one, are next to each other.
#[derive(Debug, Default)]
pub(crate) struct Registers<N: Lane> {
    pub(crate) floats: Vec<N::Lanes>,
    pub(crate) ints: Vec<Lanes<u32>>,
    pub(crate) uniform_floats: Vec<N>,
    pub(crate) uniform_ints: Vec<u32>,
    /// Entries between the chunks of a register of lanes, in both files.
    pub(crate) stride: usize,
}

/// A [`Class`] as a type: its lanes and its files.
pub(crate) trait ClassOf<N: Number> {
    type Lane: Lane;

    fn from_bits(bits: u32) -> Self::Lane;
    fn to_bits(lane: Self::Lane) -> u32;

    /// Whichever of the two is of the class.
    fn pick(number: N, int: u32) -> Self::Lane;
    /// The lane as the one that it is, and the other zero.
    fn parts(lane: Self::Lane) -> (N, u32);

    fn uniforms(registers: &mut Registers<N>) -> &mut Vec<Self::Lane>;
    fn file(registers: &mut Registers<N>) -> &mut Vec<<Self::Lane as Lane>::Lanes>;
}

/// [`Class::Float`] as a type.
pub(crate) struct Float;
/// [`Class::Int`] as a type.
pub(crate) struct Int;

macro_rules! class {
    ($class:ident, $lane:ty, $file:ident, $uniform:ident, $from:expr, $to:expr, $pick:expr, $parts:expr) => {
        impl<N: Number> ClassOf<N> for $class {
            type Lane = $lane;

            #[inline(always)]
            fn from_bits(bits: u32) -> $lane {
                let from: fn(u32) -> $lane = $from;
                from(bits)
            }
            #[inline(always)]
            fn to_bits(lane: $lane) -> u32 {
                let to: fn($lane) -> u32 = $to;
                to(lane)
            }
            #[inline(always)]
            fn pick(number: N, int: u32) -> $lane {
                let pick: fn(N, u32) -> $lane = $pick;
                pick(number, int)
            }
            #[inline(always)]
            fn parts(lane: $lane) -> (N, u32) {
                let parts: fn($lane) -> (N, u32) = $parts;
                parts(lane)
            }
            #[inline(always)]
            fn uniforms(registers: &mut Registers<N>) -> &mut Vec<$lane> {
                &mut registers.$uniform
            }
            #[inline(always)]
            fn file(registers: &mut Registers<N>) -> &mut Vec<<$lane as Lane>::Lanes> {
                &mut registers.$file
            }
        }
    };
}

class!(
    Float,
    N,
    floats,
    uniform_floats,
    |bits| N::from_f32(f32::from_bits(bits)),
    |lane| lane.to_f32().to_bits(),
    |number, _| number,
    |lane| (lane, 0)
);
class!(
    Int,
    u32,
    ints,
    uniform_ints,
    |bits| bits,
    |lane| lane,
    |_, int| int,
    |lane| (N::default(), lane)
);

//! Register files: many lanes of one number each.

use crate::num::Number;

/// Lanes of a register, or of a part of one where a workgroup is larger.
pub(crate) const LANES: usize = 64;

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
pub(crate) struct Registers<N> {
    pub(crate) floats: Vec<Lanes<N>>,
    pub(crate) ints: Vec<Lanes<u32>>,
    pub(crate) uniform_floats: Vec<N>,
    pub(crate) uniform_ints: Vec<u32>,
    /// Entries between the chunks of a register of lanes, in both files.
    pub(crate) stride: usize,
}

/// A [`Class`] as a type: its lanes and its files.
pub(crate) trait ClassOf<N> {
    type Lane: Copy + Default + Send + Sync;

    fn from_bits(bits: u32) -> Self::Lane;
    fn to_bits(lane: Self::Lane) -> u32;

    fn uniforms(registers: &mut Registers<N>) -> &mut Vec<Self::Lane>;
    fn file(registers: &mut Registers<N>) -> &mut Vec<Lanes<Self::Lane>>;
}

/// [`Class::Float`] as a type.
pub(crate) struct Float;
/// [`Class::Int`] as a type.
pub(crate) struct Int;

macro_rules! class {
    ($class:ident, $lane:ty, $file:ident, $uniform:ident, $from:expr, $to:expr) => {
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
            fn uniforms(registers: &mut Registers<N>) -> &mut Vec<$lane> {
                &mut registers.$uniform
            }
            #[inline(always)]
            fn file(registers: &mut Registers<N>) -> &mut Vec<Lanes<$lane>> {
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
    |lane| lane.to_f32().to_bits()
);
class!(Int, u32, ints, uniform_ints, |bits| bits, |lane| lane);

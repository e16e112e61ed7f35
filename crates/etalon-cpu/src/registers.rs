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

/// All registers of one worker. A register of lanes has `chunks` consecutive
/// entries in its file.
#[derive(Debug, Default)]
pub(crate) struct Registers<N> {
    pub(crate) floats: Vec<Lanes<N>>,
    pub(crate) ints: Vec<Lanes<u32>>,
    pub(crate) uniform_floats: Vec<N>,
    pub(crate) uniform_ints: Vec<u32>,
}

/// A register file without the one register that is being written.
pub(crate) struct Others<'a, T> {
    before: &'a [Lanes<T>],
    after: &'a [Lanes<T>],
}

impl<'a, T> Others<'a, T> {
    /// All of a file, and one of it to write; `at` is in range.
    #[inline(always)]
    fn split(file: &'a mut [Lanes<T>], at: usize) -> (&'a mut Lanes<T>, Self) {
        let (before, rest) = file.split_at_mut(at);
        let (written, after) = rest.split_at_mut(1);
        (&mut written[0], Self { before, after })
    }

    #[inline(always)]
    fn all(file: &'a [Lanes<T>]) -> Self {
        Self {
            before: file,
            after: &[],
        }
    }

    /// The register `at`, which is not the one being written.
    #[inline(always)]
    pub(crate) fn get(&self, at: usize) -> &'a Lanes<T> {
        if at < self.before.len() {
            &self.before[at]
        } else {
            &self.after[at - self.before.len() - 1]
        }
    }
}

/// What can be read while a register is written.
pub(crate) struct Rest<'a, N> {
    floats: Others<'a, N>,
    ints: Others<'a, u32>,
}

/// A [`Class`] as a type: its lanes and its files.
pub(crate) trait ClassOf<N> {
    type Lane: Copy + Default + Send + Sync;
    const CLASS: Class;

    fn from_bits(bits: u32) -> Self::Lane;
    fn to_bits(lane: Self::Lane) -> u32;

    fn uniform(registers: &Registers<N>, at: usize) -> Self::Lane;
    fn set_uniform(registers: &mut Registers<N>, at: usize, lane: Self::Lane);
    fn lanes(registers: &Registers<N>, at: usize) -> &Lanes<Self::Lane>;
    fn lanes_mut(registers: &mut Registers<N>, at: usize) -> &mut Lanes<Self::Lane>;
    /// A register to write, and the others to read.
    fn split(registers: &mut Registers<N>, at: usize) -> (&mut Lanes<Self::Lane>, Rest<'_, N>);
    fn other<'a>(rest: &Rest<'a, N>, at: usize) -> &'a Lanes<Self::Lane>;
}

/// [`Class::Float`] as a type.
pub(crate) struct Float;
/// [`Class::Int`] as a type.
pub(crate) struct Int;

macro_rules! class {
    ($class:ident, $lane:ty, $file:ident, $other:ident, $uniform:ident, $from:expr, $to:expr) => {
        impl<N: Number> ClassOf<N> for $class {
            type Lane = $lane;
            const CLASS: Class = Class::$class;

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
            fn uniform(registers: &Registers<N>, at: usize) -> $lane {
                registers.$uniform[at]
            }
            #[inline(always)]
            fn set_uniform(registers: &mut Registers<N>, at: usize, lane: $lane) {
                registers.$uniform[at] = lane;
            }
            #[inline(always)]
            fn lanes(registers: &Registers<N>, at: usize) -> &Lanes<$lane> {
                &registers.$file[at]
            }
            #[inline(always)]
            fn lanes_mut(registers: &mut Registers<N>, at: usize) -> &mut Lanes<$lane> {
                &mut registers.$file[at]
            }
            #[inline(always)]
            fn split(registers: &mut Registers<N>, at: usize) -> (&mut Lanes<$lane>, Rest<'_, N>) {
                let (written, $file) = Others::split(&mut registers.$file, at);
                let $other = Others::all(&registers.$other);
                (written, Rest { $file, $other })
            }
            #[inline(always)]
            fn other<'a>(rest: &Rest<'a, N>, at: usize) -> &'a Lanes<$lane> {
                rest.$file.get(at)
            }
        }
    };
}

class!(
    Float,
    N,
    floats,
    ints,
    uniform_floats,
    |bits| N::from_f32(f32::from_bits(bits)),
    |lane| lane.to_f32().to_bits()
);
class!(Int, u32, ints, floats, uniform_ints, |bits| bits, |lane| {
    lane
});

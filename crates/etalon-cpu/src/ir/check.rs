//! Instructions that look for what a GPU hides. They are there only in programs
//! that ask for them, have no results, and look at active invocations alone.

use std::fmt;

use super::{Class, ImageAccess, Memory, Slots};

/// What is indexed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Indexed {
    Array,
    Vector,
    Matrix,
}

/// How memory is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Access {
    Read,
    Write,
    /// An atomic read, write or both; `reads` unless it only stores.
    Atomic {
        reads: bool,
    },
}

impl Access {
    pub(crate) fn reads(self) -> bool {
        matches!(self, Self::Read | Self::Atomic { reads: true })
    }

    pub(crate) fn writes(self) -> bool {
        !matches!(self, Self::Read)
    }
}

/// A check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Check {
    /// Operands: the index and the number of elements.
    Index { of: Indexed, signed: bool },
    /// Operands: coordinates, layer and level, as for loads and stores of texels.
    Texel {
        access: ImageAccess,
        level: bool,
        signed: bool,
    },
    /// Operand: the layer that is sampled.
    Layer { image: u16 },
    /// Operand: the level that is asked about.
    Level { image: u16 },
    /// Operands: dividends, each with its divisor.
    Division { signed: bool },
    /// Operands: amounts.
    Shift,
    /// Operands: numbers that become integers.
    Conversion { signed: bool },
    /// Operands: groups of so many, each a result and what it is made of.
    NonFinite { group: u16 },
    /// That all invocations are here.
    Barrier,
    /// What has been used before is ordered before what follows.
    Order {
        workgroup: bool,
        storage: bool,
        texture: bool,
    },
    /// Slots that hold no value yet.
    Forget { first: Slots, count: Slots },
    /// Operands: computed parts of the slots of floats and of integers, if any.
    Memory {
        memory: Memory,
        first: Slots,
        count: Slots,
        access: Access,
    },
    /// Operand: the computed part of the word's index, if any.
    Buffer {
        buffer: u16,
        offset: u32,
        words: u32,
        access: Access,
    },
    /// Operands as for [`Check::Texel`].
    TexelMemory {
        image: ImageAccess,
        level: bool,
        access: Access,
    },
    /// Operands: coordinates, layer, level, as for samples.
    SampleMemory { access: ImageAccess, sampler: u16 },
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Index { of, signed } => write!(f, "check.index.{} {of:?}", sign(signed)),
            Self::Texel { access, .. } => write!(f, "check.texel b{}", access.image),
            Self::Layer { image } => write!(f, "check.layer b{image}"),
            Self::Level { image } => write!(f, "check.level b{image}"),
            Self::Division { signed } => write!(f, "check.division.{}", sign(signed)),
            Self::Shift => f.write_str("check.shift"),
            Self::Conversion { signed } => write!(f, "check.conversion.{}", sign(signed)),
            Self::NonFinite { group } => write!(f, "check.nonfinite /{group}"),
            Self::Barrier => f.write_str("check.barrier"),
            Self::Order { .. } => f.write_str("check.order"),
            Self::Forget { first, count } => {
                write!(f, "check.forget {}", Range(first, count))
            }
            Self::Memory {
                memory,
                first,
                count,
                access,
            } => write!(
                f,
                "check.memory {memory:?}+{} {access:?}",
                Range(first, count)
            ),
            Self::Buffer {
                buffer,
                offset,
                words,
                access,
            } => write!(f, "check.buffer b{buffer}+{offset}..{words} {access:?}"),
            Self::TexelMemory { image, access, .. } => {
                write!(f, "check.texel.memory b{} {access:?}", image.image)
            }
            Self::SampleMemory { access, sampler } => {
                write!(f, "check.sample.memory b{} b{sampler}", access.image)
            }
        }
    }
}

fn sign(signed: bool) -> char {
    if signed { 's' } else { 'u' }
}

/// Slots of both classes for the listing.
struct Range(Slots, Slots);

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(first, count) = self;
        write!(
            f,
            "f{}..{} i{}..{}",
            first.float, count.float, first.int, count.int
        )
    }
}

impl Slots {
    /// Those of a class.
    pub(crate) fn of(self, class: Class) -> u32 {
        match class {
            Class::Float => self.float,
            Class::Int => self.int,
        }
    }
}

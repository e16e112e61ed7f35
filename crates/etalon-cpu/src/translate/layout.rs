//! How composite types come apart into scalars.

use naga::{ArraySize, Handle, ScalarKind, Type, TypeInner};

use super::{Fail, Translator};
use crate::ir::{Class, Slots};

/// One scalar of a type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) kind: ScalarKind,
    /// Whether it is an `f16`.
    pub(super) is_half: bool,
    /// Whether it is an integer of 16 bits.
    pub(super) is_short: bool,
    /// Where it lies in host-shareable memory, in bytes from the start of the type.
    pub(super) offset: u32,
}

impl Leaf {
    pub(super) fn class(self) -> Class {
        class_of(self.kind)
    }
}

pub(super) fn class_of(kind: ScalarKind) -> Class {
    if kind == ScalarKind::Float {
        Class::Float
    } else {
        Class::Int
    }
}

/// Most scalars a single value may have: a limit on what is flattened, so that
/// no declaration can make translation run out of memory.
const MAX_LEAVES: usize = 1 << 16;

impl<'a> Translator<'a> {
    /// The scalars of a type in order.
    pub(super) fn leaves(&self, ty: &TypeInner) -> Result<Vec<Leaf>, Fail> {
        let mut leaves = Vec::new();
        self.collect_leaves(ty, 0, &mut leaves)?;
        Ok(leaves)
    }

    fn collect_leaves(&self, ty: &TypeInner, offset: u32, out: &mut Vec<Leaf>) -> Result<(), Fail> {
        if out.len() > MAX_LEAVES {
            return Err(Fail::TooLarge {
                what: "number of scalars in a value",
                size: out.len() as u64,
                limit: MAX_LEAVES as u64,
            });
        }
        match *ty {
            TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) => out.push(Leaf {
                kind: supported(scalar)?,
                is_half: is_half(scalar),
                is_short: is_short(scalar),
                offset,
            }),
            TypeInner::Vector { size, scalar } => {
                let kind = supported(scalar)?;
                out.extend((0..size as u32).map(|i| Leaf {
                    kind,
                    is_half: is_half(scalar),
                    is_short: is_short(scalar),
                    offset: offset.saturating_add(bytes(scalar) * i),
                }));
            }
            TypeInner::Matrix {
                columns,
                rows,
                scalar,
            } => {
                let kind = supported(scalar)?;
                for column in 0..columns as u32 {
                    let start = offset.saturating_add(column * column_stride(rows, scalar));
                    out.extend((0..rows as u32).map(|row| Leaf {
                        kind,
                        is_half: is_half(scalar),
                        is_short: is_short(scalar),
                        offset: start.saturating_add(bytes(scalar) * row),
                    }));
                }
            }
            TypeInner::Array { base, size, stride } => {
                let count = fixed_length(size)?;
                for i in 0..count {
                    self.collect_leaves(
                        &self.module.types[base].inner,
                        offset.saturating_add(i.saturating_mul(stride)),
                        out,
                    )?;
                }
            }
            TypeInner::Struct { ref members, .. } => {
                for member in members {
                    self.collect_leaves(
                        &self.module.types[member.ty].inner,
                        offset.saturating_add(member.offset),
                        out,
                    )?;
                }
            }
            ref other => {
                return Err(Fail::unsupported(format!(
                    "values of type {}",
                    describe(other)
                )));
            }
        }
        Ok(())
    }

    /// How many memory slots of each class a type takes.
    pub(super) fn slots(&self, ty: &TypeInner) -> Result<Slots, Fail> {
        let mut slots = Slots::default();
        for leaf in self.leaves(ty)? {
            match leaf.class() {
                Class::Float => slots.float += 1,
                Class::Int => slots.int += 1,
            }
        }
        Ok(slots)
    }

    pub(super) fn inner(&self, ty: Handle<Type>) -> &'a TypeInner {
        &self.module.types[ty].inner
    }
}

/// Bytes of a scalar in memory that the host sees.
pub(super) fn bytes(scalar: naga::Scalar) -> u32 {
    if scalar.width == 2 { 2 } else { 4 }
}

pub(super) fn is_half(scalar: naga::Scalar) -> bool {
    scalar == naga::Scalar::F16
}

/// Whether a scalar is an integer of 16 bits. WGSL has none, but naga makes the
/// exponent of an `f16`'s `frexp` one, and a bit cast of `f16` gives one. They
/// are kept in 32 bits, extended by their sign if they have one.
pub(super) fn is_short(scalar: naga::Scalar) -> bool {
    matches!(scalar, naga::Scalar::I16 | naga::Scalar::U16)
}

/// Bytes from one column of a matrix to the next: columns are aligned as
/// vectors are (WGSL §14.4.1).
pub(super) fn column_stride(rows: naga::VectorSize, scalar: naga::Scalar) -> u32 {
    bytes(scalar) * if rows == naga::VectorSize::Bi { 2 } else { 4 }
}

pub(super) fn fixed_length(size: ArraySize) -> Result<u32, Fail> {
    match size {
        ArraySize::Constant(count) => Ok(count.get()),
        ArraySize::Pending(_) => Err(Fail::invalid(
            "an array's size is an override that was not resolved",
        )),
        ArraySize::Dynamic => Err(Fail::invalid("a runtime-sized array is used as a value")),
    }
}

fn supported(scalar: naga::Scalar) -> Result<ScalarKind, Fail> {
    match (scalar.kind, scalar.width) {
        (ScalarKind::Bool, _)
        | (ScalarKind::Float, 2 | 4)
        | (ScalarKind::Sint | ScalarKind::Uint, 2 | 4) => Ok(scalar.kind),
        (kind, width) => Err(Fail::unsupported(format!(
            "{}-bit {} scalars",
            u32::from(width) * 8,
            describe_kind(kind)
        ))),
    }
}

fn describe_kind(kind: ScalarKind) -> &'static str {
    match kind {
        ScalarKind::Sint => "signed integer",
        ScalarKind::Uint => "unsigned integer",
        ScalarKind::Float => "floating-point",
        ScalarKind::Bool => "boolean",
        ScalarKind::AbstractInt | ScalarKind::AbstractFloat => "abstract",
    }
}

/// A type for an error message.
pub(super) fn describe(ty: &TypeInner) -> &'static str {
    match ty {
        TypeInner::Scalar(_) => "scalar",
        TypeInner::Vector { .. } => "vector",
        TypeInner::Matrix { .. } => "matrix",
        TypeInner::CooperativeMatrix { .. } => "cooperative matrix",
        TypeInner::Atomic(_) => "atomic",
        TypeInner::Pointer { .. } | TypeInner::ValuePointer { .. } => "pointer",
        TypeInner::Array { .. } => "array",
        TypeInner::Struct { .. } => "struct",
        TypeInner::Image { .. } => "texture",
        TypeInner::Sampler { .. } => "sampler",
        TypeInner::AccelerationStructure { .. } => "acceleration structure",
        TypeInner::RayQuery { .. } => "ray query",
        TypeInner::BindingArray { .. } => "binding array",
    }
}

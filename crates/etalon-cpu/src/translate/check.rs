//! Inserts the checks that a program is to make.

use naga::{BinaryOperator, Expression, Handle, MathFunction, ScalarKind, TypeInner};

use super::place::{Place, Root};
use super::{Fail, Frame, Translator};
use crate::binding::BindingKind;
use crate::finding::Checks;
use crate::ir::{Access, Check, Class, ImageAccess, Indexed, Memory, Op, Value};

impl<'a> Translator<'a> {
    pub(super) fn checks(&self) -> Checks {
        self.builder.tree.resources.checks
    }

    fn check(&mut self, check: Check, operands: &[Value]) {
        self.builder.op(Op::Check(check), operands, &[]);
    }

    /// That an index is one of `length`'s elements.
    pub(super) fn check_index(
        &mut self,
        of: &TypeInner,
        index: Value,
        length: Value,
        signed: bool,
    ) {
        let inside = match (
            self.builder.constant_bits(index),
            self.builder.constant_bits(length),
        ) {
            (Some(index), Some(length)) => index < length,
            _ => false,
        };
        if !self.checks().bounds || inside {
            return;
        }
        let of = match of {
            TypeInner::Vector { .. } => Indexed::Vector,
            TypeInner::Matrix { .. } => Indexed::Matrix,
            _ => Indexed::Array,
        };
        self.check(Check::Index { of, signed }, &[index, length]);
    }

    /// [`Translator::check_index`] for what a pointer points at.
    pub(super) fn check_place_index(
        &mut self,
        place: &Place,
        index: Value,
        signed: bool,
    ) -> Result<(), Fail> {
        if !self.checks().bounds {
            return Ok(());
        }
        let length = match self.length_of(&place.ty)? {
            Some(length) => self.builder.int(length),
            None => self.runtime_length(place)?,
        };
        self.check_index(&place.ty, index, length, signed);
        Ok(())
    }

    /// That coordinates, layer and level are of the texture, and for a read that
    /// something wrote the texel.
    pub(super) fn check_texel(
        &mut self,
        image: ImageAccess,
        level: bool,
        signed: bool,
        access: Access,
        operands: &[Value],
    ) {
        let checks = self.checks();
        if checks.bounds {
            self.check(
                Check::Texel {
                    access: image,
                    level,
                    signed,
                },
                operands,
            );
        }
        let storage = !level;
        if checks.uninitialised || checks.races && storage {
            self.check(
                Check::TexelMemory {
                    image,
                    level,
                    access,
                },
                operands,
            );
        }
    }

    /// That the layer that is sampled exists. Operands are coordinates and layer.
    pub(super) fn check_layer(&mut self, access: ImageAccess, place: &[Value]) {
        if let Some(&layer) = place.get(usize::from(access.coordinates))
            && self.checks().bounds
            && access.layered
        {
            let image = access.image;
            self.check(Check::Layer { image }, &[layer]);
        }
    }

    /// That something wrote the texels that a sample or gather at a level of detail
    /// reads, given coordinates and layer.
    pub(super) fn check_sample(
        &mut self,
        access: ImageAccess,
        sampler: u16,
        place: &[Value],
        lod: Value,
    ) {
        if self.checks().uninitialised {
            let operands: Vec<Value> = place.iter().copied().chain([lod]).collect();
            self.check(Check::SampleMemory { access, sampler }, &operands);
        }
    }

    /// That a texture has the level that is asked about.
    pub(super) fn check_level(&mut self, image: u16, level: Value) {
        if self.checks().bounds && self.builder.constant_bits(level) != Some(0) {
            self.check(Check::Level { image }, &[level]);
        }
    }

    /// Of the operands of an integer operation, component by component.
    pub(super) fn check_integers(
        &mut self,
        op: BinaryOperator,
        kind: ScalarKind,
        pairs: &[(Value, Value)],
    ) {
        let checks = self.checks();
        let signed = kind == ScalarKind::Sint;
        if !matches!(kind, ScalarKind::Sint | ScalarKind::Uint) {
            return;
        }
        let right = |builder: &super::builder::Builder, pair: &(Value, Value)| {
            builder.constant_bits(pair.1)
        };
        match op {
            BinaryOperator::Divide | BinaryOperator::Modulo if checks.division => {
                let operands: Vec<Value> = pairs
                    .iter()
                    .filter(|pair| match right(&self.builder, pair) {
                        Some(0) | None => true,
                        Some(divisor) => signed && divisor == u32::MAX,
                    })
                    .flat_map(|&(a, b)| [a, b])
                    .collect();
                if !operands.is_empty() {
                    self.check(Check::Division { signed }, &operands);
                }
            }
            BinaryOperator::ShiftLeft | BinaryOperator::ShiftRight if checks.shifts => {
                let amounts: Vec<Value> = pairs
                    .iter()
                    .filter(|pair| right(&self.builder, pair).is_none_or(|amount| amount >= 32))
                    .map(|pair| pair.1)
                    .collect();
                if !amounts.is_empty() {
                    self.check(Check::Shift, &amounts);
                }
            }
            _ => {}
        }
    }

    /// That numbers are in the range of the integer type they are converted to.
    pub(super) fn check_conversion(&mut self, values: &[Value], from: ScalarKind, to: ScalarKind) {
        let integer = matches!(to, ScalarKind::Sint | ScalarKind::Uint);
        if self.checks().conversions && from == ScalarKind::Float && integer {
            let signed = to == ScalarKind::Sint;
            self.check(Check::Conversion { signed }, values);
        }
    }

    /// That an expression does not make a NaN or infinity of finite operands.
    /// `results` are its scalars.
    pub(super) fn check_finite(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
        results: &[Value],
    ) -> Result<(), Fail> {
        if !self.checks().non_finite {
            return Ok(());
        }
        let (operands, by_component) = match frame.function.expressions[expression] {
            Expression::Binary {
                op:
                    op @ (BinaryOperator::Add
                    | BinaryOperator::Subtract
                    | BinaryOperator::Multiply
                    | BinaryOperator::Divide
                    | BinaryOperator::Modulo),
                left,
                right,
            } => {
                let is_matrix = |this: &Self, operand| {
                    matches!(this.ty(frame, operand), TypeInner::Matrix { .. })
                };
                let product = op == BinaryOperator::Multiply
                    && (is_matrix(self, left) || is_matrix(self, right))
                    && !matches!(self.ty(frame, left), TypeInner::Scalar(_))
                    && !matches!(self.ty(frame, right), TypeInner::Scalar(_));
                (vec![left, right], !product)
            }
            Expression::Math {
                fun,
                arg,
                arg1,
                arg2,
                arg3,
            } => {
                if is_of_bits(fun) {
                    return Ok(());
                }
                let operands = [Some(arg), arg1, arg2, arg3].into_iter().flatten();
                (operands.collect(), !is_of_vectors(fun))
            }
            Expression::As {
                expr,
                kind: ScalarKind::Float,
                convert: Some(_),
            } => (vec![expr], true),
            _ => return Ok(()),
        };
        let operands = operands
            .into_iter()
            .map(|operand| self.scalars(frame, operand))
            .collect::<Result<Vec<_>, _>>()?;
        let width = operands.iter().map(Vec::len).max().unwrap_or(1);
        // Groups of a result and what it is made of.
        let mut groups = Vec::new();
        let mut group = 0;
        for (i, &result) in results.iter().enumerate() {
            let known = self
                .builder
                .constant_bits(result)
                .is_some_and(|bits| f32::from_bits(bits).is_finite());
            if self.builder.class(result) != Class::Float || known {
                continue;
            }
            groups.push(result);
            let before = groups.len();
            for values in &operands {
                if !by_component {
                    groups.extend(values);
                } else if values.len() == 1 {
                    groups.push(values[0]);
                } else if let Some(&value) = values.get(i % width) {
                    groups.push(value);
                }
            }
            group = 1 + groups.len() - before;
        }
        let Ok(group) = u16::try_from(group) else {
            return Err(Fail::invalid("a function with too many arguments"));
        };
        if group > 0 {
            self.check(Check::NonFinite { group }, &groups);
        }
        Ok(())
    }

    /// A barrier for the given kinds of memory.
    pub(super) fn barrier(&mut self, barrier: naga::Barrier) {
        let checks = self.checks();
        if checks.barriers {
            self.check(Check::Barrier, &[]);
        } else {
            self.builder.barrier();
        }
        if checks.races {
            self.check(
                Check::Order {
                    workgroup: barrier.contains(naga::Barrier::WORK_GROUP),
                    storage: barrier.contains(naga::Barrier::STORAGE),
                    texture: barrier.contains(naga::Barrier::TEXTURE),
                },
                &[],
            );
        }
    }

    /// Whether a variable of an invocation must be in memory so that reads of what
    /// nothing wrote are seen.
    pub(super) fn is_watched(&self, ty: &TypeInner, has_init: bool) -> bool {
        self.checks().uninitialised && !has_init && self.has_array(ty)
    }

    fn has_array(&self, ty: &TypeInner) -> bool {
        match ty {
            TypeInner::Array { .. } => true,
            TypeInner::Struct { members, .. } => members
                .iter()
                .any(|member| self.has_array(self.inner(member.ty))),
            _ => false,
        }
    }

    /// What a variable of an invocation holds is no value of the kernel's.
    pub(super) fn forget_place(&mut self, place: &Place) -> Result<(), Fail> {
        if let Root::Memory {
            memory: Memory::Private,
            slots,
            ..
        } = place.root
        {
            let count = self.slots(&place.ty)?;
            self.check(
                Check::Forget {
                    first: slots,
                    count,
                },
                &[],
            );
        }
        Ok(())
    }

    /// Notes that memory is used, where that is of interest.
    pub(super) fn check_memory(&mut self, place: &Place, access: Access) -> Result<(), Fail> {
        let checks = self.checks();
        if !checks.uninitialised && !checks.races {
            return Ok(());
        }
        let access = match (&place.ty, access) {
            (TypeInner::Atomic(_), Access::Read) => Access::Atomic { reads: true },
            (TypeInner::Atomic(_), Access::Write) => Access::Atomic { reads: false },
            (_, access) => access,
        };
        match place.root {
            Root::Variables { .. } => {}
            Root::Memory {
                memory,
                slots,
                computed,
            } => {
                if memory == Memory::Workgroup || checks.uninitialised {
                    let count = self.slots(&place.ty)?;
                    let operands: Vec<Value> =
                        computed.into_iter().flat_map(|(f, i)| [f, i]).collect();
                    let check = Check::Memory {
                        memory,
                        first: slots,
                        count,
                        access,
                    };
                    self.check(check, &operands);
                }
            }
            Root::Buffer {
                buffer,
                offset,
                computed,
                ..
            } => {
                let kind = self.bindings.get(usize::from(buffer)).map(|b| b.kind);
                let Some(BindingKind::Storage { writable, .. }) = kind else {
                    return Ok(());
                };
                if !checks.uninitialised && !writable {
                    return Ok(());
                }
                for (first, words) in self.words(&place.ty, offset)? {
                    let check = Check::Buffer {
                        buffer,
                        offset: first,
                        words,
                        access,
                    };
                    self.check(check, computed.as_slice());
                }
            }
        }
        Ok(())
    }

    /// The words of a type in a buffer, as runs of a first one and a number.
    fn words(&self, ty: &TypeInner, offset: u32) -> Result<Vec<(u32, u32)>, Fail> {
        let mut runs: Vec<(u32, u32)> = Vec::new();
        for leaf in self.leaves(ty)? {
            let word = offset.saturating_add(leaf.offset) / 4;
            match runs.last_mut() {
                Some((first, count)) if word == first.saturating_add(*count) => *count += 1,
                Some((first, count)) if word < first.saturating_add(*count) => {}
                _ => runs.push((word, 1)),
            }
        }
        Ok(runs)
    }
}

/// Functions whose operands are bits rather than numbers.
fn is_of_bits(function: MathFunction) -> bool {
    use MathFunction as M;
    matches!(
        function,
        M::Unpack4x8snorm
            | M::Unpack4x8unorm
            | M::Unpack2x16snorm
            | M::Unpack2x16unorm
            | M::Unpack2x16float
    )
}

/// Functions of whole vectors or matrices; all others work by component.
fn is_of_vectors(function: MathFunction) -> bool {
    use MathFunction as M;
    matches!(
        function,
        M::Dot
            | M::Length
            | M::Distance
            | M::Normalize
            | M::Cross
            | M::FaceForward
            | M::Reflect
            | M::Refract
            | M::Determinant
            | M::Transpose
            | M::Inverse
            | M::Outer
    )
}

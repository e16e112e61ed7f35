//! Subgroup built-ins.

use naga::{CollectiveOperation, Expression, GatherMode, Handle, ScalarKind, SubgroupOperation};

use super::layout::{class_of, is_half};
use super::{Fail, Frame, Operand, Translator};
use crate::ir::subgroup::{Combine, Scan, Source, SubgroupFunction};
use crate::ir::{Arith, Class, Input, Op, Value};

impl<'a> Translator<'a> {
    pub(super) fn subgroup_size(&mut self) -> Value {
        self.input(Input::SubgroupSize)
    }

    /// The number of a subgroup in its workgroup.
    pub(super) fn subgroup_id(&mut self) -> Value {
        let (index, size) = (self.input(Input::LocalIndex), self.subgroup_size());
        self.builder.arith(Arith::DivU, &[index, size])
    }

    /// The number of an invocation in its subgroup.
    pub(super) fn subgroup_invocation_id(&mut self) -> Value {
        let (index, size) = (self.input(Input::LocalIndex), self.subgroup_size());
        self.builder.arith(Arith::RemU, &[index, size])
    }

    /// Subgroups of a workgroup; the last one may not be full.
    pub(super) fn num_subgroups(&mut self) -> Value {
        let invocations = self.workgroup_size.iter().product();
        let (invocations, one) = (self.builder.int(invocations), self.builder.int(1));
        let size = self.subgroup_size();
        let last = self.builder.arith(Arith::SubI, &[size, one]);
        let sum = self.builder.arith(Arith::AddI, &[invocations, last]);
        self.builder.arith(Arith::DivU, &[sum, size])
    }

    pub(super) fn subgroup_ballot(
        &mut self,
        frame: &mut Frame<'a>,
        result: Handle<Expression>,
        predicate: Option<Handle<Expression>>,
    ) -> Result<(), Fail> {
        let predicate = match predicate {
            Some(predicate) => self.scalar(frame, predicate)?,
            None => self.builder.bool(true),
        };
        let words = self.builder.op(
            Op::Subgroup {
                function: SubgroupFunction::Ballot,
                class: Class::Int,
            },
            &[predicate],
            &[Class::Int; 4],
        );
        frame.operands.insert(result, Operand::Scalars(words));
        Ok(())
    }

    pub(super) fn subgroup_gather(
        &mut self,
        frame: &mut Frame<'a>,
        mode: GatherMode,
        argument: Handle<Expression>,
        result: Handle<Expression>,
    ) -> Result<(), Fail> {
        let (source, number) = match mode {
            GatherMode::BroadcastFirst => (Source::First, None),
            GatherMode::Broadcast(number) | GatherMode::Shuffle(number) => {
                (Source::Number, Some(self.scalar(frame, number)?))
            }
            GatherMode::ShuffleDown(delta) => (Source::After, Some(self.scalar(frame, delta)?)),
            GatherMode::ShuffleUp(delta) => (Source::Before, Some(self.scalar(frame, delta)?)),
            GatherMode::ShuffleXor(bits) => (Source::Xor, Some(self.scalar(frame, bits)?)),
            GatherMode::QuadBroadcast(number) => {
                (Source::InQuad, Some(self.scalar(frame, number)?))
            }
            GatherMode::QuadSwap(direction) => {
                let bits = match direction {
                    naga::Direction::X => 1,
                    naga::Direction::Y => 2,
                    naga::Direction::Diagonal => 3,
                };
                (Source::Xor, Some(self.builder.int(bits)))
            }
        };
        let values = self.scalars(frame, argument)?;
        let values = values
            .into_iter()
            .map(|value| {
                let operands: Vec<Value> = [value].into_iter().chain(number).collect();
                let class = self.builder.class(value);
                let function = SubgroupFunction::Gather(source);
                self.builder
                    .op(Op::Subgroup { function, class }, &operands, &[class])[0]
            })
            .collect();
        frame.operands.insert(result, Operand::Scalars(values));
        Ok(())
    }

    pub(super) fn subgroup_collective(
        &mut self,
        frame: &mut Frame<'a>,
        op: SubgroupOperation,
        collective: CollectiveOperation,
        argument: Handle<Expression>,
        result: Handle<Expression>,
    ) -> Result<(), Fail> {
        use ScalarKind as K;
        use SubgroupOperation as S;
        self.refuse_short(frame, argument)?;
        let kind = self.kind(frame, argument)?;
        let combine = match (op, kind) {
            // Booleans are all zeros or all ones.
            (S::All | S::And, _) => Combine::And,
            (S::Any | S::Or, _) => Combine::Or,
            (S::Xor, _) => Combine::Xor,
            (S::Add, _) => Combine::Add,
            (S::Mul, _) => Combine::Mul,
            (S::Min, K::Float) => Combine::MinF,
            (S::Min, K::Sint) => Combine::MinS,
            (S::Min, _) => Combine::MinU,
            (S::Max, K::Float) => Combine::MaxF,
            (S::Max, K::Sint) => Combine::MaxS,
            (S::Max, _) => Combine::MaxU,
        };
        let scan = match collective {
            CollectiveOperation::Reduce => Scan::Reduce,
            CollectiveOperation::InclusiveScan => Scan::Inclusive,
            CollectiveOperation::ExclusiveScan => Scan::Exclusive,
        };
        let half = self.ty(frame, argument).scalar().is_some_and(is_half);
        let class = class_of(kind);
        let function = SubgroupFunction::Combine(combine, scan);
        let values = self.scalars(frame, argument)?;
        let values = values
            .into_iter()
            .map(|value| {
                let value = self
                    .builder
                    .op(Op::Subgroup { function, class }, &[value], &[class])[0];
                if half {
                    self.builder.arith(Arith::RoundHalf, &[value])
                } else {
                    value
                }
            })
            .collect();
        frame.operands.insert(result, Operand::Scalars(values));
        Ok(())
    }
}

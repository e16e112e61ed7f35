//! Statements: control flow, calls, stores.

use std::collections::HashSet;

use naga::{Block, Expression, Function, Handle, Span, Statement, SwitchCase, SwitchValue};

use super::builder::FALSE;
use super::scan::{self, Root};
use super::{Fail, Frame, Operand, Translator};
use crate::ir::{Arith, AtomicFunction, ScopeId, Value, Variable};

/// How deep early exits turn what follows them into an `else` branch.
const MAX_ABSORBED: usize = 48;

/// Statements to translate one after the other, gathered from several blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Sequence<'a> {
    parts: Vec<(&'a Block, usize)>,
    absorbed: usize,
}

impl<'a> Sequence<'a> {
    pub(super) fn of(block: &'a Block) -> Self {
        Self {
            parts: vec![(block, 0)],
            absorbed: 0,
        }
    }

    fn next(&mut self) -> Option<(&'a Statement, Span)> {
        while let Some((block, position)) = self.parts.first_mut() {
            if let Some((statement, span)) = block.span_iter().nth(*position) {
                *position += 1;
                return Some((statement, *span));
            }
            self.parts.remove(0);
        }
        None
    }

    fn is_empty(&self) -> bool {
        self.parts
            .iter()
            .all(|(block, position)| *position >= block.len())
    }

    /// The statements of `block`, then those of `self`.
    fn after(&self, block: &'a Block) -> Self {
        let parts = [(block, 0)]
            .into_iter()
            .chain(self.parts.iter().copied())
            .collect();
        Self {
            parts,
            absorbed: self.absorbed + 1,
        }
    }
}

impl<'a> Translator<'a> {
    /// Translates statements. Leaving any scope of `tails` from their end is
    /// what happens anyway. Says whether their end can be reached.
    pub(super) fn block(
        &mut self,
        frame: &mut Frame<'a>,
        mut sequence: Sequence<'a>,
        tails: &[ScopeId],
    ) -> Result<bool, Fail> {
        while let Some((statement, span)) = sequence.next() {
            self.builder.span = span;
            self.builder.check_size()?;
            let here: &[ScopeId] = if sequence.is_empty() { tails } else { &[] };
            let falls_through = if let Statement::If {
                condition,
                accept,
                reject,
            } = statement
            {
                let condition = self.scalar(frame, *condition)?;
                // `if c { return x; } rest` is `if c { return x; } else { rest }`,
                // in which no lanes need be remembered as having returned.
                let skips = |block: &Block| {
                    target(frame, block).is_some_and(|scope| tails.contains(&scope))
                };
                let absorb = !sequence.is_empty()
                    && sequence.absorbed < MAX_ABSORBED
                    && skips(accept) != skips(reject);
                if absorb {
                    let (yes, no) = if skips(accept) {
                        (Sequence::of(accept), sequence.after(reject))
                    } else {
                        (sequence.after(accept), Sequence::of(reject))
                    };
                    return self.if_else(frame, condition, yes, no, tails);
                }
                self.if_else(
                    frame,
                    condition,
                    Sequence::of(accept),
                    Sequence::of(reject),
                    here,
                )?
            } else {
                self.statement(frame, statement, here)?
            };
            if !falls_through {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn if_else(
        &mut self,
        frame: &mut Frame<'a>,
        condition: Value,
        accept: Sequence<'a>,
        reject: Sequence<'a>,
        tails: &[ScopeId],
    ) -> Result<bool, Fail> {
        if let Some(bits) = self.builder.constant_bits(condition) {
            return self.block(frame, if bits == FALSE { reject } else { accept }, tails);
        }
        let before = self.builder.snapshot();
        self.builder.begin();
        let reached = self.block(frame, accept, tails)?;
        let accept = self.builder.end(reached);
        self.builder.restore(&before);
        self.builder.begin();
        let reached = self.block(frame, reject, tails)?;
        let reject = self.builder.end(reached);
        Ok(self.builder.finish_if(condition, &before, accept, reject))
    }

    fn statement(
        &mut self,
        frame: &mut Frame<'a>,
        statement: &'a Statement,
        tails: &[ScopeId],
    ) -> Result<bool, Fail> {
        match statement {
            Statement::Emit(range) => {
                for expression in range.clone() {
                    self.emit(frame, expression)?;
                }
            }
            Statement::Block(block) => return self.block(frame, Sequence::of(block), tails),
            Statement::If { .. } => return Err(Fail::invalid("a branch outside of a block")),
            Statement::Switch { selector, cases } => {
                return self.switch(frame, *selector, cases, tails);
            }
            Statement::Loop {
                body,
                continuing,
                break_if,
            } => return self.looped(frame, body, continuing, *break_if),
            Statement::Break => {
                let scope = *frame
                    .breaks
                    .last()
                    .ok_or_else(|| Fail::invalid("`break` outside of a loop or switch"))?;
                return Ok(self.leave(scope, tails));
            }
            Statement::Continue => {
                let scope = *frame
                    .continues
                    .last()
                    .ok_or_else(|| Fail::invalid("`continue` outside of a loop"))?;
                return Ok(self.leave(scope, tails));
            }
            Statement::Return { value } => {
                if let Some(value) = value {
                    let values = self.scalars(frame, *value)?;
                    for (i, value) in values.into_iter().enumerate() {
                        let variable = *frame.result.get(i).ok_or_else(|| {
                            Fail::invalid("a returned value is not of the function's type")
                        })?;
                        self.builder.set(variable, value);
                    }
                }
                return Ok(self.leave(frame.scope, tails));
            }
            Statement::Store { pointer, value } => {
                let place = self.place(frame, *pointer)?;
                let values = self.scalars(frame, *value)?;
                self.store(&place, &values)?;
                if self.is_declaration(frame, *pointer, *value) {
                    self.forget_place(&place)?;
                }
            }
            Statement::ImageStore {
                image,
                coordinate,
                array_index,
                value,
            } => self.image_store(frame, *image, *coordinate, *array_index, *value)?,
            // Lanes of a subgroup are in step as all others.
            Statement::ControlBarrier(naga::Barrier::SUB_GROUP) => {}
            Statement::ControlBarrier(barrier) => self.barrier(*barrier),
            // Lanes run in lockstep, so memory is always up to date.
            Statement::MemoryBarrier(_) => {}
            Statement::WorkGroupUniformLoad { pointer, result } => {
                self.barrier(naga::Barrier::WORK_GROUP);
                let place = self.place(frame, *pointer)?;
                let values = self.load(&place)?;
                self.barrier(naga::Barrier::WORK_GROUP);
                frame.operands.insert(*result, Operand::Scalars(values));
            }
            Statement::Atomic {
                pointer,
                fun,
                value,
                result,
            } => self.atomic_statement(frame, *pointer, fun, *value, *result)?,
            Statement::Call {
                function,
                arguments,
                result,
            } => self.call(frame, *function, arguments, *result)?,
            Statement::Kill => self.discard()?,
            Statement::ImageAtomic {
                image,
                coordinate,
                array_index,
                fun,
                value,
            } => self.image_atomic(frame, *image, *coordinate, *array_index, *fun, *value)?,
            Statement::RayQuery { .. } | Statement::RayPipelineFunction(_) => {
                return Err(Fail::unsupported("ray tracing"));
            }
            Statement::SubgroupBallot { result, predicate } => {
                self.subgroup_ballot(frame, *result, *predicate)?;
            }
            Statement::SubgroupGather {
                mode,
                argument,
                result,
            } => self.subgroup_gather(frame, *mode, *argument, *result)?,
            Statement::SubgroupCollectiveOperation {
                op,
                collective_op,
                argument,
                result,
            } => self.subgroup_collective(frame, *op, *collective_op, *argument, *result)?,
            Statement::CooperativeStore { .. } => {
                return Err(Fail::unsupported("cooperative matrices"));
            }
        }
        Ok(true)
    }

    /// Whether a store only gives the zero value to a watched variable that is
    /// declared in a loop without an initial one. It spans the declaration then, as
    /// the value does; one that is written in the source is a part of its statement.
    fn is_declaration(
        &self,
        frame: &Frame<'a>,
        pointer: Handle<Expression>,
        value: Handle<Expression>,
    ) -> bool {
        let expressions = &frame.function.expressions;
        let (&Expression::LocalVariable(local), &Expression::ZeroValue(ty)) =
            (&expressions[pointer], &expressions[value])
        else {
            return false;
        };
        let local = &frame.function.local_variables[local];
        self.is_watched(self.inner(ty), local.init.is_some())
            && expressions.get_span(value) == self.builder.span
    }

    /// Leaves a scope; says whether what follows is where that leads.
    fn leave(&mut self, scope: ScopeId, tails: &[ScopeId]) -> bool {
        if tails.contains(&scope) {
            return true;
        }
        self.builder.exit(scope);
        false
    }

    fn switch(
        &mut self,
        frame: &mut Frame<'a>,
        selector: Handle<Expression>,
        cases: &'a [SwitchCase],
        tails: &[ScopeId],
    ) -> Result<bool, Fail> {
        let selector = self.scalar(frame, selector)?;
        let scope = self.builder.new_scope();
        frame.breaks.push(scope);
        // Several values for one body are bodies without statements that fall through.
        let mut groups: Vec<(Vec<u32>, bool, &'a Block)> = Vec::new();
        let (mut values, mut is_default) = (Vec::new(), false);
        for case in cases {
            match case.value {
                SwitchValue::I32(value) => values.push(value as u32),
                SwitchValue::U32(value) => values.push(value),
                SwitchValue::Default => is_default = true,
            }
            if case.fall_through {
                if !case.body.is_empty() {
                    return Err(Fail::unsupported("`fallthrough`"));
                }
                continue;
            }
            groups.push((
                std::mem::take(&mut values),
                std::mem::take(&mut is_default),
                &case.body,
            ));
        }
        // The default comes last wherever it is written.
        groups.sort_by_key(|group| group.1);
        let tails: Vec<ScopeId> = tails.iter().copied().chain([scope]).collect();
        self.builder.begin();
        let reached = self.cases(frame, selector, &groups, &tails)?;
        let branch = self.builder.end(reached);
        frame.breaks.pop();
        self.builder.finish_scope(scope, branch);
        Ok(reached || self.builder.is_left(scope))
    }

    fn cases(
        &mut self,
        frame: &mut Frame<'a>,
        selector: Value,
        groups: &[(Vec<u32>, bool, &'a Block)],
        tails: &[ScopeId],
    ) -> Result<bool, Fail> {
        let Some(((values, is_default, body), rest)) = groups.split_first() else {
            return Ok(true);
        };
        if *is_default {
            return self.block(frame, Sequence::of(body), tails);
        }
        let mut condition = self.builder.bool(false);
        for &value in values {
            let value = self.builder.int(value);
            let equal = self.builder.arith(Arith::EqI, &[selector, value]);
            condition = self.builder.arith(Arith::Or, &[condition, equal]);
        }
        match self.builder.constant_bits(condition) {
            Some(FALSE) => return self.cases(frame, selector, rest, tails),
            Some(_) => return self.block(frame, Sequence::of(body), tails),
            None => {}
        }
        let before = self.builder.snapshot();
        self.builder.begin();
        let reached = self.block(frame, Sequence::of(body), tails)?;
        let accept = self.builder.end(reached);
        self.builder.restore(&before);
        self.builder.begin();
        let reached = self.cases(frame, selector, rest, tails)?;
        let reject = self.builder.end(reached);
        Ok(self.builder.finish_if(condition, &before, accept, reject))
    }

    fn looped(
        &mut self,
        frame: &mut Frame<'a>,
        body: &'a Block,
        continuing: &'a Block,
        break_if: Option<Handle<Expression>>,
    ) -> Result<bool, Fail> {
        let span = self.builder.span;
        let (id, next) = (self.builder.new_scope(), self.builder.new_scope());
        let changing = self.changing(frame, &[body, continuing]);
        self.builder.forget(changing);
        frame.breaks.push(id);
        frame.continues.push(next);
        self.builder.begin();
        let reached = self.block(frame, Sequence::of(body), &[next])?;
        let body = self.builder.end(reached);
        frame.breaks.pop();
        frame.continues.pop();
        self.builder.begin();
        self.builder.after_body(next, &body);
        // `break` is not allowed here.
        let reached = self.block(frame, Sequence::of(continuing), &[])?;
        let break_if = break_if
            .map(|condition| self.scalar(frame, condition))
            .transpose()?;
        let continuing = self.builder.end(reached);
        self.builder.span = span;
        self.builder
            .finish_loop(id, next, body, continuing, break_if);
        Ok(true)
    }

    /// The variables that `blocks` may set.
    fn changing(&self, frame: &Frame<'a>, blocks: &[&Block]) -> Vec<Variable> {
        let mut roots = HashSet::new();
        let mut calls = false;
        for block in blocks {
            calls |= scan::assigned(frame.function, block, &mut roots);
        }
        let mut variables = Vec::new();
        for root in roots {
            match root {
                Root::Local(local) => variables.extend(
                    frame
                        .locals
                        .get(&local)
                        .map(super::Place::variables)
                        .unwrap_or_default(),
                ),
                Root::Argument(index) => {
                    if let Some(Operand::Place(place)) = frame.arguments.get(index as usize) {
                        variables.extend(place.variables());
                    }
                }
                Root::Global(global) => {
                    if let Some(Operand::Place(place)) = self.globals.get(&global) {
                        variables.extend(place.variables());
                    }
                }
                Root::Other => {}
            }
        }
        if calls {
            variables.extend(&self.private_variables);
        }
        variables.extend(self.stage.alive);
        variables
    }

    fn call(
        &mut self,
        frame: &mut Frame<'a>,
        function: Handle<Function>,
        arguments: &[Handle<Expression>],
        result: Option<Handle<Expression>>,
    ) -> Result<(), Fail> {
        let span = self.builder.span;
        let arguments = arguments
            .iter()
            .map(|&argument| self.operand(frame, argument))
            .collect::<Result<Vec<_>, _>>()?;
        let scope = self.builder.new_scope();
        self.builder.begin();
        let body = &self.module.functions[function].body;
        let mut callee = self.frame(
            &self.module.functions[function],
            &self.info[function],
            arguments,
            scope,
        )?;
        let reached = self.block(&mut callee, Sequence::of(body), &[scope])?;
        let body = self.builder.end(reached);
        self.builder.span = span;
        self.builder.finish_scope(scope, body);
        if let Some(result) = result {
            let values = callee
                .result
                .iter()
                .map(|&variable| self.builder.get(variable))
                .collect();
            frame.operands.insert(result, Operand::Scalars(values));
        }
        Ok(())
    }

    fn atomic_statement(
        &mut self,
        frame: &mut Frame<'a>,
        pointer: Handle<Expression>,
        function: &naga::AtomicFunction,
        value: Handle<Expression>,
        result: Option<Handle<Expression>>,
    ) -> Result<(), Fail> {
        let place = self.place(frame, pointer)?;
        let signed = self.kind(frame, value)? == naga::ScalarKind::Sint;
        let mut values = vec![self.scalar(frame, value)?];
        let mut compared = None;
        if let naga::AtomicFunction::Exchange {
            compare: Some(compare),
        } = *function
        {
            let expected = self.scalar(frame, compare)?;
            values.insert(0, expected);
            compared = Some(expected);
        }
        let function = atomic_function(*function, signed);
        let old = self.atomic(&place, function, &values)?;
        if let Some(result) = result {
            let mut values = vec![old];
            if let Some(expected) = compared {
                // `exchanged` of the result struct.
                values.push(self.builder.arith(Arith::EqI, &[old, expected]));
            }
            frame.operands.insert(result, Operand::Scalars(values));
        }
        Ok(())
    }
}

/// An atomic function on integers that are signed or not.
pub(super) fn atomic_function(function: naga::AtomicFunction, signed: bool) -> AtomicFunction {
    use naga::AtomicFunction as A;
    match function {
        A::Add => AtomicFunction::Add,
        A::Subtract => AtomicFunction::Sub,
        A::And => AtomicFunction::And,
        A::ExclusiveOr => AtomicFunction::Xor,
        A::InclusiveOr => AtomicFunction::Or,
        A::Min if signed => AtomicFunction::MinS,
        A::Min => AtomicFunction::MinU,
        A::Max if signed => AtomicFunction::MaxS,
        A::Max => AtomicFunction::MaxU,
        A::Exchange { compare: None } => AtomicFunction::Exchange,
        A::Exchange { compare: Some(_) } => AtomicFunction::CompareExchange,
    }
}

/// The scope that `block` leaves from its end.
fn target(frame: &Frame<'_>, block: &Block) -> Option<ScopeId> {
    match block.last()? {
        Statement::Return { .. } => Some(frame.scope),
        Statement::Break => frame.breaks.last().copied(),
        Statement::Continue => frame.continues.last().copied(),
        Statement::Block(block) => target(frame, block),
        _ => None,
    }
}

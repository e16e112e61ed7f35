//! Expressions.

use naga::{
    BinaryOperator, Expression, Handle, Literal, RelationalFunction, ScalarKind, TypeInner,
    UnaryOperator,
};

use super::layout::{describe, is_half, is_short};
use super::{Fail, Frame, Operand, Place, Translator};
use crate::ir::{Arith, Class, Op, Value};

impl<'a> Translator<'a> {
    /// Evaluates an expression where naga says that it is evaluated.
    pub(super) fn emit(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<(), Fail> {
        let mut span = frame.function.expressions.get_span(expression);
        if !span.is_defined()
            && let Expression::Load { pointer } = frame.function.expressions[expression]
            && let Expression::LocalVariable(local) = frame.function.expressions[pointer]
        {
            // Where a whole local variable is read is not kept; where it is declared is.
            span = frame.function.local_variables.get_span(local);
        }
        let outer = std::mem::replace(&mut self.builder.span, span);
        let operand = self.evaluate(frame, expression)?;
        self.builder.span = outer;
        frame.operands.insert(expression, operand);
        Ok(())
    }

    /// The meaning of an expression that has been evaluated, or needs no evaluation.
    pub(super) fn operand(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Operand, Fail> {
        if let Some(operand) = frame.operands.get(&expression) {
            return Ok(operand.clone());
        }
        let operand = self.evaluate(frame, expression)?;
        frame.operands.insert(expression, operand.clone());
        Ok(operand)
    }

    /// The scalars of a value.
    pub(super) fn scalars(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        match self.operand(frame, expression)? {
            Operand::Scalars(values) => Ok(values),
            Operand::Place(_) => Err(Fail::invalid("a pointer is used as a value")),
            Operand::Resource(_) => Err(Fail::invalid("a texture or sampler is used as a value")),
        }
    }

    pub(super) fn scalar(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Value, Fail> {
        let values = self.scalars(frame, expression)?;
        match values[..] {
            [value] => Ok(value),
            _ => Err(Fail::invalid("a composite is used as a scalar")),
        }
    }

    pub(super) fn place(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Place, Fail> {
        match self.operand(frame, expression)? {
            Operand::Place(place) => Ok(place),
            Operand::Scalars(_) | Operand::Resource(_) => {
                Err(Fail::invalid("a value is used as a pointer"))
            }
        }
    }

    pub(super) fn resource(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<u16, Fail> {
        match self.operand(frame, expression)? {
            Operand::Resource(index) => Ok(index),
            Operand::Scalars(_) | Operand::Place(_) => {
                Err(Fail::invalid("a value is used as a texture or sampler"))
            }
        }
    }

    pub(super) fn ty<'s>(
        &'s self,
        frame: &'s Frame<'a>,
        expression: Handle<Expression>,
    ) -> &'s TypeInner {
        frame.info[expression].ty.inner_with(&self.module.types)
    }

    /// The scalar kind of a numeric expression.
    pub(super) fn kind(
        &self,
        frame: &Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<ScalarKind, Fail> {
        let ty = self.ty(frame, expression);
        ty.scalar_kind()
            .ok_or_else(|| Fail::invalid(format!("a {} where numbers are expected", describe(ty))))
    }

    fn evaluate(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Operand, Fail> {
        let values = match frame.function.expressions[expression] {
            Expression::Literal(literal) => vec![self.literal(literal)?],
            Expression::Constant(constant) => {
                self.global_constant(self.module.constants[constant].init)?
            }
            Expression::ZeroValue(ty) => self.zero(self.inner(ty))?,
            Expression::Compose { ref components, .. } => {
                let mut values = Vec::new();
                for &component in components {
                    values.extend(self.scalars(frame, component)?);
                }
                values
            }
            Expression::Splat { size, value } => vec![self.scalar(frame, value)?; size as usize],
            Expression::Swizzle {
                size,
                vector,
                pattern,
            } => {
                let vector = self.scalars(frame, vector)?;
                pattern[..size as usize]
                    .iter()
                    .map(|&c| {
                        vector
                            .get(c as usize)
                            .copied()
                            .ok_or_else(|| Fail::invalid("a swizzle leaves its vector"))
                    })
                    .collect::<Result<_, _>>()?
            }
            Expression::AccessIndex { base, index } => match self.operand(frame, base)? {
                Operand::Place(place) => return Ok(Operand::Place(self.member(&place, index)?)),
                Operand::Scalars(values) => {
                    let (start, count) = self.part(self.ty(frame, base), index)?;
                    slice(&values, start, count)?
                }
                Operand::Resource(_) => return Err(Fail::unsupported("arrays of textures")),
            },
            Expression::Access { base, index } => {
                let signed = self.kind(frame, index)? == ScalarKind::Sint;
                let index = self.scalar(frame, index)?;
                match self.operand(frame, base)? {
                    Operand::Place(place) => {
                        self.check_place_index(&place, index, signed)?;
                        return Ok(Operand::Place(self.element_at(&place, index)?));
                    }
                    Operand::Scalars(values) => {
                        let ty = self.ty(frame, base).clone();
                        self.index_value(&ty, &values, index, signed)?
                    }
                    Operand::Resource(_) => return Err(Fail::unsupported("arrays of textures")),
                }
            }
            Expression::FunctionArgument(index) => {
                return frame
                    .arguments
                    .get(index as usize)
                    .cloned()
                    .ok_or_else(|| Fail::invalid("an argument is missing"));
            }
            Expression::GlobalVariable(global) => {
                return self.globals.get(&global).cloned().ok_or_else(|| {
                    Fail::invalid("a global variable is used that analysis says is not")
                });
            }
            Expression::LocalVariable(local) => {
                return frame
                    .locals
                    .get(&local)
                    .cloned()
                    .map(Operand::Place)
                    .ok_or_else(|| Fail::invalid("a local variable is missing"));
            }
            Expression::Load { pointer } => {
                let place = self.place(frame, pointer)?;
                self.load(&place)?
            }
            Expression::ArrayLength(pointer) => {
                let place = self.place(frame, pointer)?;
                vec![self.runtime_length(&place)?]
            }
            Expression::ImageLoad {
                image,
                coordinate,
                array_index,
                sample,
                level,
            } => {
                if sample.is_some() {
                    return Err(Fail::unsupported(crate::binding::MULTISAMPLED));
                }
                self.image_load(frame, image, coordinate, array_index, level)?
            }
            Expression::ImageSample { .. } => self.image_sample(frame, expression)?,
            Expression::ImageQuery { image, query } => self.image_query(frame, image, query)?,
            Expression::Unary { op, expr } => {
                self.refuse_short(frame, expr)?;
                self.unary(frame, op, expr)?
            }
            Expression::Binary { op, left, right } => {
                if !is_comparison(op) {
                    self.refuse_short(frame, left)?;
                }
                self.rounded_as(frame, left, |this, frame| {
                    this.binary(frame, op, left, right)
                })?
            }
            Expression::Select {
                condition,
                accept,
                reject,
            } => {
                let condition = self.scalars(frame, condition)?;
                let (accept, reject) = (self.scalars(frame, accept)?, self.scalars(frame, reject)?);
                let width = accept.len();
                (0..width)
                    .map(|i| {
                        self.builder.select(
                            condition[if condition.len() == width { i } else { 0 }],
                            accept[i],
                            reject[i],
                        )
                    })
                    .collect()
            }
            Expression::Relational { fun, argument } => self.relational(frame, fun, argument)?,
            Expression::Math {
                fun,
                arg,
                arg1,
                arg2,
                arg3,
            } => {
                self.refuse_short(frame, arg)?;
                self.rounded_as(frame, arg, |this, frame| {
                    this.math(frame, fun, &[Some(arg), arg1, arg2, arg3])
                })?
            }
            Expression::As {
                expr,
                kind,
                convert,
            } => self.cast(frame, expr, kind, convert)?,
            Expression::CallResult(_)
            | Expression::AtomicResult { .. }
            | Expression::SubgroupBallotResult
            | Expression::SubgroupOperationResult { .. }
            | Expression::WorkGroupUniformLoadResult { .. } => {
                return Err(Fail::invalid("a result is used before its statement"));
            }
            Expression::Override(_) => return Err(Fail::invalid("an override was not resolved")),
            Expression::Derivative { axis, ctrl, expr } => {
                self.derivative(frame, axis, ctrl, expr)?
            }
            Expression::RayQueryVertexPositions { .. }
            | Expression::RayQueryProceedResult
            | Expression::RayQueryGetIntersection { .. } => {
                return Err(Fail::unsupported("ray queries"));
            }
            Expression::CooperativeLoad { .. } | Expression::CooperativeMultiplyAdd { .. } => {
                return Err(Fail::unsupported("cooperative matrices"));
            }
        };
        self.check_finite(frame, expression, &values)?;
        Ok(Operand::Scalars(values))
    }

    /// Translates arithmetic whose results are rounded to the precision that
    /// `operand` has.
    fn rounded_as<T>(
        &mut self,
        frame: &mut Frame<'a>,
        operand: Handle<Expression>,
        translate: impl FnOnce(&mut Self, &mut Frame<'a>) -> Result<T, Fail>,
    ) -> Result<T, Fail> {
        let half = self.ty(frame, operand).scalar().is_some_and(is_half);
        let outer = std::mem::replace(&mut self.builder.half, half);
        let result = translate(self, frame);
        self.builder.half = outer;
        result
    }

    /// Integers of 16 bits come from `frexp` and bit casts of `f16`; WGSL has no
    /// arithmetic on them.
    pub(super) fn refuse_short(
        &self,
        frame: &Frame<'a>,
        operand: Handle<Expression>,
    ) -> Result<(), Fail> {
        if self.ty(frame, operand).scalar().is_some_and(is_short) {
            return Err(Fail::unsupported("arithmetic on 16-bit integers"));
        }
        Ok(())
    }

    fn literal(&mut self, literal: Literal) -> Result<Value, Fail> {
        Ok(match literal {
            Literal::F32(value) => self.builder.float(value),
            Literal::U32(value) => self.builder.int(value),
            Literal::I32(value) => self.builder.int(value as u32),
            Literal::Bool(value) => self.builder.bool(value),
            Literal::F16(value) => self.builder.float(value.to_f32()),
            Literal::I16(value) => self.builder.int(i32::from(value) as u32),
            Literal::U16(value) => self.builder.int(value.into()),
            Literal::F64(_) | Literal::U64(_) | Literal::I64(_) => {
                return Err(Fail::unsupported("64-bit scalars"));
            }
            Literal::AbstractInt(_) | Literal::AbstractFloat(_) => {
                return Err(Fail::invalid("an abstract literal was not made concrete"));
            }
        })
    }

    /// A module-scope constant expression.
    pub(super) fn global_constant(
        &mut self,
        expression: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        if let Some(values) = self.constants.get(&expression) {
            return Ok(values.clone());
        }
        let values = match self.module.global_expressions[expression] {
            Expression::Literal(literal) => vec![self.literal(literal)?],
            Expression::Constant(constant) => {
                self.global_constant(self.module.constants[constant].init)?
            }
            Expression::ZeroValue(ty) => self.zero(self.inner(ty))?,
            Expression::Compose { ref components, .. } => {
                let mut values = Vec::new();
                for &component in components {
                    values.extend(self.global_constant(component)?);
                }
                values
            }
            Expression::Splat { size, value } => {
                let value = self.global_constant(value)?;
                value.repeat(size as usize)
            }
            _ => return Err(Fail::invalid("a constant was not evaluated")),
        };
        self.constants.insert(expression, values.clone());
        Ok(values)
    }

    /// Where the component `index` of a flattened value starts, and its length.
    fn part(&self, ty: &TypeInner, index: u32) -> Result<(usize, usize), Fail> {
        match *ty {
            TypeInner::Struct { ref members, .. } => {
                let mut start = 0;
                for member in members.iter().take(index as usize) {
                    start += self.leaves(self.inner(member.ty))?.len();
                }
                let member = members
                    .get(index as usize)
                    .ok_or_else(|| Fail::invalid("a member index is out of range"))?;
                Ok((start, self.leaves(self.inner(member.ty))?.len()))
            }
            _ => {
                let count = self.element_leaves(ty)?;
                let start = count
                    .checked_mul(index as usize)
                    .ok_or_else(|| Fail::invalid("an index is out of range"))?;
                Ok((start, count))
            }
        }
    }

    fn element_leaves(&self, ty: &TypeInner) -> Result<usize, Fail> {
        match *ty {
            TypeInner::Vector { .. } => Ok(1),
            TypeInner::Matrix { rows, .. } => Ok(rows as usize),
            TypeInner::Array { base, .. } => Ok(self.leaves(self.inner(base))?.len()),
            _ => Err(Fail::invalid("a value without elements is indexed")),
        }
    }

    /// An element of a value at a computed index.
    fn index_value(
        &mut self,
        ty: &TypeInner,
        values: &[Value],
        index: Value,
        signed: bool,
    ) -> Result<Vec<Value>, Fail> {
        let width = self.element_leaves(ty)?;
        if width == 0 || values.is_empty() {
            return Err(Fail::invalid("a value without elements is indexed"));
        }
        let count = values.len() / width;
        let length = self.builder.int(count as u32);
        self.check_index(ty, index, length, signed);
        let last = self.builder.int(count as u32 - 1);
        let index = self.builder.arith(Arith::MinU, &[index, last]);
        if let Some(index) = self.builder.constant_bits(index) {
            return slice(values, index as usize * width, width);
        }
        let mut result = Vec::with_capacity(width);
        for part in 0..width {
            let column: Vec<Value> = values.iter().skip(part).step_by(width).copied().collect();
            let bits: Option<Vec<u32>> = column
                .iter()
                .map(|&value| self.builder.constant_bits(value))
                .collect();
            let class = self.builder.class(column[0]);
            let value = match bits {
                Some(bits) if count > 4 => {
                    let tables = &mut self.builder.tree.resources.tables;
                    let table = tables
                        .iter()
                        .position(|table| *table == bits)
                        .unwrap_or_else(|| {
                            tables.push(bits);
                            tables.len() - 1
                        });
                    self.builder.op(
                        Op::Table {
                            table: table as u32,
                            class,
                        },
                        &[index],
                        &[class],
                    )[0]
                }
                _ => {
                    let mut value = column[count - 1];
                    for (i, &candidate) in column.iter().enumerate().rev().skip(1) {
                        let i = self.builder.int(i as u32);
                        let here = self.builder.arith(Arith::EqI, &[index, i]);
                        value = self.builder.select(here, candidate, value);
                    }
                    value
                }
            };
            result.push(value);
        }
        Ok(result)
    }

    fn unary(
        &mut self,
        frame: &mut Frame<'a>,
        op: UnaryOperator,
        operand: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        let kind = self.kind(frame, operand)?;
        let values = self.scalars(frame, operand)?;
        Ok(values
            .into_iter()
            .map(|value| match (op, kind) {
                (UnaryOperator::Negate, ScalarKind::Float) => {
                    self.builder.arith(Arith::NegF, &[value])
                }
                (UnaryOperator::Negate, _) => {
                    let zero = self.builder.int(0);
                    self.builder.arith(Arith::SubI, &[zero, value])
                }
                (UnaryOperator::LogicalNot | UnaryOperator::BitwiseNot, _) => {
                    self.builder.arith(Arith::Not, &[value])
                }
            })
            .collect())
    }

    fn binary(
        &mut self,
        frame: &mut Frame<'a>,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        let kind = self.kind(frame, left)?;
        let (a, b) = (self.scalars(frame, left)?, self.scalars(frame, right)?);
        if op == BinaryOperator::Multiply {
            match (self.ty(frame, left), self.ty(frame, right)) {
                (&TypeInner::Matrix { columns, rows, .. }, TypeInner::Matrix { .. }) => {
                    return Ok(self.matrix_product(&a, columns as usize, rows as usize, &b));
                }
                (&TypeInner::Matrix { columns, rows, .. }, TypeInner::Vector { .. }) => {
                    return Ok(self.matrix_product(&a, columns as usize, rows as usize, &b));
                }
                (TypeInner::Vector { .. }, &TypeInner::Matrix { rows, .. }) => {
                    // Each column dotted with the vector.
                    return Ok(b
                        .chunks(rows as usize)
                        .map(|column| self.dot(Class::Float, &a, column))
                        .collect());
                }
                _ => {}
            }
        }
        let width = a.len().max(b.len());
        let at = |values: &[Value], i: usize| values[if values.len() == 1 { 0 } else { i }];
        let pairs: Vec<(Value, Value)> = (0..width).map(|i| (at(&a, i), at(&b, i))).collect();
        self.check_integers(op, kind, &pairs);
        let mut result = Vec::with_capacity(width);
        for (a, b) in pairs {
            result.push(self.binary_scalar(op, kind, a, b)?);
        }
        Ok(result)
    }

    fn binary_scalar(
        &mut self,
        op: BinaryOperator,
        kind: ScalarKind,
        a: Value,
        b: Value,
    ) -> Result<Value, Fail> {
        use BinaryOperator as B;
        use ScalarKind as K;
        let (arith, swap) = match (op, kind) {
            (B::Add, K::Float) => (Arith::AddF, false),
            (B::Add, _) => (Arith::AddI, false),
            (B::Subtract, K::Float) => (Arith::SubF, false),
            (B::Subtract, _) => (Arith::SubI, false),
            (B::Multiply, K::Float) => (Arith::MulF, false),
            (B::Multiply, _) => (Arith::MulI, false),
            (B::Divide, K::Float) => (Arith::DivF, false),
            (B::Divide, K::Sint) => (Arith::DivS, false),
            (B::Divide, _) => (Arith::DivU, false),
            (B::Modulo, K::Float) => (Arith::RemF, false),
            (B::Modulo, K::Sint) => (Arith::RemS, false),
            (B::Modulo, _) => (Arith::RemU, false),
            (B::Equal, K::Float) => (Arith::EqF, false),
            (B::Equal, _) => (Arith::EqI, false),
            (B::NotEqual, K::Float) => (Arith::NeF, false),
            (B::NotEqual, _) => (Arith::NeI, false),
            (B::Less, K::Float) => (Arith::LtF, false),
            (B::Less, K::Sint) => (Arith::LtS, false),
            (B::Less, _) => (Arith::LtU, false),
            (B::LessEqual, K::Float) => (Arith::LeF, false),
            (B::LessEqual, K::Sint) => (Arith::LeS, false),
            (B::LessEqual, _) => (Arith::LeU, false),
            (B::Greater, K::Float) => (Arith::LtF, true),
            (B::Greater, K::Sint) => (Arith::LtS, true),
            (B::Greater, _) => (Arith::LtU, true),
            (B::GreaterEqual, K::Float) => (Arith::LeF, true),
            (B::GreaterEqual, K::Sint) => (Arith::LeS, true),
            (B::GreaterEqual, _) => (Arith::LeU, true),
            (B::And | B::LogicalAnd, _) => (Arith::And, false),
            (B::InclusiveOr | B::LogicalOr, _) => (Arith::Or, false),
            (B::ExclusiveOr, _) => (Arith::Xor, false),
            (B::ShiftLeft, _) => (Arith::Shl, false),
            (B::ShiftRight, K::Sint) => (Arith::ShrS, false),
            (B::ShiftRight, _) => (Arith::ShrU, false),
        };
        Ok(if swap {
            self.builder.arith(arith, &[b, a])
        } else {
            self.builder.arith(arith, &[a, b])
        })
    }

    /// Matrix times the columns in `right`, each summed from the first column on.
    pub(super) fn matrix_product(
        &mut self,
        left: &[Value],
        columns: usize,
        rows: usize,
        right: &[Value],
    ) -> Vec<Value> {
        let mut result = Vec::with_capacity(rows * right.len() / columns.max(1));
        for vector in right.chunks(columns) {
            for row in 0..rows {
                let elements: Vec<Value> = (0..columns)
                    .map(|column| left[column * rows + row])
                    .collect();
                result.push(self.dot(Class::Float, &elements, vector));
            }
        }
        result
    }

    /// Sum of products, from the first component on.
    pub(super) fn dot(&mut self, class: Class, a: &[Value], b: &[Value]) -> Value {
        let (multiply, add) = match class {
            Class::Float => (Arith::MulF, Arith::AddF),
            Class::Int => (Arith::MulI, Arith::AddI),
        };
        let mut sum = None;
        for (&a, &b) in a.iter().zip(b) {
            let product = self.builder.arith(multiply, &[a, b]);
            sum = Some(match sum {
                Some(sum) => self.builder.arith(add, &[sum, product]),
                None => product,
            });
        }
        sum.unwrap_or_else(|| self.builder.constant(class, 0))
    }

    fn relational(
        &mut self,
        frame: &mut Frame<'a>,
        function: RelationalFunction,
        argument: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        let values = self.scalars(frame, argument)?;
        let mut fold = |op: Arith| {
            let mut values = values.iter().copied();
            let first = values.next();
            let all = values.fold(first, |all, value| {
                all.map(|all| self.builder.arith(op, &[all, value]))
            });
            all.map(|all| vec![all])
                .ok_or_else(|| Fail::invalid("`all` or `any` of nothing"))
        };
        match function {
            RelationalFunction::All => fold(Arith::And),
            RelationalFunction::Any => fold(Arith::Or),
            RelationalFunction::IsNan => Ok(values
                .into_iter()
                .map(|v| self.builder.arith(Arith::NeF, &[v, v]))
                .collect()),
            RelationalFunction::IsInf => Ok(values
                .into_iter()
                .map(|v| {
                    let magnitude = self.builder.arith(Arith::AbsF, &[v]);
                    let infinity = self.builder.float(f32::INFINITY);
                    self.builder.arith(Arith::EqF, &[magnitude, infinity])
                })
                .collect()),
        }
    }
}

fn is_comparison(op: BinaryOperator) -> bool {
    use BinaryOperator as B;
    matches!(
        op,
        B::Equal | B::NotEqual | B::Less | B::LessEqual | B::Greater | B::GreaterEqual
    )
}

fn slice(values: &[Value], start: usize, count: usize) -> Result<Vec<Value>, Fail> {
    values
        .get(start..start.saturating_add(count))
        .map(<[Value]>::to_vec)
        .ok_or_else(|| Fail::invalid("an index is out of range"))
}

//! Expressions.

use super::{Access, Generator};
use crate::programs::grammar::*;

const COMPARISONS: [Binary; 6] = [
    Binary::Less,
    Binary::Equal,
    Binary::GreaterEqual,
    Binary::NotEqual,
    Binary::LessEqual,
    Binary::Greater,
];

/// Floats beyond this are clamped where they are stored.
const LARGEST: f32 = 65536.0;

fn expr(ty: &Type, kind: ExprKind) -> Expr {
    Expr {
        ty: ty.clone(),
        kind,
    }
}

fn binary(ty: &Type, op: Binary, a: Expr, b: Expr) -> Expr {
    expr(ty, ExprKind::Binary(op, Box::new(a), Box::new(b)))
}

fn function(ty: &Type, function: Function, parts: Vec<Expr>) -> Expr {
    expr(ty, ExprKind::Function(function, parts))
}

/// A scalar's literal, for all components of a vector.
fn splat(ty: &Type, scalar: Scalar, bits: u32) -> Expr {
    let literal = Expr::literal(scalar, bits);
    match ty {
        Type::Vector(..) => expr(ty, ExprKind::Construct(vec![literal])),
        _ => literal,
    }
}

fn float(ty: &Type, value: f32) -> Expr {
    splat(ty, Scalar::F32, value.to_bits())
}

impl Generator<'_> {
    /// An integer, small or at an edge or any.
    pub(super) fn integer(&mut self) -> u32 {
        const EDGES: [u32; 12] = [
            31,
            32,
            255,
            256,
            0x7fff_ffff,
            0x8000_0000,
            0xffff_ffff,
            0xffff_fffe,
            0xaaaa_aaaa,
            0x0102_0408,
            65535,
            0x8000_0001,
        ];
        match self.choices.below(10) {
            0..=5 => self.choices.below(10) as u32,
            6 | 7 => self.choices.of(&EDGES),
            _ => self.choices.word(),
        }
    }

    /// A float of moderate size, or if wild of any.
    pub(super) fn real(&mut self, wild: bool) -> f32 {
        const USUAL: [f32; 12] = [
            0.0, 1.0, -1.0, 0.5, 2.0, -0.75, 3.0, 0.1, 1.5, 100.25, -7.3, 1e-3,
        ];
        const WILD: [f32; 8] = [
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            f32::MAX,
            f32::MIN_POSITIVE,
            -0.0,
            1e-41,
            3e30,
        ];
        if wild && self.choices.chance(30) {
            return self.choices.of(&WILD);
        }
        match self.choices.below(4) {
            0 | 1 => self.choices.of(&USUAL),
            2 => self.choices.below(64) as f32 / 8.0 - 4.0,
            // A full significand, between -256 and 256.
            _ => self.choices.word() as i32 as f32 / 8_388_608.0,
        }
    }

    pub(super) fn literal_bits(&mut self, scalar: Scalar) -> u32 {
        match scalar {
            Scalar::Bool => self.choices.below(2) as u32,
            Scalar::U32 | Scalar::I32 => self.integer(),
            Scalar::F32 => self.real(false).to_bits(),
        }
    }

    /// An expression of a type, nested at most so deep.
    pub(super) fn expr(&mut self, ty: &Type, depth: usize) -> Expr {
        if depth == 0 || self.choices.chance(15) {
            return self.leaf(ty);
        }
        if self.choices.chance(10)
            && let Some(call) = self.call(ty, depth - 1)
        {
            return call;
        }
        match ty {
            Type::Scalar(scalar) => self.numeric(ty, *scalar, depth - 1),
            Type::Vector(scalar, _) => match self.choices.below(4) {
                0 => self.construct(ty, depth - 1),
                1 => self.swizzle(ty, depth - 1),
                _ => self.numeric(ty, *scalar, depth - 1),
            },
            Type::Matrix { columns, rows } => self.matrix(ty, *columns, *rows, depth - 1),
            Type::Array(..) | Type::Struct(_) => self.construct(ty, depth - 1),
        }
    }

    /// An expression to be stored: floats are mostly kept moderate.
    pub(super) fn stored(&mut self, ty: &Type, depth: usize) -> Expr {
        let value = self.expr(ty, depth);
        let small = matches!(
            value.kind,
            ExprKind::Literal(_) | ExprKind::Name(_) | ExprKind::Load(_) | ExprKind::Reals(_)
        );
        let plain = matches!(ty, &F32 | Type::Vector(Scalar::F32, _));
        if !plain || small || value.is_constant() || self.choices.chance(5) {
            return value;
        }
        let parts = vec![value, float(ty, -LARGEST), float(ty, LARGEST)];
        function(ty, Function::Clamp, parts)
    }

    /// An expression without operators.
    fn leaf(&mut self, ty: &Type) -> Expr {
        let names: Vec<Id> = self
            .scope
            .names
            .iter()
            .filter(|(_, other)| other == ty)
            .map(|(id, _)| *id)
            .collect();
        for _ in 0..2 {
            match self.choices.below(8) {
                0 => break,
                1 | 2 if !names.is_empty() => {
                    return expr(ty, ExprKind::Name(self.choices.of(&names)));
                }
                3 | 4 => {
                    if let Some(place) = self.place(ty, false) {
                        return expr(ty, ExprKind::Load(place));
                    }
                }
                5 if *ty == U32 && self.in_main => return expr(ty, ExprKind::Input(Input::Lane)),
                5 if *ty == Type::Vector(Scalar::U32, 3) && self.in_main => {
                    let input = self.choices.of(&[
                        Input::Local,
                        Input::Global,
                        Input::Group,
                        Input::Groups,
                    ]);
                    return expr(ty, ExprKind::Input(input));
                }
                6 => match *ty {
                    U32 => {
                        let index = self.any_u32();
                        return expr(ty, ExprKind::Data(Box::new(index)));
                    }
                    F32 => {
                        let index = self.any_u32();
                        return expr(ty, ExprKind::Reals(Box::new(index)));
                    }
                    _ => {}
                },
                7 => {
                    if let Some(element) = self.element_of_constant(ty) {
                        return element;
                    }
                    if let Some(load) = self.atomic_load(ty) {
                        return load;
                    }
                }
                _ => {}
            }
        }
        match ty {
            Type::Scalar(scalar) => Expr::literal(*scalar, self.literal_bits(*scalar)),
            _ if self.choices.chance(15) => Expr::zero(ty.clone()),
            Type::Vector(scalar, _) if self.choices.chance(50) => {
                let bits = self.literal_bits(*scalar);
                splat(ty, *scalar, bits)
            }
            _ => self.construct(ty, 0),
        }
    }

    fn element_of_constant(&mut self, ty: &Type) -> Option<Expr> {
        let fitting: Vec<usize> = (0..self.program.constants.len())
            .filter(|&index| {
                self.program.constants[index].0.element().map(|of| of.0) == Some(ty.clone())
            })
            .collect();
        if fitting.is_empty() {
            return None;
        }
        let index = self.choices.of(&fitting);
        let array = expr(
            &self.program.constants[index].0.clone(),
            ExprKind::Constant(index),
        );
        let at = self.any_u32();
        Some(expr(ty, ExprKind::Index(Box::new(array), Box::new(at))))
    }

    fn atomic_load(&mut self, ty: &Type) -> Option<Expr> {
        let fitting: Vec<usize> = self
            .program
            .workgroup
            .iter()
            .enumerate()
            .filter(|(index, variable)| {
                let scalar = match variable {
                    Workgroup::LaneAtomics(scalar) | Workgroup::Counters(scalar, _) => *scalar,
                    _ => return false,
                };
                self.in_main && self.access[*index] == Access::Read && *ty == Type::Scalar(scalar)
            })
            .map(|(index, _)| index)
            .collect();
        if fitting.is_empty() {
            return None;
        }
        let variable = self.choices.of(&fitting);
        let index = self.any_u32();
        Some(expr(ty, ExprKind::AtomicLoad(variable, Box::new(index))))
    }

    /// Something of type `u32` that is no constant.
    fn any_u32(&mut self) -> Expr {
        let names: Vec<Id> = self
            .scope
            .names
            .iter()
            .filter(|(_, ty)| *ty == U32)
            .map(|(id, _)| *id)
            .collect();
        if self.in_main && (names.is_empty() || self.choices.chance(50)) {
            expr(&U32, ExprKind::Input(Input::Lane))
        } else {
            // Functions have a parameter of this type.
            expr(&U32, ExprKind::Name(self.choices.of(&names)))
        }
    }

    /// Something of a scalar or vector type that is no constant.
    fn runtime(&mut self, ty: &Type) -> Expr {
        let word = self.any_u32();
        match ty {
            Type::Vector(scalar, _) => {
                let part = self.runtime(&Type::Scalar(*scalar));
                expr(ty, ExprKind::Construct(vec![part]))
            }
            &I32 => expr(ty, ExprKind::Bitcast(Box::new(word))),
            &BOOL => {
                let limit = Expr::literal(Scalar::U32, self.choices.below(16) as u32);
                binary(ty, Binary::Greater, word, limit)
            }
            &F32 => {
                let limit = Expr::literal(Scalar::U32, 1024);
                let small = binary(&U32, Binary::Remainder, word, limit);
                expr(ty, ExprKind::Convert(Box::new(small)))
            }
            _ => word,
        }
    }

    /// The same, unless it is a constant: then another.
    fn not_constant(&mut self, value: Expr) -> Expr {
        if value.is_constant() {
            self.runtime(&value.ty)
        } else {
            value
        }
    }

    /// A call of a function with the result, if there is one that can be called.
    fn call(&mut self, ty: &Type, depth: usize) -> Option<Expr> {
        let fitting: Vec<usize> = (0..self.program.routines.len())
            .filter(|&routine| self.program.routines[routine].result.as_ref() == Some(ty))
            .collect();
        if fitting.is_empty() {
            return None;
        }
        let routine = self.choices.of(&fitting);
        let arguments = self.arguments(routine, depth.min(1))?;
        Some(expr(ty, ExprKind::Call(routine, arguments)))
    }

    fn construct(&mut self, ty: &Type, depth: usize) -> Expr {
        let parts = match ty {
            Type::Struct(structure) => structure
                .members
                .clone()
                .iter()
                .map(|member| self.expr(member, depth))
                .collect(),
            // Of a scalar and a vector.
            Type::Vector(scalar, size @ 3..) if self.choices.chance(40) => {
                let first = self.expr(&Type::Scalar(*scalar), depth);
                let rest = self.expr(&Type::Vector(*scalar, size - 1), depth);
                // A constant vector of a scalar and a zero vector, as
                // `vec3<i32>(1i, vec2<i32>())`, naga 30 writes as an
                // `OpConstantComposite` of both, which SPIR-V does not allow and
                // lavapipe refuses.
                let mut parts = if rest.is_constant() {
                    vec![self.not_constant(first), rest]
                } else {
                    vec![first, rest]
                };
                if self.choices.chance(50) {
                    parts.reverse();
                }
                parts
            }
            // Of all scalars.
            Type::Matrix { columns, rows } if depth == 0 && self.choices.chance(30) => {
                (0..columns * rows).map(|_| self.leaf(&F32)).collect()
            }
            _ => match ty.element() {
                Some((element, size)) => (0..size).map(|_| self.expr(&element, depth)).collect(),
                None => return self.leaf(ty),
            },
        };
        expr(ty, ExprKind::Construct(parts))
    }

    /// A vector from the components of another.
    fn swizzle(&mut self, ty: &Type, depth: usize) -> Expr {
        let Type::Vector(scalar, size) = *ty else {
            return self.leaf(ty);
        };
        let from = 2 + self.choices.below(3);
        let components = (0..size).map(|_| self.choices.below(from)).collect();
        let vector = self.expr(&Type::Vector(scalar, from), depth);
        expr(ty, ExprKind::Swizzle(Box::new(vector), components))
    }

    fn matrix(&mut self, ty: &Type, columns: usize, rows: usize, depth: usize) -> Expr {
        let op = self.choices.of(&[Binary::Add, Binary::Subtract]);
        // In a loop it would grow without bound.
        match self.choices.below(if self.repeats > 1 { 2 } else { 5 }) {
            0 => self.construct(ty, depth),
            1 => {
                let transposed = Type::Matrix {
                    columns: rows,
                    rows: columns,
                };
                let matrix = self.expr(&transposed, depth.min(1));
                if matrix.is_constant() {
                    return self.construct(ty, depth);
                }
                function(ty, Function::Transpose, vec![matrix])
            }
            2 => {
                let matrix = self.expr(ty, depth);
                let scalar = self.expr(&F32, depth);
                let scalar = self.not_constant(scalar);
                if self.choices.chance(50) {
                    binary(ty, Binary::Multiply, matrix, scalar)
                } else {
                    binary(ty, Binary::Multiply, scalar, matrix)
                }
            }
            _ => {
                let (a, b) = (self.expr(ty, depth), self.expr(ty, depth));
                if a.is_constant() {
                    return b;
                }
                binary(ty, op, a, b)
            }
        }
    }

    /// An operation with a scalar or vector as its result.
    fn numeric(&mut self, ty: &Type, scalar: Scalar, depth: usize) -> Expr {
        if let Type::Scalar(_) = ty
            && self.choices.chance(12)
            && let Some(part) = self.part(ty, depth)
        {
            return part;
        }
        if self.choices.chance(8) {
            return self.select(ty, depth);
        }
        match scalar {
            Scalar::Bool => self.boolean(ty, depth),
            Scalar::F32 => self.floating(ty, depth),
            Scalar::U32 | Scalar::I32 => self.integral(ty, scalar, depth),
        }
    }

    fn select(&mut self, ty: &Type, depth: usize) -> Expr {
        let condition = if self.choices.chance(50) {
            BOOL
        } else {
            ty.with_scalar(Scalar::Bool)
        };
        let (no, yes) = (self.expr(ty, depth), self.expr(ty, depth));
        let condition = self.expr(&condition, depth);
        let condition = self.not_constant(condition);
        function(ty, Function::Select, vec![no, yes, condition])
    }

    /// A component, element or member of something that is no variable.
    fn part(&mut self, ty: &Type, depth: usize) -> Option<Expr> {
        let scalar = ty.scalar()?;
        if self.choices.chance(60) {
            let size = 2 + self.choices.below(3);
            let vector = self.expr(&Type::Vector(scalar, size), depth);
            return Some(if self.choices.chance(60) {
                let components = vec![self.choices.below(size)];
                expr(ty, ExprKind::Swizzle(Box::new(vector), components))
            } else {
                let vector = self.not_constant(vector);
                let index = self.index(depth.min(1));
                expr(ty, ExprKind::Index(Box::new(vector), Box::new(index)))
            });
        }
        let structures = self.structures.clone();
        for whole in structures {
            let Type::Struct(structure) = &whole else {
                continue;
            };
            if let Some(index) = structure.members.iter().position(|member| member == ty) {
                let value = self.expr(&whole, depth);
                return Some(expr(ty, ExprKind::Member(Box::new(value), index)));
            }
        }
        None
    }

    fn boolean(&mut self, ty: &Type, depth: usize) -> Expr {
        let number = |scalar| ty.with_scalar(scalar);
        match self.choices.below(10) {
            0..=4 => {
                let of = number(self.choices.of(&[Scalar::U32, Scalar::I32, Scalar::F32]));
                let op = self.choices.of(&COMPARISONS);
                let (a, b) = (self.expr(&of, depth), self.expr(&of, depth));
                let a = self.not_constant(a);
                binary(ty, op, a, b)
            }
            5 => {
                let a = self.expr(ty, depth);
                let a = self.not_constant(a);
                expr(ty, ExprKind::Unary(Unary::Not, Box::new(a)))
            }
            6 => {
                let from = number(self.choices.of(&[Scalar::U32, Scalar::I32, Scalar::F32]));
                let a = self.expr(&from, depth);
                let a = self.not_constant(a);
                expr(ty, ExprKind::Convert(Box::new(a)))
            }
            7 if *ty == BOOL => {
                let all = self.choices.of(&[Function::All, Function::Any]);
                let vector = Type::Vector(Scalar::Bool, 2 + self.choices.below(3));
                let a = self.expr(&vector, depth);
                let a = self.not_constant(a);
                function(ty, all, vec![a])
            }
            _ => {
                let ops: &[Binary] = if *ty == BOOL {
                    &[
                        Binary::LogicalAnd,
                        Binary::LogicalOr,
                        Binary::And,
                        Binary::Or,
                        Binary::Equal,
                        Binary::NotEqual,
                    ]
                } else {
                    &[Binary::And, Binary::Or, Binary::Equal, Binary::NotEqual]
                };
                let op = self.choices.of(ops);
                let (a, b) = (self.expr(ty, depth), self.expr(ty, depth));
                let a = self.not_constant(a);
                binary(ty, op, a, b)
            }
        }
    }

    fn integral(&mut self, ty: &Type, scalar: Scalar, depth: usize) -> Expr {
        const PLAIN: [Binary; 6] = [
            Binary::Add,
            Binary::Subtract,
            Binary::Multiply,
            Binary::Xor,
            Binary::And,
            Binary::Or,
        ];
        let a = self.expr(ty, depth);
        let a = self.not_constant(a);
        match self.choices.below(20) {
            0..=6 => {
                let op = self.choices.of(&PLAIN);
                let b = if matches!(op, Binary::Xor | Binary::And | Binary::Or) {
                    self.expr(ty, depth)
                } else {
                    self.operand(ty, depth)
                };
                binary(ty, op, a, b)
            }
            7 | 8 => {
                let op = self.choices.of(&[Binary::Divide, Binary::Remainder]);
                let b = self.expr(ty, depth);
                // By a constant zero it would be an error, in one component too.
                let b = if b.is_constant() {
                    let divisor = 1 + self.choices.below(9) as u32;
                    let negative = scalar == Scalar::I32 && self.choices.chance(40);
                    let bits = if negative {
                        divisor.wrapping_neg()
                    } else {
                        divisor
                    };
                    splat(ty, scalar, bits)
                } else if matches!(b.kind, ExprKind::Construct(_)) {
                    binary(ty, Binary::Or, b, splat(ty, scalar, 1))
                } else {
                    b
                };
                binary(ty, op, a, b)
            }
            9 | 10 => {
                let op = self.choices.of(&[Binary::ShiftLeft, Binary::ShiftRight]);
                let shift = ty.with_scalar(Scalar::U32);
                let b = self.expr(&shift, depth);
                // By a constant too large it would be an error, in one component too.
                let b = if b.is_constant() {
                    splat(&shift, Scalar::U32, self.choices.below(32) as u32)
                } else if !self.program.interpreter_only || matches!(b.kind, ExprKind::Construct(_))
                {
                    binary(&shift, Binary::And, b, splat(&shift, Scalar::U32, 31))
                } else {
                    b
                };
                binary(ty, op, a, b)
            }
            11 => {
                let op = if scalar == Scalar::I32 && self.choices.chance(60) {
                    Unary::Negate
                } else {
                    Unary::Complement
                };
                expr(ty, ExprKind::Unary(op, Box::new(a)))
            }
            12 | 13 => self.converted(ty, scalar, depth),
            14 => self.packed(ty, scalar, depth),
            _ => self.integer_function(ty, scalar, a, depth),
        }
    }

    /// The second operand of an arithmetic operator: of the same type, or at times a
    /// scalar beside a vector.
    fn operand(&mut self, ty: &Type, depth: usize) -> Expr {
        match (ty, ty.scalar()) {
            (Type::Vector(..), Some(scalar)) if self.choices.chance(25) => {
                self.expr(&Type::Scalar(scalar), depth)
            }
            _ => self.expr(ty, depth),
        }
    }

    fn converted(&mut self, ty: &Type, scalar: Scalar, depth: usize) -> Expr {
        let others: Vec<Scalar> = [Scalar::U32, Scalar::I32, Scalar::F32, Scalar::Bool]
            .into_iter()
            .filter(|other| *other != scalar)
            .collect();
        let from = ty.with_scalar(self.choices.of(&others));
        let a = self.expr(&from, depth);
        let a = self.not_constant(a);
        // A float's bits for an integer, or an integer's bits for the other.
        let bits = scalar != Scalar::F32 && from.scalar() != Some(Scalar::Bool);
        let kind = if bits && self.choices.chance(40) {
            ExprKind::Bitcast(Box::new(a))
        } else {
            ExprKind::Convert(Box::new(a))
        };
        expr(ty, kind)
    }

    fn integer_function(&mut self, ty: &Type, scalar: Scalar, a: Expr, depth: usize) -> Expr {
        const BITS: [Function; 6] = [
            Function::CountOneBits,
            Function::CountLeadingZeros,
            Function::CountTrailingZeros,
            Function::FirstLeadingBit,
            Function::FirstTrailingBit,
            Function::ReverseBits,
        ];
        match self.choices.below(10) {
            0 | 1 => {
                let which = self.choices.of(&[Function::Min, Function::Max]);
                let b = self.expr(ty, depth);
                function(ty, which, vec![a, b])
            }
            2 => {
                let (low, high) = (self.expr(ty, depth), self.expr(ty, depth));
                // Constant bounds have to be in order.
                let (low, high) = if low.is_constant() && high.is_constant() {
                    let low = self.choices.below(8) as u32;
                    let high = low + self.choices.below(100) as u32;
                    (splat(ty, scalar, low), splat(ty, scalar, high))
                } else {
                    (low, high)
                };
                function(ty, Function::Clamp, vec![a, low, high])
            }
            3 => function(ty, Function::Abs, vec![a]),
            4 if scalar == Scalar::I32 => function(ty, Function::Sign, vec![a]),
            5 | 6 => {
                let (offset, count) = (self.bit_index(), self.bit_index());
                if self.choices.chance(50) {
                    function(ty, Function::ExtractBits, vec![a, offset, count])
                } else {
                    let new = self.expr(ty, depth);
                    function(ty, Function::InsertBits, vec![a, new, offset, count])
                }
            }
            _ => {
                let which = self.choices.of(&BITS);
                function(ty, which, vec![a])
            }
        }
    }

    /// An offset or a count of bits, a constant only where any sum fits.
    fn bit_index(&mut self) -> Expr {
        let value = self.expr(&U32, 1);
        if value.is_constant() {
            Expr::literal(Scalar::U32, self.choices.below(17) as u32)
        } else {
            value
        }
    }

    /// Functions on four bytes in a word, and dot products.
    fn packed(&mut self, ty: &Type, scalar: Scalar, depth: usize) -> Expr {
        let signed = scalar == Scalar::I32;
        let bytes = |signed: bool| {
            let scalar = if signed { Scalar::I32 } else { Scalar::U32 };
            Type::Vector(scalar, 4)
        };
        match ty {
            Type::Scalar(_) if self.choices.chance(35) => {
                let vector = Type::Vector(scalar, 2 + self.choices.below(3));
                let (a, b) = (self.expr(&vector, depth), self.expr(&vector, depth));
                let a = self.not_constant(a);
                function(ty, Function::Dot, vec![a, b])
            }
            Type::Scalar(_) if signed || self.choices.chance(40) => {
                let which = if signed {
                    Function::Dot4I8Packed
                } else {
                    Function::Dot4U8Packed
                };
                let (a, b) = (self.expr(&U32, depth), self.expr(&U32, depth));
                let a = self.not_constant(a);
                function(ty, which, vec![a, b])
            }
            Type::Scalar(_) => {
                let (which, signed) = self.choices.of(&[
                    (Function::Pack4xI8, true),
                    (Function::Pack4xU8, false),
                    (Function::Pack4xI8Clamp, true),
                    (Function::Pack4xU8Clamp, false),
                ]);
                let a = self.expr(&bytes(signed), depth);
                let a = self.not_constant(a);
                function(ty, which, vec![a])
            }
            Type::Vector(_, 4) => {
                let which = if signed {
                    Function::Unpack4xI8
                } else {
                    Function::Unpack4xU8
                };
                let a = self.expr(&U32, depth);
                let a = self.not_constant(a);
                function(ty, which, vec![a])
            }
            _ => self.converted(ty, scalar, depth),
        }
    }

    fn floating(&mut self, ty: &Type, depth: usize) -> Expr {
        let a = self.expr(ty, depth);
        let a = self.not_constant(a);
        match self.choices.below(20) {
            0..=6 => {
                let op = self
                    .choices
                    .of(&[Binary::Add, Binary::Multiply, Binary::Subtract]);
                let b = self.operand(ty, depth);
                binary(ty, op, a, b)
            }
            7 | 8 => {
                let b = self.expr(ty, depth);
                let b = if self.choices.chance(4) && !b.is_constant() {
                    b
                } else {
                    let b = self.not_constant(b);
                    let size = function(ty, Function::Abs, vec![b]);
                    binary(ty, Binary::Add, size, float(ty, 0.5))
                };
                binary(ty, Binary::Divide, a, b)
            }
            9 => expr(ty, ExprKind::Unary(Unary::Negate, Box::new(a))),
            10 | 11 => self.converted(ty, Scalar::F32, depth),
            12 => {
                // Bits of an integer as the significand of a number in 1..2.
                let words = ty.with_scalar(Scalar::U32);
                let bits = self.expr(&words, depth);
                let bits = self.not_constant(bits);
                let kept = splat(&words, Scalar::U32, 0x007f_ffff);
                let one = splat(&words, Scalar::U32, 0x3f80_0000);
                let bits = binary(&words, Binary::And, bits, kept);
                let bits = binary(&words, Binary::Or, bits, one);
                expr(ty, ExprKind::Bitcast(Box::new(bits)))
            }
            _ => self.float_function(ty, a, depth),
        }
    }

    fn float_function(&mut self, ty: &Type, a: Expr, depth: usize) -> Expr {
        const ROUNDINGS: [Function; 4] = [
            Function::Floor,
            Function::Ceil,
            Function::Trunc,
            Function::Round,
        ];
        match self.choices.below(12) {
            0..=2 => {
                let which = self.choices.of(&[Function::Min, Function::Max]);
                let b = self.expr(ty, depth);
                function(ty, which, vec![a, b])
            }
            3 => {
                let low = self.real(false);
                let high = low + self.choices.below(64) as f32 / 4.0;
                function(
                    ty,
                    Function::Clamp,
                    vec![a, float(ty, low), float(ty, high)],
                )
            }
            4 => function(ty, Function::Saturate, vec![a]),
            5 => function(ty, Function::Sign, vec![a]),
            6 => {
                let x = self.expr(ty, depth);
                function(ty, Function::Step, vec![a, x])
            }
            7 => function(ty, Function::Abs, vec![a]),
            8 => {
                let square = if self.choices.chance(3) {
                    a
                } else {
                    function(ty, Function::Abs, vec![a])
                };
                function(ty, Function::Sqrt, vec![square])
            }
            _ => {
                let which = self.choices.of(&ROUNDINGS);
                function(ty, which, vec![a])
            }
        }
    }

    /// A condition that is the same in all invocations of a workgroup.
    pub(super) fn uniform_condition(&mut self) -> Expr {
        let a = self.uniform_u32();
        let b = Expr::literal(Scalar::U32, self.choices.below(3) as u32);
        let op = self.choices.of(&COMPARISONS);
        binary(&BOOL, op, a, b)
    }

    fn uniform_u32(&mut self) -> Expr {
        let names: Vec<(Id, Type)> = self
            .scope
            .uniform
            .iter()
            .filter(|(_, ty)| matches!(ty, &U32 | &I32))
            .cloned()
            .collect();
        if names.is_empty() || self.choices.chance(30) {
            let group = expr(&Type::Vector(Scalar::U32, 3), ExprKind::Input(Input::Group));
            let component = vec![self.choices.below(3)];
            return expr(&U32, ExprKind::Swizzle(Box::new(group), component));
        }
        let (id, ty) = self.choices.of(&names);
        let name = expr(&ty, ExprKind::Name(id));
        if ty == U32 {
            name
        } else {
            expr(&U32, ExprKind::Bitcast(Box::new(name)))
        }
    }
}

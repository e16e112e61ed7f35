//! Random programs whose results are defined.
//!
//! * Integers wrap, divide and shift as WGSL says. Operands that WGSL forbids
//!   in constant expressions do not occur there.
//! * Floats are kept moderate: quotients mostly by what is not near zero, roots
//!   mostly of what is not negative, and what is stored is mostly clamped. So
//!   infinities, NaNs and subnormals are rare, but they occur.
//! * Functions are called with pointers to different variables, and never with
//!   a pointer to a private variable that the callee knows by name.
//! * Workgroup memory is used in phases with a barrier between them. In one
//!   phase a variable is written by its owner only, or read only, or updated
//!   by operations that commute. Tickets drawn from one counter are all used
//!   alike, for who gets which is not defined.
//! * Loops count their iterations, and the counts of nested loops and of
//!   functions called in them are limited together.

mod expression;
mod memory;
mod statement;

use std::sync::Arc;

use super::choices::Choices;
use super::evaluate::{Evaluation, evaluate};
use super::grammar::*;

/// Steps of an evaluation that is worth waiting for.
pub const STEPS: u64 = 1_500_000;

/// The program of a seed, and its results.
///
/// The few that take too long are passed over for the next in line.
#[must_use]
pub fn of_seed(seed: u64) -> (Program, Evaluation) {
    let mut attempt = seed;
    loop {
        let program = generate(Choices::seeded(attempt));
        if let Ok(evaluation) = evaluate(&program, STEPS) {
            return (program, evaluation);
        }
        // Far from the seeds that people count through.
        attempt = attempt.wrapping_add(0x5851_f42d_4c95_7f2d);
    }
}

/// The program that choices lead to.
#[must_use]
pub fn generate(choices: Choices<'_>) -> Program {
    let mut generator = Generator::new(choices);
    generator.declarations();
    generator.routines();
    generator.main();
    generator.program
}

/// How a workgroup variable may be used at the moment.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Access {
    Nothing,
    /// Everyone their own element.
    Own,
    /// Everyone everything, only reading.
    Read,
    /// The one invocation of this number, everything.
    Alone(u32),
    /// Everyone everything, by operations of the rule.
    Count(Rule),
}

/// What can be named at the moment.
#[derive(Clone, Debug, Default)]
struct Scope {
    /// Values.
    names: Vec<(Id, Type)>,
    /// Values that are the same in all invocations.
    uniform: Vec<(Id, Type)>,
    /// Variables.
    variables: Vec<(Id, Type)>,
    /// Parameters that point somewhere.
    pointers: Vec<(Id, Type, Passing)>,
}

struct Generator<'a> {
    choices: Choices<'a>,
    program: Program,
    structures: Vec<Type>,
    scope: Scope,
    /// How the workgroup variables may be used.
    access: Vec<Access>,
    /// The invocation that is alone at the moment.
    alone: Option<u32>,
    /// What the program does with tickets of each counter that it draws from.
    draws: Vec<(Counter, Draw)>,
    next: Id,
    /// Whether this is the entry point.
    in_main: bool,
    /// Whether private variables may be named, and functions called that do.
    private: bool,
    /// Whether one was.
    touched_private: bool,
    /// What the function returns.
    result: Option<Type>,
    /// Whether `return` is allowed.
    may_return: bool,
    /// Whether `break` leaves something, and `continue` goes on with something.
    may_break: bool,
    may_continue: bool,
    /// Whether this is a `continuing` block or its condition.
    continuing: bool,
    /// Statements that may still be made.
    fuel: usize,
    /// How often the statement being made is run at most.
    repeats: u64,
    /// Statements run by the function so far, at most.
    cost: u64,
    /// The same of finished functions.
    costs: Vec<u64>,
}

/// Most statements that nested loops and calls may run in one place.
const REPEATS: u64 = 48;

impl<'a> Generator<'a> {
    fn new(mut choices: Choices<'a>) -> Self {
        const SIZES: [[u32; 3]; 14] = [
            [8, 8, 1],
            [32, 1, 1],
            [64, 1, 1],
            [4, 4, 4],
            [1, 1, 1],
            [7, 1, 1],
            [16, 2, 1],
            [5, 13, 1],
            [10, 10, 1],
            [3, 1, 5],
            [128, 1, 1],
            [64, 3, 1],
            [16, 16, 1],
            [2, 1, 1],
        ];
        const GROUPS: [[u32; 3]; 5] = [[2, 1, 1], [1, 1, 1], [1, 2, 1], [3, 1, 1], [1, 1, 2]];
        let size = choices.of(&SIZES);
        let groups = if size.iter().product::<u32>() > 100 {
            [1, 1, 1]
        } else {
            choices.of(&GROUPS)
        };
        Self {
            choices,
            program: Program {
                constants: Vec::new(),
                private: Vec::new(),
                workgroup: Vec::new(),
                routines: Vec::new(),
                main: Vec::new(),
                names: 0,
                slots: 0,
                size,
                groups,
                data: Vec::new(),
                reals: Vec::new(),
                interpreter_only: false,
            },
            continuing: false,
            structures: Vec::new(),
            scope: Scope::default(),
            access: Vec::new(),
            alone: None,
            draws: Vec::new(),
            next: 0,
            in_main: true,
            private: true,
            touched_private: false,
            result: None,
            may_return: false,
            may_break: false,
            may_continue: false,
            fuel: 0,
            repeats: 1,
            cost: 0,
            costs: Vec::new(),
        }
    }

    /// A name that is not used yet.
    fn fresh(&mut self) -> Id {
        self.next += 1;
        self.next - 1
    }

    /// What the module declares beside functions.
    fn declarations(&mut self) {
        let wild = self.choices.chance(10);
        self.program.interpreter_only = self.choices.chance(10);
        self.program.data = (0..32).map(|_| self.integer()).collect();
        self.program.reals = (0..32).map(|_| self.real(wild).to_bits()).collect();
        for index in 0..self.choices.below(3) {
            let members = (0..1 + self.choices.below(4)).map(|_| self.ty(1)).collect();
            let structure = Structure { index, members };
            self.structures.push(Type::Struct(Arc::new(structure)));
        }
        for _ in 0..self.choices.below(3) {
            let scalar = self.choices.of(&[Scalar::U32, Scalar::I32, Scalar::F32]);
            let size = 2 + self.choices.below(5);
            let words = (0..size).map(|_| self.literal_bits(scalar)).collect();
            let ty = Type::Array(Arc::new(Type::Scalar(scalar)), size);
            self.program.constants.push((ty, words));
        }
        for _ in 0..self.choices.below(4) {
            let ty = self.ty(2);
            let words = if self.choices.chance(50) {
                ty.scalars()
                    .into_iter()
                    .map(|scalar| self.literal_bits(scalar))
                    .collect()
            } else {
                vec![0; ty.words()]
            };
            self.program.private.push((ty, words));
        }
        if self.choices.chance(60) {
            for _ in 0..1 + self.choices.below(3) {
                let integer = self.choices.of(&[Scalar::U32, Scalar::I32]);
                let variable = match self.choices.below(5) {
                    0 => Workgroup::Single(self.ty(1)),
                    1 => Workgroup::LaneAtomics(integer),
                    2 => Workgroup::Counters(integer, 1 + self.choices.below(4)),
                    _ => {
                        // A workgroup has 16 KiB.
                        let ty = self.ty(1);
                        let small = ty.words() * self.program.lanes() as usize <= 1024;
                        Workgroup::Lanes(if small { ty } else { U32 })
                    }
                };
                self.program.workgroup.push(variable);
            }
        }
        self.access = vec![Access::Nothing; self.program.workgroup.len()];
    }

    /// A type; arrays and structures have parts of less depth.
    fn ty(&mut self, depth: usize) -> Type {
        const SCALARS: [Scalar; 7] = [
            Scalar::U32,
            Scalar::I32,
            Scalar::F32,
            Scalar::U32,
            Scalar::I32,
            Scalar::F32,
            Scalar::Bool,
        ];
        let scalar = self.choices.of(&SCALARS);
        match self.choices.below(if depth == 0 { 14 } else { 20 }) {
            0..=7 => Type::Scalar(scalar),
            8..=12 => Type::Vector(scalar, 2 + self.choices.below(3)),
            13 => Type::Matrix {
                columns: 2 + self.choices.below(3),
                rows: 2 + self.choices.below(3),
            },
            14..=16 => {
                let element = self.ty(depth - 1);
                Type::Array(Arc::new(element), 2 + self.choices.below(4))
            }
            _ if self.structures.is_empty() => Type::Scalar(scalar),
            _ => self.choices.of(&self.structures.clone()),
        }
    }

    /// Functions, from those that call nothing to those that call others.
    fn routines(&mut self) {
        for _ in 0..self.choices.below(4) {
            self.next = 0;
            self.in_main = false;
            self.private = true;
            self.touched_private = false;
            self.may_return = true;
            (self.repeats, self.cost) = (1, 0);
            self.fuel = 3 + self.choices.below(8);
            self.scope = Scope::default();
            // The first parameter is what is not constant in the function.
            let mut parameters = vec![Parameter {
                id: self.fresh(),
                ty: U32,
                passing: Passing::Value,
            }];
            for _ in 0..self.choices.below(4) {
                parameters.push(self.parameter());
            }
            for parameter in &parameters {
                let Parameter { id, ty, passing } = parameter.clone();
                match passing {
                    Passing::Value => self.scope.names.push((id, ty)),
                    _ => self.scope.pointers.push((id, ty, passing)),
                }
                // What it points to may not be reached by another way.
                self.private &= passing != Passing::Private;
            }
            let result = self.choices.chance(85).then(|| self.ty(1));
            self.result = result.clone();
            let mut body = self.block(2, 4);
            if let Some(ty) = &result {
                body.retain(|stmt| !matches!(stmt, Stmt::Return(_)));
                let value = self.stored(ty, 2);
                body.push(Stmt::Return(Some(value)));
            }
            self.program.routines.push(Routine {
                parameters,
                result,
                body,
                names: self.next,
                touches_private: self.touched_private,
            });
            self.costs.push(self.cost + 1);
        }
        self.result = None;
    }

    fn parameter(&mut self) -> Parameter {
        let id = self.fresh();
        let private = &self.program.private;
        let (ty, passing) = match self.choices.below(5) {
            0 | 1 => (self.ty(1), Passing::Value),
            2 | 3 => (self.ty(1), Passing::Function),
            _ if private.is_empty() => (self.ty(1), Passing::Value),
            // So that there is something to point to.
            _ => {
                let at = self.choices.below(private.len());
                (self.program.private[at].0.clone(), Passing::Private)
            }
        };
        Parameter { id, ty, passing }
    }

    fn main(&mut self) {
        self.next = 0;
        self.in_main = true;
        self.private = true;
        self.may_return = false;
        (self.repeats, self.cost) = (1, 0);
        self.scope = Scope::default();
        let mut body = Vec::new();
        for _ in 0..3 + self.choices.below(4) {
            body.push(self.declaration());
        }
        // Something for functions to point to.
        for routine in 0..self.program.routines.len() {
            for parameter in self.program.routines[routine].parameters.clone() {
                if parameter.passing == Passing::Function {
                    let id = self.fresh();
                    let value = self.expr(&parameter.ty, 1);
                    self.scope.variables.push((id, parameter.ty.clone()));
                    body.push(Stmt::Var(id, parameter.ty, Some(value)));
                }
            }
        }
        if !self.program.workgroup.is_empty() {
            for _ in 0..1 + self.choices.below(4) {
                self.segment(&mut body, 1);
            }
        }
        // Behind the last barrier, workgroup memory stays as it is.
        self.access.fill(Access::Read);
        self.may_return = true;
        self.fuel = 8 + self.choices.below(16);
        let mut rest = self.statements(3, 12);
        body.append(&mut rest);
        self.emit_everything(&mut body);
        self.program.main = body;
        self.program.names = self.next;
    }
}

//! Programs made smaller while they keep going wrong.

use super::grammar::*;

/// A program from which nothing can be left out.
#[derive(Clone, Debug)]
pub struct Shrunk {
    /// The program.
    pub program: Program,
    /// Programs tried on the way.
    pub tried: usize,
}

/// Takes a program apart as long as `fails` says that what is left still goes
/// wrong, trying at most `limit` programs.
///
/// Statements go first, in halves of blocks and then one by one; then compound
/// statements are replaced by their parts, expressions by theirs or by
/// constants, and the number of invocations is reduced.
pub fn shrink(program: &Program, limit: usize, mut fails: impl FnMut(&Program) -> bool) -> Shrunk {
    let mut best = program.clone();
    let mut tried = 0;
    let mut progress = true;
    while progress && tried < limit {
        progress = false;
        for kind in [Edits::Statements, Edits::Expressions] {
            let mut number = 0;
            while tried < limit
                && let Some(candidate) = edited(&best, kind, number)
            {
                tried += 1;
                if size(&candidate) < size(&best) && is_sound(&candidate) && fails(&candidate) {
                    // The edit of the same number is now another one.
                    best = candidate;
                    progress = true;
                } else {
                    number += 1;
                }
            }
        }
    }
    Shrunk {
        program: best,
        tried,
    }
}

/// What shrinking makes less of: parts of the program, large constants,
/// invocations.
#[must_use]
pub fn size(program: &Program) -> usize {
    let mut counter = Editor::new(Edits::Count, 0);
    counter.program(&mut program.clone());
    let invocations = program.invocations() as usize;
    counter.seen * 4 + invocations
}

/// Whether a program is free of what generated ones avoid, for naga gets it
/// wrong: a constant vector of a scalar and a vector.
fn is_sound(program: &Program) -> bool {
    let mut counter = Editor::new(Edits::Count, 0);
    counter.program(&mut program.clone());
    !counter.unsound
}

/// How many statements a program has, in functions that are not called too.
#[must_use]
pub fn statements(program: &Program) -> usize {
    let mut counter = Editor::new(Edits::Count, 0);
    counter.program(&mut program.clone());
    counter.statements
}

/// Which edits are looked at.
#[derive(Clone, Copy, PartialEq)]
enum Edits {
    Statements,
    Expressions,
    /// None; parts are counted.
    Count,
}

/// The program after the edit of a number, if there are so many.
fn edited(program: &Program, kind: Edits, number: usize) -> Option<Program> {
    let mut program = program.clone();
    let mut editor = Editor::new(kind, number);
    editor.program(&mut program);
    editor.done.then_some(program)
}

/// Walks through a program up to the edit of a number.
struct Editor {
    kind: Edits,
    /// Edits still to pass.
    left: usize,
    done: bool,
    /// Parts seen.
    seen: usize,
    /// Statements seen.
    statements: usize,
    /// Whether something was seen that generated programs avoid.
    unsound: bool,
}

impl Editor {
    fn new(kind: Edits, number: usize) -> Self {
        Self {
            kind,
            left: number,
            done: false,
            seen: 0,
            statements: 0,
            unsound: false,
        }
    }

    /// Whether to make this edit.
    fn now(&mut self, kind: Edits) -> bool {
        if self.done || self.kind != kind {
            return false;
        }
        if self.left == 0 {
            self.done = true;
            return true;
        }
        self.left -= 1;
        false
    }

    fn program(&mut self, program: &mut Program) {
        const ONE: [u32; 3] = [1; 3];
        if program.groups != ONE && self.now(Edits::Statements) {
            program.groups = ONE;
        }
        if program.size != ONE && self.now(Edits::Statements) {
            program.size = ONE;
        }
        for axis in 0..3 {
            if program.size[axis] > 1 && self.now(Edits::Statements) {
                program.size[axis] /= 2;
            }
        }
        self.block(&mut program.main);
        for routine in &mut program.routines {
            self.block(&mut routine.body);
        }
    }

    fn block(&mut self, block: &mut Block) {
        // Halves, quarters, ... and single statements.
        let mut length = block.len() / 2;
        while length > 1 {
            let mut start = 0;
            while start < block.len() {
                if self.now(Edits::Statements) {
                    let end = block.len().min(start + length);
                    block.drain(start..end);
                    return;
                }
                start += length;
            }
            length /= 2;
        }
        for index in (0..block.len()).rev() {
            if self.now(Edits::Statements) {
                block.remove(index);
                return;
            }
            if self.unwrap(block, index) {
                return;
            }
        }
        for stmt in block {
            if self.done {
                return;
            }
            self.seen += 3;
            self.statements += 1;
            self.stmt(stmt);
        }
    }

    /// Replaces a compound statement by a part of it. A phase stays whole: it
    /// keeps the barrier behind what it does.
    fn unwrap(&mut self, block: &mut Block, index: usize) -> bool {
        let parts: Vec<&Block> = match &block[index] {
            Stmt::If(_, accept, reject) => vec![accept, reject],
            Stmt::Switch(_, cases) => cases.iter().map(|case| &case.body).collect(),
            Stmt::For { body, .. } | Stmt::While { body, .. } | Stmt::Block(body) => vec![body],
            Stmt::Loop {
                body, continuing, ..
            } => vec![body, continuing],
            _ => return false,
        };
        for part in parts {
            if self.now(Edits::Statements) {
                let part = part.clone();
                block.splice(index..=index, part);
                return true;
            }
        }
        false
    }

    fn stmt(&mut self, stmt: &mut Stmt) {
        match stmt {
            Stmt::Let(_, value)
            | Stmt::Ignore(value)
            | Stmt::Emit(_, value)
            | Stmt::Count(_, _, value)
            | Stmt::CompareAndAdd(_, _, value)
            | Stmt::Return(Some(value)) => self.expr(value),
            Stmt::Var(_, _, value) => {
                if value.is_some() && self.now(Edits::Expressions) {
                    *value = None;
                }
                if let Some(value) = value {
                    self.expr(value);
                }
            }
            Stmt::Assign(place, value) => {
                self.place(place);
                self.expr(value);
            }
            Stmt::Update(op, place, value) => {
                if !matches!(op, Binary::Add | Binary::And) && self.now(Edits::Expressions) {
                    *stmt = Stmt::Assign(place.clone(), value.clone());
                    return;
                }
                self.place(place);
                self.expr(value);
            }
            Stmt::Step(place, _) => self.place(place),
            Stmt::If(condition, accept, reject) => {
                if !reject.is_empty() && self.now(Edits::Statements) {
                    reject.clear();
                }
                self.expr(condition);
                self.block(accept);
                self.block(reject);
            }
            Stmt::Switch(selector, cases) => {
                for index in 0..cases.len() {
                    if !cases[index].default && self.now(Edits::Statements) {
                        cases.remove(index);
                        return;
                    }
                    if cases[index].values.len() > 1 && self.now(Edits::Statements) {
                        cases[index].values.pop();
                        return;
                    }
                }
                self.expr(selector);
                for case in cases {
                    self.seen += 1 + case.values.len();
                    self.block(&mut case.body);
                }
            }
            Stmt::For { trips, body, .. } => {
                self.trips(trips);
                self.block(body);
            }
            Stmt::While {
                trips,
                condition,
                body,
                ..
            } => {
                self.trips(trips);
                self.expr(condition);
                self.block(body);
            }
            Stmt::Loop {
                trips,
                body,
                continuing,
                until,
                ..
            } => {
                self.trips(trips);
                if until.is_some() && self.now(Edits::Expressions) {
                    *until = None;
                }
                self.block(body);
                self.block(continuing);
                if let Some(until) = until {
                    self.expr(until);
                }
            }
            Stmt::Call(_, arguments) => self.arguments(arguments),
            Stmt::Block(block) | Stmt::Alone(_, block) | Stmt::Phase(block, _) => {
                self.block(block);
            }
            Stmt::OwnAtomic { compare, value, .. } => {
                if let Some(compare) = compare {
                    self.expr(compare);
                }
                self.expr(value);
            }
            Stmt::Ticket { draw, .. } => {
                if draw.factor != 1 {
                    self.seen += 1;
                    // Where several draw from the counter, they no longer do the
                    // same then, and an evaluation refuses that.
                    if self.now(Edits::Expressions) {
                        draw.factor = 1;
                    }
                }
            }
            Stmt::Break | Stmt::Continue | Stmt::Return(None) | Stmt::UniformLoad(..) => {}
        }
    }

    fn trips(&mut self, trips: &mut u32) {
        self.seen += *trips as usize;
        if *trips > 1 && self.now(Edits::Statements) {
            *trips = 1;
        }
        if *trips > 2 && self.now(Edits::Statements) {
            *trips -= 1;
        }
    }

    fn arguments(&mut self, arguments: &mut [Argument]) {
        for argument in arguments {
            self.seen += 1;
            if let Argument::Value(value) = argument {
                self.expr(value);
            }
        }
    }

    fn place(&mut self, place: &mut Place) {
        self.seen += 1;
        if let Root::Shared(_, index) = &mut place.root {
            self.expr(index);
        }
        for step in &mut place.path {
            self.seen += 1;
            if let Step::Index(index) = step {
                self.expr(index);
            }
        }
    }

    fn expr(&mut self, expr: &mut Expr) {
        self.seen += 1;
        if self.done {
            return;
        }
        // Literals are as small as it gets, 0 being smaller than others.
        if let ExprKind::Literal(bits) = expr.kind {
            self.seen += usize::from(bits != 0) + usize::from(bits > 1);
            for value in 0..2 {
                if bits > value && self.now(Edits::Expressions) {
                    expr.kind = ExprKind::Literal(value_of(&expr.ty, value));
                    return;
                }
            }
            return;
        }
        if expr.kind == ExprKind::Zero {
            return;
        }
        self.seen += 1;
        if let (Type::Vector(..), ExprKind::Construct(parts)) = (&expr.ty, &expr.kind) {
            let vector = parts.iter().any(|part| matches!(part.ty, Type::Vector(..)));
            self.unsound |= vector && expr.is_constant();
        }
        if self.now(Edits::Expressions) {
            *expr = Expr::zero(expr.ty.clone());
            return;
        }
        if let Type::Scalar(scalar) = expr.ty
            && self.now(Edits::Expressions)
        {
            *expr = Expr::literal(scalar, value_of(&expr.ty, 1));
            return;
        }
        let mut parts = Vec::new();
        below(expr, 2, &mut parts);
        for part in parts {
            if part.ty == expr.ty && self.now(Edits::Expressions) {
                *expr = part;
                return;
            }
        }
        self.inside(expr);
    }

    fn inside(&mut self, expr: &mut Expr) {
        match &mut expr.kind {
            ExprKind::Data(a)
            | ExprKind::Reals(a)
            | ExprKind::Unary(_, a)
            | ExprKind::Convert(a)
            | ExprKind::Bitcast(a)
            | ExprKind::Swizzle(a, _)
            | ExprKind::Member(a, _)
            | ExprKind::AtomicLoad(_, a) => self.expr(a),
            ExprKind::Binary(_, a, b) | ExprKind::Index(a, b) => {
                self.expr(a);
                self.expr(b);
            }
            ExprKind::Load(place) => self.place(place),
            ExprKind::Function(_, parts) | ExprKind::Construct(parts) => {
                for part in parts {
                    self.expr(part);
                }
            }
            ExprKind::Call(_, arguments) => self.arguments(arguments),
            ExprKind::Literal(_)
            | ExprKind::Zero
            | ExprKind::Constant(_)
            | ExprKind::Input(_)
            | ExprKind::Name(_) => {}
        }
    }
}

/// The bits of 0 or 1 in a scalar type.
fn value_of(ty: &Type, value: u32) -> u32 {
    match ty {
        &F32 => (value as f32).to_bits(),
        _ => value,
    }
}

/// The expressions directly below one, and those below them.
fn below(expr: &Expr, depth: usize, parts: &mut Vec<Expr>) {
    if depth == 0 {
        return;
    }
    let mut add = |part: &Expr| {
        parts.push(part.clone());
        below(part, depth - 1, parts);
    };
    match &expr.kind {
        ExprKind::Data(a)
        | ExprKind::Reals(a)
        | ExprKind::Unary(_, a)
        | ExprKind::Convert(a)
        | ExprKind::Bitcast(a)
        | ExprKind::Swizzle(a, _)
        | ExprKind::Member(a, _)
        | ExprKind::AtomicLoad(_, a) => add(a),
        ExprKind::Binary(_, a, b) | ExprKind::Index(a, b) => {
            add(a);
            add(b);
        }
        ExprKind::Function(_, all) | ExprKind::Construct(all) => all.iter().for_each(add),
        ExprKind::Call(_, arguments) => {
            for argument in arguments {
                if let Argument::Value(value) = argument {
                    add(value);
                }
            }
        }
        _ => {}
    }
}

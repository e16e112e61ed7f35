//! Statements.

use super::{Access, Generator, REPEATS};
use crate::programs::grammar::*;

impl Generator<'_> {
    /// Statements in a scope of their own.
    pub(super) fn block(&mut self, depth: usize, most: usize) -> Block {
        let scope = self.scope.clone();
        let block = self.statements(depth, most);
        self.scope = scope;
        block
    }

    /// Statements in the scope that is.
    pub(super) fn statements(&mut self, depth: usize, most: usize) -> Block {
        let mut block = Vec::new();
        for _ in 0..1 + self.choices.below(most) {
            if self.fuel == 0 {
                break;
            }
            self.fuel -= 1;
            self.cost += self.repeats;
            let stmt = self.stmt(depth);
            block.push(stmt);
        }
        block
    }

    fn stmt(&mut self, depth: usize) -> Stmt {
        let nested = depth > 0 && self.fuel > 1;
        match self.choices.below(if nested { 32 } else { 16 }) {
            0 => self.declaration(),
            1 | 2 => self.named(),
            3..=6 => self.assignment(),
            7 | 8 => self.update(),
            9 => self.step(),
            10 | 11 if self.in_main => self.emit(),
            12 | 13 if self.in_main => self.atomic(),
            14 => self.call_statement(),
            15 | 16 => self.jump(),
            17..=22 => {
                let condition = self.expr(&BOOL, 2);
                let accept = self.block(depth - 1, 4);
                let reject = if self.choices.chance(50) {
                    self.block(depth - 1, 3)
                } else {
                    Vec::new()
                };
                Stmt::If(condition, accept, reject)
            }
            23 | 24 => self.switch(depth),
            25..=29 => self.repeat(depth),
            30 => Stmt::Block(self.block(depth - 1, 3)),
            31 if self.in_main && !self.program.workgroup.is_empty() => self.by_one(depth),
            _ => self.assignment(),
        }
    }

    /// `var` or `let`.
    pub(super) fn declaration(&mut self) -> Stmt {
        if self.choices.chance(25) {
            return self.named();
        }
        let ty = self.ty(2);
        let value = self.choices.chance(80).then(|| self.stored(&ty, 2));
        let id = self.fresh();
        self.scope.variables.push((id, ty.clone()));
        Stmt::Var(id, ty, value)
    }

    fn named(&mut self) -> Stmt {
        let ty = self.ty(1);
        let value = self.stored(&ty, 3);
        let id = self.fresh();
        // naga takes the name of a constant for a constant.
        if value.is_constant() {
            self.scope.variables.push((id, ty.clone()));
            return Stmt::Var(id, ty, Some(value));
        }
        self.scope.names.push((id, ty));
        Stmt::Let(id, value)
    }

    fn assignment(&mut self) -> Stmt {
        for _ in 0..6 {
            let ty = self.ty(2);
            if let Some(place) = self.place(&ty, true) {
                let value = self.stored(&ty, 3);
                return Stmt::Assign(place, value);
            }
        }
        self.named()
    }

    fn update(&mut self) -> Stmt {
        const PLAIN: [Binary; 6] = [
            Binary::Add,
            Binary::Subtract,
            Binary::Multiply,
            Binary::Xor,
            Binary::And,
            Binary::Or,
        ];
        for _ in 0..6 {
            let ty = self.ty(0);
            let (Type::Scalar(scalar) | Type::Vector(scalar, _)) = ty else {
                continue;
            };
            let ops: &[Binary] = match scalar {
                Scalar::Bool => &[Binary::And, Binary::Or],
                Scalar::F32 => &[Binary::Add, Binary::Subtract],
                _ => &PLAIN,
            };
            let op = self.choices.of(ops);
            if let Some(place) = self.place(&ty, true) {
                let value = self.stored(&ty, 2);
                return Stmt::Update(op, place, value);
            }
        }
        self.assignment()
    }

    fn step(&mut self) -> Stmt {
        let ty = self.choices.of(&[U32, I32]);
        match self.place(&ty, true) {
            Some(place) => Stmt::Step(place, self.choices.chance(60)),
            None => self.assignment(),
        }
    }

    fn emit(&mut self) -> Stmt {
        let ty =
            Type::Scalar(
                self.choices
                    .of(&[Scalar::U32, Scalar::I32, Scalar::F32, Scalar::Bool]),
            );
        let value = self.expr(&ty, 2);
        self.slot(value)
    }

    /// Writes a result to a slot of its own.
    fn slot(&mut self, value: Expr) -> Stmt {
        self.program.slots += 1;
        Stmt::Emit(self.program.slots - 1, value)
    }

    /// Everything there is at the end of the entry point, as results.
    pub(super) fn emit_everything(&mut self, body: &mut Block) {
        /// Enough to see most of what was computed.
        const SLOTS: usize = 24;
        let mut wholes: Vec<Expr> = Vec::new();
        let mut load = |root: Root, ty: &Type| {
            let place = Place {
                ty: ty.clone(),
                of: ty.clone(),
                root,
                path: Vec::new(),
            };
            wholes.push(Expr {
                ty: ty.clone(),
                kind: ExprKind::Load(place),
            });
        };
        for (id, ty) in &self.scope.variables {
            load(Root::Local(*id), ty);
        }
        for (index, (ty, _)) in self.program.private.iter().enumerate() {
            load(Root::Private(index), ty);
        }
        for (id, ty) in &self.scope.names {
            wholes.push(Expr {
                ty: ty.clone(),
                kind: ExprKind::Name(*id),
            });
        }
        let mut parts = Vec::new();
        for whole in wholes {
            scalars_of(whole, &mut parts);
        }
        // Spread over all of them.
        let stride = parts.len().div_ceil(SLOTS).max(1);
        for part in parts.into_iter().step_by(stride) {
            let stmt = self.slot(part);
            body.push(stmt);
        }
        if self.program.slots == 0 {
            let stmt = self.slot(Expr::literal(Scalar::U32, 1));
            body.push(stmt);
        }
    }

    fn call_statement(&mut self) -> Stmt {
        if !self.program.routines.is_empty() {
            let routine = self.choices.below(self.program.routines.len());
            if let Some(arguments) = self.arguments(routine, 1) {
                return Stmt::Call(routine, arguments);
            }
        }
        let ty = self.ty(1);
        Stmt::Ignore(self.expr(&ty, 2))
    }

    /// `break`, `continue` or `return`, under a condition.
    fn jump(&mut self) -> Stmt {
        let mut kinds = Vec::new();
        if self.may_break {
            kinds.extend([0, 0]);
        }
        if self.may_continue {
            kinds.extend([1, 1]);
        }
        if self.may_return {
            kinds.push(2);
        }
        if kinds.is_empty() {
            return self.assignment();
        }
        let condition = self.expr(&BOOL, 2);
        let mut block = if self.choices.chance(30) {
            vec![self.assignment()]
        } else {
            Vec::new()
        };
        block.push(match self.choices.of(&kinds) {
            0 => Stmt::Break,
            1 => Stmt::Continue,
            _ => {
                let value = self.result.clone().map(|ty| self.stored(&ty, 2));
                Stmt::Return(value)
            }
        });
        // What was named in the block is not known behind it.
        let known = |id: &Id| {
            block.iter().all(
                |stmt| !matches!(stmt, Stmt::Let(other, _) | Stmt::Var(other, ..) if other == id),
            )
        };
        self.scope.names.retain(|(id, _)| known(id));
        self.scope.variables.retain(|(id, _)| known(id));
        Stmt::If(condition, block, Vec::new())
    }

    fn switch(&mut self, depth: usize) -> Stmt {
        let scalar = self.choices.of(&[Scalar::U32, Scalar::I32]);
        let selector = self.expr(&Type::Scalar(scalar), 2);
        let few = Expr::literal(scalar, 2 + self.choices.below(4) as u32);
        // Most values have a case.
        let selector = if self.choices.chance(70) && !selector.is_constant() {
            Expr {
                ty: selector.ty.clone(),
                kind: ExprKind::Binary(Binary::Remainder, Box::new(selector), Box::new(few)),
            }
        } else {
            selector
        };
        let may_break = std::mem::replace(&mut self.may_break, true);
        let mut cases = Vec::new();
        let mut value = if scalar == Scalar::I32 { u32::MAX } else { 0 };
        for _ in 0..1 + self.choices.below(3) {
            let values = (0..1 + self.choices.below(2))
                .map(|_| {
                    value = value.wrapping_add(1);
                    value.wrapping_sub(1)
                })
                .collect();
            cases.push(Case {
                values,
                default: false,
                body: self.block(depth - 1, 3),
            });
        }
        if self.choices.chance(20) {
            let at = self.choices.below(cases.len());
            cases[at].default = true;
        } else {
            let at = self.choices.below(cases.len() + 1);
            let body = self.block(depth - 1, 2);
            cases.insert(
                at,
                Case {
                    values: Vec::new(),
                    default: true,
                    body,
                },
            );
        }
        self.may_break = may_break;
        Stmt::Switch(selector, cases)
    }

    /// A loop of one kind or another.
    fn repeat(&mut self, depth: usize) -> Stmt {
        let trips = 1 + self.choices.below(5) as u32;
        if self.repeats * u64::from(trips) > REPEATS {
            return Stmt::Block(self.block(depth - 1, 3));
        }
        let repeats = self.repeats;
        self.repeats *= u64::from(trips);
        let outer = (self.may_break, self.may_continue);
        let scope = self.scope.clone();
        let id = self.fresh();
        let kind = self.choices.below(4);
        let scalar = if kind < 2 {
            self.choices.of(&[Scalar::U32, Scalar::I32])
        } else {
            Scalar::U32
        };
        self.scope.names.push((id, Type::Scalar(scalar)));
        // Without `break` and `continue`.
        (self.may_break, self.may_continue) = (false, false);
        let continuing = std::mem::replace(&mut self.continuing, kind > 2);
        let condition = self.expr(&BOOL, 2);
        self.continuing = continuing;
        (self.may_break, self.may_continue) = (true, true);
        let body = self.block(depth - 1, 4);
        let stmt = match kind {
            0 | 1 => Stmt::For {
                id,
                scalar,
                from: self.choices.below(6) as u32,
                step: self.choices.of(&[1, 1, 1, 2, 3, u32::MAX]),
                trips,
                body,
            },
            2 => Stmt::While {
                id,
                trips,
                condition,
                body,
            },
            _ => {
                (self.may_break, self.may_continue) = (false, false);
                let may_return = std::mem::replace(&mut self.may_return, false);
                let outer = std::mem::replace(&mut self.continuing, true);
                let continuing = self.block(0, 2);
                self.continuing = outer;
                self.may_return = may_return;
                Stmt::Loop {
                    id,
                    trips,
                    body,
                    continuing,
                    until: self.choices.chance(70).then_some(condition),
                }
            }
        };
        self.scope = scope;
        (self.may_break, self.may_continue) = outer;
        self.repeats = repeats;
        stmt
    }

    /// Updates of tallies and counters.
    fn atomic(&mut self) -> Stmt {
        let mut counters: Vec<(Counter, Scalar, Rule)> = Vec::new();
        for (index, rule) in TALLY_RULES.into_iter().enumerate() {
            counters.push((Counter::Tally(index), Scalar::U32, rule));
            counters.push((Counter::SignedTally(index), Scalar::I32, rule));
        }
        let mut own = Vec::new();
        for (index, variable) in self.program.workgroup.iter().enumerate() {
            match (variable, self.access[index]) {
                (Workgroup::Counters(scalar, count), Access::Count(rule)) => {
                    // Preferred to tallies, which there always are.
                    for _ in 0..4 {
                        let element = self.choices.below(*count);
                        counters.push((Counter::Workgroup(index, element), *scalar, rule));
                    }
                }
                (Workgroup::LaneAtomics(scalar), Access::Own) => own.push((index, *scalar)),
                _ => {}
            }
        }
        if !own.is_empty() && self.choices.chance(60) {
            let (variable, scalar) = self.choices.of(&own);
            return self.own_atomic(variable, scalar);
        }
        let (counter, scalar, rule) = self.choices.of(&counters);
        if rule == Rule::Tickets {
            let draw = self.draw(counter, scalar, &counters);
            return Stmt::Ticket {
                from: counter,
                scalar,
                draw,
            };
        }
        let value = self.expr(&Type::Scalar(scalar), 2);
        // Contended exchanges repeat once for every other invocation.
        let alone = self.repeats == 1 && !self.continuing;
        if rule == Rule::Sum && alone && self.choices.chance(25) {
            let value = if value.is_constant() {
                Expr::literal(scalar, 3)
            } else {
                value
            };
            return Stmt::CompareAndAdd(counter, scalar, value);
        }
        Stmt::Count(counter, self.choices.of(rule.operations()), value)
    }

    /// What to do with tickets of a counter: the same as everywhere in the
    /// program, see [`Stmt::Ticket`].
    fn draw(
        &mut self,
        from: Counter,
        scalar: Scalar,
        counters: &[(Counter, Scalar, Rule)],
    ) -> Draw {
        // Not a workgroup's own: which workgroup gets which ticket is open.
        let others: Vec<(Counter, Rule)> = counters
            .iter()
            .filter(|(to, other, rule)| {
                *other == scalar && *rule != Rule::Tickets && !matches!(to, Counter::Workgroup(..))
            })
            .map(|(to, _, rule)| (*to, *rule))
            .collect();
        let (to, rule) = self.choices.of(&others);
        let draw = Draw {
            to,
            update: self.choices.of(rule.operations()),
            factor: 1 + self.choices.below(1000) as u32,
        };
        if let Some((_, known)) = self.draws.iter().find(|(counter, _)| *counter == from) {
            return *known;
        }
        self.draws.push((from, draw));
        draw
    }

    fn own_atomic(&mut self, variable: usize, scalar: Scalar) -> Stmt {
        const ALL: [Atomic; 10] = [
            Atomic::Add,
            Atomic::Sub,
            Atomic::Min,
            Atomic::Max,
            Atomic::And,
            Atomic::Or,
            Atomic::Xor,
            Atomic::Exchange,
            Atomic::CompareExchange,
            Atomic::Store,
        ];
        let ty = Type::Scalar(scalar);
        let atomic = self.choices.of(&ALL);
        let compare = (atomic == Atomic::CompareExchange)
            .then(|| Expr::literal(scalar, self.choices.below(2) as u32));
        let value = self.expr(&ty, 2);
        let id = self.fresh();
        self.scope.names.push((id, ty));
        Stmt::OwnAtomic {
            id,
            variable,
            atomic,
            compare,
            value,
        }
    }

    /// A block for one invocation alone.
    fn by_one(&mut self, depth: usize) -> Stmt {
        let lanes: Vec<u32> = self
            .access
            .iter()
            .filter_map(|access| match access {
                Access::Alone(lane) => Some(*lane),
                _ => None,
            })
            .collect();
        let (Some(_), None) = (lanes.first(), self.alone) else {
            return self.assignment();
        };
        let lane = self.choices.of(&lanes);
        self.alone = Some(lane);
        let block = self.block(depth - 1, 3);
        self.alone = None;
        Stmt::Alone(lane, block)
    }

    /// A part of the entry point in uniform control flow, in which workgroup
    /// memory is used.
    pub(super) fn segment(&mut self, body: &mut Block, depth: usize) {
        match self.choices.below(8) {
            0 if depth > 0 => {
                let condition = self.uniform_condition();
                let accept = self.segments(depth - 1);
                let reject = if self.choices.chance(50) {
                    self.segments(depth - 1)
                } else {
                    Vec::new()
                };
                body.push(Stmt::If(condition, accept, reject));
            }
            1 if depth > 0 => {
                let trips = 2 + self.choices.below(2) as u32;
                let id = self.fresh();
                let scope = self.scope.clone();
                self.scope.names.push((id, U32));
                self.scope.uniform.push((id, U32));
                let repeats = std::mem::replace(&mut self.repeats, u64::from(trips));
                let inner = self.segments(depth - 1);
                self.repeats = repeats;
                self.scope = scope;
                body.push(Stmt::For {
                    id,
                    scalar: Scalar::U32,
                    from: self.choices.below(3) as u32,
                    step: 1,
                    trips,
                    body: inner,
                });
            }
            2 | 3 => {
                let singles: Vec<(usize, Type)> = self
                    .program
                    .workgroup
                    .iter()
                    .enumerate()
                    .filter_map(|(index, variable)| match variable {
                        Workgroup::Single(ty) => Some((index, ty.clone())),
                        _ => None,
                    })
                    .collect();
                if singles.is_empty() {
                    self.phase(body);
                } else {
                    let (variable, ty) = self.choices.of(&singles);
                    let id = self.fresh();
                    self.scope.names.push((id, ty.clone()));
                    self.scope.uniform.push((id, ty));
                    body.push(Stmt::UniformLoad(id, variable));
                }
            }
            _ => self.phase(body),
        }
    }

    fn segments(&mut self, depth: usize) -> Block {
        let scope = self.scope.clone();
        let mut body = Vec::new();
        for _ in 0..1 + self.choices.below(2) {
            self.segment(&mut body, depth);
        }
        self.scope = scope;
        body
    }

    /// Statements between two barriers.
    fn phase(&mut self, body: &mut Block) {
        for index in 0..self.access.len() {
            let written = self.choices.chance(65);
            self.access[index] = match self.program.workgroup[index] {
                _ if !written => Access::Read,
                Workgroup::Lanes(_) | Workgroup::LaneAtomics(_) => Access::Own,
                Workgroup::Single(_) => {
                    Access::Alone(self.choices.below(self.program.lanes() as usize) as u32)
                }
                Workgroup::Counters(..) => {
                    let rules = [Rule::Sum, Rule::Max, Rule::Xor, Rule::Or, Rule::Min];
                    Access::Count(self.choices.of(&rules))
                }
            };
        }
        self.fuel = 4 + self.choices.below(7);
        let scope = self.scope.clone();
        let mut block = Vec::new();
        // Each variable that may be written is, if only by this.
        for index in 0..self.access.len() {
            if let Some(stmt) = self.write_to(index) {
                block.push(stmt);
            }
        }
        block.extend(self.statements(2, 6));
        self.scope = scope;
        self.access.fill(Access::Nothing);
        let barrier = self.choices.of(&[Barrier::Workgroup, Barrier::Both]);
        body.push(Stmt::Phase(block, barrier));
    }

    fn write_to(&mut self, index: usize) -> Option<Stmt> {
        let place = |root: Root, ty: &Type| Place {
            ty: ty.clone(),
            of: ty.clone(),
            root,
            path: Vec::new(),
        };
        match (self.program.workgroup[index].clone(), self.access[index]) {
            (Workgroup::Lanes(ty), Access::Own) => {
                let value = self.stored(&ty, 2);
                Some(Stmt::Assign(place(Root::Own(index), &ty), value))
            }
            (Workgroup::Single(ty), Access::Alone(lane)) => {
                let value = self.stored(&ty, 2);
                let assign = Stmt::Assign(place(Root::Single(index), &ty), value);
                Some(Stmt::Alone(lane, vec![assign]))
            }
            (Workgroup::LaneAtomics(scalar), Access::Own) => Some(self.own_atomic(index, scalar)),
            (Workgroup::Counters(scalar, count), Access::Count(rule)) => {
                let counter = Counter::Workgroup(index, self.choices.below(count));
                let value = self.expr(&Type::Scalar(scalar), 2);
                Some(Stmt::Count(
                    counter,
                    self.choices.of(rule.operations()),
                    value,
                ))
            }
            _ => None,
        }
    }
}

/// The scalars that a value consists of, as expressions.
fn scalars_of(whole: Expr, parts: &mut Vec<Expr>) {
    match &whole.ty {
        Type::Scalar(_) => parts.push(whole),
        Type::Vector(scalar, size) => {
            for index in 0..*size {
                let kind = ExprKind::Swizzle(Box::new(whole.clone()), vec![index]);
                parts.push(Expr {
                    ty: Type::Scalar(*scalar),
                    kind,
                });
            }
        }
        Type::Matrix { .. } | Type::Array(..) => {
            if let Some((element, size)) = whole.ty.element() {
                for index in 0..size {
                    let at = Box::new(Expr::literal(Scalar::U32, index as u32));
                    let kind = ExprKind::Index(Box::new(whole.clone()), at);
                    let part = Expr {
                        ty: element.clone(),
                        kind,
                    };
                    scalars_of(part, parts);
                }
            }
        }
        Type::Struct(structure) => {
            for (index, member) in structure.members.iter().enumerate() {
                let kind = ExprKind::Member(Box::new(whole.clone()), index);
                let part = Expr {
                    ty: member.clone(),
                    kind,
                };
                scalars_of(part, parts);
            }
        }
    }
}

//! Programs evaluated one invocation at a time: what they mean.
//!
//! Nothing here is shared with the interpreter. An invocation runs alone up to
//! the next barrier, its variables being words in a frame; where control is
//! uniform and contains a barrier, all invocations go statement by statement.
//! Since programs have no races, that is any order's result.

use thiserror::Error;

use super::arithmetic::{self, Open, truth};
use super::grammar::*;

/// Why a program cannot be evaluated. Generated programs can; shrinking makes
/// some that cannot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Malformed {
    /// A name without a value, or parts that do not fit each other.
    #[error("the program does not fit together")]
    Broken,
    /// A barrier where some invocations have returned, or in control flow that
    /// is not uniform.
    #[error("a barrier is not reached by all invocations")]
    Divergent,
    /// More steps than are worth waiting for.
    #[error("the program takes too many steps")]
    TooLong,
    /// Statements that draw tickets from the same counter and do different
    /// things with them: what comes out depends on who comes first.
    #[error("the outcome depends on the order of invocations")]
    Unordered,
}

/// What a program leaves behind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Results {
    /// Of every invocation its slots.
    pub results: Vec<u32>,
    /// The unsigned tallies.
    pub tallies: Vec<u32>,
    /// The signed tallies.
    pub signed_tallies: Vec<u32>,
}

/// The outcome of an evaluation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Evaluation {
    /// What is left behind.
    pub results: Results,
    /// What WGSL leaves open on the way.
    pub open: Open,
    /// What is defined and known to go wrong on some driver.
    pub risks: Risks,
    /// Statements and expressions evaluated.
    pub steps: u64,
}

/// What a program does that WGSL defines and a driver is known to get wrong:
/// see [`may_differ`](super::may_differ).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Risks {
    /// An invocation left a loop by its `break if` before the counter had it
    /// leave.
    pub left_early: bool,
    /// `pack4xI8Clamp` was called.
    pub packed_clamped: bool,
}

/// Evaluates a program, unless that takes more than `limit` steps.
///
/// # Errors
/// [`Malformed`].
pub fn evaluate(program: &Program, limit: u64) -> Result<Evaluation, Malformed> {
    let mut machine = Machine {
        program,
        results: Results::start(program.invocations() as usize * program.slots),
        shared: Vec::new(),
        tickets: Vec::new(),
        open: Open::default(),
        risks: Risks::default(),
        steps: 0,
        limit,
    };
    let [x, y, z] = program.groups;
    for group in (0..z).flat_map(|z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z]))) {
        machine.workgroup(group)?;
    }
    Ok(Evaluation {
        results: machine.results,
        open: machine.open,
        risks: machine.risks,
        steps: machine.steps,
    })
}

/// Where control goes.
#[derive(Clone, Copy, PartialEq)]
enum Flow {
    Next,
    Break,
    Continue,
    Return,
}

/// The memory that a pointer points to.
#[derive(Clone, Copy)]
enum Target {
    Local(usize, Id),
    Private(usize),
    Shared(usize),
}

#[derive(Clone)]
enum Slot {
    Empty,
    Value(Vec<u32>),
    Pointer(Target),
}

#[derive(Clone)]
struct Frame {
    slots: Vec<Slot>,
    result: Vec<u32>,
}

impl Frame {
    fn new(names: usize) -> Self {
        Self {
            slots: vec![Slot::Empty; names],
            result: Vec::new(),
        }
    }
}

struct Invocation {
    frames: Vec<Frame>,
    private: Vec<Vec<u32>>,
    lane: u32,
    local: [u32; 3],
    group: [u32; 3],
    /// Where its results begin.
    base: usize,
    returned: bool,
}

impl Invocation {
    fn set(&mut self, id: Id, value: Vec<u32>) -> Result<(), Malformed> {
        let frame = self.frames.last_mut().ok_or(Malformed::Broken)?;
        *frame.slots.get_mut(id).ok_or(Malformed::Broken)? = Slot::Value(value);
        Ok(())
    }

    fn slot(&self, id: Id) -> Result<&Slot, Malformed> {
        let frame = self.frames.last().ok_or(Malformed::Broken)?;
        frame.slots.get(id).ok_or(Malformed::Broken)
    }
}

struct Machine<'a> {
    program: &'a Program,
    results: Results,
    shared: Vec<Vec<u32>>,
    /// Counters that tickets were drawn from, with what was done with them.
    tickets: Vec<(Counter, Draw)>,
    open: Open,
    risks: Risks,
    steps: u64,
    limit: u64,
}

type Words = Result<Vec<u32>, Malformed>;

impl Machine<'_> {
    fn workgroup(&mut self, group: [u32; 3]) -> Result<(), Malformed> {
        let program = self.program;
        let lanes = program.lanes() as usize;
        self.shared = program
            .workgroup
            .iter()
            .map(|variable| match variable {
                Workgroup::Lanes(ty) => vec![0; ty.words() * lanes],
                Workgroup::Single(ty) => vec![0; ty.words()],
                Workgroup::LaneAtomics(_) => vec![0; lanes],
                Workgroup::Counters(_, count) => vec![0; *count],
            })
            .collect();
        let [groups_x, groups_y, _] = program.groups;
        let linear = ((group[2] * groups_y + group[1]) * groups_x + group[0]) as usize;
        let [x, y, _] = program.size;
        let mut invocations: Vec<Invocation> = (0..lanes as u32)
            .map(|lane| Invocation {
                frames: vec![Frame::new(program.names)],
                private: program
                    .private
                    .iter()
                    .map(|(_, words)| words.clone())
                    .collect(),
                lane,
                local: [lane % x, lane / x % y, lane / x / y],
                group,
                base: (linear * lanes + lane as usize) * program.slots,
                returned: false,
            })
            .collect();
        self.together(&program.main, &mut invocations)
    }

    fn step(&mut self) -> Result<(), Malformed> {
        self.steps += 1;
        if self.steps > self.limit {
            return Err(Malformed::TooLong);
        }
        Ok(())
    }

    /// Statements of uniform control flow.
    fn together(&mut self, block: &Block, invocations: &mut [Invocation]) -> Result<(), Malformed> {
        for stmt in block {
            if !waits(stmt) {
                for invocation in invocations.iter_mut().filter(|other| !other.returned) {
                    match self.stmt(invocation, stmt)? {
                        Flow::Next => {}
                        Flow::Return => invocation.returned = true,
                        // Out of a loop that others stay in.
                        Flow::Break | Flow::Continue => return Err(Malformed::Divergent),
                    }
                }
                continue;
            }
            if invocations.iter().any(|invocation| invocation.returned) {
                return Err(Malformed::Divergent);
            }
            match stmt {
                Stmt::Phase(block, _) => {
                    for invocation in invocations.iter_mut() {
                        if self.block(invocation, block)? != Flow::Next {
                            return Err(Malformed::Divergent);
                        }
                    }
                }
                Stmt::UniformLoad(id, variable) => {
                    let value = self.shared.get(*variable).ok_or(Malformed::Broken)?;
                    for invocation in invocations.iter_mut() {
                        invocation.set(*id, value.clone())?;
                    }
                }
                Stmt::Block(block) => self.together(block, invocations)?,
                Stmt::If(condition, accept, reject) => {
                    let condition = self.uniform(condition, invocations)?;
                    let block = if condition != 0 { accept } else { reject };
                    self.together(block, invocations)?;
                }
                Stmt::For {
                    id,
                    from,
                    step,
                    trips,
                    body,
                    ..
                } => {
                    for trip in 0..*trips {
                        let counter = from.wrapping_add(step.wrapping_mul(trip));
                        for invocation in invocations.iter_mut() {
                            invocation.set(*id, vec![counter])?;
                        }
                        self.together(body, invocations)?;
                    }
                }
                _ => return Err(Malformed::Divergent),
            }
        }
        Ok(())
    }

    /// A scalar that has to be the same in all invocations.
    fn uniform(&mut self, expr: &Expr, invocations: &mut [Invocation]) -> Result<u32, Malformed> {
        let mut first = None;
        for invocation in invocations {
            let value = self.scalar(invocation, expr)?;
            if *first.get_or_insert(value) != value {
                return Err(Malformed::Divergent);
            }
        }
        first.ok_or(Malformed::Broken)
    }

    fn block(&mut self, inv: &mut Invocation, block: &Block) -> Result<Flow, Malformed> {
        for stmt in block {
            let flow = self.stmt(inv, stmt)?;
            if flow != Flow::Next {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    fn stmt(&mut self, inv: &mut Invocation, stmt: &Stmt) -> Result<Flow, Malformed> {
        self.step()?;
        match stmt {
            Stmt::Let(id, value) => {
                let value = self.expr(inv, value)?;
                inv.set(*id, value)?;
            }
            Stmt::Var(id, ty, value) => {
                let value = match value {
                    Some(value) => self.expr(inv, value)?,
                    None => vec![0; ty.words()],
                };
                inv.set(*id, value)?;
            }
            Stmt::Assign(place, value) => {
                let (target, at) = self.resolve(inv, place)?;
                let value = self.expr(inv, value)?;
                self.store(inv, target, at, &value)?;
            }
            Stmt::Update(op, place, value) => {
                let (target, at) = self.resolve(inv, place)?;
                let old = self.load(inv, target, at, place.ty.words())?;
                let b = self.expr(inv, value)?;
                let new = self.binary(*op, &place.ty, &old, &value.ty, &b)?;
                self.store(inv, target, at, &new)?;
            }
            Stmt::Step(place, up) => {
                let (target, at) = self.resolve(inv, place)?;
                let old = self.load(inv, target, at, 1)?[0];
                let new = if *up {
                    old.wrapping_add(1)
                } else {
                    old.wrapping_sub(1)
                };
                self.store(inv, target, at, &[new])?;
            }
            Stmt::Ignore(value) => {
                self.expr(inv, value)?;
            }
            Stmt::If(condition, accept, reject) => {
                let accepted = self.scalar(inv, condition)? != 0;
                return self.block(inv, if accepted { accept } else { reject });
            }
            Stmt::Switch(selector, cases) => {
                let selector = self.scalar(inv, selector)?;
                let taken = cases
                    .iter()
                    .find(|case| case.values.contains(&selector))
                    .or_else(|| cases.iter().find(|case| case.default))
                    .ok_or(Malformed::Broken)?;
                return Ok(match self.block(inv, &taken.body)? {
                    Flow::Break => Flow::Next,
                    other => other,
                });
            }
            Stmt::For {
                id,
                from,
                step,
                trips,
                body,
                ..
            } => {
                for trip in 0..*trips {
                    self.step()?;
                    inv.set(*id, vec![from.wrapping_add(step.wrapping_mul(trip))])?;
                    match self.block(inv, body)? {
                        Flow::Break => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::Next | Flow::Continue => {}
                    }
                }
            }
            Stmt::While {
                id,
                trips,
                condition,
                body,
            } => {
                inv.set(*id, vec![0])?;
                for trip in 0..*trips {
                    if self.scalar(inv, condition)? == 0 {
                        break;
                    }
                    inv.set(*id, vec![trip + 1])?;
                    match self.block(inv, body)? {
                        Flow::Break => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::Next | Flow::Continue => {}
                    }
                }
            }
            Stmt::Loop {
                id,
                trips,
                body,
                continuing,
                until,
            } => {
                let mut trip = 0;
                loop {
                    inv.set(*id, vec![trip])?;
                    match self.block(inv, body)? {
                        Flow::Break => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::Next | Flow::Continue => {}
                    }
                    if self.block(inv, continuing)? != Flow::Next {
                        return Err(Malformed::Broken);
                    }
                    trip += 1;
                    inv.set(*id, vec![trip])?;
                    if trip >= *trips {
                        break;
                    }
                    if let Some(until) = until
                        && self.scalar(inv, until)? != 0
                    {
                        self.risks.left_early = true;
                        break;
                    }
                }
            }
            Stmt::Break => return Ok(Flow::Break),
            Stmt::Continue => return Ok(Flow::Continue),
            Stmt::Return(value) => {
                if let Some(value) = value {
                    let value = self.expr(inv, value)?;
                    inv.frames.last_mut().ok_or(Malformed::Broken)?.result = value;
                }
                return Ok(Flow::Return);
            }
            Stmt::Call(routine, arguments) => {
                self.call(inv, *routine, arguments)?;
            }
            Stmt::Block(block) => return self.block(inv, block),
            Stmt::Emit(slot, value) => {
                let word = self.scalar(inv, value)?;
                let results = &mut self.results.results;
                *results.get_mut(inv.base + slot).ok_or(Malformed::Broken)? = word;
            }
            Stmt::Alone(lane, block) => {
                if inv.lane == lane % self.program.lanes() {
                    return self.block(inv, block);
                }
            }
            Stmt::Count(counter, atomic, value) => {
                let value = self.scalar(inv, value)?;
                self.update(*counter, *atomic, value)?;
            }
            Stmt::CompareAndAdd(counter, _, value) => {
                let value = self.scalar(inv, value)?;
                self.update(*counter, Atomic::Add, value)?;
            }
            Stmt::Ticket { from, draw, .. } => {
                match self.tickets.iter().find(|(other, _)| other == from) {
                    Some((_, other)) if other != draw => return Err(Malformed::Unordered),
                    Some(_) => {}
                    None => self.tickets.push((*from, *draw)),
                }
                // Which workgroup draws which ticket depends on the order too.
                if matches!(draw.to, Counter::Workgroup(..)) {
                    return Err(Malformed::Unordered);
                }
                let ticket = self.update(*from, Atomic::Add, 1)?;
                self.update(draw.to, draw.update, ticket.wrapping_mul(draw.factor))?;
            }
            Stmt::OwnAtomic {
                id,
                variable,
                atomic,
                compare,
                value,
            } => {
                let compare = match compare {
                    Some(compare) => Some(self.scalar(inv, compare)?),
                    None => None,
                };
                let value = self.scalar(inv, value)?;
                let Some(Workgroup::LaneAtomics(scalar)) = self.program.workgroup.get(*variable)
                else {
                    return Err(Malformed::Broken);
                };
                let word = &mut self.shared[*variable][inv.lane as usize];
                let old = *word;
                *word = match compare {
                    Some(compare) if compare != old => old,
                    _ => updated(*atomic, *scalar, old, value),
                };
                let result = match atomic {
                    Atomic::Store => value,
                    Atomic::CompareExchange if compare == Some(old) => !old,
                    _ => old,
                };
                inv.set(*id, vec![result])?;
            }
            Stmt::Phase(..) | Stmt::UniformLoad(..) => return Err(Malformed::Divergent),
        }
        Ok(Flow::Next)
    }

    /// Updates a counter; gives what it was.
    fn update(&mut self, counter: Counter, atomic: Atomic, value: u32) -> Result<u32, Malformed> {
        let (word, scalar) = match counter {
            Counter::Tally(index) => (self.results.tallies.get_mut(index), Scalar::U32),
            Counter::SignedTally(index) => {
                (self.results.signed_tallies.get_mut(index), Scalar::I32)
            }
            Counter::Workgroup(variable, index) => {
                let scalar = match self.program.workgroup.get(variable) {
                    Some(Workgroup::Counters(scalar, _)) => *scalar,
                    _ => return Err(Malformed::Broken),
                };
                (self.shared[variable].get_mut(index), scalar)
            }
        };
        let word = word.ok_or(Malformed::Broken)?;
        let old = *word;
        *word = updated(atomic, scalar, old, value);
        Ok(old)
    }

    /// The memory of a place, and the words before it.
    fn resolve(
        &mut self,
        inv: &mut Invocation,
        place: &Place,
    ) -> Result<(Target, usize), Malformed> {
        let (target, mut at) = match &place.root {
            Root::Local(id) => match inv.slot(*id)? {
                Slot::Value(_) => (Target::Local(inv.frames.len() - 1, *id), 0),
                _ => return Err(Malformed::Broken),
            },
            Root::Pointer(id) => match inv.slot(*id)? {
                Slot::Pointer(target) => (*target, 0),
                _ => return Err(Malformed::Broken),
            },
            Root::Private(index) => (Target::Private(*index), 0),
            Root::Own(variable) => {
                let at = inv.lane as usize * place.of.words();
                (Target::Shared(*variable), at)
            }
            Root::Shared(variable, index) => {
                let index = self.scalar(inv, index)? % self.program.lanes();
                (Target::Shared(*variable), index as usize * place.of.words())
            }
            Root::Single(variable) => (Target::Shared(*variable), 0),
        };
        let mut ty = place.of.clone();
        for step in &place.path {
            let element = match step {
                Step::Member(index) => {
                    let (member, before) = ty.member(*index).ok_or(Malformed::Broken)?;
                    at += before;
                    ty = member;
                    continue;
                }
                Step::Component(index) => {
                    let (element, size) = ty.element().ok_or(Malformed::Broken)?;
                    at += index % size * element.words();
                    element
                }
                Step::Index(index) => {
                    let (element, size) = ty.element().ok_or(Malformed::Broken)?;
                    let index = self.scalar(inv, index)? as usize % size;
                    at += index * element.words();
                    element
                }
            };
            ty = element;
        }
        Ok((target, at))
    }

    fn memory<'m>(
        &'m mut self,
        inv: &'m mut Invocation,
        target: Target,
    ) -> Result<&'m mut Vec<u32>, Malformed> {
        match target {
            Target::Local(frame, id) => match inv.frames.get_mut(frame) {
                Some(frame) => match frame.slots.get_mut(id) {
                    Some(Slot::Value(words)) => Ok(words),
                    _ => Err(Malformed::Broken),
                },
                None => Err(Malformed::Broken),
            },
            Target::Private(index) => inv.private.get_mut(index).ok_or(Malformed::Broken),
            Target::Shared(index) => self.shared.get_mut(index).ok_or(Malformed::Broken),
        }
    }

    fn load(&mut self, inv: &mut Invocation, target: Target, at: usize, words: usize) -> Words {
        let memory = self.memory(inv, target)?;
        memory
            .get(at..at + words)
            .map(<[u32]>::to_vec)
            .ok_or(Malformed::Broken)
    }

    fn store(
        &mut self,
        inv: &mut Invocation,
        target: Target,
        at: usize,
        value: &[u32],
    ) -> Result<(), Malformed> {
        let memory = self.memory(inv, target)?;
        memory
            .get_mut(at..at + value.len())
            .ok_or(Malformed::Broken)?
            .copy_from_slice(value);
        Ok(())
    }

    fn scalar(&mut self, inv: &mut Invocation, expr: &Expr) -> Result<u32, Malformed> {
        self.expr(inv, expr)?
            .first()
            .copied()
            .ok_or(Malformed::Broken)
    }

    fn call(&mut self, inv: &mut Invocation, routine: usize, arguments: &[Argument]) -> Words {
        let routine = self
            .program
            .routines
            .get(routine)
            .ok_or(Malformed::Broken)?;
        let mut frame = Frame::new(routine.names);
        for (parameter, argument) in routine.parameters.iter().zip(arguments) {
            let slot = match argument {
                Argument::Value(value) => Slot::Value(self.expr(inv, value)?),
                Argument::Pointer(root) => Slot::Pointer(match root {
                    Root::Local(id) => Target::Local(inv.frames.len() - 1, *id),
                    Root::Private(index) => Target::Private(*index),
                    Root::Pointer(id) => match inv.slot(*id)? {
                        Slot::Pointer(target) => *target,
                        _ => return Err(Malformed::Broken),
                    },
                    _ => return Err(Malformed::Broken),
                }),
            };
            *frame.slots.get_mut(parameter.id).ok_or(Malformed::Broken)? = slot;
        }
        inv.frames.push(frame);
        let flow = self.block(inv, &routine.body)?;
        let frame = inv.frames.pop().ok_or(Malformed::Broken)?;
        let words = routine.result.as_ref().map_or(0, Type::words);
        if frame.result.len() != words || matches!(flow, Flow::Break | Flow::Continue) {
            return Err(Malformed::Broken);
        }
        Ok(frame.result)
    }

    fn expr(&mut self, inv: &mut Invocation, expr: &Expr) -> Words {
        self.step()?;
        let ty = &expr.ty;
        Ok(match &expr.kind {
            ExprKind::Literal(bits) => vec![*bits],
            ExprKind::Zero => vec![0; ty.words()],
            ExprKind::Constant(index) => {
                let (_, words) = self
                    .program
                    .constants
                    .get(*index)
                    .ok_or(Malformed::Broken)?;
                words.clone()
            }
            ExprKind::Input(input) => match input {
                Input::Lane => vec![inv.lane],
                Input::Local => inv.local.to_vec(),
                Input::Group => inv.group.to_vec(),
                Input::Global => (0..3)
                    .map(|i| inv.group[i] * self.program.size[i] + inv.local[i])
                    .collect(),
                Input::Groups => self.program.groups.to_vec(),
            },
            ExprKind::Data(index) => {
                let index = self.scalar(inv, index)? as usize;
                vec![self.program.data[index % self.program.data.len()]]
            }
            ExprKind::Reals(index) => {
                let index = self.scalar(inv, index)? as usize;
                vec![self.program.reals[index % self.program.reals.len()]]
            }
            ExprKind::Name(id) => match inv.slot(*id)? {
                Slot::Value(words) => words.clone(),
                _ => return Err(Malformed::Broken),
            },
            ExprKind::Load(place) => {
                let (target, at) = self.resolve(inv, place)?;
                self.load(inv, target, at, ty.words())?
            }
            ExprKind::Unary(op, a) => {
                let scalar = a.ty.scalar().ok_or(Malformed::Broken)?;
                let a = self.expr(inv, a)?;
                a.iter()
                    .map(|&a| arithmetic::unary(*op, scalar, a))
                    .collect()
            }
            ExprKind::Binary(op, a, b) => {
                let left = self.expr(inv, a)?;
                match op {
                    Binary::LogicalAnd if left == [0] => return Ok(left),
                    Binary::LogicalOr if left != [0] => return Ok(left),
                    _ => {}
                }
                let right = self.expr(inv, b)?;
                self.binary(*op, &a.ty, &left, &b.ty, &right)?
            }
            ExprKind::Function(function, parts) => {
                let values = self.all(inv, parts)?;
                self.function(*function, ty, parts, &values)?
            }
            ExprKind::Call(routine, arguments) => self.call(inv, *routine, arguments)?,
            ExprKind::Construct(parts) => {
                let words = self.all(inv, parts)?.concat();
                match (ty, words.as_slice()) {
                    // One scalar for all components.
                    (Type::Vector(_, size), [word]) => vec![*word; *size],
                    _ => words,
                }
            }
            ExprKind::Convert(a) => {
                let (from, to) = (a.ty.scalar(), ty.scalar());
                let (from, to) = from.zip(to).ok_or(Malformed::Broken)?;
                let a = self.expr(inv, a)?;
                a.iter()
                    .map(|&a| arithmetic::convert(from, to, a, &mut self.open))
                    .collect()
            }
            ExprKind::Bitcast(a) => {
                let (from, to) = (a.ty.scalar(), ty.scalar());
                let (from, to) = from.zip(to).ok_or(Malformed::Broken)?;
                let a = self.expr(inv, a)?;
                a.iter()
                    .map(|&a| arithmetic::bitcast(from, to, a, &mut self.open))
                    .collect()
            }
            ExprKind::Swizzle(a, components) => {
                let a = self.expr(inv, a)?;
                components.iter().map(|&i| a[i % a.len()]).collect()
            }
            ExprKind::Member(a, index) => {
                let (member, before) = a.ty.member(*index).ok_or(Malformed::Broken)?;
                let words = self.expr(inv, a)?;
                part(&words, before, member.words())?
            }
            ExprKind::Index(a, index) => {
                let (element, size) = a.ty.element().ok_or(Malformed::Broken)?;
                let words = self.expr(inv, a)?;
                let index = self.scalar(inv, index)? as usize % size;
                part(&words, index * element.words(), element.words())?
            }
            ExprKind::AtomicLoad(variable, index) => {
                let index = self.scalar(inv, index)? as usize;
                let words = self.shared.get(*variable).ok_or(Malformed::Broken)?;
                vec![words[index % words.len()]]
            }
        })
    }

    fn all(&mut self, inv: &mut Invocation, parts: &[Expr]) -> Result<Vec<Vec<u32>>, Malformed> {
        parts.iter().map(|part| self.expr(inv, part)).collect()
    }

    /// An operator component by component; a scalar goes with each.
    fn binary(&mut self, op: Binary, left: &Type, a: &[u32], right: &Type, b: &[u32]) -> Words {
        let scalar = left.scalar().or(right.scalar()).ok_or(Malformed::Broken)?;
        let width = a.len().max(b.len());
        let at = |words: &[u32], i: usize| words[if words.len() == 1 { 0 } else { i }];
        if (a.len() != width && a.len() != 1) || (b.len() != width && b.len() != 1) {
            return Err(Malformed::Broken);
        }
        let matrix = |ty: &Type| matches!(ty, Type::Matrix { .. });
        if op == Binary::Multiply && (matrix(left) || matrix(right)) {
            let finite = |word: &u32| f32::from_bits(*word).is_finite();
            self.open.infinite |= !a.iter().chain(b).all(finite);
        }
        Ok((0..width)
            .map(|i| arithmetic::binary(op, scalar, at(a, i), at(b, i), &mut self.open))
            .collect())
    }

    fn function(
        &mut self,
        function: Function,
        ty: &Type,
        parts: &[Expr],
        values: &[Vec<u32>],
    ) -> Words {
        let first = values.first().ok_or(Malformed::Broken)?;
        let second = || values.get(1).ok_or(Malformed::Broken);
        let wrapping_sum =
            |products: &mut dyn Iterator<Item = u32>| vec![products.fold(0_u32, u32::wrapping_add)];
        let products = |a: &[u32], b: &[u32]| {
            wrapping_sum(&mut a.iter().zip(b).map(|(a, b)| a.wrapping_mul(*b)))
        };
        Ok(match function {
            Function::Select => {
                let (yes, condition) = (second()?, values.get(2).ok_or(Malformed::Broken)?);
                (0..first.len())
                    .map(|i| {
                        let taken = condition[if condition.len() == 1 { 0 } else { i }] != 0;
                        if taken { yes[i] } else { first[i] }
                    })
                    .collect()
            }
            Function::Transpose => {
                let Type::Matrix { columns, rows } = *ty else {
                    return Err(Malformed::Broken);
                };
                // The argument's columns are this one's rows.
                (0..columns)
                    .flat_map(|column| (0..rows).map(move |row| row * columns + column))
                    .map(|i| first[i])
                    .collect()
            }
            Function::Any => vec![truth(first.iter().any(|word| *word != 0))],
            Function::All => vec![truth(first.iter().all(|word| *word != 0))],
            Function::Dot => products(first, second()?),
            Function::Dot4U8Packed | Function::Dot4I8Packed => {
                let signed = function == Function::Dot4I8Packed;
                let unpacked = |words: &[u32]| arithmetic::unpack(words[0], signed);
                products(&unpacked(first), &unpacked(second()?))
            }
            Function::Pack4xI8 => vec![arithmetic::pack(first, true, false)],
            Function::Pack4xU8 => vec![arithmetic::pack(first, false, false)],
            Function::Pack4xI8Clamp => {
                self.risks.packed_clamped = true;
                vec![arithmetic::pack(first, true, true)]
            }
            Function::Pack4xU8Clamp => vec![arithmetic::pack(first, false, true)],
            Function::Unpack4xI8 => arithmetic::unpack(first[0], true).to_vec(),
            Function::Unpack4xU8 => arithmetic::unpack(first[0], false).to_vec(),
            _ => {
                let scalar = parts[0].ty.scalar().ok_or(Malformed::Broken)?;
                (0..first.len())
                    .map(|i| {
                        let x: Vec<u32> = values
                            .iter()
                            .map(|words| words[if words.len() == 1 { 0 } else { i }])
                            .collect();
                        arithmetic::component(function, scalar, &x, &mut self.open)
                    })
                    .collect()
            }
        })
    }
}

fn part(words: &[u32], at: usize, count: usize) -> Words {
    words
        .get(at..at + count)
        .map(<[u32]>::to_vec)
        .ok_or(Malformed::Broken)
}

/// Whether all invocations wait for each other somewhere in a statement.
pub(super) fn waits(stmt: &Stmt) -> bool {
    match stmt {
        Stmt::Phase(..) | Stmt::UniformLoad(..) => true,
        Stmt::Block(block) | Stmt::Alone(_, block) => block.iter().any(waits),
        Stmt::If(_, accept, reject) => accept.iter().chain(reject).any(waits),
        Stmt::For { body, .. } | Stmt::While { body, .. } => body.iter().any(waits),
        Stmt::Loop {
            body, continuing, ..
        } => body.iter().chain(continuing).any(waits),
        Stmt::Switch(_, cases) => cases.iter().any(|case| case.body.iter().any(waits)),
        _ => false,
    }
}

/// What an atomic holds after an update.
fn updated(atomic: Atomic, scalar: Scalar, old: u32, value: u32) -> u32 {
    let signed = scalar == Scalar::I32;
    match atomic {
        Atomic::Add => old.wrapping_add(value),
        Atomic::Sub => old.wrapping_sub(value),
        Atomic::Min if signed => (old as i32).min(value as i32) as u32,
        Atomic::Min => old.min(value),
        Atomic::Max if signed => (old as i32).max(value as i32) as u32,
        Atomic::Max => old.max(value),
        Atomic::And => old & value,
        Atomic::Or => old | value,
        Atomic::Xor => old ^ value,
        Atomic::Exchange | Atomic::CompareExchange | Atomic::Store => value,
    }
}

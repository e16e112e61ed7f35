//! Appends nodes to the tree: local value numbering, constant folding, copy
//! propagation through variables, hoisting into the prologue, and
//! if-conversion of small branches, all while building.

use std::collections::{BTreeSet, HashMap};

use naga::Span;

use super::Fail;
use crate::ir::arith::{Binary, ClassOf, Quaternary, Ternary, Unary, Visitor};
use crate::ir::{
    Arith, Class, Inst, Node, Op, Origin, Perturbed, Probe, Probed, ScopeId, Tree, Value,
    ValueInfo, Variable,
};

/// Most nodes in a program: inlining must not run away.
const MAX_NODES: u64 = 1 << 19;

/// Branches up to this [`Op::speculation_cost`] run unconditionally: a masked
/// branch costs about four instructions of bookkeeping and a masked move per
/// variable.
const SPECULATION_LIMIT: u32 = 16;

pub(super) const FALSE: u32 = 0;
pub(super) const TRUE: u32 = u32::MAX;

type Numbering = HashMap<(Op, Vec<Value>), Vec<Value>>;

/// One level of nested control flow under construction.
#[derive(Default)]
struct Level {
    nodes: Vec<Node>,
    numbering: Numbering,
    assigned: BTreeSet<Variable>,
    /// What was known of the variables at the start.
    before: Vec<Option<Value>>,
}

/// A finished level.
pub(super) struct Branch {
    pub(super) nodes: Vec<Node>,
    numbering: Numbering,
    assigned: BTreeSet<Variable>,
    /// What was known of the variables at the start.
    before: Vec<Option<Value>>,
    /// What was known of the variables at the end.
    known: Vec<Option<Value>>,
    /// Whether the end can be reached.
    pub(super) falls_through: bool,
}

pub(super) struct Builder {
    pub(super) tree: Tree,
    levels: Vec<Level>,
    prologue_numbering: Numbering,
    constants: HashMap<(Class, u32), Value>,
    /// What computed each value.
    computed: HashMap<Value, (Arith, Vec<Value>)>,
    /// What results became that were perturbed.
    perturbed: HashMap<Value, Value>,
    /// The value each variable is known to have at this point.
    known: Vec<Option<Value>>,
    node_count: u64,
    /// Scopes that something leaves early.
    left: BTreeSet<ScopeId>,
    /// Whether arithmetic is on `f16`: every result is rounded to binary16.
    ///
    /// Computing in binary32 first is harmless for `+ - * /` and square roots:
    /// 24 bits are at least twice the 11 of binary16 and two more, so the second
    /// rounding is never led astray by the first.
    pub(super) half: bool,
    /// What is put beside arithmetic.
    pub(super) instrument: Instrument,
    pub(super) span: Span,
}

/// What is put beside arithmetic.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instrument {
    /// Probes of the sanitiser.
    pub(super) probes: bool,
    /// Perturbations.
    pub(super) perturbs: bool,
}

impl Builder {
    pub(super) fn new() -> Self {
        Self {
            tree: Tree::default(),
            levels: vec![Level::default()],
            prologue_numbering: HashMap::new(),
            constants: HashMap::new(),
            computed: HashMap::new(),
            perturbed: HashMap::new(),
            known: Vec::new(),
            node_count: 0,
            left: BTreeSet::new(),
            half: false,
            instrument: Instrument::default(),
            span: Span::default(),
        }
    }

    pub(super) fn finish(mut self) -> Tree {
        if let Some(level) = self.levels.pop() {
            self.tree.body = level.nodes;
        }
        self.tree
    }

    pub(super) fn check_size(&self) -> Result<(), Fail> {
        if self.node_count > MAX_NODES {
            return Err(Fail::TooLarge {
                what: "number of instructions after inlining",
                size: self.node_count,
                limit: MAX_NODES,
            });
        }
        Ok(())
    }

    fn level(&mut self) -> &mut Level {
        if self.levels.is_empty() {
            self.levels.push(Level::default());
        }
        let last = self.levels.len() - 1;
        &mut self.levels[last]
    }

    fn push(&mut self, node: Node) {
        self.node_count += 1;
        self.level().nodes.push(node);
    }

    fn new_value(&mut self, class: Class, origin: Origin) -> Value {
        self.tree.values.push(ValueInfo { class, origin });
        Value(self.tree.values.len() as u32 - 1)
    }

    pub(super) fn class(&self, value: Value) -> Class {
        self.tree.values[value.0 as usize].class
    }

    fn origin(&self, value: Value) -> Origin {
        self.tree.values[value.0 as usize].origin
    }

    /// The bits of a constant.
    pub(super) fn constant_bits(&self, value: Value) -> Option<u32> {
        match self.origin(value) {
            Origin::Constant(bits) => Some(bits),
            Origin::Prologue | Origin::Body => None,
        }
    }

    pub(super) fn constant(&mut self, class: Class, bits: u32) -> Value {
        if let Some(&value) = self.constants.get(&(class, bits)) {
            return value;
        }
        let value = self.new_value(class, Origin::Constant(bits));
        self.constants.insert((class, bits), value);
        value
    }

    pub(super) fn float(&mut self, value: f32) -> Value {
        self.constant(Class::Float, value.to_bits())
    }

    pub(super) fn int(&mut self, value: u32) -> Value {
        self.constant(Class::Int, value)
    }

    pub(super) fn bool(&mut self, value: bool) -> Value {
        self.constant(Class::Int, if value { TRUE } else { FALSE })
    }

    /// Emits an arithmetic instruction.
    pub(super) fn arith(&mut self, op: Arith, operands: &[Value]) -> Value {
        let value = self.arith_once(op, operands);
        if self.half && op.leaves_half() {
            return self.arith_once(Arith::RoundHalf, &[value]);
        }
        value
    }

    fn arith_once(&mut self, op: Arith, operands: &[Value]) -> Value {
        if let Some(value) = self.simplify(op, operands) {
            return value;
        }
        let bits: Option<Vec<u32>> = operands.iter().map(|&v| self.constant_bits(v)).collect();
        if let Some(bits) = bits {
            let folded = op.visit::<f32, _>(Fold { bits: &bits });
            // What is born of constants is to be seen where it happens.
            let is_wild = op.result() == Class::Float && !f32::from_bits(folded).is_finite();
            if !(is_wild && self.instrument.probes) {
                return self.constant(op.result(), folded);
            }
        }
        let known = self.tree.values.len();
        let value = self.op(Op::Arith(op), operands, &[op.result()])[0];
        self.computed.insert(value, (op, operands.to_vec()));
        let is_new = self.tree.values.len() > known;
        if is_new && self.instrument.probes && op.is_probed() {
            let scalars: Vec<Value> = [value]
                .into_iter()
                .chain(operands.iter().copied())
                .collect();
            self.probe(Probed::Arith(op), &scalars);
        }
        if self.instrument.perturbs && op.result() == Class::Float && op.is_probed() {
            return self.perturb(op, value, operands);
        }
        value
    }

    /// Has the sanitiser follow something.
    pub(super) fn probe(&mut self, probed: Probed, operands: &[Value]) {
        let site = self.tree.resources.probes.len() as u32;
        let span = self.span;
        self.tree.resources.probes.push(Probe { probed, span });
        self.op(Op::Probe(site), operands, &[]);
    }

    /// A number as a device might store it in 16 bits.
    pub(super) fn perturb_store(&mut self, value: Value) -> Value {
        let site = self.perturbed.len() as u32;
        let product = None;
        let perturbed = Op::Perturb(Perturbed {
            op: Arith::RoundHalf,
            site,
            product,
        });
        self.op(perturbed, &[value, value], &[Class::Float])[0]
    }

    /// A result as a device might have computed it; the same for a result that is known.
    fn perturb(&mut self, op: Arith, value: Value, operands: &[Value]) -> Value {
        if op.chooses() || op.drops_digits() {
            return value;
        }
        if let Some(&perturbed) = self.perturbed.get(&value) {
            return perturbed;
        }
        let mut given: Vec<Value> = [value]
            .into_iter()
            .chain(operands.iter().copied())
            .collect();
        let mut product = None;
        if matches!(op, Arith::AddF | Arith::SubF) {
            for (at, operand) in (0..).zip(operands) {
                if let Some((Arith::MulF, factors)) = self.computed.get(operand) {
                    product = Some(at);
                    given.extend(factors);
                    break;
                }
            }
        }
        let site = self.perturbed.len() as u32;
        let perturbed = Op::Perturb(Perturbed { op, site, product });
        let result = self.op(perturbed, &given, &[Class::Float])[0];
        self.computed.insert(result, (op, operands.to_vec()));
        self.perturbed.insert(value, result);
        result
    }

    /// Identities that hold for every operand, NaN and -0 included.
    fn simplify(&mut self, op: Arith, operands: &[Value]) -> Option<Value> {
        let bits = |i: usize| operands.get(i).and_then(|&v| self.constant_bits(v));
        if op == Arith::Not {
            return self.negate(operands[0]);
        }
        match op {
            Arith::SelectF | Arith::SelectI => match bits(0) {
                Some(TRUE) => Some(operands[1]),
                Some(FALSE) => Some(operands[2]),
                _ => (operands[1] == operands[2]).then_some(operands[1]),
            },
            Arith::AddI | Arith::Or | Arith::Xor => match (bits(0), bits(1)) {
                (Some(0), _) => Some(operands[1]),
                (_, Some(0)) => Some(operands[0]),
                _ => None,
            },
            Arith::SubI | Arith::Shl | Arith::ShrS | Arith::ShrU => {
                (bits(1) == Some(0)).then_some(operands[0])
            }
            Arith::MulI => match (bits(0), bits(1)) {
                (Some(1), _) => Some(operands[1]),
                (_, Some(1)) => Some(operands[0]),
                _ => None,
            },
            Arith::And => match (bits(0), bits(1)) {
                (Some(TRUE), _) => Some(operands[1]),
                (_, Some(TRUE)) => Some(operands[0]),
                (Some(0), _) => Some(operands[0]),
                (_, Some(0)) => Some(operands[1]),
                _ => None,
            },
            _ => None,
        }
    }

    /// The complement of something whose complement has an instruction.
    fn negate(&mut self, value: Value) -> Option<Value> {
        let (op, operands) = self.computed.get(&value)?;
        let (opposite, swap) = match op {
            Arith::Not => return operands.first().copied(),
            Arith::EqI => (Arith::NeI, false),
            Arith::NeI => (Arith::EqI, false),
            Arith::LtU => (Arith::LeU, true),
            Arith::LeU => (Arith::LtU, true),
            Arith::LtS => (Arith::LeS, true),
            Arith::LeS => (Arith::LtS, true),
            Arith::EqF => (Arith::NeF, false),
            Arith::NeF => (Arith::EqF, false),
            // With a NaN neither `a < b` nor `b <= a`.
            _ => return None,
        };
        let mut operands = operands.clone();
        if swap {
            operands.reverse();
        }
        Some(self.arith(opposite, &operands))
    }

    /// `condition ? yes : no`.
    pub(super) fn select(&mut self, condition: Value, yes: Value, no: Value) -> Value {
        if self.class(yes) == Class::Float {
            return self.arith(Arith::SelectF, &[condition, yes, no]);
        }
        // Booleans written as branches, which is what `&&` and `||` become. As the
        // condition is a mask, this is right for any integer.
        match (self.constant_bits(yes), self.constant_bits(no)) {
            (Some(TRUE), Some(FALSE)) => condition,
            (Some(TRUE), _) => self.arith(Arith::Or, &[condition, no]),
            (_, Some(FALSE)) => self.arith(Arith::And, &[condition, yes]),
            (_, Some(TRUE)) => {
                let not = self.arith(Arith::Not, &[condition]);
                self.arith(Arith::Or, &[not, yes])
            }
            (Some(FALSE), _) => self.arith(Arith::AndNot, &[no, condition]),
            _ => self.arith(Arith::SelectI, &[condition, yes, no]),
        }
    }

    /// Emits an instruction, or finds the same one in what dominates this point.
    pub(super) fn op(&mut self, op: Op, operands: &[Value], results: &[Class]) -> Vec<Value> {
        let mut operands = operands.to_vec();
        if let Op::Arith(arith) = op
            && arith.commutes()
            && operands[0] > operands[1]
        {
            operands.swap(0, 1);
        }
        let span = self.span;
        let key = (op, operands);
        if op.is_pure() {
            let known = self
                .levels
                .iter()
                .rev()
                .map(|level| &level.numbering)
                .chain([&self.prologue_numbering])
                .find_map(|n| n.get(&key));
            if let Some(known) = known {
                return known.clone();
            }
        }
        let in_prologue =
            op.is_dispatch_constant() && key.1.iter().all(|&v| self.origin(v) != Origin::Body);
        let origin = if in_prologue {
            Origin::Prologue
        } else {
            Origin::Body
        };
        let values: Vec<Value> = results
            .iter()
            .map(|&class| self.new_value(class, origin))
            .collect();
        let inst = Inst {
            op,
            results: values.iter().copied().map(Some).collect(),
            operands: key.1.clone(),
            span,
        };
        if in_prologue {
            self.node_count += 1;
            self.tree.prologue.push(inst);
            self.prologue_numbering.insert(key, values.clone());
        } else {
            self.push(Node::Inst(inst));
            if op.is_pure() {
                self.level().numbering.insert(key, values.clone());
            }
        }
        values
    }

    pub(super) fn new_variable(&mut self, class: Class) -> Variable {
        self.tree.variables.push(class);
        self.known.push(None);
        Variable(self.tree.variables.len() as u32 - 1)
    }

    pub(super) fn set(&mut self, variable: Variable, value: Value) {
        if self.known[variable.0 as usize] == Some(value) {
            return;
        }
        let span = self.span;
        self.push(Node::Set {
            variable,
            value,
            span,
            is_read: true,
            hazards: Vec::new(),
        });
        self.known[variable.0 as usize] = Some(value);
        self.level().assigned.insert(variable);
    }

    pub(super) fn get(&mut self, variable: Variable) -> Value {
        if let Some(value) = self.known[variable.0 as usize] {
            return value;
        }
        let class = self.tree.variables[variable.0 as usize];
        let value = self.new_value(class, Origin::Body);
        self.push(Node::Get { value, variable });
        self.known[variable.0 as usize] = Some(value);
        value
    }

    /// Forgets what the variables hold.
    pub(super) fn forget(&mut self, variables: impl IntoIterator<Item = Variable>) {
        for variable in variables {
            self.known[variable.0 as usize] = None;
        }
    }

    pub(super) fn new_scope(&mut self) -> ScopeId {
        self.tree.scopes += 1;
        ScopeId(self.tree.scopes - 1)
    }

    pub(super) fn exit(&mut self, scope: ScopeId) {
        self.left.insert(scope);
        self.push(Node::Exit(scope));
    }

    pub(super) fn barrier(&mut self) {
        let span = self.span;
        self.push(Node::Barrier { span });
    }

    /// Starts building nodes apart from the current ones.
    pub(super) fn begin(&mut self) {
        let before = self.known.clone();
        self.levels.push(Level {
            before,
            ..Level::default()
        });
    }

    /// Ends what [`Builder::begin`] started. What is known of the variables
    /// stays as it is at the end.
    pub(super) fn end(&mut self, falls_through: bool) -> Branch {
        let level = self.levels.pop().unwrap_or_default();
        Branch {
            nodes: level.nodes,
            numbering: level.numbering,
            assigned: level.assigned,
            before: level.before,
            known: self.known.clone(),
            falls_through,
        }
    }

    /// What is known of the variables, for [`Builder::restore`].
    pub(super) fn snapshot(&self) -> Vec<Option<Value>> {
        self.known.clone()
    }

    /// Returns to an earlier state of knowledge; variables made since are unknown.
    pub(super) fn restore(&mut self, known: &[Option<Value>]) {
        self.known.fill(None);
        self.known[..known.len()].copy_from_slice(known);
    }

    fn note_assigned(&mut self, variables: &BTreeSet<Variable>) {
        self.level().assigned.extend(variables.iter().copied());
    }

    /// Appends a two-way branch on `condition`, `before` being the snapshot at
    /// its start. Says whether its end can be reached.
    pub(super) fn finish_if(
        &mut self,
        condition: Value,
        before: &[Option<Value>],
        accept: Branch,
        reject: Branch,
    ) -> bool {
        self.restore(before);
        if accept.nodes.is_empty() && reject.nodes.is_empty() {
            return accept.falls_through || reject.falls_through;
        }
        if speculation_cost(&accept.nodes)
            .zip(speculation_cost(&reject.nodes))
            .is_some_and(|(a, b)| a + b <= SPECULATION_LIMIT)
        {
            self.speculate(condition, before.len(), &accept, &reject);
            return true;
        }
        let falls_through = accept.falls_through || reject.falls_through;
        for branch in [&accept, &reject] {
            self.note_assigned(&branch.assigned);
            // What a branch that leaves has set, the code after it never sees.
            if branch.falls_through {
                self.forget(branch.assigned.iter().copied());
            }
        }
        self.push(Node::If {
            id: 0,
            condition,
            accept: accept.nodes,
            reject: reject.nodes,
        });
        falls_through
    }

    /// Runs both branches and selects what they set of the first `outer`
    /// variables; the others are the branches' own.
    fn speculate(&mut self, condition: Value, outer: usize, accept: &Branch, reject: &Branch) {
        let before = self.known.clone();
        for node in accept.nodes.iter().chain(&reject.nodes) {
            if let Node::Inst(_) | Node::Get { .. } = node {
                self.level().nodes.push(node.clone());
            }
        }
        let variables: BTreeSet<Variable> = accept
            .assigned
            .union(&reject.assigned)
            .copied()
            .filter(|v| (v.0 as usize) < outer)
            .collect();
        let mut selected = Vec::with_capacity(variables.len());
        for variable in variables {
            let mut at_end = |branch: &Branch| {
                if branch.assigned.contains(&variable)
                    && let Some(value) = branch.known[variable.0 as usize]
                {
                    value
                } else {
                    self.known[variable.0 as usize] =
                        before.get(variable.0 as usize).copied().flatten();
                    self.get(variable)
                }
            };
            let (yes, no) = (at_end(accept), at_end(reject));
            selected.push((variable, yes, no));
        }
        for (variable, yes, no) in selected {
            let value = self.select(condition, yes, no);
            self.set(variable, value);
        }
    }

    /// Appends a branch that always runs, as a scope if something leaves it.
    pub(super) fn finish_scope(&mut self, id: ScopeId, branch: Branch) {
        self.note_assigned(&branch.assigned);
        if self.left.contains(&id) {
            // Some lanes may have skipped any part of it.
            self.restore(&branch.before);
            self.forget(branch.assigned.iter().copied());
            self.push(Node::Scope {
                id,
                body: branch.nodes,
            });
        } else {
            let level = self.level();
            level.nodes.extend(branch.nodes);
            level.numbering.extend(branch.numbering);
        }
    }

    /// Whether anything leaves the scope.
    pub(super) fn is_left(&self, id: ScopeId) -> bool {
        self.left.contains(&id)
    }

    /// Between the body of a loop and what every iteration ends with: unless some
    /// lanes may have skipped parts of the body, all of it is known.
    pub(super) fn after_body(&mut self, next: ScopeId, body: &Branch) {
        if self.left.contains(&next) {
            self.restore(&body.before);
            self.forget(body.assigned.iter().copied());
        } else {
            self.level().numbering.extend(
                body.numbering
                    .iter()
                    .map(|(key, values)| (key.clone(), values.clone())),
            );
        }
    }

    /// Appends a loop.
    pub(super) fn finish_loop(
        &mut self,
        id: ScopeId,
        next: ScopeId,
        body: Branch,
        continuing: Branch,
        break_if: Option<Value>,
    ) {
        self.note_assigned(&body.assigned);
        self.note_assigned(&continuing.assigned);
        self.restore(&body.before);
        self.forget(body.assigned.iter().chain(&continuing.assigned).copied());
        let span = self.span;
        self.push(Node::Loop {
            id,
            next,
            body: body.nodes,
            continuing: continuing.nodes,
            break_if,
            span,
        });
    }
}

/// What running `nodes` for nothing costs; `None` if that must not be done.
fn speculation_cost(nodes: &[Node]) -> Option<u32> {
    let mut cost = 0_u32;
    for node in nodes {
        cost += match node {
            Node::Inst(inst) => inst.op.speculation_cost()?,
            Node::Get { .. } => 0,
            Node::Set { .. } => 1,
            _ => return None,
        };
        if cost > SPECULATION_LIMIT {
            return None;
        }
    }
    Some(cost)
}

/// Evaluates an instruction on the bits of its operands.
struct Fold<'a> {
    bits: &'a [u32],
}

impl Visitor<f32> for Fold<'_> {
    type Output = u32;

    fn unary<O: Unary<f32>>(self) -> u32 {
        <O::D as ClassOf<f32>>::to_bits(O::eval(<O::A as ClassOf<f32>>::from_bits(self.bits[0])))
    }

    fn binary<O: Binary<f32>>(self) -> u32 {
        <O::D as ClassOf<f32>>::to_bits(O::eval(
            <O::A as ClassOf<f32>>::from_bits(self.bits[0]),
            <O::B as ClassOf<f32>>::from_bits(self.bits[1]),
        ))
    }

    fn quaternary<O: Quaternary<f32>>(self) -> u32 {
        <O::D as ClassOf<f32>>::to_bits(O::eval(
            <O::A as ClassOf<f32>>::from_bits(self.bits[0]),
            <O::B as ClassOf<f32>>::from_bits(self.bits[1]),
            <O::C as ClassOf<f32>>::from_bits(self.bits[2]),
            <O::E as ClassOf<f32>>::from_bits(self.bits[3]),
        ))
    }

    fn ternary<O: Ternary<f32>>(self) -> u32 {
        <O::D as ClassOf<f32>>::to_bits(O::eval(
            <O::A as ClassOf<f32>>::from_bits(self.bits[0]),
            <O::B as ClassOf<f32>>::from_bits(self.bits[1]),
            <O::C as ClassOf<f32>>::from_bits(self.bits[2]),
        ))
    }
}

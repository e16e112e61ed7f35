//! Structured control flow into blocks and masks.
//!
//! Where lanes part ways, both ways are run one after the other under a mask.
//! A scope that lanes leave one by one keeps a mask of those still inside;
//! leaving takes lanes out of it and of all such masks on the way, and the mask
//! in force is narrowed after the branch that contained the exit.

use std::collections::HashMap;

use naga::Span;

use super::flat::{Block, BlockId, Flat, FlatInst, Reg, RegInfo, Terminator};
use super::uniform::Uniformity;
use crate::ir::{
    Arith, Class, Hazard, Input, Inst, Node, Op, Origin, ScopeId, Tree, Value, Variable,
};

pub(super) fn flatten(tree: &Tree, uniformity: &Uniformity, partial: bool) -> Flat {
    let mut flattener = Flattener {
        uniformity,
        flat: Flat {
            resources: tree.resources.clone(),
            independent: tree.independent,
            ..Flat::default()
        },
        variables: tree.values.len() as u32,
        constants: HashMap::new(),
        open: None,
        lanes: None,
        masks: Vec::new(),
        labels: Vec::new(),
        scopes: Vec::new(),
        ends: Vec::new(),
        mask: None,
        whole: None,
        span: Span::default(),
    };
    for (i, value) in tree.values.iter().enumerate() {
        let constant = if let Origin::Constant(bits) = value.origin {
            Some(bits)
        } else {
            None
        };
        flattener.flat.regs.push(RegInfo {
            class: value.class,
            varying: uniformity.is_varying(Value(i as u32)),
            constant,
        });
    }
    for (i, &class) in tree.variables.iter().enumerate() {
        flattener.flat.regs.push(RegInfo {
            class,
            varying: uniformity.is_variable_varying(Variable(i as u32)),
            constant: None,
        });
    }
    flattener.flat.prologue = tree
        .prologue
        .iter()
        .map(|inst| flattener.inst(inst))
        .collect();
    flattener.body(&tree.body, partial);
    flattener.flat
}

/// A place to jump to, whose block may not be known yet.
#[derive(Clone, Copy, Debug)]
struct Label(u32);

/// A scope being flattened.
struct Scope {
    id: ScopeId,
    /// Lanes still inside.
    inside: Option<Reg>,
    end: Label,
}

struct Flattener<'a> {
    uniformity: &'a Uniformity,
    flat: Flat,
    /// The register of the first variable.
    variables: u32,
    constants: HashMap<u32, Reg>,
    /// Instructions of the block being written.
    open: Option<Vec<FlatInst>>,
    /// Lanes active at the start of that block.
    lanes: Option<u32>,
    /// Registers of masks, by number.
    masks: Vec<Reg>,
    /// Blocks of the labels; jumps hold labels until the end.
    labels: Vec<Option<BlockId>>,
    scopes: Vec<Scope>,
    /// Where to go on when no lane is left, innermost last.
    ends: Vec<Label>,
    /// Lanes that are active here; all without it.
    mask: Option<Reg>,
    /// The mask of a whole workgroup.
    whole: Option<Reg>,
    span: Span,
}

impl Flattener<'_> {
    fn body(&mut self, nodes: &[Node], partial: bool) {
        self.open = Some(Vec::new());
        let end = self.label();
        self.ends.push(end);
        if partial {
            let lanes = self.new_mask();
            self.push(Op::Input(Input::ActiveLanes), &[lanes], &[], None);
            self.mask = Some(lanes);
            self.whole = self.mask;
        }
        self.nodes(nodes);
        self.start(end);
        self.close(Terminator::End);
        self.resolve();
    }

    /// Turns labels into blocks, past blocks that only jump on.
    fn resolve(&mut self) {
        let targets: Vec<BlockId> = self
            .labels
            .iter()
            .map(|&block| {
                let mut block = block.unwrap_or(BlockId(0));
                // Each step goes forward, except that loops are entered by `Enter`.
                while let Some(Block {
                    insts,
                    end: Terminator::Jump(next),
                    ..
                }) = self.flat.blocks.get(block.0 as usize)
                    && insts.is_empty()
                    && let Some(Some(next)) = self.labels.get(next.0 as usize)
                    && *next > block
                {
                    block = *next;
                }
                block
            })
            .collect();
        let resolve =
            |label: &mut BlockId| *label = targets.get(label.0 as usize).copied().unwrap_or(*label);
        for block in &mut self.flat.blocks {
            match &mut block.end {
                Terminator::Jump(to) | Terminator::Enter { head: to, .. } => resolve(to),
                Terminator::Branch { yes: a, no: b, .. }
                | Terminator::Any { yes: a, no: b, .. }
                | Terminator::Again {
                    head: a, end: b, ..
                } => {
                    resolve(a);
                    resolve(b);
                }
                Terminator::End => {}
            }
        }
    }

    fn label(&mut self) -> Label {
        self.labels.push(None);
        Label(self.labels.len() as u32 - 1)
    }

    /// Ends the open block, if any.
    fn close(&mut self, end: Terminator) {
        if let Some(insts) = self.open.take() {
            self.flat.blocks.push(Block {
                insts,
                end,
                lanes: self.lanes,
            });
        }
    }

    /// Begins the block of a label; an open block goes on there.
    fn start(&mut self, label: Label) {
        self.close(Terminator::Jump(to(label)));
        self.labels[label.0 as usize] = Some(BlockId(self.flat.blocks.len() as u32));
        self.open = Some(Vec::new());
        self.lanes = self.mask.map(|mask| self.number_of(mask));
    }

    /// The number of a mask.
    fn number_of(&mut self, mask: Reg) -> u32 {
        let known = self.masks.iter().position(|known| *known == mask);
        let number = known.unwrap_or_else(|| {
            self.masks.push(mask);
            self.masks.len() - 1
        });
        number as u32
    }

    fn push(&mut self, op: Op, results: &[Reg], operands: &[Reg], mask: Option<Reg>) {
        let span = self.span;
        if let Some(open) = &mut self.open {
            open.push(FlatInst {
                op,
                results: results.iter().copied().map(Some).collect(),
                operands: operands.to_vec(),
                mask,
                span,
            });
        }
    }

    fn new_reg(&mut self, info: RegInfo) -> Reg {
        self.flat.regs.push(info);
        Reg(self.flat.regs.len() as u32 - 1)
    }

    fn new_mask(&mut self) -> Reg {
        self.new_reg(RegInfo {
            class: Class::Int,
            varying: true,
            constant: None,
        })
    }

    fn constant(&mut self, bits: u32) -> Reg {
        if let Some(&reg) = self.constants.get(&bits) {
            return reg;
        }
        let reg = self.new_reg(RegInfo {
            class: Class::Int,
            varying: false,
            constant: Some(bits),
        });
        self.constants.insert(bits, reg);
        reg
    }

    fn arith(&mut self, op: Arith, operands: &[Reg]) -> Reg {
        let result = self.new_mask();
        self.push(Op::Arith(op), &[result], operands, None);
        result
    }

    fn variable(&self, variable: Variable) -> Reg {
        Reg(self.variables + variable.0)
    }

    fn inst(&self, inst: &Inst) -> FlatInst {
        FlatInst {
            op: inst.op,
            results: inst
                .results
                .iter()
                .map(|result| result.map(|value| Reg(value.0)))
                .collect(),
            operands: inst.operands.iter().map(|value| Reg(value.0)).collect(),
            mask: if inst.op.is_masked() { self.mask } else { None },
            span: inst.span,
        }
    }

    fn nodes(&mut self, nodes: &[Node]) {
        for (i, node) in nodes.iter().enumerate() {
            let is_last = i + 1 == nodes.len();
            match node {
                Node::Inst(inst) => {
                    let inst = self.inst(inst);
                    self.span = inst.span;
                    if let Some(open) = &mut self.open {
                        open.push(inst);
                    }
                }
                Node::Get { value, variable } => {
                    let (result, variable) = (Reg(value.0), self.variable(*variable));
                    let class = self.flat.regs[result.0 as usize].class;
                    self.push(Op::Move(class), &[result], &[variable], None);
                }
                Node::Set {
                    variable,
                    value,
                    span,
                    hazards,
                    ..
                } => self.set(*variable, *value, *span, hazards),
                Node::If {
                    condition,
                    accept,
                    reject,
                    ..
                } => self.branch(*condition, accept, reject, is_last),
                Node::Scope { id, body } => self.scope(*id, body, is_last),
                Node::Loop {
                    id,
                    next,
                    body,
                    continuing,
                    break_if,
                    span,
                } => {
                    self.repeat(*id, *next, body, continuing, *break_if, *span);
                    self.narrow(&[body, continuing], is_last);
                }
                Node::Exit(target) => {
                    self.exit(*target, self.mask);
                    return;
                }
                Node::Barrier { span } => {
                    self.span = *span;
                    if self.mask != self.whole {
                        self.push(Op::Barrier, &[], &[], self.mask);
                    }
                }
            }
        }
    }

    fn set(&mut self, variable: Variable, value: Value, span: Span, hazards: &[Hazard]) {
        self.span = span;
        let (variable, value) = (self.variable(variable), Reg(value.0));
        let info = self.flat.regs[variable.0 as usize];
        let mask = if info.varying && self.uniformity.is_hazardous(hazards) {
            self.mask
        } else {
            None
        };
        self.push(Op::Move(info.class), &[variable], &[value], mask);
    }

    /// Whether something in `nodes` takes lanes out of a scope around them.
    fn escapes(&self, nodes: &[Node]) -> bool {
        nodes.iter().any(|node| match node {
            Node::Exit(target) => {
                self.uniformity.is_masked(*target)
                    && self.scopes.iter().any(|scope| scope.id == *target)
            }
            Node::If { accept, reject, .. } => self.escapes(accept) || self.escapes(reject),
            Node::Scope { body, .. } => self.escapes(body),
            Node::Loop {
                body, continuing, ..
            } => self.escapes(body) || self.escapes(continuing),
            _ => false,
        })
    }

    /// After code that may have taken lanes away: leaves them out, and skips
    /// the rest if none remain.
    fn narrow(&mut self, after: &[&[Node]], is_last: bool) {
        if !after.iter().any(|nodes| self.escapes(nodes)) {
            return;
        }
        let Some(inside) = self.scopes.iter().rev().find_map(|scope| scope.inside) else {
            return;
        };
        if self.open.is_none() {
            return;
        }
        let mask = match self.mask {
            Some(mask) if mask != inside => self.arith(Arith::And, &[mask, inside]),
            _ => inside,
        };
        self.mask = Some(mask);
        if !is_last && let Some(&end) = self.ends.last() {
            let go_on = self.label();
            self.close(Terminator::Any {
                mask,
                yes: to(go_on),
                no: to(end),
            });
            self.start(go_on);
        }
    }

    fn branch(&mut self, condition: Value, accept: &[Node], reject: &[Node], is_last: bool) {
        let condition_reg = Reg(condition.0);
        let join = self.label();
        let outer = self.mask;
        if self.uniformity.is_varying(condition) {
            match (accept, reject) {
                ([Node::Exit(target)], []) if self.uniformity.is_masked(*target) => {
                    return self.exit_if(condition_reg, true, *target, is_last, accept);
                }
                ([], [Node::Exit(target)]) if self.uniformity.is_masked(*target) => {
                    return self.exit_if(condition_reg, false, *target, is_last, reject);
                }
                _ => {}
            }
            self.ends.push(join);
            if !accept.is_empty() {
                let (then, other) = (self.label(), self.label());
                let mask = match outer {
                    Some(mask) => self.arith(Arith::And, &[mask, condition_reg]),
                    None => condition_reg,
                };
                self.close(Terminator::Any {
                    mask,
                    yes: to(then),
                    no: to(other),
                });
                self.mask = Some(mask);
                self.start(then);
                if let Some(end) = self.ends.last_mut() {
                    *end = other;
                }
                self.nodes(accept);
                self.mask = outer;
                self.start(other);
                if let Some(end) = self.ends.last_mut() {
                    *end = join;
                }
            }
            if !reject.is_empty() {
                let then = self.label();
                let mask = match outer {
                    Some(mask) => self.arith(Arith::AndNot, &[mask, condition_reg]),
                    None => self.arith(Arith::Not, &[condition_reg]),
                };
                self.close(Terminator::Any {
                    mask,
                    yes: to(then),
                    no: to(join),
                });
                self.mask = Some(mask);
                self.start(then);
                self.nodes(reject);
            }
        } else {
            let (then, other) = (
                self.label(),
                if reject.is_empty() {
                    join
                } else {
                    self.label()
                },
            );
            self.close(Terminator::Branch {
                condition: condition_reg,
                yes: to(then),
                no: to(other),
            });
            self.ends.push(join);
            self.start(then);
            self.nodes(accept);
            if !reject.is_empty() {
                self.close(Terminator::Jump(to(join)));
                self.mask = outer;
                self.start(other);
                self.nodes(reject);
            }
        }
        self.ends.pop();
        self.mask = outer;
        self.start(join);
        self.narrow(&[accept, reject], is_last);
    }

    /// `if condition == when { exit }`.
    fn exit_if(
        &mut self,
        condition: Reg,
        when: bool,
        target: ScopeId,
        is_last: bool,
        exit: &[Node],
    ) {
        let innermost = self.scopes.iter().rev().find_map(|scope| scope.inside);
        if let Some(inside) = innermost
            && self.mask == Some(inside)
            && self.crossed_masks(target) == [inside]
        {
            // Active are exactly the lanes inside.
            let op = if when { Arith::AndNot } else { Arith::And };
            self.push(Op::Arith(op), &[inside], &[inside, condition], None);
        } else {
            let leaving = match (self.mask, when) {
                (Some(mask), true) => self.arith(Arith::And, &[mask, condition]),
                (Some(mask), false) => self.arith(Arith::AndNot, &[mask, condition]),
                (None, true) => condition,
                (None, false) => self.arith(Arith::Not, &[condition]),
            };
            self.take_out(target, leaving);
        }
        self.narrow(&[exit], is_last);
    }

    /// The masks of the scopes that leaving `target` leaves, outermost first.
    fn crossed_masks(&self, target: ScopeId) -> Vec<Reg> {
        let from = self
            .scopes
            .iter()
            .position(|scope| scope.id == target)
            .unwrap_or(self.scopes.len());
        self.scopes[from..]
            .iter()
            .filter_map(|scope| scope.inside)
            .collect()
    }

    /// The lanes leaving may be the innermost mask itself, so that one is
    /// changed last.
    fn take_out(&mut self, target: ScopeId, leaving: Reg) {
        for inside in self.crossed_masks(target) {
            self.push(
                Op::Arith(Arith::AndNot),
                &[inside],
                &[inside, leaving],
                None,
            );
        }
    }

    fn exit(&mut self, target: ScopeId, mask: Option<Reg>) {
        if !self.uniformity.is_masked(target) {
            if let Some(scope) = self.scopes.iter().find(|scope| scope.id == target) {
                let end = scope.end;
                self.close(Terminator::Jump(to(end)));
            }
            return;
        }
        let leaving = match mask {
            Some(mask) => mask,
            None => self.constant(u32::MAX),
        };
        self.take_out(target, leaving);
        if let Some(&end) = self.ends.last() {
            self.close(Terminator::Jump(to(end)));
        }
    }

    /// A mask of the lanes inside a scope, if it needs one: at first those
    /// active here.
    fn enter(&mut self, id: ScopeId) -> Option<Reg> {
        if !self.uniformity.needs_mask(id) {
            return None;
        }
        let inside = self.new_mask();
        let active = match self.mask {
            Some(mask) => mask,
            None => self.constant(u32::MAX),
        };
        self.push(Op::Move(Class::Int), &[inside], &[active], None);
        self.mask = Some(inside);
        Some(inside)
    }

    fn scope(&mut self, id: ScopeId, body: &[Node], is_last: bool) {
        let outer = self.mask;
        let end = self.label();
        let inside = self.enter(id);
        self.scopes.push(Scope { id, inside, end });
        self.ends.push(end);
        self.nodes(body);
        self.ends.pop();
        self.scopes.pop();
        self.mask = outer;
        self.start(end);
        self.narrow(&[body], is_last);
    }

    fn repeat(
        &mut self,
        id: ScopeId,
        next: ScopeId,
        body: &[Node],
        continuing: &[Node],
        break_if: Option<Value>,
        span: Span,
    ) {
        let outer = self.mask;
        let (head, step, end) = (self.label(), self.label(), self.label());
        let counter = self.flat.loops.len() as u32;
        self.flat.loops.push(span);
        let inside = self.enter(id);
        let in_loop = self.mask;
        self.scopes.push(Scope { id, inside, end });
        self.close(Terminator::Enter {
            counter,
            head: to(head),
        });
        self.start(head);
        let in_body = self.enter(next);
        self.scopes.push(Scope {
            id: next,
            inside: in_body,
            end: step,
        });
        // Without lanes that wait for the next iteration, none left means the end.
        self.ends.push(if in_body.is_some() { step } else { end });
        self.nodes(body);
        self.ends.pop();
        self.scopes.pop();
        self.mask = in_loop;
        self.start(step);
        self.ends.push(end);
        self.nodes(continuing);
        self.ends.pop();
        self.scopes.pop();
        if let Some(condition) = break_if {
            let condition_reg = Reg(condition.0);
            match inside {
                Some(inside) if self.uniformity.is_varying(condition) => {
                    self.push(
                        Op::Arith(Arith::AndNot),
                        &[inside],
                        &[inside, condition_reg],
                        None,
                    );
                }
                _ => {
                    let again = self.label();
                    self.close(Terminator::Branch {
                        condition: condition_reg,
                        yes: to(end),
                        no: to(again),
                    });
                    self.start(again);
                }
            }
        }
        if let Some(inside) = inside {
            let again = self.label();
            self.close(Terminator::Any {
                mask: inside,
                yes: to(again),
                no: to(end),
            });
            self.start(again);
        }
        self.close(Terminator::Again {
            counter,
            head: to(head),
            end: to(end),
            mask: in_loop,
        });
        self.mask = outer;
        self.start(end);
    }
}

/// A label where a block will be.
fn to(label: Label) -> BlockId {
    BlockId(label.0)
}

//! Which values are the same in all invocations of a workgroup, hence kept
//! once, and where control flow differs between them.
//!
//! A fixpoint that starts from everything being uniform. A variable stays
//! uniform when every value it is set to is, and no lane that missed the
//! setting reads it afterwards: a loop's counter is uniform although lanes
//! leave the loop at different times.

use std::collections::BTreeSet;

use crate::ir::{Hazard, Inst, Node, ScopeId, Tree, Value, Variable};

/// What the analysis found.
#[derive(Debug, Default)]
pub(super) struct Uniformity {
    varying_values: Vec<bool>,
    varying_variables: Vec<bool>,
    /// Branches on a varying condition.
    divergent: BTreeSet<u32>,
    /// Scopes that lanes leave one by one.
    masked: BTreeSet<ScopeId>,
    /// Loops that are left one by one on the way out of another scope.
    crossed: BTreeSet<ScopeId>,
}

impl Uniformity {
    pub(super) fn is_varying(&self, value: Value) -> bool {
        self.varying_values[value.0 as usize]
    }

    pub(super) fn is_variable_varying(&self, variable: Variable) -> bool {
        self.varying_variables[variable.0 as usize]
    }

    /// Whether lanes leave the scope one by one, so that leaving it is noted in a mask.
    pub(super) fn is_masked(&self, scope: ScopeId) -> bool {
        self.masked.contains(&scope)
    }

    /// Whether the scope needs a mask of the lanes that are still in it: a loop
    /// needs one to know when it ends; for other scopes on the way out the mask
    /// of the scope that is left will do.
    pub(super) fn needs_mask(&self, scope: ScopeId) -> bool {
        self.masked.contains(&scope) || self.crossed.contains(&scope)
    }

    /// Whether a lane that does not take part may read what was there before.
    pub(super) fn is_hazardous(&self, hazards: &[Hazard]) -> bool {
        hazards.iter().any(|hazard| match hazard {
            Hazard::Branch(id) => self.divergent.contains(id),
            Hazard::Exit(scope) => self.masked.contains(scope),
        })
    }
}

pub(super) fn analyse(tree: &Tree) -> Uniformity {
    let mut walk = Walk {
        found: Uniformity {
            varying_values: vec![false; tree.values.len()],
            varying_variables: vec![false; tree.variables.len()],
            ..Uniformity::default()
        },
        enclosing: Vec::new(),
        changed: true,
    };
    while walk.changed {
        walk.changed = false;
        walk.nodes(&tree.body);
    }
    walk.found
}

#[derive(Clone, Copy)]
enum Enclosing {
    Branch(u32),
    Scope(ScopeId),
    Loop(ScopeId),
}

struct Walk {
    found: Uniformity,
    enclosing: Vec<Enclosing>,
    changed: bool,
}

impl Walk {
    fn set_varying(&mut self, value: Value) {
        let varying = &mut self.found.varying_values[value.0 as usize];
        self.changed |= !*varying;
        *varying = true;
    }

    fn set_masked(&mut self, scope: ScopeId) {
        self.changed |= self.found.masked.insert(scope);
    }

    fn inst(&mut self, inst: &Inst) {
        if inst.op.is_varying()
            || inst
                .operands
                .iter()
                .any(|&operand| self.found.is_varying(operand))
        {
            for &result in inst.results.iter().flatten() {
                self.set_varying(result);
            }
        }
    }

    fn inside(&mut self, entries: &[Enclosing], nodes: &[Node]) {
        self.enclosing.extend(entries);
        self.nodes(nodes);
        self.enclosing
            .truncate(self.enclosing.len() - entries.len());
    }

    fn nodes(&mut self, nodes: &[Node]) {
        for node in nodes {
            match node {
                Node::Inst(inst) => self.inst(inst),
                Node::Get { value, variable } => {
                    if self.found.is_variable_varying(*variable) {
                        self.set_varying(*value);
                    }
                }
                Node::Set {
                    variable,
                    value,
                    hazards,
                    ..
                } => {
                    if self.found.is_varying(*value) || self.found.is_hazardous(hazards) {
                        let varying = &mut self.found.varying_variables[variable.0 as usize];
                        self.changed |= !*varying;
                        *varying = true;
                    }
                }
                Node::If {
                    id,
                    condition,
                    accept,
                    reject,
                } => {
                    if self.found.is_varying(*condition) {
                        self.changed |= self.found.divergent.insert(*id);
                    }
                    self.inside(&[Enclosing::Branch(*id)], accept);
                    self.inside(&[Enclosing::Branch(*id)], reject);
                }
                Node::Scope { id, body } => self.inside(&[Enclosing::Scope(*id)], body),
                Node::Loop {
                    id,
                    next,
                    body,
                    continuing,
                    break_if,
                    ..
                } => {
                    self.inside(&[Enclosing::Loop(*id), Enclosing::Scope(*next)], body);
                    self.inside(&[Enclosing::Loop(*id)], continuing);
                    if break_if.is_some_and(|condition| self.found.is_varying(condition)) {
                        self.set_masked(*id);
                    }
                }
                Node::Exit(target) => self.exit(*target),
                Node::Barrier { .. } => {}
            }
        }
    }

    /// Lanes leave together unless a branch on the way was taken by some only,
    /// or some are waiting at the end of a scope on the way.
    fn exit(&mut self, target: ScopeId) {
        let mut crossed = Vec::new();
        let mut together = true;
        for enclosing in self.enclosing.iter().rev() {
            match *enclosing {
                Enclosing::Branch(id) => together &= !self.found.divergent.contains(&id),
                Enclosing::Scope(scope) | Enclosing::Loop(scope) if scope == target => break,
                Enclosing::Scope(scope) => together &= !self.found.masked.contains(&scope),
                Enclosing::Loop(scope) => {
                    together &= !self.found.masked.contains(&scope);
                    crossed.push(scope);
                }
            }
        }
        if !together {
            self.set_masked(target);
            for scope in crossed {
                self.changed |= self.found.crossed.insert(scope);
            }
        }
    }
}

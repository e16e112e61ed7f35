//! Which variables are read again, hence which nodes do nothing, and where
//! setting a variable must spare the lanes that do not take part.

use std::collections::HashMap;

use crate::ir::{Hazard, Inst, Node, ScopeId, Tree};

/// A set of small numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct BitSet {
    words: Vec<u64>,
}

impl BitSet {
    pub(super) fn new(size: usize) -> Self {
        Self {
            words: vec![0; size.div_ceil(64)],
        }
    }

    pub(super) fn contains(&self, index: usize) -> bool {
        self.words
            .get(index / 64)
            .is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    pub(super) fn insert(&mut self, index: usize) {
        if let Some(word) = self.words.get_mut(index / 64) {
            *word |= 1 << (index % 64);
        }
    }

    pub(super) fn remove(&mut self, index: usize) {
        if let Some(word) = self.words.get_mut(index / 64) {
            *word &= !(1 << (index % 64));
        }
    }

    /// Adds all of `other`; says whether that changed anything.
    pub(super) fn union(&mut self, other: &Self) -> bool {
        let mut changed = false;
        for (word, &new) in self.words.iter_mut().zip(&other.words) {
            changed |= new & !*word != 0;
            *word |= new;
        }
        changed
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words.iter().enumerate().flat_map(|(i, &word)| {
            (0..64)
                .filter(move |bit| word >> bit & 1 == 1)
                .map(move |bit| i * 64 + bit)
        })
    }
}

/// Removes nodes without effect, numbers branches and finds hazards.
pub(super) fn prune(tree: &mut Tree) {
    // Each round can make more dead; a few reach practically everything.
    for _ in 0..8 {
        let mut walk = Walk {
            ends: HashMap::new(),
            enclosing: Vec::new(),
            branches: 0,
        };
        let mut live = BitSet::new(tree.variables.len());
        walk.nodes(&mut tree.body, &mut live);
        if !remove_dead(tree) {
            break;
        }
    }
}

struct Walk {
    /// What is live at the end of each open scope.
    ends: HashMap<ScopeId, BitSet>,
    /// Where lanes that do not take part go on, with what is live there.
    enclosing: Vec<(Hazard, BitSet)>,
    branches: u32,
}

impl Walk {
    /// Walks backwards; `live` is what is live at the end, then at the start.
    fn nodes(&mut self, nodes: &mut [Node], live: &mut BitSet) {
        for node in nodes.iter_mut().rev() {
            match node {
                Node::Inst(_) | Node::Barrier { .. } => {}
                Node::Get { variable, .. } => live.insert(variable.0 as usize),
                Node::Set {
                    variable,
                    hazards,
                    is_read,
                    ..
                } => {
                    let index = variable.0 as usize;
                    hazards.clear();
                    hazards.extend(
                        self.enclosing
                            .iter()
                            .filter(|(_, live)| live.contains(index))
                            .map(|(hazard, _)| *hazard),
                    );
                    *is_read = live.contains(index);
                    live.remove(index);
                }
                Node::If {
                    id, accept, reject, ..
                } => {
                    *id = self.branches;
                    self.branches += 1;
                    let hazard = Hazard::Branch(*id);
                    let mut at_reject = live.clone();
                    self.enclosing.push((hazard, live.clone()));
                    self.nodes(reject, &mut at_reject);
                    self.enclosing.pop();
                    self.enclosing.push((hazard, at_reject.clone()));
                    self.nodes(accept, live);
                    self.enclosing.pop();
                    live.union(&at_reject);
                }
                Node::Scope { id, body } => {
                    self.ends.insert(*id, live.clone());
                    self.enclosing.push((Hazard::Exit(*id), live.clone()));
                    self.nodes(body, live);
                    self.enclosing.pop();
                }
                Node::Loop {
                    id,
                    next,
                    body,
                    continuing,
                    break_if,
                    ..
                } => {
                    let after = live.clone();
                    self.ends.insert(*id, after.clone());
                    let mut head = BitSet {
                        words: vec![0; after.words.len()],
                    };
                    let branches = self.branches;
                    loop {
                        self.branches = branches;
                        let mut point = head.clone();
                        if break_if.is_some() {
                            point.union(&after);
                        }
                        self.enclosing.push((Hazard::Exit(*id), after.clone()));
                        self.nodes(continuing, &mut point);
                        self.ends.insert(*next, point.clone());
                        self.enclosing.push((Hazard::Exit(*next), point.clone()));
                        self.nodes(body, &mut point);
                        self.enclosing.truncate(self.enclosing.len() - 2);
                        if !head.union(&point) {
                            break;
                        }
                    }
                    *live = head;
                }
                Node::Exit(scope) => {
                    if let Some(end) = self.ends.get(scope) {
                        *live = end.clone();
                    }
                }
            }
        }
    }
}

/// Removes what has neither effect nor reader; says whether there was any.
fn remove_dead(tree: &mut Tree) -> bool {
    let mut needed = BitSet::new(tree.values.len());
    let before = count(&tree.body) + tree.prologue.len();
    sweep(&mut tree.body, &mut needed);
    let mut prologue: Vec<Inst> = std::mem::take(&mut tree.prologue);
    prologue.reverse();
    prologue.retain_mut(|inst| keep(inst, &mut needed));
    prologue.reverse();
    tree.prologue = prologue;
    before != count(&tree.body) + tree.prologue.len()
}

fn count(nodes: &[Node]) -> usize {
    nodes
        .iter()
        .map(|node| match node {
            Node::If { accept, reject, .. } => 1 + count(accept) + count(reject),
            Node::Scope { body, .. } => 1 + count(body),
            Node::Loop {
                body, continuing, ..
            } => 1 + count(body) + count(continuing),
            _ => 1,
        })
        .sum()
}

/// Whether an instruction must stay; notes what it needs.
fn keep(inst: &mut Inst, needed: &mut BitSet) -> bool {
    for result in &mut inst.results {
        if result.is_some_and(|value| !needed.contains(value.0 as usize)) {
            *result = None;
        }
    }
    if inst.op.is_removable() && inst.results.iter().all(Option::is_none) {
        return false;
    }
    for operand in &inst.operands {
        needed.insert(operand.0 as usize);
    }
    true
}

/// Every value is computed before it is used in the order of the nodes, so one
/// pass from the end sees all uses first.
fn sweep(nodes: &mut Vec<Node>, needed: &mut BitSet) {
    let mut kept = Vec::with_capacity(nodes.len());
    for mut node in nodes.drain(..).rev() {
        let keep = match &mut node {
            Node::Inst(inst) => keep(inst, needed),
            Node::Get { value, .. } => needed.contains(value.0 as usize),
            Node::Set { value, is_read, .. } => {
                if *is_read {
                    needed.insert(value.0 as usize);
                }
                *is_read
            }
            Node::If {
                condition,
                accept,
                reject,
                ..
            } => {
                sweep(reject, needed);
                sweep(accept, needed);
                needed.insert(condition.0 as usize);
                !(accept.is_empty() && reject.is_empty())
            }
            Node::Scope { body, .. } => {
                sweep(body, needed);
                !body.is_empty()
            }
            Node::Loop {
                body,
                continuing,
                break_if,
                ..
            } => {
                if let Some(condition) = break_if {
                    needed.insert(condition.0 as usize);
                }
                sweep(continuing, needed);
                sweep(body, needed);
                // A loop that does nothing may still not end.
                true
            }
            Node::Exit(_) | Node::Barrier { .. } => true,
        };
        if keep {
            kept.push(node);
        }
    }
    kept.reverse();
    *nodes = kept;
}

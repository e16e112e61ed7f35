//! The intermediate representation between naga's IR and bytecode: scalar
//! values, mutable scalar variables, and structured control flow.
//!
//! A [`Value`] is computed by one instruction and never changes; a
//! [`Variable`] is set and read by explicit nodes, and is the only thing that
//! carries data around loops and out of branches.

pub(crate) mod arith;
pub(crate) mod chain;
mod check;
mod op;
mod probe;
mod stage;
pub(crate) mod subgroup;

pub(crate) use arith::{Arith, Class};
pub(crate) use check::{Access, Check, Indexed};
pub(crate) use op::{AtomicFunction, ImageAccess, ImageQuery, Input, Memory, Op, Sampling};
pub(crate) use probe::{Perturbed, Probe, Probed};
pub(crate) use stage::{Interpolation, StageInput, StageOutput, StageSlots};

use naga::Span;

use crate::finding::Checks;

/// A scalar that is computed once per execution of its instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Value(pub(crate) u32);

/// A scalar that is set and read by nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Variable(pub(crate) u32);

/// A scope that can be left early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct ScopeId(pub(crate) u32);

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Origin {
    /// A literal, by its bits.
    Constant(u32),
    /// An instruction of the prologue: the same for the whole dispatch.
    Prologue,
    /// An instruction of the body.
    Body,
}

/// What is known of a value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ValueInfo {
    pub(crate) class: Class,
    pub(crate) origin: Origin,
}

/// One instruction.
#[derive(Clone, Debug)]
pub(crate) struct Inst {
    pub(crate) op: Op,
    /// Results; `None` where nobody wants one.
    pub(crate) results: Vec<Option<Value>>,
    pub(crate) operands: Vec<Value>,
    pub(crate) span: Span,
}

/// A place after a [`Node::Set`] where lanes that may not have taken part in it
/// read the variable's former value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hazard {
    /// Lanes that took the other side of a branch.
    Branch(u32),
    /// Lanes that left a scope.
    Exit(ScopeId),
}

/// A step of structured control flow.
#[derive(Clone, Debug)]
pub(crate) enum Node {
    Inst(Inst),
    /// `value = variable`, a snapshot.
    Get {
        value: Value,
        variable: Variable,
    },
    /// `variable = value`. Whether it is read again and the hazards are found
    /// by [`crate::lower`].
    Set {
        variable: Variable,
        value: Value,
        span: Span,
        is_read: bool,
        hazards: Vec<Hazard>,
    },
    /// Branches are numbered by [`crate::lower`].
    If {
        id: u32,
        condition: Value,
        accept: Vec<Node>,
        reject: Vec<Node>,
    },
    /// Runs `body` once; [`Node::Exit`] leaves it.
    Scope {
        id: ScopeId,
        body: Vec<Node>,
    },
    /// Repeats `body`, `continuing`. [`Node::Exit`] of `id` ends the loop, of
    /// `next` goes to `continuing`; `break_if` ends it after `continuing`.
    Loop {
        id: ScopeId,
        next: ScopeId,
        body: Vec<Node>,
        continuing: Vec<Node>,
        break_if: Option<Value>,
        span: Span,
    },
    /// Goes to the end of the scope.
    Exit(ScopeId),
    /// All invocations of the workgroup must get here together.
    Barrier {
        span: Span,
    },
}

/// A whole kernel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) values: Vec<ValueInfo>,
    /// Class of each variable.
    pub(crate) variables: Vec<Class>,
    pub(crate) scopes: u32,
    /// Runs once per worker; all of it uniform.
    pub(crate) prologue: Vec<Inst>,
    pub(crate) body: Vec<Node>,
    pub(crate) resources: Resources,
    /// Whether invocations of several workgroups can run together: none of
    /// them waits for others or shares memory with them.
    pub(crate) independent: bool,
}

/// What the instructions refer to by index.
#[derive(Clone, Debug, Default)]
pub(crate) struct Resources {
    /// Constant tables, by bits.
    pub(crate) tables: Vec<Vec<u32>>,
    /// Per-invocation memory: slots of each class.
    pub(crate) private: Slots,
    /// Memory of the workgroup: slots of each class.
    pub(crate) workgroup: Slots,
    /// What the program watches for.
    pub(crate) checks: Checks,
    /// What the sanitiser follows.
    pub(crate) probes: Vec<Probe>,
    /// Of vertex and fragment kernels.
    pub(crate) stage: StageSlots,
}

/// A number of memory slots of each class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Slots {
    pub(crate) float: u32,
    pub(crate) int: u32,
}

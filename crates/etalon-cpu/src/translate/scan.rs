//! What must be known of functions before they are translated: which variables
//! are indexed by a computed value, and which ones a loop assigns.

use std::collections::{HashMap, HashSet};

use naga::valid::ModuleInfo;
use naga::{
    AddressSpace, Binding, Block, BuiltIn, Expression, Function, GlobalVariable, Handle,
    LocalVariable, Module, Statement, TypeInner,
};

/// What a pointer or value was derived from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Root {
    Local(Handle<LocalVariable>),
    Global(Handle<GlobalVariable>),
    Argument(u32),
    Other,
}

pub(super) fn root(function: &Function, mut expression: Handle<Expression>) -> Root {
    loop {
        match function.expressions[expression] {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => {
                expression = base
            }
            Expression::LocalVariable(local) => return Root::Local(local),
            Expression::GlobalVariable(global) => return Root::Global(global),
            Expression::FunctionArgument(index) => return Root::Argument(index),
            _ => return Root::Other,
        }
    }
}

/// Variables that are indexed by a computed value somewhere, so that they need
/// an address; all others become registers.
#[derive(Debug, Default)]
pub(super) struct Indexed {
    arguments: HashMap<Handle<Function>, HashSet<u32>>,
    pub(super) globals: HashSet<Handle<GlobalVariable>>,
}

/// Looks through the whole module.
pub(super) fn indexed(module: &Module) -> Indexed {
    let mut indexed = Indexed::default();
    // A function comes after those it calls.
    for (handle, function) in module.functions.iter() {
        let roots = indexed.roots(function);
        let arguments = roots
            .iter()
            .filter_map(|root| {
                if let Root::Argument(i) = root {
                    Some(*i)
                } else {
                    None
                }
            })
            .collect();
        indexed.arguments.insert(handle, arguments);
        indexed.add_globals(&roots);
    }
    for entry in &module.entry_points {
        let roots = indexed.roots(&entry.function);
        indexed.add_globals(&roots);
    }
    indexed
}

impl Indexed {
    fn add_globals(&mut self, roots: &HashSet<Root>) {
        self.globals.extend(roots.iter().filter_map(|root| {
            if let Root::Global(g) = root {
                Some(*g)
            } else {
                None
            }
        }));
    }

    /// The local variables of `function` that are indexed.
    pub(super) fn locals(&self, function: &Function) -> HashSet<Handle<LocalVariable>> {
        self.roots(function)
            .iter()
            .filter_map(|root| {
                if let Root::Local(l) = root {
                    Some(*l)
                } else {
                    None
                }
            })
            .collect()
    }

    fn roots(&self, function: &Function) -> HashSet<Root> {
        let mut roots = HashSet::new();
        for (_, expression) in function.expressions.iter() {
            if let Expression::Access { base, index } = *expression
                && !matches!(function.expressions[index], Expression::Literal(_))
            {
                roots.insert(root(function, base));
            }
        }
        self.passed_on(function, &function.body, &mut roots);
        roots
    }

    /// Variables whose address goes to a function that indexes it.
    fn passed_on(&self, function: &Function, block: &Block, roots: &mut HashSet<Root>) {
        for_each(block, &mut |statement| {
            if let Statement::Call {
                function: callee,
                arguments,
                ..
            } = statement
                && let Some(indexed) = self.arguments.get(callee)
            {
                for &index in indexed {
                    if let Some(&argument) = arguments.get(index as usize) {
                        roots.insert(root(function, argument));
                    }
                }
            }
        });
    }
}

/// The roots of everything `block` may assign, and whether it calls anything.
pub(super) fn assigned(function: &Function, block: &Block, roots: &mut HashSet<Root>) -> bool {
    let mut calls = false;
    for_each(block, &mut |statement| match statement {
        Statement::Store { pointer, .. } | Statement::Atomic { pointer, .. } => {
            roots.insert(root(function, *pointer));
        }
        Statement::Call { arguments, .. } => {
            calls = true;
            roots.extend(arguments.iter().map(|&argument| root(function, argument)));
        }
        _ => {}
    });
    calls
}

/// Whether invocations of a workgroup depend on each other: they share memory,
/// or wait for or talk to each other.
pub(super) fn is_collective(module: &Module, info: &ModuleInfo, entry_point: usize) -> bool {
    let used = info.get_entry_point(entry_point);
    let shares = module.global_variables.iter().any(|(handle, global)| {
        global.space == AddressSpace::WorkGroup && !used[handle].is_empty()
    });
    let mut meets = false;
    let functions = module.functions.iter().map(|(_, function)| function);
    for function in functions.chain([&module.entry_points[entry_point].function]) {
        for_each(&function.body, &mut |statement| {
            meets |= matches!(
                statement,
                Statement::ControlBarrier(_)
                    | Statement::MemoryBarrier(_)
                    | Statement::WorkGroupUniformLoad { .. }
                    | Statement::SubgroupBallot { .. }
                    | Statement::SubgroupGather { .. }
                    | Statement::SubgroupCollectiveOperation { .. }
            );
        });
    }
    let arguments = &module.entry_points[entry_point].function.arguments;
    let is_subgroup = |binding: &Option<Binding>| {
        matches!(
            binding,
            Some(Binding::BuiltIn(
                BuiltIn::SubgroupId
                    | BuiltIn::SubgroupInvocationId
                    | BuiltIn::SubgroupSize
                    | BuiltIn::NumSubgroups
            ))
        )
    };
    let numbered = arguments.iter().any(|argument| {
        is_subgroup(&argument.binding)
            || match &module.types[argument.ty].inner {
                TypeInner::Struct { members, .. } => {
                    members.iter().any(|member| is_subgroup(&member.binding))
                }
                _ => false,
            }
    });
    shares || meets || numbered
}

fn for_each(block: &Block, visit: &mut impl FnMut(&Statement)) {
    for statement in block.iter() {
        visit(statement);
        match statement {
            Statement::Block(block) => for_each(block, visit),
            Statement::If { accept, reject, .. } => {
                for_each(accept, visit);
                for_each(reject, visit);
            }
            Statement::Switch { cases, .. } => {
                cases.iter().for_each(|case| for_each(&case.body, visit))
            }
            Statement::Loop {
                body, continuing, ..
            } => {
                for_each(body, visit);
                for_each(continuing, visit);
            }
            _ => {}
        }
    }
}

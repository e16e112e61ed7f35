//! What memory an expression may read and a statement may write.

use super::{Access, Generator};
use crate::programs::grammar::*;

/// From a variable to a part, indices being still to be chosen.
#[derive(Clone, Copy)]
enum Hop {
    Member(usize),
    Component(usize),
    Index,
}

/// All ways from a type to parts of another type.
fn ways(from: &Type, to: &Type, way: &mut Vec<Hop>, found: &mut Vec<Vec<Hop>>) {
    if from == to {
        found.push(way.clone());
    }
    let mut follow = |hop: Hop, part: &Type| {
        way.push(hop);
        ways(part, to, way, found);
        way.pop();
    };
    match from {
        Type::Scalar(_) => {}
        Type::Vector(scalar, size) => {
            let part = Type::Scalar(*scalar);
            for index in 0..*size {
                follow(Hop::Component(index), &part);
            }
            follow(Hop::Index, &part);
        }
        Type::Struct(structure) => {
            for (index, member) in structure.members.iter().enumerate() {
                follow(Hop::Member(index), member);
            }
        }
        Type::Matrix { .. } | Type::Array(..) => {
            if let Some((element, _)) = from.element() {
                follow(Hop::Index, &element);
            }
        }
    }
}

impl Generator<'_> {
    /// Roots that may be read, or also written, with the types of what they are.
    fn roots(&mut self, write: bool) -> Vec<(Root, Type)> {
        let mut roots: Vec<(Root, Type)> = Vec::new();
        for (id, ty) in &self.scope.variables {
            roots.push((Root::Local(*id), ty.clone()));
        }
        for (id, ty, _) in &self.scope.pointers {
            roots.push((Root::Pointer(*id), ty.clone()));
        }
        if self.private {
            for (index, (ty, _)) in self.program.private.iter().enumerate() {
                roots.push((Root::Private(index), ty.clone()));
            }
        }
        if !self.in_main {
            return roots;
        }
        for (index, variable) in self.program.workgroup.iter().enumerate() {
            match (variable, self.access[index]) {
                (Workgroup::Lanes(ty), Access::Own) => roots.push((Root::Own(index), ty.clone())),
                (Workgroup::Lanes(ty), Access::Read) if !write => {
                    // The index is chosen with the others.
                    let index = Root::Shared(index, Box::new(Expr::literal(Scalar::U32, 0)));
                    roots.push((index, ty.clone()));
                }
                (Workgroup::Single(ty), Access::Read) if !write => {
                    roots.push((Root::Single(index), ty.clone()));
                }
                (Workgroup::Single(ty), Access::Alone(lane)) if self.alone == Some(lane) => {
                    roots.push((Root::Single(index), ty.clone()));
                }
                _ => {}
            }
        }
        roots
    }

    /// A place of a type that may be read, or also written, if there is one.
    pub(super) fn place(&mut self, ty: &Type, write: bool) -> Option<Place> {
        let mut found = Vec::new();
        for (root, of) in self.roots(write) {
            let mut all = Vec::new();
            ways(&of, ty, &mut Vec::new(), &mut all);
            // One of each variable, so that large ones are not preferred.
            if !all.is_empty() {
                found.push((root, of, self.choices.of(&all)));
            }
        }
        if found.is_empty() {
            return None;
        }
        let (root, of, way) = self.choices.of(&found);
        let root = match root {
            Root::Shared(variable, _) => Root::Shared(variable, Box::new(self.index(1))),
            other => other,
        };
        self.touched_private |= matches!(root, Root::Private(_));
        let path = way
            .into_iter()
            .map(|hop| match hop {
                Hop::Member(index) => Step::Member(index),
                Hop::Component(index) => Step::Component(index),
                Hop::Index => Step::Index(Box::new(self.index(1))),
            })
            .collect();
        Some(Place {
            ty: ty.clone(),
            of,
            root,
            path,
        })
    }

    /// An index that nobody has bounded yet.
    pub(super) fn index(&mut self, depth: usize) -> Expr {
        if self.choices.chance(35) {
            Expr::literal(Scalar::U32, self.choices.below(8) as u32)
        } else {
            self.expr(&U32, depth)
        }
    }

    /// Arguments for a function, if there is something to point to.
    pub(super) fn arguments(&mut self, routine: usize, depth: usize) -> Option<Vec<Argument>> {
        let Routine {
            parameters,
            touches_private,
            ..
        } = self.program.routines[routine].clone();
        if self.costs[routine] * self.repeats > 8 * super::REPEATS
            || (touches_private && !self.private)
        {
            return None;
        }
        let mut arguments = Vec::new();
        let mut pointed: Vec<Root> = Vec::new();
        for parameter in &parameters {
            if parameter.passing == Passing::Value {
                arguments.push(Argument::Value(self.stored(&parameter.ty, depth)));
                continue;
            }
            let mut roots = Vec::new();
            for (id, ty, passing) in &self.scope.pointers {
                if (ty, passing) == (&parameter.ty, &parameter.passing) {
                    roots.push(Root::Pointer(*id));
                }
            }
            if parameter.passing == Passing::Function {
                for (id, ty) in &self.scope.variables {
                    if *ty == parameter.ty {
                        roots.push(Root::Local(*id));
                    }
                }
            } else if self.private && !touches_private {
                for (index, (ty, _)) in self.program.private.iter().enumerate() {
                    if *ty == parameter.ty {
                        roots.push(Root::Private(index));
                    }
                }
            }
            roots.retain(|root| !pointed.contains(root));
            if roots.is_empty() {
                return None;
            }
            let root = self.choices.of(&roots);
            self.touched_private |= matches!(root, Root::Private(_));
            pointed.push(root.clone());
            arguments.push(Argument::Pointer(root));
        }
        self.touched_private |= touches_private;
        self.cost += self.costs[routine] * self.repeats;
        Some(arguments)
    }
}

//! What drivers are known to do otherwise now and then, and in which programs
//! that can show. Each fault has a program among the kept ones.

use super::evaluate::Evaluation;
use super::grammar::*;

/// Something that drivers do otherwise.
struct Habit {
    /// Parts of the drivers' names; an empty one is part of all.
    drivers: &'static [&'static str],
    /// Whether it can show in a program's results.
    shows: fn(&Program, &Evaluation) -> bool,
}

const HABITS: [Habit; 6] = [
    // WGSL §15.7.2: nobody is wrong. lavapipe takes `0.0 - x` for `-x`, and a
    // zero times a number for a zero in products with matrices.
    Habit {
        drivers: &[""],
        shows: |_, evaluation| evaluation.open.zero_made && evaluation.open.zero_seen,
    },
    Habit {
        drivers: &[""],
        shows: |_, evaluation| evaluation.open.infinite,
    },
    // lavapipe (Mesa 22.3) and SwiftShader run a loop for several invocations at
    // a time. Where a loop's one exit is at its end, they keep a value computed
    // in it as the last iteration of all leaves it: those that have left before
    // compute on, with loads giving 0. The same loop is right where all leave
    // together. See `break-if-*.wgsl`.
    Habit {
        drivers: &["llvmpipe", "SwiftShader"],
        shows: |_, evaluation| evaluation.risks.left_early,
    },
    // Mesa's analysis of loops takes the value that a counter begins with for
    // one that a `break` behind the increment sees, and lets the loop end where
    // that would break. See `while-counter-break.wgsl`.
    Habit {
        drivers: &["llvmpipe"],
        shows: |program, _| leaves_by_counter(program),
    },
    // SwiftShader converts integers to a neighbour that need not be the nearest,
    // as §15.7.6 allows.
    Habit {
        drivers: &["SwiftShader"],
        shows: |_, evaluation| evaluation.open.rounded,
    },
    // It clamps the numbers of `pack4xI8Clamp` as unsigned ones: naga writes
    // `SClamp` of unsigned types, which by GLSL.std.450 is signed nevertheless.
    // See `pack-clamp.wgsl`.
    Habit {
        drivers: &["SwiftShader"],
        shows: |_, evaluation| evaluation.risks.packed_clamped,
    },
];

/// Whether a program is for devices at all: little in it is open, and nothing
/// wrong wherever naga's SPIR-V goes.
#[must_use]
pub fn binds_devices(program: &Program, evaluation: &Evaluation) -> bool {
    !evaluation.open.any() && !program.interpreter_only
}

/// Whether a program does what a driver of this name is known to do otherwise at
/// times, rightly or wrongly. Most of these programs give what they should all
/// the same, so they are tried, and other results are no failure.
#[must_use]
pub fn may_differ(program: &Program, evaluation: &Evaluation, driver: &str) -> bool {
    HABITS.iter().any(|habit| {
        habit.drivers.iter().any(|part| driver.contains(part)) && (habit.shows)(program, evaluation)
    })
}

/// Whether a `while` loop is left by a `break` whose condition looks at the
/// loop's counter.
fn leaves_by_counter(program: &Program) -> bool {
    let routines = program.routines.iter().map(|routine| &routine.body);
    routines.chain([&program.main]).any(in_block)
}

fn in_block(block: &Block) -> bool {
    block.iter().any(|stmt| match stmt {
        Stmt::While { id, body, .. } => breaks_by(body, *id) || in_block(body),
        _ => parts(stmt).into_iter().any(in_block),
    })
}

/// Whether a block leaves the loop around it under a condition with a name.
fn breaks_by(block: &Block, id: Id) -> bool {
    block.iter().any(|stmt| match stmt {
        // What breaks in them leaves them.
        Stmt::For { .. } | Stmt::While { .. } | Stmt::Loop { .. } | Stmt::Switch(..) => false,
        Stmt::If(condition, accept, reject) => {
            let breaks = |block: &Block| block.contains(&Stmt::Break);
            (names(condition, id) && (breaks(accept) || breaks(reject)))
                || breaks_by(accept, id)
                || breaks_by(reject, id)
        }
        _ => parts(stmt).into_iter().any(|part| breaks_by(part, id)),
    })
}

/// The blocks that a statement consists of.
fn parts(stmt: &Stmt) -> Vec<&Block> {
    match stmt {
        Stmt::If(_, accept, reject) => vec![accept, reject],
        Stmt::Switch(_, cases) => cases.iter().map(|case| &case.body).collect(),
        Stmt::For { body, .. }
        | Stmt::While { body, .. }
        | Stmt::Block(body)
        | Stmt::Alone(_, body)
        | Stmt::Phase(body, _) => vec![body],
        Stmt::Loop {
            body, continuing, ..
        } => vec![body, continuing],
        _ => Vec::new(),
    }
}

/// Whether an expression has a name in it, outside of indices and arguments.
fn names(expr: &Expr, id: Id) -> bool {
    match &expr.kind {
        ExprKind::Name(other) => *other == id,
        ExprKind::Unary(_, a)
        | ExprKind::Convert(a)
        | ExprKind::Bitcast(a)
        | ExprKind::Swizzle(a, _)
        | ExprKind::Member(a, _)
        | ExprKind::Index(a, _) => names(a, id),
        ExprKind::Binary(_, a, b) => names(a, id) || names(b, id),
        ExprKind::Function(_, parts) | ExprKind::Construct(parts) => {
            parts.iter().any(|part| names(part, id))
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_break_by_the_counter_of_its_own_loop_counts() {
        let condition = |id| Expr {
            ty: BOOL,
            kind: ExprKind::Unary(
                Unary::Not,
                Box::new(Expr {
                    ty: BOOL,
                    kind: ExprKind::Name(id),
                }),
            ),
        };
        let leave = |id| Stmt::If(condition(id), vec![Stmt::Break], Vec::new());
        let repeat = |stmt| {
            vec![Stmt::Block(vec![Stmt::While {
                id: 3,
                trips: 2,
                condition: condition(3),
                body: vec![stmt],
            }])]
        };
        let of_switch = |stmt| {
            let case = Case {
                values: Vec::new(),
                default: true,
                body: vec![stmt],
            };
            Stmt::Switch(Expr::literal(Scalar::U32, 0), vec![case])
        };
        assert!(in_block(&repeat(leave(3))));
        assert!(in_block(&repeat(Stmt::Block(vec![leave(3)]))));
        assert!(!in_block(&repeat(leave(4))));
        // It leaves the `switch`.
        assert!(!in_block(&repeat(of_switch(leave(3)))));
        assert!(!in_block(&vec![leave(3)]));
    }
}

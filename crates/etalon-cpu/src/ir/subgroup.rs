//! Operations among the invocations of a subgroup.

/// An operation that combines numbers of invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Combine {
    /// Of the class the instruction is for.
    Add,
    Mul,
    /// Of floating-point numbers.
    MinF,
    MaxF,
    MinS,
    MaxS,
    MinU,
    MaxU,
    And,
    Or,
    Xor,
}

/// Which invocations' numbers an invocation combines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Scan {
    /// Those of the whole subgroup.
    Reduce,
    /// Its own and those before.
    Inclusive,
    /// Those before.
    Exclusive,
}

/// Whose number an invocation gets; operands that say so come second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Source {
    /// The first active invocation's.
    First,
    /// That of the invocation of the number given.
    Number,
    /// That of the invocation so many before.
    Before,
    /// That of the invocation so many after.
    After,
    /// That of the invocation whose number differs by the bits given.
    Xor,
    /// That of the invocation of the number given within the same four.
    InQuad,
}

/// What a subgroup does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum SubgroupFunction {
    /// A bit for each active invocation whose operand is true. Four results.
    Ballot,
    Combine(Combine, Scan),
    Gather(Source),
}

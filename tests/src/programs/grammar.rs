//! What a generated program is made of.
//!
//! The tree is typed: every expression and place carries its type, and is made
//! of parts of the right types. It says more than WGSL's grammar where that
//! keeps a program's results defined: indices are bounded when they are
//! printed, loops count their iterations, a stretch of divergent code that
//! touches workgroup memory ends with its barrier.

use std::sync::Arc;

/// A scalar type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `bool`.
    Bool,
    /// `i32`.
    I32,
    /// `u32`.
    U32,
    /// `f32`.
    F32,
}

/// A structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Its number, for its name.
    pub index: usize,
    /// Its members' types.
    pub members: Vec<Type>,
}

/// A type whose values can be stored in variables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    /// A number or boolean.
    Scalar(Scalar),
    /// A vector of so many components.
    Vector(Scalar, usize),
    /// A matrix of `f32`.
    Matrix {
        /// Its columns.
        columns: usize,
        /// Components of each.
        rows: usize,
    },
    /// An array of so many elements.
    Array(Arc<Type>, usize),
    /// A structure.
    Struct(Arc<Structure>),
}

/// `bool`.
pub const BOOL: Type = Type::Scalar(Scalar::Bool);
/// `i32`.
pub const I32: Type = Type::Scalar(Scalar::I32);
/// `u32`.
pub const U32: Type = Type::Scalar(Scalar::U32);
/// `f32`.
pub const F32: Type = Type::Scalar(Scalar::F32);

impl Type {
    /// Its scalars in order, as values are kept.
    #[must_use]
    pub fn scalars(&self) -> Vec<Scalar> {
        match self {
            Self::Scalar(scalar) => vec![*scalar],
            Self::Vector(scalar, size) => vec![*scalar; *size],
            Self::Matrix { columns, rows } => vec![Scalar::F32; columns * rows],
            Self::Array(element, size) => element.scalars().repeat(*size),
            Self::Struct(structure) => structure
                .members
                .iter()
                .flat_map(|member| member.scalars())
                .collect(),
        }
    }

    /// How many scalars it has.
    #[must_use]
    pub fn words(&self) -> usize {
        match self {
            Self::Scalar(_) => 1,
            Self::Vector(_, size) => *size,
            Self::Matrix { columns, rows } => columns * rows,
            Self::Array(element, size) => element.words() * size,
            Self::Struct(structure) => structure.members.iter().map(Self::words).sum(),
        }
    }

    /// The scalar that a scalar or vector consists of.
    #[must_use]
    pub fn scalar(&self) -> Option<Scalar> {
        match self {
            Self::Scalar(scalar) | Self::Vector(scalar, _) => Some(*scalar),
            Self::Matrix { .. } => Some(Scalar::F32),
            _ => None,
        }
    }

    /// A scalar or vector of another scalar type and the same shape.
    #[must_use]
    pub fn with_scalar(&self, scalar: Scalar) -> Self {
        match self {
            Self::Vector(_, size) => Self::Vector(scalar, *size),
            _ => Self::Scalar(scalar),
        }
    }

    /// What an index leads to, and how many there are.
    #[must_use]
    pub fn element(&self) -> Option<(Self, usize)> {
        match self {
            Self::Vector(scalar, size) => Some((Self::Scalar(*scalar), *size)),
            Self::Matrix { columns, rows } => Some((Self::Vector(Scalar::F32, *rows), *columns)),
            Self::Array(element, size) => Some(((**element).clone(), *size)),
            Self::Scalar(_) | Self::Struct(_) => None,
        }
    }

    /// A member's type, and the scalars before it.
    #[must_use]
    pub fn member(&self, index: usize) -> Option<(Self, usize)> {
        let Self::Struct(structure) = self else {
            return None;
        };
        let before = structure.members.get(..index)?;
        Some((
            structure.members.get(index)?.clone(),
            before.iter().map(Self::words).sum(),
        ))
    }
}

/// Names a variable, value or parameter within a function.
pub type Id = usize;

/// What the entry point is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// `local_invocation_index`.
    Lane,
    /// `local_invocation_id`.
    Local,
    /// `workgroup_id`.
    Group,
    /// `global_invocation_id`.
    Global,
    /// `num_workgroups`.
    Groups,
}

/// An expression and its type.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// The type.
    pub ty: Type,
    /// What it is.
    pub kind: ExprKind,
}

/// Kinds of expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// A scalar's bits.
    Literal(u32),
    /// The zero value of the type.
    Zero,
    /// A module-scope constant.
    Constant(usize),
    /// A built-in value.
    Input(Input),
    /// An element of `data`, whose index is bounded.
    Data(Box<Expr>),
    /// An element of `reals`, whose index is bounded.
    Reals(Box<Expr>),
    /// A `let`, a loop's counter, or a parameter.
    Name(Id),
    /// What a variable or a part of one holds.
    Load(Place),
    /// An operator with one operand.
    Unary(Unary, Box<Expr>),
    /// An operator with two operands.
    Binary(Binary, Box<Expr>, Box<Expr>),
    /// A built-in function.
    Function(Function, Vec<Expr>),
    /// A function of the program.
    Call(usize, Vec<Argument>),
    /// A vector, matrix, array or structure from its parts.
    Construct(Vec<Expr>),
    /// The same value in another scalar type; floats are brought into range first.
    Convert(Box<Expr>),
    /// The same bits in another scalar type.
    Bitcast(Box<Expr>),
    /// Components of a vector.
    Swizzle(Box<Expr>, Vec<usize>),
    /// A member of a structure.
    Member(Box<Expr>, usize),
    /// An element, whose index is bounded.
    Index(Box<Expr>, Box<Expr>),
    /// `atomicLoad` of any invocation's element of a workgroup variable of
    /// atomics, whose index is bounded.
    AtomicLoad(usize, Box<Expr>),
}

/// A reference to memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Type of what is there.
    pub ty: Type,
    /// Type of what the root is.
    pub of: Type,
    /// The variable.
    pub root: Root,
    /// From the variable to the part of it.
    pub path: Vec<Step>,
}

/// The variable that a place is in.
#[derive(Clone, Debug, PartialEq)]
pub enum Root {
    /// A local variable.
    Local(Id),
    /// A `var<private>`.
    Private(usize),
    /// What a parameter points to.
    Pointer(Id),
    /// The element of a workgroup array that belongs to this invocation.
    Own(usize),
    /// Any element of a workgroup array, whose index is bounded.
    Shared(usize, Box<Expr>),
    /// A whole workgroup variable.
    Single(usize),
}

/// From a value to a part of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// A structure's member.
    Member(usize),
    /// A vector's component, by its letter.
    Component(usize),
    /// An element, whose index is bounded.
    Index(Box<Expr>),
}

/// Operators with one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    /// `-`.
    Negate,
    /// `!`.
    Not,
    /// `~`.
    Complement,
}

/// Operators with two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is WGSL's operator of that name")]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    And,
    Or,
    Xor,
    ShiftLeft,
    ShiftRight,
    Equal,
    NotEqual,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    LogicalAnd,
    LogicalOr,
}

impl Binary {
    /// As WGSL writes it.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Divide => "/",
            Self::Remainder => "%",
            Self::And => "&",
            Self::Or => "|",
            Self::Xor => "^",
            Self::ShiftLeft => "<<",
            Self::ShiftRight => ">>",
            Self::Equal => "==",
            Self::NotEqual => "!=",
            Self::Less => "<",
            Self::LessEqual => "<=",
            Self::Greater => ">",
            Self::GreaterEqual => ">=",
            Self::LogicalAnd => "&&",
            Self::LogicalOr => "||",
        }
    }
}

/// The built-in functions that are exactly defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is WGSL's function of that name")]
pub enum Function {
    Abs,
    Min,
    Max,
    Clamp,
    Saturate,
    Sign,
    Step,
    Floor,
    Ceil,
    Trunc,
    Round,
    Sqrt,
    Select,
    Transpose,
    CountOneBits,
    CountLeadingZeros,
    CountTrailingZeros,
    FirstLeadingBit,
    FirstTrailingBit,
    ReverseBits,
    ExtractBits,
    InsertBits,
    Dot,
    Dot4U8Packed,
    Dot4I8Packed,
    Pack4xI8,
    Pack4xU8,
    Pack4xI8Clamp,
    Pack4xU8Clamp,
    Unpack4xI8,
    Unpack4xU8,
    Any,
    All,
}

impl Function {
    /// As WGSL writes it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Abs => "abs",
            Self::Min => "min",
            Self::Max => "max",
            Self::Clamp => "clamp",
            Self::Saturate => "saturate",
            Self::Sign => "sign",
            Self::Step => "step",
            Self::Floor => "floor",
            Self::Ceil => "ceil",
            Self::Trunc => "trunc",
            Self::Round => "round",
            Self::Sqrt => "sqrt",
            Self::Select => "select",
            Self::Transpose => "transpose",
            Self::CountOneBits => "countOneBits",
            Self::CountLeadingZeros => "countLeadingZeros",
            Self::CountTrailingZeros => "countTrailingZeros",
            Self::FirstLeadingBit => "firstLeadingBit",
            Self::FirstTrailingBit => "firstTrailingBit",
            Self::ReverseBits => "reverseBits",
            Self::ExtractBits => "extractBits",
            Self::InsertBits => "insertBits",
            Self::Dot => "dot",
            Self::Dot4U8Packed => "dot4U8Packed",
            Self::Dot4I8Packed => "dot4I8Packed",
            Self::Pack4xI8 => "pack4xI8",
            Self::Pack4xU8 => "pack4xU8",
            Self::Pack4xI8Clamp => "pack4xI8Clamp",
            Self::Pack4xU8Clamp => "pack4xU8Clamp",
            Self::Unpack4xI8 => "unpack4xI8",
            Self::Unpack4xU8 => "unpack4xU8",
            Self::Any => "any",
            Self::All => "all",
        }
    }
}

/// What a function is called with.
#[derive(Clone, Debug, PartialEq)]
pub enum Argument {
    /// A value.
    Value(Expr),
    /// The address of a whole variable, or a pointer handed on. WGSL asks for
    /// no less where the extension `unrestricted_pointer_parameters` is off,
    /// and SPIR-V's logical addressing has no pointers to parts as arguments.
    Pointer(Root),
}

/// Statements in order.
pub type Block = Vec<Stmt>;

/// A clause of a `switch`.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Its selectors' bits.
    pub values: Vec<u32>,
    /// Whether it is taken when no other is.
    pub default: bool,
    /// What it does.
    pub body: Block,
}

/// Read-modify-write operations on atomics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is WGSL's function of that name")]
pub enum Atomic {
    Add,
    Sub,
    Min,
    Max,
    And,
    Or,
    Xor,
    Exchange,
    CompareExchange,
    Store,
}

impl Atomic {
    /// As WGSL writes it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Add => "atomicAdd",
            Self::Sub => "atomicSub",
            Self::Min => "atomicMin",
            Self::Max => "atomicMax",
            Self::And => "atomicAnd",
            Self::Or => "atomicOr",
            Self::Xor => "atomicXor",
            Self::Exchange => "atomicExchange",
            Self::CompareExchange => "atomicCompareExchangeWeak",
            Self::Store => "atomicStore",
        }
    }
}

/// An atomic that many invocations update at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counter {
    /// An element of the storage buffer `tallies`.
    Tally(usize),
    /// An element of the storage buffer `signed_tallies`.
    SignedTally(usize),
    /// An element of a workgroup variable of atomics.
    Workgroup(usize, usize),
}

/// What is done with a number drawn from a counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Updates this.
    pub to: Counter,
    /// So.
    pub update: Atomic,
    /// A factor for the number.
    pub factor: u32,
}

/// The barrier at the end of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Barrier {
    /// `workgroupBarrier()`.
    Workgroup,
    /// `storageBarrier()` and `workgroupBarrier()`.
    Both,
}

/// A statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Stmt {
    /// `let`.
    Let(Id, Expr),
    /// `var`, with a value or zero.
    Var(Id, Type, Option<Expr>),
    /// `=`.
    Assign(Place, Expr),
    /// `+=` and its like.
    Update(Binary, Place, Expr),
    /// `++`, or `--`.
    Step(Place, bool),
    /// `_ =`.
    Ignore(Expr),
    /// `if` and `else`.
    If(Expr, Block, Block),
    /// `switch` of an `i32` or `u32`.
    Switch(Expr, Vec<Case>),
    /// `for` over a counter that takes so many values.
    For {
        /// The counter.
        id: Id,
        /// Its type, `i32` or `u32`.
        scalar: Scalar,
        /// Its first value.
        from: u32,
        /// What is added to it.
        step: u32,
        /// How many values it takes.
        trips: u32,
        /// What is done with each.
        body: Block,
    },
    /// `while`, at most so often.
    While {
        /// A counter of type `u32`.
        id: Id,
        /// The most iterations.
        trips: u32,
        /// Whether to go on.
        condition: Expr,
        /// What is done; the counter is 1 in its first iteration.
        body: Block,
    },
    /// `loop` with `continuing` and `break if`, at most so often.
    Loop {
        /// A counter of type `u32`.
        id: Id,
        /// The most iterations.
        trips: u32,
        /// What is done first.
        body: Block,
        /// What is done at the end.
        continuing: Block,
        /// Whether to leave.
        until: Option<Expr>,
    },
    /// `break`.
    Break,
    /// `continue`.
    Continue,
    /// `return`.
    Return(Option<Expr>),
    /// A call for its effects.
    Call(usize, Vec<Argument>),
    /// `{ }`.
    Block(Block),
    /// Writes a result; the slot is this statement's alone.
    Emit(usize, Expr),
    /// Updates a counter, and does not look at what it was. All updates of a
    /// counter in one phase commute, so that order makes no difference.
    Count(Counter, Atomic, Expr),
    /// Adds to a counter by `atomicCompareExchangeWeak` until that succeeds.
    CompareAndAdd(Counter, Scalar, Expr),
    /// Adds 1 to a counter and updates another with what it was.
    ///
    /// Atomic operations on one location happen in some order, and WGSL does
    /// not say which: who gets which number is open, the set of numbers is not.
    /// So the outcome is defined where everyone does the same with a number of
    /// that counter, all over the program. A second statement that updates
    /// something else, or does so in another way, would get an unknown part of
    /// the numbers.
    Ticket {
        /// Takes the number from here.
        from: Counter,
        /// Its type.
        scalar: Scalar,
        /// Does this with it.
        draw: Draw,
    },
    /// An atomic operation on this invocation's own element of a workgroup
    /// variable: its result is defined, and named. Of
    /// `atomicCompareExchangeWeak` the result is the old value, or what
    /// `exchanged` selects.
    OwnAtomic {
        /// Names the result.
        id: Id,
        /// The workgroup variable.
        variable: usize,
        /// The operation.
        atomic: Atomic,
        /// What to compare with, for `CompareExchange`.
        compare: Option<Expr>,
        /// The operand.
        value: Expr,
    },
    /// One invocation alone does something.
    Alone(u32, Block),
    /// All invocations do something, then wait for each other. Only in uniform
    /// control flow of the entry point.
    Phase(Block, Barrier),
    /// `workgroupUniformLoad` of a whole workgroup variable.
    UniformLoad(Id, usize),
}

/// How a parameter is passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passing {
    /// As a value.
    Value,
    /// As `ptr<function, T>`.
    Function,
    /// As `ptr<private, T>`.
    Private,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub id: Id,
    /// Its type, or that of what it points to.
    pub ty: Type,
    /// How it is passed.
    pub passing: Passing,
}

/// A function other than the entry point. It calls only functions before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Routine {
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// What it returns.
    pub result: Option<Type>,
    /// What it does.
    pub body: Block,
    /// One more than the largest name in it.
    pub names: usize,
    /// Whether it, or what it calls, touches private variables.
    pub touches_private: bool,
}

/// A workgroup variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Workgroup {
    /// An element for each invocation.
    Lanes(Type),
    /// One value.
    Single(Type),
    /// Atomics, one for each invocation.
    LaneAtomics(Scalar),
    /// So many atomics for all.
    Counters(Scalar, usize),
}

/// A compute program of one entry point.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Module-scope constants with their values.
    pub constants: Vec<(Type, Vec<u32>)>,
    /// Private variables with their initial values.
    pub private: Vec<(Type, Vec<u32>)>,
    /// Workgroup variables.
    pub workgroup: Vec<Workgroup>,
    /// Functions.
    pub routines: Vec<Routine>,
    /// The entry point.
    pub main: Block,
    /// One more than the largest name in the entry point.
    pub names: usize,
    /// Results of each invocation.
    pub slots: usize,
    /// Invocations of a workgroup along each axis.
    pub size: [u32; 3],
    /// Workgroups along each axis.
    pub groups: [u32; 3],
    /// What `data` holds.
    pub data: Vec<u32>,
    /// The bits of what `reals` holds.
    pub reals: Vec<u32>,
    /// Whether it may shift by 32 and more. WGSL takes the amount modulo 32;
    /// naga 30 leaves that out of the SPIR-V, where such a shift is undefined.
    pub interpreter_only: bool,
}

/// What may be done to a counter while many invocations update it, so that
/// their order makes no difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Additions and subtractions.
    Sum,
    /// `atomicMin`.
    Min,
    /// `atomicMax`.
    Max,
    /// `atomicAnd`.
    And,
    /// `atomicOr`.
    Or,
    /// `atomicXor`.
    Xor,
    /// [`Stmt::Ticket`] draws from it.
    Tickets,
}

/// The rules of the elements of each of the two buffers of tallies, for the
/// whole program: no barrier separates workgroups.
pub const TALLY_RULES: [Rule; 7] = [
    Rule::Sum,
    Rule::Min,
    Rule::Max,
    Rule::And,
    Rule::Or,
    Rule::Xor,
    Rule::Tickets,
];

impl Rule {
    /// What a tally starts with: what every update can change.
    #[must_use]
    pub const fn start(self, scalar: Scalar) -> u32 {
        match (self, scalar) {
            (Self::Min, Scalar::I32) => i32::MAX as u32,
            (Self::Max, Scalar::I32) => i32::MIN as u32,
            (Self::Min | Self::And, _) => u32::MAX,
            _ => 0,
        }
    }

    /// The operations it allows.
    #[must_use]
    pub const fn operations(self) -> &'static [Atomic] {
        match self {
            Self::Sum => &[Atomic::Add, Atomic::Sub],
            Self::Min => &[Atomic::Min],
            Self::Max => &[Atomic::Max],
            Self::And => &[Atomic::And],
            Self::Or => &[Atomic::Or],
            Self::Xor => &[Atomic::Xor],
            Self::Tickets => &[],
        }
    }
}

impl Program {
    /// Invocations of a workgroup.
    #[must_use]
    pub fn lanes(&self) -> u32 {
        self.size.iter().product()
    }

    /// Invocations of all workgroups.
    #[must_use]
    pub fn invocations(&self) -> u32 {
        self.lanes() * self.groups.iter().product::<u32>()
    }
}

impl Expr {
    /// A literal of a scalar type.
    #[must_use]
    pub fn literal(scalar: Scalar, bits: u32) -> Self {
        Self {
            ty: Type::Scalar(scalar),
            kind: ExprKind::Literal(bits),
        }
    }

    /// The zero value of a type.
    #[must_use]
    pub fn zero(ty: Type) -> Self {
        match ty {
            Type::Scalar(scalar) => Self::literal(scalar, 0),
            ty => Self {
                ty,
                kind: ExprKind::Zero,
            },
        }
    }

    /// Whether it is a constant expression, computed when the shader is made.
    /// What would overflow there is an error rather than a value.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        let all = |parts: &[Self]| parts.iter().all(Self::is_constant);
        match &self.kind {
            ExprKind::Literal(_) | ExprKind::Zero | ExprKind::Constant(_) => true,
            ExprKind::Unary(_, a)
            | ExprKind::Convert(a)
            | ExprKind::Bitcast(a)
            | ExprKind::Swizzle(a, _)
            | ExprKind::Member(a, _) => a.is_constant(),
            ExprKind::Binary(_, a, b) | ExprKind::Index(a, b) => a.is_constant() && b.is_constant(),
            ExprKind::Function(_, parts) | ExprKind::Construct(parts) => all(parts),
            _ => false,
        }
    }
}

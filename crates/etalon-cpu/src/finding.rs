//! What a GPU hides and the interpreter can report.

use std::fmt;

use crate::error::{Location, triple};

/// What a program watches for while it runs. Each costs time where it is on and
/// nothing where it is off: a program is translated with the checks it is to
/// make, see [`crate::TranslateOptions`].
///
/// Checks never change what a kernel computes. What WGSL defines for the cases
/// they report is still what happens: an index outside of an array is brought
/// into it, division by zero gives the dividend, and so on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Checks {
    /// Reads and writes out of bounds (WGSL, "Out-of-Bounds Access"): of arrays,
    /// vectors and matrices, and of textures with their levels and layers. Levels
    /// of detail of samples are clamped by definition and are no findings; layers are.
    pub bounds: bool,
    /// Reads of memory that nothing wrote: workgroup memory, and arrays of
    /// functions and `var<private>` without an initial value, both of which WGSL
    /// fills with zeros ("Zero Value"); and words and texels of [`crate::Buffer::unwritten`] and
    /// [`crate::Texture::unwritten`], which hold anything on a GPU. Of filtered
    /// reads those with offsets, derivatives or clamped coordinates are not looked into.
    pub uninitialised: bool,
    /// Two invocations of a workgroup use a word of workgroup or storage memory, or
    /// a texel of a storage texture, one of them writing it other than by an atomic
    /// operation, and no barrier for that memory is between ("Memory Model").
    pub races: bool,
    /// Barriers that only some invocations of a workgroup reach ("Uniformity"). They
    /// are reported instead of failing the dispatch; those that are there go on.
    pub barriers: bool,
    /// Loops that go past [`crate::Executor::with_max_trips`]. They are left and
    /// reported instead of failing the dispatch.
    pub loops: bool,
    /// Integer division and remainder by zero, and of the most negative number by
    /// -1 ("Arithmetic Expressions").
    pub division: bool,
    /// Shifts by the bit width or more ("Bit Expressions").
    pub shifts: bool,
    /// Conversions to an integer of numbers outside of its range, and of NaN
    /// ("Floating Point Conversion").
    pub conversions: bool,
    /// Expressions that make a NaN or an infinity of finite operands ("Floating
    /// Point Evaluation").
    pub non_finite: bool,
}

impl Checks {
    /// No checks.
    pub const NONE: Self = Self {
        bounds: false,
        uninitialised: false,
        races: false,
        barriers: false,
        loops: false,
        division: false,
        shifts: false,
        conversions: false,
        non_finite: false,
    };

    /// Every check.
    #[must_use]
    pub const fn all() -> Self {
        Self {
            bounds: true,
            uninitialised: true,
            races: true,
            barriers: true,
            loops: true,
            division: true,
            shifts: true,
            conversions: true,
            non_finite: true,
        }
    }

    /// Whether any check is on.
    #[must_use]
    pub fn any(self) -> bool {
        self != Self::NONE
    }
}

/// What kind of thing a [`Finding`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum FindingKind {
    /// An index outside of an array, vector or matrix.
    Index,
    /// Coordinates outside of a texture's level.
    Texel,
    /// A level that a texture does not have.
    Level,
    /// A layer that a texture does not have.
    Layer,
    /// A read of memory that nothing wrote.
    Uninitialised,
    /// A data race within a workgroup.
    Race,
    /// A barrier in control flow that differs within a workgroup.
    DivergentBarrier,
    /// A loop that did not end.
    EndlessLoop,
    /// Integer division or remainder by zero.
    DivisionByZero,
    /// The most negative integer divided by -1.
    DivisionOverflow,
    /// A shift by the bit width or more.
    Shift,
    /// A conversion to an integer type that does not have the number.
    Conversion,
    /// A NaN or infinity from finite operands.
    NonFinite,
}

/// One place of a kernel at which something was found.
///
/// Which workgroup and invocation is named does not depend on threads, lanes or
/// the instruction set: it is the lowest workgroup, z before y before x, and in
/// it the lowest invocation, in the order of `local_invocation_index`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was found.
    pub kind: FindingKind,
    /// Where in the kernel's source: the start of the expression or statement. For
    /// a local variable that is read as a whole, its declaration.
    pub location: Location,
    /// What was wrong, with the values that the named invocation had.
    pub message: String,
    /// `workgroup_id` of the first that did it.
    pub workgroup: [u32; 3],
    /// `local_invocation_id` of the first that did it.
    pub invocation: [u32; 3],
    /// How often it happened in all: times that an invocation evaluated the place
    /// so. For words of buffers that nothing wrote, words; for barriers,
    /// invocations that were missing.
    pub count: u64,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {} (workgroup {}, invocation {}",
            self.location,
            self.message,
            triple(&self.workgroup),
            triple(&self.invocation)
        )?;
        match self.count {
            0 | 1 => f.write_str(")"),
            count => write!(f, ", and {} more)", count - 1),
        }
    }
}

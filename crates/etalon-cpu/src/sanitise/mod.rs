//! The numerical sanitiser: what rounding does to a kernel, line by line.
//!
//! A program translated with [`TranslateOptions::sanitise`] and run by an
//! [`Executor`] in [`NumberType::Shadow`] computes everything twice: in `f32`, which
//! decides, and in `f64` beside it. Of every operation it notes how far the two have
//! come apart, how much of that the operation itself introduced and how much it was
//! given, where digits cancelled, where NaN and infinity are born, passed on and
//! lost, and where the `f64` twin would have decided otherwise: a comparison that
//! turns out differently, another integer and with it another texel, level or bin.
//!
//! The method is that of NSan (C. Courbet, "NSan: A Floating-Point Numerical
//! Sanitizer", 2021) for the shadow and the thresholds, of Herbgrind (A. Sanchez-Stern
//! et al., 2018) for what is introduced and what inherited, and of FlowFPX (X. Li et
//! al., 2024) for where exceptional values are born and die.
//!
//! Once an invocation has decided otherwise than its twin, the twin answers another
//! question: what is found of it after that is counted apart
//! ([`Site::after_divergence`]) and in no other number of the report.
//!
//! Resources without a wide plane start every program from the `f32` in them, so that
//! a kernel is judged by what it does with what it is given. `f64` is not exact: what
//! loses over 29 bits more than `f32` has cannot be told apart.
//!
//! [`TranslateOptions::sanitise`]: crate::TranslateOptions::sanitise
//! [`Executor`]: crate::Executor
//! [`NumberType::Shadow`]: crate::NumberType::Shadow

mod gather;

use std::fmt;

pub(crate) use gather::Probes;

use crate::error::Location;

/// Relative error that shows in a picture of 16-bit floats: a unit in the last of
/// their 11 digits.
pub const VISIBLE: f64 = 1.0 / 2048.0;

/// Relative error worth a look: NSan's threshold, 2⁻¹⁹.
pub const NOTABLE: f64 = 1.0 / 524_288.0;

/// Of how many executions one that loses digits is a fault, see [`Site::loses_often`].
pub const OFTEN: u64 = 256;

/// What is followed at a [`Site`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Arithmetic whose result is a number.
    Arithmetic,
    /// A comparison of numbers.
    Comparison,
    /// Rounding to an integer, of either kind of number.
    Index,
    /// A texel or word that is written, or the colour that a fragment gives.
    Store,
}

/// A number of an invocation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// `global_invocation_id`; of fragments the pixel, of vertices their number among
    /// those that a draw gives to the kernel, instance by instance.
    pub invocation: [u32; 3],
    /// What was computed.
    pub value: f32,
    /// What it would have been in `f64`.
    pub exact: f64,
}

/// How often something happened, and which invocation did it first: the lowest by
/// `global_invocation_id`, z before y before x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// Times that an invocation did it.
    pub times: u64,
    /// The first; of no meaning if there is none.
    pub first: Worst,
}

/// What was found at one operation of a kernel.
///
/// Errors are of invocations that have not decided otherwise than their twins, see
/// the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Where in the source.
    pub location: Location,
    /// The operation, as [`Program`](crate::Program) lists it.
    pub operation: String,
    /// What is followed.
    pub role: Role,
    /// Times that an invocation evaluated it.
    pub executions: u64,
    /// How many of those had decided otherwise than their twin before.
    pub after_divergence: u64,
    /// The largest error in units in the last place of the exact result.
    pub max_ulps: f64,
    /// What 99 % of errors are at most, in the same units: a bound that is less than
    /// √2 too large.
    pub p99_ulps: f64,
    /// The largest relative error: relative to the larger of the two results, or to the
    /// least normal number if that is more. At a store relative to what the format can tell
    /// apart, if that is more: see [`Site::floor`].
    pub max_relative: f64,
    /// Where that was.
    pub worst: Worst,
    /// The largest error that the operation itself made, in units in the last place:
    /// its result against that of `f64` on the same `f32` operands.
    pub introduced_ulps: f64,
    /// Executions whose relative error is above [`VISIBLE`] and over four times that of
    /// each operand: here the digits were lost.
    pub lost: Count,
    /// The most leading bits that cancelled in a sum or difference of operands that
    /// carry an error.
    pub cancelled_bits: u32,
    /// NaN or infinity from finite operands.
    pub births: Count,
    /// NaN or infinity from such.
    pub propagated: u64,
    /// A finite result, or a decision, from NaN or infinity.
    pub deaths: Count,
    /// The twin would have decided otherwise.
    pub unstable: Count,
    /// The largest distance between what was decided on, relative to the larger of
    /// the two, when the twin would have decided otherwise.
    pub unstable_margin: f64,
    /// Of stores: the largest number written, over the largest that the format has.
    pub of_range: f64,
    /// Of stores: numbers below the least normal one of the format that are not 0.
    pub subnormal: u64,
    /// Of stores: magnitudes below this count as this in relative errors: the least
    /// normal number of 16-bit and smaller floats, 2⁻²¹ for 32-bit floats, the whole
    /// range for formats of fixed point.
    pub floor: f64,
    /// Of each invocation of the dispatch the largest error, by place in
    /// [`Sanitised::grid`]: eighths of bits that are wrong, so 192 for all of an
    /// `f32`, [`HEAT_UNSTABLE`] or [`HEAT_BIRTH`]. Empty if there is no room.
    pub heat: Vec<u8>,
}

/// In [`Site::heat`]: the twin would have decided otherwise.
pub const HEAT_UNSTABLE: u8 = 254;
/// In [`Site::heat`]: a NaN or infinity was born.
pub const HEAT_BIRTH: u8 = 255;

/// Most bytes of all [`Site::heat`] of a dispatch.
pub const HEAT_LIMIT: u64 = 1 << 28;

/// What was found in a dispatch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sanitised {
    /// In the order of the source. The same at any number of threads and lanes and on
    /// any instruction set.
    pub sites: Vec<Site>,
    /// Invocations along x and, those of y and z together, y; of fragments the size of
    /// the targets, of vertices 0.
    pub grid: [u32; 2],
    /// Which invocations have decided otherwise than their twins at some time, by
    /// place in the grid. Empty if there is no room.
    pub diverged: Vec<bool>,
}

/// What is wrong at a site.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// A NaN or infinity is born.
    Birth,
    /// A value is written whose relative error is above [`VISIBLE`].
    Inaccurate,
    /// A sum or difference that is far less accurate than its operands, and that
    /// not only where it happens to be next to 0: see [`Site::loses_often`].
    Cancellation,
    /// Another operation that often is.
    Amplification,
    /// A comparison that turns out otherwise in `f64`.
    UnstableBranch,
    /// An integer that is another one in `f64`.
    UnstableIndex,
    /// A NaN or infinity ends here without a trace.
    Death,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Birth,
        Self::Inaccurate,
        Self::Cancellation,
        Self::Amplification,
        Self::UnstableBranch,
        Self::UnstableIndex,
        Self::Death,
    ];

    /// The name by which a comment in a kernel allows it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Birth => "birth",
            Self::Inaccurate => "inaccurate",
            Self::Cancellation => "cancellation",
            Self::Amplification => "amplification",
            Self::UnstableBranch => "unstable-branch",
            Self::UnstableIndex => "unstable-index",
            Self::Death => "death",
        }
    }

    /// Whether a kernel must not have it, rather than only be looked at for it.
    #[must_use]
    pub const fn is_error(self) -> bool {
        matches!(self, Self::Birth | Self::Inaccurate)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Site {
    /// What is wrong here, the worst first, and how often.
    #[must_use]
    pub fn faults(&self) -> Vec<(Fault, Count)> {
        let mut faults = Vec::new();
        let mut fault = |fault, count: Count| {
            if count.times > 0 {
                faults.push((fault, count));
            }
        };
        fault(Fault::Birth, self.births);
        let unstable = match self.role {
            Role::Comparison => Fault::UnstableBranch,
            _ => Fault::UnstableIndex,
        };
        let lost = match self.role {
            Role::Store => Fault::Inaccurate,
            _ if matches!(self.operation.as_str(), "add.f" | "sub.f") => Fault::Cancellation,
            _ => Fault::Amplification,
        };
        if self.role == Role::Store || self.loses_often() {
            fault(lost, self.lost);
        }
        fault(unstable, self.unstable);
        fault(Fault::Death, self.deaths);
        faults
    }

    /// Whether digits are lost here by rule rather than by chance: in more than one
    /// execution of [`OFTEN`]. A difference that passes through zero loses the digits
    /// that [`VISIBLE`] asks for where it is within 2⁻¹³ of its operands, which is one of
    /// some thousand where it is spread evenly.
    #[must_use]
    pub fn loses_often(&self) -> bool {
        let counted = self.executions - self.after_divergence.min(self.executions);
        self.lost.times > counted / OFTEN
    }

    /// Bits of the largest error: the logarithm of units in the last place, from 1
    /// for one unit.
    #[must_use]
    pub fn max_bits(&self) -> f64 {
        (1.0 + self.max_ulps).log2()
    }
}

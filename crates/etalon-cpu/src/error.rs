//! Typed errors.

use std::fmt;

use thiserror::Error;

/// A place in a kernel's source.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Location {
    /// The file, or the kernel's name.
    pub file: String,
    /// Line, from 1; 0 when unknown.
    pub line: u32,
    /// Column, from 1; 0 when unknown.
    pub column: u32,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// Why a kernel cannot be made into a program.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TranslateError {
    /// The kernel uses something the interpreter does not have.
    #[error("{location}: the CPU backend does not support {construct}")]
    Unsupported {
        /// What it is, in WGSL's terms.
        construct: String,
        /// Where it is used.
        location: Location,
    },
    /// The module has no compute entry point of the name.
    #[error("{name}: no compute entry point `{entry_point}`")]
    NoEntryPoint {
        /// The kernel.
        name: String,
        /// As asked for.
        entry_point: String,
    },
    /// The kernel needs more registers, instructions or memory than the
    /// bytecode can address.
    #[error("{name}: {what} is {size}, more than the interpreter's {limit}")]
    TooLarge {
        /// The kernel.
        name: String,
        /// Which limit.
        what: &'static str,
        /// As needed.
        size: u64,
        /// As possible.
        limit: u64,
    },
    /// The module breaks a rule that validation should have caught.
    #[error("{location}: invalid module: {what}")]
    Invalid {
        /// Which rule.
        what: String,
        /// Where.
        location: Location,
    },
}

/// As an identifier is written in messages.
pub(crate) fn triple([x, y, z]: &[u32; 3]) -> String {
    format!("({x},{y},{z})")
}

/// Why a dispatch failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RunError {
    /// A loop did not end within the limit.
    #[error(
        "{location}: a loop of kernel {kernel} ran {limit} times without ending (workgroup {}, invocation {})",
        triple(workgroup),
        triple(invocation)
    )]
    EndlessLoop {
        /// The kernel.
        kernel: String,
        /// The loop.
        location: Location,
        /// The limit.
        limit: u32,
        /// `workgroup_id` of the first workgroup that it happened in.
        workgroup: [u32; 3],
        /// `local_invocation_id` of the first invocation that was still in the loop.
        invocation: [u32; 3],
    },
    /// A barrier was reached by a part of a workgroup only.
    #[error(
        "{location}: a barrier of kernel {kernel} is in control flow that differs within a workgroup (workgroup {}, without invocation {})",
        triple(workgroup),
        triple(invocation)
    )]
    DivergentBarrier {
        /// The kernel.
        kernel: String,
        /// The barrier.
        location: Location,
        /// `workgroup_id` of the first workgroup that it happened in.
        workgroup: [u32; 3],
        /// `local_invocation_id` of the first invocation that did not reach it.
        invocation: [u32; 3],
    },
    /// Nothing, or the wrong kind of thing, is bound.
    #[error("kernel {kernel}: `{binding}` needs {expected}, but {found} is bound")]
    Binding {
        /// The kernel.
        kernel: String,
        /// The variable's name.
        binding: String,
        /// As the kernel declares it.
        expected: String,
        /// As given.
        found: String,
    },
    /// More workgroups than can be counted.
    #[error("kernel {kernel}: {x}×{y}×{z} workgroups are too many")]
    TooManyWorkgroups {
        /// The kernel.
        kernel: String,
        /// Workgroups in x.
        x: u32,
        /// Workgroups in y.
        y: u32,
        /// Workgroups in z.
        z: u32,
    },
    /// Worker threads cannot be had.
    #[error("no worker threads: {reason}")]
    Threads {
        /// What the system says.
        reason: String,
    },
    /// Memory for a resource or the interpreter's registers cannot be had.
    #[error("out of memory: {bytes} bytes for {what}")]
    OutOfMemory {
        /// What it was for.
        what: String,
        /// How much.
        bytes: u64,
    },
}

//! What can be wrong with a graph when it is planned.

use thiserror::Error;

use crate::kernel::KernelError;
use crate::resource::ResourceError;

/// Why a graph cannot be planned.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A description is impossible or over the device's limits.
    #[error("`{resource}`: {error}")]
    Resource {
        /// The resource.
        resource: String,
        /// What is wrong with it.
        error: ResourceError,
    },
    /// A kernel does not compile.
    #[error("pass `{pass}`: {error}")]
    Kernel {
        /// The pass that needs it.
        pass: String,
        /// What is wrong, with file, line and column.
        #[source]
        error: Box<KernelError>,
    },
    /// The declaration of a pass and its kernel disagree.
    #[error("pass `{pass}` and kernel `{kernel}`: {mismatch}")]
    Mismatch {
        /// The pass.
        pass: String,
        /// The kernel.
        kernel: String,
        /// On what.
        mismatch: Mismatch,
    },
    /// A dispatch over the device's limits.
    #[error(
        "pass `{pass}` asks for {groups:?} workgroups, over the device's limit of {limit} in one dimension"
    )]
    TooManyGroups {
        /// The pass.
        pass: String,
        /// As asked.
        groups: [u32; 3],
        /// As possible.
        limit: u32,
    },
    /// Something reads the last frame's contents of a history that this frame leaves unwritten.
    #[error(
        "history `{history}` is read, so all of its `current` must be written for the next frame"
    )]
    HistoryNotWritten {
        /// The history.
        history: String,
    },
    /// An output would be gone by the end.
    #[error(
        "output `{output}` is a version of `{resource}` that pass `{by}` writes over; copy it first"
    )]
    OutputOverwritten {
        /// The output.
        output: String,
        /// The resource.
        resource: String,
        /// Who writes over it.
        by: String,
    },
    /// Every order would have some pass read contents that are gone.
    #[error("these passes wait for each other, because one reads a version that another has written over: {}", passes.join(" → "))]
    Cycle {
        /// The passes.
        passes: Vec<String>,
    },
    /// The transient resources together are larger than 2⁶⁴ bytes.
    #[error("the transient resources need more memory than can be counted")]
    OutOfRange,
}

/// How the declaration of a pass and its kernel can disagree.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Mismatch {
    /// The pass gives something the kernel has not.
    #[error("the pass gives {what} `{name}`, the kernel has none of that name; it has {has}")]
    NotInKernel {
        /// Kind of thing.
        what: &'static str,
        /// Its name.
        name: String,
        /// What the kernel has.
        has: String,
    },
    /// The kernel wants something the pass does not give.
    #[error("the kernel wants {what} `{name}`, which the pass does not give")]
    NotInPass {
        /// Kind of thing.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// Both have it, as different things.
    #[error("`{name}`: the pass gives {given}, the kernel wants {wanted}")]
    Differs {
        /// The binding or uniform member.
        name: String,
        /// As the pass has it.
        given: String,
        /// As the kernel has it.
        wanted: String,
    },
}

//! Why a draw is refused or fails.

use etalon_core::Format;
use etalon_core::raster::{RasterStateError, VertexLayoutError};
use thiserror::Error;

use crate::error::{Location, RunError, TranslateError};

/// Why a raster program cannot be made, or a draw fails.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RasterError {
    /// One of the kernels cannot be translated.
    #[error(transparent)]
    Translate(#[from] TranslateError),
    /// The state does not fit the pass, or the viewport or scissor the targets.
    #[error("{name}: {error}")]
    State {
        /// The program.
        name: String,
        /// What is wrong.
        error: RasterStateError,
    },
    /// A vertex layout that devices cannot read.
    #[error("{name}: vertex buffer {buffer}: {error}")]
    Layout {
        /// The program.
        name: String,
        /// The layout's place in the list.
        buffer: usize,
        /// What is wrong.
        error: VertexLayoutError,
    },
    /// An input or output that does not fit what is on its other side.
    #[error("{name}: {what} is {found}; it must be {expected}")]
    Interface {
        /// The program.
        name: String,
        /// Which input or output.
        what: String,
        /// What would be right.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A target's format that cannot be drawn to as the state says.
    #[error("{name}: {what} has the format {format}, which cannot be {purpose}")]
    Format {
        /// The program.
        name: String,
        /// Which target.
        what: String,
        /// Its format.
        format: Format,
        /// What for.
        purpose: &'static str,
    },
    /// Something given to a draw is not as it must be.
    #[error("{name}: {what} is {found}; it must be {expected}")]
    Draw {
        /// The program.
        name: String,
        /// Which of the draw's inputs.
        what: String,
        /// What would be right.
        expected: String,
        /// As given.
        found: String,
    },
    /// A loop did not end within the executor's limit.
    #[error("{location}: a loop of {name} ran {limit} times without ending")]
    EndlessLoop {
        /// The program.
        name: String,
        /// The loop.
        location: Location,
        /// The limit.
        limit: u32,
    },
    /// What goes wrong for every program: bindings, memory.
    #[error(transparent)]
    Run(#[from] RunError),
}

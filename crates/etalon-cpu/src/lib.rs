//! CPU backend of Etalon: kernels as bytecode over wide lanes.
//!
//! A kernel's naga module is [translated](Program::from_module) into a tree of
//! scalar instructions, lowered to blocks of bytecode, and run by an
//! [`Executor`]: all invocations of a workgroup, or of several, together, one
//! instruction at a time, each over many lanes with vector instructions. What is the same in all
//! invocations is computed once. Where invocations part ways, both ways are run
//! under a mask.
//!
//! Arithmetic is IEEE 754 binary32 without fused operations and with
//! subnormals, so results of `+ - * / sqrt` and of what is made from them are
//! exactly those of strict devices. They do not depend on the instruction set
//! or the number of threads, save for the payload of NaNs. [`semantics`] says
//! operation by operation what is computed.
//!
//! A program can be translated with [`Checks`]: then it reports what a GPU hides,
//! from accesses out of bounds to data races, at its place in the source. Without
//! them its code has no trace of that.

#![deny(unsafe_code)]

mod backend;
mod binding;
mod code;
mod error;
mod exec;
mod finding;
mod ir;
mod lower;
mod memory;
mod num;
mod program;
mod raster;
mod registers;
pub mod semantics;

mod report;
pub mod sanitise;
mod translate;

pub use backend::{
    CpuBackend, CpuOptions, Findings, StepFinding, StepSanitised, WideCapture, WideExecution,
};
pub use binding::{BindingInfo, BindingKind, ChannelKind, View};
pub use error::{Location, RunError, TranslateError};
pub use exec::{Cost, DispatchCounters, Executor, Profile, ProfiledInstruction, Tier};
pub use finding::{Checks, Finding, FindingKind};
pub use memory::{Buffer, Texture, TextureView};
pub use num::NumberType;
pub use program::{BoundResource, DispatchReport, Program, TranslateOptions};
pub use raster::{
    DrawCounters, DrawRange, DrawReport, DrawSanitised, IndexBuffer, RasterDesc, RasterDraw,
    RasterError, RasterProgram, VertexBuffer,
};

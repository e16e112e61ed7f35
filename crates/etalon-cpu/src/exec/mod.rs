//! Running bytecode.
//!
//! A worker holds a [`State`]: register files of lanes, and where in the
//! dispatch it is. Each instruction has a handler, a function that is generic
//! over the number type and compiled once per instruction set; a program is
//! linked to the handlers of one set and then is a list of calls.

// Loops over lanes index several arrays of lanes alike.
#![allow(clippy::needless_range_loop)]

mod arith;
mod chain;
mod check;
mod dispatch;
#[allow(unsafe_code)]
mod formats;
mod fused;
mod half;
mod image;
#[allow(unsafe_code)]
mod isa;
#[allow(unsafe_code)]
mod lanes;
mod link;
mod links;
mod memory;
mod perturb;
mod probe;
mod profile;
mod sample;
mod stage;
mod state;
mod subgroup;
mod texel_atomic;
#[allow(unsafe_code)]
mod texels;
#[allow(unsafe_code)]
mod tier;
mod wide;

pub use dispatch::{DispatchCounters, Executor};
pub use profile::{Cost, Profile, ProfiledInstruction};
pub use tier::Tier;

pub(crate) use check::{Detail, Found, Part, Shadow, Site};
pub(crate) use dispatch::{DispatchFailure, Job};
pub(crate) use fused::Fused;
pub(crate) use isa::Isa;
pub(crate) use lanes::Operands;
pub(crate) use link::Linked;
pub(crate) use links::Links;
pub(crate) use probe::{Heat, Tally};
pub(crate) use profile::Recording;
pub(crate) use stage::{Stage, StageFailure, StageKernel, StageWatch};
pub(crate) use state::{Failure, LocalIds, Resource};
pub(crate) use texels::{OUTSIDE, fetch, put};
pub(crate) use tier::{Work, work};

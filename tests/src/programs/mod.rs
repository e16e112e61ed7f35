//! Random compute programs, and what they should compute.
//!
//! ```text
//! seed, or a fuzzer's bytes ─ choices ─ generate ─> Program ─ Display ─> WGSL ─> interpreter, wgpu, ash
//!                                                      └───── evaluate ─> Results, one invocation at a time
//! ```
//!
//! Results have to be equal bit for bit, but for what WGSL §15.7.2 leaves free:
//! the payload of a NaN, and on devices whether subnormal numbers are zeros and
//! the sign of a zero ([`Held`]). Where a program lets such a freedom decide
//! something, its results are [`Open`] and bind no device; the interpreter's
//! tiers still have to agree. Where it does what a driver is known to do
//! otherwise at times, another result of that driver is no news ([`may_differ`]).
//!
//! [`shrink`] takes a program that goes wrong apart until nothing can be left
//! out.

mod arithmetic;
mod choices;
mod evaluate;
mod execute;
mod generate;
mod grammar;
mod interpreter;
mod known;
mod print;
mod shrink;
mod trial;

pub use arithmetic::Open;
pub use choices::Choices;
pub use evaluate::{Evaluation, Malformed, Results, Risks, evaluate};
pub use execute::{Difference, ExecuteError, Held, differences, execute};
pub use generate::{STEPS, generate, of_seed};
pub use grammar::*;
pub use interpreter::Interpreters;
pub use known::{binds_devices, may_differ};
pub use shrink::{Shrunk, shrink, size, statements};
pub use trial::{ParseTrialError, Trial};

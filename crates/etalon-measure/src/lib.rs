//! Measures the interpreter.
//!
//! * [`work`]: what one kernel does within an effect, cut out of the effect's
//!   plan so that it can be run alone, as often as wanted, on any backend.
//! * [`subjects`]: which kernels are measured: those of all effects, and a few
//!   that do one thing only.
//! * [`compare`]: the interpreter and a Vulkan driver side by side.
//! * [`count`]: work whose instructions are counted.
//! * [`profile`]: where the interpreter's time goes.

#![forbid(unsafe_code)]

pub mod clock;
pub mod compare;
pub mod count;
pub mod profile;
pub mod subjects;
pub mod table;
pub mod work;

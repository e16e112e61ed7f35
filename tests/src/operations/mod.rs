//! Every operation of WGSL on numbers, held to the specification.
//!
//! For each operator and built-in function there is a table of ordinary and
//! special inputs ([`inputs`]) and a kernel ([`kernel`]). Executors run it as
//! users run kernels, by graph and plan ([`run`]). What may come out is derived
//! from WGSL's accuracy table ([`accuracy`], [`formulas`]) and from real
//! arithmetic in about 100 bits ([`exact`]), neither of which shares code with
//! the interpreter. [`judge`] holds every result to it:
//!
//! * every executor to WGSL: the accuracy of §15.7.4, with what §15.7.2 leaves
//!   open (subnormal numbers flushed, the sign of zeros, anything after overflow,
//!   infinity or NaN);
//! * the interpreter to its own semantics too: IEEE 754, rounded to the nearest
//!   even, nothing flushed, bit for bit, where WGSL says "correctly rounded";
//! * under strict arithmetic every executor to the interpreter, bit for bit,
//!   flushed numbers aside.
//!
//! What a driver is known to do otherwise is in the table of [`exceptions`].

pub mod accuracy;
pub mod exact;
pub mod exceptions;
pub mod float;
pub mod formulas;
pub mod inputs;
pub mod interval;
pub mod judge;
pub mod kernel;
pub mod operation;
pub mod report;
pub mod run;
pub mod table;

//! What accuracy costs in time.
//!
//! An effect's knobs are turned through their ladders; of every setting the error
//! against independent truths, the time on every backend and the work in counters
//! that depend on no hardware are kept, and drawn as charts to decide from.
//!
//! * [`model`]: what a sweep found, as data.

#![forbid(unsafe_code)]

pub mod model;

//! What accuracy costs in time.
//!
//! An effect's knobs are turned through their ladders; of every setting the error
//! against independent truths, the time on every backend and the work in counters
//! that depend on no hardware are kept, and drawn as charts to decide from.
//!
//! * [`model`]: what a sweep found, as data;
//! * [`metric`]: measures of error;
//! * [`front`]: what costs least for its error;
//! * [`chart`]: error against time, drawn;
//! * [`report`]: the charts with all about every point, as a web page and a table.

#![forbid(unsafe_code)]

pub mod chart;
pub mod front;
pub mod metric;
pub mod model;
pub mod report;
mod text;

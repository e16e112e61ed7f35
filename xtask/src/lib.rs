//! Everything a developer or CI runs.

#![forbid(unsafe_code)]

pub mod compare;
pub mod drivers;
pub mod setup;

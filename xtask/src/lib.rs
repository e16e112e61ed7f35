//! Everything a developer or CI runs.

#![forbid(unsafe_code)]

pub mod compare;

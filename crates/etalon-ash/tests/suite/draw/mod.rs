//! Drawing.

mod engine;
mod plans;
mod sources;

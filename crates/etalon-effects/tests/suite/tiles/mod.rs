//! Effects on tiles, held against the same effects on the whole picture, and lists of
//! tiles against their definition.

mod lists;
mod quarter;
mod reflection;

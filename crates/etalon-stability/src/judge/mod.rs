//! What is asked of the results, a module for each question.

pub mod agreement;
pub mod drawn;
pub mod finite;
pub mod recovery;
mod reflection;
pub mod rounding;
pub mod scale;
pub mod spread;
pub mod truth;

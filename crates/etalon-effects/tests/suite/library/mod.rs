//! The shared functions of the shaders.

mod guards;
mod math;
mod storage;

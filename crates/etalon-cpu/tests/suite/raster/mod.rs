//! Rasterising.

mod coverage;
mod input;
mod interpolation;
mod kernels;
mod output;
mod robust;
mod sanitise;

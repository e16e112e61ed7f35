//! The interpreter against what WGSL says: values, memory, textures, checks,
//! rasterising, number types, and the instruments built on it.

mod arithmetic;
mod backend;
mod checks;
mod common;
mod effects;
mod features;
mod half;
mod half_bits;
mod images;
mod known_faults;
mod memory;
mod number_effects;
mod numbers;
mod perturb;
mod profile;
mod random_programs;
mod raster;
mod refused;
mod sampling;
mod sanitise;
mod subgroups;
mod superinstructions;

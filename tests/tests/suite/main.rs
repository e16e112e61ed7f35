//! What concerns several backends at once.

mod accuracy;
mod agreement;
mod bad_vertices;
mod counters;
mod demands;
mod economy;
mod environment;
mod forward;
mod fuzz;
mod geometry;
mod half;
mod hiz;
mod inputs;
mod lighting;
mod operations;
mod position;
mod probes;
mod programs;
mod shading;
mod tiles;

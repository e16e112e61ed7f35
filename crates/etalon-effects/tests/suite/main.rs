//! The effects on the interpreter: their pictures, truths, knobs and hard inputs.

mod bloom;
mod budget;
mod checks;
mod common;
mod composite;
mod demand;
mod environment;
mod exposure;
mod fast;
mod forward_plan;
mod geometry_plan;
mod hard_inputs;
mod hiz;
mod knobs;
mod library;
mod metamorphic;
mod plans;
mod probes;
mod settings;
mod ssr;
mod ssr_colour;
mod ssr_hard;
mod ssr_search;
mod tiles;
mod truth;

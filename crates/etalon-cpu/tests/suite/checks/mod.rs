//! What the interpreter reports and a GPU hides.

mod backend;
mod memory;
mod textures;
mod values;

//! OpenEXR files.

mod damage;
mod frames;
mod inputs;
mod names;

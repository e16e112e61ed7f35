//! glTF files.

mod damage;
mod files;
mod inputs;

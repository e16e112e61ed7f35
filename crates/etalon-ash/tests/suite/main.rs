//! Plans and drawing on Vulkan devices, and what is refused before one is asked.

mod common;
mod draw;
mod draws;
mod engine;
mod formats;
mod offline;
mod validation;

//! Textures and buffers that several workers can read and write at once.
//!
//! Memory is made of relaxed atomics of the texel's size: plain loads and
//! stores for the processor, and well defined when invocations race.

mod buffer;
mod srgb;
mod texel;
mod texture;
mod wide;
pub(crate) mod written;

pub use buffer::Buffer;
pub use texture::{Texture, TextureView};

pub(crate) use texel::{Channels, decode, encode, unorm8, unorm8_codes};
pub(crate) use texture::{Level, Texels};
pub(crate) use wide::{WideTexels, WideWords, in_range};

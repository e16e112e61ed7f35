//! Textures and buffers that are used again from one frame to the next.

use std::collections::BTreeMap;

use etalon_core::resource::TextureDesc;

use crate::error::RunError;
use crate::memory::{Buffer, Texture};

/// How many frames something is kept that no frame uses.
const KEPT_FRAMES: u64 = 4;

/// What has been made so far, and what is held now.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PoolCounters {
    pub(super) textures: u64,
    pub(super) buffers: u64,
    pub(super) bytes: u64,
}

/// Free resources by shape, each with the frame that used it last.
#[derive(Debug)]
pub(super) struct Pool {
    textures: BTreeMap<(Shape, bool), Vec<(u64, Texture)>>,
    buffers: BTreeMap<(u64, bool), Vec<(u64, Buffer)>>,
    /// Whether what is written needs a wide plane.
    wide: bool,
    frame: u64,
    counters: PoolCounters,
}

/// A [`TextureDesc`] that can be ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Shape(etalon_core::Format, u8, [u32; 4]);

fn shape(desc: &TextureDesc) -> Shape {
    Shape(
        desc.format,
        desc.dimension as u8,
        [
            desc.extent.width,
            desc.extent.height,
            desc.extent.depth_or_layers,
            desc.mips,
        ],
    )
}

impl Pool {
    pub(super) fn new(wide: bool) -> Self {
        Self {
            textures: BTreeMap::new(),
            buffers: BTreeMap::new(),
            wide,
            frame: 0,
            counters: PoolCounters::default(),
        }
    }

    pub(super) fn counters(&self) -> PoolCounters {
        self.counters
    }

    /// A texture with whatever it held last; `written` if passes write it.
    pub(super) fn texture(
        &mut self,
        desc: TextureDesc,
        written: bool,
    ) -> Result<Texture, RunError> {
        let wide = written && self.wide && Texture::can_be_wide(desc.format);
        let key = (shape(&desc), wide);
        if let Some((_, texture)) = self.textures.get_mut(&key).and_then(Vec::pop) {
            return Ok(texture);
        }
        let mut texture = Texture::zeroed(desc)?;
        if wide {
            texture = texture.widen()?;
        }
        self.counters.textures += 1;
        self.counters.bytes += texture.bytes();
        Ok(texture)
    }

    /// A buffer with whatever it held last; `written` if passes write it.
    pub(super) fn buffer(&mut self, bytes: u64, written: bool) -> Result<Buffer, RunError> {
        let wide = written && self.wide;
        let key = (bytes, wide);
        if let Some((_, buffer)) = self.buffers.get_mut(&key).and_then(Vec::pop) {
            return Ok(buffer);
        }
        let mut buffer = Buffer::zeroed(bytes)?;
        if wide {
            buffer = buffer.widen()?;
        }
        self.counters.buffers += 1;
        self.counters.bytes += buffer.held_bytes();
        Ok(buffer)
    }

    pub(super) fn return_texture(&mut self, texture: Texture) {
        self.textures
            .entry((shape(&texture.desc()), texture.is_wide()))
            .or_default()
            .push((self.frame, texture));
    }

    pub(super) fn return_buffer(&mut self, buffer: Buffer) {
        self.buffers
            .entry((buffer.len(), buffer.is_wide()))
            .or_default()
            .push((self.frame, buffer));
    }

    /// Frees what no frame has used for a while.
    pub(super) fn end_frame(&mut self) {
        let oldest = self.frame.saturating_sub(KEPT_FRAMES);
        let mut freed = 0;
        self.textures.retain(|_, list| {
            list.retain(|(used, texture)| {
                let keep = *used >= oldest;
                freed += if keep { 0 } else { texture.bytes() };
                keep
            });
            !list.is_empty()
        });
        self.buffers.retain(|_, list| {
            list.retain(|(used, buffer)| {
                let keep = *used >= oldest;
                freed += if keep { 0 } else { buffer.held_bytes() };
                keep
            });
            !list.is_empty()
        });
        self.counters.bytes -= freed.min(self.counters.bytes);
        self.frame += 1;
    }
}

//! What passes wrote.

use etalon_core::backend::{BackendError, CapturedData, Execution};
use etalon_core::image::ImageData;
use etalon_cpu::{WideCapture, WideExecution};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why nothing was seen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ObserveError {
    /// The plan cannot be run.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

/// What one pass wrote to one binding.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    /// The pass, or `output` for what the graph gives.
    pub pass: String,
    /// Its binding.
    pub binding: String,
    /// The texels; a buffer has none.
    pub image: Option<ImageData>,
    /// The same before it was rounded to the format, of an executor that computes
    /// in more digits. As many as the image has texels.
    pub wide: Option<Vec<[f64; 4]>>,
    /// The bytes of a buffer.
    pub buffer: Option<Vec<u8>>,
}

impl Store {
    /// A texel's place by its number.
    #[must_use]
    pub fn place(&self, frame: usize, index: usize, channel: usize) -> Place {
        let width = self
            .image
            .as_ref()
            .map_or(1, |image| image.desc.extent.width.max(1)) as usize;
        Place {
            frame,
            pass: self.pass.clone(),
            binding: self.binding.clone(),
            x: (index % width) as u32,
            y: (index / width) as u32,
            channel: channel as u32,
        }
    }

    /// The image's name among those of a frame.
    #[must_use]
    pub fn same_as(&self, other: &Self) -> bool {
        self.pass == other.pass && self.binding == other.binding
    }
}

/// A channel of a texel of what a pass wrote.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// Which frame of the case, from 0.
    pub frame: usize,
    /// The pass.
    pub pass: String,
    /// Its binding.
    pub binding: String,
    /// Column.
    pub x: u32,
    /// Row; rows of further layers and mips follow.
    pub y: u32,
    /// Channel, from 0.
    pub channel: u32,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, {} of texel ({}, {}), frame {}",
            self.pass,
            ["x", "y", "z", "w"][(self.channel & 3) as usize],
            self.x,
            self.y,
            self.frame
        )
    }
}

/// What an execution captured.
#[must_use]
pub fn stores(execution: Execution) -> Vec<Store> {
    execution
        .captures
        .into_iter()
        .map(|captured| {
            let (image, buffer) = match captured.data {
                CapturedData::Texture(image) => (Some(image), None),
                CapturedData::Buffer(bytes) => (None, Some(bytes)),
            };
            Store {
                pass: captured.pass,
                binding: captured.binding,
                image,
                wide: None,
                buffer,
            }
        })
        .collect()
}

/// The same with what an interpreter of more digits computed.
#[must_use]
pub fn wide_stores(wide: WideExecution) -> Vec<Store> {
    let mut found = stores(wide.execution);
    for (store, wide) in found.iter_mut().zip(wide.captures) {
        if let WideCapture::Texture(texels) = wide {
            store.wide = Some(texels);
        }
    }
    found
}

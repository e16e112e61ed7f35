//! What the steps of one run use.

use std::collections::BTreeMap;

use etalon_core::backend::{BackendError, Inputs};
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::plan::{Plan, ResourceKind};
use etalon_core::resource::TextureDesc;

use super::histories::Histories;
use super::pool::Pool;
use super::{malformed, step_error};
use crate::error::RunError;
use crate::memory::{Buffer, Texture, TextureView};

/// Where a resource of the plan is.
#[derive(Clone, Copy, Debug)]
enum Location {
    /// Index into [`Resources::textures`].
    Texture(usize),
    /// Index into [`Resources::buffers`].
    Buffer(usize),
    /// A texture of a history, by the history's index.
    History { index: u32, current: bool },
}

/// Textures and buffers taken from the pool for a run.
#[derive(Debug, Default)]
pub(super) struct Resources {
    textures: Vec<Texture>,
    buffers: Vec<Buffer>,
    locations: Vec<Location>,
    transient_bytes: u64,
}

fn out_of_memory(name: &str, error: RunError) -> BackendError {
    match error {
        RunError::OutOfMemory { bytes, .. } => BackendError::OutOfMemory {
            what: format!("`{name}`"),
            bytes,
        },
        other => step_error(name, other),
    }
}

fn describe(desc: &TextureDesc, bytes: usize) -> String {
    let size = desc.extent;
    format!(
        "a {:?} texture of {}×{}×{}, {} mips, {} ({bytes} bytes)",
        desc.dimension, size.width, size.height, size.depth_or_layers, desc.mips, desc.format
    )
}

impl Resources {
    /// Bytes behind the transients.
    pub(super) const fn transient_bytes(&self) -> u64 {
        self.transient_bytes
    }

    /// Gives every resource of the plan a place, and imports their contents. If
    /// `watched`, each has a place of its own and counts as unwritten until
    /// something writes it.
    pub(super) fn acquire(
        &mut self,
        plan: &Plan,
        inputs: &Inputs<'_>,
        pool: &mut Pool,
        watched: bool,
    ) -> Result<(), BackendError> {
        let mut slots = BTreeMap::new();
        for resource in &plan.resources {
            let name = &resource.name;
            let shared = match &resource.kind {
                ResourceKind::HistoryPrevious(index) => Some(Location::History {
                    index: *index,
                    current: false,
                }),
                ResourceKind::HistoryCurrent(index) => Some(Location::History {
                    index: *index,
                    current: true,
                }),
                ResourceKind::Transient(place) if !watched => slots.get(&place.slot).copied(),
                ResourceKind::Transient(_) => None,
                ResourceKind::Import(_) | ResourceKind::Output(_) => None,
            };
            if let Some(location) = shared {
                self.check_shape(location, &resource.desc)
                    .map_err(|what| malformed(name, what))?;
                self.locations.push(location);
                continue;
            }
            let import = if let ResourceKind::Import(import) = &resource.kind {
                Some(import.as_str())
            } else {
                None
            };
            let location = match &resource.desc {
                ResourceDesc::Texture(desc) => {
                    let contents = import
                        .map(|import| texture_input(import, desc, inputs))
                        .transpose()?;
                    let mut texture = pool
                        .texture(*desc, import.is_none())
                        .map_err(|error| out_of_memory(name, error))?;
                    if watched {
                        texture
                            .forget()
                            .map_err(|error| out_of_memory(name, error))?;
                    }
                    if let Some(contents) = contents {
                        texture.write(contents);
                    }
                    self.textures.push(texture);
                    Location::Texture(self.textures.len() - 1)
                }
                ResourceDesc::Buffer(desc) => {
                    let contents = import
                        .map(|import| buffer_input(import, desc.bytes, inputs))
                        .transpose()?;
                    let mut buffer = pool
                        .buffer(desc.bytes, import.is_none())
                        .map_err(|error| out_of_memory(name, error))?;
                    if watched {
                        buffer
                            .forget()
                            .map_err(|error| out_of_memory(name, error))?;
                    }
                    if let Some(contents) = contents {
                        buffer.write(contents);
                    }
                    self.buffers.push(buffer);
                    Location::Buffer(self.buffers.len() - 1)
                }
            };
            if let ResourceKind::Transient(place) = &resource.kind {
                slots.insert(place.slot, location);
                self.transient_bytes += match location {
                    Location::Texture(index) => self.textures[index].bytes(),
                    Location::Buffer(index) => self.buffers[index].held_bytes(),
                    Location::History { .. } => 0,
                };
            }
            self.locations.push(location);
        }
        Ok(())
    }

    /// Whether a place that resources share is of the shape of one of them.
    fn check_shape(&self, location: Location, desc: &ResourceDesc) -> Result<(), &'static str> {
        let fits = match (location, desc) {
            (Location::Texture(index), ResourceDesc::Texture(desc)) => {
                self.textures[index].desc() == *desc
            }
            (Location::Buffer(index), ResourceDesc::Buffer(desc)) => {
                self.buffers[index].len() == desc.bytes
            }
            (Location::History { .. }, ResourceDesc::Texture(_)) => true,
            _ => false,
        };
        if fits {
            Ok(())
        } else {
            Err("its memory is planned for a resource of another shape")
        }
    }

    fn location(&self, step: &str, resource: u32) -> Result<Location, BackendError> {
        self.locations
            .get(resource as usize)
            .copied()
            .ok_or_else(|| malformed(step, format_args!("there is no resource {resource}")))
    }

    /// Part of a texture.
    pub(super) fn texture<'a>(
        &'a self,
        step: &str,
        plan: &Plan,
        histories: &'a Histories,
        resource: u32,
        range: Subresources,
    ) -> Result<TextureView<'a>, BackendError> {
        let texture = match self.location(step, resource)? {
            Location::Texture(index) => &self.textures[index],
            Location::Buffer(_) => {
                return Err(malformed(
                    step,
                    format_args!("resource {resource} is no texture"),
                ));
            }
            Location::History { index, current } => {
                let history = plan
                    .histories
                    .get(index as usize)
                    .and_then(|planned| histories.get(&planned.name));
                let history = history
                    .ok_or_else(|| malformed(step, format_args!("there is no history {index}")))?;
                if current {
                    &history.current
                } else {
                    &history.previous
                }
            }
        };
        texture
            .part(range)
            .ok_or_else(|| malformed(step, format_args!("resource {resource} has no {range:?}")))
    }

    pub(super) fn buffer(&self, step: &str, resource: u32) -> Result<&Buffer, BackendError> {
        match self.location(step, resource)? {
            Location::Buffer(index) => Ok(&self.buffers[index]),
            Location::Texture(_) | Location::History { .. } => Err(malformed(
                step,
                format_args!("resource {resource} is no buffer"),
            )),
        }
    }

    /// Gives everything back to the pool.
    pub(super) fn release(self, pool: &mut Pool) {
        // In reverse, so that the next run gets them in the same order.
        self.textures
            .into_iter()
            .rev()
            .for_each(|texture| pool.return_texture(texture));
        self.buffers
            .into_iter()
            .rev()
            .for_each(|buffer| pool.return_buffer(buffer));
    }
}

fn texture_input<'a>(
    name: &str,
    wanted: &TextureDesc,
    inputs: &Inputs<'a>,
) -> Result<&'a [u8], BackendError> {
    let image = inputs
        .textures
        .get(name)
        .ok_or_else(|| BackendError::MissingInput {
            name: name.to_owned(),
        })?;
    let bytes = wanted
        .bytes()
        .and_then(|bytes| usize::try_from(bytes).ok())
        .unwrap_or(usize::MAX);
    if image.desc != *wanted || image.bytes.len() != bytes {
        return Err(BackendError::InputMismatch {
            name: name.to_owned(),
            given: describe(&image.desc, image.bytes.len()),
            wanted: describe(wanted, bytes),
        });
    }
    Ok(&image.bytes)
}

fn buffer_input<'a>(
    name: &str,
    wanted: u64,
    inputs: &Inputs<'a>,
) -> Result<&'a [u8], BackendError> {
    let bytes = inputs
        .buffers
        .get(name)
        .ok_or_else(|| BackendError::MissingInput {
            name: name.to_owned(),
        })?;
    if bytes.len() as u64 != wanted {
        return Err(BackendError::InputMismatch {
            name: name.to_owned(),
            given: format!("{} bytes", bytes.len()),
            wanted: format!("{wanted} bytes"),
        });
    }
    Ok(bytes)
}

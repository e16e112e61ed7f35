//! What runs need whose inputs come from the host and whose captures go back
//! to it.

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::{BackendError, Captured, CapturedData, Execution, Inputs, StepTime};
use etalon_core::graph::ResourceDesc;
use etalon_core::image::ImageData;
use etalon_core::plan::{Plan, ResourceKind, Step, Usage};
use gpu_allocator::MemoryLocation;

use crate::buffer::Buffer;
use crate::commands::{Barriers, Commands, Transition};
use crate::device::{Device, Remains};
use crate::error::failed;
use crate::image::Image;
use crate::run::{Captures, Place};
use crate::texels::{self, Texels};
use crate::{Resource, convert, usage};

/// What a plan needs to run from the host, made with the first such run.
pub(crate) struct HostSide {
    device: Arc<Device>,
    imports: Vec<Import>,
    staging: Option<Arc<Buffer>>,
    readback: Option<Arc<Buffer>>,
    /// By capture, in the plan's order.
    places: Vec<Place>,
    pub(crate) queries: vk::QueryPool,
    query_count: u32,
}

/// A texture or buffer that is filled from the host.
struct Import {
    /// Number in the plan.
    resource: usize,
    target: Resource,
    place: Place,
}

/// The error for sizes that no host can hold.
fn too_large(what: &str) -> BackendError {
    BackendError::OutOfMemory {
        what: what.to_owned(),
        bytes: u64::MAX,
    }
}

/// Finds room for a resource behind `end`, and moves that on.
fn place(
    desc: &ResourceDesc,
    range: Option<etalon_core::graph::Subresources>,
    end: &mut u64,
) -> Option<Place> {
    match desc {
        ResourceDesc::Texture(desc) => {
            let range = range.unwrap_or_else(|| convert::whole(desc));
            let texels = Texels::new(desc, range, texels::align(*end))?;
            *end = texels.end;
            Some(Place::Texture(texels))
        }
        ResourceDesc::Buffer(desc) => {
            let offset = texels::align(*end);
            *end = offset.checked_add(desc.bytes)?;
            Some(Place::Buffer {
                offset,
                bytes: desc.bytes,
            })
        }
    }
}

impl HostSide {
    pub(crate) fn new(device: &Arc<Device>, plan: &Plan) -> Result<Self, BackendError> {
        let mut this = Self {
            device: device.clone(),
            imports: Vec::new(),
            staging: None,
            readback: None,
            places: Vec::new(),
            queries: vk::QueryPool::null(),
            query_count: 0,
        };
        let mut staged = 0;
        for (resource, planned) in plan.resources.iter().enumerate() {
            if !matches!(planned.kind, ResourceKind::Import(_)) {
                continue;
            }
            let usages = planned.usages.with(Usage::CopyTarget);
            let name = &planned.name;
            let target = match &planned.desc {
                ResourceDesc::Texture(desc) => {
                    let flags = usage::image_flags(usages.with(Usage::Sampled));
                    Resource::Texture(Image::new(device, name, desc, flags)?)
                }
                ResourceDesc::Buffer(desc) => {
                    let flags = usage::buffer_flags(usages.with(Usage::StorageRead));
                    let local = MemoryLocation::GpuOnly;
                    Resource::Buffer(Buffer::new(device, name, desc.bytes, flags, local)?)
                }
            };
            let place =
                place(&planned.desc, None, &mut staged).ok_or_else(|| too_large("inputs"))?;
            this.imports.push(Import {
                resource,
                target,
                place,
            });
        }
        let mut captured = 0;
        for step in &plan.steps {
            match &step.step {
                Step::Capture {
                    resource, range, ..
                } => {
                    let planned = usize::try_from(*resource)
                        .ok()
                        .and_then(|index| plan.resources.get(index));
                    let place = planned
                        .and_then(|planned| place(&planned.desc, Some(*range), &mut captured))
                        .ok_or_else(|| too_large("captures"))?;
                    this.places.push(place);
                }
                _ => this.query_count += 2,
            }
        }
        let buffer = |name: &str, bytes: u64, flags, location| {
            (bytes > 0)
                .then(|| Buffer::new(device, name, bytes, flags, location))
                .transpose()
        };
        this.staging = buffer(
            "inputs from the host",
            staged,
            vk::BufferUsageFlags::TRANSFER_SRC,
            MemoryLocation::CpuToGpu,
        )?;
        this.readback = buffer(
            "captures for the host",
            captured,
            vk::BufferUsageFlags::TRANSFER_DST,
            MemoryLocation::GpuToCpu,
        )?;
        if this.query_count > 0 && device.timestamp_bits() > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(this.query_count);
            // SAFETY: the count is not zero.
            this.queries = unsafe { device.raw.create_query_pool(&info, None) }
                .map_err(failed("vkCreateQueryPool"))?;
        }
        Ok(this)
    }

    /// The imported resource of this number in the plan.
    pub(crate) fn import(&self, resource: usize) -> Option<&Resource> {
        self.imports
            .iter()
            .find(|import| import.resource == resource)
            .map(|import| &import.target)
    }

    /// Writes the inputs, which were checked, to where the GPU finds them.
    pub(crate) fn stage(&self, plan: &Plan, inputs: &Inputs<'_>) -> Result<(), BackendError> {
        let Some(staging) = &self.staging else {
            return Ok(());
        };
        for import in &self.imports {
            let Some(ResourceKind::Import(name)) = plan
                .resources
                .get(import.resource)
                .map(|planned| &planned.kind)
            else {
                continue;
            };
            match &import.place {
                Place::Texture(texels) => {
                    let mut left = inputs
                        .textures
                        .get(name.as_str())
                        .map_or(&[][..], |image| &image.bytes);
                    for mip in &texels.mips {
                        let Some((bytes, rest)) = left.split_at_checked(mip.bytes) else {
                            return Err(BackendError::MissingInput { name: name.clone() });
                        };
                        staging.write(mip.offset, bytes)?;
                        left = rest;
                    }
                }
                Place::Buffer { offset, .. } => {
                    let bytes = inputs.buffers.get(name.as_str()).copied().unwrap_or(&[]);
                    staging.write(*offset, bytes)?;
                }
            }
        }
        Ok(())
    }

    /// Records the copies from there, which leave the imports at rest.
    pub(crate) fn upload(&self, commands: &Commands<'_>) {
        let Some(staging) = &self.staging else {
            return;
        };
        let written = usage::row(Usage::CopyTarget);
        let mut barriers = Barriers::default();
        for import in &self.imports {
            if let Resource::Texture(image) = &import.target {
                let by = Transition {
                    // The run before has been waited for.
                    source: (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE),
                    target: (written.stages, written.access),
                    layouts: (vk::ImageLayout::UNDEFINED, written.layout),
                };
                barriers.image(image, convert::whole(&image.desc), by);
            }
        }
        commands.barrier(&mut barriers);
        for import in &self.imports {
            let rest = match (&import.target, &import.place) {
                (Resource::Texture(image), Place::Texture(texels)) => {
                    commands.upload(staging, image, &texels.regions);
                    usage::row(Usage::Sampled)
                }
                (Resource::Buffer(buffer), Place::Buffer { offset, bytes }) => {
                    commands.copy_buffer((staging, *offset), (buffer, 0), *bytes);
                    usage::row(Usage::StorageRead)
                }
                _ => continue,
            };
            let by = Transition {
                source: (written.stages, written.access),
                target: (rest.stages, rest.access),
                layouts: (written.layout, rest.layout),
            };
            match &import.target {
                Resource::Texture(image) => barriers.image(image, convert::whole(&image.desc), by),
                Resource::Buffer(buffer) => barriers.buffer(buffer, by),
            }
        }
        commands.barrier(&mut barriers);
    }

    /// Makes the queries ready, and returns them if there are any.
    pub(crate) fn queries(&self, commands: &Commands<'_>) -> Option<vk::QueryPool> {
        if self.queries == vk::QueryPool::null() {
            return None;
        }
        commands.reset_queries(self.queries, self.query_count);
        Some(self.queries)
    }

    /// Where captures go.
    pub(crate) fn captures(&self) -> Option<Captures<'_>> {
        self.readback.as_ref().map(|buffer| Captures {
            buffer,
            places: &self.places,
        })
    }

    /// Makes what was captured visible to the host, once it has been waited for.
    pub(crate) fn show(&self, commands: &Commands<'_>) {
        if self.readback.is_some() {
            let mut barriers = Barriers::default();
            barriers.memory(
                (
                    vk::PipelineStageFlags2::COPY,
                    vk::AccessFlags2::TRANSFER_WRITE,
                ),
                (vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ),
            );
            commands.barrier(&mut barriers);
        }
    }

    /// Collects the results of a run that has been waited for.
    pub(crate) fn collect(&self, plan: &Plan) -> Result<Execution, BackendError> {
        let mut captures = Vec::with_capacity(self.places.len());
        let mut places = self.places.iter();
        for step in &plan.steps {
            let Step::Capture {
                resource,
                range,
                pass,
                binding,
            } = &step.step
            else {
                continue;
            };
            let planned = usize::try_from(*resource)
                .ok()
                .and_then(|index| plan.resources.get(index));
            let (Some(planned), Some(place), Some(readback)) =
                (planned, places.next(), &self.readback)
            else {
                continue;
            };
            let data = match (place, &planned.desc) {
                (Place::Texture(texels), ResourceDesc::Texture(desc)) => {
                    let total = texels.mips.iter().map(|mip| mip.bytes).sum();
                    let mut bytes = zeroed(total)?;
                    let mut left = &mut bytes[..];
                    for mip in &texels.mips {
                        let (here, rest) = left.split_at_mut(mip.bytes);
                        readback.read(mip.offset, here)?;
                        left = rest;
                    }
                    CapturedData::Texture(ImageData {
                        desc: texels::part(desc, *range),
                        bytes,
                    })
                }
                (Place::Buffer { offset, bytes }, _) => {
                    let mut data = zeroed(usize::try_from(*bytes).unwrap_or(usize::MAX))?;
                    readback.read(*offset, &mut data)?;
                    CapturedData::Buffer(data)
                }
                _ => continue,
            };
            captures.push(Captured {
                pass: pass.clone(),
                binding: binding.clone(),
                resource: planned.name.clone(),
                data,
            });
        }
        Ok(Execution {
            captures,
            times: self.times(plan)?,
        })
    }

    /// The time of each step that was timed.
    fn times(&self, plan: &Plan) -> Result<Vec<StepTime>, BackendError> {
        if self.queries == vk::QueryPool::null() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0_u64; usize::try_from(self.query_count).unwrap_or(0)];
        // SAFETY: the pool has as many queries as there are elements, all of
        // which the run has written.
        let result = unsafe {
            self.device.raw.get_query_pool_results(
                self.queries,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64,
            )
        };
        match result {
            Ok(()) => {}
            Err(vk::Result::NOT_READY) => return Ok(Vec::new()),
            Err(result) => return Err(failed("vkGetQueryPoolResults")(result)),
        }
        let timed = plan
            .steps
            .iter()
            .filter(|step| !matches!(step.step, Step::Capture { .. }));
        Ok(timed
            .zip(ticks.chunks_exact(2))
            .map(|(step, ticks)| StepTime {
                step: step.name.clone(),
                nanoseconds: self.device.nanoseconds(ticks[0], ticks[1]),
            })
            .collect())
    }
}

impl Drop for HostSide {
    fn drop(&mut self) {
        self.device.bury(Remains::QueryPool(self.queries));
    }
}

/// So many zeros, or an error instead of an abort when there is no memory.
fn zeroed(count: usize) -> Result<Vec<u8>, BackendError> {
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(count)
        .map_err(|_| BackendError::OutOfMemory {
            what: "a capture on the host".to_owned(),
            bytes: u64::try_from(count).unwrap_or(u64::MAX),
        })?;
    bytes.resize(count, 0);
    Ok(bytes)
}

/// Checks that the inputs are what a plan imports, before anything is made.
pub(crate) fn check_inputs(plan: &Plan, inputs: &Inputs<'_>) -> Result<(), BackendError> {
    for planned in &plan.resources {
        let ResourceKind::Import(name) = &planned.kind else {
            continue;
        };
        let missing = || BackendError::MissingInput { name: name.clone() };
        let mismatch = |given: String, wanted: String| BackendError::InputMismatch {
            name: name.clone(),
            given,
            wanted,
        };
        match &planned.desc {
            ResourceDesc::Texture(desc) => {
                let image = inputs.textures.get(name.as_str()).ok_or_else(missing)?;
                if image.desc != *desc {
                    return Err(mismatch(
                        convert::describe(&image.desc),
                        convert::describe(desc),
                    ));
                }
                let (given, wanted) = (image.bytes.len(), desc.bytes());
                if u64::try_from(given).ok() != wanted {
                    return Err(mismatch(
                        format!("{given} bytes"),
                        format!("{} bytes", wanted.unwrap_or(u64::MAX)),
                    ));
                }
            }
            ResourceDesc::Buffer(desc) => {
                let given = inputs.buffers.get(name.as_str()).ok_or_else(missing)?.len();
                if u64::try_from(given).ok() != Some(desc.bytes) {
                    return Err(mismatch(
                        format!("a buffer of {given} bytes"),
                        format!("a buffer of {} bytes", desc.bytes),
                    ));
                }
            }
        }
    }
    Ok(())
}

//! A plan is checked once, before anything is made for it: for numbers that
//! point nowhere, and for what the device cannot do.
//!
//! Planning makes no plan that contradicts itself, but a plan is plain data
//! that anybody can change, and it may have been made with the limits of
//! another device.

mod raster;

use etalon_core::backend::BackendError;
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::kernel::{BindingKind, Kernel, ViewDimension};
use etalon_core::plan::{
    Bound, Groups, Plan, PlannedResource, PlannedStep, ResourceKind, Step, UniformSlice,
};
use etalon_core::resource::{BufferDesc, Dimension, TextureDesc};

use crate::convert;
use crate::device::Device;
use crate::error::{malformed, unsupported};
use crate::{image, pipeline, usage};

/// The index of a resource.
fn index(resource: u32) -> usize {
    usize::try_from(resource).unwrap_or(usize::MAX)
}

/// Checks all of a plan.
pub(crate) fn plan(device: &Device, plan: &Plan) -> Result<(), BackendError> {
    let checker = Checker { device, plan };
    for resource in &plan.resources {
        checker.resource(resource)?;
    }
    for step in &plan.steps {
        checker.step(step)?;
    }
    for barrier in plan
        .steps
        .iter()
        .flat_map(|step| &step.barriers)
        .chain(&plan.final_barriers)
    {
        checker.part("a barrier", barrier.resource, barrier.range)?;
    }
    for history in &plan.histories {
        for resource in [history.previous, history.current] {
            if checker.texture("a history", resource)? != history.desc {
                return Err(malformed(format!(
                    "history `{}` and its textures have different shapes",
                    history.name
                )));
            }
        }
    }
    Ok(())
}

struct Checker<'a> {
    device: &'a Device,
    plan: &'a Plan,
}

impl Checker<'_> {
    fn get(&self, who: &str, resource: u32) -> Result<&PlannedResource, BackendError> {
        self.plan.resources.get(index(resource)).ok_or_else(|| {
            malformed(format!(
                "{who} uses resource {resource}, the plan has {}",
                self.plan.resources.len()
            ))
        })
    }

    fn texture(&self, who: &str, resource: u32) -> Result<TextureDesc, BackendError> {
        let found = self.get(who, resource)?;
        match found.desc {
            ResourceDesc::Texture(desc) => Ok(desc),
            ResourceDesc::Buffer(_) => Err(malformed(format!(
                "{who} uses the buffer `{}` as a texture",
                found.name
            ))),
        }
    }

    fn buffer(&self, who: &str, resource: u32) -> Result<BufferDesc, BackendError> {
        let found = self.get(who, resource)?;
        match found.desc {
            ResourceDesc::Buffer(desc) => Ok(desc),
            ResourceDesc::Texture(_) => Err(malformed(format!(
                "{who} uses the texture `{}` as a buffer",
                found.name
            ))),
        }
    }

    /// Checks a range of a texture; a buffer has one mip and layer.
    fn part(&self, who: &str, resource: u32, range: Subresources) -> Result<(), BackendError> {
        let found = self.get(who, resource)?;
        let (mips, layers) = match &found.desc {
            ResourceDesc::Texture(desc) => (desc.mips, desc.layers()),
            ResourceDesc::Buffer(_) => (1, 1),
        };
        let within = |first: u32, count: u32, all: u32| {
            count > 0 && first.checked_add(count).is_some_and(|end| end <= all)
        };
        if within(range.mip, range.mips, mips) && within(range.layer, range.layers, layers) {
            Ok(())
        } else {
            Err(malformed(format!(
                "{who} uses {} mips from {} and {} layers from {} of `{}`, which has {mips} and {layers}",
                range.mips, range.mip, range.layers, range.layer, found.name
            )))
        }
    }

    /// The first step that uses a resource, for errors.
    fn first_user(&self, resource: &PlannedResource) -> &str {
        self.plan
            .steps
            .get(index(resource.first))
            .map_or("?", |step| step.name.as_str())
    }

    /// Checks that the device can have a resource, and that it is where it
    /// belongs.
    fn resource(&self, resource: &PlannedResource) -> Result<(), BackendError> {
        let user = self.first_user(resource);
        let heap = match &resource.desc {
            ResourceDesc::Texture(desc) => {
                let flags = usage::image_flags(resource.usages);
                if flags.is_empty() {
                    return Err(malformed(format!("nothing uses `{}`", resource.name)));
                }
                image::check(self.device, desc, flags)
                    .map_err(|what| unsupported(user, format!("`{}`, {what}", resource.name)))?;
                self.plan.texture_heap
            }
            ResourceDesc::Buffer(desc) => {
                if usage::buffer_flags(resource.usages).is_empty() {
                    return Err(malformed(format!("nothing uses `{}`", resource.name)));
                }
                desc.validate(&self.device.physical.limits(&self.device.features))
                    .map_err(|error| unsupported(user, format!("`{}`: {error}", resource.name)))?;
                self.plan.buffer_heap
            }
        };
        if let ResourceKind::Transient(place) = &resource.kind
            && place
                .offset
                .checked_add(place.bytes)
                .is_none_or(|end| end > heap)
        {
            return Err(malformed(format!(
                "`{}` lies at byte {} with {} bytes, in a heap of {heap}",
                resource.name, place.offset, place.bytes
            )));
        }
        if let ResourceKind::HistoryPrevious(history) | ResourceKind::HistoryCurrent(history) =
            &resource.kind
            && index(*history) >= self.plan.histories.len()
        {
            return Err(malformed(format!(
                "`{}` is of history {history}, the plan has {}",
                resource.name,
                self.plan.histories.len()
            )));
        }
        Ok(())
    }

    fn step(&self, step: &PlannedStep) -> Result<(), BackendError> {
        let who = format!("step `{}`", step.name);
        match &step.step {
            Step::Dispatch {
                kernel,
                bindings,
                groups,
            } => {
                pipeline::check(self.device, &kernel.0, &step.name)?;
                self.bindings(step, &kernel.0, bindings)?;
                self.groups(step, groups)
            }
            Step::Raster(raster) => self.raster(step, raster),
            Step::ClearTexture {
                resource, range, ..
            } => {
                self.texture(&who, *resource)?;
                self.part(&who, *resource, *range)
            }
            Step::ClearBuffer { resource } => self.buffer(&who, *resource).map(|_| ()),
            Step::CopyTexture { source, target } => {
                let (from, to) = (self.texture(&who, source.0)?, self.texture(&who, target.0)?);
                self.part(&who, source.0, source.1)?;
                self.part(&who, target.0, target.1)?;
                let shape = |desc: &TextureDesc, range: &Subresources| {
                    let extent = convert::copy_extent(desc, range.mip);
                    (
                        desc.format,
                        (extent.width, extent.height, extent.depth),
                        (range.mips, range.layers),
                    )
                };
                if shape(&from, &source.1) == shape(&to, &target.1) {
                    Ok(())
                } else {
                    Err(malformed(format!("{who} copies between different shapes")))
                }
            }
            Step::CopyBuffer { source, target } => {
                if self.buffer(&who, *source)? == self.buffer(&who, *target)? {
                    Ok(())
                } else {
                    Err(malformed(format!("{who} copies between different sizes")))
                }
            }
            Step::Capture {
                resource, range, ..
            } => self.part(&who, *resource, *range),
        }
    }

    fn bindings(
        &self,
        step: &PlannedStep,
        kernel: &Kernel,
        bindings: &[Bound],
    ) -> Result<(), BackendError> {
        let who = format!("step `{}`", step.name);
        if bindings.len() != kernel.bindings.len() {
            return Err(malformed(format!(
                "{who} binds {} things to kernel `{}`, which has {} bindings",
                bindings.len(),
                kernel.name,
                kernel.bindings.len()
            )));
        }
        for (bound, binding) in bindings.iter().zip(&kernel.bindings) {
            let wrong = || {
                malformed(format!(
                    "{who} binds {bound:?} to `{}`, which is {:?}",
                    binding.name, binding.kind
                ))
            };
            match (bound, &binding.kind) {
                (
                    Bound::Texture { resource, range },
                    BindingKind::Texture { dimension, .. }
                    | BindingKind::StorageTexture { dimension, .. },
                ) => {
                    let desc = self.texture(&who, *resource)?;
                    self.part(&who, *resource, *range)?;
                    if !suits(*dimension, desc.dimension, range.layers) {
                        return Err(wrong());
                    }
                    if let BindingKind::StorageTexture { format, .. } = &binding.kind
                        && (*format != desc.format || range.mips != 1)
                    {
                        return Err(wrong());
                    }
                }
                (Bound::Buffer { resource }, BindingKind::StorageBuffer { .. }) => {
                    self.buffer(&who, *resource)?;
                }
                (Bound::Uniform(slice), BindingKind::Uniform(layout)) => {
                    if slice.size < layout.size {
                        return Err(wrong());
                    }
                    self.uniforms(step, *slice)?;
                }
                (Bound::Sampler(desc), BindingKind::Sampler { comparison })
                    if desc.compare.is_some() == *comparison && desc.lod.is_valid() => {}
                _ => return Err(wrong()),
            }
        }
        Ok(())
    }

    fn uniforms(&self, step: &PlannedStep, slice: UniformSlice) -> Result<(), BackendError> {
        let limits = &self.device.physical.limits;
        if slice.size > limits.max_uniform_buffer_range {
            let what = format!(
                "a uniform block of {} bytes (at most {})",
                slice.size, limits.max_uniform_buffer_range
            );
            return Err(unsupported(&step.name, what));
        }
        let alignment = limits.min_uniform_buffer_offset_alignment.max(1);
        if !u64::from(slice.offset).is_multiple_of(alignment) {
            let what = format!(
                "its uniform block at byte {}, not at a multiple of {alignment} (plan with this device's limits)",
                slice.offset
            );
            return Err(unsupported(&step.name, what));
        }
        let end = u64::from(slice.offset) + u64::from(slice.size);
        if u64::try_from(self.plan.uniforms.len()).is_ok_and(|all| end <= all) {
            Ok(())
        } else {
            Err(malformed(format!(
                "step `{}` has its uniform block behind the end of {} bytes",
                step.name,
                self.plan.uniforms.len()
            )))
        }
    }

    fn groups(&self, step: &PlannedStep, groups: &Groups) -> Result<(), BackendError> {
        match groups {
            Groups::Direct(counts) => {
                let limits = self.device.physical.limits.max_compute_work_group_count;
                if counts.iter().zip(&limits).any(|(count, max)| count > max) {
                    let what = format!("{counts:?} workgroups (at most {limits:?})");
                    return Err(unsupported(&step.name, what));
                }
                Ok(())
            }
            Groups::Indirect { buffer, offset } => {
                let desc = self.buffer(&format!("step `{}`", step.name), *buffer)?;
                if offset.is_multiple_of(4)
                    && offset.checked_add(12).is_some_and(|end| end <= desc.bytes)
                {
                    Ok(())
                } else {
                    Err(malformed(format!(
                        "step `{}` reads its workgroup counts at byte {offset} of {}",
                        step.name, desc.bytes
                    )))
                }
            }
        }
    }
}

/// Whether so many layers of a texture can be seen so.
fn suits(view: ViewDimension, dimension: Dimension, layers: u32) -> bool {
    match view {
        ViewDimension::D2 => !matches!(dimension, Dimension::D3) && layers == 1,
        ViewDimension::D2Array => !matches!(dimension, Dimension::D3),
        ViewDimension::Cube => matches!(dimension, Dimension::Cube) && layers == 6,
        ViewDimension::CubeArray => {
            matches!(dimension, Dimension::Cube) && layers.is_multiple_of(6)
        }
        ViewDimension::D3 => matches!(dimension, Dimension::D3),
    }
}

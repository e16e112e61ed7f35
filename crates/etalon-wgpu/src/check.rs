//! Holding a plan against a device before anything is made for it.
//!
//! A plan may have been made with other limits than this device's, and its
//! fields are open to everybody. What is checked here need not be checked again
//! by those who prepare and record.

use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::format::SampleKind;
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::kernel::{BindingKind, Kernel};
use etalon_core::plan::{
    Bound, Groups, Plan, PlannedResource, PlannedStep, ResourceKind, Step, UniformSlice,
};
use etalon_core::resource::{Dimension, TextureDesc};

use crate::convert;
use crate::fault::unsupported;
use crate::gl;
use crate::gpu::Gpu;
use crate::pipeline::uniform_bytes;
use crate::raster;

/// A plan that contradicts itself.
fn malformed(step: &str, what: impl std::fmt::Display) -> BackendError {
    BackendError::Api {
        call: "plan",
        reason: format!("step `{step}`: {what}"),
    }
}

/// Checks everything.
pub(crate) fn check(gpu: &Gpu, plan: &Plan) -> Result<(), BackendError> {
    for resource in &plan.resources {
        let step = plan
            .steps
            .get(resource.first as usize)
            .map_or(resource.name.as_str(), |step| &step.name);
        check_resource(gpu, step, resource)?;
    }
    for step in &plan.steps {
        let checker = Checker { gpu, plan, step };
        checker.check()?;
    }
    if gpu.is_gl() {
        gl::check(plan)?;
    }
    for history in &plan.histories {
        for index in [history.previous, history.current] {
            match plan.resources.get(index as usize).map(|found| found.desc) {
                Some(ResourceDesc::Texture(desc)) if desc == history.desc => {}
                _ => {
                    return Err(malformed(
                        &history.name,
                        "its textures are of another shape",
                    ));
                }
            }
        }
    }
    Ok(())
}

fn check_resource(gpu: &Gpu, step: &str, resource: &PlannedResource) -> Result<(), BackendError> {
    let name = &resource.name;
    let limits = gpu.limits();
    match &resource.desc {
        ResourceDesc::Texture(desc) => {
            desc.validate(&limits)
                .map_err(|error| unsupported(step, format!("`{name}`: {error}")))?;
            let usages = convert::texture_usages(resource.usages, desc.format);
            check_texture(gpu, desc, usages)
                .map_err(|what| unsupported(step, format!("`{name}` as {what}")))
        }
        ResourceDesc::Buffer(desc) => {
            desc.validate(&limits)
                .map_err(|error| unsupported(step, format!("`{name}`: {error}")))?;
            if desc.bytes.is_multiple_of(4) {
                Ok(())
            } else {
                let bytes = desc.bytes;
                Err(unsupported(
                    step,
                    format!("`{name}` of {bytes} bytes (only multiples of 4)"),
                ))
            }
        }
    }
}

/// Whether the device has textures of this shape and format for these uses;
/// what it lacks otherwise.
pub(crate) fn check_texture(
    gpu: &Gpu,
    desc: &TextureDesc,
    usages: wgpu::TextureUsages,
) -> Result<(), String> {
    let format = desc.format;
    let Some((_, features)) = gpu.format(format) else {
        return Err(format!("{format} texture"));
    };
    let depth = format.sample_kind() == SampleKind::Depth;
    if depth && desc.dimension == Dimension::D3 {
        return Err(format!("3D {format} texture"));
    }
    if desc.dimension == Dimension::Cube
        && desc.layers() > 6
        && !gpu.has(wgpu::DownlevelFlags::CUBE_ARRAY_TEXTURES)
    {
        return Err("array of cubes".to_owned());
    }
    let missing = usages.difference(features.allowed_usages);
    for (usage, text) in [
        (wgpu::TextureUsages::TEXTURE_BINDING, "sampled"),
        (wgpu::TextureUsages::STORAGE_BINDING, "storage"),
        (wgpu::TextureUsages::COPY_SRC, "copied"),
        (wgpu::TextureUsages::COPY_DST, "copied or cleared"),
        (wgpu::TextureUsages::RENDER_ATTACHMENT, "rendered"),
    ] {
        if missing.contains(usage) {
            return Err(format!("{text} {format} texture"));
        }
    }
    Ok(())
}

/// Whether texels of a format can be copied between textures and buffers in
/// this direction; what cannot be done otherwise.
pub(crate) fn check_buffer_copy(gpu: &Gpu, desc: &TextureDesc, back: bool) -> Result<(), String> {
    let format = desc.format;
    let depth = format.sample_kind() == SampleKind::Depth;
    if depth && !gpu.has(wgpu::DownlevelFlags::DEPTH_TEXTURE_AND_BUFFER_COPIES) {
        return Err(format!("copies between {format} textures and buffers"));
    }
    if back {
        check_copy_source(gpu, desc)?;
    }
    Ok(())
}

/// Whether texels can be copied from a texture; what cannot be done otherwise.
fn check_copy_source(gpu: &Gpu, desc: &TextureDesc) -> Result<(), String> {
    if !gpu.is_gl() {
        return Ok(());
    }
    let format = desc.format;
    let size = desc.extent;
    if desc.dimension != Dimension::D3
        && size.width == size.height
        && size.depth_or_layers.is_multiple_of(6)
    {
        return Err("copies from what OpenGL takes for a cube".to_owned());
    }
    if format.sample_kind() == SampleKind::Depth || !gpu.copies(format) {
        return Err(format!("copies from {format} textures"));
    }
    Ok(())
}

/// Checks one step.
pub(crate) struct Checker<'a> {
    pub(crate) gpu: &'a Gpu,
    plan: &'a Plan,
    step: &'a PlannedStep,
}

impl Checker<'_> {
    pub(crate) fn malformed(&self, what: impl std::fmt::Display) -> BackendError {
        malformed(&self.step.name, what)
    }

    pub(crate) fn unsupported(&self, what: impl Into<String>) -> BackendError {
        unsupported(&self.step.name, what)
    }

    fn resource(&self, index: u32) -> Result<&PlannedResource, BackendError> {
        self.plan
            .resources
            .get(index as usize)
            .ok_or_else(|| self.malformed(format_args!("there is no resource {index}")))
    }

    pub(crate) fn texture(
        &self,
        index: u32,
        range: Subresources,
    ) -> Result<&TextureDesc, BackendError> {
        let resource = self.resource(index)?;
        let ResourceDesc::Texture(desc) = &resource.desc else {
            return Err(self.malformed(format_args!("`{}` is no texture", resource.name)));
        };
        let within = |first: u32, count: u32, all: u32| {
            count > 0 && first.checked_add(count).is_some_and(|end| end <= all)
        };
        if !within(range.mip, range.mips, desc.mips)
            || !within(range.layer, range.layers, desc.layers())
        {
            return Err(self.malformed(format_args!("`{}` has no {range:?}", resource.name)));
        }
        Ok(desc)
    }

    pub(crate) fn buffer(&self, index: u32) -> Result<u64, BackendError> {
        let resource = self.resource(index)?;
        match &resource.desc {
            ResourceDesc::Buffer(desc) => Ok(desc.bytes),
            ResourceDesc::Texture(_) => {
                Err(self.malformed(format_args!("`{}` is no buffer", resource.name)))
            }
        }
    }

    fn check(&self) -> Result<(), BackendError> {
        match &self.step.step {
            Step::Dispatch {
                kernel,
                bindings,
                groups,
            } => {
                if kernel.0.compute().is_none() {
                    return Err(self.malformed("it dispatches a raster kernel"));
                }
                self.bindings(&kernel.0, bindings)?;
                self.groups(groups)
            }
            Step::Raster(raster) => raster::check(self, raster),
            Step::ClearTexture {
                resource, range, ..
            } => {
                let desc = self.texture(*resource, *range)?;
                if desc.format == Format::Depth32Float {
                    return Ok(());
                }
                check_buffer_copy(self.gpu, desc, false).map_err(|what| self.unsupported(what))
            }
            Step::ClearBuffer { resource } => self.buffer(*resource).map(drop),
            Step::CopyTexture { source, target } => {
                let from = self.texture(source.0, source.1)?;
                let to = self.texture(target.0, target.1)?;
                let shape = |desc: &TextureDesc, range: Subresources| {
                    let size = convert::copy_extent(desc, range.mip, range);
                    (desc.format, size, range.mips)
                };
                if shape(from, source.1) != shape(to, target.1) {
                    return Err(self.malformed("source and target are of different shapes"));
                }
                if self.gpu.is_gl() && from.dimension == Dimension::D3 {
                    // wgpu copies one slice there.
                    return Err(self.unsupported("copies between 3D textures"));
                }
                check_copy_source(self.gpu, from).map_err(|what| self.unsupported(what))
            }
            Step::CopyBuffer { source, target } => {
                if self.buffer(*source)? == self.buffer(*target)? && source != target {
                    Ok(())
                } else {
                    Err(self.malformed("source and target are of different sizes, or one"))
                }
            }
            Step::Capture {
                resource, range, ..
            } => match self.resource(*resource)?.desc {
                ResourceDesc::Buffer(_) => Ok(()),
                ResourceDesc::Texture(_) => {
                    let desc = self.texture(*resource, *range)?;
                    check_buffer_copy(self.gpu, desc, true).map_err(|what| self.unsupported(what))
                }
            },
        }
    }

    /// Checks what the bindings of a kernel are given.
    pub(crate) fn bindings(&self, kernel: &Kernel, bindings: &[Bound]) -> Result<(), BackendError> {
        if kernel.bindings.len() != bindings.len() {
            return Err(self.malformed("the kernel has more or fewer bindings"));
        }
        for (binding, bound) in kernel.bindings.iter().zip(bindings) {
            self.bound(&binding.name, &binding.kind, bound)?;
        }
        Ok(())
    }

    fn bound(&self, name: &str, kind: &BindingKind, bound: &Bound) -> Result<(), BackendError> {
        match (kind, bound) {
            (BindingKind::Texture { filtered, .. }, Bound::Texture { resource, range }) => {
                let desc = self.texture(*resource, *range)?;
                let filters = self.gpu.format(desc.format).is_some_and(|(_, features)| {
                    features
                        .flags
                        .contains(wgpu::TextureFormatFeatureFlags::FILTERABLE)
                        || desc.format.sample_kind() == SampleKind::Depth
                });
                if *filtered && !filters {
                    return Err(
                        self.unsupported(format!("`{name}` as filtered {} texture", desc.format))
                    );
                }
                Ok(())
            }
            (BindingKind::StorageTexture { format, .. }, Bound::Texture { resource, range }) => {
                let desc = self.texture(*resource, *range)?;
                if self.gpu.is_gl() && desc.dimension == Dimension::D3 {
                    // wgpu binds one slice there.
                    return Err(self.unsupported(format!("`{name}` as 3D storage texture")));
                }
                if desc.format == *format && range.mips == 1 {
                    Ok(())
                } else {
                    Err(self.malformed(format_args!("`{name}` is not one mip of {format}")))
                }
            }
            (BindingKind::StorageBuffer { min_size, .. }, Bound::Buffer { resource }) => {
                if self.buffer(*resource)? >= *min_size {
                    Ok(())
                } else {
                    Err(self.malformed(format_args!("`{name}` is smaller than {min_size} bytes")))
                }
            }
            (BindingKind::Uniform(layout), Bound::Uniform(slice)) if layout.size == slice.size => {
                self.uniform(*slice)
            }
            (BindingKind::Sampler { comparison }, Bound::Sampler(desc))
                if *comparison == desc.compare.is_some() && desc.lod.is_valid() =>
            {
                Ok(())
            }
            _ => Err(self.malformed(format_args!("`{name}` is given something else"))),
        }
    }

    fn uniform(&self, slice: UniformSlice) -> Result<(), BackendError> {
        let end = u64::from(slice.offset) + u64::from(slice.size);
        if end > self.plan.uniforms.len() as u64 {
            return Err(self.malformed("its uniforms are not in the plan"));
        }
        let limits = self.gpu.raw_limits();
        let alignment = limits.min_uniform_buffer_offset_alignment.max(16);
        if !slice.offset.is_multiple_of(alignment) {
            return Err(self.unsupported(format!(
                "uniforms at byte {} (only multiples of {alignment}; plan with this device's limits)",
                slice.offset
            )));
        }
        if uniform_bytes(slice.size) > limits.max_uniform_buffer_binding_size {
            return Err(self.unsupported(format!(
                "{} bytes of uniforms (at most {})",
                slice.size, limits.max_uniform_buffer_binding_size
            )));
        }
        Ok(())
    }

    fn groups(&self, groups: &Groups) -> Result<(), BackendError> {
        match groups {
            Groups::Direct(groups) => {
                let limit = self.gpu.raw_limits().max_compute_workgroups_per_dimension;
                if groups.iter().all(|count| *count <= limit) {
                    Ok(())
                } else {
                    Err(self.unsupported(format!(
                        "{groups:?} workgroups (at most {limit} in one dimension)"
                    )))
                }
            }
            Groups::Indirect { buffer, offset } => {
                if !self.gpu.has(wgpu::DownlevelFlags::INDIRECT_EXECUTION) {
                    return Err(self.unsupported("indirect dispatches"));
                }
                let bytes = self.buffer(*buffer)?;
                if offset.is_multiple_of(4)
                    && offset.checked_add(12).is_some_and(|end| end <= bytes)
                {
                    Ok(())
                } else {
                    Err(self.malformed("its arguments are outside of their buffer"))
                }
            }
        }
    }
}

/// Whether anything of a plan can only be had from the host's side.
pub(crate) fn first_capture(plan: &Plan) -> Option<&PlannedStep> {
    plan.steps
        .iter()
        .find(|step| matches!(step.step, Step::Capture { .. }))
}

/// The names of a plan's outputs, for messages.
pub(crate) fn output_names(plan: &Plan) -> String {
    let names: Vec<String> = plan
        .resources
        .iter()
        .filter_map(|resource| match &resource.kind {
            ResourceKind::Output(names) => Some(names),
            _ => None,
        })
        .flatten()
        .map(|name| format!("`{name}`"))
        .collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

//! Checks of steps that draw.

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::format::SampleKind;
use etalon_core::graph::ClearValue;
use etalon_core::kernel::RasterStages;
use etalon_core::plan::{
    DrawExtent, PlannedDraw, PlannedStep, PlannedTarget, PlannedVertices, RasterStep, Usage,
};
use etalon_core::raster::{IndexFormat, NumberKind, StepMode};

use super::Checker;
use crate::error::{malformed, unsupported};
use crate::{convert, pipeline, stages};

/// A feature and what asks for it, in words.
fn feature(name: &str, purpose: &str) -> String {
    format!("the feature `{name}`, for {purpose}")
}

impl Checker<'_> {
    /// Checks a step that draws.
    pub(super) fn raster(
        &self,
        step: &PlannedStep,
        raster: &RasterStep,
    ) -> Result<(), BackendError> {
        let lacking = |what: String| Err(unsupported(&step.name, what));
        let who = format!("step `{}`", step.name);
        if !self.device.draws() {
            return lacking("a queue that draws".to_owned());
        }
        if !self.device.features.dynamic_rendering {
            return lacking(feature("dynamicRendering", "draws"));
        }
        let limits = &self.device.physical.limits;
        let [width, height] = raster.size;
        let most = [
            limits
                .max_framebuffer_width
                .min(limits.max_viewport_dimensions[0]),
            limits
                .max_framebuffer_height
                .min(limits.max_viewport_dimensions[1]),
        ];
        if width > most[0] || height > most[1] {
            return lacking(format!(
                "targets of {width}×{height} pixels (at most {}×{})",
                most[0], most[1]
            ));
        }
        let (count, most) = (raster.colours.len(), limits.max_color_attachments);
        if u32::try_from(count).is_ok_and(|count| count > most) {
            return lacking(format!("{count} colour targets (at most {most})"));
        }
        let all: Vec<_> = raster.colours.iter().chain(&raster.depth).collect();
        if all.is_empty() {
            return Err(malformed(format!("{who} has no target to draw to")));
        }
        for (index, target) in all.iter().enumerate() {
            let is_depth = index >= raster.colours.len();
            self.target(step, raster, target, is_depth)?;
            let same = |other: &&PlannedTarget| {
                (other.resource, other.range) == (target.resource, target.range)
            };
            if all[..index].iter().any(same) {
                return Err(malformed(format!("{who} draws to one target twice")));
            }
        }
        let states = [
            raster.viewport.validate(width, height),
            raster.scissor.validate(width, height),
        ];
        for state in states {
            state.map_err(|error| malformed(format!("{who}: {error}")))?;
        }
        for (index, draw) in raster.draws.iter().enumerate() {
            Drawn {
                checker: self,
                step,
                raster,
                draw,
                who: format!("draw {index} of {who}"),
            }
            .check()?;
        }
        Ok(())
    }

    /// Checks that a resource was planned to be used so.
    fn used(&self, who: &str, resource: u32, usage: Usage) -> Result<(), BackendError> {
        let found = self.get(who, resource)?;
        if found.usages.contains(usage) {
            Ok(())
        } else {
            Err(malformed(format!(
                "{who} uses `{}` as {usage:?}, which was not planned",
                found.name
            )))
        }
    }

    /// What a device can do with the texels of a format.
    fn format_features(&self, format: vk::Format) -> vk::FormatProperties {
        // SAFETY: the physical device is the instance's, and the value one of
        // the enumeration's own names.
        unsafe {
            self.device
                .instance
                .raw
                .get_physical_device_format_properties(self.device.physical.handle, format)
        }
    }

    fn target(
        &self,
        step: &PlannedStep,
        raster: &RasterStep,
        target: &PlannedTarget,
        is_depth: bool,
    ) -> Result<(), BackendError> {
        let who = format!("step `{}`", step.name);
        let desc = self.texture(&who, target.resource)?;
        self.part(&who, target.resource, target.range)?;
        let (usage, needed) = if is_depth {
            (
                Usage::DepthTarget,
                vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT,
            )
        } else {
            (
                Usage::ColourTarget,
                vk::FormatFeatureFlags::COLOR_ATTACHMENT,
            )
        };
        self.used(&who, target.resource, usage)?;
        let kind = desc.format.sample_kind();
        let extent = desc.mip_extent(target.range.mip);
        let clears = match target.clear {
            None => true,
            Some(ClearValue::Float(_)) => matches!(kind, SampleKind::Float | SampleKind::Depth),
            Some(ClearValue::Sint(_)) => kind == SampleKind::Sint,
            Some(ClearValue::Uint(_)) => kind == SampleKind::Uint,
        };
        if is_depth != (kind == SampleKind::Depth)
            || (target.range.mips, target.range.layers) != (1, 1)
            || [extent.width, extent.height] != raster.size
            || !clears
        {
            return Err(malformed(format!(
                "{who} cannot draw to {target:?}, of {}",
                convert::describe(&desc)
            )));
        }
        let format = convert::format(desc.format).unwrap_or_default();
        let offered = self.format_features(format).optimal_tiling_features;
        if offered.contains(needed) {
            Ok(())
        } else {
            let what = format!("targets of the format {}", desc.format);
            Err(unsupported(&step.name, what))
        }
    }
}

/// One draw to be checked.
struct Drawn<'a> {
    checker: &'a Checker<'a>,
    step: &'a PlannedStep,
    raster: &'a RasterStep,
    draw: &'a PlannedDraw,
    who: String,
}

impl Drawn<'_> {
    fn check(&self) -> Result<(), BackendError> {
        let Self {
            checker,
            step,
            draw,
            ..
        } = self;
        let kernel = &draw.kernel.0;
        let Some(interface) = kernel.raster() else {
            return self.malformed(format!("`{}` is no kernel that draws", kernel.name));
        };
        let device = checker.device;
        pipeline::check(device, kernel, &step.name)?;
        let colours = self.raster.colours.len();
        stages::check(&device.physical.limits, kernel, colours, &step.name)?;
        checker.bindings(step, kernel, &draw.bindings)?;
        self.state()?;
        self.outputs(interface)?;
        self.layouts(interface)?;
        // Buffers are not touched by a draw of nothing.
        if draw.extent.is_none() {
            return Ok(());
        }
        for vertices in &draw.vertices {
            self.vertices(vertices)?;
        }
        self.indices()?;
        self.records()
    }

    fn malformed(&self, what: impl std::fmt::Display) -> Result<(), BackendError> {
        Err(malformed(format!("{}: {what}", self.who)))
    }

    fn lacking(&self, what: impl Into<String>) -> Result<(), BackendError> {
        Err(unsupported(&self.step.name, what))
    }

    /// Culling, depth and blending.
    fn state(&self) -> Result<(), BackendError> {
        let state = &self.draw.state;
        let features = &self.checker.device.features;
        if let Err(error) = state.validate(self.raster.colours.len()) {
            return self.malformed(error);
        }
        if let Some(depth) = &state.depth {
            if self.raster.depth.is_none() {
                return self.malformed("its state compares depth, and the pass has none");
            }
            let bias = &depth.bias;
            if !bias.is_none() && bias.clamp != 0.0 && !features.depth_bias_clamp {
                return self.lacking(feature("depthBiasClamp", "a depth bias with a clamp"));
            }
        }
        for (index, target) in self.raster.colours.iter().enumerate() {
            if state.target(index).blend.is_none() {
                continue;
            }
            let desc = self.checker.texture(&self.who, target.resource)?;
            let format = convert::format(desc.format).unwrap_or_default();
            let offered = self.checker.format_features(format).optimal_tiling_features;
            if !offered.contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND) {
                return self.lacking(format!("blending into the format {}", desc.format));
            }
        }
        let count = self.raster.colours.len();
        let differ = (1..count).any(|index| state.target(index) != state.target(0));
        if differ && !features.independent_blend {
            return self.lacking(feature(
                "independentBlend",
                "colour targets that are blended or masked differently",
            ));
        }
        Ok(())
    }

    /// What is written must be put out, in the kind of the target.
    fn outputs(&self, interface: &RasterStages) -> Result<(), BackendError> {
        let outputs = interface.fragment.as_ref().map(|stage| &stage.outputs[..]);
        for (index, target) in self.raster.colours.iter().enumerate() {
            let state = self.draw.state.target(index);
            let output = outputs
                .unwrap_or(&[])
                .iter()
                .find(|output| usize::try_from(output.location) == Ok(index));
            let desc = self.checker.texture(&self.who, target.resource)?;
            let kind = match desc.format.sample_kind() {
                SampleKind::Float | SampleKind::Depth => NumberKind::Float,
                SampleKind::Sint => NumberKind::Sint,
                SampleKind::Uint => NumberKind::Uint,
            };
            let writes = state.writes != etalon_core::raster::ColourWrites::NONE;
            let fits = match output {
                Some(output) => output.kind == kind,
                None => !writes && state.blend.is_none(),
            };
            if !fits {
                return self.malformed(format!(
                    "target {index} is {}, and the kernel puts out {output:?}",
                    desc.format
                ));
            }
        }
        Ok(())
    }

    /// What vertex kernels are fed with.
    fn layouts(&self, interface: &RasterStages) -> Result<(), BackendError> {
        let limits = &self.checker.device.physical.limits;
        let inputs = &interface.vertex.inputs;
        let buffers = self.draw.vertices.len();
        let mut locations = Vec::new();
        for vertices in &self.draw.vertices {
            if vertices.layout.stride > limits.max_vertex_input_binding_stride {
                return self.lacking(format!(
                    "a stride of {} bytes (at most {})",
                    vertices.layout.stride, limits.max_vertex_input_binding_stride
                ));
            }
            for attribute in &vertices.layout.attributes {
                let input = inputs
                    .iter()
                    .find(|input| input.location == attribute.location);
                let fits = input.is_some_and(|input| input.kind == attribute.format.kind());
                if !fits || locations.contains(&attribute.location) {
                    return self.malformed(format!("{attribute:?} does not suit the kernel"));
                }
                locations.push(attribute.location);
                let alignment = attribute.format.bytes().min(4);
                let end = attribute.offset.checked_add(attribute.format.bytes());
                if !attribute.offset.is_multiple_of(alignment)
                    || !vertices.layout.stride.is_multiple_of(4)
                    || end.is_none_or(|end| end > vertices.layout.stride)
                {
                    return self.malformed(format!(
                        "{attribute:?} cannot be read in elements of {} bytes",
                        vertices.layout.stride
                    ));
                }
                if attribute.offset > limits.max_vertex_input_attribute_offset {
                    return self.lacking(format!(
                        "a vertex input {} bytes into its element (at most {})",
                        attribute.offset, limits.max_vertex_input_attribute_offset
                    ));
                }
                let known = convert::vertex_format(attribute.format).unwrap_or_default();
                let offered = self.checker.format_features(known).buffer_features;
                if !offered.contains(vk::FormatFeatureFlags::VERTEX_BUFFER) {
                    return self.lacking(format!("vertices of {:?}", attribute.format));
                }
            }
        }
        if locations.len() != inputs.len() {
            return self.malformed("the kernel has inputs that are not fed");
        }
        let last = locations.iter().max().map_or(0, |location| location + 1);
        for (what, count, most) in [
            (
                "vertex buffers",
                u32::try_from(buffers).unwrap_or(u32::MAX),
                limits.max_vertex_input_bindings,
            ),
            (
                "locations of vertex inputs",
                last,
                limits.max_vertex_input_attributes,
            ),
        ] {
            if count > most {
                return self.lacking(format!("{count} {what} (at most {most})"));
            }
        }
        Ok(())
    }

    /// A buffer that is read from a byte on, which is to be a multiple of
    /// something, up to a last byte.
    fn slice(
        &self,
        (buffer, usage): (u32, Usage),
        (offset, multiple): (u64, u64),
        end: Option<u64>,
    ) -> Result<(), BackendError> {
        let bytes = self.checker.buffer(&self.who, buffer)?.bytes;
        self.checker.used(&self.who, buffer, usage)?;
        if offset.is_multiple_of(multiple) && offset < bytes && end.is_some_and(|end| end <= bytes)
        {
            Ok(())
        } else {
            self.malformed(format!(
                "it reads a buffer of {bytes} bytes as {usage:?} from byte {offset} on"
            ))
        }
    }

    fn vertices(&self, vertices: &PlannedVertices) -> Result<(), BackendError> {
        let tail = vertices
            .layout
            .attributes
            .iter()
            .map(|attribute| u64::from(attribute.offset) + u64::from(attribute.format.bytes()))
            .max()
            .unwrap_or(0);
        // The last element that the plan knows will be read.
        let last = match (&self.draw.extent, vertices.layout.step) {
            (DrawExtent::Direct { instances, .. }, StepMode::Instance) => Some(instances.end - 1),
            (DrawExtent::Direct { elements, .. }, StepMode::Vertex)
                if self.draw.indices.is_none() =>
            {
                Some(elements.end - 1)
            }
            _ => None,
        };
        let end = match last {
            Some(last) => (u64::from(last) * u64::from(vertices.layout.stride))
                .checked_add(tail)
                .and_then(|end| end.checked_add(vertices.offset)),
            None => Some(0),
        };
        let source = (vertices.buffer, Usage::Vertices);
        self.slice(source, (vertices.offset, 4), end)?;
        let robust = self.checker.device.features.robust_buffer_access;
        if last.is_none() && !vertices.layout.attributes.is_empty() && !robust {
            return self.lacking(feature(
                "robustBufferAccess",
                "draws whose vertices only the device knows",
            ));
        }
        Ok(())
    }

    fn indices(&self) -> Result<(), BackendError> {
        let Some(indices) = &self.draw.indices else {
            return Ok(());
        };
        if indices.format == IndexFormat::Uint32
            && !self.checker.device.features.full_draw_index_uint32
        {
            return self.lacking(feature("fullDrawIndexUint32", "indices of 32 bits"));
        }
        let each = u64::from(indices.format.bytes());
        let end = match &self.draw.extent {
            DrawExtent::Direct { elements, .. } => {
                (u64::from(elements.end) * each).checked_add(indices.offset)
            }
            DrawExtent::Indirect { .. } => Some(0),
        };
        let source = (indices.buffer, Usage::Indices);
        self.slice(source, (indices.offset, each), end)
    }

    fn records(&self) -> Result<(), BackendError> {
        let DrawExtent::Indirect {
            buffer,
            offset,
            draws,
        } = self.draw.extent
        else {
            return Ok(());
        };
        if !self.checker.device.features.draw_indirect_first_instance {
            return self.lacking(feature("drawIndirectFirstInstance", "indirect draws"));
        }
        let each = if self.draw.indices.is_some() { 20 } else { 16 };
        let end = (u64::from(draws) * each).checked_add(offset);
        self.slice((buffer, Usage::Indirect), (offset, 4), end)
    }
}

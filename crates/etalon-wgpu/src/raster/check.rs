//! Holding a step of draws against a device before anything is made for it.
//!
//! What wgpu would refuse only as it records, or not at all because SPIR-V is
//! handed through, is refused here.

use std::collections::BTreeSet;

use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::format::SampleKind;
use etalon_core::graph::ClearValue;
use etalon_core::kernel::{BindingKind, RasterStages};
use etalon_core::plan::{
    DrawExtent, PlannedDraw, PlannedIndices, PlannedTarget, PlannedVertices, RasterStep,
};
use etalon_core::raster::{MAX_COLOUR_TARGETS, NumberKind, StepMode, TargetState, Topology};

use super::convert;
use crate::check::Checker;

/// Checks targets and draws.
pub(crate) fn check(checker: &Checker<'_>, step: &RasterStep) -> Result<(), BackendError> {
    let formats = targets(checker, step)?;
    let [width, height] = step.size;
    step.viewport
        .validate(width, height)
        .and_then(|()| step.scissor.validate(width, height))
        .map_err(|error| checker.malformed(error))?;
    for draw in &step.draws {
        let drawn = Drawn {
            checker,
            step,
            draw,
            formats: &formats,
        };
        drawn.check()?;
    }
    Ok(())
}

/// Checks the targets; the formats of the colour targets.
fn targets(checker: &Checker<'_>, step: &RasterStep) -> Result<Vec<Format>, BackendError> {
    let limits = checker.gpu.raw_limits();
    let count = step.colours.len();
    if count == 0 && step.depth.is_none() {
        return Err(checker.malformed("it has no target"));
    }
    let most = (limits.max_color_attachments as usize).min(MAX_COLOUR_TARGETS);
    if count > most {
        return Err(checker.unsupported(format!("{count} colour targets (at most {most})")));
    }
    let mut seen = BTreeSet::new();
    let (mut formats, mut bytes) = (Vec::with_capacity(count), 0_u32);
    let colours = step.colours.iter().map(|target| (target, false));
    for (target, is_depth) in colours.chain(step.depth.iter().map(|target| (target, true))) {
        let (format, raw) = self::target(checker, step, target, is_depth)?;
        if !seen.insert((target.resource, target.range.mip, target.range.layer)) {
            return Err(checker.malformed("one target is given twice"));
        }
        if !is_depth {
            let size = |size: Option<u32>| size.unwrap_or_else(|| format.texel_bytes());
            bytes = bytes.next_multiple_of(size(raw.target_component_alignment()).max(1))
                + size(raw.target_pixel_byte_cost());
            formats.push(format);
        }
    }
    let most = limits.max_color_attachment_bytes_per_sample;
    if bytes > most {
        return Err(checker.unsupported(format!(
            "colour targets of {bytes} bytes a pixel (at most {most})"
        )));
    }
    Ok(formats)
}

fn target(
    checker: &Checker<'_>,
    step: &RasterStep,
    target: &PlannedTarget,
    is_depth: bool,
) -> Result<(Format, wgpu::TextureFormat), BackendError> {
    let desc = checker.texture(target.resource, target.range)?;
    let format = desc.format;
    let size = desc.mip_extent(target.range.mip);
    if (target.range.mips, target.range.layers) != (1, 1)
        || [size.width, size.height] != step.size
        || is_depth != (format.sample_kind() == SampleKind::Depth)
    {
        return Err(checker.malformed(format_args!(
            "a target is not one mip and layer of {:?} {} pixels",
            step.size,
            if is_depth { "depth" } else { "colour" }
        )));
    }
    let raw = match checker.gpu.format(format) {
        Some((raw, features))
            if features
                .allowed_usages
                .contains(wgpu::TextureUsages::RENDER_ATTACHMENT) =>
        {
            raw
        }
        _ => return Err(checker.unsupported(format!("draws to {format} textures"))),
    };
    match (target.clear, format.sample_kind()) {
        (None, _)
        | (Some(ClearValue::Float(_)), SampleKind::Float | SampleKind::Depth)
        | (Some(ClearValue::Sint(_)), SampleKind::Sint)
        | (Some(ClearValue::Uint(_)), SampleKind::Uint) => {}
        (Some(_), _) => {
            return Err(checker.malformed(format_args!("{format} is cleared to another kind")));
        }
    }
    Ok((format, raw))
}

const fn kind(format: Format) -> NumberKind {
    match format.sample_kind() {
        SampleKind::Float | SampleKind::Depth => NumberKind::Float,
        SampleKind::Sint => NumberKind::Sint,
        SampleKind::Uint => NumberKind::Uint,
    }
}

/// Checks one draw.
struct Drawn<'a> {
    checker: &'a Checker<'a>,
    step: &'a RasterStep,
    draw: &'a PlannedDraw,
    formats: &'a [Format],
}

impl Drawn<'_> {
    fn check(&self) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        let kernel = &draw.kernel.0;
        let Some(stages) = kernel.raster() else {
            return Err(checker.malformed("it draws with a compute kernel"));
        };
        checker.bindings(kernel, &draw.bindings)?;
        let storage = kernel.bindings.iter().any(|binding| {
            matches!(
                binding.kind,
                BindingKind::StorageBuffer { .. } | BindingKind::StorageTexture { .. }
            )
        });
        let stored = wgpu::DownlevelFlags::VERTEX_STORAGE | wgpu::DownlevelFlags::FRAGMENT_STORAGE;
        if storage && !checker.gpu.has(stored) {
            return Err(checker.unsupported("storage bindings of draws"));
        }
        self.outputs(stages)?;
        self.state(stages)?;
        self.vertices(stages)?;
        if let Some(indices) = &draw.indices {
            self.indices(indices)?;
        }
        self.extent()
    }

    /// Every output has a target that takes it, and every target that is written
    /// has an output.
    fn outputs(&self, stages: &RasterStages) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        if draw.state.targets.len() != self.formats.len() {
            return Err(checker.malformed("a draw has more or fewer targets than the pass"));
        }
        let outputs = match &stages.fragment {
            Some(fragment) => fragment.outputs.as_slice(),
            None => &[],
        };
        for output in outputs {
            let format = self.formats.get(output.location as usize);
            let Some(format) = format.filter(|format| kind(**format) == output.kind) else {
                return Err(checker.malformed(format_args!("no target takes `{}`", output.name)));
            };
            if output.components < format.channels() {
                return Err(checker.unsupported(format!(
                    "`{}` of {} numbers drawn to {format} (WebGPU wants {})",
                    output.name,
                    output.components,
                    format.channels()
                )));
            }
        }
        for (location, (state, format)) in draw.state.targets.iter().zip(self.formats).enumerate() {
            let written = outputs
                .iter()
                .any(|output| output.location as usize == location);
            let writes = state.writes;
            if !written && (writes.red || writes.green || writes.blue || writes.alpha) {
                return Err(checker.malformed(format_args!(
                    "target {location} is written, and no output goes there"
                )));
            }
            let blends = checker.gpu.format(*format).is_some_and(|(_, features)| {
                features
                    .flags
                    .contains(wgpu::TextureFormatFeatureFlags::BLENDABLE)
            });
            if state.blend.is_some() && !blends {
                return Err(checker.unsupported(format!("blending with {format}")));
            }
        }
        let alike = |pair: &[TargetState]| pair[0] == pair[1];
        if !draw.state.targets.windows(2).all(alike)
            && !checker.gpu.has(wgpu::DownlevelFlags::INDEPENDENT_BLEND)
        {
            return Err(checker.unsupported("targets that are blended or masked differently"));
        }
        Ok(())
    }

    fn state(&self, stages: &RasterStages) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        let state = &draw.state;
        state
            .validate(self.formats.len())
            .map_err(|error| checker.malformed(error))?;
        let own = stages
            .fragment
            .as_ref()
            .is_some_and(|fragment| fragment.writes_depth);
        if self.step.depth.is_none() {
            if state.depth.is_some() {
                return Err(checker.malformed("a draw compares depth, and there is none"));
            }
            if own {
                return Err(checker.unsupported("a kernel's own depth without a depth target"));
            }
        }
        let clamped = state
            .depth
            .is_some_and(|depth| !depth.bias.is_none() && depth.bias.clamp != 0.0);
        if clamped && !checker.gpu.has(wgpu::DownlevelFlags::DEPTH_BIAS_CLAMP) {
            return Err(checker.unsupported("a depth bias with a limit"));
        }
        if checker.gpu.is_gl()
            && state.topology == Topology::TriangleStrip
            && draw.indices.is_some()
        {
            // wgpu does not switch on the restart there.
            return Err(checker.unsupported("indexed strips"));
        }
        Ok(())
    }

    /// Every input is fed with numbers of its kind, from where a device can read.
    fn vertices(&self, stages: &RasterStages) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        let limits = checker.gpu.raw_limits();
        let attributes = || draw.vertices.iter().flat_map(|it| &it.layout.attributes);
        for (what, given, most) in [
            (
                "vertex buffers",
                draw.vertices.len(),
                limits.max_vertex_buffers,
            ),
            (
                "vertex inputs",
                attributes().count(),
                limits.max_vertex_attributes,
            ),
            // A draw has one bind group.
            (
                "bind groups and vertex buffers",
                draw.vertices.len() + 1,
                limits.max_bind_groups_plus_vertex_buffers,
            ),
        ] {
            if given > most as usize {
                return Err(checker.unsupported(format!("{given} {what} (at most {most})")));
            }
        }
        let mut fed = BTreeSet::new();
        for attribute in attributes() {
            let input = stages
                .vertex
                .inputs
                .iter()
                .find(|input| input.location == attribute.location);
            let location = attribute.location;
            if input.is_none_or(|input| input.kind != attribute.format.kind())
                || !fed.insert(location)
            {
                return Err(checker.malformed(format_args!(
                    "what is fed to location {location} is not what the kernel takes there"
                )));
            }
            if location >= limits.max_vertex_attributes {
                return Err(checker.unsupported(format!("a vertex input at location {location}")));
            }
            if convert::vertex_format(attribute.format).is_none() {
                return Err(checker.unsupported(format!("{:?} vertices", attribute.format)));
            }
        }
        if fed.len() != stages.vertex.inputs.len() {
            return Err(checker.malformed("a vertex input is not fed"));
        }
        draw.vertices
            .iter()
            .try_for_each(|vertices| self.vertex_buffer(vertices))
    }

    fn vertex_buffer(&self, vertices: &PlannedVertices) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        let bytes = checker.buffer(vertices.buffer)?;
        let (stride, offset) = (vertices.layout.stride, vertices.offset);
        let most = checker.gpu.raw_limits().max_vertex_buffer_array_stride;
        if stride > most {
            return Err(
                checker.unsupported(format!("vertices of {stride} bytes each (at most {most})"))
            );
        }
        let mut tail = 0;
        for attribute in &vertices.layout.attributes {
            let size = attribute.format.bytes();
            tail = tail.max(u64::from(attribute.offset) + u64::from(size));
            if !attribute.offset.is_multiple_of(size.min(4)) {
                return Err(checker.malformed("a vertex input is not aligned"));
            }
        }
        if !stride.is_multiple_of(4) || !offset.is_multiple_of(4) || tail > stride.into() {
            return Err(checker.malformed("its vertices are not aligned, or overlap"));
        }
        if vertices.layout.attributes.is_empty() || draw.extent.is_none() {
            return Ok(());
        }
        // The last element that is read for sure; those that indices or records
        // name only the device sees.
        let last = match &draw.extent {
            DrawExtent::Indirect { .. } => 0,
            DrawExtent::Direct {
                elements,
                instances,
                ..
            } => match vertices.layout.step {
                StepMode::Instance => instances.end - 1,
                StepMode::Vertex if draw.indices.is_none() => elements.end - 1,
                StepMode::Vertex => 0,
            },
        };
        // Neither overflows: 32 bits times 32 bits and a little.
        let end = u64::from(last) * u64::from(stride) + tail;
        if offset.checked_add(end).is_none_or(|end| end > bytes) {
            return Err(checker.unsupported(format!(
                "vertices up to byte {end} behind byte {offset} of a buffer of {bytes}"
            )));
        }
        Ok(())
    }

    fn indices(&self, indices: &PlannedIndices) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        let bytes = checker.buffer(indices.buffer)?;
        let size = u64::from(indices.format.bytes());
        if !indices.offset.is_multiple_of(size) {
            return Err(checker.malformed("its indices are not aligned"));
        }
        if draw.extent.is_none() {
            return Ok(());
        }
        let count = match &draw.extent {
            DrawExtent::Direct { elements, .. } => u64::from(elements.end),
            DrawExtent::Indirect { .. } => 1,
        };
        let end = indices.offset.checked_add(count * size);
        if end.is_none_or(|end| end > bytes) {
            return Err(checker.unsupported(format!(
                "{count} indices behind byte {} of a buffer of {bytes}",
                indices.offset
            )));
        }
        Ok(())
    }

    fn extent(&self) -> Result<(), BackendError> {
        let Self { checker, draw, .. } = self;
        match &draw.extent {
            DrawExtent::Direct {
                elements,
                base_vertex,
                instances,
            } => {
                if elements.start > elements.end || instances.start > instances.end {
                    return Err(checker.malformed("its elements end before they begin"));
                }
                let based = *base_vertex != 0 && draw.indices.is_some();
                if based && !checker.gpu.has(wgpu::DownlevelFlags::BASE_VERTEX) {
                    return Err(checker.unsupported("a base vertex"));
                }
                Ok(())
            }
            DrawExtent::Indirect {
                buffer,
                offset,
                draws,
            } => {
                if *draws == 0 {
                    return Ok(());
                }
                if !checker.gpu.has(wgpu::DownlevelFlags::INDIRECT_EXECUTION) {
                    return Err(checker.unsupported("indirect draws"));
                }
                // Without, a first instance in a record makes wgpu drop the draw,
                // and nobody can tell beforehand.
                if !checker.gpu.draws_first_instances() {
                    return Err(checker.unsupported("indirect draws (INDIRECT_FIRST_INSTANCE)"));
                }
                let bytes = checker.buffer(*buffer)?;
                let records = u64::from(*draws) * record_bytes(draw);
                let end = offset.checked_add(records);
                if offset.is_multiple_of(4) && end.is_some_and(|end| end <= bytes) {
                    Ok(())
                } else {
                    Err(checker.malformed("its records are outside of their buffer"))
                }
            }
        }
    }
}

/// Bytes of a record of an indirect draw.
const fn record_bytes(draw: &PlannedDraw) -> u64 {
    match draw.indices {
        Some(_) => 20,
        None => 16,
    }
}

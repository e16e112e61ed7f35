//! Pipelines that draw: one for each kernel, state, layout of vertices and
//! formats of targets.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use ash::vk;
use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::graph::ResourceDesc;
use etalon_core::kernel::{Kernel, KernelId};
use etalon_core::plan::{Plan, PlannedAttribute, PlannedDraw, PlannedTarget, RasterStep};
use etalon_core::raster::{CullMode, FrontFace, RasterState, StepMode, TargetState, Topology};
use etalon_core::resource::Compare;

use crate::convert;
use crate::device::{Device, count};
use crate::error::malformed;
use crate::layout::Layout;
use crate::pipeline::{Module, Pipeline, check, translate};

/// What a pass draws to.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Formats {
    colours: Vec<Format>,
    depth: Option<Format>,
}

impl Formats {
    /// The formats of a step's targets, in a plan that has been checked.
    pub(crate) fn of(plan: &Plan, raster: &RasterStep) -> Self {
        let format = |target: &PlannedTarget| {
            let index = usize::try_from(target.resource).ok()?;
            match plan.resources.get(index)?.desc {
                ResourceDesc::Texture(desc) => Some(desc.format),
                ResourceDesc::Buffer(_) => None,
            }
        };
        Self {
            colours: raster.colours.iter().filter_map(format).collect(),
            depth: raster.depth.as_ref().and_then(format),
        }
    }
}

/// A depth state; numbers by their bits, so that it can be looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct DepthKey {
    compare: Compare,
    write: bool,
    constant: i32,
    slope: u32,
    clamp: u32,
}

/// The elements of a vertex buffer.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct VerticesKey {
    stride: u32,
    step: StepMode,
    attributes: Vec<PlannedAttribute>,
}

/// Everything that tells one pipeline from another.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    kernel: KernelId,
    vertices: Vec<VerticesKey>,
    topology: Topology,
    front: FrontFace,
    cull: CullMode,
    depth: Option<DepthKey>,
    targets: Vec<TargetState>,
    formats: Formats,
}

impl Key {
    fn new(draw: &PlannedDraw, formats: &Formats) -> Self {
        let state = &draw.state;
        let vertices = draw.vertices.iter().map(|vertices| VerticesKey {
            stride: vertices.stride,
            step: vertices.step,
            attributes: vertices.attributes.clone(),
        });
        Self {
            kernel: draw.kernel.0.id,
            vertices: vertices.collect(),
            topology: state.topology,
            front: state.front,
            cull: state.cull,
            depth: state.depth.map(|depth| DepthKey {
                compare: depth.compare,
                write: depth.write,
                constant: depth.bias.constant,
                slope: depth.bias.slope.to_bits(),
                clamp: depth.bias.clamp.to_bits(),
            }),
            targets: (0..formats.colours.len())
                .map(|index| state.target(index))
                .collect(),
            formats: formats.clone(),
        }
    }
}

/// A kernel's stages as SPIR-V, and what it binds.
struct Stages {
    layout: Arc<Layout>,
    vertex: Vec<u32>,
    fragment: Option<Vec<u32>>,
}

/// Kernels that draw and their pipelines.
#[derive(Default)]
pub(crate) struct DrawPipelines {
    stages: HashMap<KernelId, Stages>,
    pipelines: HashMap<Key, Arc<Pipeline>>,
}

impl DrawPipelines {
    /// The pipeline of a draw in a plan that has been checked.
    pub(crate) fn get(
        &mut self,
        device: &Arc<Device>,
        draw: &PlannedDraw,
        formats: &Formats,
        step: &str,
    ) -> Result<Arc<Pipeline>, BackendError> {
        let key = Key::new(draw, formats);
        if let Some(pipeline) = self.pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        let kernel = &draw.kernel.0;
        let stages = match self.stages.entry(kernel.id) {
            Entry::Occupied(found) => found.into_mut(),
            Entry::Vacant(free) => free.insert(Stages::new(device, kernel, step)?),
        };
        let made = pipeline(device, kernel, stages, &key, &draw.state)?;
        self.pipelines.insert(key, made.clone());
        Ok(made)
    }
}

impl Stages {
    fn new(device: &Arc<Device>, kernel: &Kernel, step: &str) -> Result<Self, BackendError> {
        check(device, kernel, step)?;
        let vertex = translate(kernel, naga::ShaderStage::Vertex, step)?;
        let has_fragment = kernel
            .raster()
            .is_some_and(|stages| stages.fragment.is_some());
        let fragment = has_fragment
            .then(|| translate(kernel, naga::ShaderStage::Fragment, step))
            .transpose()?;
        count(&device.tally.kernels, 1);
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        Ok(Self {
            layout: Layout::new(device, kernel, stages)?,
            vertex,
            fragment,
        })
    }
}

fn pipeline(
    device: &Arc<Device>,
    kernel: &Kernel,
    stages: &Stages,
    key: &Key,
    state: &RasterState,
) -> Result<Arc<Pipeline>, BackendError> {
    let names = kernel
        .raster()
        .ok_or_else(|| malformed(format!("kernel `{}` draws nothing", kernel.name)))?;
    let vertex = Module::new(device, &stages.vertex, &names.vertex.entry_point)?;
    let fragment = match (&stages.fragment, &names.fragment) {
        (Some(words), Some(stage)) => Some(Module::new(device, words, &stage.entry_point)?),
        _ => None,
    };
    let mut modules = vec![vertex.stage(vk::ShaderStageFlags::VERTEX)];
    modules.extend(
        fragment
            .as_ref()
            .map(|module| module.stage(vk::ShaderStageFlags::FRAGMENT)),
    );
    let (buffers, attributes) = vertex_input(&key.vertices);
    let vertex_input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_binding_descriptions(&buffers)
        .vertex_attribute_descriptions(&attributes);
    let (topology, strips) = match key.topology {
        Topology::TriangleList => (vk::PrimitiveTopology::TRIANGLE_LIST, false),
        Topology::TriangleStrip => (vk::PrimitiveTopology::TRIANGLE_STRIP, true),
    };
    // In lists the largest index is one like any other.
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
        .topology(topology)
        .primitive_restart_enable(strips);
    let viewport = vk::PipelineViewportStateCreateInfo::default()
        .viewport_count(1)
        .scissor_count(1);
    let multisample = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let targets: Vec<_> = key.targets.iter().map(convert::target_state).collect();
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&targets);
    let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
    let colours: Vec<_> = key
        .formats
        .colours
        .iter()
        .map(|format| convert::format(*format).unwrap_or_default())
        .collect();
    let mut rendering = vk::PipelineRenderingCreateInfo::default()
        .color_attachment_formats(&colours)
        .depth_attachment_format(
            key.formats
                .depth
                .and_then(convert::format)
                .unwrap_or_default(),
        );
    let rasterization = rasterization(state);
    let depth = depth(state);
    let info = vk::GraphicsPipelineCreateInfo::default()
        .stages(&modules)
        .vertex_input_state(&vertex_input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&rasterization)
        .multisample_state(&multisample)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(stages.layout.raw)
        .push_next(&mut rendering);
    // SAFETY: modules and layout were made for each other from one kernel. The
    // plan was checked: vertex inputs, formats, states and counts are what the
    // device has, with the features they need, and `dynamicRendering` is on.
    let made = unsafe {
        device
            .raw
            .create_graphics_pipelines(vk::PipelineCache::null(), &[info], None)
    };
    let call = "vkCreateGraphicsPipelines";
    let point = vk::PipelineBindPoint::GRAPHICS;
    Pipeline::made(device, kernel, stages.layout.clone(), point, call, made)
}

fn vertex_input(
    vertices: &[VerticesKey],
) -> (
    Vec<vk::VertexInputBindingDescription>,
    Vec<vk::VertexInputAttributeDescription>,
) {
    let numbered = || (0_u32..).zip(vertices);
    let buffers = numbered().map(|(binding, vertices)| vk::VertexInputBindingDescription {
        binding,
        stride: vertices.stride,
        input_rate: match vertices.step {
            StepMode::Vertex => vk::VertexInputRate::VERTEX,
            StepMode::Instance => vk::VertexInputRate::INSTANCE,
        },
    });
    let attributes = numbered().flat_map(|(binding, vertices)| {
        let one = move |attribute: &PlannedAttribute| vk::VertexInputAttributeDescription {
            location: attribute.location,
            binding,
            format: convert::vertex_format(attribute.format).unwrap_or_default(),
            offset: attribute.offset,
        };
        vertices.attributes.iter().map(one)
    });
    (buffers.collect(), attributes.collect())
}

/// Viewports of negative height turn the picture over before Vulkan looks which
/// way around the corners of a triangle are, so a front is what it is called.
fn rasterization(state: &RasterState) -> vk::PipelineRasterizationStateCreateInfo<'static> {
    let info = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .front_face(match state.front {
            FrontFace::CounterClockwise => vk::FrontFace::COUNTER_CLOCKWISE,
            FrontFace::Clockwise => vk::FrontFace::CLOCKWISE,
        })
        .cull_mode(match state.cull {
            CullMode::None => vk::CullModeFlags::NONE,
            CullMode::Front => vk::CullModeFlags::FRONT,
            CullMode::Back => vk::CullModeFlags::BACK,
        })
        .line_width(1.0);
    match state.depth.map(|depth| depth.bias) {
        Some(bias) if !bias.is_none() => info
            .depth_bias_enable(true)
            .depth_bias_constant_factor(bias.constant as f32)
            .depth_bias_slope_factor(bias.slope)
            .depth_bias_clamp(bias.clamp),
        _ => info,
    }
}

fn depth(state: &RasterState) -> vk::PipelineDepthStencilStateCreateInfo<'static> {
    let info = vk::PipelineDepthStencilStateCreateInfo::default();
    match &state.depth {
        Some(depth) => info
            .depth_test_enable(true)
            .depth_write_enable(depth.write)
            .depth_compare_op(convert::compare_op(depth.compare)),
        None => info,
    }
}

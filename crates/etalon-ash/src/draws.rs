//! Pipelines that draw: one for each kernel, state, layout of vertices and
//! formats of targets.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{Kernel, KernelId};
use etalon_core::plan::{DrawForm, PlannedAttribute, PlannedLayout};
use etalon_core::raster::{CullMode, FrontFace, RasterState, StepMode, Topology};

use crate::convert;
use crate::device::{Device, count};
use crate::error::malformed;
use crate::layout::Layout;
use crate::pipeline::{Module, Pipeline, check, translate};

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
    pipelines: HashMap<DrawForm, Arc<Pipeline>>,
}

impl DrawPipelines {
    /// The pipeline for draws of a form, with the form's kernel.
    pub(crate) fn get(
        &mut self,
        device: &Arc<Device>,
        kernel: &Kernel,
        form: DrawForm,
        step: &str,
    ) -> Result<Arc<Pipeline>, BackendError> {
        if let Some(pipeline) = self.pipelines.get(&form) {
            return Ok(pipeline.clone());
        }
        let stages = match self.stages.entry(kernel.id) {
            Entry::Occupied(found) => found.into_mut(),
            Entry::Vacant(free) => free.insert(Stages::new(device, kernel, step)?),
        };
        let made = pipeline(device, kernel, stages, &form)?;
        self.pipelines.insert(form, made.clone());
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
    form: &DrawForm,
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
    let (buffers, attributes) = vertex_input(&form.vertices);
    let vertex_input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_binding_descriptions(&buffers)
        .vertex_attribute_descriptions(&attributes);
    let (topology, strips) = match form.state.topology {
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
    let targets = (0..form.colours.len()).map(|index| form.state.target(index));
    let targets: Vec<_> = targets.map(|state| convert::target_state(&state)).collect();
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&targets);
    let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
    let colours: Vec<_> = form
        .colours
        .iter()
        .map(|format| convert::format(*format).unwrap_or_default())
        .collect();
    let mut rendering = vk::PipelineRenderingCreateInfo::default()
        .color_attachment_formats(&colours)
        .depth_attachment_format(form.depth.and_then(convert::format).unwrap_or_default());
    let rasterization = rasterization(&form.state);
    let depth = depth(&form.state);
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
    vertices: &[PlannedLayout],
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

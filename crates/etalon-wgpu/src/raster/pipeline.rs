//! Render pipelines, and the shaders that they share.

use std::collections::HashMap;
use std::sync::Arc;

use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{Kernel, KernelId};
use etalon_core::plan::{DrawForm, PlannedDraw};
use etalon_core::raster::{IndexFormat, Topology};

use super::{convert, stages};
use crate::gpu::Gpu;
use crate::pipeline::{check_needs, layout_entry, translated};
use crate::spirv;

/// The format of the indices of a draw, if they make a strip.
fn strip(draw: &PlannedDraw) -> Option<IndexFormat> {
    match draw.state.topology {
        Topology::TriangleList => None,
        Topology::TriangleStrip => draw.indices.map(|indices| indices.format),
    }
}

/// A kernel on a device, before anything is known of what it draws.
#[derive(Debug)]
pub(super) struct Shaders {
    vertex: wgpu::ShaderModule,
    fragment: Option<wgpu::ShaderModule>,
    layout: wgpu::PipelineLayout,
    /// Of its bind group.
    pub(super) group: wgpu::BindGroupLayout,
}

/// A kernel, ready to draw in one way.
#[derive(Debug)]
pub(crate) struct RenderPipeline {
    pub(super) raw: wgpu::RenderPipeline,
    pub(super) shaders: Arc<Shaders>,
}

/// Every pipeline there is, and what they share.
#[derive(Debug, Default)]
pub(crate) struct Pipelines {
    /// By form and, of strips, the format of the indices.
    known: HashMap<(DrawForm, Option<IndexFormat>), Arc<RenderPipeline>>,
    shaders: HashMap<KernelId, Arc<Shaders>>,
    blank: Option<wgpu::ShaderModule>,
}

/// The fragments of kernels that have none, where there are colour targets all
/// the same: WebGPU has it that a pipeline without a fragment stage has no
/// colour targets.
const BLANK: &str = "@fragment fn blank() {}";

impl Pipelines {
    /// The pipeline of a draw, which `step` needs.
    pub(super) fn get(
        &mut self,
        gpu: &Gpu,
        step: &str,
        draw: &PlannedDraw,
        form: DrawForm,
    ) -> Result<Arc<RenderPipeline>, BackendError> {
        let key = (form, strip(draw));
        if let Some(pipeline) = self.known.get(&key) {
            return Ok(pipeline.clone());
        }
        let (form, strip) = &key;
        let kernel = &draw.kernel.0;
        let shaders = match self.shaders.get(&kernel.id) {
            Some(shaders) => shaders.clone(),
            None => {
                let made = Arc::new(Shaders::new(gpu, kernel, step)?);
                self.shaders.insert(kernel.id, made.clone());
                made
            }
        };
        if shaders.fragment.is_none() && !form.colours.is_empty() && self.blank.is_none() {
            let source = wgpu::ShaderModuleDescriptor {
                label: Some("etalon blank"),
                source: wgpu::ShaderSource::Wgsl(BLANK.into()),
            };
            let blank = gpu
                .guarded(|| gpu.device.create_shader_module(source))
                .map_err(|fault| fault.of_kernel(step))?;
            self.blank = Some(blank);
        }
        let raw = pipeline(
            gpu,
            step,
            kernel,
            (form, *strip),
            &shaders,
            self.blank.as_ref(),
        )?;
        let made = Arc::new(RenderPipeline { raw, shaders });
        self.known.insert(key, made.clone());
        Ok(made)
    }

    /// Drops what no prepared plan has.
    pub(crate) fn trim(&mut self) {
        self.known
            .retain(|_, pipeline| Arc::strong_count(pipeline) > 1);
        self.shaders
            .retain(|_, shaders| Arc::strong_count(shaders) > 1);
    }
}

impl Shaders {
    fn new(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<Self, BackendError> {
        check_needs(gpu, kernel, step)?;
        stages::check(gpu, kernel, step)?;
        let visible = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let entries = kernel
            .bindings
            .iter()
            .map(|binding| layout_entry(gpu, binding, visible, step))
            .collect::<Result<Vec<_>, _>>()?;
        let draws_colours = kernel
            .raster()
            .is_some_and(|stages| stages.fragment.is_some());
        let modules = if gpu.passes_spirv() {
            let module = |stage| spirv::module(gpu, kernel, stage);
            module(naga::ShaderStage::Vertex).and_then(|vertex| {
                let fragment = draws_colours.then(|| module(naga::ShaderStage::Fragment));
                Ok((vertex, fragment.transpose()?))
            })
        } else {
            translated(gpu, kernel).map(|both| {
                let fragment = draws_colours.then(|| both.clone());
                (both, fragment)
            })
        };
        let (vertex, fragment) = modules.map_err(|error| error.of(step))?;
        gpu.tally.kernels.add(1);
        let (group, layout) = gpu
            .guarded(|| {
                let device = &gpu.device;
                let group = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: Some(&kernel.name),
                    entries: &entries,
                });
                let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some(&kernel.name),
                    bind_group_layouts: &[Some(&group)],
                    immediate_size: 0,
                });
                (group, layout)
            })
            .map_err(|fault| fault.of_kernel(step))?;
        Ok(Self {
            vertex,
            fragment,
            layout,
            group,
        })
    }
}

fn pipeline(
    gpu: &Gpu,
    step: &str,
    kernel: &Kernel,
    (form, strip): (&DrawForm, Option<IndexFormat>),
    shaders: &Shaders,
    blank: Option<&wgpu::ShaderModule>,
) -> Result<wgpu::RenderPipeline, BackendError> {
    let attributes: Vec<_> = form
        .vertices
        .iter()
        .map(|vertices| convert::attributes(&vertices.attributes))
        .collect();
    let buffers: Vec<_> = form
        .vertices
        .iter()
        .zip(&attributes)
        .map(|(vertices, attributes)| convert::vertex_layout(vertices, attributes))
        .collect();
    let raw_format = |format: Format| gpu.format(format).map(|(raw, _)| raw);
    let targets: Vec<_> = form
        .colours
        .iter()
        .enumerate()
        .map(|(index, format)| {
            raw_format(*format).map(|raw| convert::target(&form.state.target(index), raw))
        })
        .collect();
    let depth_stencil = form
        .depth
        .and_then(raw_format)
        .map(|raw| convert::depth(form.state.depth.as_ref(), raw));
    let stages = kernel.raster();
    let module = match &shaders.fragment {
        Some(module) => Some((
            module,
            stages.and_then(|stages| stages.fragment.as_ref()?.entry_point.as_str().into()),
        )),
        // Depth alone takes no fragment stage, and is faster without.
        None if form.colours.is_empty() => None,
        None => blank.map(|module| (module, None)),
    };
    let raw = gpu
        .guarded(|| {
            gpu.device
                .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                    label: Some(&kernel.name),
                    layout: Some(&shaders.layout),
                    vertex: wgpu::VertexState {
                        module: &shaders.vertex,
                        entry_point: stages.map(|stages| stages.vertex.entry_point.as_str()),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        buffers: &buffers,
                    },
                    primitive: convert::primitive(&form.state, strip),
                    depth_stencil,
                    multisample: wgpu::MultisampleState::default(),
                    fragment: module.map(|(module, entry_point)| wgpu::FragmentState {
                        module,
                        entry_point,
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        targets: &targets,
                    }),
                    multiview_mask: None,
                    cache: None,
                })
        })
        .map_err(|fault| fault.of_kernel(step))?;
    gpu.tally.pipelines.add(1);
    Ok(raw)
}

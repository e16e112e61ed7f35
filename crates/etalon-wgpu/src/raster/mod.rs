//! Steps of draws: what they need on a device, and how they are recorded.

mod check;
mod convert;
mod pipeline;
mod stages;

use std::sync::Arc;

use etalon_core::backend::BackendError;
use etalon_core::graph::{ClearValue, ResourceDesc};
use etalon_core::plan::{
    Bound, DrawExtent, DrawForm, Plan, PlannedDraw, PlannedTarget, RasterStep,
};
use etalon_core::raster::MAX_COLOUR_TARGETS;

pub(crate) use check::check;
pub(crate) use pipeline::Pipelines;

use crate::bind::{BindContext, PerPhysical, Physical, Samplers, touched};
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::timing::Stamp;
use pipeline::RenderPipeline;

/// A step of draws, ready to be recorded for any targets of one shape.
#[derive(Debug)]
pub(crate) struct Raster {
    draws: Vec<PreparedDraw>,
    /// A view of each colour target, then of the depth target.
    views: PerPhysical<Vec<wgpu::TextureView>>,
}

#[derive(Debug)]
struct PreparedDraw {
    pipeline: Arc<RenderPipeline>,
    groups: PerPhysical<wgpu::BindGroup>,
}

/// Colour targets, then the depth target.
fn targets(step: &RasterStep) -> impl Iterator<Item = &PlannedTarget> + Clone {
    step.colours.iter().chain(&step.depth)
}

impl Raster {
    /// Makes what the draws need, whatever they are drawn to. The step must have
    /// been checked.
    pub(crate) fn new(
        gpu: &Gpu,
        plan: &Plan,
        name: &str,
        step: &RasterStep,
        pipelines: &mut Pipelines,
        samplers: &mut Samplers,
    ) -> Result<Self, BackendError> {
        let mut draws = Vec::with_capacity(step.draws.len());
        for draw in &step.draws {
            for bound in &draw.bindings {
                if let Bound::Sampler(desc) = bound {
                    samplers.add(gpu, desc)?;
                }
            }
            let form = DrawForm::new(plan, step, draw)
                .ok_or_else(|| unsupported(name, "a target that is no texture"))?;
            draws.push(PreparedDraw {
                pipeline: pipelines.get(gpu, name, draw, form)?,
                groups: PerPhysical::default(),
            });
        }
        Ok(Self {
            draws,
            views: PerPhysical::default(),
        })
    }

    /// Makes what recording with these textures and buffers lacks.
    pub(crate) fn prepare(
        &mut self,
        context: &BindContext<'_>,
        name: &str,
        step: &RasterStep,
    ) -> Result<(), BackendError> {
        let (gpu, physicals) = (context.gpu, context.physicals);
        let key = targets(step).filter_map(|target| physicals.get(target.resource as usize));
        self.views
            .select(key, || views(gpu, name, step, physicals))?;
        for (draw, prepared) in step.draws.iter().zip(&mut self.draws) {
            if draw.extent.is_none() {
                continue;
            }
            let layout = &prepared.pipeline.shaders.group;
            prepared
                .groups
                .select(touched(&draw.bindings, physicals), || {
                    context.group(name, &draw.kernel.0, layout, &draw.bindings)
                })?;
        }
        Ok(())
    }

    /// Forgets the textures and buffers it was prepared for.
    pub(crate) fn trim(&mut self) {
        self.views = PerPhysical::default();
        for draw in &mut self.draws {
            draw.groups = PerPhysical::default();
        }
    }

    /// Records the draws as a pass of their own.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        context: &Recording<'_>,
        name: &str,
        step: &RasterStep,
        stamp: Option<Stamp<'_>>,
    ) {
        let Some(views) = self.views.selected() else {
            return;
        };
        let mut colours = [const { None }; MAX_COLOUR_TARGETS];
        for ((attachment, target), view) in colours.iter_mut().zip(&step.colours).zip(views) {
            *attachment = Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: operations(target.clear.map(colour)),
            });
        }
        let depth = step.depth.as_ref().zip(views.get(step.colours.len()));
        let count = step.colours.len().min(MAX_COLOUR_TARGETS);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(name),
            color_attachments: &colours[..count],
            depth_stencil_attachment: depth.map(|(target, view)| {
                wgpu::RenderPassDepthStencilAttachment {
                    view,
                    depth_ops: Some(operations(target.clear.map(|value| match value {
                        ClearValue::Float([depth, ..]) => depth,
                        ClearValue::Sint(_) | ClearValue::Uint(_) => 0.0,
                    }))),
                    stencil_ops: None,
                }
            }),
            timestamp_writes: stamp.map(Stamp::of_render_pass),
            ..wgpu::RenderPassDescriptor::default()
        });
        let view = &step.viewport;
        pass.set_viewport(view.x, view.y, view.width, view.height, view.near, view.far);
        let part = &step.scissor;
        pass.set_scissor_rect(part.x, part.y, part.width, part.height);
        let mut last: Option<&Arc<RenderPipeline>> = None;
        for (draw, prepared) in step.draws.iter().zip(&self.draws) {
            if draw.extent.is_none() {
                continue;
            }
            let pipeline = &prepared.pipeline;
            if !last.is_some_and(|last| Arc::ptr_eq(last, pipeline)) {
                pass.set_pipeline(&pipeline.raw);
                last = Some(pipeline);
            }
            pass.set_bind_group(0, prepared.groups.selected(), &[]);
            // What is not there has been refused when the plan was prepared.
            if context.draw(&mut pass, draw).is_some() {
                context.gpu.tally.draws.add(1);
            }
        }
    }
}

/// What draws are recorded with.
pub(crate) struct Recording<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) plan: &'a Plan,
    pub(crate) physicals: &'a [Physical],
}

impl Recording<'_> {
    fn buffer(&self, index: u32) -> Option<&wgpu::Buffer> {
        self.physicals.get(index as usize)?.buffer()
    }

    /// A buffer from a byte on, as far as the plan knows it: an engine's may be
    /// larger.
    fn slice(&self, index: u32, offset: u64) -> Option<wgpu::BufferSlice<'_>> {
        match &self.plan.resources.get(index as usize)?.desc {
            ResourceDesc::Buffer(desc) if offset < desc.bytes => {
                Some(self.buffer(index)?.slice(offset..desc.bytes))
            }
            _ => None,
        }
    }

    /// Records one draw.
    fn draw(&self, pass: &mut wgpu::RenderPass<'_>, draw: &PlannedDraw) -> Option<()> {
        for (slot, vertices) in (0..).zip(&draw.vertices) {
            if !vertices.layout.attributes.is_empty() {
                pass.set_vertex_buffer(slot, self.slice(vertices.buffer, vertices.offset)?);
            }
        }
        if let Some(indices) = &draw.indices {
            let format = convert::index_format(indices.format);
            pass.set_index_buffer(self.slice(indices.buffer, indices.offset)?, format);
        }
        match &draw.extent {
            DrawExtent::Direct {
                elements,
                base_vertex,
                instances,
            } => match draw.indices {
                Some(_) => pass.draw_indexed(elements.clone(), *base_vertex, instances.clone()),
                None => pass.draw(elements.clone(), instances.clone()),
            },
            DrawExtent::Indirect {
                buffer,
                offset,
                draws,
            } => {
                let buffer = self.buffer(*buffer)?;
                match draw.indices {
                    Some(_) => pass.multi_draw_indexed_indirect(buffer, *offset, *draws),
                    None => pass.multi_draw_indirect(buffer, *offset, *draws),
                }
            }
        }
        Some(())
    }
}

fn operations<V: Default>(clear: Option<V>) -> wgpu::Operations<V> {
    wgpu::Operations {
        load: clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
        store: wgpu::StoreOp::Store,
    }
}

/// A value as wgpu takes it for every format: 64-bit floats hold 32-bit numbers
/// of each kind.
fn colour(value: ClearValue) -> wgpu::Color {
    let [r, g, b, a] = match value {
        ClearValue::Float(value) => value.map(f64::from),
        ClearValue::Sint(value) => value.map(f64::from),
        ClearValue::Uint(value) => value.map(f64::from),
    };
    wgpu::Color { r, g, b, a }
}

/// A view of each target, in the order of [`targets`].
fn views(
    gpu: &Gpu,
    name: &str,
    step: &RasterStep,
    physicals: &[Physical],
) -> Result<Vec<wgpu::TextureView>, BackendError> {
    let views: Option<Vec<_>> = gpu
        .guarded(|| {
            targets(step)
                .map(|target| {
                    let part = physicals.get(target.resource as usize)?.texture()?;
                    Some(part.view(wgpu::TextureViewDimension::D2, target.range))
                })
                .collect()
        })
        .map_err(|fault| fault.of("create_view", name, 0))?;
    let views = views.ok_or_else(|| BackendError::Api {
        call: "create_view",
        reason: format!("step `{name}`: a target is no texture"),
    })?;
    gpu.tally.views.add(views.len() as u64);
    Ok(views)
}

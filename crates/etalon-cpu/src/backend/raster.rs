//! Steps that draw.

use std::collections::HashMap;
use std::sync::Arc;

use etalon_core::backend::BackendError;
use etalon_core::kernel::Kernel;
use etalon_core::plan::{
    DrawExtent, DrawForm, Plan, PlannedAttribute, PlannedDraw, PlannedLayout, PlannedTarget,
    RasterStep,
};
use etalon_core::raster::{VertexAttribute, VertexLayout};

use super::histories::clear_texel;
use super::resources::Resources;
use super::{CpuBackend, StepSanitised, malformed};
use crate::error::RunError;
use crate::program::locate_of;
use crate::raster::{
    DrawRange, DrawWatch, IndexBuffer, RasterDesc, RasterDraw, RasterError, RasterProgram,
    VertexBuffer,
};

/// The programs of all draws, by what makes them.
#[derive(Debug, Default)]
pub(super) struct RasterPrograms(HashMap<DrawForm, RasterProgram>);

fn form(
    plan: &Plan,
    step: &str,
    raster: &RasterStep,
    draw: &PlannedDraw,
) -> Result<DrawForm, BackendError> {
    let form = DrawForm::new(plan, raster, draw);
    form.ok_or_else(|| malformed(step, "a target is no texture"))
}

/// What feeds a vertex kernel, by the names of its inputs.
fn layouts(kernel: &Kernel, form: &DrawForm) -> Vec<VertexLayout> {
    let inputs = kernel
        .raster()
        .map_or(&[][..], |stages| stages.vertex.inputs.as_slice());
    let attribute = |attribute: &PlannedAttribute| {
        let input = inputs
            .iter()
            .find(|input| input.location == attribute.location)?;
        Some(VertexAttribute {
            name: input.name.clone().into(),
            format: attribute.format,
            offset: attribute.offset,
        })
    };
    let layout = |layout: &PlannedLayout| VertexLayout {
        stride: layout.stride,
        step: layout.step,
        attributes: layout.attributes.iter().filter_map(attribute).collect(),
    };
    form.vertices.iter().map(layout).collect()
}

fn failed(step: &str, error: RasterError) -> BackendError {
    match error {
        RasterError::Run(RunError::OutOfMemory { what, bytes }) => {
            BackendError::OutOfMemory { what, bytes }
        }
        other => BackendError::Kernel {
            step: step.to_owned(),
            error: Box::new(other),
        },
    }
}

fn translate(
    kernel: &Arc<Kernel>,
    form: &DrawForm,
    sanitise: bool,
) -> Result<RasterProgram, RasterError> {
    let (vertex, fragment) = match kernel.raster() {
        Some(stages) => (
            stages.vertex.entry_point.as_str(),
            stages
                .fragment
                .as_ref()
                .map(|stage| stage.entry_point.as_str()),
        ),
        None => ("vertex", None),
    };
    let desc = RasterDesc {
        vertex,
        fragment,
        layouts: &layouts(kernel, form),
        state: &form.state,
        colours: &form.colours,
        depth: form.depth,
        sanitise,
    };
    let name = kernel.name.clone();
    RasterProgram::new(
        name,
        Box::new(locate_of(kernel)),
        &kernel.module,
        &kernel.info,
        &desc,
    )
}

impl CpuBackend {
    /// Translates what a step draws with.
    pub(super) fn prepare_raster(
        &mut self,
        plan: &Plan,
        step: &str,
        raster: &RasterStep,
    ) -> Result<(), BackendError> {
        for draw in &raster.draws {
            let form = form(plan, step, raster, draw)?;
            let kernel = &draw.kernel.0;
            if self.raster_programs.0.contains_key(&form) {
                continue;
            }
            let program =
                translate(kernel, &form, self.sanitise).map_err(|error| failed(step, error))?;
            if !self
                .raster_programs
                .0
                .keys()
                .any(|made| made.kernel == kernel.id)
            {
                self.counters.kernels += 1;
            }
            self.counters.pipelines += 1;
            self.raster_programs.0.insert(form, program);
        }
        Ok(())
    }

    /// Draws what a step draws.
    pub(super) fn raster(
        &mut self,
        plan: &Plan,
        name: &str,
        raster: &RasterStep,
        resources: &Resources,
    ) -> Result<(), BackendError> {
        let mut count = 0;
        let view = |target: &PlannedTarget| {
            let (resource, range) = (target.resource, target.range);
            let view = resources.texture(name, plan, &self.histories, resource, range)?;
            if let Some(value) = target.clear {
                view.fill(clear_texel(value));
            }
            Ok::<_, BackendError>(view)
        };
        let colours = raster
            .colours
            .iter()
            .map(view)
            .collect::<Result<Vec<_>, _>>()?;
        let depth = raster.depth.as_ref().map(view).transpose()?;
        // Of all draws of a form at once.
        let mut watched: Vec<(DrawForm, DrawWatch)> = Vec::new();
        for draw in &raster.draws {
            let form = form(plan, name, raster, draw)?;
            let program = self.raster_programs.0.get(&form);
            let program =
                program.ok_or_else(|| malformed(name, "a draw's kernel was not translated"))?;
            let kernel = &draw.kernel.0;
            let uniforms = self.uniforms(plan, name, &draw.bindings)?;
            let bound = self.bound(
                plan,
                name,
                kernel,
                (program.bindings(), &draw.bindings),
                &uniforms,
                resources,
            )?;
            let mut vertex_buffers = Vec::with_capacity(draw.vertices.len());
            for vertices in &draw.vertices {
                vertex_buffers.push(VertexBuffer {
                    buffer: resources.buffer(name, vertices.buffer)?,
                    offset: vertices.offset,
                });
            }
            let indices = match &draw.indices {
                None => None,
                Some(indices) => Some(IndexBuffer {
                    buffer: resources.buffer(name, indices.buffer)?,
                    offset: indices.offset,
                    format: indices.format,
                }),
            };
            for range in ranges(name, draw, resources)? {
                let draw = RasterDraw {
                    vertex_buffers: &vertex_buffers,
                    indices,
                    range,
                    viewport: raster.viewport,
                    scissor: raster.scissor,
                    resources: &bound,
                    immediates: &[],
                    colours: &colours,
                    depth: depth.as_ref(),
                };
                let at = watched.iter().position(|(known, _)| *known == form);
                let at = at.unwrap_or_else(|| {
                    watched.push((form.clone(), program.watch(&draw)));
                    watched.len() - 1
                });
                let drawn = program.draw_watched(&self.executor, &draw, &watched[at].1);
                drawn.map_err(|error| failed(name, error))?;
            }
            count += u64::from(!draw.extent.is_none());
        }
        self.counters.draws += count;
        if self.sanitise {
            for (form, watch) in watched {
                let Some(program) = self.raster_programs.0.get(&form) else {
                    continue;
                };
                let found = program.sanitised(watch);
                for found in [found.vertices, found.fragments] {
                    self.sanitised.push(StepSanitised {
                        step: name.to_owned(),
                        kernel: program.name().to_owned(),
                        found,
                    });
                }
            }
        }
        Ok(())
    }
}

/// What a draw draws: one range, or as many as its records say.
fn ranges(
    step: &str,
    draw: &PlannedDraw,
    resources: &Resources,
) -> Result<Vec<DrawRange>, BackendError> {
    match &draw.extent {
        DrawExtent::Direct {
            elements,
            base_vertex,
            instances,
        } => Ok(vec![DrawRange {
            first: elements.start,
            count: elements.end.saturating_sub(elements.start),
            base_vertex: if draw.indices.is_some() {
                *base_vertex
            } else {
                0
            },
            first_instance: instances.start,
            instances: instances.end.saturating_sub(instances.start),
        }]),
        DrawExtent::Indirect {
            buffer,
            offset,
            draws,
        } => {
            let buffer = resources.buffer(step, *buffer)?;
            let indexed = draw.indices.is_some();
            let words = if indexed { 5 } else { 4 };
            let record = |number: u32| {
                let word = |at: u64| {
                    let byte = offset.checked_add(4 * (u64::from(number) * words + at))?;
                    buffer.word(byte)
                };
                Some(DrawRange {
                    count: word(0)?,
                    instances: word(1)?,
                    first: word(2)?,
                    base_vertex: if indexed { word(3)?.cast_signed() } else { 0 },
                    first_instance: word(words - 1)?,
                })
            };
            let records = (0..*draws).map(record).collect::<Option<Vec<_>>>();
            records.ok_or_else(|| malformed(step, "its records are outside of their buffer"))
        }
    }
}

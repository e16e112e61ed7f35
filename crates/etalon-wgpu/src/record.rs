//! Turning a prepared plan into commands.

use etalon_core::backend::BackendError;
use etalon_core::graph::{ResourceDesc, Subresources};
use etalon_core::plan::{Groups, Plan, PlannedStep, Step};
use etalon_core::resource::TextureDesc;

use crate::bind::{BindContext, Physical, Samplers, touched};
use crate::convert;
use crate::gpu::Gpu;
use crate::prepare::{Prepared, PreparedStep};
use crate::raster::{Raster, Recording};
use crate::timing::{Stamp, Timing};

/// Makes whatever recording with these textures and buffers lacks: in a steady
/// state, nothing.
pub(crate) fn prepare_steps(
    gpu: &Gpu,
    plan: &Plan,
    prepared: &mut Prepared,
    physicals: &[Physical],
    samplers: &Samplers,
) -> Result<(), BackendError> {
    let context = BindContext {
        gpu,
        plan,
        physicals,
        uniforms: prepared.uniforms.as_deref(),
        samplers,
    };
    for (planned, step) in plan.steps.iter().zip(&mut prepared.steps) {
        match (&planned.step, step) {
            (
                Step::Dispatch {
                    kernel,
                    bindings,
                    groups: count,
                },
                PreparedStep::Dispatch { pipeline, groups },
            ) if !count.is_none() => {
                groups.select(touched(bindings, physicals), || {
                    context.group(&planned.name, &kernel.0, &pipeline.layout, bindings)
                })?;
            }
            (Step::Raster(step), PreparedStep::Raster(raster)) => {
                raster.prepare(&context, &planned.name, step)?;
            }
            (
                Step::ClearTexture {
                    resource, range, ..
                },
                PreparedStep::Clear(clear),
            ) => {
                if let Some(target) = physicals.get(*resource as usize) {
                    clear.prepare(gpu, &planned.name, target, *range)?;
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Records every step. Without `timing`, dispatches that follow each other
/// share a pass; with it, each has one of its own, whose time is taken. Draws of
/// a step are a pass of their own either way. Timing by the host submits and
/// waits for what is recorded.
pub(crate) fn record(
    encoder: &mut wgpu::CommandEncoder,
    gpu: &Gpu,
    plan: &Plan,
    prepared: &Prepared,
    physicals: &[Physical],
    timing: Option<&Timing>,
) {
    let recorder = Recorder {
        gpu,
        plan,
        physicals,
    };
    gpu.tally.barriers.add(plan.final_barriers.len() as u64);
    match timing {
        Some(Timing::Device(queries)) => {
            let stamps = queries.stamps(&plan.steps);
            for ((planned, step), stamp) in plan.steps.iter().zip(&prepared.steps).zip(stamps) {
                recorder.timed(encoder, planned, step, stamp);
            }
            queries.record(encoder);
        }
        Some(Timing::Host(clock)) => {
            clock.restart();
            for (planned, step) in plan.steps.iter().zip(&prepared.steps) {
                clock.time(gpu, encoder, planned, |encoder| {
                    recorder.timed(encoder, planned, step, None);
                });
            }
        }
        None => {
            let mut steps = plan.steps.iter().zip(&prepared.steps).peekable();
            while let Some((planned, step)) = steps.next() {
                match step {
                    PreparedStep::Dispatch { .. } => {}
                    PreparedStep::Raster(raster) => {
                        recorder.draw(encoder, planned, raster, None);
                        continue;
                    }
                    _ => {
                        recorder.transfer(encoder, planned, step);
                        continue;
                    }
                }
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("etalon"),
                    timestamp_writes: None,
                });
                let mut next = Some((planned, step));
                while let Some((planned, step)) = next {
                    pass.push_debug_group(&planned.name);
                    recorder.dispatch(&mut pass, planned, step);
                    pass.pop_debug_group();
                    next = steps.next_if(|(_, step)| matches!(step, PreparedStep::Dispatch { .. }));
                }
            }
        }
    }
}

struct Recorder<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    physicals: &'a [Physical],
}

impl Recorder<'_> {
    fn physical(&self, index: u32) -> Option<&Physical> {
        self.physicals.get(index as usize)
    }

    fn texture_desc(&self, index: u32) -> Option<&TextureDesc> {
        match &self.plan.resources.get(index as usize)?.desc {
            ResourceDesc::Texture(desc) => Some(desc),
            ResourceDesc::Buffer(_) => None,
        }
    }

    /// Counts a step that is recorded.
    fn count(&self, planned: &PlannedStep) {
        let tally = &self.gpu.tally;
        tally.barriers.add(planned.barriers.len() as u64);
        tally.passes.add(u64::from(planned.step.works()));
        tally
            .invocations
            .add(planned.step.invocations().unwrap_or(0));
    }

    /// One step, between two timestamps if there are any.
    fn timed(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        planned: &PlannedStep,
        step: &PreparedStep,
        stamp: Option<Stamp<'_>>,
    ) {
        if let PreparedStep::Raster(raster) = step {
            self.draw(encoder, planned, raster, stamp);
            return;
        }
        let runs = match &planned.step {
            Step::Dispatch { groups, .. } => !groups.is_none(),
            _ => false,
        };
        if runs {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(&planned.name),
                timestamp_writes: stamp.map(Stamp::of_pass),
            });
            self.dispatch(&mut pass, planned, step);
            return;
        }
        // A query that is read must have been written, whatever was skipped.
        if let Some(stamp) = stamp {
            stamp.begin(encoder);
        }
        self.transfer(encoder, planned, step);
        if let Some(stamp) = stamp {
            stamp.end(encoder);
        }
    }

    fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        planned: &PlannedStep,
        raster: &Raster,
        stamp: Option<Stamp<'_>>,
    ) {
        self.count(planned);
        if let Step::Raster(step) = &planned.step {
            let recording = Recording {
                gpu: self.gpu,
                plan: self.plan,
                physicals: self.physicals,
            };
            raster.record(encoder, &recording, &planned.name, step, stamp);
        }
    }

    fn dispatch(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        planned: &PlannedStep,
        step: &PreparedStep,
    ) {
        self.count(planned);
        let (Step::Dispatch { groups: count, .. }, PreparedStep::Dispatch { pipeline, groups }) =
            (&planned.step, step)
        else {
            return;
        };
        if count.is_none() {
            return;
        }
        pass.set_pipeline(&pipeline.raw);
        pass.set_bind_group(0, groups.selected(), &[]);
        match count {
            Groups::Direct([x, y, z]) => pass.dispatch_workgroups(*x, *y, *z),
            Groups::Indirect { buffer, offset } => {
                let Some(buffer) = self.physical(*buffer).and_then(Physical::buffer) else {
                    return;
                };
                pass.dispatch_workgroups_indirect(buffer, *offset);
            }
        }
        self.gpu.tally.dispatches.add(1);
    }

    /// Clears, copies and captures.
    fn transfer(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        planned: &PlannedStep,
        step: &PreparedStep,
    ) {
        self.count(planned);
        // What is not there has been refused when the plan was prepared.
        let _: Option<()> = (|| {
            match (&planned.step, step) {
                (
                    Step::ClearTexture {
                        resource, range, ..
                    },
                    PreparedStep::Clear(clear),
                ) => {
                    let part = self.physical(*resource)?.texture()?;
                    clear.record(encoder, self.texture_desc(*resource)?, part, *range);
                }
                (Step::ClearBuffer { resource }, _) => {
                    let buffer = self.physical(*resource)?.buffer()?;
                    encoder.clear_buffer(buffer, 0, Some(self.buffer_bytes(*resource)?));
                }
                (Step::CopyTexture { source, target }, _) => {
                    self.copy_texture(encoder, *source, *target)?;
                }
                (Step::CopyBuffer { source, target }, _) => {
                    let bytes = self.buffer_bytes(*source)?;
                    let source = self.physical(*source)?.buffer()?;
                    let target = self.physical(*target)?.buffer()?;
                    encoder.copy_buffer_to_buffer(source, 0, target, 0, bytes);
                }
                (
                    Step::Capture {
                        resource, range, ..
                    },
                    PreparedStep::Capture(readback),
                ) => readback.record(encoder, self.physical(*resource)?, *range),
                _ => {}
            }
            Some(())
        })();
    }

    fn buffer_bytes(&self, index: u32) -> Option<u64> {
        match &self.plan.resources.get(index as usize)?.desc {
            ResourceDesc::Buffer(desc) => Some(desc.bytes),
            ResourceDesc::Texture(_) => None,
        }
    }

    fn copy_texture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (source, from): (u32, Subresources),
        (target, to): (u32, Subresources),
    ) -> Option<()> {
        let desc = self.texture_desc(source)?;
        let source = self.physical(source)?.texture()?;
        let target = self.physical(target)?.texture()?;
        for mip in 0..from.mips {
            encoder.copy_texture_to_texture(
                source.origin(from.mip + mip, 0, from.layer),
                target.origin(to.mip + mip, 0, to.layer),
                convert::copy_extent(desc, from.mip + mip, from),
            );
        }
        Some(())
    }
}

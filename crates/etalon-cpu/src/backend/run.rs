//! One run of a plan.

use std::time::Instant;

use etalon_core::backend::{BackendError, Captured, CapturedData, Execution, Inputs, StepTime};
use etalon_core::graph::ResourceDesc;
use etalon_core::kernel::Kernel;
use etalon_core::plan::{Bound, Groups, Plan, Step};

use super::histories::clear_texel;
use super::resources::Resources;
use super::{CpuBackend, StepSanitised, WideCapture, malformed, step_error};
use crate::binding::BindingInfo;
use crate::error::RunError;
use crate::memory::Buffer;
use crate::program::BoundResource;

impl CpuBackend {
    pub(super) fn run(
        &mut self,
        plan: &Plan,
        inputs: &Inputs<'_>,
        wide: Option<&mut Vec<WideCapture>>,
    ) -> Result<Execution, BackendError> {
        for step in &plan.steps {
            match &step.step {
                Step::Dispatch { kernel, .. } => self.prepare(&step.name, &kernel.0)?,
                Step::Raster(raster) => self.prepare_raster(plan, &step.name, raster)?,
                _ => {}
            }
        }
        let mut resources = Resources::default();
        let result = self.run_with(plan, inputs, &mut resources, wide);
        resources.release(&mut self.pool);
        self.pool.end_frame();
        if result.is_ok() {
            self.histories.advance(plan, &mut self.pool);
        }
        result
    }

    fn run_with(
        &mut self,
        plan: &Plan,
        inputs: &Inputs<'_>,
        resources: &mut Resources,
        mut wide: Option<&mut Vec<WideCapture>>,
    ) -> Result<Execution, BackendError> {
        let watched = self.checks.uninitialised;
        resources.acquire(plan, inputs, &mut self.pool, watched)?;
        self.histories
            .acquire(plan, &mut self.pool, watched)
            .map_err(|error| step_error("histories", error))?;
        let mut execution = Execution::default();
        self.counters.transient_bytes = resources.transient_bytes();
        for step in &plan.steps {
            let start = Instant::now();
            self.counters.barriers += step.barriers.len() as u64;
            let captured = self.step(plan, &step.name, &step.step, resources)?;
            self.counters.passes += u64::from(step.step.works());
            self.counters.invocations += step.step.invocations().unwrap_or(0);
            match captured {
                Some(captured) => {
                    execution.captures.push(captured);
                    if let Some(wide) = &mut wide {
                        wide.push(self.capture_wide(plan, &step.name, &step.step, resources)?);
                    }
                }
                None => {
                    let nanoseconds = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
                    execution.times.push(StepTime {
                        step: step.name.clone(),
                        nanoseconds,
                    });
                }
            }
        }
        self.counters.barriers += plan.final_barriers.len() as u64;
        Ok(execution)
    }

    fn step(
        &mut self,
        plan: &Plan,
        name: &str,
        step: &Step,
        resources: &Resources,
    ) -> Result<Option<Captured>, BackendError> {
        match step {
            Step::Dispatch {
                kernel,
                bindings,
                groups,
            } => self.dispatch(plan, name, &kernel.0, bindings, groups, resources)?,
            Step::Raster(raster) => self.raster(plan, name, raster, resources)?,
            Step::ClearTexture {
                resource,
                range,
                value,
            } => resources
                .texture(name, plan, &self.histories, *resource, *range)?
                .fill(clear_texel(*value)),
            Step::ClearBuffer { resource } => resources.buffer(name, *resource)?.clear(),
            Step::CopyTexture { source, target } => {
                let from = resources.texture(name, plan, &self.histories, source.0, source.1)?;
                let to = resources.texture(name, plan, &self.histories, target.0, target.1)?;
                if !to.copy_from(&from) {
                    return Err(malformed(name, "source and target are of different shapes"));
                }
            }
            Step::CopyBuffer { source, target } => resources
                .buffer(name, *target)?
                .copy_from(resources.buffer(name, *source)?),
            Step::Capture {
                resource,
                range,
                pass,
                binding,
            } => {
                let Some(planned) = plan.resources.get(*resource as usize) else {
                    return Err(malformed(
                        name,
                        format_args!("there is no resource {resource}"),
                    ));
                };
                let data = match planned.desc {
                    ResourceDesc::Texture(_) => {
                        let view =
                            resources.texture(name, plan, &self.histories, *resource, *range)?;
                        CapturedData::Texture(
                            view.to_image().map_err(|error| step_error(name, error))?,
                        )
                    }
                    ResourceDesc::Buffer(_) => CapturedData::Buffer(
                        resources
                            .buffer(name, *resource)?
                            .to_bytes()
                            .map_err(|error| step_error(name, error))?,
                    ),
                };
                return Ok(Some(Captured {
                    pass: pass.clone(),
                    binding: binding.clone(),
                    resource: planned.name.clone(),
                    data,
                }));
            }
        }
        Ok(None)
    }

    /// What a capture step captures, in `f64`.
    fn capture_wide(
        &self,
        plan: &Plan,
        name: &str,
        step: &Step,
        resources: &Resources,
    ) -> Result<WideCapture, BackendError> {
        let Step::Capture {
            resource, range, ..
        } = step
        else {
            return Ok(WideCapture::None);
        };
        let is_buffer = plan
            .resources
            .get(*resource as usize)
            .is_some_and(|planned| matches!(planned.desc, ResourceDesc::Buffer(_)));
        if is_buffer {
            let values = resources.buffer(name, *resource)?.to_f64();
            return Ok(WideCapture::Buffer(
                values.map_err(|error| step_error(name, error))?,
            ));
        }
        let view = resources.texture(name, plan, &self.histories, *resource, *range)?;
        let texels = view.to_f64().map_err(|error| step_error(name, error))?;
        Ok(texels.map_or(WideCapture::None, WideCapture::Texture))
    }

    /// The uniform blocks among what is bound. They are small: each dispatch and
    /// each draw has copies of its own.
    pub(super) fn uniforms(
        &self,
        plan: &Plan,
        name: &str,
        bindings: &[Bound],
    ) -> Result<Vec<Buffer>, BackendError> {
        let mut uniforms = Vec::new();
        for bound in bindings {
            if let Bound::Uniform(slice) = bound {
                let range = slice.offset as usize
                    ..(slice.offset as usize).saturating_add(slice.size as usize);
                let bytes = plan
                    .uniforms
                    .get(range)
                    .ok_or_else(|| malformed(name, "its uniforms are not in the plan"))?;
                uniforms.push(Buffer::from_bytes(bytes).map_err(|error| step_error(name, error))?);
            }
        }
        Ok(uniforms)
    }

    /// What the bindings that a program wants are given, in the program's order.
    pub(super) fn bound<'r>(
        &'r self,
        plan: &Plan,
        name: &str,
        kernel: &Kernel,
        (wanted, bindings): (&[BindingInfo], &[Bound]),
        uniforms: &'r [Buffer],
        resources: &'r Resources,
    ) -> Result<Vec<BoundResource<'r>>, BackendError> {
        let mut next_uniform = uniforms.iter();
        let mut given = Vec::with_capacity(bindings.len());
        for bound in bindings {
            given.push(match *bound {
                Bound::Texture { resource, range } => BoundResource::Texture(resources.texture(
                    name,
                    plan,
                    &self.histories,
                    resource,
                    range,
                )?),
                Bound::Buffer { resource } => {
                    BoundResource::Buffer(resources.buffer(name, resource)?)
                }
                Bound::Uniform(_) => BoundResource::Buffer(
                    next_uniform
                        .next()
                        .ok_or_else(|| malformed(name, "its uniforms are not in the plan"))?,
                ),
                Bound::Sampler(sampler) => BoundResource::Sampler(sampler),
            });
        }
        // The kernel lists bindings by number, the program by declaration.
        let mut bound = Vec::with_capacity(given.len());
        for wanted in wanted {
            let position = kernel.bindings.iter().position(|binding| {
                (binding.group, binding.binding) == (wanted.group, wanted.binding)
            });
            let found = position
                .and_then(|position| given.get(position))
                .ok_or_else(|| {
                    let error = RunError::Binding {
                        kernel: kernel.name.clone(),
                        binding: wanted.name.clone(),
                        expected: "a resource".to_owned(),
                        found: "nothing".to_owned(),
                    };
                    step_error(name, error)
                })?;
            bound.push(found.clone());
        }
        Ok(bound)
    }

    fn dispatch(
        &mut self,
        plan: &Plan,
        name: &str,
        kernel: &Kernel,
        bindings: &[Bound],
        planned: &Groups,
        resources: &Resources,
    ) -> Result<(), BackendError> {
        let program = self
            .programs
            .get(&kernel.id)
            .ok_or_else(|| malformed(name, "its kernel was not translated"))?;
        let groups = match planned {
            Groups::Direct(groups) => *groups,
            Groups::Indirect { buffer, offset } => {
                let buffer = resources.buffer(name, *buffer)?;
                let word = |axis: u64| {
                    offset
                        .checked_add(4 * axis)
                        .filter(|at| at % 4 == 0)
                        .and_then(|at| buffer.word(at))
                };
                match (word(0), word(1), word(2)) {
                    (Some(x), Some(y), Some(z)) => [x, y, z],
                    _ => return Err(malformed(name, "its arguments are outside of their buffer")),
                }
            }
        };
        let uniforms = self.uniforms(plan, name, bindings)?;
        let bound = self.bound(
            plan,
            name,
            kernel,
            (program.bindings(), bindings),
            &uniforms,
            resources,
        )?;
        let report = program
            .dispatch(&self.executor, groups, &bound)
            .map_err(|error| step_error(name, error))?;
        self.findings.add(name, report.findings);
        if self.sanitise {
            self.sanitised.push(StepSanitised {
                step: name.to_owned(),
                kernel: kernel.name.clone(),
                found: report.sanitised,
            });
        }
        self.counters.dispatches += u64::from(!planned.is_none());
        if matches!(planned, Groups::Indirect { .. }) {
            let size = kernel
                .compute()
                .map_or([0; 3], |stage| stage.workgroup_size);
            let known = Groups::Direct(groups).invocations(size);
            self.counters.indirect_invocations += known.unwrap_or(0);
        }
        Ok(())
    }
}

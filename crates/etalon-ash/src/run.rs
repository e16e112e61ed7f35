//! Recording a plan: its steps in order, its barriers as they stand.

mod raster;

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::plan::{Barrier, Bound, Groups, Plan, Step, UsageSet};

use crate::buffer::Buffer;
use crate::commands::{Barriers, Commands, Transition};
use crate::device::{Tally, count};
use crate::error::malformed;
use crate::image::Image;
use crate::pipeline::Pipeline;
use crate::texels::Texels;
use crate::usage::Shaders;
use crate::{Resource, usage};

/// Where the bytes of one capture go.
#[derive(Debug)]
pub(crate) enum Place {
    /// Part of a texture.
    Texture(Texels),
    /// A whole buffer.
    Buffer {
        /// First byte.
        offset: u64,
        /// Number of bytes.
        bytes: u64,
    },
}

/// Where captures go: a host-visible buffer, and a place in it for each of the
/// plan's captures in order.
pub(crate) struct Captures<'a> {
    pub(crate) buffer: &'a Buffer,
    pub(crate) places: &'a [Place],
}

/// Everything a recording of a plan needs, made and bound.
pub(crate) struct Run<'a> {
    pub(crate) plan: &'a Plan,
    /// By number in the plan.
    pub(crate) resources: &'a [Resource],
    /// By number in the plan: transients with memory of their own.
    pub(crate) apart: &'a [bool],
    /// By dispatch and draw, in order.
    pub(crate) pipelines: &'a [Arc<Pipeline>],
    /// By dispatch and draw, in order.
    pub(crate) sets: &'a [vk::DescriptorSet],
    /// Where this run's uniform blocks begin in their ring.
    pub(crate) uniforms: u32,
    pub(crate) captures: Option<Captures<'a>>,
    /// Two queries for each step that is not a capture.
    pub(crate) queries: Option<vk::QueryPool>,
}

impl Run<'_> {
    /// Records the plan.
    pub(crate) fn record(&self, commands: &Commands<'_>) -> Result<(), BackendError> {
        let shaders = Shaders::of(self.plan);
        let mut barriers = Barriers::default();
        if let Some([source, target]) = shaders.leave_rest() {
            barriers.memory(source, target);
            commands.barrier(&mut barriers);
        }
        let mut captured = 0;
        let mut timed = 0;
        // Of the dispatches and draws.
        let mut next = 0;
        for step in &self.plan.steps {
            commands.begin_label(&step.name);
            self.barriers(commands, &step.barriers, shaders, &mut barriers)?;
            let result = if let Step::Capture { resource, .. } = &step.step {
                captured += 1;
                self.capture(commands, *resource, captured - 1)
            } else {
                self.timed(commands, &mut timed, || {
                    self.work(commands, &mut next, &step.step)
                })
            };
            commands.end_label();
            result?;
            count_work(&commands.device.tally, &step.step);
        }
        self.barriers(commands, &self.plan.final_barriers, shaders, &mut barriers)?;
        if let Some([source, target]) = shaders.come_to_rest() {
            barriers.memory(source, target);
            commands.barrier(&mut barriers);
        }
        Ok(())
    }

    /// Takes the time before and after.
    fn timed(
        &self,
        commands: &Commands<'_>,
        query: &mut u32,
        work: impl FnOnce() -> Result<(), BackendError>,
    ) -> Result<(), BackendError> {
        let Some(pool) = self.queries else {
            return work();
        };
        commands.timestamp(pool, *query);
        let result = work();
        commands.timestamp(pool, *query + 1);
        *query += 2;
        result
    }

    fn get(&self, resource: u32) -> Result<&Resource, BackendError> {
        // The plan was checked, so this does not fail.
        usize::try_from(resource)
            .ok()
            .and_then(|index| self.resources.get(index))
            .ok_or_else(|| malformed(format!("there is no resource {resource}")))
    }

    fn image(&self, resource: u32) -> Result<&Image, BackendError> {
        match self.get(resource)? {
            Resource::Texture(image) => Ok(image),
            Resource::Buffer(_) => Err(malformed(format!("resource {resource} is a buffer"))),
        }
    }

    fn buffer(&self, resource: u32) -> Result<&Buffer, BackendError> {
        match self.get(resource)? {
            Resource::Buffer(buffer) => Ok(buffer),
            Resource::Texture(_) => Err(malformed(format!("resource {resource} is a texture"))),
        }
    }

    /// Records a step's barriers in one call.
    fn barriers(
        &self,
        commands: &Commands<'_>,
        planned: &[Barrier],
        shaders: Shaders,
        barriers: &mut Barriers,
    ) -> Result<(), BackendError> {
        for barrier in planned {
            let by = self.transition(barrier, shaders);
            match self.get(barrier.resource)? {
                Resource::Texture(image) => barriers.image(image, barrier.range, by),
                Resource::Buffer(buffer) => barriers.buffer(buffer, by),
            }
        }
        count(
            &commands.device.tally.barriers,
            u64::try_from(planned.len()).unwrap_or(u64::MAX),
        );
        commands.barrier(barriers);
        Ok(())
    }

    /// What a barrier is in Vulkan.
    fn transition(&self, barrier: &Barrier, shaders: Shaders) -> Transition {
        let index = usize::try_from(barrier.resource).unwrap_or(usize::MAX);
        let own_uses = match (self.apart.get(index), self.plan.resources.get(index)) {
            (Some(true), Some(resource)) => resource.usages,
            _ => UsageSet::EMPTY,
        };
        transition(barrier, own_uses, shaders)
    }

    /// Does what a step does.
    fn work(
        &self,
        commands: &Commands<'_>,
        next: &mut usize,
        step: &Step,
    ) -> Result<(), BackendError> {
        match step {
            Step::Dispatch {
                bindings, groups, ..
            } => {
                *next += 1;
                self.dispatch(commands, *next - 1, bindings, groups)
            }
            Step::Raster(raster) => {
                let first = *next;
                *next += raster.draws.len();
                self.raster(commands, first, raster)
            }
            // Captures are told apart before.
            Step::Capture { .. } => Ok(()),
            Step::ClearTexture {
                resource,
                range,
                value,
            } => {
                commands.clear_image(self.image(*resource)?, *range, *value);
                Ok(())
            }
            Step::ClearBuffer { resource } => {
                commands.clear_buffer(self.buffer(*resource)?);
                Ok(())
            }
            Step::CopyTexture { source, target } => {
                commands.copy_image(
                    (self.image(source.0)?, source.1),
                    (self.image(target.0)?, target.1),
                );
                Ok(())
            }
            Step::CopyBuffer { source, target } => {
                let source = self.buffer(*source)?;
                commands.copy_buffer((source, 0), (self.buffer(*target)?, 0), source.bytes);
                Ok(())
            }
        }
    }

    fn dispatch(
        &self,
        commands: &Commands<'_>,
        index: usize,
        bindings: &[Bound],
        groups: &Groups,
    ) -> Result<(), BackendError> {
        if groups.is_none() {
            return Ok(());
        }
        self.bind(commands, index, bindings)?;
        match groups {
            Groups::Direct(counts) => commands.dispatch(*counts),
            Groups::Indirect { buffer, offset } => {
                commands.dispatch_indirect(self.buffer(*buffer)?, *offset);
            }
        }
        count(&commands.device.tally.dispatches, 1);
        Ok(())
    }

    /// Makes the pipeline of a dispatch or draw current, and what it binds.
    fn bind(
        &self,
        commands: &Commands<'_>,
        index: usize,
        bindings: &[Bound],
    ) -> Result<(), BackendError> {
        let (Some(pipeline), Some(set)) = (self.pipelines.get(index), self.sets.get(index)) else {
            // Each was given both when the plan was prepared.
            return Err(malformed(format!(
                "use {index} of a kernel was not prepared"
            )));
        };
        // In order of binding number, as the kernel's bindings are.
        let offsets: Vec<u32> = bindings
            .iter()
            .filter_map(|bound| match bound {
                Bound::Uniform(slice) => Some(self.uniforms + slice.offset),
                _ => None,
            })
            .collect();
        commands.bind(pipeline, *set, &offsets);
        Ok(())
    }

    fn capture(
        &self,
        commands: &Commands<'_>,
        resource: u32,
        index: usize,
    ) -> Result<(), BackendError> {
        let place = self
            .captures
            .as_ref()
            .and_then(|captures| Some((captures.buffer, captures.places.get(index)?)));
        match (place, self.get(resource)?) {
            (Some((target, Place::Texture(texels))), Resource::Texture(image)) => {
                commands.download(image, target, &texels.regions);
                Ok(())
            }
            (Some((target, Place::Buffer { offset, bytes })), Resource::Buffer(source)) => {
                commands.copy_buffer((source, 0), (target, *offset), *bytes);
                Ok(())
            }
            // Each capture was given a place when the plan was prepared.
            _ => Err(malformed(format!("capture {index} has no place to go"))),
        }
    }
}

/// Counts a step that has been recorded.
fn count_work(tally: &Tally, step: &Step) {
    count(&tally.passes, u64::from(step.works()));
    count(&tally.invocations, step.invocations().unwrap_or(0));
}

/// What a barrier is in Vulkan. `own_uses` are the uses of a transient that has
/// memory of its own: the plan says what to wait for before its first use by
/// naming the uses of those that had its memory before, which here was itself,
/// in the run before. (An empty set waits for everything.)
fn transition(barrier: &Barrier, own_uses: UsageSet, shaders: Shaders) -> Transition {
    let first_use = barrier.layout.is_none() && !barrier.from.is_empty();
    let from = if first_use {
        barrier.from.union(own_uses)
    } else {
        barrier.from
    };
    let to = usage::row_in(barrier.to, shaders);
    let old = barrier.layout.map(|layout| usage::row(layout).layout);
    Transition {
        source: usage::source(from, shaders),
        target: (to.stages, to.access),
        layouts: (old.unwrap_or(vk::ImageLayout::UNDEFINED), to.layout),
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::graph::Subresources;
    use etalon_core::plan::Usage;

    use super::*;

    fn barrier(from: UsageSet, layout: Option<Usage>) -> Barrier {
        Barrier {
            resource: 0,
            range: Subresources::ALL,
            from,
            layout,
            to: Usage::CopyTarget,
        }
    }

    #[test]
    fn contents_are_kept_where_the_plan_keeps_them() {
        let kept = barrier(Usage::StorageWrite.into(), Some(Usage::StorageWrite));
        let by = transition(&kept, UsageSet::EMPTY, Shaders::Computing);
        let target = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        assert_eq!(by.layouts, (vk::ImageLayout::GENERAL, target));
        assert_eq!(
            by.source,
            usage::source(Usage::StorageWrite.into(), Shaders::Computing)
        );
        let lost = barrier(Usage::StorageWrite.into(), None);
        let by = transition(&lost, UsageSet::EMPTY, Shaders::Computing);
        assert_eq!(by.layouts, (vk::ImageLayout::UNDEFINED, target));
    }

    #[test]
    fn transients_apart_wait_for_their_own_uses_too() {
        let own: UsageSet = Usage::CopySource.into();
        let former: UsageSet = Usage::Sampled.into();
        let first = transition(&barrier(former, None), own, Shaders::Drawing);
        assert_eq!(
            first.source,
            usage::source(former.union(own), Shaders::Drawing)
        );
        // Everything is enough, and later uses are the plan's business.
        let all = transition(&barrier(UsageSet::EMPTY, None), own, Shaders::Drawing);
        assert_eq!(all.source, usage::source(UsageSet::EMPTY, Shaders::Drawing));
        let later = transition(
            &barrier(former, Some(Usage::Sampled)),
            own,
            Shaders::Drawing,
        );
        assert_eq!(later.source, usage::source(former, Shaders::Drawing));
    }
}

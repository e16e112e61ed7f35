//! What each [`Usage`] is in Vulkan: one table.
//!
//! | usage           | stages                         | access                                    | layout                             |
//! |-----------------|--------------------------------|-------------------------------------------|------------------------------------|
//! | `Sampled`       | shaders                        | `SHADER_SAMPLED_READ`                     | `SHADER_READ_ONLY_OPTIMAL`         |
//! | `StorageRead`   | shaders                        | `SHADER_STORAGE_READ`                     | `GENERAL`                          |
//! | `StorageWrite`  | `COMPUTE_SHADER`               | `SHADER_STORAGE_WRITE`                    | `GENERAL`                          |
//! | `StorageUpdate` | `COMPUTE_SHADER`               | `SHADER_STORAGE_READ`, `…_WRITE`          | `GENERAL`                          |
//! | `CopySource`    | `COPY`                         | `TRANSFER_READ`                           | `TRANSFER_SRC_OPTIMAL`             |
//! | `CopyTarget`    | `COPY`, `CLEAR`                | `TRANSFER_WRITE`                          | `TRANSFER_DST_OPTIMAL`             |
//! | `Indirect`      | `DRAW_INDIRECT`                | `INDIRECT_COMMAND_READ`                   | buffers only                       |
//! | `ColourTarget`  | `COLOR_ATTACHMENT_OUTPUT`      | `COLOR_ATTACHMENT_READ`, `…_WRITE`        | `COLOR_ATTACHMENT_OPTIMAL`         |
//! | `DepthTarget`   | `EARLY_…`, `LATE_FRAGMENT_TESTS` | `DEPTH_STENCIL_ATTACHMENT_READ`, `…_WRITE` | `DEPTH_STENCIL_ATTACHMENT_OPTIMAL` |
//! | `Vertices`      | `VERTEX_ATTRIBUTE_INPUT`       | `VERTEX_ATTRIBUTE_READ`                   | buffers only                       |
//! | `Indices`       | `INDEX_INPUT`                  | `INDEX_READ`                              | buffers only                       |
//!
//! A plan does not say which shaders read, so those that may: `COMPUTE_SHADER`
//! alone in a plan that draws nothing, and [`Shaders::Drawing`] in one that
//! does. Between runs things rest as compute shaders read them, whatever the
//! plan, so that plans that do not draw wait for nothing that others draw, and
//! run on queues that cannot. A plan that draws therefore begins with a barrier
//! from compute shaders to its vertex and fragment shaders, and ends with one
//! back; see [`Shaders::leave_rest`].
//!
//! A barrier waits for the stages of every usage in `from` and makes what they
//! *wrote* available; reads need no more than the wait. An empty `from` stands
//! for whatever ran before on the queue: `ALL_COMMANDS` with `MEMORY_WRITE`.
//! A `layout` of `None` lets the contents go: `UNDEFINED`.

use ash::vk;
use etalon_core::plan::{Plan, Step, Usage, UsageSet};

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) stages: vk::PipelineStageFlags2,
    pub(crate) access: vk::AccessFlags2,
    pub(crate) layout: vk::ImageLayout,
}

/// Two ends of a barrier of memory: stages and accesses of each.
pub(crate) type Ends = [(vk::PipelineStageFlags2, vk::AccessFlags2); 2];

/// The shaders that read in a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shaders {
    /// Compute shaders: of plans that draw nothing, and of things at rest.
    Computing,
    /// Compute, vertex and fragment shaders.
    Drawing,
}

/// The shaders of draws.
const OF_DRAWS: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::from_raw(
    vk::PipelineStageFlags2::VERTEX_SHADER.as_raw()
        | vk::PipelineStageFlags2::FRAGMENT_SHADER.as_raw(),
);

impl Shaders {
    /// Those of a plan.
    pub(crate) fn of(plan: &Plan) -> Self {
        let draws = |step: &Step| matches!(step, Step::Raster(_));
        if plan.steps.iter().any(|step| draws(&step.step)) {
            Self::Drawing
        } else {
            Self::Computing
        }
    }

    fn stages(self) -> vk::PipelineStageFlags2 {
        match self {
            Self::Computing => vk::PipelineStageFlags2::COMPUTE_SHADER,
            Self::Drawing => vk::PipelineStageFlags2::COMPUTE_SHADER | OF_DRAWS,
        }
    }

    /// What lets shaders of draws, too, read what is at rest. Its writes are
    /// available already; what is left is to wait as those do that read it as
    /// it rests, and to see it.
    pub(crate) fn leave_rest(self) -> Option<Ends> {
        let reads = vk::AccessFlags2::SHADER_SAMPLED_READ | vk::AccessFlags2::SHADER_STORAGE_READ;
        (self == Self::Drawing).then_some([
            (
                vk::PipelineStageFlags2::COMPUTE_SHADER,
                vk::AccessFlags2::NONE,
            ),
            (OF_DRAWS, reads),
        ])
    }

    /// What makes those who wait for a thing at rest wait for its readers among
    /// draws. What comes before vertex shaders in a draw, reads of vertices,
    /// indices and records, is waited for with them (Vulkan 1.3, §7.1.2).
    pub(crate) fn come_to_rest(self) -> Option<Ends> {
        (self == Self::Drawing).then_some([
            (OF_DRAWS, vk::AccessFlags2::NONE),
            (
                vk::PipelineStageFlags2::COMPUTE_SHADER,
                vk::AccessFlags2::NONE,
            ),
        ])
    }
}

/// The row of a usage outside of plans.
pub(crate) fn row(usage: Usage) -> Row {
    row_in(usage, Shaders::Computing)
}

/// The row of a usage in a plan with these shaders.
pub(crate) fn row_in(usage: Usage, shaders: Shaders) -> Row {
    use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
    let (stages, access, layout) = match usage {
        Usage::Sampled => (
            shaders.stages(),
            A::SHADER_SAMPLED_READ,
            L::SHADER_READ_ONLY_OPTIMAL,
        ),
        Usage::StorageRead => (shaders.stages(), A::SHADER_STORAGE_READ, L::GENERAL),
        Usage::StorageWrite => (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE, L::GENERAL),
        Usage::StorageUpdate => (
            S::COMPUTE_SHADER,
            A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE,
            L::GENERAL,
        ),
        Usage::CopySource => (S::COPY, A::TRANSFER_READ, L::TRANSFER_SRC_OPTIMAL),
        Usage::CopyTarget => (
            S::COPY | S::CLEAR,
            A::TRANSFER_WRITE,
            L::TRANSFER_DST_OPTIMAL,
        ),
        Usage::Indirect => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ, L::GENERAL),
        Usage::ColourTarget => (
            S::COLOR_ATTACHMENT_OUTPUT,
            A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
            L::COLOR_ATTACHMENT_OPTIMAL,
        ),
        Usage::DepthTarget => (
            S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS,
            A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
            L::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        ),
        Usage::Vertices => (
            S::VERTEX_ATTRIBUTE_INPUT,
            A::VERTEX_ATTRIBUTE_READ,
            L::GENERAL,
        ),
        Usage::Indices => (S::INDEX_INPUT, A::INDEX_READ, L::GENERAL),
    };
    Row {
        stages,
        access,
        layout,
    }
}

/// The first synchronization scope of a barrier that waits for these usages.
pub(crate) fn source(
    from: UsageSet,
    shaders: Shaders,
) -> (vk::PipelineStageFlags2, vk::AccessFlags2) {
    if from.is_empty() {
        return (
            vk::PipelineStageFlags2::ALL_COMMANDS,
            vk::AccessFlags2::MEMORY_WRITE,
        );
    }
    let writes = vk::AccessFlags2::SHADER_STORAGE_WRITE
        | vk::AccessFlags2::TRANSFER_WRITE
        | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE
        | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
    from.iter().map(|usage| row_in(usage, shaders)).fold(
        (vk::PipelineStageFlags2::empty(), vk::AccessFlags2::empty()),
        |(stages, access), row| (stages | row.stages, access | (row.access & writes)),
    )
}

/// The usage flags an image needs for these usages.
pub(crate) fn image_flags(usages: UsageSet) -> vk::ImageUsageFlags {
    usages
        .iter()
        .map(|usage| match usage {
            Usage::Sampled => vk::ImageUsageFlags::SAMPLED,
            Usage::StorageRead | Usage::StorageWrite | Usage::StorageUpdate => {
                vk::ImageUsageFlags::STORAGE
            }
            Usage::CopySource => vk::ImageUsageFlags::TRANSFER_SRC,
            Usage::CopyTarget => vk::ImageUsageFlags::TRANSFER_DST,
            Usage::ColourTarget => vk::ImageUsageFlags::COLOR_ATTACHMENT,
            Usage::DepthTarget => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            Usage::Indirect | Usage::Vertices | Usage::Indices => vk::ImageUsageFlags::empty(),
        })
        .fold(vk::ImageUsageFlags::empty(), |all, flags| all | flags)
}

/// The usage flags a buffer needs for these usages.
pub(crate) fn buffer_flags(usages: UsageSet) -> vk::BufferUsageFlags {
    usages
        .iter()
        .map(|usage| match usage {
            Usage::Sampled | Usage::StorageRead | Usage::StorageWrite | Usage::StorageUpdate => {
                vk::BufferUsageFlags::STORAGE_BUFFER
            }
            Usage::CopySource => vk::BufferUsageFlags::TRANSFER_SRC,
            Usage::CopyTarget => vk::BufferUsageFlags::TRANSFER_DST,
            Usage::Indirect => vk::BufferUsageFlags::INDIRECT_BUFFER,
            Usage::Vertices => vk::BufferUsageFlags::VERTEX_BUFFER,
            Usage::Indices => vk::BufferUsageFlags::INDEX_BUFFER,
            Usage::ColourTarget | Usage::DepthTarget => vk::BufferUsageFlags::empty(),
        })
        .fold(vk::BufferUsageFlags::empty(), |all, flags| all | flags)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Usage; 11] = [
        Usage::Sampled,
        Usage::StorageRead,
        Usage::StorageWrite,
        Usage::StorageUpdate,
        Usage::CopySource,
        Usage::CopyTarget,
        Usage::Indirect,
        Usage::ColourTarget,
        Usage::DepthTarget,
        Usage::Vertices,
        Usage::Indices,
    ];

    const BOTH: [Shaders; 2] = [Shaders::Computing, Shaders::Drawing];

    #[test]
    fn what_a_plan_takes_for_one_layout_is_one_layout() {
        for a in ALL {
            for b in ALL {
                let of_buffers = [Usage::Indirect, Usage::Vertices, Usage::Indices];
                if !of_buffers.contains(&a) && !of_buffers.contains(&b) {
                    assert_eq!(
                        a.same_layout(b),
                        row(a).layout == row(b).layout,
                        "{a:?} and {b:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn only_writes_are_made_available() {
        for (usage, shaders) in ALL
            .into_iter()
            .flat_map(|usage| BOTH.map(|shaders| (usage, shaders)))
        {
            let (stages, access) = source(usage.into(), shaders);
            let row = row_in(usage, shaders);
            assert_eq!(stages, row.stages);
            assert_eq!(!access.is_empty(), usage.writes(), "{usage:?}");
            assert!(row.access.contains(access));
        }
        let both = UsageSet::from(Usage::CopyTarget).with(Usage::StorageUpdate);
        let (stages, access) = source(both, Shaders::Computing);
        assert!(stages.contains(vk::PipelineStageFlags2::COMPUTE_SHADER));
        assert!(stages.contains(vk::PipelineStageFlags2::CLEAR));
        assert!(access.contains(vk::AccessFlags2::TRANSFER_WRITE));
        assert!(access.contains(vk::AccessFlags2::SHADER_STORAGE_WRITE));
    }

    #[test]
    fn nothing_to_wait_for_means_everything_before() {
        for shaders in BOTH {
            assert_eq!(
                source(UsageSet::EMPTY, shaders),
                (
                    vk::PipelineStageFlags2::ALL_COMMANDS,
                    vk::AccessFlags2::MEMORY_WRITE
                )
            );
        }
    }

    /// What is at rest can be read by all shaders of a plan, and whoever takes
    /// it from rest waits for all of them.
    #[test]
    fn shaders_of_draws_meet_the_rest_by_barriers() {
        assert_eq!(Shaders::Computing.leave_rest(), None);
        assert_eq!(Shaders::Computing.come_to_rest(), None);
        let ([before, reads], [after, rest]) = (
            Shaders::Drawing.leave_rest().unwrap(),
            Shaders::Drawing.come_to_rest().unwrap(),
        );
        for usage in [Usage::Sampled, Usage::StorageRead] {
            let (at_rest, in_plan) = (row(usage), row_in(usage, Shaders::Drawing));
            assert_eq!(at_rest.layout, in_plan.layout);
            assert_eq!(at_rest.stages, vk::PipelineStageFlags2::COMPUTE_SHADER);
            assert_eq!(before.0, at_rest.stages);
            assert_eq!(before.0 | reads.0, in_plan.stages);
            assert!(reads.1.contains(in_plan.access));
            assert_eq!(after.0 | rest.0, in_plan.stages);
            assert_eq!(rest.0, at_rest.stages);
        }
    }
}

//! What each [`Usage`] is in Vulkan: one table.
//!
//! | usage           | stages           | access                              | layout                     |
//! |-----------------|------------------|-------------------------------------|----------------------------|
//! | `Sampled`       | `COMPUTE_SHADER` | `SHADER_SAMPLED_READ`               | `SHADER_READ_ONLY_OPTIMAL` |
//! | `StorageRead`   | `COMPUTE_SHADER` | `SHADER_STORAGE_READ`               | `GENERAL`                  |
//! | `StorageWrite`  | `COMPUTE_SHADER` | `SHADER_STORAGE_WRITE`              | `GENERAL`                  |
//! | `StorageUpdate` | `COMPUTE_SHADER` | `SHADER_STORAGE_READ`, `…_WRITE`    | `GENERAL`                  |
//! | `CopySource`    | `COPY`           | `TRANSFER_READ`                     | `TRANSFER_SRC_OPTIMAL`     |
//! | `CopyTarget`    | `COPY`, `CLEAR`  | `TRANSFER_WRITE`                    | `TRANSFER_DST_OPTIMAL`     |
//! | `Indirect`      | `DRAW_INDIRECT`  | `INDIRECT_COMMAND_READ`             | buffers only               |
//!
//! A barrier waits for the stages of every usage in `from` and makes what they
//! *wrote* available; reads need no more than the wait. An empty `from` stands
//! for whatever ran before on the queue: `ALL_COMMANDS` with `MEMORY_WRITE`.
//! A `layout` of `None` lets the contents go: `UNDEFINED`.

use ash::vk;
use etalon_core::plan::{Usage, UsageSet};

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) stages: vk::PipelineStageFlags2,
    pub(crate) access: vk::AccessFlags2,
    pub(crate) layout: vk::ImageLayout,
}

/// The row of a usage.
pub(crate) fn row(usage: Usage) -> Row {
    use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
    let (stages, access, layout) = match usage {
        Usage::Sampled => (
            S::COMPUTE_SHADER,
            A::SHADER_SAMPLED_READ,
            L::SHADER_READ_ONLY_OPTIMAL,
        ),
        Usage::StorageRead => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ, L::GENERAL),
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
pub(crate) fn source(from: UsageSet) -> (vk::PipelineStageFlags2, vk::AccessFlags2) {
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
    from.iter().map(row).fold(
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
        for usage in ALL {
            let (stages, access) = source(usage.into());
            assert_eq!(stages, row(usage).stages);
            assert_eq!(!access.is_empty(), usage.writes(), "{usage:?}");
            assert!(row(usage).access.contains(access));
        }
        let both = UsageSet::from(Usage::CopyTarget).with(Usage::StorageUpdate);
        let (stages, access) = source(both);
        assert!(stages.contains(vk::PipelineStageFlags2::COMPUTE_SHADER));
        assert!(stages.contains(vk::PipelineStageFlags2::CLEAR));
        assert!(access.contains(vk::AccessFlags2::TRANSFER_WRITE));
        assert!(access.contains(vk::AccessFlags2::SHADER_STORAGE_WRITE));
    }

    #[test]
    fn nothing_to_wait_for_means_everything_before() {
        assert_eq!(
            source(UsageSet::EMPTY),
            (
                vk::PipelineStageFlags2::ALL_COMMANDS,
                vk::AccessFlags2::MEMORY_WRITE
            )
        );
    }
}

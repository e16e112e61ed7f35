//! How much goes from vertex to fragment kernels, and out of those.

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{BindingKind, Kernel, StageValue};

use crate::error::unsupported;

/// Holds the stages of a kernel, which `step` draws with, against the limits.
pub(crate) fn check(
    limits: &vk::PhysicalDeviceLimits,
    kernel: &Kernel,
    colours: usize,
    step: &str,
) -> Result<(), BackendError> {
    let stages = kernel.raster();
    let outputs = stages.map_or(&[][..], |stages| &stages.vertex.outputs);
    let fragment = stages.and_then(|stages| stages.fragment.as_ref());
    let inputs = fragment.map_or(&[][..], |fragment| &fragment.inputs);
    // A location has four components; positions take one more.
    let components = |values: &[StageValue]| {
        let last = values.iter().map(|value| u64::from(value.location)).max();
        last.map_or(0, |last| 4 * (last + 1)) + 4
    };
    let stored = kernel.bindings.iter().filter(|binding| {
        matches!(
            binding.kind,
            BindingKind::StorageBuffer { .. } | BindingKind::StorageTexture { .. }
        )
    });
    let sampled_or_stored = kernel
        .bindings
        .iter()
        .filter(|binding| !matches!(binding.kind, BindingKind::Sampler { .. }));
    let as_u64 = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
    for (what, wanted, most) in [
        (
            "components of vertices",
            components(outputs),
            limits.max_vertex_output_components,
        ),
        (
            "components of fragments",
            components(inputs),
            limits.max_fragment_input_components,
        ),
        (
            "colour targets",
            as_u64(colours),
            limits.max_fragment_output_attachments,
        ),
        (
            "storage buffers, storage textures and colour targets",
            as_u64(stored.count() + colours),
            limits.max_fragment_combined_output_resources,
        ),
        (
            "resources and colour targets",
            as_u64(sampled_or_stored.count() + colours),
            limits.max_per_stage_resources,
        ),
    ] {
        if wanted > u64::from(most) {
            let what = format!(
                "{wanted} {what} (at most {most}) for kernel `{}`",
                kernel.name
            );
            return Err(unsupported(step, what));
        }
    }
    Ok(())
}

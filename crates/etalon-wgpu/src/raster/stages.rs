//! How much goes from the vertex stage of a kernel to its fragment stage: wgpu looks
//! at it only where it translates the stages itself.

use etalon_core::backend::BackendError;
use etalon_core::kernel::Kernel;

use crate::fault::unsupported;
use crate::gpu::Gpu;

/// Holds what vertices pass on against the device.
pub(super) fn check(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<(), BackendError> {
    let most = gpu.raw_limits().max_inter_stage_shader_variables;
    let passed = kernel
        .raster()
        .map_or(&[][..], |stages| &stages.vertex.outputs);
    let past = passed.iter().any(|value| value.location >= most);
    if past || passed.len() > most as usize {
        return Err(unsupported(
            step,
            format!("more values from vertices to fragments than the device's {most}"),
        ));
    }
    Ok(())
}

//! Work in counters that depend on no hardware: what the interpreter counts while
//! it runs a plan.

use std::collections::BTreeMap;

use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::plan::Plan;
use etalon_cpu::{CpuBackend, CpuOptions, Profile};

use crate::model::Work;

/// The kernel that follows rays.
const MARCH: &str = "ssr/march";

/// Whether an operation of the interpreter fetches a texel, or four for a gather
/// and eight at most for a sample, which count as one each: a sampler is one unit.
fn fetches(operation: &str) -> bool {
    ["image.load", "image.sample", "image.gather"]
        .iter()
        .any(|prefix| operation.starts_with(prefix))
}

/// Counts what a plan does in its first frame.
///
/// # Errors
/// If it cannot be run.
pub fn count(plan: &Plan, inputs: &Inputs<'_>) -> Result<Work, BackendError> {
    let mut backend = CpuBackend::new(&CpuOptions {
        profile: true,
        ..CpuOptions::default()
    })?;
    backend.execute(plan, inputs)?;
    let profiles = backend.profiles();
    let mut work = Work::default();
    for profile in &profiles {
        for instruction in &profile.instructions {
            // What is the same for all invocations is done once for a batch.
            let times = if instruction.uniform {
                instruction.cost.executions
            } else {
                instruction.cost.active_lanes
            };
            work.operations += times;
            if fetches(&instruction.operation) {
                work.texel_fetches += times;
            }
        }
        if profile.kernel == MARCH {
            work.steps_per_ray = steps_per_ray(profile);
        }
    }
    Ok(work)
}

/// Texels looked at along a ray, those of a pyramid as well, in the mean over the pixels
/// that show a surface.
///
/// The march itself reads its own pixel once, before it begins, and its searches, which
/// are other files, look at the others: of the march's own lines that fetch, the one that
/// fetches least is read once by every pixel that shows a surface.
fn steps_per_ray(profile: &Profile) -> Option<f64> {
    let mut own: BTreeMap<u32, u64> = BTreeMap::new();
    let mut looks = 0;
    for instruction in &profile.instructions {
        let (location, lanes) = (&instruction.location, instruction.cost.active_lanes);
        if !fetches(&instruction.operation) {
            continue;
        }
        if location.file.contains(MARCH) {
            *own.entry(location.line).or_default() += lanes;
        } else {
            looks += lanes;
        }
    }
    let rays = own.values().copied().min().filter(|count| *count > 0)?;
    Some(looks as f64 / rays as f64)
}

//! How far devices may be from the interpreter in fast arithmetic: it runs the same
//! frames several times, each time as another device that WGSL allows.

use etalon::cpu::{CpuBackend, CpuOptions};
use etalon_core::backend::{Backend, BackendError, CapturedData};
use etalon_core::plan::Plan;
use etalon_stability::judge::spread::{PERTURBATIONS, Spread as Moves};
use etalon_stability::observe::Store;

use super::frame::Content;
use super::outcome::{Run, Spread};
use super::{ExecuteError, Job};

/// What a frame's passes stored, but for buffers, which hold integers.
fn stores(
    backend: &mut CpuBackend,
    plan: &Plan,
    content: &Content,
) -> Result<Vec<Store>, BackendError> {
    let execution = backend.execute(plan, &content.inputs())?;
    let textures = execution.captures.into_iter().filter_map(|captured| {
        let CapturedData::Texture(image) = captured.data else {
            return None;
        };
        Some(Store {
            pass: captured.pass,
            binding: captured.binding,
            image: Some(image),
            ..Store::default()
        })
    });
    Ok(textures.collect())
}

/// Runs the job's frames again, perturbed, and writes for each capture how far it moves.
///
/// # Errors
/// If the interpreter cannot run the plan, or a file cannot be written.
pub(super) fn add(
    job: &Job,
    plan: &Plan,
    content: &Content,
    run: &mut Run,
) -> Result<(), ExecuteError> {
    let mut backend = CpuBackend::new(&CpuOptions {
        threads: job.threads,
        perturbs: true,
        ..CpuOptions::default()
    })?;
    let mut spreads = Vec::new();
    for _ in 0..job.frames {
        spreads.push(Moves::around(&stores(&mut backend, plan, content)?));
    }
    for seed in 0..PERTURBATIONS {
        backend.reset_histories();
        backend.set_perturbation(Some(seed));
        for spread in &mut spreads {
            spread.widen(&stores(&mut backend, plan, content)?);
        }
    }
    for (frame, spread) in (0..).zip(&spreads) {
        for allowed in spread.allowed() {
            let Store { pass, binding, .. } = allowed.store;
            let of_store = |capture: &&mut super::outcome::Capture| {
                capture.key() == (frame, pass.as_str(), binding.as_str())
            };
            let Some(capture) = run.captures.iter_mut().find(of_store) else {
                continue;
            };
            let spread = Spread {
                // Up, so that what is allowed stays so.
                allowed: allowed
                    .channels
                    .iter()
                    .map(|texel| texel.map(|value| (value as f32).next_up()))
                    .collect(),
                decided: allowed.decided,
            };
            capture.write_spread(&job.out, &spread)?;
        }
    }
    Ok(())
}

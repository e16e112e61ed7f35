//! What was found, as the library's users take it.

use etalon_effects::budget::{DeviceProfile, EffectProfile, ProfilePoint};
use etalon_effects::effect;
use etalon_effects::quality::tolerance;

use crate::model::{ErrorKind, Executor, Subject, Sweep};

/// The settings of every effect of a frame on one executor in fast arithmetic, which is what
/// an engine runs, on the first scene of each effect. The error is the main one of
/// the algorithm, in multiples of what is [tolerable](tolerance).
#[must_use]
pub fn profile(sweep: &Sweep, executor: &Executor) -> DeviceProfile {
    let mut effects: Vec<EffectProfile> = Vec::new();
    // What is made once for many frames is no part of a frame's time.
    let framed = |subject: &&Subject| effect(&subject.effect).is_some();
    for subject in sweep.subjects.iter().filter(framed) {
        if !effects.iter().any(|known| known.effect == subject.effect) {
            effects.push(EffectProfile {
                effect: subject.effect.clone(),
                points: points(subject, &executor.id),
            });
        }
    }
    DeviceProfile {
        device: executor.device.clone(),
        size: sweep.size,
        effects,
    }
}

fn points(subject: &Subject, executor: &str) -> Vec<ProfilePoint> {
    let fast = subject
        .points
        .iter()
        .filter(|point| point.arithmetic == "fast");
    let mains = subject.mains();
    let main = mains
        .into_iter()
        .find(|metric| metric.kind == ErrorKind::Algorithm);
    fast.filter_map(|point| {
        let result = point.on(executor)?;
        let error = result.errors.get(&main?.id)? / tolerance(&subject.effect);
        Some(ProfilePoint {
            milliseconds: result.time?.median * 1e-6,
            error,
            values: point.settings.clone().into_iter().collect(),
        })
    })
    .collect()
}

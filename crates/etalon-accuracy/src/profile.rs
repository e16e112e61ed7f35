//! What was found, as the library's users take it.

use etalon_effects::budget::{DeviceProfile, EffectProfile, ProfilePoint};

use crate::model::{Executor, Subject, Sweep};

/// The settings of every effect on one executor in fast arithmetic, which is what
/// an engine runs, on the first scene of each effect.
///
/// The error is the relative mean square one against the exhaustive method;
/// exposure's, which is in stops, is turned into it: a factor of 2^e on all light
/// is a relative error of 2^e − 1.
#[must_use]
pub fn profile(sweep: &Sweep, executor: &Executor) -> DeviceProfile {
    let mut effects: Vec<EffectProfile> = Vec::new();
    for subject in &sweep.subjects {
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
    fast.filter_map(|point| {
        let mut results = point.results.iter();
        let result = results.find(|result| result.executor == executor)?;
        let error = match result.errors.get("algorithm.colour") {
            Some(error) => *error,
            None => (result.errors.get("algorithm.ev")?.exp2() - 1.0).powi(2),
        };
        Some(ProfilePoint {
            milliseconds: result.time?.median * 1e-6,
            error,
            values: point.settings.clone().into_iter().collect(),
        })
    })
    .collect()
}

//! What calls for reflections.

use etalon_core::graph::Decision;

use super::{Blend, Ssr};
use crate::demand::{Calls, Demands, Need, Thresholds, off, unseen};

/// What the march and the mix read.
pub(crate) const NEEDS: &[Need] = &[Need::Depth, Need::Normal, Need::Specular];

/// Something has to mirror.
pub(crate) fn decide(calls: &Calls<'_>) -> Decision {
    let Some(settings) = &calls.settings.ssr else {
        return off();
    };
    if !calls.outputs.lit() {
        return unseen("light");
    }
    if settings.resolution == 0.0 {
        return Decision::absent("its resolution is 0");
    }
    let Some(reflective) = &calls.demands.reflective else {
        return Decision::absent("no surface on screen mirrors");
    };
    let [smoothest, _] = reflective.roughness;
    let (specular, limits) = (reflective.specular, calls.thresholds);
    if specular <= limits.min_specular {
        return Decision::absent(format!(
            "no surface on screen mirrors more than {} of a colour; the most is {specular}",
            limits.min_specular
        ));
    }
    if smoothest > limits.max_roughness {
        return Decision::absent(format!(
            "no mirroring surface smoother than {} on screen; the smoothest has {smoothest}",
            limits.max_roughness
        ));
    }
    Decision::runs(format!(
        "surfaces of a roughness from {smoothest} on mirror up to {specular} of a colour, on {}",
        reflective.region
    ))
}

/// The settings without what nothing on screen calls for: where all that mirrors is
/// perfectly smooth, the blur has no share in the mix; and where most of the screen
/// mirrors, tiles save less than they cost.
pub(crate) fn suited(settings: &Ssr, demands: &Demands, thresholds: &Thresholds) -> Ssr {
    let Some(reflective) = demands.reflective else {
        return *settings;
    };
    let rough = reflective.roughness[1] > 0.0;
    let suited = Ssr {
        blur_radius: if rough { settings.blur_radius } else { 0 },
        ..*settings
    };
    match &thresholds.tiles {
        Some(cost) => suited.for_coverage(reflective.region.coverage().into(), cost),
        None => suited,
    }
}

/// How many times brighter than the brightest light reflections can make a texel:
/// each shows at most that light, by at most what its surface mirrors.
pub(crate) fn gain(settings: &Ssr, demands: &Demands) -> f32 {
    match (settings.blend, &demands.reflective) {
        (Blend::Add, Some(reflective)) => 1.0 + reflective.specular,
        (Blend::Add, None) | (Blend::Replace, _) => 1.0,
    }
}

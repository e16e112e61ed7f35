//! What calls for reflections.

use etalon_core::graph::Decision;

use super::{Blend, Ssr};
use crate::demand::{Calls, Demands, Need, Reflective, Thresholds, off, unseen};

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
/// perfectly smooth, the blur has no share in the mix; where nothing is as rough as what
/// is marched at a quarter of the rate, or nothing smoother, there is one rate; and where
/// most of the screen mirrors, tiles save less than they cost. The picture stays the same
/// but where reflections are [faint](Thresholds::faint_specular) or
/// [distant](Thresholds::distant).
pub(crate) fn suited(settings: &Ssr, demands: &Demands, thresholds: &Thresholds) -> Ssr {
    let Some(reflective) = demands.reflective else {
        return *settings;
    };
    let rough = reflective.roughness[1] > 0.0;
    let suited = Ssr {
        blur_radius: if rough { settings.blur_radius } else { 0 },
        quarter_from: quarter_from(settings, &reflective, thresholds),
        ..*settings
    };
    match &thresholds.tiles {
        Some(cost) => suited.for_coverage(reflective.region.coverage().into(), cost),
        None => suited,
    }
}

/// The roughness from which one texel in four is marched.
fn quarter_from(settings: &Ssr, reflective: &Reflective, thresholds: &Thresholds) -> f32 {
    // Specular maps of 8 bits round a roughness by half of this.
    const STEP: f32 = 1.0 / 255.0;
    let [smoothest, roughest] = reflective.roughness;
    let limit = settings.quarter_from;
    let faint = reflective.specular <= thresholds.faint_specular;
    if faint || is_distant(reflective, thresholds) || smoothest >= limit + STEP {
        0.0
    } else if roughest <= limit - STEP {
        Ssr::NO_QUARTER
    } else {
        limit
    }
}

fn is_distant(reflective: &Reflective, thresholds: &Thresholds) -> bool {
    // A distance that nobody set is not reached by infinite ones either.
    thresholds.distant.is_finite() && reflective.nearest >= thresholds.distant
}

/// Why [`suited`] settings march at another rate than was asked for, if they do.
pub(crate) fn other_rate(asked: &Ssr, suited: &Ssr, calls: &Calls<'_>) -> Option<String> {
    let reflective = calls.demands.reflective?;
    let [smoothest, roughest] = reflective.roughness;
    if asked.quarter_from == suited.quarter_from {
        return None;
    }
    Some(if suited.quarter_from != 0.0 {
        format!("nothing that mirrors is rougher than {roughest}: every texel is marched")
    } else if is_distant(&reflective, calls.thresholds) {
        format!(
            "no surface that mirrors is nearer than {}: one texel in four is marched",
            reflective.nearest
        )
    } else if smoothest < asked.quarter_from {
        format!(
            "no surface mirrors more than {} of a colour: one texel in four is marched",
            reflective.specular
        )
    } else {
        format!("nothing that mirrors is smoother than {smoothest}: one texel in four is marched")
    })
}

/// How many times brighter than the brightest light reflections can make a texel:
/// each shows at most that light, by at most what its surface mirrors.
pub(crate) fn gain(settings: &Ssr, demands: &Demands) -> f32 {
    match (settings.blend, &demands.reflective) {
        (Blend::Add, Some(reflective)) => 1.0 + reflective.specular,
        (Blend::Add, None) | (Blend::Replace, _) => 1.0,
    }
}

//! How bright surfaces can get by what lights them.

use etalon_effects::environment::Surroundings;
use etalon_effects::lighting::{LightKind, PunctualLight};
use glam::{DVec3, Vec3};

/// The most that a half float holds.
pub(super) const MOST: f32 = 65_504.0;

/// The least roughness that shading knows, and the least squared distance of lights.
const LEAST_ROUGHNESS: f32 = 0.045;
const LEAST_SQUARED: f64 = 1e-6;

/// Radiance that a surface of a roughness sends back at most per irradiance.
///
/// Scattered light is at most 1/π. Of GGX the distribution is at most 1/(π α²), Smith's
/// visibility times the cosine of the light at most 1/(2 α), and Fresnel's term at most
/// 1, with α the squared roughness (B. Walter et al. 2007, E. Heitz 2014).
fn reflected(roughness: f32) -> f32 {
    use std::f32::consts::FRAC_1_PI;
    let alpha = roughness.max(LEAST_ROUGHNESS).powi(2);
    FRAC_1_PI + 0.5 * FRAC_1_PI / alpha.powi(3)
}

/// The largest channel of the light from a part within a box in the world, of a
/// roughness at least, lit by all lights and by what is around it.
pub(super) fn brightest(
    bounds: [DVec3; 2],
    roughness: f32,
    emission: Vec3,
    lights: &[PunctualLight],
    around: &Surroundings,
) -> f32 {
    if around.environment.is_some() {
        return MOST;
    }
    let [low, high] = bounds;
    let irradiance: f64 = lights
        .iter()
        .map(|light| {
            let power = f64::from(light.power.max_element());
            if light.kind == LightKind::Directional {
                return power;
            }
            let nearest = light.position.clamp(low, high);
            let squared = nearest.distance_squared(light.position);
            let reach = light.reach.map_or(f64::INFINITY, f64::from);
            if squared > reach * reach {
                0.0
            } else {
                power / squared.max(LEAST_SQUARED)
            }
        })
        .sum();
    // Of uniform light a surface sends back no more than it gets; the gradient's
    // largest is at one end. Twice, for scattered and mirrored light counted apart.
    let uniform = 2.0 * around.above.max(around.below).max_element();
    // A hundredth for what roundings and the approximation of what is mirrored add.
    let light = reflected(roughness) * irradiance as f32 + uniform;
    (1.01 * (emission.max_element() + light)).min(MOST)
}

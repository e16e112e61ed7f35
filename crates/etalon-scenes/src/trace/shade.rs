//! Direct light on a surface: Lambert below a GGX lobe, hard shadows.
//!
//! The specular lobe is the GGX distribution with height-correlated Smith
//! visibility (Walter et al. 2007; Heitz, JCGT 3(2), 2014) and Schlick's Fresnel
//! term. `1 − (n·h)²` is taken as `|n × h|²`, which does not cancel for smooth
//! surfaces (Filament's materials guide, section 4.4.1).

use std::f64::consts::PI;

use glam::DVec3;

use super::material::Material;
use super::ray::Hit;
use super::scene::{Light, Scene};

/// Lights have no extent, so a smooth surface would show them as single, nearly
/// infinite pixels. For them alone surfaces are at least this rough, which gives
/// lights an apparent size.
const LEAST_ROUGHNESS: f64 = 0.12;

/// A material's properties at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) base: DVec3,
    pub(crate) specular: DVec3,
    pub(crate) roughness: f64,
    pub(crate) emission: DVec3,
}

impl Surface {
    pub(crate) fn new(material: &Material, position: DVec3) -> Self {
        Self {
            base: material.base.at(position),
            specular: material.specular.at(position),
            roughness: material.roughness.at(position),
            emission: material.emission,
        }
    }

    /// Whether it reflects at all.
    pub(crate) fn reflects(&self) -> bool {
        self.specular.max_element() > 0.0
    }
}

/// Radiance that leaves the hit point in the unit direction `out`: emission and
/// the reflection of lights and ambient light, without reflections of the scene.
pub(crate) fn radiance(scene: &Scene, hit: &Hit, surface: &Surface, out: DVec3) -> DVec3 {
    let n = hit.normal;
    let ambient = scene.ambient();
    let from_everywhere = ambient.below.lerp(ambient.above, 0.5 + 0.5 * n.y);
    let mut sum = surface.emission + surface.base * from_everywhere;
    for light in scene.lights() {
        let (towards, irradiance, end) = match *light {
            Light::Directional {
                towards,
                irradiance,
            } => (towards.normalize(), irradiance, f64::INFINITY),
            Light::Point {
                position,
                intensity,
                body,
            } => {
                let offset = position - hit.position;
                let distance = offset.length();
                if distance <= body {
                    continue;
                }
                (
                    offset / distance,
                    intensity / (distance * distance),
                    distance - body,
                )
            }
        };
        let cosine = n.dot(towards);
        if cosine > 0.0 && !scene.occluded(&hit.ray(towards), end) {
            sum += reflected(surface, n, out, towards) * irradiance * cosine;
        }
    }
    sum
}

/// The reflectance distribution function.
fn reflected(surface: &Surface, n: DVec3, out: DVec3, towards: DVec3) -> DVec3 {
    let Some(h) = (out + towards).try_normalize() else {
        return surface.base / PI;
    };
    let roughness = surface.roughness.max(LEAST_ROUGHNESS);
    let alpha = roughness * roughness;
    let alpha2 = alpha * alpha;
    let (nl, nv, nh) = (n.dot(towards).max(0.0), n.dot(out).max(1e-6), n.dot(h));
    let spread = nh * nh * alpha2 + n.cross(h).length_squared();
    let distribution = alpha2 / (PI * spread * spread);
    let smith = |a: f64, b: f64| a * (b * b * (1.0 - alpha2) + alpha2).sqrt();
    let visibility = 0.5 / (smith(nl, nv) + smith(nv, nl));
    let grazing = 1.0 - out.dot(h).clamp(0.0, 1.0);
    let grazing2 = grazing * grazing;
    let fresnel =
        surface.specular + (DVec3::ONE - surface.specular) * (grazing2 * grazing2 * grazing);
    // A black specular colour means no specular layer, not a layer seen at grazing angles only.
    let fresnel = if surface.reflects() {
        fresnel
    } else {
        DVec3::ZERO
    };
    surface.base * (DVec3::ONE - fresnel) / PI + fresnel * (distribution * visibility)
}

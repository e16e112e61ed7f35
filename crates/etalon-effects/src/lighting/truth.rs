//! The truth of lighting: the reflection model of a point in f64.
//!
//! # Definition
//! glTF 2.0, appendix B, of lights without extent (`KHR_lights_punctual`): Lambert's
//! reflection below microfacets with the GGX distribution (B. Walter et al., 2007),
//! Smith's masking with correlated heights (E. Heitz, 2014), and Schlick's Fresnel term
//! (1994), each in its usual form, with cosines and tangents, which kernels do not use.
//!
//! Of what is no number or out of its range: light is as [`radiance`] says, shares as
//! [`unit_interval`] does. What has no normal faces along +z, what has no place is at
//! the eye and seen along +z. No surface is smoother than a roughness of 0.045, and none
//! is nearer to a light than a millimetre. The light of one lamp is at most
//! [`MOST_LIGHT`].

use std::f64::consts::PI;

use glam::DVec3;

use super::{LightKind, PunctualLight};
use crate::CameraParams;
use crate::geometry::View;
use crate::truth::{MOST_LIGHT, light, radiance, unit_interval};

/// No surface is taken to be smoother.
const LEAST_ROUGHNESS: f64 = 0.045;

/// A point of a surface, in view space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where it is; the eye's place for none.
    pub place: DVec3,
    /// Of unit length.
    pub normal: DVec3,
    /// Scattered per light received.
    pub colour: DVec3,
    /// Mirrored at normal incidence.
    pub mirrored: DVec3,
    /// 0 mirrors sharply, 1 not at all.
    pub roughness: f64,
}

/// A texel of each image of a G-buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texels {
    /// Scattered light, and in alpha whether there is a surface.
    pub colour: [f64; 4],
    /// In view space.
    pub normal: [f64; 4],
    /// Mirrored at normal incidence; alpha is 1 − roughness.
    pub specular: [f64; 4],
    /// Device depth.
    pub depth: f64,
}

/// The distance of what has a depth; 0 where there is nothing.
fn distance(camera: &CameraParams, depth: f64) -> f64 {
    let [bias, slope] = camera.depth_bias_slope().as_dvec2().to_array();
    let [near, end] = camera.distance_range().as_dvec2().to_array();
    let distance = slope / (depth - bias);
    // What is in front of the near plane by no more than rounding is on it.
    if (near * 0.999_999..end).contains(&distance) {
        distance
    } else {
        0.0
    }
}

/// A direction; +z for what has none.
fn unit(v: DVec3) -> DVec3 {
    let largest = v.abs().max_element();
    let known = !v.is_nan() && (2_f64.powi(-50)..=2_f64.powi(50)).contains(&largest);
    if known { v.normalize() } else { DVec3::Z }
}

fn limited([r, g, b, _]: [f64; 4]) -> DVec3 {
    DVec3::new(unit_interval(r), unit_interval(g), unit_interval(b))
}

impl Point {
    /// What is seen at `ndc` of a picture.
    #[must_use]
    pub fn seen(camera: &CameraParams, ndc: glam::DVec2, texels: &Texels) -> Self {
        let across = (ndc - camera.centre.as_dvec2()) / camera.scale.as_dvec2();
        let [x, y, z, _] = texels.normal;
        Self {
            place: across.extend(-1.0) * distance(camera, texels.depth),
            normal: unit(DVec3::new(x, y, z)),
            colour: light(texels.colour),
            mirrored: limited(texels.specular),
            roughness: 1.0 - unit_interval(texels.specular[3]),
        }
    }

    /// What it sends to the eye of a light, each channel up to [`MOST_LIGHT`].
    #[must_use]
    pub fn lit(&self, light: &PunctualLight, view: &View) -> DVec3 {
        let (towards, irradiance) = self.arriving(light, view);
        let eye = unit(-self.place);
        let nl = self.normal.dot(towards);
        if nl <= 0.0 {
            return DVec3::ZERO;
        }
        let half = (towards + eye).try_normalize().unwrap_or(self.normal);
        let nh = self.normal.dot(half);
        // Normals that turn away from the eye count as turned to it.
        let nv = self.normal.dot(eye).abs().max(1e-4);
        let a2 = self.roughness.max(LEAST_ROUGHNESS).powi(4);
        let lambda = |cosine: f64| {
            let tangent2 = (1.0 - cosine * cosine).max(0.0) / (cosine * cosine);
            0.5 * ((1.0 + a2 * tangent2).sqrt() - 1.0)
        };
        let distribution = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
        let masking = 1.0 / (1.0 + lambda(nl) + lambda(nv));
        let edge = (1.0 - towards.dot(half).clamp(0.0, 1.0)).powi(5);
        let fresnel = self.mirrored + (DVec3::ONE - self.mirrored) * edge;
        let scattered = self.colour / PI * (DVec3::ONE - fresnel) * nl;
        let mirrored = fresnel * (distribution * masking / (4.0 * nv));
        let sent = (scattered + mirrored) * irradiance;
        DVec3::from(sent.to_array().map(radiance)).min(DVec3::splat(MOST_LIGHT))
    }

    /// Where a light is seen, and its irradiance on a plane that faces it.
    fn arriving(&self, light: &PunctualLight, view: &View) -> (DVec3, DVec3) {
        let power = light.power.as_dvec3();
        let shines = view
            .view
            .transform_vector3(light.direction)
            .normalize_or(DVec3::NEG_Z);
        if light.kind == LightKind::Directional {
            return (-shines, power);
        }
        let way = view.view.transform_point3(light.position) - self.place;
        let towards = way.try_normalize().unwrap_or(-shines);
        let squared = way.length_squared().max(1e-6);
        let cone = match light.kind {
            LightKind::Spot { inner, outer } => {
                let angle = f64::from(outer);
                // cos a − cos b is 2 sin((a + b) / 2) sin((b − a) / 2).
                let step = |a: f64, b: f64| 2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin();
                let off = shines.cross(-towards).length().atan2(shines.dot(-towards));
                (step(off, angle) / step(inner.into(), angle)).clamp(0.0, 1.0)
            }
            _ => 1.0,
        };
        let window = light.reach.map_or(1.0, |reach| {
            (1.0 - (squared / f64::from(reach).powi(2)).powi(2)).clamp(0.0, 1.0)
        });
        (towards, power * (window * cone * cone / squared))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, Vec3};

    use super::*;

    fn view() -> View {
        View {
            camera: CameraParams::perspective(1.0, 1.0, 0.1),
            view: DMat4::IDENTITY,
            previous: DMat4::IDENTITY,
        }
    }

    fn lamp() -> PunctualLight {
        PunctualLight {
            kind: LightKind::Point,
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            power: Vec3::ONE,
            reach: None,
        }
    }

    /// White without a coat, lit from where it is seen: colour over π by the square of
    /// the distance.
    #[test]
    fn a_white_wall_sends_what_lambert_says() {
        let point = Point {
            place: DVec3::new(0.0, 0.0, -2.0),
            normal: DVec3::Z,
            colour: DVec3::ONE,
            mirrored: DVec3::ZERO,
            roughness: 1.0,
        };
        let sent = point.lit(&lamp(), &view());
        assert!((sent - DVec3::splat(0.25 / PI)).length() < 1e-12, "{sent}");
        let behind = Point {
            normal: DVec3::NEG_Z,
            ..point
        };
        assert_eq!(behind.lit(&lamp(), &view()), DVec3::ZERO);
    }

    /// Seen and lit along the normal a mirror sends its peak, 1 / (4 π α²), of f0.
    #[test]
    fn a_mirror_sends_the_distributions_peak() {
        let point = Point {
            place: DVec3::new(0.0, 0.0, -1.0),
            normal: DVec3::Z,
            colour: DVec3::ZERO,
            mirrored: DVec3::splat(0.5),
            roughness: 0.5,
        };
        let sent = point.lit(&lamp(), &view()).x;
        let peak = 0.5 / (4.0 * PI * 0.5_f64.powi(4));
        assert!((sent / peak - 1.0).abs() < 1e-12, "{sent} and {peak}");
    }

    #[test]
    fn cones_fall_from_one_angle_to_the_other() {
        let point = Point {
            place: DVec3::new(0.0, 0.0, -1000.0),
            normal: DVec3::Z,
            colour: DVec3::ONE,
            mirrored: DVec3::ZERO,
            roughness: 1.0,
        };
        let lit = |inner: f32, outer: f32, aside: f64| {
            let light = PunctualLight {
                kind: LightKind::Spot { inner, outer },
                position: DVec3::new(aside, 0.0, 0.0),
                power: Vec3::splat(1e6),
                ..lamp()
            };
            point.lit(&light, &view()).x * PI
        };
        assert!((lit(5e-4, 1e-3, 0.0) - 1.0).abs() < 1e-6);
        assert_eq!(lit(5e-4, 1e-3, 1.01), 0.0);
        // 0.75 of a milliradian: (1 − 0.5625) / (1 − 0.25), squared.
        let expected = (0.4375_f64 / 0.75).powi(2);
        assert!((lit(5e-4, 1e-3, 0.75) / expected - 1.0).abs() < 1e-5);
    }
}

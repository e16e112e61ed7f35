//! What a radiance map holds, in f64, from its definition.
//!
//! The first of the two factors of B. Karis' split sum ("Real Shading in Unreal Engine
//! 4", 2013) is the light that a surface mirrors, seen from straight above, over what it
//! would mirror of uniform light without loss:
//!
//! > L(n, α) = ∫ L(l) D(h) (n·l) dl / ∫ D(h) (n·l) dl
//!
//! over the hemisphere of n, with h half way between n and l, and D of GGX (B. Walter
//! et al., "Microfacet Models for Refraction through Rough Surfaces", 2007, equation
//! 33); α is roughness squared. Without roughness it is the light itself, at roughness 1,
//! where D is the same everywhere, irradiance over π.
//!
//! [`averaged`] integrates a function that is given everywhere, to rounding where it is
//! smooth. [`Light`] is a map or a picture cut into small pieces, and its
//! [`averaged`](Light::averaged) the sum over all of them. No direction is drawn, no
//! mip is read: nothing that a number of samples decides.

use std::f64::consts::{PI, TAU};

use etalon_core::image::ImageError;
use glam::{DVec2, DVec3};

use super::map::{corner, direction, mips, octahedral, octahedral_direction};
use crate::EffectError;
use crate::check::Settings;
use crate::truth::{Plane, exact_sum, light, reserved};

/// The roughness that a level of a radiance map is made for, `side` texels high: evenly
/// spaced from 0 to 1.
///
/// # Errors
/// If there is no map of that side, or no such level in it.
pub fn roughness(side: u32, level: u32) -> Result<f64, EffectError> {
    super::map::check_side(side)?;
    let last = mips(side) - 1;
    Settings("environment").count("level", level, 0, last)?;
    Ok(f64::from(level) / f64::from(last))
}

/// 1 − α² for roughness limited to `[0, 1]`, 0 for NaN.
fn narrowness(roughness: f64) -> f64 {
    1.0 - crate::truth::unit_interval(roughness).powi(4)
}

/// D(h) (n·l) for the cosine n·l, but for a factor: 1 of narrowness 0 and n = l. The half
/// vector's cosine, squared, is half of 1 + n·l.
fn weight(cosine: f64, narrowness: f64) -> f64 {
    let root = 1.0 - narrowness * (0.5 + 0.5 * cosine);
    cosine.max(0.0) / (root * root)
}

/// Nodes of [`averaged`] from the pole to the edge of the hemisphere.
const RINGS: usize = 64;

/// Nodes around the pole: exact for harmonics up to the order of 127.
const SPOKES: u32 = 128;

/// The light around a unit direction as a surface of a roughness in `[0, 1]` mirrors it.
///
/// Of polynomials of a low degree it is exact to 1e-12; light with edges is met at 8192
/// directions, most of them where the surface mirrors most.
#[must_use]
pub fn averaged(normal: DVec3, roughness: f64, light: &dyn Fn(DVec3) -> DVec3) -> DVec3 {
    let narrow = narrowness(roughness);
    if narrow >= 1.0 {
        return light(normal);
    }
    let (u, v) = normal.any_orthonormal_pair();
    // In t from the edge to the pole, so that D's root falls in a constant ratio.
    let [edge, pole] = [0.5, 1.0].map(|half| (-narrow * half).ln_1p());
    let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
    for (node, share) in gauss_legendre(RINGS) {
        let t = 0.5 + 0.5 * node;
        let (half, step) = if narrow > 0.0 {
            let root = edge + (pole - edge) * t;
            (-root.exp_m1() / narrow, root.exp())
        } else {
            (0.5 + 0.5 * t, 1.0)
        };
        let cosine = 2.0 * half - 1.0;
        let across = 2.0 * (half * (1.0 - half)).max(0.0).sqrt();
        let weight = share * step * weight(cosine, narrow);
        for spoke in 0..SPOKES {
            let (sin, cos) = (TAU * f64::from(spoke) / f64::from(SPOKES)).sin_cos();
            sum += light(u * (across * cos) + v * (across * sin) + normal * cosine) * weight;
            weights += weight;
        }
    }
    sum / weights
}

/// Nodes and weights on `[−1, 1]` (Abramowitz and Stegun, 25.4.29): roots of Legendre's
/// polynomial by Newton's method.
fn gauss_legendre(count: usize) -> impl Iterator<Item = (f64, f64)> {
    (0..count).map(move |k| {
        let n = count as f64;
        let mut x = (PI * (k as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut before, mut value) = (1.0, x);
            for degree in 2..=count {
                let d = degree as f64;
                (before, value) = (
                    value,
                    ((2.0 * d - 1.0) * x * value - (d - 1.0) * before) / d,
                );
            }
            slope = n * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    })
}

/// Pieces of a texel in each axis. A lobe is a radian times α wide, 5 texels or more of
/// the largest level, so that the midpoints of halves are off by (1 / 10)² / 24 of how
/// much it bends, and what is off evens out over the lobe.
const PARTS: u32 = 2;

/// Pieces that are summed before the next direction's turn, so that they stay in the
/// nearest cache.
const BLOCK: usize = 512;

/// Light from all directions, in pieces of known solid angle.
#[derive(Clone, Debug)]
pub struct Light {
    /// x, y, z; red, green and blue times the solid angle; the solid angle.
    pieces: [Vec<f64>; 7],
}

impl Light {
    fn with_room(count: usize) -> Result<Self, ImageError> {
        let mut pieces: [Vec<f64>; 7] = Default::default();
        for values in &mut pieces {
            *values = reserved(count)?;
        }
        Ok(Self { pieces })
    }

    fn push(&mut self, at: DVec3, light: DVec3, solid_angle: f64) {
        let light = light * solid_angle;
        let values = [at.x, at.y, at.z, light.x, light.y, light.z, solid_angle];
        for (all, value) in self.pieces.iter_mut().zip(values) {
            all.push(value);
        }
    }

    /// The largest level of the image of an [`EnvironmentMap`](super::EnvironmentMap),
    /// as kernels interpolate it.
    ///
    /// # Errors
    /// If the plane is not of the size of such an image, or memory runs out.
    pub fn of_map(map: &Plane) -> Result<Self, EffectError> {
        let side = side(map)?;
        let inner = side - 2;
        let count = inner * PARTS;
        let mut pieces = Self::with_room((count as usize).pow(2))?;
        let step = 2.0 / f64::from(count);
        for (x, y) in square(count) {
            let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * step - 1.0;
            let at = octahedral_direction(place);
            // A face's texel is seen from its distance r, under an angle of cosine
            // 1 / (r √3), and √3 larger than its shadow on the square.
            let solid_angle = step * step * at.abs().element_sum().powi(3);
            pieces.push(at, map_light(map, side, place), solid_angle);
        }
        Ok(pieces)
    }

    /// An equirectangular picture, laid out as for
    /// [`EnvironmentMap`](super::EnvironmentMap), each texel as a whole.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn of_equirectangular(picture: &Plane) -> Result<Self, EffectError> {
        let [width, height] = picture.size();
        let mut pieces = Self::with_room(picture.texels().len())?;
        for y in 0..height {
            let edge = |row: u32| (PI * f64::from(row) / f64::from(height)).cos();
            let solid_angle = TAU / f64::from(width) * (edge(y) - edge(y + 1));
            for x in 0..width {
                let uv = [(x, width), (y, height)]
                    .map(|(at, size)| (f64::from(at) + 0.5) / f64::from(size));
                let texel = picture.at(x.into(), y.into());
                pieces.push(direction(uv[0], uv[1]), light(texel), solid_angle);
            }
        }
        Ok(pieces)
    }

    /// Each piece's direction, and its light times its solid angle.
    pub(super) fn pieces(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        let [x, y, z, red, green, blue, _] = &self.pieces;
        (0..x.len()).map(|k| {
            (
                DVec3::new(x[k], y[k], z[k]),
                DVec3::new(red[k], green[k], blue[k]),
            )
        })
    }

    /// The mean over all directions, and the solid angle of all pieces, which is 4π but
    /// for what their sizes are off.
    #[must_use]
    pub fn mean(&self) -> (DVec3, f64) {
        let [_, _, _, red, green, blue, solid] = &self.pieces;
        let [red, green, blue, solid] =
            [red, green, blue, solid].map(|values| exact_sum(values.iter().copied()));
        (DVec3::new(red, green, blue) / solid, solid)
    }

    /// The light around each of some unit directions as a surface of a roughness in
    /// `(0, 1]` mirrors it: the sum over all pieces that it faces.
    #[must_use]
    pub fn averaged(&self, normals: &[DVec3], roughness: f64) -> Vec<DVec3> {
        let narrow = narrowness(roughness);
        let mut sums = vec![[0.0; 4]; normals.len()];
        let [x, y, z, red, green, blue, solid] = &self.pieces;
        for begin in (0..x.len()).step_by(BLOCK) {
            let block = begin..(begin + BLOCK).min(x.len());
            let [x, y, z, red, green, blue, solid] =
                [x, y, z, red, green, blue, solid].map(|values| &values[block.clone()]);
            for (sum, n) in sums.iter_mut().zip(normals) {
                // Lanes of their own, which a compiler may put side by side.
                let mut lanes = [[0.0; 4]; 4];
                for k in 0..x.len() {
                    let weight = weight(n.x * x[k] + n.y * y[k] + n.z * z[k], narrow);
                    let lane = &mut lanes[k % 4];
                    lane[0] += weight * red[k];
                    lane[1] += weight * green[k];
                    lane[2] += weight * blue[k];
                    lane[3] += weight * solid[k];
                }
                for lane in lanes {
                    for (sum, part) in sum.iter_mut().zip(lane) {
                        *sum += part;
                    }
                }
            }
        }
        let mean = |[r, g, b, all]: [f64; 4]| DVec3::new(r, g, b) / all;
        sums.into_iter().map(mean).collect()
    }
}

/// The side of a map's image.
fn side(map: &Plane) -> Result<u32, EffectError> {
    let [width, height] = map.size();
    super::map::check_side(height)?;
    let [needed, _] = super::map::image_size(height);
    Settings("environment").count("width", width, needed, needed)?;
    Ok(height)
}

fn square(count: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..count).flat_map(move |y| (0..count).map(move |x| (x, y)))
}

/// Light of a map's largest level at a place of the square from −1 to 1.
fn map_light(map: &Plane, side: u32, place: DVec2) -> DVec3 {
    let texel = (place * 0.5 + 0.5) * (f64::from(side) - 2.0) + 1.0;
    let [r, g, b, a] = map.bilinear(texel).to_array();
    light([r, g, b, a])
}

/// The directions of the texels of a level, row by row, without the frame, which
/// repeats them.
///
/// # Errors
/// If there is no map of that side, or no such level in it.
pub fn directions(side: u32, level: u32) -> Result<Vec<DVec3>, EffectError> {
    roughness(side, level)?;
    let inner = (side >> level) - 2;
    let place = |(x, y): (u32, u32)| {
        DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * (2.0 / f64::from(inner)) - 1.0
    };
    Ok(square(inner).map(place).map(octahedral_direction).collect())
}

/// What a level of a map's image holds, without the frame.
///
/// # Errors
/// If the plane is not of the size of such an image, or there is no such level.
pub fn level(map: &Plane, level: u32) -> Result<Plane, EffectError> {
    let side = side(map)?;
    roughness(side, level)?;
    let [left, top] = corner(side, level);
    let inner = (side >> level) - 2;
    Ok(Plane::from_fn(inner, inner, |x, y| {
        map.at((left + 1 + x).into(), (top + 1 + y).into())
    })?)
}

/// The map's light in a unit direction, as kernels interpolate it: what its radiance map
/// holds for no roughness.
///
/// # Errors
/// If the plane is not of the size of a map's image.
pub fn unblurred(map: &Plane, at: DVec3) -> Result<DVec3, EffectError> {
    Ok(map_light(map, side(map)?, octahedral(at)))
}

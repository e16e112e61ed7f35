//! Irradiance by spherical harmonics.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use etalon_core::image::{ImageData, ImageError};
use glam::{DVec2, DVec3};

use super::cube::{CubePicture, FACES, face_direction};
use super::map::{direction, texel};
use super::truth::Light;
use crate::SettingError;
use crate::check::Settings;

/// Light from everywhere, as far as surfaces that scatter it can tell: its first
/// nine spherical harmonics.
///
/// In the order of bands, and in a band from −l to l: 1; y, z, x; xy, yz, 3z² − 1,
/// xz, x² − y², each times the constant that makes its square integrate to 1
/// (R. Ramamoorthi and P. Hanrahan, "An Efficient Representation for Irradiance
/// Environment Maps", 2001, equation 3).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Irradiance {
    /// Integrals of radiance times each harmonic, of magnitude up to 1e6.
    pub harmonics: [DVec3; 9],
}

/// What each polynomial is multiplied by to be a harmonic.
const CONSTANTS: [f64; 9] = [
    0.282_094_791_773_878_14,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    1.092_548_430_592_079_2,
    1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];

/// Of the cosine over a hemisphere: what irradiance keeps of each band (equation 8).
const KEPT: [f64; 3] = [PI, TAU / 3.0, FRAC_PI_4];

fn polynomials(n: DVec3) -> [f64; 9] {
    let DVec3 { x, y, z } = n;
    [
        1.0,
        y,
        z,
        x,
        x * y,
        y * z,
        3.0 * z * z - 1.0,
        x * z,
        x * x - y * y,
    ]
}

const fn band(number: usize) -> usize {
    match number {
        0 => 0,
        1..=3 => 1,
        _ => 2,
    }
}

/// Integrals of radiance times each polynomial.
#[derive(Default)]
struct Sum([DVec3; 9]);

impl Sum {
    /// Light from a unit direction, times the solid angle it comes from.
    fn add(&mut self, at: DVec3, light: DVec3) {
        for (sum, value) in self.0.iter_mut().zip(polynomials(at)) {
            *sum += light * value;
        }
    }

    fn irradiance(self) -> Irradiance {
        Irradiance {
            harmonics: std::array::from_fn(|k| self.0[k] * CONSTANTS[k]),
        }
    }
}

impl Irradiance {
    /// Of radiance that goes from `below` to `above` with the sine of the elevation.
    #[must_use]
    pub fn of_gradient(above: DVec3, below: DVec3) -> Self {
        let (middle, slope) = (0.5 * (above + below), 0.5 * (above - below));
        let mut harmonics = [DVec3::ZERO; 9];
        harmonics[0] = middle * (CONSTANTS[0] * 2.0 * TAU);
        harmonics[1] = slope * (CONSTANTS[1] * 2.0 * TAU / 3.0);
        Self { harmonics }
    }

    /// Of an equirectangular picture, laid out as for
    /// [`EnvironmentMap`](super::EnvironmentMap): each texel's light comes from its
    /// centre, in proportion to the solid angle that it covers.
    ///
    /// # Errors
    /// If the image's bytes are not what its description says.
    pub fn of_equirectangular(image: &ImageData) -> Result<Self, ImageError> {
        let [width, height] = [image.desc.extent.width, image.desc.extent.height];
        let texels = image.to_rgba_f32()?;
        let mut sum = Sum::default();
        for y in 0..height {
            let edge = |row: u32| (PI * f64::from(row) / f64::from(height)).cos();
            let solid_angle = TAU / f64::from(width) * (edge(y) - edge(y + 1));
            for x in 0..width {
                let place = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                let at = direction(place.0 / f64::from(width), place.1 / f64::from(height));
                sum.add(at, texel(&texels, [width, height], x, y) * solid_angle);
            }
        }
        Ok(sum.irradiance())
    }

    /// Of the faces of a cube: each texel's light comes from its centre, in proportion to
    /// the solid angle that it covers.
    ///
    /// # Errors
    /// If the image's bytes are not what its description says.
    pub fn of_cube(picture: &CubePicture) -> Result<Self, ImageError> {
        let side = picture.side();
        let texels = picture.image().to_rgba_f32()?;
        let mut sum = Sum::default();
        for (face, y) in (0..FACES).flat_map(|face| (0..side).map(move |y| (face, y))) {
            for x in 0..side {
                let edge = |at: u32| 2.0 * f64::from(at) / f64::from(side) - 1.0;
                let [left, right, top, bottom] = [edge(x), edge(x + 1), edge(y), edge(y + 1)];
                // Of the rectangle from the face's middle to a corner.
                let area = |x: f64, y: f64| (x * y).atan2((x * x + y * y + 1.0).sqrt());
                let solid_angle =
                    area(right, bottom) - area(left, bottom) - area(right, top) + area(left, top);
                let middle = DVec2::new(0.5 * (left + right), 0.5 * (top + bottom));
                let at = face_direction(face, middle).normalize();
                let light = texel(&texels, [side, side * FACES], x, face * side + y);
                sum.add(at, light * solid_angle);
            }
        }
        Ok(sum.irradiance())
    }

    /// Of the largest level of the image of an [`EnvironmentMap`](super::EnvironmentMap),
    /// cut into pieces of known solid angle.
    pub fn of_pieces(light: &Light) -> Self {
        let mut sum = Sum::default();
        for (at, light) in light.pieces() {
            sum.add(at, light);
        }
        sum.irradiance()
    }

    /// The irradiance on a plane that faces a unit direction, not under 0.
    #[must_use]
    pub fn at(&self, normal: DVec3) -> DVec3 {
        let factors = self.polynomial().into_iter().zip(polynomials(normal));
        let sum: DVec3 = factors.map(|(factor, value)| factor * value).sum();
        (sum * PI).max(DVec3::ZERO)
    }

    /// Factors of the polynomials that add up to irradiance over π, in the order of the
    /// harmonics: what `environment/irradiance` computes.
    #[must_use]
    pub fn polynomial(&self) -> [DVec3; 9] {
        std::array::from_fn(|k| self.harmonics[k] * (CONSTANTS[k] * KEPT[band(k)] / PI))
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            harmonics: std::array::from_fn(|k| self.harmonics[k] + other.harmonics[k]),
        }
    }

    pub(super) fn validate(&self) -> Result<(), SettingError> {
        let values = self.harmonics.iter().flat_map(DVec3::to_array);
        for value in values {
            Settings("environment").range("irradiance", value as f32, -1e6, 1e6)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The harmonics are orthonormal: constants and polynomials fit each other.
    #[test]
    fn harmonics_are_orthonormal() {
        let count = 200;
        let mut products = [[0.0; 9]; 9];
        for i in 0..count {
            for j in 0..count {
                let z = (f64::from(i) + 0.5) / f64::from(count) * 2.0 - 1.0;
                let turn = TAU * (f64::from(j) + 0.5) / f64::from(count);
                let r = (1.0 - z * z).sqrt();
                let at = polynomials(DVec3::new(r * turn.cos(), r * turn.sin(), z));
                for (row, a) in products.iter_mut().zip(0..9) {
                    for (sum, b) in row.iter_mut().zip(0..9) {
                        let weight = 2.0 * TAU / f64::from(count * count);
                        *sum += at[a] * CONSTANTS[a] * at[b] * CONSTANTS[b] * weight;
                    }
                }
            }
        }
        for (a, row) in products.iter().enumerate() {
            for (b, product) in row.iter().enumerate() {
                let want = f64::from(u8::from(a == b));
                // The midpoint rule is off by h² / 24 times the change of slope: 30
                // for the steepest square.
                assert!((product - want).abs() < 1.5e-4, "{a}, {b}: {product}");
            }
        }
    }

    #[test]
    fn a_gradient_is_exact() {
        let (above, below) = (DVec3::new(3.0, 1.0, 0.0), DVec3::new(0.5, 1.0, 2.0));
        let light = Irradiance::of_gradient(above, below);
        // Radiance m + s y gives π (m + 2/3 s n.y).
        for n in [DVec3::Y, DVec3::NEG_Y, DVec3::new(0.6, 0.0, 0.8)] {
            let (middle, slope) = (0.5 * (above + below), 0.5 * (above - below));
            let want = PI * (middle + slope * (2.0 / 3.0 * n.y));
            assert!((light.at(n) - want).length() < 1e-12);
        }
    }
}

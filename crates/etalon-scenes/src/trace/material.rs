//! What surfaces are made of.
//!
//! Patterns are evaluated from the world position in f64 with nothing but
//! arithmetic and `floor`, so they are the same on every machine.

use std::ops::{Add, Mul};

use glam::DVec3;

/// A scalar in `[0, 1]` that varies over space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Pattern {
    /// Squares, 0 and 1 in turn.
    Checker {
        /// A corner of a square.
        origin: DVec3,
        /// One edge of a square.
        u: DVec3,
        /// The other edge, at a right angle to `u`.
        v: DVec3,
    },
    /// Bands across a direction, 0 and 1 in turn.
    Stripes {
        /// Where a band begins.
        origin: DVec3,
        /// The width of a band and the direction across.
        across: DVec3,
    },
    /// Lines along the edges of a grid of squares: 1 on the lines, 0 between.
    Grid {
        /// A crossing of lines.
        origin: DVec3,
        /// One edge of a square.
        u: DVec3,
        /// The other edge, at a right angle to `u`.
        v: DVec3,
        /// Width of the lines as part of an edge.
        line: f64,
    },
    /// Smooth random patches: three octaves of value noise over the directions
    /// `u` and `v`, then a smooth step from 0 at `low` to 1 at `high`.
    Patches {
        /// One feature in one direction.
        u: DVec3,
        /// One feature in the other.
        v: DVec3,
        /// Noise value, in `[0, 1]`, up to which the pattern is 0.
        low: f64,
        /// Noise value from which the pattern is 1.
        high: f64,
        /// Which of many such patterns.
        seed: u32,
    },
}

impl Pattern {
    /// The value at a world position.
    #[must_use]
    pub fn at(&self, position: DVec3) -> f64 {
        match *self {
            Self::Checker { origin, u, v } => {
                let offset = position - origin;
                let parity = |edge| along(offset, edge).floor().rem_euclid(2.0);
                if parity(u) == parity(v) { 0.0 } else { 1.0 }
            }
            Self::Stripes { origin, across } => {
                along(position - origin, across).floor().rem_euclid(2.0)
            }
            Self::Grid { origin, u, v, line } => {
                let offset = position - origin;
                let near = |edge| {
                    let x = along(offset, edge);
                    (x - x.round()).abs() < 0.5 * line
                };
                if near(u) || near(v) { 1.0 } else { 0.0 }
            }
            Self::Patches {
                u,
                v,
                low,
                high,
                seed,
            } => {
                let (x, y) = (along(position, u), along(position, v));
                let mut sum = 0.0;
                for octave in 0..3_u32 {
                    let scale = f64::from(1_u32 << octave);
                    sum += noise(x * scale, y * scale, seed.wrapping_add(octave)) / scale;
                }
                smooth_step((sum / 1.75 - low) / (high - low))
            }
        }
    }
}

/// How many times `edge` fits into `offset` along its direction.
fn along(offset: DVec3, edge: DVec3) -> f64 {
    offset.dot(edge) / edge.length_squared()
}

fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Value noise in `[0, 1]`: random values on the integer lattice, joined smoothly.
fn noise(x: f64, y: f64, seed: u32) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let value = |i: f64, j: f64| {
        // Wraps around every 2³² features; the casts saturate beyond ±2⁶³.
        let mixed = hash(hash(seed ^ (x0 + i) as i64 as u32).wrapping_add((y0 + j) as i64 as u32));
        f64::from(mixed) / f64::from(u32::MAX)
    };
    let (s, t) = (smooth_step(x - x0), smooth_step(y - y0));
    let low = value(0.0, 0.0) + (value(1.0, 0.0) - value(0.0, 0.0)) * s;
    let high = value(0.0, 1.0) + (value(1.0, 1.0) - value(0.0, 1.0)) * s;
    low + (high - low) * t
}

/// A bijective mix of 32 bits: the finaliser of MurmurHash3.
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x85eb_ca6b);
    x ^= x >> 13;
    x = x.wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

/// A property that is constant or varies between two values by a pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Property<T> {
    /// The same everywhere.
    Constant(T),
    /// `low` where the pattern is 0, `high` where it is 1, linear between.
    Varying {
        /// Where the pattern is 0.
        low: T,
        /// Where the pattern is 1.
        high: T,
        /// The pattern.
        pattern: Pattern,
    },
}

impl<T: Copy + Add<Output = T> + Mul<f64, Output = T>> Property<T> {
    /// The value at a world position.
    #[must_use]
    pub fn at(&self, position: DVec3) -> T {
        match *self {
            Self::Constant(value) => value,
            Self::Varying { low, high, pattern } => {
                let weight = pattern.at(position);
                low * (1.0 - weight) + high * weight
            }
        }
    }
}

impl<T> From<T> for Property<T> {
    fn from(value: T) -> Self {
        Self::Constant(value)
    }
}

/// A surface's material: Lambert under a GGX specular layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Diffuse reflectance, each channel in `[0, 1]`.
    pub base: Property<DVec3>,
    /// Specular reflectance at normal incidence, each channel in `[0, 1]`; 0
    /// reflects nothing. Water and most dielectrics: 0.02 to 0.05.
    pub specular: Property<DVec3>,
    /// Perceptual roughness in `[0, 1]`: the square root of GGX's α.
    pub roughness: Property<f64>,
    /// Light given off, in the unit of the frame's colour.
    pub emission: DVec3,
}

impl Material {
    /// A matte material that reflects nothing.
    #[must_use]
    pub fn matte(base: impl Into<Property<DVec3>>) -> Self {
        Self {
            base: base.into(),
            specular: DVec3::ZERO.into(),
            roughness: 1.0.into(),
            emission: DVec3::ZERO,
        }
    }

    /// A dielectric with the usual 4 % reflectance.
    #[must_use]
    pub fn plastic(base: impl Into<Property<DVec3>>, roughness: f64) -> Self {
        Self {
            base: base.into(),
            specular: DVec3::splat(0.04).into(),
            roughness: roughness.into(),
            emission: DVec3::ZERO,
        }
    }

    /// A conductor: reflects in colour, has no diffuse part.
    #[must_use]
    pub fn metal(specular: DVec3, roughness: f64) -> Self {
        Self {
            base: DVec3::ZERO.into(),
            specular: specular.into(),
            roughness: roughness.into(),
            emission: DVec3::ZERO,
        }
    }

    /// A black surface that gives off light.
    #[must_use]
    pub fn light(emission: DVec3) -> Self {
        Self {
            emission,
            ..Self::matte(DVec3::ZERO)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkers_alternate_on_both_sides_of_the_origin() {
        let checker = Pattern::Checker {
            origin: DVec3::ZERO,
            u: DVec3::X * 0.5,
            v: DVec3::Z * 0.5,
        };
        for (x, z, value) in [
            (0.1, 0.1, 0.0),
            (0.6, 0.1, 1.0),
            (-0.1, 0.1, 1.0),
            (-0.1, -0.1, 0.0),
        ] {
            // The height does not matter, however little it is off the plane.
            for y in [0.0, 1e-300, -1e-17, 7.0] {
                assert_eq!(checker.at(DVec3::new(x, y, z)), value, "at {x}, {y}, {z}");
            }
        }
    }

    #[test]
    fn patches_are_smooth_and_in_range() {
        let patches = Pattern::Patches {
            u: DVec3::X,
            v: DVec3::Z,
            low: 0.3,
            high: 0.7,
            seed: 1,
        };
        let (mut least, mut most) = (1.0_f64, 0.0_f64);
        for i in 0..10_000 {
            let x = f64::from(i) * 1e-2;
            let value = patches.at(DVec3::new(x, 0.0, 0.3 * x));
            assert!((0.0..=1.0).contains(&value));
            // Slope: 3/2 per unit of each smooth step, three octaves of equal
            // slope over 1.75, a range of 0.4, and a path of √1.09 per step.
            let next = patches.at(DVec3::new(x + 1e-6, 0.0, 0.3 * x));
            assert!((next - value).abs() < 1e-6 * 1.5 * 3.0 * 1.5 / 1.75 / 0.4);
            least = least.min(value);
            most = most.max(value);
        }
        assert_eq!((least, most), (0.0, 1.0));
    }
}

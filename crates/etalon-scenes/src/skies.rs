//! A registry of procedural skies: pictures of all directions.

use etalon_core::Format;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::resource::TextureDesc;
use etalon_effects::environment::direction;
use glam::DVec3;

/// A sky.
#[derive(Clone, Copy, Debug)]
pub struct SkyEntry {
    /// By which it is known.
    pub name: &'static str,
    /// What it is, and what it is for.
    pub description: &'static str,
    /// The radiance from a unit direction, each channel finite and not under 0.
    pub radiance: fn(DVec3) -> DVec3,
}

impl SkyEntry {
    /// Its picture, equirectangular and `rgba32float`, as
    /// [`EnvironmentMap`](etalon_effects::environment::EnvironmentMap) takes it, each
    /// texel with the radiance from its centre; twice as wide as high.
    ///
    /// # Errors
    /// If `height` is 0, or the image does not fit into memory.
    pub fn picture(&self, height: u32) -> Result<ImageData, ImageError> {
        let desc = TextureDesc::d2(height.saturating_mul(2), height, Format::Rgba32Float);
        let mut image = ImageData::zeroed(desc)?;
        let part = |at: u32, size: u32| (f64::from(at) + 0.5) / f64::from(size);
        let texels = image.bytes.chunks_exact_mut(16);
        let places = (0..height).flat_map(|y| (0..desc.extent.width).map(move |x| (x, y)));
        for (bytes, (x, y)) in texels.zip(places) {
            let at = direction(part(x, desc.extent.width), part(y, height));
            let texel = (self.radiance)(at).as_vec3().extend(1.0);
            for (bytes, value) in bytes.chunks_exact_mut(4).zip(texel.to_array()) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
        }
        Ok(image)
    }
}

/// All skies.
#[must_use]
pub const fn skies() -> &'static [SkyEntry] {
    SKIES
}

/// The sky of that name.
#[must_use]
pub fn sky(name: &str) -> Option<&'static SkyEntry> {
    skies().iter().find(|entry| entry.name == name)
}

const SKIES: &[SkyEntry] = &[
    SkyEntry {
        name: "sun",
        description: "a clear sky over dark ground, with a sun of 4 degrees that gives half of all light: few samples meet it",
        radiance: |at| clear(at) + disc(at, SUN, 2.0) * DVec3::new(2400.0, 2100.0, 1700.0),
    },
    SkyEntry {
        name: "lamps",
        description: "a dim room with three lamps of several colours: edges, and light from everywhere",
        radiance: |at| {
            let room = DVec3::new(0.06, 0.05, 0.04) * (1.2 + 0.8 * at.y);
            LAMPS.iter().fold(room, |light, (way, degrees, colour)| {
                light + disc(at, *way, *degrees) * *colour
            })
        },
    },
];

const SUN: DVec3 = DVec3::new(0.48, 0.6, -0.64);

/// Where, its radius in degrees, radiance.
const LAMPS: [(DVec3, f64, DVec3); 3] = [
    (
        DVec3::new(0.0, 0.96, 0.28),
        14.0,
        DVec3::new(12.0, 11.0, 9.0),
    ),
    (DVec3::new(-0.8, 0.0, 0.6), 7.0, DVec3::new(3.0, 9.0, 24.0)),
    (
        DVec3::new(0.6, -0.48, -0.64),
        3.0,
        DVec3::new(90.0, 30.0, 6.0),
    ),
];

/// Blue towards the zenith, pale at the horizon; brown below it.
fn clear(at: DVec3) -> DVec3 {
    let horizon = DVec3::new(0.9, 0.95, 1.0);
    if at.y > 0.0 {
        horizon.lerp(DVec3::new(0.2, 0.4, 0.9), at.y.sqrt())
    } else {
        horizon.lerp(DVec3::new(0.12, 0.1, 0.08), (-12.0 * at.y).min(1.0))
    }
}

/// 1 within so many degrees around a direction, with an edge a quarter of that wide.
fn disc(at: DVec3, way: DVec3, degrees: f64) -> f64 {
    // By the tangent of half the angle, which is right for small ones, too.
    let angle = 2.0 * (at - way).length().atan2((at + way).length()).to_degrees();
    ((1.125 - angle / degrees) * 4.0).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_of_finite_light_and_show_what_is_there() {
        for entry in skies() {
            let image = entry.picture(64).unwrap();
            assert_eq!(
                (image.desc.extent.width, image.desc.extent.height),
                (128, 64)
            );
            let texels = image.to_rgba_f32().unwrap();
            let fine = |texel: &[f32; 4]| texel.iter().all(|value| (0.0..6e4).contains(value));
            assert!(texels.iter().all(fine), "{}", entry.name);
            assert_eq!(sky(entry.name).map(|found| found.name), Some(entry.name));
        }
        assert!(sky("nowhere").is_none());
        // The sun's texel is hundreds of times as bright as the one below.
        let sun = sky("sun").unwrap();
        assert!((sun.radiance)(SUN).x > 2400.0 && (sun.radiance)(-SUN).x < 1.0);
        assert!(sun.picture(0).is_err() && sun.picture(u32::MAX).is_err());
    }
}

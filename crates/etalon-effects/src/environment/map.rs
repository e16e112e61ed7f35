//! From a picture of all directions to an octahedral map.

use std::f64::consts::{PI, TAU};

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;
use glam::{DVec2, DVec3};

use super::{CubePicture, Irradiance};
use crate::check::Settings;
use crate::{EffectError, SettingError};

/// A picture of all directions, as effects take it.
///
/// The picture given is equirectangular, or six [faces](super::CubePicture) of a cube.
/// The columns of an equirectangular one go round from behind, by x = −1 and the middle,
/// which is −z, to x = 1 and back; its rows from straight above, +y, to straight below.
/// Negative light and NaN in it count as 0, more than the largest `f16` as that.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    image: ImageData,
    irradiance: Irradiance,
}

/// Subdivisions of a texel in x and y for each texel of the next larger mip.
const PARTS: u32 = 4;

pub(crate) fn check_side(side: u32) -> Result<(), SettingError> {
    let check = Settings("environment");
    check.count("side", side, 32, 2048)?;
    if side.is_power_of_two() {
        return Ok(());
    }
    check.count("side", side, side.next_power_of_two(), 2048)
}

/// Mips down to 16 texels.
pub(super) fn mips(side: u32) -> u32 {
    side.ilog2() - 3
}

/// Texels of an image with all mips, as `lib/octahedral` has it.
pub(crate) fn image_size(side: u32) -> [u32; 2] {
    [side + side / 2, side]
}

/// The upper left corner of a mip in it.
pub(super) fn corner(side: u32, mip: u32) -> [u32; 2] {
    match mip {
        0 => [0, 0],
        _ => [side, side - (side >> (mip - 1))],
    }
}

/// The unit direction at a place of an equirectangular picture, from 0 at the left and
/// at the top to 1, laid out as for [`EnvironmentMap`].
#[must_use]
pub fn direction(u: f64, v: f64) -> DVec3 {
    let (turn, tilt) = ((u - 0.5) * TAU, v * PI);
    let across = tilt.sin();
    DVec3::new(across * turn.sin(), tilt.cos(), -across * turn.cos())
}

/// A texel as light: finite, not negative, no more than an `f16` holds.
pub(super) fn texel(texels: &[[f32; 4]], [width, _]: [u32; 2], x: u32, y: u32) -> DVec3 {
    let at = y as usize * width as usize + x as usize;
    let [r, g, b, _] = texels.get(at).copied().unwrap_or_default();
    // NaN is not over 0.
    let light = |value: f32| if value > 0.0 { value.min(65504.0) } else { 0.0 };
    DVec3::from([r, g, b].map(|value| f64::from(light(value))))
}

impl EnvironmentMap {
    /// Resamples a picture to `side × side` texels, a power of two in `[32, 2048]`.
    /// The map needs `16 · side²` bytes for each mip on the way; a side of a third
    /// of the picture's width keeps all of its detail. Each doubling adds a step of
    /// roughness: 256 have one at every quarter, and half way between them soft light
    /// is off by up to a hundredth; 64 have one at the half, and are off by four.
    ///
    /// # Errors
    /// If `side` is out of its range, the picture is not 2D, or an image does not
    /// fit into memory.
    pub fn of_equirectangular(picture: &ImageData, side: u32) -> Result<Self, EffectError> {
        check_side(side)?;
        let size = [picture.desc.extent.width, picture.desc.extent.height];
        let check = Settings("environment");
        for (field, value, most) in [
            ("width", size[0], 1 << 16),
            ("height", size[1], 1 << 16),
            ("layers", picture.desc.extent.depth_or_layers, 1),
        ] {
            check.count(field, value, 1, most)?;
        }
        let irradiance = Irradiance::of_equirectangular(picture)?;
        let texels = picture.to_rgba_f32()?;
        // So many places that every texel of the picture is met.
        let parts = (2 * size[0] / (3 * side)).clamp(1, 32);
        let sample = |at: DVec3| equirectangular(&texels, size, at);
        let mut levels = vec![resampled(side, parts, &sample)];
        for mip in 1..mips(side) {
            let previous = &levels[levels.len() - 1];
            let finer = side >> (mip - 1);
            let sample = |at: DVec3| octahedral_light(previous, finer, at);
            let level = resampled(side >> mip, PARTS, &sample);
            levels.push(level);
        }
        Self::of_levels(side, &levels, irradiance)
    }

    /// As [`EnvironmentMap::of_equirectangular`], of the faces of a cube, each mip the mean
    /// of the faces themselves: what [`of_faces`](super::of_faces) makes on a device. A side
    /// of 1½ times theirs keeps all of their detail.
    ///
    /// # Errors
    /// If `side` is out of its range, or an image does not fit into memory.
    pub fn of_cube(picture: &CubePicture, side: u32) -> Result<Self, EffectError> {
        check_side(side)?;
        let texels = picture.image().to_rgba_f32()?;
        let (face, parts) = (picture.side(), super::cube::parts(picture.side(), side));
        let irradiance = Irradiance::of_cube(picture)?;
        let sample = |at: DVec3| super::cube::light(&texels, face, at);
        let level = |mip: u32| {
            let parts = (parts << mip).min(super::cube::MOST_PARTS);
            resampled(side >> mip, parts, &sample)
        };
        let levels: Vec<Vec<DVec3>> = (0..mips(side)).map(level).collect();
        Self::of_levels(side, &levels, irradiance)
    }

    /// Of all mips, the largest first.
    fn of_levels(
        side: u32,
        levels: &[Vec<DVec3>],
        irradiance: Irradiance,
    ) -> Result<Self, EffectError> {
        let [width, height] = image_size(side);
        let desc = TextureDesc::d2(width, height, Format::Rgba16Float);
        let mut image = ImageData::zeroed(desc)?;
        for (mip, level) in (0..).zip(levels) {
            let ([left, top], own) = (corner(side, mip), side >> mip);
            for (at, light) in (0..).zip(level) {
                let [r, g, b] = light.as_vec3().to_array();
                let texel = Texel::Float([r, g, b, 1.0]);
                image.set_texel(left + at % own, top + at / own, 0, 0, texel)?;
            }
        }
        Ok(Self { image, irradiance })
    }

    /// The octahedral map with its mips beside it: what [`environment`](super::environment())
    /// takes as `base` once it is imported.
    #[must_use]
    pub fn image(&self) -> &ImageData {
        &self.image
    }

    /// What surfaces scatter.
    #[must_use]
    pub fn irradiance(&self) -> &Irradiance {
        &self.irradiance
    }
}

/// Each texel as the mean over `parts × parts` places in it, the frame included.
fn resampled(side: u32, parts: u32, sample: &dyn Fn(DVec3) -> DVec3) -> Vec<DVec3> {
    let inner = f64::from(side) - 2.0;
    let part = |k: u32| (f64::from(k) + 0.5) / f64::from(parts);
    let places = (0..side).flat_map(|y| (0..side).map(move |x| (f64::from(x), f64::from(y))));
    let mean = |(x, y): (f64, f64)| {
        let mut sum = DVec3::ZERO;
        for (i, j) in (0..parts).flat_map(|j| (0..parts).map(move |i| (i, j))) {
            let place = DVec2::new(x - 1.0 + part(i), y - 1.0 + part(j));
            sum += sample(octahedral_direction(place / inner * 2.0 - 1.0));
        }
        sum / f64::from(parts * parts)
    };
    places.map(mean).collect()
}

/// The picture's light from a direction, interpolated bilinearly.
fn equirectangular(texels: &[[f32; 4]], [width, height]: [u32; 2], at: DVec3) -> DVec3 {
    let u = 0.5 + at.x.atan2(-at.z) / TAU;
    let v = at.y.clamp(-1.0, 1.0).acos() / PI;
    let (x, y) = (
        u * f64::from(width) - 0.5,
        (v * f64::from(height) - 0.5).clamp(0.0, f64::from(height - 1)),
    );
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    let columns = [0.0, 1.0].map(|step| (left + step).rem_euclid(f64::from(width)) as u32);
    let rows = [top as u32, (top as u32 + 1).min(height - 1)];
    let row = |y: u32| {
        let [a, b] = columns.map(|x| texel(texels, [width, height], x.min(width - 1), y));
        a.lerp(b, fx)
    };
    row(rows[0]).lerp(row(rows[1]), fy)
}

/// A mip's light from a direction, interpolated bilinearly.
fn octahedral_light(texels: &[DVec3], side: u32, at: DVec3) -> DVec3 {
    let place = (octahedral(at) * 0.5 + 0.5) * (f64::from(side) - 2.0) + 0.5;
    let corner = place
        .floor()
        .clamp(DVec2::ZERO, DVec2::splat(f64::from(side - 2)));
    let part = place - corner;
    let texel =
        |x: u32, y: u32| texels[((corner.y as u32 + y) * side + corner.x as u32 + x) as usize];
    let upper = texel(0, 0).lerp(texel(1, 0), part.x);
    let lower = texel(0, 1).lerp(texel(1, 1), part.x);
    upper.lerp(lower, part.y)
}

fn sign(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

fn folded(p: DVec2) -> DVec2 {
    DVec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

/// As in `lib/octahedral`.
pub(super) fn octahedral(direction: DVec3) -> DVec2 {
    let p = DVec2::new(direction.x, direction.z) / direction.abs().element_sum();
    if direction.y < 0.0 { folded(p) } else { p }
}

/// As in `lib/octahedral`.
pub(super) fn octahedral_direction(place: DVec2) -> DVec3 {
    let mut p = place;
    if p.x.abs() > 1.0 {
        p = DVec2::new(sign(p.x) * (2.0 - p.x.abs()), -p.y);
    }
    if p.y.abs() > 1.0 {
        p = DVec2::new(-p.x, sign(p.y) * (2.0 - p.y.abs()));
    }
    let y = 1.0 - p.x.abs() - p.y.abs();
    let xz = if y < 0.0 { folded(p) } else { p };
    DVec3::new(xz.x, y, xz.y).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octahedral_places_come_back() {
        for (i, j) in (0..41).flat_map(|i| (0..41).map(move |j| (i, j))) {
            let place = DVec2::new(f64::from(i), f64::from(j)) / 20.5 - 0.975;
            let back = octahedral(octahedral_direction(place));
            assert!((back - place).length() < 1e-12, "{place}: {back}");
        }
    }

    /// What lies beyond an edge is what lies within at the other end of it.
    #[test]
    fn beyond_the_fold_directions_go_on() {
        for k in -9..=9 {
            let along = f64::from(k) / 10.0;
            let places = [-1.001, -0.999].map(|x| octahedral_direction(DVec2::new(x, along)));
            assert!(places[0].distance(places[1]) < 0.01, "{along}: {places:?}");
            let places = [1.001, 0.999].map(|y| octahedral_direction(DVec2::new(along, y)));
            assert!(places[0].distance(places[1]) < 0.01, "{along}: {places:?}");
        }
    }

    #[test]
    fn each_axis_is_where_it_belongs() {
        assert!(direction(0.5, 0.5).distance(DVec3::NEG_Z) < 1e-12);
        assert!(direction(0.75, 0.5).distance(DVec3::X) < 1e-12);
        assert!(direction(0.2, 0.0).distance(DVec3::Y) < 1e-12);
    }
}

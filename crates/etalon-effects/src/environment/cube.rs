//! Pictures on the six faces of a cube.

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use glam::{DVec2, DVec3};

use super::MAX_FACE;
use super::map::texel;
use crate::check::Settings;
use crate::{EffectError, SettingError};

/// Faces of a cube.
pub const FACES: u32 = 6;

/// Light on the faces of a cube, as `rgba32float` in six layers: +x, −x, +y, −y, +z, −z
/// as they are seen from within, y up; on +y −z is up, on −y +z.
///
/// These are the faces of cube textures (WebGPU, Vulkan) turned left to right, whose
/// pictures are those of a world in a mirror.
#[derive(Clone, Debug, PartialEq)]
pub struct CubePicture {
    image: ImageData,
}

impl CubePicture {
    /// The description of the image of faces of so many texels.
    ///
    /// # Errors
    /// If the side is not in `[1, MAX_FACE]`.
    pub fn desc(side: u32) -> Result<TextureDesc, SettingError> {
        Settings("environment").count("face width", side, 1, MAX_FACE)?;
        let mut desc = TextureDesc::d2(side, side, Format::Rgba32Float);
        desc.extent.depth_or_layers = FACES;
        Ok(desc)
    }

    /// Faces of `side × side` texels, each a function of the face's number, the column
    /// and the row.
    ///
    /// # Errors
    /// If the side is not in `[1, MAX_FACE]`, or the image does not fit into memory.
    pub fn from_fn(
        side: u32,
        mut light: impl FnMut(u32, u32, u32) -> [f32; 3],
    ) -> Result<Self, EffectError> {
        let mut image = ImageData::zeroed(Self::desc(side)?)?;
        let places = (0..FACES).flat_map(|face| (0..side).map(move |y| (face, y)));
        let places = places.flat_map(|(face, y)| (0..side).map(move |x| (face, x, y)));
        for (bytes, (face, x, y)) in image.bytes.chunks_exact_mut(16).zip(places) {
            let [r, g, b] = light(face, x, y);
            for (bytes, value) in bytes.chunks_exact_mut(4).zip([r, g, b, 1.0]) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
        }
        Ok(Self { image })
    }

    /// Light by unit direction, each texel with that of its centre.
    ///
    /// # Errors
    /// As [`CubePicture::from_fn`].
    pub fn of_directions(side: u32, light: impl Fn(DVec3) -> DVec3) -> Result<Self, EffectError> {
        Self::from_fn(side, |face, x, y| {
            let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / f64::from(side);
            let at = face_direction(face, 2.0 * place - 1.0).normalize();
            light(at).as_vec3().to_array()
        })
    }

    /// The faces, as [`of_faces`](super::of_faces) takes them once they are imported.
    #[must_use]
    pub const fn image(&self) -> &ImageData {
        &self.image
    }

    /// Texels of a face's side.
    #[must_use]
    pub const fn side(&self) -> u32 {
        self.image.desc.extent.width
    }
}

/// A direction, of no particular length, through a place of a face: from (−1, −1) at the
/// left and at the top to (1, 1), or beside it in its plane. Numbers from 6 on count as
/// the last face's.
#[must_use]
pub fn face_direction(face: u32, at: DVec2) -> DVec3 {
    let (x, y) = (at.x, at.y);
    match face {
        0 => DVec3::new(1.0, -y, x),
        1 => DVec3::new(-1.0, -y, -x),
        2 => DVec3::new(-x, 1.0, y),
        3 => DVec3::new(-x, -1.0, -y),
        4 => DVec3::new(-x, -y, 1.0),
        _ => DVec3::new(x, -y, -1.0),
    }
}

/// The face that a direction meets, and where: the one on whose plane it is met first.
fn face_of(way: DVec3) -> (u32, DVec2) {
    let size = way.abs().max_element();
    let faces = (0..FACES).map(|face| {
        let ahead = face_direction(face, DVec2::ZERO);
        let across = |at: DVec2| face_direction(face, at) - ahead;
        let met = way / way.dot(ahead);
        let place = DVec2::new(met.dot(across(DVec2::X)), met.dot(across(DVec2::Y)));
        (face, way.dot(ahead), place)
    });
    let met = faces
        .filter(|(_, ahead, _)| *ahead >= size)
        .map(|(face, _, place)| (face, place));
    met.min_by_key(|(face, _)| *face)
        .unwrap_or((0, DVec2::ZERO))
}

/// Most places in x and in y for each texel of any mip, as `environment/faces` has it.
pub(super) const MOST_PARTS: u32 = 256;

/// Places in x and in y for each texel of a map's largest mip, so that all texels of
/// faces are met: a map's texel covers up to 5.2 times its area of the square, a face's at
/// least 0.19 times.
pub(super) fn parts(face: u32, side: u32) -> u32 {
    (5 * face).div_ceil(2 * side).clamp(1, 8)
}

/// The light of faces from a direction, interpolated across their edges: what lies beside
/// a face is what is seen there on another one.
pub(super) fn light(texels: &[[f32; 4]], side: u32, way: DVec3) -> DVec3 {
    let (face, place) = face_of(way);
    bilinear(side, place, |x, y| {
        let within = 0..i64::from(side);
        if within.contains(&x) && within.contains(&y) {
            return own(texels, side, face, x, y);
        }
        let at = (DVec2::new(x as f64, y as f64) + 0.5) / f64::from(side) * 2.0 - 1.0;
        let (other, place) = face_of(face_direction(face, at));
        bilinear(side, place, |x, y| own(texels, side, other, x, y))
    })
}

/// A texel of a face, the edge repeated outside.
fn own(texels: &[[f32; 4]], side: u32, face: u32, x: i64, y: i64) -> DVec3 {
    let [x, y] = [x, y].map(|at| at.clamp(0, i64::from(side) - 1) as u32);
    texel(texels, [side, side * FACES], x, face * side + y)
}

fn bilinear(side: u32, place: DVec2, texel: impl Fn(i64, i64) -> DVec3) -> DVec3 {
    let at = (place * 0.5 + 0.5) * f64::from(side) - 0.5;
    let corner = at.floor();
    let part = at - corner;
    let (x, y) = (corner.x as i64, corner.y as i64);
    let upper = texel(x, y).lerp(texel(x + 1, y), part.x);
    let lower = texel(x, y + 1).lerp(texel(x + 1, y + 1), part.x);
    upper.lerp(lower, part.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen from within: what is right, up and ahead are right-handed axes.
    #[test]
    fn faces_are_seen_from_within() {
        for face in 0..FACES {
            let ahead = face_direction(face, DVec2::ZERO);
            let right = face_direction(face, DVec2::X) - ahead;
            let up = face_direction(face, DVec2::NEG_Y) - ahead;
            assert_eq!(right.cross(up), -ahead, "{face}");
        }
    }

    #[test]
    fn directions_come_back_to_their_faces() {
        for face in 0..FACES {
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                let place = DVec2::new(f64::from(i), f64::from(j)) / 4.5 - 8.0 / 9.0;
                let (found, at) = face_of(face_direction(face, place));
                assert_eq!(found, face);
                assert!(at.distance(place) < 1e-14, "{at}, not {place}");
            }
        }
    }
}

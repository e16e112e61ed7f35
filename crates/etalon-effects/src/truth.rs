//! What the truths of the effects stand on: pictures in f64.
//!
//! Beside each effect stands its truth: what an ideal implementation makes of
//! the *same* screen data with the same settings, computed in f64 from the
//! definition and not from the kernels. It separates two of the three errors
//! that a picture can have:
//!
//! * **rounding**: the kernel in f32 against the same steps in f64;
//! * **algorithm**: those steps against the truth, which takes no shortcut;
//! * **model**: the truth against the scene, of which the screen is a part.
//!
//! Settings that only trade accuracy for time do not enter a truth. Its results
//! are not rounded to any format.
//!
//! [`ssr`](crate::ssr::truth), [`bloom`](crate::bloom::truth),
//! [`exposure`](crate::exposure::truth), [`composite`](crate::composite::truth),
//! [`environment`](crate::environment::truth) and
//! [`lighting`](crate::lighting::truth) each have one.

use etalon_core::Format;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::resource::{Limits, TextureDesc};
use glam::{DVec2, DVec3, DVec4};

use crate::{EffectError, SettingError};

/// The largest light that enters an effect: the largest number of f16.
pub const MOST_LIGHT: f64 = 65_504.0;

/// One channel of imported light: 0 for NaN and what is negative, and at most
/// [`MOST_LIGHT`].
#[must_use]
pub fn radiance(light: f64) -> f64 {
    if light > 0.0 {
        light.min(MOST_LIGHT)
    } else {
        0.0
    }
}

/// A share of something, as in maps: limited to `[0, 1]`, 0 for NaN.
#[must_use]
pub fn unit_interval(share: f64) -> f64 {
    if share > 0.0 { share.min(1.0) } else { 0.0 }
}

/// The first three channels of a texel as light: each by [`radiance`].
#[must_use]
pub fn light([r, g, b, _]: [f64; 4]) -> DVec3 {
    DVec3::new(radiance(r), radiance(g), radiance(b))
}

/// Relative luminance of linear Rec. 709 light (ITU-R BT.709-6, §3).
#[must_use]
pub fn luminance(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Hermite's `3 t² − 2 t³` of `t` limited to `[0, 1]`.
#[must_use]
pub fn smooth(t: f64) -> f64 {
    let t = unit_interval(t);
    t * t * (3.0 - 2.0 * t)
}

/// The sum of finite numbers, rounded once.
///
/// The partial sums kept do not overlap, so that together they are the exact
/// sum, whatever the order and the magnitudes: J. R. Shewchuk, "Adaptive
/// Precision Floating-Point Arithmetic", 1997, as in Python's `math.fsum`. The
/// magnitudes must add up to less than `f64::MAX`; the result is no number if
/// one of the numbers is none.
#[must_use]
pub fn exact_sum(numbers: impl IntoIterator<Item = f64>) -> f64 {
    // From the smallest to the largest.
    let mut partials: Vec<f64> = Vec::new();
    for mut number in numbers {
        let mut kept = 0;
        for index in 0..partials.len() {
            let (large, small) = if number.abs() < partials[index].abs() {
                (partials[index], number)
            } else {
                (number, partials[index])
            };
            number = large + small;
            let lost = small - (number - large);
            if lost != 0.0 {
                partials[kept] = lost;
                kept += 1;
            }
        }
        partials.truncate(kept);
        partials.push(number);
    }
    let Some(mut sum) = partials.pop() else {
        return 0.0;
    };
    while let Some(partial) = partials.pop() {
        let large = sum;
        sum = large + partial;
        let lost = partial - (sum - large);
        if lost != 0.0 {
            // What is left was rounded to even if it is half a unit; the next
            // partial, of the same sign, says that it should not have been.
            if let Some(next) = partials.pop()
                && (lost > 0.0) == (next > 0.0)
            {
                let doubled = 2.0 * lost;
                let other = sum + doubled;
                if other - sum == doubled {
                    sum = other;
                }
            }
            break;
        }
    }
    sum
}

/// A picture in f64: four channels, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    width: u32,
    height: u32,
    texels: Vec<[f64; 4]>,
}

/// The number of texels of a picture, if there can be one of that size.
fn texel_count(width: u32, height: u32) -> Result<usize, ImageError> {
    let limits = Limits {
        max_texture_2d: u32::MAX,
        max_texture_bytes: isize::MAX as u64 / 2,
        ..Limits::default()
    };
    // Texels of half the size of those kept.
    TextureDesc::d2(width, height, Format::Rgba32Float).validate(&limits)?;
    Ok(width as usize * height as usize)
}

/// An empty vector with room for `count` elements.
pub(crate) fn reserved<T>(count: usize) -> Result<Vec<T>, ImageError> {
    let mut vector = Vec::new();
    vector
        .try_reserve_exact(count)
        .map_err(|_| ImageError::OutOfMemory {
            bytes: (count as u64).saturating_mul(size_of::<T>() as u64),
        })?;
    Ok(vector)
}

impl Plane {
    /// A picture of texels given row by row from the top.
    ///
    /// # Errors
    /// If a side is 0 or the number of texels is not their product.
    pub fn new(width: u32, height: u32, texels: Vec<[f64; 4]>) -> Result<Self, ImageError> {
        let expected = texel_count(width, height)?;
        if texels.len() != expected {
            return Err(ImageError::WrongTexelCount {
                expected: expected as u64,
                actual: texels.len() as u64,
            });
        }
        Ok(Self {
            width,
            height,
            texels,
        })
    }

    /// A picture whose texel in column x and row y is `texel(x, y)`.
    ///
    /// # Errors
    /// If a side is 0 or memory runs out.
    pub fn from_fn(
        width: u32,
        height: u32,
        mut texel: impl FnMut(u32, u32) -> [f64; 4],
    ) -> Result<Self, ImageError> {
        let mut texels = reserved(texel_count(width, height)?)?;
        for y in 0..height {
            texels.extend((0..width).map(|x| texel(x, y)));
        }
        Ok(Self {
            width,
            height,
            texels,
        })
    }

    /// What an image of any format shows, of its first layer and mip.
    ///
    /// Values of 8 bits are the exact multiples of 1/255, which f32 has not.
    ///
    /// # Errors
    /// If the image's bytes are not what its description needs, a side is 0, or
    /// memory runs out.
    pub fn of(image: &ImageData) -> Result<Self, ImageError> {
        let desc = image.desc;
        let (width, height) = (desc.extent.width, desc.extent.height);
        let count = texel_count(width, height)?;
        let texel_bytes = desc.format.texel_bytes() as usize;
        let needed = count.checked_mul(texel_bytes);
        let Some(bytes) = needed.and_then(|needed| image.bytes.get(..needed)) else {
            return Err(ImageError::WrongLength {
                format: desc.format,
                width,
                height,
                depth_or_layers: desc.extent.depth_or_layers,
                mips: desc.mips,
                expected: desc.bytes().unwrap_or(u64::MAX),
                actual: image.bytes.len() as u64,
            });
        };
        let eight_bits = matches!(
            desc.format,
            Format::R8Unorm | Format::Rg8Unorm | Format::Rgba8Unorm | Format::Bgra8Unorm
        );
        let mut texels = reserved(count)?;
        texels.extend(bytes.chunks_exact(texel_bytes).map(|bytes| {
            let texel = desc.format.decode(bytes).to_f32().map(f64::from);
            if eight_bits {
                texel.map(|share| (share * 255.0).round() / 255.0)
            } else {
                texel
            }
        }));
        Ok(Self {
            width,
            height,
            texels,
        })
    }

    /// Columns; at least 1.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Rows; at least 1.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Width and height.
    #[must_use]
    pub const fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The texels, row by row from the top.
    #[must_use]
    pub fn texels(&self) -> &[[f64; 4]] {
        &self.texels
    }

    /// The texel in column `x` and row `y`, the edge repeated outside.
    #[must_use]
    pub fn at(&self, x: i64, y: i64) -> [f64; 4] {
        let x = x.clamp(0, i64::from(self.width) - 1);
        let y = y.clamp(0, i64::from(self.height) - 1);
        self.texels[y as usize * self.width as usize + x as usize]
    }

    /// Bilinear interpolation at a finite place in texels: `(0, 0)` is the top
    /// left corner, texel centres lie at halves, and the edge is repeated.
    #[must_use]
    pub fn bilinear(&self, place: DVec2) -> DVec4 {
        let size = DVec2::new(self.width.into(), self.height.into());
        // Beyond half a texel from the edge there is only the edge.
        let place = (place - 0.5).clamp(DVec2::splat(-1.0), size);
        let corner = place.floor();
        let part = place - corner;
        let (x, y) = (corner.x as i64, corner.y as i64);
        let at = |x, y| DVec4::from(self.at(x, y));
        at(x, y)
            .lerp(at(x + 1, y), part.x)
            .lerp(at(x, y + 1).lerp(at(x + 1, y + 1), part.x), part.y)
    }

    /// The same picture with each texel replaced, row by row from the top.
    #[must_use]
    pub fn map(mut self, mut texel: impl FnMut([f64; 4]) -> [f64; 4]) -> Self {
        for old in &mut self.texels {
            *old = texel(*old);
        }
        self
    }

    /// The same picture as light that an effect takes in: the first three
    /// channels by [`radiance`], the fourth by [`unit_interval`].
    #[must_use]
    pub fn sanitised(self) -> Self {
        self.map(|texel| light(texel).extend(unit_interval(texel[3])).to_array())
    }
}

/// A factor or time is a finite number that is not negative.
pub(crate) fn not_negative(
    effect: &'static str,
    field: &'static str,
    value: f64,
) -> Result<(), EffectError> {
    if (0.0..=f64::MAX).contains(&value) {
        return Ok(());
    }
    Err(SettingError {
        effect,
        field,
        value,
        min: 0.0,
        max: f64::MAX,
    }
    .into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_made_finite_as_documented() {
        let cases = [
            (f64::NAN, 0.0, 0.0),
            (-f64::NAN, 0.0, 0.0),
            (f64::INFINITY, MOST_LIGHT, 1.0),
            (f64::NEG_INFINITY, 0.0, 0.0),
            (-1e-300, 0.0, 0.0),
            (0.25, 0.25, 0.25),
            (1.5, 1.5, 1.0),
            (65_504.5, MOST_LIGHT, 1.0),
        ];
        for (value, as_light, as_share) in cases {
            assert_eq!(radiance(value), as_light, "{value}");
            assert_eq!(unit_interval(value), as_share, "{value}");
            let plane = Plane::new(1, 1, vec![[value; 4]]).expect("one texel");
            let expected = [as_light, as_light, as_light, as_share];
            assert_eq!(plane.sanitised().texels(), [expected]);
        }
    }

    #[test]
    fn places_are_between_texel_centres() {
        let plane = Plane::from_fn(3, 2, |x, y| [f64::from(x), f64::from(y), 0.0, 1.0]);
        let plane = plane.expect("small");
        for (place, expected) in [
            ((0.5, 0.5), (0.0, 0.0)),
            ((1.0, 1.0), (0.5, 0.5)),
            ((2.25, 0.75), (1.75, 0.25)),
            ((0.0, 2.0), (0.0, 1.0)),
            ((1e300, -1e300), (2.0, 0.0)),
        ] {
            let got = plane.bilinear(DVec2::from(place));
            assert_eq!(
                got,
                DVec4::new(expected.0, expected.1, 0.0, 1.0),
                "{place:?}"
            );
        }
        assert_eq!(plane.at(i64::MIN, i64::MAX), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(plane.at(9, 0), [2.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn eight_bits_are_exact_shares() {
        let texels: Vec<[f32; 4]> = (0..256).map(|code| [code as f32 / 255.0; 4]).collect();
        let desc = TextureDesc::d2(16, 16, Format::Rgba8Unorm);
        let image = ImageData::from_rgba_f32(desc, &texels).expect("small");
        for (code, texel) in Plane::of(&image)
            .expect("small")
            .texels()
            .iter()
            .enumerate()
        {
            assert_eq!(*texel, [code as f64 / 255.0; 4]);
        }
    }
}

//! Images as pictures: 8-bit sRGB for eyes, and for metrics that model them.

use etalon_core::format::SampleKind;
use etalon_core::image::ImageData;
use etalon_core::texel::linear_to_srgb;

/// An opaque 8-bit sRGB picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Red, green, blue; rows from top to bottom.
    pub rgb: Vec<u8>,
}

/// How values become shades. Taken from the reference alone, so that an image
/// and its reference are shown alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    /// Values of both signs (normals, offsets): `[-limit, limit]` becomes black
    /// to white, 0 mid grey.
    Signed {
        /// The largest magnitude.
        limit: f64,
    },
    /// Light: Reinhard's curve with `white` as its white point (Reinhard et
    /// al. 2002, equation 4), then sRGB. White 1 is no curve at all.
    Light {
        /// The value shown as white, at least 1.
        white: f64,
    },
    /// A single channel of one sign (depth, masks): `[0, limit]` becomes black
    /// to white by way of sRGB.
    Grey {
        /// The largest value.
        limit: f64,
    },
}

/// What NaN and infinity are shown as: a colour that no mapping gives.
const NON_FINITE: [u8; 3] = [255, 0, 255];
/// Behind mips and layers of different sizes.
const BACKGROUND: [u8; 3] = [24, 24, 24];
/// Pictures are made of images up to this many pixels a side.
const LARGEST: u32 = 8192;

impl Mapping {
    /// The mapping that shows an image's values best.
    #[must_use]
    pub fn of(image: &ImageData) -> Self {
        let format = image.desc.format;
        // Alpha is not shown, nor may it decide.
        let channels = format.channels().min(3) as usize;
        let (mut least, mut largest) = (0.0_f64, 0.0_f64);
        for mip in 0..image.desc.mips {
            for (_, texel) in image.texels(mip) {
                for &value in texel.to_f64()[..channels]
                    .iter()
                    .filter(|value| value.is_finite())
                {
                    least = least.min(value);
                    largest = largest.max(value);
                }
            }
        }
        // Something to divide by, for an image of zeros.
        let at_least_one = |limit: f64| if limit > 0.0 { limit } else { 1.0 };
        if least < 0.0 {
            Self::Signed {
                limit: at_least_one(largest.max(-least)),
            }
        } else if channels == 1
            || matches!(format.sample_kind(), SampleKind::Uint | SampleKind::Sint)
        {
            Self::Grey {
                limit: at_least_one(largest),
            }
        } else {
            Self::Light {
                white: largest.max(1.0),
            }
        }
    }

    /// One value's shade.
    fn shade(self, value: f64) -> u8 {
        let shown = match self {
            Self::Signed { limit } => 0.5 + 0.5 * value / limit,
            Self::Grey { limit } => linear_to_srgb(value / limit),
            Self::Light { white: 1.0 } => linear_to_srgb(value),
            Self::Light { white } => {
                linear_to_srgb(value * (1.0 + value / (white * white)) / (1.0 + value))
            }
        };
        (shown.clamp(0.0, 1.0) * 255.0).round() as u8
    }

    /// One texel's colour.
    fn colour(self, channels: usize, values: [f64; 4]) -> [u8; 3] {
        if values[..channels].iter().any(|value| !value.is_finite()) {
            return NON_FINITE;
        }
        if channels == 1 {
            return [self.shade(values[0]); 3];
        }
        [0, 1, 2].map(|channel| {
            if channel < channels {
                self.shade(values[channel])
            } else {
                0
            }
        })
    }
}

/// The picture of all mips and layers: layers of a mip in a grid, mip 0 at the
/// left, the others in a column beside it.
#[must_use]
pub fn picture(image: &ImageData, mapping: Mapping) -> Picture {
    let channels = image.desc.format.channels().min(4) as usize;
    draw(image, |mip| {
        image
            .texels(mip)
            .map(|(position, texel)| (position, mapping.colour(channels, texel.to_f64())))
            .collect()
    })
}

/// Where two images of one description differ: black where they are equal,
/// from blue (1 ULP) through red to white (2^24 ULPs and more), magenta where
/// a NaN or infinity is in one only. The layout is that of [`picture`].
#[must_use]
pub fn difference_picture(reference: &ImageData, subject: &ImageData) -> Picture {
    let format = reference.desc.format;
    let size = format.texel_bytes() as usize;
    draw(reference, |mip| {
        let (a, b) = (
            reference.mip(mip).unwrap_or(&[]),
            subject.mip(mip).unwrap_or(&[]),
        );
        let pairs = a.chunks_exact(size).zip(b.chunks_exact(size));
        let heat = pairs.map(|(a, b)| {
            let distances = format.ulps(format.codes(a), format.codes(b));
            heat(distances.into_iter().max().unwrap_or(0))
        });
        reference.desc.positions(mip).zip(heat).collect()
    })
}

/// The colour of a distance in ULPs.
fn heat(ulps: u64) -> [u8; 3] {
    if ulps == 0 {
        return [0, 0, 0];
    }
    if ulps == etalon_core::texel::INFINITE_ULPS {
        return NON_FINITE;
    }
    // Logarithmic: 0 at 1 ULP, 1 at 2^24. Blue, violet, red, yellow, white.
    const STOPS: [[f64; 3]; 5] = [
        [40.0, 70.0, 255.0],
        [150.0, 40.0, 210.0],
        [235.0, 50.0, 60.0],
        [255.0, 200.0, 40.0],
        [255.0, 255.0, 255.0],
    ];
    let place = ((ulps as f64).log2() / 24.0).clamp(0.0, 1.0) * 4.0;
    let stop = (place as usize).min(3);
    let fraction = place - stop as f64;
    [0, 1, 2].map(|channel| {
        (STOPS[stop][channel] * (1.0 - fraction) + STOPS[stop + 1][channel] * fraction).round()
            as u8
    })
}

/// Lays out the mips and layers of an image, coloured by a function from a mip
/// to its texels' colours.
fn draw(
    image: &ImageData,
    colours: impl Fn(u32) -> Vec<(etalon_core::image::TexelPosition, [u8; 3])>,
) -> Picture {
    let desc = image.desc;
    // A grid as near to a square as the number of layers allows.
    let columns = (1..=desc.extent.depth_or_layers)
        .find(|side| side.saturating_mul(*side) >= desc.extent.depth_or_layers);
    let columns = columns.unwrap_or(1);
    let mut places = Vec::new();
    let (mut width, mut height) = (0_u32, 0_u32);
    let (mut left, mut top) = (0_u32, 0_u32);
    for mip in 0..desc.mips {
        let extent = desc.mip_extent(mip);
        let across = columns.min(extent.depth_or_layers);
        let down = extent.depth_or_layers.div_ceil(across.max(1));
        let (Some(right), Some(bottom)) = (
            extent
                .width
                .checked_mul(across)
                .and_then(|size| size.checked_add(left)),
            extent
                .height
                .checked_mul(down)
                .and_then(|size| size.checked_add(top)),
        ) else {
            break;
        };
        if right > LARGEST || bottom > LARGEST {
            break;
        }
        places.push((mip, left, top, across.max(1)));
        width = width.max(right);
        height = height.max(bottom);
        if mip == 0 {
            left = right;
        } else {
            top = bottom;
        }
    }
    let mut rgb: Vec<u8> = BACKGROUND.repeat(width as usize * height as usize);
    for (mip, left, top, across) in places {
        let extent = desc.mip_extent(mip);
        for (position, colour) in colours(mip) {
            let x = left + position.layer % across * extent.width + position.x;
            let y = top + position.layer / across * extent.height + position.y;
            let start = (y as usize * width as usize + x as usize) * 3;
            if let Some(pixel) = rgb.get_mut(start..start + 3) {
                pixel.copy_from_slice(&colour);
            }
        }
    }
    Picture { width, height, rgb }
}

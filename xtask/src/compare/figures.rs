//! The figures of a comparison.

use std::fmt;

use etalon_core::Format;
use etalon_core::format::Encoding;
use etalon_core::image::{ImageData, TexelPosition};
use etalon_core::resource::TextureDesc;
use etalon_core::texel::{INFINITE_ULPS, TexelCodes};
use serde::{Serialize, Serializer};
use thiserror::Error;

use super::flip::{Flip, flip};

/// A distance in units of the last place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ulps(pub u64);

impl Ulps {
    /// The distance of a NaN to a number, or of an infinity to a finite number.
    pub const INFINITE: Self = Self(INFINITE_ULPS);
}

impl fmt::Display for Ulps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::INFINITE {
            f.pad("inf")
        } else {
            self.0.fmt(f)
        }
    }
}

impl Serialize for Ulps {
    /// A number, or the string `"infinite"`: 2^64 − 1 is no number that every
    /// JSON reader keeps.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if *self == Self::INFINITE {
            serializer.serialize_str("infinite")
        } else {
            serializer.serialize_u64(self.0)
        }
    }
}

/// What two images of one description have in common, and what not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Texels in each image, all mips and layers.
    pub texels: u64,
    /// Whether every bit is the same. Images of 0 ULPs may differ in the sign
    /// of a zero, in subnormal `f32` values and in the payloads of NaNs.
    pub same_bits: bool,
    /// The largest distance of any channel of any texel.
    pub max_ulp: Ulps,
    /// The mean distance over all channels of all texels, those infinitely far
    /// apart left out.
    pub mean_ulp: f64,
    /// Texels with a distance above 0 in any channel.
    pub differing_texels: u64,
    /// `differing_texels` over `texels`.
    pub differing_share: f64,
    /// The largest difference of the decoded values; infinite where a NaN or
    /// infinity meets something else.
    #[serde(serialize_with = "serialize_number")]
    pub max_abs: f64,
    /// The texel of `max_ulp`, the first in storage order; `None` if that is 0.
    pub worst: Option<WorstTexel>,
    /// Texels of the reference with a NaN or an infinity in any channel.
    pub non_finite_reference: u64,
    /// The same of the image under test.
    pub non_finite_subject: u64,
    /// Perceived difference.
    pub flip: Flip,
}

/// The texel where two images are furthest apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstTexel {
    /// Where.
    #[serde(flatten)]
    pub position: TexelPosition,
    /// Which channel: 0 red, 1 green, 2 blue, 3 alpha.
    pub channel: usize,
    /// The reference's decoded value.
    #[serde(serialize_with = "serialize_number")]
    pub reference: f64,
    /// The decoded value under test.
    #[serde(serialize_with = "serialize_number")]
    pub subject: f64,
    /// How far apart they are.
    pub ulps: Ulps,
}

impl fmt::Display for WorstTexel {
    /// `x 3, y 1, layer 0, mip 2, blue: 0.5 became 0.75`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TexelPosition { mip, layer, y, x } = self.position;
        let channel = ["red", "green", "blue", "alpha"][self.channel.min(3)];
        write!(
            f,
            "x {x}, y {y}, layer {layer}, mip {mip}, {channel}: {} became {}",
            self.reference, self.subject
        )
    }
}

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// They are not of the same shape and format.
    #[error("the reference is {}, the image under test {}", describe(.reference), describe(.subject))]
    Description {
        /// Of the reference.
        reference: TextureDesc,
        /// Of the image under test.
        subject: TextureDesc,
    },
    /// An image does not have the bytes its description needs.
    #[error("{} takes {} bytes, but the image has {}", describe(.desc), .expected, .actual)]
    Incomplete {
        /// Of either image.
        desc: TextureDesc,
        /// Bytes needed.
        expected: u64,
        /// Bytes there.
        actual: u64,
    },
}

/// A description in a few words: `640×360 rgba16float, 2 layers, 5 mips`.
#[must_use]
pub fn describe(desc: &TextureDesc) -> String {
    let extent = desc.extent;
    let mut text = format!("{}×{}", extent.width, extent.height);
    if desc.layers() != extent.depth_or_layers {
        text += &format!("×{}", extent.depth_or_layers);
    }
    text += &format!(" {}", desc.format);
    if desc.layers() > 1 {
        text += &format!(", {} layers", desc.layers());
    }
    if desc.mips > 1 {
        text += &format!(", {} mips", desc.mips);
    }
    text
}

/// Compares an image with its reference, over all mips and layers.
///
/// # Errors
/// If they are not of the same shape and format, or lack bytes.
pub fn compare(reference: &ImageData, subject: &ImageData) -> Result<Comparison, CompareError> {
    check(reference, subject)?;
    let format = reference.desc.format;
    let mut totals = Totals::default();
    for_each_texel(reference, subject, |position, reference, subject| {
        totals.add(format, position, reference, subject);
    });
    let values = totals
        .texels
        .saturating_mul(format.channels().into())
        .max(1);
    Ok(Comparison {
        texels: totals.texels,
        same_bits: reference.bytes == subject.bytes,
        max_ulp: totals.worst.map_or(Ulps(0), |worst| worst.ulps),
        mean_ulp: totals.sum as f64 / values as f64,
        differing_texels: totals.differing,
        differing_share: totals.differing as f64 / totals.texels.max(1) as f64,
        max_abs: totals.max_abs,
        worst: totals.worst,
        non_finite_reference: totals.non_finite_reference,
        non_finite_subject: totals.non_finite_subject,
        flip: flip(reference, subject),
    })
}

/// One channel of one texel in which two images differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The distance, above 0.
    pub ulps: Ulps,
    /// The reference's decoded value.
    pub reference: f64,
    /// The decoded value under test.
    pub subject: f64,
}

impl Difference {
    /// The absolute difference of the values; infinite where that of the codes is.
    #[must_use]
    pub fn absolute(&self) -> f64 {
        if self.ulps == Ulps::INFINITE {
            f64::INFINITY
        } else {
            (self.reference - self.subject).abs()
        }
    }
}

/// A channel of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The texel's number, in storage order.
    pub texel: usize,
    /// The channel's.
    pub channel: usize,
}

/// Counts the texels for which `condition` holds in any channel that differs.
///
/// # Errors
/// As of [`compare`].
pub fn texels_with(
    reference: &ImageData,
    subject: &ImageData,
    condition: impl Fn(Channel, &Difference) -> bool,
) -> Result<u64, CompareError> {
    check(reference, subject)?;
    let format = reference.desc.format;
    let (mut count, mut next) = (0, 0);
    for_each_texel(reference, subject, |_, bytes_reference, bytes_subject| {
        let texel = next;
        next += 1;
        if bytes_reference == bytes_subject {
            return;
        }
        let (a, b) = (format.codes(bytes_reference), format.codes(bytes_subject));
        let distances = format.ulps(a, b);
        let values = (
            format.decode_codes(a).to_f64(),
            format.decode_codes(b).to_f64(),
        );
        let holds = |channel: usize| {
            let ulps = Ulps(distances[channel]);
            let difference = Difference {
                ulps,
                reference: values.0[channel],
                subject: values.1[channel],
            };
            ulps > Ulps(0) && condition(Channel { texel, channel }, &difference)
        };
        count += u64::from((0..format.channels() as usize).any(holds));
    });
    Ok(count)
}

/// What a pass over the texels gathers.
#[derive(Default)]
struct Totals {
    texels: u64,
    differing: u64,
    sum: u128,
    max_abs: f64,
    worst: Option<WorstTexel>,
    non_finite_reference: u64,
    non_finite_subject: u64,
}

impl Totals {
    /// Adds the same texel of both images.
    fn add(&mut self, format: Format, position: TexelPosition, reference: &[u8], subject: &[u8]) {
        self.texels += 1;
        let same = reference == subject;
        // Other encodings have no non-finite codes to look for.
        let can_be_non_finite = matches!(format.encoding(), Encoding::Float | Encoding::Ufloat);
        if same && !can_be_non_finite {
            return;
        }
        let (a, b) = (format.codes(reference), format.codes(subject));
        let non_finite = |codes: TexelCodes| {
            let mut channels = 0..format.channels() as usize;
            channels.any(|channel| format.is_non_finite(channel, codes.channels[channel]))
        };
        if can_be_non_finite {
            self.non_finite_reference += u64::from(non_finite(a));
            self.non_finite_subject += u64::from(non_finite(b));
        }
        let distances = if same { [0; 4] } else { format.ulps(a, b) };
        if distances == [0; 4] {
            return;
        }
        self.differing += 1;
        let (a, b) = (
            format.decode_codes(a).to_f64(),
            format.decode_codes(b).to_f64(),
        );
        for (channel, &distance) in distances
            .iter()
            .enumerate()
            .filter(|&(_, &distance)| distance > 0)
        {
            let difference = Difference {
                ulps: Ulps(distance),
                reference: a[channel],
                subject: b[channel],
            };
            let Difference {
                ulps,
                reference,
                subject,
            } = difference;
            if ulps != Ulps::INFINITE {
                self.sum += u128::from(distance);
            }
            self.max_abs = self.max_abs.max(difference.absolute());
            if self.worst.is_none_or(|worst| ulps > worst.ulps) {
                self.worst = Some(WorstTexel {
                    position,
                    channel,
                    reference,
                    subject,
                    ulps,
                });
            }
        }
    }
}

/// Whether the images can be compared texel by texel.
fn check(reference: &ImageData, subject: &ImageData) -> Result<(), CompareError> {
    if reference.desc != subject.desc {
        return Err(CompareError::Description {
            reference: reference.desc,
            subject: subject.desc,
        });
    }
    for image in [reference, subject] {
        let expected = image.desc.bytes().unwrap_or(u64::MAX);
        let actual = image.bytes.len() as u64;
        if expected != actual {
            return Err(CompareError::Incomplete {
                desc: image.desc,
                expected,
                actual,
            });
        }
    }
    Ok(())
}

/// Visits the texels of both images in storage order.
fn for_each_texel(
    reference: &ImageData,
    subject: &ImageData,
    mut visit: impl FnMut(TexelPosition, &[u8], &[u8]),
) {
    let size = reference.desc.format.texel_bytes() as usize;
    for mip in 0..reference.desc.mips {
        let (Some(a), Some(b)) = (reference.mip(mip), subject.mip(mip)) else {
            return;
        };
        for ((position, a), b) in reference
            .desc
            .positions(mip)
            .zip(a.chunks_exact(size))
            .zip(b.chunks_exact(size))
        {
            visit(position, a, b);
        }
    }
}

/// Writes a number, or the strings `"NaN"`, `"inf"`, `"-inf"`, for which JSON
/// has no numbers.
fn serialize_number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.collect_str(value)
    }
}

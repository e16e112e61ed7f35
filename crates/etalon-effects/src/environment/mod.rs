//! Light that comes from everywhere.
//!
//! [`EnvironmentMap`] takes a picture of all directions apart on the host: into the
//! nine numbers per channel of its [`Irradiance`], and into an octahedral map that
//! [`environment`] blurs by roughness, mip by mip. [`Surroundings`] put the result
//! beside a gradient from below to above, which needs no picture; deferred
//! [`lighting`](fn@crate::lighting::lighting) and [`forward`](mod@crate::forward)
//! shading read both alike.
//!
//! Scattered light is exact to what nine spherical harmonics hold (R. Ramamoorthi
//! and P. Hanrahan, "An Efficient Representation for Irradiance Environment Maps",
//! 2001: about 1% on average). Mirrored light is the product of two averages
//! (B. Karis, "Real Shading in Unreal Engine 4", 2013): exact in uniform light,
//! else without the stretching of highlights towards grazing angles.

mod around;
mod cube;
mod irradiance;
mod map;
pub mod truth;

use std::f64::consts::TAU;

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture, TextureView};
use etalon_core::resource::TextureDesc;
use glam::{Vec2, Vec3};

pub(crate) use around::Around;
pub use cube::{CubePicture, FACES, face_direction};
pub use irradiance::Irradiance;
pub use map::{EnvironmentMap, direction};
pub(crate) use map::{check_side, image_size};

use crate::check::Settings;
use crate::knob::{Tunable, knobs};
use crate::probes::Probes;
use crate::{EffectError, SettingError};

/// An environment, ready to light surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Environment {
    /// What [`environment`] made.
    pub radiance: Texture,
    /// Of the same picture.
    pub irradiance: Irradiance,
}

/// Light that comes from everywhere, and what is behind everything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Radiance from straight above, each channel in `[0, 65504]`. In between it
    /// goes with the sine of the elevation.
    pub above: Vec3,
    /// Radiance from straight below, each channel in `[0, 65504]`.
    pub below: Vec3,
    /// Radiance where there is no surface, each channel in `[0, 65504]`.
    pub background: Vec3,
    /// What is added to the light from above and below. Its radiance map costs
    /// eight texels a pixel.
    pub environment: Option<Environment>,
    /// The table of [`mirroring`], to be made once for all that use it.
    pub mirroring: Option<Texture>,
    /// Light captured nearby, which counts before that of the world.
    pub probes: Option<Probes>,
    /// Which pass adds what surfaces mirror of all this.
    pub mirrored: Mirrored,
}

/// Which pass adds the light of surroundings that opaque surfaces mirror. Glass, over
/// which no reflection on the screen is laid, mirrors it in every case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mirrored {
    /// The one that lights them.
    #[default]
    Lit,
    /// [`ssr`](fn@crate::ssr::ssr), where the screen has no answer: what is
    /// [beyond](crate::SceneInputs::beyond) it. It mirrors by the specular map alone, as
    /// it does what is on the screen.
    Reflected,
}

/// How finely a radiance map is blurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prefilter {
    /// Directions for each texel, a power of two in `[16, 1024]`: what is left of
    /// small bright lights turns from spots to smooth with their number, at a cost
    /// in proportion.
    pub samples: u32,
}

knobs!(Prefilter, "environment" {
    count samples [16, 1024] "directions", Accuracy [16, 32, 64, 128, 256, 512, 1024], "directions for each texel, a power of two";
});

impl Default for Prefilter {
    /// 64 directions.
    fn default() -> Self {
        Self { samples: 64 }
    }
}

impl Prefilter {
    /// Checks the number of samples.
    ///
    /// # Errors
    /// If it is not a power of two within its range.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()?;
        if self.samples.is_power_of_two() {
            return Ok(());
        }
        // The nearest range that it is outside of.
        let next = self.samples.next_power_of_two();
        Settings(Self::EFFECT).count("samples", self.samples, next, 1024)
    }
}

/// Blurs the image of an [`EnvironmentMap`], imported as `base`, by roughness: its
/// largest mip is as it is, the last one as seen in the roughest of surfaces.
///
/// The result is `rgba16float`, of the image's size. The cost is that of `samples`
/// reads for a third as many texels as the largest mip has; whoever keeps the result
/// pays it once.
///
/// # Errors
/// If a setting is out of its range, or `base` is not as large as the image of an
/// [`EnvironmentMap`].
pub fn environment(
    graph: &mut Graph,
    base: Texture,
    irradiance: &Irradiance,
    settings: &Prefilter,
) -> Result<Environment, EffectError> {
    settings.validate()?;
    irradiance.validate()?;
    let [width, height] = size_of_map(graph, base)?;
    let radiance = graph.texture(
        "environment radiance",
        TextureDesc::d2(width, height, Format::Rgba16Float),
    );
    Ok(Environment {
        radiance: prefiltered(graph, base, radiance, settings)?,
        irradiance: *irradiance,
    })
}

/// The size of the image of an [`EnvironmentMap`], if it is one.
fn size_of_map(graph: &Graph, base: Texture) -> Result<[u32; 2], SettingError> {
    let extent = graph.desc(base).extent;
    check_side(extent.height)?;
    let [width, height] = image_size(extent.height);
    Settings("environment").count("width", extent.width, width, width)?;
    Ok([width, height])
}

/// [`environment`]'s radiance, in a texture of the image's size or a layer of one.
pub(crate) fn prefiltered(
    graph: &mut Graph,
    base: Texture,
    target: impl Into<TextureView>,
    settings: &Prefilter,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    size_of_map(graph, base)?;
    let turn = TAU / f64::from(settings.samples);
    Ok(graph
        .compute("environment/prefilter")
        .read("source", base)
        .write("result", target)
        .set("samples", settings.samples)
        .set("turn", Vec2::new(turn.cos() as f32, turn.sin() as f32))
        .per_texel("result")?)
}

/// The factors of irradiance over π of the image of an [`EnvironmentMap`], in nine texels
/// of `rgba32float`.
pub(crate) fn scattered(
    graph: &mut Graph,
    base: Texture,
    target: impl Into<TextureView>,
) -> Result<Texture, EffectError> {
    size_of_map(graph, base)?;
    let written = graph
        .compute("environment/irradiance")
        .read("source", base)
        .write("result", target)
        .groups([9, 1, 1])?;
    Ok(written.texture("result")?)
}

/// Most texels of a side of a cube's face.
pub const MAX_FACE: u32 = 4096;

/// Makes of six faces what [`environment`] takes as `base`: `rgba16float`, `side` texels
/// high, a power of two in `[32, 2048]`.
///
/// `faces` has six square layers of up to [`MAX_FACE`] texels: +x, −x, +y, −y, +z, −z as
/// they are seen from within, y up; on +y −z is up, on −y +z. These are the faces of a
/// cube texture turned left to right. What [`capture`](mod@crate::probes::capture) draws
/// and [`CubePicture`] holds is laid out so.
///
/// Each texel is the mean over the part of the sphere that it covers, of as many places
/// as meet every texel of faces of up to 3 times `side` texels; of smaller mips 256 × 256
/// at most. The cost is that of the largest mip for each mip.
///
/// # Errors
/// If `side` is out of its range or `faces` is not such a texture.
pub fn of_faces(graph: &mut Graph, faces: Texture, side: u32) -> Result<Texture, EffectError> {
    check_side(side)?;
    let extent = graph.desc(faces).extent;
    let check = Settings("environment");
    check.count("face width", extent.width, 1, MAX_FACE)?;
    check.count("face height", extent.height, extent.width, extent.width)?;
    check.count("faces", extent.depth_or_layers, 6, 6)?;
    let [width, height] = image_size(side);
    let base = graph.texture(
        "environment base",
        TextureDesc::d2(width, height, Format::Rgba16Float),
    );
    Ok(graph
        .compute("environment/faces")
        .read("faces", faces)
        .write("result", base)
        .set("parts", cube::parts(extent.width, side))
        .per_texel("result")?)
}

/// Texels of the table's sides.
const TABLE: u32 = 48;

/// The table of how much of light from everywhere is mirrored, by angle and
/// roughness: `rgba16float`, 48 × 48, the same for all surroundings.
///
/// It is within 0.002 of the integral for cosines of view from 0.01 on. The cost is
/// that of 0.9 million evaluations of the reflection model; whoever keeps the
/// result pays it once.
///
/// # Errors
/// If the graph refuses the pass.
pub fn mirroring(graph: &mut Graph) -> Result<Texture, EffectError> {
    let table = graph.texture(
        "mirroring",
        TextureDesc::d2(TABLE, TABLE, Format::Rgba16Float),
    );
    Ok(graph
        .compute("environment/mirroring")
        .write("result", table)
        .per_texel("result")?)
}

impl Surroundings {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("surroundings");
        for (field, colour) in [
            ("above", self.above),
            ("below", self.below),
            ("background", self.background),
        ] {
            for value in colour.to_array() {
                check.range(field, value, 0.0, 65504.0)?;
            }
        }
        if let Some(probes) = &self.probes {
            probes.validate()?;
        }
        match &self.environment {
            Some(environment) => environment.irradiance.validate(),
            None => Ok(()),
        }
    }

    /// Whether light comes from them: only then a table of [`mirroring`] is read.
    #[must_use]
    pub fn shine(&self) -> bool {
        self.environment.is_some()
            || self.probes.is_some()
            || self.above != Vec3::ZERO
            || self.below != Vec3::ZERO
    }
}

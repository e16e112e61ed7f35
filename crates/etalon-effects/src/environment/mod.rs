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

mod irradiance;
mod map;
pub mod truth;

use std::f64::consts::TAU;

use etalon_core::Format;
use etalon_core::graph::{Draw, Graph, Texture};
use etalon_core::resource::TextureDesc;
use glam::{DMat4, Mat4, Vec2, Vec3};

pub use irradiance::Irradiance;
pub use map::{EnvironmentMap, direction};

use crate::bloom::LINEAR;
use crate::check::Settings;
use crate::geometry::View;
use crate::knob::{Tunable, knobs};
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
    let extent = graph.desc(base).extent;
    map::check_side(extent.height)?;
    let [width, height] = map::image_size(extent.height);
    Settings("environment").count("width", extent.width, width, width)?;
    let radiance = graph.texture(
        "environment radiance",
        TextureDesc::d2(width, height, Format::Rgba16Float),
    );
    let turn = TAU / f64::from(settings.samples);
    let radiance = graph
        .compute("environment/prefilter")
        .read("source", base)
        .write("result", radiance)
        .set("samples", settings.samples)
        .set("turn", Vec2::new(turn.cos() as f32, turn.sin() as f32))
        .per_texel("result")?;
    Ok(Environment {
        radiance,
        irradiance: *irradiance,
    })
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

/// Surroundings with all that kernels read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    irradiance: Irradiance,
    middle: Vec3,
    slope: Vec3,
    radiance: Option<Texture>,
    mirroring: Texture,
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
        match &self.environment {
            Some(environment) => environment.irradiance.validate(),
            None => Ok(()),
        }
    }

    /// Whether light comes from them: only then a table of [`mirroring`] is read.
    #[must_use]
    pub fn shine(&self) -> bool {
        self.environment.is_some() || self.above != Vec3::ZERO || self.below != Vec3::ZERO
    }

    /// Makes what is missing.
    pub(crate) fn ready(&self, graph: &mut Graph) -> Result<Around, EffectError> {
        let mirroring = match self.mirroring {
            Some(table) => table,
            None => mirroring(graph)?,
        };
        let gradient = Irradiance::of_gradient(self.above.as_dvec3(), self.below.as_dvec3());
        Ok(Around {
            irradiance: match &self.environment {
                Some(environment) => gradient.plus(&environment.irradiance),
                None => gradient,
            },
            middle: 0.5 * (self.above + self.below),
            slope: 0.5 * (self.above - self.below),
            radiance: self.environment.map(|environment| environment.radiance),
            mirroring,
        })
    }
}

impl Around {
    /// Sets what `lib/surroundings` asks for.
    pub(crate) fn set(&self, draw: Draw, view: &View) -> Draw {
        let factors = self.irradiance.polynomial();
        let columns = |four: [usize; 4]| {
            let [x, y, z, w] = four.map(|of| factors[of].as_vec3().extend(0.0));
            Mat4::from_cols(x, y, z, w)
        };
        let to_world = DMat4::from_mat3(glam::DMat3::from_mat4(view.view).transpose());
        let draw = draw
            .feature("surrounded", true)
            .feature("environment", self.radiance.is_some())
            .read("mirroring", self.mirroring)
            .sampler("smoothing", LINEAR)
            .set("to_world", to_world.as_mat4())
            .set("irradiance_low", columns([0, 1, 2, 3]))
            .set("irradiance_high", columns([4, 5, 6, 7]))
            .set("irradiance_last", factors[8].as_vec3())
            .set("middle", self.middle)
            .set("slope", self.slope);
        match self.radiance {
            Some(map) => draw.read("radiance_map", map),
            None => draw,
        }
    }
}

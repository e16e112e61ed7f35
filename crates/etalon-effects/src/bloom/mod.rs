//! Bloom: the glow that bright things have in eyes and lenses.
//!
//! What is brighter than a threshold is halved in size level by level and then
//! doubled again, each level mixed with the wider blur from below. Level `i`
//! has texels of 2^(i+1) pixels, so a handful of levels blurs over hundreds of
//! pixels for little more than the cost of the first.
//!
//! # Source
//! J. Jimenez, "Next Generation Post Processing in Call of Duty: Advanced
//! Warfare", SIGGRAPH 2014: the 13-tap filter down and the 3 × 3 tent up.
//! B. Karis, "Tone mapping", 2013: the weighting against flicker.

pub(crate) mod demand;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{ComputePass, Graph, Texture};
use etalon_core::resource::{AddressMode, Filter, SamplerDesc};

use crate::exposure::Exposed;
use crate::knob::{Tunable, choices, knobs};
use crate::{EffectError, SettingError};

/// What the levels of the chain are stored in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightStorage {
    /// `rg11b10ufloat`: half the bytes of a half float, and a step of 1/64 of the
    /// value (1/32 in blue), so that hues drift over the levels. Not every device
    /// can store to it; planning says so.
    Packed,
    /// `rgba16float`: steps of 1/2048 of the value.
    #[default]
    Half,
    /// `rgba32float`: twice the bytes, no rounding to be seen.
    Full,
}

choices!(LightStorage {
    Packed => "rg11b10ufloat",
    Half => "rgba16float",
    Full => "rgba32float",
});

impl LightStorage {
    const fn format(self) -> Format {
        match self {
            Self::Packed => Format::Rg11b10Ufloat,
            Self::Half => Format::Rgba16Float,
            Self::Full => Format::Rgba32Float,
        }
    }

    /// Tells a kernel which variant to be.
    fn set(self, pass: ComputePass<'_>) -> ComputePass<'_> {
        pass.feature("packed", self == Self::Packed)
            .feature("full", self == Self::Full)
    }
}

/// Settings of [`bloom`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bloom {
    /// Exposed brightness, of the largest channel, from which on light blooms,
    /// in `[0, 65504]`; 1 is white. 0 blooms everything.
    pub threshold: f32,
    /// Softness of the threshold as a share of it, in `[0, 1]`: 0 is a step,
    /// which flickers where a surface's brightness wavers around it.
    pub knee: f32,
    /// Weighs each texel by the reciprocal of its brightness in the first step,
    /// so that single bright ones do not flicker. It dims the bloom of small
    /// lights. Costs a division per texel looked at.
    pub suppress_fireflies: bool,
    /// How many times the picture is halved, in `[1, 12]`; fewer where it is
    /// too small. Each level doubles the reach of the bloom and costs a quarter
    /// of the one before.
    pub levels: u32,
    /// Share of the wider blur at each level, in `[0, 1]`: 0 is a small, sharp
    /// glow, 1 only the widest.
    pub scatter: f32,
    /// How much of the bloom is added to the picture, in `[0, 16]`.
    pub intensity: f32,
    /// What the levels are stored in.
    pub storage: LightStorage,
}

knobs!(Bloom, "bloom" {
    real threshold [0.0, 65_504.0] "exposed light", Look [0.0, 1.0, 4.0], "brightness from which on light blooms";
    real knee [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "softness of the threshold";
    choice suppress_fireflies [bool] "", Look ["off", "on"], "whether single bright texels weigh less";
    count levels [1, 12] "", Accuracy [1, 2, 3, 4, 5, 6, 7, 8, 9], "how many times the picture is halved";
    real scatter [0.0, 1.0] "", Look [0.3, 0.6, 0.9], "share of the wider blur at each level";
    real intensity [0.0, 16.0] "", Look [0.1, 0.3, 1.0], "how much of the bloom is added";
    choice storage [LightStorage] "", Accuracy ["rg11b10ufloat", "rgba16float", "rgba32float"], "what the levels are stored in";
});

impl Default for Bloom {
    fn default() -> Self {
        Self {
            threshold: 1.0,
            knee: 0.5,
            suppress_fireflies: true,
            levels: 6,
            scatter: 0.6,
            intensity: 0.3,
            storage: LightStorage::Half,
        }
    }
}

impl Bloom {
    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()
    }
}

/// What fast kernels filter with; strict ones do it themselves.
pub(crate) const LINEAR: SamplerDesc =
    SamplerDesc::new(AddressMode::ClampToEdge, Filter::Linear, Filter::Nearest);

/// The bloom of `colour`, exposed.
///
/// The result is of half the size of `colour`, rounded up, and of the format of
/// `settings.storage`, with alpha 1. `settings.intensity` is for whoever adds it to the picture.
///
/// # Errors
/// If a setting or the exposure is out of range.
pub fn bloom(
    graph: &mut Graph,
    colour: Texture,
    exposed: Exposed,
    settings: &Bloom,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    exposed.validate("bloom")?;
    let mut desc = graph
        .desc(colour)
        .with_format(settings.storage.format())
        .half();
    let result = graph.texture("bloom.down 1", desc);
    let mut pass = graph
        .compute("bloom/threshold")
        .read("source", colour)
        .write("result", result)
        .set("threshold", settings.threshold)
        .set("knee", settings.threshold * settings.knee)
        .set("exposure", exposed.factor)
        .feature("adapted", exposed.adaptation.is_some())
        .constant("KARIS", f64::from(u8::from(settings.suppress_fireflies)));
    if let Some(adaptation) = exposed.adaptation {
        pass = pass.read("adaptation", adaptation);
    }
    let mut levels = vec![settings.storage.set(pass).per_texel("result")?];
    while levels.len() < settings.levels as usize
        && (desc.extent.width > 1 || desc.extent.height > 1)
    {
        desc = desc.half();
        let result = graph.texture(format!("bloom.down {}", levels.len() + 1), desc);
        let source = levels[levels.len() - 1];
        let pass = graph
            .compute("bloom/downsample")
            .read("source", source)
            .write("result", result)
            .sampler("linear", LINEAR);
        levels.push(settings.storage.set(pass).per_texel("result")?);
    }
    let mut newest = levels[levels.len() - 1];
    for (level, &fine) in levels.iter().enumerate().rev().skip(1) {
        let result = graph.texture(format!("bloom.up {}", level + 1), graph.desc(fine));
        let pass = graph
            .compute("bloom/upsample")
            .read("fine", fine)
            .read("coarse", newest)
            .write("result", result)
            .set("scatter", settings.scatter)
            .sampler("linear", LINEAR);
        newest = settings.storage.set(pass).per_texel("result")?;
    }
    Ok(newest)
}

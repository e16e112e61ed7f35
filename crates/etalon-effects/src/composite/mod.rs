//! The last pass: exposure, bloom, tone curve and encoding in one kernel.

pub(crate) mod demand;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::TextureDesc;

use crate::bloom::LINEAR;
use crate::check::{Settings, same_size, size};
use crate::exposure::Exposed;
use crate::knob::{Choice, Tunable, knobs};
use crate::{EffectError, SettingError};

/// How light is brought into the range of a display. Sources and formulas are
/// in `shaders/lib/tone.wesl`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ToneCurve {
    /// Cut off at white. The cheapest, and the measure of the others: colours
    /// below white are exact.
    Linear,
    /// Extended Reinhard on luminance.
    Reinhard {
        /// Luminance that becomes white, in `[1e-2, 65504]`.
        white: f32,
    },
    /// S. Hill's fit of ACES: contrasty, film-like, shifts saturated hues.
    Aces,
    /// Khronos PBR Neutral: keeps the colours of surfaces, compresses highlights.
    #[default]
    Neutral,
    /// AgX: wide latitude, soft highlights that lose saturation.
    AgX,
}

impl ToneCurve {
    /// Every curve, for comparisons; Reinhard's with a white of 4.
    pub const ALL: [Self; 5] = [
        Self::Linear,
        Self::Reinhard { white: 4.0 },
        Self::Aces,
        Self::Neutral,
        Self::AgX,
    ];

    /// The number that the kernel knows the curve by.
    const fn number(self) -> u32 {
        match self {
            Self::Linear => 0,
            Self::Reinhard { .. } => 1,
            Self::Aces => 2,
            Self::Neutral => 3,
            Self::AgX => 4,
        }
    }
}

/// What the composite produces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output {
    /// `rgba8unorm`, tone-mapped and encoded as sRGB.
    Sdr(ToneCurve),
    /// `rgba16float`, linear, without a tone curve: for a display pipeline that
    /// has its own.
    Hdr,
}

impl Default for Output {
    fn default() -> Self {
        Self::Sdr(ToneCurve::default())
    }
}

impl Choice for Output {
    const NAMES: &'static [&'static str] = &["linear", "reinhard", "aces", "neutral", "agx", "hdr"];

    fn name(self) -> &'static str {
        match self {
            Self::Sdr(curve) => Self::NAMES[curve.number() as usize],
            Self::Hdr => "hdr",
        }
    }

    fn named(name: &str) -> Option<Self> {
        if name == "hdr" {
            return Some(Self::Hdr);
        }
        let named = |curve: &ToneCurve| Self::Sdr(*curve).name() == name;
        ToneCurve::ALL.into_iter().find(named).map(Self::Sdr)
    }
}

/// Settings of [`composite`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Composite {
    /// Factor on the light, in `[0, 1e6]`, on top of automatic exposure if
    /// there is any; bloom counts from the light so multiplied.
    pub exposure: f32,
    /// What is produced.
    pub output: Output,
}

knobs!(Composite, "composite" {
    real exposure [0.0, 1e6] "", Look [0.5, 1.0, 2.0], "factor on the light";
    choice output [Output] "", Look ["linear", "reinhard", "aces", "neutral", "agx", "hdr"], "tone curve, or none and linear light";
});

impl Default for Composite {
    fn default() -> Self {
        Self {
            exposure: 1.0,
            output: Output::default(),
        }
    }
}

impl Composite {
    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()?;
        match self.output {
            Output::Sdr(ToneCurve::Reinhard { white }) => {
                Settings(Self::EFFECT).range("white", white, 1e-2, 65_504.0)
            }
            Output::Sdr(_) | Output::Hdr => Ok(()),
        }
    }
}

/// A bloom to be added: what [`bloom`](crate::bloom::bloom) returned, and how
/// much of it, in `[0, 16]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glow {
    /// Half the size of the picture, rounded up.
    pub bloom: Texture,
    /// Factor on it.
    pub intensity: f32,
}

/// Makes the final picture of `colour`.
///
/// `adaptation` is what [`exposure`](crate::exposure::exposure) returned, if
/// exposure is automatic. The result has the size of `colour` and the format
/// that `settings.output` says; alpha is that of `colour`.
///
/// # Errors
/// If a setting is out of range, or the glow is not half the size of `colour`.
pub fn composite(
    graph: &mut Graph,
    colour: Texture,
    adaptation: Option<Texture>,
    glow: Option<Glow>,
    settings: &Composite,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    let exposed = Exposed {
        factor: settings.exposure,
        adaptation,
    };
    let (format, curve) = match settings.output {
        Output::Sdr(curve) => (Format::Rgba8Unorm, Some(curve)),
        Output::Hdr => (Format::Rgba16Float, None),
    };
    if let Some(glow) = glow {
        Settings("composite").range("intensity", glow.intensity, 0.0, 16.0)?;
        let half = size(graph, colour).map(|side| side.div_ceil(2));
        same_size(
            "composite",
            ("half of colour", half),
            ("bloom", size(graph, glow.bloom)),
        )?;
    }
    let full = glow.is_some_and(|glow| graph.desc(glow.bloom).format == Format::Rgba32Float);
    let extent = graph.desc(colour).extent;
    let result = graph.texture(
        "composite.result",
        TextureDesc::d2(extent.width, extent.height, format),
    );
    let mut pass = graph
        .compute("composite/composite")
        .read("source", colour)
        .write("result", result)
        .set("exposure", exposed.factor)
        .feature("adapted", exposed.adaptation.is_some())
        .feature("bloom", glow.is_some())
        .feature("hdr", curve.is_none())
        .feature("full", full);
    if let Some(adaptation) = exposed.adaptation {
        pass = pass.read("adaptation", adaptation);
    }
    if let Some(glow) = glow {
        pass = pass
            .read("bloom", glow.bloom)
            .set("bloom_intensity", glow.intensity)
            .sampler("linear", LINEAR);
    }
    if let Some(curve) = curve {
        let white = if let ToneCurve::Reinhard { white } = curve {
            white
        } else {
            1.0
        };
        pass = pass
            .set("white", white)
            .constant("CURVE", f64::from(curve.number()));
    }
    Ok(pass.per_texel("result")?)
}

//! Automatic exposure: the picture's average luminance, followed over time as
//! an eye follows it.
//!
//! [`measure`] sums the luminance of the picture down to one texel; [`exposure`]
//! lets a history follow it and derives the factor that [`composite`] and
//! [`bloom`] multiply the picture by.
//!
//! Both are kept in the first two channels of `rgba32float` textures, because
//! OpenGL cannot store to two-channel ones; they are a 256th of the picture and
//! smaller, so the other two channels cost next to nothing.
//!
//! [`composite`]: crate::composite
//! [`bloom`]: crate::bloom

pub(crate) mod demand;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{ClearValue, Graph, Texture};
use etalon_core::resource::TextureDesc;

use crate::check::Settings;
use crate::knob::{Tunable, choices, knobs};
use crate::{EffectError, SettingError};

/// Which average of the luminance is metered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Metering {
    /// Arithmetic mean: all light counts, so one lamp in the dark darkens the
    /// picture.
    Arithmetic,
    /// Geometric mean, the average in stops: what most of the picture is
    /// like counts (Reinhard et al. 2002, equation 1).
    #[default]
    Logarithmic,
}

choices!(Metering {
    Arithmetic => "arithmetic",
    Logarithmic => "logarithmic",
});

/// Settings of [`exposure`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Which average is metered. The geometric one costs a logarithm per pixel.
    pub metering: Metering,
    /// Distance between the texels that are looked at, in each axis, in `[1, 64]`:
    /// 2 looks at a quarter of the picture for a quarter of the cost, and lets
    /// small lights jump in and out of the average.
    pub stride: u32,
    /// Luminance that the average is brought to, in `[1e-4, 10]`: 0.18 is the
    /// middle grey of photography.
    pub key: f32,
    /// Stops brighter than that, in `[−16, 16]`.
    pub compensation: f32,
    /// Darkest luminance adapted to, in `[1e-6, 65504]`: below it the picture
    /// gets dark. It bounds the exposure of a black picture.
    pub min_luminance: f32,
    /// Brightest luminance adapted to, from `min_luminance` to 65504: above it
    /// the picture gets bright.
    pub max_luminance: f32,
    /// How fast the eye follows when the scene gets brighter, as the reciprocal
    /// of the time constant in seconds, in `[0, 1e4]`. 0 never does.
    pub speed_up: f32,
    /// As `speed_up`, when it gets darker; eyes take longer for that.
    pub speed_down: f32,
}

knobs!(Exposure, "exposure" {
    choice metering [Metering] "", Look ["arithmetic", "logarithmic"], "which average is metered";
    count stride [1, 64] "texels", Accuracy [32, 16, 8, 4, 2, 1], "distance between the texels looked at";
    real key [1e-4, 10.0] "luminance", Look [0.09, 0.18, 0.36], "what the average is brought to";
    real compensation [-16.0, 16.0] "stops", Look [-1.0, 0.0, 1.0], "brighter or darker than that";
    real min_luminance [1e-6, 65_504.0] "luminance", Look [1e-4, 1e-3, 1e-2], "darkest luminance adapted to";
    real max_luminance [1e-6, 65_504.0] "luminance", Look [1e2, 1e4], "brightest luminance adapted to";
    real speed_up [0.0, 1e4] "1/s", Look [1.0, 3.0, 10.0], "how fast a brighter scene is followed";
    real speed_down [0.0, 1e4] "1/s", Look [0.5, 1.0, 10.0], "how fast a darker scene is followed";
});

impl Default for Exposure {
    fn default() -> Self {
        Self {
            metering: Metering::Logarithmic,
            stride: 1,
            key: 0.18,
            compensation: 0.0,
            min_luminance: 1e-3,
            max_luminance: 1e4,
            speed_up: 3.0,
            speed_down: 1.0,
        }
    }
}

impl Exposure {
    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()?;
        Settings(Self::EFFECT).range(
            "max_luminance",
            self.max_luminance,
            self.min_luminance,
            65_504.0,
        )
    }

    fn metering(&self) -> f64 {
        match self.metering {
            Metering::Arithmetic => 0.0,
            Metering::Logarithmic => 1.0,
        }
    }
}

/// Name of the history that [`exposure`] keeps between frames.
pub const HISTORY: &str = "exposure";

/// Width and height of the tiles that one workgroup sums.
const TILE: u32 = 16;

/// Sums the luminance of `colour`, or its logarithm to base 2, as
/// `settings.metering` says.
///
/// The result is one texel of `rgba32float`: the sum, and the number of texels
/// that were looked at, finite, and so took part.
///
/// # Errors
/// If a setting is out of range.
pub fn measure(
    graph: &mut Graph,
    colour: Texture,
    settings: &Exposure,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    let extent = graph.desc(colour).extent;
    let mut size = [extent.width, extent.height].map(|side| {
        let seen = side.div_ceil(settings.stride);
        seen.div_ceil(TILE).max(1)
    });
    let mut level = 0;
    let mut tiles = |graph: &mut Graph, [width, height]: [u32; 2]| {
        level += 1;
        graph.texture(
            format!("exposure.sums {level}"),
            TextureDesc::d2(width, height, Format::Rgba32Float),
        )
    };
    let result = tiles(graph, size);
    let mut newest = graph
        .compute("exposure/luminance")
        .read("source", colour)
        .write("result", result)
        .constant("METERING", settings.metering())
        .constant("STRIDE", f64::from(settings.stride))
        .set("floor_luminance", settings.min_luminance)
        .groups([size[0], size[1], 1])?
        .texture("result")?;
    while size != [1, 1] {
        size = size.map(|side| side.div_ceil(TILE));
        let result = tiles(graph, size);
        newest = graph
            .compute("exposure/reduce")
            .read("source", newest)
            .write("result", result)
            .groups([size[0], size[1], 1])?
            .texture("result")?;
    }
    Ok(newest)
}

/// Meters `colour` and adapts to it.
///
/// `delta_time` is the time since the last frame in seconds, in `[0, 1e6]`. The
/// result is one texel of `rgba32float`: the luminance adapted to, and the factor
/// that brings it to `key`. It is kept as the history [`HISTORY`]. As long as no frame
/// had a finite texel the luminance is 0, which is none, and the factor that of the
/// darkest.
///
/// # Errors
/// If a setting or `delta_time` is out of range.
pub fn exposure(
    graph: &mut Graph,
    colour: Texture,
    delta_time: f32,
    settings: &Exposure,
) -> Result<Texture, EffectError> {
    Settings("exposure").range("delta_time", delta_time, 0.0, 1e6)?;
    let measured = measure(graph, colour, settings)?;
    // No luminance is 0, so the first frame's history is seen to be none.
    let history = graph.history(
        HISTORY,
        TextureDesc::d2(1, 1, Format::Rgba32Float),
        ClearValue::Float([0.0; 4]),
    )?;
    Ok(graph
        .compute("exposure/adapt")
        .read("measured", measured)
        .read("history", history.previous)
        .write("result", history.current)
        .constant("METERING", settings.metering())
        .set("min_luminance", settings.min_luminance)
        .set("max_luminance", settings.max_luminance)
        .set("key", settings.key)
        .set("compensation", settings.compensation)
        .set("speed_up", settings.speed_up)
        .set("speed_down", settings.speed_down)
        .set("delta_time", delta_time)
        .per_texel("result")?)
}

/// How much light is multiplied by before it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposed {
    /// A fixed factor, in `[0, 1e6]`.
    pub factor: f32,
    /// What [`exposure`] returned, whose factor comes on top.
    pub adaptation: Option<Texture>,
}

impl Default for Exposed {
    fn default() -> Self {
        Self {
            factor: 1.0,
            adaptation: None,
        }
    }
}

impl Exposed {
    pub(crate) fn validate(&self, effect: &'static str) -> Result<(), SettingError> {
        Settings(effect).range("exposure", self.factor, 0.0, 1e6)
    }
}

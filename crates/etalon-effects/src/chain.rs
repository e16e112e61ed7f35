//! The effects of a frame, one after the other, as the scene asks for them.

use etalon_core::graph::{Graph, Texture};

use crate::bloom::{Bloom, bloom};
use crate::composite::{Composite, Glow, composite};
use crate::exposure::{Exposed, Exposure, exposure};
use crate::knob::Tunable;
use crate::quality::Quality;
use crate::ssr::{Ssr, ssr};
use crate::{EffectError, SceneInputs, SettingError};

/// Which effects a frame has, and their settings. `None` is off, and costs
/// nothing: no pass, no kernel, no memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChainSettings {
    /// Screen-space reflection.
    pub ssr: Option<Ssr>,
    /// Automatic exposure.
    pub exposure: Option<Exposure>,
    /// Bloom.
    pub bloom: Option<Bloom>,
    /// The last pass, which every picture needs.
    pub composite: Composite,
}

impl ChainSettings {
    /// Every effect with its default settings.
    #[must_use]
    pub fn full() -> Self {
        Self {
            ssr: Some(Ssr::default()),
            exposure: Some(Exposure::default()),
            bloom: Some(Bloom::default()),
            composite: Composite::default(),
        }
    }

    /// Every effect with the settings of a preset.
    #[must_use]
    pub fn preset(quality: Quality) -> Self {
        Self {
            ssr: Some(Ssr::preset(quality)),
            exposure: Some(Exposure::preset(quality)),
            bloom: Some(Bloom::preset(quality)),
            composite: Composite::preset(quality),
        }
    }

    /// Checks the settings of the effects that are on.
    ///
    /// # Errors
    /// The first field out of its range.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.ssr.as_ref().map_or(Ok(()), Ssr::validate)?;
        self.exposure.as_ref().map_or(Ok(()), Exposure::validate)?;
        self.bloom.as_ref().map_or(Ok(()), Bloom::validate)?;
        self.composite.validate()
    }
}

/// What the effects of a frame produced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// The final picture.
    pub picture: Texture,
    /// Linear light with reflections, before exposure; the scene's own colour
    /// where there are none.
    pub light: Texture,
    /// `rgba32float`, one texel: luminance adapted to and exposure.
    pub adaptation: Option<Texture>,
    /// `rgba16float`, half size: exposed bloom.
    pub bloom: Option<Texture>,
}

/// Declares the effects of a frame: reflection, exposure, bloom, composite.
///
/// Settings are checked before anything is declared.
///
/// # Errors
/// If a setting is out of range or the inputs do not fit together.
pub fn chain(
    graph: &mut Graph,
    inputs: &SceneInputs,
    settings: &ChainSettings,
) -> Result<Chain, EffectError> {
    settings.validate()?;
    let light = match &settings.ssr {
        Some(settings) => ssr(graph, inputs, settings)?,
        None => inputs.colour,
    };
    on_light(graph, light, inputs.delta_time, settings)
}

/// The effects that read nothing but light: exposure, bloom, composite. Settings have
/// been checked.
pub(crate) fn on_light(
    graph: &mut Graph,
    light: Texture,
    delta_time: f32,
    settings: &ChainSettings,
) -> Result<Chain, EffectError> {
    let adaptation = match &settings.exposure {
        Some(settings) => Some(exposure(graph, light, delta_time, settings)?),
        None => None,
    };
    let exposed = Exposed {
        factor: settings.composite.exposure,
        adaptation,
    };
    let glow = match &settings.bloom {
        Some(settings) => Some(Glow {
            bloom: bloom(graph, light, exposed, settings)?,
            intensity: settings.intensity,
        }),
        None => None,
    };
    let picture = composite(graph, light, adaptation, glow, &settings.composite)?;
    Ok(Chain {
        picture,
        light,
        adaptation,
        bloom: glow.map(|glow| glow.bloom),
    })
}

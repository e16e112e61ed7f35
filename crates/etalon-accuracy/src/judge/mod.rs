//! How effects are judged: which truths each is held against, and by what measure.
//!
//! The three [kinds of error](ErrorKind) are kept apart throughout. Truths are computed
//! once for a scene; a judge then holds any number of settings to them.

mod environment;
mod light;
mod ssr;

use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::plan::PlanError;
use etalon_effects::EffectError;
use etalon_effects::truth::Plane;
use etalon_scenes::picture::Look;
use thiserror::Error;

use crate::metric::MetricError;
use crate::metric::colour::{RELATIVE_EPSILON, relative_error};
use crate::metric::flip::{hdr, ldr};
use crate::model::{ErrorKind, Fact, Metric};
use crate::observe::{ObserveError, Observed};
use crate::pictures::{Picture, PictureError};
use crate::sky::SkyStage;
use crate::stage::{Stage, StageError};

/// Why an effect cannot be judged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum JudgeError {
    /// There is no truth for it.
    #[error(
        "there is no truth for `{effect}` on a frame; there are ssr, exposure, bloom, composite"
    )]
    NoTruth {
        /// The effect.
        effect: String,
    },
    /// It cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// It cannot be run.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// What it wrote cannot be seen.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The scene cannot say what is true.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The truth cannot be computed.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// What was written and what is true cannot be compared.
    #[error(transparent)]
    Metric(#[from] MetricError),
    /// A picture cannot be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// What a judge says of one result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// By metric id.
    pub errors: BTreeMap<String, f64>,
    /// The result; effects without a picture have none.
    pub picture: Option<Picture>,
    /// How it differs from the truth on the same screen data.
    pub difference: Option<Picture>,
}

/// Holds results of one effect on one scene to the truth.
pub trait Judge {
    /// What is measured, the main measure of each kind first.
    fn metrics(&self) -> Vec<Metric>;

    /// What is true of the scene, whatever the settings.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// Judges what passes wrote; `exact` is the same in `f64`.
    ///
    /// # Errors
    /// If the passes are not those of the effect.
    fn judge(&self, seen: &Observed, exact: &Observed) -> Result<Judgement, JudgeError>;
}

/// The scenes or skies that an effect is best judged on: where it has something to do, and
/// one that it finds hard.
#[must_use]
pub fn scenes(effect: &str) -> &'static [&'static str] {
    match effect {
        "ssr" => &["wet-floor", "mirror-planes"],
        "bloom" => &["dark-room-lights", "wet-floor"],
        // Which texels a stride meets is chance, that only several scenes even out.
        "exposure" => &["wet-floor", "corridor-grazing", "dark-room-lights"],
        // Small and bright, and soft.
        "environment" => &["sun", "lamps"],
        _ => &["wet-floor"],
    }
}

/// The judge of an effect on a frame with its default look. Computes the truths.
///
/// # Errors
/// If there are none for the effect, or memory runs out.
pub fn judge(effect: &str, stage: &Stage) -> Result<Box<dyn Judge>, JudgeError> {
    Ok(match effect {
        "ssr" => Box::new(ssr::Reflections::new(stage)?),
        "exposure" => Box::new(light::Metered::new(stage)?),
        "bloom" => Box::new(light::Pictured::bloom(stage)?),
        "composite" => Box::new(light::Pictured::composite(stage)?),
        _ => {
            return Err(JudgeError::NoTruth {
                effect: effect.to_owned(),
            });
        }
    })
}

/// The judge of the environment on a sky. Computes the truths.
///
/// # Errors
/// If memory runs out.
pub fn map_judge(stage: &SkyStage) -> Result<Box<dyn Judge>, JudgeError> {
    Ok(Box::new(environment::Blurred::new(stage)?))
}

/// A measure whose smaller values are better.
fn metric(kind: ErrorKind, id: &str, name: &str, unit: &str, description: &str) -> Metric {
    Metric {
        id: format!("{}.{id}", prefix(kind)),
        kind,
        name: name.to_owned(),
        unit: unit.to_owned(),
        description: description.to_owned(),
        larger_is_better: false,
    }
}

const fn prefix(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::Rounding => "rounding",
        ErrorKind::Algorithm => "algorithm",
        ErrorKind::Model => "model",
    }
}

/// What the numbers of a picture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Picturing {
    /// Linear light.
    Light,
    /// What a display is sent, encoded as sRGB.
    Encoded,
}

impl Picturing {
    const fn look(self) -> Look {
        match self {
            Self::Light => Look::Colour { exposure: 1.0 },
            Self::Encoded => Look::Plain,
        }
    }
}

/// The measures of a picture.
fn colour_metrics(kind: ErrorKind, picturing: Picturing) -> Vec<Metric> {
    let relative = format!(
        "Squared difference over the squared truth plus {RELATIVE_EPSILON}, in the mean over pixels and channels."
    );
    let mut metrics = vec![
        metric(kind, "colour", "colour, relMSE", "", &relative),
        metric(
            kind,
            "colour-worst",
            "colour, relMSE, 99.9th percentile",
            "",
            "The same of single pixels: one in a thousand is further off.",
        ),
    ];
    if kind == ErrorKind::Algorithm {
        let (name, description) = match picturing {
            Picturing::Light => (
                "HDR-FLIP",
                "What an eye notices, over all exposures that the truth can be shown at, from 0 to 1.",
            ),
            Picturing::Encoded => ("FLIP", "What an eye notices, from 0 to 1."),
        };
        metrics.push(metric(kind, "flip", name, "", description));
    }
    metrics
}

/// The figures of [`colour_metrics`]; those of the algorithm with a picture of where
/// an eye sees them. FLIP takes longer than everything else together, so that the
/// other kinds, of which an eye sees nothing or everything, do without.
fn colour_figures(
    judgement: &mut Judgement,
    kind: ErrorKind,
    picturing: Picturing,
    seen: &Plane,
    truth: &Plane,
) -> Result<(), JudgeError> {
    let figures = relative_error(seen.texels(), truth.texels())?;
    let prefix = prefix(kind);
    let errors = &mut judgement.errors;
    errors.insert(format!("{prefix}.colour"), figures.mean);
    errors.insert(format!("{prefix}.colour-worst"), figures.p999);
    if kind == ErrorKind::Algorithm {
        let map = match picturing {
            Picturing::Light => hdr(seen.texels(), truth.texels(), seen.size())?.map,
            Picturing::Encoded => {
                let [seen, truth] = [seen, truth].map(|plane| Picture::of(plane, picturing.look()));
                ldr(&seen.rgb, &truth.rgb, [seen.width, seen.height])?
            }
        };
        errors.insert(format!("{prefix}.flip"), map.mean());
        let [width, height] = seen.size();
        let shares = map.values.into_iter().map(f64::from);
        judgement.difference = Some(Picture::heat(width, height, shares));
    }
    Ok(())
}

//! Exposure, bloom and composite: what they make of a picture of light.
//!
//! Their model error is that of the picture they are given: they see one ray
//! through the centre of each pixel, rounded to half floats, where the scene's own
//! light is the average over each pixel.

use etalon_effects::bloom::{self, Bloom};
use etalon_effects::composite::{self, Composite};
use etalon_effects::exposure::{self, Exposure};
use etalon_effects::truth::Plane;

use super::{
    Judge, JudgeError, Judgement, Picturing, colour_figures, colour_metrics, metric, prefix,
};
use crate::metric::colour::energy;
use crate::model::{ErrorKind, Metric};
use crate::observe::Observed;
use crate::pictures::Picture;
use crate::stage::{DELTA_TIME, Stage};

const KINDS: [ErrorKind; 3] = [ErrorKind::Algorithm, ErrorKind::Rounding, ErrorKind::Model];

/// Truths of an effect whose result is a picture.
pub(super) struct Pictured {
    /// On the same screen data, and on the scene's own light.
    algorithm: Plane,
    model: Plane,
    picturing: Picturing,
    energy: bool,
}

impl Pictured {
    /// Bloom without exposure.
    pub(super) fn bloom(stage: &Stage) -> Result<Self, JudgeError> {
        let settings = Bloom::default();
        let of = |colour: &Plane| bloom::truth::bloom(colour, 1.0, &settings);
        Ok(Self {
            algorithm: of(&stage.screen.colour)?,
            model: of(&stage.light()?)?,
            picturing: Picturing::Light,
            energy: true,
        })
    }

    /// Composite without exposure and bloom.
    pub(super) fn composite(stage: &Stage) -> Result<Self, JudgeError> {
        let settings = Composite::default();
        let of = |colour: &Plane| composite::truth::composite(colour, 1.0, None, &settings);
        Ok(Self {
            algorithm: of(&stage.screen.colour)?,
            model: of(&stage.light()?)?,
            picturing: Picturing::Encoded,
            energy: false,
        })
    }
}

impl Judge for Pictured {
    fn metrics(&self) -> Vec<Metric> {
        let mut metrics = Vec::new();
        for kind in KINDS {
            metrics.extend(colour_metrics(kind, self.picturing));
            if self.energy {
                metrics.push(metric(
                    kind,
                    "energy",
                    "energy",
                    "",
                    "Sum of all light over that of the truth, less 1, without sign.",
                ));
            }
        }
        metrics
    }

    fn judge(&self, seen: &Observed, exact: &Observed) -> Result<Judgement, JudgeError> {
        let mut judgement = Judgement::default();
        let result = seen.result()?;
        for (kind, truth) in [
            (ErrorKind::Algorithm, &self.algorithm),
            (ErrorKind::Rounding, exact.result()?),
            (ErrorKind::Model, &self.model),
        ] {
            colour_figures(&mut judgement, kind, self.picturing, result, truth)?;
            if self.energy {
                let energy = energy(result.texels(), truth.texels())?;
                let id = format!("{}.energy", prefix(kind));
                judgement.errors.insert(id, energy.error());
            }
        }
        judgement.picture = Some(Picture::of(result, self.picturing.look()));
        Ok(judgement)
    }
}

/// How exposed light is metered.
pub(super) struct Metered {
    /// Luminance adapted to, by the exact sum over the same screen data, and over the
    /// scene's own light.
    algorithm: f64,
    model: f64,
}

impl Metered {
    pub(super) fn new(stage: &Stage) -> Result<Self, JudgeError> {
        let settings = Exposure::default();
        // The first frame has nothing to adapt from.
        let of = |colour: &Plane| {
            let adapted = exposure::truth::exposure(colour, None, DELTA_TIME.into(), &settings);
            adapted.map(|adapted| adapted.luminance)
        };
        Ok(Self {
            algorithm: of(&stage.screen.colour)?,
            model: of(&stage.light()?)?,
        })
    }
}

impl Judge for Metered {
    fn metrics(&self) -> Vec<Metric> {
        let ev = |kind| {
            metric(
                kind,
                "ev",
                "exposure",
                "stops",
                "Logarithm to base 2 of the luminance adapted to over the true one, without sign.",
            )
        };
        KINDS.map(ev).to_vec()
    }

    fn judge(&self, seen: &Observed, exact: &Observed) -> Result<Judgement, JudgeError> {
        let luminance = |observed: &Observed| -> Result<f64, JudgeError> {
            Ok(observed.texture("exposure/adapt", "result")?.at(0, 0)[0])
        };
        let mut judgement = Judgement::default();
        let found = luminance(seen)?;
        for (kind, truth) in [
            (ErrorKind::Algorithm, self.algorithm),
            (ErrorKind::Rounding, luminance(exact)?),
            (ErrorKind::Model, self.model),
        ] {
            let id = format!("{}.ev", prefix(kind));
            if let Some(stops) = exposure::truth::ev_between(found, truth) {
                judgement.errors.insert(id, stops.abs());
            }
        }
        Ok(judgement)
    }
}

//! The environment: how light is blurred by roughness, level by level.
//!
//! The first level is a copy, in which nothing can be wrong; all others count alike,
//! since a surface of each roughness is as likely. Frames repeat what is there and do not
//! count. The model error is that of the map that kernels are given, of texels of one
//! size, against the picture of the sky.

use etalon_effects::environment::truth::{Light, directions, level, roughness};
use etalon_effects::truth::Plane;
use glam::DVec3;
use rayon::prelude::*;

use super::{Judge, JudgeError, Judgement, Picturing, colour_metrics, metric, prefix};
use crate::metric::colour::relative_error;
use crate::metric::flip::hdr;
use crate::model::{ErrorKind, Fact, Metric};
use crate::observe::Observed;
use crate::pictures::Picture;
use crate::sky::SkyStage;

const KINDS: [ErrorKind; 3] = [ErrorKind::Algorithm, ErrorKind::Rounding, ErrorKind::Model];

/// Directions that one thread averages around at a time.
const BATCH: usize = 32;

/// The truths of a sky.
pub(super) struct Blurred {
    /// Of each level but the first.
    roughness: Vec<f64>,
    algorithm: Vec<Plane>,
    model: Vec<Plane>,
    facts: Vec<Fact>,
}

impl Blurred {
    pub(super) fn new(stage: &SkyStage) -> Result<Self, JudgeError> {
        let side = stage.side();
        let roughness = (1..)
            .map_while(|level| roughness(side, level).ok())
            .collect::<Vec<_>>();
        let base = Plane::of(stage.map.image()).map_err(etalon_effects::EffectError::from)?;
        let map = Light::of_map(&base)?;
        let picture = Light::of_equirectangular(&stage.picture)?;
        let (mean, _) = map.mean();
        let brightest = base.texels().iter().map(|texel| texel[1]);
        let facts = vec![
            Fact {
                name: "side of the map".to_owned(),
                value: side.into(),
                unit: "texels".to_owned(),
            },
            Fact {
                name: "brightest texel over the mean, green".to_owned(),
                value: brightest.fold(0.0, f64::max) / mean.y,
                unit: String::new(),
            },
        ];
        Ok(Self {
            algorithm: levels(&map, side, &roughness)?,
            model: levels(&picture, side, &roughness)?,
            roughness,
            facts,
        })
    }

    fn level_id(kind: ErrorKind, number: usize) -> String {
        format!("{}.level-{number}", prefix(kind))
    }
}

/// All levels of light but the first.
fn levels(light: &Light, side: u32, roughness: &[f64]) -> Result<Vec<Plane>, JudgeError> {
    let level = |(number, roughness): (u32, &f64)| -> Result<Plane, JudgeError> {
        let all = directions(side, number)?;
        let averaged: Vec<DVec3> = all
            .par_chunks(BATCH)
            .flat_map_iter(|some| light.averaged(some, *roughness))
            .collect();
        let inner = (side >> number) - 2;
        let texels = averaged.iter().map(|light| light.extend(1.0).to_array());
        let plane = Plane::new(inner, inner, texels.collect());
        Ok(plane.map_err(etalon_effects::EffectError::from)?)
    };
    (1..).zip(roughness).map(level).collect()
}

impl Judge for Blurred {
    fn metrics(&self) -> Vec<Metric> {
        let mut metrics = Vec::new();
        for kind in KINDS {
            metrics.extend(colour_metrics(kind, Picturing::Light));
            for (number, roughness) in (1..).zip(&self.roughness) {
                metrics.push(Metric {
                    id: Self::level_id(kind, number),
                    ..metric(
                        kind,
                        "level",
                        &format!("roughness {roughness:.2}, relMSE"),
                        "",
                        "The same of one level.",
                    )
                });
            }
        }
        metrics
    }

    fn facts(&self) -> Vec<Fact> {
        self.facts.clone()
    }

    fn judge(&self, seen: &Observed, exact: &Observed) -> Result<Judgement, JudgeError> {
        let of = |map: &Plane| -> Result<Vec<Plane>, JudgeError> {
            let numbers = 1..=self.roughness.len() as u32;
            Ok(numbers
                .map(|number| level(map, number))
                .collect::<Result<_, _>>()?)
        };
        let (seen, exact) = (of(seen.result()?)?, of(exact.result()?)?);
        let mut judgement = Judgement::default();
        let errors = &mut judgement.errors;
        let share = (seen.len() as f64).recip();
        for (kind, truth) in [
            (ErrorKind::Algorithm, &self.algorithm),
            (ErrorKind::Rounding, &exact),
            (ErrorKind::Model, &self.model),
        ] {
            let (mut mean, mut worst) = (0.0, 0_f64);
            for (number, (seen, truth)) in (1..).zip(seen.iter().zip(truth)) {
                let figures = relative_error(seen.texels(), truth.texels())?;
                mean += figures.mean * share;
                worst = worst.max(figures.p999);
                errors.insert(Self::level_id(kind, number), figures.mean);
            }
            errors.insert(format!("{}.colour", prefix(kind)), mean);
            errors.insert(format!("{}.colour-worst", prefix(kind)), worst);
        }
        let mut flip = 0.0;
        let mut maps = Vec::new();
        for (seen, truth) in seen.iter().zip(&self.algorithm) {
            let map = hdr(seen.texels(), truth.texels(), seen.size())?.map;
            flip += map.mean() * share;
            maps.push((seen.width(), map.values));
        }
        errors.insert(format!("{}.flip", prefix(ErrorKind::Algorithm)), flip);
        judgement.difference = Some(strip(maps.iter().map(|(width, values)| {
            let shares = values.iter().copied().map(f64::from);
            Picture::heat(*width, *width, shares)
        })));
        let look = Picturing::Light.look();
        judgement.picture = Some(strip(seen.iter().map(|level| Picture::of(level, look))));
        Ok(judgement)
    }
}

/// Levels side by side, each enlarged by whole texels to about the size of the first.
fn strip(levels: impl Iterator<Item = Picture>) -> Picture {
    let levels: Vec<Picture> = levels.collect();
    let height = levels.first().map_or(0, |level| level.height);
    let mut rows = vec![Vec::new(); height as usize];
    for (number, level) in levels.iter().enumerate() {
        let scale = 1 << number;
        for (y, row) in (0..height).zip(&mut rows) {
            for x in 0..level.width * scale {
                let place = (y / scale * level.width + x / scale) as usize * 3;
                // Below a smaller level there is nothing.
                let texel = level.rgb.get(place..place + 3).unwrap_or(&[0; 3]);
                row.extend_from_slice(texel);
            }
        }
    }
    let rgb = rows.concat();
    Picture {
        width: rgb.len() as u32 / 3 / height.max(1),
        height,
        rgb,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_stand_side_by_side() {
        let level = |width: u32, value: u8| Picture {
            width,
            height: width,
            rgb: vec![value; (width * width * 3) as usize],
        };
        let all = strip([level(6, 1), level(2, 2)].into_iter());
        assert_eq!((all.width, all.height, all.rgb.len()), (10, 6, 180));
        let at = |x: usize, y: usize| all.rgb[(y * 10 + x) * 3];
        assert_eq!([at(5, 5), at(6, 0), at(9, 3), at(9, 4)], [1, 2, 2, 0]);
        assert_eq!(strip(std::iter::empty()).rgb.len(), 0);
    }
}

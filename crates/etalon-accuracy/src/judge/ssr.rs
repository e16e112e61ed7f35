//! Screen-space reflection: where reflections are found, and what is seen there.

use etalon_effects::ssr::Ssr;
use etalon_effects::ssr::truth::{hits, picture};
use etalon_effects::truth::Plane;
use etalon_scenes::trace::MirrorRay;

use super::{
    Judge, JudgeError, Judgement, Picturing, colour_figures, colour_metrics, metric, prefix,
};
use crate::metric::hits::{Distances, Hits, hits as compare};
use crate::model::{ErrorKind, Fact, Metric};
use crate::observe::{ObserveError, Observed};
use crate::pictures::Picture;
use crate::stage::Stage;

/// Where a reflection is found, pixel by pixel.
type Places = Vec<Option<[f64; 2]>>;

/// The truths of a scene.
pub(super) struct Reflections {
    size: [u32; 2],
    /// By the exhaustive search of the same screen.
    places: Places,
    /// The whole effect with those.
    picture: Plane,
    /// By the scene itself, where the screen shows it; and which pixels reflect.
    true_places: Places,
    reflects: Vec<bool>,
    facts: Vec<Fact>,
}

impl Reflections {
    pub(super) fn new(stage: &Stage) -> Result<Self, JudgeError> {
        let settings = Ssr::default();
        let screen = &stage.screen;
        let found = hits(&screen.depth, &screen.normal, &stage.camera, &settings)?;
        let rays = stage.reflection()?.rays;
        let true_places = rays.iter().map(|ray| match ray {
            MirrorRay::Hit(hit) if hit.visible => hit.uv.map(|uv| uv.to_array()),
            _ => None,
        });
        let reflects: Vec<bool> = rays.iter().map(|ray| *ray != MirrorRay::None).collect();
        Ok(Self {
            size: screen.depth.size(),
            places: found
                .iter()
                .map(|hit| Some(hit.as_ref()?.uv.to_array()))
                .collect(),
            picture: picture(screen, &stage.camera, &settings)?,
            true_places: true_places.collect(),
            facts: facts(&rays),
            reflects,
        })
    }
}

/// What the screen can answer.
fn facts(rays: &[MirrorRay]) -> Vec<Fact> {
    let count = |of: fn(&MirrorRay) -> bool| rays.iter().filter(|ray| of(ray)).count() as f64;
    let all = count(|ray| *ray != MirrorRay::None);
    let share = |name: &str, of: fn(&MirrorRay) -> bool| Fact {
        name: name.to_owned(),
        value: count(of) / all.max(1.0),
        unit: String::new(),
    };
    vec![
        Fact {
            name: "pixels that reflect".to_owned(),
            value: all / rays.len().max(1) as f64,
            unit: String::new(),
        },
        share(
            "of their rays, those that meet what the screen shows",
            |ray| matches!(ray, MirrorRay::Hit(hit) if hit.visible),
        ),
        share(
            "those that the screen cannot answer: hidden, facing away, or outside the picture",
            |ray| matches!(ray, MirrorRay::Hit(hit) if !hit.visible),
        ),
        share("those that leave for the sky", |ray| {
            matches!(ray, MirrorRay::Miss { .. })
        }),
    ]
}

/// The measures of places found.
fn hit_metrics(kind: ErrorKind) -> Vec<Metric> {
    let larger = |id, name, description| Metric {
        larger_is_better: true,
        ..metric(kind, id, name, "", description)
    };
    vec![
        metric(
            kind,
            "hit-median",
            "hit position, median",
            "pixels",
            "Distance of the place found from the true one, over pixels where both are.",
        ),
        metric(
            kind,
            "hit-95",
            "hit position, 95th percentile",
            "pixels",
            "The same; one in twenty is further off.",
        ),
        metric(
            kind,
            "hit-max",
            "hit position, largest",
            "pixels",
            "The same; none is further off.",
        ),
        metric(
            kind,
            "hit-silhouette",
            "hit position at silhouettes, 95th percentile",
            "pixels",
            "Over pixels next to which the true place jumps, which the others leave out.",
        ),
        larger(
            "precision",
            "precision",
            "Share of the reflections found that there are.",
        ),
        larger(
            "recall",
            "recall",
            "Share of the reflections there are that were found.",
        ),
        larger(
            "located",
            "found to a pixel",
            "Share of the reflections there are that were found within a pixel of their place.",
        ),
    ]
}

impl Judge for Reflections {
    fn metrics(&self) -> Vec<Metric> {
        let mut metrics = Vec::new();
        for kind in [ErrorKind::Algorithm, ErrorKind::Rounding] {
            metrics.extend(colour_metrics(kind, Picturing::Light));
            metrics.extend(hit_metrics(kind));
        }
        // What an eye sees comes first: a reflection that is missed altogether is
        // forgiven by the relative error more than one that is moved a little.
        metrics.sort_by_key(|metric| !metric.id.ends_with(".flip"));
        metrics.extend(hit_metrics(ErrorKind::Model));
        metrics
    }

    fn facts(&self) -> Vec<Fact> {
        self.facts.clone()
    }

    fn judge(&self, seen: &Observed, exact: &Observed) -> Result<Judgement, JudgeError> {
        let mut judgement = Judgement::default();
        let places = places(seen, self.size)?;
        let exact_places = self::places(exact, self.size)?;
        let reflecting = places.iter().zip(&self.reflects);
        let reflecting: Places = reflecting
            .map(|(place, reflects)| place.filter(|_| *reflects))
            .collect();
        for (kind, places, truth) in [
            (ErrorKind::Algorithm, &places, &self.places),
            (ErrorKind::Rounding, &places, &exact_places),
            (ErrorKind::Model, &reflecting, &self.true_places),
        ] {
            let hits = compare(places, truth, self.size)?;
            insert(&mut judgement, kind, &hits);
        }
        let result = seen.result()?;
        let light = Picturing::Light;
        for (kind, truth) in [
            (ErrorKind::Rounding, exact.result()?),
            (ErrorKind::Algorithm, &self.picture),
        ] {
            colour_figures(&mut judgement, kind, light, result, truth)?;
        }
        judgement.picture = Some(Picture::of(result, light.look()));
        Ok(judgement)
    }
}

/// Where reflections were found: their length is not 0. Pixels that were not marched
/// themselves have the mean of the places of those around them that found one.
fn places(seen: &Observed, [width, height]: [u32; 2]) -> Result<Places, ObserveError> {
    let full = seen.texture("ssr/march", "result");
    let quarter = seen.texture("ssr/march quarter", "result");
    let (full, quarter) = match (full, quarter) {
        (full, Err(_)) => (Some(full?), None),
        (full, Ok(quarter)) => (full.ok(), Some(quarter)),
    };
    let found = |march: &Plane, [x, y]: [u32; 2]| {
        let [u, v, _, length] = *march.texels().get((march.size()[0] * y + x) as usize)?;
        (length > 0.0).then_some([u, v])
    };
    let between = |march: &Plane, at: [u32; 2]| {
        let [columns, rows] = [0, 1].map(|axis| {
            let near = at[axis] / 2;
            [near, (near + at[axis] % 2).min(march.size()[axis] - 1)]
        });
        let ends = rows.iter().flat_map(|&y| columns.map(|x| [x, y]));
        let around: Vec<[f64; 2]> = ends.filter_map(|at| found(march, at)).collect();
        let mean = |axis: usize| {
            let sum: f64 = around.iter().map(|place| place[axis]).sum();
            sum / around.len() as f64
        };
        (!around.is_empty()).then(|| [mean(0), mean(1)])
    };
    let place = |at: [u32; 2]| {
        let full = full.and_then(|march| found(march, at));
        full.or_else(|| between(quarter?, at))
    };
    Ok((0..height)
        .flat_map(|y| (0..width).map(move |x| [x, y]))
        .map(place)
        .collect())
}

fn insert(judgement: &mut Judgement, kind: ErrorKind, hits: &Hits) {
    let prefix = prefix(kind);
    let distance = |of: fn(&Distances) -> f64| hits.interior.distance.as_ref().map(of);
    let figures = [
        ("hit-median", distance(|distance| distance.median)),
        ("hit-95", distance(|distance| distance.p95)),
        ("hit-max", distance(|distance| distance.largest)),
        (
            "hit-silhouette",
            hits.silhouette.distance.map(|distance| distance.p95),
        ),
        ("precision", hits.all.precision()),
        ("recall", hits.all.recall()),
        ("located", hits.all.located()),
    ];
    for (id, value) in figures {
        if let Some(value) = value {
            judgement.errors.insert(format!("{prefix}.{id}"), value);
        }
    }
}

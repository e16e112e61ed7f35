//! Who is best for its time, by every metric, on every executor.

use std::collections::BTreeMap;

use crate::front::{Candidate, dominated, front};
use crate::model::{ErrorKind, Metric, Point, Spread, Subject, Sweep};

/// All kinds of error, as they are told.
pub(super) const KINDS: [(ErrorKind, &str, &str); 3] = [
    (
        ErrorKind::Rounding,
        "Rounding",
        "the same algorithm against itself in f64",
    ),
    (
        ErrorKind::Algorithm,
        "Algorithm",
        "against the exhaustive method on the same screen data, in f64",
    ),
    (ErrorKind::Model, "Model", "against the scene itself"),
];

/// The name of a kind.
pub(super) fn kind_name(kind: ErrorKind) -> &'static str {
    KINDS
        .iter()
        .find(|(known, _, _)| *known == kind)
        .map_or("", |(_, name, _)| name)
}

/// Places of the metrics of a kind, the main one first.
pub(super) fn metrics_of(subject: &Subject, kind: ErrorKind) -> impl Iterator<Item = usize> {
    (0..subject.metrics.len()).filter(move |&place| subject.metrics[place].kind == kind)
}

/// Whether a metric is the main one of its kind.
pub(super) fn is_main(subject: &Subject, metric: usize) -> bool {
    subject
        .metrics
        .get(metric)
        .is_some_and(|known| metrics_of(subject, known.kind).next() == Some(metric))
}

/// What a reader sees first: the main error of the algorithm, which is what settings
/// change, if it was measured.
pub(super) fn first_metric(subject: &Subject) -> Option<usize> {
    [ErrorKind::Algorithm, ErrorKind::Model, ErrorKind::Rounding]
        .into_iter()
        .find_map(|kind| metrics_of(subject, kind).next())
}

/// The standing of all points of a subject.
pub(super) struct Verdicts<'a> {
    /// By metric and executor: of each point whether it is on the front, and which
    /// is better.
    standings: BTreeMap<(usize, &'a str), Vec<Standing>>,
}

/// The standing of a point by one metric on one executor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Standing {
    pub(super) on_front: bool,
    /// The place of the point to take instead.
    pub(super) better: Option<usize>,
}

impl<'a> Verdicts<'a> {
    pub(super) fn new(sweep: &'a Sweep, subject: &'a Subject) -> Self {
        let mut standings = BTreeMap::new();
        for (place, metric) in subject.metrics.iter().enumerate() {
            for executor in &sweep.executors {
                let of_executor = standing(subject, metric, &executor.id);
                standings.insert((place, executor.id.as_str()), of_executor);
            }
        }
        Self { standings }
    }

    pub(super) fn of(&self, metric: usize, executor: &str, point: usize) -> Standing {
        self.standings
            .get(&(metric, executor))
            .and_then(|all| all.get(point))
            .copied()
            .unwrap_or_default()
    }

    /// How much better the other point is, in words.
    pub(super) fn comparison(
        &self,
        metric: &Metric,
        executor: &str,
        point: &Point,
        better: &Point,
    ) -> Option<String> {
        let (one, other) = (point.on(executor)?, better.on(executor)?);
        let (before, after) = (one.time.as_ref()?, other.time.as_ref()?);
        let time = match less(before.median, after.median) {
            None => "the same time".to_owned(),
            Some(share) if overlap(before, after) => {
                format!("{share} less time, within the spread")
            }
            Some(share) => format!("{share} less time"),
        };
        let (a, b) = (*one.errors.get(&metric.id)?, *other.errors.get(&metric.id)?);
        let error = if a == b {
            "the same result".to_owned()
        } else if metric.larger_is_better {
            format!(
                "{} instead of {}",
                crate::text::number(b),
                crate::text::number(a)
            )
        } else if b == 0.0 {
            "no error".to_owned()
        } else {
            less(a, b).map_or_else(
                || "less error".to_owned(),
                |share| format!("{share} less error"),
            )
        };
        Some(format!("{time}, {error}"))
    }
}

/// Whether the middle halves of two times have something in common.
fn overlap(a: &Spread, b: &Spread) -> bool {
    a.lower <= b.upper && b.lower <= a.upper
}

/// By what share the second is less than the first.
fn less(before: f64, after: f64) -> Option<String> {
    let share = 1.0 - after / before;
    if share.is_nan() || share <= 0.0 {
        return None;
    }
    Some(if share < 0.001 {
        "under 0.1 %".to_owned()
    } else if share < 0.0995 {
        format!("{:.1} %", share * 100.0)
    } else if share < 0.995 {
        format!("{:.0} %", share * 100.0)
    } else {
        "over 99 %".to_owned()
    })
}

/// The standing of each point among those of its arithmetic: which arithmetic to
/// take is decided by other reasons, so that a preset is not beaten by its own twin.
fn standing(subject: &Subject, metric: &Metric, executor: &str) -> Vec<Standing> {
    let mut standings = vec![Standing::default(); subject.points.len()];
    let mut arithmetics: BTreeMap<&str, Vec<(usize, Candidate)>> = BTreeMap::new();
    for (place, point) in subject.points.iter().enumerate() {
        let candidate = point
            .on(executor)
            .and_then(|outcome| Candidate::of(outcome, metric));
        if let Some(candidate) = candidate {
            let of_arithmetic = arithmetics.entry(&point.arithmetic).or_default();
            of_arithmetic.push((place, candidate));
        }
    }
    for points in arithmetics.into_values() {
        let candidates: Vec<Candidate> = points.iter().map(|(_, candidate)| *candidate).collect();
        for (number, (place, _)) in points.iter().enumerate() {
            standings[*place].better =
                dominated(&candidates, number).map(|better| points[better].0);
        }
        for number in front(&candidates) {
            standings[points[number].0].on_front = true;
        }
    }
    standings
}

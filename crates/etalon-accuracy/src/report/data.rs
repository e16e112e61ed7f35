//! What the page's script shows of a point, ready to be shown.

use std::collections::BTreeMap;

use serde::Serialize;

use super::verdict::{Verdicts, kind_name};
use crate::chart::{is_default, spread_text};
use crate::model::{Outcome, Point, Subject, Sweep};
use crate::text;

/// A subject.
#[derive(Serialize)]
struct Shown<'a> {
    /// Name and unit of each knob.
    knobs: Vec<[&'a str; 2]>,
    /// Kind and name of each metric.
    metrics: Vec<[&'a str; 2]>,
    executors: Vec<&'a str>,
    points: BTreeMap<&'a str, ShownPoint<'a>>,
}

#[derive(Serialize)]
struct ShownPoint<'a> {
    preset: Option<&'a str>,
    default: bool,
    arithmetic: &'a str,
    /// In the order of the knobs, then any others by name.
    settings: Vec<[String; 2]>,
    bytes: String,
    work: Vec<[String; 2]>,
    results: BTreeMap<&'a str, ShownOutcome>,
}

#[derive(Serialize)]
struct ShownOutcome {
    time: Option<String>,
    short: Option<String>,
    frames: u32,
    /// In the order of the metrics.
    errors: Vec<Option<String>>,
    /// Places of the metrics of whose front it is.
    front: Vec<usize>,
    /// Of each metric the point to take instead, and how much better it is.
    better: Vec<Option<[String; 2]>>,
    picture: Option<String>,
    difference: Option<String>,
}

/// As JSON that may stand in a script element.
pub(super) fn data(sweep: &Sweep, subject: &Subject, verdicts: &Verdicts<'_>) -> String {
    let shown = Shown {
        knobs: subject
            .knobs
            .iter()
            .map(|knob| [knob.name.as_str(), knob.unit.as_str()])
            .collect(),
        metrics: subject
            .metrics
            .iter()
            .map(|metric| [kind_name(metric.kind), metric.name.as_str()])
            .collect(),
        executors: sweep
            .executors
            .iter()
            .map(|executor| executor.id.as_str())
            .collect(),
        points: (subject.points.iter().enumerate())
            .map(|(place, point)| {
                (
                    point.id.as_str(),
                    shown_point(sweep, subject, verdicts, place, point),
                )
            })
            .collect(),
    };
    // Neither the end of the element nor a comment can be in there.
    serde_json::to_string(&shown)
        .unwrap_or_else(|_| "{}".to_owned())
        .replace('<', "\\u003c")
}

fn shown_point<'a>(
    sweep: &'a Sweep,
    subject: &'a Subject,
    verdicts: &Verdicts<'_>,
    place: usize,
    point: &'a Point,
) -> ShownPoint<'a> {
    let mut work = vec![
        [
            "texel fetches".to_owned(),
            text::count(point.work.texel_fetches),
        ],
        ["operations".to_owned(), text::count(point.work.operations)],
    ];
    if let Some(steps) = point.work.steps_per_ray {
        work.push(["steps per ray".to_owned(), text::number(steps)]);
    }
    ShownPoint {
        preset: point.preset.as_deref(),
        default: is_default(subject, point),
        arithmetic: &point.arithmetic,
        settings: in_order(subject, point),
        bytes: text::bytes(point.bytes),
        work,
        results: sweep
            .executors
            .iter()
            .filter_map(|executor| {
                let found = point.on(&executor.id)?;
                let id = executor.id.as_str();
                Some((
                    id,
                    shown_outcome(subject, verdicts, (place, point), id, found),
                ))
            })
            .collect(),
    }
}

/// Settings with their units, knobs in their order, then any others by name.
pub(super) fn in_order(subject: &Subject, point: &Point) -> Vec<[String; 2]> {
    let known = subject.knobs.iter().filter_map(|knob| {
        let value = point.settings.get(&knob.name)?;
        let value = if knob.unit.is_empty() {
            value.clone()
        } else {
            format!("{value} {}", knob.unit)
        };
        Some([knob.name.clone(), value])
    });
    let is_known = |name: &str| subject.knobs.iter().any(|knob| knob.name == name);
    let others = point
        .settings
        .iter()
        .filter(|(name, _)| !is_known(name))
        .map(|(name, value)| [name.clone(), value.clone()]);
    known.chain(others).collect()
}

fn shown_outcome(
    subject: &Subject,
    verdicts: &Verdicts<'_>,
    (place, point): (usize, &Point),
    executor: &str,
    found: &Outcome,
) -> ShownOutcome {
    let metrics = || subject.metrics.iter().enumerate();
    ShownOutcome {
        time: found.time.as_ref().map(spread_text),
        short: found.time.as_ref().map(|time| text::time(time.median)),
        frames: found.time.as_ref().map_or(0, |time| time.frames),
        errors: metrics()
            .map(|(_, metric)| {
                let error = found.errors.get(&metric.id)?;
                Some(text::quantity(*error, &metric.unit))
            })
            .collect(),
        front: metrics()
            .map(|(metric, _)| metric)
            .filter(|&metric| verdicts.of(metric, executor, place).on_front)
            .collect(),
        better: metrics()
            .map(|(number, metric)| {
                let better = verdicts.of(number, executor, place).better?;
                let better = subject.points.get(better)?;
                let how = verdicts.comparison(metric, executor, point, better)?;
                Some([better.id.clone(), how])
            })
            .collect(),
        picture: found.picture.as_deref().map(url),
        difference: found.difference.as_deref().map(url),
    }
}

/// A path relative to the page as an address: no part of it is taken for a scheme,
/// a query or a fragment.
pub(super) fn url(path: &str) -> String {
    let mut url = String::new();
    // From the page's folder, even where it starts with a slash.
    for byte in path.trim_start_matches('/').bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => {
                url.push(char::from(byte));
            }
            b'\\' => url.push('/'),
            other => url.push_str(&format!("%{other:02X}")),
        }
    }
    url
}

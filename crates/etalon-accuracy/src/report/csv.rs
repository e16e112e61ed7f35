//! The table for other programs.

use crate::chart::is_default;
use crate::model::{Outcome, Point, Subject, Sweep};

/// Every subject, point and executor as a row of comma-separated values (RFC 4180),
/// with all settings and errors. Columns of knobs are named `set:` and the knob,
/// columns of errors `error:` and the metric, in the order in which subjects have
/// them; cells that do not apply are empty. Times are in nanoseconds. A point that
/// nobody ran has one row, without an executor.
#[must_use]
pub fn csv(sweep: &Sweep) -> String {
    let mut knobs: Vec<&str> = Vec::new();
    let mut metrics: Vec<(&str, &str)> = Vec::new();
    for subject in &sweep.subjects {
        for knob in &subject.knobs {
            once(&mut knobs, knob.name.as_str());
        }
        for metric in &subject.metrics {
            once(&mut metrics, (&metric.id, &metric.unit));
        }
        // What nobody described is no less data.
        for point in &subject.points {
            for knob in point.settings.keys() {
                once(&mut knobs, knob);
            }
            for id in point.results.iter().flat_map(|all| all.errors.keys()) {
                if metrics.iter().all(|(known, _)| known != id) {
                    metrics.push((id, ""));
                }
            }
        }
    }
    let fixed = [
        "effect",
        "scene",
        "point",
        "preset",
        "default",
        "arithmetic",
        "executor",
        "api",
        "device",
        "driver",
        "time median [ns]",
        "time lower quartile [ns]",
        "time upper quartile [ns]",
        "frames",
        "bytes",
        "texel fetches",
        "operations",
        "steps per ray",
    ];
    let mut header: Vec<String> = fixed.map(str::to_owned).to_vec();
    header.extend(knobs.iter().map(|knob| format!("set:{knob}")));
    header.extend(metrics.iter().map(|(id, unit)| {
        if unit.is_empty() {
            format!("error:{id}")
        } else {
            format!("error:{id} [{unit}]")
        }
    }));
    header.extend(["picture", "difference"].map(str::to_owned));
    let mut text = String::new();
    push(&mut text, &header);
    let nobody = Outcome::default();
    for subject in &sweep.subjects {
        for point in &subject.points {
            if point.results.is_empty() {
                push(
                    &mut text,
                    &row(sweep, subject, point, &nobody, &knobs, &metrics),
                );
            }
            for outcome in &point.results {
                push(
                    &mut text,
                    &row(sweep, subject, point, outcome, &knobs, &metrics),
                );
            }
        }
    }
    text
}

fn once<T: PartialEq>(all: &mut Vec<T>, one: T) {
    if !all.contains(&one) {
        all.push(one);
    }
}

fn row(
    sweep: &Sweep,
    subject: &Subject,
    point: &Point,
    outcome: &Outcome,
    knobs: &[&str],
    metrics: &[(&str, &str)],
) -> Vec<String> {
    let executor = sweep
        .executors
        .iter()
        .find(|executor| executor.id == outcome.executor);
    let of = |part: fn(&crate::model::Executor) -> &String| {
        executor.map_or_else(String::new, |executor| part(executor).clone())
    };
    let time = |part: fn(&crate::model::Spread) -> String| {
        outcome.time.as_ref().map_or_else(String::new, part)
    };
    let mut row = vec![
        subject.effect.clone(),
        subject.scene.clone(),
        point.id.clone(),
        point.preset.clone().unwrap_or_default(),
        if is_default(subject, point) {
            "yes"
        } else {
            "no"
        }
        .to_owned(),
        point.arithmetic.clone(),
        outcome.executor.clone(),
        of(|executor| &executor.api),
        of(|executor| &executor.device),
        of(|executor| &executor.driver),
        time(|time| time.median.to_string()),
        time(|time| time.lower.to_string()),
        time(|time| time.upper.to_string()),
        time(|time| time.frames.to_string()),
        point.bytes.to_string(),
        point.work.texel_fetches.to_string(),
        point.work.operations.to_string(),
        point
            .work
            .steps_per_ray
            .map_or_else(String::new, |steps| steps.to_string()),
    ];
    let or_empty = |value: Option<String>| value.unwrap_or_default();
    row.extend(
        knobs
            .iter()
            .map(|knob| or_empty(point.settings.get(*knob).cloned())),
    );
    // A metric of another unit under the same id belongs to another subject.
    let has = |id: &str, unit: &str| {
        let mut known = subject.metrics.iter().filter(|metric| metric.id == id);
        known.next().map_or("", |metric| metric.unit.as_str()) == unit
    };
    row.extend(metrics.iter().map(|(id, unit)| {
        let error = outcome.errors.get(*id).filter(|_| has(id, unit));
        or_empty(error.map(ToString::to_string))
    }));
    row.push(or_empty(outcome.picture.clone()));
    row.push(or_empty(outcome.difference.clone()));
    row
}

/// A row; cells are quoted where they have to be.
fn push(text: &mut String, cells: &[String]) {
    for (place, cell) in cells.iter().enumerate() {
        if place > 0 {
            text.push(',');
        }
        if cell.contains([',', '"', '\n', '\r']) {
            text.push('"');
            text.push_str(&cell.replace('"', "\"\""));
            text.push('"');
        } else {
            text.push_str(cell);
        }
    }
    text.push_str("\r\n");
}

//! The table of all settings.

use std::fmt::Write;

use super::html::things;
use super::presets::{is_preset, name};
use super::verdict::{Verdicts, first_metric, is_main, kind_name};
use crate::chart::is_default;
use crate::model::{ErrorKind, Executor, Point, Subject, Sweep};
use crate::text::{bytes, count, escape, number, time};

/// A row for each point on each executor, to be sorted by any column.
pub(super) fn table(body: &mut String, sweep: &Sweep, subject: &Subject, verdicts: &Verdicts<'_>) {
    let _ = write!(
        body,
        "<details class=\"settings\" open>\n<summary><strong>All settings</strong> <span class=\"muted\">{}; a heading \
         sorts, a row shows its point</span></summary>\n\
         <div class=\"controls needs-script\"><label>Executor <select class=\"of-executor\"><option value=\"\">all</option>",
        things(subject.points.len(), "setting", "settings")
    );
    for executor in &sweep.executors {
        let id = escape(&executor.id);
        let _ = write!(body, "<option value=\"{id}\">{id}</option>");
    }
    body.push_str(
        "</select></label><label><input type=\"checkbox\" class=\"only-kept\"> Only what is best for its time, and presets</label></div>\n\
         <p class=\"print-only muted\">On paper only presets, the default, and what is best for its time by the first \
         error that the page shows; points.csv has all of them.</p>\n\
         <div class=\"scroll tall\"><table class=\"sortable\">\n<thead>\n<tr>",
    );
    let unknown = unknown_knobs(subject);
    // Heading and class.
    let mut columns: Vec<(String, &str)> = Vec::new();
    for heading in ["Setting", "Executor", "Arithmetic"] {
        columns.push((heading.to_owned(), ""));
    }
    columns.push(("Standing".to_owned(), ""));
    columns.push(("Time".to_owned(), "figure"));
    for metric in &subject.metrics {
        let unit = if metric.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", metric.unit)
        };
        columns.push((
            format!("{}: {}{unit}", kind_name(metric.kind), metric.name),
            "figure",
        ));
    }
    for knob in &subject.knobs {
        columns.push((with_unit(&knob.name, &knob.unit), "figure"));
    }
    for knob in &unknown {
        columns.push(((*knob).to_owned(), "figure"));
    }
    columns.push(("Memory".to_owned(), "figure"));
    for heading in ["Texel fetches", "Operations", "Steps per ray"] {
        columns.push((heading.to_owned(), "figure work"));
    }
    for (heading, class) in columns {
        let _ = write!(
            body,
            "<th scope=\"col\" class=\"{class}\"><button type=\"button\">{}</button></th>",
            escape(&heading)
        );
    }
    body.push_str("</tr>\n</thead>\n<tbody>\n");
    for (place, point) in subject.points.iter().enumerate() {
        for executor in &sweep.executors {
            if point.on(&executor.id).is_some() {
                row(body, subject, verdicts, executor, (place, point), &unknown);
            }
        }
    }
    body.push_str("</tbody>\n</table></div>\n</details>\n");
}

fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} [{unit}]")
    }
}

/// Knobs that points have set and the subject does not tell of.
fn unknown_knobs(subject: &Subject) -> Vec<&str> {
    let mut unknown: Vec<&str> = Vec::new();
    for knob in subject
        .points
        .iter()
        .flat_map(|point| point.settings.keys())
    {
        if subject.knobs.iter().all(|known| known.name != *knob)
            && !unknown.contains(&knob.as_str())
        {
            unknown.push(knob);
        }
    }
    unknown
}

fn row(
    body: &mut String,
    subject: &Subject,
    verdicts: &Verdicts<'_>,
    executor: &Executor,
    (place, point): (usize, &Point),
    unknown: &[&str],
) {
    let Some(found) = point.on(&executor.id) else {
        return;
    };
    let first = first_metric(subject);
    let best = first.is_some_and(|first| verdicts.of(first, &executor.id, place).on_front);
    let class = match (is_preset(subject, point), best) {
        (true, _) => " class=\"preset kept\"",
        (false, true) => " class=\"kept\"",
        (false, false) => "",
    };
    let preset = match (&point.preset, is_default(subject, point)) {
        (None, false) => String::new(),
        _ => format!(
            " <span class=\"badge plain\">{}</span>",
            escape(&name(subject, point))
        ),
    };
    let _ = write!(
        body,
        "<tr data-point=\"{id}\" data-executor=\"{executor}\"{}><th scope=\"row\"><button type=\"button\" class=\"show\">{id}</button>{preset}</th>\
         <td>{executor}</td><td>{}</td><td class=\"standing\">",
        class,
        escape(&point.arithmetic),
        id = escape(&point.id),
        executor = escape(&executor.id),
    );
    standing(body, subject, verdicts, executor, (place, point));
    body.push_str("</td>");
    match &found.time {
        Some(spread) => value(body, Some(spread.median), &time(spread.median)),
        None => value(body, None, "–"),
    }
    for metric in &subject.metrics {
        match found.errors.get(&metric.id) {
            Some(error) => value(body, Some(*error), &number(*error)),
            None => value(body, None, "–"),
        }
    }
    let knobs = subject.knobs.iter().map(|knob| knob.name.as_str());
    for knob in knobs.chain(unknown.iter().copied()) {
        let set = point.settings.get(knob).map_or("–", String::as_str);
        // Settings that are no numbers are sorted as texts.
        value(body, set.parse().ok(), set);
    }
    value(body, Some(point.bytes as f64), &bytes(point.bytes));
    let work = &point.work;
    for counter in [work.texel_fetches, work.operations] {
        cell(body, "figure work", Some(counter as f64), &count(counter));
    }
    let steps = work.steps_per_ray.map_or_else(|| "–".to_owned(), number);
    cell(body, "figure work", work.steps_per_ray, &steps);
    body.push_str("</tr>\n");
}

/// A figure with what it is sorted by.
fn value(body: &mut String, value: Option<f64>, text: &str) {
    cell(body, "figure", value, text);
}

/// A cell of a class.
fn cell(body: &mut String, class: &str, value: Option<f64>, text: &str) {
    let value = value.filter(|value| value.is_finite());
    let value = value.map_or_else(String::new, |value| format!(" data-value=\"{value:e}\""));
    let _ = write!(body, "<td class=\"{class}\"{value}>{}</td>", escape(text));
}

/// For each metric whether the point is best for its time, or dominated although it
/// is a preset; not by rounding, which nobody turns a knob to lessen. The page shows
/// that of the metric chosen.
fn standing(
    body: &mut String,
    subject: &Subject,
    verdicts: &Verdicts<'_>,
    executor: &Executor,
    (place, point): (usize, &Point),
) {
    for (number, metric) in subject.metrics.iter().enumerate() {
        let standing = verdicts.of(number, &executor.id, place);
        let main = if is_main(subject, number) {
            " main"
        } else {
            ""
        };
        let kind = kind_name(metric.kind).to_lowercase();
        let (class, text, title) = if standing.on_front {
            ("good", "best", String::new())
        } else if let Some(better) = standing
            .better
            .filter(|_| is_preset(subject, point) && metric.kind != ErrorKind::Rounding)
            .and_then(|better| subject.points.get(better))
        {
            let how = verdicts.comparison(metric, &executor.id, point, better);
            let title = format!("by {}: {}", better.id, how.unwrap_or_default());
            ("bad", "dominated", title)
        } else {
            continue;
        };
        let _ = write!(
            body,
            "<span class=\"badge {class}{main}\" data-metric=\"{number}\" title=\"{}\"><span class=\"of-kind\">{kind}: </span>{text}</span>",
            escape(&title)
        );
    }
}

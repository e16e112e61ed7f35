//! Presets and the default: whether they are worth having.

use std::fmt::Write;

use super::html::things;
use super::verdict::{KINDS, Verdicts, first_metric, metrics_of};
use crate::chart::{is_default, spread_text};
use crate::model::{ErrorKind, Executor, Point, Subject, Sweep};
use crate::text::{escape, quantity, time};

/// What has to be worth its time: presets, and what nobody set.
pub(super) fn is_preset(subject: &Subject, point: &Point) -> bool {
    point.preset.is_some() || is_default(subject, point)
}

/// Places of the presets that an executor ran, by arithmetic, then from the fastest.
fn presets_of(subject: &Subject, executor: &Executor) -> Vec<usize> {
    let median = |place: &usize| {
        let outcome = subject.points.get(*place)?.on(&executor.id)?;
        Some(outcome.time.as_ref()?.median)
    };
    let mut places: Vec<usize> = (0..subject.points.len())
        .filter(|&place| {
            let point = &subject.points[place];
            is_preset(subject, point) && point.on(&executor.id).is_some()
        })
        .collect();
    places.sort_by(|a, b| {
        // Strict before fast.
        let arithmetic = |place: usize| subject.points[place].arithmetic.as_str();
        let time = |place| median(place).unwrap_or(f64::INFINITY);
        (arithmetic(*b).cmp(arithmetic(*a))).then(time(a).total_cmp(&time(b)))
    });
    places
}

/// How many presets are dominated on any executor by the error shown first.
pub(super) fn badge(sweep: &Sweep, subject: &Subject, verdicts: &Verdicts<'_>) -> String {
    let Some(metric) = first_metric(subject) else {
        return "<span class=\"muted\">no errors measured</span>".to_owned();
    };
    let (mut all, mut dominated) = (0, 0);
    for (place, point) in subject.points.iter().enumerate() {
        if !is_preset(subject, point) {
            continue;
        }
        let standings = || {
            let executors = sweep.executors.iter();
            executors.map(|executor| verdicts.of(metric, &executor.id, place))
        };
        all += usize::from(standings().any(|one| one.on_front || one.better.is_some()));
        dominated += usize::from(standings().any(|one| one.better.is_some()));
    }
    match (all, dominated) {
        (0, _) => "<span class=\"muted\">no presets measured</span>".to_owned(),
        (_, 0) => format!(
            "<span class=\"badge good\">{} best for {} time</span>",
            things(all, "preset", "presets"),
            if all == 1 { "its" } else { "their" }
        ),
        _ => format!(
            "<span class=\"badge bad\">{dominated} of {} dominated</span>",
            things(all, "preset", "presets")
        ),
    }
}

/// The name of a point among presets.
pub(super) fn name(subject: &Subject, point: &Point) -> String {
    match (&point.preset, is_default(subject, point)) {
        (Some(preset), true) => format!("{preset}, default"),
        (Some(preset), false) => preset.clone(),
        (None, true) => "default".to_owned(),
        (None, false) => point.id.clone(),
    }
}

/// A row for each preset on each executor: its time, its main errors, and by which
/// it is beaten.
pub(super) fn table(body: &mut String, sweep: &Sweep, subject: &Subject, verdicts: &Verdicts<'_>) {
    let mains: Vec<usize> = KINDS
        .iter()
        .filter_map(|(kind, _, _)| metrics_of(subject, *kind).next())
        .collect();
    let rows: Vec<(&Executor, Vec<usize>)> = sweep
        .executors
        .iter()
        .map(|executor| (executor, presets_of(subject, executor)))
        .filter(|(_, places)| !places.is_empty())
        .collect();
    if rows.is_empty() {
        return;
    }
    body.push_str(
        "<h3>Presets</h3>\n<div class=\"scroll\"><table class=\"presets\">\n<thead><tr><th scope=\"col\">Executor</th>\
         <th scope=\"col\">Preset</th><th scope=\"col\">Arithmetic</th><th scope=\"col\" class=\"figure\">Time</th>",
    );
    for (kind, name, _) in KINDS {
        let metric = metrics_of(subject, kind).next();
        let metric = metric.map_or("not measured", |metric| &subject.metrics[metric].name);
        let _ = write!(body, "<th scope=\"col\">{name}: {}</th>", escape(metric));
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for (executor, places) in rows {
        for (row, &place) in places.iter().enumerate() {
            let point = &subject.points[place];
            let _ = write!(
                body,
                "<tr data-point=\"{}\" data-executor=\"{}\"{}>",
                escape(&point.id),
                escape(&executor.id),
                if row == 0 { " class=\"first\"" } else { "" }
            );
            if row == 0 {
                let _ = write!(
                    body,
                    "<th scope=\"rowgroup\" rowspan=\"{}\">{}</th>",
                    places.len(),
                    escape(&executor.id)
                );
            }
            let found = point.on(&executor.id);
            let spread = found.and_then(|outcome| outcome.time.as_ref());
            let _ = write!(
                body,
                "<th scope=\"row\">{}</th><td>{}</td><td class=\"figure\"{}>{}</td>",
                escape(&name(subject, point)),
                escape(&point.arithmetic),
                spread.map_or_else(String::new, |spread| {
                    format!(" title=\"{}\"", escape(&spread_text(spread)))
                }),
                spread.map_or_else(|| "–".to_owned(), |spread| time(spread.median)),
            );
            for (kind, _, _) in KINDS {
                let metric = mains
                    .iter()
                    .find(|&&metric| subject.metrics[metric].kind == kind);
                cell(body, subject, verdicts, executor, place, metric.copied());
            }
            body.push_str("</tr>\n");
        }
    }
    body.push_str("</tbody>\n</table></div>\n");
}

/// An error and what is better.
fn cell(
    body: &mut String,
    subject: &Subject,
    verdicts: &Verdicts<'_>,
    executor: &Executor,
    place: usize,
    metric: Option<usize>,
) {
    let point = &subject.points[place];
    let value = metric.and_then(|metric| {
        let known = subject.metrics.get(metric)?;
        let value = point.on(&executor.id)?.errors.get(&known.id)?;
        Some((metric, known, *value))
    });
    let Some((number, metric, value)) = value else {
        body.push_str("<td class=\"muted\">–</td>");
        return;
    };
    let standing = verdicts.of(number, &executor.id, place);
    let _ = write!(
        body,
        "<td><span class=\"value\">{}</span> ",
        escape(&quantity(value, &metric.unit))
    );
    if metric.kind == ErrorKind::Rounding {
        // Is to be small enough; nobody turns a knob to make it smaller.
    } else if standing.on_front {
        body.push_str("<span class=\"badge good\">best for its time</span>");
    } else if let Some(better) = standing
        .better
        .and_then(|better| subject.points.get(better))
    {
        let how = verdicts.comparison(metric, &executor.id, point, better);
        let _ = write!(
            body,
            "<span class=\"badge bad\">dominated</span> <span class=\"how\">by <a href=\"#\" class=\"to-point\" \
             data-point=\"{}\" data-executor=\"{}\">{}</a>: {}</span>",
            escape(&better.id),
            escape(&executor.id),
            escape(&name(subject, better)),
            escape(&how.unwrap_or_default()),
        );
    }
    body.push_str("</td>");
}

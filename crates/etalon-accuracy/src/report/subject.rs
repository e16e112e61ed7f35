//! One effect on one scene.

use std::fmt::Write;

use super::data::data;
use super::verdict::{KINDS, Verdicts, first_metric, is_main, kind_name, metrics_of};
use super::{presets, settings};
use crate::chart::{Chart, Place};
use crate::model::{Subject, Sweep};
use crate::text::{escape, quantity};

/// The whole section.
pub(super) fn section(
    body: &mut String,
    sweep: &Sweep,
    subject: &Subject,
    verdicts: &Verdicts<'_>,
    number: usize,
) {
    let _ = writeln!(
        body,
        "<section class=\"subject\" id=\"subject-{number}\">\n<h2>{} <span class=\"muted\">on</span> {}</h2>",
        escape(&subject.effect),
        escape(&subject.scene)
    );
    facts(body, subject);
    if subject.points.is_empty() {
        body.push_str("<p class=\"muted\">No setting was tried.</p>\n");
    }
    chooser(body, subject, number);
    body.push_str("<div class=\"look\">\n<div class=\"charts-of\">\n");
    for metric in 0..subject.metrics.len() {
        charts(body, sweep, subject, metric);
    }
    body.push_str(
        "</div>\n<aside class=\"panel needs-script\" aria-live=\"polite\"><p class=\"muted\">Point at a setting to see \
         all about it, or reach it with the Tab key. A click keeps it, Escape lets it go.</p></aside>\n</div>\n",
    );
    presets::table(body, sweep, subject, verdicts);
    settings::table(body, sweep, subject, verdicts);
    knobs(body, subject);
    metrics(body, subject);
    let _ = writeln!(
        body,
        "<script type=\"application/json\" class=\"data\">{}</script>\n</section>",
        data(sweep, subject, verdicts)
    );
}

/// What is true of the scene.
fn facts(body: &mut String, subject: &Subject) {
    if subject.facts.is_empty() {
        return;
    }
    body.push_str("<dl class=\"facts\">\n");
    for fact in &subject.facts {
        // A share is easier to grasp in percent.
        let value = if fact.unit.is_empty() && (0.0..=1.0).contains(&fact.value) {
            quantity(fact.value * 100.0, "%")
        } else {
            quantity(fact.value, &fact.unit)
        };
        let _ = writeln!(
            body,
            "<div><dt>{}</dt><dd>{}</dd></div>",
            escape(&fact.name),
            escape(&value)
        );
    }
    body.push_str("</dl>\n");
}

/// The choice of the error that is shown; all three kinds are named, measured or not.
fn chooser(body: &mut String, subject: &Subject, number: usize) {
    let first = first_metric(subject);
    let _ = write!(
        body,
        "<h3>Error against time</h3>\n<div class=\"controls needs-script\"><label for=\"metric-{number}\">Error</label>\
         <select id=\"metric-{number}\" class=\"metric\">"
    );
    for (kind, name, what) in KINDS {
        let _ = write!(body, "<optgroup label=\"{name}: {what}\">");
        let mut any = false;
        for place in metrics_of(subject, kind) {
            any = true;
            let metric = &subject.metrics[place];
            let _ = write!(
                body,
                "<option value=\"{place}\"{}>{}</option>",
                if Some(place) == first {
                    " selected"
                } else {
                    ""
                },
                escape(&metric.name)
            );
        }
        if !any {
            body.push_str("<option disabled>not measured</option>");
        }
        body.push_str("</optgroup>");
    }
    body.push_str("</select></div>\n");
    if first.is_none() {
        body.push_str("<p class=\"muted\">No error was measured.</p>\n");
    }
}

/// One error on all executors. Those that are not the main ones of their kind are
/// kept aside until somebody asks for them.
fn charts(body: &mut String, sweep: &Sweep, subject: &Subject, place: usize) {
    let Some(metric) = subject.metrics.get(place) else {
        return;
    };
    let main = is_main(subject, place);
    let first = first_metric(subject) == Some(place);
    if !main {
        let _ = write!(body, "<template data-metric=\"{place}\">");
    }
    let better = if metric.larger_is_better {
        " Larger is better; drawn is what is missing."
    } else {
        ""
    };
    let _ = writeln!(
        body,
        "<div class=\"charts{}{}\" data-metric=\"{place}\">\n<p class=\"about\"><strong>{}: {}</strong> \
         <span class=\"muted\">{}{better}</span></p>\n<div class=\"grid\">",
        if main { " main" } else { "" },
        if first { " selected" } else { "" },
        kind_name(metric.kind),
        escape(&metric.name),
        escape(&metric.description),
    );
    for executor in &sweep.executors {
        let chart = Chart::of(subject, metric, executor);
        if chart.marks.is_empty() {
            continue;
        }
        let _ = writeln!(
            body,
            "<figure class=\"chart\" data-executor=\"{}\">\n{}</figure>",
            escape(&executor.id),
            chart.svg(Place::Page)
        );
    }
    body.push_str("</div>\n</div>\n");
    if !main {
        body.push_str("</template>\n");
    }
}

/// What can be set.
fn knobs(body: &mut String, subject: &Subject) {
    if subject.knobs.is_empty() {
        return;
    }
    body.push_str(
        "<details open>\n<summary><strong>Settings explained</strong></summary>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\">Setting</th><th scope=\"col\" class=\"figure\">Default</th><th scope=\"col\">What it does</th></tr></thead>\n<tbody>\n",
    );
    for knob in &subject.knobs {
        let unit = if knob.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", knob.unit)
        };
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\">{}</th><td class=\"figure\">{}{}</td><td>{}</td></tr>",
            escape(&knob.name),
            escape(&knob.default),
            escape(&unit),
            escape(&knob.description)
        );
    }
    body.push_str("</tbody>\n</table></div>\n</details>\n");
}

/// What was measured.
fn metrics(body: &mut String, subject: &Subject) {
    body.push_str(
        "<details open>\n<summary><strong>Errors explained</strong></summary>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\">Kind</th><th scope=\"col\">Error</th><th scope=\"col\">Unit</th><th scope=\"col\">How it is measured</th></tr></thead>\n<tbody>\n",
    );
    for (kind, name, what) in KINDS {
        let mut any = false;
        for place in metrics_of(subject, kind) {
            any = true;
            let metric = &subject.metrics[place];
            let _ = writeln!(
                body,
                "<tr><th scope=\"row\" title=\"{what}\">{name}</th><td>{}</td><td>{}</td><td>{}{}</td></tr>",
                escape(&metric.name),
                escape(&metric.unit),
                escape(&metric.description),
                if metric.larger_is_better {
                    " Larger is better."
                } else {
                    ""
                }
            );
        }
        if !any {
            let _ = writeln!(
                body,
                "<tr><th scope=\"row\" title=\"{what}\">{name}</th><td colspan=\"3\" class=\"muted\">not measured</td></tr>"
            );
        }
    }
    body.push_str("</tbody>\n</table></div>\n</details>\n");
}

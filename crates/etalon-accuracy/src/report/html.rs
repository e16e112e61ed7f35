//! The page around the subjects.

use std::fmt::Write;

use super::verdict::{KINDS, Verdicts};
use super::{TABLE, presets, subject};
use crate::chart::STYLE as CHART_STYLE;
use crate::model::Sweep;
use crate::store::FILE;
use crate::text::{count, escape};

const PAGE: &str = include_str!("page.html");
/// Colours and rules of the page, which other reports share.
pub const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// The page. Pictures, the data and the table are looked for beside it.
#[must_use]
pub fn render(sweep: &Sweep) -> String {
    let mut body = String::new();
    header(&mut body, sweep);
    executors(&mut body, sweep);
    let verdicts: Vec<Verdicts<'_>> = sweep
        .subjects
        .iter()
        .map(|subject| Verdicts::new(sweep, subject))
        .collect();
    contents(&mut body, sweep, &verdicts);
    for (number, (subject, verdicts)) in sweep.subjects.iter().zip(&verdicts).enumerate() {
        subject::section(&mut body, sweep, subject, verdicts, number);
    }
    let style = format!("{}\n{CHART_STYLE}", STYLE.trim_end());
    page("What accuracy costs in time", &style, SCRIPT, &body)
}

/// A web page that needs nothing but itself: what reports of this project are put
/// into. The title is text, the others are as they stand in the page.
#[must_use]
pub fn page(title: &str, style: &str, script: &str, body: &str) -> String {
    // The body last: it may contain anything.
    PAGE.replace("{{title}}", &escape(title))
        .replace("{{style}}", style.trim_end())
        .replace("{{script}}", script.trim_end())
        .replace("{{body}}", body.trim_end())
}

/// A number of things.
pub(super) fn things(number: usize, one: &str, many: &str) -> String {
    let name = if number == 1 { one } else { many };
    format!("{} {name}", count(number as u64))
}

/// What this is and how to read it.
fn header(body: &mut String, sweep: &Sweep) {
    let settings: usize = sweep
        .subjects
        .iter()
        .map(|subject| subject.points.len())
        .sum();
    let [width, height] = sweep.size;
    let _ = write!(
        body,
        "<header>\n<h1>What accuracy costs in time</h1>\n\
         <p class=\"muted\">{width} × {height} pixels · {} · {} · {} · \
         <a href=\"{TABLE}\" download>table (CSV)</a> · <a href=\"{FILE}\" download>data (JSON)</a></p>\n\
         <p class=\"lead\">Every setting is a point: how long it takes, and how wrong it is. Lower left is better. \
         The lines join what is <em>best for its time</em>: nothing tried in the same arithmetic is as fast and less \
         wrong. Any other point is <em>dominated</em>: something else is no slower, no more wrong, and better in one \
         of both. Both axes are logarithmic; bars are the middle half of the times of all frames.</p>\n<dl class=\"kinds\">\n",
        things(sweep.subjects.len(), "subject", "subjects"),
        things(settings, "setting", "settings"),
        things(sweep.executors.len(), "executor", "executors"),
    );
    for (_, name, what) in KINDS {
        let _ = writeln!(body, "<div><dt>{name}</dt><dd>{what}</dd></div>");
    }
    body.push_str(
        "</dl>\n<p class=\"muted\">These three errors are told apart and never added up.</p>\n",
    );
    if !sweep.notes.is_empty() {
        body.push_str("<h2>Worth knowing</h2>\n<ul class=\"messages\">\n");
        for note in &sweep.notes {
            let _ = writeln!(body, "<li>{}</li>", escape(note.trim_end()));
        }
        body.push_str("</ul>\n");
    }
    body.push_str("</header>\n");
}

/// Who executed.
fn executors(body: &mut String, sweep: &Sweep) {
    body.push_str("<section>\n<h2>Executors</h2>\n");
    if sweep.executors.is_empty() {
        body.push_str("<p class=\"muted\">Nobody executed anything.</p>\n</section>\n");
        return;
    }
    body.push_str(
        "<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Executor</th><th scope=\"col\">Device</th>\
         <th scope=\"col\">API</th><th scope=\"col\">Driver</th></tr></thead>\n<tbody>\n",
    );
    for executor in &sweep.executors {
        let [id, device, api, driver] = [
            &executor.id,
            &executor.device,
            &executor.api,
            &executor.driver,
        ]
        .map(|text| escape(text));
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\">{id}</th><td>{device}</td><td>{api}</td><td>{driver}</td></tr>"
        );
    }
    body.push_str("</tbody>\n</table></div>\n</section>\n");
}

/// Links to the subjects, with what needs a decision.
fn contents(body: &mut String, sweep: &Sweep, verdicts: &[Verdicts<'_>]) {
    if sweep.subjects.is_empty() {
        body.push_str("<p class=\"muted\">There are no subjects.</p>\n");
        return;
    }
    body.push_str("<nav>\n<h2>Subjects</h2>\n<ul>\n");
    for (number, (subject, verdicts)) in sweep.subjects.iter().zip(verdicts).enumerate() {
        let _ = writeln!(
            body,
            "<li><a href=\"#subject-{number}\">{} on {}</a> <span class=\"muted\">{}</span> {}</li>",
            escape(&subject.effect),
            escape(&subject.scene),
            things(subject.points.len(), "setting", "settings"),
            presets::badge(sweep, subject, verdicts),
        );
    }
    body.push_str("</ul>\n</nav>\n");
}

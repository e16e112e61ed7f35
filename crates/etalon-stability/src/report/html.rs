//! The page.

use std::fmt::Write;

use crate::model::{CaseReport, ExecutorResult, Report, Status};
use crate::table::{sign, sort};
use crate::text::{escape, power};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// The whole page, the worst cases first.
#[must_use]
pub fn render(report: &Report) -> String {
    let mut body = String::new();
    header(&mut body, report);
    executors(&mut body, report);
    super::sites::sites(&mut body, report);
    cases(&mut body, report);
    refusals(&mut body, report);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Hard cases</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n{body}\
         <script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

fn header(body: &mut String, report: &Report) {
    let totals = report.totals;
    let verdict = if report.is_sound() {
        "<span class=\"badge\">nothing found</span>".to_owned()
    } else {
        let plural = if totals.findings == 1 { "" } else { "s" };
        format!(
            "<span class=\"badge bad\">{} finding{plural}</span>",
            totals.findings
        )
    };
    let _ = write!(
        body,
        "<header>\n<h1>Hard cases {verdict}</h1>\n\
         <p class=\"muted\">{} named cases · {} with their effects · {} executions · {} values beyond their \
         range</p>\n\
         <p class=\"lead\">Every effect on inputs that such effects are known to break on. All that any pass stores \
         has to be numbers; under strict arithmetic devices have to store the interpreter's bits; and <code>f32</code> \
         has to be near the <code>f64</code> that takes the same decisions. <em>Error</em> is the largest relative \
         one of all passes, beyond what rounding to the storage format explains; <em>otherwise</em> counts texels that \
         come out differently where <code>f64</code> decides for itself.</p>\n</header>\n",
        totals.cases, totals.pairs, totals.executions, totals.refusals,
    );
}

fn executors(body: &mut String, report: &Report) {
    body.push_str(
        "<h2>Executors</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>Executor</th><th>API</th>\
         <th>Device</th><th>Driver</th></tr></thead>\n<tbody>\n",
    );
    for one in &report.executors {
        let _ = writeln!(
            body,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&one.name),
            escape(&one.api),
            escape(&one.device),
            escape(&one.driver)
        );
    }
    body.push_str("</tbody>\n</table></div>\n");
    for note in &report.notes {
        let _ = writeln!(body, "<p class=\"muted\">{}</p>", escape(note));
    }
    for failure in &report.failures {
        let _ = writeln!(body, "<p class=\"findings\">{}</p>", escape(failure));
    }
}

fn cases(body: &mut String, report: &Report) {
    let mut cases: Vec<&CaseReport> = report.cases.iter().collect();
    sort(&mut cases);
    body.push_str(
        "<h2>Cases, the worst first</h2>\n<p><input id=\"filter\" type=\"search\" aria-label=\"Filter\" \
         placeholder=\"words of a case, effect or reason\"> <span id=\"shown\" class=\"muted\"></span></p>\n\
         <div class=\"scroll\"><table id=\"cases\">\n<thead><tr><th>Case</th><th>Effect</th><th>Error</th>\
         <th>99.9 %</th><th>Allowed</th><th>Otherwise</th><th>Unstable</th><th>Executors</th></tr></thead>\n<tbody>\n",
    );
    for case in cases {
        row(body, case);
    }
    body.push_str("</tbody>\n</table></div>\n");
}

fn row(body: &mut String, case: &CaseReport) {
    let shadow = case.results.iter().find(|one| one.rounding.is_some());
    let rounding = shadow.and_then(|one| one.rounding.as_ref());
    let figure = |error: Option<f64>| error.map_or_else(|| "–".to_owned(), power);
    let otherwise = rounding
        .map(|one| one.otherwise)
        .map_or_else(|| "–".to_owned(), |count| count.to_string());
    let _ = write!(
        body,
        "<tr{}><td><strong>{}</strong> <span class=\"muted\">{} × {}{}</span><br>{}<br>\
         <span class=\"muted\">{}</span>",
        if case.findings.is_empty() {
            ""
        } else {
            " class=\"bad\""
        },
        escape(&case.name),
        case.size[0],
        case.size[1],
        match case.frames {
            1 => String::new(),
            frames => format!(", {frames} frames"),
        },
        escape(&case.reason),
        escape(&case.source),
    );
    for (knob, value) in &case.knobs {
        let _ = write!(
            body,
            " <span class=\"badge\">{} = {}</span>",
            escape(knob),
            escape(value)
        );
    }
    if let Some(expected) = &case.expected {
        let _ = write!(
            body,
            "<br>up to {} is expected: {}",
            power(expected.bound),
            escape(&expected.reason)
        );
    }
    if !case.findings.is_empty() {
        body.push_str("<ul class=\"findings\">");
        for finding in &case.findings {
            let _ = write!(
                body,
                "<li>{}: {}</li>",
                escape(&finding.executor),
                escape(&finding.text)
            );
        }
        body.push_str("</ul>");
    }
    for one in &case.excused {
        let _ = write!(
            body,
            "<br><span class=\"muted\">{}: {}, {}</span>",
            escape(&one.finding.executor),
            escape(&one.reason),
            escape(&one.finding.text)
        );
    }
    let place = rounding.map_or_else(String::new, |one| {
        format!(" title=\"{}\"", escape(&one.at.to_string()))
    });
    let _ = writeln!(
        body,
        "</td><td>{}</td><td class=\"number\"{place}>{}</td><td class=\"number\">{}</td>\
         <td class=\"number\">{}</td><td class=\"number\">{otherwise}</td>{}<td>{}</td></tr>",
        escape(&case.effect),
        figure(rounding.map(|one| one.max)),
        figure(rounding.map(|one| one.p999)),
        figure(rounding.map(|one| one.allowed)),
        unstable(case),
        case.results.iter().map(badge).collect::<Vec<_>>().join(" "),
    );
}

/// Decisions that are not stable, and what they do.
fn unstable(case: &CaseReport) -> String {
    let counts = case.results.iter().find_map(|one| one.sanitised.as_ref());
    counts.map_or_else(
        || "<td class=\"number\">–</td>".to_owned(),
        |counts| {
            format!(
                "<td class=\"number\" title=\"{} comparisons, {} integers; {} of {} texels stored come out \
                 otherwise, by {} at most\">{}</td>",
                counts.unstable_branches,
                counts.unstable_indices,
                counts.effect.changed,
                counts.effect.texels,
                power(counts.effect.largest),
                counts.unstable_branches + counts.unstable_indices,
            )
        },
    )
}

fn badge(result: &ExecutorResult) -> String {
    let bad = result.non_finite.is_some()
        || result.difference.is_some()
        || result.rounding.as_ref().is_some_and(|one| one.beyond > 0)
        || matches!(result.status, Status::Failed { .. });
    let reason = match &result.status {
        Status::Unsupported { reason } | Status::Failed { reason } => {
            format!(" title=\"{}\"", escape(reason))
        }
        Status::Ran => String::new(),
    };
    format!(
        "<span class=\"badge{}\"{reason}>{}</span>",
        if bad { " bad" } else { "" },
        escape(&sign(result))
    )
}

fn refusals(body: &mut String, report: &Report) {
    if report.refusals.is_empty() {
        return;
    }
    let _ = write!(
        body,
        "<h2>Values beyond their range</h2>\n<details><summary>{} values, {} of them not refused</summary>\n\
         <div class=\"scroll\"><table>\n<thead><tr><th>Effect</th><th>Knob</th><th>Value</th><th>Answer</th></tr>\
         </thead>\n<tbody>\n",
        report.refusals.len(),
        report.accepted().count()
    );
    for one in &report.refusals {
        let _ = writeln!(
            body,
            "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            if one.error.is_some() {
                ""
            } else {
                " class=\"bad\""
            },
            escape(&one.effect),
            escape(&one.knob),
            escape(&one.value),
            escape(one.error.as_deref().unwrap_or("taken, which is a fault")),
        );
    }
    body.push_str("</tbody>\n</table></div>\n</details>\n");
}

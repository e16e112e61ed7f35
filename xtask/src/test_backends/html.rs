//! The report as a web page that needs nothing but itself and its pictures.

use std::fmt::Write;

use etalon_accuracy::report::{escape, page};

use super::model::{Case, ComparisonReport, Pictures, Report, Status};
use super::table::{milliseconds, number, percent, total_time};
use crate::compare::{Flip, Verdict};

const STYLE: &str = include_str!("../report/style.css");
const SCRIPT: &str = include_str!("../report/script.js");

/// The page. Pictures are looked for beside it.
#[must_use]
pub(super) fn render(report: &Report) -> String {
    let mut body = String::new();
    header(&mut body, report);
    executors(&mut body, report);
    contents(&mut body, report);
    for (number, case) in report.cases().into_iter().enumerate() {
        section(&mut body, report, case, number);
    }
    page("Backends compared", STYLE, SCRIPT, &body)
}

/// A list of messages, or nothing.
fn messages(body: &mut String, title: &str, messages: &[String]) {
    if messages.is_empty() {
        return;
    }
    let _ = writeln!(body, "<h3>{title}</h3>\n<ul class=\"messages\">");
    for message in messages {
        let _ = writeln!(body, "<li>{}</li>", escape(message.trim_end()));
    }
    body.push_str("</ul>\n");
}

/// Verdict, settings, problems.
fn header(body: &mut String, report: &Report) {
    let settings = &report.settings;
    let required: Vec<_> = settings.required.iter().map(ToString::to_string).collect();
    let (class, verdict) = if report.ok {
        (
            "good",
            format!(
                "All required backends ran and agree in {} comparisons.",
                report.comparisons.len()
            ),
        )
    } else {
        (
            "bad",
            "The required backends did not all run, or do not agree.".to_owned(),
        )
    };
    let _ = write!(
        body,
        "<header>\n<h1>Backends compared</h1>\n<p class=\"verdict {class}\">{verdict}</p>\n\
         <p class=\"muted\">{} × {} pixels · frames: {} · effects: {} · scenes: {} · arithmetic: {} · \
         required: {}</p>\n",
        settings.width,
        settings.height,
        settings.frames,
        escape(&settings.effects.join(", ")),
        escape(&settings.scenes.join(", ")),
        escape(&settings.arithmetic.join(", ")),
        escape(&required.join(", ")),
    );
    messages(body, "What is wrong", &report.problems);
    messages(body, "Worth knowing", &report.notes);
    body.push_str(
        "<p class=\"needs-script\"><label><input type=\"checkbox\" id=\"only-differing\"> \
         Show only outputs that differ</label></p>\n</header>\n",
    );
}

/// Who was there.
fn executors(body: &mut String, report: &Report) {
    body.push_str(
        "<section>\n<h2>Executors</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Executor</th>\
         <th scope=\"col\">State</th><th scope=\"col\">Device</th><th scope=\"col\">API</th>\
         <th scope=\"col\">Driver</th></tr></thead>\n<tbody>\n",
    );
    for executor in &report.executors {
        let (word, fault) = report.state(&executor.id);
        let class = if fault { " class=\"bad\"" } else { "" };
        let [name, api, driver] = report
            .device(&executor.id)
            .map_or([""; 3], |device| {
                [
                    device.device.as_str(),
                    device.api.as_str(),
                    device.driver.as_str(),
                ]
            })
            .map(escape);
        let _ = writeln!(
            body,
            "<tr{class}><th scope=\"row\">{}</th><td>{word}</td><td>{name}</td><td>{api}</td><td>{driver}</td></tr>",
            escape(&executor.id),
        );
    }
    body.push_str("</tbody>\n</table></div>\n</section>\n");
}

/// Links to the cases.
fn contents(body: &mut String, report: &Report) {
    body.push_str("<nav>\n<h2>Cases</h2>\n<ul>\n");
    for (number, case) in report.cases().into_iter().enumerate() {
        let passed = report
            .comparisons_of(case)
            .all(|comparison| comparison.verdict.passed());
        let compared = report.comparisons_of(case).count();
        let verdict = if compared == 0 {
            "<span class=\"muted\">nothing to compare</span>"
        } else {
            badge(passed)
        };
        let _ = writeln!(
            body,
            "<li><a href=\"#case-{number}\">{}</a> {verdict}</li>",
            escape(&case.to_string())
        );
    }
    body.push_str("</ul>\n</nav>\n");
}

/// All comparisons of one output: the same pass and binding in one case.
struct Output<'a> {
    id: String,
    comparisons: Vec<&'a ComparisonReport>,
}

impl Output<'_> {
    fn passed(&self) -> bool {
        self.comparisons
            .iter()
            .all(|comparison| comparison.verdict.passed())
    }

    fn differs(&self) -> bool {
        self.comparisons.iter().any(|comparison| {
            comparison
                .figures
                .as_ref()
                .is_none_or(|figures| figures.differing_texels > 0)
        })
    }
}

/// The outputs of a case in the order of steps.
fn outputs<'a>(report: &'a Report, case: &'a Case, number: usize) -> Vec<Output<'a>> {
    let mut outputs: Vec<Output<'a>> = Vec::new();
    for comparison in report.comparisons_of(case) {
        let same = |output: &&mut Output<'a>| {
            output.comparisons.iter().any(|other| {
                (&other.pass, &other.binding) == (&comparison.pass, &comparison.binding)
            })
        };
        match outputs.iter_mut().find(same) {
            Some(output) => output.comparisons.push(comparison),
            None => {
                let id = format!("case-{number}-output-{}", outputs.len());
                outputs.push(Output {
                    id,
                    comparisons: vec![comparison],
                });
            }
        }
    }
    outputs
}

/// One scene in one arithmetic.
fn section(body: &mut String, report: &Report, case: &Case, number: usize) {
    let outputs = outputs(report, case, number);
    let _ = writeln!(
        body,
        "<section>\n<h2 id=\"case-{number}\">{}</h2>",
        escape(&case.to_string())
    );
    overview(body, report, case, &outputs);
    for (position, output) in outputs.iter().enumerate() {
        // What went wrong is to be seen at once, and what came out in the end.
        let open = !output.passed() || position + 1 == outputs.len();
        details(body, output, open);
    }
    body.push_str("</section>\n");
}

/// The table of a case: a row for each output.
fn overview(body: &mut String, report: &Report, case: &Case, outputs: &[Output<'_>]) {
    let ran: Vec<_> = report
        .executors
        .iter()
        .filter_map(|executor| match &report.run(case, &executor.id)?.status {
            Status::Ran { times, .. } => Some((executor.id.as_str(), times)),
            _ => None,
        })
        .collect();
    body.push_str(
        "<div class=\"scroll\"><table>\n<caption>The largest figures of all pairs and frames; times in milliseconds \
         of the last frame.</caption>\n<thead><tr><th scope=\"col\">Pass</th><th scope=\"col\">Output</th>\
         <th scope=\"col\">Shape</th><th scope=\"col\">Verdict</th>",
    );
    for heading in ["Max ULP", "Mean ULP", "Differing", "FLIP"] {
        let _ = write!(body, "<th scope=\"col\" class=\"figure\">{heading}</th>");
    }
    for (id, _) in &ran {
        let _ = write!(
            body,
            "<th scope=\"col\" class=\"figure\">{}</th>",
            // A place to break the line.
            escape(id).replace('/', "/<wbr>")
        );
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for output in outputs {
        let Some(first) = output.comparisons.first() else {
            continue;
        };
        let class = if output.passed() {
            ""
        } else {
            " class=\"bad\""
        };
        let _ = write!(
            body,
            "<tr{class} data-differs=\"{}\"><th scope=\"row\"><a href=\"#{}\">{}</a></th><td>{}</td><td class=\"whole\">{}</td><td>{}</td>",
            output.differs(),
            output.id,
            escape(&first.pass),
            escape(&first.binding),
            escape(&first.shape),
            badge(output.passed()),
        );
        for figure in super::table::worst_of(&output.comparisons) {
            let _ = write!(body, "<td class=\"figure\">{}</td>", escape(&figure));
        }
        for (_, times) in &ran {
            let time = times.iter().find(|time| time.step == first.pass);
            let _ = write!(
                body,
                "<td class=\"figure\">{}</td>",
                time.map_or_else(|| "–".to_owned(), |time| milliseconds(time.nanoseconds))
            );
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody>\n<tfoot><tr><th scope=\"row\" colspan=\"8\">All passes</th>");
    for (id, _) in &ran {
        let total = total_time(report, case, id).map_or_else(|| "–".to_owned(), milliseconds);
        let _ = write!(body, "<td class=\"figure\">{total}</td>");
    }
    body.push_str("</tr></tfoot>\n</table></div>\n");
}

fn badge(passed: bool) -> &'static str {
    if passed {
        "<span class=\"badge good\">agree</span>"
    } else {
        "<span class=\"badge bad\">disagree</span>"
    }
}

/// One output: pictures, slider, figures.
fn details(body: &mut String, output: &Output<'_>, open: bool) {
    let Some(first) = output.comparisons.first() else {
        return;
    };
    let _ = writeln!(
        body,
        "<details class=\"output\" id=\"{}\" data-differs=\"{}\"{}>\n<summary><strong>{}</strong> <span>{}</span> \
         <span class=\"muted\">{}</span> {}</summary>\n<div>",
        output.id,
        output.differs(),
        if open { " open" } else { "" },
        escape(&first.pass),
        escape(&first.binding),
        escape(&first.shape),
        badge(output.passed()),
    );
    pictures(body, output);
    figures(body, output);
    body.push_str("</div>\n</details>\n");
}

/// Pictures side by side and under a slider. Of several frames the first that
/// fails is shown, else the last.
fn pictures(body: &mut String, output: &Output<'_>) {
    let failing = output
        .comparisons
        .iter()
        .filter(|comparison| !comparison.verdict.passed())
        .map(|failed| failed.frame)
        .min();
    let Some(frame) = failing.or_else(|| {
        output
            .comparisons
            .iter()
            .map(|comparison| comparison.frame)
            .max()
    }) else {
        return;
    };
    let shown: Vec<(&ComparisonReport, &Pictures)> = output
        .comparisons
        .iter()
        .filter(|comparison| comparison.frame == frame)
        .filter_map(|comparison| Some((*comparison, comparison.pictures.as_ref()?)))
        .collect();
    // The executors' pictures, each once; then the differences.
    let mut images: Vec<(String, String)> = Vec::new();
    let mut add = |name: String, path: &std::path::Path| {
        if images.iter().all(|(known, _)| *known != name) {
            images.push((name, path.to_string_lossy().into_owned()));
        }
    };
    for (comparison, pictures) in &shown {
        add(comparison.reference.clone(), &pictures.reference);
        add(comparison.subject.clone(), &pictures.subject);
    }
    for (comparison, pictures) in &shown {
        if let Some(difference) = &pictures.difference {
            add(
                format!("{} − {}", comparison.subject, comparison.reference),
                difference,
            );
        }
    }
    let [(first, first_path), .., (_, _)] = images.as_slice() else {
        body.push_str("<p class=\"muted\">Not an image, or no pictures were made.</p>\n");
        return;
    };
    let _ = writeln!(
        body,
        "<h3>Side by side, frame {frame}</h3>\n<div class=\"pictures\">"
    );
    for (name, path) in &images {
        let (name, path) = (escape(name), escape(path));
        let _ = writeln!(
            body,
            "<figure><a href=\"{path}\"><img src=\"{path}\" alt=\"{name}\" loading=\"lazy\"></a>\
             <figcaption>{name}</figcaption></figure>"
        );
    }
    if shown
        .iter()
        .all(|(_, pictures)| pictures.difference.is_none())
    {
        body.push_str(
            "<div class=\"nothing\">No difference: every executor gave the same bits.</div>\n",
        );
    } else {
        body.push_str(
            "</div>\n<p class=\"muted\">Differences: black is equal, blue 1 ULP, red thousands, white 2²⁴ and more, \
             magenta a NaN or infinity.</p>\n<div class=\"pictures\">\n",
        );
    }
    body.push_str("</div>\n");
    // What is worth a look against the reference: the first that disagrees.
    let suspect = shown
        .iter()
        .find(|(comparison, _)| !comparison.verdict.passed());
    let (second, second_path) = images
        .iter()
        .find(|(name, _)| suspect.is_some_and(|(comparison, _)| comparison.subject == *name))
        .or(images.get(1))
        .map_or((first, first_path), |(name, path)| (name, path));
    let options = |selected: &str| {
        images
            .iter()
            .fold(String::new(), |mut options, (name, path)| {
                let selected = if name == selected { " selected" } else { "" };
                let _ = write!(
                    options,
                    "<option value=\"{}\"{selected}>{}</option>",
                    escape(path),
                    escape(name)
                );
                options
            })
    };
    let _ = writeln!(
        body,
        "<div class=\"wipe needs-script\">\n<h3>Wipe</h3>\n<div class=\"controls\"><label>Left <select>{}</select></label>\
         <label>Right <select>{}</select></label></div>\n<div class=\"stage\"><img src=\"{}\" alt=\"{}\" loading=\"lazy\">\
         <img class=\"over\" src=\"{}\" alt=\"{}\" loading=\"lazy\"></div>\n\
         <input class=\"slider\" type=\"range\" min=\"0\" max=\"100\" step=\"0.1\" value=\"50\" \
         aria-label=\"Border between the two pictures\">\n</div>",
        options(first),
        options(second),
        escape(first_path),
        escape(first),
        escape(second_path),
        escape(second),
    );
}

/// Every pair and frame in numbers.
fn figures(body: &mut String, output: &Output<'_>) {
    body.push_str("<h3>Figures</h3>\n<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Executor</th><th scope=\"col\">Against</th>");
    for heading in [
        "Frame",
        "Max ULP",
        "Mean ULP",
        "Differing",
        "Largest difference",
        "FLIP",
        "Not finite",
    ] {
        let _ = write!(body, "<th scope=\"col\" class=\"figure\">{heading}</th>");
    }
    body.push_str("<th scope=\"col\">Worst texel</th><th scope=\"col\">Tolerance</th><th scope=\"col\">Verdict</th></tr></thead>\n<tbody>\n");
    for comparison in &output.comparisons {
        let class = if comparison.verdict.passed() {
            ""
        } else {
            " class=\"bad\""
        };
        let _ = write!(
            body,
            "<tr{class}><th scope=\"row\">{}</th><td>{}</td><td class=\"figure\">{}</td>",
            escape(&comparison.subject),
            escape(&comparison.reference),
            comparison.frame,
        );
        match &comparison.figures {
            Some(figures) => {
                let flip = match &figures.flip {
                    Flip::Mean(mean) => number((*mean).into()),
                    Flip::Skipped(why) => format!("– ({why})"),
                };
                let _ = write!(
                    body,
                    "<td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td>\
                     <td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{} / {}</td><td>{}</td>",
                    figures.max_ulp,
                    number(figures.mean_ulp),
                    percent(figures.differing_share),
                    number(figures.max_abs),
                    escape(&flip),
                    figures.non_finite_subject,
                    figures.non_finite_reference,
                    figures
                        .worst
                        .map_or_else(String::new, |worst| escape(&worst.to_string())),
                );
            }
            None => body.push_str("<td colspan=\"7\">–</td>"),
        }
        let verdict = match &comparison.verdict {
            Verdict::Pass => badge(true).to_owned(),
            Verdict::Fail(why) => format!("{} {}", badge(false), escape(why)),
        };
        let _ = writeln!(
            body,
            "<td title=\"{}\">{}</td><td>{verdict}</td></tr>",
            escape(&comparison.tolerance_reason),
            escape(&comparison.tolerance.summary()),
        );
    }
    body.push_str("</tbody>\n</table></div>\n");
    if let Some(first) = output.comparisons.first() {
        let _ = writeln!(
            body,
            "<p class=\"muted\">Tolerance: {}.</p>",
            escape(&first.tolerance_reason)
        );
    }
}

//! The plan as a web page that needs nothing but itself.

use std::fmt::Write;

use etalon_accuracy::report::{bytes, count, escape, page};

use super::model::{Report, is_backends, on_screen, rows};
use super::svg;
use super::text::{why, work};

const STYLE: &str = include_str!("style.css");

/// The page.
pub(super) fn render(report: &Report) -> String {
    let mut body = String::new();
    header(&mut body, report);
    effects(&mut body, report);
    graph(&mut body, report);
    memory(&mut body, report);
    passes(&mut body, report);
    counters(&mut body, report);
    page(&format!("Plan of {}", report.scene), STYLE, "", &body)
}

fn header(body: &mut String, report: &Report) {
    let [width, height] = report.size;
    let runs = report.plan.effects.iter();
    let runs = runs.filter(|effect| effect.decision.is_run()).count();
    let _ = write!(
        body,
        "<header>\n<h1>Plan of {}</h1>\n<p class=\"muted\">{width} × {height} pixels · {} preset · {} \
         arithmetic · {} passes · {runs} of {} effects and parts of effects run · {} of transient \
         memory</p>\n<h2>On the screen</h2>\n<dl>\n",
        escape(&report.scene),
        escape(&report.preset),
        report.plan.arithmetic,
        report.counters.passes,
        report.plan.effects.len(),
        escape(&bytes(report.memory.planned)),
    );
    for (what, where_) in on_screen(&report.demands) {
        let _ = writeln!(
            body,
            "<div><dt>{what}</dt><dd>{}</dd></div>",
            escape(&where_)
        );
    }
    body.push_str("</dl>\n</header>\n");
}

fn effects(body: &mut String, report: &Report) {
    let colours = svg::colours(&report.plan);
    body.push_str(
        "<section>\n<h2>Effects</h2>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\">Effect</th><th scope=\"col\">Decision</th><th scope=\"col\">Why</th>\
         <th scope=\"col\" class=\"figure\">Passes</th></tr></thead>\n<tbody>\n",
    );
    for effect in &report.plan.effects {
        let (class, word) = match effect.decision.is_run() {
            true => ("good", "runs"),
            false => ("plain", "absent"),
        };
        let own = effect.name.split('/').next().unwrap_or_default();
        let key = if colours.contains_key(own) && effect.decision.is_run() {
            format!("<span class=\"key {}\"></span>", svg::class(&colours, own))
        } else {
            "<span class=\"key none\"></span>".to_owned()
        };
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\">{key}{}</th><td><span class=\"badge {class}\">{word}</span></td>\
             <td>{}</td><td class=\"figure\">{}</td></tr>",
            escape(&effect.name),
            escape(effect.decision.reason()),
            effect.passes
        );
    }
    body.push_str("</tbody>\n</table></div>\n</section>\n");
}

fn graph(body: &mut String, report: &Report) {
    body.push_str(
        "<section class=\"wide\">\n<h2>Passes</h2>\n<p class=\"muted\">From top to bottom: what \
         comes in, the passes in layers below all that they read, what goes out. Lines and boxes \
         tell more where the pointer rests.</p>\n<div class=\"scroll\">\n",
    );
    body.push_str(&svg::graph(&report.plan));
    body.push_str("</div>\n</section>\n");
}

fn memory(body: &mut String, report: &Report) {
    let memory = &report.memory;
    let _ = write!(
        body,
        "<section class=\"wide\">\n<h2>Transient memory</h2>\n<dl class=\"facts\">\n\
         <div><dt>planned</dt><dd>{}</dd></div>\n<div><dt>largest set alive at once</dt>\
         <dd>{}</dd></div>\n<div><dt>over that</dt><dd>{:.1} %</dd></div>\n\
         <div><dt>by whole resources</dt><dd>{}</dd></div>\n<div><dt>without aliasing</dt>\
         <dd>{}</dd></div>\n</dl>\n",
        escape(&bytes(memory.planned)),
        escape(&bytes(memory.least)),
        100.0 * memory.excess(),
        escape(&bytes(memory.slots)),
        escape(&bytes(memory.unaliased)),
    );
    if memory.planned > 0 {
        body.push_str(
            "<p class=\"muted\">Which bytes each resource has, and from which step to which; \
             coloured by the effect that writes it first. The line is what is alive in \
             all.</p>\n<div class=\"scroll\">\n",
        );
        body.push_str(&svg::memory(report));
        body.push_str("</div>\n");
    }
    body.push_str("</section>\n");
}

fn passes(body: &mut String, report: &Report) {
    let plan = &report.plan;
    body.push_str(
        "<section>\n<h2>Why each pass runs</h2>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\" class=\"figure\">Step</th><th scope=\"col\">Pass</th>\
         <th scope=\"col\">Effect</th><th scope=\"col\">Does</th><th scope=\"col\">Why</th>\
         <th scope=\"col\" class=\"figure\">Barriers</th></tr></thead>\n<tbody>\n",
    );
    for (index, step) in plan.steps.iter().enumerate() {
        let _ = writeln!(
            body,
            "<tr><td class=\"figure\">{index}</td><th scope=\"row\">{}</th><td>{}</td><td>{}</td>\
             <td>{}</td><td class=\"figure\">{}</td></tr>",
            escape(&step.name),
            escape(&step.effect),
            escape(&work(step)),
            escape(&why(step)),
            step.barriers.len()
        );
    }
    body.push_str("</tbody>\n</table></div>\n");
    if !plan.culled.is_empty() {
        body.push_str("<h3>Declared, but not run</h3>\n<ul>\n");
        for pass in &plan.culled {
            let _ = writeln!(
                body,
                "<li><b>{}</b>: {}</li>",
                escape(&pass.name),
                escape(&pass.reason)
            );
        }
        body.push_str("</ul>\n");
    }
    body.push_str("</section>\n");
}

fn counters(body: &mut String, report: &Report) {
    body.push_str(
        "<section>\n<h2>Counters</h2>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\"></th><th scope=\"col\" class=\"figure\">Plan</th>",
    );
    for run in &report.measured {
        let _ = write!(
            body,
            "<th scope=\"col\" class=\"figure\" title=\"{}\">{}</th>",
            escape(&run.backend.to_string()),
            escape(run.backend.backend)
        );
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for (row, (name, value)) in rows(&report.counters).iter().enumerate() {
        if is_backends(name) && report.measured.is_empty() {
            continue;
        }
        let told = match is_backends(name) {
            true => "–".to_owned(),
            false => count(*value),
        };
        let _ = write!(
            body,
            "<tr><th scope=\"row\">{name}</th><td class=\"figure\">{told}</td>"
        );
        for run in &report.measured {
            let _ = write!(
                body,
                "<td class=\"figure\">{}</td>",
                count(rows(&run.counters)[row].1)
            );
        }
        body.push_str("</tr>\n");
    }
    let _ = writeln!(
        body,
        "<tr><th scope=\"row\">shader files parsed</th><td class=\"figure\">{}</td></tr>\n\
         </tbody>\n</table></div>\n</section>",
        report.parsed
    );
}

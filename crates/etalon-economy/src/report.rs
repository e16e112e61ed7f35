//! The report: a web page that needs nothing but itself, and the data beside it.

use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

use etalon_accuracy::model::{Executor, Spread};
use etalon_accuracy::report::{STYLE, escape, page};
use etalon_accuracy::text::{bytes, number, time};
use thiserror::Error;

use crate::chart;
use crate::model::{Economy, LackingFrame, Sweep};
use crate::table::percent;

/// The page's name in the folder of a report.
pub const PAGE: &str = "index.html";
/// The name of the data beside it.
pub const DATA: &str = "economy.json";

const OWN_STYLE: &str = include_str!("report.css");

/// Why nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file or folder cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The data cannot be put into words.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// Writes the page and the data into a folder, which is made if there is none; the
/// page's path.
///
/// # Errors
/// If something cannot be written.
pub fn write(economy: &Economy, folder: &Path) -> Result<PathBuf, ReportError> {
    make(folder)?;
    write_text(&folder.join(DATA), &json(economy)?)?;
    let path = folder.join(PAGE);
    write_text(&path, &render(economy))?;
    Ok(path)
}

/// What was found, as JSON.
///
/// # Errors
/// If a number is none that JSON has.
pub fn json(economy: &Economy) -> Result<String, ReportError> {
    let mut text = serde_json::to_string_pretty(economy)?;
    text.push('\n');
    Ok(text)
}

/// Writes text to a file.
///
/// # Errors
/// If it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), ReportError> {
    std::fs::write(path, text).map_err(|source| ReportError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Writes the chart of each executor into a folder, which is made if there is none.
///
/// # Errors
/// If something cannot be written.
pub fn charts(economy: &Economy, folder: &Path) -> Result<(), ReportError> {
    make(folder)?;
    for executor in &economy.executors {
        let chart = chart::svg(&title(executor), &economy.of(&executor.id), true);
        write_text(&folder.join(format!("economy-{}.svg", executor.id)), &chart)?;
    }
    Ok(())
}

fn make(folder: &Path) -> Result<(), ReportError> {
    std::fs::create_dir_all(folder).map_err(|source| ReportError::Io {
        path: folder.to_owned(),
        source,
    })
}

fn title(executor: &Executor) -> String {
    if executor.device.is_empty() {
        executor.id.clone()
    } else {
        format!("{} · {}", executor.id, executor.device)
    }
}

/// The page.
#[must_use]
pub fn render(economy: &Economy) -> String {
    let mut body = String::new();
    header(&mut body, economy);
    for executor in &economy.executors {
        let (sweeps, title) = (economy.of(&executor.id), title(executor));
        let _ = writeln!(
            body,
            "<section class=\"executor\">\n<h2>{}</h2>\n<p class=\"muted\">{} · {}</p>\n<figure class=\"chart\">\n{}</figure>",
            escape(&title),
            escape(&executor.api),
            escape(&executor.driver),
            chart::svg(&title, &sweeps, false)
        );
        conclusions(&mut body, &sweeps);
        points(&mut body, &sweeps);
        body.push_str("</section>\n");
    }
    frames(&mut body, economy);
    let style = format!(
        "{}\n{}\n{OWN_STYLE}",
        STYLE.trim_end(),
        chart::STYLE.trim_end()
    );
    page(
        "What effects cost by the screen they concern",
        &style,
        "",
        &body,
    )
}

fn header(body: &mut String, economy: &Economy) {
    let [width, height] = economy.size;
    let _ = write!(
        body,
        "<header>\n<h1>What effects cost by the screen they concern</h1>\n\
         <p class=\"muted\">Reflections on {} · {width} × {height} pixels · <a href=\"{DATA}\" download>data (JSON)</a></p>\n\
         <p class=\"lead\">A share of the screen mirrors, from none of it to all: a rectangle around the middle \
         (<em>compact</em>), or squares of 16 × 16 texels strewn over it (<em>scattered</em>). On tiles, what shows \
         nothing mirrored is only copied; the picture is the same, bit for bit, which was checked for every point. \
         The line is <code>t = a + b · share</code> by least squares: <em>a</em> is what reflections cost where \
         there are none, and where the line meets the time on the whole picture it is better to do without tiles. What takes the time is the \
         share that is <em>marched</em>, tiles around rough ones included; over that the time is a line in either \
         layout. \
         Bars are the middle half of the times of all frames.</p>\n",
        escape(&economy.scene)
    );
    if !economy.notes.is_empty() {
        body.push_str("<h2>Worth knowing</h2>\n<ul class=\"messages\">\n");
        for note in &economy.notes {
            let _ = writeln!(body, "<li>{}</li>", escape(note));
        }
        body.push_str("</ul>\n");
    }
    body.push_str("</header>\n");
}

fn conclusions(body: &mut String, sweeps: &[&Sweep]) {
    body.push_str(
        "<div class=\"scroll\"><table class=\"conclusions\">\n<thead><tr><th scope=\"col\">Layout</th>\
         <th class=\"figure\" scope=\"col\">Idle, a</th><th class=\"figure\" scope=\"col\">of the whole</th>\
         <th class=\"figure\" scope=\"col\">Slope, b</th><th class=\"figure\" scope=\"col\">R²</th>\
         <th class=\"figure\" scope=\"col\">Classification</th><th class=\"figure\" scope=\"col\">Whole</th>\
         <th class=\"figure\" scope=\"col\">Tiles are faster below, mirroring</th>\
         <th class=\"figure\" scope=\"col\">Marched: idle</th><th class=\"figure\" scope=\"col\">slope</th>\
         <th class=\"figure\" scope=\"col\">R²</th><th class=\"figure\" scope=\"col\">Tiles are faster below, marched</th>\
         <th scope=\"col\">Aims</th></tr></thead>\n<tbody>\n",
    );
    for sweep in sweeps {
        let classification = sweep.points.iter().map(|point| point.classification.median);
        let classification = classification.fold(0.0, f64::max);
        let whole = sweep.cost.whole;
        let of_whole = if whole > 0.0 {
            percent(sweep.fit.intercept / whole)
        } else {
            "?".to_owned()
        };
        let aims: Vec<String> = sweep
            .targets()
            .into_iter()
            .map(|(aim, ratio, met)| {
                let class = if met { "good" } else { "bad" };
                format!(
                    "<span class=\"badge {class}\">{aim}: {}</span>",
                    percent(ratio)
                )
            })
            .collect();
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\">{}</th><td class=\"figure\">{}</td><td class=\"figure\">{of_whole}</td>\
             <td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td>\
             <td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td>\
             <td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td><td>{}</td></tr>",
            sweep.layout,
            time(sweep.fit.intercept),
            time(sweep.fit.slope),
            number(sweep.fit.r_squared),
            time(classification),
            time(whole),
            percent(sweep.crossover()),
            time(sweep.cost.idle),
            time(sweep.cost.slope),
            number(sweep.work.r_squared),
            percent(sweep.cost.crossover()),
            aims.join(" "),
        );
    }
    body.push_str("</tbody>\n</table></div>\n");
}

fn points(body: &mut String, sweeps: &[&Sweep]) {
    body.push_str(
        "<details>\n<summary>Every point</summary>\n<div class=\"scroll\"><table class=\"points\">\n<thead><tr>\
         <th scope=\"col\">Layout</th><th class=\"figure\" scope=\"col\">Mirroring</th>\
         <th class=\"figure\" scope=\"col\">In marched tiles</th><th class=\"figure\" scope=\"col\">On tiles</th>\
         <th class=\"figure\" scope=\"col\">Classification</th><th class=\"figure\" scope=\"col\">Whole</th>\
         <th class=\"figure\" scope=\"col\">Ratio</th></tr></thead>\n<tbody>\n",
    );
    for sweep in sweeps {
        for point in &sweep.points {
            let _ = writeln!(
                body,
                "<tr><td>{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td>\
                 <td class=\"figure\">{}</td><td class=\"figure\">{}</td><td class=\"figure\">{}</td></tr>",
                sweep.layout,
                percent(point.coverage),
                percent(point.marched),
                quartiles(&point.tiled),
                quartiles(&point.classification),
                quartiles(&point.whole),
                percent(point.ratio.median),
            );
        }
    }
    body.push_str("</tbody>\n</table></div>\n</details>\n");
}

fn quartiles(times: &Spread) -> String {
    format!(
        "{} <span class=\"muted\">({}–{})</span>",
        time(times.median),
        time(times.lower),
        time(times.upper)
    )
}

fn frames(body: &mut String, economy: &Economy) {
    let Some(full) = economy.frames.first() else {
        return;
    };
    body.push_str(
        "<section>\n<h2>Whole frames that lack something</h2>\n<p class=\"lead\">Reflections, exposure, bloom and \
         composite, of a scene in which all have something to do, and of the same without one thing.</p>\n\
         <div class=\"scroll\"><table class=\"frames\">\n<thead><tr><th scope=\"col\">It lacks</th>\
         <th class=\"figure\" scope=\"col\">Dispatches</th><th class=\"figure\" scope=\"col\">Transient memory</th>",
    );
    for (executor, _) in &full.times {
        let _ = write!(
            body,
            "<th class=\"figure\" scope=\"col\">{}</th>",
            escape(executor)
        );
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for frame in &economy.frames {
        let _ = write!(
            body,
            "<tr><th scope=\"row\">{}<br><span class=\"muted\">{}</span></th><td class=\"figure\">{}</td>\
             <td class=\"figure\">{}</td>",
            escape(&frame.lacking),
            escape(&frame.why),
            frame.dispatches,
            bytes(frame.bytes)
        );
        for (executor, times) in &frame.times {
            let _ = write!(
                body,
                "<td class=\"figure\">{}<br><span class=\"muted\">{}</span></td>",
                time(times.median),
                of_full(full, executor, times)
            );
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody>\n</table></div>\n</section>\n");
}

/// A frame's time as a share of that of the frame that lacks nothing.
fn of_full(full: &LackingFrame, executor: &str, times: &Spread) -> String {
    let mut all = full.times.iter();
    match all.find(|(known, _)| known == executor) {
        Some((_, full)) if full.median > 0.0 => percent(times.median / full.median),
        _ => String::new(),
    }
}

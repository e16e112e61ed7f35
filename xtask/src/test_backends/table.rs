//! The report as text for a terminal.

use std::fmt::Write;

use super::model::{Case, ComparisonReport, Report, Status};
use crate::compare::{Comparison, Flip, Ulps};

/// The whole report.
#[must_use]
pub(super) fn render(report: &Report) -> String {
    let mut text = String::new();
    executors(&mut text, report);
    for case in report.cases() {
        passes(&mut text, report, case);
    }
    if !report.notes.is_empty() {
        text += "\nNotes\n";
        for note in &report.notes {
            let _ = writeln!(text, "  {}", indent(note));
        }
    }
    text += "\n";
    if report.ok {
        let compared = report.comparisons.len();
        let _ = writeln!(
            text,
            "OK: all required backends ran and agree ({compared} comparisons)."
        );
    } else {
        text += "NOT OK\n";
        for problem in &report.problems {
            let _ = writeln!(text, "  {}", indent(problem));
        }
    }
    text
}

/// Keeps the lines of a message together under their first.
fn indent(message: &str) -> String {
    message.trim_end().replace('\n', "\n    ")
}

/// The list of executors, numbered for the tables below it.
fn executors(text: &mut String, report: &Report) {
    text.push_str("Executors\n");
    let mut rows = Vec::new();
    for (number, executor) in report.executors.iter().enumerate() {
        let device = report.device(&executor.id);
        rows.push(vec![
            format!("[{}]", number + 1),
            executor.id.clone(),
            report.state(&executor.id).0.to_owned(),
            device.map_or_else(String::new, |device| {
                format!("{}, {}, {}", device.device, device.api, device.driver)
            }),
        ]);
    }
    align(text, &rows, &[Align::Left; 4]);
}

/// The table of one case: a row for each output of each pass.
fn passes(text: &mut String, report: &Report, case: &Case) {
    let settings = &report.settings;
    let _ = writeln!(
        text,
        "\n{case}, {}×{}, {} frame{}",
        settings.width,
        settings.height,
        settings.frames,
        if settings.frames == 1 { "" } else { "s" }
    );
    let ran: Vec<(usize, &str)> = report
        .executors
        .iter()
        .enumerate()
        .filter(|(_, executor)| {
            report
                .run(case, &executor.id)
                .is_some_and(|run| matches!(run.status, Status::Ran { .. }))
        })
        .map(|(number, executor)| (number, executor.id.as_str()))
        .collect();
    if ran.is_empty() {
        text.push_str("  nothing ran\n");
        return;
    }
    let mut header: Vec<String> = ["pass", "output", "shape"].map(str::to_owned).to_vec();
    header.extend(ran.iter().map(|(number, _)| format!("ms [{}]", number + 1)));
    header.extend(["max ULP", "mean ULP", "differing", "FLIP", "tolerance"].map(str::to_owned));
    let mut alignment = vec![Align::Left; 3];
    alignment.resize(header.len() - 1, Align::Right);
    alignment.push(Align::Left);
    let mut rows = vec![header];
    // Of each output the worst of all pairs and frames, in the order of steps.
    let mut outputs: Vec<(&str, &str, Vec<&ComparisonReport>)> = Vec::new();
    for comparison in report.comparisons_of(case) {
        let key = (comparison.pass.as_str(), comparison.binding.as_str());
        match outputs
            .iter_mut()
            .find(|(pass, binding, _)| (*pass, *binding) == key)
        {
            Some((_, _, all)) => all.push(comparison),
            None => outputs.push((key.0, key.1, vec![comparison])),
        }
    }
    for (pass, binding, comparisons) in &outputs {
        let Some(first) = comparisons.first() else {
            continue;
        };
        let mut row = vec![
            (*pass).to_owned(),
            (*binding).to_owned(),
            first.shape.clone(),
        ];
        row.extend(ran.iter().map(|(_, id)| {
            time(report, case, id, pass).map_or_else(|| "–".to_owned(), milliseconds)
        }));
        let failed = comparisons
            .iter()
            .any(|comparison| !comparison.verdict.passed());
        row.extend(worst_of(comparisons));
        row.push(format!(
            "{}{}",
            first.tolerance.summary(),
            if failed { "  ✗" } else { "" }
        ));
        rows.push(row);
    }
    let mut total = vec!["all passes".to_owned(), String::new(), String::new()];
    total.extend(
        ran.iter().map(|(_, id)| {
            total_time(report, case, id).map_or_else(|| "–".to_owned(), milliseconds)
        }),
    );
    rows.push(total);
    align(text, &rows, &alignment);
    for comparison in report
        .comparisons_of(case)
        .filter(|comparison| !comparison.verdict.passed())
    {
        let _ = writeln!(text, "  ✗ {}", failure(comparison));
    }
    for executor in &report.executors {
        let run = report.run(case, &executor.id);
        if let Some(Status::Ran { findings, .. }) = run.map(|run| &run.status) {
            for finding in findings {
                let _ = writeln!(text, "  {} found {finding}", executor.id);
            }
        }
    }
}

/// The largest of each figure over several comparisons: largest and mean
/// distance, share of differing texels, FLIP.
pub(super) fn worst_of(comparisons: &[&ComparisonReport]) -> [String; 4] {
    let figures: Vec<&Comparison> = comparisons
        .iter()
        .filter_map(|comparison| comparison.figures.as_ref())
        .collect();
    let largest = |of: fn(&Comparison) -> f64| {
        figures
            .iter()
            .map(|figures| of(figures))
            .fold(0.0, f64::max)
    };
    let max_ulp = figures
        .iter()
        .map(|figures| figures.max_ulp)
        .max()
        .unwrap_or(Ulps(0));
    let flips = figures
        .iter()
        .filter_map(|figures| figures.flip.mean())
        .fold(None, |worst: Option<f32>, mean| {
            Some(worst.map_or(mean, |worst| worst.max(mean)))
        });
    if figures.is_empty() {
        return ["–"; 4].map(str::to_owned);
    }
    [
        max_ulp.to_string(),
        number(largest(|figures| figures.mean_ulp)),
        percent(largest(|figures| figures.differing_share)),
        flips.map_or_else(|| "–".to_owned(), |mean| number(mean.into())),
    ]
}

/// One failed comparison in a line.
fn failure(comparison: &ComparisonReport) -> String {
    let mut line = format!(
        "{} `{}`, frame {}, {} against {}",
        comparison.pass,
        comparison.binding,
        comparison.frame,
        comparison.subject,
        comparison.reference
    );
    if let crate::compare::Verdict::Fail(why) = &comparison.verdict {
        let _ = write!(line, ": {why}");
    }
    if let Some(figures) = &comparison.figures {
        let _ = write!(
            line,
            "; max {} ULP, mean {}, {} of the texels, largest difference {}",
            figures.max_ulp,
            number(figures.mean_ulp),
            percent(figures.differing_share),
            number(figures.max_abs),
        );
        match &figures.flip {
            Flip::Mean(mean) => {
                let _ = write!(line, ", FLIP {}", number((*mean).into()));
            }
            Flip::Skipped(why) => {
                let _ = write!(line, ", no FLIP ({why})");
            }
        }
        if let Some(worst) = figures.worst {
            let _ = write!(line, "; worst at {worst}");
        }
    }
    line
}

/// How long a pass took on an executor, in nanoseconds.
fn time(report: &Report, case: &Case, executor: &str, pass: &str) -> Option<u64> {
    match &report.run(case, executor)?.status {
        Status::Ran { times, .. } => times
            .iter()
            .find(|time| time.step == pass)
            .map(|time| time.nanoseconds),
        _ => None,
    }
}

/// How long all passes took on an executor, in nanoseconds.
pub(super) fn total_time(report: &Report, case: &Case, executor: &str) -> Option<u64> {
    match &report.run(case, executor)?.status {
        Status::Ran { times, .. } if !times.is_empty() => {
            Some(times.iter().map(|time| time.nanoseconds).sum())
        }
        _ => None,
    }
}

/// Nanoseconds as milliseconds of three digits after the point.
pub(super) fn milliseconds(nanoseconds: u64) -> String {
    format!("{:.3}", nanoseconds as f64 / 1e6)
}

/// A figure in three significant digits; 0 is `0` and nothing else is.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if (0.001..100_000.0).contains(&value.abs()) {
        let digits = 2 - value.abs().log10().floor() as i32;
        format!("{value:.*}", digits.clamp(0, 6) as usize)
    } else {
        format!("{value:.2e}")
    }
}

/// A share in percent; 0 % is only nothing, 100 % only everything.
pub(super) fn percent(share: f64) -> String {
    if share == 0.0 || share == 1.0 {
        format!("{} %", share * 100.0)
    } else if share > 0.999 {
        "> 99.9 %".to_owned()
    } else {
        format!("{} %", number(share * 100.0))
    }
}

/// Which side of a column its cells keep to.
#[derive(Clone, Copy, PartialEq)]
enum Align {
    Left,
    Right,
}

/// Writes rows with columns of equal width, two spaces between them.
fn align(text: &mut String, rows: &[Vec<String>], alignment: &[Align]) {
    let widths: Vec<usize> = (0..alignment.len())
        .map(|column| {
            rows.iter()
                .filter_map(|row| row.get(column))
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    for row in rows {
        let mut line = String::new();
        for ((cell, &width), side) in row.iter().zip(&widths).zip(alignment) {
            let _ = match side {
                Align::Left => write!(line, "  {cell:<width$}"),
                Align::Right => write!(line, "  {cell:>width$}"),
            };
        }
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short_and_zero_is_only_zero() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (0.012_345, "0.0123"),
            (123.456, "123"),
            (99_999.0, "99999"),
            (1e-9, "1.00e-9"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(value), text);
        }
        for (share, text) in [
            (0.0, "0 %"),
            (1.0, "100 %"),
            (0.123_45, "12.3 %"),
            (1e-7, "1.00e-5 %"),
            (0.999_999, "> 99.9 %"),
        ] {
            assert_eq!(percent(share), text);
        }
        assert_eq!(milliseconds(1_234_567), "1.235");
    }

    #[test]
    fn columns_line_up() {
        let mut text = String::new();
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        align(
            &mut text,
            &[row(["a", "1"]), row(["bcd", "100"])],
            &[Align::Left, Align::Right],
        );
        assert_eq!(text, "  a      1\n  bcd  100\n");
    }
}

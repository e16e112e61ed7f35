//! The findings for a terminal.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::model::{CaseReport, ExecutorResult, Report, Status};
use crate::text::power;

/// Rows up to which every case is shown.
const FEW: usize = 40;

/// Rows of the worst cases, where not all are shown.
const WORST: usize = 12;

/// Everything worth knowing at a glance: families, the worst cases, the findings.
#[must_use]
pub fn text(report: &Report) -> String {
    let mut out = String::new();
    for executor in &report.executors {
        let _ = writeln!(
            out,
            "{:<11} {}, {}, {}",
            executor.name, executor.api, executor.device, executor.driver
        );
    }
    for note in &report.notes {
        let _ = writeln!(out, "{note}");
    }
    for failure in &report.failures {
        let _ = writeln!(out, "FAILED {failure}");
    }
    families(&mut out, report);
    rows(&mut out, report);
    sites(&mut out, report);
    let findings: Vec<_> = report.findings().collect();
    if !findings.is_empty() {
        let _ = writeln!(out, "\nFindings");
    }
    for (case, finding) in findings {
        let _ = writeln!(
            out,
            "  {} on {}, {}: {}",
            case.effect, case.name, finding.executor, finding.text
        );
    }
    let excused = || {
        report
            .cases
            .iter()
            .flat_map(|case| case.excused.iter().map(move |one| (case, one)))
    };
    if excused().next().is_some() {
        let _ = writeln!(out, "\nKnown of drivers");
    }
    for (case, one) in excused() {
        let _ = writeln!(
            out,
            "  {} on {}, {}: {} ({})",
            case.effect, case.name, one.finding.executor, one.reason, one.finding.text
        );
    }
    for refusal in report.accepted() {
        let _ = writeln!(
            out,
            "  {} takes {} = {}, which is not allowed",
            refusal.effect, refusal.knob, refusal.value
        );
    }
    let totals = report.totals;
    let _ = writeln!(
        out,
        "\n{} named cases, {} with their effects, {} executions, {} values refused: {}",
        totals.cases,
        totals.pairs,
        totals.executions,
        totals.refusals - report.accepted().count(),
        match totals.findings {
            0 => "nothing found".to_owned(),
            1 => "1 finding".to_owned(),
            count => format!("{count} findings"),
        }
    );
    out
}

/// A line for each family of cases.
fn families(out: &mut String, report: &Report) {
    let mut families: BTreeMap<&str, Vec<&CaseReport>> = BTreeMap::new();
    for case in &report.cases {
        families.entry(&case.family).or_default().push(case);
    }
    let _ = writeln!(
        out,
        "\n{:<10} {:>5} {:>10} {:>10} {:>7} {:>11}  worst",
        "family", "pairs", "executions", "no numbers", "differ", "error"
    );
    for (family, cases) in families {
        let results = || cases.iter().flat_map(|case| &case.results);
        let worst = cases
            .iter()
            .max_by(|a, b| a.strain().total_cmp(&b.strain()));
        let _ = writeln!(
            out,
            "{family:<10} {:>5} {:>10} {:>10} {:>7} {:>10.1}%  {}",
            cases.len(),
            results().map(|result| result.executions).sum::<u64>(),
            results()
                .filter(|result| result.non_finite.is_some())
                .count(),
            results()
                .filter(|result| result.difference.is_some())
                .count(),
            100.0 * worst.map_or(0.0, |worst| worst.strain()),
            worst.map_or(String::new(), |worst| format!(
                "{}, {}",
                worst.name, worst.effect
            )),
        );
    }
    out.push_str("(error: the largest as a share of what is allowed)\n");
}

/// A line for each case, or for the worst of many.
fn rows(out: &mut String, report: &Report) {
    let mut cases: Vec<&CaseReport> = report.cases.iter().collect();
    if cases.len() > FEW {
        sort(&mut cases);
        cases.truncate(WORST);
    }
    let _ = writeln!(
        out,
        "\n{:<44} {:<10} {:>9} {:>9} {:>9} {:>9} {:>8}  executors",
        "case", "effect", "max error", "99.9 %", "allowed", "otherwise", "unstable"
    );
    for case in cases {
        let shadow = case.results.iter().find(|one| one.rounding.is_some());
        let rounding = shadow.and_then(|one| one.rounding.as_ref());
        let otherwise = rounding.map(|one| one.otherwise);
        let counts = case.results.iter().find_map(|one| one.sanitised);
        let unstable = counts.map(|one| one.unstable_branches + one.unstable_indices);
        let _ = writeln!(
            out,
            "{:<44} {:<10} {:>9} {:>9} {:>9} {:>9} {:>8}  {}",
            case.name,
            case.effect,
            rounding.map_or_else(|| "-".to_owned(), |one| power(one.max)),
            rounding.map_or_else(|| "-".to_owned(), |one| power(one.p999)),
            rounding.map_or_else(|| "-".to_owned(), |one| power(one.allowed)),
            otherwise.map_or_else(|| "-".to_owned(), |count| count.to_string()),
            unstable.map_or_else(|| "-".to_owned(), |count| count.to_string()),
            case.results.iter().map(sign).collect::<Vec<_>>().join(" "),
        );
    }
}

/// A line for each place in a kernel at which something is wrong that it does not allow.
fn sites(out: &mut String, report: &Report) {
    let open: Vec<_> = report
        .sites
        .iter()
        .filter(|site| site.allowed.is_none())
        .collect();
    if !report.sites.is_empty() {
        let _ = writeln!(
            out,
            "\n{:<30} {:<12} {:<16} {:>10} {:>13} {:>9} {:>8}  worst in",
            "kernel", "operation", "fault", "times", "of", "by", "bits"
        );
    }
    for site in &open {
        let _ = writeln!(
            out,
            "{:<30} {:<12} {:<16} {:>10} {:>13} {:>9} {:>8}  {}",
            site.place(),
            site.operation,
            site.fault,
            site.times,
            site.executions,
            power(site.severity),
            site.cancelled_bits,
            site.worst_case,
        );
    }
    if report.sites.len() > open.len() {
        let allowed = report.sites.len() - open.len();
        let _ = writeln!(
            out,
            "{allowed} more that kernels allow, each with its reason"
        );
    }
    for (file, line, fault) in &report.unused {
        let _ = writeln!(out, "{file}:{line} allows {fault}, which no case has");
    }
}

/// The worst first: what has findings, then by how close its error is to what is
/// allowed.
pub(crate) fn sort(cases: &mut [&CaseReport]) {
    cases.sort_by(|a, b| {
        let key = |case: &CaseReport| (case.findings.len(), case.strain());
        let ((found_a, strain_a), (found_b, strain_b)) = (key(a), key(b));
        found_b
            .cmp(&found_a)
            .then(strain_b.total_cmp(&strain_a))
            .then_with(|| (&a.name, &a.effect).cmp(&(&b.name, &b.effect)))
    });
}

/// How an executor did, in a word.
pub(crate) fn sign(result: &ExecutorResult) -> String {
    let verdict = match &result.status {
        Status::Unsupported { .. } => "cannot",
        Status::Failed { .. } => "FAILED",
        Status::Ran if result.non_finite.is_some() => "NaN",
        Status::Ran if result.difference.is_some() => "DIFFERS",
        Status::Ran if result.rounding.as_ref().is_some_and(|one| one.beyond > 0) => "INEXACT",
        Status::Ran => "ok",
    };
    format!("{}:{verdict}", result.executor)
}

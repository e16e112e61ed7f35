//! From finished executions to comparisons, and from those to a verdict.

use std::collections::BTreeMap;
use std::path::Path;

use thiserror::Error;

use super::gallery::{Gallery, GalleryError};
use super::model::{BackendKind, Case, ComparisonReport, Executor, Report, Status};
use crate::compare::{CompareError, Tolerance, Verdict, compare, describe};
use crate::execute::outcome::{Capture, OutcomeError, Run, Spread};
use crate::setup;

/// An execution to compare: who, and what is in which folder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Finished<'a> {
    /// Who ran.
    pub executor: &'a Executor,
    /// What came out.
    pub run: &'a Run,
    /// Where the texels are.
    pub folder: &'a Path,
}

/// Why a comparison could not be carried through.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// Texels cannot be read.
    #[error(transparent)]
    Outcome(#[from] OutcomeError),
    /// Pictures cannot be written.
    #[error(transparent)]
    Gallery(#[from] GalleryError),
    /// Images that were compared cannot be judged.
    #[error(transparent)]
    Compare(#[from] CompareError),
}

/// Which executions of one case are compared: each with the interpreter, and
/// ash with wgpu where both ran on one driver. The first of a pair is the
/// reference.
#[must_use]
pub(super) fn pairs<'a>(finished: &[Finished<'a>]) -> Vec<(Finished<'a>, Finished<'a>)> {
    let find = |backend, driver: &str| {
        let is = |candidate: &&Finished<'a>| {
            candidate.executor.backend == backend && candidate.executor.driver() == driver
        };
        finished.iter().find(is).copied()
    };
    let mut pairs = Vec::new();
    for &subject in finished
        .iter()
        .filter(|finished| finished.executor.backend != BackendKind::Cpu)
    {
        pairs.extend(find(BackendKind::Cpu, "host").map(|reference| (reference, subject)));
    }
    for &subject in finished
        .iter()
        .filter(|finished| finished.executor.backend == BackendKind::Ash)
    {
        pairs.extend(
            find(BackendKind::Wgpu, subject.executor.driver())
                .map(|reference| (reference, subject)),
        );
    }
    pairs
}

/// Compares everything two executions captured.
///
/// # Errors
/// If texels cannot be read or pictures cannot be written.
pub(super) fn compare_pair(
    case: &Case,
    (reference, subject): (Finished<'_>, Finished<'_>),
    tolerance: impl Fn(&Capture, Option<Spread>) -> Tolerance,
    mut gallery: Option<&mut Gallery>,
) -> Result<Vec<ComparisonReport>, EvaluateError> {
    let mut others: BTreeMap<_, _> = subject
        .run
        .captures
        .iter()
        .map(|capture| (capture.key(), capture))
        .collect();
    let report = |capture: &Capture, tolerance: Tolerance, verdict| ComparisonReport {
        case: case.clone(),
        frame: capture.frame,
        pass: capture.pass.clone(),
        binding: capture.binding.clone(),
        resource: capture.resource.clone(),
        shape: if capture.buffer {
            format!("{} bytes", capture.desc.bytes().unwrap_or(u64::MAX))
        } else {
            describe(&capture.desc)
        },
        reference: reference.executor.id.clone(),
        subject: subject.executor.id.clone(),
        backend: subject.executor.backend,
        driver: subject.executor.driver().to_owned(),
        figures: None,
        tolerance_reason: tolerance.reason().to_owned(),
        tolerance,
        verdict,
        pictures: None,
    };
    let mut reports = Vec::new();
    for capture in &reference.run.captures {
        let tolerance = tolerance(capture, capture.read_spread(reference.folder)?);
        let Some(other) = others.remove(&capture.key()) else {
            let why = format!("{} did not capture it", subject.executor.id);
            reports.push(report(capture, tolerance, Verdict::Fail(why)));
            continue;
        };
        let (expected, actual) = (capture.read(reference.folder)?, other.read(subject.folder)?);
        let figures = match compare(&expected, &actual) {
            Ok(figures) => figures,
            Err(error) => {
                reports.push(report(capture, tolerance, Verdict::Fail(error.to_string())));
                continue;
            }
        };
        let verdict = tolerance.judge(&figures, &expected, &actual)?;
        let mut report = report(capture, tolerance, verdict);
        report.figures = Some(figures);
        if let Some(gallery) = gallery.as_deref_mut().filter(|_| !capture.buffer) {
            report.pictures = Some(gallery.add(&expected, &actual)?);
        }
        reports.push(report);
    }
    for capture in others.into_values() {
        let why = format!("{} did not capture it", reference.executor.id);
        reports.push(report(
            capture,
            tolerance(capture, None),
            Verdict::Fail(why),
        ));
    }
    Ok(reports)
}

/// Fills in the verdict: `ok`, the problems and the notes.
pub(super) fn conclude(report: &mut Report) {
    let mut problems = Vec::new();
    let mut notes = Vec::new();
    let backend_of = |id: &str| {
        report
            .executors
            .iter()
            .find(|executor| executor.id == id)
            .map(|found| found.backend)
    };
    let required = |backend| report.settings.required.contains(&backend);
    for run in &report.runs {
        let Some(reason) = run.status.reason() else {
            continue;
        };
        let line = match run.status {
            // The same in every case.
            Status::NoDevice { .. } => format!("{}: {reason}", run.executor),
            // The same on every scene.
            Status::Unsupported { .. } => {
                format!("{} cannot run {}: {reason}", run.executor, run.case.effect)
            }
            _ => format!(
                "{} {} ({}): {reason}",
                run.executor,
                run.status.word(),
                run.case
            ),
        };
        if run.status.is_fault() && backend_of(&run.executor).is_some_and(required) {
            problems.push(line);
        } else if !notes.contains(&line) {
            notes.push(line);
        }
    }
    for &backend in &report.settings.required {
        problems.extend(missing(report, backend));
    }
    if report.runs.is_empty() {
        problems.push("nothing ran".to_owned());
    }
    for (line, backend) in disagreements(report) {
        if required(backend) {
            &mut problems
        } else {
            &mut notes
        }
        .push(line);
    }
    for bad in &report.unusable_manifests {
        notes.push(bad.to_string());
    }
    report.ok = problems.is_empty();
    report.problems = problems;
    report.notes = notes;
}

/// What is missing of a required backend.
fn missing(report: &Report, backend: BackendKind) -> Vec<String> {
    let of_backend = |id: &str| {
        report
            .executors
            .iter()
            .any(|executor| executor.id == id && executor.backend == backend)
    };
    let ran = |case: &Case| {
        report.runs.iter().any(|run| {
            run.case == *case
                && of_backend(&run.executor)
                && matches!(run.status, Status::Ran { .. })
        })
    };
    let compared = |case: &Case| {
        backend == BackendKind::Cpu
            || report
                .comparisons_of(case)
                .any(|comparison| comparison.backend == backend)
    };
    // What was asked for, not what was added to test an executor in parts.
    let mut cases = report.cases();
    cases.retain(|case| report.settings.effects.contains(&case.effect));
    if !cases.iter().any(|case| ran(case)) {
        return vec![match backend {
            BackendKind::Cpu => {
                "cpu did not run, and it is what the others are compared with".to_owned()
            }
            _ => format!(
                "{backend} ran on no driver; to install drivers: {}",
                setup::hint()
            ),
        }];
    }
    let line = |case: &&Case| {
        if !ran(case) {
            Some(format!("{backend} did not run ({case})"))
        } else if !compared(case) {
            Some(format!(
                "{backend} ran, but nothing of it could be compared ({case})"
            ))
        } else {
            None
        }
    };
    cases.iter().filter_map(line).collect()
}

/// One line for each pair that disagrees in a case, naming the first pass in
/// the order of execution that does: those after it may only pass it on.
fn disagreements(report: &Report) -> Vec<(String, BackendKind)> {
    let mut lines = Vec::new();
    for case in report.cases() {
        let mut seen: Vec<(&str, &str)> = Vec::new();
        for comparison in report.comparisons_of(case) {
            let pair = (comparison.reference.as_str(), comparison.subject.as_str());
            let Verdict::Fail(why) = &comparison.verdict else {
                continue;
            };
            if seen.contains(&pair) {
                continue;
            }
            seen.push(pair);
            let of_pair = || {
                report
                    .comparisons_of(case)
                    .filter(|other| (other.reference.as_str(), other.subject.as_str()) == pair)
            };
            let failed = of_pair().filter(|other| !other.verdict.passed()).count();
            let line = format!(
                "{} disagrees with {} ({case}), first in pass `{}`, output `{}`, frame {}: {why}; {failed} of {} outputs \
                 are affected",
                pair.1,
                pair.0,
                comparison.pass,
                comparison.binding,
                comparison.frame,
                of_pair().count(),
            );
            lines.push((line, comparison.backend));
        }
    }
    lines
}

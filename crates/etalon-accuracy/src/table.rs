//! What was found, for a terminal: the front of each effect on each executor.

use std::fmt::Write;

use crate::front::{Candidate, front};
use crate::model::{Executor, Metric, Point, Subject, Sweep};

/// The fronts as text.
#[must_use]
pub fn text(sweep: &Sweep) -> String {
    let mut text = String::new();
    for subject in &sweep.subjects {
        for fact in &subject.facts {
            let _ = writeln!(
                text,
                "{}: {} {:.4} {}",
                subject.scene, fact.name, fact.value, fact.unit
            );
        }
        for executor in &sweep.executors {
            one(&mut text, subject, executor);
        }
    }
    for note in &sweep.notes {
        let _ = writeln!(text, "note: {note}");
    }
    text
}

/// The front by the main metric of each kind of error.
fn one(text: &mut String, subject: &Subject, executor: &Executor) {
    let mains = subject.mains();
    let Some(main) = mains.first() else {
        return;
    };
    let _ = write!(
        text,
        "\n{} on {}, {} ({})\n{:>10} {:>10}",
        subject.effect, subject.scene, executor.id, executor.device, "ms", "fetches"
    );
    for metric in &mains {
        let _ = write!(text, " {:>28}", metric.id);
    }
    let _ = writeln!(text, "  setting");
    let points: Vec<(&Point, Candidate)> = subject
        .points
        .iter()
        .filter_map(|point| Some((point, Candidate::of(point.on(&executor.id)?, main)?)))
        .collect();
    let candidates: Vec<Candidate> = points.iter().map(|(_, candidate)| *candidate).collect();
    let front = front(&candidates);
    let mut shown: Vec<usize> = (0..points.len())
        .filter(|index| front.contains(index) || points[*index].0.preset.is_some())
        .collect();
    shown.sort_by(|a, b| candidates[*a].cost.total_cmp(&candidates[*b].cost));
    for index in shown {
        let (point, Candidate { cost, .. }) = points[index];
        let _ = write!(
            text,
            "{:>10.3} {:>10}",
            cost * 1e-6,
            point.work.texel_fetches
        );
        for metric in &mains {
            let _ = write!(text, " {:>28.3e}", error(point, executor, metric));
        }
        let beaten = if front.contains(&index) {
            ""
        } else {
            ", not on the front"
        };
        let preset = point.preset.as_deref().unwrap_or_default();
        let space = if preset.is_empty() { "" } else { " = " };
        let _ = writeln!(text, "  {}{space}{preset}{beaten}", point.id);
    }
}

fn error(point: &Point, executor: &Executor, metric: &Metric) -> f64 {
    point.error_on(&executor.id, &metric.id).unwrap_or(f64::NAN)
}

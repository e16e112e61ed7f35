//! Data without numbers that JSON does not know.

use crate::model::{Spread, Sweep};

/// The sweep without numbers that are not finite, and with a note for those left
/// out.
pub(super) fn sound(sweep: &Sweep) -> Sweep {
    let mut sound = sweep.clone();
    let mut notes = Vec::new();
    for subject in &mut sound.subjects {
        let place = format!("{} on {}", subject.effect, subject.scene);
        let mut note = |count: usize, what: &str| {
            if count > 0 {
                notes.push(format!(
                    "{place}: {count} {what} not finite and left out of the data"
                ));
            }
        };
        let facts = subject.facts.len();
        subject.facts.retain(|fact| fact.value.is_finite());
        note(facts - subject.facts.len(), "facts are");
        let (mut times, mut errors, mut steps) = (0, 0, 0);
        for point in &mut subject.points {
            if point.work.steps_per_ray.is_some_and(|all| !all.is_finite()) {
                point.work.steps_per_ray = None;
                steps += 1;
            }
            for outcome in &mut point.results {
                if outcome.time.as_ref().is_some_and(|time| !is_finite(time)) {
                    outcome.time = None;
                    times += 1;
                }
                let before = outcome.errors.len();
                outcome.errors.retain(|_, error| error.is_finite());
                errors += before - outcome.errors.len();
            }
        }
        note(times, "times are");
        note(errors, "errors are");
        note(steps, "means of steps are");
    }
    for note in notes {
        if !sound.notes.contains(&note) {
            sound.notes.push(note);
        }
    }
    sound
}

fn is_finite(time: &Spread) -> bool {
    [time.median, time.lower, time.upper]
        .iter()
        .all(|time| time.is_finite())
}

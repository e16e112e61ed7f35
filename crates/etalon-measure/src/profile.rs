//! Where the interpreter's time goes, by its own profile.

use std::fmt::Write as _;

use etalon_core::backend::{Backend, BackendError};
use etalon_core::kernel::Arithmetic;
use etalon_cpu::{Cost, CpuBackend, CpuOptions, Profile, Tier};
use thiserror::Error;

use crate::compare::interpreter;
use crate::subjects::{Size, Subject, SubjectError, frame};

/// Why nothing was profiled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// There is nothing to measure.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// The interpreter cannot be had, or fails.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

/// What to profile.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Size of the picture.
    pub size: Size,
    /// Effects and small kernels.
    pub subjects: Vec<Subject>,
    /// Kernels whose path contains this; all if empty.
    pub kernel: String,
    /// Which arithmetics.
    pub arithmetics: Vec<Arithmetic>,
    /// The tier; the best one without it.
    pub tier: Option<Tier>,
    /// Threads; 0 for as many as there are processors.
    pub threads: usize,
    /// How often the work is done.
    pub repetitions: usize,
}

/// A kernel's profile within an effect.
#[derive(Clone, Debug)]
pub struct KernelProfile {
    /// The effect, or the small kernel's name.
    pub subject: String,
    /// Arithmetic.
    pub arithmetic: Arithmetic,
    /// How often the work was done.
    pub repetitions: usize,
    /// The profile.
    pub profile: Profile,
}

/// Profiles every kernel; `done` is told of each.
///
/// # Errors
/// A [`ProfileError`] at the first thing that fails.
pub fn profile(
    settings: &Settings,
    mut done: impl FnMut(&KernelProfile),
) -> Result<(), ProfileError> {
    let frame = frame(settings.size)?;
    let mut prober = interpreter(settings.tier, settings.threads)?;
    for &arithmetic in &settings.arithmetics {
        let has = |subject: &&Subject| subject.has(arithmetic);
        for subject in settings.subjects.iter().filter(has) {
            for work in subject.works(&frame, arithmetic, &mut prober)? {
                if !work.kernel.contains(&settings.kernel) {
                    continue;
                }
                let mut backend = CpuBackend::new(&CpuOptions {
                    tier: settings.tier,
                    threads: settings.threads,
                    profile: true,
                    ..CpuOptions::default()
                })?;
                backend.execute(&work.repeated(settings.repetitions), &work.inputs())?;
                for profile in backend.profiles() {
                    done(&KernelProfile {
                        subject: subject.name.to_owned(),
                        arithmetic,
                        repetitions: settings.repetitions,
                        profile,
                    });
                }
            }
        }
    }
    Ok(())
}

/// The hottest operations and source lines, `most` of each.
#[must_use]
pub fn report(kernel: &KernelProfile, most: usize) -> String {
    let profile = &kernel.profile;
    let total = profile.total();
    let mut text = format!(
        "{} {}: {} operations executed, {:.1} % of lanes active, {:.1} ns per operation, {:.3} ms on all threads (of {} times; {:.1} ns of the clock taken off each)\n",
        kernel.arithmetic,
        profile.kernel,
        total.executions / kernel.repetitions as u64,
        100.0 * total.active_share(),
        total.nanoseconds_each(),
        total.nanoseconds * 1e-6 / kernel.repetitions as f64,
        kernel.repetitions,
        profile.overhead
    );
    for (title, costs) in [
        ("operation", profile.by_operation()),
        ("line", profile.by_line()),
    ] {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "    {title:<32} {:>12} {:>8} {:>9} {:>10} {:>6}",
            "executed", "active %", "ns each", "ms", "%"
        );
        for (name, cost) in costs.iter().take(most) {
            text += &line(name, cost, total.nanoseconds, kernel.repetitions);
        }
    }
    text
}

/// A kernel in one row of a table in Markdown; its columns are
/// [`SUMMARY_HEADING`].
#[must_use]
pub fn summary(kernel: &KernelProfile) -> String {
    let total = kernel.profile.total();
    let hottest: Vec<String> = kernel
        .profile
        .by_operation()
        .iter()
        .take(3)
        .map(|(name, cost)| {
            let share = 100.0 * cost.nanoseconds / total.nanoseconds.max(f64::MIN_POSITIVE);
            format!("{name} {share:.0} %")
        })
        .collect();
    format!(
        "| {} | {} | {:.1} | {:.1} | {} |",
        kernel.profile.kernel,
        total.executions / kernel.repetitions as u64,
        100.0 * total.active_share(),
        total.nanoseconds_each(),
        hottest.join(", ")
    )
}

/// The heading of the table of [`summary`].
pub const SUMMARY_HEADING: &str =
    "| kernel | operations executed | lanes active, % | ns per operation | most time in |
|---|---|---|---|---|";

fn line(name: &str, cost: &Cost, total: f64, repetitions: usize) -> String {
    format!(
        "    {name:<32} {:>12} {:>8.1} {:>9.1} {:>10.3} {:>6.1}\n",
        cost.executions / repetitions as u64,
        100.0 * cost.active_share(),
        cost.nanoseconds_each(),
        cost.nanoseconds * 1e-6 / repetitions as f64,
        100.0 * cost.nanoseconds / total.max(f64::MIN_POSITIVE)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subjects::subject;

    #[test]
    fn reports_name_operations_and_lines() {
        let settings = Settings {
            size: Size {
                width: 40,
                height: 24,
            },
            subjects: vec![subject("composite").unwrap(), subject("exposure").unwrap()],
            kernel: "composite".to_owned(),
            arithmetics: vec![Arithmetic::Strict, Arithmetic::Fast],
            tier: None,
            threads: 2,
            repetitions: 2,
        };
        let mut seen = Vec::new();
        profile(&settings, |kernel| {
            let report = report(kernel, 1000);
            assert!(report.contains("image.load"), "{report}");
            assert!(report.contains("composite/composite.wesl:"), "{report}");
            // Every invocation stores its texel, and no other lane.
            let store = kernel.profile.by_operation();
            let store = store.iter().find(|(name, _)| name == "image.store");
            assert_eq!(store.unwrap().1.active_lanes, 2 * 40 * 24);
            let row = summary(kernel);
            assert_eq!(
                row.matches('|').count(),
                SUMMARY_HEADING.lines().next().unwrap().matches('|').count()
            );
            seen.push(kernel.arithmetic);
        })
        .unwrap();
        assert_eq!(seen, [Arithmetic::Strict, Arithmetic::Fast]);
    }
}

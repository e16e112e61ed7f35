//! Running WGSL with checks in tests.

use etalon_cpu::{BoundResource, Checks, Executor, Finding, FindingKind, Location, Tier};

use super::{Program, translate_with};

/// Marks in WGSL where something is to be found.
pub(crate) const MARK: &str = "/*!*/";

/// The place right after the `n`th mark.
pub(crate) fn place(wgsl: &str, n: usize) -> Location {
    let (at, _) = wgsl
        .match_indices(MARK)
        .nth(n)
        .unwrap_or_else(|| panic!("there is no mark {n} in\n{wgsl}"));
    let before = &wgsl[..at + MARK.len()];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Location {
        file: "test".to_owned(),
        line: before.matches('\n').count() as u32 + 1,
        column: (before.len() - line_start) as u32 + 1,
    }
}

pub(crate) fn checked(wgsl: &str, checks: Checks) -> Program {
    translate_with(wgsl, checks).unwrap_or_else(|error| panic!("{error}\n{wgsl}"))
}

/// Every way of running that must find the same.
pub(crate) fn all_executors() -> Vec<(String, Executor)> {
    let mut all = Vec::new();
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        for threads in [1, 3] {
            for lanes in [64, 256] {
                let executor = Executor::new(threads)
                    .unwrap()
                    .with_tier(tier)
                    .with_lanes(lanes)
                    .with_max_trips(100);
                all.push((
                    format!("{tier}, {threads} threads, {lanes} lanes"),
                    executor,
                ));
            }
        }
    }
    all
}

/// What a program finds, the same in every way of running. `with` gets a way to
/// run what it is given on fresh resources.
pub(crate) fn find(
    program: &Program,
    executors: &[(String, Executor)],
    workgroups: [u32; 3],
    mut with: impl FnMut(&mut dyn FnMut(&[BoundResource<'_>])),
) -> Vec<Finding> {
    let mut first: Option<Vec<Finding>> = None;
    for (name, executor) in executors {
        with(&mut |bound| {
            let report = program
                .dispatch(executor, workgroups, bound)
                .unwrap_or_else(|error| panic!("{error}\n{program}"));
            match &first {
                None => first = Some(report.findings),
                Some(first) => assert_eq!(*first, report.findings, "differs on {name}\n{program}"),
            }
        });
    }
    first.unwrap()
}

/// The checks that report a kind.
pub(crate) fn only(kind: FindingKind) -> Checks {
    let mut checks = Checks::NONE;
    *switch(&mut checks, kind) = true;
    checks
}

/// All checks but the one that reports a kind.
pub(crate) fn all_but(kind: FindingKind) -> Checks {
    let mut checks = Checks::all();
    *switch(&mut checks, kind) = false;
    checks
}

fn switch(checks: &mut Checks, kind: FindingKind) -> &mut bool {
    use FindingKind as K;
    match kind {
        K::Index | K::Texel | K::Level | K::Layer => &mut checks.bounds,
        K::Uninitialised => &mut checks.uninitialised,
        K::Race => &mut checks.races,
        K::DivergentBarrier => &mut checks.barriers,
        K::EndlessLoop => &mut checks.loops,
        K::DivisionByZero | K::DivisionOverflow => &mut checks.division,
        K::Shift => &mut checks.shifts,
        K::Conversion => &mut checks.conversions,
        K::NonFinite => &mut checks.non_finite,
        other => panic!("no check is known to report {other:?}"),
    }
}

/// Findings for messages of failed tests.
pub(crate) fn list(findings: &[Finding]) -> String {
    findings
        .iter()
        .map(|finding| format!("{:?} {finding}\n", finding.kind))
        .collect()
}

//! What is compared with what, and what is concluded from it.

use super::*;
use crate::compare::Verdict;

#[test]
fn equal_executions_agree() {
    let fixture = Fixture::new(&images());
    let report = report_of(&[Some(&fixture), Some(&fixture), Some(&fixture)], None);
    assert_eq!(
        (report.ok, &report.problems, &report.notes),
        (true, &vec![], &vec![])
    );
    // Two against the interpreter and ash against wgpu, three outputs each.
    let pairs: Vec<_> = report
        .comparisons
        .iter()
        .map(|comparison| (comparison.reference.as_str(), comparison.subject.as_str()))
        .collect();
    assert_eq!(pairs.len(), 9);
    for pair in [
        ("cpu", "wgpu/lavapipe"),
        ("cpu", "ash/lavapipe"),
        ("wgpu/lavapipe", "ash/lavapipe"),
    ] {
        assert_eq!(
            pairs.iter().filter(|other| **other == pair).count(),
            3,
            "{pair:?}"
        );
    }
}

#[test]
fn a_noisy_texel_fails_and_its_pass_and_executor_are_named() {
    let (good, bad) = (
        Fixture::new(&images()),
        Fixture::new(&with_noise("ssr/mix")),
    );
    let report = report_of(&[Some(&good), Some(&good), Some(&bad)], None);
    assert!(!report.ok);
    assert_eq!(report.problems.len(), 2, "{:?}", report.problems);
    assert!(
        report.problems[0].starts_with(
            "ash/lavapipe disagrees with cpu (chain on test <scene>, strict arithmetic), first in pass `ssr/mix`, output \
             `target`, frame 0: 1 texel (0.019 %) not bit equal; 1 of 3 outputs are affected"
        ),
        "{:?}",
        report.problems
    );
    assert!(
        report.problems[1].starts_with("ash/lavapipe disagrees with wgpu/lavapipe"),
        "{:?}",
        report.problems
    );
}

#[test]
fn of_several_failing_passes_the_first_executed_is_named() {
    let mut images_bad = with_noise("ssr/mix");
    images_bad[2] = with_noise("bloom/threshold").remove(2);
    let (good, bad) = (Fixture::new(&images()), Fixture::new(&images_bad));
    let report = report_of(&[Some(&good), Some(&bad), Some(&good)], None);
    assert!(
        report.problems[0].contains("first in pass `ssr/mix`"),
        "{:?}",
        report.problems
    );
    assert!(
        report.problems[0].contains("2 of 3 outputs"),
        "{:?}",
        report.problems
    );
}

#[test]
fn a_fault_of_a_backend_that_is_not_required_is_a_note() {
    let (good, bad) = (
        Fixture::new(&images()),
        Fixture::new(&with_noise("ssr/mix")),
    );
    let mut report = report_of(&[Some(&good), Some(&bad), Some(&good)], None);
    report.settings.required = vec![BackendKind::Cpu];
    conclude(&mut report);
    assert!(report.ok, "{:?}", report.problems);
    assert_eq!(report.notes.len(), 2, "{:?}", report.notes);
}

#[test]
fn captures_that_only_one_execution_has_fail() {
    let (whole, short) = (Fixture::new(&images()), Fixture::new(&images()[..2]));
    for (reference, subject, missing) in [(&whole, &short, "ash/lavapipe"), (&short, &whole, "cpu")]
    {
        let report = report_of(&[Some(reference), None, Some(subject)], None);
        assert!(!report.ok);
        let why = Verdict::Fail(format!("{missing} did not capture it"));
        let failed: Vec<_> = report
            .comparisons
            .iter()
            .filter(|comparison| comparison.verdict == why)
            .collect();
        assert_eq!(failed.len(), 1, "{:?}", report.problems);
        assert_eq!(failed[0].pass, "bloom/threshold");
    }
}

#[test]
fn images_of_another_size_fail() {
    let mut other = images();
    other[0].2 = ImageData::zeroed(TextureDesc::d2(54, 96, Format::Rgba16Float)).unwrap();
    let (good, bad) = (Fixture::new(&images()), Fixture::new(&other));
    let report = report_of(&[Some(&good), Some(&bad), Some(&good)], None);
    assert!(!report.ok);
    assert!(
        report.problems[0]
            .contains("the reference is 96×54 rgba16float, the image under test 54×96 rgba16float"),
        "{:?}",
        report.problems
    );
}

#[test]
fn required_backends_have_to_run() {
    let fixture = Fixture::new(&images());
    let report = report_of(&[Some(&fixture), Some(&fixture), None], None);
    assert!(!report.ok);
    assert!(
        report.problems[0].starts_with("ash ran on no driver; to install"),
        "{:?}",
        report.problems
    );
    assert!(
        report.problems[0].contains("apt-get install mesa-vulkan-drivers"),
        "{:?}",
        report.problems
    );
    // No device is a note of its own.
    assert!(
        report.notes[0].contains("ash/lavapipe: none there"),
        "{:?}",
        report.notes
    );
    // Without the reference nothing is compared, and nothing is fine.
    let report = report_of(&[None, Some(&fixture), Some(&fixture)], None);
    assert!(!report.ok);
    assert!(
        report
            .problems
            .iter()
            .any(|problem| problem.starts_with("cpu did not run")),
        "{:?}",
        report.problems
    );
    assert!(
        report
            .problems
            .iter()
            .any(|problem| problem.starts_with("wgpu ran, but nothing")),
        "{:?}",
        report.problems
    );
}

#[test]
fn crashes_and_errors_are_problems() {
    let fixture = Fixture::new(&images());
    for status in [
        Status::Crashed {
            reason: "signal: 11".into(),
        },
        Status::Failed {
            reason: "signal: 11".into(),
        },
    ] {
        let fixtures = [Some(&fixture), Some(&fixture), None];
        let statuses = vec![fixture.status(), fixture.status(), status.clone()];
        let report = report_with(&fixtures, statuses, None);
        assert!(!report.ok);
        let expected = format!(
            "ash/lavapipe {} (chain on test <scene>, strict arithmetic): signal: 11",
            status.word()
        );
        assert!(report.problems.contains(&expected), "{:?}", report.problems);
    }
}

#[test]
fn an_empty_report_is_not_ok() {
    let mut report = report_of(&[], None);
    report.runs.clear();
    report.settings.required = vec![BackendKind::Cpu];
    conclude(&mut report);
    assert!(!report.ok);
}

//! What the sanitiser finds in the effects' kernels, and that it finds what is planted.

use etalon_stability::executors::Kind;
use etalon_stability::model::{FindingKind, Report};
use etalon_stability::mutate::{guards, without};
use etalon_stability::run::{Options, run};

/// Bloom on pictures in which there is nothing.
fn bloom(kernels: Vec<(String, String)>) -> Report {
    let options = Options {
        cases: vec!["light-none".to_owned(), "tone-linear-zero".to_owned()],
        effects: vec!["bloom".to_owned(), "composite".to_owned()],
        executors: vec![Kind::Cpu, Kind::Sanitiser],
        kernels,
        ..Options::default()
    };
    run(&options, &mut ()).unwrap_or_else(|error| panic!("{error}"))
}

/// The threshold without what keeps it from dividing by 0.
fn unguarded(comment: &str) -> Vec<(String, String)> {
    let path = "bloom/threshold";
    let text = etalon_shaders::source(path).unwrap();
    let guard = guards([(path, text)])
        .into_iter()
        .find(|guard| guard.unguarded == "let most = brightness;")
        .unwrap();
    let mutated = without(text, &guard);
    let line = format!("let most = brightness;{comment}");
    vec![(
        path.to_owned(),
        mutated.replace("let most = brightness;", &line),
    )]
}

#[test]
fn kernels_as_they_are_have_no_errors() {
    let report = bloom(Vec::new());
    assert!(report.is_sound(), "{:?}", report.findings().next());
    let followed = report.cases.iter().filter_map(|case| case.on("sanitiser"));
    let counts: Vec<_> = followed.filter_map(|result| result.sanitised).collect();
    assert!(!counts.is_empty() && counts.iter().all(|counts| counts.executions > 10_000));
}

#[test]
fn a_guard_that_is_missing_is_found_at_its_line() {
    let report = bloom(unguarded(""));
    assert!(!report.is_sound());
    let births: Vec<_> = report
        .findings()
        .filter(|(_, finding)| finding.kind == FindingKind::Birth)
        .collect();
    assert!(!births.is_empty());
    for (case, finding) in births {
        assert_eq!(case.effect, "bloom");
        assert!(
            finding.text.starts_with("bloom/threshold.wesl:"),
            "{finding:?}"
        );
    }
    let site = report.sites.first().expect("the worst first");
    assert!(site.counts() && site.fault == "birth" && site.file == "bloom/threshold.wesl");
    // The quotient is made in the lines right after it.
    let text = unguarded("").remove(0).1;
    let line = text
        .lines()
        .position(|line| line.contains("most = brightness"));
    let line = line.unwrap() as u32 + 1;
    assert!((line..line + 8).contains(&site.line), "{site:?}");
    // In what the interpreter stores there is no trace of it: rounding to 16 bits takes a
    // NaN for 0.
    let seen = |(_, finding): (_, &etalon_stability::model::Finding)| {
        finding.kind == FindingKind::NonFinite && finding.executor == "cpu"
    };
    assert!(!report.findings().any(seen));
}

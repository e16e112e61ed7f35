//! Every effect on every case, on the interpreter and on every device there is.
//!
//! Cases of more than [`LARGEST`] texels run for one effect each, the one that
//! contains all others: pictures of 65,536 texels, one for
//! each half float, on five executors take most of the time and differ from each
//! other by the channel alone. `cargo xtask stability` runs all of them.

use std::collections::BTreeSet;

use etalon_stability::executors::Kind;
use etalon_stability::model::{Report, Status};
use etalon_stability::run::{Options, run};
use etalon_stability::subject::subjects;
use etalon_stability::{functions, knobs};

/// Texels up to which every effect is run.
const LARGEST: usize = 16_384;

/// Texels up to which the sanitiser and perturbed executions are run, of which the frames
/// of most cases have more: they take far longer.
const FOLLOWED: usize = 1024;

fn sound(report: &Report) {
    let found: Vec<_> = report
        .findings()
        .map(|(case, finding)| {
            format!(
                "{} on {}, {}: {}",
                case.effect, case.name, finding.executor, finding.text
            )
        })
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_effect_on_every_case_stores_the_same_numbers_everywhere() {
    let report = run(
        &Options {
            largest: Some(LARGEST),
            followed: FOLLOWED,
            ..Options::default()
        },
        &mut (),
    )
    .unwrap();
    sound(&report);
    assert!(report.totals.cases >= 120, "{:?}", report.totals);
    assert!(report.totals.executions > 2000, "{:?}", report.totals);
    for case in &report.cases {
        for result in &case.results {
            if !matches!(result.status, Status::Unsupported { .. }) && !is_off(&case.name) {
                assert!(result.executions as usize >= case.frames, "{}", case.name);
                assert!(result.stores > 0, "{}", case.name);
            }
        }
        if case.family == functions::FAMILY {
            continue;
        }
        // What is drawn is computed in f32 whatever the interpreter's number.
        let rastered = ["geometry", "lighting", "forward"];
        if rastered.contains(&case.effect.as_str()) {
            continue;
        }
        let shadow = case.on("cpu-shadow").unwrap();
        assert!(
            shadow.rounding.is_some() || is_off(&case.name),
            "{}",
            case.name
        );
    }
}

/// An effect that is off hands on its input, and stores nothing.
fn is_off(name: &str) -> bool {
    name == "knob-ssr-resolution-least"
}

#[test]
fn the_chain_takes_every_bit_pattern() {
    let report = run(
        &Options {
            cases: vec!["bits-half".to_owned(), "bits-single".to_owned()],
            effects: vec!["chain".to_owned()],
            executors: vec![Kind::Cpu, Kind::Double, Kind::Shadow, Kind::Wgpu],
            ..Options::default()
        },
        &mut (),
    )
    .unwrap();
    sound(&report);
    assert_eq!(report.totals.cases, 11);
}

#[test]
fn cases_have_names_of_their_own_with_reasons_and_sources() {
    let all = subjects().unwrap();
    let names: BTreeSet<_> = all.iter().map(|subject| &subject.name).collect();
    assert_eq!(names.len(), all.len());
    assert!(names.len() >= 120, "{}", names.len());
    for subject in &all {
        assert!(!subject.reason.is_empty(), "{}", subject.name);
        assert!(!subject.source.is_empty(), "{}", subject.name);
        assert!(!subject.effects.is_empty(), "{}", subject.name);
    }
    // Every knob of every effect is at both ends of its range.
    for effect in etalon_effects::effects() {
        for knob in effect.knobs() {
            let start = format!("knob-{}-{}-", effect.name, knob.name.replace('_', "-"));
            let own = names.iter().filter(|name| name.starts_with(&start));
            assert!(own.count() >= 1, "{start}");
        }
    }
}

#[test]
fn every_value_beyond_a_range_is_refused_with_an_error_that_says_so() {
    let frames = etalon_scenes::cases::case(knobs::FRAMES).unwrap();
    let refusals = knobs::refusals(frames);
    assert!(refusals.len() > 100, "{}", refusals.len());
    for refusal in &refusals {
        let error = refusal.error.as_ref().unwrap_or_else(|| {
            panic!(
                "{} takes {} = {}",
                refusal.effect, refusal.knob, refusal.value
            )
        });
        assert!(error.contains(&refusal.effect), "{error}");
        assert!(error.contains(&refusal.knob), "{error}");
    }
    for effect in ["ssr", "bloom", "exposure", "composite", "chain"] {
        assert!(
            refusals.iter().any(|refusal| refusal.effect == effect),
            "{effect}"
        );
    }
}

#[test]
fn two_runs_find_the_same() {
    let options = Options {
        cases: vec!["time-ten".to_owned(), "normal-nan".to_owned()],
        executors: vec![Kind::Cpu, Kind::Double, Kind::Shadow],
        ..Options::default()
    };
    let [first, second] = [(), ()].map(|()| run(&options, &mut ()).unwrap());
    assert_eq!(first, second);
}

#[test]
fn what_is_not_there_is_said() {
    let error = |options: Options| run(&options, &mut ()).unwrap_err().to_string();
    let unknown = error(Options {
        effects: vec!["blom".to_owned()],
        ..Options::default()
    });
    assert!(
        unknown.contains("no effect `blom`") && unknown.contains("bloom"),
        "{unknown}"
    );
    let unknown = error(Options {
        cases: vec!["no such case".to_owned()],
        ..Options::default()
    });
    assert!(unknown.contains("no such case"), "{unknown}");
}

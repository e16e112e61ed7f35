//! The report as files.

use std::collections::BTreeMap;
use std::path::Path;

use etalon_accuracy::model::{
    Executor, Fact, Metric, Outcome, Point, Spread, Subject, Sweep, Work,
};
use etalon_accuracy::report;
use etalon_accuracy::store::{self, StoreError};

use crate::made_up;

/// Rows and cells as RFC 4180 has them.
fn parse(csv: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut cell) = (Vec::new(), Vec::new(), String::new());
    let mut quoted = false;
    let mut characters = csv.chars().peekable();
    while let Some(character) = characters.next() {
        match (character, quoted) {
            ('"', true) if characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            ('"', _) => quoted = !quoted,
            (',', false) => row.push(std::mem::take(&mut cell)),
            ('\r', false) => assert_eq!(characters.peek(), Some(&'\n')),
            ('\n', false) => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            (other, _) => cell.push(other),
        }
    }
    assert!(cell.is_empty() && row.is_empty(), "the last line ends");
    rows
}

#[test]
fn the_table_has_a_row_for_each_point_on_each_executor() {
    let sweep = made_up::sweep();
    let rows = parse(&report::csv(&sweep));
    let header = &rows[0];
    assert!(rows.iter().all(|row| row.len() == header.len()));
    let column = |name: &str| header.iter().position(|known| known == name).unwrap();
    // Of bloom one point was not run by anybody.
    let expected: usize = sweep
        .subjects
        .iter()
        .flat_map(|subject| &subject.points)
        .map(|point| point.results.len().max(1))
        .sum();
    assert_eq!(rows.len() - 1, expected);
    let subject = &sweep.subjects[0];
    let point = &subject.points[17];
    let outcome = &point.results[1];
    let row = rows
        .iter()
        .find(|row| row[column("point")] == point.id && row[column("executor")] == outcome.executor)
        .unwrap();
    for (knob, value) in &point.settings {
        assert_eq!(&row[column(&format!("set:{knob}"))], value);
    }
    let number = |name: &str| row[column(name)].parse::<f64>().unwrap();
    let time = outcome.time.unwrap();
    assert_eq!(number("time median [ns]"), time.median);
    assert_eq!(number("time lower quartile [ns]"), time.lower);
    assert_eq!(number("time upper quartile [ns]"), time.upper);
    assert_eq!(
        number("error:algorithm.hit-median [px]"),
        outcome.errors["algorithm.hit-median"]
    );
    assert_eq!(
        number("error:algorithm.recall"),
        outcome.errors["algorithm.recall"]
    );
    assert_eq!(number("bytes"), point.bytes as f64);
    assert_eq!(
        row[column("error:rounding.relmse")],
        "",
        "of another effect"
    );
    assert_eq!(row[column("driver")], "Mesa 25.0.7");
    // Names that need quotes come back as they were.
    assert!(
        rows.iter()
            .any(|row| row[column("preset")] == "low, \"quoted\"")
    );
    assert!(
        rows.iter()
            .any(|row| row[column("scene")] == made_up::HOSTILE)
    );
    let default: Vec<&str> = rows
        .iter()
        .filter(|row| row[column("default")] == "yes")
        .map(|row| row[column("point")].as_str())
        .collect();
    assert_eq!(default.len(), 3 * 3, "two arithmetics of ssr, one of bloom");
    assert!(default.contains(&"levels6-tent"));
}

#[test]
fn what_is_written_can_be_read_again() {
    let sweep = made_up::sweep();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("deep/er");
    let page = report::write(&sweep, &folder).unwrap();
    assert_eq!(page, folder.join(report::PAGE));
    let text = std::fs::read_to_string(folder.join(store::FILE)).unwrap();
    let read: Sweep = serde_json::from_str(&text).unwrap();
    assert_eq!(read, sweep);
    // Again, over what is there.
    report::write(&read, &folder).unwrap();
    let names: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 3, "{names:?}");
}

/// A sweep of numbers that are none.
fn unsound() -> Sweep {
    let spread = |median| Spread {
        median,
        lower: f64::NAN,
        upper: f64::INFINITY,
        frames: 1,
    };
    let point = |number: usize, median: f64, error: f64| Point {
        id: number.to_string(),
        preset: Some("low".to_owned()),
        work: Work {
            steps_per_ray: Some(error),
            ..Work::default()
        },
        results: vec![Outcome {
            executor: "cpu".to_owned(),
            time: Some(spread(median)),
            errors: BTreeMap::from([("m".to_owned(), error), ("unknown".to_owned(), 1.0)]),
            ..Outcome::default()
        }],
        ..Point::default()
    };
    Sweep {
        executors: vec![Executor {
            id: "cpu".to_owned(),
            ..Executor::default()
        }],
        subjects: vec![Subject {
            metrics: vec![Metric {
                id: "m".to_owned(),
                name: "error".to_owned(),
                ..Metric::default()
            }],
            facts: vec![Fact {
                value: f64::NAN,
                ..Fact::default()
            }],
            points: vec![
                point(0, 1e6, f64::INFINITY),
                point(1, f64::NAN, 1.0),
                point(2, f64::INFINITY, f64::NAN),
                point(3, -1.0, -1.0),
                point(3, 0.0, 0.0),
            ],
            ..Subject::default()
        }],
        ..Sweep::default()
    }
}

#[test]
fn numbers_that_json_does_not_know_are_left_out_with_a_note() {
    let sweep = unsound();
    let folder = tempfile::tempdir().unwrap();
    report::write(&sweep, folder.path()).unwrap();
    let text = std::fs::read_to_string(folder.path().join(store::FILE)).unwrap();
    let read: Sweep = serde_json::from_str(&text).unwrap();
    let points = &read.subjects[0].points;
    assert_eq!(points.len(), 5);
    assert!(points[0].results[0].time.is_none());
    assert_eq!(
        points[0].results[0].errors,
        BTreeMap::from([("unknown".to_owned(), 1.0)])
    );
    assert_eq!(points[1].results[0].errors["m"], 1.0);
    assert_eq!(read.notes.len(), 4, "{:?}", read.notes);
    // The same notes are not told twice.
    let again = Sweep {
        notes: read.notes.clone(),
        ..sweep
    };
    report::write(&again, folder.path()).unwrap();
    let text = std::fs::read_to_string(folder.path().join(store::FILE)).unwrap();
    let read_again: Sweep = serde_json::from_str(&text).unwrap();
    assert_eq!(read_again.notes, read.notes);
    let page = std::fs::read_to_string(folder.path().join(report::PAGE)).unwrap();
    assert!(
        page.contains("2 errors are not finite") && page.contains("∞"),
        "{page}"
    );
}

#[test]
fn a_folder_that_cannot_be_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    for path in [file.join("below"), file] {
        let error = report::write(&Sweep::default(), &path).unwrap_err();
        assert!(matches!(&error, StoreError::File { .. }), "{error}");
    }
    assert!(!Path::new("index.html").exists());
}

#[test]
fn nothing_in_a_sweep_becomes_markup() {
    let page = report::render(&made_up::sweep());
    assert!(!page.contains("<b onclick"));
    // One script, and the data of each subject.
    assert_eq!(page.matches("<script").count(), 3);
    assert_eq!(page.matches("</script>").count(), 3);
    assert!(
        !page.contains("http://") && !page.contains("https://"),
        "no network"
    );
    for kind in ["Rounding", "Algorithm", "Model"] {
        assert_eq!(
            page.matches(&format!("<optgroup label=\"{kind}")).count(),
            2
        );
    }
    assert!(page.contains("not measured"));
    // Presets that lost are told, with what to take instead.
    assert!(page.contains("dominated</span> <span class=\"how\">by <a"));
}

#[test]
fn presets_are_held_against_settings_of_their_arithmetic() {
    let point = |id: &str, preset: Option<&str>, arithmetic: &str, median, error| Point {
        id: id.to_owned(),
        preset: preset.map(str::to_owned),
        arithmetic: arithmetic.to_owned(),
        results: vec![Outcome {
            executor: "cpu".to_owned(),
            time: Some(Spread {
                median,
                lower: median,
                upper: median,
                frames: 1,
            }),
            errors: BTreeMap::from([("m".to_owned(), error)]),
            ..Outcome::default()
        }],
        ..Point::default()
    };
    let mut sweep = unsound();
    let subject = &mut sweep.subjects[0];
    subject.points = vec![
        point("a", Some("low"), "strict", 2e6, 0.5),
        point("a-fast", Some("low"), "fast", 1e6, 0.5),
        point("b", None, "strict", 3e6, 0.4),
    ];
    let good = report::render(&sweep);
    assert!(good.contains("2 presets best for their time"), "{good}");
    // Half the time and less error, in the same arithmetic.
    sweep.subjects[0]
        .points
        .push(point("c", None, "strict", 1e6, 0.25));
    let bad = report::render(&sweep);
    assert!(bad.contains("1 of 2 presets dominated"), "{bad}");
    assert!(
        bad.contains(
            "data-point=\"c\" data-executor=\"cpu\">c</a>: 50 % less time, 50 % less error"
        ),
        "{bad}"
    );
}

#[test]
fn an_empty_sweep_is_a_page() {
    let page = report::render(&Sweep::default());
    assert!(page.contains("There are no subjects."));
    let bare = Sweep {
        subjects: vec![Subject::default()],
        ..Sweep::default()
    };
    let page = report::render(&bare);
    assert!(page.contains("No setting was tried.") && page.contains("No error was measured."));
    assert_eq!(parse(&report::csv(&bare)).len(), 1);
}

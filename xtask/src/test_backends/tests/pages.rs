//! The table, the JSON and the page.

use super::*;
use crate::test_backends::{html, table};

fn failing(folder: Option<&Path>) -> Report {
    let (good, bad) = (
        Fixture::new(&images()),
        Fixture::new(&with_noise("ssr/mix")),
    );
    report_of(&[Some(&good), Some(&good), Some(&bad)], folder)
}

#[test]
fn the_table_has_times_figures_and_the_failing_pass() {
    let text = table::render(&failing(None));
    let line = |start: &str| {
        text.lines()
            .find(|line| line.trim_start().starts_with(start))
            .unwrap_or_else(|| panic!("{start}: {text}"))
    };
    assert!(line("[3]").contains("ash/lavapipe"), "{text}");
    let march: Vec<_> = line("ssr/march").split_whitespace().collect();
    assert_eq!(
        march,
        [
            "ssr/march",
            "hit",
            "96×54",
            "rgba16float",
            "2.500",
            "2.500",
            "2.500",
            "0",
            "0",
            "0",
            "%",
            "0",
            "bit",
            "equal"
        ]
    );
    assert!(line("ssr/mix").ends_with('✗'), "{text}");
    assert!(line("all passes").contains("3.504"), "{text}");
    assert!(
        line("✗ ssr/mix `target`, frame 0, ash/lavapipe against cpu").contains("worst at x 3, y 2"),
        "{text}"
    );
    assert!(text.contains("NOT OK"), "{text}");
    let fixture = Fixture::new(&images());
    let text = table::render(&report_of(&[Some(&fixture); 3], None));
    assert!(
        text.contains("OK: all required backends ran and agree (9 comparisons)."),
        "{text}"
    );
    assert!(!text.contains("NOT OK") && !text.contains('✗'), "{text}");
}

/// Findings are shown with the executor they are of, and are no failure.
#[test]
fn the_table_has_what_checks_found() {
    let (mut watched, other) = (Fixture::new(&images()), Fixture::new(&images()));
    watched.run.findings = vec!["ssr/march: a.wesl:1:2: index 3 is outside of 2".into()];
    let report = report_of(&[Some(&watched), Some(&other), Some(&other)], None);
    let text = table::render(&report);
    let id = &report.executors[0].id;
    let line = format!("  {id} found ssr/march: a.wesl:1:2: index 3 is outside of 2\n");
    assert_eq!(text.matches(" found ").count(), 1, "{text}");
    assert!(text.contains(&line) && report.ok, "{text}");
}

#[test]
fn the_json_has_every_comparison() {
    let json = serde_json::to_value(failing(None)).unwrap();
    assert_eq!(json["ok"], false);
    let comparisons = json["comparisons"].as_array().unwrap();
    assert_eq!(comparisons.len(), 9);
    let failed: Vec<_> = comparisons
        .iter()
        .filter(|comparison| comparison["verdict"] == "fail")
        .collect();
    assert_eq!(failed.len(), 2);
    let failed = failed[0];
    for (key, value) in [
        ("scene", "test <scene>"),
        ("effect", "chain"),
        ("arithmetic", "strict"),
        ("pass", "ssr/mix"),
        ("binding", "target"),
        ("backend", "ash"),
        ("driver", "lavapipe"),
        ("reference", "cpu"),
    ] {
        assert_eq!(failed[key], value, "{key}");
    }
    assert_eq!(failed["tolerance"]["kind"], "bit-equal");
    assert!(
        failed["tolerance_reason"]
            .as_str()
            .unwrap()
            .contains("correctly rounded")
    );
    assert!(failed["why"].as_str().unwrap().starts_with("1 texel ("));
    assert_eq!(failed["figures"]["differing_texels"], 1);
    assert_eq!(failed["figures"]["worst"]["x"], 3);
    assert!(failed["figures"]["max_ulp"].as_u64().unwrap() > 0);
    assert!(failed["figures"]["flip"]["mean"].as_f64().unwrap() > 0.0);
    assert_eq!(json["runs"][2]["status"], "ran");
}

#[test]
fn the_page_escapes_what_it_shows_and_refers_to_pictures_that_exist() {
    let (_guard, folder) = page_folder("pages");
    let page = html::render(&failing(Some(&folder)));
    assert!(page.contains("test &lt;scene&gt;") && !page.contains("<scene>"));
    assert!(page.contains("a &quot;device&quot; &amp; more"));
    assert!(!page.contains("{{"));
    // Nothing from elsewhere.
    for outside in ["http:", "https:", "src=\"//", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    let sources: Vec<&str> = page
        .split("src=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert!(sources.len() > 10, "{sources:?}");
    for source in sources {
        assert!(folder.join(source).is_file(), "{source}");
    }
    // The failing output is open, and the last one.
    assert_eq!(page.matches("<details class=\"output\"").count(), 3);
    assert_eq!(page.matches(" open>").count(), 2);
}

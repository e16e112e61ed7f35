//! The page and the data.

use etalon_economy::model::Economy;
use etalon_economy::{report, table};

use crate::made_up;

#[test]
fn the_page_says_what_was_found_and_needs_no_network() {
    let economy = made_up::economy();
    let page = report::render(&economy);
    for part in [
        "a device of cpu &lt;b&gt;",
        "a note with &lt;angles&gt;",
        "97.0 %",
        "80.0 %",
        "1 % of the screen at most 8 %",
        "25.0 %",
        "5.00 MiB",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for network in ["http:", "https:", "//cdn", "@import", "url("] {
        assert!(!page.contains(network), "{network}");
    }
    assert_eq!(page.matches("<svg").count(), 3);
    // A rectangle of a hundredth takes 4 % where the aim is 8, all of it 103 %.
    assert_eq!(page.matches("badge good").count(), 6);
    assert_eq!(page.matches("badge bad").count(), 0);
}

#[test]
fn a_missed_aim_is_said_to_be_missed() {
    let mut economy = made_up::economy();
    for point in &mut economy.sweeps[0].points {
        point.ratio.median += 0.1;
    }
    let page = report::render(&economy);
    assert_eq!(page.matches("class=\"badge bad\"").count(), 2);
    assert!(table::text(&economy).contains("missed: 1 % of the screen"));
}

#[test]
fn data_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let economy = made_up::economy();
    let page = report::write(&economy, &folder.path().join("new/folder")).unwrap();
    assert!(page.ends_with("new/folder/index.html"));
    let data = std::fs::read_to_string(page.with_file_name(report::DATA)).unwrap();
    let read: Economy = serde_json::from_str(&data).unwrap();
    assert_eq!(read.scene, economy.scene);
    assert_eq!(read.sweeps.len(), economy.sweeps.len());
    report::charts(&economy, &folder.path().join("charts")).unwrap();
    let chart = folder.path().join("charts/economy-ash.svg");
    assert!(std::fs::read_to_string(chart).unwrap().contains("<style>"));
}

#[test]
fn what_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let error = report::write(&Economy::default(), &file.join("below")).unwrap_err();
    assert!(error.to_string().contains("file/below"), "{error}");
}

#[test]
fn nothing_found_is_a_page_as_well() {
    let page = report::render(&Economy::default());
    assert!(page.contains("</html>"));
    assert!(!table::text(&Economy::default()).is_empty());
}

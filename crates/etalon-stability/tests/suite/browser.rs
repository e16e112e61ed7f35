//! The page in a real browser, where there is one.
//!
//! Without a Chromium the test says so and passes, unless `ETALON_REQUIRE` lists
//! `chromium`.

use std::process::Command;

use etalon_stability::executors::Kind;
use etalon_stability::model::Report;
use etalon_stability::plant::{Fault, Plant};
use etalon_stability::report;
use etalon_stability::run::{Options, run};

/// Gathers errors from before anything else runs.
const WATCH: &str = r#"<script>
window.foundErrors = [];
addEventListener("error", (event) => window.foundErrors.push(event.message || "a resource did not load"), true);
</script>
"#;

/// Filters as a user would, and writes down what became of it.
const PROBE: &str = r##"<script>
const found = { errors: window.foundErrors, ready: document.documentElement.dataset.ready };
const all = [...document.querySelectorAll("#cases tbody tr")];
found.rows = all.length;
found.first = all[0]?.textContent ?? "";
found.bad = all.map((row) => row.classList.contains("bad"));
const input = document.querySelector("#filter");
input.value = "bloom one texel";
input.dispatchEvent(new Event("input"));
found.kept = all.filter((row) => row.checkVisibility()).map((row) => row.querySelector("strong").textContent);
found.shown = document.querySelector("#shown").textContent;
const result = document.createElement("pre");
result.id = "found";
result.textContent = JSON.stringify(found);
document.body.append(result);
</script>
"##;

fn browser() -> Option<&'static str> {
    let runs = |program: &&str| {
        Command::new(program)
            .arg("--version")
            .output()
            .is_ok_and(|output| output.status.success())
    };
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(runs)
}

/// What the page's probe found; `None` if there is no browser.
fn open(found: &Report) -> Option<serde_json::Value> {
    let Some(browser) = browser() else {
        let required = std::env::var("ETALON_REQUIRE")
            .is_ok_and(|list| list.split(',').any(|one| one.trim() == "chromium"));
        assert!(
            !required,
            "ETALON_REQUIRE asks for `chromium`: there is none"
        );
        eprintln!("no Chromium here: the page was not opened");
        return None;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = report::write(found, folder.path()).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    let probed = page
        .replacen("<head>", &format!("<head>{WATCH}"), 1)
        .replace("</body>", &format!("{PROBE}</body>"));
    std::fs::write(&path, probed).unwrap();
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--window-size=1600,1000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let text = dom
        .rsplit_once("<pre id=\"found\">")
        .and_then(|(_, rest)| rest.split("</pre>").next())
        .unwrap_or_else(|| panic!("no result: {}", String::from_utf8_lossy(&output.stderr)))
        .replace("&quot;", "\"")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    Some(serde_json::from_str(&text).unwrap())
}

#[test]
fn the_worst_case_comes_first_and_words_filter() {
    let options = Options {
        cases: vec!["size-1x1".to_owned(), "size-3x3".to_owned()],
        executors: vec![Kind::Cpu, Kind::Double],
        // What the first stores is held to the truth as well.
        plant: Some(Plant {
            executor: Kind::Double,
            fault: Fault::Nan,
        }),
        ..Options::default()
    };
    let report = run(&options, &mut ()).unwrap();
    let Some(found) = open(&report) else {
        return;
    };
    assert_eq!(found["errors"], serde_json::json!([]), "{found:#}");
    assert_eq!(found["ready"], "true", "{found:#}");
    assert_eq!(found["rows"], report.cases.len(), "{found:#}");
    // A picture of 8 bits cannot hold the fault: its two rows come last.
    let bad: Vec<bool> = serde_json::from_value(found["bad"].clone()).unwrap();
    assert!(bad[0] && bad.is_sorted_by(|a, b| a >= b), "{bad:?}");
    assert!(bad.iter().any(|bad| !bad), "{bad:?}");
    assert!(
        found["first"].as_str().unwrap().contains("no numbers"),
        "{found:#}"
    );
    assert_eq!(found["kept"], serde_json::json!(["size-1x1"]), "{found:#}");
    assert_eq!(found["shown"], format!("1 of {}", report.cases.len()));
}

#[test]
fn a_page_of_nothing_runs() {
    let Some(found) = open(&Report::default()) else {
        return;
    };
    assert_eq!(found["errors"], serde_json::json!([]), "{found:#}");
    assert_eq!(found["rows"], 0);
}

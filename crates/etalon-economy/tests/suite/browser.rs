//! The page in a real browser, where there is one.
//!
//! Without a Chromium the test says so and passes, unless `ETALON_REQUIRE` lists
//! `chromium`.

use std::process::Command;

use etalon_economy::report;

use crate::made_up;

/// Gathers errors from before anything else runs.
const WATCH: &str = r#"<script>
window.foundErrors = [];
addEventListener("error", (event) => window.foundErrors.push(event.message || "a resource did not load"), true);
</script>
"#;

/// Looks at the page as a reader would, and writes down what is there.
const PROBE: &str = r#"
<script>
const found = { errors: window.foundErrors };
try {
  const visible = (selector) => [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility());
  const box = (one) => one.getBoundingClientRect();
  found.charts = visible("figure.chart svg").map((one) => box(one).width > 300 && box(one).height > 150);
  found.badges = visible(".badge.good").length;
  found.rows = visible("table.conclusions tbody tr").length;
  found.frames = visible("table.frames tbody tr").length;
  found.pointsHidden = visible("table.points").length;
  document.querySelectorAll("details").forEach((one) => { one.open = true; });
  found.points = visible("table.points tbody tr").length;
  // Every point stands within its chart, and the time on tiles rises with the share.
  const svg = document.querySelector("figure.chart svg");
  const dots = [...svg.querySelectorAll("circle.compact")].filter((one) => one.querySelector("title"));
  const places = dots.map((one) => [one.cx.baseVal.value, one.cy.baseVal.value]);
  found.rising = places.every(([x, y], i) => i === 0 || (x > places[i - 1][0] && y < places[i - 1][1]));
  const frame = box(svg);
  found.inside = [...svg.querySelectorAll("circle, text")].every((one) => {
    const own = box(one);
    return own.left >= frame.left - 1 && own.right <= frame.right + 1 && own.top >= frame.top - 1 && own.bottom <= frame.bottom + 1;
  });
  found.requests = performance.getEntriesByType("resource").map((one) => one.name).filter((name) => !name.startsWith("data:"));
  found.wide = document.documentElement.scrollWidth <= document.documentElement.clientWidth;
} catch (error) {
  found.errors.push(String(error.stack ?? error));
}
const result = document.createElement("pre");
result.id = "found";
result.textContent = JSON.stringify(found);
document.body.append(result);
</script>
"#;

/// A Chromium of this machine.
fn browser() -> Option<&'static str> {
    let runs = |program: &&str| {
        let output = Command::new(program).arg("--version").output();
        output.is_ok_and(|output| output.status.success())
    };
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(runs)
}

#[test]
fn the_page_is_whole_and_in_its_place() {
    let Some(browser) = browser() else {
        let required = std::env::var("ETALON_REQUIRE")
            .is_ok_and(|list| list.split(',').any(|one| one.trim() == "chromium"));
        assert!(
            !required,
            "ETALON_REQUIRE asks for `chromium`: there is none"
        );
        eprintln!("no Chromium here: the page was not opened");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let page = report::write(&made_up::economy(), folder.path()).unwrap();
    let text = std::fs::read_to_string(&page).unwrap();
    let probed = text
        .replacen("<head>", &format!("<head>{WATCH}"), 1)
        .replace("</body>", &format!("{PROBE}</body>"));
    let path = folder.path().join("probed.html");
    std::fs::write(&path, probed).unwrap();
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--window-size=1400,1000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let found = dom.split_once("<pre id=\"found\">{");
    let found = found.and_then(|(_, rest)| rest.split("</pre>").next());
    let found = found
        .unwrap_or_else(|| panic!("no result: {}", String::from_utf8_lossy(&output.stderr)))
        .replace("&quot;", "\"")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    let found: serde_json::Value = serde_json::from_str(&format!("{{{found}")).unwrap();
    let expected = serde_json::json!({
        "errors": [],
        "charts": [true, true, true],
        "badges": 6,
        "rows": 6,
        "frames": 2,
        "pointsHidden": 0,
        "points": 72,
        "rising": true,
        "inside": true,
        "requests": [],
        "wide": true,
    });
    assert_eq!(found, expected);
}

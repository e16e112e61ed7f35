//! The page in a real browser, where there is one.
//!
//! Without a Chromium the test says so and passes, unless `ETALON_REQUIRE` lists
//! `chromium`.

use std::process::Command;

use etalon_accuracy::model::Sweep;
use etalon_accuracy::report;

use crate::made_up;

/// Gathers errors from before anything else runs.
const WATCH: &str = r#"<script>
window.foundErrors = [];
addEventListener("error", (event) => window.foundErrors.push(event.message || "a resource did not load"), true);
addEventListener("unhandledrejection", (event) => window.foundErrors.push(String(event.reason)));
</script>
"#;

/// Operates the first subject as a user would, and writes down what became of it.
const PROBE: &str = r#"
<script>
const found = { errors: window.foundErrors };
try {
  found.ready = document.documentElement.dataset.ready;
  const section = document.querySelector(".subject");
  const panel = section.querySelector(".panel");
  const visible = (selector) => [...section.querySelectorAll(selector)].filter((one) => one.checkVisibility());
  const point = (figure, id) => figure.querySelector(`.point[data-point="${id}"]`);
  const image = () => panel.querySelector("img")?.getAttribute("src") ?? null;
  found.charts = visible("figure.chart").length;
  found.shownMetric = visible(".about strong").map((one) => one.textContent);
  const [first, second] = visible("figure.chart");
  const one = point(first, "steps32-refine2-thick0.05-fast");
  one.dispatchEvent(new PointerEvent("pointerenter"));
  found.hovered = panel.innerText;
  found.hoveredPicture = image();
  found.marked = section.querySelectorAll(".point.chosen").length;
  point(second, "steps256-refine8-thick0.2-strict").focus();
  found.focused = panel.innerText;
  found.focusedPicture = image();
  // A click keeps what is shown, whatever is pointed at next; Escape does not.
  one.dispatchEvent(new MouseEvent("click", { bubbles: true }));
  point(first, "steps8-refine0-thick0.8-strict").dispatchEvent(new PointerEvent("pointerenter"));
  found.kept = panel.querySelector("p.muted").textContent;
  const select = section.querySelector("select.metric");
  select.value = "2";
  select.dispatchEvent(new Event("change", { bubbles: true }));
  found.otherMetric = visible(".about strong").map((one) => one.textContent);
  found.otherCharts = visible("figure.chart").length;
  found.switched = panel.querySelector("tr.chosen").textContent;
  dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
  found.released = panel.innerText;
  point(visible("figure.chart")[0], "steps8-refine0-thick0.8-strict").dispatchEvent(new PointerEvent("pointerenter"));
  found.hoveredAnew = image();
  // Pointing beside a point is pointing at it: at the one furthest from all others.
  const svg = visible("figure.chart")[0].querySelector("svg");
  const middle = (one) => {
    const box = one.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
  };
  const all = [...svg.querySelectorAll(".point")].map((one) => ({ one, at: middle(one) }));
  const apart = (a, b) => Math.hypot(a.at[0] - b.at[0], a.at[1] - b.at[1]);
  for (const point of all) point.alone = Math.min(...all.filter((other) => other !== point).map((other) => apart(point, other)));
  const lonely = all.reduce((best, point) => (point.alone > best.alone ? point : best));
  const [x, y] = lonely.at;
  svg.dispatchEvent(new PointerEvent("pointermove", { clientX: x + lonely.alone * 0.45, clientY: y }));
  found.near = [lonely.alone > 5, section.querySelector(".sortable tr.chosen").dataset.point === lonely.one.dataset.point];
  // Sorting.
  const table = section.querySelector("table.sortable");
  const heading = [...table.tHead.rows[0].cells].find((cell) => cell.textContent === "Time");
  const times = () => [...table.tBodies[0].rows].map((row) => row.cells[heading.cellIndex].dataset.value)
    .map((value) => (value === undefined ? Infinity : Number(value)));
  const sorted = (values) => values.every((value, place) => place === 0 || values[place - 1] <= value);
  found.before = sorted(times());
  heading.querySelector("button").click();
  found.ascending = sorted(times());
  heading.querySelector("button").click();
  found.descending = sorted(times().filter(Number.isFinite).reverse()) && times().at(-1) === Infinity;
  // Filters.
  const rows = () => [...table.tBodies[0].rows].filter((row) => row.checkVisibility()).length;
  const allRows = rows();
  const filter = section.querySelector(".of-executor");
  filter.value = "ash";
  filter.dispatchEvent(new Event("change"));
  const ofOne = rows();
  const only = section.querySelector(".only-kept");
  only.checked = true;
  only.dispatchEvent(new Event("change"));
  found.rows = [allRows, ofOne, rows()];
  found.badges = visible(".standing .badge").every((badge) => badge.dataset.metric === "2");
  // What dominates a preset can be followed.
  const link = section.querySelector("table.presets .to-point");
  link.click();
  found.followed = section.querySelector(".sortable tr.chosen").dataset.point === link.dataset.point;
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
        Command::new(program)
            .arg("--version")
            .output()
            .is_ok_and(|output| output.status.success())
    };
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(runs)
}

/// What a page's probe found; `None` if there is no browser.
fn open(sweep: &Sweep, probe: &str) -> Option<serde_json::Value> {
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
    let page = report::write(sweep, folder.path()).unwrap();
    made_up::draw(sweep, folder.path());
    let page = std::fs::read_to_string(page).unwrap();
    let probed = page
        .replacen("<head>", &format!("<head>{WATCH}"), 1)
        .replace("</body>", &format!("{probe}</body>"));
    let path = folder.path().join("probed.html");
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
    let found = dom
        .rsplit("<pre id=\"found\">")
        .next()
        .filter(|_| dom.contains("<pre id=\"found\">"))
        .and_then(|rest| rest.split("</pre>").next());
    let found = found
        .unwrap_or_else(|| panic!("no result: {}", String::from_utf8_lossy(&output.stderr)))
        .replace("&quot;", "\"")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    Some(serde_json::from_str(&found).unwrap())
}

#[test]
fn a_point_shows_all_about_itself_and_errors_can_be_chosen() {
    let sweep = made_up::sweep();
    let Some(found) = open(&sweep, PROBE) else {
        return;
    };
    assert_eq!(found["errors"], serde_json::json!([]), "{found:#}");
    assert_eq!(found["ready"], "true", "{found:#}");
    assert_eq!(found["charts"], 3, "{found:#}");
    assert_eq!(
        found["shownMetric"],
        serde_json::json!(["Algorithm: hit position, median"])
    );
    let has = |what: &str, parts: &[&str]| {
        let text = found[what].as_str().unwrap().replace(['\t', '\n'], " ");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in parts {
            assert!(text.contains(part), "{what}: {part}: {text}");
        }
    };
    has(
        "hovered",
        &[
            "steps32-refine2-thick0.05-fast",
            "cpu/avx2 · fast",
            "max_steps 32",
            "refine 2",
            "thickness 0.05 m",
            "over 24 frames",
            "HDR-FLIP, mean",
            "texel fetches",
            "47.5 MiB",
        ],
    );
    assert_eq!(
        found["hoveredPicture"],
        "pictures/steps32-refine2-thick0.05-fast.png"
    );
    // The same point in each of three charts, of the metric shown and the two others
    // that the page has from the start.
    assert_eq!(found["marked"], 9);
    has(
        "focused",
        &["ultra", "wgpu · strict", "max_steps 256", "refine 8"],
    );
    assert_eq!(
        found["focusedPicture"],
        "pictures/steps256-refine8-thick0.2-strict.png"
    );
    has(
        "kept",
        &["steps32-refine2-thick0.05-fast", "kept"].map(|part| {
            if part == "kept" {
                "kept; Escape lets go"
            } else {
                "cpu/avx2"
            }
        }),
    );
    assert_eq!(
        found["otherMetric"],
        serde_json::json!(["Algorithm: hits found"])
    );
    assert_eq!(found["otherCharts"], 3);
    has("switched", &["hits found"]);
    has("released", &["Point at a setting"]);
    assert_eq!(
        found["hoveredAnew"],
        "pictures/steps8-refine0-thick0.8-strict.png"
    );
    assert_eq!(found["near"], serde_json::json!([true, true]));
    assert_eq!(
        [&found["before"], &found["ascending"], &found["descending"]],
        [false, true, true]
    );
    let rows = &found["rows"];
    assert_eq!((&rows[0], &rows[1]), (&432.into(), &144.into()), "{rows}");
    assert!(
        rows[2].as_u64().is_some_and(|kept| kept > 3 && kept < 100),
        "{rows}"
    );
    assert_eq!(found["badges"], true);
    assert_eq!(found["followed"], true);
    assert_eq!(found["wide"], true, "the page scrolls sideways");
}

#[test]
fn a_page_of_nothing_runs() {
    let probe = r#"<script>
      const result = document.createElement("pre");
      result.id = "found";
      result.textContent = JSON.stringify({ errors: window.foundErrors, ready: document.documentElement.dataset.ready });
      document.body.append(result);
    </script>"#;
    let bare = Sweep {
        subjects: vec![etalon_accuracy::model::Subject::default()],
        ..Sweep::default()
    };
    for sweep in [Sweep::default(), bare] {
        let Some(found) = open(&sweep, probe) else {
            return;
        };
        assert_eq!(found["errors"], serde_json::json!([]), "{found}");
        assert_eq!(found["ready"], "true", "{found}");
    }
}

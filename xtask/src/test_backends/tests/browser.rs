//! The page in a real browser, where there is one.

use std::process::Command;

use super::*;
use crate::test_backends::html;

/// Moves the slider and changes a selection as a user would, and writes down
/// what became of it, and every error on the way.
const PROBE: &str = r#"
<script>
const found = { errors: window.foundErrors };
try {
  const wipe = document.querySelector(".wipe");
  const stage = wipe.querySelector(".stage");
  const slider = wipe.querySelector(".slider");
  found.ready = document.documentElement.dataset.ready;
  found.before = stage.style.getPropertyValue("--place");
  slider.value = "25";
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  found.after = stage.style.getPropertyValue("--place");
  found.clip = getComputedStyle(stage.querySelector(".over")).clipPath;
  const [left, right] = wipe.querySelectorAll("select");
  right.selectedIndex = right.options.length - 1;
  right.dispatchEvent(new Event("change", { bubbles: true }));
  found.shown = stage.querySelector(".over").getAttribute("src") === right.value;
  const open = document.querySelectorAll("details[open]").length;
  dispatchEvent(new Event("beforeprint"));
  found.opened = [open, document.querySelectorAll("details[open]").length];
  const filter = document.getElementById("only-differing");
  filter.checked = true;
  filter.dispatchEvent(new Event("change"));
  found.visible = [...document.querySelectorAll("details")].filter((one) => one.offsetParent !== null).length;
  found.broken = [...document.images].filter((image) => image.complete && image.naturalWidth === 0).length;
} catch (error) {
  found.errors.push(String(error));
}
const result = document.createElement("pre");
result.id = "found";
result.textContent = JSON.stringify(found);
document.body.append(result);
</script>
"#;

/// Gathers errors from before anything else runs.
const WATCH: &str = r#"<script>
window.foundErrors = [];
addEventListener("error", (event) => window.foundErrors.push(event.message || "a resource did not load"), true);
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

#[test]
fn the_page_runs_without_errors_and_its_slider_works() {
    let Some(browser) = browser() else {
        eprintln!("no Chromium here: the page was not opened");
        return;
    };
    let (_guard, folder) = page_folder("browser");
    let (good, bad) = (
        Fixture::new(&images()),
        Fixture::new(&with_noise("ssr/mix")),
    );
    let report = report_of(&[Some(&good), Some(&good), Some(&bad)], Some(&folder));
    let page = html::render(&report);
    std::fs::write(folder.join("index.html"), &page).unwrap();
    let probed = page
        .replacen("<head>", &format!("<head>{WATCH}"), 1)
        .replace("</body>", &format!("{PROBE}</body>"));
    let path = folder.join("probed.html");
    std::fs::write(&path, probed).unwrap();
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let found = dom
        .split("<pre id=\"found\">")
        .nth(1)
        .and_then(|rest| rest.split("</pre>").next());
    let found = found.unwrap_or_else(|| {
        panic!(
            "no result: {dom}\n{}",
            String::from_utf8_lossy(&output.stderr)
        )
    });
    let found: serde_json::Value =
        serde_json::from_str(&found.replace("&quot;", "\"").replace("&amp;", "&")).unwrap();
    assert_eq!(found["errors"].as_array().map(Vec::len), Some(0), "{found}");
    assert_eq!(found["ready"], "true", "{found}");
    assert_eq!(
        (&found["before"], &found["after"]),
        (&"50%".into(), &"25%".into()),
        "{found}"
    );
    assert_eq!(found["clip"], "inset(0px 0px 0px 25%)", "{found}");
    assert_eq!(found["shown"], true, "{found}");
    assert_eq!(found["opened"], serde_json::json!([2, 3]), "{found}");
    assert_eq!(found["visible"], 1, "{found}");
    assert_eq!(found["broken"], 0, "{found}");
}

//! The command line.

use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_etalon-economy"))
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn what_is_wrong_with_arguments_is_said() {
    for (arguments, message) in [
        (&["--size", "640"][..], "`640` is no size like 640x360"),
        (&["--size", "0x5"], "not possible"),
        (&["--size", "8192x4096"], "at most 8294400 are swept"),
        (&["--scene", "nowhere"], "there is no scene `nowhere`"),
        (&["--tiles", "7"], "there are 8, 16, 32, 64"),
        (&["--tiles", "off"], "there are 8, 16, 32, 64"),
        (&["--backend", "metal"], "there is no backend `metal`"),
        (&["--budget-minutes", "NaN"], "no time that can be waited"),
        (&["--budget-minutes", "-1"], ""),
        (&["--frames", "many"], "many"),
        (&["--nonsense"], "--nonsense"),
    ] {
        let output = run(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{arguments:?}");
        assert!(error.contains(message), "{arguments:?}: {error}");
        assert!(!error.contains("panicked"), "{arguments:?}: {error}");
    }
}

#[test]
fn a_small_sweep_writes_what_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let output = run(&[
        "--backend",
        "cpu",
        "--size",
        "48x27",
        "--frames",
        "3",
        "--budget-minutes",
        "0",
        "--report",
        &file("report"),
        "--json",
        &file("economy.json"),
        "--crossover",
        &file("crossover.json"),
        "--charts",
        &file("charts"),
    ]);
    let text = String::from_utf8_lossy(&output.stdout);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(
        text.contains("cpu, compact") && text.contains("cpu, scattered"),
        "{text}"
    );
    for name in [
        "report/index.html",
        "economy.json",
        "crossover.json",
        "charts/economy-cpu.svg",
    ] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    let crossover = std::fs::read_to_string(file("crossover.json")).unwrap();
    let cost: etalon_effects::tiles::crossover::Cost = serde_json::from_str(&crossover).unwrap();
    assert!(cost.whole > 0.0);
}

//! The command as a user runs it, with and without planted faults.
//!
//! Where there is no lavapipe, there is nothing to compare the interpreter
//! with; the tests then say so and end.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Runs the command on a small picture with lavapipe alone.
fn test_backends(arguments: &[&str]) -> (Output, Value) {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("report.json");
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args([
            "test-backends",
            "--scene",
            "wet-floor",
            "--size",
            "96x54",
            "--frames",
            "1",
        ])
        .args(["--drivers", "lavapipe", "--json"])
        .arg(&json)
        .args(arguments)
        .output()
        .unwrap();
    let text = std::fs::read_to_string(&json).unwrap_or_else(|_| "null".to_owned());
    (output, serde_json::from_str(&text).unwrap())
}

/// Whether this machine has lavapipe.
fn lavapipe() -> bool {
    let found = xtask::drivers::find(&xtask::drivers::Environment::of_process());
    let there = found.drivers.iter().any(|driver| driver.name == "lavapipe");
    if !there {
        eprintln!("no lavapipe here: nothing was compared");
    }
    there
}

/// The problems of a report, after checking that it is one that failed.
fn problems((output, report): &(Output, Value)) -> Vec<String> {
    assert_eq!(
        output.status.code(),
        Some(1),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    assert_eq!(report["ok"], false);
    report["problems"]
        .as_array()
        .unwrap()
        .iter()
        .map(|problem| problem.as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn backends_agree_and_faults_are_found_where_they_were_planted() {
    if !lavapipe() {
        return;
    }
    let (output, report) = test_backends(&[]);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    assert_eq!(report["ok"], true);
    assert!(report["comparisons"].as_array().unwrap().len() > 30);

    // A constant changed by one part in 1024, in one kernel of one executor.
    let plant = "wgpu/lavapipe=constant:bloom/threshold:luminance(exposed):luminance(exposed * 1.0009765625)";
    let found = problems(&test_backends(&["--plant", plant]));
    assert!(
        found[0].starts_with("wgpu/lavapipe disagrees with cpu"),
        "{found:?}"
    );
    assert!(
        found[0].contains("first in pass `bloom/threshold`"),
        "{found:?}"
    );
    // ash is as it should be, and so disagrees with wgpu.
    assert!(
        !found
            .iter()
            .any(|problem| problem.starts_with("ash/lavapipe disagrees with cpu")),
        "{found:?}"
    );
    assert!(
        found
            .iter()
            .any(|problem| problem.starts_with("ash/lavapipe disagrees with wgpu/lavapipe")),
        "{found:?}"
    );

    // Two bindings swapped.
    let found = problems(&test_backends(&[
        "--plant",
        "ash/lavapipe=swap:ssr/mix:sharp:blurred",
    ]));
    assert!(
        found[0].starts_with("ash/lavapipe disagrees with cpu"),
        "{found:?}"
    );
    assert!(found[0].contains("first in pass `ssr/mix`"), "{found:?}");

    // One bit of one texel, in the reference itself.
    let found = problems(&test_backends(&[
        "--plant",
        "cpu=texel:bloom/upsample#2:result",
    ]));
    assert_eq!(found.len(), 2, "{found:?}");
    for (problem, subject) in found.iter().zip(["wgpu/lavapipe", "ash/lavapipe"]) {
        assert!(
            problem.starts_with(&format!("{subject} disagrees with cpu")),
            "{found:?}"
        );
        assert!(
            problem.contains("first in pass `bloom/upsample#2`, output `result`, frame 0: 1 texel"),
            "{found:?}"
        );
        assert!(problem.contains("; 1 of "), "{found:?}");
    }

    // A driver that takes its process with it.
    let found = problems(&test_backends(&["--plant", "ash/lavapipe=crash"]));
    assert!(found[0].starts_with("ash/lavapipe crashed"), "{found:?}");
    assert!(found[0].contains("crashing on purpose"), "{found:?}");
    assert!(found[1].starts_with("ash ran on no driver"), "{found:?}");
}

#[test]
fn the_interpreter_alone_is_enough_if_nothing_else_is_required() {
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args([
            "test-backends",
            "--scene",
            "mirror-planes",
            "--size",
            "16x9",
            "--frames",
            "1",
            "--require",
            "cpu",
        ])
        // A machine without any driver.
        .env("VK_DRIVER_FILES", "/nowhere/none.json")
        .env("VK_ICD_FILENAMES", "/nowhere/none.json")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("/nowhere/none.json"), "{text}");
    // And with the default requirements it is not, and the way out is told.
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args([
            "test-backends",
            "--scene",
            "mirror-planes",
            "--size",
            "16x9",
            "--frames",
            "1",
            "--effect",
            "composite",
        ])
        .args(["--drivers", "all"])
        .env("VK_DRIVER_FILES", "/nowhere/none.json")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains(
            "ash ran on no driver; to install drivers: cargo xtask test-backends --setup"
        ),
        "{text}"
    );
}

#[test]
fn a_frame_from_a_file_is_as_good_as_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let size = etalon_scenes::FrameSize::new(32, 18).unwrap();
    let frame = etalon_scenes::scene("mirror-planes")
        .unwrap()
        .frame(size)
        .unwrap();
    etalon_scenes::exr_frame::save_exr(&frame, &path).unwrap();
    let json = folder.path().join("report.json");
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["test-backends", "--require", "cpu", "--input"])
        .arg(&path)
        .arg("--json")
        .arg(&json)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(
        report["settings"]["scenes"],
        serde_json::json!(["frame.exr"])
    );
    assert_eq!(
        (&report["settings"]["width"], &report["settings"]["height"]),
        (&32.into(), &18.into())
    );
    assert_eq!(
        (&report["runs"][0]["executor"], &report["runs"][0]["status"]),
        (&"cpu".into(), &"ran".into())
    );
}

#[test]
fn mistakes_on_the_command_line_are_explained() {
    for (arguments, message) in [
        (
            &["--scene", "nowhere"][..],
            "there is no scene `nowhere`; there are wet-floor",
        ),
        (
            &["--effect", "magic"],
            "there is no effect `magic`; there are ssr",
        ),
        (
            &["--drivers", "voodoo"],
            "there is no driver `voodoo`; there are",
        ),
        (&["--input", "/nowhere/frame.exr"], "/nowhere/frame.exr"),
        (&["--plant", "vax=crash"], "there is no executor `vax`"),
        (
            &["--plant", "cpu=explode"],
            "it is none of constant:KERNEL:FROM:TO",
        ),
        (&["--size", "0x9"], "a size is a width and a height"),
        (&["--frames", "0"], "invalid value '0'"),
        (&["--require", "gpu"], "invalid value 'gpu'"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
            .arg("test-backends")
            .args(arguments)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{arguments:?}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
}

#[test]
fn a_report_that_cannot_be_written_is_an_error() {
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args([
            "test-backends",
            "--scene",
            "mirror-planes",
            "--size",
            "8x8",
            "--report",
            "/dev/null/report",
        ])
        .output()
        .unwrap();
    assert!(!output.status.success());
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(
        text.contains("/dev/null/report") && Path::new("/dev/null").exists(),
        "{text}"
    );
}

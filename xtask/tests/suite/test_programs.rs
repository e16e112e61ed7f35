//! `test-programs` as a user runs it, with and without a planted fault.

use std::path::Path;
use std::process::{Command, Output};

use etalon_tests::programs::Trial;

/// Tries a few programs on the interpreter, and on lavapipe where that is.
fn test_programs(keep: &Path, arguments: &[&str]) -> Output {
    let found = xtask::drivers::find(&xtask::drivers::Environment::of_process());
    let lavapipe = found.drivers.iter().any(|driver| driver.name == "lavapipe");
    // OpenGL is left out by the command, so this is the interpreter alone.
    let drivers = if lavapipe { "lavapipe" } else { "gl" };
    Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["test-programs", "--count", "6", "--drivers", drivers])
        .arg("--keep")
        .arg(keep)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn programs_agree_and_nothing_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let keep = folder.path().join("kept");
    let output = test_programs(&keep, &["--require", "cpu"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(
        text.contains("cpu: 6 agreed, 0 left out, 0 known to differ, 0 failed"),
        "{text}"
    );
    assert!(!keep.exists());
}

#[test]
fn a_planted_fault_is_found_shrunk_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let output = test_programs(folder.path(), &["--plant", "cpu: * => + "]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("NOT OK") && text.contains("statements left"),
        "{text}"
    );
    let mut kept = 0;
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let trial: Trial = text.parse().unwrap();
        assert!(
            text.starts_with("// Seed ") && text.contains("and not 0x"),
            "{text}"
        );
        if path.to_string_lossy().ends_with("-whole.wgsl") {
            continue;
        }
        kept += 1;
        // The fault is in what is left, and there is little of it.
        assert!(trial.wgsl.contains(" * "), "{text}");
        assert!(trial.wgsl.lines().count() < 40, "{text}");
    }
    assert!(kept > 0);
}

#[test]
fn what_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let output = test_programs(folder.path(), &["--plant", "cpu"]);
    assert_eq!(output.status.code(), Some(2));
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["test-programs", "--count", "1", "--drivers", "abacus"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("no driver `abacus`"), "{text}");
}

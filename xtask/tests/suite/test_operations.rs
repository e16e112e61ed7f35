//! The command as a user runs it, with and without a planted fault.
//!
//! Where there is no lavapipe, only the interpreter is run.

use std::process::{Command, Output};

use serde_json::Value;

/// Runs the command on some operations and gives its report too.
fn test_operations(arguments: &[&str]) -> (Output, Value) {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("operations.json");
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["test-operations", "--json"])
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
    found.drivers.iter().any(|driver| driver.name == "lavapipe")
}

#[test]
fn operations_are_run_on_a_driver_and_a_wrong_bit_is_found() {
    if !lavapipe() {
        eprintln!("no lavapipe here: nothing was compared");
        return;
    }
    let chosen = ["--operation", "a + b, f32", "--drivers", "lavapipe"];
    let required = ["--require", "cpu,wgpu,ash"];
    let (output, report) = test_operations(&[&chosen[..], &required[..]].concat());
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert_eq!(
        report["executors"],
        serde_json::json!(["cpu", "wgpu/lavapipe", "ash/lavapipe"])
    );
    // Strict and fast on three executors.
    assert_eq!(report["entries"].as_array().unwrap().len(), 6);
    assert!(text.contains("a + b, f32"), "{text}");

    let plant = ["--plant", "ash/lavapipe=a + b, f32"];
    let (output, report) = test_operations(&[&chosen[..], &plant[..]].concat());
    assert_eq!(output.status.code(), Some(1));
    let problems = report["problems"].as_array().unwrap();
    assert!(!problems.is_empty());
    for problem in problems {
        let problem = problem.as_str().unwrap();
        assert!(problem.contains("a + b, f32 on ash/lavapipe"), "{problem}");
        assert!(problem.contains("1 results, the first of 0x"), "{problem}");
    }
}

#[test]
fn what_is_not_there_is_an_error() {
    for (arguments, message) in [
        (
            ["--operation", "no such thing"],
            "no operation's name contains",
        ),
        (["--drivers", "no-such-driver"], "there is no driver"),
    ] {
        let (output, report) = test_operations(&arguments);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(report, Value::Null);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(message), "{said}");
    }
}

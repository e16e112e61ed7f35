//! The corpus on several Vulkan drivers, in a process for each.
//!
//! The Vulkan loader reads its list of drivers once per process, and a driver that
//! crashes takes its process with it. This process runs the interpreter; a child for
//! each driver runs the devices, and for itself what they are held to: the interpreter
//! in `f32`, and perturbed. The reports become one, in which an executor on a driver is
//! called `wgpu/lavapipe`.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use thiserror::Error;

use crate::drivers::Driver;
use crate::executors::Kind;
use crate::model::{CaseReport, Finding, FindingKind, Report};
use crate::run::{Options, Progress, REQUIRED, RunError, required, run};

/// Variables that choose Vulkan drivers; the second is the older name of the first.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// No driver of a name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no driver `{name}`; there are {}", found.join(", "))]
pub struct NoDriver {
    /// As asked.
    pub name: String,
    /// As there are.
    pub found: Vec<String>,
}

/// Those of the drivers found that are asked for: by their names, or `all`.
///
/// # Errors
/// If there is none of a name.
pub fn chosen(found: Vec<Driver>, asked: &[String]) -> Result<Vec<Driver>, NoDriver> {
    let known = |name: &str| name == "all" || found.iter().any(|driver| driver.name == name);
    if let Some(unknown) = asked.iter().find(|name| !known(name)) {
        return Err(NoDriver {
            name: unknown.clone(),
            found: found.into_iter().map(|driver| driver.name).collect(),
        });
    }
    let wanted = |driver: &Driver| {
        let mut asked = asked.iter();
        asked.any(|name| name == "all" || *name == driver.name)
    };
    Ok(found.into_iter().filter(wanted).collect())
}

/// How a driver's process is started: it writes its report as JSON to its standard
/// output, and nothing else.
#[derive(Clone, Debug)]
pub struct Child {
    /// The program.
    pub program: PathBuf,
    /// Its arguments without the executors.
    pub arguments: Vec<OsString>,
}

/// Runs the cases asked for on the interpreter here, and on each driver in a process of
/// its own.
///
/// A process that ends otherwise than with a report is in [`Report::failures`].
///
/// # Errors
/// As [`run`](fn@run).
pub fn run_on(
    options: &Options,
    child: &Child,
    drivers: &[Driver],
    progress: &mut dyn Progress,
) -> Result<Report, RunError> {
    let (devices, here): (Vec<Kind>, Vec<Kind>) =
        options.executors.iter().partition(|kind| kind.is_device());
    let held_to = [Kind::Cpu, Kind::Perturbed];
    let there = held_to.iter().filter(|kind| here.contains(kind));
    let there: Vec<&str> = there.chain(&devices).map(|kind| kind.name()).collect();
    let mut report = run(
        &Options {
            executors: here.clone(),
            ..options.clone()
        },
        progress,
    )?;
    if devices.is_empty() {
        return Ok(report);
    }
    for driver in drivers {
        progress.next("all cases", &driver.name);
        match on_driver(child, driver, &there.join(",")) {
            Ok(own) => merge(&mut report, &driver.name, own),
            Err(reason) => report.failures.push(format!("{}: {reason}", driver.name)),
        }
    }
    for kind in devices.iter().filter(|kind| required(kind.name())) {
        let start = format!("{kind}/");
        let mut executors = report.executors.iter();
        if !executors.any(|executor| executor.name.starts_with(&start)) {
            let none = format!("{kind} is required: no driver has a device for it");
            report.failures.push(none);
        }
    }
    report.count();
    Ok(report)
}

/// What a driver's process reports.
fn on_driver(child: &Child, driver: &Driver, executors: &str) -> Result<Report, String> {
    let mut command = Command::new(&child.program);
    command
        // A manifest without a device is none that is missing.
        .env_remove(REQUIRED)
        .args(&child.arguments)
        .args(["--executor", executors])
        .stdin(Stdio::null());
    for variable in DRIVER_VARIABLES {
        command.env(variable, &driver.manifest);
    }
    let output = command.output().map_err(|error| error.to_string())?;
    serde_json::from_slice(&output.stdout).map_err(|error| {
        let said = String::from_utf8_lossy(&output.stderr);
        let said = said.trim();
        let start = said.floor_char_boundary(said.len().saturating_sub(LAST_WORDS));
        format!("{}, {error}; it wrote: {}", output.status, &said[start..])
    })
}

/// Bytes of what a process wrote last that are repeated.
const LAST_WORDS: usize = 2000;

/// Puts what a driver's process reports of devices beside what there is.
fn merge(report: &mut Report, driver: &str, own: Report) {
    let is_device = |name: &str| name.parse().is_ok_and(Kind::is_device);
    let named = |name: &str| format!("{name}/{driver}");
    for mut info in own.executors {
        if is_device(&info.name) {
            info.name = named(&info.name);
            report.executors.push(info);
        }
    }
    let notes = own.notes.into_iter();
    report
        .notes
        .extend(notes.map(|note| format!("{driver}: {note}")));
    let mut cases: BTreeMap<(String, String), &mut CaseReport> = report
        .cases
        .iter_mut()
        .map(|case| ((case.name.clone(), case.effect.clone()), case))
        .collect();
    for own in own.cases {
        let Some(case) = cases.get_mut(&(own.name.clone(), own.effect.clone())) else {
            let missing = format!("{driver}: {} on {} is not run here", own.effect, own.name);
            report.failures.push(missing);
            continue;
        };
        for mut result in own.results {
            if is_device(&result.executor) {
                result.executor = named(&result.executor);
                case.results.push(result);
            } else if let (Some(here), Some(there)) = (
                case.on(&result.executor).and_then(|here| here.digest),
                result.digest,
            ) && here != there
            {
                case.findings.push(Finding {
                    kind: FindingKind::Disagreement,
                    executor: named(&result.executor),
                    text: "the interpreter does not store the same bits in every process"
                        .to_owned(),
                });
            }
        }
        for mut excused in own.excused {
            excused.finding.executor = named(&excused.finding.executor);
            case.excused.push(excused);
        }
        for mut finding in own.findings {
            if is_device(&finding.executor) {
                finding.executor = named(&finding.executor);
                case.findings.push(finding);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ExecutorInfo, ExecutorResult};

    fn result(executor: &str, digest: Option<u64>) -> ExecutorResult {
        ExecutorResult {
            executor: executor.to_owned(),
            executions: 1,
            digest,
            ..ExecutorResult::default()
        }
    }

    fn report(results: Vec<ExecutorResult>, findings: &[&str]) -> Report {
        let executors = results.iter().map(|result| ExecutorInfo {
            name: result.executor.clone(),
            ..ExecutorInfo::default()
        });
        Report {
            executors: executors.collect(),
            cases: vec![CaseReport {
                name: "one".to_owned(),
                effect: "bloom".to_owned(),
                results,
                findings: findings
                    .iter()
                    .map(|executor| Finding {
                        kind: FindingKind::NonFinite,
                        executor: (*executor).to_owned(),
                        text: String::new(),
                    })
                    .collect(),
                ..CaseReport::default()
            }],
            ..Report::default()
        }
    }

    fn driver(name: &str) -> Driver {
        Driver {
            name: name.to_owned(),
            manifest: "/nowhere.json".into(),
            library: "/nowhere.so".into(),
        }
    }

    #[test]
    fn devices_of_each_driver_stand_beside_each_other() {
        let mut all = report(vec![result("cpu", Some(1))], &[]);
        for name in ["lavapipe", "swiftshader"] {
            let own = report(
                vec![result("cpu", Some(1)), result("ash", None)],
                &["cpu", "ash"],
            );
            merge(&mut all, name, own);
        }
        all.count();
        let names: Vec<_> = all
            .executors
            .iter()
            .map(|info| info.name.as_str())
            .collect();
        assert_eq!(names, ["cpu", "ash/lavapipe", "ash/swiftshader"]);
        assert!(all.cases[0].on("ash/swiftshader").is_some());
        // What the interpreter finds is found here, once.
        let who: Vec<_> = all.findings().map(|(_, found)| &found.executor).collect();
        assert_eq!(who, ["ash/lavapipe", "ash/swiftshader"]);
        assert_eq!((all.totals.executions, all.totals.findings), (3, 2));
    }

    #[test]
    fn an_interpreter_of_other_bits_is_found() {
        let mut all = report(vec![result("cpu", Some(1))], &[]);
        merge(
            &mut all,
            "lavapipe",
            report(vec![result("cpu", Some(2))], &[]),
        );
        let (_, found) = all.findings().next().unwrap();
        assert_eq!(found.kind, FindingKind::Disagreement);
    }

    #[test]
    fn a_process_that_ends_without_a_report_is_told_of() {
        let child = Child {
            program: "sh".into(),
            arguments: ["-c", "echo no such device >&2; exit 3", "child"]
                .map(OsString::from)
                .to_vec(),
        };
        let reason = on_driver(&child, &driver("x"), "cpu").unwrap_err();
        assert!(
            reason.contains("3") && reason.contains("no such device"),
            "{reason}"
        );
        let mut report = Report::default();
        report.failures.push(reason);
        report.count();
        assert!(!report.is_sound());
        assert_eq!(report.totals.findings, 1);
    }

    #[test]
    fn drivers_are_chosen_by_name() {
        let found = || vec![driver("lavapipe"), driver("radv")];
        let names = |asked: &[&str]| {
            let asked: Vec<String> = asked.iter().map(|name| (*name).to_owned()).collect();
            chosen(found(), &asked)
                .map(|some| some.into_iter().map(|one| one.name).collect::<Vec<_>>())
        };
        assert_eq!(names(&["all"]).unwrap(), ["lavapipe", "radv"]);
        assert_eq!(names(&["radv"]).unwrap(), ["radv"]);
        let error = names(&["nvk"]).unwrap_err().to_string();
        assert!(
            error.contains("nvk") && error.contains("lavapipe, radv"),
            "{error}"
        );
    }
}

//! Faults planted into results are found, named, and end the program as they should.

use std::process::Command;

use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::texel::Texel;
use etalon_stability::drivers;
use etalon_stability::executors::{Executor, Kind};
use etalon_stability::judge::truth::Judge;
use etalon_stability::model::{FindingKind, Report};
use etalon_stability::observe::Store;
use etalon_stability::plant::{Fault, Plant};
use etalon_stability::report;
use etalon_stability::run::{Options, run};
use etalon_stability::subject::subjects;

fn planted(plant: Option<Plant>) -> Report {
    let options = Options {
        cases: vec!["size-5x5".to_owned()],
        effects: vec!["ssr".to_owned()],
        executors: vec![Kind::Cpu, Kind::Double, Kind::Shadow],
        plant,
        ..Options::default()
    };
    run(&options, &mut ()).unwrap()
}

fn kinds(report: &Report) -> Vec<FindingKind> {
    report.findings().map(|(_, finding)| finding.kind).collect()
}

#[test]
fn without_a_fault_nothing_is_found() {
    let report = planted(None);
    assert!(
        report.is_sound(),
        "{:?}",
        report.findings().collect::<Vec<_>>()
    );
    assert_eq!(report.totals.findings, 0);
}

#[test]
fn a_nan_is_found_with_its_place() {
    let report = planted(Some(Plant {
        executor: Kind::Cpu,
        fault: Fault::Nan,
    }));
    // Nor is it what the effect's truth says.
    assert_eq!(
        kinds(&report),
        [FindingKind::NonFinite, FindingKind::Untrue]
    );
    let wrong = report.cases[0]
        .on("cpu")
        .unwrap()
        .non_finite
        .as_ref()
        .unwrap();
    assert_eq!((wrong.first.x, wrong.first.y, wrong.first.frame), (0, 0, 0));
    assert_eq!(wrong.first.pass, "ssr/march");
    assert_eq!(wrong.channels, 4);
}

#[test]
fn an_error_of_a_hundredth_is_found() {
    let report = planted(Some(Plant {
        executor: Kind::Shadow,
        fault: Fault::Error,
    }));
    assert_eq!(kinds(&report), [FindingKind::Rounding; 1]);
    let wrong = report.cases[0]
        .on("cpu-shadow")
        .unwrap()
        .rounding
        .as_ref()
        .unwrap();
    assert!(
        wrong.beyond >= 1 && wrong.max > 0.005 && wrong.max < 0.5,
        "{wrong:?}"
    );
}

/// A device is needed for something to differ from.
#[test]
fn a_bit_is_found_on_a_device() {
    for kind in [Kind::Wgpu, Kind::Ash] {
        let options = Options {
            cases: vec!["size-5x5".to_owned()],
            effects: vec!["bloom".to_owned()],
            executors: vec![Kind::Cpu, kind],
            plant: Some(Plant {
                executor: kind,
                fault: Fault::Bit,
            }),
            ..Options::default()
        };
        let report = run(&options, &mut ()).unwrap();
        if report.executors.len() < 2 {
            eprintln!("without {kind}: {:?}", report.notes);
            continue;
        }
        assert_eq!(kinds(&report), [FindingKind::Disagreement]);
        let wrong = report.cases[0]
            .on(kind.name())
            .unwrap()
            .difference
            .as_ref()
            .unwrap();
        assert_eq!((wrong.texels, wrong.ulps), (1, 1));
        assert_eq!((wrong.first.x, wrong.first.y), (0, 0));
    }
}

/// One case of each effect that draws or lights, with a fault.
fn drawn(plant: Option<Plant>) -> Report {
    let cases = [
        "triangle-across-the-near-plane",
        "lamp-at-the-eye",
        "map-black",
        "drawn-normal-zero",
    ];
    let options = Options {
        cases: cases.map(str::to_owned).to_vec(),
        executors: vec![Kind::Cpu, Kind::Wgpu, Kind::Ash],
        plant,
        ..Options::default()
    };
    run(&options, &mut ()).unwrap()
}

/// The effects in which something of a kind is found.
fn effects(report: &Report, kind: FindingKind) -> Vec<&str> {
    let found = report.findings().filter(|(_, found)| found.kind == kind);
    found.map(|(case, _)| case.effect.as_str()).collect()
}

#[test]
fn what_is_drawn_is_held_to_its_truth() {
    let report = drawn(None);
    assert!(
        report.is_sound(),
        "{:?}",
        report.findings().collect::<Vec<_>>()
    );
    let (executor, fault) = (Kind::Cpu, Fault::Error);
    let report = drawn(Some(Plant { executor, fault }));
    // The first stores of the others are velocities that another pass completes, and
    // light, of which there is no truth here.
    let untrue = effects(&report, FindingKind::Untrue);
    assert_eq!(untrue, ["lighting", "environment"]);
}

/// What the interpreter draws, with a texel of each store that is judged changed.
#[test]
fn a_pixel_that_no_ray_sees_is_found() {
    let mut subjects = subjects().unwrap().into_iter();
    let subject = subjects
        .find(|subject| subject.name == "velocity-of-half-a-pixel-in-a-thousand")
        .unwrap();
    let scene = subject.scenes().unwrap().remove(0);
    let mut executor = Executor::open(Kind::Cpu).unwrap();
    let graph = subject.graph(&subject.effects[0], &scene).unwrap();
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        limits: executor.backend().limits(),
        capture: Capture::EveryPass,
        memory: executor.backend().memory(),
    };
    let plan = Plan::new(&graph, &etalon_effects::kernels(), &options).unwrap();
    let stores = executor.run(&plan, &scene.inputs()).unwrap();
    let untrue = |stores: &[Store]| {
        let mut judge = Judge::new("geometry", &[], None).unwrap();
        judge.look(0, &scene, stores);
        judge.finish()
    };
    assert_eq!(untrue(&stores), None);
    // In the middle of the wall, and in the corner, where nothing is.
    for ((x, y), pass, texel) in [
        ((20, 14), "geometry/prepass", [0.0251; 4]),
        ((20, 14), "geometry/gbuffer", [0.0, 0.01, 1.0, 0.0]),
        ((20, 14), "geometry/camera velocity", [1e-4; 4]),
        ((0, 0), "geometry/prepass", [0.025; 4]),
    ] {
        let binding = match pass {
            "geometry/prepass" => "depth",
            "geometry/gbuffer" => "normal",
            _ => "velocity",
        };
        let mut planted = stores.clone();
        let store = planted
            .iter_mut()
            .find(|store| store.pass == pass && store.binding == binding)
            .unwrap_or_else(|| panic!("no {binding} of {pass}"));
        let image = store.image.as_mut().unwrap();
        image.set_texel(x, y, 0, 0, Texel::Float(texel)).unwrap();
        let found = untrue(&planted).unwrap_or_else(|| panic!("{pass} at {x}, {y}"));
        assert_eq!(
            (found.texels, found.first.pass.as_str()),
            (1, pass),
            "{found:?}"
        );
        assert_eq!((found.first.x, found.first.y), (x, y));
    }
}

#[test]
fn what_devices_draw_is_held_to_the_interpreter_and_to_each_other() {
    let (executor, fault) = (Kind::Wgpu, Fault::Error);
    let report = drawn(Some(Plant { executor, fault }));
    if report.executors.len() < 3 {
        eprintln!("without devices: {:?}", report.notes);
        return;
    }
    let all = ["geometry", "lighting", "environment", "forward"];
    let on = |report: &Report, executor: &str| -> Vec<String> {
        let found = report.findings().filter(|(_, found)| {
            found.kind == FindingKind::Disagreement && found.executor == executor
        });
        found.map(|(case, _)| case.effect.clone()).collect()
    };
    assert_eq!(on(&report, "wgpu"), all);
    // A bit is within what rasterisers are free to do, but not of the same device.
    let (executor, fault) = (Kind::Ash, Fault::Bit);
    let report = drawn(Some(Plant { executor, fault }));
    assert_eq!(on(&report, "ash"), all);
}

#[test]
fn every_driver_has_its_own_process() {
    let arguments = ["--case", "size-3x3", "--effect", "bloom"];
    let on = |drivers: &str| {
        let chosen = ["--executor", "cpu,ash", "--drivers", drivers];
        program(&[&arguments[..], &chosen].concat())
    };
    let (status, text) = on("no-such-driver");
    assert_eq!(status, Some(2), "{text}");
    assert!(text.contains("no driver `no-such-driver`"), "{text}");
    let found = drivers::find(&drivers::Environment::of_process()).drivers;
    if found.is_empty() {
        eprintln!("no drivers here");
        return;
    }
    let (status, text) = on("all");
    assert_eq!(status, Some(0), "{text}");
    // Not every manifest has a device behind it; the others are told of.
    for driver in found {
        let name = driver.name;
        let told = [format!("ash/{name}"), format!("{name}: without ash")];
        assert!(told.iter().any(|told| text.contains(told)), "{text}");
    }
}

/// The program with a fault, its exit status and what it said.
fn program(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_etalon-stability"))
        .args(arguments)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].concat();
    (
        output.status.code(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

#[test]
fn the_exit_status_tells_findings_from_faults_of_the_command() {
    let few = [
        "--case",
        "size-5x5",
        "--effect",
        "ssr",
        "--executor",
        "cpu,cpu-f64,cpu-shadow",
    ];
    let with = |more: &[&str]| program(&[&few[..], more].concat());
    let (status, text) = with(&[]);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains("nothing found"), "{text}");
    for (fault, said) in [
        ("cpu:nan", "no numbers"),
        ("cpu-shadow:nan", "no numbers"),
        ("cpu-shadow:error", "off by more than"),
    ] {
        let (status, text) = with(&["--plant", fault]);
        assert_eq!(status, Some(1), "{fault}: {text}");
        assert!(
            text.contains(said) && text.contains("size-5x5"),
            "{fault}: {text}"
        );
    }
    let (status, text) = program(&["--effect", "none"]);
    assert_eq!(status, Some(2), "{text}");
    assert!(text.contains("no effect `none`"), "{text}");
    assert_eq!(program(&["--plant", "cpu"]).0, Some(2));
    assert_eq!(program(&["--executor", "gpu"]).0, Some(2));
}

#[test]
fn what_is_written_is_what_is_read() {
    let report = planted(Some(Plant {
        executor: Kind::Cpu,
        fault: Fault::Nan,
    }));
    let folder = tempfile::tempdir().unwrap();
    let page = report::write(&report, folder.path()).unwrap();
    let text = std::fs::read_to_string(folder.path().join(report::DATA)).unwrap();
    assert_eq!(serde_json::from_str::<Report>(&text).unwrap(), report);
    let data: serde_json::Value = serde_json::from_str(&text).unwrap();
    let case = &data["cases"][0];
    for field in ["name", "effect", "reason", "source"] {
        assert!(
            case[field].as_str().is_some_and(|text| !text.is_empty()),
            "{field}"
        );
    }
    assert_eq!(case["results"].as_array().unwrap().len(), 3);
    assert_eq!(case["results"][0]["status"]["is"], "ran");
    assert_eq!(data["totals"]["cases"], 1);
    assert!(data["totals"]["executions"].as_u64().unwrap() > 3);
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("size-5x5") && page.contains("no numbers"));
    assert!(!page.contains("http://") && !page.contains("https://"));
}

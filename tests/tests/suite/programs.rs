//! Random programs: on the interpreter in every way it can run them, on every
//! backend there is, and evaluated one invocation at a time.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use etalon::backend::Backend;
use etalon::kernel::{Arithmetic, KernelLibrary, KernelRequest, SpirvOptions, spirv};
use etalon_tests::programs::{
    Choices, Difference, Draw, Held, Interpreters, Malformed, Program, Results, STEPS, Stmt, Trial,
    binds_devices, differences, evaluate, execute, generate, may_differ, of_seed, shrink,
    statements,
};
use etalon_tests::{cpu, executors};

fn first(trial: &Trial, results: &Results, held: Held) -> Option<Difference> {
    differences(trial, results, held).into_iter().next()
}

/// What the interpreter does wrong with a trial, on whichever way does first.
fn mistake_of_trial(interpreters: &Interpreters, mut trial: Trial, open: bool) -> Option<String> {
    let all = match interpreters.run(&trial) {
        Ok(all) => all,
        Err(error) => return Some(error),
    };
    // Where WGSL leaves results open, the ways still agree with each other.
    if open {
        trial.expected = all[0].1.clone();
    }
    all.iter().find_map(|(name, results)| {
        let difference = first(&trial, results, Held::Bits)?;
        Some(format!("on {name}: {difference}"))
    })
}

/// What the interpreter does wrong with a program.
fn mistake(interpreters: &Interpreters, program: &Program) -> Option<String> {
    let evaluation = evaluate(program, STEPS).ok()?;
    let trial = Trial::new(program, &evaluation.results);
    mistake_of_trial(interpreters, trial, evaluation.open.unspecified)
}

#[test]
fn the_interpreter_does_what_each_invocation_would() {
    let interpreters = Interpreters::new().unwrap();
    for seed in 0..300 {
        let (program, _) = of_seed(seed);
        if let Some(found) = mistake(&interpreters, &program) {
            // Another result stays another result, a refusal a refusal.
            let differs = found.starts_with("on ");
            let less = shrink(&program, 20_000, |less| {
                mistake(&interpreters, less)
                    .is_some_and(|other| other.starts_with("on ") == differs)
            });
            let why = mistake(&interpreters, &less.program).unwrap_or_default();
            panic!("seed {seed}: {found}\n{why}\n{}", less.program);
        }
    }
}

#[test]
fn programs_fit_together() {
    let mut long = 0;
    for seed in 0..300 {
        match evaluate(&generate(Choices::seeded(seed)), STEPS) {
            Ok(_) => {}
            Err(Malformed::TooLong) => long += 1,
            Err(error) => panic!("seed {seed}: {error}"),
        }
    }
    assert!(long < 10, "{long} of 300 programs take too long");
}

#[test]
fn tickets_of_a_counter_are_all_used_alike() {
    let mut drawn = 0;
    for seed in 0..300 {
        let (program, _) = of_seed(seed);
        let Some(ticket) = program.main.iter().find_map(|stmt| match stmt {
            Stmt::Ticket { from, scalar, draw } => Some((*from, *scalar, *draw)),
            _ => None,
        }) else {
            continue;
        };
        drawn += 1;
        let with = |factor| {
            let (from, scalar, draw) = ticket;
            let draws = [draw, Draw { factor, ..draw }];
            let tickets = draws.map(|draw| Stmt::Ticket { from, scalar, draw });
            let mut more = program.clone();
            more.main.splice(..0, tickets);
            evaluate(&more, STEPS).map(|_| ())
        };
        assert_eq!(with(ticket.2.factor), Ok(()), "seed {seed}");
        // Whether a number is doubled would depend on who draws it.
        assert_eq!(
            with(ticket.2.factor * 2),
            Err(Malformed::Unordered),
            "seed {seed}"
        );
    }
    assert!(drawn > 3, "{drawn} of 300 programs draw tickets");
}

#[test]
fn most_programs_bind_every_device_and_do_something() {
    let (mut open, mut steps, mut zeros, mut words) = (0, 0, 0, 0);
    let mut text = String::new();
    for seed in 0..200 {
        let (program, evaluation) = of_seed(seed);
        open += u32::from(evaluation.open.any());
        steps += evaluation.steps;
        let results = &evaluation.results.results;
        zeros += results.iter().filter(|word| **word == 0).count();
        words += results.len();
        text += &program.to_string();
    }
    assert!(open < 40, "{open} of 200 programs are open");
    assert!(steps > 200 * 5_000, "{steps} steps");
    assert!(zeros * 2 < words, "{zeros} of {words} results are 0");
    // Everything that programs are said to be made of.
    for part in [
        "switch ",
        "default: {",
        "case 0u, default",
        "for (",
        "while ",
        "loop {",
        "continuing {",
        "break if",
        "break;",
        "continue;",
        "return;",
        "return v",
        " else if ",
        "ptr<function, ",
        "ptr<private, ",
        "&v",
        "struct S0",
        "mat2x3<f32>",
        "array<",
        "var<private>",
        "bool>",
        "var<workgroup>",
        "workgroupBarrier();",
        "storageBarrier();",
        "workgroupUniformLoad",
        "atomicAdd(&w",
        "atomicMin(&tallies",
        "atomicCompareExchangeWeak",
        "atomicStore",
        "atomicExchange",
        "atomicLoad",
        ".zy",
        " += ",
        "++;",
        " << ",
        " % ",
        " && ",
        " || ",
        "transpose(",
        "dot(",
        "dot4I8Packed(",
        "pack4xU8Clamp(",
        "unpack4xI8(",
        "insertBits(",
        "extractBits(",
        "firstLeadingBit(",
        "reverseBits(",
        "select(",
        "sqrt(",
        "round(",
        "step(",
        "bitcast<f32>",
        "any(",
        "_ = ",
        "const c0",
    ] {
        assert!(text.contains(part), "no `{part}` in 200 programs");
    }
}

#[test]
fn most_programs_have_nothing_that_a_driver_does_otherwise() {
    let programs: Vec<_> = (0..300).map(of_seed).collect();
    let bound: Vec<_> = programs
        .iter()
        .filter(|(program, evaluation)| binds_devices(program, evaluation))
        .collect();
    assert!(bound.len() > 230, "{} of 300 bind devices", bound.len());
    for (driver, most) in [
        ("llvmpipe Mesa 22.3.6 (LLVM 15.0.6)", 40),
        ("SwiftShader driver", 50),
        ("a driver without faults", 20),
    ] {
        let differ = |(program, evaluation): &&&(_, _)| may_differ(program, evaluation, driver);
        let differ = bound.iter().filter(differ).count();
        let percent = differ * 100 / bound.len();
        assert!(differ > 0, "none on {driver}");
        assert!(percent < most, "{differ} of {} on {driver}", bound.len());
    }
}

/// Programs that went wrong once, with what they are.
fn kept() -> Vec<(String, Trial)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("programs");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "wgsl")
        })
        .collect();
    paths.sort();
    assert!(!paths.is_empty());
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let trial = text
            .parse()
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        (name, trial)
    };
    paths.into_iter().map(read).collect()
}

/// Who is known to get which kept program wrong, and why: lines of the
/// program, part of the driver's name, and the reason.
fn exceptions() -> Vec<[String; 3]> {
    include_str!("../../programs/exceptions.txt")
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| {
            let fields: Vec<String> = line
                .splitn(3, ',')
                .map(|field| field.trim().to_owned())
                .collect();
            fields
                .try_into()
                .unwrap_or_else(|_| panic!("`{line}` has not three fields"))
        })
        .collect()
}

#[test]
fn kept_programs_go_right_on_the_interpreter() {
    let interpreters = Interpreters::new().unwrap();
    for (name, trial) in kept() {
        if let Some(mistake) = mistake_of_trial(&interpreters, trial, false) {
            panic!("{name}: {mistake}");
        }
    }
}

#[test]
fn kept_programs_and_a_few_others_go_right_on_every_backend() {
    let (kept, exceptions) = (kept(), exceptions());
    for [name, ..] in &exceptions {
        assert!(
            kept.iter().any(|(kept, _)| kept == name),
            "no program `{name}`"
        );
    }
    let others: Vec<_> = (500..515).map(|seed| (seed, of_seed(seed))).collect();
    for mut executor in executors() {
        let info = executor.info();
        let bound = others.iter().filter_map(|(seed, (program, evaluation))| {
            let bound = binds_devices(program, evaluation)
                && !may_differ(program, evaluation, &info.driver);
            bound.then(|| (seed.to_string(), Trial::new(program, &evaluation.results)))
        });
        for (name, trial) in kept.iter().cloned().chain(bound) {
            let known = exceptions.iter().any(|[program, driver, _]| {
                *program == name && info.driver.contains(driver.as_str())
            });
            let wrong = match execute(&mut *executor, &trial) {
                Ok(results) => first(&trial, &results, Held::Wgsl).map(|word| word.to_string()),
                Err(error) => Some(error.to_string()),
            };
            if let Some(wrong) = wrong {
                assert!(
                    known,
                    "{name} on {} ({}): {wrong}",
                    info.backend, info.driver
                );
            }
        }
    }
}

/// The bits of a kernel's SPIR-V, for `spirv-val`.
fn spirv_of(trial: &Trial) -> Vec<u8> {
    let mut kernels = KernelLibrary::new();
    kernels.add_source("program", &trial.wgsl);
    let request = KernelRequest::new("program");
    let kernel = kernels.get(&request, Arithmetic::Strict).unwrap();
    let words = spirv(
        &kernel,
        naga::ShaderStage::Compute,
        &SpirvOptions::default(),
    )
    .unwrap();
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[test]
fn the_spirv_of_programs_is_valid() {
    let folder = std::env::temp_dir().join(format!("etalon-programs-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let generated = (0..100).map(|seed| {
        let (program, evaluation) = of_seed(seed);
        (seed.to_string(), Trial::new(&program, &evaluation.results))
    });
    for (name, trial) in kept().into_iter().chain(generated) {
        let path = folder.join(format!("{name}.spv"));
        std::fs::write(&path, spirv_of(&trial)).unwrap();
        let output = Command::new("spirv-val")
            .args(["--target-env", "vulkan1.1"])
            .arg(&path)
            .output();
        match output {
            Ok(output) => assert!(
                output.status.success(),
                "{name}: {}\n{}",
                String::from_utf8_lossy(&output.stderr),
                trial.wgsl
            ),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                assert!(!etalon_tests::required("validation"), "no spirv-val");
                eprintln!("no spirv-val here: the SPIR-V is not validated");
                break;
            }
            Err(error) => panic!("{error}"),
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// What a backend does wrong with a program of which it gets another text.
fn planted(backend: &mut dyn Backend, program: &Program, from: &str, to: &str) -> Option<String> {
    let evaluation = evaluate(program, STEPS).ok()?;
    let mut trial = Trial::new(program, &evaluation.results);
    trial.wgsl = trial.wgsl.replacen(from, to, 1);
    let results = execute(backend, &trial).ok()?;
    first(&trial, &results, Held::Wgsl).map(|word| word.to_string())
}

#[test]
fn a_planted_miscompilation_is_found_and_shrunk_to_a_few_lines() {
    let mut backend = cpu().unwrap();
    // An operator, a constant, a function, the order of arguments.
    let faults = [
        (" + ", " - "),
        ("1u", "2u"),
        ("min(", "max("),
        (" / ", " * "),
        (" % 32u]", " % 31u]"),
    ];
    for (from, to) in faults {
        let found = (0..60).find_map(|seed| {
            let (program, _) = of_seed(seed);
            planted(&mut *backend, &program, from, to)?;
            Some(program)
        });
        let program = found.unwrap_or_else(|| panic!("`{from}` as `{to}` is not found"));
        let less = shrink(&program, 4000, |less| {
            planted(&mut *backend, less, from, to).is_some()
        });
        let left = statements(&less.program);
        assert!(
            left <= 6 && left < statements(&program),
            "`{from}` as `{to}`: {left} statements of {} are left\n{}",
            statements(&program),
            less.program
        );
    }
}

#[test]
fn a_word_that_differs_is_found_wherever_it_is() {
    let (program, evaluation) = of_seed(3);
    let trial = Trial::new(&program, &evaluation.results);
    assert_eq!(first(&trial, &trial.expected, Held::Bits), None);
    let last = trial.expected.results.len() - 1;
    let change = |change: &dyn Fn(&mut Results)| {
        let mut results = trial.expected.clone();
        change(&mut results);
        first(&trial, &results, Held::Wgsl).unwrap().place
    };
    let workgroup = trial.expected.results.len() / trial.slots.len() / trial.lanes as usize - 1;
    assert_eq!(
        change(&|results| results.results[last] ^= 1 << 30),
        format!(
            "result {} of workgroup {workgroup}, lane {}",
            trial.slots.len() - 1,
            trial.lanes - 1
        )
    );
    assert_eq!(change(&|results| results.tallies[2] ^= 1), "tallies[2]");
    assert_eq!(
        change(&|results| results.signed_tallies[0] ^= 1),
        "signed_tallies[0]"
    );
    assert!(
        change(&|results| {
            results.tallies.pop();
        })
        .contains("the length")
    );
}

//! `check-vectors`: the interpreter's handlers in the disassembly.
//!
//! A handler is compiled once per instruction set, and relies on the compiler
//! to turn its loop over lanes into vector instructions. It does not say when
//! it has not, so this looks: every handler of the AVX2 and AVX-512 tiers must
//! use their full width, have no scalar floating-point arithmetic, no calls and
//! no loops lane by lane. What cannot be so is listed in `vectors.json` with
//! its reason. Hot handlers are listed there as well and must exist, and so are
//! instructions that handlers with many paths must have for the common ones.

pub mod disassembly;
pub mod judge;

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;
use serde::Deserialize;
use thiserror::Error;

use disassembly::{Function, parse};
use judge::{Fault, Tier, judge};

/// What is demanded of which handlers.
const RULES: &str = include_str!("../../vectors.json");

/// Options of `check-vectors`.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// Look at this library instead of building it.
    #[arg(long)]
    library: Option<PathBuf>,
    /// Print every handler, also those without fault.
    #[arg(long)]
    all: bool,
}

/// Why handlers cannot be looked at.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VectorsError {
    /// A tool cannot be started.
    #[error("{tool} cannot be started: {source}")]
    Start {
        /// The tool.
        tool: &'static str,
        /// Why not.
        source: std::io::Error,
    },
    /// A tool has failed.
    #[error("{tool} failed: {message}")]
    Failed {
        /// The tool.
        tool: &'static str,
        /// What it said.
        message: String,
    },
    /// Cargo has built no library.
    #[error("cargo names no library among what it has built")]
    NoLibrary,
    /// The rules cannot be read.
    #[error("vectors.json: {0}")]
    Rules(#[from] serde_json::Error),
}

/// What `vectors.json` holds.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Handlers that must exist in both tiers, by the beginning of their names.
    pub hot: Vec<String>,
    /// Instructions that some must have: their paths for common cases.
    pub needs: Vec<Need>,
    /// What is allowed to some.
    pub exceptions: Vec<Exception>,
}

/// What a handler must have.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Need {
    /// The beginning of its name.
    pub handler: String,
    /// In which tiers.
    pub tiers: Vec<Tier>,
    /// Beginnings of mnemonics, of each of which it must have one.
    pub instructions: Vec<String>,
    /// What for.
    pub reason: String,
}

/// What is allowed to a handler.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exception {
    /// The beginning of its name.
    pub handler: String,
    /// In which tiers.
    pub tiers: Vec<Tier>,
    /// The faults.
    pub allow: Vec<Fault>,
    /// Why.
    pub reason: String,
}

/// A handler's fault that nothing allows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The handler, without the paths of its types.
    pub handler: String,
    /// In which tier.
    pub tier: Tier,
    /// What is wrong; none if it, or what it needs, does not exist.
    pub fault: Option<Fault>,
    /// What shows it.
    pub evidence: String,
}

/// The tier and name of a handler for `f32`, if the function is one.
#[must_use]
pub fn handler(function: &str) -> Option<(Tier, String)> {
    let (path, generics) = function.split_once("::<f32, ")?;
    let tier = match path.rsplit("::").next()? {
        "avx2" => Tier::Avx2,
        "avx512" => Tier::Avx512,
        _ => return None,
    };
    let generics = generics.strip_suffix('>')?;
    Some((tier, without_paths(generics)))
}

/// A type without the paths of the types in it.
fn without_paths(name: &str) -> String {
    let mut short = String::with_capacity(name.len());
    let mut word = String::new();
    for letter in name.chars() {
        match letter {
            ':' => word.clear(),
            letter if letter.is_alphanumeric() || letter == '_' => word.push(letter),
            letter => {
                short.push_str(&word);
                word.clear();
                short.push(letter);
            }
        }
    }
    short + &word
}

/// Every violation of the rules by the handlers among functions, and the
/// exceptions nobody needs.
#[must_use]
pub fn check(functions: &[Function], rules: &Rules) -> (Vec<Violation>, Vec<String>) {
    let mut violations = Vec::new();
    let mut used = vec![false; rules.exceptions.len()];
    let handlers: Vec<_> = functions
        .iter()
        .filter_map(|function| Some((handler(&function.name)?, function)))
        .collect();
    for ((tier, name), function) in &handlers {
        for finding in judge(function, *tier) {
            let mut allowed = false;
            for (exception, used) in rules.exceptions.iter().zip(&mut used) {
                if name.starts_with(&exception.handler)
                    && exception.tiers.contains(tier)
                    && exception.allow.contains(&finding.fault)
                {
                    allowed = true;
                    *used = true;
                }
            }
            if !allowed {
                violations.push(Violation {
                    handler: name.clone(),
                    tier: *tier,
                    fault: Some(finding.fault),
                    evidence: finding.evidence,
                });
            }
        }
    }
    for hot in &rules.hot {
        for tier in [Tier::Avx2, Tier::Avx512] {
            let exists = handlers
                .iter()
                .any(|((its, name), _)| *its == tier && name.starts_with(hot));
            if !exists {
                violations.push(Violation {
                    handler: hot.clone(),
                    tier,
                    fault: None,
                    evidence: "there is no such handler".to_owned(),
                });
            }
        }
    }
    for need in &rules.needs {
        for &tier in &need.tiers {
            let mut named = handlers
                .iter()
                .filter(|((its, name), _)| *its == tier && name.starts_with(&need.handler));
            for wanted in &need.instructions {
                let has = |function: &Function| {
                    let mut mnemonics = function.instructions.iter().map(|one| &one.mnemonic);
                    mnemonics.any(|mnemonic| mnemonic.starts_with(wanted))
                };
                if !named.clone().any(|(_, function)| has(function)) {
                    violations.push(Violation {
                        handler: need.handler.clone(),
                        tier,
                        fault: None,
                        evidence: format!("no {wanted} in it ({})", need.reason),
                    });
                }
            }
            if named.next().is_none() {
                violations.push(Violation {
                    handler: need.handler.clone(),
                    tier,
                    fault: None,
                    evidence: "there is no such handler".to_owned(),
                });
            }
        }
    }
    let unused = rules.exceptions.iter().zip(used);
    let unused = unused
        .filter(|(_, used)| !used)
        .map(|(exception, _)| exception.handler.clone())
        .collect();
    (violations, unused)
}

/// Builds the interpreter as it is released and checks its handlers. Returns
/// whether all is well.
///
/// # Errors
/// If it cannot be built or disassembled.
pub fn run(options: &Options) -> Result<bool, VectorsError> {
    let rules: Rules = serde_json::from_str(RULES)?;
    let library = match &options.library {
        Some(library) => library.clone(),
        None => build()?,
    };
    let functions = disassemble(&library)?;
    let handlers = functions
        .iter()
        .filter_map(|function| Some((handler(&function.name)?, function)));
    let mut count = 0;
    for ((tier, name), function) in handlers {
        count += 1;
        if options.all {
            let findings = judge(function, tier);
            let findings = findings
                .iter()
                .map(|finding| format!("{} ({})", finding.fault, finding.evidence));
            println!(
                "{tier} {name}: {} instructions {}",
                function.instructions.len(),
                findings.collect::<Vec<_>>().join("; ")
            );
        }
    }
    let (violations, unused) = check(&functions, &rules);
    for violation in &violations {
        let fault = violation
            .fault
            .map_or_else(|| "missing".to_owned(), |fault| fault.to_string());
        println!(
            "{} {}: {fault}: {}",
            violation.tier, violation.handler, violation.evidence
        );
    }
    for handler in unused {
        println!("note: nothing needs the exception for {handler}");
    }
    println!("{count} handlers, {} violations", violations.len());
    Ok(violations.is_empty() && count > 0)
}

/// The interpreter's library, built with the mangling that tells the instances
/// of a generic function apart.
fn build() -> Result<PathBuf, VectorsError> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["rustc", "--release", "--package", "etalon-cpu", "--lib"])
        .args(["--message-format", "json-render-diagnostics"])
        .args(["--", "-C", "symbol-mangling-version=v0"])
        .stderr(std::process::Stdio::inherit())
        .output()
        .map_err(|source| VectorsError::Start {
            tool: "cargo",
            source,
        })?;
    if !output.status.success() {
        return Err(VectorsError::Failed {
            tool: "cargo",
            message: "see above".to_owned(),
        });
    }
    #[derive(Deserialize)]
    struct Message {
        reason: String,
        target: Option<Target>,
        #[serde(default)]
        filenames: Vec<PathBuf>,
    }
    #[derive(Deserialize)]
    struct Target {
        name: String,
    }
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .filter_map(|line| serde_json::from_str::<Message>(line).ok())
        .filter(|message| message.reason == "compiler-artifact")
        .filter(|message| {
            let target = message.target.as_ref();
            target.is_some_and(|target| target.name == "etalon_cpu")
        })
        .flat_map(|message| message.filenames)
        .find(|path| {
            path.extension()
                .is_some_and(|extension| extension == "rlib")
        })
        .ok_or(VectorsError::NoLibrary)
}

/// The functions of a library.
///
/// # Errors
/// If there is no `objdump` (package `binutils`), or it cannot read the file.
pub fn disassemble(library: &Path) -> Result<Vec<Function>, VectorsError> {
    let output = Command::new("objdump")
        .args(["-dr", "--no-show-raw-insn", "-M", "intel", "-C"])
        .arg(library)
        .output()
        .map_err(|source| VectorsError::Start {
            tool: "objdump",
            source,
        })?;
    if !output.status.success() {
        return Err(VectorsError::Failed {
            tool: "objdump",
            message: String::from_utf8_lossy(&output.stderr).into_owned(),
        });
    }
    Ok(parse(&String::from_utf8_lossy(&output.stdout)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handlers_are_known_by_their_names() {
        let name = "etalon_cpu::exec::tier::avx512::<f32, etalon_cpu::exec::arith::BinaryLanes<etalon_cpu::ir::arith::meaning::AddF, true, false>>";
        assert_eq!(
            handler(name),
            Some((Tier::Avx512, "BinaryLanes<AddF, true, false>".to_owned()))
        );
        assert_eq!(
            handler("a::avx2::<f32, a::b::Load<64>>"),
            Some((Tier::Avx2, "Load<64>".to_owned()))
        );
        assert_eq!(handler("a::avx2::<f64, a::b::Load<64>>"), None);
        assert_eq!(handler("a::sse::<f32, a::b::Load<64>>"), None);
        assert_eq!(handler("a::avx2"), None);
    }

    #[test]
    fn the_rules_can_be_read_and_give_reasons() {
        let rules: Rules = serde_json::from_str(RULES).unwrap();
        assert!(!rules.hot.is_empty());
        for need in &rules.needs {
            assert!(!need.reason.is_empty() && !need.instructions.is_empty());
        }
        for exception in &rules.exceptions {
            assert!(!exception.reason.is_empty() && !exception.allow.is_empty());
            // What is hot has no excuse for the kinds of faults that matter most.
            let hot = |hot: &String| hot.starts_with(&exception.handler);
            assert!(!rules.hot.iter().any(hot), "{}", exception.handler);
        }
    }

    /// Handlers as the interpreter has them, one of which works lane by lane
    /// on purpose, compiled as it is.
    const PLANTED: &str = r#"
        pub mod arith {
            pub struct Vector;
            pub struct Planted;
        }
        pub trait Step<N> { fn run(d: &mut [f32; 64], a: &[f32; 64]); }
        impl Step<f32> for arith::Vector {
            #[inline(always)]
            fn run(d: &mut [f32; 64], a: &[f32; 64]) {
                for k in 0..64 { d[k] = a[k] * a[k] + 1.0; }
            }
        }
        impl Step<f32> for arith::Planted {
            #[inline(always)]
            fn run(d: &mut [f32; 64], a: &[f32; 64]) {
                for k in 0..64 { d[k] = std::hint::black_box(a[k]) * a[k] + 1.0; }
            }
        }
        #[target_feature(enable = "avx2")]
        fn avx2<N, S: Step<N>>(d: &mut [f32; 64], a: &[f32; 64]) { S::run(d, a); }
        pub static HANDLERS: [unsafe fn(&mut [f32; 64], &[f32; 64]); 2] =
            [avx2::<f32, arith::Vector>, avx2::<f32, arith::Planted>];
    "#;

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn a_planted_scalar_handler_is_found_and_a_vector_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("planted.rs");
        std::fs::write(&source, PLANTED).unwrap();
        let library = folder.path().join("libplanted.rlib");
        let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let status = Command::new(rustc)
            .args([
                "--edition",
                "2024",
                "--crate-type",
                "rlib",
                "-C",
                "opt-level=3",
            ])
            .args(["-C", "symbol-mangling-version=v0", "-o"])
            .args([&library, &source])
            .status()
            .unwrap();
        assert!(status.success());
        let functions = disassemble(&library).unwrap();
        let rules = |exceptions| Rules {
            hot: vec!["Vector".to_owned()],
            needs: vec![Need {
                handler: "Vector".to_owned(),
                tiers: vec![Tier::Avx2],
                instructions: vec!["vmulps".to_owned()],
                reason: "to square".to_owned(),
            }],
            exceptions,
        };
        let (violations, unused) = check(&functions, &rules(Vec::new()));
        // There is no handler of the other tier.
        let (missing, violations): (Vec<_>, Vec<_>) = violations
            .into_iter()
            .partition(|violation| violation.fault.is_none());
        assert_eq!(missing.len(), 1);
        assert_eq!(
            (&*missing[0].handler, missing[0].tier),
            ("Vector", Tier::Avx512)
        );
        assert!(unused.is_empty());
        assert!(
            violations
                .iter()
                .all(|violation| violation.handler == "Planted"),
            "{violations:?}"
        );
        let scalar = |violation: &Violation| violation.fault == Some(Fault::Scalar);
        assert!(violations.iter().any(scalar), "{violations:?}");
        // What is needed and not there is one.
        let mut demanding = rules(Vec::new());
        demanding.needs[0].instructions.push("vpgather".to_owned());
        let (violations, _) = check(&functions, &demanding);
        let gather = |violation: &Violation| violation.evidence.contains("no vpgather");
        assert_eq!(violations.iter().filter(|one| gather(one)).count(), 1);
        // What is allowed is no violation; what nobody needs is named.
        let exception = |handler: &str| Exception {
            handler: handler.to_owned(),
            tiers: vec![Tier::Avx2],
            allow: vec![
                Fault::Width,
                Fault::Scalar,
                Fault::Calls,
                Fault::Loops,
                Fault::Lanes,
            ],
            reason: "planted".to_owned(),
        };
        let (violations, unused) = check(
            &functions,
            &rules(vec![exception("Planted"), exception("Vector")]),
        );
        assert!(violations.iter().all(|violation| violation.fault.is_none()));
        assert_eq!(unused, ["Vector"]);
    }
}

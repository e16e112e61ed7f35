//! Does anything fail where a kernel's guard is missing?
//!
//! A comment before a line of a kernel says what the line would be without its guard:
//!
//! ```wgsl
//! // unguarded: let most = brightness;
//! let most = max(brightness, 1e-30);
//! ```
//!
//! Each such line is replaced by that, one at a time, and the corpus run again. A guard
//! that nothing is found without is one that no case needs.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::executors::Kind;
use crate::functions::LIBRARY;
use crate::model::Report;
use crate::run::{Options, RunError, run};
use crate::scene::Effect;

/// What begins such a comment.
pub(crate) const MARK: &str = "// unguarded: ";

/// A guard of a kernel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Guard {
    /// The kernel's path without extension.
    pub path: String,
    /// The guarded line, from 1.
    pub line: u32,
    /// That line.
    pub guarded: String,
    /// What it would be without.
    pub unguarded: String,
}

/// What became of a kernel without one of its guards.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mutant {
    /// The guard that it has not.
    pub guard: Guard,
    /// The first finding; none if no case failed.
    pub finding: Option<String>,
    /// How many cases failed.
    pub failed: usize,
    /// How many stored other bits than with the guard, failed or not.
    pub changed: usize,
}

/// The guards that files have, each by its path and with its text.
pub fn guards<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Vec<Guard> {
    let mut guards = Vec::new();
    for (path, text) in files {
        let mut lines = text.lines().zip(1..).peekable();
        while let Some((line, _)) = lines.next() {
            let unguarded = line.trim_start().strip_prefix(MARK);
            if let (Some(unguarded), Some(&(guarded, number))) = (unguarded, lines.peek()) {
                guards.push(Guard {
                    path: path.to_owned(),
                    line: number,
                    guarded: guarded.trim().to_owned(),
                    unguarded: unguarded.trim().to_owned(),
                });
            }
        }
    }
    guards
}

/// A file without one of its guards.
#[must_use]
pub fn without(text: &str, guard: &Guard) -> String {
    let mut mutated = String::with_capacity(text.len());
    for (line, number) in text.lines().zip(1_u32..) {
        mutated.push_str(if number == guard.line {
            &guard.unguarded
        } else {
            line
        });
        mutated.push('\n');
    }
    mutated
}

/// Most cases that are followed by the sanitiser and the shadow, of a guard without
/// which nothing is found before.
const FOLLOWED: usize = 16;

/// Removes each guard of the embedded kernels in turn and runs the corpus, of frames of
/// up to so many texels. `progress` is told how many are done, of how many.
///
/// The interpreter alone sees what is no number, what its checks watch for, and what is
/// not the effects' truth. Where it sees nothing, cases that store other bits are run
/// again with the sanitiser and beside `f64`.
///
/// # Errors
/// Those of [`run`](fn@run).
pub fn mutate(
    largest: usize,
    mut progress: impl FnMut(usize, usize),
) -> Result<Vec<Mutant>, RunError> {
    let mut options = Options {
        executors: vec![Kind::Cpu],
        largest: Some(largest),
        followed: largest,
        ..Options::default()
    };
    let guarded = digests(&run(&options, &mut ())?);
    let all = guards(etalon_shaders::sources());
    let mut mutants = Vec::with_capacity(all.len());
    for (index, guard) in all.iter().enumerate() {
        progress(index, all.len());
        let text = etalon_shaders::source(&guard.path).unwrap_or_default();
        options.kernels = vec![(guard.path.clone(), without(text, guard))];
        options.effects = users(&guard.path, etalon_shaders::sources());
        let mut report = run(&options, &mut ())?;
        if report.is_sound() {
            // What is brightest comes of all effects together.
            options.effects = vec![CHAIN.to_owned()];
            let chain = run(&options, &mut ())?;
            report.cases.extend(chain.cases);
        }
        let unguarded = digests(&report);
        let changed: Vec<&(String, String)> = unguarded
            .iter()
            .filter(|(case, digest)| guarded.get(*case) != Some(digest))
            .map(|(case, _)| case)
            .collect();
        if report.is_sound() && !changed.is_empty() {
            let cases = changed.iter().take(FOLLOWED);
            let (cases, effects): (Vec<_>, Vec<_>) = cases.map(|case| (*case).clone()).unzip();
            report = run(
                &Options {
                    cases,
                    effects: effects
                        .into_iter()
                        .collect::<BTreeSet<_>>()
                        .into_iter()
                        .collect(),
                    executors: vec![Kind::Cpu, Kind::Double, Kind::Shadow, Kind::Sanitiser],
                    ..options.clone()
                },
                &mut (),
            )?;
        }
        let first = report.findings().next();
        mutants.push(Mutant {
            guard: guard.clone(),
            finding: first.map(|(case, finding)| {
                format!("{} on {}: {}", case.effect, case.name, finding.text)
            }),
            failed: report
                .cases
                .iter()
                .filter(|case| !case.findings.is_empty())
                .count(),
            changed: changed.len(),
        });
    }
    Ok(mutants)
}

/// All effects in one, of the registry.
const CHAIN: &str = "chain";

/// The effects whose kernels a file is or that import it, directly or not, of files by
/// their paths; and the library's functions, if it is of these.
fn users<'a>(path: &str, files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Vec<String> {
    let files: Vec<(&str, &str)> = files.into_iter().collect();
    let mut found = BTreeSet::from([path]);
    loop {
        let before = found.len();
        for (user, text) in &files {
            let imports = |path: &&str| {
                let import = format!("import package::{}::", path.replace('/', "::"));
                text.contains(&import)
            };
            if found.iter().any(imports) {
                found.insert(user);
            }
        }
        if found.len() == before {
            break;
        }
    }
    let folders = found.iter().filter_map(|path| path.split('/').next());
    let known = |folder: &&str| *folder == LIBRARY || Effect::names().any(|name| name == *folder);
    let folders: BTreeSet<&str> = folders.filter(known).collect();
    folders.into_iter().map(str::to_owned).collect()
}

/// What the interpreter stored in each case with each effect, as a number.
fn digests(report: &Report) -> BTreeMap<(String, String), u64> {
    let each = report.cases.iter().filter_map(|case| {
        let digest = case.results.first()?.digest?;
        Some(((case.name.clone(), case.effect.clone()), digest))
    });
    each.collect()
}

/// A line for each, what nothing was found without first.
#[must_use]
pub fn table(mutants: &[Mutant]) -> String {
    let mut sorted: Vec<&Mutant> = mutants.iter().collect();
    sorted.sort_by_key(|mutant| (mutant.failed > 0, mutant.changed > 0));
    let mut out = String::new();
    for mutant in sorted {
        let Mutant { guard, .. } = mutant;
        out += &format!(
            "{}.wesl:{}: {} -> {}\n    {} cases fail, {} store other bits{}\n",
            guard.path,
            guard.line,
            guard.guarded,
            guard.unguarded,
            mutant.failed,
            mutant.changed,
            match &mutant.finding {
                Some(finding) => format!("; the first: {finding}"),
                None => String::new(),
            }
        );
    }
    let found = mutants.iter().filter(|mutant| mutant.failed > 0).count();
    let seen = mutants.iter().filter(|mutant| mutant.changed > 0).count();
    out += &format!(
        "{} guards: without {found} of them cases fail, without {seen} other bits are stored\n",
        mutants.len()
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "fn f(x: f32) -> f32 {
    // unguarded: let y = x;
    let y = max(x, 0.0);
    return sqrt(y);
}
";

    #[test]
    fn a_line_loses_its_guard_and_nothing_else() {
        let found = guards([("a/b", TEXT)]);
        let [guard] = &found[..] else {
            panic!("{found:?}");
        };
        assert_eq!((guard.line, guard.unguarded.as_str()), (3, "let y = x;"));
        let mutated = without(TEXT, guard);
        assert!(mutated.contains("\nlet y = x;\n") && !mutated.contains("max"));
        assert_eq!(mutated.lines().count(), TEXT.lines().count());
    }

    #[test]
    fn a_file_is_used_by_whoever_imports_it_in_the_end() {
        let files = [
            ("lib/a", "fn a() {}"),
            ("lib/b", "import package::lib::a::a;"),
            ("ssr/march", "import package::lib::b::{b, c};"),
            ("bloom/blur", "import package::lib::c::c;"),
        ];
        assert_eq!(users("lib/a", files), ["lib", "ssr"]);
        assert_eq!(users("ssr/march", files), ["ssr"]);
        let real = users("lib/camera", etalon_shaders::sources());
        assert_eq!(real, ["geometry", "lib", "lighting", "ssr"]);
    }

    #[test]
    fn kernels_have_guards_that_can_go() {
        let found = guards(etalon_shaders::sources());
        assert!(found.len() >= 36, "{}", found.len());
        for guard in &found {
            assert!(!guard.guarded.is_empty() && guard.guarded != guard.unguarded);
        }
    }
}

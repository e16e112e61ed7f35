//! Programs as executors get them, with what is to come out: all that is
//! needed to try a program again without the generator that made it.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::evaluate::Results;
use super::grammar::*;

/// A program to be tried.
///
/// [`Display`](fmt::Display) and [`FromStr`] write and read it as WGSL with
/// comments in front.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// The text.
    pub wgsl: String,
    /// Invocations of a workgroup.
    pub lanes: u32,
    /// Workgroups along each axis.
    pub groups: [u32; 3],
    /// What `data` holds.
    pub data: Vec<u32>,
    /// The bits of what `reals` holds.
    pub reals: Vec<u32>,
    /// The type of each result of an invocation.
    pub slots: Vec<Scalar>,
    /// What comes out.
    pub expected: Results,
}

impl Trial {
    /// A trial of a program with its results.
    #[must_use]
    pub fn new(program: &Program, expected: &Results) -> Self {
        let mut slots = vec![Scalar::U32; program.slots];
        slot_types(&program.main, &mut slots);
        Self {
            wgsl: program.to_string(),
            lanes: program.lanes(),
            groups: program.groups,
            data: program.data.clone(),
            reals: program.reals.clone(),
            slots,
            expected: expected.clone(),
        }
    }

    /// What the buffers that are written hold before.
    #[must_use]
    pub fn start(&self) -> Results {
        Results {
            results: vec![0; self.expected.results.len()],
            ..Results::start(0)
        }
    }
}

impl Results {
    /// Before a program has run that has so many results in all.
    #[must_use]
    pub fn start(results: usize) -> Self {
        let tallies = |scalar| TALLY_RULES.map(|rule| rule.start(scalar)).to_vec();
        Self {
            results: vec![0; results],
            tallies: tallies(Scalar::U32),
            signed_tallies: tallies(Scalar::I32),
        }
    }
}

/// The types of the slots of results.
fn slot_types(block: &Block, types: &mut [Scalar]) {
    for stmt in block {
        match stmt {
            Stmt::Emit(slot, value) => {
                if let (Some(ty), Some(scalar)) = (types.get_mut(*slot), value.ty.scalar()) {
                    *ty = scalar;
                }
            }
            Stmt::If(_, accept, reject) => {
                slot_types(accept, types);
                slot_types(reject, types);
            }
            Stmt::Switch(_, cases) => cases.iter().for_each(|case| slot_types(&case.body, types)),
            Stmt::For { body, .. }
            | Stmt::While { body, .. }
            | Stmt::Block(body)
            | Stmt::Alone(_, body)
            | Stmt::Phase(body, _) => slot_types(body, types),
            Stmt::Loop {
                body, continuing, ..
            } => {
                slot_types(body, types);
                slot_types(continuing, types);
            }
            _ => {}
        }
    }
}

/// A text that is no trial.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {reason}")]
pub struct ParseTrialError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

fn letter(scalar: Scalar) -> char {
    match scalar {
        Scalar::Bool => 'b',
        Scalar::I32 => 'i',
        Scalar::U32 => 'u',
        Scalar::F32 => 'f',
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hex =
            |words: &[u32]| -> String { words.iter().map(|word| format!(" {word:x}")).collect() };
        let slots: String = self.slots.iter().map(|slot| letter(*slot)).collect();
        writeln!(f, "//: lanes {:x}", self.lanes)?;
        writeln!(f, "//: groups{}", hex(&self.groups))?;
        writeln!(f, "//: data{}", hex(&self.data))?;
        writeln!(f, "//: reals{}", hex(&self.reals))?;
        writeln!(f, "//: slots {slots}")?;
        writeln!(f, "//: results{}", hex(&self.expected.results))?;
        writeln!(f, "//: tallies{}", hex(&self.expected.tallies))?;
        writeln!(f, "//: signed{}", hex(&self.expected.signed_tallies))?;
        f.write_str(&self.wgsl)
    }
}

impl FromStr for Trial {
    type Err = ParseTrialError;

    fn from_str(text: &str) -> Result<Self, ParseTrialError> {
        let mut trial = Self {
            wgsl: String::new(),
            lanes: 0,
            groups: [0; 3],
            data: Vec::new(),
            reals: Vec::new(),
            slots: Vec::new(),
            expected: Results {
                results: Vec::new(),
                tallies: Vec::new(),
                signed_tallies: Vec::new(),
            },
        };
        for (index, line) in text.lines().enumerate() {
            let fail = |reason: String| ParseTrialError {
                line: index + 1,
                reason,
            };
            let Some(fields) = line.strip_prefix("//:") else {
                if !line.starts_with("//") {
                    trial.wgsl.push_str(line);
                    trial.wgsl.push('\n');
                }
                continue;
            };
            let mut fields = fields.split_whitespace();
            let name = fields.next().unwrap_or_default();
            if name == "slots" {
                for letter in fields.flat_map(str::chars) {
                    trial.slots.push(match letter {
                        'b' => Scalar::Bool,
                        'i' => Scalar::I32,
                        'u' => Scalar::U32,
                        'f' => Scalar::F32,
                        other => return Err(fail(format!("`{other}` is none of b, i, u, f"))),
                    });
                }
                continue;
            }
            let words = fields
                .map(|field| u32::from_str_radix(field, 16))
                .collect::<Result<Vec<u32>, _>>()
                .map_err(|error| fail(error.to_string()))?;
            match (name, words.as_slice()) {
                ("lanes", [lanes]) => trial.lanes = *lanes,
                ("groups", [x, y, z]) => trial.groups = [*x, *y, *z],
                ("data", _) => trial.data = words,
                ("reals", _) => trial.reals = words,
                ("results", _) => trial.expected.results = words,
                ("tallies", _) => trial.expected.tallies = words,
                ("signed", _) => trial.expected.signed_tallies = words,
                _ => return Err(fail(format!("`{name}` with {} numbers", words.len()))),
            }
        }
        Ok(trial)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::programs::of_seed;

    #[test]
    fn trials_are_read_as_they_are_written() {
        let (program, evaluation) = of_seed(5);
        let trial = Trial::new(&program, &evaluation.results);
        let text = format!("// A remark.\n{trial}");
        assert_eq!(text.parse::<Trial>().unwrap(), trial);
    }

    #[test]
    fn what_is_no_trial_is_refused_with_its_line() {
        for (text, reason) in [
            ("\n//: lanes 1 2", "line 2: `lanes` with 2 numbers"),
            ("//: data 1 x", "line 1: invalid digit found in string"),
            ("//: slots uq", "line 1: `q` is none of b, i, u, f"),
            ("//: colour", "line 1: `colour` with 0 numbers"),
        ] {
            assert_eq!(text.parse::<Trial>().unwrap_err().to_string(), reason);
        }
    }
}

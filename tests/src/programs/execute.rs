//! Programs run by a backend, the way every kernel is.

use std::fmt;

use etalon::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon::graph::{Graph, GraphError};
use etalon::kernel::{Arithmetic, KernelError, KernelLibrary, KernelRequest};
use etalon::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon::resource::BufferDesc;
use thiserror::Error;

use super::evaluate::Results;
use super::grammar::Scalar;
use super::trial::Trial;

/// Why a program did not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExecuteError {
    /// It cannot be declared.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// Its text is not accepted.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// It cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The backend fails.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A buffer was not captured.
    #[error("the buffer `{name}` was not captured")]
    Missing {
        /// Its name.
        name: &'static str,
    },
}

/// The path programs are given in a library of kernels.
pub(super) const PATH: &str = "program";

/// The buffers that are read.
const INPUTS: [&str; 2] = ["data", "reals"];
/// The buffers that are written.
const OUTPUTS: [&str; 3] = ["results", "tallies", "signed_tallies"];

pub(super) fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

pub(super) fn words(bytes: &[u8]) -> Vec<u32> {
    bytes
        .chunks_exact(4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect()
}

/// Runs a program in strict arithmetic.
///
/// # Errors
/// [`ExecuteError`].
pub fn execute(backend: &mut dyn Backend, trial: &Trial) -> Result<Results, ExecuteError> {
    let mut kernels = KernelLibrary::new();
    kernels.add_source(PATH, &trial.wgsl);
    let kernel = kernels.get(&KernelRequest::new(PATH), Arithmetic::Strict)?;
    let start = trial.start();
    let contents = [
        bytes(&trial.data),
        bytes(&trial.reals),
        bytes(&start.results),
        bytes(&start.tallies),
        bytes(&start.signed_tallies),
    ];
    let mut graph = Graph::new();
    let mut inputs = Inputs::new();
    let mut imports = Vec::new();
    for (name, bytes) in INPUTS.iter().chain(&OUTPUTS).zip(&contents) {
        let desc = BufferDesc {
            bytes: bytes.len() as u64,
        };
        imports.push((desc, graph.import_buffer(name, desc)?));
        inputs = inputs.buffer(*name, bytes);
    }
    // A kernel may not be given to write what it does not use.
    let mut targets = Vec::new();
    for (name, (desc, start)) in OUTPUTS.into_iter().zip(&imports[INPUTS.len()..]) {
        if kernel.binding(name).is_some() {
            let buffer = graph.buffer(name, *desc);
            targets.push((name, graph.copy_buffer(*start, buffer)?));
        }
    }
    if targets.is_empty() {
        return Ok(start);
    }
    let mut pass = graph.compute(PATH);
    for (name, (_, buffer)) in INPUTS.into_iter().zip(&imports) {
        pass = pass.read_buffer(name, *buffer);
    }
    for (name, buffer) in &targets {
        pass = pass.update_buffer(*name, *buffer);
    }
    let written = pass.groups(trial.groups)?;
    for (name, _) in &targets {
        graph.output_buffer(name, written.buffer(name)?)?;
    }
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        limits: backend.limits(),
        capture: Capture::Outputs,
        memory: backend.memory(),
    };
    let plan = Plan::new(&graph, &kernels, &options)?;
    let execution = backend.execute(&plan, &inputs)?;
    let captured = |name: &'static str, start: Vec<u32>| {
        if kernel.binding(name).is_none() {
            return Ok(start);
        }
        execution
            .captures
            .iter()
            .find_map(|captured| match &captured.data {
                CapturedData::Buffer(bytes) if captured.binding == name => Some(words(bytes)),
                _ => None,
            })
            .ok_or(ExecuteError::Missing { name })
    };
    Ok(Results {
        results: captured(OUTPUTS[0], start.results)?,
        tallies: captured(OUTPUTS[1], start.tallies)?,
        signed_tallies: captured(OUTPUTS[2], start.signed_tallies)?,
    })
}

/// A word that is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Which word.
    pub place: String,
    /// As evaluated.
    pub expected: u32,
    /// As computed.
    pub found: u32,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            place,
            expected,
            found,
        } = self;
        write!(f, "{place} is {found:#010x} and not {expected:#010x}")?;
        let [found, expected] = [*found, *expected].map(f32::from_bits);
        write!(f, " (as floats {found:?} and {expected:?})")
    }
}

/// What results are held to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// Their bits, but for the payload of NaNs: the interpreter.
    Bits,
    /// What WGSL fixes (§15.7.2): subnormal numbers may also be zeros, and the
    /// sign of a zero is free.
    Wgsl,
}

/// Whether two results of a type are the same.
fn same(held: Held, scalar: Scalar, a: u32, b: u32) -> bool {
    if a == b {
        return true;
    }
    let [x, y] = [a, b].map(f32::from_bits);
    let zero = |value: f32| value == 0.0 || value.is_subnormal();
    let zeros = held == Held::Wgsl && zero(x) && zero(y);
    scalar == Scalar::F32 && ((x.is_nan() && y.is_nan()) || zeros)
}

/// Where results are not what they should be, by more than is free.
#[must_use]
pub fn differences(trial: &Trial, found: &Results, held: Held) -> Vec<Difference> {
    let expected = &trial.expected;
    let mut all = Vec::new();
    let mut compare =
        |expected: &[u32], found: &[u32], place: &dyn Fn(usize) -> (Scalar, String)| {
            if expected.len() != found.len() {
                all.push(Difference {
                    place: format!("the length of the buffer of {}", place(0).1),
                    expected: expected.len() as u32,
                    found: found.len() as u32,
                });
            }
            for (i, (&expected, &found)) in expected.iter().zip(found).enumerate() {
                if expected == found {
                    continue;
                }
                let (scalar, place) = place(i);
                if !same(held, scalar, expected, found) {
                    all.push(Difference {
                        place,
                        expected,
                        found,
                    });
                }
            }
        };
    let (lanes, slots) = (trial.lanes.max(1) as usize, trial.slots.len().max(1));
    compare(&expected.results, &found.results, &|i| {
        let (invocation, slot) = (i / slots, i % slots);
        let (group, lane) = (invocation / lanes, invocation % lanes);
        let scalar = trial.slots.get(slot).copied().unwrap_or(Scalar::U32);
        (
            scalar,
            format!("result {slot} of workgroup {group}, lane {lane}"),
        )
    });
    compare(&expected.tallies, &found.tallies, &|i| {
        (Scalar::U32, format!("tallies[{i}]"))
    });
    compare(&expected.signed_tallies, &found.signed_tallies, &|i| {
        (Scalar::I32, format!("signed_tallies[{i}]"))
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nans_are_the_same_and_zeros_where_wgsl_says_so() {
        let bits = f32::to_bits;
        let (nan, zero, minus_zero) = (bits(f32::NAN), bits(0.0), bits(-0.0));
        let cases = [
            (nan, 0xffc0_0001, true, true),
            (bits(1.0), bits(1.0), true, true),
            (zero, 1, false, true),
            (1, 0x8000_0000, false, true),
            (7, 8, false, true),
            (zero, minus_zero, false, true),
            (bits(1.0), bits(1.0) + 1, false, false),
            (nan, bits(f32::INFINITY), false, false),
            (1, bits(f32::MIN_POSITIVE), false, false),
        ];
        for (a, b, exactly, freely) in cases {
            for (a, b) in [(a, b), (b, a)] {
                assert_eq!(
                    same(Held::Bits, Scalar::F32, a, b),
                    exactly,
                    "{a:#x} {b:#x}"
                );
                assert_eq!(same(Held::Wgsl, Scalar::F32, a, b), freely, "{a:#x} {b:#x}");
                assert_eq!(same(Held::Wgsl, Scalar::U32, a, b), a == b);
            }
        }
    }
}

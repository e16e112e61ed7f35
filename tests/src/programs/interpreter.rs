//! Programs on the interpreter, in every way it can run them.

use etalon::cpu::{BoundResource, Buffer, Executor, Program as Bytecode, RunError, Tier};
use etalon::kernel::{Arithmetic, KernelLibrary, KernelRequest};

use super::evaluate::Results;
use super::execute::{PATH, bytes, words};
use super::trial::Trial;

/// Executors of every tier the processor has, with 64 and 256 lanes, on one
/// thread and on three.
#[derive(Debug)]
pub struct Interpreters {
    executors: Vec<(String, Executor)>,
}

impl Interpreters {
    /// Starts the threads.
    ///
    /// # Errors
    /// If the system does not give them.
    pub fn new() -> Result<Self, RunError> {
        let tiers = Tier::ALL.into_iter().filter(|tier| tier.is_available());
        Self::of(tiers.flat_map(|tier| {
            let lanes = [64, 256].into_iter();
            lanes.flat_map(move |lanes| [1, 3].map(|threads| (tier, lanes, threads)))
        }))
    }

    /// Executors of these tiers with so many lanes and threads.
    ///
    /// # Errors
    /// If the system does not give the threads.
    pub fn of(ways: impl IntoIterator<Item = (Tier, u32, usize)>) -> Result<Self, RunError> {
        let mut executors = Vec::new();
        for (tier, lanes, threads) in ways {
            let name = format!("{tier}, {lanes} lanes, {threads} threads");
            let executor = Executor::new(threads)?.with_tier(tier).with_lanes(lanes);
            executors.push((name, executor));
        }
        Ok(Self { executors })
    }

    /// The names of the ways.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.executors.iter().map(|(name, _)| name.as_str())
    }

    /// The results of a program from each way by its name.
    ///
    /// # Errors
    /// What the library, the translation or a dispatch says, in words.
    pub fn run(&self, trial: &Trial) -> Result<Vec<(&str, Results)>, String> {
        let mut kernels = KernelLibrary::new();
        kernels.add_source(PATH, &trial.wgsl);
        let kernel = kernels
            .get(&KernelRequest::new(PATH), Arithmetic::Strict)
            .map_err(|error| error.to_string())?;
        let bytecode = Bytecode::translate(&kernel).map_err(|error| error.to_string())?;
        let mut all = Vec::new();
        for (name, executor) in &self.executors {
            let results = run_on(executor, &bytecode, trial)
                .map_err(|error| format!("on {name}: {error}"))?;
            all.push((name.as_str(), results));
        }
        Ok(all)
    }
}

fn run_on(executor: &Executor, bytecode: &Bytecode, trial: &Trial) -> Result<Results, RunError> {
    let start = trial.start();
    let contents = [
        &trial.data,
        &trial.reals,
        &start.results,
        &start.tallies,
        &start.signed_tallies,
    ];
    let buffers = contents
        .into_iter()
        .map(|words| Buffer::from_bytes(&bytes(words)))
        .collect::<Result<Vec<_>, _>>()?;
    let bound: Vec<BoundResource<'_>> = bytecode
        .bindings()
        .iter()
        .filter_map(|binding| buffers.get(binding.binding as usize))
        .map(BoundResource::Buffer)
        .collect();
    bytecode.dispatch(executor, trial.groups, &bound)?;
    let read = |index: usize| Ok(words(&buffers[index].to_bytes()?));
    Ok(Results {
        results: read(2)?,
        tallies: read(3)?,
        signed_tallies: read(4)?,
    })
}

//! Everything a developer or CI runs.

#![forbid(unsafe_code)]

pub mod compare;
pub mod execute;
pub mod instructions;
pub mod measure;
pub mod plan;
pub mod setup;
pub mod size;
pub mod test_backends;
pub mod test_operations;
pub mod test_programs;
pub mod vectors;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
pub use etalon_stability::drivers;

/// Tasks of the Etalon project.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    TestBackends(Box<test_backends::Options>),
    TestOperations(test_operations::Options),
    /// Every kernel on the interpreter and on a Vulkan driver, side by side;
    /// `--help` after it says more.
    BenchKernels(measure::Forwarded),
    /// What accuracy costs in time: every setting's errors beside its time on
    /// every backend; `--help` after it says more.
    Accuracy(measure::Forwarded),
    /// What effects cost by the share of the screen they concern, and where tiles do
    /// not pay; `--help` after it says more.
    Economy(measure::Forwarded),
    /// Every effect on a corpus of hard cases: numbers everywhere, the same bits on
    /// every backend, rounding bounded; `--help` after it says more.
    Stability(measure::Forwarded),
    Plan(Box<plan::Options>),
    /// Look whether the interpreter's handlers use vector instructions.
    CheckVectors(vectors::Options),
    /// Count the instructions the interpreter executes for each kernel.
    CountInstructions(instructions::Options),
    TestPrograms(Box<test_programs::Options>),
    /// Run one job of test-backends.
    #[command(hide = true, name = test_backends::COMMAND)]
    Execute(execute::Job),
    /// Run every operation on one executor.
    #[command(hide = true, name = test_operations::COMMAND)]
    ExecuteOperations(test_operations::Job),
    /// Try programs on one executor.
    #[command(hide = true, name = test_programs::COMMAND)]
    ExecutePrograms(test_programs::Job),
}

/// Runs the task that the command line asks for.
#[must_use]
pub fn main() -> ExitCode {
    match Arguments::parse().task {
        Task::TestBackends(options) => conclude(this_program().and_then(|program| {
            test_backends::run(&options, &program)
                .map(|report| report.ok)
                .map_err(|error| error.to_string())
        })),
        Task::TestOperations(options) => conclude(this_program().and_then(|program| {
            test_operations::run(&options, &program).map_err(|error| error.to_string())
        })),
        Task::TestPrograms(options) => conclude(this_program().and_then(|program| {
            test_programs::run(&options, &program).map_err(|error| error.to_string())
        })),
        Task::BenchKernels(arguments) => conclude(
            measure::run(measure::INTERPRETER, &["kernels"], &arguments)
                .map_err(|error| error.to_string()),
        ),
        Task::Accuracy(arguments) => conclude(
            measure::run(measure::ACCURACY, &[], &arguments).map_err(|error| error.to_string()),
        ),
        Task::Economy(arguments) => conclude(
            measure::run(measure::ECONOMY, &[], &arguments).map_err(|error| error.to_string()),
        ),
        Task::Stability(arguments) => conclude(
            measure::run(measure::STABILITY, &[], &arguments).map_err(|error| error.to_string()),
        ),
        Task::Plan(options) => conclude(
            plan::run(&options)
                .map(|()| true)
                .map_err(|error| error.to_string()),
        ),
        Task::CheckVectors(options) => {
            conclude(vectors::run(&options).map_err(|error| error.to_string()))
        }
        Task::CountInstructions(options) => {
            conclude(instructions::run(&options).map_err(|error| error.to_string()))
        }
        Task::Execute(job) => conclude(
            execute::run(&job)
                .map(|()| true)
                .map_err(|error| error.to_string()),
        ),
        Task::ExecuteOperations(job) => conclude(
            test_operations::execute(&job)
                .map(|()| true)
                .map_err(|error| error.to_string()),
        ),
        Task::ExecutePrograms(job) => conclude(
            test_programs::execute(&job)
                .map(|()| true)
                .map_err(|error| error.to_string()),
        ),
    }
}

/// Where this program is: it starts itself for its hidden commands.
fn this_program() -> Result<PathBuf, String> {
    std::env::current_exe().map_err(|error| format!("this program cannot find itself: {error}"))
}

/// The exit status: success, or failure and on standard error why.
fn conclude(result: Result<bool, String>) -> ExitCode {
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

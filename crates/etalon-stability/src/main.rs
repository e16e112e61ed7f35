//! Runs every effect on the hard cases: see the library, and `--help`.

#![forbid(unsafe_code)]

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use etalon_stability::executors::Kind;
use etalon_stability::per_driver::{self, Child};
use etalon_stability::plant::Plant;
use etalon_stability::run::{FOLLOWED, Options, Progress, run};
use etalon_stability::{drivers, kernels, mutate, report, table};
use indicatif::{ProgressBar, ProgressStyle};

/// Runs every effect on a corpus of hard cases, on every backend: are all results
/// numbers, the same bits everywhere, and near those of f64?
///
/// Ends with 0 if nothing was found that should not be, with 1 if something was, and
/// with 2 if nothing could be found out.
#[derive(Debug, Parser)]
struct Arguments {
    /// Effects; all without it.
    #[arg(long, value_delimiter = ',')]
    effect: Vec<String>,
    /// Names of cases, or parts of names; all without it.
    #[arg(long, value_delimiter = ',')]
    case: Vec<String>,
    /// Executors; devices are compared with `cpu`, `cpu-f64` with `cpu-shadow`.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "cpu,cpu-f64,cpu-shadow,sanitiser,perturbed,wgpu,ash"
    )]
    executor: Vec<Kind>,
    /// Vulkan drivers to run wgpu and Vulkan on, each in a process of its own: `all`, or
    /// names like `lavapipe,swiftshader`. Without it the first device of the first.
    #[arg(long, value_delimiter = ',', value_name = "all|NAMES")]
    drivers: Vec<String>,
    /// Most texels of a frame; larger cases are left out.
    #[arg(long)]
    largest: Option<usize>,
    /// Most texels of a frame for the sanitiser and perturbed executions, which take far
    /// longer than the others.
    #[arg(long, default_value_t = FOLLOWED)]
    followed: usize,
    /// Write a page with all cases, the worst first, here.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write everything found to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Take kernels from this folder in place of those built in, to try a formula.
    #[arg(long)]
    kernels: Option<PathBuf>,
    /// Take the guards of kernels away, one at a time, and see whether anything is found:
    /// runs the corpus for each, on frames of up to 2048 texels, unless `--largest` says
    /// otherwise.
    #[arg(long)]
    mutate: bool,
    /// Plant a fault to be found, as `wgpu:nan`, `ash:bit` or `cpu-shadow:error`.
    #[arg(long, hide = true)]
    plant: Option<Plant>,
    /// Write the report to standard output as JSON, and nothing else.
    #[arg(long, hide = true)]
    data: bool,
}

/// Progress as a bar with an estimate.
struct Shown(ProgressBar);

impl Progress for Shown {
    fn begin(&mut self, pairs: usize) {
        self.0.set_length(pairs as u64);
    }

    fn next(&mut self, case: &str, effect: &str) {
        self.0.set_message(format!("{effect} on {case}"));
        self.0.inc(1);
    }
}

impl Arguments {
    /// This program once more, with the same cases, for a driver.
    fn child(&self) -> Result<Child, String> {
        let program = std::env::current_exe()
            .map_err(|error| format!("this program cannot find itself: {error}"))?;
        let mut arguments: Vec<OsString> = vec!["--data".into()];
        for (option, values) in [("--effect", &self.effect), ("--case", &self.case)] {
            for value in values {
                arguments.extend([option.into(), value.into()]);
            }
        }
        if let Some(largest) = self.largest {
            arguments.extend(["--largest".into(), largest.to_string().into()]);
        }
        arguments.extend(["--followed".into(), self.followed.to_string().into()]);
        if let Some(kernels) = &self.kernels {
            arguments.extend(["--kernels".into(), kernels.into()]);
        }
        if let Some(plant) = &self.plant {
            arguments.extend(["--plant".into(), plant.to_string().into()]);
        }
        Ok(Child { program, arguments })
    }

    fn run(self) -> Result<bool, String> {
        if self.mutate {
            let shown = ProgressBar::no_length();
            let mutants = mutate::mutate(self.largest.unwrap_or(FOLLOWED), |done, of| {
                shown.set_length(of as u64);
                shown.set_position(done as u64);
            });
            shown.finish_and_clear();
            let mutants = mutants.map_err(|error| error.to_string())?;
            print!("{}", mutate::table(&mutants));
            return Ok(mutants.iter().all(|mutant| mutant.failed > 0));
        }
        let kernels = match &self.kernels {
            Some(folder) => kernels::of_folder(folder).map_err(|error| error.to_string())?,
            None => Vec::new(),
        };
        let child = self.child()?;
        let options = Options {
            cases: self.case,
            effects: self.effect,
            executors: self.executor,
            largest: self.largest,
            followed: self.followed,
            kernels,
            plant: self.plant,
        };
        // The template is a constant that is right.
        let style = ProgressStyle::with_template("{wide_bar} {pos}/{len}, {eta} left  {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let mut shown = Shown(ProgressBar::new(0).with_style(style));
        let found = if self.drivers.is_empty() {
            run(&options, &mut shown)
        } else {
            let found = drivers::find(&drivers::Environment::of_process());
            let chosen = per_driver::chosen(found.drivers, &self.drivers);
            let chosen = chosen.map_err(|error| error.to_string())?;
            per_driver::run_on(&options, &child, &chosen, &mut shown)
        };
        shown.0.finish_and_clear();
        let found = found.map_err(|error| error.to_string())?;
        if self.data {
            print!(
                "{}",
                report::json(&found).map_err(|error| error.to_string())?
            );
            return Ok(found.is_sound());
        }
        print!("{}", table::text(&found));
        if let Some(path) = &self.json {
            let text = report::json(&found).map_err(|error| error.to_string())?;
            report::write_text(path, &text).map_err(|error| error.to_string())?;
        }
        if let Some(folder) = &self.report {
            let page = report::write(&found, folder).map_err(|error| error.to_string())?;
            println!("{}", page.display());
        }
        Ok(found.is_sound())
    }
}

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

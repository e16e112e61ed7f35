//! Measures the interpreter: see the library, and `--help`.

#![forbid(unsafe_code)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use etalon_core::kernel::Arithmetic;
use etalon_cpu::Tier;
use etalon_measure::compare::{Settings, compare};
use etalon_measure::subjects::{Size, subject, subjects};
use etalon_measure::table;

/// Measures the interpreter.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Every kernel on the interpreter and on a Vulkan driver, side by side.
    Kernels(Kernels),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ArithmeticName {
    Strict,
    Fast,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TierName {
    All,
    Baseline,
    Avx2,
    Avx512,
}

#[derive(Debug, Args)]
struct Kernels {
    /// Size of the picture.
    #[arg(long, default_value = "1280x720")]
    size: Size,
    /// Effects or small kernels; all without it.
    #[arg(long, value_delimiter = ',')]
    effect: Vec<String>,
    /// Only kernels whose path contains this.
    #[arg(long, default_value = "")]
    kernel: String,
    /// Arithmetics.
    #[arg(long, value_delimiter = ',', default_value = "strict,fast")]
    arithmetic: Vec<ArithmeticName>,
    /// Tiers of the interpreter; those that this processor has not are left out.
    #[arg(long, value_delimiter = ',', default_value = "all")]
    tiers: Vec<TierName>,
    /// Part of the name of the Vulkan device; `none` to measure the interpreter alone.
    #[arg(long, default_value = "llvmpipe")]
    device: String,
    /// Rounds.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Threads of the interpreter; 0 for as many as there are processors.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Milliseconds per executor and round.
    #[arg(long, default_value_t = 40.0)]
    span: f64,
    /// Write all figures to this file.
    #[arg(long)]
    json: Option<PathBuf>,
}

impl Kernels {
    fn settings(&self) -> Result<Settings, String> {
        let subjects = if self.effect.is_empty() {
            subjects()
        } else {
            let named = self.effect.iter().map(|name| subject(name));
            named
                .collect::<Result<_, _>>()
                .map_err(|error| error.to_string())?
        };
        let wanted = |tier: &Tier| {
            self.tiers.iter().any(|name| match name {
                TierName::All => true,
                TierName::Baseline => *tier == Tier::Baseline,
                TierName::Avx2 => *tier == Tier::Avx2,
                TierName::Avx512 => *tier == Tier::Avx512,
            })
        };
        Ok(Settings {
            size: self.size,
            subjects,
            kernel: self.kernel.clone(),
            arithmetics: self
                .arithmetic
                .iter()
                .map(|name| match name {
                    ArithmeticName::Strict => Arithmetic::Strict,
                    ArithmeticName::Fast => Arithmetic::Fast,
                })
                .collect(),
            tiers: Tier::ALL
                .into_iter()
                .filter(|tier| tier.is_available() && wanted(tier))
                .collect(),
            device: (self.device != "none").then(|| self.device.clone()),
            rounds: self.rounds.max(1),
            threads: self.threads,
            span: self.span,
        })
    }

    fn run(&self) -> Result<(), String> {
        let settings = self.settings()?;
        println!(
            "{} at {}, {} rounds; targets: effects avx512 0.5, avx2 0.65, baseline 1.1; arithmetic 0.75, 1.0, 1.6",
            etalon_measure::subjects::SCENE,
            self.size,
            settings.rounds
        );
        let mut first = true;
        let rows = compare(&settings, |row| {
            if std::mem::take(&mut first) {
                println!("{}", table::heading(row));
            }
            println!("{}", table::line(row));
        })
        .map_err(|error| error.to_string())?;
        if let Some(path) = &self.json {
            let text = serde_json::to_string_pretty(&rows).map_err(|error| error.to_string())?;
            std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    let result = match Arguments::parse().task {
        Task::Kernels(kernels) => kernels.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

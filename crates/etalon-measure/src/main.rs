//! Measures the interpreter: see the library, and `--help`.

#![forbid(unsafe_code)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use etalon_core::kernel::Arithmetic;
use etalon_cpu::Tier;
use etalon_measure::subjects::{Size, Subject, subject, subjects};
use etalon_measure::{compare, count, profile, table};

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
    /// Run every kernel for a tool that counts instructions, and print the
    /// kernels' names; see `cargo xtask count-instructions`.
    Count,
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

/// What is measured.
#[derive(Debug, Args)]
struct What {
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
    /// Threads of the interpreter; 0 for as many as there are processors.
    #[arg(long, default_value_t = 0)]
    threads: usize,
}

impl What {
    fn subjects(&self) -> Result<Vec<Subject>, String> {
        if self.effect.is_empty() {
            return Ok(subjects());
        }
        let named = self.effect.iter().map(|name| subject(name));
        named
            .collect::<Result<_, _>>()
            .map_err(|error| error.to_string())
    }

    fn arithmetics(&self) -> Vec<Arithmetic> {
        let names = self.arithmetic.iter();
        names
            .map(|name| match name {
                ArithmeticName::Strict => Arithmetic::Strict,
                ArithmeticName::Fast => Arithmetic::Fast,
            })
            .collect()
    }

    fn tiers(&self) -> Vec<Tier> {
        let wanted = |tier: &Tier| {
            self.tiers.iter().any(|name| match name {
                TierName::All => true,
                TierName::Baseline => *tier == Tier::Baseline,
                TierName::Avx2 => *tier == Tier::Avx2,
                TierName::Avx512 => *tier == Tier::Avx512,
            })
        };
        let available = Tier::ALL.into_iter().filter(|tier| tier.is_available());
        available.filter(wanted).collect()
    }
}

#[derive(Debug, Args)]
struct Kernels {
    #[command(flatten)]
    what: What,
    /// Part of the name of the Vulkan device; `none` to measure the interpreter alone.
    #[arg(long, default_value = "llvmpipe")]
    device: String,
    /// Rounds.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Milliseconds per executor and round.
    #[arg(long, default_value_t = 40.0)]
    span: f64,
    /// Write all figures to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Also print tables in Markdown; with `--profile`, only those.
    #[arg(long)]
    markdown: bool,
    /// Instead of comparing, report the hottest operations and source lines by
    /// the interpreter's own profile, on the last of the tiers.
    #[arg(long)]
    profile: bool,
    /// With `--profile`, how many of each.
    #[arg(long, default_value_t = 12)]
    most: usize,
    /// With `--profile`, list the code with what each instruction cost.
    #[arg(long)]
    listing: bool,
}

impl Kernels {
    fn run(&self) -> Result<(), String> {
        if self.profile {
            return self.profile();
        }
        let settings = compare::Settings {
            size: self.what.size,
            subjects: self.what.subjects()?,
            kernel: self.what.kernel.clone(),
            arithmetics: self.what.arithmetics(),
            tiers: self.what.tiers(),
            device: (self.device != "none").then(|| self.device.clone()),
            rounds: self.rounds.max(1),
            threads: self.what.threads,
            span: self.span,
        };
        println!(
            "{} at {}, {} rounds; targets: effects avx512 0.5, avx2 0.65, baseline 1.1; arithmetic 0.75, 1.0, 1.6",
            etalon_measure::subjects::SCENE,
            settings.size,
            settings.rounds
        );
        let mut first = true;
        let rows = compare::compare(&settings, |row| {
            if std::mem::take(&mut first) {
                println!("{}", table::heading(row));
            }
            println!("{}", table::line(row));
        })
        .map_err(|error| error.to_string())?;
        println!("{}", table::spreads(&rows));
        if self.markdown {
            for arithmetic in settings.arithmetics {
                let of = |row: &&compare::Row| row.arithmetic == arithmetic;
                let rows: Vec<_> = rows.iter().filter(of).cloned().collect();
                println!("\n{arithmetic}\n\n{}", table::markdown(&rows));
            }
        }
        if let Some(path) = &self.json {
            let text = serde_json::to_string_pretty(&rows).map_err(|error| error.to_string())?;
            std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(())
    }

    fn profile(&self) -> Result<(), String> {
        let settings = profile::Settings {
            size: self.what.size,
            subjects: self.what.subjects()?,
            kernel: self.what.kernel.clone(),
            arithmetics: self.what.arithmetics(),
            tier: self.what.tiers().last().copied(),
            threads: self.what.threads,
            repetitions: 3,
        };
        let mut before = None;
        profile::profile(&settings, |kernel| {
            if self.markdown {
                if before.replace(kernel.arithmetic) != Some(kernel.arithmetic) {
                    println!("\n{}\n\n{}", kernel.arithmetic, profile::SUMMARY_HEADING);
                }
                println!("{}", profile::summary(kernel));
                return;
            }
            println!("{}", profile::report(kernel, self.most));
            if self.listing {
                println!("{}", kernel.profile);
            }
        })
        .map_err(|error| error.to_string())
    }
}

fn main() -> ExitCode {
    let result = match Arguments::parse().task {
        Task::Kernels(kernels) => kernels.run(),
        Task::Count => count::count()
            .map(|names| println!("{}", names.join("\n")))
            .map_err(|error| error.to_string()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

//! Measures what accuracy costs in time: see the library, and `--help`.

#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use etalon_accuracy::chart::{Chart, Place};
use etalon_accuracy::executors::Kind;
use etalon_accuracy::model::{Subject, Sweep};
use etalon_accuracy::pictures::Pictures;
use etalon_accuracy::sweep::{LEAST_FRAMES, Options, Progress, Scenes, sweep};
use etalon_accuracy::trial::Swept;
use etalon_accuracy::{profile, report, store, table, text};
use indicatif::{ProgressBar, ProgressStyle};

/// Sweeps the settings of effects: their errors against independent truths beside
/// their times on every backend.
#[derive(Debug, Parser)]
struct Arguments {
    /// Effects; all that have a truth without it.
    #[arg(long, value_delimiter = ',')]
    effect: Vec<String>,
    /// Scenes, and skies for the environment; for each effect the one it has most to do
    /// on without it, and all that it is judged on with `all`.
    #[arg(long, value_delimiter = ',')]
    scene: Vec<String>,
    /// Backends.
    #[arg(long, value_delimiter = ',', default_value = "cpu,wgpu,ash")]
    backend: Vec<Kind>,
    /// Pixels of the pictures; an environment map is as many texels high as the largest
    /// power of two that the height has room for, up to 256.
    #[arg(long, default_value = "640x360")]
    size: String,
    /// Minutes for everything; what does not fit is left out and said so.
    #[arg(long, default_value_t = 10.0)]
    budget_minutes: f64,
    /// How many knobs are turned at once.
    #[arg(long, default_value_t = 2)]
    depth: usize,
    /// Frames that each setting is timed for on each backend.
    #[arg(long, default_value_t = 5)]
    frames: u32,
    /// Write a page with charts and pictures here. What is there of an earlier run
    /// is gone on with.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write each effect's chart of its main error on each scene and backend here,
    /// as an SVG file of its own.
    #[arg(long)]
    charts: Option<PathBuf>,
    /// Write everything found to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the fronts of the last backend to this file, as
    /// `ChainSettings::for_budget` takes them.
    #[arg(long)]
    profile: Option<PathBuf>,
}

impl Arguments {
    fn effects(&self) -> Result<Vec<Swept>, String> {
        if self.effect.is_empty() {
            return Ok(Swept::all().collect());
        }
        let known = |name: &String| Swept::named(name).map_err(|error| error.to_string());
        self.effect.iter().map(known).collect()
    }

    fn options(&self) -> Result<Options, String> {
        let minutes = self.budget_minutes;
        let budget = Duration::try_from_secs_f64(minutes * 60.0)
            .map_err(|_| format!("{minutes} minutes are no time that can be waited"))?;
        Ok(Options {
            effects: self.effects()?,
            scenes: match self.scene.as_slice() {
                [] => Scenes::First,
                [all] if all == "all" => Scenes::Judged,
                names => Scenes::Named(names.to_vec()),
            },
            backends: self.backend.clone(),
            size: text::size(&self.size)?,
            depth: self.depth.min(8),
            frames: self.frames.max(LEAST_FRAMES),
            budget,
        })
    }

    fn run(&self) -> Result<(), String> {
        let options = self.options()?;
        let pictures = self
            .report
            .as_deref()
            .map_or_else(Pictures::none, Pictures::beside);
        let before = match self.report.as_deref() {
            Some(folder) => store::read(folder).map_err(|error| error.to_string())?,
            None => None,
        };
        let mut shown = Shown {
            bar: ProgressBar::hidden(),
            folder: self.report.as_deref(),
        };
        let found = sweep(&options, before.as_ref(), &pictures, &mut shown);
        shown.bar.finish_and_clear();
        let found = found.map_err(|error| error.to_string())?;
        print!("{}", table::text(&found));
        if let Some(folder) = &self.charts {
            charts(&found, folder)?;
        }
        if let Some(path) = &self.json {
            let text = serde_json::to_string_pretty(&found).map_err(|error| error.to_string())?;
            write(path, &text)?;
        }
        if let (Some(path), Some(executor)) = (&self.profile, found.executors.last()) {
            let profile = profile::profile(&found, executor);
            let text = serde_json::to_string_pretty(&profile).map_err(|error| error.to_string())?;
            write(path, &text)?;
        }
        if let Some(folder) = &self.report {
            let page = report::write(&found, folder).map_err(|error| error.to_string())?;
            println!("{}", page.display());
        }
        Ok(())
    }
}

fn charts(sweep: &Sweep, folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for subject in &sweep.subjects {
        let Some(&main) = subject.mains().first() else {
            continue;
        };
        for executor in &sweep.executors {
            let chart = Chart::of(subject, main, executor).svg(Place::Alone);
            let Subject { effect, scene, .. } = subject;
            let file = format!("{effect}-{scene}-{}.svg", executor.id);
            write(&folder.join(file), &chart)?;
        }
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Progress as a bar with an estimate, and what was found kept in a folder.
struct Shown<'a> {
    bar: ProgressBar,
    folder: Option<&'a Path>,
}

impl Progress for Shown<'_> {
    fn begin(&mut self, what: &str, steps: usize) {
        self.bar.finish_and_clear();
        // The template is a constant that is right.
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        self.bar = ProgressBar::new(steps as u64).with_style(style);
        self.bar.set_message(what.to_owned());
    }

    fn step(&mut self) {
        self.bar.inc(1);
    }

    fn keep(&mut self, sweep: &Sweep) -> Result<(), String> {
        self.folder
            .map_or(Ok(()), |folder| store::keep(sweep, folder).map(|_| ()))
            .map_err(|error| error.to_string())
    }
}

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

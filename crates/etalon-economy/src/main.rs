//! Measures what effects cost by the share of the screen that they concern: see the
//! library, and `--help`.

#![forbid(unsafe_code)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use etalon_accuracy::executors::Kind;
use etalon_accuracy::text;
use etalon_economy::sweep::{LEAST_FRAMES, Options, Progress, sweep};
use etalon_economy::{report, table};
use etalon_effects::tiles::Tiling;
use indicatif::{ProgressBar, ProgressStyle};

/// Draws reflections on a scene of which a share mirrors, from none of the screen to all
/// of it, on tiles and on the whole picture: what they cost where there are none, what
/// per share of the screen, and from which share on tiles do not pay. Then whole frames
/// of scenes that lack something.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask economy", bin_name = "cargo xtask economy")]
struct Arguments {
    /// Backends.
    #[arg(long, value_delimiter = ',', default_value = "cpu,wgpu,ash")]
    backend: Vec<Kind>,
    /// Pixels of the pictures.
    #[arg(long, default_value = "640x360")]
    size: String,
    /// The scene.
    #[arg(long, default_value = "corridor-grazing")]
    scene: String,
    /// Texels along the side of a tile: 8, 16, 32 or 64.
    #[arg(long, default_value = "8")]
    tiles: String,
    /// Frames that everything is timed for.
    #[arg(long, default_value_t = 9)]
    frames: u32,
    /// Minutes for everything; with fewer, fewer frames are timed, but never under three.
    #[arg(long, default_value_t = 6.0)]
    budget_minutes: f64,
    /// Write a page with charts here.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write everything found to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write to this file what reflections cost on the last backend where they are
    /// scattered, as `Ssr::for_coverage` takes it.
    #[arg(long)]
    crossover: Option<PathBuf>,
    /// Write the chart of each backend to this folder, as an SVG file of its own.
    #[arg(long)]
    charts: Option<PathBuf>,
}

impl Arguments {
    fn options(&self) -> Result<Options, String> {
        let minutes = self.budget_minutes;
        let budget = Duration::try_from_secs_f64(minutes * 60.0)
            .map_err(|_| format!("{minutes} minutes are no time that can be waited"))?;
        let sized = Tiling::ALL[1..].iter().copied().find(|tiling| {
            let side = tiling.size().map(|size| size.side().to_string());
            side.as_deref() == Some(self.tiles.as_str())
        });
        Ok(Options {
            scene: self.scene.clone(),
            size: text::size(&self.size)?,
            backends: self.backend.clone(),
            tiles: sized.ok_or_else(|| {
                format!(
                    "there are no tiles of `{}` texels; there are 8, 16, 32, 64",
                    self.tiles
                )
            })?,
            frames: self.frames.clamp(LEAST_FRAMES, 10_000),
            budget,
        })
    }

    fn run(&self) -> Result<(), String> {
        let options = self.options()?;
        let mut shown = Shown(ProgressBar::hidden());
        let found = sweep(&options, &mut shown);
        shown.0.finish_and_clear();
        let found = found.map_err(|error| error.to_string())?;
        print!("{}", table::text(&found));
        if let Some(path) = &self.json {
            let text = report::json(&found).map_err(|error| error.to_string())?;
            report::write_text(path, &text).map_err(|error| error.to_string())?;
        }
        if let (Some(path), Some(last)) = (&self.crossover, found.sweeps.last()) {
            let text =
                serde_json::to_string_pretty(&last.cost).map_err(|error| error.to_string())?;
            report::write_text(path, &text).map_err(|error| error.to_string())?;
        }
        if let Some(folder) = &self.charts {
            report::charts(&found, folder).map_err(|error| error.to_string())?;
        }
        if let Some(folder) = &self.report {
            let page = report::write(&found, folder).map_err(|error| error.to_string())?;
            println!("{}", page.display());
        }
        Ok(())
    }
}

/// Progress as a bar with an estimate.
struct Shown(ProgressBar);

impl Progress for Shown {
    fn begin(&mut self, what: &str, steps: u64) {
        self.0.finish_and_clear();
        // The template is a constant that is right.
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        self.0 = ProgressBar::new(steps).with_style(style);
        self.0.set_message(what.to_owned());
    }

    fn step(&mut self) {
        self.0.inc(1);
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

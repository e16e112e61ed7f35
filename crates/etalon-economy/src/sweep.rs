//! Reflections by the share of the screen that mirrors, timed in turns.
//!
//! In each round every share is drawn once on tiles and once without on every executor,
//! the two right after each other and another one first each time, so that what else
//! the machine does meets both alike. The first round does not count; in it the
//! pictures are held against each other, which have to be the same bits.

use std::time::{Duration, Instant};

use etalon_accuracy::executors::{Executor, Kind};
use etalon_accuracy::metric::{MetricError, spread};
use etalon_core::backend::{BackendError, CapturedData, Inputs};
use etalon_core::graph::{Graph, GraphError};
use etalon_core::image::{ImageData, ImageError};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError};
use etalon_effects::EffectError;
use etalon_effects::ssr::{Ssr, ssr};
use etalon_effects::tiles::crossover::Cost;
use etalon_effects::tiles::{MARKED_SIDE, Tiling};
use etalon_scenes::frame::FrameError;
use etalon_scenes::scenes::WorldError;
use etalon_scenes::{Frame, FrameSize, scene, scenes};
use thiserror::Error;

use crate::fit::{self, FitError};
use crate::mask::{Layout, mask, share};
use crate::model::{Economy, Point, Sweep};
use crate::{lacking, model};

/// Shares of the screen that are tried.
pub const COVERAGES: [f64; 12] = [
    0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0,
];

/// Frames that everything is timed for at least: quartiles of fewer would be none.
pub const LEAST_FRAMES: u32 = 3;

/// Seconds between frames: results depend on no clock.
pub(crate) const DELTA_TIME: f32 = 1.0 / 60.0;

/// What mirrors: half of the light, and rough, so that nothing is saved on the blur.
const MIRROR: [f32; 4] = [0.5, 0.5, 0.5, 0.5];

/// The most pixels that are swept: the specular map is held once for each share.
pub const MOST_PIXELS: usize = 3840 * 2160;

/// What to sweep.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scene's name.
    pub scene: String,
    /// Pixels of the pictures.
    pub size: FrameSize,
    /// Backends; each has to be there.
    pub backends: Vec<Kind>,
    /// Size of the tiles.
    pub tiles: Tiling,
    /// Frames that each share is timed for on each executor.
    pub frames: u32,
    /// Time for everything.
    pub budget: Duration,
}

/// Why a sweep ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EconomyError {
    /// There is no such scene.
    #[error("there is no scene `{name}`; there are {}", scenes().iter().map(|scene| scene.name).collect::<Vec<_>>().join(", "))]
    NoScene {
        /// As given.
        name: String,
    },
    /// Without tiles there is nothing to compare.
    #[error("tiles that are off have no cost; give the side of tiles: 8, 16, 32 or 64")]
    NoTiles,
    /// The pictures are larger than what is swept.
    #[error("{} × {} pixels are too many: at most {MOST_PIXELS} are swept", .size[0], .size[1])]
    TooLarge {
        /// Width and height.
        size: [u32; 2],
    },
    /// The scene cannot be rendered.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The size is not possible.
    #[error(transparent)]
    Size(#[from] FrameError),
    /// An image cannot be made.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// An effect refuses the scene.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The graph refuses a result.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// A graph cannot be planned.
    #[error("{kind}: {source}")]
    Plan {
        /// For which backend.
        kind: Kind,
        /// Why not.
        source: Box<PlanError>,
    },
    /// A backend that was asked for is not there, or fails.
    #[error("{kind}: {source}")]
    Backend {
        /// Which.
        kind: Kind,
        /// Why.
        source: BackendError,
    },
    /// A device cannot tell how long steps take.
    #[error("{kind}: the device has no clock")]
    NoClock {
        /// Of which backend.
        kind: Kind,
    },
    /// The picture on tiles is another one.
    #[error(
        "{kind}: with {layout} {:.1} % mirroring the picture on tiles is another than the whole one, first at texel \
         ({}, {})",
        .coverage * 100.0, .texel[0], .texel[1]
    )]
    Different {
        /// On which backend.
        kind: Kind,
        /// How the mirroring texels lie.
        layout: Layout,
        /// Their share.
        coverage: f64,
        /// The first texel that differs.
        texel: [u32; 2],
    },
    /// Times have no median.
    #[error(transparent)]
    Times(#[from] MetricError),
    /// Times have no line.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Is told how a sweep comes on.
pub trait Progress {
    /// Something with at most so many steps begins.
    fn begin(&mut self, what: &str, steps: u64);
    /// A step is done.
    fn step(&mut self);
}

/// Sweeps.
///
/// # Errors
/// An [`EconomyError`] at the first thing that fails, a picture that differs included.
pub fn sweep(options: &Options, progress: &mut dyn Progress) -> Result<Economy, EconomyError> {
    let begin = Instant::now();
    if options.tiles == Tiling::Off {
        return Err(EconomyError::NoTiles);
    }
    let size = [options.size.width(), options.size.height()];
    if options.size.pixels() > MOST_PIXELS {
        return Err(EconomyError::TooLarge { size });
    }
    let entry = scene(&options.scene).ok_or_else(|| EconomyError::NoScene {
        name: options.scene.clone(),
    })?;
    let mut executors = Vec::new();
    for &kind in &options.backends {
        let opened = Executor::open(kind);
        executors.push(opened.map_err(|source| EconomyError::Backend { kind, source })?);
    }
    let frame = entry.frame(options.size)?;
    let kernels = etalon_effects::kernels();
    let mut economy = Economy {
        size,
        scene: entry.name.to_owned(),
        executors: executors.iter().map(Executor::model).collect(),
        ..Economy::default()
    };
    let scenes = masked(&frame)?;
    // A quarter of the time is for whole frames.
    let end = begin + options.budget.mul_f64(0.75);
    let mut samples = vec![Vec::new(); executors.len() * scenes.len()];
    let runs = Runs::new(&frame, options, &executors, &kernels)?;
    let steps = u64::from(options.frames + 1) * samples.len() as u64;
    progress.begin("reflections by coverage", steps);
    for round in 0..=options.frames {
        let start = Instant::now();
        for (index, executor) in executors.iter_mut().enumerate() {
            for (place, scene) in scenes.iter().enumerate() {
                let run = &runs.0[index];
                let inputs = frame.inputs().texture("specular", &scene.specular);
                if round == 0 {
                    run.compare(executor, &inputs, scene)?;
                } else {
                    let first = (round as usize + place).is_multiple_of(2);
                    let sample = run.sample(executor, &inputs, first)?;
                    samples[index * scenes.len() + place].push(sample);
                }
                progress.step();
            }
        }
        if round >= LEAST_FRAMES && round < options.frames && Instant::now() + start.elapsed() > end
        {
            economy.notes.push(format!(
                "each share was timed for {round} frames instead of {} for want of time",
                options.frames
            ));
            break;
        }
    }
    let marched = marched(&frame, &scenes, options, &kernels)?;
    for (executor, samples) in executors.iter().zip(samples.chunks(scenes.len())) {
        for layout in Layout::ALL {
            let each = scenes.iter().zip(samples).zip(&marched);
            let points = each
                .filter(|((scene, _), _)| scene.layout == layout)
                .map(|((scene, samples), marched)| point(scene, samples, *marched));
            let points: Vec<Point> = points.collect::<Result<_, _>>()?;
            let mut swept = Sweep {
                executor: executor.kind.to_string(),
                layout,
                points,
                ..Sweep::default()
            };
            conclude(&mut swept)?;
            economy.sweeps.push(swept);
        }
    }
    let end = begin + options.budget;
    lacking::frames(
        &frame,
        options,
        &mut executors,
        &kernels,
        end,
        &mut economy,
        progress,
    )?;
    Ok(economy)
}

/// A specular map of which a share mirrors.
struct Masked {
    layout: Layout,
    coverage: f64,
    specular: ImageData,
}

/// The scene's specular map, replaced by one that mirrors where `mirrors` says so.
pub(crate) fn specular(frame: &Frame, mirrors: &[bool]) -> Result<ImageData, ImageError> {
    let texels: Vec<[f32; 4]> = mirrors
        .iter()
        .map(|mirrors| if *mirrors { MIRROR } else { [0.0; 4] })
        .collect();
    ImageData::from_rgba_f32(frame.specular.desc, &texels)
}

fn masked(frame: &Frame) -> Result<Vec<Masked>, EconomyError> {
    let mut all = Vec::new();
    for layout in Layout::ALL {
        for wanted in COVERAGES {
            let mirrors = mask(layout, wanted, frame.size());
            all.push(Masked {
                layout,
                coverage: share(&mirrors),
                specular: specular(frame, &mirrors)?,
            });
        }
    }
    Ok(all)
}

/// The plans of reflections on tiles and without for one executor, and the same with
/// the picture read back.
struct Run {
    tiled: Plan,
    whole: Plan,
    shown: [Plan; 2],
}

struct Runs(Vec<Run>);

impl Runs {
    fn new(
        frame: &Frame,
        options: &Options,
        executors: &[Executor],
        kernels: &KernelLibrary,
    ) -> Result<Self, EconomyError> {
        let tiled = graph(frame, options.tiles)?;
        let whole = graph(frame, Tiling::Off)?;
        let run = |executor: &Executor| {
            Ok(Run {
                tiled: plan(executor, &tiled, kernels, Capture::None)?,
                whole: plan(executor, &whole, kernels, Capture::None)?,
                shown: [
                    plan(executor, &tiled, kernels, Capture::Outputs)?,
                    plan(executor, &whole, kernels, Capture::Outputs)?,
                ],
            })
        };
        Ok(Self(
            executors
                .iter()
                .map(run)
                .collect::<Result<_, EconomyError>>()?,
        ))
    }
}

fn graph(frame: &Frame, tiles: Tiling) -> Result<Graph, EconomyError> {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, DELTA_TIME)?;
    let settings = Ssr {
        tiles,
        ..Ssr::default()
    };
    let result = ssr(&mut graph, &inputs, &settings)?;
    graph.output("result", result)?;
    Ok(graph)
}

/// Plans for an executor, in the arithmetic that an engine's frame runs.
pub(crate) fn plan(
    executor: &Executor,
    graph: &Graph,
    kernels: &KernelLibrary,
    capture: Capture,
) -> Result<Plan, EconomyError> {
    let plan = executor.plan(graph, kernels, Arithmetic::Fast, capture);
    plan.map_err(|source| EconomyError::Plan {
        kind: executor.kind,
        source: Box::new(source),
    })
}

/// Times of one frame, in nanoseconds.
#[derive(Clone, Copy, Debug)]
struct Sample {
    tiled: f64,
    classification: f64,
    whole: f64,
}

/// Nanoseconds of a plan's steps on an executor: all, and those that classify.
pub(crate) fn time(
    executor: &mut Executor,
    plan: &Plan,
    inputs: &Inputs<'_>,
) -> Result<[f64; 2], EconomyError> {
    let kind = executor.kind;
    let execution = executor.backend().execute(plan, inputs);
    let times = execution
        .map_err(|source| EconomyError::Backend { kind, source })?
        .times;
    if times.is_empty() {
        return Err(EconomyError::NoClock { kind });
    }
    let classifies = |step: &str| step.starts_with("tiles/") || step.ends_with("/classify");
    let mut sums = [0.0; 2];
    for time in &times {
        sums[0] += time.nanoseconds as f64;
        if classifies(&time.step) {
            sums[1] += time.nanoseconds as f64;
        }
    }
    Ok(sums)
}

impl Run {
    fn sample(
        &self,
        executor: &mut Executor,
        inputs: &Inputs<'_>,
        tiled_first: bool,
    ) -> Result<Sample, EconomyError> {
        let (tiled, whole);
        if tiled_first {
            tiled = time(executor, &self.tiled, inputs)?;
            whole = time(executor, &self.whole, inputs)?;
        } else {
            whole = time(executor, &self.whole, inputs)?;
            tiled = time(executor, &self.tiled, inputs)?;
        }
        Ok(Sample {
            tiled: tiled[0],
            classification: tiled[1],
            whole: whole[0],
        })
    }

    /// Holds the picture on tiles to the whole one. Both have been run once then.
    fn compare(
        &self,
        executor: &mut Executor,
        inputs: &Inputs<'_>,
        scene: &Masked,
    ) -> Result<(), EconomyError> {
        let kind = executor.kind;
        let mut picture = |plan: &Plan| {
            let execution = executor.backend().execute(plan, inputs);
            let execution = execution.map_err(|source| EconomyError::Backend { kind, source })?;
            Ok::<_, EconomyError>(execution.output("result").cloned())
        };
        let [tiled, whole] = [picture(&self.shown[0])?, picture(&self.shown[1])?];
        match first_difference(tiled.as_ref(), whole.as_ref()) {
            None => Ok(()),
            Some(texel) => Err(EconomyError::Different {
                kind,
                layout: scene.layout,
                coverage: scene.coverage,
                texel,
            }),
        }
    }
}

/// The first texel whose bits differ; the first of all if there is a picture too few.
fn first_difference(tiled: Option<&ImageData>, whole: Option<&ImageData>) -> Option<[u32; 2]> {
    let (Some(tiled), Some(whole)) = (tiled, whole) else {
        return Some([0, 0]);
    };
    let size = whole.desc.format.texel_bytes() as usize;
    let mut texels = tiled.bytes.chunks(size).zip(whole.bytes.chunks(size));
    let place = texels.position(|(tiled, whole)| tiled != whole)? as u32;
    let width = whole.desc.extent.width.max(1);
    Some([place % width, place / width])
}

/// For each scene the share of the texels in tiles that are marched, as the lists say
/// that the interpreter makes.
fn marched(
    frame: &Frame,
    scenes: &[Masked],
    options: &Options,
    kernels: &KernelLibrary,
) -> Result<Vec<f64>, EconomyError> {
    let kind = Kind::Cpu;
    let mut cpu = Executor::open(kind).map_err(|source| EconomyError::Backend { kind, source })?;
    let graph = graph(frame, options.tiles)?;
    let plan = plan(&cpu, &graph, kernels, Capture::EveryPass)?;
    let pixels = options.size.pixels() as f64;
    let mut shares = Vec::new();
    for scene in scenes {
        let inputs = frame.inputs().texture("specular", &scene.specular);
        let execution = cpu.backend().execute(&plan, &inputs);
        let execution = execution.map_err(|source| EconomyError::Backend { kind, source })?;
        // The march's list is made first, and says in its fourth word how many
        // workgroups have work.
        let mut captures = execution.captures.iter();
        let groups = captures.find_map(|capture| match &capture.data {
            CapturedData::Buffer(bytes) if capture.pass == "tiles/list" => {
                let word = bytes.get(12..16)?;
                Some(u32::from_le_bytes(word.try_into().ok()?))
            }
            _ => None,
        });
        let texels = f64::from(groups.unwrap_or(0)) * f64::from(MARKED_SIDE * MARKED_SIDE);
        // Tiles stand over the picture's edges.
        shares.push((texels / pixels).min(1.0));
    }
    Ok(shares)
}

fn point(scene: &Masked, samples: &[Sample], marched: f64) -> Result<Point, MetricError> {
    let of = |time: fn(&Sample) -> f64| {
        let times: Vec<f64> = samples.iter().map(time).collect();
        spread(&times)
    };
    Ok(Point {
        coverage: scene.coverage,
        marched,
        tiled: of(|sample| sample.tiled)?,
        classification: of(|sample| sample.classification)?,
        whole: of(|sample| sample.whole)?,
        ratio: of(|sample| sample.tiled / sample.whole)?,
    })
}

/// The lines through a sweep's points, and what follows from them.
pub(crate) fn conclude(sweep: &mut model::Sweep) -> Result<(), EconomyError> {
    let over = |share: fn(&Point) -> f64| {
        let points = sweep.points.iter();
        let points: Vec<_> = points
            .map(|point| (share(point), point.tiled.median))
            .collect();
        fit::line(&points)
    };
    let (fit, work) = (over(|point| point.coverage)?, over(|point| point.marched)?);
    let whole: Vec<f64> = sweep
        .points
        .iter()
        .map(|point| point.whole.median)
        .collect();
    (sweep.fit, sweep.work) = (fit, work);
    sweep.cost = Cost {
        idle: work.intercept,
        slope: work.slope,
        whole: spread(&whole)?.median,
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_accuracy::model::Spread;

    fn times(median: f64) -> Spread {
        Spread {
            median,
            lower: median,
            upper: median,
            frames: 3,
        }
    }

    #[test]
    fn a_sweep_crosses_where_its_line_meets_the_whole() {
        let points = COVERAGES.map(|coverage| Point {
            coverage,
            marched: (2.0 * coverage).min(1.0),
            tiled: times(2.0 + 10.0 * (2.0 * coverage).min(1.0)),
            whole: times(7.0),
            ..Point::default()
        });
        let mut sweep = Sweep {
            points: points.to_vec(),
            ..Sweep::default()
        };
        conclude(&mut sweep).unwrap();
        // A line over what is marched, and none over what mirrors.
        assert!((sweep.work.r_squared - 1.0).abs() < 1e-12);
        assert!(sweep.fit.r_squared < 0.9);
        assert!((sweep.cost.crossover() - 0.5).abs() < 1e-12, "{sweep:?}");
    }

    #[test]
    fn a_planted_bit_is_a_difference() {
        let frame = scene("corridor-grazing").unwrap();
        let frame = frame.frame(FrameSize::new(9, 7).unwrap()).unwrap();
        let whole = frame.colour;
        let mut tiled = whole.clone();
        assert_eq!(first_difference(Some(&tiled), Some(&whole)), None);
        tiled.bytes[(2 * 9 + 4) * 8 + 3] ^= 1;
        assert_eq!(first_difference(Some(&tiled), Some(&whole)), Some([4, 2]));
        assert_eq!(first_difference(None, Some(&whole)), Some([0, 0]));
    }
}

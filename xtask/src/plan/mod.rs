//! `cargo xtask plan`: what a frame of a scene calls for, and what that costs.

mod dot;
mod flow;
mod html;
mod layout;
mod model;
mod options;
mod svg;
#[cfg(test)]
mod tests;
mod text;

use std::path::{Path, PathBuf};

use etalon::effects::demand::Demands;
use etalon::effects::frame::{Request, of_images};
use etalon::graph::{Graph, GraphError};
use etalon_core::backend::{Backend, BackendError};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_scenes::model::{Shot, ShotError};
use thiserror::Error;

use crate::execute::frame::{Content, DELTA_TIME, SourceError};
use crate::execute::{Api, backends};
use crate::test_backends::model::BackendKind;
use model::{Measured, Report};
pub use options::{Options, Preset, ShadingName};

/// Why there is no plan to show.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlanCommandError {
    /// No scene of that name.
    #[error(
        "there is no scene `{name}`; there are {}, and files whose names end with .gltf, .glb or .exr",
        known.join(", ")
    )]
    NoScene {
        /// As given.
        name: String,
        /// Those there are.
        known: Vec<&'static str>,
    },
    /// No effect of that name.
    #[error("there is no effect `{name}` to switch; there are all, none, {}", known.join(", "))]
    NoEffect {
        /// As given.
        name: String,
        /// Those there are.
        known: Vec<&'static str>,
    },
    /// No output of that name.
    #[error("there is no output `{name}`; there are {}", known.join(", "))]
    NoOutput {
        /// As given.
        name: String,
        /// Those there are.
        known: Vec<&'static str>,
    },
    /// There is no such file, or nothing in it that can be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The graph cannot be planned.
    #[error(transparent)]
    Plan(Box<PlanError>),
    /// A backend cannot be had, or cannot run the plan.
    #[error("{backend:?}: {error}")]
    Backend {
        /// Which one.
        backend: BackendKind,
        /// Why not.
        error: Box<BackendError>,
    },
    /// A file cannot be written.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        error: std::io::Error,
    },
}

impl From<PlanError> for PlanCommandError {
    fn from(error: PlanError) -> Self {
        Self::Plan(Box::new(error))
    }
}

/// Runs the command: prints the plan and writes what was asked for.
///
/// # Errors
/// If there is no such scene, or something cannot be planned, run or written.
pub fn run(options: &Options) -> Result<(), PlanCommandError> {
    let report = report(options)?;
    print!("{}", text::render(&report));
    if let Some(path) = &options.dot {
        write(path, &dot::render(&report.plan))?;
    }
    if let Some(path) = &options.json {
        write(path, &model::json(&report))?;
    }
    if let Some(folder) = &options.report {
        std::fs::create_dir_all(folder).map_err(|error| PlanCommandError::Io {
            path: folder.clone(),
            error,
        })?;
        let page = folder.join("index.html");
        write(&page, &html::render(&report))?;
        println!("\nThe page is {}", page.display());
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), PlanCommandError> {
    std::fs::write(path, text).map_err(|error| PlanCommandError::Io {
        path: path.to_owned(),
        error,
    })
}

/// Plans the frame, and runs it where that is asked for.
fn report(options: &Options) -> Result<Report, PlanCommandError> {
    // What costs nothing to find wrong first.
    let source = options.source()?;
    let mut request = Request {
        demands: Demands::everything(),
        outputs: options.asked()?,
        settings: options.settings()?,
        thresholds: options.thresholds(),
    };
    request
        .thresholds
        .validate()
        .map_err(|error| SourceError::Effect(error.into()))?;
    let content = source.content()?;
    if !options.everything {
        request.demands = demands(&content)?;
    }
    let graph = graph(&content, options, &request)?;
    let kernels = etalon::effects::kernels();
    let plan_options = PlanOptions {
        arithmetic: options.arithmetic.into(),
        ..PlanOptions::default()
    };
    let plan = Plan::new(&graph, &kernels, &plan_options)?;
    let mut measured = Vec::new();
    for &kind in &options.run {
        let failed = |error: BackendError| PlanCommandError::Backend {
            backend: kind,
            error: Box::new(error),
        };
        let mut backend = backends::open(kind, Api::Vulkan, 0, false).map_err(failed)?;
        measured.push(measure(backend.as_mut(), &graph, &content, options)?.map_err(failed)?);
    }
    let size = content.size();
    Ok(Report {
        scene: source.name(),
        size: [size.width(), size.height()],
        preset: options.preset.name(),
        demands: request.demands,
        memory: plan.transient_memory(),
        timeline: plan.memory_timeline(),
        counters: plan.counters(),
        parsed: kernels.stats().parsed,
        measured,
        plan,
    })
}

/// The counters of one run on a new backend.
fn measure(
    backend: &mut dyn Backend,
    graph: &Graph,
    content: &Content,
    options: &Options,
) -> Result<Result<Measured, BackendError>, PlanCommandError> {
    let kernels = etalon::effects::kernels();
    let plan_options = PlanOptions {
        arithmetic: options.arithmetic.into(),
        limits: backend.limits(),
        capture: Capture::None,
        memory: backend.memory(),
    };
    let plan = Plan::new(graph, &kernels, &plan_options)?;
    Ok(backend.execute(&plan, &content.inputs()).map(|_| Measured {
        backend: backend.info(),
        counters: backend.counters(),
    }))
}

/// What is on the screen.
fn demands(content: &Content) -> Result<Demands, PlanCommandError> {
    Ok(match content {
        Content::Frame(frame) => frame.demands(),
        Content::Shot(shot, size) => {
            let sky = Shot::sky(&mut Graph::new()).map_err(SourceError::from)?;
            let demands = shot.demands(*size, &sky);
            demands.map_err(|error| SourceError::from(ShotError::from(error)))?
        }
    })
}

/// The passes that a frame calls for.
fn graph(
    content: &Content,
    options: &Options,
    request: &Request,
) -> Result<Graph, PlanCommandError> {
    let mut graph = Graph::new();
    match content {
        Content::Frame(frame) => {
            let inputs = frame.import(&mut graph, DELTA_TIME);
            let inputs = inputs.map_err(|error: GraphError| SourceError::from(error))?;
            of_images(&mut graph, &inputs, request).map_err(SourceError::from)?;
        }
        Content::Shot(shot, size) => {
            let sky = Shot::sky(&mut graph).map_err(SourceError::from)?;
            let shading = options.shading.into();
            shot.frame(&mut graph, *size, sky, shading, DELTA_TIME, request)
                .map_err(SourceError::from)?;
        }
    }
    Ok(graph)
}

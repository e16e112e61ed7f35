//! The hidden command that runs one scene on one backend and one driver, in a
//! process of its own: the Vulkan loader reads its environment once per
//! process, and a driver that crashes must not take the comparison with it.

pub(crate) mod backends;
mod buffer;
pub mod frame;
pub mod outcome;
pub mod plant;
mod spread;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use etalon::effects::{EffectEntry, effect, effects};
use etalon_core::backend::{BackendError, CapturedData};
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture as CaptureWhat, Plan, PlanError, PlanOptions};
use thiserror::Error;

use crate::size::Size;
use crate::test_backends::model::BackendKind;
use backends::open_for;
use frame::{Source, SourceError};
use outcome::{Capture, Label, Outcome, OutcomeError, Run, Time};
use plant::{Fault, PlantError};

/// Through which API wgpu reaches the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Api {
    /// Vulkan.
    Vulkan,
    /// OpenGL.
    Gl,
}

/// Which arithmetic kernels use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ArithmeticName {
    /// The same bits everywhere.
    Strict,
    /// The device's own functions and filters.
    Fast,
}

impl ArithmeticName {
    /// As on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Fast => "fast",
        }
    }
}

impl From<ArithmeticName> for Arithmetic {
    fn from(name: ArithmeticName) -> Self {
        match name {
            ArithmeticName::Strict => Self::Strict,
            ArithmeticName::Fast => Self::Fast,
        }
    }
}

/// What to run, on what, and where to put the result.
#[derive(Clone, Debug, Args)]
pub struct Job {
    /// The backend.
    #[arg(long)]
    pub backend: BackendKind,
    /// The API that wgpu uses.
    #[arg(long, default_value = "vulkan")]
    pub api: Api,
    /// A scene or model of the registry.
    #[arg(long, required_unless_present = "input")]
    pub scene: Option<String>,
    /// A rendered frame or a model in a file instead.
    #[arg(long, conflicts_with = "scene")]
    pub input: Option<PathBuf>,
    /// Size of the scene's picture.
    #[arg(long, default_value = "640x360")]
    pub size: Size,
    /// The effect.
    #[arg(long, default_value = "chain")]
    pub effect: String,
    /// The arithmetic.
    #[arg(long, default_value = "strict")]
    pub arithmetic: ArithmeticName,
    /// How often the same frame is run, histories carried over.
    #[arg(long, default_value_t = 1)]
    pub frames: u32,
    /// Threads of the interpreter; 0 for as many as there are processors.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Whether ash runs under the validation layer, whose messages are errors.
    #[arg(long)]
    pub validate: bool,
    /// Whether the interpreter watches for what a GPU hides.
    #[arg(long)]
    pub checks: bool,
    /// Whether the interpreter finds out how far devices may be from what it stores.
    #[arg(long)]
    pub spread: bool,
    /// A fault to plant.
    #[arg(long)]
    pub plant: Option<Fault>,
    /// An existing folder for the outcome.
    #[arg(long)]
    pub out: PathBuf,
}

impl Job {
    /// What to render.
    ///
    /// # Errors
    /// If there is no scene or model of its name.
    pub fn source(&self) -> Result<Source, SourceError> {
        match (&self.input, &self.scene) {
            (Some(path), _) => Ok(Source::of_file(path.clone(), self.size)),
            (None, name) => Source::named(name.as_deref().unwrap_or_default(), self.size),
        }
    }

    /// The job as arguments of the hidden command.
    #[must_use]
    pub fn arguments(&self) -> Vec<std::ffi::OsString> {
        let value = |value: &dyn ValueName| value.value_name();
        let mut arguments: Vec<std::ffi::OsString> = Vec::new();
        let mut add = |name: &str, value: std::ffi::OsString| {
            arguments.push(name.into());
            arguments.push(value);
        };
        add("--backend", value(&self.backend).into());
        add("--api", value(&self.api).into());
        if let Some(scene) = &self.scene {
            add("--scene", scene.into());
        }
        if let Some(input) = &self.input {
            add("--input", input.into());
        }
        add("--size", self.size.to_string().into());
        add("--effect", (&self.effect).into());
        add("--arithmetic", value(&self.arithmetic).into());
        add("--frames", self.frames.to_string().into());
        add("--threads", self.threads.to_string().into());
        if let Some(fault) = &self.plant {
            add("--plant", fault.to_string().into());
        }
        add("--out", (&self.out).into());
        if self.validate {
            arguments.push("--validate".into());
        }
        if self.checks {
            arguments.push("--checks".into());
        }
        if self.spread {
            arguments.push("--spread".into());
        }
        arguments
    }
}

/// The name of a value on the command line.
trait ValueName {
    fn value_name(&self) -> String;
}

impl<T: ValueEnum> ValueName for T {
    fn value_name(&self) -> String {
        self.to_possible_value()
            .map(|value| value.get_name().to_owned())
            .unwrap_or_default()
    }
}

/// Why an execution did not complete.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExecuteError {
    /// There is no frame or no graph.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// No effect of that name.
    #[error(transparent)]
    Effect(#[from] UnknownEffect),
    /// The graph cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The backend cannot be had, or cannot run the plan.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The fault cannot be planted.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A captured buffer is no image.
    #[error("`{binding}` of pass `{pass}`: {source}")]
    Capture {
        /// The pass.
        pass: String,
        /// Its binding.
        binding: String,
        /// Why not.
        source: etalon_core::image::ImageError,
    },
    /// The outcome cannot be written.
    #[error(transparent)]
    Outcome(#[from] OutcomeError),
}

/// No effect of that name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no effect `{name}`; there are {}", effects().iter().map(|effect| effect.name).collect::<Vec<_>>().join(", "))]
pub struct UnknownEffect {
    name: String,
}

/// The effect of a name.
///
/// # Errors
/// If there is none.
pub fn find_effect(name: &str) -> Result<&'static EffectEntry, UnknownEffect> {
    effect(name).ok_or_else(|| UnknownEffect {
        name: name.to_owned(),
    })
}

/// Runs the job and writes its outcome, whatever that is, to the folder.
///
/// # Errors
/// If the outcome itself cannot be written.
pub fn run(job: &Job) -> Result<(), OutcomeError> {
    if let Some(fault) = &job.plant {
        fault.at_the_start();
    }
    let outcome = match execute(job) {
        Ok(run) => Outcome::Ran(run),
        Err(ExecuteError::Outcome(error)) => return Err(error),
        Err(error) => {
            let reason = error.to_string();
            match error {
                ExecuteError::Backend(BackendError::NoDevice { .. }) => {
                    Outcome::NoDevice { reason }
                }
                ExecuteError::Backend(
                    BackendError::Unsupported { .. } | BackendError::Lacking { .. },
                ) => Outcome::Unsupported { reason },
                _ => Outcome::Failed { reason },
            }
        }
    };
    outcome.write(&job.out)
}

fn execute(job: &Job) -> Result<Run, ExecuteError> {
    let effect = find_effect(&job.effect)?;
    // The device first: without one there is no need to render anything.
    let mut opened = open_for(job)?;
    let backend = opened.backend();
    let content = job.source()?.content()?;
    let graph = content.graph(effect)?;
    let mut kernels = etalon::effects::kernels();
    if let Some(fault) = &job.plant {
        fault.in_kernels(&mut kernels)?;
    }
    let options = PlanOptions {
        arithmetic: job.arithmetic.into(),
        limits: backend.limits(),
        capture: CaptureWhat::EveryPass,
        memory: backend.memory(),
    };
    let mut plan = Plan::new(&graph, &kernels, &options)?;
    if let Some(fault) = &job.plant {
        fault.in_plan(&mut plan)?;
    }
    let mut run = Run {
        device: backend.info().into(),
        captures: Vec::new(),
        times: Vec::new(),
        findings: Vec::new(),
    };
    for number in 0..job.frames {
        let mut execution = backend.execute(&plan, &content.inputs())?;
        if let Some(fault) = &job.plant {
            fault.in_captures(&mut execution)?;
        }
        run.times = execution
            .times
            .into_iter()
            .map(|time| Time {
                step: time.step,
                nanoseconds: time.nanoseconds,
            })
            .collect();
        for captured in execution.captures {
            let image = match captured.data {
                CapturedData::Texture(image) => Ok((image, false)),
                CapturedData::Buffer(bytes) => {
                    let format = buffer::format_of(&plan, &captured.pass, &captured.binding);
                    buffer::as_image(bytes, format).map(|image| (image, true))
                }
            };
            let (image, buffer) = image.map_err(|source| ExecuteError::Capture {
                pass: captured.pass.clone(),
                binding: captured.binding.clone(),
                source,
            })?;
            let label = Label {
                frame: number,
                pass: &captured.pass,
                binding: &captured.binding,
                resource: &captured.resource,
                buffer,
            };
            run.captures.push(Capture::write(
                Path::new(&job.out),
                label,
                run.captures.len(),
                &image,
            )?);
        }
    }
    run.findings = opened.findings();
    if job.spread {
        spread::add(job, &plan, &content, &mut run)?;
    }
    Ok(run)
}

//! The command line of `test-backends`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::model::{BackendKind, Executor, Target};
use crate::execute::frame::Source;
use crate::execute::plant::Fault;
use crate::execute::{Api, ArithmeticName, Job};
use crate::size::Size;

/// Which arithmetic to test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ArithmeticChoice {
    /// The same bits everywhere.
    Strict,
    /// The device's own functions and filters.
    Fast,
    /// One after the other.
    Both,
}

impl ArithmeticChoice {
    /// One or two.
    #[must_use]
    pub const fn names(self) -> &'static [ArithmeticName] {
        match self {
            Self::Strict => &[ArithmeticName::Strict],
            Self::Fast => &[ArithmeticName::Fast],
            Self::Both => &[ArithmeticName::Strict, ArithmeticName::Fast],
        }
    }
}

/// Render the same scenes with every backend on every driver and compare each
/// pass's output.
///
/// The CPU interpreter is the reference: wgpu and ash are compared with it on
/// every Vulkan driver found, ash with wgpu on each driver, and wgpu also
/// through OpenGL. Exit status 0 means that all required backends ran and
/// agree, 1 that they did not, 2 that the command line is wrong.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// A scene or model to render; may be given several times [default: all]
    #[arg(long, value_name = "NAME", conflicts_with = "input")]
    pub scene: Vec<String>,
    /// Width and height of the scenes' and models' pictures
    #[arg(long, value_name = "WxH", default_value = "640x360")]
    pub size: Size,
    /// A file to use instead of scenes: a model that the backends draw, or a
    /// rendered frame with colour, depth, normals and so on
    #[arg(long, value_name = "MODEL.gltf|MODEL.glb|FRAME.exr")]
    pub input: Option<PathBuf>,
    /// Effects to apply, each by itself; `all` for every one
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "all|NAMES",
        default_value = "chain"
    )]
    pub effect: Vec<String>,
    /// How often each frame is run; effects that remember need two
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub frames: u32,
    /// Backends that have to run and agree
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "BACKENDS",
        default_value = "cpu,wgpu,ash"
    )]
    pub require: Vec<BackendKind>,
    /// Drivers to use: `all`, or names like `lavapipe,swiftshader,gl`
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "all|NAMES",
        default_value = "all"
    )]
    pub drivers: Vec<String>,
    /// The arithmetic of the kernels
    #[arg(long, default_value = "strict")]
    pub arithmetic: ArithmeticChoice,
    /// Write an HTML report with pictures to this folder
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Write everything measured to this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Run ash under the Khronos validation layer, its messages being failures
    #[arg(long)]
    pub validate: bool,
    /// Have the interpreter watch for what a GPU hides: accesses out of bounds,
    /// reads of what nothing wrote, races, NaNs that are born, and more
    #[arg(long)]
    pub checks: bool,
    /// First install Vulkan drivers and tools (Debian and its kin)
    #[arg(long)]
    pub setup: bool,
    /// Threads of the interpreter [default: as many as there are processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub threads: usize,
    /// Seconds after which an execution counts as crashed
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub timeout: u64,
    /// Plant a fault into one executor, as `ash/lavapipe=texel:PASS:BINDING`,
    /// to see it found
    #[arg(long, value_name = "EXECUTOR=FAULT", hide = true, value_parser = planted)]
    pub plant: Vec<(String, Fault)>,
}

impl Options {
    /// The job that applies an effect to a frame on one executor.
    pub(super) fn job(
        &self,
        source: &Source,
        effect: &str,
        arithmetic: ArithmeticName,
        executor: &Executor,
        out: PathBuf,
    ) -> Job {
        let (scene, input) = match source {
            Source::Scene { name, .. } | Source::Model { name, .. } => (Some(name.clone()), None),
            Source::File(path) | Source::ModelFile { path, .. } => (None, Some(path.clone())),
        };
        let planted = self.plant.iter().find(|(name, _)| *name == executor.id);
        Job {
            backend: executor.backend,
            api: if executor.target == Target::Gl {
                Api::Gl
            } else {
                Api::Vulkan
            },
            scene,
            input,
            size: self.size,
            effect: effect.to_owned(),
            arithmetic,
            frames: self.frames,
            threads: self.threads,
            validate: self.validate,
            checks: self.checks,
            // What is drawn is not perturbed.
            spread: executor.backend == BackendKind::Cpu
                && arithmetic == ArithmeticName::Fast
                && !source.is_drawn(),
            plant: planted.map(|(_, fault)| fault.clone()),
            out,
        }
    }
}

/// Reads `EXECUTOR=FAULT`.
fn planted(text: &str) -> Result<(String, Fault), String> {
    let (executor, fault) = text
        .split_once('=')
        .ok_or("as in ash/lavapipe=texel:PASS:BINDING")?;
    Ok((
        executor.to_owned(),
        fault.parse::<Fault>().map_err(|error| error.to_string())?,
    ))
}

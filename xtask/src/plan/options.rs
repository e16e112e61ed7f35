//! The command line of `plan`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use etalon::effects::demand::{Outputs, Thresholds};
use etalon::effects::{ChainSettings, Quality, frame};

use super::PlanCommandError;
use crate::execute::ArithmeticName;
use crate::execute::frame::Source;
use crate::size::Size;
use crate::test_backends::model::BackendKind;

/// How good the effects are to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// As they are by default.
    Default,
    /// The cheapest that can be looked at.
    Low,
    /// A third of the way up.
    Medium,
    /// Two thirds of the way up.
    High,
    /// Where more work shows no more.
    Ultra,
}

impl Preset {
    /// As on the command line.
    #[must_use]
    pub fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// How surfaces of models are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShadingName {
    /// As they are drawn.
    Forward,
    /// From a G-buffer.
    Deferred,
}

impl From<ShadingName> for frame::Shading {
    fn from(name: ShadingName) -> Self {
        match name {
            ShadingName::Forward => Self::Forward,
            ShadingName::Deferred => Self::Deferred,
        }
    }
}

/// Show what a frame of a scene calls for: which effects run and why or why not, the
/// passes of the plan in order, the memory that is alive at each, and what is counted.
///
/// Nothing is run unless `--run` names backends, whose own counters then stand beside
/// those of the plan.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// A scene or model of the registry, or a file: a model, or a rendered frame
    #[arg(value_name = "SCENE|MODEL.gltf|MODEL.glb|FRAME.exr")]
    pub scene: String,
    /// Width and height of the picture; a frame in a file has its own
    #[arg(long, value_name = "WxH", default_value = "640x360")]
    pub size: Size,
    /// Effects that are on: `all`, `none`, or some of ssr, exposure, bloom
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "all|none|NAMES",
        default_value = "all"
    )]
    pub effects: Vec<String>,
    /// How good they are to be
    #[arg(long, default_value = "default")]
    pub preset: Preset,
    /// The arithmetic of the kernels
    #[arg(long, default_value = "strict")]
    pub arithmetic: ArithmeticName,
    /// What is asked for: some of picture, light, depth, normal, specular, velocity
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "NAMES",
        default_value = "picture"
    )]
    pub outputs: Vec<String>,
    /// How opaque surfaces of models are lit
    #[arg(long, default_value = "forward")]
    pub shading: ShadingName,
    /// Reflect nothing unless something that mirrors is as smooth as this roughness
    #[arg(long, value_name = "0..1", default_value_t = Thresholds::default().max_roughness)]
    pub max_roughness: f32,
    /// Reflect nothing unless something mirrors more of a colour than this
    #[arg(long, value_name = "0..1", default_value_t = Thresholds::default().min_specular)]
    pub min_specular: f32,
    /// March one texel in four unless something mirrors more of a colour than this
    #[arg(long, value_name = "0..1", default_value_t = Thresholds::default().faint_specular)]
    pub faint_specular: f32,
    /// March one texel in four unless something that mirrors is nearer, in view units
    #[arg(long, value_name = "DISTANCE", default_value_t = Thresholds::default().distant)]
    pub distant: f32,
    /// Plan as if anything could be anywhere on the screen
    #[arg(long)]
    pub everything: bool,
    /// Backends to run the plan on once, for their own counters
    #[arg(long, value_delimiter = ',', value_name = "BACKENDS")]
    pub run: Vec<BackendKind>,
    /// Write the passes and what they hand to each other as a Graphviz graph
    #[arg(long, value_name = "FILE")]
    pub dot: Option<PathBuf>,
    /// Write an HTML page with the graph and the memory drawn to this folder
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Write the plan and all that is told of it to this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// The effects that can be switched.
const SWITCHED: [&str; 3] = ["ssr", "exposure", "bloom"];

/// What can be asked for.
const OUTPUTS: [&str; 6] = [
    "picture", "light", "depth", "normal", "specular", "velocity",
];

impl Options {
    /// What to plan a frame of.
    pub(super) fn source(&self) -> Result<Source, PlanCommandError> {
        let path = PathBuf::from(&self.scene);
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        if ["gltf", "glb", "exr"].iter().any(|known| ending == *known) {
            return Ok(Source::of_file(path, self.size));
        }
        Source::named(&self.scene, self.size).map_err(|_| PlanCommandError::NoScene {
            name: self.scene.clone(),
            known: Source::names().collect(),
        })
    }

    /// The settings of the effects that are on.
    pub(super) fn settings(&self) -> Result<ChainSettings, PlanCommandError> {
        let all = match self.preset {
            Preset::Default => ChainSettings::full(),
            Preset::Low => ChainSettings::preset(Quality::Low),
            Preset::Medium => ChainSettings::preset(Quality::Medium),
            Preset::High => ChainSettings::preset(Quality::High),
            Preset::Ultra => ChainSettings::preset(Quality::Ultra),
        };
        for name in &self.effects {
            if !["all", "none"].contains(&name.as_str()) && !SWITCHED.contains(&name.as_str()) {
                return Err(PlanCommandError::NoEffect {
                    name: name.clone(),
                    known: SWITCHED.to_vec(),
                });
            }
        }
        let on = |effect: &str| {
            self.effects
                .iter()
                .any(|name| name == "all" || name == effect)
        };
        Ok(ChainSettings {
            ssr: all.ssr.filter(|_| on("ssr")),
            exposure: all.exposure.filter(|_| on("exposure")),
            bloom: all.bloom.filter(|_| on("bloom")),
            composite: all.composite,
        })
    }

    /// What is asked for.
    pub(super) fn asked(&self) -> Result<Outputs, PlanCommandError> {
        let mut asked = Outputs::NONE;
        for name in &self.outputs {
            let field = match name.as_str() {
                "picture" => &mut asked.picture,
                "light" => &mut asked.light,
                "depth" => &mut asked.depth,
                "normal" => &mut asked.normal,
                "specular" => &mut asked.specular,
                "velocity" => &mut asked.velocity,
                _ => {
                    return Err(PlanCommandError::NoOutput {
                        name: name.clone(),
                        known: OUTPUTS.to_vec(),
                    });
                }
            };
            *field = true;
        }
        Ok(asked)
    }

    /// What is worth an effect.
    pub(super) fn thresholds(&self) -> Thresholds {
        Thresholds {
            max_roughness: self.max_roughness,
            min_specular: self.min_specular,
            faint_specular: self.faint_specular,
            distant: self.distant,
            ..Thresholds::default()
        }
    }
}

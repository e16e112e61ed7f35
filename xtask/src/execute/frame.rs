//! What the effects are applied to: images of a scene, a rendered frame, or a
//! model that the backends draw themselves.

use std::path::{Path, PathBuf};

use etalon::backend::Inputs;
use etalon::effects::environment::{Mirrored, Surroundings};
use etalon::effects::{Beyond, EffectEntry, EffectError, SceneInputs};
use etalon::graph::{Graph, GraphError};
use etalon_scenes::exr_frame::{ExrError, ExrOptions, load_exr};
use etalon_scenes::frame::FrameError;
use etalon_scenes::model::gltf::{GltfError, GltfOptions, load_gltf};
use etalon_scenes::model::{Shot, ShotError};
use etalon_scenes::scenes::WorldError;
use etalon_scenes::{Frame, FrameSize, model, models, scene, scenes};
use thiserror::Error;

use crate::size::Size;

/// Seconds between frames: a constant, as results may not depend on clocks.
pub(crate) const DELTA_TIME: f32 = 1.0 / 60.0;

/// Seconds of a model's animation that have passed.
const TIME: f64 = 0.5;

/// What to render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene of the registry, as images.
    Scene {
        /// Its name.
        name: String,
        /// Pixels of the picture.
        size: Size,
    },
    /// A model of the registry.
    Model {
        /// Its name.
        name: String,
        /// Pixels of the picture.
        size: Size,
    },
    /// A model in a glTF file.
    ModelFile {
        /// The file.
        path: PathBuf,
        /// Pixels of the picture.
        size: Size,
    },
    /// A rendered frame.
    File(PathBuf),
}

/// Why there is no frame, or no graph on it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceError {
    /// No scene of that name.
    #[error("there is no scene `{name}`; there are {}", Source::names().collect::<Vec<_>>().join(", "))]
    NoScene {
        /// As given.
        name: String,
    },
    /// The size is not possible.
    #[error(transparent)]
    Size(#[from] FrameError),
    /// The scene cannot be rendered.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The model cannot be made or drawn.
    #[error(transparent)]
    Shot(Box<ShotError>),
    /// The file is no frame that can be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: ExrError,
    },
    /// The file is no model that can be read.
    #[error("{}: {source}", path.display())]
    ModelFile {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: Box<GltfError>,
    },
    /// The graph refuses the frame.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The effect refuses the frame.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

impl From<ShotError> for SourceError {
    fn from(error: ShotError) -> Self {
        Self::Shot(Box::new(error))
    }
}

impl Source {
    /// The names of all scenes and models.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let models = models().iter().map(|model| model.name);
        scenes().iter().map(|scene| scene.name).chain(models)
    }

    /// The scene or model of a name.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(name: &str, size: Size) -> Result<Self, SourceError> {
        let name = name.to_owned();
        if scene(&name).is_some() {
            Ok(Self::Scene { name, size })
        } else if model(&name).is_some() {
            Ok(Self::Model { name, size })
        } else {
            Err(SourceError::NoScene { name })
        }
    }

    /// A file: a model if its name ends as those of glTF do, else a frame.
    #[must_use]
    pub fn of_file(path: PathBuf, size: Size) -> Self {
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("gltf") || ending.eq_ignore_ascii_case("glb") {
            Self::ModelFile { path, size }
        } else {
            Self::File(path)
        }
    }

    /// A scene's name or a file's.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Scene { name, .. } | Self::Model { name, .. } => name.clone(),
            Self::File(path) | Self::ModelFile { path, .. } => path
                .file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned(),
        }
    }

    /// Whether backends draw it themselves, so that their rasterisers are compared
    /// as well.
    #[must_use]
    pub const fn is_drawn(&self) -> bool {
        matches!(self, Self::Model { .. } | Self::ModelFile { .. })
    }

    /// Renders or reads what there is.
    ///
    /// # Errors
    /// If there is no such scene or file, or it is nothing that can be used.
    pub fn content(&self) -> Result<Content, SourceError> {
        let no_scene = |name: &String| SourceError::NoScene { name: name.clone() };
        match self {
            Self::Scene { name, size } => {
                let entry = scene(name).ok_or_else(|| no_scene(name))?;
                Ok(Content::Frame(Box::new(entry.frame(frame_size(*size)?)?)))
            }
            Self::Model { name, size } => {
                let entry = model(name).ok_or_else(|| no_scene(name))?;
                let model = (entry.build)().map_err(ShotError::from)?;
                let shot = Shot::new(model, TIME)?;
                Ok(Content::Shot(Box::new(shot), frame_size(*size)?))
            }
            Self::ModelFile { path, size } => {
                let model = load_gltf(path, &GltfOptions::default()).map_err(|source| {
                    SourceError::ModelFile {
                        path: path.clone(),
                        source: Box::new(source),
                    }
                })?;
                let shot = Shot::new(model, TIME)?;
                Ok(Content::Shot(Box::new(shot), frame_size(*size)?))
            }
            Self::File(path) => Ok(Content::Frame(Box::new(read(path)?))),
        }
    }
}

fn frame_size(size: Size) -> Result<FrameSize, FrameError> {
    FrameSize::new(size.width, size.height)
}

fn read(path: &Path) -> Result<Frame, SourceError> {
    let loaded = load_exr(path, &ExrOptions::default());
    Ok(loaded
        .map_err(|source| SourceError::File {
            path: path.to_owned(),
            source,
        })?
        .frame)
}

/// What an effect is applied to.
#[derive(Debug)]
pub enum Content {
    /// Images.
    Frame(Box<Frame>),
    /// A model, drawn at a size.
    Shot(Box<Shot>, FrameSize),
}

impl Content {
    /// Pixels of the picture.
    #[must_use]
    pub fn size(&self) -> FrameSize {
        match self {
            Self::Frame(frame) => frame.size(),
            Self::Shot(_, size) => *size,
        }
    }

    /// The graph of an effect with its default settings, its result as the output
    /// `result`.
    ///
    /// # Errors
    /// If the effect refuses the content.
    pub fn graph(&self, effect: &EffectEntry) -> Result<Graph, SourceError> {
        let mut graph = Graph::new();
        let inputs = match self {
            Self::Frame(frame) => frame.import(&mut graph, DELTA_TIME)?,
            Self::Shot(shot, size) => {
                // What surfaces mirror of the rooms is seen in reflections, where the
                // screen has no answer.
                let around = Surroundings {
                    mirrored: Mirrored::Reflected,
                    ..shot.among_rooms(&mut graph)?
                };
                let drawn = shot.draw(&mut graph, *size, around, DELTA_TIME)?;
                // Or nobody would need it.
                graph.output("deferred", drawn.deferred)?;
                SceneInputs {
                    beyond: Some(Beyond {
                        surroundings: around,
                        view: shot.camera().pose().view_matrix(),
                    }),
                    ..drawn.inputs
                }
            }
        };
        let result = effect.build(&mut graph, &inputs)?;
        graph.output("result", result)?;
        Ok(graph)
    }

    /// What the graph's imports hold.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        match self {
            Self::Frame(frame) => frame.inputs(),
            Self::Shot(shot, _) => shot.inputs(),
        }
    }
}

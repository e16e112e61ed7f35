//! Where the frame comes from that the effects are applied to.

use std::path::{Path, PathBuf};

use etalon::effects::{EffectEntry, EffectError};
use etalon::graph::{Graph, GraphError};
use etalon_scenes::exr_frame::{ExrError, ExrOptions, load_exr};
use etalon_scenes::frame::FrameError;
use etalon_scenes::scenes::WorldError;
use etalon_scenes::{Frame, FrameSize, scene, scenes};
use thiserror::Error;

/// Seconds between frames: a constant, as results may not depend on clocks.
const DELTA_TIME: f32 = 1.0 / 60.0;

/// What to render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene of the registry at a size.
    Scene {
        /// Its name.
        name: String,
        /// Pixels in x.
        width: u32,
        /// Pixels in y.
        height: u32,
    },
    /// A rendered frame.
    File(PathBuf),
}

/// Why there is no frame, or no graph on it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceError {
    /// No scene of that name.
    #[error("there is no scene `{name}`; there are {}", scenes().iter().map(|scene| scene.name).collect::<Vec<_>>().join(", "))]
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
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: ExrError,
    },
    /// The frame cannot be imported.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The effect refuses it.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

impl Source {
    /// A scene's name or a file's.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Scene { name, .. } => name.clone(),
            Self::File(path) => path
                .file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned(),
        }
    }

    /// Renders or reads the frame.
    ///
    /// # Errors
    /// If there is no such scene or file, or it is no possible frame.
    pub fn frame(&self) -> Result<Frame, SourceError> {
        match self {
            Self::Scene {
                name,
                width,
                height,
            } => {
                let entry =
                    scene(name).ok_or_else(|| SourceError::NoScene { name: name.clone() })?;
                Ok(entry.frame(FrameSize::new(*width, *height)?)?)
            }
            Self::File(path) => read(path),
        }
    }
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

/// The graph of an effect with its default settings on a frame, its result as
/// the output `result`.
///
/// # Errors
/// If the effect refuses the frame.
pub fn graph(frame: &Frame, effect: &EffectEntry) -> Result<Graph, SourceError> {
    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, DELTA_TIME)?;
    let result = (effect.build)(&mut graph, &inputs)?;
    graph.output("result", result)?;
    Ok(graph)
}

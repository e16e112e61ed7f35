//! What is measured: every kernel of every effect, and a few small kernels
//! that do one thing only.

use std::str::FromStr;

use etalon_core::Format;
use etalon_core::backend::Backend;
use etalon_core::graph::{Graph, GraphError, Texture};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::resource::{Limits, SamplerDesc, TextureDesc};
use etalon_effects::registry::{EffectEntry, effects};
use etalon_effects::{EffectError, SceneInputs};
use etalon_scenes::frame::FrameError;
use etalon_scenes::scenes::WorldError;
use etalon_scenes::{Frame, FrameSize, scene};
use thiserror::Error;

use crate::work::{Work, WorkError, works};

/// Why there is nothing to measure.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SubjectError {
    /// The size is not possible.
    #[error(transparent)]
    Size(#[from] FrameError),
    /// The scene cannot be rendered.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The scenes do not have the one that is measured.
    #[error("there is no scene `{SCENE}`")]
    NoScene,
    /// No subject of that name.
    #[error("there is nothing to measure by the name `{name}`; there are {}", names().join(", "))]
    Unknown {
        /// As given.
        name: String,
    },
    /// The frame cannot be imported.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The effect refuses the frame.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The effect cannot be taken apart.
    #[error("{subject}: {source}")]
    Work {
        /// The subject.
        subject: &'static str,
        /// Why not.
        source: Box<WorkError>,
    },
}

/// The scene measured on.
pub const SCENE: &str = "wet-floor";

/// Seconds between frames: results depend on no clock.
const DELTA_TIME: f32 = 1.0 / 60.0;

/// How much of a Vulkan driver's time the interpreter may take, by tier.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Targets {
    /// SSE2.
    pub baseline: f64,
    /// AVX2.
    pub avx2: f64,
    /// AVX-512.
    pub avx512: f64,
}

/// Of kernels of effects.
const EFFECTS: Targets = Targets {
    baseline: 1.1,
    avx2: 0.65,
    avx512: 0.5,
};

/// Of loops of nothing but arithmetic.
const ARITHMETIC: Targets = Targets {
    baseline: 1.6,
    avx2: 1.0,
    avx512: 0.75,
};

type Build = fn(&mut Graph, &SceneInputs) -> Result<Texture, EffectError>;

/// Where a graph comes from.
#[derive(Clone, Copy, Debug)]
enum Origin {
    Effect(&'static EffectEntry),
    Small(Build),
}

/// Something to measure.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    /// By which it is known: the effect's name, or the small kernel's.
    pub name: &'static str,
    /// What is aimed at.
    pub targets: Targets,
    origin: Origin,
    /// Whether it can be had in strict arithmetic.
    strict: bool,
}

/// The small kernels: path and text.
const KERNELS: [(&str, &str); 3] = [
    (
        "measure/arithmetic",
        include_str!("../kernels/arithmetic.wesl"),
    ),
    (
        "measure/arithmetic_chains",
        include_str!("../kernels/arithmetic_chains.wesl"),
    ),
    ("measure/bilinear", include_str!("../kernels/bilinear.wesl")),
];

fn target(graph: &mut Graph, inputs: &SceneInputs, format: Format) -> Texture {
    let extent = graph.desc(inputs.colour).extent;
    graph.texture(
        "result",
        TextureDesc::d2(extent.width, extent.height, format),
    )
}

fn small() -> [Subject; 3] {
    [
        Subject {
            name: "arithmetic",
            targets: ARITHMETIC,
            origin: Origin::Small(|graph, inputs| {
                let result = target(graph, inputs, Format::R32Float);
                Ok(graph
                    .compute("measure/arithmetic")
                    .write("result", result)
                    .set("offset", 0.375)
                    .per_texel("result")?)
            }),
            strict: true,
        },
        Subject {
            name: "arithmetic-chains",
            targets: ARITHMETIC,
            origin: Origin::Small(|graph, inputs| {
                let result = target(graph, inputs, Format::R32Float);
                Ok(graph
                    .compute("measure/arithmetic_chains")
                    .write("result", result)
                    .set("offset", 0.375)
                    .per_texel("result")?)
            }),
            strict: true,
        },
        Subject {
            name: "bilinear",
            targets: EFFECTS,
            origin: Origin::Small(|graph, inputs| {
                let result = target(graph, inputs, Format::Rgba16Float);
                Ok(graph
                    .compute("measure/bilinear")
                    .read("source", inputs.colour)
                    .sampler("linear", SamplerDesc::LINEAR_CLAMP)
                    .write("result", result)
                    .per_texel("result")?)
            }),
            // Samplers' weights are their own.
            strict: false,
        },
    ]
}

fn of_effect(entry: &'static EffectEntry) -> Subject {
    Subject {
        name: entry.name,
        targets: EFFECTS,
        origin: Origin::Effect(entry),
        strict: true,
    }
}

/// Everything there is to measure: the effects in the registry's order, but
/// for `chain`, whose kernels are theirs; then the small kernels.
#[must_use]
pub fn subjects() -> Vec<Subject> {
    effects()
        .iter()
        .filter(|entry| entry.name != "chain")
        .map(of_effect)
        .chain(small())
        .collect()
}

/// The names of [`subjects`], and `chain`, which can be asked for.
#[must_use]
pub fn names() -> Vec<&'static str> {
    let chain = effects().iter().map(|entry| entry.name);
    chain.chain(small().map(|subject| subject.name)).collect()
}

/// The subject of a name, which may be `chain`.
///
/// # Errors
/// [`SubjectError::Unknown`] if there is none.
pub fn subject(name: &str) -> Result<Subject, SubjectError> {
    let entry = effects().iter().find(|entry| entry.name == name);
    entry
        .map(of_effect)
        .or_else(|| small().into_iter().find(|subject| subject.name == name))
        .ok_or_else(|| SubjectError::Unknown {
            name: name.to_owned(),
        })
}

/// The frame measured on.
///
/// # Errors
/// If the size is not possible.
pub fn frame(size: Size) -> Result<Frame, SubjectError> {
    let size = FrameSize::new(size.width, size.height)?;
    Ok(scene(SCENE).ok_or(SubjectError::NoScene)?.frame(size)?)
}

impl Subject {
    /// Whether it can be had in this arithmetic.
    #[must_use]
    pub fn has(&self, arithmetic: Arithmetic) -> bool {
        self.strict || arithmetic == Arithmetic::Fast
    }

    /// Its graph on a frame.
    ///
    /// # Errors
    /// If the effect refuses the frame.
    pub fn graph(&self, frame: &Frame) -> Result<Graph, SubjectError> {
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, DELTA_TIME)?;
        let result = match self.origin {
            Origin::Effect(entry) => entry.build_with(&mut graph, &inputs, &entry.everywhere())?,
            Origin::Small(build) => build(&mut graph, &inputs)?,
        };
        graph.output("result", result)?;
        Ok(graph)
    }

    /// The work of each of its kernels. `backend` finds out what they read.
    ///
    /// # Errors
    /// If it cannot be planned or run.
    pub fn works(
        &self,
        frame: &Frame,
        arithmetic: Arithmetic,
        backend: &mut dyn Backend,
    ) -> Result<Vec<Work>, SubjectError> {
        let graph = self.graph(frame)?;
        // What every device can do, so that one plan suits all.
        let limits = Limits::default();
        works(
            &graph,
            &library(),
            arithmetic,
            limits,
            backend,
            &frame.inputs(),
        )
        .map_err(|source| SubjectError::Work {
            subject: self.name,
            source: Box::new(source),
        })
    }
}

/// All kernels, the small ones too.
#[must_use]
pub fn library() -> KernelLibrary {
    let mut library = etalon_effects::kernels();
    for (path, text) in KERNELS {
        library.add_source(path, text);
    }
    library
}

/// Pixels in x and y, written `1280x720`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels in x, at least 1.
    pub width: u32,
    /// Pixels in y, at least 1.
    pub height: u32,
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| *side > 0);
        text.split_once(['x', '×'])
            .and_then(|(width, height)| {
                Some(Self {
                    width: side(width)?,
                    height: side(height)?,
                })
            })
            .ok_or_else(|| {
                "a size is a width and a height of at least 1, as in 1280x720".to_owned()
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subjects_have_names_of_their_own_and_are_found_by_them() {
        let names = names();
        for (index, name) in names.iter().enumerate() {
            assert!(!names[..index].contains(name), "{name}");
            assert_eq!(subject(name).unwrap().name, *name);
        }
        assert!(names.contains(&"chain"));
        assert_eq!(subjects().len() + 1, names.len());
        let error = subject("nothing").unwrap_err().to_string();
        assert!(error.contains("`nothing`") && error.contains("bilinear"));
    }

    #[test]
    fn sizes_are_read() {
        let size: Size = "64x36".parse().unwrap();
        assert_eq!((size.width, size.height), (64, 36));
        assert_eq!(size.to_string(), "64x36");
        for text in ["", "64", "0x1", "1x0", "1x2x3", "-1x4"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}

//! A scene as effects and truths take it.

use etalon_core::graph::Graph;
use etalon_core::image::ImageError;
use etalon_effects::knob::KnobValue;
use etalon_effects::ssr::truth::ScreenData;
use etalon_effects::truth::Plane;
use etalon_effects::{CameraParams, EffectEntry, EffectError};
use etalon_scenes::frame::FrameError;
use etalon_scenes::scenes::WorldError;
use etalon_scenes::trace::Reflection;
use etalon_scenes::{Frame, FrameSize, World, scene, scenes, skies};
use thiserror::Error;

/// Seconds between frames: results depend on no clock.
pub const DELTA_TIME: f32 = 1.0 / 60.0;

/// Rays through each pixel, in each axis, that the scene's own light is averaged
/// over.
const RAYS: u32 = 4;

/// Why there is no stage.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StageError {
    /// No scene of that name.
    #[error("there is no scene `{name}`; there are {}", scenes().iter().map(|scene| scene.name).collect::<Vec<_>>().join(", "))]
    NoScene {
        /// As given.
        name: String,
    },
    /// No sky of that name.
    #[error("there is no sky `{name}`; there are {}", skies().iter().map(|sky| sky.name).collect::<Vec<_>>().join(", "))]
    NoSky {
        /// As given.
        name: String,
    },
    /// The sky is refused as an environment.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The scene cannot be rendered.
    #[error(transparent)]
    World(#[from] WorldError),
    /// Its images cannot be held.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Its images cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// A scene, and what a frame of it holds.
#[derive(Clone, Debug)]
pub struct Stage {
    /// The scene's name.
    pub scene: &'static str,
    /// What there is.
    pub world: World,
    /// Its images.
    pub frame: Frame,
    /// Its camera, as effects take it.
    pub camera: CameraParams,
    /// What the frame shows, as numbers.
    pub screen: ScreenData,
}

impl Stage {
    /// Renders a scene of the registry.
    ///
    /// # Errors
    /// If there is none of that name, or memory runs out.
    pub fn new(name: &str, size: FrameSize) -> Result<Self, StageError> {
        let entry = scene(name).ok_or_else(|| StageError::NoScene {
            name: name.to_owned(),
        })?;
        let frame = entry.frame(size)?;
        Ok(Self {
            scene: entry.name,
            world: (entry.build)()?,
            camera: frame.camera_params(),
            screen: ScreenData {
                colour: Plane::of(&frame.colour)?,
                depth: Plane::of(&frame.depth)?,
                normal: Plane::of(&frame.normal)?,
                specular: Plane::of(&frame.specular)?,
            },
            frame,
        })
    }

    /// Width and height.
    #[must_use]
    pub fn size(&self) -> FrameSize {
        self.frame.size()
    }

    /// The graph of an effect with some knobs set, its result as the output `result`.
    /// Every pass runs on the whole picture unless a value says otherwise.
    ///
    /// # Errors
    /// If the effect refuses the scene or a value.
    pub fn graph(
        &self,
        effect: &EffectEntry,
        values: &[(&str, KnobValue)],
    ) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let inputs = self.frame.import(&mut graph, DELTA_TIME)?;
        let mut all: Vec<(&str, KnobValue)> = effect.everywhere();
        all.extend_from_slice(values);
        let result = effect.build_with(&mut graph, &inputs, &all)?;
        graph.output("result", result)?;
        Ok(graph)
    }

    /// What the mirror ray of each pixel meets.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn reflection(&self) -> Result<Reflection, StageError> {
        Ok(self.world.reflection(self.size())?)
    }

    /// The scene's own light, averaged over each pixel by 16 rays, where a frame has
    /// what one ray through its centre met. Fewer rays where so many pixels would be
    /// too many.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn light(&self) -> Result<Plane, StageError> {
        let size = self.size();
        let mut rays = RAYS;
        let fine = loop {
            match FrameSize::new(size.width() * rays, size.height() * rays) {
                Ok(fine) => break fine,
                Err(_) if rays > 1 => rays /= 2,
                Err(error) => return Err(error.into()),
            }
        };
        let fine = Plane::of(&self.world.frame(fine)?.colour)?;
        let share = f64::from(rays * rays).recip();
        Ok(Plane::from_fn(size.width(), size.height(), |x, y| {
            let mut sum = [0.0; 4];
            for row in 0..rays {
                for column in 0..rays {
                    let texel = fine.at((x * rays + column).into(), (y * rays + row).into());
                    for (sum, value) in sum.iter_mut().zip(texel) {
                        *sum += value * share;
                    }
                }
            }
            sum
        })?)
    }
}

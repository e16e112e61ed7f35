//! A sky as effects of environment maps and their truths take it.

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_effects::environment::EnvironmentMap;
use etalon_effects::knob::KnobValue;
use etalon_effects::truth::Plane;
use etalon_effects::{EffectError, MapEntry};
use etalon_scenes::{FrameSize, sky};

use crate::stage::StageError;

/// The largest map that is tried. Its truth is a sum over all texels for each texel:
/// twice the side takes sixteen times as long.
const LARGEST: u32 = 256;

/// The name of the map's image among a graph's imports.
const BASE: &str = "base";

/// A sky, and the map that is made of it.
#[derive(Clone, Debug)]
pub struct SkyStage {
    /// The sky's name.
    pub scene: &'static str,
    /// Its picture, which keeps all that the map could hold.
    pub picture: Plane,
    /// What effects take.
    pub map: EnvironmentMap,
}

impl SkyStage {
    /// A sky of the registry, as a map whose side is the largest power of two that the
    /// picture's height has room for, from 32 to 256.
    ///
    /// # Errors
    /// If there is none of that name, or memory runs out.
    pub fn new(name: &str, size: FrameSize) -> Result<Self, StageError> {
        let entry = sky(name).ok_or_else(|| StageError::NoSky {
            name: name.to_owned(),
        })?;
        let side = (1 << size.height().ilog2()).clamp(32, LARGEST);
        // As wide as three sides.
        let picture = entry.picture(side + side / 2)?;
        Ok(Self {
            scene: entry.name,
            map: EnvironmentMap::of_equirectangular(&picture, side)?,
            picture: Plane::of(&picture)?,
        })
    }

    /// Texels of the map's side.
    #[must_use]
    pub fn side(&self) -> u32 {
        self.map.image().desc.extent.height
    }

    /// The graph of an effect with some knobs set, its result as the output `result`.
    ///
    /// # Errors
    /// If the effect refuses a value.
    pub fn graph(
        &self,
        effect: &MapEntry,
        values: &[(&str, KnobValue)],
    ) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let base = graph.import_texture(BASE, self.map.image().desc)?;
        let result = effect.build_with(&mut graph, base, values)?;
        graph.output("result", result)?;
        Ok(graph)
    }

    /// What the graph is given.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        Inputs::new().texture(BASE, self.map.image())
    }
}

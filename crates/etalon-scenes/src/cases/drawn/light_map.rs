//! Light from all directions, as a case gives it.

use etalon_core::Format;
use etalon_core::backend::Inputs;
use etalon_core::graph::{Graph, Texture};
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_effects::EffectError;
use etalon_effects::environment::{
    Environment, EnvironmentMap, Irradiance, Prefilter, environment, mirroring,
};
use glam::DVec3;

use super::{CaseError, Stage};
use crate::frame::FrameSize;

/// The name of the map among the graph's imports.
const BASE: &str = "base";

/// A map with its mips, and how it is blurred.
#[derive(Clone, Debug)]
pub struct LightMap {
    /// Of the image, mips included.
    pub size: FrameSize,
    /// As [`EnvironmentMap::image`] has it.
    pub base: ImageData,
    /// What surfaces scatter of it.
    pub irradiance: Irradiance,
    /// Directions for each texel.
    pub samples: u32,
    /// The light from every direction, where it is the same from all: then so is the
    /// result.
    pub uniform: Option<DVec3>,
    /// Whether the table of what is mirrored is made as well.
    pub with_table: bool,
}

impl LightMap {
    fn new(base: ImageData, irradiance: Irradiance) -> Result<Self, CaseError> {
        let extent = base.desc.extent;
        Ok(Self {
            size: FrameSize::new(extent.width, extent.height)?,
            base,
            irradiance,
            samples: 16,
            uniform: None,
            with_table: false,
        })
    }

    /// Of an equirectangular picture, each texel of which is a function of its column
    /// and row, resampled to `side × side` texels.
    pub(super) fn painted(
        [width, height]: [u32; 2],
        side: u32,
        paint: impl Fn(u32, u32) -> [f32; 3],
    ) -> Result<Self, CaseError> {
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let texels: Vec<[f32; 4]> = texels
            .map(|(x, y)| {
                let [r, g, b] = paint(x, y);
                [r, g, b, 1.0]
            })
            .collect();
        let desc = TextureDesc::d2(width, height, Format::Rgba32Float);
        let picture = ImageData::from_rgba_f32(desc, &texels)?;
        let map = EnvironmentMap::of_equirectangular(&picture, side)?;
        Self::new(map.image().clone(), *map.irradiance())
    }

    /// Of an image with its mips that nobody has looked at: each texel by its number.
    pub(super) fn raw(
        side: u32,
        format: Format,
        paint: impl Fn(u32) -> [f32; 4],
    ) -> Result<Self, CaseError> {
        let desc = TextureDesc::d2(side + side / 2, side, format);
        let texels: Vec<[f32; 4]> = (0..side * (side + side / 2)).map(paint).collect();
        Self::new(
            ImageData::from_rgba_f32(desc, &texels)?,
            Irradiance::default(),
        )
    }

    /// The same light from everywhere.
    pub(super) fn uniform(light: [f32; 3]) -> Result<Self, CaseError> {
        Ok(Self {
            uniform: Some(DVec3::from(light.map(f64::from))),
            ..Self::painted([8, 4], 32, |_, _| light)?
        })
    }

    /// With so many directions for each texel.
    pub(super) fn sampled(self, samples: u32) -> Self {
        Self { samples, ..self }
    }

    /// With the table of what is mirrored.
    pub(super) fn with_table(self) -> Self {
        Self {
            with_table: true,
            ..self
        }
    }

    /// As a stage.
    pub(super) fn staged(self) -> Result<Stage, CaseError> {
        Ok(Stage::LightMap(Box::new(self)))
    }

    /// Declares the passes that make an environment of it.
    pub(super) fn import(&self, graph: &mut Graph) -> Result<Environment, EffectError> {
        let base: Texture = graph.import_texture(BASE, self.base.desc)?;
        environment(graph, base, &self.irradiance, &self.prefilter())
    }

    /// How it is blurred.
    pub(super) const fn prefilter(&self) -> Prefilter {
        Prefilter {
            samples: self.samples,
        }
    }

    pub(super) fn inputs(&self) -> Inputs<'_> {
        self.give(Inputs::new())
    }

    /// Adds the map to what a graph is given.
    pub(super) fn give<'a>(&'a self, inputs: Inputs<'a>) -> Inputs<'a> {
        inputs.texture(BASE, &self.base)
    }

    pub(super) fn environment(&self) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let made = self.import(&mut graph)?;
        graph.output("radiance", made.radiance)?;
        if self.with_table {
            let table = mirroring(&mut graph)?;
            graph.output("mirroring", table)?;
        }
        Ok(graph)
    }
}

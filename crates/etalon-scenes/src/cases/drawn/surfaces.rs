//! A G-buffer and its lights, as a case gives them.

use std::sync::Arc;

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::geometry::{GBuffer, View};
use etalon_effects::lighting::{PunctualLight, Surroundings, lighting};
use glam::{DMat4, DVec3, Vec3};

use super::super::Step;
use super::super::paint::{Canvas, Spot, Texel};
use super::{CaseError, LightMap, MIRRORING, Stage, with_mirroring};

/// Images of surfaces, and what lights them.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// The G-buffer: `colour` is what is scattered.
    pub step: Step,
    /// What surfaces give by themselves.
    pub emission: ImageData,
    /// Who looks.
    pub view: View,
    /// Lights without extent.
    pub lights: Vec<PunctualLight>,
    /// Light from above and below, and what is behind everything.
    pub surroundings: Surroundings,
    /// Light from everywhere.
    pub environment: Option<LightMap>,
    /// See [`Stage::give_mirroring`].
    pub(super) mirroring: Option<Arc<ImageData>>,
}

impl Surfaces {
    /// On a canvas, each texel a function of its place, without light.
    pub(super) fn painted(
        canvas: Canvas,
        paint: impl Fn(&Spot) -> Texel,
    ) -> Result<Self, CaseError> {
        let step = canvas.step(paint)?;
        let camera = step.camera;
        let mut emission = step.frame.colour.clone();
        emission.bytes.fill(0);
        Ok(Self {
            step,
            emission,
            view: View {
                camera,
                view: DMat4::IDENTITY,
                previous: DMat4::IDENTITY,
            },
            lights: Vec::new(),
            surroundings: Surroundings::default(),
            environment: None,
            mirroring: None,
        })
    }

    /// Lit by these.
    pub(super) fn lit(self, lights: &[PunctualLight]) -> Self {
        Self {
            lights: lights.to_vec(),
            ..self
        }
    }

    /// The surfaces give what they scatter.
    pub(super) fn glowing(mut self) -> Self {
        self.emission = self.step.frame.colour.clone();
        self
    }

    /// With light from above and below.
    pub(super) fn under(mut self, above: f32, below: f32) -> Self {
        self.surroundings.above = Vec3::splat(above);
        self.surroundings.below = Vec3::splat(below);
        self.surroundings.background = Vec3::new(0.25, 0.5, 1.0);
        self
    }

    /// With light from everywhere.
    pub(super) fn within(self, map: LightMap) -> Self {
        Self {
            environment: Some(map),
            ..self
        }
    }

    /// The same with everything, the eye and the lights, moved in the world.
    pub(super) fn moved(mut self, by: DVec3) -> Self {
        self.view.view = DMat4::from_translation(-by);
        self.view.previous = self.view.view;
        for light in &mut self.lights {
            light.position += by;
        }
        self
    }

    /// As a stage.
    pub(super) fn staged(self) -> Result<Stage, CaseError> {
        Ok(Stage::Surfaces(Box::new(self)))
    }

    fn images(&self) -> [(&'static str, &ImageData); 5] {
        let frame = &self.step.frame;
        [
            ("colour", &frame.colour),
            ("normal", &frame.normal),
            ("specular", &frame.specular),
            ("emission", &self.emission),
            ("depth", &frame.depth),
        ]
    }

    pub(super) fn inputs(&self) -> Inputs<'_> {
        let images = self.images().into_iter();
        let inputs = images.fold(Inputs::new(), |inputs, (name, image)| {
            inputs.texture(name, image)
        });
        let inputs = match &self.mirroring {
            Some(table) => inputs.texture(MIRRORING, table),
            None => inputs,
        };
        match &self.environment {
            Some(map) => map.give(inputs),
            None => inputs,
        }
    }

    pub(super) fn lighting(&self) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let mut textures = Vec::new();
        for (name, image) in self.images() {
            textures.push(graph.import_texture(name, image.desc)?);
        }
        let surfaces = GBuffer {
            colour: textures[0],
            normal: textures[1],
            specular: textures[2],
            emission: textures[3],
            depth: textures[4],
        };
        let mut surroundings = self.surroundings;
        if let Some(map) = &self.environment {
            surroundings.environment = Some(map.import(&mut graph)?);
        }
        let surroundings = with_mirroring(&mut graph, surroundings, self.mirroring.as_ref())?;
        let light = lighting(
            &mut graph,
            &self.view,
            &surfaces,
            &self.lights,
            &surroundings,
        )?;
        graph.output("light", light)?;
        Ok(graph)
    }
}

//! A G-buffer and its lights, as a case gives them.

use std::sync::Arc;

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::geometry::{GBuffer, View};
use etalon_effects::lighting::{PunctualLight, Surroundings, lighting};
use etalon_effects::probes::{Probe, ProbeMaps, Probes, probe_bytes, probe_map};
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
    /// Light captured nearby, if there is any.
    pub rooms: Option<Rooms>,
}

/// Probes of one map.
#[derive(Clone, Debug)]
pub struct Rooms {
    /// Where they count.
    pub probes: Vec<Probe>,
    /// What all of them have captured.
    pub map: LightMap,
    list: Vec<u8>,
}

/// The names of the probes' list and map among the graph's imports.
const LIST: &str = "probes";
const CAPTURED: &str = "captured";

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
            rooms: None,
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

    /// With probes around, of the map of one of them.
    pub(super) fn around(self, probes: &[Probe], map: LightMap) -> Self {
        Self {
            rooms: Some(Rooms {
                probes: probes.to_vec(),
                map,
                list: Vec::new(),
            }),
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
        for probe in self.rooms.iter_mut().flat_map(|rooms| &mut rooms.probes) {
            probe.position += by;
            probe.room.centre += by;
        }
        self
    }

    /// As a stage.
    pub(super) fn staged(mut self) -> Result<Stage, CaseError> {
        if let Some(rooms) = &mut self.rooms {
            rooms.list = probe_bytes(&self.view, &rooms.probes).map_err(EffectError::from)?;
        }
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
        let inputs = match &self.rooms {
            Some(rooms) => inputs
                .buffer(LIST, &rooms.list)
                .texture(CAPTURED, &rooms.map.base),
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
        if let Some(rooms) = &self.rooms {
            surroundings.probes = rooms.import(&mut graph)?;
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

impl Rooms {
    /// Declares the passes that make a probe's map.
    fn import(&self, graph: &mut Graph) -> Result<Option<Probes>, EffectError> {
        let base = graph.import_texture(CAPTURED, self.map.base.desc)?;
        let maps = ProbeMaps::new(graph, self.map.base.desc.extent.height, 1)?;
        let maps = probe_map(graph, maps, 0, base, &self.map.prefilter())?;
        Probes::import(graph, LIST, maps, self.probes.len() as u32)
    }
}

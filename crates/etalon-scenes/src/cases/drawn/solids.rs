//! Triangles before a camera, as a case gives them.
//!
//! Unlike those of a [`Mesh`](crate::model::Mesh), which checks them, corners and normals
//! may be anything that an engine's buffers may hold.

use std::sync::Arc;

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::raster::{StepMode, VertexAttribute, VertexFormat, VertexLayout};
use etalon_core::resource::BufferDesc;
use etalon_effects::forward::{Lamps, Lighting, forward, glass, lamp_bytes};
use etalon_effects::geometry::{DrawClass, Geometry, Item, Surface, View, gbuffer, prepass};
use etalon_effects::lighting::{PunctualLight, Surroundings};
use etalon_effects::{CameraParams, EffectError};
use glam::{DMat4, DVec3, Vec3};

use super::super::paint::SMALL;
use super::{CaseError, LightMap, MIRRORING, Stage, with_mirroring};
use crate::frame::FrameSize;

/// Three corners.
pub(super) type Triangle = [[f32; 3]; 3];

/// Triangles of one surface.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Corners in the solid's own space.
    pub triangles: Vec<Triangle>,
    /// A normal for all corners, in that space; anything.
    pub normal: [f32; 3],
    /// From there to the world.
    pub world: DMat4,
    /// The same one frame earlier.
    pub previous: DMat4,
    /// When it is drawn.
    pub class: DrawClass,
    /// What it is made of.
    pub surface: Surface,
    /// Whether it is glass, drawn over what is opaque.
    pub glass: bool,
    bytes: Vec<u8>,
}

/// Bytes of a corner: its place and its normal.
const STRIDE: u64 = 24;

impl Solid {
    /// Seen from both sides, standing still, half rough.
    pub(super) fn new(triangles: &[Triangle]) -> Self {
        let solid = Self {
            triangles: triangles.to_vec(),
            normal: [0.0, 0.0, 1.0],
            world: DMat4::IDENTITY,
            previous: DMat4::IDENTITY,
            class: DrawClass::Static,
            surface: Surface {
                base: glam::Vec4::new(0.8, 0.4, 0.2, 1.0),
                two_sided: true,
                ..Surface::default()
            },
            glass: false,
            bytes: Vec::new(),
        };
        solid.written()
    }

    /// A square of a half side at a distance, facing the eye.
    pub(super) fn wall(distance: f32, half: f32) -> Self {
        let at = |x: f32, y: f32| [x * half, y * half, -distance];
        let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
        Self::new(&[[a, b, c], [a, c, d]])
    }

    /// With a normal of any kind.
    pub(super) fn normal(self, normal: [f32; 3]) -> Self {
        Self { normal, ..self }.written()
    }

    /// Placed, now as before.
    pub(super) fn placed(self, world: DMat4) -> Self {
        Self {
            world,
            previous: world,
            ..self
        }
    }

    /// Moving from another place.
    pub(super) fn moving_from(self, previous: DMat4) -> Self {
        Self {
            previous,
            class: DrawClass::Dynamic,
            ..self
        }
    }

    /// Made of something else.
    pub(super) fn made_of(mut self, change: impl FnOnce(&mut Surface)) -> Self {
        change(&mut self.surface);
        self
    }

    /// Drawn as glass of an opacity.
    pub(super) fn glass(self, opacity: f32) -> Self {
        let solid = self.made_of(|surface| surface.base.w = opacity);
        Self {
            glass: true,
            ..solid
        }
    }

    fn written(mut self) -> Self {
        let corners = self.triangles.iter().flatten();
        let numbers = corners.flat_map(|place| place.iter().chain(&self.normal));
        self.bytes = numbers.copied().flat_map(f32::to_le_bytes).collect();
        self
    }

    fn layout() -> VertexLayout {
        let attribute = |name: &'static str, offset| VertexAttribute {
            name: name.into(),
            format: VertexFormat::Float32x3,
            offset,
        };
        VertexLayout {
            stride: STRIDE as u32,
            step: StepMode::Vertex,
            attributes: vec![attribute("position", 0), attribute("normal", 12)],
        }
    }
}

/// Solids, lights and who looks at them.
#[derive(Clone, Debug)]
pub struct Solids {
    /// In the order given.
    pub solids: Vec<Solid>,
    /// Pixels of the picture.
    pub size: FrameSize,
    /// Who looks.
    pub view: View,
    /// Lights without extent, of forward shading.
    pub lights: Vec<PunctualLight>,
    /// Light from above and below, and what is behind everything.
    pub surroundings: Surroundings,
    /// Light from everywhere.
    pub environment: Option<LightMap>,
    lamps: Vec<u8>,
    /// See [`Stage::give_mirroring`].
    pub(super) mirroring: Option<Arc<ImageData>>,
}

impl Solids {
    /// Before an eye at the origin that sees 60° and nothing nearer than 0.1.
    pub(super) fn new(solids: Vec<Solid>) -> Result<Self, CaseError> {
        Self::sized(SMALL, solids)
    }

    /// The same in a picture of a size.
    pub(super) fn sized(
        (width, height): (u32, u32),
        solids: Vec<Solid>,
    ) -> Result<Self, CaseError> {
        let aspect = width as f32 / height as f32;
        Ok(Self {
            solids,
            size: FrameSize::new(width, height)?,
            view: View {
                camera: CameraParams::perspective(60_f32.to_radians(), aspect, 0.1),
                view: DMat4::IDENTITY,
                previous: DMat4::IDENTITY,
            },
            lights: Vec::new(),
            surroundings: Surroundings {
                background: Vec3::new(0.25, 0.5, 1.0),
                ..Surroundings::default()
            },
            environment: None,
            mirroring: None,
            lamps: Vec::new(),
        })
    }

    /// With the eye or its projection changed.
    pub(super) fn seen(mut self, change: impl FnOnce(&mut View)) -> Self {
        change(&mut self.view);
        self
    }

    /// The same with everything moved in the world.
    pub(super) fn moved(mut self, by: DVec3) -> Self {
        let there = DMat4::from_translation(by);
        for solid in &mut self.solids {
            solid.world = there * solid.world;
            solid.previous = there * solid.previous;
        }
        for light in &mut self.lights {
            light.position += by;
        }
        self.view.view *= DMat4::from_translation(-by);
        self.view.previous *= DMat4::from_translation(-by);
        self
    }

    /// Lit by these.
    pub(super) fn lit(self, lights: &[PunctualLight]) -> Self {
        Self {
            lights: lights.to_vec(),
            ..self
        }
    }

    /// With light from above and below.
    pub(super) fn under(mut self, above: f32, below: f32) -> Self {
        self.surroundings.above = Vec3::splat(above);
        self.surroundings.below = Vec3::splat(below);
        self
    }

    /// With light from everywhere.
    pub(super) fn within(self, map: LightMap) -> Self {
        Self {
            environment: Some(map),
            ..self
        }
    }

    /// As a stage.
    pub(super) fn staged(mut self) -> Result<Stage, CaseError> {
        self.lamps = lamp_bytes(&self.view, &self.lights).map_err(EffectError::from)?;
        Ok(Stage::Solids(Box::new(self)))
    }

    pub(super) fn inputs(&self) -> Inputs<'_> {
        let solids = self.solids.iter().enumerate();
        let mut inputs = solids.fold(Inputs::new(), |inputs, (number, solid)| {
            inputs.buffer(format!("corners {number}"), &solid.bytes)
        });
        if let Some(map) = &self.environment {
            inputs = map.give(inputs);
        }
        if let Some(table) = &self.mirroring {
            inputs = inputs.texture(MIRRORING, table);
        }
        // Nobody asks for it where there are no lights, and then it is empty.
        match self.lamps.is_empty() {
            true => inputs,
            false => inputs.buffer("lamps", &self.lamps),
        }
    }

    /// The solids as items, opaque ones and glass.
    fn items(&self, graph: &mut Graph, glass: bool) -> Result<Vec<Item>, EffectError> {
        let mut items = Vec::new();
        for (number, solid) in self.solids.iter().enumerate() {
            if solid.glass != glass {
                continue;
            }
            let desc = BufferDesc {
                bytes: solid.bytes.len() as u64,
            };
            let buffer = graph.import_buffer(&format!("corners {number}"), desc)?;
            items.push(Item {
                vertices: vec![(buffer, 0, Solid::layout())],
                indices: None,
                elements: 0..3 * solid.triangles.len() as u32,
                world: solid.world,
                previous: solid.previous,
                class: solid.class,
                surface: solid.surface,
            });
        }
        Ok(items)
    }

    fn geometry_of<'i>(&self, items: &'i [Item]) -> Geometry<'i> {
        Geometry {
            items,
            view: self.view,
            size: [self.size.width(), self.size.height()],
        }
    }

    pub(super) fn geometry(&self) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let items = self.items(&mut graph, false)?;
        let geometry = self.geometry_of(&items);
        let pre = prepass(&mut graph, &geometry, true)?;
        let surfaces = gbuffer(&mut graph, &geometry, Some(&pre))?;
        graph.output("depth", pre.depth)?;
        if let Some(velocity) = pre.velocity {
            graph.output("velocity", velocity)?;
        }
        graph.output("colour", surfaces.colour)?;
        graph.output("normal", surfaces.normal)?;
        graph.output("specular", surfaces.specular)?;
        graph.output("emission", surfaces.emission)?;
        Ok(graph)
    }

    pub(super) fn forward(&self) -> Result<Graph, EffectError> {
        let mut graph = Graph::new();
        let opaque = self.items(&mut graph, false)?;
        let panes = self.items(&mut graph, true)?;
        let mut surroundings = self.surroundings;
        if let Some(map) = &self.environment {
            surroundings.environment = Some(map.import(&mut graph)?);
        }
        let surroundings = with_mirroring(&mut graph, surroundings, self.mirroring.as_ref())?;
        let lighting = Lighting {
            lamps: Lamps::import(&mut graph, "lamps", self.lights.len() as u32)?,
            surroundings,
        };
        let shaded = forward(
            &mut graph,
            &self.geometry_of(&opaque),
            None,
            &lighting,
            true,
        )?;
        let mut light = shaded.light;
        if !panes.is_empty() {
            let panes = self.geometry_of(&panes);
            light = glass(&mut graph, &panes, light, shaded.depth, &lighting)?;
        }
        graph.output("light", light)?;
        graph.output("depth", shaded.depth)?;
        if let Some(thin) = shaded.thin {
            graph.output("normal", thin.normal)?;
            graph.output("specular", thin.specular)?;
        }
        Ok(graph)
    }
}

//! Models as they are drawn both ways, and as the reflection model sees them.

use etalon::backend::{Backend, Execution};
use etalon::effects::environment::{
    EnvironmentMap, Prefilter, Surroundings, environment, mirroring,
};
use etalon::effects::forward::{Lamps, Lighting, forward, glass, lamp_bytes};
use etalon::effects::geometry::{Geometry, View, gbuffer, prepass};
use etalon::effects::lighting::{LightKind, PunctualLight, lighting};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::model::{AlphaMode, Drawable, Model, Snapshot, lights, view};
use etalon_scenes::trace::{TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, FrameSize, models};
use etalon_tests::plan_for;
use glam::{DMat3, DVec3, DVec4, Vec3};

use crate::shading::{Around, Parts, Point, picture};

/// A model at a time, seen by its first camera.
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) snapshot: Snapshot,
    pub(crate) camera: Camera,
    pub(crate) size: FrameSize,
    pub(crate) lamps: Vec<PunctualLight>,
    pub(crate) sky: Option<Sky>,
}

/// How a scene is drawn.
pub(crate) struct With<'a> {
    pub(crate) lamps: &'a [PunctualLight],
    /// Of the lamps, for forward shading.
    pub(crate) bytes: &'a [u8],
    pub(crate) arithmetic: Arithmetic,
    pub(crate) kernels: &'a KernelLibrary,
}

/// Light from everywhere, `middle + slope · direction` in all, part of it by
/// `above` and `below` and part by a map.
pub(crate) struct Sky {
    pub(crate) above: Vec3,
    pub(crate) below: Vec3,
    pub(crate) map: EnvironmentMap,
    pub(crate) middle: DVec3,
    pub(crate) slope: DMat3,
}

impl Sky {
    pub(crate) fn new() -> Self {
        let (above, below) = (Vec3::new(0.6, 0.5, 0.4), Vec3::new(0.1, 0.15, 0.2));
        let (middle, across) = (DVec3::new(0.3, 0.3, 0.5), DVec3::new(0.25, 0.1, 0.0));
        let along = DVec3::new(0.0, 0.1, 0.3);
        let map = picture(256, &|at| middle + across * at.x + along * at.z);
        let up = 0.5 * (above - below).as_dvec3();
        Self {
            above,
            below,
            map: EnvironmentMap::of_equirectangular(&map, 256).unwrap(),
            middle: middle + 0.5 * (above + below).as_dvec3(),
            slope: DMat3::from_cols(across, up, along),
        }
    }
}

impl Scene {
    pub(crate) fn of(name: &str, model: Model, size: FrameSize) -> Self {
        let snapshot = model.at(0.5).unwrap();
        let camera = snapshot.cameras[0];
        let mut lamps = lights(&model, &snapshot, 100.0);
        let lamp = |kind, reach| PunctualLight {
            kind,
            position: camera.pose().position() + DVec3::new(0.8, 0.9, -0.4),
            direction: DVec3::new(-0.3, -0.6, -1.0),
            power: Vec3::new(2.0, 1.5, 1.0),
            reach,
        };
        lamps.push(lamp(LightKind::Directional, None));
        lamps.push(lamp(LightKind::Point, Some(30.0)));
        Self {
            name: name.to_owned(),
            model,
            snapshot,
            camera,
            size,
            lamps,
            sky: Some(Sky::new()),
        }
    }

    pub(crate) fn view(&self) -> View {
        view(&self.camera, self.size).unwrap()
    }

    pub(crate) fn is_opaque(&self, material: usize) -> bool {
        let material = &self.model.parts().materials[material];
        material.alpha != AlphaMode::Blend && material.transmission == 0.0
    }

    pub(crate) fn truth(&self) -> Truth {
        let (model, snapshot) = (&self.model, &self.snapshot);
        let traced = TriangleScene::of(model, snapshot, |at| self.is_opaque(at.material)).unwrap();
        let options = TruthOptions::default();
        traced.truth(&self.camera, self.size, &options).unwrap()
    }

    /// Draws it both ways; `lamps` are lit.
    pub(crate) fn draw(&self, executor: &mut dyn Backend, lamps: &[PunctualLight]) -> Execution {
        let bytes = lamp_bytes(&self.view(), lamps).unwrap();
        let with = With {
            lamps,
            bytes: &bytes,
            arithmetic: Arithmetic::Strict,
            kernels: &etalon::effects::kernels(),
        };
        self.draw_with(executor, &with)
    }

    pub(crate) fn draw_with(&self, executor: &mut dyn Backend, with: &With<'_>) -> Execution {
        let With { lamps, bytes, .. } = *with;
        let drawable = Drawable::new(&self.model).unwrap();
        let mut graph = Graph::new();
        let imported = drawable.import(&mut graph).unwrap();
        let items = imported.opaque_items(&self.model, &self.snapshot);
        let eye = self.camera.pose().position();
        let panes = imported.blended_items(&self.model, &self.snapshot, eye);
        let geometry = Geometry {
            items: &items,
            view: self.view(),
            size: [self.size.width(), self.size.height()],
        };
        let mut inputs = drawable.inputs();
        let mut surroundings = Surroundings {
            background: Vec3::new(0.25, 0.5, 1.0),
            ..Surroundings::default()
        };
        if let Some(sky) = &self.sky {
            let base = graph.import_texture("sky", sky.map.image().desc).unwrap();
            let settings = Prefilter::default();
            let around = environment(&mut graph, base, sky.map.irradiance(), &settings);
            surroundings.environment = Some(around.unwrap());
            surroundings.mirroring = Some(mirroring(&mut graph).unwrap());
            (surroundings.above, surroundings.below) = (sky.above, sky.below);
            inputs = inputs.texture("sky", sky.map.image());
        }
        let lit = Lighting {
            lamps: Lamps::import(&mut graph, "lamps", lamps.len() as u32).unwrap(),
            surroundings,
        };
        if lit.lamps.is_some() {
            inputs = inputs.buffer("lamps", bytes);
        }
        let pre = prepass(&mut graph, &geometry, false).unwrap();
        let g = gbuffer(&mut graph, &geometry, Some(&pre)).unwrap();
        let map = lighting(&mut graph, &geometry.view, &g, lamps, &surroundings).unwrap();
        let shaded = forward(&mut graph, &geometry, Some(&pre), &lit, true).unwrap();
        let without = forward(&mut graph, &geometry, None, &lit, false).unwrap();
        let panes = Geometry {
            items: &panes,
            ..geometry
        };
        let (light, depth) = (without.light, without.depth);
        let whole = glass(&mut graph, &panes, light, depth, &lit).unwrap();
        let thin = shaded.thin.unwrap();
        for (name, texture) in [
            ("light map", map),
            ("light", shaded.light),
            ("glass", whole),
            ("normal", g.normal),
            ("specular", g.specular),
            ("colour", g.colour),
            ("emission", g.emission),
            ("thin normal", thin.normal),
            ("thin specular", thin.specular),
            ("depth", g.depth),
        ] {
            graph.output(name, texture).unwrap();
        }
        let capture = Capture::Outputs;
        let plan = plan_for(executor, &graph, with.kernels, with.arithmetic, capture).unwrap();
        executor.execute(&plan, &inputs).unwrap()
    }

    pub(crate) fn around(&self) -> Option<Around> {
        let sky = self.sky.as_ref()?;
        Some(Around {
            to_world: DMat3::from_mat4(self.camera.pose().view_matrix()).transpose(),
            middle: sky.middle,
            slope: sky.slope,
        })
    }

    /// What a point sends to the eye.
    pub(crate) fn model_of(&self, point: &Point) -> Parts {
        let view = self.view();
        let lamps = self.lamps.iter().map(|lamp| point.lit(lamp, &view));
        let lit = lamps.fold(Parts::default(), Parts::plus);
        match self.around() {
            Some(around) => lit.plus(point.surrounded(&around)),
            None => lit,
        }
    }
}

pub(crate) fn scenes(size: FrameSize) -> Vec<Scene> {
    let scene =
        |entry: &etalon_scenes::ModelEntry| Scene::of(entry.name, (entry.build)().unwrap(), size);
    models().iter().map(scene).collect()
}

pub(crate) fn texel(execution: &Execution, name: &str, x: u32, y: u32) -> DVec4 {
    let image = execution.output(name).unwrap();
    DVec4::from(image.texel(x, y, 0, 0).unwrap().to_f64())
}

pub(crate) fn pixels(size: FrameSize) -> impl Iterator<Item = (u32, u32)> {
    (0..size.height()).flat_map(move |y| (0..size.width()).map(move |x| (x, y)))
}

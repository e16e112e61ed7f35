//! A corridor among three probes and a world, each with light that is known by direction.

use etalon::Format;
use etalon::backend::{Backend, Execution, Inputs};
use etalon::effects::EffectError;
use etalon::effects::environment::{EnvironmentMap, Mirrored, Prefilter, environment};
use etalon::effects::geometry::View;
use etalon::effects::lighting::Surroundings;
use etalon::effects::probes::{Probe, ProbeMaps, Probes, Room, probe_bytes, probe_map, truth};
use etalon::graph::{Graph, Texture};
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::{Frame, FrameSize, scene};
use etalon_tests::plan_for;
use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, Vec3};

use crate::shading::picture;

/// Texels of a map's height.
const SIDE: u32 = 64;

/// Light that is linear in the direction: `middle + slope · direction`.
#[derive(Clone, Copy)]
pub(super) struct Light {
    pub(super) middle: DVec3,
    pub(super) slope: DMat3,
}

impl Light {
    pub(super) const fn uniform(middle: DVec3) -> Self {
        Self {
            middle,
            slope: DMat3::ZERO,
        }
    }

    pub(super) fn at(&self, way: DVec3) -> DVec3 {
        self.middle + self.slope * way
    }

    fn map(&self) -> EnvironmentMap {
        let picture = picture(3 * SIDE, &|at| self.at(at));
        EnvironmentMap::of_equirectangular(&picture, SIDE).unwrap()
    }
}

pub(super) struct Bench {
    pub(super) frame: Frame,
    pub(super) view: View,
    pub(super) probes: Vec<Probe>,
    pub(super) lights: Vec<Light>,
    pub(super) world: Light,
    list: Vec<u8>,
    maps: Vec<EnvironmentMap>,
    sky: EnvironmentMap,
}

/// How a graph is run.
pub(super) struct With<'a> {
    pub(super) kernels: &'a KernelLibrary,
    pub(super) arithmetic: Arithmetic,
}

impl Bench {
    /// Lights of all colours, brighter to several sides.
    pub(super) fn coloured(mask: impl Fn(u32, u32) -> [f32; 4]) -> Self {
        let light = |k: f64| Light {
            middle: DVec3::new(0.8 + 0.3 * k, 1.0 - 0.2 * k, 0.75),
            slope: DMat3::from_cols(
                DVec3::new(0.2, 0.0, 0.1 * k),
                DVec3::new(0.0, -0.2, 0.1),
                DVec3::new(-0.1 * k, 0.1, 0.2),
            ),
        };
        Self::new(mask, [light(0.0), light(1.0), light(2.0)], light(-1.0))
    }

    pub(super) fn new(
        mask: impl Fn(u32, u32) -> [f32; 4],
        lights: [Light; 3],
        world: Light,
    ) -> Self {
        let size = FrameSize::new(67, 38).unwrap();
        let mut frame = scene("corridor-grazing").unwrap().frame(size).unwrap();
        let texels: Vec<[f32; 4]> = (0..size.height())
            .flat_map(|y| (0..size.width()).map(move |x| (x, y)))
            .map(|(x, y)| mask(x, y))
            .collect();
        let desc = TextureDesc::d2(size.width(), size.height(), Format::Rgba8Unorm);
        frame.specular = ImageData::from_rgba_f32(desc, &texels).unwrap();
        let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.2);
        let to_world = DMat4::from_rotation_translation(turn, DVec3::new(30.0, -4.0, 12.0));
        let view = View {
            camera: frame.camera_params(),
            view: to_world.inverse(),
            previous: to_world.inverse(),
        };
        let probe = |layer: u32, [z, half, falloff]: [f64; 3]| {
            let turn = turn * DQuat::from_rotation_z(0.1) * DQuat::from_rotation_y(0.3 * z);
            let room = Room {
                centre: to_world.transform_point3(DVec3::new(0.2, 0.5, z)),
                turn,
                half: DVec3::new(half, 0.8 * half, 1.2 * half),
            };
            Probe {
                position: room.centre + turn * (room.half * DVec3::new(0.3, -0.4, 0.2)),
                room,
                influence: room.half * 0.9,
                falloff: falloff as f32,
                layer,
            }
        };
        // The layers are not in the order of the list.
        let probes = vec![
            probe(2, [-3.0, 1.5, 1.0]),
            probe(0, [-6.0, 4.0, 2.0]),
            probe(1, [-14.0, 9.0, 3.0]),
        ];
        Self {
            list: probe_bytes(&view, &probes).unwrap(),
            maps: lights.iter().map(Light::map).collect(),
            sky: world.map(),
            frame,
            view,
            probes,
            lights: lights.to_vec(),
            world,
        }
    }

    /// The same lights in other rooms, for another eye.
    pub(super) fn watch(&mut self, view: View, probes: Vec<Probe>) {
        self.list = probe_bytes(&view, &probes).unwrap();
        (self.view, self.probes) = (view, probes);
    }

    /// The maps and the list, beside what a graph is given already.
    pub(super) fn give<'a>(&'a self, inputs: Inputs<'a>) -> Inputs<'a> {
        let inputs = inputs.buffer("probes", &self.list);
        let maps = self.maps.iter().enumerate();
        let inputs = maps.fold(inputs, |inputs, (layer, map)| {
            inputs.texture(format!("map {layer}"), map.image())
        });
        inputs.texture("sky", self.sky.image())
    }

    /// All that shines.
    pub(super) fn surroundings(&self, graph: &mut Graph) -> Result<Surroundings, EffectError> {
        let settings = Prefilter { samples: 16 };
        let mut maps = ProbeMaps::new(graph, SIDE, self.maps.len() as u32)?;
        for (layer, map) in (0..).zip(&self.maps) {
            let base = graph.import_texture(&format!("map {layer}"), map.image().desc)?;
            maps = probe_map(graph, maps, layer, base, &settings)?;
        }
        let sky = graph.import_texture("sky", self.sky.image().desc)?;
        let sky = environment(graph, sky, self.sky.irradiance(), &settings)?;
        Ok(Surroundings {
            environment: Some(sky),
            probes: Probes::import(graph, "probes", maps, self.probes.len() as u32)?,
            mirrored: Mirrored::Reflected,
            ..Surroundings::default()
        })
    }

    /// What a graph with these inputs makes.
    pub(super) fn run(
        &self,
        executor: &mut dyn Backend,
        with: &With<'_>,
        declare: impl FnOnce(&mut Graph, Surroundings) -> Result<Texture, EffectError>,
    ) -> ImageData {
        self.execute(executor, with, declare)
            .output("result")
            .unwrap()
            .clone()
    }

    pub(super) fn execute(
        &self,
        executor: &mut dyn Backend,
        with: &With<'_>,
        declare: impl FnOnce(&mut Graph, Surroundings) -> Result<Texture, EffectError>,
    ) -> Execution {
        let mut graph = Graph::new();
        let surroundings = self.surroundings(&mut graph).unwrap();
        let result = declare(&mut graph, surroundings).unwrap();
        graph.output("result", result).unwrap();
        let With {
            kernels,
            arithmetic,
        } = *with;
        let plan = plan_for(executor, &graph, kernels, arithmetic, Capture::Outputs).unwrap();
        executor
            .execute(&plan, &self.give(self.frame.inputs()))
            .unwrap()
    }

    pub(super) fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let size = self.frame.size();
        (0..size.height()).flat_map(move |y| (0..size.width()).map(move |x| (x, y)))
    }

    /// Where a pixel's surface is, in the world, and the way of what it mirrors; nothing
    /// for the sky.
    pub(super) fn mirrored(&self, x: u32, y: u32) -> Option<(DVec3, DVec3)> {
        let texel = |image: &ImageData| image.texel(x, y, 0, 0).unwrap().to_f64();
        let depth = texel(&self.frame.depth)[0];
        let [nx, ny, nz, _] = texel(&self.frame.normal);
        let normal = DVec3::new(nx, ny, nz);
        if depth <= 0.0 || normal == DVec3::ZERO {
            return None;
        }
        let camera = &self.view.camera;
        let size = self.frame.size();
        let uv = DVec2::new(
            (f64::from(x) + 0.5) / f64::from(size.width()),
            (f64::from(y) + 0.5) / f64::from(size.height()),
        );
        let ndc = DVec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y);
        let point = (ndc / camera.scale.as_dvec2()).extend(-1.0) * (f64::from(camera.near) / depth);
        let way = point.normalize().reflect(normal.normalize());
        let to_world = self.view.view.inverse();
        Some((
            to_world.transform_point3(point),
            to_world.transform_vector3(way),
        ))
    }

    /// The light that a pixel's surface mirrors, by definition.
    pub(super) fn light(&self, point: DVec3, way: DVec3) -> DVec3 {
        let map =
            |number: usize, way: DVec3| self.lights[self.probes[number].layer as usize].at(way);
        truth::light(&self.probes, point, way, map, |way| self.world.at(way))
    }
}

/// A texel's colour.
pub(super) fn colour(image: &ImageData, x: u32, y: u32) -> DVec3 {
    let [r, g, b, _] = image.texel(x, y, 0, 0).unwrap().to_f64();
    DVec3::new(r, g, b)
}

/// The kernels with a part of one changed.
pub(super) fn planted(path: &str, part: &str, by: &str) -> KernelLibrary {
    let mut kernels = etalon::effects::kernels();
    let source = kernels.source(path).unwrap().to_string();
    let changed = source.replace(part, by);
    assert_ne!(source, changed, "{path}");
    kernels.add_source(path, &changed);
    kernels
}

/// The same light from everywhere.
pub(super) fn uniform(light: Vec3) -> [Light; 3] {
    [Light::uniform(light.as_dvec3()); 3]
}

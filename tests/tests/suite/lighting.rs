//! The light map is what the reflection model says, computed here in f64.

use crate::shading;

use etalon::Format;
use etalon::backend::Inputs;
use etalon::effects::geometry::{GBuffer, View};
use etalon::effects::lighting::{LightKind, PunctualLight, Surroundings, lighting};
use etalon::effects::{CameraParams, EffectError};
use etalon::graph::{Graph, GraphError, Texture};
use etalon::image::ImageData;
use etalon::kernel::Arithmetic;
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_tests::{executors, plan_for};
use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use shading::Point;

const WIDTH: u32 = 24;
const HEIGHT: u32 = 16;

/// Images of surfaces, and what lights them.
struct Scene {
    images: Vec<(&'static str, ImageData)>,
    view: View,
}

impl Scene {
    /// Surfaces of every roughness, metals and not, turned this way and that, the
    /// last column empty.
    fn new() -> Self {
        let texels = |texel: &dyn Fn(f32, f32) -> [f32; 4], format| {
            let desc = TextureDesc::d2(WIDTH, HEIGHT, format);
            let of = |x: u32, y: u32| texel(x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32);
            let all = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
            let all: Vec<_> = all
                .map(|(x, y)| if x + 1 == WIDTH { [0.0; 4] } else { of(x, y) })
                .collect();
            ImageData::from_rgba_f32(desc, &all).unwrap()
        };
        let normal = |u: f32, v: f32| {
            let n = Vec3::new(1.6 * u - 0.8, 0.9 - 1.5 * v, 1.0).normalize();
            n.extend(0.0).to_array()
        };
        let images = vec![
            (
                "depth",
                texels(
                    &|u, v| [0.02 + 0.03 * u + 0.01 * v, 0.0, 0.0, 0.0],
                    Format::R32Float,
                ),
            ),
            (
                "colour",
                texels(&|u, v| [0.9 * v, 0.5, 0.8 * u, 1.0], Format::Rgba16Float),
            ),
            ("normal", texels(&normal, Format::Rgba16Float)),
            (
                "specular",
                texels(
                    &|u, v| [0.04 + 0.9 * v, 0.04, 0.5 * u, 0.9 * u],
                    Format::Rgba8Unorm,
                ),
            ),
            (
                "emission",
                texels(&|u, _| [0.0, 2.0 * u, 0.0, 1.0], Format::Rgba16Float),
            ),
        ];
        let turned = DMat4::from_rotation_translation(
            DQuat::from_rotation_y(0.4),
            DVec3::new(0.3, -0.2, -1.0),
        );
        Self {
            images,
            view: View {
                camera: CameraParams::perspective(1.0, WIDTH as f32 / HEIGHT as f32, 0.1),
                view: turned,
                previous: turned,
            },
        }
    }

    fn import(&self, graph: &mut Graph) -> Result<GBuffer, GraphError> {
        let mut import = |name: &str| -> Result<Texture, GraphError> {
            graph.import_texture(name, self.at(name).desc)
        };
        Ok(GBuffer {
            colour: import("colour")?,
            normal: import("normal")?,
            specular: import("specular")?,
            emission: import("emission")?,
            depth: import("depth")?,
        })
    }

    fn at(&self, name: &str) -> &ImageData {
        &self.images.iter().find(|(of, _)| *of == name).unwrap().1
    }

    fn texel(&self, name: &str, x: u32, y: u32) -> DVec4 {
        DVec4::from(self.at(name).texel(x, y, 0, 0).unwrap().to_f64())
    }

    /// The light of a pixel.
    fn expected(&self, light: &PunctualLight, x: u32, y: u32) -> DVec3 {
        let camera = &self.view.camera;
        let distance = f64::from(camera.near) / self.texel("depth", x, y).x;
        let ndc_x = (f64::from(x) + 0.5) / f64::from(WIDTH) * 2.0 - 1.0;
        let ndc_y = 1.0 - (f64::from(y) + 0.5) / f64::from(HEIGHT) * 2.0;
        let scale = camera.scale.as_dvec2();
        let specular = self.texel("specular", x, y);
        let point = Point {
            place: DVec3::new(ndc_x / scale.x, ndc_y / scale.y, -1.0) * distance,
            normal: self.texel("normal", x, y).truncate().normalize(),
            colour: self.texel("colour", x, y).truncate(),
            mirrored: specular.truncate(),
            roughness: 1.0 - specular.w,
        };
        point.lit(light, &self.view).sum()
    }
}

fn lamps() -> [PunctualLight; 4] {
    let lamp = |kind, reach| PunctualLight {
        kind,
        position: DVec3::new(0.5, 1.5, -1.0),
        direction: DVec3::new(-0.2, -0.5, -1.0),
        power: Vec3::new(3.0, 2.0, 1.0),
        reach,
    };
    let spot = LightKind::Spot {
        inner: 0.3,
        outer: 0.9,
    };
    [
        lamp(LightKind::Directional, None),
        lamp(LightKind::Point, None),
        lamp(LightKind::Point, Some(5.0)),
        lamp(spot, None),
    ]
}

/// Each layer is rounded to f16 once by the kernel, and the sum once for each layer by
/// the target; the kernel itself computes in f32, with some ten roundings on the way
/// and, for normals, differences of numbers around 1.
fn close(got: f64, want: f64, layers: f64) -> bool {
    (got - want).abs() <= want.abs() * (layers + 1.0) / 1024.0 + 1e-6
}

#[test]
fn each_light_adds_what_the_model_says() {
    let scene = Scene::new();
    let inputs = scene
        .images
        .iter()
        .fold(Inputs::new(), |inputs, (name, image)| {
            inputs.texture(*name, image)
        });
    let lamps = lamps();
    let sets: Vec<&[PunctualLight]> = (0..4)
        .map(|k| &lamps[k..=k])
        .chain([&lamps[..], &lamps[..0]])
        .collect();
    for executor in &mut executors() {
        for lights in &sets {
            let mut graph = Graph::new();
            let surfaces = scene.import(&mut graph).unwrap();
            let around = Surroundings {
                background: Vec3::new(0.25, 0.5, 1.0),
                ..Surroundings::default()
            };
            let light = lighting(&mut graph, &scene.view, &surfaces, lights, &around).unwrap();
            graph.output("light", light).unwrap();
            let kernels = etalon::effects::kernels();
            let (strict, capture) = (Arithmetic::Strict, Capture::Outputs);
            let plan = plan_for(executor.as_ref(), &graph, &kernels, strict, capture).unwrap();
            let execution = executor.execute(&plan, &inputs).unwrap();
            let image = execution.output("light").unwrap();
            let mut lit = 0;
            for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
                let got = DVec4::from(image.texel(x, y, 0, 0).unwrap().to_f64());
                if x + 1 == WIDTH {
                    assert_eq!(got, DVec4::new(0.25, 0.5, 1.0, 1.0));
                    continue;
                }
                let own = scene.texel("emission", x, y).truncate();
                let added = lights.iter().map(|light| scene.expected(light, x, y));
                let want = added.fold(own, |sum, light| sum + light);
                let layers = lights.len() as f64 + 1.0;
                for channel in 0..3 {
                    assert!(
                        close(got[channel], want[channel], layers),
                        "{lights:?} at {x}, {y}: {got} and not {want} on {}",
                        executor.info()
                    );
                }
                lit += usize::from(want.max_element() > 0.01);
            }
            assert!(lit > 100, "{lit} lit by {lights:?}");
        }
    }
}

/// The comparison must be able to fail: a light moved by a hundredth.
#[test]
fn another_light_is_told_apart() {
    let scene = Scene::new();
    let light = lamps()[1];
    let moved = PunctualLight {
        position: light.position + DVec3::new(0.01, 0.0, 0.0),
        ..light
    };
    let differ = (0..HEIGHT)
        .flat_map(|y| (0..WIDTH - 1).map(move |x| (x, y)))
        .filter(|&(x, y)| {
            let (a, b) = (scene.expected(&light, x, y), scene.expected(&moved, x, y));
            !(0..3).all(|channel| close(b[channel], a[channel], 1.0))
        });
    assert!(differ.count() > 50);
}

#[test]
fn numbers_out_of_range_are_refused() {
    let scene = Scene::new();
    let changes: [fn(&mut PunctualLight); 6] = [
        |light| light.power.x = -1.0,
        |light| light.power.y = f32::NAN,
        |light| light.direction = DVec3::ZERO,
        |light| light.position.z = f64::INFINITY,
        |light| light.reach = Some(0.0),
        |light| {
            light.kind = LightKind::Spot {
                inner: 0.5,
                outer: 0.5,
            }
        },
    ];
    for change in changes {
        let mut light = lamps()[0];
        change(&mut light);
        let mut graph = Graph::new();
        let surfaces = scene.import(&mut graph).unwrap();
        let around = Surroundings::default();
        let refused = lighting(&mut graph, &scene.view, &surfaces, &[light], &around);
        assert!(matches!(refused, Err(EffectError::Setting(_))), "{light:?}");
    }
}

//! Surfaces lit as they are drawn are what the reflection model says, computed here
//! in f64 where exact rays meet them, and what the light map has of them.

mod shading;

use etalon::Format;
use etalon::backend::{Backend, Execution};
use etalon::effects::environment::{
    EnvironmentMap, Prefilter, Surroundings, environment, mirroring,
};
use etalon::effects::forward::{Lamps, Lighting, forward, glass, lamp_bytes};
use etalon::effects::geometry::{Geometry, View, gbuffer, prepass};
use etalon::effects::lighting::{LightKind, PunctualLight, lighting};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::model::{
    AlphaMode, Drawable, Material, Model, ModelParts, Node, Snapshot, Transform, Viewpoint, lights,
    shapes, view,
};
use etalon_scenes::trace::{TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, FrameSize, models};
use etalon_tests::{drawing_executors, non_finite, plan_for};
use glam::{DMat3, DVec3, DVec4, Vec3};
use shading::{Around, Parts, Point, mirrored_parts};
use std::f64::consts::{PI, TAU};

/// Who draws.
fn executors() -> Vec<Box<dyn Backend>> {
    drawing_executors()
}

/// A model at a time, seen by its first camera.
struct Scene {
    name: String,
    model: Model,
    snapshot: Snapshot,
    camera: Camera,
    size: FrameSize,
    lamps: Vec<PunctualLight>,
    sky: Option<Sky>,
}

/// How a scene is drawn.
struct With<'a> {
    lamps: &'a [PunctualLight],
    /// Of the lamps, for forward shading.
    bytes: &'a [u8],
    arithmetic: Arithmetic,
    kernels: &'a KernelLibrary,
}

/// Light from everywhere, `middle + slope · direction` in all, part of it by
/// `above` and `below` and part by a map.
struct Sky {
    above: Vec3,
    below: Vec3,
    map: EnvironmentMap,
    middle: DVec3,
    slope: DMat3,
}

impl Sky {
    fn new() -> Self {
        let (above, below) = (Vec3::new(0.6, 0.5, 0.4), Vec3::new(0.1, 0.15, 0.2));
        let (middle, across) = (DVec3::new(0.3, 0.3, 0.5), DVec3::new(0.25, 0.1, 0.0));
        let along = DVec3::new(0.0, 0.1, 0.3);
        let map = picture(&|at| middle + across * at.x + along * at.z);
        let up = 0.5 * (above - below).as_dvec3();
        Self {
            above,
            below,
            map: EnvironmentMap::of_equirectangular(&map, 64).unwrap(),
            middle: middle + 0.5 * (above + below).as_dvec3(),
            slope: DMat3::from_cols(across, up, along),
        }
    }
}

/// An equirectangular picture of what comes from each direction.
fn picture(radiance: &dyn Fn(DVec3) -> DVec3) -> ImageData {
    let [width, height] = [256, 128];
    let texel = |k: u32| {
        let turn = TAU * ((f64::from(k % width) + 0.5) / f64::from(width) - 0.5);
        let tilt = PI * (f64::from(k / width) + 0.5) / f64::from(height);
        let across = tilt.sin();
        let at = DVec3::new(across * turn.sin(), tilt.cos(), -across * turn.cos());
        radiance(at).as_vec3().extend(1.0).to_array()
    };
    let texels: Vec<_> = (0..width * height).map(texel).collect();
    let desc = TextureDesc::d2(width, height, Format::Rgba32Float);
    ImageData::from_rgba_f32(desc, &texels).unwrap()
}

impl Scene {
    fn of(name: &str, model: Model, size: FrameSize) -> Self {
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

    fn view(&self) -> View {
        view(&self.camera, self.size).unwrap()
    }

    fn is_opaque(&self, material: usize) -> bool {
        let material = &self.model.parts().materials[material];
        material.alpha != AlphaMode::Blend && material.transmission == 0.0
    }

    fn truth(&self) -> Truth {
        let (model, snapshot) = (&self.model, &self.snapshot);
        let traced = TriangleScene::of(model, snapshot, |at| self.is_opaque(at.material)).unwrap();
        let options = TruthOptions::default();
        traced.truth(&self.camera, self.size, &options).unwrap()
    }

    /// Draws it both ways; `lamps` are lit.
    fn draw(&self, executor: &mut dyn Backend, lamps: &[PunctualLight]) -> Execution {
        let bytes = lamp_bytes(&self.view(), lamps).unwrap();
        let with = With {
            lamps,
            bytes: &bytes,
            arithmetic: Arithmetic::Strict,
            kernels: &KernelLibrary::new(),
        };
        self.draw_with(executor, &with)
    }

    fn draw_with(&self, executor: &mut dyn Backend, with: &With<'_>) -> Execution {
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

    fn around(&self) -> Option<Around> {
        let sky = self.sky.as_ref()?;
        Some(Around {
            to_world: DMat3::from_mat4(self.camera.pose().view_matrix()).transpose(),
            middle: sky.middle,
            slope: sky.slope,
        })
    }

    /// What a point sends to the eye.
    fn model_of(&self, point: &Point) -> Parts {
        let view = self.view();
        let lamps = self.lamps.iter().map(|lamp| point.lit(lamp, &view));
        let lit = lamps.fold(Parts::default(), Parts::plus);
        match self.around() {
            Some(around) => lit.plus(point.surrounded(&around)),
            None => lit,
        }
    }
}

fn scenes(size: FrameSize) -> Vec<Scene> {
    let scene =
        |entry: &etalon_scenes::ModelEntry| Scene::of(entry.name, (entry.build)().unwrap(), size);
    models().iter().map(scene).collect()
}

fn texel(execution: &Execution, name: &str, x: u32, y: u32) -> DVec4 {
    let image = execution.output(name).unwrap();
    DVec4::from(image.texel(x, y, 0, 0).unwrap().to_f64())
}

fn pixels(size: FrameSize) -> impl Iterator<Item = (u32, u32)> {
    (0..size.height()).flat_map(move |y| (0..size.width()).map(move |x| (x, y)))
}

/// How much a point's light changes with its normal turned by an angle.
fn by_normal(scene: &Scene, point: &Point, angle: f64) -> DVec3 {
    let light = scene.model_of(point).sum();
    let (u, v) = point.normal.any_orthonormal_pair();
    let turned = [u, -u, v, -v].map(|to| {
        let normal = (point.normal + to * angle).normalize();
        (scene.model_of(&Point { normal, ..*point }).sum() - light).abs()
    });
    turned.into_iter().fold(DVec3::ZERO, DVec3::max)
}

/// What kernels are off in light from everywhere: the table's two numbers by 0.003
/// of it at most, and the map by a hundredth, of whose texels the coarsest are 13
/// degrees wide.
fn of_table_and_map(scene: &Scene, point: &Point) -> DVec3 {
    let Some(around) = scene.around() else {
        return DVec3::ZERO;
    };
    let parts = point.surrounded(&around);
    let bright = around.middle + DVec3::splat(around.slope.abs().x_axis.length());
    bright * (point.mirrored + 1.0) * 0.003 + parts.mirrored * 0.01 + parts.scattered * 1e-3
}

/// The light of a pixel, and how far from it is allowed.
struct Expected {
    pixel: [u32; 2],
    light: DVec3,
    allowed: DVec3,
}

/// The model's light where one triangle of a surface without maps is seen: of every
/// seventh pixel, as the model sums thousands of directions for each.
fn expected(scene: &Scene) -> Vec<Expected> {
    let truth = scene.truth();
    let to_view = scene.camera.pose().view_matrix();
    let mut all = Vec::new();
    for (x, y) in pixels(scene.size).step_by(7) {
        let pixel = truth.at(x, y).unwrap();
        let (true, Some(surface)) = (pixel.inner, &pixel.surface) else {
            continue;
        };
        let material = scene.snapshot.instances.all()[surface.instance as usize].material;
        let material = &scene.model.parts().materials[material];
        if material.textures().next().is_some() {
            continue;
        }
        let [r, g, b, _] = material.base_colour.map(f64::from);
        let (base, metal) = (DVec3::new(r, g, b), f64::from(material.metallic));
        let f0 = f64::from((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let side = if surface.front { 1.0 } else { -1.0 };
        let point = Point {
            place: surface.view,
            normal: to_view.transform_vector3(surface.normal * side),
            colour: base * (1.0 - metal),
            mirrored: DVec3::splat(f0).lerp(base, metal),
            roughness: f64::from(material.roughness),
        };
        let emission = DVec3::from(material.emissive.map(f64::from));
        let own = emission * f64::from(material.emissive_strength);
        let light = own + scene.model_of(&point).sum();
        // Corners move by half a 256th of a pixel at most, over which no normal of
        // these models turns by more than this angle; the result is rounded to f16,
        // and f32 loses some ulps in differences of numbers around 1.
        let allowed = by_normal(scene, &point, 3e-4)
            + of_table_and_map(scene, &point)
            + light.abs() * (1.0 / 2048.0 + 1e-4)
            + 1e-5;
        all.push(Expected {
            pixel: [x, y],
            light,
            allowed,
        });
    }
    all
}

/// The largest distance of light drawn, in units of what is allowed.
fn worst(expected: &[Expected], drawn: &Execution) -> f64 {
    let off = expected.iter().map(|expected| {
        let [x, y] = expected.pixel;
        let got = texel(drawn, "light", x, y).truncate();
        ((got - expected.light).abs() / expected.allowed).max_element()
    });
    off.fold(0.0, f64::max)
}

#[test]
fn surfaces_are_lit_as_the_model_says() {
    let size = FrameSize::new(240, 135).unwrap();
    for scene in &scenes(size) {
        let expected = expected(scene);
        assert!(expected.len() > 100, "{}: {}", scene.name, expected.len());
        for executor in &mut executors() {
            let drawn = scene.draw(executor.as_mut(), &scene.lamps);
            let worst = worst(&expected, &drawn);
            let who = format!("{} on {}: {worst}", scene.name, executor.info());
            println!("{who}");
            assert!(worst <= 1.0, "{who}");
        }
    }
}

/// Fast kernels filter with the device's weights, of eight bits: a 256th of what two
/// texels of the table or the map differ by, which is less than what those are off.
#[test]
fn fast_kernels_light_alike() {
    let size = FrameSize::new(120, 68).unwrap();
    let scene = &scenes(size)[0];
    let expected = expected(scene);
    let bytes = lamp_bytes(&scene.view(), &scene.lamps).unwrap();
    for executor in &mut executors() {
        let with = With {
            lamps: &scene.lamps,
            bytes: &bytes,
            arithmetic: Arithmetic::Fast,
            kernels: &KernelLibrary::new(),
        };
        let worst = worst(&expected, &scene.draw_with(executor.as_mut(), &with));
        assert!(worst <= 1.0, "{worst} on {}", executor.info());
    }
}

/// Whatever bits a list of lamps has, light is finite.
#[test]
fn no_lamp_makes_light_that_is_no_number() {
    let size = FrameSize::new(64, 36).unwrap();
    let scene = &scenes(size)[0];
    let patterns = [
        0xffff_ffff_u32,
        0x7f80_0000,
        0xff7f_ffff,
        0x7fc0_0001,
        0x0000_0001,
    ];
    for executor in &mut executors() {
        for (arithmetic, pattern) in [Arithmetic::Strict, Arithmetic::Fast]
            .into_iter()
            .flat_map(|arithmetic| patterns.map(|pattern| (arithmetic, pattern)))
        {
            let count = scene.lamps.len();
            let bytes: Vec<u8> = (0..16 * count as u32)
                .flat_map(|word| {
                    if word % 3 == 0 {
                        1.0_f32.to_bits()
                    } else {
                        pattern
                    }
                    .to_le_bytes()
                })
                .collect();
            let with = With {
                lamps: &scene.lamps,
                bytes: &bytes,
                arithmetic,
                kernels: &KernelLibrary::new(),
            };
            let drawn = scene.draw_with(executor.as_mut(), &with);
            for name in ["light", "glass"] {
                let found = non_finite(drawn.output(name).unwrap());
                assert_eq!(found, 0, "{name}, {pattern:x} on {}", executor.info());
            }
        }
    }
}

/// The comparison must be able to fail: a sky a little darker, and a lamp moved by
/// two centimetres.
#[test]
fn another_light_is_told_apart() {
    let size = FrameSize::new(120, 68).unwrap();
    let mut scene = scenes(size).swap_remove(0);
    let mut executors = executors();
    let Some(executor) = executors.first_mut() else {
        return;
    };
    let dim = expected(&scene);
    let mut darker = Scene::of("dark", (models()[0].build)().unwrap(), size);
    darker.sky.as_mut().unwrap().above *= 0.95;
    let bad = worst(&dim, &darker.draw(executor.as_mut(), &scene.lamps));
    assert!(bad > 1.5, "{bad}");

    scene.sky = None;
    let expected = expected(&scene);
    let mut moved = scene.lamps.clone();
    moved.last_mut().unwrap().position.x += 0.02;
    let good = worst(&expected, &scene.draw(executor.as_mut(), &scene.lamps));
    let bad = worst(&expected, &scene.draw(executor.as_mut(), &moved));
    assert!(good <= 1.0 && bad > 1.5, "{good}, {bad}");
}

/// Forward light and light map differ by what the G-buffer and the layers lose: half
/// a step of each format, times what the model makes of it.
#[test]
fn light_as_drawn_is_that_of_the_light_map() {
    let size = FrameSize::new(200, 112).unwrap();
    for scene in &scenes(size) {
        for executor in &mut executors() {
            let drawn = scene.draw(executor.as_mut(), &scene.lamps);
            let (count, worst) = apart(scene, &drawn);
            let who = format!("{} on {}: {count}, {worst}", scene.name, executor.info());
            println!("{who}");
            assert!(count > 100 && worst <= 1.0, "{who}");
        }
    }
}

/// The comparison must be able to fail: a hundredth of what is scattered left out.
#[test]
fn a_light_map_of_other_light_is_told_apart() {
    let size = FrameSize::new(100, 56).unwrap();
    let scene = &scenes(size)[0];
    let mut kernels = KernelLibrary::new();
    let shade = kernels.source("forward/shade").unwrap().to_string();
    let changed = shade.replacen(
        "seen.emission + scattered +",
        "seen.emission + 0.99 * scattered +",
        1,
    );
    assert_ne!(shade, changed);
    kernels.add_source("forward/shade", &changed);
    let bytes = lamp_bytes(&scene.view(), &scene.lamps).unwrap();
    let mut executors = executors();
    let Some(executor) = executors.first_mut() else {
        return;
    };
    let with = With {
        lamps: &scene.lamps,
        bytes: &bytes,
        arithmetic: Arithmetic::Strict,
        kernels: &kernels,
    };
    let (_, worst) = apart(scene, &scene.draw_with(executor.as_mut(), &with));
    assert!(worst > 1.2, "{worst}");
}

/// How many pixels of surfaces are compared, and the largest distance between light
/// map and forward light, in units of what is allowed.
fn apart(scene: &Scene, drawn: &Execution) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0_f64);
    for (x, y) in pixels(scene.size) {
        let [a, b] = ["light map", "light"].map(|name| texel(drawn, name, x, y));
        let colour = texel(drawn, "colour", x, y);
        if colour.w == 0.0 {
            // Both show what is behind everything.
            assert_eq!(a, b, "{x}, {y}");
            continue;
        }
        if (x + 3 * y) % 37 != 0 {
            continue;
        }
        let allowed = of_storage(scene, drawn, x, y);
        let off = (a - b).truncate().abs() / allowed;
        worst = worst.max(off.max_element());
        count += 1;
    }
    (count, worst)
}

/// How far a pixel's light may move by the rounding of what the G-buffer holds of it.
fn of_storage(scene: &Scene, drawn: &Execution, x: u32, y: u32) -> DVec3 {
    let camera = scene.view().camera;
    let distance = f64::from(camera.near) / texel(drawn, "depth", x, y).x;
    let ndc_x = (f64::from(x) + 0.5) / f64::from(scene.size.width()) * 2.0 - 1.0;
    let ndc_y = 1.0 - (f64::from(y) + 0.5) / f64::from(scene.size.height()) * 2.0;
    let scale = camera.scale.as_dvec2();
    let specular = texel(drawn, "specular", x, y);
    let point = Point {
        place: DVec3::new(ndc_x / scale.x, ndc_y / scale.y, -1.0) * distance,
        normal: texel(drawn, "normal", x, y).truncate().normalize(),
        colour: texel(drawn, "colour", x, y).truncate(),
        mirrored: specular.truncate(),
        roughness: 1.0 - specular.w,
    };
    let light = scene.model_of(&point).sum();
    let change = |changed: Point| (scene.model_of(&changed).sum() - light).abs();
    let either = |f: &dyn Fn(f64) -> Point| change(f(1.0)).max(change(f(-1.0)));
    let half = 0.5 / 255.0;
    let by_roughness = either(&|sign| Point {
        roughness: (point.roughness + sign * half).clamp(0.0, 1.0),
        ..point
    });
    let by_mirrored = either(&|sign| Point {
        mirrored: (point.mirrored + sign * half).clamp(DVec3::ZERO, DVec3::ONE),
        ..point
    });
    let by_colour = either(&|sign| Point {
        colour: point.colour * (1.0 + sign / 2048.0),
        ..point
    });
    // Where the surface is drawn may be off by the grid's half 256th of a pixel.
    let grid = distance / f64::from(scene.size.height()) / scale.y / 256.0;
    let by_place = either(&|sign| Point {
        place: point.place + DVec3::splat(sign * grid),
        ..point
    });
    // Half a step of f16 below 1 in each of three components.
    let by_normal = by_normal(scene, &point, 3_f64.sqrt() / 4096.0);
    let own = texel(drawn, "emission", x, y).truncate();
    let layers = scene.lamps.len() as f64 + 2.0;
    // The linear bounds add up; a tenth is for what is not linear in them.
    1.1 * (by_roughness + by_mirrored + by_colour + by_normal + by_place)
        + (light + own) * (layers / 1024.0)
        + 1e-5
}

/// A prepass only decides which fragments are shaded, and the thin G-buffer is that
/// of the whole one.
#[test]
fn what_is_beside_the_light_is_as_elsewhere() {
    let size = FrameSize::new(160, 90).unwrap();
    let scenes = scenes(size);
    let scene = scenes.iter().find(|scene| scene.name == "stairs").unwrap();
    for executor in &mut executors() {
        let drawn = scene.draw(executor.as_mut(), &scene.lamps);
        let bytes = |name: &str| &drawn.output(name).unwrap().bytes;
        assert_eq!(bytes("normal"), bytes("thin normal"));
        assert_eq!(bytes("specular"), bytes("thin specular"));
        // There is no glass in it, so that this is what is drawn without prepass.
        assert_eq!(bytes("light"), bytes("glass"));
    }
}

/// Six balls in a row, white metals and white plastics, from smooth to rough, in
/// front of nothing.
fn balls() -> Model {
    let mut parts = ModelParts::default();
    let ball = parts.mesh(shapes::icosphere("ball", 0.45, 3).unwrap());
    for (k, (metal, roughness)) in [0.0_f32, 1.0]
        .into_iter()
        .flat_map(|metal| [0.1_f32, 0.5, 1.0].map(|roughness| (metal, roughness)))
        .enumerate()
    {
        let material = parts.material(Material {
            metallic: metal,
            ..Material::dielectric("white", [1.0; 3], roughness)
        });
        let place = [k as f32 - 2.5, 0.0, -6.0];
        parts.node(Node::with_part(
            "ball",
            Transform::at(place),
            ball,
            material,
        ));
    }
    let eye = parts.node(Node::default());
    parts.viewpoints.push(Viewpoint::Node {
        node: eye,
        vertical_fov: 0.3,
        near: 0.1,
    });
    Model::new(parts).unwrap()
}

/// White surfaces in uniform light of 1 send the part that the model reflects, within
/// the table's error. Metals never send more than arrives, and lose what is masked
/// twice, which the model does not follow: up to seven tenths, of the roughest.
/// Plastics may send a tenth more towards grazing angles: what the coat mirrors there
/// is not all taken from what is scattered below it (glTF 2.0, appendix B.3.5: the
/// two are mixed by the angle to the half vector).
#[test]
fn white_surfaces_send_what_arrives_but_for_the_models_own_losses() {
    let size = FrameSize::new(768, 128).unwrap();
    let mut scene = Scene::of("balls", balls(), size);
    scene.lamps.clear();
    scene.sky = Some(Sky {
        above: Vec3::ZERO,
        below: Vec3::ZERO,
        map: EnvironmentMap::of_equirectangular(&picture(&|_| DVec3::ONE), 32).unwrap(),
        middle: DVec3::ONE,
        slope: DMat3::ZERO,
    });
    let truth = scene.truth();
    let to_view = scene.camera.pose().view_matrix();
    for executor in &mut executors() {
        let drawn = scene.draw(executor.as_mut(), &[]);
        let mut found = [[2.0_f64, 0.0]; 2];
        let (mut count, mut worst) = (0, 0_f64);
        for (x, y) in pixels(size).step_by(3) {
            let pixel = truth.at(x, y).unwrap();
            let (true, Some(surface)) = (pixel.inner, &pixel.surface) else {
                continue;
            };
            let instance = &scene.snapshot.instances.all()[surface.instance as usize];
            let material = &scene.model.parts().materials[instance.material];
            let normal = to_view.transform_vector3(surface.normal);
            let cosine = normal.dot(-surface.view.normalize());
            let metal = material.metallic > 0.5;
            let [all, fifth] = mirrored_parts(cosine, f64::from(material.roughness), 32);
            let want = if metal {
                all
            } else {
                let scattered = 0.96 * (1.0 - shading::fresnel_mean(cosine, 32));
                0.04 * (all - fifth) + fifth + scattered
            };
            let got = texel(&drawn, "light", x, y).x;
            worst = worst.max((got - want).abs());
            count += 1;
            let [least, most] = &mut found[usize::from(metal)];
            (*least, *most) = (least.min(got), most.max(got));
        }
        let who = format!(
            "{}: plastics, metals {found:?}, off {worst}, {count}",
            executor.info()
        );
        println!("{who}");
        // The table's error, f16's, and that of the normals at grazing angles.
        assert!(count > 1000 && worst <= 0.005, "{who}");
        let [plastics, metals] = found;
        assert!(plastics[0] >= 0.95 && plastics[1] <= 1.1, "{who}");
        assert!(metals[0] >= 0.3 && metals[1] <= 1.001, "{who}");
    }
}

/// A pane of clear glass before a wall that glows: what is behind shows by what is
/// neither covered nor mirrored, and what is mirrored comes on top in full.
#[test]
fn glass_covers_by_its_opacity_and_mirrors_in_full() {
    let mut parts = ModelParts::default();
    let wall = parts.mesh(shapes::cuboid("wall", [4.0, 4.0, 0.1]).unwrap());
    let glowing = parts.material(Material {
        emissive: [0.5, 0.25, 1.0],
        ..Material::dielectric("glowing", [0.0; 3], 1.0)
    });
    let pane = parts.material(Material {
        alpha: AlphaMode::Blend,
        base_colour: [0.5, 0.8, 0.2, 0.25],
        metallic: 0.0,
        roughness: 0.2,
        ..Material::default()
    });
    let sheet = parts.mesh(shapes::cuboid("sheet", [1.0, 1.0, 0.01]).unwrap());
    parts.node(Node::with_part(
        "wall",
        Transform::at([0.0, 0.0, -9.0]),
        wall,
        glowing,
    ));
    parts.node(Node::with_part(
        "sheet",
        Transform::at([0.0, 0.0, -5.0]),
        sheet,
        pane,
    ));
    let eye = parts.node(Node::default());
    parts.viewpoints.push(Viewpoint::Node {
        node: eye,
        vertical_fov: 0.3,
        near: 0.1,
    });
    let size = FrameSize::new(32, 32).unwrap();
    let scene = Scene::of("pane", Model::new(parts).unwrap(), size);
    for executor in &mut executors() {
        let drawn = scene.draw(executor.as_mut(), &scene.lamps);
        let mut worst = 0_f64;
        for (x, y) in pixels(size) {
            let behind = texel(&drawn, "light", x, y);
            let got = texel(&drawn, "glass", x, y);
            assert_eq!(got.w, 1.0);
            let scale = scene.view().camera.scale.as_dvec2();
            let ndc = |at: u32| (f64::from(at) + 0.5) / 16.0 - 1.0;
            let point = Point {
                place: DVec3::new(ndc(x) / scale.x, -ndc(y) / scale.y, -1.0) * 4.99,
                normal: DVec3::Z,
                colour: DVec3::new(0.5, 0.8, 0.2),
                mirrored: DVec3::splat(0.04),
                roughness: 0.2,
            };
            let parts = scene.model_of(&point);
            let fresnel = 0.04 + 0.96 * (1.0 - point.to_eye().z).powi(5);
            let passes = 0.75 * (1.0 - fresnel);
            let own = parts.scattered * 0.25 + parts.mirrored;
            let want = own + behind.truncate() * passes;
            // Rounded to f16 for what is drawn, its coverage and the sum.
            let allowed = of_table_and_map(&scene, &point)
                + by_normal(&scene, &point, 1e-5)
                + want * (4.0 / 2048.0)
                + 1e-5;
            let off = (got.truncate() - want).abs() / allowed;
            worst = worst.max(off.max_element());
        }
        assert!(worst <= 1.0, "{worst} on {}", executor.info());
    }
}

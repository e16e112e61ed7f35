//! What is drawn is what exact rays see: depth, normals and velocity of every
//! model, on every backend.

use etalon::backend::{Backend, Execution};
use etalon::effects::geometry::{Geometry, gbuffer, prepass};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::Arithmetic;
use etalon::plan::Capture;
use etalon_scenes::model::{AlphaMode, Drawable, Model, Snapshot, view};
use etalon_scenes::trace::{SurfacePoint, TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, FrameSize, Pose, models};
use etalon_tests::{executors, plan_for};
use glam::{DMat3, DVec2, DVec3, DVec4};

/// A model at a time, as rays see what of it is opaque.
struct Scene {
    name: &'static str,
    model: Model,
    snapshot: Snapshot,
    camera: Camera,
    truth: Truth,
}

fn scenes(size: FrameSize, clearance: f64) -> Vec<Scene> {
    let scene = |entry: &etalon_scenes::ModelEntry| {
        let model = (entry.build)().unwrap();
        let snapshot = model.at(0.5).unwrap();
        let camera = snapshot.cameras[0];
        let opaque = |material: usize| {
            let material = &model.parts().materials[material];
            material.alpha != AlphaMode::Blend && material.transmission == 0.0
        };
        let traced =
            TriangleScene::of(&model, &snapshot, |instance| opaque(instance.material)).unwrap();
        let options = TruthOptions {
            clearance,
            ..TruthOptions::default()
        };
        let truth = traced.truth(&camera, size, &options).unwrap();
        Scene {
            name: entry.name,
            model,
            snapshot,
            camera,
            truth,
        }
    };
    models().iter().map(scene).collect()
}

fn draw(executor: &mut dyn Backend, scene: &Scene, size: FrameSize) -> Execution {
    let drawable = Drawable::new(&scene.model).unwrap();
    let mut graph = Graph::new();
    let items = drawable.import(&mut graph).unwrap();
    let items = items.opaque_items(&scene.model, &scene.snapshot);
    let geometry = Geometry {
        items: &items,
        view: view(&scene.camera, size).unwrap(),
        size: [size.width(), size.height()],
    };
    let pre = prepass(&mut graph, &geometry, true).unwrap();
    let g = gbuffer(&mut graph, &geometry, Some(&pre)).unwrap();
    for (name, texture) in [
        ("depth", pre.depth),
        ("velocity", pre.velocity.unwrap()),
        ("colour", g.colour),
        ("normal", g.normal),
    ] {
        graph.output(name, texture).unwrap();
    }
    let kernels = etalon::effects::kernels();
    let plan = plan_for(
        executor,
        &graph,
        &kernels,
        Arithmetic::Strict,
        Capture::Outputs,
    )
    .unwrap();
    executor.execute(&plan, &drawable.inputs()).unwrap()
}

fn texel(image: &ImageData, x: u32, y: u32) -> [f64; 4] {
    image.texel(x, y, 0, 0).unwrap().to_f64()
}

/// How a driver rasterises.
#[derive(Clone, Copy, Debug)]
struct Rules {
    /// Bits of a pixel that corners are moved to (`subPixelPrecisionBits`).
    sub_pixel_bits: i32,
    /// Whether planes of triangles that reach behind the near plane are right.
    /// SwiftShader's depths of such floors are off by several per cent.
    cuts: bool,
}

impl Rules {
    fn of(executor: &dyn Backend) -> Self {
        let swiftshader = executor.info().device.contains("SwiftShader");
        Self {
            sub_pixel_bits: if swiftshader { 4 } else { 8 },
            cuts: !swiftshader,
        }
    }

    /// By how much of a pixel corners may move: half a step of the grid.
    fn snap(self) -> f64 {
        0.5_f64.powi(self.sub_pixel_bits + 1)
    }
}

/// Whether a triangle reaches behind the near plane.
fn reaches_behind(scene: &Scene, size: FrameSize, surface: &SurfacePoint) -> bool {
    let near = scene.camera.projection(size).unwrap().near();
    let instance = &scene.snapshot.instances.all()[surface.instance as usize];
    let to_view = scene.camera.pose().view_matrix() * instance.world.as_dmat4();
    let mesh = &scene.model.parts().meshes[instance.mesh];
    let corners = mesh.triangles()[surface.triangle as usize];
    corners.iter().any(|corner| {
        let position = mesh.vertices().positions[*corner as usize].map(f64::from);
        -to_view.transform_point3(position.into()).z < near
    })
}

/// The change of depth over a pixel in x and in y, which is constant over a plane.
fn slope(scene: &Scene, size: FrameSize, surface: &SurfacePoint) -> f64 {
    let projection = scene.camera.projection(size).unwrap();
    let to_view = scene.camera.pose().view_matrix();
    let normal = to_view.transform_vector3(surface.geometric_normal);
    // near / distance = near · (normal · ray) / (normal · point), where the ray
    // to a pixel is (ndc / scale, −1).
    let per_ray = projection.near() / normal.dot(surface.view).abs();
    let pixel = DVec2::new(
        2.0 / f64::from(size.width()),
        2.0 / f64::from(size.height()),
    );
    let change = normal.truncate().abs() * per_ray / projection.scale() * pixel;
    change.x + change.y
}

/// What is found of one model on one backend.
#[derive(Debug, Default)]
struct Found {
    /// Pixels that show one triangle alone.
    surfaces: usize,
    /// Over what rounding and the grid explain, in units of the last place.
    depth: f64,
    /// In degrees.
    normal: f64,
    /// In pictures.
    velocity: f64,
}

fn compare(scene: &Scene, size: FrameSize, rules: Rules, drawn: &Execution) -> Found {
    let [depth, normal, velocity, colour] =
        ["depth", "normal", "velocity", "colour"].map(|name| drawn.output(name).unwrap());
    let to_view = scene.camera.pose().view_matrix();
    let mut found = Found::default();
    for (x, y) in (0..size.height()).flat_map(|y| (0..size.width()).map(move |x| (x, y))) {
        let pixel = scene.truth.at(x, y).unwrap();
        if !pixel.inner {
            continue;
        }
        let at = |image| texel(image, x, y);
        let Some(surface) = &pixel.surface else {
            assert_eq!(at(depth)[0], 0.0, "{}: nothing at {x}, {y}", scene.name);
            assert_eq!(at(colour), [0.0; 4], "{}: nothing at {x}, {y}", scene.name);
            continue;
        };
        assert_eq!(at(colour)[3], 1.0, "{}: a surface at {x}, {y}", scene.name);
        if !rules.cuts && reaches_behind(scene, size, surface) {
            continue;
        }
        found.surfaces += 1;
        let exact = surface.depth as f32;
        let unit = f64::from(exact.next_up() - exact);
        let off = (at(depth)[0] - surface.depth).abs() - rules.snap() * slope(scene, size, surface);
        found.depth = found.depth.max(off / unit);
        let material = scene.snapshot.instances.all()[surface.instance as usize].material;
        if scene.model.parts().materials[material]
            .normal_texture
            .is_none()
        {
            let side = if surface.front { 1.0 } else { -1.0 };
            let want = to_view.transform_vector3(surface.normal * side);
            let got = DVec4::from(at(normal)).truncate();
            let angle = got.angle_between(want).to_degrees();
            found.normal = found.normal.max(angle);
        }
        let moved = DVec4::from(at(velocity)).truncate().truncate() - surface.velocity;
        found.velocity = found.velocity.max(moved.abs().max_element());
    }
    found
}

#[test]
fn what_is_drawn_is_what_exact_rays_see() {
    let size = FrameSize::new(320, 180).unwrap();
    for scene in &scenes(size, 0.5) {
        for executor in &mut executors() {
            let rules = Rules::of(executor.as_ref());
            let drawn = draw(executor.as_mut(), scene, size);
            let found = compare(scene, size, rules, &drawn);
            let who = format!("{} on {}: {found:?}", scene.name, executor.info());
            println!("{who}");
            assert!(found.surfaces > 1000 || !rules.cuts, "{who}");
            assert!(found.depth <= 4.0, "{who}");
            // Spheres of 20 pixels turn by 3° from one to the next.
            assert!(found.normal <= 0.1 + 3.0 * rules.snap(), "{who}");
            // Stored as f16: half a unit of the last place of 0.25, and as much
            // again for what moves by less than that. What was where a corner
            // is moved to was so much off one frame earlier.
            let most = 0.25 / 2048.0 + rules.snap() / f64::from(size.height());
            assert!(found.velocity <= most, "{who}");
        }
    }
}

/// The pixels in which two pictures differ.
fn differing(a: &ImageData, b: &ImageData) -> Vec<(u32, u32)> {
    assert_eq!(a.desc, b.desc);
    let size = a.desc.format.texel_bytes() as usize;
    let texels = a.bytes.chunks_exact(size).zip(b.bytes.chunks_exact(size));
    let width = a.desc.extent.width;
    let at = |i: usize| (i as u32 % width, i as u32 / width);
    let different = texels.enumerate().filter(|(_, (a, b))| a != b);
    different.map(|(i, _)| at(i)).collect()
}

/// Which pixels show a surface.
fn covered(drawn: &Execution, (x, y): (u32, u32)) -> bool {
    texel(drawn.output("colour").unwrap(), x, y)[3] != 0.0
}

/// Where instances are, in pixels, that are scaled to a line or a point. Rays see
/// nothing of them, but their corners moved to the grid may have an area.
fn lines(scene: &Scene, size: FrameSize) -> Vec<[DVec2; 2]> {
    let pixels = DVec2::new(size.width().into(), size.height().into());
    let scale = scene.camera.projection(size).unwrap().scale();
    let all = scene.snapshot.instances.all().iter();
    let flat = all.filter(|instance| {
        let matrix = DMat3::from_mat4(instance.world.as_dmat4());
        let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
        [x.cross(y), y.cross(z), z.cross(x)]
            .iter()
            .all(|normal| *normal == DVec3::ZERO)
    });
    let bounds = flat.map(|instance| {
        let to_view = scene.camera.pose().view_matrix() * instance.world.as_dmat4();
        let corners = &scene.model.parts().meshes[instance.mesh]
            .vertices()
            .positions;
        let at = corners.iter().map(|corner| {
            let view = to_view.transform_point3(corner.map(f64::from).into());
            let place = view.truncate() / -view.z * scale;
            (place * DVec2::new(0.5, -0.5) + 0.5) * pixels
        });
        let start = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        at.fold(start, |[low, high], at| [low.min(at), high.max(at)])
    });
    bounds.collect()
}

/// lavapipe moves corners to the same grid and computes depth by the same
/// operations: no pixel of any model differs. Others may cover other pixels where
/// an edge is nearer to the centre than both grids move corners, and those alone.
#[test]
fn coverage_and_depth_are_those_of_lavapipe() {
    for size in [(320, 180), (333, 217)] {
        let size = FrameSize::new(size.0, size.1).unwrap();
        let mut executors = executors();
        let (interpreter, devices) = executors.split_first_mut().unwrap();
        let rules = devices.iter().map(|device| Rules::of(device.as_ref()));
        let snap = rules.map(Rules::snap).fold(0.0, f64::max);
        let ours = Rules::of(interpreter.as_ref()).snap();
        for scene in &scenes(size, snap + ours) {
            let lines = lines(scene, size);
            let expected = draw(interpreter.as_mut(), scene, size);
            for device in &mut *devices {
                let drawn = draw(device.as_mut(), scene, size);
                let who = format!("{} on {}", scene.name, device.info());
                let pictures = |name| [&expected, &drawn].map(|run| run.output(name).unwrap());
                let [a, b] = pictures("depth");
                if device.info().device.contains("llvmpipe") {
                    assert_eq!(differing(a, b), [], "{who}");
                    continue;
                }
                let pixels =
                    (0..size.height()).flat_map(|y| (0..size.width()).map(move |x| (x, y)));
                let other = |at| covered(&expected, at) != covered(&drawn, at);
                let others: Vec<_> = pixels.filter(|at| other(*at)).collect();
                println!("{who}: {} pixels are covered otherwise", others.len());
                let clear = |(x, y): (u32, u32)| {
                    let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let on_a_line = |[low, high]: &[DVec2; 2]| {
                        centre.cmpgt(*low - 1.0).all() && centre.cmplt(*high + 1.0).all()
                    };
                    scene.truth.at(x, y).unwrap().inner && !lines.iter().any(on_a_line)
                };
                let stray: Vec<_> = others.into_iter().filter(|at| clear(*at)).collect();
                assert_eq!(stray, [], "{who}");
            }
        }
    }
}

#[test]
fn a_pixel_drawn_otherwise_is_found() {
    let size = FrameSize::new(32, 18).unwrap();
    let scene = &scenes(size, 0.5)[0];
    let drawn = draw(executors()[0].as_mut(), scene, size);
    let depth = drawn.output("depth").unwrap();
    let mut other = depth.clone();
    assert_eq!(differing(depth, &other), []);
    other.bytes[4 * (32 * 5 + 7)] ^= 1;
    assert_eq!(differing(depth, &other), [(7, 5)]);
}

/// The comparison must be able to fail: the camera a centimetre from where rays
/// start.
#[test]
fn a_scene_seen_from_elsewhere_is_found() {
    let size = FrameSize::new(160, 90).unwrap();
    let mut scenes = scenes(size, 0.5);
    let scene = scenes
        .iter_mut()
        .find(|scene| scene.name == "stairs")
        .unwrap();
    let pose = scene.camera.pose();
    let moved = Pose::look_at(
        pose.position() + DVec3::new(0.0, 0.0, 0.01),
        pose.position() + pose.orientation() * DVec3::new(0.0, 0.0, -1.0),
        DVec3::Y,
    );
    let mut executors = executors();
    let executor = executors[0].as_mut();
    let rules = Rules::of(executor);
    let good = compare(scene, size, rules, &draw(executor, scene, size));
    let seen = scene.camera;
    let fov = seen.vertical_fov();
    scene.camera = Camera::new(moved.unwrap(), fov)
        .unwrap()
        .moved_from(seen.previous_pose());
    let drawn = draw(executor, scene, size);
    scene.camera = seen;
    let bad = compare(scene, size, rules, &drawn);
    assert!(good.depth <= 4.0 && bad.depth > 40.0, "{good:?}, {bad:?}");
}

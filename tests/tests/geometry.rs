//! What is drawn is what exact rays see: depth, normals and velocity of every
//! model, on every backend.

use etalon::backend::{Backend, Execution};
use etalon::effects::geometry::{Geometry, gbuffer, prepass};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::model::{AlphaMode, Drawable, Model, Snapshot, view};
use etalon_scenes::trace::{SurfacePoint, TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, FrameSize, Pose, models};
use etalon_tests::{executors, plan_for};
use glam::{DVec2, DVec3, DVec4};

/// A model at a time, as rays see what of it is opaque.
struct Scene {
    name: &'static str,
    model: Model,
    snapshot: Snapshot,
    camera: Camera,
    truth: Truth,
}

fn scenes(size: FrameSize) -> Vec<Scene> {
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
        let truth = traced
            .truth(&camera, size, &TruthOptions::default())
            .unwrap();
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
    let kernels = KernelLibrary::new();
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

/// How much of a pixel corners may move to the grid: half a 256th.
const SNAP: f64 = 0.5 / 256.0;

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

fn compare(scene: &Scene, size: FrameSize, drawn: &Execution) -> Found {
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
        found.surfaces += 1;
        let exact = surface.depth as f32;
        let unit = f64::from(exact.next_up() - exact);
        let off = (at(depth)[0] - surface.depth).abs() - SNAP * slope(scene, size, surface);
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
    for scene in &scenes(size) {
        for executor in &mut executors() {
            let drawn = draw(executor.as_mut(), scene, size);
            let found = compare(scene, size, &drawn);
            let who = format!("{} on {}: {found:?}", scene.name, executor.info());
            println!("{who}");
            assert!(found.surfaces > 1000, "{who}");
            assert!(found.depth <= 4.0, "{who}");
            assert!(found.normal <= 0.1, "{who}");
            // Stored as f16: half a unit of the last place of 0.25, and as much
            // again for what moves by less than that.
            assert!(found.velocity <= 0.25 / 2048.0, "{who}");
        }
    }
}

/// The comparison must be able to fail: the camera a centimetre from where rays
/// start.
#[test]
fn a_scene_seen_from_elsewhere_is_found() {
    let size = FrameSize::new(160, 90).unwrap();
    let mut scenes = scenes(size);
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
    let good = compare(scene, size, &draw(executor, scene, size));
    let seen = scene.camera;
    let fov = seen.vertical_fov();
    scene.camera = Camera::new(moved.unwrap(), fov)
        .unwrap()
        .moved_from(seen.previous_pose());
    let drawn = draw(executor, scene, size);
    scene.camera = seen;
    let bad = compare(scene, size, &drawn);
    assert!(good.depth <= 4.0 && bad.depth > 40.0, "{good:?}, {bad:?}");
}

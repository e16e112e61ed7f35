//! What is drawn is what exact rays see: depth, normals and velocity of every
//! model, on every backend.

use etalon::backend::Execution;
use etalon::effects::geometry::{Geometry, gbuffer, prepass};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::model::{AlphaMode, Drawable, Model, Snapshot, view};
use etalon_scenes::trace::{TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, FrameSize, models};
use etalon_tests::{executors, plan_for};

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

fn draw(
    executor: &mut dyn etalon::backend::Backend,
    scene: &Scene,
    size: FrameSize,
    arithmetic: Arithmetic,
) -> Execution {
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
    let plan = plan_for(executor, &graph, &kernels, arithmetic, Capture::Outputs).unwrap();
    executor.execute(&plan, &drawable.inputs()).unwrap()
}

fn texel(image: &ImageData, x: u32, y: u32) -> [f64; 4] {
    image.texel(x, y, 0, 0).unwrap().to_f64()
}

#[test]
fn depth_and_normals_are_those_of_exact_rays() {
    let size = FrameSize::new(320, 180).unwrap();
    for scene in &scenes(size) {
        for executor in &mut [etalon_tests::wgpu().unwrap()] {
            let drawn = draw(executor.as_mut(), scene, size, Arithmetic::Strict);
            let [depth, normal, velocity] =
                ["depth", "normal", "velocity"].map(|name| drawn.output(name).unwrap());
            let (mut inner, mut worst, mut angle, mut moved, mut covered) =
                (0, 0.0_f64, 0.0_f64, 0.0_f64, 0);
            for y in 0..size.height() {
                for x in 0..size.width() {
                    let pixel = scene.truth.at(x, y).unwrap();
                    if !pixel.inner {
                        continue;
                    }
                    inner += 1;
                    let got = f64::from(texel(depth, x, y)[0] as f32);
                    match &pixel.surface {
                        None => assert_eq!(got, 0.0, "{} {x} {y}", scene.name),
                        Some(surface) => {
                            covered += 1;
                            let ulp =
                                f64::from((surface.depth as f32).next_up() - surface.depth as f32);
                            let off = (got - surface.depth).abs() / ulp;
                            if off > worst {
                                worst = off;
                            }
                            let view = scene.camera.pose().view_matrix();
                            let want = view.transform_vector3(surface.normal).normalize();
                            let [a, b, c, _] = texel(normal, x, y);
                            let got = glam::DVec3::new(a, b, c);
                            angle = angle.max(got.angle_between(want).to_degrees());
                            let [a, b, ..] = texel(velocity, x, y);
                            moved = moved.max(
                                (glam::DVec2::new(a, b) - surface.velocity)
                                    .abs()
                                    .max_element(),
                            );
                        }
                    }
                }
            }
            println!(
                "{:12} {}: inner {inner} covered {covered} depth {worst:.1} ulp, normal {angle:.4}°, velocity {moved:.6}",
                scene.name,
                executor.info()
            );
        }
    }
}

//! What a rasteriser should draw, against projections and dense rays.

use crate::common;

use common::{Random, centres, size};
use etalon_scenes::model::{
    Animation, Interpolation, Material, Mesh, Model, ModelParts, Node, Track, Transform, Values,
    Vertices, Viewpoint, shapes,
};
use etalon_scenes::trace::{Faces, TriangleScene, Truth, TruthOptions};
use etalon_scenes::{Camera, Pose};
use glam::{DVec2, DVec3};

fn camera() -> Camera {
    let look = |x: f64| {
        let eye = DVec3::new(x, 1.5, 4.0);
        Pose::look_at(eye, DVec3::new(0.0, 0.5, 0.0), DVec3::Y).unwrap()
    };
    Camera::new(look(0.3), 1.0).unwrap().moved_from(look(0.2))
}

/// A floor, a ball that moves, a box, and a sliver across the picture.
fn model() -> Model {
    let mut parts = ModelParts::default();
    let material = parts.material(Material::dielectric("grey", [0.5; 3], 0.5));
    let floor = parts.mesh(shapes::grid("floor", [6.0, 6.0], [1, 1]).unwrap());
    let ball = parts.mesh(shapes::icosphere("ball", 0.7, 3).unwrap());
    let cube = parts.mesh(shapes::cuboid("cube", [0.4, 0.4, 0.4]).unwrap());
    parts.node(Node::with_part(
        "floor",
        Transform::default(),
        floor,
        material,
    ));
    let moving = parts.node(Node::with_part(
        "ball",
        Transform::default(),
        ball,
        material,
    ));
    let turned = Transform::turned([1.2, 0.4, 0.8], 0.4);
    parts.node(Node::with_part("cube", turned, cube, material));
    let sliver = Vertices {
        positions: vec![[-3.0, 0.3, 1.5], [3.0, 1.2, 1.5], [3.0, 1.2001, 1.5]],
        normals: vec![[0.0, 0.0, 1.0]; 3],
        ..Vertices::default()
    };
    let sliver = parts.mesh(Mesh::new("sliver", sliver, vec![[0, 1, 2]]).unwrap());
    parts.node(Node::with_part(
        "sliver",
        Transform::default(),
        sliver,
        material,
    ));
    parts.animations.push(Animation {
        name: "roll".into(),
        tracks: vec![Track {
            node: moving,
            times: vec![0.0, 1.0],
            interpolation: Interpolation::Linear,
            values: Values::Translation(vec![[-1.0, 0.7, 0.0], [2.0, 0.7, 0.0]]),
        }],
    });
    parts.viewpoints.push(Viewpoint::Fixed(camera()));
    Model::new(parts).unwrap()
}

fn truth(model: &Model, width: u32, height: u32) -> Truth {
    let snapshot = model.at(0.25).unwrap();
    let scene = TriangleScene::new(model, &snapshot).unwrap();
    let camera = snapshot.cameras[0];
    scene
        .truth(&camera, size(width, height), &TruthOptions::default())
        .unwrap()
}

#[test]
fn every_pixel_is_where_the_projection_says() {
    let model = model();
    let snapshot = model.at(0.25).unwrap();
    let truth = truth(&model, 96, 54);
    let camera = camera();
    let projection = camera.projection(truth.size).unwrap();
    let mut seen = [0; 4];
    for (uv, pixel) in centres(truth.size).zip(&truth.pixels) {
        let Some(surface) = pixel.surface else {
            continue;
        };
        let projected = projection
            .project(camera.pose().to_view(surface.world))
            .unwrap();
        // Some twenty roundings on coordinates below 10, over cosines down to 1e-2.
        assert!((projected.uv - uv).length() < 1e-12, "{surface:?}");
        assert!((projected.depth / surface.depth - 1.0).abs() < 1e-12);
        assert!((camera.pose().to_world(surface.view) - surface.world).length() < 1e-13);
        let node = snapshot.instances.all()[surface.instance as usize].node;
        seen[node] += 1;
        // The ball moves by 3 m/s · 1/60 s, in f32; the rest stands.
        let moved = if node == 1 { 0.05 } else { 0.0 };
        let back = surface.world - surface.previous;
        assert!((back - DVec3::X * moved).length() < 1e-6, "{back}");
        let before = projection
            .project(camera.previous_pose().to_view(surface.previous))
            .unwrap();
        assert!((surface.velocity - (uv - before.uv)).length() < 1e-15);
        if node == 0 {
            assert!(surface.world.y.abs() < 1e-14 && surface.normal == DVec3::Y);
            let uv = surface.world.truncate().with_y(surface.world.z) / 6.0 + 0.5;
            assert!((uv - surface.uv[0]).length() < 1e-13);
        }
    }
    assert!(seen[..3].iter().all(|&count| count > 100), "{seen:?}");
}

/// What rays over the square around each pixel's centre hit: the one triangle, or none.
fn same_by_rays(
    scene: &TriangleScene<'_>,
    camera: &Camera,
    truth: &Truth,
    reach: f64,
    steps: i32,
) -> Vec<bool> {
    let projection = camera.projection(truth.size).unwrap();
    let pixel = DVec2::new(
        1.0 / f64::from(truth.size.width()),
        1.0 / f64::from(truth.size.height()),
    );
    centres(truth.size)
        .map(|uv| {
            let id = |i: i32, j: i32| {
                let offset = DVec2::new(f64::from(i), f64::from(j)) / f64::from(steps) * reach;
                let ray = camera.ray(&projection, uv + offset * pixel);
                let hit = scene.intersect(&ray, Faces::Drawn);
                hit.map(|hit| (hit.instance, hit.triangle))
            };
            let middle = id(0, 0);
            (-steps..=steps).all(|i| (-steps..=steps).all(|j| id(i, j) == middle))
        })
        .collect()
}

#[test]
fn inner_pixels_show_one_triangle_all_over() {
    let model = model();
    let snapshot = model.at(0.25).unwrap();
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    let camera = snapshot.cameras[0];
    let truth = truth(&model, 128, 72);
    let inner: Vec<_> = truth.pixels.iter().map(|pixel| pixel.inner).collect();
    for (i, same) in same_by_rays(&scene, &camera, &truth, 0.5, 4)
        .into_iter()
        .enumerate()
    {
        assert!(!inner[i] || same, "pixel {i}");
    }
    // Without the sliver, whose pixels rays cannot tell, the mask leaves out
    // little more than has to be: all that is one triangle in a larger square.
    let scene = TriangleScene::of(&model, &snapshot, |i| i.node != 3).unwrap();
    let truth = scene
        .truth(&camera, truth.size, &TruthOptions::default())
        .unwrap();
    let mut count = 0;
    for (i, same) in same_by_rays(&scene, &camera, &truth, 0.6, 6)
        .into_iter()
        .enumerate()
    {
        if same {
            count += 1;
            // The ball touches the floor in its corner's pixels only.
            assert!(truth.pixels[i].inner, "pixel {i}");
        }
    }
    assert!(count > 4000, "{count}");
}

#[test]
fn slivers_between_pixel_centres_are_not_missed() {
    let model = model();
    let with = truth(&model, 128, 72);
    let snapshot = model.at(0.25).unwrap();
    let scene = TriangleScene::of(&model, &snapshot, |i| i.node != 3).unwrap();
    let without = scene
        .truth(&snapshot.cameras[0], with.size, &TruthOptions::default())
        .unwrap();
    let changed: Vec<_> = (with.pixels.iter().zip(&without.pixels))
        .filter(|(with, without)| with.inner != without.inner)
        .collect();
    // It runs over the whole width: one pixel per column at least, where what
    // is behind is inner.
    assert!(changed.len() > 60, "{}", changed.len());
    assert!(changed.iter().all(|(with, _)| !with.inner));
}

#[test]
fn surfaces_at_one_place_are_not_inner() {
    let mut parts = ModelParts::default();
    let material = parts.material(Material::dielectric("", [0.5; 3], 0.5));
    let quad = parts.mesh(shapes::grid("", [2.0, 2.0], [1, 1]).unwrap());
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, -1.0)] {
        parts.node(Node::with_part(
            "",
            Transform::at([x, y, 0.0]),
            quad,
            material,
        ));
    }
    let model = Model::new(parts).unwrap();
    let snapshot = model.at(0.0).unwrap();
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    let pose = Pose::look_at(DVec3::new(0.0, 5.0, 0.0), DVec3::ZERO, DVec3::NEG_Z).unwrap();
    let camera = Camera::new(pose, 0.5).unwrap();
    let truth = scene
        .truth(&camera, size(64, 64), &TruthOptions::default())
        .unwrap();
    let mut inner = [0; 2];
    for pixel in &truth.pixels {
        if let Some(surface) = pixel.surface
            && surface.world.y == 0.0
        {
            // Two floors lie on each other over x in 0..1, a third far enough below.
            let double = surface.world.x > 0.0 && surface.world.x < 1.0;
            assert!(!(double && pixel.inner), "{surface:?}");
            inner[usize::from(double)] += usize::from(pixel.inner);
        }
    }
    assert!(inner[0] > 500, "{inner:?}");
}

#[test]
fn triangles_across_the_near_plane_are_cut_there() {
    // A floor from behind the eye to far away, and a wall just before the near plane.
    let mut parts = ModelParts::default();
    let material = parts.material(Material::dielectric("", [0.5; 3], 0.5));
    let floor = parts.mesh(shapes::grid("", [2000.0, 2000.0], [1, 1]).unwrap());
    let wall = parts.mesh(shapes::cuboid("", [1.0, 1.0, 0.01]).unwrap());
    parts.node(Node::with_part(
        "",
        Transform::at([3.0, -1.0, 7.0]),
        floor,
        material,
    ));
    parts.node(Node::with_part(
        "",
        Transform::at([0.0, 0.0, -0.05]),
        wall,
        material,
    ));
    let model = Model::new(parts).unwrap();
    let scene_at = model.at(0.0).unwrap();
    let scene = TriangleScene::new(&model, &scene_at).unwrap();
    let camera = Camera::new(
        Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).unwrap(),
        2.0,
    )
    .unwrap();
    let truth = scene
        .truth(&camera, size(64, 64), &TruthOptions::default())
        .unwrap();
    for (i, pixel) in truth.pixels.iter().enumerate() {
        let below = i / 64 >= 32;
        assert_eq!(pixel.surface.is_some(), below, "pixel {i}");
        if let Some(surface) = pixel.surface {
            assert!((surface.world.y + 1.0).abs() < 1e-9 && surface.depth < 1.0);
        }
        // The whole sky, and the floor but for its diagonal and far edge.
        if i / 64 < 31 {
            assert!(pixel.inner, "pixel {i}");
        }
    }
    assert!(
        truth
            .pixels
            .iter()
            .filter(|p| p.inner && p.surface.is_some())
            .count()
            > 1700
    );
    assert!(truth.at(63, 63).is_some() && truth.at(64, 0).is_none() && truth.at(0, 64).is_none());
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let model = model();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| truth(&model, 61, 37))
    };
    let one = with(1);
    assert_eq!(one, with(3));
    // Silly options are no reason to fail.
    let snapshot = model.at(0.25).unwrap();
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    let mut random = Random::new(8);
    for bad in [f64::NAN, -1.0, 0.0, f64::INFINITY, random.within(0.0, 1e9)] {
        let options = TruthOptions {
            clearance: bad,
            separation: bad,
            ..TruthOptions::default()
        };
        let other = scene
            .truth(&snapshot.cameras[0], one.size, &options)
            .unwrap();
        let surfaces = |truth: &Truth| truth.pixels.iter().map(|p| p.surface).collect::<Vec<_>>();
        assert_eq!(surfaces(&one), surfaces(&other));
    }
}

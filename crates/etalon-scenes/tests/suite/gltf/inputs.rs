//! Models that others made. They are not part of the project: the environment
//! variable `ETALON_INPUTS` names the folder whose subfolder `gltf` has them, and
//! without it these tests do nothing but say so.

use crate::common;

use common::{input, size};
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{DrawClass, Model, Moment, tangents};
use etalon_scenes::trace::{Faces, TriangleScene, TruthOptions};
use etalon_scenes::{Camera, Pose};
use glam::{DVec3, Vec3};

fn load(path: &std::path::Path) -> Model {
    load_gltf(path, &GltfOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_helmet_has_what_its_accessors_say() {
    let Some(path) = input("gltf/flight-helmet/FlightHelmet.gltf") else {
        return;
    };
    let model = load(&path);
    let parts = model.parts();
    let json = gltf::json::Root::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let count = |accessor: usize| json.accessors[accessor].count.0 as usize;
    let mut triangles = 0;
    for (mesh, described) in parts.meshes.iter().zip(&json.meshes) {
        let primitive = &described.primitives[0];
        let indices = count(primitive.indices.unwrap().value());
        assert_eq!(mesh.triangles().len() * 3, indices);
        triangles += indices / 3;
        for (semantic, accessor) in &primitive.attributes {
            let v = mesh.vertices();
            let length = match format!("{semantic:?}").as_str() {
                "Valid(Positions)" => v.positions.len(),
                "Valid(Normals)" => v.normals.len(),
                "Valid(Tangents)" => v.tangents.len(),
                "Valid(TexCoords(0))" => v.uv[0].len(),
                other => panic!("{other}"),
            };
            assert_eq!(length, count(accessor.value()));
            // Positions come with their bounds.
            let described = &json.accessors[accessor.value()];
            if let (Some(min), true) = (&described.min, length == v.positions.len()) {
                let low: Vec<f32> = gltf::json::deserialize::from_value(min.clone()).unwrap();
                assert_eq!(mesh.bounds()[0].to_vec(), low);
            }
        }
    }
    assert_eq!((model.triangles(), triangles), (94_722, 94_722));
    assert_eq!(
        (
            parts.meshes.len(),
            parts.materials.len(),
            parts.images.len()
        ),
        (6, 6, 15)
    );
    for (image, described) in parts.images.iter().zip(&json.images) {
        let bytes = std::fs::read(path.with_file_name(described.uri.as_ref().unwrap())).unwrap();
        // The header of a PNG file begins with its size.
        let side = |at: usize| u32::from_be_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
        assert_eq!((image.width(), image.height()), (side(16), side(20)));
    }
    assert!(
        parts
            .materials
            .iter()
            .all(|material| material.normal_texture.is_some())
    );
}

#[test]
fn tangents_made_here_agree_with_the_helmets_own() {
    let Some(path) = input("gltf/flight-helmet/FlightHelmet.gltf") else {
        return;
    };
    let model = load(&path);
    let (mut all, mut signs, mut close) = (0, 0, 0);
    for mesh in &model.parts().meshes {
        let own = &mesh.vertices().tangents;
        for (made, own) in tangents(mesh.vertices(), mesh.triangles(), 0)
            .iter()
            .zip(own)
        {
            all += 1;
            signs += usize::from(made[3] == own[3]);
            let cosine = Vec3::from_slice(made).dot(Vec3::from_slice(own));
            close += usize::from(cosine > 0.95);
        }
    }
    println!("{all} tangents: {signs} of the same sign, {close} within 18°");
    assert!(signs as f64 > 0.99 * f64::from(all), "{signs} of {all}");
    assert!(close as f64 > 0.95 * f64::from(all), "{close} of {all}");
}

#[test]
fn rays_see_the_helmet() {
    let Some(path) = input("gltf/flight-helmet/FlightHelmet.gltf") else {
        return;
    };
    let model = load(&path);
    let snapshot = model.at(0.0).unwrap();
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    println!(
        "{} triangles, {} without area",
        scene.triangles(),
        scene.degenerate()
    );
    let pose = Pose::look_at(
        DVec3::new(0.4, 0.4, 0.7),
        DVec3::new(0.0, 0.3, 0.0),
        DVec3::Y,
    );
    let camera = Camera::new(pose.unwrap(), 0.7).unwrap();
    let truth = scene
        .truth(&camera, size(96, 96), &TruthOptions::default())
        .unwrap();
    let hits = truth
        .pixels
        .iter()
        .filter(|pixel| pixel.surface.is_some())
        .count();
    assert!((1500..9000).contains(&hits), "{hits}");
    let projection = camera.projection(truth.size).unwrap();
    for (i, uv) in common::centres(truth.size).enumerate().step_by(571) {
        let ray = camera.ray(&projection, uv);
        let exhaustive = scene.intersect_exhaustively(&ray, Faces::Drawn);
        assert_eq!(scene.intersect(&ray, Faces::Drawn), exhaustive);
        let seen = truth.pixels[i].surface.map(|s| (s.instance, s.triangle));
        assert_eq!(exhaustive.map(|hit| (hit.instance, hit.triangle)), seen);
    }
}

#[test]
fn the_fox_has_a_skin_and_three_gaits() {
    let Some(path) = input("gltf/fox/fox.glb") else {
        return;
    };
    let model = load(&path);
    let parts = model.parts();
    assert_eq!(model.triangles(), 1728 / 3);
    let mesh = &parts.meshes[0];
    assert_eq!(mesh.joints(), 24);
    assert_eq!(
        (
            parts.skins[0].joints.len(),
            parts.skins[0].inverse_bind.len()
        ),
        (24, 24)
    );
    let names: Vec<_> = parts.animations.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["Survey", "Walk", "Run"]);
    // The file has no normals: each triangle has its own.
    assert_eq!(mesh.vertices().normals.len(), 1728);
    let snapshot = model.at(0.5).unwrap();
    assert_eq!(snapshot.instances.of(DrawClass::Dynamic).len(), 1);
    assert_eq!(snapshot.instances.all()[0].skin, Some(0));
    for (i, animation) in parts.animations.iter().enumerate() {
        assert!(animation.duration() > 0.5, "{}", animation.name);
        let moment = Moment {
            animation: Some(i),
            time: 0.25 * animation.duration(),
            step: 1.0 / 60.0,
        };
        let snapshot = model.at_moment(moment).unwrap();
        assert!(
            snapshot
                .nodes
                .iter()
                .zip(&snapshot.previous)
                .any(|(now, before)| now != before)
        );
        assert!(snapshot.nodes.iter().all(|matrix| matrix.is_finite()));
    }
}

//! The registry of models: what each was made for is there.

use crate::common;

use std::collections::BTreeSet;

use common::size;
use etalon_scenes::model::{DrawClass, Model, Snapshot};
use etalon_scenes::trace::{TriangleScene, Truth, TruthOptions};
use etalon_scenes::{model, models};

fn built(name: &str) -> (Model, Snapshot) {
    let model = (model(name).unwrap().build)().unwrap();
    let snapshot = model.at(0.5).unwrap();
    (model, snapshot)
}

fn truth(model: &Model, snapshot: &Snapshot) -> Truth {
    let scene = TriangleScene::new(model, snapshot).unwrap();
    let options = TruthOptions::default();
    scene
        .truth(&snapshot.cameras[0], size(160, 90), &options)
        .unwrap()
}

/// Which nodes are seen.
fn seen(model: &Model, snapshot: &Snapshot) -> BTreeSet<String> {
    let name = |instance: u32| {
        let node = snapshot.instances.all()[instance as usize].node;
        model.parts().nodes[node].name.clone()
    };
    let truth = truth(model, snapshot);
    truth
        .pixels
        .iter()
        .filter_map(|pixel| Some(name(pixel.surface?.instance)))
        .collect()
}

#[test]
fn every_model_is_seen_and_is_the_same_each_time() {
    for entry in models() {
        assert!(!entry.name.is_empty() && !entry.description.is_empty());
        assert_eq!(model(entry.name).map(|found| found.name), Some(entry.name));
        let (model, snapshot) = built(entry.name);
        assert_eq!((entry.build)().unwrap(), model, "{}", entry.name);
        let truth = truth(&model, &snapshot);
        let surfaces: Vec<_> = truth.pixels.iter().filter_map(|p| p.surface).collect();
        assert!(surfaces.len() > 1000, "{}: {}", entry.name, surfaces.len());
        for surface in surfaces {
            assert!(surface.depth > 0.0 && surface.depth <= 1.0);
            assert!((surface.normal.length() - 1.0).abs() < 1e-12);
            assert!(surface.world.is_finite() && surface.velocity.is_finite());
        }
        let inner = truth.pixels.iter().filter(|p| p.inner).count();
        println!(
            "{}: {inner} of {} pixels are inner",
            entry.name,
            truth.pixels.len()
        );
        assert!(inner > 500, "{}: {inner}", entry.name);
    }
    assert!(model("no such model").is_none());
}

#[test]
fn the_gallery_has_all_materials_lights_and_classes() {
    let (model, snapshot) = built("gallery");
    let materials = &model.parts().materials;
    assert!(
        materials
            .iter()
            .any(|m| m.metallic == 1.0 && m.roughness < 0.2)
    );
    assert!(
        materials
            .iter()
            .any(|m| m.metallic == 0.0 && m.roughness > 0.9)
    );
    assert!(materials.iter().any(|m| m.emissive_strength > 1.0));
    assert!(
        materials
            .iter()
            .any(|m| m.transmission > 0.0 && m.double_sided)
    );
    assert!(materials.iter().any(|m| m.volume.thickness > 0.0));
    assert!(materials.iter().any(|m| m.normal_texture.is_some()));
    assert_eq!(snapshot.lights.len(), 3);
    for class in [DrawClass::Weapon, DrawClass::Static, DrawClass::Dynamic] {
        let instances = snapshot.instances.of(class);
        assert!(!instances.is_empty());
        let moves = instances.iter().any(|i| i.world != i.previous);
        assert_eq!(moves, class != DrawClass::Static);
    }
    let seen = seen(&model, &snapshot);
    for name in [
        "weapon",
        "ball",
        "panes",
        "gold sphere",
        "hammered cube",
        "neon ring",
        "floor",
    ] {
        assert!(seen.contains(name), "{name} is not seen");
    }
    // Behind the panes, which rays take for opaque.
    let opaque = TriangleScene::of(&model, &snapshot, |instance| {
        let name = &model.parts().nodes[instance.node].name;
        name != "panes"
    });
    let camera = &snapshot.cameras[0];
    let behind = (opaque.unwrap()).truth(camera, size(160, 90), &TruthOptions::default());
    assert!(behind.unwrap().pixels.iter().any(|pixel| {
        pixel.surface.is_some_and(|surface| {
            let node = snapshot.instances.all()[surface.instance as usize].node;
            model.parts().nodes[node].name == "amber"
        })
    }));
    // What the camera carries does not move in the picture, but for rounding to f32.
    let truth = truth(&model, &snapshot);
    let weapons = snapshot.instances.of(DrawClass::Weapon).len();
    let (mut still, mut fastest) = (0.0_f64, 0.0_f64);
    for surface in truth.pixels.iter().filter_map(|p| p.surface) {
        let speed = surface.velocity.length();
        if (surface.instance as usize) < weapons {
            still = still.max(speed);
        } else {
            fastest = fastest.max(speed);
        }
    }
    // A unit in the last place of 5.5 m, twice, at a distance of 0.3 m.
    assert!(still < 1e-5 && fastest > 1e-3, "{still} {fastest}");
}

#[test]
fn the_stairs_are_deep() {
    let (model, snapshot) = built("stairs");
    let truth = truth(&model, &snapshot);
    let depths = truth.pixels.iter().filter_map(|p| Some(-p.surface?.view.z));
    let (mut near, mut far) = (f64::INFINITY, 0.0_f64);
    for depth in depths {
        (near, far) = (near.min(depth), far.max(depth));
    }
    assert!(near < 4.0 && far > 8000.0, "{near} {far}");
    assert!(seen(&model, &snapshot).len() > 30);
}

#[test]
fn thin_things_are_never_inner() {
    let (model, snapshot) = built("thin");
    let truth = truth(&model, &snapshot);
    let floor = |instance: u32| snapshot.instances.all()[instance as usize].node == 0;
    let mut thin = 0;
    for pixel in &truth.pixels {
        if let Some(surface) = pixel.surface
            && !floor(surface.instance)
        {
            thin += 1;
            let node = snapshot.instances.all()[surface.instance as usize].node;
            // Needles are as wide as a pixel only at the rim of their disc.
            assert!(!pixel.inner || node == 2, "{surface:?}");
        }
    }
    assert!(thin > 300, "{thin}");
}

#[test]
fn what_is_behind_or_too_near_is_not_seen() {
    let (model, snapshot) = built("crossing");
    let seen = seen(&model, &snapshot);
    for name in ["floor", "shards", "backdrop", "beside"] {
        assert!(seen.contains(name), "{name} is not seen");
    }
    assert!(!seen.contains("unseen") && !seen.contains("around"));
    assert!(
        truth(&model, &snapshot)
            .pixels
            .iter()
            .all(|p| p.surface.is_some())
    );
}

#[test]
fn the_degenerate_model_is() {
    let (model, snapshot) = built("degenerate");
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    // Four in the square, and all of two balls: the line and the point.
    assert!(scene.degenerate() >= 4 + 2 * 320, "{}", scene.degenerate());
    let seen = seen(&model, &snapshot);
    for name in [
        "collapsed",
        "overlap",
        "junction",
        "mirrored",
        "inside out twice",
        "flat",
    ] {
        assert!(seen.contains(name), "{name} is not seen");
    }
    assert!(!seen.contains("line") && !seen.contains("point"));
}

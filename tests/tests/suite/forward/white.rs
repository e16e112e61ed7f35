//! White surfaces in uniform light, and glass.

use etalon::effects::environment::EnvironmentMap;
use etalon_scenes::FrameSize;
use etalon_scenes::model::{
    AlphaMode, Material, Model, ModelParts, Node, Transform, Viewpoint, shapes,
};
use etalon_tests::executors;
use glam::{DMat3, DVec3, Vec3};

use super::scene::{Scene, Sky, pixels, texel};
use super::{by_normal, of_table_and_map};
use crate::shading::{Point, fresnel_mean, mirrored_parts, picture};

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
        map: EnvironmentMap::of_equirectangular(&picture(256, &|_| DVec3::ONE), 32).unwrap(),
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
                let scattered = 0.96 * (1.0 - fresnel_mean(cosine, 32));
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

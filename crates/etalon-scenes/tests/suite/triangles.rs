//! Rays through models' triangles, against every triangle tried in turn and
//! against closed forms.

use crate::common;

use common::Random;
use etalon_scenes::model::{
    Material, Mesh, Model, ModelParts, Node, Snapshot, Transform, Vertices, shapes,
};
use etalon_scenes::trace::{Faces, Ray, TriangleScene, TriangleSceneError};
use glam::{DVec3, Mat4, Quat, Vec3};

fn matte(double_sided: bool) -> Material {
    Material {
        double_sided,
        ..Material::dielectric("matte", [0.5; 3], 1.0)
    }
}

/// Meshes, each in a place of its own.
fn model(meshes: impl IntoIterator<Item = (Mesh, Mat4)>, double_sided: bool) -> Model {
    let mut parts = ModelParts::default();
    let material = parts.material(matte(double_sided));
    for (mesh, place) in meshes {
        let transform = Transform::Matrix(place.to_cols_array());
        let mesh = parts.mesh(mesh);
        parts.node(Node::with_part("", transform, mesh, material));
    }
    Model::new(parts).unwrap()
}

fn posed(model: &Model) -> Snapshot {
    model.at(0.0).unwrap()
}

fn random_place(random: &mut Random) -> Mat4 {
    let rotation =
        Quat::from_axis_angle(random.direction().as_vec3(), random.within(0.0, 6.0) as f32);
    let mut scale = || {
        random.within(0.3, 2.0) as f32
            * if random.bits().is_multiple_of(2) {
                1.0
            } else {
                -1.0
            }
    };
    let scale = Vec3::new(scale(), scale(), scale());
    Mat4::from_scale_rotation_translation(scale, rotation, random.vector(5.0).as_vec3())
}

#[test]
fn the_hierarchy_finds_what_trying_everything_finds() {
    let mut random = Random::new(3);
    let mut hits = 0;
    for round in 0..12 {
        let meshes = [
            shapes::icosphere("a", 1.0, 2).unwrap(),
            shapes::torus("b", 1.0, 0.4, 12, 8).unwrap(),
            shapes::cuboid("c", [0.5, 1.0, 0.2]).unwrap(),
            shapes::panes("d", 2.0, 5, [1.0, 1.0]).unwrap(),
        ]
        .map(|mesh| (mesh, random_place(&mut random)));
        let model = model(meshes, round % 2 == 0);
        let scene = TriangleScene::new(&model, &posed(&model)).unwrap();
        for _ in 0..400 {
            let origin = random.vector(9.0);
            let ray = Ray::new(origin, random.vector(4.0) - origin).starting_at(0.1);
            for faces in [Faces::Drawn, Faces::Both] {
                let found = scene.intersect(&ray, faces);
                assert_eq!(found, scene.intersect_exhaustively(&ray, faces));
                hits += usize::from(found.is_some());
            }
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn a_hit_says_where_and_what_it_is() {
    // A floor at y = 2, turned and stretched, seen from above and from below.
    let place = Mat4::from_scale_rotation_translation(
        Vec3::new(2.0, 1.0, 3.0),
        Quat::IDENTITY,
        Vec3::new(1.0, 2.0, -1.0),
    );
    let floor = shapes::grid("floor", [4.0, 2.0], [8, 4]).unwrap();
    let model = model([(floor, place)], false);
    let scene = TriangleScene::new(&model, &posed(&model)).unwrap();
    let mut random = Random::new(4);
    for _ in 0..2000 {
        let (u, v) = (random.within(0.001, 0.999), random.within(0.001, 0.999));
        let target = DVec3::new(1.0 + (u - 0.5) * 8.0, 2.0, -1.0 + (v - 0.5) * 6.0);
        let mut out = random.direction();
        if out.y.abs() < 0.1 {
            continue;
        }
        for side in [1.0, -1.0] {
            out.y = out.y.abs() * side;
            let ray = Ray::new(target + out * 7.0, -out);
            let hit = scene.intersect(&ray, Faces::Both).unwrap();
            // Distances are below 20 and cosines over 0.1: ten roundings.
            assert!((hit.t - 7.0).abs() < 1e-13, "{hit:?}");
            assert!(hit.position.distance(target) < 1e-13);
            // The grid's texture coordinates are rounded to f32.
            assert!((hit.uv[0].x - u).abs() < 1e-7 && (hit.uv[0].y - v).abs() < 1e-7);
            assert_eq!(hit.uv[1], glam::DVec2::ZERO);
            assert_eq!((hit.normal, hit.geometric_normal), (DVec3::Y, DVec3::Y));
            assert_eq!(hit.front, side > 0.0);
            assert!((hit.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(hit.weights.iter().all(|&w| w >= 0.0));
            let corners = model.parts().meshes[0].triangles()[hit.triangle as usize];
            let positions = &model.parts().meshes[0].vertices().positions;
            let mixed: DVec3 = (corners.iter().zip(hit.weights))
                .map(|(&i, w)| DVec3::from_array(positions[i as usize].map(f64::from)) * w)
                .sum();
            let mixed = place.as_dmat4().transform_point3(mixed);
            assert!(mixed.distance(target) < 1e-13);
            assert_eq!(scene.intersect(&ray, Faces::Drawn).is_some(), side > 0.0);
        }
    }
}

#[test]
fn a_sphere_of_triangles_is_nearly_a_sphere() {
    let subdivisions = 5;
    let model = model(
        [(
            shapes::icosphere("ball", 2.0, subdivisions).unwrap(),
            Mat4::IDENTITY,
        )],
        false,
    );
    let scene = TriangleScene::new(&model, &posed(&model)).unwrap();
    // The longest edges of the icosahedron's faces after n cuts: an angle of
    // at most 1.26 · 63.4° / 2ⁿ. A triangle's middle is within an edge/√3 of a corner.
    let angle = 1.26 * 63.435_f64.to_radians() / f64::from(1 << subdivisions) / 3.0_f64.sqrt();
    let mut random = Random::new(5);
    for _ in 0..3000 {
        let out = random.direction();
        let hit = scene
            .intersect(&Ray::new(out * 10.0, -out), Faces::Drawn)
            .unwrap();
        let short = hit.t - 8.0;
        assert!(
            (-1e-6..2.0 * (1.0 - angle.cos()) + 1e-6).contains(&short),
            "{short}"
        );
        assert!(hit.front);
        assert!(hit.geometric_normal.dot(out) > angle.cos() - 1e-6);
        // Interpolated, normals err by the square of the angle only.
        assert!(hit.normal.dot(out) > (angle * angle).cos() - 1e-6);
    }
}

#[test]
fn nothing_leaks_through_edges_and_corners() {
    let mut random = Random::new(6);
    for mesh in [
        shapes::icosphere("ball", 1.0, 2).unwrap(),
        shapes::torus("ring", 1.0, 0.3, 24, 12).unwrap(),
        shapes::cuboid("box", [1.0, 0.5, 0.25]).unwrap(),
        shapes::cone("cone", 1.0, 2.0, 17).unwrap(),
    ] {
        let place = random_place(&mut random);
        let model = model([(mesh, place)], false);
        let scene = TriangleScene::new(&model, &posed(&model)).unwrap();
        let mesh = &model.parts().meshes[0];
        let world = |i: u32| {
            let p = mesh.vertices().positions[i as usize];
            place
                .as_dmat4()
                .transform_point3(DVec3::from_array(p.map(f64::from)))
        };
        for triangle in mesh.triangles() {
            let [a, b, c] = triangle.map(world);
            let middle = (a + b + c) / 3.0;
            let normal = (b - a).cross(c - a).normalize() * place.determinant().signum() as f64;
            // From close inside, where nothing else is between.
            let inside = middle - normal * 1e-3;
            for target in [
                a,
                b,
                c,
                (a + b) * 0.5,
                b + (c - b) * random.within(0.0, 1.0),
            ] {
                let ray = Ray::new(inside, target - inside);
                let hit = scene.intersect(&ray, Faces::Both);
                let hit = hit.unwrap_or_else(|| panic!("{}: leak at {target}", mesh.name()));
                // Rounding may take the ray past the edge, to a neighbour;
                // past the reflex edges of the ring it stays inside.
                let convex = mesh.name() != "ring";
                assert!(
                    hit.t < 1.0 + 1e-6 || !convex,
                    "{}: {hit:?} beyond {target}",
                    mesh.name()
                );
            }
        }
        // From outside: something of a closed body is hit wherever one of its
        // points is aimed at, unless the ray grazes its silhouette.
        for _ in 0..2000 {
            let triangle = mesh.triangles()[random.bits() as usize % mesh.triangles().len()];
            let [a, b, c] = triangle.map(world);
            let normal = (b - a).cross(c - a).normalize() * place.determinant().signum() as f64;
            let target = [a, (a + b) * 0.5, (b + c) * 0.5][random.bits() as usize % 3];
            let origin = target + random.direction() * 30.0;
            let neighbours = mesh.triangles().iter().filter(|t| {
                t.iter()
                    .any(|&i| (world(i) - a).length() < 1e-9 || (world(i) - b).length() < 1e-9)
            });
            let grazing = neighbours.into_iter().any(|t| {
                let [p, q, r] = t.map(world);
                let n = (q - p).cross(r - p).normalize();
                (origin - target).normalize().dot(n)
                    * (origin - target).normalize().dot(normal)
                    * place.determinant().signum() as f64
                    <= 1e-4
            });
            if !grazing {
                let ray = Ray::new(origin, target - origin);
                let hit = scene.intersect(&ray, Faces::Both).expect("no leak");
                assert!(hit.t < 1.0 + 1e-9);
            }
        }
    }
}

#[test]
fn mirrored_instances_keep_their_front_outside() {
    let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let model = model(
        [(shapes::icosphere("ball", 1.0, 2).unwrap(), mirror)],
        false,
    );
    let snapshot = posed(&model);
    assert!(snapshot.instances.all()[0].mirrored());
    let scene = TriangleScene::new(&model, &snapshot).unwrap();
    let mut random = Random::new(7);
    for _ in 0..500 {
        let out = random.direction();
        let hit = scene
            .intersect(&Ray::new(out * 4.0, -out), Faces::Drawn)
            .unwrap();
        assert!(hit.front && hit.t < 3.1);
        assert!(hit.geometric_normal.dot(out) > 0.9 && hit.normal.dot(out) > 0.9);
        // From inside only back faces: culled.
        assert!(
            scene
                .intersect(&Ray::new(DVec3::ZERO, out), Faces::Drawn)
                .is_none()
        );
        assert!(
            !scene
                .intersect(&Ray::new(DVec3::ZERO, out), Faces::Both)
                .unwrap()
                .front
        );
    }
}

#[test]
fn triangles_without_area_are_left_out() {
    let vertices = Vertices {
        positions: vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [2.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
        ],
        normals: vec![[0.0, 0.0, 1.0]; 5],
        ..Vertices::default()
    };
    let triangles = vec![[0, 1, 2], [0, 0, 1], [0, 1, 3], [1, 4, 2]];
    let mesh = Mesh::new("m", vertices, triangles).unwrap();
    // The same flattened to a line by its place.
    let line = Mat4::from_scale(Vec3::new(1.0, 0.0, 0.0));
    let model = model([(mesh.clone(), Mat4::IDENTITY), (mesh, line)], true);
    let scene = TriangleScene::new(&model, &posed(&model)).unwrap();
    assert_eq!((scene.triangles(), scene.degenerate()), (1, 7));
    let ray = Ray::new(DVec3::new(0.2, 0.2, 3.0), DVec3::NEG_Z);
    assert_eq!(scene.intersect(&ray, Faces::Drawn).unwrap().t, 3.0);
    // Rays that are no rays hit nothing.
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        assert!(
            scene
                .intersect(&Ray::new(DVec3::new(0.2, 0.2, 3.0), bad), Faces::Both)
                .is_none()
        );
        assert!(
            scene
                .intersect(&Ray::new(DVec3::NAN, bad), Faces::Both)
                .is_none()
        );
    }
}

#[test]
fn instances_keep_their_ids_when_others_are_left_out() {
    let at = |z: f32| Mat4::from_translation(Vec3::new(0.0, 0.0, z));
    let quad = || shapes::cuboid("box", [1.0, 1.0, 0.1]).unwrap();
    let model = model([(quad(), at(0.0)), (quad(), at(-2.0))], false);
    let snapshot = posed(&model);
    let scene = TriangleScene::of(&model, &snapshot, |i| i.node == 1).unwrap();
    let hit = scene
        .intersect(&Ray::new(DVec3::Z * 5.0, DVec3::NEG_Z), Faces::Drawn)
        .unwrap();
    assert_eq!(hit.instance, 1);
    let other = Model::new(ModelParts::default()).unwrap();
    assert!(matches!(
        TriangleScene::new(&other, &snapshot).err(),
        Some(TriangleSceneError::Foreign {
            instance: 0,
            what: "mesh",
            index: 0,
            count: 0
        })
    ));
}

//! Intersections against answers known by construction: a point on the surface
//! is chosen first and a ray is sent there.

mod common;

use common::Random;
use etalon_scenes::trace::{Hit, Material, Mesh, Ray, Scene, SceneBuilder, SceneError, Shape};
use glam::{DMat3, DQuat, DVec3};

fn scene(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    let mut builder = SceneBuilder::new();
    for shape in shapes {
        builder.object(shape, Material::matte(DVec3::ONE));
    }
    builder.build().unwrap()
}

/// A shape with a random place and size, a point of its surface and the outward
/// normal there.
fn sample(random: &mut Random, kind: usize) -> (Shape, DVec3, DVec3) {
    let center = random.vector(10.0);
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(random.direction(), random.within(0.0, 6.0)));
    match kind {
        0 => {
            let q = center + rotation.x_axis * random.within(-5.0, 5.0) + rotation.y_axis * random.within(-5.0, 5.0);
            (Shape::Plane { point: center, normal: rotation.z_axis * 3.0 }, q, rotation.z_axis)
        }
        1 => {
            let (u, v) = (rotation.x_axis * random.within(0.5, 3.0), rotation.y_axis * random.within(0.5, 3.0));
            let q = center + u * random.within(-0.999, 0.999) + v * random.within(-0.999, 0.999);
            (Shape::Rectangle { center, half_u: u, half_v: v }, q, rotation.z_axis)
        }
        2 => {
            let radius = random.within(0.5, 3.0);
            let (r, angle) = (radius * random.within(0.0, 0.999), random.within(0.0, 6.0));
            let q = center + rotation * DVec3::new(r * angle.cos(), r * angle.sin(), 0.0);
            (Shape::Disc { center, normal: rotation.z_axis, radius }, q, rotation.z_axis)
        }
        3 => {
            let (radius, normal) = (random.within(0.1, 5.0), random.direction());
            (Shape::Sphere { center, radius }, center + normal * radius, normal)
        }
        4 => {
            let half = DVec3::new(random.within(0.2, 3.0), random.within(0.2, 3.0), random.within(0.2, 3.0));
            let axis = random.bits() as usize % 3;
            let sign = if random.bits() % 2 == 0 { 1.0 } else { -1.0 };
            let mut local = half * DVec3::new(random.within(-0.999, 0.999), random.within(-0.999, 0.999), random.within(-0.999, 0.999));
            local[axis] = sign * half[axis];
            (Shape::Box { center, half, orientation: rotation }, center + rotation * local, rotation.col(axis) * sign)
        }
        _ => {
            let corners = [center, center + rotation.x_axis * 2.0, center + rotation.y_axis * 1.5 + rotation.x_axis * 0.3];
            let (mut u, mut v) = (random.within(0.001, 0.999), random.within(0.001, 0.999));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let q = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let mesh = Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]] };
            (Shape::Mesh(mesh), q, rotation.z_axis)
        }
    }
}

#[test]
fn every_shape_is_hit_where_it_is() {
    let mut random = Random::new(1);
    for round in 0..12_000 {
        let kind = round % 6;
        let (shape, q, normal) = sample(&mut random, kind);
        let mut out = random.direction();
        if out.dot(normal) < 0.0 {
            out = -out;
        }
        // At grazing angles any error is divided by the cosine.
        if out.dot(normal) < 0.2 {
            continue;
        }
        let (distance, speed) = (random.within(0.1, 100.0), random.within(0.1, 10.0));
        let ray = Ray::new(q + out * distance, -out * speed);
        let hit = scene([shape.clone()]).intersect(&ray).unwrap_or_else(|| panic!("{shape:?} missed by {ray:?}"));
        // Coordinates are below 120, so one rounding is under 1.5e-14; some
        // ten of them over the cosine remain below 1e-12 of the distance, or of
        // the coordinates where those are larger.
        let scale = distance.max(10.0);
        assert!((hit.t * speed - distance).abs() < 1e-12 * scale, "{shape:?}: {hit:?}");
        assert!(hit.position.distance(q) < 1e-12 * scale, "{shape:?}: {hit:?}, not {q}");
        assert!((hit.normal - normal).length() < 1e-11, "{shape:?}: {hit:?}, not {normal}");
        assert!((hit.normal.length() - 1.0).abs() < 1e-14);
        // Not beyond what is looked for, and not before where the ray starts.
        let scene = scene([shape]);
        assert!(scene.occluded(&ray, hit.t * 1.001) && !scene.occluded(&ray, hit.t * 0.999));
    }
}

#[test]
fn rays_beside_a_shape_miss_it() {
    let mut random = Random::new(2);
    for _ in 0..3000 {
        let (center, radius, normal) = (random.vector(10.0), random.within(0.1, 5.0), random.direction());
        let tangent = normal.any_orthonormal_vector();
        for (factor, hits) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
            let ray = Ray::new(center + normal * (radius * factor) - tangent * 30.0, tangent);
            let sphere = scene([Shape::Sphere { center, radius }]);
            assert_eq!(sphere.intersect(&ray).is_some(), hits);
            let disc = scene([Shape::Disc { center, normal: tangent, radius }]);
            assert_eq!(disc.intersect(&ray).is_some(), hits);
        }
        let half = DVec3::new(1.0, 2.0, 3.0);
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(normal, radius));
        for (factor, hits) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
            let ray = Ray::new(center + rotation * DVec3::new(half.x * factor, 0.5, 40.0), rotation * DVec3::NEG_Z);
            let cuboid = scene([Shape::Box { center, half, orientation: rotation }]);
            assert_eq!(cuboid.intersect(&ray).is_some(), hits);
            let rectangle = Shape::Rectangle { center, half_u: rotation.x_axis, half_v: rotation.y_axis * 2.0 };
            assert_eq!(scene([rectangle]).intersect(&ray).is_some(), hits);
        }
    }
}

#[test]
fn a_far_sphere_is_hit_as_precisely_as_a_near_one() {
    // The textbook formula subtracts squares of 1e14 and is off by about 1e-2.
    let distance = 1e7;
    let sphere = scene([Shape::Sphere { center: DVec3::ZERO, radius: 1.0 }]);
    for offset in [0.0, 0.3, 0.9, 0.999] {
        let ray = Ray::new(DVec3::new(offset, 0.0, distance), DVec3::NEG_Z);
        let hit = sphere.intersect(&ray).unwrap();
        let expected = DVec3::new(offset, 0.0, (1.0_f64 - offset * offset).sqrt());
        // One unit in the last place of t is 1.9e-9; the cosine is at least 0.04.
        assert!(hit.position.distance(expected) < 1e-7, "{hit:?}, not {expected}");
        assert!((hit.t - (distance - expected.z)).abs() < 1e-7);
    }
}

#[test]
fn no_ray_meets_the_surface_it_leaves() {
    let mut random = Random::new(3);
    for round in 0..12_000 {
        let (shape, q, normal) = sample(&mut random, round % 6);
        // Far from the origin a fixed offset would be too small; here there is none.
        let shift = if round % 2 == 0 { DVec3::ZERO } else { random.vector(1e6) };
        let scene = scene([moved(shape, shift)]);
        let Some(hit) = scene.intersect(&Ray::new(q + shift + normal * 3.0, -normal)) else {
            panic!("missed");
        };
        let mut out = random.direction();
        if out.dot(hit.normal) < 0.0 {
            out = -out;
        }
        assert_eq!(scene.intersect(&hit.ray(out)), None);
        assert!(!scene.occluded(&hit.ray(out), f64::INFINITY));
    }
}

fn moved(shape: Shape, shift: DVec3) -> Shape {
    match shape {
        Shape::Plane { point, normal } => Shape::Plane { point: point + shift, normal },
        Shape::Rectangle { center, half_u, half_v } => Shape::Rectangle { center: center + shift, half_u, half_v },
        Shape::Disc { center, normal, radius } => Shape::Disc { center: center + shift, normal, radius },
        Shape::Sphere { center, radius } => Shape::Sphere { center: center + shift, radius },
        Shape::Box { center, half, orientation } => Shape::Box { center: center + shift, half, orientation },
        Shape::Mesh(mut mesh) => {
            mesh.positions.iter_mut().for_each(|position| *position += shift);
            Shape::Mesh(mesh)
        }
        other => other,
    }
}

#[test]
fn rays_into_a_solid_meet_its_far_side() {
    let mut random = Random::new(4);
    for _ in 0..2000 {
        let (center, radius) = (random.vector(10.0), random.within(0.1, 5.0));
        let sphere = scene([Shape::Sphere { center, radius }]);
        let start = random.direction();
        let hit = sphere.intersect(&Ray::new(center + start * (radius * 3.0), -start)).unwrap();
        let mut inward = random.direction();
        if inward.dot(hit.normal) > 0.0 {
            inward = -inward;
        }
        let chord = sphere.intersect(&hit.ray(inward)).unwrap();
        let expected = -2.0 * radius * inward.dot(start);
        assert!((chord.t - expected).abs() < 1e-12 * radius.max(1.0), "{} not {expected}", chord.t);
        // The normal is on the side the ray comes from: inside.
        assert!(chord.normal.dot(chord.position - center) < 0.0);
    }
    let cuboid = scene([Shape::aligned_box(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0))]);
    let hit = cuboid.intersect(&Ray::new(DVec3::new(0.25, 0.5, 9.0), DVec3::NEG_Z)).unwrap();
    let through = cuboid.intersect(&hit.ray(DVec3::NEG_Z)).unwrap();
    assert_eq!((through.t, through.position.z, through.normal), (6.0, -3.0, DVec3::Z));
}

#[test]
fn starts_are_respected() {
    let sphere = scene([Shape::Sphere { center: DVec3::ZERO, radius: 1.0 }]);
    let ray = Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z);
    assert_eq!(sphere.intersect(&ray).unwrap().t, 4.0);
    assert_eq!(sphere.intersect(&ray.starting_at(4.5)).unwrap().t, 6.0);
    assert_eq!(sphere.intersect(&ray.starting_at(6.5)), None);
    assert_eq!(sphere.intersect(&Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::Z)), None);
}

/// Triangles, spheres, boxes, discs and rectangles anywhere, and one plane.
fn clutter(random: &mut Random) -> Vec<Shape> {
    let mut shapes = vec![Shape::Plane { point: DVec3::NEG_Y * 11.0, normal: DVec3::Y }];
    for round in 0..300 {
        shapes.push(sample(random, 1 + round % 5).0);
        let corner = random.vector(10.0);
        let (a, b) = (corner + random.vector(2.0), corner + random.vector(2.0));
        shapes.push(Shape::Mesh(Mesh { positions: vec![corner, a, b], triangles: vec![[0, 1, 2]] }));
    }
    // Twice the same: of equal hits the first object counts.
    let copies: Vec<_> = shapes[1..40].to_vec();
    shapes.extend(copies);
    shapes
}

#[test]
fn the_hierarchy_finds_exactly_what_trying_everything_finds() {
    let mut random = Random::new(5);
    let scene = scene(clutter(&mut random));
    let mut hits = 0;
    let mut last: Option<Hit> = None;
    for round in 0..20_000 {
        let mut direction = random.direction();
        if round % 5 == 0 {
            // Along the axes, where a slab's inverse direction is infinite.
            let axis = random.bits() as usize % 3;
            direction = DVec3::ZERO;
            direction[axis] = if round % 2 == 0 { 1.0 } else { -1.0 };
        }
        let ray = match last {
            Some(hit) if round % 3 == 0 => hit.ray(direction),
            _ => Ray::new(random.vector(14.0), direction),
        };
        last = scene.intersect(&ray);
        assert_eq!(last, scene.intersect_exhaustively(&ray), "{ray:?}");
        let end = random.within(0.0, 20.0);
        let blocked = last.is_some_and(|hit| hit.t < end);
        assert_eq!(scene.occluded(&ray, end), blocked, "{ray:?} up to {end}");
        hits += usize::from(last.is_some());
    }
    assert!((10_000..20_000).contains(&hits), "{hits} rays hit something");
}

#[test]
fn no_ray_slips_through_a_closed_mesh() {
    let solids = [
        Mesh::icosahedron(DVec3::new(0.1, 0.2, 0.3), 1.0),
        Mesh::knot(DVec3::ZERO, 1.0, 0.3, 64, 12),
    ];
    for mesh in solids {
        let scene = scene([Shape::Mesh(mesh.clone())]);
        let mut random = Random::new(6);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let normal = (b - a).cross(c - a).normalize();
            // Edges and corners exactly, as far as f64 can aim.
            for target in [a, b, c, 0.5 * (a + b), 0.5 * (b + c), a + (c - a) * random.within(0.0, 1.0)] {
                let outside = target + (normal + random.direction() * 0.3) * 4.0;
                let direction = target - outside;
                let hit = scene.intersect(&Ray::new(outside, direction));
                assert!(hit.is_some_and(|hit| hit.t < 1.0 + 1e-9), "a gap at {target}");
            }
        }
    }
}

#[test]
fn solids_are_closed_and_point_outwards() {
    // By the divergence theorem the sum of a · (b × c) / 6 is the volume.
    let volume = |mesh: &Mesh| -> f64 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum()
    };
    let mesh = Mesh::icosahedron(DVec3::ZERO, 1.0);
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (12, 20));
    // Volume of the icosahedron of edge a: 5 (3 + √5) a³ / 12, a = 1 / sin(2π/5).
    let edge = 1.0 / (0.4 * std::f64::consts::PI).sin();
    let expected = 5.0 * (3.0 + 5.0_f64.sqrt()) / 12.0 * edge.powi(3);
    let absolute: f64 = (mesh.triangles.iter())
        .map(|&[a, b, c]| {
            let corner = |i: u32| mesh.positions[i as usize];
            (corner(a).dot(corner(b).cross(corner(c))) / 6.0).abs()
        })
        .sum();
    assert!((absolute / expected - 1.0).abs() < 1e-12, "{absolute}, not {expected}");
    // A tube's volume is its length times its section (Pappus); the length is
    // that of the knot's closed polygon here, the section that of a polygon.
    let (around, across, tube) = (600, 40, 0.05);
    let mesh = Mesh::knot(DVec3::ZERO, 1.0, tube, around, across);
    let ring = |i: u32| {
        let from = (i % around * across) as usize;
        mesh.positions[from..from + across as usize].iter().sum::<DVec3>() / f64::from(across)
    };
    let length: f64 = (0..around).map(|i| ring(i).distance(ring(i + 1))).sum();
    let section = 0.5 * f64::from(across) * tube * tube * (std::f64::consts::TAU / f64::from(across)).sin();
    assert!((volume(&mesh).abs() / (length * section) - 1.0).abs() < 0.01, "{} {}", volume(&mesh), length * section);
}

#[test]
fn invalid_objects_and_lights_are_refused() {
    use etalon_scenes::trace::Light;
    let bad = |shape: Shape| {
        let mut builder = SceneBuilder::new();
        builder.object(Shape::aligned_box(DVec3::ZERO, DVec3::ONE), Material::matte(DVec3::ONE));
        builder.object(shape, Material::matte(DVec3::ONE));
        builder.build().unwrap_err()
    };
    let nan = DVec3::new(0.0, f64::NAN, 0.0);
    for shape in [
        Shape::Plane { point: nan, normal: DVec3::Y },
        Shape::Plane { point: DVec3::ZERO, normal: DVec3::ZERO },
        Shape::Rectangle { center: DVec3::ZERO, half_u: DVec3::X, half_v: DVec3::new(1.0, 1.0, 0.0) },
        Shape::Rectangle { center: DVec3::ZERO, half_u: DVec3::X, half_v: DVec3::ZERO },
        Shape::Disc { center: DVec3::ZERO, normal: DVec3::Y, radius: f64::INFINITY },
        Shape::Sphere { center: DVec3::ZERO, radius: 0.0 },
        Shape::Sphere { center: DVec3::ZERO, radius: -1.0 },
        Shape::Sphere { center: DVec3::ZERO, radius: f64::NAN },
        Shape::aligned_box(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)),
        Shape::Box { center: DVec3::ZERO, half: DVec3::ONE, orientation: DMat3::from_diagonal(DVec3::splat(2.0)) },
        Shape::Mesh(Mesh { positions: vec![nan], triangles: vec![] }),
    ] {
        let error = bad(shape.clone());
        assert!(matches!(error, SceneError::Value { which: "object", index: 1, .. }), "{shape:?}: {error}");
    }
    let error = bad(Shape::Mesh(Mesh { positions: vec![DVec3::ZERO; 2], triangles: vec![[0, 1, 2]] }));
    assert_eq!(error, SceneError::Corner { object: 1, triangle: 0, corner: 2, corners: 2 });

    let mut builder = SceneBuilder::new();
    builder.light(Light::Directional { towards: DVec3::ZERO, irradiance: DVec3::ONE });
    assert!(matches!(builder.build(), Err(SceneError::Value { which: "light", index: 0, .. })));

    // Triangles without area are no error: meshes have them. Nothing hits them.
    let flat = Mesh { positions: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], triangles: vec![[0, 1, 2], [0, 0, 0]] };
    let scene = scene([Shape::Mesh(flat)]);
    assert_eq!(scene.intersect(&Ray::new(DVec3::new(0.5, 0.0, 1.0), DVec3::NEG_Z)), None);
}

#[test]
fn senseless_rays_hit_nothing() {
    let mut random = Random::new(7);
    let scene = scene(clutter(&mut random));
    let inf = f64::INFINITY;
    for ray in [
        Ray::new(DVec3::splat(f64::NAN), DVec3::X),
        Ray::new(DVec3::splat(0.1), DVec3::splat(f64::NAN)),
        Ray::new(DVec3::splat(0.1), DVec3::ZERO),
        Ray::new(DVec3::splat(inf), DVec3::X),
        Ray::new(DVec3::splat(0.1), DVec3::X).starting_at(inf),
        Ray::new(DVec3::splat(0.1), DVec3::X).starting_at(f64::NAN),
    ] {
        assert_eq!(scene.intersect(&ray), None, "{ray:?}");
        assert_eq!(scene.intersect_exhaustively(&ray), None, "{ray:?}");
    }
}

//! Whole scenes: the hierarchy, meshes and what is refused.

use crate::common;

use common::Random;
use common::shapes::{sample, scene};
use etalon_scenes::trace::{Hit, Light, Material, Mesh, Ray, SceneBuilder, SceneError, Shape};
use glam::{DMat3, DVec3};

/// Triangles, spheres, boxes, discs and rectangles anywhere, and one plane.
fn clutter(random: &mut Random) -> Vec<Shape> {
    let mut shapes = vec![Shape::Plane {
        point: DVec3::NEG_Y * 11.0,
        normal: DVec3::Y,
    }];
    for round in 0..300 {
        shapes.push(sample(random, 1 + round % 5).0);
        let corner = random.vector(10.0);
        let (a, b) = (corner + random.vector(2.0), corner + random.vector(2.0));
        shapes.push(Shape::Mesh(Mesh {
            positions: vec![corner, a, b],
            triangles: vec![[0, 1, 2]],
        }));
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
    assert!(
        (10_000..20_000).contains(&hits),
        "{hits} rays hit something"
    );
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
            for target in [
                a,
                b,
                c,
                0.5 * (a + b),
                0.5 * (b + c),
                a + (c - a) * random.within(0.0, 1.0),
            ] {
                let outside = target + (normal + random.direction() * 0.3) * 4.0;
                let direction = target - outside;
                let hit = scene.intersect(&Ray::new(outside, direction));
                assert!(
                    hit.is_some_and(|hit| hit.t < 1.0 + 1e-9),
                    "a gap at {target}"
                );
            }
        }
    }
}

#[test]
fn solids_are_closed_and_point_outwards() {
    // By the divergence theorem the sum of a · (b × c) / 6 is the volume.
    let volume = |mesh: &Mesh| -> f64 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles
            .iter()
            .map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0)
            .sum()
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
    assert!(
        (absolute / expected - 1.0).abs() < 1e-12,
        "{absolute}, not {expected}"
    );
    // A tube's volume is its length times its section (Pappus); the length is
    // that of the knot's closed polygon here, the section that of a polygon.
    let (around, across, tube) = (600, 40, 0.05);
    let mesh = Mesh::knot(DVec3::ZERO, 1.0, tube, around, across);
    let ring = |i: u32| {
        let from = (i % around * across) as usize;
        mesh.positions[from..from + across as usize]
            .iter()
            .sum::<DVec3>()
            / f64::from(across)
    };
    let length: f64 = (0..around).map(|i| ring(i).distance(ring(i + 1))).sum();
    let section =
        0.5 * f64::from(across) * tube * tube * (std::f64::consts::TAU / f64::from(across)).sin();
    assert!(
        (volume(&mesh).abs() / (length * section) - 1.0).abs() < 0.01,
        "{} {}",
        volume(&mesh),
        length * section
    );
}

#[test]
fn invalid_objects_and_lights_are_refused() {
    let bad = |shape: Shape| {
        let mut builder = SceneBuilder::new();
        builder.object(
            Shape::aligned_box(DVec3::ZERO, DVec3::ONE),
            Material::matte(DVec3::ONE),
        );
        builder.object(shape, Material::matte(DVec3::ONE));
        builder.build().unwrap_err()
    };
    let nan = DVec3::new(0.0, f64::NAN, 0.0);
    for shape in [
        Shape::Plane {
            point: nan,
            normal: DVec3::Y,
        },
        Shape::Plane {
            point: DVec3::ZERO,
            normal: DVec3::ZERO,
        },
        Shape::Rectangle {
            center: DVec3::ZERO,
            half_u: DVec3::X,
            half_v: DVec3::new(1.0, 1.0, 0.0),
        },
        Shape::Rectangle {
            center: DVec3::ZERO,
            half_u: DVec3::X,
            half_v: DVec3::ZERO,
        },
        Shape::Disc {
            center: DVec3::ZERO,
            normal: DVec3::Y,
            radius: f64::INFINITY,
        },
        Shape::Sphere {
            center: DVec3::ZERO,
            radius: 0.0,
        },
        Shape::Sphere {
            center: DVec3::ZERO,
            radius: -1.0,
        },
        Shape::Sphere {
            center: DVec3::ZERO,
            radius: f64::NAN,
        },
        Shape::aligned_box(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)),
        Shape::Box {
            center: DVec3::ZERO,
            half: DVec3::ONE,
            orientation: DMat3::from_diagonal(DVec3::splat(2.0)),
        },
        Shape::Mesh(Mesh {
            positions: vec![nan],
            triangles: vec![],
        }),
    ] {
        let error = bad(shape.clone());
        assert!(
            matches!(
                error,
                SceneError::Value {
                    which: "object",
                    index: 1,
                    ..
                }
            ),
            "{shape:?}: {error}"
        );
    }
    let error = bad(Shape::Mesh(Mesh {
        positions: vec![DVec3::ZERO; 2],
        triangles: vec![[0, 1, 2]],
    }));
    assert_eq!(
        error,
        SceneError::Corner {
            object: 1,
            triangle: 0,
            corner: 2,
            corners: 2
        }
    );

    let mut builder = SceneBuilder::new();
    builder.light(Light::Directional {
        towards: DVec3::ZERO,
        irradiance: DVec3::ONE,
    });
    assert!(matches!(
        builder.build(),
        Err(SceneError::Value {
            which: "light",
            index: 0,
            ..
        })
    ));

    // Triangles without area are no error: meshes have them. Nothing hits them.
    let flat = Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0],
        triangles: vec![[0, 1, 2], [0, 0, 0]],
    };
    let scene = scene([Shape::Mesh(flat)]);
    assert_eq!(
        scene.intersect(&Ray::new(DVec3::new(0.5, 0.0, 1.0), DVec3::NEG_Z)),
        None
    );
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

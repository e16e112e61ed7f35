//! Intersections against answers known by construction: a point on the surface
//! is chosen first and a ray is sent there.

use crate::common;

use common::Random;
use common::shapes::{sample, scene};
use etalon_scenes::trace::{Ray, Shape};
use glam::{DMat3, DQuat, DVec3};

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
        let hit = scene([shape.clone()])
            .intersect(&ray)
            .unwrap_or_else(|| panic!("{shape:?} missed by {ray:?}"));
        // Coordinates are below 120, so one rounding is under 1.5e-14; some
        // ten of them over the cosine remain below 1e-12 of the distance, or of
        // the coordinates where those are larger.
        let scale = distance.max(10.0);
        assert!(
            (hit.t * speed - distance).abs() < 1e-12 * scale,
            "{shape:?}: {hit:?}"
        );
        assert!(
            hit.position.distance(q) < 1e-12 * scale,
            "{shape:?}: {hit:?}, not {q}"
        );
        assert!(
            (hit.normal - normal).length() < 1e-11,
            "{shape:?}: {hit:?}, not {normal}"
        );
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
        let (center, radius, normal) = (
            random.vector(10.0),
            random.within(0.1, 5.0),
            random.direction(),
        );
        let tangent = normal.any_orthonormal_vector();
        for (factor, hits) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
            let ray = Ray::new(
                center + normal * (radius * factor) - tangent * 30.0,
                tangent,
            );
            let sphere = scene([Shape::Sphere { center, radius }]);
            assert_eq!(sphere.intersect(&ray).is_some(), hits);
            let disc = scene([Shape::Disc {
                center,
                normal: tangent,
                radius,
            }]);
            assert_eq!(disc.intersect(&ray).is_some(), hits);
        }
        let half = DVec3::new(1.0, 2.0, 3.0);
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(normal, radius));
        for (factor, hits) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
            let ray = Ray::new(
                center + rotation * DVec3::new(half.x * factor, 0.5, 40.0),
                rotation * DVec3::NEG_Z,
            );
            let cuboid = scene([Shape::Box {
                center,
                half,
                orientation: rotation,
            }]);
            assert_eq!(cuboid.intersect(&ray).is_some(), hits);
            let rectangle = Shape::Rectangle {
                center,
                half_u: rotation.x_axis,
                half_v: rotation.y_axis * 2.0,
            };
            assert_eq!(scene([rectangle]).intersect(&ray).is_some(), hits);
        }
    }
}

#[test]
fn a_far_sphere_is_hit_as_precisely_as_a_near_one() {
    // The textbook formula subtracts squares of 1e14 and is off by about 1e-2.
    let distance = 1e7;
    let sphere = scene([Shape::Sphere {
        center: DVec3::ZERO,
        radius: 1.0,
    }]);
    for offset in [0.0, 0.3, 0.9, 0.999] {
        let ray = Ray::new(DVec3::new(offset, 0.0, distance), DVec3::NEG_Z);
        let hit = sphere.intersect(&ray).unwrap();
        let expected = DVec3::new(offset, 0.0, (1.0_f64 - offset * offset).sqrt());
        // One unit in the last place of t is 1.9e-9; the cosine is at least 0.04.
        assert!(
            hit.position.distance(expected) < 1e-7,
            "{hit:?}, not {expected}"
        );
        assert!((hit.t - (distance - expected.z)).abs() < 1e-7);
    }
}

#[test]
fn no_ray_meets_the_surface_it_leaves() {
    let mut random = Random::new(3);
    for round in 0..12_000 {
        let (shape, q, normal) = sample(&mut random, round % 6);
        // Far from the origin a fixed offset would be too small; here there is none.
        let shift = if round % 2 == 0 {
            DVec3::ZERO
        } else {
            random.vector(1e6)
        };
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
        Shape::Plane { point, normal } => Shape::Plane {
            point: point + shift,
            normal,
        },
        Shape::Rectangle {
            center,
            half_u,
            half_v,
        } => Shape::Rectangle {
            center: center + shift,
            half_u,
            half_v,
        },
        Shape::Disc {
            center,
            normal,
            radius,
        } => Shape::Disc {
            center: center + shift,
            normal,
            radius,
        },
        Shape::Sphere { center, radius } => Shape::Sphere {
            center: center + shift,
            radius,
        },
        Shape::Box {
            center,
            half,
            orientation,
        } => Shape::Box {
            center: center + shift,
            half,
            orientation,
        },
        Shape::Mesh(mut mesh) => {
            mesh.positions
                .iter_mut()
                .for_each(|position| *position += shift);
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
        let hit = sphere
            .intersect(&Ray::new(center + start * (radius * 3.0), -start))
            .unwrap();
        let mut inward = random.direction();
        if inward.dot(hit.normal) > 0.0 {
            inward = -inward;
        }
        let chord = sphere.intersect(&hit.ray(inward)).unwrap();
        let expected = -2.0 * radius * inward.dot(start);
        assert!(
            (chord.t - expected).abs() < 1e-12 * radius.max(1.0),
            "{} not {expected}",
            chord.t
        );
        // The normal is on the side the ray comes from: inside.
        assert!(chord.normal.dot(chord.position - center) < 0.0);
    }
    let cuboid = scene([Shape::aligned_box(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0))]);
    let hit = cuboid
        .intersect(&Ray::new(DVec3::new(0.25, 0.5, 9.0), DVec3::NEG_Z))
        .unwrap();
    let through = cuboid.intersect(&hit.ray(DVec3::NEG_Z)).unwrap();
    assert_eq!(
        (through.t, through.position.z, through.normal),
        (6.0, -3.0, DVec3::Z)
    );
}

#[test]
fn starts_are_respected() {
    let sphere = scene([Shape::Sphere {
        center: DVec3::ZERO,
        radius: 1.0,
    }]);
    let ray = Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z);
    assert_eq!(sphere.intersect(&ray).unwrap().t, 4.0);
    assert_eq!(sphere.intersect(&ray.starting_at(4.5)).unwrap().t, 6.0);
    assert_eq!(sphere.intersect(&ray.starting_at(6.5)), None);
    assert_eq!(
        sphere.intersect(&Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::Z)),
        None
    );
}

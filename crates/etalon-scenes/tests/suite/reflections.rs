//! True reflections against closed forms and against looking again.

use crate::common;

use common::{centres, size, texels, world};
use etalon_scenes::scenes::{MIRROR_HEIGHT, WALL_DISTANCE};
use etalon_scenes::trace::{
    Material, MirrorRay, Pattern, SceneBuilder, Shape, Sky, true_reflection,
};
use etalon_scenes::{Camera, Pose};
use glam::{DVec2, DVec3};

#[test]
fn the_mirror_planes_reflect_as_their_closed_form_says() {
    let world = world("mirror-planes");
    let size = size(160, 120);
    let reflection = world.reflection(size).unwrap();
    let frame = world.frame(size).unwrap();
    let colour = texels(&frame.colour);
    let projection = world.camera.projection(size).unwrap();
    let pose = world.camera.pose();
    let eye = pose.position();
    let checker = Pattern::Checker {
        origin: DVec3::ZERO,
        u: DVec3::X * 0.5,
        v: DVec3::Y * 0.5,
    };
    let (mut on_screen, mut off_screen) = (0, 0);
    for (pixel, uv) in centres(size).enumerate() {
        let d = pose.orientation() * projection.direction(uv);
        let mirror = (MIRROR_HEIGHT - eye.y) / d.y;
        let wall = (-WALL_DISTANCE - eye.z) / d.z;
        let ray = &reflection.rays[pixel];
        if d.y >= 0.0 || wall < mirror {
            assert_eq!(*ray, MirrorRay::None, "the wall does not reflect");
            continue;
        }
        // The mirror itself shows nothing but reflections, which are left out.
        assert_eq!(colour[pixel], [0.0, 0.0, 0.0, 1.0]);
        let m = eye + d * mirror;
        let up = DVec3::new(d.x, -d.y, d.z);
        let point = m + up * (-WALL_DISTANCE - m.z) / d.z;
        let (from, position) = (pose.to_view(m), pose.to_view(point));
        let MirrorRay::Hit(hit) = ray else {
            panic!("no hit at {uv}");
        };
        assert!(
            hit.from.distance(from) < 1e-10 * from.length(),
            "{} not {from}",
            hit.from
        );
        assert!(
            hit.position.distance(position) < 1e-10 * position.length(),
            "{} not {position}",
            hit.position
        );
        let s = projection.scale();
        let seen = DVec2::new(
            0.5 - 0.5 * s.x * position.x / position.z,
            0.5 + 0.5 * s.y * position.y / position.z,
        );
        let inside = (0.0..=1.0).contains(&seen.x) && (0.0..=1.0).contains(&seen.y);
        assert_eq!(hit.uv.is_some(), inside, "{seen}");
        assert_eq!(hit.visible, inside, "nothing hides the wall");
        if let Some(uv) = hit.uv {
            assert!((uv - seen).length() < 1e-10);
        }
        let near_edge = [point.x, point.y]
            .iter()
            .any(|x| (x * 2.0 - (x * 2.0).round()).abs() < 1e-9);
        if !near_edge {
            let expected = if checker.at(point) == 0.0 {
                DVec3::new(0.9, 0.35, 0.1)
            } else {
                DVec3::new(0.05, 0.2, 0.6)
            };
            assert!(
                (hit.colour - expected).abs().max_element() < 1e-12,
                "{} at {point}",
                hit.colour
            );
            assert_eq!(
                hit.colour, hit.colour_to_camera,
                "ambient light looks the same from everywhere"
            );
        }
        *(if inside {
            &mut on_screen
        } else {
            &mut off_screen
        }) += 1;
    }
    assert!(
        on_screen > 1000 && off_screen > 100,
        "{on_screen} on screen, {off_screen} off"
    );
}

#[test]
fn a_sphere_reflects_about_its_normal() {
    // Law of reflection, checked without the renderer's formula: in and out
    // have equal angles with the normal and lie in one plane with it.
    let world = world("wet-floor");
    let size = size(96, 54);
    let reflection = world.reflection(size).unwrap();
    let pose = world.camera.pose();
    let frame = world.frame(size).unwrap();
    let normals = texels(&frame.normal);
    let mut checked = 0;
    for (pixel, ray) in reflection.rays.iter().enumerate() {
        let MirrorRay::Hit(hit) = ray else { continue };
        let [x, y, z, _] = normals[pixel].map(f64::from);
        let n = DVec3::new(x, y, z).normalize();
        let (into, out) = (hit.from.normalize(), (hit.position - hit.from).normalize());
        // The frame's normal is rounded to half precision.
        assert!((into.dot(n) + out.dot(n)).abs() < 2e-3);
        assert!(into.cross(out).dot(n).abs() < 2e-3);
        assert!(pose.to_world(hit.from).is_finite());
        checked += 1;
    }
    assert!(checked > 1000);
}

#[test]
fn visible_reflections_are_what_the_camera_sees() {
    // Looked at again with a ray from the eye instead of one to it.
    for name in ["wet-floor", "corridor-grazing"] {
        let world = world(name);
        let size = size(160, 90);
        let projection = world.camera.projection(size).unwrap();
        let (mut visible, mut hidden) = (0, 0);
        for ray in &world.reflection(size).unwrap().rays {
            let MirrorRay::Hit(hit) = ray else { continue };
            let Some(uv) = hit.uv else {
                assert!(!hit.visible);
                continue;
            };
            let seen = world.scene.intersect(&world.camera.ray(&projection, uv));
            let seen = seen.map(|seen| world.camera.pose().to_view(seen.position));
            let distance = seen.map_or(f64::INFINITY, |seen| seen.distance(hit.position));
            // The same point up to rounding, which grazing angles enlarge, or
            // something else altogether: there is nothing between.
            let same = distance < 1e-8;
            assert_eq!(
                hit.visible, same,
                "{name} at {uv}: {} seen {distance} away",
                hit.position
            );
            *(if same { &mut visible } else { &mut hidden }) += 1;
        }
        assert!(
            visible > 1000 && hidden > 100,
            "{name}: {visible} visible, {hidden} hidden"
        );
    }
}

#[test]
fn what_is_seen_from_behind_is_not_visible() {
    // A panel between camera and mirror, to one side: beside it the mirror
    // shows its back, while the camera sees its front.
    let mut builder = SceneBuilder::new();
    builder.object(
        Shape::Rectangle {
            center: DVec3::new(0.0, 0.0, -10.0),
            half_u: DVec3::X * 5.0,
            half_v: DVec3::Y * 5.0,
        },
        Material::metal(DVec3::ONE, 0.0),
    );
    builder.object(
        Shape::Rectangle {
            center: DVec3::new(1.75, 0.0, -6.0),
            half_u: DVec3::X * 0.75,
            half_v: DVec3::Y,
        },
        Material::matte(DVec3::ONE),
    );
    builder.sky(Sky {
        horizon: DVec3::ONE,
        zenith: DVec3::ONE,
    });
    let scene = builder.build().unwrap();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).unwrap();
    let camera = Camera::new(pose, 1.2).unwrap();
    let reflection = true_reflection(&scene, &camera, size(101, 101)).unwrap();
    let (mut backs, mut skies) = (0, 0);
    for ray in &reflection.rays {
        match ray {
            MirrorRay::Hit(hit) => {
                assert!(hit.uv.is_some() && !hit.visible);
                backs += 1;
            }
            MirrorRay::Miss { direction, colour } => {
                assert!(direction.z > 0.0 && *colour == DVec3::ONE);
                skies += 1;
            }
            MirrorRay::None => {}
        }
    }
    assert!(backs > 50 && skies > 100, "{backs} backs, {skies} skies");
}

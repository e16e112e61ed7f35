//! Frames and reflections of whole scenes against closed forms and against one
//! another.

use crate::common;

use common::{Random, centres, size, texels, world};
use etalon_scenes::trace::{Ambient, Light, Material, SceneBuilder, Shape, trace};
use etalon_scenes::{Camera, Frame, Pose, scene, scenes};
use glam::{DVec2, DVec3};

#[test]
fn every_scene_renders_at_odd_sizes() {
    for entry in scenes() {
        let world = (entry.build)().unwrap();
        for (width, height) in [(1, 1), (1, 512), (512, 1), (7, 13), (129, 65)] {
            let size = size(width, height);
            let frame = entry.frame(size).unwrap();
            assert_eq!(frame.size(), size, "{}", entry.name);
            let reflection = world.reflection(size).unwrap();
            assert_eq!(reflection.rays.len(), size.pixels());
        }
    }
    let tall = world("mirror-planes").frame(size(1, 4096)).unwrap();
    let wide = world("mirror-planes").frame(size(1920, 1080)).unwrap();
    assert_eq!(
        (tall.depth.bytes.len(), wide.depth.bytes.len()),
        (4096 * 4, 1920 * 1080 * 4)
    );
}

#[test]
fn scenes_are_listed_once_and_described() {
    for entry in scenes() {
        assert!(
            entry
                .name
                .chars()
                .all(|c| c.is_ascii_lowercase() || c == '-'),
            "{}",
            entry.name
        );
        assert!(!entry.description.is_empty());
        assert_eq!(
            scenes()
                .iter()
                .filter(|other| other.name == entry.name)
                .count(),
            1
        );
    }
    assert!(scene("no-such-scene").is_none());
}

#[test]
fn frames_hold_what_they_promise() {
    for entry in scenes().iter().filter(|entry| entry.alter.is_none()) {
        let frame = entry.frame(size(96, 54)).unwrap();
        let (colour, depth) = (texels(&frame.colour), texels(&frame.depth));
        let (normal, specular) = (texels(&frame.normal), texels(&frame.specular));
        let mut surfaces = 0;
        for (pixel, uv) in centres(frame.size()).enumerate() {
            let [r, g, b, a] = colour[pixel];
            assert!(
                [r, g, b].iter().all(|x| x.is_finite() && *x >= 0.0),
                "{}",
                entry.name
            );
            let depth = f64::from(depth[pixel][0]);
            let [x, y, z, w] = normal[pixel].map(f64::from);
            if depth == 0.0 {
                assert_eq!(
                    (a, [x, y, z, w], specular[pixel]),
                    (0.0, [0.0; 4], [0.0; 4])
                );
                continue;
            }
            surfaces += 1;
            assert_eq!((a, w), (1.0, 1.0));
            assert!(depth > 0.0 && depth <= 1.0);
            // Each component is rounded by at most 2⁻¹² of 1.
            let n = DVec3::new(x, y, z);
            assert!((n.length() - 1.0).abs() < 1e-3, "{}: {n}", entry.name);
            // Towards the camera, up to that rounding.
            assert!(
                n.dot(frame.camera.projection.direction(uv)) < 1e-3,
                "{}: {n} at {uv}",
                entry.name
            );
            assert!(specular[pixel].iter().all(|x| (0.0..=1.0).contains(x)));
        }
        assert!(surfaces > 96 * 54 / 2, "{} is mostly sky", entry.name);
    }
}

#[test]
fn depth_of_a_sphere_is_analytic() {
    let (center, radius) = (DVec3::new(0.3, -0.2, -5.0), 1.5);
    let mut builder = SceneBuilder::new();
    builder.object(
        Shape::Sphere { center, radius },
        Material::matte(DVec3::ONE),
    );
    let scene = builder.build().unwrap();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).unwrap();
    let camera = Camera::new(pose, 1.0).unwrap();
    let frame = trace(&scene, &camera, size(101, 67)).unwrap();
    let (depth, normal) = (texels(&frame.depth), texels(&frame.normal));
    let projection = frame.camera.projection;
    let mut covered = 0;
    for (pixel, uv) in centres(frame.size()).enumerate() {
        // Along d with d.z = −1: |s d − c|² = r², and the distance is s.
        let d = projection.direction(uv);
        let (a, b, c) = (
            d.dot(d),
            d.dot(center),
            center.dot(center) - radius * radius,
        );
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            assert_eq!(depth[pixel][0], 0.0);
            continue;
        }
        covered += 1;
        let s = (b - discriminant.sqrt()) / a;
        let expected = (projection.near() / s) as f32;
        // f64 agrees to far below an f32 rounding step, which may fall either way.
        assert!((depth[pixel][0] - expected).abs() <= f32::EPSILON * expected);
        let n = (d * s - center) / radius;
        for (value, expected) in normal[pixel].into_iter().zip(n.to_array()) {
            // A half is within 2⁻¹¹ of a value under 1, in relation to it.
            assert!(
                (f64::from(value) - expected).abs() <= expected.abs() * 2.0_f64.powi(-11) + 1e-7
            );
        }
    }
    assert!(covered > 500);
}

#[test]
fn direct_light_is_lambert_with_hard_shadows() {
    let base = DVec3::new(0.8, 0.4, 0.2);
    let irradiance = DVec3::new(2.0, 3.0, 4.0);
    let towards = DVec3::new(0.6, 0.8, 0.0);
    let mut builder = SceneBuilder::new();
    builder.object(
        Shape::Plane {
            point: DVec3::ZERO,
            normal: DVec3::Y,
        },
        Material::matte(base),
    );
    builder.object(
        Shape::Sphere {
            center: DVec3::new(1.5, 2.0, 0.0),
            radius: 0.5,
        },
        Material::matte(base),
    );
    builder.light(Light::Directional {
        towards: towards * 7.0,
        irradiance,
    });
    builder.ambient(Ambient {
        above: DVec3::splat(0.5),
        below: DVec3::splat(0.25),
    });
    let scene = builder.build().unwrap();
    let pose = Pose::look_at(DVec3::new(0.0, 5.0, 0.0), DVec3::ZERO, DVec3::Z).unwrap();
    let camera = Camera::new(pose, 1.2).unwrap();
    let frame = trace(&scene, &camera, size(64, 64)).unwrap();
    let (colour, depth) = (texels(&frame.colour), texels(&frame.depth));
    let (mut lit, mut dark) = (0, 0);
    for (pixel, uv) in centres(frame.size()).enumerate() {
        let view = frame
            .camera
            .projection
            .unproject(uv, f64::from(depth[pixel][0]));
        let p = pose.to_world(view);
        if p.y > 0.01 {
            continue;
        }
        // The shadow is where the line to the light passes the sphere's centre
        // at less than its radius.
        let offset = DVec3::new(1.5, 2.0, 0.0) - p;
        let passed = offset.reject_from_normalized(towards).length();
        if (passed - 0.5).abs() < 1e-4 {
            continue;
        }
        let direct = if passed < 0.5 {
            DVec3::ZERO
        } else {
            irradiance * 0.8 / std::f64::consts::PI
        };
        let expected = base * (DVec3::splat(0.5) + direct);
        for (value, expected) in colour[pixel].into_iter().zip(expected.to_array()) {
            assert!((f64::from(value) / expected - 1.0).abs() <= 2.0_f64.powi(-11));
        }
        *(if passed < 0.5 { &mut dark } else { &mut lit }) += 1;
    }
    assert!(lit > 1000 && dark > 30, "{lit} lit, {dark} dark");
}

#[test]
fn a_lamps_body_does_not_shade_its_own_light() {
    let mut builder = SceneBuilder::new();
    builder.object(
        Shape::Plane {
            point: DVec3::ZERO,
            normal: DVec3::Y,
        },
        Material::matte(DVec3::ONE),
    );
    let radiance = DVec3::splat(100.0);
    builder.lamp(DVec3::new(0.0, 2.0, 0.0), 0.1, radiance);
    let scene = builder.build().unwrap();
    let pose = Pose::look_at(
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::new(1.0, 0.0, 0.0),
        DVec3::Z,
    )
    .unwrap();
    let camera = Camera::new(pose, 0.01).unwrap();
    let frame = trace(&scene, &camera, size(1, 1)).unwrap();
    // Seen from (1, 0, 0): intensity π r² L, distance² 5, cosine 2/√5, over π.
    let expected = 0.01 * 100.0 / 5.0 * 2.0 / 5.0_f64.sqrt();
    let value = f64::from(texels(&frame.colour)[0][0]);
    assert!(
        (value / expected - 1.0).abs() <= 2.0_f64.powi(-11),
        "{value}, not {expected}"
    );
}

#[test]
fn velocity_is_where_things_were_projected_before() {
    for name in ["wet-floor", "corridor-grazing", "mirror-planes"] {
        let world = world(name);
        let frame = world.frame(size(80, 45)).unwrap();
        let (depth, velocity) = (texels(&frame.depth), texels(&frame.velocity));
        let (now, before) = (world.camera.pose(), world.camera.previous_pose());
        let mut moved = 0;
        for (pixel, uv) in centres(frame.size()).enumerate() {
            let depth = f64::from(depth[pixel][0]);
            let projection = frame.camera.projection;
            let then = if depth == 0.0 {
                before.direction_to_view(now.orientation() * projection.direction(uv))
            } else {
                // The matrix of the frame must say the same as the pose.
                let world = now.to_world(projection.unproject(uv, depth));
                (frame.camera.previous_view * world.extend(1.0)).truncate()
            };
            let expected = uv - projection.project(then).unwrap().uv;
            let [u, v, ..] = velocity[pixel].map(f64::from);
            // Half precision of the velocity, a denormal's step, and 2⁻²⁴ of
            // the depth, by which the whole parallax may be off.
            let error = (DVec2::new(u, v) - expected).abs();
            let allowed = expected.abs() * 2.0_f64.powi(-11) + DVec2::splat(2.0_f64.powi(-24));
            assert!(
                error.cmple(allowed).all(),
                "{name} at {uv}: {u} {v}, not {expected}"
            );
            moved += usize::from(expected.length() > 1e-4);
        }
        assert!(moved > 80 * 45 / 2, "{name}: {moved}");
    }
}

#[test]
fn a_camera_at_rest_gives_no_velocity() {
    let mut world = world("wet-floor");
    world.camera = world.camera.previous();
    let frame = world.frame(size(40, 30)).unwrap();
    // Projecting the same point twice differs from the pixel's centre by rounding only.
    for [u, v, ..] in texels(&frame.velocity) {
        assert!(u.abs() < 1e-6 && v.abs() < 1e-6);
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let world = world("wet-floor");
    let size = size(64, 37);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| (world.frame(size).unwrap(), world.reflection(size).unwrap()))
    };
    let one = run(1);
    for threads in [2, 3, 7] {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}

#[test]
fn the_dark_room_spans_six_orders_of_magnitude() {
    let frame = world("dark-room-lights").frame(size(320, 180)).unwrap();
    let luminance: Vec<f32> = texels(&frame.colour)
        .iter()
        .map(|[r, g, b, _]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
        .collect();
    let most = luminance.iter().copied().fold(0.0, f32::max);
    let mut sorted = luminance;
    sorted.sort_by(f32::total_cmp);
    let median = sorted[sorted.len() / 2];
    assert!(
        most > 1000.0 && median < 0.05 && sorted[0] > 0.0,
        "median {median}, most {most}"
    );
}

#[test]
fn hard_inputs_hold_every_special_value_and_repeat() {
    let entry = scene("hard-inputs").unwrap();
    let frame = entry.frame(size(64, 48)).unwrap();
    assert_eq!(bytes(&frame), bytes(&entry.frame(size(64, 48)).unwrap()));
    let clean = world("wet-floor").frame(size(64, 48)).unwrap();
    for ((name, damaged), (_, clean)) in frame.images().into_iter().zip(clean.images()) {
        let texel = damaged.desc.format.texel_bytes() as usize;
        let changed = (damaged.bytes.chunks_exact(texel))
            .zip(clean.bytes.chunks_exact(texel))
            .filter(|(a, b)| a != b)
            .count();
        // One in sixteen, give or take; some replacements change nothing.
        assert!(
            (64 * 48 / 40..64 * 48 / 8).contains(&changed),
            "{name}: {changed} texels changed"
        );
        if name == "specular" {
            continue;
        }
        let values: Vec<f32> = texels(damaged)
            .into_iter()
            .flat_map(|texel| texel.into_iter().take(2))
            .collect();
        let smallest = if name == "depth" {
            f32::MIN_POSITIVE
        } else {
            2.0_f32.powi(-14)
        };
        type Test<'a> = (&'a str, &'a dyn Fn(f32) -> bool);
        let tests: [Test<'_>; 6] = [
            ("NaN", &|x| x.is_nan()),
            ("infinity", &|x| x == f32::INFINITY),
            ("minus infinity", &|x| x == f32::NEG_INFINITY),
            ("negative", &|x| x < 0.0 && x.is_finite()),
            ("denormal", &|x| x != 0.0 && x.abs() < smallest),
            ("minus zero", &|x| x == 0.0 && x.is_sign_negative()),
        ];
        for (what, test) in tests {
            assert!(values.iter().any(|&x| test(x)), "{name} has no {what}");
        }
    }
    assert!(texels(&frame.normal).contains(&[0.0, 0.0, 0.0, 1.0]));
    for special in [0.0, 1.0, 2.0] {
        assert!(texels(&frame.depth).iter().any(|texel| texel[0] == special));
    }
    // Even a single pixel is damaged.
    let tiny = entry.frame(size(1, 1)).unwrap();
    assert!(texels(&tiny.depth)[0][0].is_nan());
}

/// All images as bytes: NaN differs from NaN, its bits do not.
fn bytes(frame: &Frame) -> Vec<&[u8]> {
    frame
        .images()
        .iter()
        .map(|(_, image)| image.bytes.as_slice())
        .collect()
}

#[test]
fn world_and_view_space_agree_far_from_the_origin() {
    // The same scene moved by 2²⁰: f64 must lose no more than 2²⁰ of its 2⁵³.
    let build = |shift: DVec3| {
        let mut builder = SceneBuilder::new();
        let mut random = Random::new(9);
        for _ in 0..20 {
            let center = random.vector(3.0) - DVec3::Z * 8.0 + shift;
            builder.object(
                Shape::Sphere {
                    center,
                    radius: 0.7,
                },
                Material::plastic(DVec3::ONE, 0.1),
            );
        }
        let pose = Pose::look_at(shift, shift - DVec3::Z, DVec3::Y).unwrap();
        (builder.build().unwrap(), Camera::new(pose, 1.0).unwrap())
    };
    let (near, camera) = build(DVec3::ZERO);
    let (far, far_camera) = build(DVec3::splat(f64::from(1 << 20)));
    let size = size(64, 64);
    let (a, b) = (
        trace(&near, &camera, size).unwrap(),
        trace(&far, &far_camera, size).unwrap(),
    );
    let (a, b) = (texels(&a.depth), texels(&b.depth));
    for (a, b) in a.iter().zip(&b) {
        // Where a silhouette moves by rounding, one of both is sky: none here.
        assert!(
            (a[0] - b[0]).abs() <= 2.0 * f32::EPSILON * a[0],
            "{} {}",
            a[0],
            b[0]
        );
    }
}

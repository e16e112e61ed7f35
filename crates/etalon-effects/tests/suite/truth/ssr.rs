//! The truth of reflections against closed forms and against a search in view
//! space.

use crate::common;

use common::image;
use etalon_core::Format;
use etalon_core::image::ImageError;
use etalon_effects::ssr::Ssr;
use etalon_effects::ssr::truth::hits;
use etalon_effects::truth::Plane;
use etalon_effects::{CameraParams, DepthRange, EffectError};
use glam::{DVec2, DVec3, Vec2};

/// Without fades, so that visibility is 1 where there is a hit.
fn plain() -> Ssr {
    Ssr {
        max_distance: 50.0,
        camera_fade: 0.0,
        depth_fade: 0.0,
        distance_fade: 0.0,
        border: 0.0,
        blur_radius: 0,
        ..Ssr::default()
    }
}

/// A projection that is off-centre, so that a wrong centre shows.
fn camera() -> CameraParams {
    CameraParams {
        centre: Vec2::new(0.125, -0.0625),
        ..CameraParams::perspective(1.0, 1.5, 0.125)
    }
}

/// View position at a place in texels; the definition of [`CameraParams`].
fn position(camera: &CameraParams, size: DVec2, pixel: DVec2, distance: f64) -> DVec3 {
    let x = 2.0 * pixel.x / size.x - 1.0 - f64::from(camera.centre.x);
    let y = 1.0 - 2.0 * pixel.y / size.y - f64::from(camera.centre.y);
    DVec3::new(
        x / f64::from(camera.scale.x) * distance,
        y / f64::from(camera.scale.y) * distance,
        -distance,
    )
}

/// Where a view position is seen, in texels.
fn pixel(camera: &CameraParams, size: DVec2, point: DVec3) -> DVec2 {
    let x = f64::from(camera.scale.x) * point.x / -point.z + f64::from(camera.centre.x);
    let y = f64::from(camera.scale.y) * point.y / -point.z + f64::from(camera.centre.y);
    DVec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * y) * size
}

fn reflect(view: DVec3, normal: DVec3) -> DVec3 {
    view - 2.0 * view.dot(normal) * normal
}

fn centre(x: u32, y: u32) -> DVec2 {
    DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)
}

/// A depth image of distances, reversed without a far plane; 0 is background.
fn depths(camera: &CameraParams, size: [u32; 2], distance: impl Fn(u32, u32) -> f64) -> Plane {
    let near = f64::from(camera.near);
    let depth = |x, y| match distance(x, y) {
        0.0 => [0.0; 4],
        distance => [near / distance, 0.0, 0.0, 0.0],
    };
    Plane::from_fn(size[0], size[1], depth).expect("small")
}

fn normals(size: [u32; 2], normal: impl Fn(u32, u32) -> DVec3) -> Plane {
    Plane::from_fn(size[0], size[1], |x, y| normal(x, y).extend(1.0).to_array()).expect("small")
}

#[test]
fn a_wall_above_a_mirror_is_where_the_closed_form_says() {
    let camera = camera();
    for size in [[120, 80], [97, 61]] {
        let extent = DVec2::new(size[0].into(), size[1].into());
        let (wall, height) = (6.0, -0.5);
        // A mirror tilted to the side below, a wall that faces the eye above.
        let up = DVec3::new(0.1, 1.0, 0.05).normalize();
        let distance = |x, y| {
            let ray = position(&camera, extent, centre(x, y), 1.0);
            let floor = height / up.dot(ray);
            if floor > 0.0 && floor < wall {
                floor
            } else {
                wall
            }
        };
        let settings = plain();
        let found = hits(
            &depths(&camera, size, distance),
            &normals(
                size,
                |x, y| if distance(x, y) < wall { up } else { DVec3::Z },
            ),
            &camera,
            &settings,
        )
        .expect("valid");
        let mut checked = 0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let hit = found[(y * size[0] + x) as usize];
                if distance(x, y) == wall {
                    continue;
                }
                let start = position(&camera, extent, centre(x, y), distance(x, y));
                let ray = reflect(start.normalize(), up);
                let length = (-wall - start.z) / ray.z;
                let point = start + ray * length;
                let place = pixel(&camera, extent, point);
                if length > settings.max_distance.into()
                    || place.min_element() < 0.0
                    || (extent - place).min_element() < 0.0
                {
                    assert_eq!(hit, None, "({x}, {y})");
                    continue;
                }
                // Cells of the outline are wall or floor as a whole.
                let cell = place.floor();
                if distance(cell.x as u32, cell.y as u32) != wall {
                    continue;
                }
                checked += 1;
                let hit = hit.unwrap_or_else(|| panic!("({x}, {y}) misses {place}"));
                let uv = place / extent;
                assert!((hit.uv - uv).abs().max_element() <= 1e-10, "{hit:?} {uv}");
                assert!((hit.length - length).abs() <= 1e-10, "{hit:?} {length}");
                assert!((hit.distance - wall).abs() <= 1e-10, "{hit:?}");
                assert!(hit.residue <= 1e-10, "{hit:?}");
                assert_eq!(hit.visibility, 1.0);
            }
        }
        assert!(checked > 1000, "{checked}");
    }
}

#[test]
fn a_ray_toward_the_eye_enters_a_wall_from_behind() {
    let camera = CameraParams::perspective(1.0, 1.0, 0.125);
    let size = [64, 64];
    let extent = DVec2::splat(64.0);
    // A wall at 2 on the left, a mirror at 4 on the right that leans toward it.
    let lean = DVec3::new(-(0.6_f64.sin()), 0.0, 0.6_f64.cos());
    let left = |x: u32| x < 32;
    let settings = Ssr {
        thickness: 0.125,
        depth_fade: 0.25,
        camera_fade: 0.5,
        ..plain()
    };
    let found = hits(
        &depths(&camera, size, |x, _| if left(x) { 2.0 } else { 4.0 }),
        &normals(size, |x, _| if left(x) { DVec3::Z } else { lean }),
        &camera,
        &settings,
    )
    .expect("valid");
    let mut checked = 0;
    for y in 0..64 {
        for x in 32..64 {
            let start = position(&camera, extent, centre(x, y), 4.0);
            let view = start.normalize();
            let ray = reflect(view, lean);
            let length = (-2.125 - start.z) / ray.z;
            let place = pixel(&camera, extent, start + ray * length);
            let inside = place.min_element() > 0.0 && (extent - place).min_element() > 0.0;
            if !inside || place.x >= 32.0 {
                continue;
            }
            checked += 1;
            let hit = found[(y * 64 + x) as usize].expect("behind the wall");
            assert!((hit.uv - place / extent).abs().max_element() <= 1e-10);
            assert!((hit.length - length).abs() <= 1e-10);
            assert!((hit.residue - 0.125).abs() <= 1e-10);
            // As deep as can be: 1 - 0.25. And by the angle.
            let back = (-view.dot(ray)).max(0.0);
            let angle = 1.0 - 0.5 * (3.0 * back.powi(2) - 2.0 * back.powi(3));
            assert!((hit.visibility - 0.75 * angle).abs() <= 1e-10, "{hit:?}");
        }
    }
    assert!(checked > 100, "{checked}");
}

/// Whether a ray is hit at a view position, by the rule as it is documented.
fn is_hit(
    camera: &CameraParams,
    distances: &[f64],
    size: [u32; 2],
    [start, normal, point]: [DVec3; 3],
    thickness: f64,
) -> bool {
    let extent = DVec2::new(size[0].into(), size[1].into());
    let cell = pixel(camera, extent, point).floor();
    let inside = cell.min_element() >= 0.0 && (extent - cell).min_element() >= 1.0;
    if !inside {
        return false;
    }
    let (x, y) = (cell.x as u32, cell.y as u32);
    let surface = distances[(y * size[0] + x) as usize];
    let behind = -point.z - surface;
    let seen = position(camera, extent, centre(x, y), surface);
    surface > 0.0
        && behind > 0.0
        && behind < thickness
        // Of the start's own cell rounding makes a little more than 0.
        && (seen - start).dot(normal) > 1e-12
}

#[test]
fn it_is_the_first_hit_of_a_dense_search_in_view_space() {
    // Steps of every height, holes, and normals every which way. The search
    // knows nothing of projected lines: it goes along the ray in view space.
    let camera = camera();
    let size = [24, 18];
    let extent = DVec2::new(24.0, 18.0);
    let random = |seed: u32| f64::from(common::hash(seed)) / f64::from(u32::MAX);
    let (mut found, mut missed) = (0, 0);
    for seed in 0..3 {
        let texel = |x: u32, y: u32| x + 24 * y + 10_000 * seed;
        let distances: Vec<f64> = (0..18)
            .flat_map(|y| (0..24).map(move |x| texel(x, y)))
            .map(|texel| match common::hash(texel + 1_000_000) % 9 {
                0 => 0.0,
                _ => 1.0 + 2.0 * random(texel),
            })
            .collect();
        let normal = |x, y| {
            let channel = |c: u32| random(texel(x, y) + 77_777 * c) * 2.0 - 1.0;
            DVec3::new(channel(1), channel(2), 0.3 + channel(3).abs()).normalize()
        };
        let settings = Ssr {
            thickness: 0.25,
            max_distance: 4.0,
            ..plain()
        };
        let (thickness, longest) = (0.25, 4.0);
        let depth = depths(&camera, size, |x, y| distances[(y * 24 + x) as usize]);
        let truth = hits(&depth, &normals(size, normal), &camera, &settings).expect("valid");
        for y in 0..18 {
            for x in 0..24 {
                let index = (y * 24 + x) as usize;
                let normal = normal(x, y);
                let start = position(&camera, extent, centre(x, y), distances[index]);
                let ray = reflect(start.normalize(), normal);
                let facing = distances[index] > 0.0 && start.dot(normal) < 0.0;
                let at = |length: f64| {
                    let point = start + ray * length;
                    let in_front = -point.z > f64::from(camera.near);
                    facing
                        && length < longest
                        && in_front
                        && is_hit(&camera, &distances, size, [start, normal, point], thickness)
                };
                let step = longest / 20_000.0;
                // The rule that half a texel is no way.
                let reach = if ray.z > 0.0 {
                    longest.min((-start.z - f64::from(camera.near)) / ray.z)
                } else {
                    longest
                };
                let tip = pixel(&camera, extent, start + ray * reach);
                let far = (tip - centre(x, y)).abs().max_element() > 0.5;
                let sampled = (1..=20_000)
                    .map(|i| f64::from(i) * step)
                    .find(|&length| far && at(length));
                match (truth[index], sampled) {
                    (None, None) => missed += 1,
                    (Some(hit), _) => {
                        found += 1;
                        // Nothing before it, and a hit from there on.
                        assert!(
                            sampled.is_none_or(|sampled| hit.length <= sampled + 1e-9),
                            "({x}, {y}): {hit:?} {sampled:?}"
                        );
                        assert!(at(hit.length + 1e-7), "({x}, {y}): {hit:?} {sampled:?}");
                        let point = start + ray * hit.length;
                        assert!((-point.z - hit.distance).abs() <= 1e-10);
                        let place = pixel(&camera, extent, point) / extent;
                        assert!((place - hit.uv).abs().max_element() <= 1e-10);
                    }
                    (None, Some(length)) => panic!("({x}, {y}) hits at {length}"),
                }
            }
        }
    }
    assert!(found > 300 && missed > 100, "{found} {missed}");
}

#[test]
fn every_depth_convention_gives_the_same() {
    let camera = camera();
    let size = [48, 32];
    let distances =
        |x: u32, y: u32| 2.0 + f64::from(common::hash(x / 4 + 97 * (y / 4)) % 64) / 16.0;
    let normal = normals(size, |_, _| DVec3::new(0.0, 0.8, 0.6));
    let reference = hits(
        &depths(&camera, size, distances),
        &normal,
        &camera,
        &plain(),
    );
    let reference = reference.expect("valid");
    assert!(reference.iter().flatten().count() > 100);
    let near = f64::from(camera.near);
    for depth in [
        DepthRange::Reversed { far: 64.0 },
        DepthRange::Standard { far: 64.0 },
        DepthRange::StandardInfinite,
    ] {
        let planes = Plane::from_fn(size[0], size[1], |x, y| {
            let reversed =
                |far: f64| (1.0 / distances(x, y) - 1.0 / far) / (1.0 / near - 1.0 / far);
            let value = match depth {
                DepthRange::Reversed { far } => reversed(far.into()),
                DepthRange::Standard { far } => 1.0 - reversed(far.into()),
                _ => 1.0 - near / distances(x, y),
            };
            [value, 0.0, 0.0, 0.0]
        })
        .expect("small");
        let camera = CameraParams { depth, ..camera };
        let got = hits(&planes, &normal, &camera, &plain()).expect("valid");
        for (got, expected) in got.iter().zip(&reference) {
            match (got, expected) {
                (None, None) => {}
                // 1 - 1 / distance keeps 2^-53 of 1, 2^-47 of the smallest
                // difference here.
                (Some(a), Some(b)) => {
                    assert!((a.uv - b.uv).length() <= 1e-9, "{depth:?}: {a:?} {b:?}");
                    assert!((a.length - b.length).abs() <= 1e-9);
                }
                _ => panic!("{depth:?}: {got:?} {expected:?}"),
            }
        }
    }
}

#[test]
fn what_is_no_screen_is_refused_and_what_is_no_number_reflects_nothing() {
    let camera = camera();
    let flat = |size: [u32; 2], texel: [f64; 4]| {
        Plane::from_fn(size[0], size[1], |_, _| texel).expect("small")
    };
    for (width, height) in [(0, 0), (0, 4), (4, 0)] {
        let refused = Plane::from_fn(width, height, |_, _| [0.0; 4]);
        assert!(matches!(refused, Err(ImageError::Description(_))));
    }
    // Larger than any memory, said without asking for it.
    let endless = Plane::from_fn(u32::MAX, u32::MAX, |_, _| [0.0; 4]);
    assert!(endless.is_err());
    assert!(matches!(
        Plane::new(2, 2, vec![[0.0; 4]; 3]),
        Err(ImageError::WrongTexelCount { .. })
    ));
    let mut cut = image(Format::R32Float, 4, 4, |_, _| [0.5; 4]);
    cut.bytes.truncate(40);
    assert!(matches!(
        Plane::of(&cut),
        Err(ImageError::WrongLength { .. })
    ));
    let up = flat([4, 4], [0.0, 0.0, 1.0, 1.0]);
    assert!(matches!(
        hits(&flat([4, 5], [0.02; 4]), &up, &camera, &plain()),
        Err(EffectError::SizeMismatch { .. })
    ));
    let thick = Ssr {
        thickness: f32::NAN,
        ..plain()
    };
    assert!(matches!(
        hits(&flat([4, 4], [0.02; 4]), &up, &camera, &thick),
        Err(EffectError::Setting(_))
    ));
    let lens = CameraParams {
        near: f32::INFINITY,
        ..camera
    };
    assert!(matches!(
        hits(&flat([4, 4], [0.02; 4]), &up, &lens, &plain()),
        Err(EffectError::Setting(_))
    ));

    // A wall that a floor mirrors; everything odd at once in one cell of either.
    let size = [24, 24];
    let wall = |y: u32| y < 12;
    let odd_depths = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1.0, 2.0];
    let odd_normals = [f64::NAN, f64::INFINITY, 1e200, 1e-200, 0.0];
    let distance = |_, y| if wall(y) { 4.0 } else { 2.0 };
    let good = depths(&camera, size, distance);
    let normal = normals(size, |_, y| if wall(y) { DVec3::Z } else { DVec3::Y });
    let all = hits(&good, &normal, &camera, &plain()).expect("valid");
    assert!(all.iter().flatten().count() > 100);
    let index = |x: u32, y: u32| x + 24 * y;
    for odd in odd_depths {
        let depth = Plane::from_fn(24, 24, |x, y| {
            let own = good.at(x.into(), y.into());
            if index(x, y).is_multiple_of(5) {
                [odd; 4]
            } else {
                own
            }
        });
        let found = hits(&depth.expect("small"), &normal, &camera, &plain()).expect("valid");
        for (i, hit) in found.iter().enumerate() {
            assert!(hit.is_none() || !i.is_multiple_of(5), "{odd}: {hit:?}");
        }
    }
    for odd in odd_normals {
        let normal = Plane::from_fn(24, 24, |x, y| {
            let own = normal.at(x.into(), y.into());
            if index(x, y).is_multiple_of(5) {
                [odd; 4]
            } else {
                own
            }
        });
        let found = hits(&good, &normal.expect("small"), &camera, &plain()).expect("valid");
        for (i, (hit, all)) in found.iter().zip(&all).enumerate() {
            let expected = if i.is_multiple_of(5) { &None } else { all };
            assert_eq!(hit, expected, "{odd}");
        }
    }
}

#[test]
fn any_bit_pattern_gives_finite_hits_on_any_lens() {
    let (width, height) = (48, 32);
    for seed in 0..4_u32 {
        let bits = |x: u32, y: u32| common::hash(x ^ (y << 10) ^ (seed << 24));
        let depth = image(Format::R32Float, width, height, |x, y| {
            let random = bits(x, y);
            let value = if random.is_multiple_of(3) {
                f32::from_bits(random)
            } else {
                (random % 1000) as f32 / 1000.0
            };
            [value, 0.0, 0.0, 0.0]
        });
        let normal = image(Format::Rgba32Float, width, height, |x, y| {
            [1, 2, 3, 4].map(|c| f32::from_bits(common::hash(bits(x, y) ^ c) & 0xbfff_ffff))
        });
        let planes = [&depth, &normal].map(|image| Plane::of(image).expect("small"));
        for camera in [
            camera(),
            CameraParams {
                centre: Vec2::new(4.0, -4.0),
                ..CameraParams::perspective(3.0, 50.0, 1e-6)
            },
            CameraParams {
                scale: Vec2::new(1e6, 1e-3),
                ..CameraParams::perspective(1.0, 1.0, 1e6)
            },
            CameraParams {
                depth: DepthRange::Standard { far: 100.0 },
                ..camera()
            },
        ] {
            for (max_distance, thickness) in [(1e6, 1e6), (1e-3, 1e-6), (20.0, 0.25)] {
                let settings = Ssr {
                    max_distance,
                    thickness,
                    ..Ssr::default()
                };
                let found = hits(&planes[0], &planes[1], &camera, &settings).expect("valid");
                for hit in found.iter().flatten() {
                    let uv = hit.uv.min_element() >= 0.0 && hit.uv.max_element() <= 1.0 + 1e-12;
                    let shares = (0.0..=1.0).contains(&hit.visibility);
                    assert!(uv && shares && hit.length.is_finite(), "{hit:?}");
                    assert!(
                        (0.0..=f64::from(thickness)).contains(&hit.residue),
                        "{hit:?}"
                    );
                }
            }
        }
    }
}

//! Pictures of all directions from files.

use std::path::PathBuf;

use etalon_effects::environment::{CubePicture, FACES, face_direction};
use etalon_scenes::environment_file::{
    EnvironmentError, EnvironmentOptions, EnvironmentPicture, FaceOrder, Layout,
    decode_environment, load_environment, load_faces,
};
use glam::{DVec2, DVec3};
use image::Rgb;
use image::codecs::hdr::HdrEncoder;

use crate::common::{Random, input};

/// Light that tells all directions apart.
fn light(at: DVec3) -> [f32; 3] {
    let way = at.normalize();
    (way + 1.5).as_vec3().to_array()
}

/// A Radiance file of a function of the place in the picture, from 0 to 1.
fn hdr([width, height]: [u32; 2], light: impl Fn(u32, u32) -> [f32; 3]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let texels: Vec<Rgb<f32>> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| Rgb(light(x, y)))
        .collect();
    HdrEncoder::new(&mut bytes)
        .encode(&texels, width as usize, height as usize)
        .unwrap();
    bytes
}

/// What the format keeps of light: 8 bits of the largest channel's power of two.
fn close(got: DVec3, want: [f32; 3]) -> bool {
    let want = DVec3::from(want.map(f64::from));
    (got - want).abs().max_element() <= want.max_element() / 128.0
}

/// The cube shows the light of each direction.
fn assert_shows(cube: &CubePicture) {
    let side = cube.side();
    for (face, y) in (0..FACES).flat_map(|face| (0..side).map(move |y| (face, y))) {
        for x in 0..side {
            let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / f64::from(side);
            let want = light(face_direction(face, 2.0 * place - 1.0));
            let [r, g, b, _] = cube.image().texel(x, y, face, 0).unwrap().to_f64();
            assert!(
                close(DVec3::new(r, g, b), want),
                "{face}, {x}, {y}: {r} {g} {b}"
            );
        }
    }
}

/// Where the faces of OpenEXR and of crosses are, written out: face, then the direction at
/// a place (u, v) of the picture's own face, from (-1, -1) at its upper left.
type Seen = fn(f64, f64) -> DVec3;
const SEEN: [Seen; 6] = [
    |u, v| DVec3::new(1.0, -v, u),
    |u, v| DVec3::new(-1.0, -v, -u),
    |u, v| DVec3::new(u, 1.0, -v),
    |u, v| DVec3::new(u, -1.0, v),
    |u, v| DVec3::new(-u, -v, 1.0),
    |u, v| DVec3::new(u, -v, -1.0),
];

const SIDE: u32 = 8;

/// The light at a pixel of a picture with the given faces at the given places; black where
/// there is none.
fn laid(x: u32, y: u32, faces: &[([u32; 2], Seen)]) -> [f32; 3] {
    let at = [x / SIDE, y / SIDE];
    let own = [x, y].map(|k| (f64::from(k % SIDE) + 0.5) / f64::from(SIDE) * 2.0 - 1.0);
    match faces.iter().find(|(place, _)| *place == at) {
        Some((_, seen)) => light(seen(own[0], own[1])),
        None => [0.0; 3],
    }
}

fn cube(bytes: &[u8], options: &EnvironmentOptions) -> CubePicture {
    match decode_environment(bytes, options).unwrap() {
        EnvironmentPicture::Cube(cube) => cube,
        EnvironmentPicture::Equirectangular(_) => panic!("no cube"),
    }
}

#[test]
fn every_layout_shows_each_direction_where_it_is() {
    let options = EnvironmentOptions::default();
    let all = |place: fn(u32) -> [u32; 2]| -> Vec<([u32; 2], Seen)> {
        (0..).map(place).zip(SEEN).collect()
    };
    let cross = |back: ([u32; 2], Seen)| {
        vec![
            ([2, 1], SEEN[0]),
            ([0, 1], SEEN[1]),
            ([1, 0], SEEN[2]),
            ([1, 2], SEEN[3]),
            back,
            ([1, 1], SEEN[5]),
        ]
    };
    // Below -y the face behind is upside down.
    let behind: Seen = |u, v| DVec3::new(u, v, 1.0);
    for (layout, size, faces) in [
        (Layout::Column, [1, 6], all(|face| [0, face])),
        (Layout::Row, [6, 1], all(|face| [face, 0])),
        (Layout::Cross, [4, 3], cross(([3, 1], SEEN[4]))),
        (Layout::TallCross, [3, 4], cross(([1, 3], behind))),
    ] {
        let bytes = hdr(size.map(|faces| faces * SIDE), |x, y| laid(x, y, &faces));
        assert_shows(&cube(&bytes, &options));
        let asked = EnvironmentOptions {
            layout: Some(layout),
            ..options
        };
        assert_eq!(cube(&bytes, &asked), cube(&bytes, &options), "{layout:?}");
    }
}

#[test]
fn six_files_are_a_cube() {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = (0..6)
        .map(|face| folder.path().join(format!("{face}.hdr")))
        .collect();
    let textures: [Seen; 6] = [
        |s, t| DVec3::new(1.0, -t, -s),
        |s, t| DVec3::new(-1.0, -t, s),
        |s, t| DVec3::new(s, 1.0, t),
        |s, t| DVec3::new(s, -1.0, -t),
        |s, t| DVec3::new(s, -t, 1.0),
        |s, t| DVec3::new(-s, -t, -1.0),
    ];
    for (path, seen) in paths.iter().zip(textures) {
        let bytes = hdr([SIDE; 2], |x, y| laid(x, y, &[([0, 0], seen)]));
        std::fs::write(path, bytes).unwrap();
    }
    let options = EnvironmentOptions {
        faces: FaceOrder::CubeTexture,
        ..EnvironmentOptions::default()
    };
    let each: [&std::path::Path; 6] = std::array::from_fn(|face| paths[face].as_path());
    assert_shows(&load_faces(each, &options).unwrap());
    // One of another size, and one that is no square.
    for (size, square) in [([4, 4], true), ([8, 4], false)] {
        std::fs::write(&paths[3], hdr(size, |_, _| [1.0; 3])).unwrap();
        match load_faces(each, &options) {
            Err(EnvironmentError::Faces { size: 4, .. }) => assert!(square),
            Err(EnvironmentError::Shape { .. }) => assert!(!square),
            other => panic!("{other:?}"),
        }
    }
    std::fs::remove_file(&paths[3]).unwrap();
    let missing = load_faces(each, &options).unwrap_err();
    assert!(matches!(missing, EnvironmentError::Io { .. }), "{missing}");
}

#[test]
fn what_is_no_picture_of_all_directions_is_refused() {
    let options = EnvironmentOptions::default();
    let refused = |bytes: &[u8], options: &EnvironmentOptions| {
        decode_environment(bytes, options).unwrap_err()
    };
    for bytes in [&b""[..], b"PNG", b"\x89PNG\r\n", b"#?"] {
        assert!(matches!(
            refused(bytes, &options),
            EnvironmentError::UnknownFormat
        ));
    }
    let odd = hdr([7, 5], |_, _| [1.0; 3]);
    assert!(matches!(
        refused(&odd, &options),
        EnvironmentError::Shape {
            width: 7,
            height: 5,
            ..
        }
    ));
    let cross = EnvironmentOptions {
        layout: Some(Layout::Cross),
        ..options
    };
    assert!(matches!(
        refused(&odd, &cross),
        EnvironmentError::Shape { .. }
    ));
    let small = EnvironmentOptions {
        max_bytes: 1000,
        ..options
    };
    let whole = hdr([16, 8], |_, _| [1.0; 3]);
    match refused(&whole, &small) {
        EnvironmentError::TooLarge { bytes, limit } => {
            assert_eq!((bytes, limit), (16 * 8 * 28, 1000));
        }
        other => panic!("{other}"),
    }
    // A header that promises more than there can be: refused before anything is made.
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n";
    let error = refused(huge, &options);
    assert!(
        matches!(
            error,
            EnvironmentError::TooLarge { .. } | EnvironmentError::Hdr(_)
        ),
        "{error}"
    );
    // Cut off anywhere.
    for length in 11..whole.len() {
        let _ = refused(&whole[..length], &options);
    }
    // Faces larger than effects take.
    let long = hdr([6 * 4100, 4100 / 100], |_, _| [1.0; 3]);
    assert!(matches!(
        refused(&long, &options),
        EnvironmentError::Shape { .. }
    ));
}

/// Any bytes give a picture or an error, and never a panic.
#[test]
fn damaged_files_are_errors() {
    let whole = hdr([32, 16], |x, y| [x as f32, y as f32, 1.0]);
    let options = EnvironmentOptions {
        max_bytes: 1 << 24,
        ..EnvironmentOptions::default()
    };
    let mut random = Random::new(7);
    let mut errors = 0;
    for _ in 0..2000 {
        let mut bytes = whole.clone();
        for _ in 0..1 + random.bits() % 4 {
            let at = random.bits() as usize % bytes.len();
            bytes[at] = random.bits() as u8;
        }
        errors += u32::from(decode_environment(&bytes, &options).is_err());
    }
    assert!(errors > 100, "{errors}");
}

/// A mean difference along edges of neighbouring faces, relative to the light there.
fn seams(cube: &CubePicture) -> f64 {
    let side = cube.side();
    let size = f64::from(side);
    let texel = |face: u32, x: u32, y: u32| {
        let [r, g, b, _] = cube.image().texel(x, y, face, 0).unwrap().to_f64();
        DVec3::new(r, g, b)
    };
    let (mut apart, mut all) = (0.0, 0.0);
    for face in 0..FACES {
        for k in 0..side {
            for (x, y, out) in [
                (0, k, DVec2::new(-1.0 - 0.5 / size, 0.0)),
                (side - 1, k, DVec2::new(1.0 + 0.5 / size, 0.0)),
                (k, 0, DVec2::new(0.0, -1.0 - 0.5 / size)),
                (k, side - 1, DVec2::new(0.0, 1.0 + 0.5 / size)),
            ] {
                let along = (f64::from(k) + 0.5) / size * 2.0 - 1.0;
                let at = DVec2::select(out.cmpeq(DVec2::ZERO), DVec2::splat(along), out);
                let way = face_direction(face, at);
                // The nearest texel of any other face.
                let mut best = (f64::MAX, DVec3::ZERO);
                for other in (0..FACES).filter(|&other| other != face) {
                    let ahead = face_direction(other, DVec2::ZERO);
                    if way.dot(ahead) <= 0.0 {
                        continue;
                    }
                    let met = way / way.dot(ahead);
                    let place = DVec2::new(
                        met.dot(face_direction(other, DVec2::X) - ahead),
                        met.dot(face_direction(other, DVec2::Y) - ahead),
                    );
                    let outside = place.abs().max_element();
                    let own =
                        ((place * 0.5 + 0.5) * size).clamp(DVec2::ZERO, DVec2::splat(size - 1.0));
                    if outside < best.0 {
                        best = (outside, texel(other, own.x as u32, own.y as u32));
                    }
                }
                let own = texel(face, x, y);
                apart += (own - best.1).abs().element_sum();
                all += (own + best.1).element_sum();
            }
        }
    }
    apart / all
}

#[test]
fn a_cube_of_openexr_hangs_together() {
    let Some(path) = input("exr/stage-env-cube.exr") else {
        eprintln!("ETALON_INPUTS has no exr/stage-env-cube.exr");
        return;
    };
    let load = |faces| {
        let options = EnvironmentOptions {
            faces,
            ..EnvironmentOptions::default()
        };
        match load_environment(&path, &options).unwrap() {
            EnvironmentPicture::Cube(cube) => cube,
            EnvironmentPicture::Equirectangular(_) => panic!("no cube"),
        }
    };
    let cube = load(FaceOrder::Seen);
    assert_eq!(cube.side(), 256);
    // Half a texel from the edge on either side.
    let (right, wrong) = (seams(&cube), seams(&load(FaceOrder::CubeTexture)));
    println!("along edges {right}, with faces turned otherwise {wrong}");
    assert!(right < 0.1 && wrong > 4.0 * right, "{right}, {wrong}");
    let map = EnvironmentPicture::Cube(cube).map(64).unwrap();
    assert!(map.irradiance().at(DVec3::Y).min_element() > 0.0);
}

#[test]
fn a_radiance_file_is_a_picture() {
    let Some(path) = input("hdr/spiaggia-di-mondello-1k.hdr") else {
        eprintln!("ETALON_INPUTS has no hdr/spiaggia-di-mondello-1k.hdr");
        return;
    };
    let picture = load_environment(&path, &EnvironmentOptions::default()).unwrap();
    let EnvironmentPicture::Equirectangular(image) = &picture else {
        panic!("no picture of 2 : 1");
    };
    assert_eq!(
        (image.desc.extent.width, image.desc.extent.height),
        (1024, 512)
    );
    let texels = image.to_rgba_f32().unwrap();
    assert!(
        texels
            .iter()
            .flatten()
            .all(|value| value.is_finite() && *value >= 0.0)
    );
    let map = picture.map(64).unwrap();
    // A beach under a sky: more light from above than from below.
    let [above, below] = [DVec3::Y, DVec3::NEG_Y].map(|n| map.irradiance().at(n).element_sum());
    assert!(above > 1.2 * below && below > 0.0, "{above}, {below}");
}

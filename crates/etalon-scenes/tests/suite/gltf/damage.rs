//! glTF files that were cut off, damaged, or lie.

use crate::common;

use common::Random;
use common::gltf_files::{Binary, base64, everything, glb, png};
use etalon_scenes::model::gltf::{GltfError, GltfOptions, decode_gltf};
use etalon_scenes::model::{Model, ModelError};

/// A small limit, so that a damaged number can ask for little.
const OPTIONS: GltfOptions = GltfOptions { max_bytes: 1 << 22 };

fn decode(bytes: &[u8]) -> Result<Model, GltfError> {
    let result = decode_gltf(bytes, &OPTIONS);
    // Whatever is a model can be posed, or says why not.
    if let Ok(model) = &result {
        let _ = model.at(0.3);
    }
    result
}

#[test]
fn files_cut_off_anywhere_are_errors() {
    let (binary, rest) = everything();
    let good = binary.glb(&rest);
    assert!(decode(&good).is_ok());
    for length in 0..good.len() {
        assert!(decode(&good[..length]).is_err(), "{length}");
    }
    // The same with lengths that admit it: the binary data is too short.
    let json = binary.json("", &rest);
    for length in 0..binary.bytes.len() {
        assert!(
            decode(&glb(json.as_bytes(), &binary.bytes[..length / 4 * 4])).is_err(),
            "{length}"
        );
    }
    for length in 0..json.len() {
        assert!(
            decode(&glb(&json.as_bytes()[..length], &binary.bytes)).is_err(),
            "{length}"
        );
    }
}

#[test]
fn damaged_bytes_are_errors_or_models() {
    let (binary, rest) = everything();
    let good = binary.glb(&rest);
    let mut random = Random::new(20);
    let (mut models, mut errors) = (0, 0);
    for _ in 0..6000 {
        let mut damaged = good.clone();
        for _ in 0..1 + random.bits() % 3 {
            let place = random.bits() as usize % damaged.len();
            damaged[place] = match random.bits() % 4 {
                0 => 0,
                1 => 255,
                2 => damaged[place] ^ (1 << (random.bits() % 8)),
                _ => b"0123456789-e[]{},:\" ."[random.bits() as usize % 21],
            };
        }
        match decode(&damaged) {
            Ok(_) => models += 1,
            Err(_) => errors += 1,
        }
    }
    assert!(
        models > 300 && errors > 300,
        "{models} models, {errors} errors"
    );
}

#[test]
fn damaged_numbers_are_errors_or_models() {
    let (binary, rest) = everything();
    let json = binary.json("", &rest);
    // Where numbers stand in the text.
    let digit = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let mut numbers = Vec::new();
    let mut start = None;
    for (i, c) in json.char_indices() {
        match (digit(c), start) {
            (true, None) if json[..i].ends_with([':', ',', '[']) => start = Some(i),
            (false, Some(from)) => {
                numbers.push(from..i);
                start = None;
            }
            _ => {}
        }
    }
    assert!(numbers.len() > 150, "{}", numbers.len());
    let mut random = Random::new(21);
    let values = [
        "0",
        "1",
        "2",
        "3",
        "-1",
        "0.5",
        "1e30",
        "1e39",
        "-1e300",
        "255",
        "256",
        "65535",
        "5121",
        "5125",
        "5126",
        "2147483648",
        "4294967295",
        "4294967296",
        "18446744073709551615",
        "1e-40",
        "null",
        "[]",
        "\"x\"",
    ];
    let (mut models, mut errors) = (0, 0);
    for round in 0..numbers.len() * values.len() {
        let mut damaged = json.clone();
        // Every number once by every value, and sometimes another one as well.
        damaged.replace_range(
            numbers[round % numbers.len()].clone(),
            values[round / numbers.len()],
        );
        if round % 5 == 0 {
            let other = numbers[random.bits() as usize % numbers.len()].clone();
            if other.end < damaged.len()
                && damaged.is_char_boundary(other.start)
                && damaged.is_char_boundary(other.end)
            {
                damaged.replace_range(other, values[random.bits() as usize % values.len()]);
            }
        }
        match decode(&glb(damaged.as_bytes(), &binary.bytes)) {
            Ok(_) => models += 1,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                errors += 1;
            }
        }
    }
    assert!(
        models > 300 && errors > 300,
        "{models} models, {errors} errors"
    );
}

/// A mesh whose positions are an accessor with this JSON, over 48 bytes.
fn with_accessor(json: &str) -> Result<Model, GltfError> {
    let mut binary = Binary::default();
    binary.view(&[0; 48]);
    let positions = binary.raw(json.into());
    let rest =
        format!(r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}}}}]}}]"#);
    decode(&binary.glb(&rest))
}

#[test]
fn lying_accessors_are_caught_before_allocation() {
    let accessor = |rest: &str| format!(r#"{{"type":"VEC3","componentType":5126,{rest}}}"#);
    assert!(with_accessor(&accessor(r#""bufferView":0,"count":3"#)).is_ok());
    for rest in [
        r#""bufferView":0,"count":5"#,
        r#""bufferView":0,"count":3,"byteOffset":16"#,
        r#""bufferView":0,"count":0"#,
        r#""bufferView":0,"count":4000000000"#,
        r#""bufferView":0,"count":18446744073709551615"#,
        r#""bufferView":0,"count":3,"byteOffset":18446744073709551615"#,
        r#""bufferView":7,"count":3"#,
    ] {
        let result = with_accessor(&accessor(rest));
        assert!(
            matches!(result, Err(GltfError::Accessor { accessor: 0, .. })),
            "{rest}: {result:?}"
        );
    }
    // Zeros need no buffer, but memory.
    for count in ["4000000000", "18446744073709551615"] {
        let result = with_accessor(&accessor(&format!(r#""count":{count}"#)));
        assert!(
            matches!(result, Err(GltfError::TooLarge { .. })),
            "{result:?}"
        );
    }
    for json in [
        r#"{"type":"VEC2","componentType":5126,"bufferView":0,"count":3}"#,
        r#"{"type":"VEC3","componentType":5121,"bufferView":0,"count":3}"#,
        r#"{"type":"VEC9","componentType":5126,"bufferView":0,"count":3}"#,
        r#"{"type":"VEC3","componentType":17,"bufferView":0,"count":3}"#,
    ] {
        assert!(
            matches!(with_accessor(json), Err(GltfError::Accessor { .. })),
            "{json}"
        );
    }
    // One small accessor many times over.
    let mut binary = Binary::default();
    let positions = binary.floats(&[[0.0_f32; 3]; 3000]);
    let primitive = format!(r#"{{"attributes":{{"POSITION":{positions}}}}}"#);
    let rest = format!(
        r#""meshes":[{{"primitives":[{}]}}]"#,
        vec![primitive; 200].join(",")
    );
    assert!(matches!(
        decode(&binary.glb(&rest)),
        Err(GltfError::TooLarge { .. })
    ));
}

#[test]
fn lying_images_are_caught_before_allocation() {
    // The header of a PNG file of 2 × 2 texels, changed.
    let promise = |width: u32, height: u32| {
        let mut bytes = png();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let mut crc = u32::MAX;
        for &byte in &bytes[12..29] {
            crc ^= u32::from(byte);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
            }
        }
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        let uri = base64(&bytes);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"data:image/png;base64,{uri}"}}]}}"#
        );
        decode_gltf(json.as_bytes(), &GltfOptions::default()).map(|_| ())
    };
    assert!(promise(2, 2).is_ok());
    for (width, height) in [
        (16_384, 16_384),
        (1 << 20, 1),
        (u32::MAX >> 1, u32::MAX >> 1),
        (0, 0),
        (4000, 4000),
    ] {
        let result = promise(width, height);
        assert!(
            matches!(result, Err(GltfError::Image { image: 0, .. })),
            "{width}×{height}: {result:?}"
        );
    }
    // Within what the bytes could hold, but they do not.
    assert!(matches!(promise(100, 100), Err(GltfError::Image { .. })));
}

/// A quad, changed in the text of its JSON.
fn changed(from: &str, to: &str) -> GltfError {
    let (binary, rest) = everything();
    assert!(rest.contains(from), "{from}");
    decode(&binary.glb(&rest.replacen(from, to, 1))).unwrap_err()
}

#[test]
fn broken_references_say_where_they_are() {
    for (from, to, text) in [
        (
            r#""children":[2]"#,
            r#""children":[9]"#,
            "a child of node 1 is node 9, but the file has 6",
        ),
        (
            r#""children":[1,3,4]"#,
            r#""children":[1,2,3,4]"#,
            "node 2 is a child of node 0 and of node 1",
        ),
        (
            r#""mesh":0,"skin":0"#,
            r#""mesh":3,"skin":0"#,
            "the mesh of node 0 is mesh 3, but the file has 1",
        ),
        (r#""scene":0"#, r#""scene":4"#, "the scene is scene 4"),
        (
            r#""source":0,"#,
            r#""source":2,"#,
            "the image of texture 0 is image 2",
        ),
        (
            r#""sampler":0}"#,
            r#""sampler":5}"#,
            "the sampler of texture 0 is sampler 5",
        ),
        (
            r#""material":0"#,
            r#""material":8"#,
            "the material of mesh 0, primitive 0 is material 8",
        ),
        (r#""camera":0"#, r#""camera":8"#, "camera 8"),
        (r#""light":1"#, r#""light":8"#, "light 8"),
        (r#""index":0}"#, r#""index":6}"#, "texture 6"),
        (r#""joints":[1,2]"#, r#""joints":[1,77]"#, "node 77"),
        (r#""joints":[1,2]"#, r#""joints":[1]"#, "needs 2 joints"),
        (r#""yfov":0.8"#, r#""yfov":4"#, "vertical field of view"),
        (r#""ior":1.33"#, r#""ior":0.3"#, "index of refraction"),
        (r#""MASK""#, r#""MUSK""#, "alpha mode"),
        (r#""texCoord":1}}"#, r#""texCoord":5}}"#, "0 or 1"),
        (
            r#""path":"translation""#,
            r#""path":"rotation""#,
            "4 components",
        ),
        (
            r#""node":2,"path":"rotation""#,
            r#""node":4,"path":"rotation""#,
            "whose transform is a matrix",
        ),
    ] {
        let message = changed(from, to).to_string();
        assert!(message.contains(text), "{to}: {message}");
    }
    // A node below itself, by itself and by another.
    for children in ["[1]", "[0]"] {
        let error = changed(
            r#"{"name":"a","children":[2]}"#,
            &format!(r#"{{"name":"a","children":{children}}}"#),
        );
        let message = error.to_string();
        assert!(
            message.contains("its own ancestor") || message.contains("a child of node"),
            "{message}"
        );
    }
    let error = changed(
        r#""children":[1,3,4]},{"name":"a","children":[2]}"#,
        r#""children":[3,4]},{"name":"a","children":[1,2]}"#,
    );
    assert!(
        matches!(&error, GltfError::Model(model) if matches!(**model, ModelError::Cycle(_))),
        "{error}"
    );
}

#[test]
fn numbers_that_are_none_are_refused() {
    for (value, right) in [(1.0, true), (f32::NAN, false), (f32::INFINITY, false)] {
        let mut binary = Binary::default();
        let positions = binary.floats(&[[0.0, 0.0, 0.0], [value, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let normals = binary.floats(&[[0.0, 0.0, value]; 3]);
        for attributes in [
            format!(r#""POSITION":{positions}"#),
            format!(r#""POSITION":{positions},"NORMAL":{normals}"#),
        ] {
            let rest = format!(
                r#""meshes":[{{"name":"m","primitives":[{{"attributes":{{{attributes}}}}}]}}]"#
            );
            let result = decode(&binary.glb(&rest));
            assert_eq!(result.is_ok(), right);
            if let Err(error) = result {
                assert!(
                    error.to_string().contains("position 1 of mesh \"m\""),
                    "{error}"
                );
            }
        }
    }
    // An index beyond the vertices, with and without normals to compute.
    let mut binary = Binary::default();
    let positions = binary.floats(&[[0.0_f32; 3]; 3]);
    let indices = binary.indices(&[0, 1, 3]);
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices}}}]}}]"#
    );
    let message = decode(&binary.glb(&rest)).unwrap_err().to_string();
    assert!(
        message.contains("triangle 0 of mesh is vertex 3, but there are 3"),
        "{message}"
    );
    let pair = binary.indices(&[0, 1]);
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{pair}}}]}}]"#
    );
    assert!(
        decode(&binary.glb(&rest))
            .unwrap_err()
            .to_string()
            .contains("a multiple of 3")
    );
}

#[test]
fn many_nodes_of_many_primitives_are_too_large() {
    let mut binary = Binary::default();
    let positions = binary.floats(&[[0.0_f32; 3]; 3]);
    let primitive = format!(r#"{{"attributes":{{"POSITION":{positions}}}}}"#);
    let rest = format!(
        r#""meshes":[{{"primitives":[{}]}}],"nodes":[{}]"#,
        vec![primitive; 1000].join(","),
        vec![r#"{"mesh":0}"#; 10_000].join(",")
    );
    let result = decode(&binary.glb(&rest));
    assert!(
        matches!(result, Err(GltfError::TooLarge { .. })),
        "{result:?}"
    );
}

#[test]
fn damaged_images_are_errors_or_images() {
    let mut random = Random::new(22);
    let texels: Vec<u8> = (0..48 * 40 * 3).map(|_| random.bits() as u8).collect();
    let picture = image::RgbImage::from_raw(48, 40, texels).unwrap();
    let (mut images, mut errors) = (0, 0);
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let mut good = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut good, format).unwrap();
        let good = good.into_inner();
        for round in 0..1000 {
            let mut damaged = good.clone();
            // Headers are the first bytes.
            for _ in 0..1 + random.bits() % 3 {
                let reach = if round % 2 == 0 { 700 } else { damaged.len() };
                let place = random.bits() as usize % reach.min(damaged.len());
                damaged[place] = random.bits() as u8;
            }
            if round % 7 == 0 {
                damaged.truncate(random.bits() as usize % damaged.len());
            }
            let uri = base64(&damaged);
            let json = format!(
                r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"data:image/png;base64,{uri}"}}]}}"#
            );
            match decode(json.as_bytes()) {
                Ok(_) => images += 1,
                Err(_) => errors += 1,
            }
        }
    }
    assert!(
        images > 100 && errors > 100,
        "{images} images, {errors} errors"
    );
}

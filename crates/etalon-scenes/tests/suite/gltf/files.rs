//! glTF files made here: what is read, and from where.

use crate::common;

use common::gltf_files::{Binary, base64, encoded, everything, glb, png};
use etalon_scenes::model::gltf::{GltfError, GltfOptions, decode_gltf, load_gltf};
use etalon_scenes::model::{
    AlphaMode, DrawClass, Filter, Interpolation, LightKind, Model, Transform, UvTransform, Values,
    Wrap,
};
use glam::{DVec3, Vec3};

fn decode(bytes: &[u8]) -> Result<Model, GltfError> {
    decode_gltf(bytes, &GltfOptions::default())
}

fn error(bytes: &[u8]) -> String {
    decode(bytes).unwrap_err().to_string()
}

#[test]
fn everything_in_a_file_arrives() {
    let (binary, rest) = everything();
    let model = decode(&binary.glb(&rest)).unwrap();
    let parts = model.parts();
    let mesh = &parts.meshes[0];
    let v = mesh.vertices();
    assert_eq!(
        (mesh.name(), mesh.triangles()),
        ("quad", &[[0, 1, 2], [0, 2, 3]][..])
    );
    assert_eq!(v.positions[2], [1.0, 1.0, 0.0]);
    // Of length 2, and of length 0.
    assert_eq!(v.normals, [[0.0, 0.0, 1.0]; 4]);
    assert_eq!(v.uv[1][1], [1.0, 0.0]);
    assert_eq!(v.uv[1][3], [128.0 / 255.0, 0.0]);
    assert_eq!(v.joints[0], [0, 1, 0, 0]);
    assert_eq!(v.weights[0], [1.0, 0.0, 0.0, 0.0]);
    assert_eq!(v.colours[3], [1.0, 0.5, 0.25, 1.0]);
    assert_eq!(v.tangents.len(), 4);
    let image = &parts.images[0];
    assert_eq!(
        (image.name(), image.width(), image.height()),
        ("four", 2, 2)
    );
    assert_eq!(image.rgba()[..8], [255, 0, 0, 255, 0, 255, 0, 255]);
    let sampler = parts.textures[0].sampler;
    assert_eq!(
        (sampler.wrap_u, sampler.wrap_v),
        (Wrap::Clamp, Wrap::Mirror)
    );
    assert_eq!(
        (sampler.magnify, sampler.minify),
        (Filter::Nearest, Filter::Linear)
    );
    assert_eq!(sampler.mip, Some(Filter::Nearest));
    let material = &parts.materials[0];
    assert_eq!(material.base_colour, [0.5, 0.25, 0.125, 1.0]);
    assert_eq!((material.metallic, material.roughness), (0.5, 0.25));
    assert_eq!(material.metallic_roughness_texture.unwrap().set, 1);
    let normal = material.normal_texture.unwrap();
    assert_eq!(
        (normal.texture, normal.set, material.normal_scale),
        (1, 1, 0.5)
    );
    let transform = UvTransform {
        offset: [0.5, 0.25],
        rotation: 1.5,
        scale: [2.0, 3.0],
    };
    assert_eq!(normal.transform, transform);
    assert_eq!(material.occlusion_strength, 0.75);
    assert_eq!(
        material.emissive_texture.unwrap().transform.scale,
        [4.0, 4.0]
    );
    assert_eq!(
        (material.emissive, material.emissive_strength),
        ([1.0, 0.5, 0.0], 5.0)
    );
    assert_eq!(material.alpha, AlphaMode::Mask { cutoff: 0.25 });
    assert!(material.double_sided);
    assert_eq!((material.transmission, material.ior), (0.9, 1.33));
    assert_eq!(
        (
            material.volume.thickness,
            material.volume.attenuation_distance
        ),
        (0.1, 2.0)
    );
    assert_eq!(parts.lights[0].kind, LightKind::Directional);
    assert_eq!(
        parts.lights[1].kind,
        LightKind::Spot {
            inner: 0.2,
            outer: 0.6
        }
    );
    assert_eq!(
        (parts.lights[1].intensity, parts.lights[1].range),
        (70.0, Some(9.0))
    );
    assert_eq!(parts.skins[0].joints, [1, 2]);
    assert_eq!(parts.skins[0].inverse_bind[1][0], 2.0);
    assert_eq!(
        parts.nodes[4].transform,
        Transform::Matrix(glam::Mat4::from_translation(Vec3::X * 7.0).to_cols_array())
    );
    assert!(parts.nodes[5].parts.is_empty() && parts.nodes[5].name == "hidden");
    let tracks = &parts.animations[0].tracks;
    assert_eq!(
        tracks[1].values,
        Values::Rotation(vec![[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]])
    );
    assert_eq!(tracks[2].interpolation, Interpolation::CubicSpline);

    let snapshot = model.at(0.5).unwrap();
    assert_eq!(snapshot.instances.of(DrawClass::Dynamic).len(), 1);
    assert_eq!(snapshot.cameras.len(), 1);
    assert_eq!(snapshot.cameras[0].pose().position(), DVec3::Z * 5.0);
    // Half way between two key frames, under the parent's half of 2.
    let joint = snapshot.nodes[2];
    assert_eq!(joint.w_axis.truncate(), Vec3::new(0.0, 2.0, 0.0));
    assert_eq!(joint.y_axis.truncate(), Vec3::Y * 1.5);
}

/// A triangle without anything but positions.
fn bare(binary: &mut Binary) -> usize {
    binary.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 1.0],
    ])
}

#[test]
fn strips_and_fans_become_triangles_that_wind_alike() {
    let mut binary = Binary::default();
    let positions = bare(&mut binary);
    for (mode, expected) in [
        (5, vec![[0.0, 0.0, 1.0], [-1.0, -1.0, 0.0]]),
        (6, vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    ] {
        let rest = format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"mode":{mode}}}]}}],"nodes":[{{"mesh":0}}]"#
        );
        let model = decode(&binary.glb(&rest)).unwrap();
        let mesh = &model.parts().meshes[0];
        assert_eq!(mesh.triangles(), [[0, 1, 2], [3, 4, 5]]);
        for (normal, expected) in [0, 3]
            .map(|i| mesh.vertices().normals[i])
            .iter()
            .zip(expected)
        {
            let expected = Vec3::from_array(expected).normalize();
            assert!(
                (Vec3::from_array(*normal) - expected).length() < 1e-6,
                "{mode}: {normal:?}"
            );
        }
        // Without a material, glTF's default one.
        assert_eq!(model.parts().materials.len(), 1);
    }
    for mode in [0, 1, 3] {
        let rest = format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"mode":{mode}}}]}}]"#
        );
        assert!(matches!(
            decode(&binary.glb(&rest)),
            Err(GltfError::Unsupported(_))
        ));
    }
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut binary = Binary::default();
    let base = binary.view(
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .as_flattened()
            .iter()
            .flat_map(|x: &f32| x.to_le_bytes())
            .collect::<Vec<_>>(),
    );
    let indices = binary.view(&[2]);
    let values = binary.view(&[0.0_f32, 5.0, 0.0].map(f32::to_le_bytes).concat());
    let sparse = |base: &str, index: usize| {
        format!(
            r#"{{{base}"count":3,"type":"VEC3","componentType":5126,"sparse":{{"count":1,"indices":{{"bufferView":{index},"componentType":5121}},"values":{{"bufferView":{values}}}}}}}"#
        )
    };
    let with = binary.raw(sparse(&format!(r#""bufferView":{base},"#), indices));
    let without = binary.raw(sparse("", indices));
    let rest = |positions: usize| {
        format!(r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}}}}]}}]"#)
    };
    let positions = |accessor: usize| {
        let model = decode(&binary.glb(&rest(accessor))).unwrap();
        model.parts().meshes[0].vertices().positions.clone()
    };
    assert_eq!(
        positions(with),
        [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 5.0, 0.0]]
    );
    assert_eq!(positions(without), [[0.0; 3], [0.0; 3], [0.0, 5.0, 0.0]]);
    let mut beyond = Binary::default();
    beyond.view(&[0; 36]);
    let indices = beyond.view(&[3]);
    beyond.view(&[0; 12]);
    let bad = beyond.raw(sparse(r#""bufferView":0,"#, indices));
    assert!(error(&beyond.glb(&rest(bad))).contains("it replaces element 3, but there are 3"));
}

#[test]
fn buffers_and_images_come_from_files_and_data() {
    let (binary, rest) = everything();
    let expected = decode(&binary.glb(&rest)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    std::fs::write(folder.path().join("a b.bin"), &binary.bytes).unwrap();
    std::fs::write(folder.path().join("maps/red.png"), png()).unwrap();
    let options = GltfOptions::default();
    let load = |json: &str| {
        let path = folder.path().join("model.gltf");
        std::fs::write(&path, json).unwrap();
        load_gltf(&path, &options)
    };
    let json = binary.json(r#""uri":"a%20b.bin","#, &rest);
    assert_eq!(load(&json).unwrap(), expected);
    let data = format!(
        r#""uri":"data:application/octet-stream;base64,{}","#,
        base64(&binary.bytes)
    );
    assert_eq!(load(&binary.json(&data, &rest)).unwrap(), expected);
    assert_eq!(
        decode(binary.json(&data, &rest).as_bytes()).unwrap(),
        expected
    );

    // An image of its own, as a file and as data of either format.
    let picture = |uri: &str| {
        let start = rest.find(r#"{"bufferView""#).unwrap();
        let end = start + rest[start..].find('}').unwrap();
        format!(
            r#"{}{{"name":"four","uri":"{uri}"{}"#,
            &rest[..start],
            &rest[end..]
        )
    };
    assert_eq!(
        load(&binary.json(&data, &picture("maps/red.png"))).unwrap(),
        expected
    );
    let uri = format!("data:image/png;base64,{}", base64(&png()));
    assert_eq!(load(&binary.json(&data, &picture(&uri))).unwrap(), expected);
    let uri = format!(
        "data:image/jpeg;base64,{}",
        base64(&encoded(image::ImageFormat::Jpeg))
    );
    let jpeg = load(&binary.json(&data, &picture(&uri))).unwrap();
    assert_eq!(
        (
            jpeg.parts().images[0].width(),
            jpeg.parts().images[0].rgba()[3]
        ),
        (2, 255)
    );

    for uri in [
        "../a.png",
        "maps/../../a.png",
        "/etc/hostname",
        "%2e%2e/a.png",
        "http://a/b.png",
        "C:/a.png",
        "..\\\\a.png",
        "",
    ] {
        let result = load(&binary.json(&data, &picture(uri)));
        assert!(
            matches!(result, Err(GltfError::Uri { .. })),
            "{uri}: {result:?}"
        );
    }
    let result = load(&binary.json(&data, &picture("missing.png")));
    assert!(matches!(result, Err(GltfError::Io { .. })), "{result:?}");
    let result = load(&binary.json(&data, &picture("maps")));
    assert!(matches!(result, Err(GltfError::Io { .. })), "{result:?}");
    // From bytes alone there is no folder.
    let result = decode(json.as_bytes());
    assert!(matches!(result, Err(GltfError::Uri { .. })), "{result:?}");
    // Data that is none, and images that are none.
    for (uri, text) in [
        ("data:image/png;base64,#", "base64"),
        ("data:image/png;base64", "base64"),
        ("data:image/png,abc", "neither PNG nor JPEG"),
        ("data:image/png;base64,iVBORw0KGgo=", "image 0"),
    ] {
        let message = load(&binary.json(&data, &picture(uri)))
            .unwrap_err()
            .to_string();
        assert!(message.contains(text), "{message}");
    }
    // A file that is shorter than its buffer says.
    std::fs::write(folder.path().join("a b.bin"), &binary.bytes[1..]).unwrap();
    assert!(matches!(load(&json), Err(GltfError::Malformed(_))));
    #[cfg(unix)]
    {
        // A link that leads out of the folder.
        let outside = tempfile::tempdir().unwrap();
        std::fs::write(outside.path().join("red.png"), png()).unwrap();
        let link = folder.path().join("link.png");
        std::os::unix::fs::symlink(outside.path().join("red.png"), link).unwrap();
        let result = load(&binary.json(&data, &picture("link.png")));
        assert!(matches!(result, Err(GltfError::Uri { .. })), "{result:?}");
    }
    let missing = load_gltf(&folder.path().join("none.gltf"), &options);
    assert!(matches!(missing, Err(GltfError::Io { .. })));
}

#[test]
fn containers_are_checked() {
    let (binary, rest) = everything();
    let good = binary.glb(&rest);
    // An unknown chunk at the end is skipped.
    let mut longer = good.clone();
    longer.extend_from_slice(&[4, 0, 0, 0, b'X', b'Y', b'Z', b'W', 1, 2, 3, 4]);
    let length = longer.len() as u32;
    longer[8..12].copy_from_slice(&length.to_le_bytes());
    assert!(decode(&longer).is_ok());
    let with = |place: usize, word: u32| {
        let mut bytes = good.clone();
        bytes[place..place + 4].copy_from_slice(&word.to_le_bytes());
        error(&bytes)
    };
    assert!(with(4, 1).contains("container version 1"));
    for length in [0, 1, 11, 12, 19, 20] {
        assert!(
            with(8, length).contains("not a valid glTF file"),
            "{length}"
        );
    }
    assert!(with(8, u32::MAX).contains("its header says 4294967295 bytes"));
    assert!(with(12, u32::MAX).contains("the chunk at byte 12 is cut off"));
    assert!(with(16, 7).contains("out of order"));
    assert!(error(&glb(b"{}", &[])).contains("asset"));
    for (json, text) in [
        (r#"{"asset":{"version":"1.0"}}"#, "version 1.0"),
        (
            r#"{"asset":{"version":"2.9","minVersion":"2.9"}}"#,
            "version 2.9",
        ),
        (
            r#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}"#,
            "KHR_draco",
        ),
        (
            r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":4}]}"#,
            "neither a URI nor a binary chunk",
        ),
        ("", "EOF"),
        ("no glTF", "expected"),
    ] {
        assert!(
            error(json.as_bytes()).contains(text),
            "{}",
            error(json.as_bytes())
        );
    }
    assert!(decode(br#"{"asset":{"version":"2.0"}}"#).is_ok());
}

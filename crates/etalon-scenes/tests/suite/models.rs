//! Models: what is refused, and what a snapshot says.

use etalon_scenes::model::{
    Animation, DrawClass, Image, Instance, Interpolation, Light, LightKind, Material, Mesh, Model,
    ModelError, ModelParts, Moment, Node, Skin, TextureUse, Track, Transform, Values, Vertices,
    Viewpoint, flat_normals, shapes,
};
use glam::{DVec3, Mat4, Vec3};

fn triangle() -> Vertices {
    Vertices {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        normals: vec![[0.0, 0.0, 1.0]; 3],
        ..Vertices::default()
    }
}

fn error<T: std::fmt::Debug>(result: Result<T, ModelError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn meshes_are_checked() {
    let mesh = |change: fn(&mut Vertices), triangles: &[[u32; 3]]| {
        let mut vertices = triangle();
        change(&mut vertices);
        Mesh::new("m", vertices, triangles.to_vec())
    };
    let good = &[[0, 1, 2]][..];
    assert!(mesh(|_| {}, good).is_ok() && mesh(|_| {}, &[]).is_ok());
    // Triangles without area are allowed.
    assert!(mesh(|_| {}, &[[0, 0, 0]]).is_ok());
    type Case = (fn(&mut Vertices), &'static str);
    let cases: [Case; 12] = [
        (|v| *v = Vertices::default(), "0 positions"),
        (|v| v.normals.clear(), "0 normals"),
        (
            |v| v.uv[1] = vec![[0.0; 2]; 2],
            "texture coordinates of set 1",
        ),
        (|v| v.positions[1][2] = f32::NAN, "position 1"),
        (|v| v.positions[2][0] = f32::INFINITY, "position 2"),
        (|v| v.normals[0] = [0.0; 3], "normal 0"),
        (|v| v.tangents = vec![[1.0, 0.0, 0.0, 0.5]; 3], "tangent 0"),
        (|v| v.colours = vec![[-1.0; 4]; 3], "colour 0"),
        (|v| v.uv[0] = vec![[f32::NAN; 2]; 3], "texture coordinate 0"),
        (|v| v.joints = vec![[0; 4]; 3], "0 weights"),
        (|v| v.weights = vec![[1.0, 0.0, 0.0, 0.0]; 3], "3 weights"),
        (
            |v| {
                v.joints = vec![[0; 4]; 3];
                v.weights = vec![[0.5, 0.0, 0.0, 0.0]; 3];
            },
            "weights 0",
        ),
    ];
    for (change, text) in cases {
        let message = error(mesh(change, good));
        assert!(
            message.contains(text) && message.contains("mesh \"m\""),
            "{message}"
        );
    }
    let message = error(mesh(|_| {}, &[[0, 1, 2], [0, 3, 1]]));
    assert_eq!(
        message,
        "triangle 1 of mesh \"m\" is vertex 3, but there are 3"
    );
}

#[test]
fn images_are_checked() {
    assert!(Image::new("i", 2, 3, vec![0; 24]).is_ok());
    for (width, height, bytes) in [(0, 1, 0), (1, 0, 0), (u32::MAX, u32::MAX, 4), (2, 3, 23)] {
        assert!(Image::new("i", width, height, vec![0; bytes]).is_err());
    }
}

fn parts() -> ModelParts {
    let mut parts = ModelParts::default();
    let mesh = parts.mesh(Mesh::new("m", triangle(), vec![[0, 1, 2]]).unwrap());
    let material = parts.material(Material::default());
    parts.node(Node::with_part("n", Transform::default(), mesh, material));
    parts
}

#[test]
fn models_are_checked() {
    assert!(Model::new(parts()).is_ok() && Model::new(ModelParts::default()).is_ok());
    let node = |change: fn(&mut Node)| {
        let mut parts = parts();
        change(&mut parts.nodes[0]);
        error(Model::new(parts))
    };
    for (message, text) in [
        (
            node(|n| n.parts[0].mesh = 7),
            "part of node 0 \"n\" is mesh 7, but there are 1",
        ),
        (node(|n| n.parts[0].material = 7), "material 7"),
        (node(|n| n.light = Some(0)), "light 0"),
        (node(|n| n.skin = Some(0)), "skin 0"),
        (node(|n| n.parent = Some(9)), "node 9"),
        (node(|n| n.parent = Some(0)), "its own ancestor"),
        (
            node(|n| n.transform = Transform::at([f32::NAN; 3])),
            "translation",
        ),
        (
            node(|n| n.transform = Transform::Matrix([1.0; 16])),
            "last row",
        ),
        (
            node(|n| {
                n.transform = Transform::Trs {
                    translation: [0.0; 3],
                    rotation: [0.0; 4],
                    scale: [1.0; 3],
                };
            }),
            "quaternion",
        ),
    ] {
        assert!(message.contains(text), "{message}");
    }
    let material = |change: fn(&mut Material)| {
        let mut parts = parts();
        parts.texture(
            Image::new("", 1, 1, vec![0; 4]).unwrap(),
            Default::default(),
        );
        change(&mut parts.materials[0]);
        error(Model::new(parts))
    };
    for (message, text) in [
        (material(|m| m.base_colour[3] = 1.5), "base colour"),
        (material(|m| m.roughness = f32::NAN), "roughness"),
        (material(|m| m.ior = 0.5), "index of refraction"),
        (
            material(|m| m.volume.attenuation_distance = 0.0),
            "attenuation distance",
        ),
        (
            material(|m| m.emissive_strength = -1.0),
            "emissive strength",
        ),
        (
            material(|m| m.normal_texture = Some(TextureUse::new(3))),
            "texture 3",
        ),
        (
            material(|m| m.base_colour_texture = Some(TextureUse::new(0))),
            "set 0 of texture coordinates, which mesh 0 \"m\" does not have",
        ),
        (
            material(|m| {
                m.emissive_texture = Some(TextureUse {
                    set: 2,
                    ..TextureUse::new(0)
                })
            }),
            "0 or 1",
        ),
    ] {
        assert!(message.contains(text), "{message}");
    }
    let mut tangentless = parts();
    let mut vertices = triangle();
    vertices.uv[0] = vec![[0.0; 2]; 3];
    tangentless.meshes[0] = Mesh::new("m", vertices, vec![[0, 1, 2]]).unwrap();
    tangentless.texture(
        Image::new("", 1, 1, vec![0; 4]).unwrap(),
        Default::default(),
    );
    tangentless.materials[0].normal_texture = Some(TextureUse::new(0));
    assert!(error(Model::new(tangentless)).contains("no tangents"));

    for kind in [
        LightKind::Spot {
            inner: 0.5,
            outer: 0.5,
        },
        LightKind::Spot {
            inner: -0.1,
            outer: 0.5,
        },
        LightKind::Spot {
            inner: 0.0,
            outer: 1.6,
        },
    ] {
        let mut parts = parts();
        let light = Light {
            name: String::new(),
            colour: [1.0; 3],
            intensity: 1.0,
            range: None,
            kind,
        };
        parts.light(light, Transform::default());
        assert!(error(Model::new(parts)).contains("cone angle"));
    }
    let mut skinned = parts();
    skinned.skins.push(Skin {
        joints: vec![0, 5],
        ..Skin::default()
    });
    assert!(error(Model::new(skinned.clone())).contains("joint 1 of skin 0 is node 5"));
    skinned.skins[0].joints = vec![0];
    skinned.nodes[0].skin = Some(0);
    assert!(error(Model::new(skinned)).contains("needs 0 joints"));
}

#[test]
fn long_cycles_are_found() {
    let mut parts = parts();
    for i in 0..1000 {
        parts.node(Node {
            name: format!("n{i}"),
            parent: Some(1 + (i + 1) % 1000),
            ..Node::default()
        });
    }
    // One that hangs on the cycle and is not in it.
    parts.nodes[0].parent = Some(1);
    let message = error(Model::new(parts));
    assert!(
        message.contains("its own ancestor") && !message.contains("node 0 "),
        "{message}"
    );
}

fn track(node: usize, values: Vec<[f32; 3]>) -> Track {
    Track {
        node,
        times: (0..values.len()).map(|i| i as f32).collect(),
        interpolation: Interpolation::Linear,
        values: Values::Translation(values),
    }
}

#[test]
fn animations_are_checked() {
    let with = |track: Track| {
        let mut parts = parts();
        parts.animations.push(Animation {
            name: "a".into(),
            tracks: vec![track],
        });
        error(Model::new(parts))
    };
    let good = || track(0, vec![[0.0; 3], [1.0; 3]]);
    for (message, text) in [
        (with(track(4, vec![[0.0; 3]])), "node 4"),
        (with(track(0, vec![])), "at least 1"),
        (
            with(Track {
                times: vec![1.0, 1.0],
                ..good()
            }),
            "key frame 1 of track 0",
        ),
        (
            with(Track {
                times: vec![-1.0, 1.0],
                ..good()
            }),
            "not negative",
        ),
        (
            with(Track {
                times: vec![0.0, f32::NAN],
                ..good()
            }),
            "key frame 1",
        ),
        (
            with(Track {
                times: vec![0.0],
                ..good()
            }),
            "2 values in a track",
        ),
        (
            with(Track {
                interpolation: Interpolation::CubicSpline,
                ..good()
            }),
            "3 for each of 2",
        ),
        (
            with(Track {
                values: Values::Rotation(vec![[0.0; 4]; 2]),
                ..good()
            }),
            "rotation 0",
        ),
    ] {
        assert!(
            message.contains(text) && message.contains("animation 0 \"a\""),
            "{message}"
        );
    }
    let mut twice = parts();
    twice.animations.push(Animation {
        name: String::new(),
        tracks: vec![good(), good()],
    });
    assert!(error(Model::new(twice)).contains("another track"));
    let mut matrix = parts();
    matrix.nodes[0].transform = Transform::Matrix(Mat4::IDENTITY.to_cols_array());
    matrix.animations.push(Animation {
        name: String::new(),
        tracks: vec![good()],
    });
    assert!(error(Model::new(matrix)).contains("whose transform is a matrix"));
}

/// A moving cart with a turned child, a lamp, a camera, a weapon and a rock.
fn cart() -> Model {
    let mut parts = ModelParts::default();
    let mesh = parts.mesh(shapes::cuboid("box", [0.5; 3]).unwrap());
    let material = parts.material(Material::dielectric("grey", [0.5; 3], 0.5));
    let rock = Node::with_part("rock", Transform::at([9.0, 0.0, 0.0]), mesh, material);
    parts.node(rock);
    let cart = parts.node(Node::with_part(
        "cart",
        Transform::default(),
        mesh,
        material,
    ));
    let child = Node::with_part(
        "child",
        Transform::turned([0.0, 1.0, 0.0], 1.0),
        mesh,
        material,
    );
    parts.node(Node {
        parent: Some(cart),
        ..child
    });
    let eye = parts.node(Node {
        parent: Some(cart),
        transform: Transform::at([0.0, 0.0, 5.0]),
        ..Node::default()
    });
    let weapon = Node::with_part("weapon", Transform::at([0.2, -0.2, -0.5]), mesh, material);
    parts.node(Node {
        parent: Some(eye),
        class: Some(DrawClass::Weapon),
        ..weapon
    });
    let lamp = Light {
        name: "lamp".into(),
        colour: [1.0; 3],
        intensity: 100.0,
        range: None,
        kind: LightKind::Spot {
            inner: 0.1,
            outer: 0.5,
        },
    };
    parts.light(
        lamp,
        Transform::turned([1.0, 2.0, 3.0], std::f32::consts::FRAC_PI_2),
    );
    parts.animations.push(Animation {
        name: "drive".into(),
        tracks: vec![track(cart, vec![[0.0; 3], [6.0, 0.0, 0.0]])],
    });
    parts.viewpoints.push(Viewpoint::Node {
        node: eye,
        vertical_fov: 1.0,
        near: 0.05,
    });
    Model::new(parts).unwrap()
}

#[test]
fn a_snapshot_has_this_frame_and_the_one_before() {
    let model = cart();
    let snapshot = model.at(0.5).unwrap();
    let names = |instances: &[Instance]| -> Vec<String> {
        let name = |i: &Instance| model.parts().nodes[i.node].name.clone();
        instances.iter().map(name).collect()
    };
    assert_eq!(
        names(snapshot.instances.all()),
        ["weapon", "rock", "cart", "child"]
    );
    assert_eq!(names(snapshot.instances.of(DrawClass::Weapon)), ["weapon"]);
    assert_eq!(names(snapshot.instances.of(DrawClass::Static)), ["rock"]);
    assert_eq!(
        names(snapshot.instances.of(DrawClass::Dynamic)),
        ["cart", "child"]
    );
    let child = snapshot.instances.of(DrawClass::Dynamic)[1];
    // 6 m/s, 1/60 s earlier: 0.1 m. Both are rounded to f32 once.
    assert!((child.world.w_axis.truncate() - Vec3::new(3.0, 1.0, 0.0)).length() < 1e-6);
    assert!((child.previous.w_axis.truncate() - Vec3::new(2.9, 1.0, 0.0)).length() < 1e-6);
    assert!(
        (child.world.x_axis.truncate() - Vec3::new(1.0_f32.cos(), 0.0, -1.0_f32.sin())).length()
            < 1e-6
    );
    let rock = snapshot.instances.of(DrawClass::Static)[0];
    assert_eq!(rock.world, rock.previous);
    let camera = snapshot.cameras[0];
    assert!((camera.pose().position() - DVec3::new(3.0, 0.0, 5.0)).length() < 1e-9);
    assert!((camera.previous_pose().position() - DVec3::new(2.9, 0.0, 5.0)).length() < 1e-9);
    assert_eq!(camera.near(), 0.05);
    let lamp = snapshot.lights[0];
    assert_eq!(lamp.position, Vec3::new(1.0, 2.0, 3.0));
    // −Z turned by a quarter about +Y.
    assert!((lamp.direction - Vec3::NEG_X).length() < 1e-6);
    // Without the animation everything stands.
    let still = model
        .at_moment(Moment {
            animation: None,
            time: 0.5,
            step: 1.0,
        })
        .unwrap();
    assert!(still.instances.all().iter().all(|i| i.world == i.previous));
    assert_eq!(still.instances.all()[2].world.w_axis.x, 0.0);
}

#[test]
fn impossible_moments_are_refused() {
    let model = cart();
    for time in [f64::NAN, f64::INFINITY] {
        assert!(error(model.at(time)).contains("time"));
    }
    let moment = Moment {
        animation: Some(1),
        time: 0.0,
        step: 0.1,
    };
    assert!(error(model.at_moment(moment)).contains("animation 1, but there are 1"));
    // Scales that multiply to more than f32 can hold.
    let mut parts = parts();
    let large = Transform::Trs {
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [1e30; 3],
    };
    parts.nodes[0].transform = large;
    parts.node(Node {
        parent: Some(0),
        transform: large,
        ..Node::default()
    });
    assert!(error(Model::new(parts).unwrap().at(0.0)).contains("matrix to the world of node 1"));
    let mut flat = parts_with_camera();
    flat.nodes[0].transform = Transform::Trs {
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.0; 3],
    };
    assert!(error(Model::new(flat).unwrap().at(0.0)).contains("viewpoint 0"));
}

fn parts_with_camera() -> ModelParts {
    let mut parts = parts();
    parts.viewpoints.push(Viewpoint::Node {
        node: 0,
        vertical_fov: 1.0,
        near: 0.1,
    });
    parts
}

#[test]
fn flat_normals_split_vertices() {
    let mut vertices = triangle();
    vertices.positions.push([0.0, 0.0, 1.0]);
    vertices.normals.clear();
    vertices.uv[0] = vec![[0.25, 0.5]; 4];
    let (flat, triangles) = flat_normals(&vertices, &[[0, 1, 2], [0, 2, 3], [0, 0, 9]]);
    assert_eq!(triangles, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
    assert_eq!(flat.normals[0], [0.0, 0.0, 1.0]);
    assert_eq!(flat.normals[4], [1.0, 0.0, 0.0]);
    assert_eq!(flat.normals[8], [0.0, 1.0, 0.0]);
    assert_eq!(flat.uv[0].len(), 9);
    assert!(Mesh::new("flat", flat, triangles).is_ok());
}

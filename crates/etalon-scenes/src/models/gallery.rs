//! A room of things of all materials.
//!
//! For drawing as a whole: every material property in use, three kinds of
//! light, all three draw classes, glass in front of glass, and velocities from
//! the camera, from an object and from both.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::model::{
    Animation, DrawClass, Image, Interpolation, Light, LightKind, Material, Model, ModelError,
    ModelParts, Node, Part, Sampler, TextureUse, Track, Transform, UvTransform, Values, Viewpoint,
    Volume, shapes,
};

pub(super) fn build() -> Result<Model, ModelError> {
    let mut parts = ModelParts::default();
    room(&mut parts)?;
    exhibits(&mut parts)?;
    glass(&mut parts)?;
    lights(&mut parts);
    let ball = rolling_ball(&mut parts)?;
    let eye = eye(&mut parts)?;
    parts.animations.push(Animation {
        name: "visit".into(),
        tracks: vec![
            Track {
                node: ball,
                times: vec![0.0, 2.0, 4.0],
                interpolation: Interpolation::Linear,
                values: Values::Translation(vec![
                    [-2.0, 0.3, 1.0],
                    [2.0, 0.3, 1.4],
                    [-2.0, 0.3, 1.0],
                ]),
            },
            // A quarter turn at a time: the ball rolls.
            Track {
                node: ball,
                times: vec![0.0, 1.0, 2.0, 3.0, 4.0],
                interpolation: Interpolation::Linear,
                values: Values::Rotation(vec![
                    [0.0, 0.0, 0.0, 1.0],
                    [0.0, 0.0, -0.707_106_77, 0.707_106_77],
                    [0.0, 0.0, -1.0, 0.0],
                    [0.0, 0.0, -0.707_106_77, 0.707_106_77],
                    [0.0, 0.0, 0.0, 1.0],
                ]),
            },
            Track {
                node: eye,
                times: vec![0.0, 4.0],
                interpolation: Interpolation::CubicSpline,
                values: Values::Translation(vec![
                    [0.0; 3],
                    [-0.5, 1.6, 5.5],
                    [0.4, 0.0, 0.0],
                    [0.4, 0.0, 0.0],
                    [0.9, 1.5, 5.2],
                    [0.0; 3],
                ]),
            },
        ],
    });
    Model::new(parts)
}

fn room(parts: &mut ModelParts) -> Result<(), ModelError> {
    let tiles = parts.texture(checker(64, 8)?, Sampler::default());
    let floor = parts.mesh(shapes::grid("floor", [12.0, 12.0], [12, 12])?);
    let tiled = parts.material(Material {
        base_colour_texture: Some(TextureUse {
            transform: UvTransform {
                scale: [6.0, 6.0],
                ..UvTransform::default()
            },
            ..TextureUse::new(tiles)
        }),
        ..Material::dielectric("tiles", [0.8; 3], 0.25)
    });
    parts.node(Node::with_part("floor", Transform::default(), floor, tiled));
    let wall = parts.mesh(shapes::cuboid("wall", [6.0, 2.0, 0.1])?);
    let plaster = parts.material(Material::dielectric("plaster", [0.62, 0.6, 0.56], 0.95));
    for (name, place, angle) in [
        ("back wall", [0.0, 2.0, -4.0], 0.0),
        ("left wall", [-6.0, 2.0, 0.0], FRAC_PI_2),
        ("right wall", [6.0, 2.0, 0.0], FRAC_PI_2),
    ] {
        parts.node(Node::with_part(
            name,
            Transform::turned(place, angle),
            wall,
            plaster,
        ));
    }
    Ok(())
}

fn exhibits(parts: &mut ModelParts) -> Result<(), ModelError> {
    let bumps = parts.texture(bumps(128, 6)?, Sampler::default());
    let sphere = parts.mesh(shapes::uv_sphere("sphere", 0.6, 64, 32)?);
    let cube = parts.mesh(shapes::cuboid("cube", [0.5; 3])?);
    let ring = parts.mesh(shapes::torus("ring", 0.5, 0.12, 64, 24)?);
    let drum = parts.mesh(shapes::cylinder("drum", 0.4, 1.2, 48)?);
    let cone = parts.mesh(shapes::cone("cone", 0.5, 1.1, 48)?);
    let gold = parts.material(Material::metal("gold", [1.0, 0.77, 0.34], 0.15));
    let iron = parts.material(Material::metal("iron", [0.56, 0.57, 0.58], 0.6));
    let hammered = parts.material(Material {
        normal_texture: Some(TextureUse::new(bumps)),
        normal_scale: 0.8,
        ..Material::metal("hammered copper", [0.95, 0.64, 0.54], 0.3)
    });
    let lacquer = parts.material(Material::dielectric("lacquer", [0.6, 0.02, 0.03], 0.08));
    let neon = parts.material(Material {
        emissive: [0.2, 0.9, 1.0],
        emissive_strength: 800.0,
        ..Material::dielectric("neon", [0.02; 3], 0.5)
    });
    for (name, place, angle, mesh, material) in [
        ("gold sphere", [-2.6, 0.6, -1.5], 0.0, sphere, gold),
        ("hammered cube", [-1.0, 0.5, -1.8], 0.5, cube, hammered),
        ("lacquer drum", [0.6, 0.6, -2.2], 0.0, drum, lacquer),
        ("iron cone", [2.0, 0.0, -1.6], 0.0, cone, iron),
        ("neon ring", [3.2, 1.2, -2.4], 0.7, ring, neon),
    ] {
        parts.node(Node::with_part(
            name,
            Transform::turned(place, angle),
            mesh,
            material,
        ));
    }
    Ok(())
}

fn glass(parts: &mut ModelParts) -> Result<(), ModelError> {
    let panes = parts.mesh(shapes::panes("panes", 0.7, 6, [0.6, 1.4])?);
    let ball = parts.mesh(shapes::icosphere("glass ball", 0.35, 4)?);
    let clear = parts.material(Material {
        transmission: 0.95,
        double_sided: true,
        ..Material::dielectric("window glass", [0.9, 1.0, 0.95], 0.02)
    });
    let thick = parts.material(Material {
        transmission: 1.0,
        ior: 1.52,
        volume: Volume {
            thickness: 0.7,
            attenuation_distance: 0.5,
            attenuation_colour: [0.95, 0.5, 0.35],
            ..Volume::default()
        },
        ..Material::dielectric("amber", [1.0; 3], 0.05)
    });
    parts.node(Node::with_part(
        "panes",
        Transform::at([1.2, 0.0, 0.2]),
        panes,
        clear,
    ));
    parts.node(Node::with_part(
        "amber",
        Transform::at([1.2, 0.35, 0.2]),
        ball,
        thick,
    ));
    Ok(())
}

fn lights(parts: &mut ModelParts) {
    let light = |name: &str, colour, intensity, kind| Light {
        name: name.into(),
        colour,
        intensity,
        range: None,
        kind,
    };
    // Downward from the left: −Z turned by a rotation about X.
    let (sin, cos) = (-0.15 * PI).sin_cos();
    let slanted = Transform::Trs {
        translation: [0.0, 4.0, 0.0],
        rotation: [sin, 0.0, 0.0, cos],
        scale: [1.0; 3],
    };
    let kind = LightKind::Directional;
    parts.light(light("moon", [0.6, 0.7, 1.0], 20.0, kind), slanted);
    let kind = LightKind::Point;
    let lamp = light("lamp", [1.0, 0.8, 0.6], 120.0, kind);
    parts.light(lamp, Transform::at([-2.0, 2.8, 1.0]));
    let kind = LightKind::Spot {
        inner: 0.25,
        outer: 0.5,
    };
    parts.light(light("spot", [1.0; 3], 400.0, kind), slanted);
}

fn rolling_ball(parts: &mut ModelParts) -> Result<usize, ModelError> {
    let stripes = parts.texture(checker(16, 4)?, Sampler::default());
    let ball = parts.mesh(shapes::uv_sphere("ball", 0.3, 32, 16)?);
    let painted = parts.material(Material {
        base_colour_texture: Some(TextureUse::new(stripes)),
        ..Material::dielectric("paint", [0.9, 0.7, 0.1], 0.4)
    });
    let place = Transform::at([-2.0, 0.3, 1.0]);
    Ok(parts.node(Node::with_part("ball", place, ball, painted)))
}

/// The camera, and a weapon that it carries.
fn eye(parts: &mut ModelParts) -> Result<usize, ModelError> {
    let eye = parts.node(Node {
        name: "eye".into(),
        transform: Transform::at([-0.5, 1.6, 5.5]),
        ..Node::default()
    });
    parts.viewpoints.push(Viewpoint::Node {
        node: eye,
        vertical_fov: 0.9,
        near: 0.05,
    });
    let barrel = parts.mesh(shapes::cuboid("barrel", [0.03, 0.03, 0.25])?);
    let grip = parts.mesh(shapes::cuboid("grip", [0.025, 0.08, 0.04])?);
    let steel = parts.material(Material::metal("steel", [0.4, 0.42, 0.45], 0.4));
    let rubber = parts.material(Material::dielectric("rubber", [0.04; 3], 0.9));
    let weapon = parts.node(Node {
        name: "weapon".into(),
        parent: Some(eye),
        transform: Transform::turned([0.16, -0.14, -0.4], 0.06),
        parts: vec![Part {
            mesh: barrel,
            material: steel,
        }],
        class: Some(DrawClass::Weapon),
        ..Node::default()
    });
    parts.node(Node {
        parent: Some(weapon),
        class: Some(DrawClass::Weapon),
        ..Node::with_part("grip", Transform::at([0.0, -0.09, 0.15]), grip, rubber)
    });
    Ok(eye)
}

/// `side × side` texels of `squares × squares` light and dark squares.
fn checker(side: u32, squares: u32) -> Result<Image, ModelError> {
    let texels = (0..side * side).flat_map(|i| {
        let (x, y) = (i % side * squares / side, i / side * squares / side);
        let value = if (x + y) % 2 == 0 { 235 } else { 70 };
        [value, value, value, 255]
    });
    Image::new("checker", side, side, texels.collect())
}

/// A normal map of `count × count` round bumps over `side × side` texels.
fn bumps(side: u32, count: u32) -> Result<Image, ModelError> {
    let turn = f64::from(count) * std::f64::consts::TAU / f64::from(side);
    let texels = (0..side * side).flat_map(|i| {
        let x = (f64::from(i % side) + 0.5) * turn;
        let y = (f64::from(i / side) + 0.5) * turn;
        // Of the height (cos x · cos y) / 2; green points up the image, against y.
        let normal =
            glam::DVec3::new(0.5 * x.sin() * y.cos(), -0.5 * x.cos() * y.sin(), 1.0).normalize();
        let [r, g, b] = (normal * 127.5 + 127.5).round().to_array();
        [r as u8, g as u8, b as u8, 255]
    });
    Image::new("bumps", side, side, texels.collect())
}

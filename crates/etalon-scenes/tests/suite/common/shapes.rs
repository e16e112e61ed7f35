//! Random shapes with known points.

use etalon_scenes::trace::{Material, Mesh, Scene, SceneBuilder, Shape};
use glam::{DMat3, DQuat, DVec3};

use super::Random;

pub(crate) fn scene(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    let mut builder = SceneBuilder::new();
    for shape in shapes {
        builder.object(shape, Material::matte(DVec3::ONE));
    }
    builder.build().unwrap()
}

/// A shape with a random place and size, a point of its surface and the outward
/// normal there.
pub(crate) fn sample(random: &mut Random, kind: usize) -> (Shape, DVec3, DVec3) {
    let center = random.vector(10.0);
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(
        random.direction(),
        random.within(0.0, 6.0),
    ));
    match kind {
        0 => {
            let q = center
                + rotation.x_axis * random.within(-5.0, 5.0)
                + rotation.y_axis * random.within(-5.0, 5.0);
            (
                Shape::Plane {
                    point: center,
                    normal: rotation.z_axis * 3.0,
                },
                q,
                rotation.z_axis,
            )
        }
        1 => {
            let (u, v) = (
                rotation.x_axis * random.within(0.5, 3.0),
                rotation.y_axis * random.within(0.5, 3.0),
            );
            let q = center + u * random.within(-0.999, 0.999) + v * random.within(-0.999, 0.999);
            (
                Shape::Rectangle {
                    center,
                    half_u: u,
                    half_v: v,
                },
                q,
                rotation.z_axis,
            )
        }
        2 => {
            let radius = random.within(0.5, 3.0);
            let (r, angle) = (radius * random.within(0.0, 0.999), random.within(0.0, 6.0));
            let q = center + rotation * DVec3::new(r * angle.cos(), r * angle.sin(), 0.0);
            (
                Shape::Disc {
                    center,
                    normal: rotation.z_axis,
                    radius,
                },
                q,
                rotation.z_axis,
            )
        }
        3 => {
            let (radius, normal) = (random.within(0.1, 5.0), random.direction());
            (
                Shape::Sphere { center, radius },
                center + normal * radius,
                normal,
            )
        }
        4 => {
            let half = DVec3::new(
                random.within(0.2, 3.0),
                random.within(0.2, 3.0),
                random.within(0.2, 3.0),
            );
            let axis = random.bits() as usize % 3;
            let sign = if random.bits().is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            let mut local = half
                * DVec3::new(
                    random.within(-0.999, 0.999),
                    random.within(-0.999, 0.999),
                    random.within(-0.999, 0.999),
                );
            local[axis] = sign * half[axis];
            (
                Shape::Box {
                    center,
                    half,
                    orientation: rotation,
                },
                center + rotation * local,
                rotation.col(axis) * sign,
            )
        }
        _ => {
            let corners = [
                center,
                center + rotation.x_axis * 2.0,
                center + rotation.y_axis * 1.5 + rotation.x_axis * 0.3,
            ];
            let (mut u, mut v) = (random.within(0.001, 0.999), random.within(0.001, 0.999));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let q = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let mesh = Mesh {
                positions: corners.to_vec(),
                triangles: vec![[0, 1, 2]],
            };
            (Shape::Mesh(mesh), q, rotation.z_axis)
        }
    }
}

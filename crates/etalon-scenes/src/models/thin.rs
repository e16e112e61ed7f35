//! Things that are too thin for pixels.
//!
//! For coverage: whether a pixel's centre is inside is all that counts, needles
//! that share corners may not leave gaps nor be drawn twice, and a comparison
//! has to leave out nearly every pixel here.

use super::{camera, quad, soup};
use crate::model::{Material, Model, ModelError, ModelParts, Node, Transform, Viewpoint, shapes};

pub(super) fn build() -> Result<Model, ModelError> {
    let mut parts = ModelParts::default();
    let grey = parts.material(Material {
        double_sided: true,
        ..Material::dielectric("grey", [0.6; 3], 0.7)
    });
    let red = parts.material(Material {
        double_sided: true,
        ..Material::dielectric("red", [0.8, 0.1, 0.05], 0.5)
    });
    let wall = parts.mesh(shapes::grid("floor", [8.0, 8.0], [1, 1])?);
    parts.node(Node::with_part(
        "floor",
        Transform::at([0.0, -1.0, -3.0]),
        wall,
        grey,
    ));

    // Posts of 4 mm down to 0.1 mm.
    let mut posts = Vec::new();
    for i in 0..40_u16 {
        let x = -2.0 + 0.05 * f32::from(i);
        let width = 0.004 * (1.0 - f32::from(i) / 41.0);
        posts.extend(quad([x, -1.0, -2.5], [width, 0.0, 0.0], [0.0, 1.6, 0.0]));
    }
    let posts = parts.mesh(soup("posts", &posts)?);
    parts.node(Node::with_part("posts", Transform::default(), posts, red));

    // A disc of needles: any two neighbours share an edge and all one corner.
    let middle = [1.2, 0.2, -3.0];
    let rim = |i: u16| {
        let (sin, cos) = (f32::from(i % 720) * std::f32::consts::TAU / 720.0).sin_cos();
        [middle[0] + 0.9 * cos, middle[1] + 0.9 * sin, middle[2]]
    };
    let needles: Vec<_> = (0..720).map(|i| [middle, rim(i), rim(i + 1)]).collect();
    let needles = parts.mesh(soup("needles", &needles)?);
    parts.node(Node::with_part(
        "needles",
        Transform::default(),
        needles,
        grey,
    ));

    // Slivers across the whole picture, each a ten-thousandth as high as long.
    let slivers: Vec<_> = (0..24_u16)
        .map(|i| {
            let y = -0.9 + 0.08 * f32::from(i);
            [
                [-3.0, y, -2.8],
                [3.0, y + 0.13, -2.8],
                [3.0, y + 0.1306, -2.8],
            ]
        })
        .collect();
    let slivers = parts.mesh(soup("slivers", &slivers)?);
    parts.node(Node::with_part(
        "slivers",
        Transform::default(),
        slivers,
        red,
    ));
    parts.viewpoints.push(Viewpoint::Fixed(camera(
        [[0.003, 0.0, 0.5], [0.0, -0.1, -3.0]],
        [[0.0, 0.0, 0.5], [0.0, -0.1, -3.0]],
        50.0,
    )?));
    Model::new(parts)
}

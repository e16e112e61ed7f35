//! Where faces are in a picture, and how they are turned there.

use etalon_core::image::ImageData;
use etalon_effects::environment::{CubePicture, FACES};

use super::{EnvironmentError, EnvironmentPicture, check_face, size};

/// How all directions are laid out in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Twice as wide as high: see [`EnvironmentMap`](etalon_effects::environment::EnvironmentMap).
    Equirectangular,
    /// Six faces one below the other: +x, −x, +y, −y, +z, −z. OpenEXR has the first and
    /// the last texels of such faces on their edges, where two faces show the same; its
    /// files are interpolated to texels that end there.
    Column,
    /// Six faces from left to right, in the same order.
    Row,
    /// A cube unfolded around −z, as it is seen from within: −x, −z, +x, +z from left to
    /// right, +y above −z, −y below it.
    Cross,
    /// The same with +z, upside down, below −y.
    TallCross,
}

/// How faces are turned that do not hang together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaceOrder {
    /// As OpenEXR's cube maps have them: seen from within, +y and −y as they join −z.
    #[default]
    Seen,
    /// As cube textures have them (WebGPU, Vulkan, Direct3D, OpenGL): each turned left to
    /// right, +y and −y as they join +z.
    CubeTexture,
}

/// A turn of a face's picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    None,
    /// By 180°.
    Half,
    /// Left to right.
    Mirrored,
}

impl Turn {
    /// Which texel of the picture is at a column and a row of the face as effects have it.
    const fn texel(self, side: u32, [x, y]: [u32; 2]) -> [u32; 2] {
        match self {
            Self::None => [x, y],
            Self::Half => [side - 1 - x, side - 1 - y],
            Self::Mirrored => [side - 1 - x, y],
        }
    }
}

/// Where a face is, in faces from the left and from the top, and how it is turned.
type Placed = ([u32; 2], Turn);

impl FaceOrder {
    const fn turn(self, face: u32) -> Turn {
        match (self, face) {
            (Self::Seen, 2 | 3) => Turn::Half,
            (Self::Seen, _) => Turn::None,
            (Self::CubeTexture, _) => Turn::Mirrored,
        }
    }
}

impl Layout {
    /// That of a picture of this shape, if there is one.
    #[must_use]
    pub fn of_shape(width: u32, height: u32) -> Option<Self> {
        let all = [
            Self::Equirectangular,
            Self::Column,
            Self::Row,
            Self::Cross,
            Self::TallCross,
        ];
        all.into_iter().find(|layout| {
            let [columns, rows] = layout.shape();
            width > 0
                && u64::from(width) * u64::from(rows) == u64::from(height) * u64::from(columns)
        })
    }

    /// Width and height in the same unit: faces, where there are any.
    const fn shape(self) -> [u32; 2] {
        match self {
            Self::Equirectangular => [2, 1],
            Self::Column => [1, 6],
            Self::Row => [6, 1],
            Self::Cross => [4, 3],
            Self::TallCross => [3, 4],
        }
    }

    const fn expected(self) -> &'static str {
        match self {
            Self::Equirectangular => "twice as wide as high",
            Self::Column => "six faces high and one wide",
            Self::Row => "six faces wide and one high",
            Self::Cross => "four faces wide and three high",
            Self::TallCross => "three faces wide and four high",
        }
    }

    /// Where the faces are.
    const fn faces(self, order: FaceOrder) -> [Placed; FACES as usize] {
        const fn cross(back: Placed) -> [Placed; FACES as usize] {
            [
                ([2, 1], Turn::None),
                ([0, 1], Turn::None),
                ([1, 0], Turn::Half),
                ([1, 2], Turn::Half),
                back,
                ([1, 1], Turn::None),
            ]
        }
        match self {
            Self::Cross => cross(([3, 1], Turn::None)),
            Self::TallCross => cross(([1, 3], Turn::Half)),
            Self::Row | Self::Column | Self::Equirectangular => {
                let mut faces = [([0, 0], Turn::None); FACES as usize];
                let mut face = 0;
                while face < FACES {
                    let at = match self {
                        Self::Row => [face, 0],
                        _ => [0, face],
                    };
                    faces[face as usize] = (at, order.turn(face));
                    face += 1;
                }
                faces
            }
        }
    }

    /// Takes a picture apart. With `to_edges` the first and the last texels of a face are
    /// on its edges, as OpenEXR has them, and not beside them.
    pub(super) fn picture(
        self,
        picture: ImageData,
        order: FaceOrder,
        to_edges: bool,
    ) -> Result<EnvironmentPicture, EnvironmentError> {
        let [width, height] = size(&picture);
        let [columns, rows] = self.shape();
        let wrong = EnvironmentError::Shape {
            width,
            height,
            expected: self.expected(),
        };
        if self == Self::Equirectangular {
            // Of any shape, if it is asked for: rows and columns are counted apart.
            return Ok(EnvironmentPicture::Equirectangular(picture));
        }
        if !width.is_multiple_of(columns) || width / columns * rows != height {
            return Err(wrong);
        }
        let side = check_face(width / columns)?;
        let faces = self.faces(order);
        let texels = picture.to_rgba_f32()?;
        let texel = |face: u32, [x, y]: [u32; 2]| {
            let ([left, top], turn) = faces[face as usize];
            let [x, y] = turn.texel(side, [x, y]);
            let row = u64::from(top * side + y) * u64::from(width);
            let at = usize::try_from(row + u64::from(left * side + x)).unwrap_or(usize::MAX);
            texels.get(at).copied().unwrap_or_default()
        };
        let cube = CubePicture::from_fn(side, |face, x, y| {
            let [r, g, b, _] = match to_edges {
                true => between(side, [x, y], |at| texel(face, at)),
                false => texel(face, [x, y]),
            };
            [r, g, b]
        })?;
        Ok(EnvironmentPicture::Cube(cube))
    }
}

/// What is at a texel's centre where texels are on the corners of as many squares, one
/// less in each axis: interpolated between four.
fn between(side: u32, at: [u32; 2], texel: impl Fn([u32; 2]) -> [f32; 4]) -> [f32; 4] {
    let last = side - 1;
    let axis = at.map(|at| {
        let place = (f64::from(at) + 0.5) * f64::from(last) / f64::from(side);
        let low = (place as u32).min(last);
        (low, (low + 1).min(last), (place - f64::from(low)) as f32)
    });
    let [(left, right, across), (top, bottom, down)] = axis;
    let row = |y: u32| {
        let (a, b) = (texel([left, y]), texel([right, y]));
        std::array::from_fn(|k| a[k] * (1.0 - across) + b[k] * across)
    };
    let (upper, lower): ([f32; 4], [f32; 4]) = (row(top), row(bottom));
    std::array::from_fn(|k| upper[k] * (1.0 - down) + lower[k] * down)
}

/// Six pictures as a cube.
pub(super) fn assembled(
    pictures: &[ImageData],
    order: FaceOrder,
) -> Result<CubePicture, EnvironmentError> {
    let mut all = Vec::with_capacity(pictures.len());
    let first = pictures.first().map_or([0, 0], size);
    for picture in pictures {
        let [width, height] = size(picture);
        if width != height {
            return Err(EnvironmentError::Shape {
                width,
                height,
                expected: "a square",
            });
        }
        if [width, height] != first {
            return Err(EnvironmentError::Faces {
                size: width,
                why: "the first face has another size",
            });
        }
        all.push(picture.to_rgba_f32()?);
    }
    let side = check_face(first[0])?;
    Ok(CubePicture::from_fn(side, |face, x, y| {
        let [x, y] = order.turn(face).texel(side, [x, y]);
        let texels = all.get(face as usize).map_or(&[][..], Vec::as_slice);
        let at = y as usize * side as usize + x as usize;
        let [r, g, b, _] = texels.get(at).copied().unwrap_or_default();
        [r, g, b]
    })?)
}

#[cfg(test)]
mod tests {
    use etalon_core::Format;
    use etalon_core::resource::TextureDesc;
    use etalon_effects::environment::face_direction;
    use glam::{DVec2, DVec3};

    use super::*;

    /// Faces that share an edge in an unfolded picture show the same directions along it.
    #[test]
    fn crosses_hang_together() {
        for layout in [Layout::Cross, Layout::TallCross] {
            let faces = layout.faces(FaceOrder::Seen);
            // A direction at a place of the picture, in faces.
            let seen = |face: usize, at: DVec2| -> DVec3 {
                let ([left, top], turn) = faces[face];
                let own = (at - DVec2::new(left.into(), top.into())) * 2.0 - 1.0;
                let own = if turn == Turn::Half { -own } else { own };
                face_direction(face as u32, own)
            };
            let mut edges = 0;
            for (a, b) in (0..6).flat_map(|a| (0..6).map(move |b| (a, b))) {
                let place = |face: usize| {
                    let [x, y] = faces[face].0;
                    DVec2::new(x.into(), y.into())
                };
                let apart = place(b) - place(a);
                if apart != DVec2::X && apart != DVec2::Y {
                    continue;
                }
                for part in [0.25, 0.5, 0.9] {
                    let along = DVec2::new(apart.y, apart.x) * part;
                    let at = place(b) + along;
                    assert!(
                        seen(a, at).distance(seen(b, at)) < 1e-12,
                        "{layout:?}: {a}, {b}"
                    );
                }
                edges += 1;
            }
            assert_eq!(edges, 5, "{layout:?}");
        }
    }

    /// The faces of a cube texture by the table of WebGPU and Vulkan: which direction is at
    /// a place (s, t) of each.
    #[test]
    fn cube_textures_are_turned_left_to_right() {
        let table: [fn(f64, f64) -> DVec3; 6] = [
            |s, t| DVec3::new(1.0, -t, -s),
            |s, t| DVec3::new(-1.0, -t, s),
            |s, t| DVec3::new(s, 1.0, t),
            |s, t| DVec3::new(s, -1.0, -t),
            |s, t| DVec3::new(s, -t, 1.0),
            |s, t| DVec3::new(-s, -t, -1.0),
        ];
        for (face, direction) in (0..).zip(table) {
            assert_eq!(FaceOrder::CubeTexture.turn(face), Turn::Mirrored);
            for (s, t) in [(0.5, -0.25), (-0.75, 0.5)] {
                assert_eq!(face_direction(face, DVec2::new(-s, t)), direction(s, t));
            }
        }
    }

    /// OpenEXR's (`ImfEnvmap.h`): which column and row a place of each face is at.
    #[test]
    fn faces_of_openexr_are_turned_where_they_join_another() {
        let table: [fn(DVec3) -> DVec2; 6] = [
            |at| DVec2::new(at.z, -at.y),
            |at| DVec2::new(-at.z, -at.y),
            |at| DVec2::new(at.x, -at.z),
            |at| DVec2::new(at.x, at.z),
            |at| DVec2::new(-at.x, -at.y),
            |at| DVec2::new(at.x, -at.y),
        ];
        for (face, place) in (0..).zip(table) {
            for own in [DVec2::new(0.5, -0.25), DVec2::new(-0.75, 0.5)] {
                let turned = match FaceOrder::Seen.turn(face) {
                    Turn::Half => -own,
                    _ => own,
                };
                assert_eq!(place(face_direction(face, own)), turned, "{face}");
            }
        }
    }

    /// Texels on the edges show the same directions as those beside them, interpolated.
    #[test]
    fn faces_to_their_edges_are_read_between_texels() {
        let side = 5;
        let place = |at: u32, steps: f32, first: f32| (at as f32 + first) / steps * 2.0 - 1.0;
        let texels: Vec<[f32; 4]> = (0..6 * side)
            .flat_map(|y| (0..side).map(move |x| (x, y)))
            .map(|(x, y)| {
                [
                    place(x, 4.0, 0.0),
                    place(y % side, 4.0, 0.0),
                    (y / side) as f32,
                    1.0,
                ]
            })
            .collect();
        let desc = TextureDesc::d2(side, 6 * side, Format::Rgba32Float);
        let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
        let picture = Layout::Column
            .picture(image, FaceOrder::Seen, true)
            .unwrap();
        let EnvironmentPicture::Cube(cube) = picture else {
            panic!("no cube");
        };
        for (face, y) in (0..6).flat_map(|face| (0..side).map(move |y| (face, y))) {
            for x in 0..side {
                let turned = if matches!(face, 2 | 3) { -1.0 } else { 1.0 };
                let want = [x, y].map(|at| f64::from(turned * place(at, 5.0, 0.5)));
                let [u, v, of, _] = cube.image().texel(x, y, face, 0).unwrap().to_f64();
                let off = (u - want[0]).abs().max((v - want[1]).abs());
                assert!(
                    off < 1e-6 && of == f64::from(face),
                    "{face}, {x}, {y}: {u}, {v}"
                );
            }
        }
        // One texel is all of a face.
        let one = between(1, [0, 0], |at| [at[0] as f32, at[1] as f32, 7.0, 1.0]);
        assert_eq!(one, [0.0, 0.0, 7.0, 1.0]);
    }

    #[test]
    fn shapes_tell_layouts() {
        for (size, layout) in [
            ([1024, 512], Some(Layout::Equirectangular)),
            ([256, 1536], Some(Layout::Column)),
            ([6, 1], Some(Layout::Row)),
            ([64, 48], Some(Layout::Cross)),
            ([48, 64], Some(Layout::TallCross)),
            ([7, 5], None),
            ([0, 0], None),
        ] {
            assert_eq!(Layout::of_shape(size[0], size[1]), layout, "{size:?}");
        }
    }
}

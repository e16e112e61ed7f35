//! Marks and lists against plain loops over tiles and texels.

use etalon_core::Format;
use etalon_core::backend::{CapturedData, Execution};
use etalon_core::image::ImageData;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Capture;
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;
use etalon_effects::tiles::{Axis, MOST_RADIUS, Marks, TileList, Tiling};

use crate::common::{Run, backend, hash};

/// Marks, row by row.
#[derive(Clone, Debug, PartialEq)]
struct Grid {
    width: u32,
    height: u32,
    marks: Vec<u32>,
}

impl Grid {
    fn new(width: u32, height: u32, mark: impl Fn(u32, u32) -> u32) -> Self {
        let marks = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let marks = marks.map(|(x, y)| mark(x, y)).collect();
        Self {
            width,
            height,
            marks,
        }
    }

    fn random(width: u32, height: u32, seed: u32, one_in: u32) -> Self {
        Self::new(width, height, |x, y| {
            let random = hash(seed ^ hash(x ^ hash(y)));
            if random.is_multiple_of(one_in) {
                1 + (random >> 16) % 3
            } else {
                0
            }
        })
    }

    fn at(&self, x: u32, y: u32) -> u32 {
        self.marks[(y * self.width + x) as usize]
    }

    fn image(&self) -> ImageData {
        let bytes = self.marks.iter().flat_map(|mark| mark.to_le_bytes());
        let desc = TextureDesc::d2(self.width, self.height, Format::R32Uint);
        ImageData::from_bytes(desc, bytes.collect()).unwrap()
    }

    fn of(image: &ImageData) -> Self {
        let extent = image.desc.extent;
        let marks = image.texels(0).map(|(_, texel)| match texel {
            Texel::Uint(channels) => channels[0],
            other => panic!("{other:?}"),
        });
        Self {
            width: extent.width,
            height: extent.height,
            marks: marks.collect(),
        }
    }
}

fn execute(run: &mut Run<'_>) -> Execution {
    run.arithmetic = Arithmetic::Strict;
    run.execute(backend().as_mut(), Capture::Outputs)
}

fn words(execution: &Execution, name: &str) -> Vec<u32> {
    let mut captures = execution.captures.iter();
    let data = captures.find(|capture| capture.binding == name).unwrap();
    let CapturedData::Buffer(bytes) = &data.data else {
        panic!("a texture")
    };
    let words = bytes.chunks_exact(4);
    words
        .map(|word| u32::from_le_bytes(word.try_into().unwrap()))
        .collect()
}

/// The list of tiles for which `listed` holds, as its documentation has it.
fn expected(grid: &Grid, shift: u32, listed: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut tiles = Vec::new();
    for y in 0..grid.height {
        for x in 0..grid.width {
            if listed(grid.at(x, y)) {
                tiles.push(x | y << 16);
            }
        }
    }
    let groups = (tiles.len() as u32) << (2 * shift);
    let rows = groups.div_ceil(65_535).max(1);
    let columns = groups.div_ceil(rows);
    // No more workgroups to no purpose than there are rows.
    assert!(columns * rows - groups < rows);
    let mut list = vec![columns, rows, 1, groups, shift];
    list.extend(&tiles);
    list.resize(5 + (grid.width * grid.height) as usize, 0);
    list
}

#[test]
fn lists_are_the_marked_tiles_in_row_order_and_the_others() {
    let shapes = [
        (1, 1),
        (1, 17),
        (1024, 1),
        (16, 16),
        (17, 15),
        (31, 9),
        (255, 1),
        (257, 3),
        // More tiles than workgroups in one row of them.
        (300, 300),
    ];
    for (number, (width, height)) in shapes.into_iter().enumerate() {
        for one_in in [1, 2, 40, u32::MAX] {
            let grid = Grid::random(width, height, number as u32, one_in);
            let image = grid.image();
            let mut run = Run::new();
            let marks = run.import("marks", &image);
            let size = Tiling::Texels8.size().unwrap();
            let marks = Marks::of(&mut run.graph, marks, size).unwrap();
            let lists: [(&str, TileList); 3] = [
                ("one", marks.with(&mut run.graph, 1).unwrap()),
                ("any", marks.with(&mut run.graph, 3).unwrap()),
                ("none", marks.without(&mut run.graph, 2).unwrap()),
            ];
            for (name, list) in lists {
                run.graph.output_buffer(name, list.buffer()).unwrap();
            }
            let execution = execute(&mut run);
            let what = format!("{width}×{height}, one in {one_in}");
            let of = |listed: fn(u32) -> bool| expected(&grid, 0, listed);
            assert_eq!(words(&execution, "one"), of(|mark| mark & 1 != 0), "{what}");
            assert_eq!(words(&execution, "any"), of(|mark| mark != 0), "{what}");
            assert_eq!(
                words(&execution, "none"),
                of(|mark| mark & 2 == 0),
                "{what}"
            );
        }
    }
}

#[test]
fn larger_tiles_have_the_largest_mark_of_their_parts() {
    for tiling in [Tiling::Texels16, Tiling::Texels32, Tiling::Texels64] {
        let size = tiling.size().unwrap();
        let parts = size.side() / 8;
        for (width, height) in [(1, 1), (8, 8), (9, 7), (33, 2)] {
            let fine = Grid::random(width, height, parts, 20);
            let coarse = Grid::new(width.div_ceil(parts), height.div_ceil(parts), |x, y| {
                let rows = y * parts..((y + 1) * parts).min(height);
                let each = rows.flat_map(|y| {
                    let columns = x * parts..((x + 1) * parts).min(width);
                    columns.map(move |x| (x, y))
                });
                each.map(|(x, y)| fine.at(x, y)).max().unwrap()
            });
            let image = fine.image();
            let mut run = Run::new();
            let marks = run.import("marks", &image);
            let marks = Marks::of(&mut run.graph, marks, size).unwrap();
            let list = marks.with(&mut run.graph, 2).unwrap();
            run.graph.output_buffer("list", list.buffer()).unwrap();
            let found = words(&execute(&mut run), "list");
            let shift = parts.trailing_zeros();
            assert_eq!(found, expected(&coarse, shift, |mark| mark & 2 != 0));
        }
    }
}

/// The tiles that a kernel reads which looks `radius` texels along an axis from every
/// texel of the tiles seen, found texel by texel.
fn read_by(grid: &Grid, (axis, radius): (Axis, u32), seen: u32, side: u32) -> Vec<bool> {
    let (width, height) = (grid.width * side, grid.height * side);
    let mut read = vec![false; grid.marks.len()];
    for y in 0..height {
        for x in 0..width {
            if grid.at(x / side, y / side) & seen == 0 {
                continue;
            }
            let (own, last) = match axis {
                Axis::X => (x, width - 1),
                Axis::Y => (y, height - 1),
            };
            for at in own.saturating_sub(radius)..=own.saturating_add(radius).min(last) {
                let (tile_x, tile_y) = match axis {
                    Axis::X => (at / side, y / side),
                    Axis::Y => (x / side, at / side),
                };
                read[(tile_y * grid.width + tile_x) as usize] = true;
            }
        }
    }
    read
}

#[test]
fn marks_spread_to_exactly_the_tiles_that_are_read() {
    for tiling in [Tiling::Texels8, Tiling::Texels16, Tiling::Texels64] {
        let size = tiling.size().unwrap();
        for radius in [0, 1, 7, 8, 9, 16, 17, 64] {
            for axis in [Axis::X, Axis::Y] {
                let parts = size.side() / 8;
                let grid = Grid::random(11, 9, radius, 25);
                // Each mark in one of its parts.
                let fine = Grid::new(11 * parts, 9 * parts, |x, y| {
                    let own = x % parts == 0 && y % parts == 0;
                    if own {
                        grid.at(x / parts, y / parts)
                    } else {
                        0
                    }
                });
                let image = fine.image();
                let mut run = Run::new();
                let marks = run.import("marks", &image);
                let marks = Marks::of(&mut run.graph, marks, size).unwrap();
                let marks = marks.spread(&mut run.graph, axis, radius, 2, 8).unwrap();
                let list = marks.with(&mut run.graph, u32::MAX).unwrap();
                let raised = marks.with(&mut run.graph, 8).unwrap();
                run.graph.output_buffer("any", list.buffer()).unwrap();
                run.graph.output_buffer("raised", raised.buffer()).unwrap();
                let execution = execute(&mut run);
                let read = read_by(&grid, (axis, radius), 2, size.side());
                let spread = Grid::new(11, 9, |x, y| {
                    grid.at(x, y) | u32::from(read[(y * 11 + x) as usize]) << 3
                });
                let shift = parts.trailing_zeros();
                let what = format!("{tiling:?}, {radius} along {axis:?}");
                let of = |listed: fn(u32) -> bool| expected(&spread, shift, listed);
                assert_eq!(words(&execution, "any"), of(|mark| mark != 0), "{what}");
                assert_eq!(
                    words(&execution, "raised"),
                    of(|mark| mark & 8 != 0),
                    "{what}"
                );
            }
        }
    }
}

#[test]
fn a_radius_that_is_too_large_is_refused() {
    let image = Grid::new(1, 1, |_, _| 0).image();
    let mut run = Run::new();
    let marks = run.import("marks", &image);
    let size = Tiling::Texels8.size().unwrap();
    let marks = Marks::of(&mut run.graph, marks, size).unwrap();
    for radius in [MOST_RADIUS + 1, u32::MAX] {
        let error = marks.spread(&mut run.graph, Axis::X, radius, 1, 2);
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with("tiles: `radius` is"), "{error}");
    }
    assert!(
        marks
            .spread(&mut run.graph, Axis::X, MOST_RADIUS, 1, 2)
            .is_ok()
    );
}

#[test]
fn marks_have_a_texel_for_each_eight_by_eight_of_any_picture() {
    for (width, height) in [(1, 1), (8, 8), (9, 1), (8192, 1), (16_384, 16_384)] {
        let mut run = Run::new();
        let desc = TextureDesc::d2(width, height, Format::Rgba8Unorm);
        let picture = run.graph.import_texture("picture", desc).unwrap();
        let marks = Marks::texture(&mut run.graph, "marks", picture);
        let extent = run.graph.desc(marks).extent;
        assert_eq!(
            (extent.width, extent.height),
            (width.div_ceil(8), height.div_ceil(8))
        );
    }
}

/// Used where marks are looked at directly.
#[test]
fn marks_read_back_as_they_were() {
    let grid = Grid::random(9, 5, 3, 2);
    assert_eq!(Grid::of(&grid.image()), grid);
}

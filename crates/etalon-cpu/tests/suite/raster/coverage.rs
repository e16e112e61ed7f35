//! Which pixels triangles cover, against exact integers and rays.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::raster::{Blend, CullMode, FrontFace, Scissor, TargetState, Viewport};

/// Adds 1 for each triangle that covers a pixel.
const COUNT: &str = PLAIN;

fn counting<'a>(size: [u32; 2], positions: &[[f32; 4]]) -> Scene<'a> {
    let mut scene = Scene::new(COUNT, size, positions);
    scene.colours = vec![Format::R32Float];
    scene.state.targets = vec![TargetState {
        blend: Some(Blend::ADD),
        ..TargetState::default()
    }];
    scene
}

fn counts(targets: &Targets) -> Vec<u32> {
    let texels = targets.colour(0);
    texels.into_iter().map(|texel| texel[0] as u32).collect()
}

/// Pixels to clip space.
fn to_clip(size: [u32; 2], [x, y]: [f32; 2]) -> [f32; 4] {
    let [width, height] = size.map(|size| size as f32);
    [x / (width / 2.0) - 1.0, 1.0 - y / (height / 2.0), 0.5, 1.0]
}

/// In 1/256 of a pixel, from the position in clip space: what the documentation says.
fn snapped(size: [u32; 2], [x, y, _, w]: [f32; 4]) -> [i128; 2] {
    let back = 1.0 / w;
    let half = size.map(|size| size as f32 / 2.0);
    let at = [
        (x * back).mul_add(half[0], half[0]),
        (y * back).mul_add(-half[1], half[1]),
    ];
    at.map(|at| (f64::from(at) * 256.0).round_ties_even() as i128)
}

/// Whether the centre of a pixel is inside, by exact integers: on which side of each
/// edge it is, and of a centre on an edge, on which side a point is that is moved a
/// little to the right and far less down, which is what the rule of top and left
/// edges amounts to.
fn covers(corners: [[i128; 2]; 3], x: u32, y: u32) -> bool {
    let at = [i128::from(x) * 256 + 128, i128::from(y) * 256 + 128];
    let sign = |p: [i128; 2], q: [i128; 2]| {
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let value = dx * (at[1] - p[1]) - dy * (at[0] - p[0]);
        // Derivatives to the right, then down.
        if value != 0 {
            value.signum()
        } else if dy != 0 {
            (-dy).signum()
        } else {
            dx.signum()
        }
    };
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if area == 0 {
        return false;
    }
    let signs = [sign(a, b), sign(b, c), sign(c, a)];
    signs.iter().all(|sign| *sign == area.signum())
}

fn expected(size: [u32; 2], positions: &[[f32; 4]]) -> Vec<u32> {
    let [width, height] = size;
    let mut counts = vec![0; (width * height) as usize];
    for corners in positions.chunks_exact(3) {
        let corners = [0, 1, 2].map(|i| snapped(size, corners[i]));
        for y in 0..height {
            for x in 0..width {
                counts[(y * width + x) as usize] += u32::from(covers(corners, x, y));
            }
        }
    }
    counts
}

#[test]
fn random_triangles_cover_what_exact_edges_say() {
    let size = [150, 90];
    let mut random = Random(1);
    for kind in 0..5 {
        let mut positions = Vec::new();
        for _ in 0..120 {
            let middle = [random.range(9.0, 141.0), random.range(9.0, 81.0)];
            for _ in 0..3 {
                let at = match kind {
                    // Large, small, on a grid of quarters of pixels, slivers, needles.
                    0 => [random.range(0.0, 150.0), random.range(0.0, 90.0)],
                    1 => middle.map(|at| at + random.range(-3.0, 3.0)),
                    2 => middle.map(|at| (at + random.range(-9.0, 9.0)).round() / 4.0 * 2.0),
                    3 => [
                        middle[0] + random.range(-90.0, 90.0),
                        middle[1] + random.range(-0.6, 0.6),
                    ],
                    _ => [
                        middle[0] + random.range(-0.3, 0.3),
                        middle[1] + random.range(-80.0, 80.0),
                    ],
                };
                // Within the picture, so that nothing is cut off.
                let at = [at[0].clamp(0.0, 150.0), at[1].clamp(0.0, 90.0)];
                positions.push(to_clip(size, at));
            }
        }
        let scene = counting(size, &positions);
        let got = if kind < 2 {
            scene.draw()
        } else {
            scene.draw_once()
        };
        assert!(counts(&got) == expected(size, &positions), "kind {kind}");
    }
}

#[test]
fn a_tessellated_square_covers_every_pixel_once() {
    let size = [130, 131];
    let mut random = Random(7);
    for cells in [3, 17, 60] {
        // Corners on a grid that is shaken, those at the edge only along it.
        let step = 140.0 / cells as f32;
        let mut grid = Vec::new();
        for y in 0..=cells {
            for x in 0..=cells {
                let mut at = [x as f32 * step - 4.0, y as f32 * step - 4.0];
                for (axis, place) in [x, y].into_iter().enumerate() {
                    if place != 0 && place != cells {
                        at[axis] += random.range(-0.3, 0.3) * step;
                    }
                }
                grid.push(to_clip(size, at));
            }
        }
        let mut positions = Vec::new();
        for y in 0..cells {
            for x in 0..cells {
                let at = |dx: usize, dy: usize| grid[(y + dy) * (cells + 1) + x + dx];
                let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                let two = match random.below(4) {
                    0 => [a, b, c, c, b, d],
                    1 => [a, c, b, b, d, c],
                    2 => [a, b, d, d, a, c],
                    _ => [a, d, c, d, b, a],
                };
                positions.extend(two);
            }
        }
        let got = counts(&counting(size, &positions).draw_once());
        assert!(got.iter().all(|count| *count == 1), "{cells}");
    }
}

/// Squares whose edges go through centres: the top and left ones are inside.
#[test]
fn centres_on_top_and_left_edges_are_inside() {
    let size = [16, 16];
    // First and last corner, and the pixels from and to which it covers.
    let table = [
        ([2.5, 3.5], [5.5, 7.5], [2, 3], [5, 7]),
        ([2.0, 3.0], [5.0, 7.0], [2, 3], [5, 7]),
        ([2.503_906_3, 3.5], [5.5, 7.503_906_3], [3, 3], [5, 8]),
        (
            [2.496_093_8, 3.496_093_8],
            [5.503_906_3, 7.5],
            [2, 3],
            [6, 7],
        ),
        ([2.5, 3.5], [3.5, 4.5], [2, 3], [3, 4]),
        ([2.6, 3.5], [3.4, 4.5], [3, 3], [3, 4]),
    ];
    for ([x0, y0], [x1, y1], first, end) in table {
        let corner = |x, y| to_clip(size, [x, y]);
        let [a, b, c, d] = [
            corner(x0, y0),
            corner(x1, y0),
            corner(x0, y1),
            corner(x1, y1),
        ];
        for positions in [[a, b, c, c, b, d], [c, b, a, d, b, c], [a, d, b, a, c, d]] {
            let got = counts(&counting(size, &positions).draw_once());
            for (i, count) in got.into_iter().enumerate() {
                let (x, y) = (i % 16, i / 16);
                let inside = (first[0]..end[0]).contains(&x) && (first[1]..end[1]).contains(&y);
                assert_eq!(count, u32::from(inside), "{x0} {y0} {x1} {y1}: {x} {y}");
            }
        }
    }
    // A centre on the slanted edge of two triangles is in one of them.
    let corners = [[0.5, 0.5], [8.5, 0.5], [0.5, 8.5], [8.5, 8.5]];
    let [a, b, c, d] = corners.map(|at| to_clip(size, at));
    let upper = counts(&counting(size, &[a, b, c]).draw_once());
    let lower = counts(&counting(size, &[b, d, c]).draw_once());
    for x in 1..8 {
        // Of the lower one that edge is a left one.
        let at = (8 - x) * 16 + x;
        assert_eq!((upper[at], lower[at]), (0, 1), "{x}");
    }
}

#[test]
fn facing_is_told_by_the_order_of_corners() {
    let size = [8, 8];
    let corners = [[1.0, 1.0], [1.0, 7.0], [7.0, 7.0]].map(|at| to_clip(size, at));
    let [a, b, c] = corners;
    for (front, cull, counter_clockwise, clockwise) in [
        (FrontFace::CounterClockwise, CullMode::None, true, true),
        (FrontFace::CounterClockwise, CullMode::Back, true, false),
        (FrontFace::CounterClockwise, CullMode::Front, false, true),
        (FrontFace::Clockwise, CullMode::Back, false, true),
        (FrontFace::Clockwise, CullMode::Front, true, false),
    ] {
        for (positions, drawn) in [([a, b, c], counter_clockwise), ([a, c, b], clockwise)] {
            let mut scene = counting(size, &positions);
            (scene.state.front, scene.state.cull) = (front, cull);
            let got = counts(&scene.draw_once());
            assert_eq!(got.iter().any(|count| *count > 0), drawn);
        }
    }
}

#[test]
fn nothing_is_drawn_outside_of_viewport_and_scissor() {
    let size = [200, 140];
    let huge = [
        [-9.0, -9.0, 0.5, 1.0],
        [9.0, -9.0, 0.5, 1.0],
        [0.0, 30.0, 0.5, 1.0],
    ];
    let mut scene = counting(size, &huge);
    scene.viewport = Some(Viewport {
        x: 10.0,
        y: 20.0,
        width: 150.0,
        height: 100.0,
        near: 0.0,
        far: 1.0,
    });
    scene.scissor = Some(Scissor {
        x: 30,
        y: 5,
        width: 170,
        height: 65,
    });
    for (i, count) in counts(&scene.draw()).into_iter().enumerate() {
        let (x, y) = (i % 200, i / 200);
        let inside = (30..160).contains(&x) && (20..70).contains(&y);
        assert_eq!(count, u32::from(inside), "{x} {y}");
    }
}

/// Whether the ray through a pixel's centre hits a triangle in clip space between the
/// near and the far plane, in `f64`: solves `b · corners = (x, y, ·, 1) · s` for
/// weights that are all of one sign. `None` too near an edge to say.
fn ray_hits(size: [u32; 2], corners: &[[f32; 4]], x: u32, y: u32) -> Option<bool> {
    let ndc = [
        (f64::from(x) + 0.5) / f64::from(size[0]) * 2.0 - 1.0,
        1.0 - (f64::from(y) + 0.5) / f64::from(size[1]) * 2.0,
    ];
    // Rows: x - ndc.x * w = 0, y - ndc.y * w = 0, in the weights.
    let row = |axis: usize| {
        [0, 1, 2].map(|i| f64::from(corners[i][axis]) - ndc[axis] * f64::from(corners[i][3]))
    };
    let (u, v) = (row(0), row(1));
    let mut weights = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let sum: f64 = weights.iter().sum();
    weights = weights.map(|weight| weight / sum);
    let value = |axis: usize| {
        (0..3)
            .map(|i| weights[i] * f64::from(corners[i][axis]))
            .sum::<f64>()
    };
    let (z, w) = (value(2), value(3));
    let bounds = [
        weights[0],
        weights[1],
        weights[2],
        z / w.abs(),
        (w - z) / w.abs(),
    ];
    // A corner moves by 1/512 of a pixel, so that weights of triangles of some pixels
    // change by about that share.
    if !sum.is_finite() || bounds.iter().any(|bound| bound.abs() < 2e-3) {
        return None;
    }
    Some(bounds.iter().all(|bound| *bound > 0.0) && w > 0.0)
}

#[test]
fn triangles_across_the_near_and_far_plane_are_what_rays_hit() {
    let size = [96, 64];
    let mut random = Random(11);
    let (mut hits, mut unsure) = (0, 0);
    for round in 0..60 {
        // Around the camera, with an infinite or finite far plane, z = near * k or so.
        let mut positions = Vec::new();
        for _ in 0..3 {
            let depth = random.range(-6.0, 12.0);
            let (x, y) = (random.range(-8.0, 8.0), random.range(-8.0, 8.0));
            // Near 0.5; far 9, or none.
            let z = if round % 2 == 0 {
                depth - 0.5
            } else {
                (depth - 0.5) * 9.0 / 8.5
            };
            positions.push([x, y, z, depth]);
        }
        let got = counts(&counting(size, &positions).draw_once());
        for y in 0..size[1] {
            for x in 0..size[0] {
                let drawn = got[(y * size[0] + x) as usize];
                match ray_hits(size, &positions, x, y) {
                    Some(hit) => {
                        hits += u32::from(hit);
                        assert_eq!(
                            drawn,
                            u32::from(hit),
                            "round {round}, {x} {y}: {positions:?}"
                        );
                    }
                    None => unsure += 1,
                }
            }
        }
    }
    assert!(
        hits > 20_000 && unsure < 40_000,
        "{hits} hits, {unsure} unsure"
    );
}

#[test]
fn triangles_far_beyond_the_picture_are_what_rays_hit() {
    let size = [80, 60];
    let mut random = Random(5);
    let mut hits = 0;
    for round in 0..60 {
        let far = [3e2, 1e3, 1e5, 1e9, 1e12][round % 5];
        let mut positions: Vec<[f32; 4]> = Vec::new();
        for _ in 0..3 {
            positions.push([random.range(-far, far), random.range(-far, far), 0.5, 1.0]);
        }
        let got = counts(&counting(size, &positions).draw_once());
        for y in 0..size[1] {
            for x in 0..size[0] {
                if let Some(hit) = ray_hits(size, &positions, x, y) {
                    hits += u32::from(hit);
                    let drawn = got[(y * size[0] + x) as usize];
                    assert_eq!(
                        drawn,
                        u32::from(hit),
                        "round {round}, {x} {y}: {positions:?}"
                    );
                }
            }
        }
    }
    assert!(hits > 10_000, "{hits}");
}

/// Triangles that share an edge share its cut: a fan that goes round the camera and
/// behind it covers every pixel once.
#[test]
fn cuts_of_shared_edges_leave_no_gap() {
    let size = [128, 128];
    let mut random = Random(23);
    for _ in 0..8 {
        // A ground plane of cells, from behind the camera to far away.
        let mut positions = Vec::new();
        let turn = random.range(0.0, 0.5);
        let at = |x: i32, y: i32| {
            let (x, y) = (x as f32 * 3.7, y as f32 * 4.3);
            let depth = y * turn.cos() + x * turn.sin();
            // Height grows with distance so that all of the lower half is covered.
            [x - y * turn, -1.5, depth - 0.1, depth]
        };
        for y in -3..300 {
            for x in -90..90 {
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
                positions.extend([a, b, c, c, b, d]);
            }
        }
        let got = counts(&counting(size, &positions).draw_once());
        // The plane is at -1.5 / depth; from depth 1.5 to 500 or so it is seen.
        for y in 70..126 {
            for x in 20..108 {
                assert_eq!(got[y * 128 + x], 1, "{x} {y}");
            }
        }
    }
}

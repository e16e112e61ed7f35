//! What fragments are given, against the solution in `f64` for each pixel.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::raster::{DepthState, StepMode, VertexAttribute, VertexFormat, VertexLayout};

const VARYINGS: &str = "
    struct Varyings {
        @builtin(position) @invariant position: vec4<f32>,
        @location(0) perspective: vec4<f32>,
        @location(3) @interpolate(linear, centroid) linear: vec2<f32>,
        @location(2) @interpolate(flat) flat: vec2<u32>,
    }
    @vertex fn vertex(
        @location(0) position: vec4<f32>,
        @location(1) values: vec4<f32>,
        @builtin(vertex_index) index: u32,
    ) -> Varyings {
        return Varyings(position, values, values.zw, vec2(index, bitcast<u32>(values.x)));
    }
    struct Colours {
        @location(0) perspective: vec4<f32>,
        @location(1) other: vec4<f32>,
        @location(2) flat: vec4<u32>,
    }
    @fragment fn fragment(in: Varyings, @builtin(front_facing) front: bool) -> Colours {
        return Colours(
            in.perspective,
            vec4(in.linear, in.position.zw),
            vec4(in.flat, u32(in.position.x * 2.0), u32(front)),
        );
    }";

fn scene(size: [u32; 2], positions: &[[f32; 4]], values: &[[f32; 4]]) -> Scene<'static> {
    let mut scene = Scene::new(VARYINGS, size, positions);
    let numbers: Vec<f32> = positions
        .iter()
        .zip(values)
        .flat_map(|(position, values)| position.iter().chain(values))
        .copied()
        .collect();
    let attribute = |name: &'static str, offset| VertexAttribute {
        name: name.into(),
        format: VertexFormat::Float32x4,
        offset,
    };
    scene.layouts = vec![VertexLayout {
        stride: 32,
        step: StepMode::Vertex,
        attributes: vec![attribute("values", 16), attribute("position", 0)],
    }];
    scene.vertices = vec![common::floats(&numbers)];
    scene.colours = vec![Format::Rgba32Float, Format::Rgba32Float, Format::Rgba32Uint];
    scene
}

/// Shares of the corners in clip space at a pixel's centre, and how far one is from
/// being undetermined: the smallest of the determinant's terms' ratio.
fn shares(size: [u32; 2], corners: &[[f32; 4]], x: usize, y: usize) -> [f64; 3] {
    let ndc = [
        (x as f64 + 0.5) / f64::from(size[0]) * 2.0 - 1.0,
        1.0 - (y as f64 + 0.5) / f64::from(size[1]) * 2.0,
    ];
    let row = |axis: usize| {
        [0, 1, 2].map(|i| f64::from(corners[i][axis]) - ndc[axis] * f64::from(corners[i][3]))
    };
    let (u, v) = (row(0), row(1));
    let weights = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

fn word(targets: &Targets, at: usize) -> [u32; 4] {
    let bytes = targets.colours[2].to_image().unwrap().bytes;
    [0, 4, 8, 12].map(|byte| {
        let from = at * 16 + byte;
        u32::from_le_bytes([
            bytes[from],
            bytes[from + 1],
            bytes[from + 2],
            bytes[from + 3],
        ])
    })
}

/// Corners are used where they are, not where they are moved to, so the error is that
/// of `f32`: of a gradient, some ulps of the largest value over the smallest extent;
/// of a value, that times the distance from the first corner, in other words some ulps
/// of the largest value times the triangle's aspect.
#[test]
fn numbers_are_those_of_the_exact_solution() {
    let size = [64, 48];
    let mut random = Random(3);
    let mut seen = 0;
    for round in 0..200 {
        let clipped = round % 3 == 0;
        let mut positions = Vec::new();
        let mut values = Vec::new();
        for _ in 0..3 {
            let w = if clipped {
                random.range(-3.0, 8.0)
            } else {
                random.range(0.5, 8.0)
            };
            let (x, y) = (random.range(-1.6, 1.6), random.range(-1.6, 1.6));
            let (x, y) = if clipped {
                (x * 4.0, y * 4.0)
            } else {
                (x * w, y * w)
            };
            positions.push([
                x,
                y,
                if clipped {
                    w - 0.4
                } else {
                    random.range(0.0, 1.0) * w
                },
                w,
            ]);
            values.push([0; 4].map(|_| random.range(-5.0, 5.0)));
        }
        let scene = scene(size, &positions, &values);
        let targets = if round < 6 {
            scene.draw()
        } else {
            scene.draw_once()
        };
        let (perspective, other) = (targets.colour(0), targets.colour(1));
        for (i, got) in perspective.iter().enumerate() {
            let [index, first, twice_x, _] = word(&targets, i);
            if twice_x == 0 {
                continue;
            }
            seen += 1;
            let (x, y) = (i % 64, i / 64);
            assert_eq!((index, first), (0, values[0][0].to_bits()), "flat");
            assert_eq!(twice_x as usize, 2 * x + 1);
            let weights = shares(size, &positions, x, y);
            let mix = |of: &dyn Fn(usize) -> f64| (0..3).map(|k| weights[k] * of(k)).sum::<f64>();
            let w = mix(&|k| f64::from(positions[k][3]));
            let z = mix(&|k| f64::from(positions[k][2])) / w;
            // How ill the triangle is: w at the corners that are drawn is at least
            // 0.4 where it is clipped, and the area at least that of a pixel or so.
            let corner = |k: usize| {
                let [x, y, _, w] = positions[k].map(f64::from);
                [x / w * 32.0, y / w * 24.0]
            };
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            let area = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
            let extent = [a, b, c]
                .iter()
                .flatten()
                .fold(0.0_f64, |most, at| most.max(at.abs()));
            let ill = if clipped {
                // Cut corners are within 0.4 of the eye: many pixels away.
                4000.0
            } else {
                (extent * extent / area).max(1.0) * 16.0
            };
            let tolerance = 5.0 * ill * f64::from(f32::EPSILON) * 16.0;
            for k in 0..4 {
                let want = mix(&|corner| f64::from(values[corner][k]));
                let difference = (f64::from(got[k]) - want).abs();
                assert!(
                    difference < tolerance,
                    "round {round}, {x} {y}: {} not {want}, {tolerance:e}",
                    got[k]
                );
            }
            if !clipped {
                for k in 0..2 {
                    let want = mix(&|corner| {
                        f64::from(values[corner][2 + k]) * f64::from(positions[corner][3])
                    }) / w;
                    let difference = (f64::from(other[i][k]) - want).abs();
                    assert!(difference < tolerance, "linear: {} not {want}", other[i][k]);
                }
            }
            let difference = (f64::from(other[i][2]) - z.clamp(0.0, 1.0)).abs();
            assert!(difference < tolerance, "z {} not {z}", other[i][2]);
            let difference = (f64::from(other[i][3]) * w - 1.0).abs();
            assert!(difference < tolerance, "1/w {} not 1/{w}", other[i][3]);
        }
    }
    assert!(seen > 50_000, "{seen}");
}

#[test]
fn flat_numbers_are_of_the_first_vertex_whatever_the_order() {
    let positions = [
        [-1.0, -1.0, 0.0, 1.0],
        [3.0, -1.0, 0.0, 1.0],
        [-1.0, 3.0, 0.0, 1.0],
    ];
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [2, 1, 0]] {
        let positions = order.map(|i: usize| positions[i]);
        let values = order.map(|i| [i as f32; 4]);
        let targets = scene([4, 4], &positions, &values).draw_once();
        for i in 0..16 {
            let [index, bits, _, front] = word(&targets, i);
            assert_eq!((index, f32::from_bits(bits)), (0, order[0] as f32));
            let even = matches!(order, [0, 1, 2] | [1, 2, 0] | [2, 0, 1]);
            assert_eq!(front, u32::from(even));
        }
    }
}

/// Depth of a plane that is parallel to the picture is that of its corners.
#[test]
fn depth_of_what_faces_the_camera_is_exact() {
    for depth in [0.0, 0.25, 0.3, 1.0] {
        let positions = [
            [-1.0, -1.0, depth, 1.0],
            [3.0, -1.0, depth, 1.0],
            [-1.0, 3.0, depth, 1.0],
        ];
        let mut scene = scene([33, 21], &positions, &[[0.0; 4]; 3]);
        scene.depth = Some(Format::Depth32Float);
        scene.clear_depth = 0.5;
        scene.state.depth = Some(DepthState {
            compare: etalon_core::resource::Compare::Always,
            ..DepthState::STANDARD
        });
        let targets = scene.draw();
        assert!(targets.depths().iter().all(|got| *got == depth));
        assert!(
            targets
                .colour(1)
                .iter()
                .all(|got| got[2] == depth && got[3] == 1.0)
        );
    }
}

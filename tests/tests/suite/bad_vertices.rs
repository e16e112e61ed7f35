//! Vertices that are no numbers, infinite or absurdly far away, between good ones: on
//! every backend they draw nothing where nothing is, and take nothing else with them.
//!
//! [`Mesh`](etalon_scenes::model::Mesh) refuses such vertices, an engine's buffers do
//! not.

use etalon::backend::{Backend, Execution, Inputs};
use etalon::effects::CameraParams;
use etalon::effects::geometry::{DrawClass, Geometry, Item, Surface, View, gbuffer, prepass};
use etalon::graph::Graph;
use etalon::kernel::Arithmetic;
use etalon::plan::Capture;
use etalon::raster::{StepMode, VertexAttribute, VertexFormat, VertexLayout};
use etalon::resource::BufferDesc;
use etalon_tests::{executors, plan_for};
use glam::DMat4;

type Triangle = [[f32; 3]; 3];

const WIDTH: u32 = 96;
const HEIGHT: u32 = 54;

/// In the left half of the picture, 4 m away.
const GOOD: Triangle = [[-2.0, -1.0, -4.0], [-0.5, -1.0, -4.0], [-1.5, 1.0, -4.0]];

/// Corners in the right half, to go with bad ones.
const OTHERS: [[f32; 3]; 2] = [[0.5, -1.0, -4.0], [2.0, 1.0, -4.0]];

/// Triangles that cover nothing that there is.
fn bad() -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN] {
        for axis in 0..3 {
            let mut corner = [1.0, 0.5, -4.0];
            corner[axis] = number;
            let [a, b] = OTHERS;
            // At each place in the triangle, and alone.
            triangles.extend([[corner, a, b], [a, corner, b], [a, b, corner], [corner; 3]]);
        }
        triangles.push([[number; 3], OTHERS[0], OTHERS[1]]);
    }
    let [a, b] = OTHERS;
    // Without area, behind the camera, in the plane of the camera.
    triangles.extend([
        [a, a, b],
        [a; 3],
        [[0.5, 0.0, 4.0], [2.0, 0.0, 4.0], [1.0, 1.0, 4.0]],
        [[0.5, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[0.0; 3]; 3],
    ]);
    triangles
}

fn draw(executor: &mut dyn Backend, triangles: &[Triangle]) -> Execution {
    let corners = triangles.iter().flatten();
    let numbers = corners.flat_map(|[x, y, z]| [*x, *y, *z, 0.0, 0.0, 1.0]);
    let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    let mut graph = Graph::new();
    let desc = BufferDesc {
        bytes: bytes.len() as u64,
    };
    let buffer = graph.import_buffer("corners", desc).unwrap();
    let attribute = |name: &'static str, offset| VertexAttribute {
        name: name.into(),
        format: VertexFormat::Float32x3,
        offset,
    };
    let layout = VertexLayout {
        stride: 24,
        step: StepMode::Vertex,
        attributes: vec![attribute("position", 0), attribute("normal", 12)],
    };
    let items = [Item {
        vertices: vec![(buffer, 0, layout)],
        indices: None,
        elements: 0..3 * triangles.len() as u32,
        world: DMat4::IDENTITY,
        previous: DMat4::IDENTITY,
        class: DrawClass::Static,
        surface: Surface {
            two_sided: true,
            ..Surface::default()
        },
    }];
    let geometry = Geometry {
        items: &items,
        view: View {
            camera: CameraParams::perspective(1.0, WIDTH as f32 / HEIGHT as f32, 0.1),
            view: DMat4::IDENTITY,
            previous: DMat4::IDENTITY,
        },
        size: [WIDTH, HEIGHT],
    };
    let pre = prepass(&mut graph, &geometry, true).unwrap();
    let surfaces = gbuffer(&mut graph, &geometry, Some(&pre)).unwrap();
    graph.output("depth", pre.depth).unwrap();
    graph.output("velocity", pre.velocity.unwrap()).unwrap();
    graph.output("colour", surfaces.colour).unwrap();
    let kernels = etalon::effects::kernels();
    let strict = Arithmetic::Strict;
    let plan = plan_for(executor, &graph, &kernels, strict, Capture::Outputs).unwrap();
    let inputs = Inputs::new().buffer("corners", &bytes);
    executor.execute(&plan, &inputs).unwrap()
}

/// How many pixels of the left and of the right half show a surface.
fn covered(drawn: &Execution) -> [usize; 2] {
    let colour = drawn.output("colour").unwrap();
    let count = |columns: std::ops::Range<u32>| {
        let pixels = columns.flat_map(|x| (0..HEIGHT).map(move |y| (x, y)));
        pixels
            .filter(|&(x, y)| colour.texel(x, y, 0, 0).unwrap().to_f64()[3] != 0.0)
            .count()
    };
    [count(0..WIDTH / 2), count(WIDTH / 2..WIDTH)]
}

#[test]
fn bad_vertices_draw_nothing_and_spoil_nothing() {
    let bad = bad();
    for executor in &mut executors() {
        let alone = draw(executor.as_mut(), &[GOOD]);
        let [seen, none] = covered(&alone);
        assert!(seen > 100 && none == 0, "{seen}, {none}");
        // Each by itself, so that the one to blame is known.
        for (number, triangle) in bad.iter().enumerate() {
            let drawn = draw(executor.as_mut(), &[*triangle, GOOD]);
            let who = format!("{number}: {triangle:?} on {}", executor.info());
            assert_eq!(covered(&drawn), [seen, 0], "{who}");
            for name in ["depth", "velocity", "colour"] {
                let [a, b] = [&alone, &drawn].map(|run| run.output(name).unwrap());
                assert!(a.bytes == b.bytes, "{name}, {who}");
            }
        }
        let mut all = bad.clone();
        all.insert(bad.len() / 2, GOOD);
        let drawn = draw(executor.as_mut(), &all);
        let who = executor.info();
        assert_eq!(covered(&drawn), [seen, 0], "all on {who}");
    }
}

/// The same with a triangle that is good: the count must see it.
#[test]
fn a_triangle_more_is_counted() {
    let more = [OTHERS[0], OTHERS[1], [0.5, 1.0, -4.0]];
    for executor in &mut executors() {
        let [_, right] = covered(&draw(executor.as_mut(), &[GOOD, more]));
        assert!(right > 100, "{right} on {}", executor.info());
    }
}

/// Corners so far away that `f32` barely holds them: a floor without end covers the
/// lower half on every backend, and nothing else.
#[test]
fn corners_without_end_leave_the_picture_whole() {
    for far in [1e4_f32, 1e8, 1e12] {
        let floor = [[-far, -1.0, far], [far, -1.0, far], [0.0, -1.0, -far]];
        for executor in &mut executors() {
            // There llvmpipe's cuts, which are made in f32, leave holes; the
            // interpreter's are not.
            if far > 1e8 && executor.info().backend != "cpu" {
                continue;
            }
            let drawn = draw(executor.as_mut(), &[floor]);
            let colour = drawn.output("colour").unwrap();
            let shows = |x, y| colour.texel(x, y, 0, 0).unwrap().to_f64()[3] != 0.0;
            let who = format!("{far:e} on {}", executor.info());
            for x in 0..WIDTH {
                // The horizon itself is a matter of roundings.
                let sky = (0..HEIGHT / 2 - 1).all(|y| !shows(x, y));
                assert!(sky, "{x}, {who}");
                let ground = (HEIGHT / 2 + 2..HEIGHT).all(|y| shows(x, y));
                assert!(ground, "{x}, {who}");
            }
        }
    }
}

//! How much is drawn: nothing, so much, or as a buffer says.

use super::{Scene, colours, flat, kernels, on_routes};
use crate::common::everywhere;
use etalon_core::Format;
use etalon_core::backend::{Backend, Execution};
use etalon_core::graph::Draw;
use etalon_core::kernel::KernelLibrary;
use etalon_core::raster::{IndexFormat, StepMode, VertexFormat, VertexLayout};

/// Rectangles by vertex and instance: each vertex is at its own column and
/// instances are rows.
fn library() -> KernelLibrary {
    let mut library = kernels();
    library.add_source(
        "test/grid",
        "struct Corner { @builtin(position) clip: vec4f, @location(0) @interpolate(flat) id: u32 }
         @vertex fn vertex(
             @location(0) position: vec4f, @location(1) row: f32, @builtin(instance_index) instance: u32
         ) -> Corner {
             return Corner(position - vec4f(0.0, row, 0.0, 0.0), instance);
         }
         @fragment fn fragment(corner: Corner) -> @location(0) vec4f {
             return vec4f(f32(corner.id + 1u), 0.0, 0.0, 1.0);
         }",
    );
    library
}

const SIZE: (u32, u32) = (8, 4);

/// Six corners for each of eight columns of the top row.
fn cells() -> Vec<f32> {
    (0..8_u8)
        .flat_map(|column| {
            let x = f32::from(column);
            super::rectangle(SIZE, (x, 0.0), (x + 1.0, 1.0), 0.0)
        })
        .collect()
}

/// What the rows of a step down are in clip space.
const ROWS: [f32; 4] = [0.0, 0.5, 1.0, 1.5];

fn draw(scene: &mut Scene) -> Draw {
    let corners = scene.floats("corners", &cells());
    let rows = scene.floats("rows", &ROWS);
    let by_instance = VertexLayout {
        step: StepMode::Instance,
        ..VertexLayout::packed("row", VertexFormat::Float32)
    };
    Draw::new("test/grid")
        .vertices(corners, 0, super::positions())
        .vertices(rows, 0, by_instance)
}

/// The pixels drawn: column, row, and what the instance was.
fn drawn(execution: &Execution) -> Vec<(u32, u32, u32)> {
    let image = colours(execution, "image");
    let image = image.into_iter().filter(|(_, _, colour)| colour[3] != 0.0);
    image
        .map(|(x, y, colour)| (x, y, colour[0] as u32 - 1))
        .collect()
}

#[test]
fn records_say_vertices_and_instances() {
    let scene = || {
        let mut scene = Scene::default();
        let records = [
            // Vertices, instances, first vertex, first instance; before them
            // what the offset skips.
            [99; 4],
            [6, 1, 0, 0],
            [12, 2, 12, 1],
            // Nothing.
            [6, 0, 0, 0],
            [0, 3, 0, 0],
            [6, 1, 42, 3],
        ];
        let records = scene.words("records", records.as_flattened());
        let draw = draw(&mut scene).indirect(records, 16, 5);
        scene.draw(SIZE, Format::Rgba16Float, [draw]);
        scene
    };
    on_routes(&library(), scene, |execution| {
        let wanted = [
            (0, 0, 0),
            (2, 1, 1),
            (3, 1, 1),
            (2, 2, 2),
            (3, 2, 2),
            (7, 3, 3),
        ];
        assert_eq!(drawn(execution), wanted);
    });
}

#[test]
fn records_say_indices_and_base_vertices() {
    for format in [IndexFormat::Uint16, IndexFormat::Uint32] {
        let scene = || {
            let mut scene = Scene::default();
            let records: [[u32; 5]; 4] = [
                // Indices, instances, first index, base vertex, first instance.
                [6, 1, 2, 0, 0],
                [6, 2, 2, 18, 2],
                [6, 1, 8, -6_i32 as u32, 1],
                [0, 1, 0, 0, 0],
            ];
            let records = scene.words("records", records.as_flattened());
            let indices = [99, 99, 0, 1, 2, 3, 4, 5, 36, 37, 38, 39, 40, 41];
            let bytes: Vec<u8> = match format {
                IndexFormat::Uint16 => indices
                    .iter()
                    .flat_map(|index| (*index as u16).to_le_bytes())
                    .collect(),
                IndexFormat::Uint32 => indices
                    .iter()
                    .flat_map(|index: &u32| index.to_le_bytes())
                    .collect(),
            };
            let indices = scene.buffer("indices", bytes);
            let draw = draw(&mut scene)
                .indices(indices, 0, format)
                .indirect(records, 0, 4);
            scene.draw(SIZE, Format::Rgba16Float, [draw]);
            scene
        };
        on_routes(&library(), scene, |execution| {
            let wanted = [(0, 0, 0), (5, 1, 1), (3, 2, 2), (3, 3, 3)];
            assert_eq!(drawn(execution), wanted, "{format:?}");
        });
    }
}

#[test]
fn no_elements_instances_or_records_draw_nothing() {
    everywhere(|_, backend| {
        let mut scene = Scene::default();
        let records = scene.words("records", &[6, 1, 0, 0]);
        let corners = scene.floats("corners", &cells());
        let all = || flat(corners, [1.0; 4]);
        let draws = [
            all(),
            all().elements(6..6),
            all().elements(0..6).instances(3..3),
            // Nothing is read, so that nothing need be there.
            all().elements(99..99),
            all().indirect(records, 0, 0),
        ];
        let before = backend.counters();
        scene.draw(SIZE, Format::Rgba8Unorm, draws);
        let execution = scene.run(backend, &kernels());
        assert_eq!(drawn(&execution), []);
        assert_eq!(backend.counters().draws, before.draws);
    });
}

/// Records and indices that name what is not there neither draw beside it nor
/// take the device down.
#[test]
fn what_records_and_indices_name_need_not_be_there() {
    let scene = || {
        let mut scene = Scene::default();
        let far = 1 << 30;
        let records = [
            [6, 1, 6, 0],
            // Vertices and instances past the end.
            [6, 1, far, 0],
            [far, 1, 0, 0],
            [6, 1, 0, 5],
            [6, far, 0, 0],
        ];
        let records = scene.words("records", records.as_flattened());
        let draw = draw(&mut scene).indirect(records, 0, 5);
        scene.draw(SIZE, Format::Rgba16Float, [draw]);
        scene
    };
    on_routes(&library(), scene, |execution| {
        assert_eq!(drawn(execution), [(1, 0, 0)]);
    });
    let scene = || {
        let mut scene = Scene::default();
        let indices = scene.words("indices", &[0, 1, 2, 1 << 30, u32::MAX, 1 << 20, 3, 4, 5]);
        let draw = draw(&mut scene)
            .indices(indices, 0, IndexFormat::Uint32)
            .elements(0..9);
        scene.draw(SIZE, Format::Rgba16Float, [draw]);
        scene
    };
    on_routes(&library(), scene, |execution| {
        assert!(drawn(execution).contains(&(0, 0, 0)));
    });
}

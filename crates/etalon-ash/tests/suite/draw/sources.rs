//! What draws are fed from: vertices, indices, instances and records.

use crate::common;

use common::draw::{Scene, corners, quad, state, tinted};
use common::on_each;
use etalon_core::Format;
use etalon_core::graph::{Buffer, ClearValue, Draw};
use etalon_core::image::ImageData;
use etalon_core::raster::{
    Blend, IndexFormat, StepMode, TargetState, Topology, VertexAttribute, VertexFormat,
    VertexLayout,
};

/// A row of pixels.
const ROW: [u32; 2] = [8, 1];
const BLACK: ClearValue = ClearValue::Float([0.0; 4]);

fn row(image: &ImageData) -> Vec<f32> {
    common::reds(image)
}

/// Six corners for each pixel of the row.
fn pixels() -> Vec<f32> {
    let pixel = |x| quad(ROW, [x as f32, 0.0], [x as f32 + 1.0, 1.0], 0.5);
    (0..ROW[0]).flat_map(pixel).collect()
}

/// Draws pixels, each counted up by the number of the instance and 1.
fn counted(mesh: Buffer) -> Draw {
    Draw::new("draw/pixels")
        .vertices(mesh, 0, corners())
        .state(state(|state| {
            state.targets = vec![TargetState {
                blend: Some(Blend::ADD),
                ..TargetState::default()
            }];
        }))
}

/// Draws to the row, where colours are added up.
fn drawn(
    backend: &mut etalon_ash::AshBackend,
    scene: Scene,
    draws: impl IntoIterator<Item = Draw>,
) -> Vec<f32> {
    let image = scene.one(backend, ROW, Format::R16Float, BLACK, |pass| {
        pass.draws(draws)
    });
    row(&image)
}

#[test]
fn vertices_begin_and_end_where_the_draw_says() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let mesh = scene.floats("mesh", &pixels());
        // Behind two pixels of six corners, and from the third corner on.
        let behind = Draw::new("draw/pixels").vertices(mesh, 2 * 96, corners());
        let draws = [
            counted(mesh).elements(6..12),
            behind.elements(6..12),
            counted(mesh).elements(30..48).instances(2..3),
            // Nothing, in each of the ways there are.
            counted(mesh).elements(0..0),
            counted(mesh).elements(9..9),
            counted(mesh).elements(0..6).instances(0..0),
            counted(mesh).elements(0..6).instances(5..5),
        ];
        let found = drawn(backend, scene, draws);
        assert_eq!(found, [0.0, 1.0, 0.0, 1.0, 0.0, 3.0, 3.0, 3.0]);
    });
}

#[test]
fn indices_of_both_sizes_are_taken_from_the_base_vertex_on() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let mesh = scene.floats("mesh", &pixels());
        // Pixel 0 backwards, behind two that are not drawn; pixel 3 after it.
        let indices = [40, 40, 5, 4, 3, 2, 1, 0, 18, 19, 20, 21, 22, 23];
        let shorts = scene.shorts("shorts", &indices.map(|index: u32| index as u16));
        let words = scene.words("words", &indices);
        let short = || counted(mesh).indices(shorts, 0, IndexFormat::Uint16);
        let word = || counted(mesh).indices(words, 0, IndexFormat::Uint32);
        let draws = [
            short().elements(2..8),
            short().elements(2..8).base_vertex(6),
            word().elements(8..14).base_vertex(-6),
            word().elements(2..14).base_vertex(24),
            counted(mesh)
                .indices(shorts, 4, IndexFormat::Uint16)
                .elements(6..12)
                .instances(1..2),
        ];
        let found = drawn(backend, scene, draws);
        assert_eq!(found, [1.0, 1.0, 1.0, 2.0, 1.0, 0.0, 0.0, 1.0]);
    });
}

#[test]
fn instances_step_through_buffers_of_their_own() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let mesh = quad(ROW, [0.0, 0.0], [1.0, 1.0], 0.5);
        let mesh = scene.floats("mesh", &mesh);
        // Offset in clip space and id, between words that nobody reads.
        let words: Vec<u32> = [(0, 10_u32), (2, 20), (5, 30), (7, 40)]
            .into_iter()
            .flat_map(|(pixel, id)| {
                let x = pixel as f32 * 2.0 / ROW[0] as f32;
                [99, id, x.to_bits(), 0.0_f32.to_bits()]
            })
            .collect();
        let instances = scene.words("instances", &words);
        let attribute = |name: &'static str, format, offset| VertexAttribute {
            name: name.into(),
            format,
            offset,
        };
        let layout = VertexLayout {
            stride: 16,
            step: StepMode::Instance,
            attributes: vec![
                attribute("id", VertexFormat::Uint32, 4),
                attribute("offset", VertexFormat::Float32x2, 8),
            ],
        };
        let target = scene.target("target", ROW, Format::R32Uint);
        let written = scene
            .graph
            .raster("pass")
            .colour(
                "colour",
                target,
                etalon_core::graph::Load::Clear(ClearValue::Uint([5; 4])),
            )
            .draw(
                Draw::new("draw/instances")
                    .vertices(mesh, 0, corners())
                    .vertices(instances, 0, layout)
                    .elements(0..6)
                    .instances(1..4),
            )
            .finish()
            .unwrap();
        let texture = written.texture("colour").unwrap();
        scene.graph.output("colour", texture).unwrap();
        let execution = scene.run(backend);
        let image = execution.output("colour").unwrap();
        let ids: Vec<u32> = image
            .bytes
            .chunks_exact(4)
            .map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        // The number of the instance is added; the first is 1.
        assert_eq!(ids, [5, 5, 21, 5, 5, 32, 5, 43]);
    });
}

/// Both formats' largest index begins a new strip.
#[test]
fn strips_end_at_the_largest_index() {
    on_each(|backend| {
        let mut scene = Scene::new();
        // Upper and lower corner of the edge before each pixel.
        let edges: Vec<f32> = (0..=ROW[0])
            .flat_map(|x| {
                let x = x as f32 * 2.0 / ROW[0] as f32 - 1.0;
                [x, 1.0, 0.5, 1.0, x, -1.0, 0.5, 1.0]
            })
            .collect();
        let edges = scene.floats("edges", &edges);
        // Pixels 0 and 1, then 4, then 6 of the other size.
        let shorts = [0, 1, 2, 3, 4, 5, 0xffff, 8, 9, 10, 11];
        let shorts = scene.shorts("shorts", &shorts);
        let words = scene.words("words", &[3, 2, u32::MAX, 12, 13, 14, 15]);
        let strip = |draw: Draw| {
            draw.vertices(edges, 0, corners()).state(state(|state| {
                state.topology = Topology::TriangleStrip;
                // Every second triangle is turned around, so all are fronts.
                state.cull = etalon_core::raster::CullMode::Back;
                state.targets = vec![TargetState {
                    blend: Some(Blend::ADD),
                    ..TargetState::default()
                }];
            }))
        };
        let new = || strip(Draw::new("draw/pixels"));
        let draws = [
            new()
                .indices(shorts, 0, IndexFormat::Uint16)
                .elements(0..11),
            new().indices(words, 0, IndexFormat::Uint32).elements(0..7),
            // Without indices.
            new().elements(6..10),
        ];
        let found = drawn(backend, scene, draws);
        assert_eq!(found, [1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0]);
    });
}

#[test]
fn as_much_is_drawn_as_records_say() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let mesh = scene.floats("mesh", &pixels());
        // Vertices, instances, first vertex, first instance; behind a word.
        let plain = [
            7, //
            6, 1, 0, 0, //
            0, 1, 0, 0, //
            12, 2, 12, 0, //
            6, 1, 36, 4,
        ];
        // Indices, instances, first index, base vertex, first instance.
        let indexed = [6, 1, 2, -(6_i32) as u32, 0, 6, 0, 0, 0, 0, 6, 1, 2, 30, 1];
        let plain = scene.words("plain", &plain);
        let indexed = scene.words("indexed", &indexed);
        let indices: Vec<u32> = [40, 40].into_iter().chain(12..18).collect();
        let indices = scene.words("indices", &indices);
        let draws = [
            counted(mesh).indirect(plain, 4, 4),
            counted(mesh)
                .indices(indices, 0, IndexFormat::Uint32)
                .indirect(indexed, 0, 3),
            counted(mesh).indirect(plain, 4, 0),
        ];
        let found = drawn(backend, scene, draws);
        // Instances 0 and 1 count 1 and 2; from instance 4 on it is 5.
        assert_eq!(found, [1.0, 1.0, 3.0, 3.0, 0.0, 0.0, 5.0, 2.0]);
    });
}

/// Whatever indices and records say, nothing is read that is not there.
#[test]
fn vertices_that_do_not_exist_do_no_harm() {
    on_each(|backend| {
        for seed in 0..8_u32 {
            let mut scene = Scene::new();
            let mesh = scene.floats("mesh", &pixels());
            let wild = |k: u32| {
                let mixed = (k + 77 * seed).wrapping_mul(2_654_435_761);
                match mixed % 4 {
                    0 => mixed,
                    1 => mixed >> 20,
                    2 => u32::MAX - (mixed >> 24),
                    _ => 1 << (mixed % 31),
                }
            };
            let values: Vec<u32> = (0..96).map(wild).collect();
            let words = scene.words("words", &values);
            let shorts: Vec<u16> = values.iter().map(|value| *value as u16).collect();
            let shorts = scene.shorts("shorts", &shorts);
            // Few enough to end, from anywhere on.
            let records: Vec<u32> = (0..6).flat_map(|k| [30, 2, wild(k), wild(k + 9)]).collect();
            let records = scene.words("records", &records);
            let draws = [
                counted(mesh)
                    .indices(words, 0, IndexFormat::Uint32)
                    .elements(0..96),
                counted(mesh)
                    .indices(shorts, 0, IndexFormat::Uint16)
                    .elements(0..96)
                    .base_vertex(-1_000_000),
                counted(mesh)
                    .indices(shorts, 0, IndexFormat::Uint16)
                    .elements(0..96)
                    .base_vertex(i32::MAX),
                counted(mesh).indirect(records, 0, 6),
            ];
            drawn(backend, scene, draws);
            // Indices behind the end of their buffer take `robustBufferAccess2`,
            // which lavapipe has.
            if !etalon_core::backend::Backend::info(backend)
                .device
                .contains("llvmpipe")
            {
                continue;
            }
            let mut scene = Scene::new();
            let mesh = scene.floats("mesh", &pixels());
            let words = scene.words("words", &values);
            let records: Vec<u32> = (0..6)
                .flat_map(|k| [30, 2, wild(k), wild(k + 9), wild(k + 5)])
                .collect();
            let records = scene.words("records", &records);
            let draw = counted(mesh)
                .indices(words, 0, IndexFormat::Uint32)
                .indirect(records, 0, 6);
            drawn(backend, scene, [draw]);
        }
        // And the device is still there.
        let mut scene = Scene::new();
        let mesh = scene.floats("mesh", &pixels());
        let found = drawn(backend, scene, [counted(mesh).elements(0..48)]);
        assert_eq!(found, [1.0; 8]);
    });
}

/// Each draw has its own block, and all of them lie in one ring.
#[test]
fn every_draw_has_its_own_uniforms() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let meshes: Vec<Buffer> = (0..8)
            .map(|x| {
                let mesh = quad(ROW, [x as f32, 0.0], [x as f32 + 1.0, 1.0], 0.5);
                scene.floats(&format!("mesh {x}"), &mesh)
            })
            .collect();
        let draws = meshes.iter().enumerate().map(|(x, mesh)| {
            let value = 0.5 + x as f32;
            tinted(*mesh, [value; 4]).elements(0..6)
        });
        let found = drawn(backend, scene, draws.collect::<Vec<_>>());
        assert_eq!(found, [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5]);
    });
}

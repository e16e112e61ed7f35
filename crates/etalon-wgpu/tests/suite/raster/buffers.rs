//! Vertices, indices and instances.

use super::{Scene, colours, kernels, on_routes, rectangle};
use etalon_core::Format;
use etalon_core::backend::Execution;
use etalon_core::graph::{Buffer, Draw};
use etalon_core::kernel::KernelLibrary;
use etalon_core::raster::{
    IndexFormat, RasterState, StepMode, Topology, VertexAttribute, VertexFormat, VertexLayout,
};

/// Rectangles of pixels by instance, from two vertex buffers.
const PLACED: &str = "
    struct Corner { @builtin(position) clip: vec4f, @location(4) @interpolate(flat) id: u32,
                    @location(1) shade: vec2f }
    @vertex fn vertex(
        @builtin(instance_index) instance: u32,
        @location(3) offset: vec2f,
        @location(0) position: vec2f,
        @location(5) shade: vec2f,
    ) -> Corner {
        return Corner(vec4f(position + offset, 0.0, 1.0), instance, shade);
    }
    @fragment fn fragment(corner: Corner) -> @location(0) vec4f {
        return vec4f(f32(corner.id), corner.shade, 1.0);
    }";

fn library() -> KernelLibrary {
    let mut library = kernels();
    library.add_source("test/placed", PLACED);
    library
}

fn attribute(name: &'static str, format: VertexFormat, offset: u32) -> VertexAttribute {
    VertexAttribute {
        name: name.into(),
        format,
        offset,
    }
}

/// A square of two pixels at the left of eight, with an unused attribute between.
fn square() -> Vec<f32> {
    [
        [-1.0, -1.0],
        [-0.75, -1.0],
        [-0.75, 1.0],
        [-1.0, -1.0],
        [-0.75, 1.0],
        [-1.0, 1.0],
    ]
    .iter()
    .flat_map(|[x, y]| [99.0, *x, *y])
    .collect()
}

fn square_layout() -> VertexLayout {
    VertexLayout {
        stride: 12,
        step: StepMode::Vertex,
        attributes: vec![
            attribute("unused", VertexFormat::Float32, 0),
            attribute("position", VertexFormat::Float32x2, 4),
        ],
    }
}

/// Instances are moved by a float and shaded by normalised integers.
fn instance_layout() -> VertexLayout {
    VertexLayout {
        stride: 12,
        step: StepMode::Instance,
        attributes: vec![
            attribute("offset", VertexFormat::Float32x2, 0),
            attribute("shade", VertexFormat::Unorm16x2, 8),
        ],
    }
}

/// Offsets of every two pixels, and shades of that.
fn instances(count: u16) -> Vec<u8> {
    (0..count)
        .flat_map(|index| {
            let mut bytes = [f32::from(index) * 0.25, 0.0]
                .map(f32::to_le_bytes)
                .concat();
            bytes.extend((index * 0x1111).to_le_bytes());
            bytes.extend(0xffff_u16.to_le_bytes());
            bytes
        })
        .collect()
}

#[test]
fn instances_are_fed_from_buffers_from_the_first_on() {
    let scene = || {
        let mut scene = Scene::default();
        let corners = scene.floats("corners", &square());
        let placed = scene.buffer("placed", instances(8));
        let draw = Draw::new("test/placed")
            .vertices(placed, 0, instance_layout())
            .vertices(corners, 0, square_layout())
            .elements(0..6)
            .instances(2..5);
        scene.draw((16, 4), Format::Rgba16Float, [draw]);
        scene
    };
    on_routes(&library(), scene, |execution| {
        for (x, y, colour) in colours(execution, "image") {
            let instance = (x / 2) as f32;
            let wanted = if (4..10).contains(&x) {
                [instance, instance / 15.0, 1.0, 1.0]
            } else {
                [0.0; 4]
            };
            // What is not whole is under 1, where binary16 is 2^-11 apart, and
            // has three more roundings to binary32.
            let near = colour
                .iter()
                .zip(wanted)
                .all(|(a, b)| (a - b).abs() <= 0.00049);
            assert!(near, "{colour:?}, not {wanted:?}, at {x}, {y}");
        }
    });
}

/// The columns that are drawn.
fn columns(execution: &Execution) -> Vec<u32> {
    let image = colours(execution, "image");
    let first = image.iter().filter(|(_, y, _)| *y == 0);
    first
        .filter(|(_, _, colour)| colour[3] != 0.0)
        .map(|(x, _, _)| *x)
        .collect()
}

/// Four corners for each of eight columns.
fn strip_corners() -> Vec<f32> {
    (0..8)
        .flat_map(|column| {
            let [left, right] = [column, column + 1].map(|x| x as f32 / 4.0 - 1.0);
            [[left, 1.0], [left, -1.0], [right, 1.0], [right, -1.0]]
        })
        .flat_map(|[x, y]| [x, y, 0.0, 1.0])
        .collect()
}

fn indices(format: IndexFormat, indices: &[u32]) -> Vec<u8> {
    let bytes = indices.iter().flat_map(|index| match format {
        IndexFormat::Uint16 => (*index as u16).to_le_bytes().to_vec(),
        IndexFormat::Uint32 => index.to_le_bytes().to_vec(),
    });
    let mut bytes: Vec<u8> = bytes.collect();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn indexed(corners: Buffer, indices: Buffer, format: IndexFormat) -> Draw {
    super::flat(corners, [1.0; 4]).indices(indices, u64::from(format.bytes()), format)
}

#[test]
fn indices_of_both_sizes_pick_vertices_from_the_base_on() {
    for format in [IndexFormat::Uint16, IndexFormat::Uint32] {
        let scene = || {
            let mut scene = Scene::default();
            let corners = scene.floats("corners", &strip_corners());
            // The first index is skipped by the offset, the next three by the range.
            let bytes = indices(format, &[31, 31, 31, 31, 0, 1, 2, 2, 1, 3]);
            let buffer = scene.buffer("indices", bytes);
            let draws = [0, 8, 28].map(|base| {
                indexed(corners, buffer, format)
                    .elements(3..9)
                    .base_vertex(base)
            });
            scene.draw((8, 2), Format::Rgba8Unorm, draws);
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            assert_eq!(columns(execution), [0, 2, 7], "{format:?}");
        });
    }
}

#[test]
fn negative_bases_are_added_too() {
    let scene = || {
        let mut scene = Scene::default();
        let corners = scene.floats("corners", &strip_corners());
        let bytes = indices(IndexFormat::Uint32, &[0, 12, 13, 14, 14, 13, 15]);
        let buffer = scene.buffer("indices", bytes);
        let draw = indexed(corners, buffer, IndexFormat::Uint32)
            .elements(0..6)
            .base_vertex(-8);
        scene.draw((8, 2), Format::Rgba8Unorm, [draw]);
        scene
    };
    on_routes(&kernels(), scene, |execution| {
        assert_eq!(columns(execution), [1]);
    });
}

#[test]
fn the_largest_index_begins_a_new_strip() {
    for format in [IndexFormat::Uint16, IndexFormat::Uint32] {
        let scene = || {
            let mut scene = Scene::default();
            let corners = scene.floats("corners", &strip_corners());
            let restart = format.restart();
            let strips = [9, 4, 5, 6, 7, restart, 16, 17, 18, 19];
            let buffer = scene.buffer("indices", indices(format, &strips));
            let state = RasterState {
                topology: Topology::TriangleStrip,
                // All of a strip face the same way.
                cull: etalon_core::raster::CullMode::Back,
                ..RasterState::default()
            };
            let draw = indexed(corners, buffer, format).elements(0..9).state(state);
            scene.draw((8, 2), Format::Rgba8Unorm, [draw]);
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            assert_eq!(columns(execution), [1, 4], "{format:?}");
        });
    }
}

#[test]
fn strips_need_no_indices() {
    let scene = || {
        let mut scene = Scene::default();
        let corners = scene.floats("corners", &strip_corners());
        let state = RasterState {
            topology: Topology::TriangleStrip,
            ..RasterState::default()
        };
        let draw = super::flat(corners, [1.0; 4]).elements(4..12).state(state);
        scene.draw((8, 2), Format::Rgba8Unorm, [draw]);
        scene
    };
    on_routes(&kernels(), scene, |execution| {
        assert_eq!(columns(execution), [1, 2]);
    });
}

/// Each format reads as what the reference says of its bytes.
#[test]
fn vertex_formats_are_read_as_numbers() {
    let bytes: Vec<u8> = [0x81, 0x7f, 0xff, 0x00, 0x00, 0x3c, 0x00, 0xc0]
        .into_iter()
        .chain(2.5_f32.to_le_bytes())
        .chain((-7.0_f32).to_le_bytes())
        .collect();
    let half = |value: u16| f32::from(value);
    let cases: [(VertexFormat, u32, [f32; 4]); 9] = [
        (VertexFormat::Float32, 8, [2.5, 0.0, 0.0, 1.0]),
        (VertexFormat::Float32x2, 8, [2.5, -7.0, 0.0, 1.0]),
        (VertexFormat::Float16x2, 4, [1.0, -2.0, 0.0, 1.0]),
        (
            VertexFormat::Unorm8x4,
            0,
            [129.0 / 255.0, 127.0 / 255.0, 1.0, 0.0],
        ),
        (VertexFormat::Unorm8x2, 2, [1.0, 0.0, 0.0, 1.0]),
        (VertexFormat::Snorm8x4, 0, [-1.0, 1.0, -1.0 / 127.0, 0.0]),
        (
            VertexFormat::Unorm16x2,
            4,
            [half(0x3c00) / 65535.0, half(0xc000) / 65535.0, 0.0, 1.0],
        ),
        (
            VertexFormat::Snorm16x2,
            4,
            [half(0x3c00) / 32767.0, -16384.0 / 32767.0, 0.0, 1.0],
        ),
        (
            VertexFormat::Unorm16x4,
            0,
            [half(0x7f81), half(0x00ff), half(0x3c00), half(0xc000)].map(|k| k / 65535.0),
        ),
    ];
    let mut library = kernels();
    library.add_source(
        "test/value",
        "struct Corner { @builtin(position) clip: vec4f, @location(0) value: vec4f }
         @vertex fn vertex(@location(1) value: vec4f, @builtin(vertex_index) index: u32) -> Corner {
             let clip = vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
             return Corner(clip, value);
         }
         @fragment fn fragment(corner: Corner) -> @location(0) vec4f { return corner.value; }",
    );
    for (format, offset, wanted) in cases {
        let scene = || {
            let mut scene = Scene::default();
            let buffer = scene.buffer("values", bytes.clone());
            let layout = VertexLayout {
                stride: 16,
                step: StepMode::Instance,
                attributes: vec![attribute("value", format, offset)],
            };
            let draw = Draw::new("test/value")
                .vertices(buffer, 0, layout)
                .elements(0..3);
            scene.draw((2, 2), Format::Rgba16Float, [draw]);
            scene
        };
        on_routes(&library, scene, |execution| {
            for (_, _, colour) in colours(execution, "image") {
                // Halves of numbers that are not whole are rounded at under 1.
                let near = colour
                    .iter()
                    .zip(wanted)
                    .all(|(a, b)| (a - b).abs() <= 0.00049);
                assert!(near, "{format:?}: {colour:?}, not {wanted:?}");
            }
        });
    }
}

#[test]
fn integers_reach_kernels_as_integers() {
    let mut library = kernels();
    library.add_source(
        "test/integers",
        "struct Corner { @builtin(position) clip: vec4f, @location(0) @interpolate(flat) ids: vec4u,
                         @location(1) @interpolate(flat) change: i32 }
         @vertex fn vertex(@location(0) position: vec4f, @location(1) ids: vec4u, @location(2) change: i32)
             -> Corner { return Corner(position, ids, change); }
         struct Targets { @location(0) ids: vec4u, @location(1) change: i32 }
         @fragment fn fragment(corner: Corner) -> Targets { return Targets(corner.ids, corner.change); }",
    );
    let scene = || {
        let mut scene = Scene::default();
        let size = (2, 2);
        let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (2.0, 2.0), 0.0));
        let values = [0xff02_8001_u32, 0x0000_ffff, -5_i32 as u32];
        let values = scene.words("values", &values);
        let layout = VertexLayout {
            stride: 12,
            step: StepMode::Instance,
            attributes: vec![
                attribute("ids", VertexFormat::Uint8x4, 0),
                attribute("change", VertexFormat::Sint32, 8),
            ],
        };
        let targets = [("ids", Format::Rgba16Uint), ("change", Format::R32Sint)];
        let textures = targets.map(|(_, format)| scene.target(size, format));
        let zeros = [
            etalon_core::graph::ClearValue::Uint([0; 4]),
            etalon_core::graph::ClearValue::Sint([0; 4]),
        ];
        let mut pass = scene.graph.raster("draws");
        for (((name, _), texture), zero) in targets.into_iter().zip(textures).zip(zeros) {
            pass = pass.colour(name, texture, etalon_core::graph::Load::Clear(zero));
        }
        let draw = Draw::new("test/integers")
            .vertices(corners, 0, super::positions())
            .vertices(values, 0, layout)
            .elements(0..6);
        let written = pass.draw(draw).finish().unwrap();
        for (name, _) in targets {
            scene
                .graph
                .output(name, written.texture(name).unwrap())
                .unwrap();
        }
        scene
    };
    on_routes(&library, scene, |execution| {
        for (_, _, texel) in super::pixels(execution, "ids") {
            assert_eq!(texel.to_f64(), [1.0, 128.0, 2.0, 255.0]);
        }
        for (_, _, texel) in super::pixels(execution, "change") {
            assert_eq!(texel.to_f64()[0], -5.0);
        }
    });
}

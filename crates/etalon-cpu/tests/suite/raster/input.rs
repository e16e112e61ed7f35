//! Vertex formats, indices, strips, instances, and what draws are refused for.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::raster::{
    Blend, IndexFormat, NumberKind, StepMode, TargetState, Topology, VertexAttribute, VertexFormat,
    VertexLayout, Viewport,
};
use etalon_cpu::{Buffer, DrawRange, Executor, RasterError};

/// One number of a vertex attribute, by the format's definition.
fn decoded(format: VertexFormat, bytes: &[u8], component: usize) -> u32 {
    let size = (format.bytes() / format.components()) as usize;
    let at = &bytes[component * size..][..size];
    let word = at
        .iter()
        .rev()
        .fold(0_u32, |word, byte| word << 8 | u32::from(*byte));
    use VertexFormat as V;
    let float = |value: f64| (value as f32).to_bits();
    match format {
        V::Float16x2 | V::Float16x4 => half::f16::from_bits(word as u16).to_f32().to_bits(),
        V::Unorm8x2 | V::Unorm8x4 => float(f64::from(word) / 255.0),
        V::Unorm16x2 | V::Unorm16x4 => float(f64::from(word) / 65535.0),
        V::Snorm8x4 => float((f64::from(word as u8 as i8) / 127.0).max(-1.0)),
        V::Snorm16x2 | V::Snorm16x4 => float((f64::from(word as u16 as i16) / 32767.0).max(-1.0)),
        _ => word,
    }
}

#[test]
fn attributes_of_every_format_are_decoded() {
    let mut random = Random(17);
    for &format in VertexFormat::ALL {
        let (kind, is_float) = match format.kind() {
            NumberKind::Float => ("f32", true),
            NumberKind::Uint => ("u32", false),
            NumberKind::Sint => ("i32", false),
        };
        let colour = match format.kind() {
            NumberKind::Float => "bitcast<vec4<u32>>(in.value)",
            _ => "vec4<u32>(in.value)",
        };
        let wgsl = format!(
            "struct Varyings {{ @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) value: vec4<{kind}> }}
             @vertex fn vertex(@builtin(vertex_index) i: u32, @location(5) value: vec4<{kind}>) -> Varyings {{
                 let pixel = i / 3u;
                 let corner = vec2(f32(i % 3u % 2u), f32(i % 3u / 2u)) * 2.0;
                 let at = (vec2(f32(pixel), 0.0) + corner) / vec2(32.0, 0.5) - 1.0;
                 return Varyings(vec4(at.x, -at.y, 0.0, 1.0), value);
             }}
             @fragment fn fragment(in: Varyings) -> @location(0) vec4<u32> {{ return {colour}; }}"
        );
        // Numbers that are all different, somewhere in elements that are larger.
        let alignment = format.bytes().min(4);
        let (stride, offset) = (format.bytes().next_multiple_of(4) + 12, 8 + alignment % 4);
        let bytes: Vec<u8> = (0..64 * 3 * stride).map(|_| random.next() as u8).collect();
        let mut scene = Scene::new(&wgsl, [64, 1], &[]);
        scene.layouts = vec![VertexLayout {
            stride,
            step: StepMode::Vertex,
            attributes: vec![VertexAttribute {
                name: "value".into(),
                format,
                offset,
            }],
        }];
        scene.vertices = vec![Buffer::from_bytes(&bytes).unwrap()];
        scene.range = DrawRange::of(64 * 3);
        scene.colours = vec![Format::Rgba32Uint];
        let got = scene.draw().bytes();
        for (pixel, texel) in got[0].chunks_exact(16).enumerate() {
            // The last triangle over a pixel is its own: each begins at its left edge.
            let element = &bytes[pixel * 3 * stride as usize + offset as usize..];
            for component in 0..4 {
                let word = u32::from_le_bytes(texel[component * 4..][..4].try_into().unwrap());
                let want = if component < format.components() as usize {
                    decoded(format, element, component)
                } else if component == 3 {
                    if is_float { 1.0_f32.to_bits() } else { 1 }
                } else {
                    0
                };
                let nans =
                    is_float && f32::from_bits(word).is_nan() && f32::from_bits(want).is_nan();
                assert!(
                    word == want || nans,
                    "{format:?}, pixel {pixel}, {component}"
                );
            }
        }
    }
}

/// Draws a triangle for each three slots of a list, one pixel each, and says which
/// vertices they were of.
const NUMBERED: &str = "
    struct Varyings { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) first: u32, @location(1) number: f32 }
    @vertex fn vertex(@builtin(vertex_index) i: u32, @location(0) at: vec2<f32>) -> Varyings {
        return Varyings(vec4(at, 0.0, 1.0), i, f32(i));
    }
    @fragment fn fragment(in: Varyings, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
        return vec4(f32(in.first), in.number, select(2.0, 1.0, front), 1.0);
    }";

/// A strip in a zigzag over a target of 8×2 pixels, whose vertices are 0 to 17.
fn zigzag() -> Scene<'static> {
    let mut scene = Scene::new(NUMBERED, [64, 8], &[]);
    let at: Vec<f32> = (0..18)
        .flat_map(|i| {
            [
                (i / 2) as f32 / 4.0 - 1.0,
                if i % 2 == 0 { 1.0 } else { -1.0 },
            ]
        })
        .collect();
    scene.layouts = vec![VertexLayout::packed("at", VertexFormat::Float32x2)];
    scene.vertices = vec![common::floats(&at)];
    scene.state.topology = Topology::TriangleStrip;
    scene.range = DrawRange::of(18);
    scene
}

fn indices(format: IndexFormat, list: &[u32]) -> (Buffer, IndexFormat) {
    let bytes: Vec<u8> = match format {
        IndexFormat::Uint16 => list
            .iter()
            .flat_map(|i| (*i as u16).to_le_bytes())
            .collect(),
        IndexFormat::Uint32 => list.iter().flat_map(|i| i.to_le_bytes()).collect(),
    };
    (Buffer::from_bytes(&bytes).unwrap(), format)
}

/// Triangles as a list, in an order that faces the same way and begins with the same.
fn listed(triangles: &[[u32; 3]]) -> Targets {
    let mut scene = zigzag();
    scene.state.topology = Topology::TriangleList;
    let flat: Vec<u32> = triangles.iter().flatten().copied().collect();
    scene.range = DrawRange::of(flat.len() as u32);
    scene.indices = Some(indices(IndexFormat::Uint32, &flat));
    scene.draw_once()
}

#[test]
fn strips_are_lists_of_triangles_that_face_the_same_way() {
    let triangles: Vec<[u32; 3]> = (0..16)
        .map(|i| {
            if i % 2 == 0 {
                [i, i + 1, i + 2]
            } else {
                [i, i + 2, i + 1]
            }
        })
        .collect();
    let want = listed(&triangles);
    assert!(want.colour(0).iter().all(|texel| texel[2] == 1.0), "fronts");
    assert!(zigzag().draw().bytes() == want.bytes());
    for format in [IndexFormat::Uint16, IndexFormat::Uint32] {
        let mut scene = zigzag();
        scene.indices = Some(indices(format, &(0..18).collect::<Vec<_>>()));
        assert!(scene.draw_once().bytes() == want.bytes());
        // Broken off, with short strips that make nothing.
        let restart = format.restart();
        let list = [
            restart, 0, 1, 2, 3, restart, 5, 4, restart, restart, 4, 5, 6, restart, 9, 10, 11, 12,
            13, restart,
        ];
        scene.indices = Some(indices(format, &list));
        scene.range = DrawRange::of(list.len() as u32);
        let want = listed(&[
            [0, 1, 2],
            [1, 3, 2],
            [4, 5, 6],
            [9, 10, 11],
            [10, 12, 11],
            [11, 12, 13],
        ]);
        assert!(scene.draw().bytes() == want.bytes(), "{format:?}");
    }
    // Of lists the index is one like others, and leads nowhere.
    let mut scene = zigzag();
    scene.state.topology = Topology::TriangleList;
    scene.indices = Some(indices(
        IndexFormat::Uint32,
        &[0, 1, 2, u32::MAX, 1, 2, 2, 1, 3],
    ));
    scene.range = DrawRange::of(9);
    let with = scene.draw_once();
    // Beyond the buffer positions are zeros.
    let center = with.colour(0)[4 * 64 + 20];
    assert_eq!(center[3], 1.0);
}

#[test]
fn bases_and_ranges_are_added() {
    let mut scene = zigzag();
    scene.state.topology = Topology::TriangleList;
    let list = [7, 7, 7, 0, 1, 2, 4, 3, 2];
    scene.indices = Some(indices(IndexFormat::Uint16, &list));
    scene.range = DrawRange {
        first: 3,
        count: 6,
        base_vertex: 6,
        first_instance: 0,
        instances: 1,
    };
    let want = listed(&[[6, 7, 8], [10, 9, 8]]);
    assert!(scene.draw().bytes() == want.bytes());
    let indices_from = |base: u32| indices(IndexFormat::Uint32, &list.map(|i| i + base));
    scene.indices = Some(indices_from(100));
    scene.range.base_vertex = -94;
    assert!(scene.draw_once().bytes() == want.bytes());
    // Without indices.
    let mut scene = zigzag();
    scene.state.topology = Topology::TriangleList;
    scene.range = DrawRange {
        first: 3,
        ..DrawRange::of(6)
    };
    assert!(scene.draw_once().bytes() == listed(&[[3, 4, 5], [6, 7, 8]]).bytes());
}

#[test]
fn instances_have_elements_and_numbers_of_their_own() {
    let wgsl = "
        struct Varyings { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) colour: vec2<f32> }
        @vertex fn vertex(
            @location(0) position: vec4<f32>,
            @location(1) shift: f32,
            @builtin(instance_index) i: u32,
        ) -> Varyings {
            return Varyings(position + vec4(shift, 0.0, 0.0, 0.0), vec2(f32(i), shift));
        }
        @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> { return vec4(in.colour, 0.0, 1.0); }";
    for count in [1_u32, 7, 3000] {
        // A column each, of a target so wide.
        let width = count.max(2);
        let pixel = 2.0 / width as f32;
        let positions = [
            [-1.0, 1.0, 0.0, 1.0],
            [-1.0, -3.0, 0.0, 1.0],
            [-1.0 + pixel, 1.0, 0.0, 1.0],
            [-1.0 + pixel, 1.0, 0.0, 1.0],
            [-1.0, -3.0, 0.0, 1.0],
            [-1.0 + pixel, -3.0, 0.0, 1.0],
        ];
        let mut scene = Scene::new(wgsl, [width, 2], &positions);
        let shifts: Vec<f32> = (0..count + 5).map(|i| (i as f32 - 5.0) * pixel).collect();
        scene.layouts.push(VertexLayout {
            step: StepMode::Instance,
            ..VertexLayout::packed("shift", VertexFormat::Float32)
        });
        scene.vertices.push(common::floats(&shifts));
        scene.range.first_instance = 5;
        scene.range.instances = count;
        scene.state.targets = vec![TargetState {
            blend: Some(Blend::ADD),
            ..TargetState::default()
        }];
        let targets = if count == 7 {
            scene.draw()
        } else {
            scene.draw_once()
        };
        for (i, got) in targets.colour(0).iter().enumerate() {
            let x = i as u32 % width;
            let want = if x < count {
                [x as f32 + 5.0, shifts[x as usize + 5], 0.0, 1.0]
            } else {
                [0.0; 4]
            };
            assert_eq!(*got, want, "{x} of {count}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_and_named() {
    let program = zigzag().program();
    let executor = Executor::new(1).unwrap();
    let refused = |change: &dyn Fn(&mut Scene<'_>), needle: &str| {
        let mut scene = zigzag();
        change(&mut scene);
        let targets = scene.targets();
        match scene.try_draw(&program, &executor, &targets, &[]) {
            Err(error @ (RasterError::Draw { .. } | RasterError::State { .. })) => {
                let text = error.to_string();
                assert!(text.contains(needle), "{text}, not {needle}");
            }
            other => panic!("{needle}: {other:?}"),
        }
    };
    refused(&|scene| scene.range.count = 19, "vertex buffer 0");
    refused(&|scene| scene.range.first = u32::MAX, "2^32");
    refused(&|scene| scene.range.base_vertex = 1, "base vertex");
    refused(&|scene| scene.vertices.clear(), "number of vertex buffers");
    refused(
        &|scene| scene.indices = Some(indices(IndexFormat::Uint16, &[0; 17])),
        "at least 36 bytes",
    );
    refused(
        &|scene| scene.colours = vec![Format::R8Unorm],
        "rgba32float",
    );
    refused(
        &|scene| scene.colours.push(Format::R8Unorm),
        "number of colour targets",
    );
    refused(
        &|scene| scene.depth = Some(Format::Depth32Float),
        "depth target",
    );
    refused(
        &|scene| scene.viewport = Some(Viewport::of(65, 8)),
        "viewport",
    );
    refused(
        &|scene| {
            scene.scissor = Some(etalon_core::raster::Scissor {
                x: 1,
                y: 0,
                width: 64,
                height: 8,
            });
        },
        "scissor",
    );

    let unfit = |change: &dyn Fn(&mut Scene<'_>), needle: &str| {
        let mut scene = zigzag();
        change(&mut scene);
        let text = scene.try_program().expect_err(needle).to_string();
        assert!(text.contains(needle), "{text}, not {needle}");
    };
    unfit(
        &|scene| scene.layouts[0].attributes[0].name = "where".into(),
        "none of `where`",
    );
    unfit(
        &|scene| scene.layouts[0].attributes[0].format = VertexFormat::Uint16x4,
        "Uint16x4",
    );
    unfit(&|scene| scene.layouts[0].stride = 6, "stride");
    unfit(
        &|scene| scene.colours = vec![Format::Rgba8Uint],
        "vec4<u32>",
    );
    unfit(&|scene| scene.colours.clear(), "at least one");
    unfit(
        &|scene| scene.state.depth = Some(etalon_core::raster::DepthState::STANDARD),
        "depth",
    );
    unfit(
        &|scene| scene.state.targets = vec![TargetState::default(); 2],
        "2 colour targets",
    );
    unfit(
        &|scene| {
            scene.wgsl = "@vertex fn other() -> @builtin(position) vec4<f32> { return vec4(0.0); }"
        },
        "`vertex`",
    );
    unfit(
        &|scene| {
            scene.wgsl = "@vertex fn vertex(@location(0) at: vec2<f32>) -> @builtin(position) vec4<f32> { return vec4(at, 0.0, 1.0); }
                @fragment fn fragment(@location(3) a: f32) -> @location(0) vec4<f32> { return vec4(a); }";
        },
        "location 3",
    );
    unfit(
        &|scene| {
            scene.wgsl = "@vertex fn vertex(@location(0) at: vec2<f32>) -> @builtin(position) vec4<f32> { return vec4(at, 0.0, 1.0); }
                @fragment fn fragment(@builtin(sample_index) a: u32) -> @location(0) vec4<f32> { return vec4(f32(a)); }";
        },
        "SampleIndex",
    );
    unfit(
        &|scene| {
            scene.wgsl = "@group(0) @binding(0) var<storage, read_write> data: array<u32>;
                @vertex fn vertex(@location(0) at: vec2<f32>) -> @builtin(position) vec4<f32> { data[0] = 1u; return vec4(at, 0.0, 1.0); }
                @fragment fn fragment() -> @location(0) vec4<f32> { return vec4(1.0); }";
        },
        "vertex kernels write",
    );
}

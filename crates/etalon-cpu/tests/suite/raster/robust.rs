//! No input makes the rasteriser panic, and what is not a triangle draws nothing.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::raster::{
    Blend, CullMode, DepthBias, DepthState, IndexFormat, TargetState, Topology, VertexFormat,
    VertexLayout, Viewport,
};
use etalon_core::resource::Compare;
use etalon_cpu::{Buffer, DrawRange};

#[test]
fn what_is_not_a_triangle_draws_nothing() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let good = [0.0, 0.5, 0.5, 1.0];
    let other = [0.5, -0.5, 0.5, 1.0];
    let cases: Vec<[[f32; 4]; 3]> = vec![
        [[nan, 0.0, 0.5, 1.0], good, other],
        [[0.0, nan, 0.5, 1.0], good, other],
        [[0.0, 0.0, nan, 1.0], good, other],
        [[0.0, 0.0, 0.5, nan], good, other],
        [[inf, 0.0, 0.5, 1.0], good, other],
        [[0.0, -inf, 0.5, 1.0], good, other],
        [[0.0, 0.0, 0.5, inf], good, other],
        [good, good, other],
        [good, good, good],
        [[0.0; 4]; 3],
        [
            [-1.0, -1.0, 0.5, 1.0],
            [0.0, 0.0, 0.5, 1.0],
            [1.0, 1.0, 0.5, 1.0],
        ],
        // Behind the camera.
        [
            [0.0, 0.5, 0.5, -1.0],
            [0.5, -0.5, 0.5, -1.0],
            [-0.5, -0.5, 0.5, -1.0],
        ],
        // Beyond the far plane, and before the near one.
        [
            [-1.0, -1.0, 1.5, 1.0],
            [3.0, -1.0, 1.5, 1.0],
            [-1.0, 3.0, 1.5, 1.0],
        ],
        [
            [-1.0, -1.0, -0.5, 1.0],
            [3.0, -1.0, -0.5, 1.0],
            [-1.0, 3.0, -0.5, 1.0],
        ],
    ];
    for (i, corners) in cases.iter().enumerate() {
        let targets = Scene::new(PLAIN, [16, 16], corners).draw();
        assert!(
            targets.colour(0).iter().all(|got| *got == [0.0; 4]),
            "case {i}"
        );
    }
}

/// A position of any bits, or of numbers that matter.
fn position(random: &mut Random) -> [f32; 4] {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MIN_POSITIVE,
        1e-45,
        f32::MAX,
        f32::MIN,
        1e30,
        -1e30,
        1e-30,
        32768.0,
        0.5,
    ];
    [0; 4].map(|_| match random.below(4) {
        0 => f32::from_bits(random.next() as u32),
        1 => special[random.below(special.len())],
        _ => random.range(-3.0, 3.0),
    })
}

#[test]
fn garbage_never_panics_and_is_the_same_everywhere() {
    let wgsl = "
        struct Varyings {
            @builtin(position) position: vec4<f32>,
            @location(0) a: vec4<f32>,
            @location(1) @interpolate(flat) b: vec2<u32>,
            @location(2) @interpolate(linear) c: f32,
        }
        @vertex fn vertex(@location(0) position: vec4<f32>) -> Varyings {
            return Varyings(position, position, bitcast<vec2<u32>>(position.xy), position.z);
        }
        @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> {
            // What is no number has no bits to compare.
            let sum = in.a.x + in.c + f32(in.b.x);
            return select(vec4(2.0), vec4(sum, in.a.y, 1.0, 0.5), abs(sum) + abs(in.a.y) < 1e30);
        }";
    let mut random = Random(1234);
    for round in 0..60 {
        let positions: Vec<[f32; 4]> = (0..240).map(|_| position(&mut random)).collect();
        let size = [1 + random.below(150) as u32, 1 + random.below(90) as u32];
        let mut scene = Scene::new(wgsl, size, &positions);
        scene.layouts = vec![VertexLayout::packed("position", VertexFormat::Float32x4)];
        if round % 3 > 0 {
            let list: Vec<u8> = (0..300)
                .flat_map(|_| {
                    let index = match random.below(6) {
                        0 => u32::MAX,
                        1 => random.next() as u32,
                        _ => random.below(300) as u32,
                    };
                    index.to_le_bytes()
                })
                .collect();
            let format = [IndexFormat::Uint32, IndexFormat::Uint16][round % 2];
            scene.indices = Some((Buffer::from_bytes(&list).unwrap(), format));
            scene.range = DrawRange {
                base_vertex: random.next() as i32 >> random.below(32),
                ..DrawRange::of(300)
            };
        }
        if round % 4 == 1 {
            scene.state.topology = Topology::TriangleStrip;
        }
        scene.state.cull = [CullMode::None, CullMode::Back, CullMode::Front][round % 3];
        if round % 2 == 0 {
            scene.depth = Some([Format::Depth32Float, Format::Depth16Unorm][round / 2 % 2]);
            scene.clear_depth = 0.5;
            scene.state.depth = Some(DepthState {
                compare: [
                    Compare::Less,
                    Compare::Greater,
                    Compare::NotEqual,
                    Compare::Always,
                ][random.below(4)],
                write: true,
                bias: DepthBias {
                    constant: random.next() as i32,
                    slope: random.range(-1e3, 1e3),
                    clamp: random.range(-1.0, 1.0),
                },
            });
        }
        if round % 5 == 0 {
            scene.state.targets = vec![TargetState {
                blend: Some(Blend::ALPHA),
                ..TargetState::default()
            }];
        }
        scene.colours = vec![[Format::Rgba16Float, Format::Rgba8Unorm][round % 2]];
        let [width, height] = size.map(|size| size as f32);
        if round % 7 == 0 {
            scene.viewport = Some(Viewport {
                x: width * 0.3,
                y: height * 0.1,
                width: width * 0.5,
                height: height * 0.8,
                near: 0.2,
                far: 0.9,
            });
        }
        scene.draw();
    }
}

#[test]
fn empty_draws_do_nothing() {
    let corners = [
        [-1.0, -1.0, 0.5, 1.0],
        [3.0, -1.0, 0.5, 1.0],
        [-1.0, 3.0, 0.5, 1.0],
    ];
    for change in [
        (|scene: &mut Scene<'_>| scene.range.count = 0) as fn(&mut Scene<'_>),
        |scene| scene.range.count = 2,
        |scene| scene.range.instances = 0,
        |scene| {
            scene.scissor = Some(etalon_core::raster::Scissor {
                x: 3,
                y: 3,
                width: 0,
                height: 5,
            });
        },
        |scene| {
            scene.viewport = Some(Viewport {
                x: 0.6,
                width: 0.3,
                ..Viewport::of(16, 16)
            });
        },
    ] {
        let mut scene = Scene::new(PLAIN, [16, 16], &corners);
        change(&mut scene);
        assert!(scene.draw().colour(0).iter().all(|got| *got == [0.0; 4]));
    }
}

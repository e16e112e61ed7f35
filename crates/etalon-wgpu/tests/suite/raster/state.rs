//! Culling, depth, blending and masks.

use super::{CLEAR, Scene, colours, flat, kernels, on_routes, positions, rectangle, with_target};
use crate::common::on_vulkan;
use etalon_core::Format;
use etalon_core::graph::{ClearValue, Draw, Load};
use etalon_core::raster::{
    Blend, BlendComponent, BlendFactor, BlendOperation, ColourWrites, CullMode, DepthBias,
    DepthState, FrontFace, RasterState, TargetState,
};

#[test]
fn faces_are_culled_by_the_order_of_their_corners_in_the_picture() {
    // Counter-clockwise in the upper half, clockwise in the lower.
    let corners = [
        [-1.0, 0.0],
        [1.0, 0.0],
        [0.0, 1.0],
        [-1.0, 0.0],
        [1.0, 0.0],
        [0.0, -1.0],
    ];
    let corners = corners.map(|[x, y]| [x, y, 0.0, 1.0]).concat();
    for front in [FrontFace::CounterClockwise, FrontFace::Clockwise] {
        for cull in [CullMode::None, CullMode::Front, CullMode::Back] {
            let scene = || {
                let mut scene = Scene::default();
                let buffer = scene.floats("corners", &corners);
                let state = RasterState {
                    front,
                    cull,
                    ..RasterState::default()
                };
                let draw = flat(buffer, [1.0; 4]).elements(0..6).state(state);
                scene.draw((16, 16), Format::Rgba8Unorm, [draw]);
                scene
            };
            on_routes(&kernels(), scene, |execution| {
                let drawn = |upper: bool| {
                    let image = colours(execution, "image");
                    let mut half = image.iter().filter(|(_, y, _)| (*y < 8) == upper);
                    half.any(|(_, _, colour)| colour[0] == 1.0)
                };
                let upper_is_front = front == FrontFace::CounterClockwise;
                for upper in [true, false] {
                    let is_front = upper == upper_is_front;
                    let wanted = match cull {
                        CullMode::None => true,
                        CullMode::Front => !is_front,
                        CullMode::Back => is_front,
                    };
                    assert_eq!(drawn(upper), wanted, "{front:?}, {cull:?}, {upper}");
                }
            });
        }
    }
}

/// Two rectangles that overlap, at different depths, in both orders.
#[test]
fn the_nearer_is_drawn_with_standard_and_reversed_depth() {
    for (depth, cleared, near) in [
        (DepthState::STANDARD, 1.0, 0.25),
        (DepthState::REVERSED, 0.0, 0.75),
    ] {
        for near_first in [true, false] {
            let scene = || {
                let mut scene = Scene::default();
                let size = (12, 4);
                let colour = scene.target(size, Format::Rgba8Unorm);
                let target = scene.target(size, Format::Depth32Float);
                let near_corners = rectangle(size, (0.0, 0.0), (8.0, 4.0), near);
                let far_corners = rectangle(size, (4.0, 0.0), (12.0, 4.0), 0.5);
                let near = scene.floats("near", &near_corners);
                let far = scene.floats("far", &far_corners);
                let state = RasterState {
                    depth: Some(depth),
                    ..RasterState::default()
                };
                let mut draws = [(near, [1.0, 0.0, 0.0, 1.0]), (far, [0.0, 1.0, 0.0, 1.0])].map(
                    |(corners, colour)| flat(corners, colour).elements(0..6).state(state.clone()),
                );
                if !near_first {
                    draws.reverse();
                }
                let written = scene
                    .graph
                    .raster("draws")
                    .colour("colour", colour, CLEAR)
                    .depth(target, Load::Clear(ClearValue::Float([cleared; 4])))
                    .draws(draws)
                    .finish()
                    .unwrap();
                let image = written.texture("colour").unwrap();
                scene.graph.output("image", image).unwrap();
                scene
            };
            on_routes(&kernels(), scene, |execution| {
                for (x, y, colour) in colours(execution, "image") {
                    let wanted = if x < 8 { [1.0, 0.0] } else { [0.0, 1.0] };
                    assert_eq!(colour[..2], wanted, "{depth:?}, at {x}, {y}");
                }
            });
        }
    }
}

#[test]
fn depth_is_written_compared_and_kept_as_the_state_says() {
    on_vulkan(|backend| {
        for format in [Format::Depth32Float, Format::Depth16Unorm] {
            let mut scene = Scene::default();
            let size = (4, 1);
            let target = scene.target(size, format);
            let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (4.0, 1.0), 0.5));
            let left = scene.floats("left", &rectangle(size, (0.0, 0.0), (2.0, 1.0), 1.0));
            let one = scene.floats("one", &rectangle(size, (1.0, 0.0), (2.0, 1.0), 1.0));
            let draw = |corners, depth: Option<DepthState>| {
                Draw::new("test/depth")
                    .vertices(corners, 0, positions())
                    .elements(0..6)
                    .state(RasterState {
                        depth,
                        ..RasterState::default()
                    })
            };
            let unwritten = DepthState {
                write: false,
                ..DepthState::REVERSED
            };
            let first = scene
                .graph
                .raster("first")
                .depth(target, Load::Clear(ClearValue::Float([0.25; 4])))
                .draw(draw(left, Some(DepthState::REVERSED)))
                // Neither compares nor writes.
                .draw(draw(corners, None))
                .draw(draw(corners, Some(unwritten)))
                .finish()
                .unwrap()
                .texture("depth")
                .unwrap();
            // A second pass over what the first left: only where it is nearer.
            let second = scene
                .graph
                .raster("second")
                .depth(first, Load::Keep)
                .draw(draw(corners, Some(DepthState::REVERSED)))
                .draw(draw(one, Some(DepthState::STANDARD)))
                .finish()
                .unwrap()
                .texture("depth")
                .unwrap();
            scene.graph.output("image", second).unwrap();
            let mut library = kernels();
            library.add_source(
                "test/depth",
                "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
                     return position;
                 }",
            );
            let execution = scene.run(backend, &library);
            for (x, _, depth) in colours(&execution, "image") {
                let wanted = if x < 2 { 1.0 } else { 0.5 };
                // Half a step of the format: the depth is a plane's.
                assert!(
                    (depth[0] - wanted).abs() <= 0.5 / 65535.0,
                    "{depth:?} at {x}"
                );
            }
        }
    });
}

#[test]
fn biases_are_added_to_depths() {
    on_vulkan(|backend| {
        let mut scene = Scene::default();
        let size = (4, 4);
        let target = scene.target(size, Format::Depth32Float);
        let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (4.0, 4.0), 0.5));
        let bias = DepthBias {
            constant: 1 << 20,
            slope: 0.0,
            clamp: 0.0,
        };
        let state = RasterState {
            depth: Some(DepthState {
                bias,
                ..DepthState::REVERSED
            }),
            ..RasterState::default()
        };
        let written = scene
            .graph
            .raster("draws")
            .depth(target, CLEAR)
            .draw(
                Draw::new("test/depth")
                    .vertices(corners, 0, positions())
                    .elements(0..6)
                    .state(state),
            )
            .finish()
            .unwrap();
        scene
            .graph
            .output("image", written.texture("depth").unwrap())
            .unwrap();
        let mut library = kernels();
        library.add_source(
            "test/depth",
            "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
                 return position;
             }",
        );
        let execution = scene.run(backend, &library);
        for (_, _, depth) in colours(&execution, "image") {
            // 2^20 units of 2^-24, the last place of numbers from a half on.
            assert_eq!(depth[0], 0.5 + 0.0625);
        }
    });
}

/// What a component of blending gives, as WebGPU §10.3.6 defines it.
fn blended(component: &BlendComponent, source: [f32; 4], target: [f32; 4], channel: usize) -> f32 {
    let factor = |factor: BlendFactor| match factor {
        BlendFactor::Zero => 0.0,
        BlendFactor::One => 1.0,
        BlendFactor::Source => source[channel],
        BlendFactor::OneMinusSource => 1.0 - source[channel],
        BlendFactor::SourceAlpha => source[3],
        BlendFactor::OneMinusSourceAlpha => 1.0 - source[3],
        BlendFactor::Target => target[channel],
        BlendFactor::OneMinusTarget => 1.0 - target[channel],
        BlendFactor::TargetAlpha => target[3],
        BlendFactor::OneMinusTargetAlpha => 1.0 - target[3],
    };
    let (s, t) = (source[channel], target[channel]);
    let (a, b) = (s * factor(component.source), t * factor(component.target));
    match component.operation {
        BlendOperation::Add => a + b,
        BlendOperation::Subtract => a - b,
        BlendOperation::ReverseSubtract => b - a,
        BlendOperation::Min => s.min(t),
        BlendOperation::Max => s.max(t),
    }
}

#[test]
fn colours_are_blended_as_scalar_arithmetic_says() {
    let component = |source, target, operation| BlendComponent {
        source,
        target,
        operation,
    };
    let both = |colour| Blend {
        colour,
        alpha: BlendComponent::REPLACE,
    };
    use BlendFactor as F;
    use BlendOperation as O;
    let blends = [
        Blend::ADD,
        Blend::OVER,
        Blend::ALPHA,
        both(component(F::Target, F::OneMinusSource, O::Add)),
        both(component(F::TargetAlpha, F::OneMinusTarget, O::Subtract)),
        both(component(
            F::OneMinusTargetAlpha,
            F::Source,
            O::ReverseSubtract,
        )),
        // The factors are taken as 1.
        both(component(F::Zero, F::SourceAlpha, O::Min)),
        both(component(F::Zero, F::Zero, O::Max)),
    ];
    // All products are exact in binary16.
    let (source, target) = ([0.25, 0.5, 0.125, 0.5], [0.5, 0.25, 1.0, 0.25]);
    for blend in blends {
        let scene = || {
            let mut scene = Scene::default();
            let size = (3, 2);
            let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (3.0, 2.0), 0.0));
            let first = flat(corners, target).elements(0..6);
            let state = with_target(TargetState {
                blend: Some(blend),
                ..TargetState::default()
            });
            let second = flat(corners, source).elements(0..6).state(state);
            scene.draw(size, Format::Rgba16Float, [first, second]);
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            let wanted = [0, 1, 2, 3].map(|channel| {
                let part = if channel == 3 {
                    &blend.alpha
                } else {
                    &blend.colour
                };
                blended(part, source, target, channel)
            });
            for (_, _, colour) in colours(execution, "image") {
                assert_eq!(colour, wanted, "{blend:?}");
            }
        });
    }
}

#[test]
fn only_the_channels_of_the_mask_are_written() {
    for mask in 0..16_u32 {
        let channel = |index: u32| mask >> index & 1 == 1;
        let writes = ColourWrites {
            red: channel(0),
            green: channel(1),
            blue: channel(2),
            alpha: channel(3),
        };
        let scene = || {
            let mut scene = Scene::default();
            let size = (2, 2);
            let corners = scene.floats("corners", &rectangle(size, (0.0, 0.0), (2.0, 2.0), 0.0));
            let state = with_target(TargetState {
                writes,
                ..TargetState::default()
            });
            let draw = flat(corners, [1.0; 4]).elements(0..6).state(state);
            scene.draw(size, Format::Rgba8Unorm, [draw]);
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            let wanted = [0, 1, 2, 3].map(|index| f32::from(u8::from(channel(index))));
            for (_, _, colour) in colours(execution, "image") {
                assert_eq!(colour, wanted);
            }
        });
    }
}

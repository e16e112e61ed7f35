//! Which pixels triangles cover.

use super::{CLEAR, Scene, colours, flat, kernels, on_routes, positions, rectangle, with_target};
use crate::common::noise;
use etalon_core::Format;
use etalon_core::backend::Execution;
use etalon_core::graph::{ClearValue, Draw, Load};
use etalon_core::raster::{Blend, Scissor, TargetState, Viewport};
use etalon_core::resource::{Extent, TextureDesc};

#[test]
fn a_triangle_over_everything_covers_every_pixel_at_its_centre() {
    for size in [(1, 1), (7, 13), (64, 33)] {
        let scene = || {
            let mut scene = Scene::default();
            let draw = Draw::new("test/centres").elements(0..3);
            scene.draw(size, Format::Rgba16Float, [draw]);
            scene
        };
        on_routes(&kernels(), scene, |execution| {
            for (x, y, colour) in colours(execution, "image") {
                assert_eq!(colour, [x as f32 + 0.5, y as f32 + 0.5, 7.0, 1.0]);
            }
        });
    }
}

/// A mesh of triangles over the whole target, with corners where `place` puts
/// those of a grid.
fn mesh(cells: i32, place: impl Fn(i32, i32) -> [f32; 2]) -> Vec<f32> {
    let mut corners = Vec::new();
    for row in 0..cells {
        for column in 0..cells {
            let [a, b, c, d] =
                [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| place(column + x, row + y));
            // Diagonals of both directions, so that shared edges have every slope.
            let triangles = if (row + column) % 2 == 0 {
                [a, b, d, a, d, c]
            } else {
                [a, b, c, b, d, c]
            };
            for [x, y] in triangles {
                corners.extend([x, y, 0.5, 1.0]);
            }
        }
    }
    corners
}

fn each_pixel_once(execution: &Execution) {
    for (x, y, colour) in colours(execution, "image") {
        assert_eq!(colour[0], 1.0, "at {x}, {y}");
    }
}

/// Triangles of a mesh neither leave out nor share a pixel, whose centre may lie
/// on an edge or corner (WebGPU §23.2.5).
#[test]
fn meshes_cover_each_pixel_once() {
    const SIZE: u32 = 32;
    let additive = || {
        with_target(TargetState {
            blend: Some(Blend::ADD),
            ..TargetState::default()
        })
    };
    let clip = |pixel: f32| pixel / SIZE as f32 * 2.0 - 1.0;
    let jitter: Vec<f32> = noise(2 * 81, 5)
        .into_iter()
        .map(|byte| f32::from(byte) / 100.0 - 1.0)
        .collect();
    let meshes = [
        // Corners and edges on the centres of pixels.
        mesh(8, |x, y| {
            let at = |k: i32| clip((k * 4) as f32 + if k == 8 { 0.5 } else { -0.5 });
            [at(x), at(y)]
        }),
        // Anywhere, but for those at the border.
        mesh(8, |x, y| {
            let inside = (1..8).contains(&x) && (1..8).contains(&y);
            let by = |axis: usize| match inside {
                true => jitter[2 * (x + 9 * y) as usize + axis],
                false => 0.0,
            };
            [clip((x * 4) as f32 + by(0)), clip((y * 4) as f32 + by(1))]
        }),
    ];
    for corners in meshes {
        let scene = || {
            let mut scene = Scene::default();
            let buffer = scene.floats("corners", &corners);
            let draw = flat(buffer, [1.0; 4])
                .elements(0..corners.len() as u32 / 4)
                .state(additive());
            scene.draw((SIZE, SIZE), Format::R16Float, [draw]);
            scene
        };
        on_routes(&kernels(), scene, each_pixel_once);
    }
}

#[test]
fn y_is_up_in_clip_space_and_down_in_the_picture() {
    let scene = || {
        let mut scene = Scene::default();
        // The upper half, and of that the left.
        let corners = [
            [-1.0, 0.0],
            [0.0, 0.0],
            [0.0, 1.0],
            [-1.0, 0.0],
            [0.0, 1.0],
            [-1.0, 1.0],
        ];
        let corners = corners.map(|[x, y]| [x, y, 0.0, 1.0]).concat();
        let buffer = scene.floats("corners", &corners);
        scene.draw(
            (8, 8),
            Format::Rgba8Unorm,
            [flat(buffer, [1.0; 4]).elements(0..6)],
        );
        scene
    };
    on_routes(&kernels(), scene, |execution| {
        for (x, y, colour) in colours(execution, "image") {
            let inside = x < 4 && y < 4;
            assert_eq!(colour[0] == 1.0, inside, "at {x}, {y}");
        }
    });
}

#[test]
fn viewports_and_scissors_bound_what_is_drawn() {
    let (viewport, scissor) = (
        Viewport {
            x: 2.0,
            y: 1.0,
            width: 9.0,
            height: 4.0,
            near: 0.25,
            far: 0.5,
        },
        Scissor {
            x: 3,
            y: 2,
            width: 13,
            height: 6,
        },
    );
    let scene = |with_scissor: bool| {
        let mut scene = Scene::default();
        let target = scene.target((16, 8), Format::Rgba16Float);
        let mut pass = scene.graph.raster("draws").colour("colour", target, CLEAR);
        pass = pass.viewport(viewport);
        if with_scissor {
            pass = pass.scissor(scissor);
        }
        let draw = Draw::new("test/centres").elements(0..3);
        let image = pass.draw(draw).finish().unwrap().texture("colour").unwrap();
        scene.graph.output("image", image).unwrap();
        scene
    };
    for with_scissor in [false, true] {
        on_routes(
            &kernels(),
            || scene(with_scissor),
            |execution| {
                for (x, y, colour) in colours(execution, "image") {
                    let viewed = (2..11).contains(&x) && (1..5).contains(&y);
                    let kept = !with_scissor || (x >= 3 && y >= 2);
                    let wanted = if viewed && kept {
                        [x as f32 + 0.5, y as f32 + 0.5, 7.0, 1.0]
                    } else {
                        [0.0; 4]
                    };
                    assert_eq!(colour, wanted, "at {x}, {y}");
                }
            },
        );
    }
}

#[test]
fn a_scissor_without_pixels_draws_nothing() {
    let scene = || {
        let mut scene = Scene::default();
        let target = scene.target((4, 4), Format::Rgba8Unorm);
        let pass = scene.graph.raster("draws").colour("colour", target, CLEAR);
        let draw = Draw::new("test/centres").elements(0..3);
        let none = Scissor {
            x: 4,
            y: 0,
            width: 0,
            height: 4,
        };
        let written = pass.scissor(none).draw(draw).finish().unwrap();
        scene
            .graph
            .output("image", written.texture("colour").unwrap())
            .unwrap();
        scene
    };
    on_routes(&kernels(), scene, |execution| {
        assert!(
            colours(execution, "image")
                .iter()
                .all(|(_, _, colour)| *colour == [0.0; 4])
        );
    });
}

#[test]
fn mips_and_layers_are_drawn_to_by_themselves() {
    let scene = || {
        let mut scene = Scene::default();
        let desc = TextureDesc {
            extent: Extent {
                width: 16,
                height: 8,
                depth_or_layers: 3,
            },
            mips: 3,
            ..TextureDesc::d2(16, 8, Format::R32Uint)
        };
        let texture = scene.graph.texture("array", desc);
        let cleared = scene
            .graph
            .clear(texture, ClearValue::Uint([9; 4]))
            .unwrap();
        let corners = scene.floats("corners", &rectangle((8, 4), (0.0, 0.0), (2.0, 4.0), 0.0));
        let part = cleared.mip(1).layer(2);
        let written = scene
            .graph
            .raster("draws")
            .colour("id", part, Load::Keep)
            .draw(
                Draw::new("test/id")
                    .vertices(corners, 0, positions())
                    .elements(0..6),
            )
            .finish()
            .unwrap();
        scene
            .graph
            .output("image", written.texture("id").unwrap())
            .unwrap();
        scene
    };
    let mut library = kernels();
    library.add_source(
        "test/id",
        "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
         struct Targets { @location(0) id: u32 }
         @fragment fn fragment() -> Targets { return Targets(77u); }",
    );
    on_routes(&library, scene, |execution| {
        let image = execution.output("image").unwrap();
        for mip in 0..3 {
            for (place, texel) in image.texels(mip) {
                let drawn = mip == 1 && place.layer == 2 && place.x < 2;
                let wanted = if drawn { 77 } else { 9 };
                assert_eq!(texel.to_f64()[0], f64::from(wanted), "mip {mip}, {place:?}");
            }
        }
    });
}

/// A mip is drawn from the one above it, in one texture.
#[test]
fn mips_are_drawn_from_others_of_the_texture() {
    let scene = || {
        let mut scene = Scene::default();
        let desc = TextureDesc {
            mips: 3,
            ..TextureDesc::d2(8, 8, Format::Rgba16Float)
        };
        let texture = scene.graph.texture("chain", desc);
        let value = ClearValue::Float([3.0; 4]);
        let mut texture = scene.graph.clear(texture, value).unwrap();
        for mip in 1..3 {
            let draw = Draw::new("test/twice")
                .read("source", texture.mip(mip - 1))
                .elements(0..3);
            let pass = scene.graph.raster(format!("mip {mip}"));
            let pass = pass.colour("colour", texture.mip(mip), Load::Keep);
            texture = pass.draw(draw).finish().unwrap().texture("colour").unwrap();
        }
        scene.graph.output("image", texture).unwrap();
        scene
    };
    let mut library = kernels();
    library.add_source(
        "test/twice",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @vertex fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
             return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
         }
         @fragment fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
             return 2.0 * textureLoad(source, 2u * vec2u(position.xy), 0);
         }",
    );
    on_routes(&library, scene, |execution| {
        let image = execution.output("image").unwrap();
        for (mip, wanted) in [(0, 3.0), (1, 6.0), (2, 12.0)] {
            for (_, texel) in image.texels(mip) {
                assert_eq!(texel.to_f32(), [wanted; 4], "mip {mip}");
            }
        }
    });
}

//! Draws on every device, under validation, held to scalar arithmetic.

use crate::common;

use common::draw::{Scene, ZERO, clip, corners, quad, state, tinted};
use common::{on_each, reds};
use etalon_core::Format;
use etalon_core::graph::{ClearValue, Draw, Load};
use etalon_core::image::ImageData;
use etalon_core::raster::{
    Blend, ColourWrites, CullMode, DepthBias, DepthState, FrontFace, Scissor, TargetState, Viewport,
};
use etalon_core::resource::Compare;

const SIZE: [u32; 2] = [8, 6];
const BLACK: ClearValue = ClearValue::Float([0.0; 4]);
const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];

fn at(image: &ImageData, x: u32, y: u32) -> [f32; 4] {
    image.texel(x, y, 0, 0).unwrap().to_f32()
}

/// The pixels of a picture, row by row, with what each should be.
fn expect(image: &ImageData, what: &str, value: impl Fn(u32, u32) -> f32) {
    let extent = image.desc.extent;
    for (x, y) in (0..extent.height).flat_map(|y| (0..extent.width).map(move |x| (x, y))) {
        assert_eq!(at(image, x, y)[0], value(x, y), "{what} at {x}, {y}");
    }
}

#[test]
fn targets_are_cleared_without_draws() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let colour = scene.target("colour", SIZE, Format::Rgba16Float);
        let id = scene.target("id", SIZE, Format::R32Sint);
        let depth = scene.target("depth", SIZE, Format::Depth32Float);
        let value = [0.25, -1.0, 3.0, 0.5];
        let written = scene
            .graph
            .raster("clear")
            .colour("colour", colour, Load::Clear(ClearValue::Float(value)))
            .colour("id", id, Load::Clear(ClearValue::Sint([-7; 4])))
            .depth(depth, Load::Clear(ClearValue::Float([0.75; 4])))
            // All is cleared all the same.
            .scissor(Scissor {
                x: 1,
                y: 1,
                width: 1,
                height: 1,
            })
            .finish()
            .unwrap();
        for name in ["colour", "id", "depth"] {
            let texture = written.texture(name).unwrap();
            scene.graph.output(name, texture).unwrap();
        }
        let execution = scene.run(backend);
        let colour = execution.output("colour").unwrap();
        assert_eq!(at(colour, 7, 5), value);
        expect(colour, "colour", |_, _| 0.25);
        expect(execution.output("id").unwrap(), "id", |_, _| -7.0);
        expect(execution.output("depth").unwrap(), "depth", |_, _| 0.75);
    });
}

#[test]
fn one_triangle_covers_every_pixel_at_its_centre() {
    on_each(|backend| {
        let draw = Draw::new("draw/full").elements(0..3);
        let image = Scene::new().one(backend, SIZE, Format::Rgba32Float, BLACK, |pass| {
            pass.draw(draw)
        });
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let centre = [x as f32 + 0.5, y as f32 + 0.5, 0.5, 1.0];
            assert_eq!(at(&image, x, y), centre);
        }
    });
}

/// A mesh over everything, with corners on and beside the centres of pixels
/// and some on edges of others: each pixel belongs to one triangle.
#[test]
fn pixels_on_shared_edges_are_drawn_once() {
    on_each(|backend| {
        let (size, cells) = ([64, 64], 12_usize);
        let mut seed = 7_u32;
        let mut random = |most: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) % most
        };
        let mut points = vec![[0.0_f32; 2]; (cells + 1) * (cells + 1)];
        for (index, point) in points.iter_mut().enumerate() {
            let cell = [index % (cells + 1), index / (cells + 1)];
            *point = cell.map(|k| {
                let place = k as f32 * 64.0 / cells as f32;
                if k == 0 || k == cells {
                    return place;
                }
                // At centres, halfway to them, or at some 256th of a pixel.
                let moved = match random(3) {
                    0 => place.floor() + 0.5,
                    1 => place.floor() + 1.0,
                    _ => place + random(512) as f32 / 256.0 - 1.0,
                };
                (moved * 256.0).round() / 256.0
            });
        }
        let mut values = Vec::new();
        for cell in 0..cells * cells {
            let first = cell / cells * (cells + 1) + cell % cells;
            let [a, b, c, d] = [first, first + 1, first + cells + 1, first + cells + 2];
            // One diagonal or the other, one way around or the other.
            let triangles = match random(4) {
                0 => [a, b, c, c, b, d],
                1 => [c, b, a, c, b, d],
                2 => [a, b, d, a, d, c],
                _ => [d, b, a, a, d, c],
            };
            for corner in triangles {
                let [x, y] = clip(size, points[corner]);
                values.extend([x, y, 0.5, 1.0]);
            }
        }
        let mut scene = Scene::new();
        let mesh = scene.floats("mesh", &values);
        let draw = tinted(mesh, RED)
            .elements(0..(values.len() / 4) as u32)
            .state(state(|state| {
                state.targets = vec![TargetState {
                    blend: Some(Blend::ADD),
                    ..TargetState::default()
                }];
            }));
        let image = scene.one(backend, size, Format::R16Float, BLACK, |pass| {
            pass.draw(draw)
        });
        expect(&image, "coverage", |_, _| 1.0);
    });
}

/// +Y is up in clip space and down in pictures.
#[test]
fn what_is_up_in_clip_space_is_above_in_the_picture() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let upper = scene.floats(
            "upper",
            &[-1.0, 0.0, 0.5, 1.0, 1.0, 0.0, 0.5, 1.0, 0.0, 1.0, 0.5, 1.0],
        );
        let draw = tinted(upper, RED).elements(0..3);
        let image = scene.one(backend, [8, 8], Format::R32Float, BLACK, |pass| {
            pass.draw(draw)
        });
        let rows: Vec<f32> = reds(&image)
            .chunks_exact(8)
            .map(|row| row.iter().sum())
            .collect();
        assert_eq!(rows[4..], [0.0; 4]);
        // Narrow at the top, wide in the middle.
        assert!(rows[0] < rows[1] && rows[1] < rows[3], "{rows:?}");
    });
}

#[test]
fn faces_are_culled_by_the_order_of_corners_in_the_picture() {
    on_each(|backend| {
        for front in [FrontFace::CounterClockwise, FrontFace::Clockwise] {
            for cull in [CullMode::None, CullMode::Front, CullMode::Back] {
                let mut scene = Scene::new();
                let mut values = quad(SIZE, [0.0, 0.0], [4.0, 6.0], 0.5);
                // The right half the other way around.
                let mut right = quad(SIZE, [4.0, 0.0], [8.0, 6.0], 0.5);
                for triangle in right.chunks_exact_mut(12) {
                    for k in 0..4 {
                        triangle.swap(k, k + 4);
                    }
                }
                values.extend(right);
                let mesh = scene.floats("mesh", &values);
                let draw = tinted(mesh, RED).elements(0..12).state(state(|state| {
                    (state.front, state.cull) = (front, cull);
                }));
                let image = scene.one(backend, SIZE, Format::R32Float, BLACK, |pass| {
                    pass.draw(draw)
                });
                expect(&image, &format!("{front:?}, {cull:?}"), |x, _| {
                    let counter_clockwise = x < 4;
                    let is_front = counter_clockwise == (front == FrontFace::CounterClockwise);
                    let drawn = match cull {
                        CullMode::None => true,
                        CullMode::Front => !is_front,
                        CullMode::Back => is_front,
                    };
                    f32::from(u8::from(drawn))
                });
            }
        }
    });
}

#[test]
fn what_is_nearer_is_drawn_in_either_order() {
    on_each(|backend| {
        for (depth, clear, near) in [
            (DepthState::REVERSED, 0.0, 0.75),
            (DepthState::STANDARD, 1.0, 0.25),
        ] {
            for near_first in [true, false] {
                let mut scene = Scene::new();
                let front = quad(SIZE, [0.0, 0.0], [5.0, 6.0], near);
                let back = quad(SIZE, [3.0, 0.0], [8.0, 6.0], 0.5);
                let (front, back) = (scene.floats("front", &front), scene.floats("back", &back));
                let with = state(|state| state.depth = Some(depth));
                let mut draws = vec![
                    tinted(front, [1.0; 4]).elements(0..6).state(with.clone()),
                    tinted(back, [2.0; 4]).elements(0..6).state(with),
                ];
                if !near_first {
                    draws.reverse();
                }
                let colour = scene.target("colour", SIZE, Format::R32Float);
                let buffer = scene.target("depth", SIZE, Format::Depth32Float);
                let written = scene
                    .graph
                    .raster("pass")
                    .colour("colour", colour, ZERO)
                    .depth(buffer, Load::Clear(ClearValue::Float([clear; 4])))
                    .draws(draws)
                    .finish()
                    .unwrap();
                for name in ["colour", "depth"] {
                    let texture = written.texture(name).unwrap();
                    scene.graph.output(name, texture).unwrap();
                }
                let execution = scene.run(backend);
                expect(execution.output("colour").unwrap(), "colour", |x, _| {
                    if x < 5 { 1.0 } else { 2.0 }
                });
                expect(execution.output("depth").unwrap(), "depth", |x, _| {
                    if x < 5 { near } else { 0.5 }
                });
            }
        }
    });
}

/// A prepass of depth, of which a later pass draws only what is equal.
#[test]
fn depth_is_kept_from_pass_to_pass() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let left = quad(SIZE, [0.0, 0.0], [4.0, 6.0], 0.5);
        let all = quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5);
        let (left, all) = (scene.floats("left", &left), scene.floats("all", &all));
        let depth = scene.target("depth", SIZE, Format::Depth32Float);
        let colour = scene.target("colour", SIZE, Format::R32Float);
        let depth = scene
            .graph
            .raster("prepass")
            .depth(depth, ZERO)
            .draw(
                Draw::new("draw/depth")
                    .vertices(left, 0, corners())
                    .elements(0..6)
                    .state(state(|state| state.depth = Some(DepthState::REVERSED))),
            )
            .finish()
            .unwrap()
            .texture("depth")
            .unwrap();
        let equal = DepthState {
            compare: Compare::Equal,
            write: false,
            bias: DepthBias::default(),
        };
        let written = scene
            .graph
            .raster("colours")
            .colour("colour", colour, ZERO)
            .depth(depth, Load::Keep)
            .draw(
                tinted(all, RED)
                    .elements(0..6)
                    .state(state(|state| state.depth = Some(equal))),
            )
            .finish()
            .unwrap();
        // Depth that is only compared has no new version.
        let colour = written.texture("colour").unwrap();
        scene.graph.output("colour", colour).unwrap();
        scene.graph.output("depth", depth).unwrap();
        let execution = scene.run(backend);
        let left = |x, _| if x < 4 { 1.0 } else { 0.0 };
        expect(execution.output("colour").unwrap(), "colour", left);
        expect(execution.output("depth").unwrap(), "depth", |x, y| {
            0.5 * left(x, y)
        });
    });
}

/// Of surfaces at one depth the biased one is nearer; a clamp limits by how much.
#[test]
fn depths_are_biased() {
    on_each(|backend| {
        // 0.5 has a unit in the last place of 2⁻²⁴.
        let unit = f32::EPSILON / 2.0;
        for (bias, depth) in [
            (DepthBias::default(), 0.5),
            (
                DepthBias {
                    constant: 1 << 12,
                    ..DepthBias::default()
                },
                0.5 + 4096.0 * unit,
            ),
            (
                DepthBias {
                    constant: 1 << 12,
                    slope: 0.0,
                    clamp: 1024.0 * unit,
                },
                0.5 + 1024.0 * unit,
            ),
        ] {
            let mut scene = Scene::new();
            let all = scene.floats("all", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
            let target = scene.target("depth", SIZE, Format::Depth32Float);
            let depth_state = DepthState {
                bias,
                ..DepthState::REVERSED
            };
            let written = scene
                .graph
                .raster("pass")
                .depth(target, ZERO)
                .draw(
                    Draw::new("draw/depth")
                        .vertices(all, 0, corners())
                        .elements(0..6)
                        .state(state(|state| state.depth = Some(depth_state))),
                )
                .finish()
                .unwrap();
            let texture = written.texture("depth").unwrap();
            scene.graph.output("depth", texture).unwrap();
            let execution = scene.run(backend);
            let found = at(execution.output("depth").unwrap(), 3, 3)[0];
            assert_eq!(found, depth, "{bias:?}");
        }
    });
}

#[test]
fn clip_space_is_mapped_to_the_viewport() {
    on_each(|backend| {
        let viewport = Viewport {
            x: 2.0,
            y: 1.0,
            width: 4.0,
            height: 3.0,
            near: 0.25,
            far: 0.75,
        };
        // A pixel wide in each direction: a quarter from the left, a third from
        // the top; and what reaches out of the viewport is clipped.
        let mut scene = Scene::new();
        let pixel = scene.floats("pixel", &quad([4, 3], [1.0, 0.0], [2.0, 1.0], 0.5));
        let draw = tinted(pixel, RED).elements(0..6);
        let image = scene.one(backend, SIZE, Format::R32Float, BLACK, |pass| {
            pass.viewport(viewport).draw(draw)
        });
        expect(
            &image,
            "pixel",
            |x, y| {
                if (x, y) == (3, 1) { 1.0 } else { 0.0 }
            },
        );
        let draw = Draw::new("draw/full").elements(0..3);
        let image = Scene::new().one(backend, SIZE, Format::Rgba32Float, BLACK, |pass| {
            pass.viewport(viewport).draw(draw)
        });
        // The triangle reaches to 3 in clip space, but not out of the viewport.
        expect(&image, "all", |x, y| {
            if (2..6).contains(&x) && (1..4).contains(&y) {
                x as f32 + 0.5
            } else {
                0.0
            }
        });
        assert_eq!(at(&image, 4, 2), [4.5, 2.5, 0.5, 1.0]);
    });
}

#[test]
fn only_the_scissor_is_drawn_to() {
    on_each(|backend| {
        for (x, y, width, height) in [(1, 2, 3, 4), (0, 0, 8, 6), (7, 5, 1, 1), (3, 3, 0, 2)] {
            let scissor = Scissor {
                x,
                y,
                width,
                height,
            };
            let mut scene = Scene::new();
            let all = scene.floats("all", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
            let draw = tinted(all, RED).elements(0..6);
            let image = scene.one(backend, SIZE, Format::R32Float, BLACK, |pass| {
                pass.scissor(scissor).draw(draw)
            });
            expect(&image, "scissor", |at_x, at_y| {
                let inside = (x..x + width).contains(&at_x) && (y..y + height).contains(&at_y);
                f32::from(u8::from(inside))
            });
        }
    });
}

/// Every number here, and every product and sum, is a half float.
#[test]
fn colours_are_blended_as_by_hand() {
    on_each(|backend| {
        let (there, drawn) = ([0.5, 2.0, 0.25, 0.5], [0.25, 0.5, 1.0, 0.25]);
        type Arithmetic = fn(f32, f32, f32) -> f32;
        let cases: [(Blend, Arithmetic); 3] = [
            (Blend::ADD, |from, to, _| from + to),
            (Blend::OVER, |from, to, alpha| from + to * (1.0 - alpha)),
            (
                Blend {
                    colour: Blend::ALPHA.colour,
                    alpha: Blend::ADD.alpha,
                },
                |from, to, alpha| from * alpha + to * (1.0 - alpha),
            ),
        ];
        for (blend, arithmetic) in cases {
            let mut scene = Scene::new();
            let all = scene.floats("all", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
            let draw = tinted(all, drawn).elements(0..6).state(state(|state| {
                state.targets = vec![TargetState {
                    blend: Some(blend),
                    ..TargetState::default()
                }];
            }));
            let clear = ClearValue::Float(there);
            let image = scene.one(backend, SIZE, Format::Rgba16Float, clear, |pass| {
                pass.draw(draw)
            });
            for channel in 0..3 {
                let expected = arithmetic(drawn[channel], there[channel], drawn[3]);
                assert_eq!(at(&image, 4, 3)[channel], expected, "{blend:?}");
            }
            let alpha = match blend.alpha == Blend::OVER.alpha {
                true => 0.25 + 0.5 * 0.75,
                false => 0.75,
            };
            assert_eq!(at(&image, 4, 3)[3], alpha, "{blend:?}");
        }
    });
}

#[test]
fn channels_that_are_masked_stay() {
    on_each(|backend| {
        let clear = ClearValue::Float([0.0, 1.0, 0.0, 1.0]);
        for bits in 0..16 {
            let [red, green, blue, alpha] = [1, 2, 4, 8].map(|bit| bits & bit != 0);
            let writes = ColourWrites {
                red,
                green,
                blue,
                alpha,
            };
            let mut scene = Scene::new();
            let all = scene.floats("all", &quad(SIZE, [0.0, 0.0], [8.0, 6.0], 0.5));
            let draw = tinted(all, [1.0, 0.0, 1.0, 0.0])
                .elements(0..6)
                .state(state(|state| {
                    state.targets = vec![TargetState {
                        writes,
                        ..TargetState::default()
                    }];
                }));
            let image = scene.one(backend, SIZE, Format::Rgba8Unorm, clear, |pass| {
                pass.draw(draw)
            });
            let expected = [red, !green, blue, !alpha].map(|on| f32::from(u8::from(on)));
            assert_eq!(at(&image, 2, 2), expected, "{writes:?}");
        }
    });
}

#[test]
fn targets_of_several_kinds_are_drawn_at_once() {
    on_each(|backend| {
        let mut scene = Scene::new();
        let formats = [Format::Rgba8Unorm, Format::R32Uint, Format::Rg32Float];
        let names = ["colour", "id", "motion"];
        let targets = [0, 1, 2].map(|k| scene.target(names[k], SIZE, formats[k]));
        let written = scene
            .graph
            .raster("pass")
            .colour("colour", targets[0], ZERO)
            .colour("id", targets[1], Load::Clear(ClearValue::Uint([9; 4])))
            .colour("motion", targets[2], ZERO)
            .draw(
                Draw::new("draw/targets")
                    .elements(0..3)
                    .state(state(|state| {
                        state.targets = vec![TargetState::default(); 3];
                        state.targets[2].writes.green = false;
                    })),
            )
            .finish()
            .unwrap();
        for name in names {
            let texture = written.texture(name).unwrap();
            scene.graph.output(name, texture).unwrap();
        }
        let execution = scene.run(backend);
        let colour = execution.output("colour").unwrap();
        assert_eq!(at(colour, 5, 5), [1.0, 0.0, 1.0, 0.0]);
        expect(execution.output("id").unwrap(), "id", |x, y| {
            (x + 100 * y) as f32
        });
        let motion = execution.output("motion").unwrap();
        for (x, y) in [(0, 0), (7, 5), (3, 4)] {
            let [u, v, ..] = at(motion, x, y);
            let [expected, _] = clip(SIZE, [x as f32 + 0.5, 0.0]);
            // Interpolated from −1 to 3 in a few operations of f32.
            assert!((u - expected).abs() < 8.0 * f32::EPSILON, "{u} {expected}");
            assert_eq!(v, 0.0);
        }
    });
}

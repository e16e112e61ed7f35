//! What has to hold between the results of one effect on two inputs, whatever the
//! results are: mirrored, brightened, moved and cut pictures, and strength 0.
//!
//! * **Mirrored.** Bloom, exposure and the composite add texels in pairs that a
//!   mirror swaps, so at sizes that halve without a rest the mirrored picture gives
//!   the mirrored bits. A march does not: coordinates count from the left, and the
//!   roundings of u and 1 − u differ; where a ray passes within such a rounding of a
//!   texel's border the texel that it meets is the next one.
//! * **Brightened by 2^k.** Multiplication by a power of two is exact, so whatever is
//!   linear in light scales exactly while no value leaves the normal numbers of its
//!   format. The logarithm of exposure is off by its rounding.
//! * **Moved by 2^k.** Effects see view space alone. A world 2^20 from its origin has
//!   steps of 2^-32 in f64, below f32's rounding of all depths from 2^-8 on.
//! * **Cut.** What is local is the same further from the cut than it reaches.
//! * **Strength 0** leaves the bits as they are.

use crate::common;

use common::{Run, backend, image, texels};
use etalon_core::backend::CapturedData;
use etalon_core::image::ImageData;
use etalon_core::plan::Capture;
use etalon_core::resource::TextureDesc;
use etalon_core::{Format, graph::Texture};
use etalon_effects::bloom::{Bloom, LightStorage, bloom};
use etalon_effects::composite::{Composite, Glow, Output, ToneCurve, composite};
use etalon_effects::exposure::{Exposed, Exposure, Metering, exposure};
use etalon_effects::ssr::{Blend, Search, Ssr, march, ssr};
use etalon_effects::{ChainSettings, SceneInputs, chain};
use etalon_scenes::trace::{Ambient, Material, Property, SceneBuilder, Shape, Sky};
use etalon_scenes::{Camera, Frame, FrameSize, Pose, World, scene};
use glam::DVec3;

/// A size whose halves are even down to one texel in y.
const WIDTH: u32 = 64;
const HEIGHT: u32 = 32;

fn wet_floor() -> Frame {
    let size = FrameSize::new(WIDTH, HEIGHT).unwrap();
    scene("wet-floor").unwrap().frame(size).unwrap()
}

/// An image with its texels in another order.
fn rearranged(
    source: &ImageData,
    [width, height]: [u32; 2],
    from: impl Fn(u32, u32) -> (u32, u32),
) -> ImageData {
    let desc = TextureDesc::d2(width, height, source.desc.format);
    let mut result = ImageData::zeroed(desc).unwrap();
    for y in 0..height {
        for x in 0..width {
            let (column, row) = from(x, y);
            let texel = source.texel(column, row, 0, 0).unwrap();
            result.set_texel(x, y, 0, 0, texel).unwrap();
        }
    }
    result
}

fn mirrored(source: &ImageData, axis: usize) -> ImageData {
    let (width, height) = (source.desc.extent.width, source.desc.extent.height);
    rearranged(source, [width, height], |x, y| match axis {
        0 => (width - 1 - x, y),
        _ => (x, height - 1 - y),
    })
}

/// The frame with all of its images mirrored, and the normals with them.
fn mirrored_frame(frame: &Frame, axis: usize) -> Frame {
    let mut result = frame.clone();
    for image in [
        &mut result.colour,
        &mut result.depth,
        &mut result.normal,
        &mut result.specular,
    ] {
        *image = mirrored(image, axis);
    }
    // The sign bit of a half float.
    for texel in result.normal.bytes.chunks_exact_mut(8) {
        texel[2 * axis + 1] ^= 0x80;
    }
    result
}

/// The result of an effect on a frame.
fn on(
    frame: &Frame,
    effect: impl Fn(&mut etalon_core::graph::Graph, &SceneInputs) -> Texture,
) -> ImageData {
    let mut run = Run::new();
    let inputs = run.import_frame(frame);
    let result = effect(&mut run.graph, &inputs);
    run.output(result)
}

#[test]
fn a_mirrored_picture_blooms_adapts_and_shows_as_the_mirror_of_it() {
    let frame = wet_floor();
    for axis in [0, 1] {
        let other = mirrored_frame(&frame, axis);
        for storage in [LightStorage::Half, LightStorage::Full] {
            for suppress_fireflies in [false, true] {
                let settings = Bloom {
                    storage,
                    suppress_fireflies,
                    threshold: 0.2,
                    levels: 5,
                    ..Bloom::default()
                };
                let glow = |frame: &Frame| {
                    on(frame, |graph, inputs| {
                        bloom(graph, inputs.colour, Exposed::default(), &settings).unwrap()
                    })
                };
                assert_eq!(glow(&other), mirrored(&glow(&frame), axis), "{settings:?}");
            }
        }
        for metering in [Metering::Arithmetic, Metering::Logarithmic] {
            let settings = Exposure {
                metering,
                ..Exposure::default()
            };
            let adapted = |frame: &Frame| {
                on(frame, |graph, inputs| {
                    exposure(graph, inputs.colour, 0.1, &settings).unwrap()
                })
            };
            assert_eq!(adapted(&other), adapted(&frame), "{metering:?}");
        }
        let settings = ChainSettings {
            ssr: None,
            ..ChainSettings::full()
        };
        let picture = |frame: &Frame| {
            on(frame, |graph, inputs| {
                chain(graph, inputs, &settings).unwrap().picture
            })
        };
        assert_eq!(picture(&other), mirrored(&picture(&frame), axis));
    }
}

#[test]
fn a_mirrored_scene_has_mirrored_reflections() {
    let frame = wet_floor();
    for axis in [0, 1] {
        let other = mirrored_frame(&frame, axis);
        let places = |frame: &Frame| {
            texels(&on(frame, |graph, inputs| {
                // Bisection would look at the border between two texels itself, which
                // belongs to the right one of both, mirrored or not.
                let settings = Ssr {
                    search: Search::Linear,
                    ..Ssr::default()
                };
                march(
                    graph,
                    inputs.depth,
                    inputs.normal,
                    &inputs.camera,
                    &settings,
                )
                .unwrap()
            }))
        };
        let (one, two) = (places(&frame), places(&other));
        let (mut hits, mut elsewhere) = (0, 0);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let (column, row) = if axis == 0 {
                    (WIDTH - 1 - x, y)
                } else {
                    (x, HEIGHT - 1 - y)
                };
                let a = one[(y * WIDTH + x) as usize];
                let b = two[(row * WIDTH + column) as usize];
                if a == [0.0; 4] && b == [0.0; 4] {
                    continue;
                }
                hits += 1;
                let back = if axis == 0 {
                    [1.0 - b[0], b[1]]
                } else {
                    [b[0], 1.0 - b[1]]
                };
                let moved = ((a[0] - back[0]) * WIDTH as f32)
                    .abs()
                    .max(((a[1] - back[1]) * HEIGHT as f32).abs());
                // The next texel at most, where both hit.
                elsewhere += usize::from((a[2] > 0.0) != (b[2] > 0.0) || moved > 1.0);
            }
        }
        // A coordinate of 64 is rounded by 2^-18: a ray of 64 steps passes a border
        // that closely less than once in a thousand.
        assert!(hits > 300, "{hits}");
        assert!(elsewhere * 100 <= hits, "{elsewhere} of {hits}");
    }
}

/// Light in every texel, from 1 to 100.
fn lights(factor: f32) -> ImageData {
    image(Format::Rgba16Float, WIDTH, HEIGHT, |x, y| {
        let channel = |seed: u32| {
            let random = common::hash(x ^ (y << 8) ^ (seed << 16)) >> 8;
            let value = 1.0 + 99.0 * (random as f32 / (1 << 24) as f32).powi(3);
            // Of half floats, so that the factor moves none of them.
            half::f16::from_f32(value).to_f32() * factor
        };
        [channel(1), channel(2), channel(3), 1.0]
    })
}

/// Every colour channel, times a factor.
fn scaled(image: &ImageData, factor: f32) -> Vec<[f32; 4]> {
    let scale = |[r, g, b, a]: [f32; 4]| [r * factor, g * factor, b * factor, a];
    texels(image).into_iter().map(scale).collect()
}

#[test]
fn light_times_a_power_of_two_blooms_as_much_brighter() {
    let glow = |factor: f32, storage, threshold| {
        let source = lights(factor);
        let mut run = Run::new();
        let colour = run.import("colour", &source);
        let settings = Bloom {
            threshold: threshold * factor,
            suppress_fireflies: false,
            storage,
            ..Bloom::default()
        };
        let result = bloom(&mut run.graph, colour, Exposed::default(), &settings).unwrap();
        run.output(result)
    };
    for power in [-4, -1, 3, 8] {
        let factor = 2_f32.powi(power);
        // Without a threshold nothing is small; with one, f32 has the range for it.
        for (storage, threshold) in [(LightStorage::Half, 0.0), (LightStorage::Full, 8.0)] {
            let expected = scaled(&glow(1.0, storage, threshold), factor);
            assert_eq!(
                texels(&glow(factor, storage, threshold)),
                expected,
                "2^{power}, {storage:?}"
            );
        }
    }
}

#[test]
fn light_times_a_power_of_two_is_exposure_times_it() {
    for power in [-6, -1, 2, 5] {
        let factor = 2_f32.powi(power);
        let outputs = ToneCurve::ALL
            .map(Output::Sdr)
            .into_iter()
            .chain([Output::Hdr]);
        for output in outputs {
            let shown = |source: &ImageData, exposure: f32| {
                let mut run = Run::new();
                let colour = run.import("colour", source);
                let settings = Composite { exposure, output };
                let result = composite(&mut run.graph, colour, None, None, &settings).unwrap();
                run.output(result)
            };
            let (dim, bright) = (lights(1.0), lights(factor));
            assert_eq!(
                shown(&bright, 1.0),
                shown(&dim, factor),
                "2^{power}, {output:?}"
            );
        }
        let adapted = |source: &ImageData| {
            let mut run = Run::new();
            let colour = run.import("colour", source);
            let result = exposure(&mut run.graph, colour, 0.0, &Exposure::default()).unwrap();
            texels(&run.output(result))[0]
        };
        let ([dim, dim_factor, ..], [bright, bright_factor, ..]) =
            (adapted(&lights(1.0)), adapted(&lights(factor)));
        // Logarithms up to 16, each within an ulp, in a tree of 11 additions: the
        // mean is off by less than 13 · 16 · 2^-24, its power by ln 2 of that; twice.
        let bound = 2.0 * 13.0 * 16.0 * 2_f32.powi(-24);
        assert!(
            (bright / (dim * factor) - 1.0).abs() <= bound,
            "{dim} {bright}"
        );
        assert!((bright_factor * factor / dim_factor - 1.0).abs() <= bound);
    }
}

#[test]
fn light_times_a_power_of_two_is_mirrored_as_much_brighter() {
    let frame = wet_floor();
    for power in [1_i32, 4] {
        let factor = 2_f32.powi(power);
        let mut other = frame.clone();
        other.colour =
            ImageData::from_rgba_f32(frame.colour.desc, &scaled(&frame.colour, factor)).unwrap();
        let mirror = |frame: &Frame| {
            on(frame, |graph, inputs| {
                ssr(graph, inputs, &Ssr::default()).unwrap()
            })
        };
        let (dim, bright) = (scaled(&mirror(&frame), factor), texels(&mirror(&other)));
        for (dim, bright) in dim.iter().zip(&bright) {
            for (dim, bright) in dim.iter().zip(bright) {
                // Below 2^-14 half floats have absolute steps, and so have four stores
                // one after the other; what they move may round the last one up.
                let bound = dim.abs() * 2_f32.powi(-10) + 4.0 * factor * 2_f32.powi(-25);
                assert!((dim - bright).abs() <= bound, "2^{power}: {dim} {bright}");
            }
        }
    }
}

/// Mirror and wall with camera and all at `origin`.
fn world(origin: DVec3) -> World {
    let mut scene = SceneBuilder::new();
    scene.sky(Sky {
        horizon: DVec3::new(0.4, 0.5, 0.7),
        zenith: DVec3::new(0.1, 0.2, 0.5),
    });
    scene.ambient(Ambient {
        above: DVec3::ONE,
        below: DVec3::ONE,
    });
    let plane = |point: DVec3, normal: DVec3| Shape::Plane {
        point: origin + point,
        normal,
    };
    scene.object(
        plane(DVec3::NEG_Y * 0.25, DVec3::Y),
        Material::metal(DVec3::ONE, 0.0),
    );
    let red = Property::Constant(DVec3::new(0.9, 0.3, 0.1));
    scene.object(plane(DVec3::NEG_Z * 6.0, DVec3::Z), Material::matte(red));
    let eye = origin + DVec3::new(0.0, 1.0, 1.0);
    let target = origin + DVec3::new(0.0, 0.25, -1.0);
    let pose = Pose::look_at(eye, target, DVec3::Y).unwrap();
    World {
        scene: scene.build().unwrap(),
        camera: Camera::new(pose, 1.0).unwrap(),
    }
}

#[test]
fn a_world_moved_by_a_power_of_two_looks_the_same() {
    let size = FrameSize::new(WIDTH, HEIGHT).unwrap();
    let frame = |origin| world(origin).frame(size).unwrap();
    let picture = |frame: &Frame| {
        on(frame, |graph, inputs| {
            chain(graph, inputs, &ChainSettings::full())
                .unwrap()
                .picture
        })
    };
    let here = frame(DVec3::ZERO);
    let shown = picture(&here);
    for power in [10, 20] {
        let far = 2_f64.powi(power);
        for origin in [DVec3::X * far, DVec3::new(-far, far, far)] {
            let there = frame(origin);
            for (a, b) in texels(&here.depth).iter().zip(texels(&there.depth)) {
                // 2^-32 of a distance of at least 1/2, and a rounding to f32.
                assert!((a[0] - b[0]).abs() <= a[0] * 2_f32.powi(-22), "{a:?} {b:?}");
            }
            let moved = picture(&there);
            let codes = shown.bytes.iter().zip(&moved.bytes);
            // One code for the rounding; a ray that an ulp of depth decides, as above.
            let otherwise = codes.filter(|(a, b)| a.abs_diff(**b) > 1).count();
            assert!(
                otherwise * 100 <= shown.bytes.len(),
                "{origin}: {otherwise}"
            );
        }
    }
}

#[test]
fn a_tile_blooms_and_shows_as_it_does_within_the_picture() {
    let (width, height) = (320, 24);
    let whole = image(Format::Rgba16Float, width, height, |x, y| {
        let random = common::hash(x ^ (y << 12)) % 1000;
        [random as f32 / 100.0, (x % 7) as f32, (y % 5) as f32, 1.0]
    });
    // Three levels: texel i of the last is made of pixels 8 i − 14 to 8 i + 21, and
    // its double reads texels i − 2 to i + 2: at most 2 · 8 + 21 pixels to a side,
    // which the level before adds half of, and so on: below 2 · 37.
    let (levels, reach) = (3, 74);
    // A tile begins where the picture's texels of all levels begin.
    let (start, end) = (40, 280);
    let tile = rearranged(&whole, [end - start, height], |x, y| (x + start, y));
    let glow = |source: &ImageData| {
        let mut run = Run::new();
        let colour = run.import("colour", source);
        let settings = Bloom {
            levels,
            ..Bloom::default()
        };
        let result = bloom(&mut run.graph, colour, Exposed::default(), &settings).unwrap();
        run.output(result)
    };
    let (of_whole, of_tile) = (glow(&whole), glow(&tile));
    let mut compared = 0;
    for y in 0..height / 2 {
        for x in (start + reach) / 2..(end - reach) / 2 {
            let inside = of_tile.texel(x - start / 2, y, 0, 0);
            assert_eq!(of_whole.texel(x, y, 0, 0), inside, "({x}, {y})");
            compared += 1;
        }
    }
    assert!(compared > 500);
    // And the cut shows nearer to it: the comparison is able to fail.
    let at_cut =
        (0..height / 2).any(|y| of_whole.texel(start / 2, y, 0, 0) != of_tile.texel(0, y, 0, 0));
    assert!(at_cut);
    let shown = |source: &ImageData| {
        let mut run = Run::new();
        let colour = run.import("colour", source);
        let result = composite(&mut run.graph, colour, None, None, &Composite::default()).unwrap();
        run.output(result)
    };
    let cut = rearranged(&shown(&whole), [end - start, height], |x, y| (x + start, y));
    assert_eq!(cut, shown(&tile));
}

#[test]
fn strength_0_leaves_every_bit_as_it_is() {
    let frame = wet_floor();
    let off = on(&frame, |graph, inputs| {
        let settings = Ssr {
            resolution: 0.0,
            ..Ssr::default()
        };
        assert_eq!(ssr(graph, inputs, &settings).unwrap(), inputs.colour);
        // Nobody wrote it: a copy by a composite without curve, exposed once.
        let copy = Composite {
            exposure: 1.0,
            output: Output::Hdr,
        };
        composite(graph, inputs.colour, None, None, &copy).unwrap()
    });
    assert_eq!(off, frame.colour);
    // Surfaces that mirror nothing.
    let mut dull = frame.clone();
    dull.specular.bytes.fill(0);
    for blend in [Blend::Add, Blend::Replace] {
        let result = on(&dull, |graph, inputs| {
            let settings = Ssr {
                blend,
                ..Ssr::default()
            };
            ssr(graph, inputs, &settings).unwrap()
        });
        assert_eq!(result, frame.colour, "{blend:?}");
    }
    // None of the bloom added, and none of the wider blur mixed in.
    let picture = |intensity: Option<f32>| {
        on(&frame, |graph, inputs| {
            let glow = intensity.map(|intensity| Glow {
                bloom: bloom(graph, inputs.colour, Exposed::default(), &Bloom::default()).unwrap(),
                intensity,
            });
            composite(graph, inputs.colour, None, glow, &Composite::default()).unwrap()
        })
    };
    assert_eq!(picture(Some(0.0)), picture(None));
    assert_ne!(picture(Some(1.0)), picture(None));
    let glow = |levels: u32| {
        on(&frame, |graph, inputs| {
            let settings = Bloom {
                scatter: 0.0,
                levels,
                ..Bloom::default()
            };
            bloom(graph, inputs.colour, Exposed::default(), &settings).unwrap()
        })
    };
    assert_eq!(glow(6), glow(1));
}

#[test]
fn one_frame_twice_is_the_same_bits() {
    let frame = wet_floor();
    let mut backend = backend();
    let mut captures = || {
        backend.reset_histories();
        let mut run = Run::new();
        let inputs = run.import_frame(&frame);
        let result = chain(&mut run.graph, &inputs, &ChainSettings::full()).unwrap();
        run.graph.output("picture", result.picture).unwrap();
        let executions = [(); 2].map(|()| run.execute(backend.as_mut(), Capture::EveryPass));
        executions.map(|execution| execution.captures)
    };
    let (one, two) = (captures(), captures());
    assert!(one == two);
    // The eye moves from frame to frame, or there is no history to be reset.
    assert_eq!(one[0].len(), two[1].len());
    // Lists of tiles among them.
    let mut captures = one[0].iter();
    assert!(captures.any(|captured| matches!(captured.data, CapturedData::Buffer(_))));
}

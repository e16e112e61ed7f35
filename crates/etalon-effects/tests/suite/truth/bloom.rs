//! The truth of bloom against a direct convolution, and the kernels against it.

use crate::common;

use std::collections::BTreeMap;

use common::{Run, hash, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::bloom::truth::{Edges, bloom, bloom_of, energy, levels};
use etalon_effects::bloom::{Bloom, LightStorage, bloom as effect};
use etalon_effects::exposure::Exposed;
use etalon_effects::truth::Plane;

/// Nothing but the filters: no threshold, no weights.
fn plain() -> Bloom {
    Bloom {
        threshold: 0.0,
        knee: 0.0,
        suppress_fireflies: false,
        scatter: 0.5,
        storage: LightStorage::Full,
        ..Bloom::default()
    }
}

fn noise(width: u32, height: u32) -> Plane {
    Plane::from_fn(width, height, |x, y| {
        let channel = |c: u32| f64::from(hash(x + 977 * y + 31_337 * c) % 4096) / 256.0;
        [channel(1), channel(2), channel(3), 1.0]
    })
    .expect("small")
}

/// Weights at places in half texels of the picture.
type Kernel = BTreeMap<(i64, i64), f64>;

fn convolved(a: &Kernel, b: &Kernel) -> Kernel {
    let mut result = Kernel::new();
    for (&(ax, ay), &weight) in a {
        for (&(bx, by), &other) in b {
            *result.entry((ax + bx, ay + by)).or_default() += weight * other;
        }
    }
    result
}

fn scaled_sum(parts: &[(&Kernel, f64)]) -> Kernel {
    let mut result = Kernel::new();
    for (kernel, factor) in parts {
        for (&place, &weight) in *kernel {
            *result.entry(place).or_default() += weight * factor;
        }
    }
    result
}

/// Jimenez' 13 taps for source texels of `d` texels, as his slides draw them: five
/// squares of four taps, each tap the mean of four texels.
fn down(d: i64) -> Kernel {
    let four = |reach: i64| -> Kernel {
        [(-1, -1), (1, -1), (-1, 1), (1, 1)]
            .map(|(x, y)| ((x * reach, y * reach), 0.25))
            .into()
    };
    // Half texels: a texel's centre lies `d` from its corner, taps 2 d apart.
    let square = convolved(&four(2 * d), &four(d));
    let at = |x: i64, y: i64| Kernel::from([((x * 2 * d, y * 2 * d), 1.0)]);
    let corners = [(-1, -1), (1, -1), (-1, 1), (1, 1)].map(|(x, y)| convolved(&square, &at(x, y)));
    scaled_sum(&[
        (&square, 0.5),
        (&corners[0], 0.125),
        (&corners[1], 0.125),
        (&corners[2], 0.125),
        (&corners[3], 0.125),
    ])
}

/// The doubling to texels of `d` texels, mean of the four ways that a texel can
/// lie on the coarser one: the weights of `resample::doubled`, in half texels.
fn up(d: i64) -> Kernel {
    // Of an odd texel: 3 7 5 1 at 5/4 and 1/4 of a coarse texel to the left, and
    // 3/4 and 7/4 to the right.
    let odd = [(-5, 3.0), (-1, 7.0), (3, 5.0), (7, 1.0)];
    let even = odd.map(|(place, weight)| (-place, weight));
    let mut result = Kernel::new();
    for xs in [odd, even] {
        for ys in [odd, even] {
            for (x, a) in xs {
                for (y, b) in ys {
                    // A quarter of a coarse texel is d / 2, or d half texels.
                    *result.entry((x * d, y * d)).or_default() += a * b / (256.0 * 4.0);
                }
            }
        }
    }
    result
}

/// The kernel of a chain of `levels`.
fn composed(levels: u32, scatter: f64) -> Kernel {
    let mut chain = vec![down(1)];
    for level in 1..levels {
        chain.push(convolved(&chain[level as usize - 1], &down(1 << level)));
    }
    let mut newest = chain.pop().expect("one level at least");
    for (index, own) in chain.iter().enumerate().rev() {
        let wide = convolved(&newest, &up(2 << index));
        newest = scaled_sum(&[(own, 1.0 - scatter), (&wide, scatter)]);
    }
    newest
}

#[test]
fn it_is_the_convolution_with_the_composed_kernel() {
    for (levels, sizes) in [
        (1, &[(1, 1), (5, 4), (9, 12)][..]),
        (2, &[(3, 3), (7, 5), (12, 9)][..]),
        (3, &[(5, 8), (9, 7)][..]),
        (4, &[(9, 2)][..]),
    ] {
        for scatter in [0.0, 0.375, 1.0] {
            let kernel = composed(levels, scatter);
            let total: f64 = kernel.values().sum();
            assert!((total - 1.0).abs() <= 1e-12, "{total}");
            for &(width, height) in sizes {
                let picture = noise(width, height);
                let settings = Bloom {
                    scatter: scatter as f32,
                    ..plain()
                };
                let result =
                    bloom_of(&picture, 1.0, &settings, levels, Edges::Picture).expect("valid");
                assert_eq!(result.size(), [width.div_ceil(2), height.div_ceil(2)]);
                // The chain ends where one texel is left.
                let mut side = width.max(height);
                let kernel = match (1..).find(|_| {
                    side = side.div_ceil(2);
                    side == 1
                }) {
                    Some(most) if most < levels => composed(most, scatter),
                    _ => kernel.clone(),
                };
                for y in 0..result.height() {
                    for x in 0..result.width() {
                        let mut sum = [0.0; 3];
                        for (&(dx, dy), weight) in &kernel {
                            // From the corner between texels 2x and 2x + 1, in
                            // half texels, to a texel's centre.
                            let texel = |at: u32, by: i64| (4 * i64::from(at) + 2 + by - 1) / 2;
                            let odd = |by: i64| by.rem_euclid(2) == 1;
                            assert!(odd(dx) && odd(dy));
                            let texel = picture.at(texel(x, dx), texel(y, dy));
                            for (sum, channel) in sum.iter_mut().zip(texel) {
                                *sum += channel * weight;
                            }
                        }
                        let got = result.at(x.into(), y.into());
                        for (got, sum) in got.iter().zip(sum) {
                            assert!(
                                (got - sum).abs() <= 1e-12 * sum.max(1.0),
                                "{levels}, {scatter}, {width}×{height}: {got} for {sum}"
                            );
                        }
                        assert_eq!(got[3], 1.0);
                    }
                }
            }
        }
    }
}

#[test]
fn a_constant_picture_stays_that_constant() {
    for (width, height) in [(1, 1), (1, 9), (13, 7), (64, 64), (65, 3), (160, 90)] {
        for suppress_fireflies in [false, true] {
            let picture = Plane::from_fn(width, height, |_, _| [1.7, 0.3, 1365.0, 0.0]);
            let settings = Bloom {
                suppress_fireflies,
                ..plain()
            };
            let picture = picture.expect("small");
            for edges in [Edges::Picture, Edges::Levels] {
                let result = bloom_of(&picture, 1.0, &settings, 12, edges).expect("valid");
                for texel in result.texels() {
                    for (got, expected) in texel.iter().zip([1.7, 0.3, 1365.0, 1.0]) {
                        assert!((got / expected - 1.0).abs() <= 1e-10, "{texel:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn an_impulse_keeps_its_energy() {
    // Far enough from the edges that nothing goes over them: three levels reach
    // 2.5 · 7 + 3.5 · 6 texels.
    for scatter in [0.0, 0.3, 1.0] {
        let settings = Bloom { scatter, ..plain() };
        let mut total = 0.0;
        for (px, py) in [(50, 50), (51, 50), (50, 51), (51, 51)] {
            let picture = Plane::from_fn(104, 104, |x, y| {
                [f64::from(u8::from((x, y) == (px, py))), 0.0, 0.0, 1.0]
            });
            let result = bloom_of(&picture.expect("small"), 1.0, &settings, 3, Edges::Picture)
                .expect("valid");
            let [red, green, blue] = energy(&result);
            assert_eq!((green, blue), (0.0, 0.0));
            // A texel of the result stands for four.
            assert!((4.0 * red - 1.0).abs() <= 1e-12, "{scatter}: {red}");
            total += red;
        }
        assert!((total - 1.0).abs() <= 1e-12, "{scatter}: {total}");
    }
}

fn computed(colour: &ImageData, settings: &Bloom) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let exposed = Exposed::default();
    let result = effect(&mut run.graph, source, exposed, settings).expect("valid settings");
    texels(&run.output(result))
}

#[test]
fn it_is_the_mean_of_the_kernels_results_over_all_alignments() {
    // Three levels lie on a grid of 8 texels. A pattern in the middle of black is
    // moved over all of its places, and the results are moved back.
    let levels = 3;
    let (side, first) = (160_u32, 72_u32);
    let pattern = |x: i64, y: i64| {
        let inside = (0..5).contains(&x) && (0..3).contains(&y);
        if inside {
            f64::from(1 + hash((x + 5 * y) as u32) % 64)
        } else {
            0.0
        }
    };
    let settings = Bloom {
        levels,
        scatter: 0.625,
        ..plain()
    };
    let still = Plane::from_fn(side, side, |x, y| {
        let place = |at: u32| i64::from(at) - i64::from(first);
        [pattern(place(x), place(y)); 4]
    });
    let truth = bloom_of(
        &still.expect("small"),
        1.0,
        &settings,
        levels,
        Edges::Picture,
    )
    .expect("valid");
    let half = i64::from(side / 2);
    let mut mean = vec![0.0; (half * half) as usize];
    // Moved by two texels the first level is only moved by one.
    for (mx, my) in (0..4_i64).flat_map(|x| (0..4_i64).map(move |y| (x, y))) {
        let moved = image(Format::Rgba32Float, side, side, |x, y| {
            let place = |at: u32, by: i64| i64::from(at) - i64::from(first) - 2 * by;
            [pattern(place(x, mx), place(y, my)) as f32; 4]
        });
        let result = computed(&moved, &settings);
        for y in 0..half - my {
            for x in 0..half - mx {
                let texel = result[((y + my) * half + x + mx) as usize];
                mean[(y * half + x) as usize] += f64::from(texel[0]) / 16.0;
            }
        }
    }
    let peak = truth
        .texels()
        .iter()
        .map(|texel| texel[0])
        .fold(0.0, f64::max);
    let mut worst = 0.0_f64;
    for (texel, mean) in truth.texels().iter().zip(&mean) {
        worst = worst.max((texel[0] - mean).abs());
    }
    // Some 36 products and sums for each of six filters: 2^-24 each, and all
    // weights are positive.
    println!("mean of alignments: {worst} of {peak}");
    assert!(
        worst <= 6.0 * 36.0 * peak / f64::from(1 << 24),
        "{worst} of {peak}"
    );
    // A single alignment is off by far more: that is the error of the algorithm.
    let aligned = image(Format::Rgba32Float, side, side, |x, y| {
        let place = |at: u32| i64::from(at) - i64::from(first);
        [pattern(place(x), place(y)) as f32; 4]
    });
    let single = computed(&aligned, &settings);
    let off = truth.texels().iter().zip(&single);
    let off = off
        .map(|(a, b)| (a[0] - f64::from(b[0])).abs())
        .fold(0.0, f64::max);
    println!("one alignment: {off} of {peak}");
    assert!(off > 100.0 * worst, "{off} {worst}");
}

#[test]
fn the_first_level_is_the_effects_own() {
    // With one level, or with nothing of the wider ones, every place is one that
    // the effect computes, weights against fireflies included.
    let (width, height) = (33, 18);
    let colour = image(Format::Rgba32Float, width, height, |x, y| {
        let channel = |c: u32| (hash(x + 977 * y + 31_337 * c) % 4096) as f32 / 512.0;
        [channel(1), channel(2), channel(3), 1.0]
    });
    for (suppress_fireflies, threshold, knee) in [
        (false, 0.0, 0.0),
        (true, 0.0, 0.0),
        (true, 2.0, 0.5),
        (false, 3.0, 1.0),
    ] {
        let settings = Bloom {
            suppress_fireflies,
            threshold,
            knee,
            scatter: 0.0,
            levels: 3,
            ..plain()
        };
        let plane = Plane::of(&colour).expect("small");
        let truth = bloom(&plane, 1.0, &settings).expect("valid");
        for (kernel, truth) in computed(&colour, &settings).iter().zip(truth.texels()) {
            for (kernel, truth) in kernel.iter().zip(truth) {
                // 36 texels: some 40 roundings of 2^-24, of what is above the
                // threshold out of 8.
                assert!(
                    (f64::from(*kernel) - truth).abs() <= 80.0 * 8.0 / f64::from(1 << 24),
                    "{settings:?}: {kernel} for {truth}"
                );
            }
        }
    }
}

#[test]
fn more_levels_come_nearer() {
    let frame = (etalon_scenes::scene("dark-room-lights")
        .expect("registered")
        .build)()
    .expect("a valid scene")
    .frame(etalon_scenes::FrameSize::new(160, 90).expect("small"))
    .expect("small");
    let plane = Plane::of(&frame.colour).expect("small");
    let settings = Bloom {
        storage: LightStorage::Full,
        threshold: 0.25,
        ..Bloom::default()
    };
    assert_eq!(levels(plane.size()), 8);
    let mut last = Vec::new();
    for edges in [Edges::Picture, Edges::Levels] {
        let truth = bloom_of(&plane, 1.0, &settings, 8, edges).expect("valid");
        let size: f64 = truth.texels().iter().map(|texel| texel[1].powi(2)).sum();
        let mut previous = f64::INFINITY;
        for count in [1, 2, 4, 8] {
            let settings = Bloom {
                levels: count,
                ..settings
            };
            let result = computed(&frame.colour, &settings);
            let pairs = truth.texels().iter().zip(&result);
            let error: f64 = pairs.map(|(a, b)| (a[1] - f64::from(b[1])).powi(2)).sum();
            let relative = (error / size).sqrt();
            let light: f64 = result.iter().map(|texel| f64::from(texel[1])).sum();
            println!(
                "{edges:?}, {count} levels: {relative:.4}, energy {:+.4}",
                light / energy(&truth)[1] - 1.0
            );
            assert!(relative < previous, "{count}: {relative} {previous}");
            previous = relative;
        }
        last.push(previous);
    }
    // With the effect's own edges what is left is less.
    assert!(last[1] < 0.5 * last[0], "{last:?}");
}

#[test]
fn edges_do_not_matter_in_the_middle_of_black() {
    let picture = Plane::from_fn(128, 96, |x, y| {
        let inside = (60..68).contains(&x) && (44..52).contains(&y);
        [f64::from(hash(x + 128 * y) % 64) * f64::from(u8::from(inside)); 4]
    });
    let picture = picture.expect("small");
    // Three levels reach 38.5 texels.
    let [a, b] = [Edges::Picture, Edges::Levels]
        .map(|edges| bloom_of(&picture, 1.0, &plain(), 3, edges).expect("valid"));
    assert_eq!(a, b);
}

#[test]
fn the_top_of_the_ladder_is_the_number_of_levels() {
    assert_eq!(levels([1, 1]), 1);
    assert_eq!(levels([2, 2]), 1);
    assert_eq!(levels([3, 1]), 2);
    assert_eq!(levels([640, 360]), 9);
    assert_eq!(levels([16_384, 16_384]), 9);
    let picture = noise(24, 17);
    let of = |levels| {
        let settings = Bloom { levels, ..plain() };
        bloom(&picture, 1.0, &settings).expect("valid")
    };
    assert_eq!(of(1), of(12));
}

#[test]
fn odd_input_is_refused_or_counts_as_none() {
    let picture = Plane::from_fn(12, 9, |x, y| match (x, y) {
        (3, 4) => [f64::NAN, f64::INFINITY, -1.0, f64::NAN],
        (8, 2) => [f64::NEG_INFINITY, 1e300, f64::MIN_POSITIVE, 0.0],
        _ => [1.0; 4],
    })
    .expect("small");
    for suppress_fireflies in [false, true] {
        for exposure in [0.0, 1e-300, 1.0, 1e300] {
            let settings = Bloom {
                suppress_fireflies,
                ..plain()
            };
            let result = bloom(&picture, exposure, &settings).expect("valid");
            let light = |x: &f64| (0.0..=65_504.0 * (1.0 + 1e-12)).contains(x);
            assert!(result.texels().iter().flatten().all(light));
        }
    }
    for exposure in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(matches!(
            bloom(&picture, exposure, &plain()),
            Err(EffectError::Setting(_))
        ));
    }
    let settings = Bloom {
        scatter: f32::NAN,
        ..plain()
    };
    assert!(bloom(&picture, 1.0, &settings).is_err());
    assert!(bloom_of(&picture, 1.0, &plain(), 0, Edges::Picture).is_err());
    assert!(bloom_of(&picture, 1.0, &plain(), 13, Edges::Picture).is_err());
}

//! Bloom against a direct computation in f64, and what it must conserve.

use crate::common;

use common::{Run, hash, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::bloom::{Bloom, LightStorage, bloom};
use etalon_effects::exposure::Exposed;

/// Nothing but the filters: no threshold, no weights.
const PLAIN: Bloom = Bloom {
    threshold: 0.0,
    knee: 0.0,
    suppress_fireflies: false,
    levels: 4,
    scatter: 0.5,
    intensity: 1.0,
    storage: LightStorage::Half,
};

fn bloomed(colour: &ImageData, factor: f32, settings: &Bloom) -> ImageData {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let exposed = Exposed {
        factor,
        adaptation: None,
    };
    let result = bloom(&mut run.graph, source, exposed, settings).expect("valid settings");
    run.output(result)
}

const SIZES: [(u32, u32); 9] = [
    (1, 1),
    (1, 9),
    (9, 1),
    (2, 2),
    (13, 7),
    (31, 33),
    (64, 64),
    (65, 3),
    (100, 50),
];

#[test]
fn a_constant_picture_stays_that_constant() {
    for (width, height) in SIZES {
        for suppress_fireflies in [false, true] {
            // An f16 with all its mantissa bits in use.
            let colour = image(Format::Rgba16Float, width, height, |_, _| {
                [1.999_023_4, 0.300_048_83, 1365.0, 1.0]
            });
            let settings = Bloom {
                suppress_fireflies,
                levels: 12,
                ..PLAIN
            };
            let result = bloomed(&colour, 1.0, &settings);
            assert_eq!(result.desc.extent.width, width.div_ceil(2));
            assert_eq!(result.desc.extent.height, height.div_ceil(2));
            for texel in texels(&result) {
                assert_eq!(
                    texel,
                    [1.999_023_4, 0.300_048_83, 1365.0, 1.0],
                    "{width}×{height}"
                );
            }
        }
    }
}

/// One channel in f64, its edge repeated outside.
#[derive(Clone)]
struct Plane {
    width: i64,
    height: i64,
    values: Vec<f64>,
}

impl Plane {
    fn new(width: i64, height: i64, value: impl Fn(i64, i64) -> f64) -> Self {
        let values = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| value(x, y))
            .collect();
        Self {
            width,
            height,
            values,
        }
    }

    fn at(&self, x: i64, y: i64) -> f64 {
        let (x, y) = (x.clamp(0, self.width - 1), y.clamp(0, self.height - 1));
        self.values[(y * self.width + x) as usize]
    }

    /// Bilinear interpolation at a position in texels.
    fn linear(&self, x: f64, y: f64) -> f64 {
        let (x, y) = (x - 0.5, y - 0.5);
        let (i, j) = (x.floor(), y.floor());
        let (a, b) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        (self.at(i, j) * (1.0 - a) + self.at(i + 1, j) * a) * (1.0 - b)
            + (self.at(i, j + 1) * (1.0 - a) + self.at(i + 1, j + 1) * a) * b
    }

    /// Jimenez' 13 taps, as his slides draw them: five boxes of four taps.
    fn halved(&self) -> Self {
        Self::new((self.width + 1) / 2, (self.height + 1) / 2, |x, y| {
            let (x, y) = ((2 * x + 1) as f64, (2 * y + 1) as f64);
            let square = |cx: f64, cy: f64| {
                let tap = |dx, dy| self.linear(cx + dx, cy + dy);
                (tap(-1.0, -1.0) + tap(1.0, -1.0) + tap(-1.0, 1.0) + tap(1.0, 1.0)) / 4.0
            };
            let corners = square(x - 1.0, y - 1.0)
                + square(x + 1.0, y - 1.0)
                + square(x - 1.0, y + 1.0)
                + square(x + 1.0, y + 1.0);
            0.5 * square(x, y) + 0.125 * corners
        })
    }

    /// The 3 × 3 tent of bilinear taps.
    fn doubled(&self, width: i64, height: i64) -> Self {
        Self::new(width, height, |x, y| {
            let (x, y) = ((x as f64 + 0.5) / 2.0, (y as f64 + 0.5) / 2.0);
            let mut sum = 0.0;
            for (dx, a) in [(-1.0, 1.0), (0.0, 2.0), (1.0, 1.0)] {
                for (dy, b) in [(-1.0, 1.0), (0.0, 2.0), (1.0, 1.0)] {
                    sum += a * b / 16.0 * self.linear(x + dx, y + dy);
                }
            }
            sum
        })
    }
}

fn reference(colour: &Plane, levels: u32, scatter: f64) -> Plane {
    let mut chain = vec![colour.halved()];
    while chain.len() < levels as usize {
        let last = &chain[chain.len() - 1];
        if last.width == 1 && last.height == 1 {
            break;
        }
        chain.push(last.halved());
    }
    let mut newest = chain.pop().expect("one level at least");
    while let Some(fine) = chain.pop() {
        let wide = newest.doubled(fine.width, fine.height);
        newest = Plane::new(fine.width, fine.height, |x, y| {
            fine.at(x, y) * (1.0 - scatter) + wide.at(x, y) * scatter
        });
    }
    newest
}

#[test]
fn it_is_the_filter_it_claims_to_be() {
    for (width, height) in SIZES {
        for levels in [1, 2, 5] {
            let value = |x: u32, y: u32| (hash(x + 977 * y) % 2048) as f32 / 64.0;
            let colour = image(Format::Rgba16Float, width, height, |x, y| {
                [value(x, y), 0.0, 1.0, 1.0]
            });
            let result = bloomed(&colour, 1.0, &Bloom { levels, ..PLAIN });
            let exact = Plane::new(width.into(), height.into(), |x, y| {
                value(x as u32, y as u32).into()
            });
            let exact = reference(&exact, levels, 0.5);
            for (texel, expected) in texels(&result).iter().zip(&exact.values) {
                // All weights are positive, so errors stay relative: one rounding
                // to f16 (2^-11) on each way through the chain per level down and
                // up, and f32 roundings far below them.
                let bound = f64::from(2 * levels) * 0.000_488_3 * expected + 1e-6;
                assert!(
                    (f64::from(texel[0]) - expected).abs() <= bound,
                    "{width}×{height}, {levels}: {texel:?} for {expected}"
                );
                assert_eq!((texel[1], texel[2]), (0.0, 1.0));
            }
        }
    }
}

#[test]
fn a_point_of_light_keeps_its_energy_wherever_it_is() {
    for scatter in [0.0, 0.5, 1.0] {
        for (px, py) in [(60, 60), (61, 60), (60, 61), (67, 63)] {
            let colour = image(Format::Rgba16Float, 128, 128, |x, y| {
                if (x, y) == (px, py) {
                    [60_000.0, 0.0, 0.0, 1.0]
                } else {
                    [0.0, 0.0, 0.0, 1.0]
                }
            });
            let result = bloomed(
                &colour,
                1.0,
                &Bloom {
                    scatter,
                    levels: 3,
                    ..PLAIN
                },
            );
            // A texel of the result stands for four of the picture.
            let energy: f64 = texels(&result)
                .iter()
                .map(|texel| 4.0 * f64::from(texel[0]))
                .sum();
            // Rounding to f16 at five stages, each within 2^-11.
            assert!(
                (energy / 60_000.0 - 1.0).abs() <= 5.0 * 0.000_488_3,
                "{scatter} ({px}, {py}): {energy}"
            );
        }
    }
}

#[test]
fn it_does_not_shift_the_picture() {
    // A centred point in an even picture must come out symmetric.
    let colour = image(Format::Rgba16Float, 64, 64, |x, y| {
        if (31..33).contains(&x) && (31..33).contains(&y) {
            [1000.0; 4]
        } else {
            [0.0; 4]
        }
    });
    let result = texels(&bloomed(&colour, 1.0, &Bloom { levels: 5, ..PLAIN }));
    for y in 0..32 {
        for x in 0..32 {
            assert_eq!(result[y * 32 + x], result[y * 32 + 31 - x]);
            assert_eq!(result[y * 32 + x], result[(31 - y) * 32 + x]);
        }
    }
}

#[test]
fn the_knee_is_the_stated_curve() {
    let (threshold, share) = (2.0_f64, 0.5_f64);
    let knee = threshold * share;
    let mut previous = 0.0;
    for step in 0..200 {
        let brightness = half::f16::from_f32(step as f32 * 0.025).to_f32();
        // The largest channel decides; the others keep their proportion.
        let colour = image(Format::Rgba16Float, 2, 2, |_, _| {
            [brightness * 0.5, brightness, 0.0, 1.0]
        });
        let settings = Bloom {
            threshold: threshold as f32,
            knee: share as f32,
            levels: 1,
            ..PLAIN
        };
        let texel = texels(&bloomed(&colour, 1.0, &settings))[0];
        let b = f64::from(brightness);
        let rise = (b - threshold + knee).clamp(0.0, 2.0 * knee);
        let expected = (b - threshold).max(rise * rise / (4.0 * knee));
        // Rounding to f16, and of f32 before.
        assert!(
            (f64::from(texel[1]) - expected).abs() <= expected * 0.000_49 + 1e-6,
            "{b}: {} for {expected}",
            texel[1]
        );
        assert!((f64::from(texel[0]) - expected * 0.5).abs() <= expected * 0.000_75 + 1e-6);
        assert!(texel[1] >= previous, "not rising at {b}");
        previous = texel[1];
    }
    assert!(previous > 2.9);
}

#[test]
fn exposure_counts_before_the_threshold() {
    let colour = image(Format::Rgba16Float, 4, 4, |_, _| [0.5, 0.25, 0.125, 1.0]);
    let settings = Bloom {
        threshold: 1.0,
        levels: 1,
        ..PLAIN
    };
    assert_eq!(
        texels(&bloomed(&colour, 1.0, &settings))[0],
        [0.0, 0.0, 0.0, 1.0]
    );
    // Exposed by 8 the brightest channel is 4, of which 3 blooms.
    assert_eq!(
        texels(&bloomed(&colour, 8.0, &settings))[0],
        [3.0, 1.5, 0.75, 1.0]
    );
    // An exposure texture multiplies on top.
    let adaptation = image(Format::Rgba32Float, 1, 1, |_, _| [1.0, 4.0, 0.0, 0.0]);
    let mut run = Run::new();
    let (source, adaptation) = (
        run.import("colour", &colour),
        run.import("adaptation", &adaptation),
    );
    let exposed = Exposed {
        factor: 2.0,
        adaptation: Some(adaptation),
    };
    let result = bloom(&mut run.graph, source, exposed, &settings).expect("valid settings");
    assert_eq!(texels(&run.output(result))[0], [3.0, 1.5, 0.75, 1.0]);
}

#[test]
fn broken_texels_neither_spread_nor_flicker() {
    for suppress_fireflies in [false, true] {
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 65_504.0] {
            let colour = image(Format::Rgba16Float, 32, 32, |x, y| {
                if (x, y) == (13, 17) {
                    [odd, 1.0, 1.0, f32::NAN]
                } else {
                    [1.0, 1.0, 1.0, 1.0]
                }
            });
            for texel in texels(&bloomed(
                &colour,
                1e6,
                &Bloom {
                    suppress_fireflies,
                    ..PLAIN
                },
            )) {
                assert!(
                    texel
                        .iter()
                        .all(|channel| channel.is_finite() && *channel >= 0.0),
                    "{odd}: {texel:?}"
                );
            }
            let texels = texels(&bloomed(
                &colour,
                1.0,
                &Bloom {
                    suppress_fireflies,
                    levels: 1,
                    ..PLAIN
                },
            ));
            let brightest = texels.iter().map(|texel| texel[0]).fold(0.0, f32::max);
            if suppress_fireflies {
                // The other 15 texels of its neighbourhood weigh 1/2 each and
                // bring 1/2; the odd one weighs nothing and brings 1 / 0.2126
                // at most, red having that share of the luminance:
                // (15/2 + 4.7) / (15/2) = 1.63.
                assert!(brightest <= 1.64, "{odd}: {brightest}");
            }
        }
    }
}

//! The composite against its formulas in f64.

use crate::common;

use common::{Run, hash, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::composite::{Composite, Glow, Output, ToneCurve, composite};

fn composed(colour: &ImageData, settings: &Composite) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let result = composite(&mut run.graph, source, None, None, settings).expect("valid settings");
    texels(&run.output(result))
}

/// The curves in f64, written from their sources.
fn curve(curve: ToneCurve, c: [f64; 3]) -> [f64; 3] {
    let times =
        |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    let shown = match curve {
        ToneCurve::Linear => c,
        ToneCurve::Reinhard { white } => {
            let y = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
            let white = f64::from(white);
            c.map(|x| x * (1.0 + y / (white * white)) / (1.0 + y))
        }
        ToneCurve::Aces => {
            let v = times(
                [
                    [0.59719, 0.35458, 0.04823],
                    [0.076, 0.90834, 0.01566],
                    [0.0284, 0.13383, 0.83777],
                ],
                c,
            );
            let w = v.map(|x| {
                (x * (x + 0.0245786) - 0.000_090_537)
                    / (x * (0.983_729 * x + 0.432_951) + 0.238_081)
            });
            times(
                [
                    [1.60475, -0.53108, -0.07367],
                    [-0.10208, 1.10813, -0.00605],
                    [-0.00327, -0.07276, 1.07602],
                ],
                w,
            )
        }
        ToneCurve::Neutral => {
            // The specification's own symbols.
            let (f90, ks, kd) = (0.04, 0.8 - 0.04, 0.15);
            let x = c[0].min(c[1]).min(c[2]);
            let f = if x <= 2.0 * f90 {
                x - x * x / (4.0 * f90)
            } else {
                f90
            };
            let p = c[0].max(c[1]).max(c[2]) - f;
            if p <= ks {
                c.map(|x| x - f)
            } else {
                let pn = 1.0 - (1.0 - ks).powi(2) / (p + 1.0 - 2.0 * ks);
                let g = 1.0 / (kd * (p - pn) + 1.0);
                c.map(|x| (x - f) * pn / p * g + pn * (1.0 - g))
            }
        }
        ToneCurve::AgX => {
            let inset = [
                [
                    0.842_479_062_253_094,
                    0.078_433_599_999_999_2,
                    0.079_223_745_147_764_3,
                ],
                [
                    0.042_328_242_261_012_3,
                    0.878_468_636_469_772,
                    0.079_166_127_460_543_4,
                ],
                [0.042_375_654_905_705_1, 0.078_433_6, 0.879_142_973_793_104],
            ];
            let outset = [
                [
                    1.196_879_005_120_17,
                    -0.098_020_881_140_136_8,
                    -0.099_029_744_079_720_5,
                ],
                [
                    -0.052_896_851_757_456_2,
                    1.151_903_129_904_17,
                    -0.098_961_176_844_843_3,
                ],
                [
                    -0.052_971_635_514_443_8,
                    -0.098_043_450_117_124_1,
                    1.151_073_672_641_16,
                ],
            ];
            let v = times(inset, c).map(|x| {
                let x = (x.log2().clamp(-12.47393, 4.026069) + 12.47393) / (4.026069 + 12.47393);
                let powers: [f64; 7] = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];
                powers.iter().rev().fold(0.0, |sum, power| sum * x + power)
            });
            times(outset, v).map(|x| x.clamp(0.0, 1.0).powf(2.2))
        }
    };
    shown.map(|x| x.clamp(0.0, 1.0))
}

fn srgb(x: f64) -> f64 {
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// Light from black to far beyond white.
fn ramp() -> Vec<f32> {
    let stops = (0..2000)
        .map(|i| half::f16::from_f32((i as f32 * 0.02 - 24.0).exp2().min(65_504.0)).to_f32());
    std::iter::once(0.0)
        .chain(stops)
        .chain([65_504.0])
        .collect()
}

fn sdr(curve: ToneCurve) -> Composite {
    Composite {
        output: Output::Sdr(curve),
        ..Composite::default()
    }
}

#[test]
fn every_curve_is_its_formula_rounded_to_eight_bits() {
    let ramp = ramp();
    let colours: Vec<[f32; 3]> = ramp
        .iter()
        .map(|&x| [x; 3])
        .chain((0..4000_u32).map(|i| {
            let stops = |c: u32| {
                half::f16::from_f32((hash(3 * i + c) as f32 / u32::MAX as f32 * 24.0 - 14.0).exp2())
                    .to_f32()
            };
            [stops(0), stops(1), stops(2)]
        }))
        .collect();
    let width = 64;
    let height = colours.len().div_ceil(width);
    let picture = image(Format::Rgba16Float, width as u32, height as u32, |x, y| {
        let [r, g, b] = colours
            .get(y as usize * width + x as usize)
            .copied()
            .unwrap_or_default();
        [r, g, b, 1.0]
    });
    for tone in ToneCurve::ALL {
        for (&colour, texel) in colours.iter().zip(composed(&picture, &sdr(tone))) {
            let exact = curve(tone, colour.map(f64::from)).map(srgb);
            for (got, exact) in texel.iter().zip(exact) {
                let code = f64::from(got * 255.0).round();
                // The nearest code, but for values within f32's error of halfway.
                // The largest such error: near black the encoding's slope of
                // 12.92 · 255 takes the cancellation in the ACES and AgX curves
                // (terms of up to 2, 16 roundings of 2^-24 each: 2^-19) to 0.0063
                // of a code.
                assert!(
                    (exact * 255.0 - code).abs() <= 0.5 + 0.007,
                    "{tone:?} {colour:?}: {code} for {}",
                    exact * 255.0
                );
            }
            assert_eq!(texel[3], 1.0);
        }
    }
}

#[test]
fn every_curve_rises_and_stays_neutral_on_greys() {
    let ramp = ramp();
    let picture = image(Format::Rgba16Float, ramp.len() as u32, 1, |x, _| {
        let x = ramp[x as usize];
        [x, x, x, 1.0]
    });
    for tone in ToneCurve::ALL {
        let mut previous = 0;
        let shown = composed(&picture, &sdr(tone));
        for (texel, light) in shown.iter().zip(&ramp) {
            let codes = texel.map(|channel| (channel * 255.0).round() as i32);
            assert!(codes[1] >= previous, "{tone:?} falls at {light}");
            // Rows of the published matrices differ in their sums by up to 2e-5,
            // which can tip a code over.
            assert!(
                (codes[0] - codes[1]).abs() <= 1 && (codes[2] - codes[1]).abs() <= 1,
                "{tone:?} {light}: {codes:?}"
            );
            previous = codes[1];
        }
        assert_eq!(shown[0], [0.0, 0.0, 0.0, 1.0], "{tone:?}: black is black");
        assert!(
            previous >= 250,
            "{tone:?}: the brightest light is {previous}"
        );
    }
}

#[test]
fn reinhard_turns_its_white_into_white() {
    let picture = image(Format::Rgba16Float, 1, 1, |_, _| [4.0; 4]);
    assert_eq!(
        composed(&picture, &sdr(ToneCurve::Reinhard { white: 4.0 }))[0],
        [1.0; 4]
    );
    let below = composed(&picture, &sdr(ToneCurve::Reinhard { white: 8.0 }))[0];
    assert!(below[0] < 1.0);
}

#[test]
fn light_below_white_passes_linear_as_the_codec_encodes_it() {
    let picture = image(Format::Rgba16Float, 64, 33, |x, y| {
        let code = (x + 64 * y).min(0x3c00 / 8) * 8;
        let x = half::f16::from_bits(code as u16).to_f32();
        [x, x, x, 0.5]
    });
    for (texel, source) in composed(&picture, &sdr(ToneCurve::Linear))
        .iter()
        .zip(texels(&picture))
    {
        let exact = srgb(source[0].into()) * 255.0;
        assert!((exact - f64::from(texel[0] * 255.0).round()).abs() <= 0.5 + 0.001);
        // 0.5 · 255 is halfway between 127 and 128, and 128 is even.
        assert_eq!((texel[3] * 255.0).round(), 128.0);
    }
}

#[test]
fn hdr_is_exposed_light_and_bloom() {
    let colour = image(Format::Rgba16Float, 7, 5, |x, y| {
        [x as f32, y as f32, 0.125, 0.75]
    });
    let bloom = image(Format::Rgba16Float, 4, 3, |_, _| [2.0, 4.0, 8.0, 1.0]);
    let adaptation = image(Format::Rgba32Float, 1, 1, |_, _| [1.0, 0.5, 0.0, 0.0]);
    let mut run = Run::new();
    let (source, glow) = (run.import("colour", &colour), run.import("bloom", &bloom));
    let adaptation = run.import("adaptation", &adaptation);
    let settings = Composite {
        exposure: 4.0,
        output: Output::Hdr,
    };
    let glow = Glow {
        bloom: glow,
        intensity: 0.25,
    };
    let result = composite(
        &mut run.graph,
        source,
        Some(adaptation),
        Some(glow),
        &settings,
    )
    .expect("valid");
    let result = run.output(result);
    assert_eq!(result.desc.format, Format::Rgba16Float);
    for (index, texel) in texels(&result).iter().enumerate() {
        let (x, y) = ((index % 7) as f32, (index / 7) as f32);
        assert_eq!(*texel, [2.0 * x + 0.5, 2.0 * y + 1.0, 2.25, 0.75]);
    }
}

#[test]
fn broken_light_costs_its_own_texel_only() {
    let odd = [
        f32::NAN,
        -f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        -1.0,
        65_504.0,
    ];
    let picture = image(Format::Rgba16Float, 12, 1, |x, _| {
        let x = x as usize;
        if x.is_multiple_of(2) {
            [odd[x / 2], 0.25, odd[x / 2], odd[x / 2]]
        } else {
            [0.25; 4]
        }
    });
    for tone in ToneCurve::ALL {
        let settings = Composite {
            exposure: 1e6,
            output: Output::Sdr(tone),
        };
        for settings in [settings, sdr(tone)] {
            let shown = composed(&picture, &settings);
            for texel in &shown {
                assert!(
                    texel.iter().all(|channel| (0.0..=1.0).contains(channel)),
                    "{tone:?}: {texel:?}"
                );
            }
            assert!(
                shown
                    .iter()
                    .skip(1)
                    .step_by(2)
                    .all(|texel| *texel == shown[1]),
                "{tone:?}"
            );
        }
    }
    let settings = Composite {
        exposure: 1e6,
        output: Output::Hdr,
    };
    for texel in composed(&picture, &settings) {
        assert!(
            texel
                .iter()
                .all(|channel| (0.0..=65_504.0).contains(channel)),
            "{texel:?}"
        );
    }
}

#[test]
fn a_glow_of_another_size_is_refused() {
    let mut run = Run::new();
    let colour = image(Format::Rgba16Float, 8, 8, |_, _| [0.0; 4]);
    let source = run.import("colour", &colour);
    let glow = Glow {
        bloom: source,
        intensity: 1.0,
    };
    let error = composite(
        &mut run.graph,
        source,
        None,
        Some(glow),
        &Composite::default(),
    )
    .expect_err("8 is not 4");
    assert!(
        error.to_string().contains("4×4") && error.to_string().contains("bloom"),
        "{error}"
    );
}

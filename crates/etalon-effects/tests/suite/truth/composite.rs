//! The truth of the composite at known points, and the kernel against it.

use crate::common;

use common::{Run, hash, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::composite::truth::{Glow, composite, srgb_encoded, tone};
use etalon_effects::composite::{
    Composite, Glow as EffectGlow, Output, ToneCurve, composite as effect,
};
use etalon_effects::truth::Plane;
use glam::DVec3;

fn near(got: f64, expected: f64) {
    assert!((got - expected).abs() <= 1e-10, "{got} for {expected}");
}

fn grey(curve: ToneCurve, light: f64) -> f64 {
    let shown = tone(curve, DVec3::splat(light));
    // Neutral but for the rounding of AgX's matrices, whose rows sum to 1 to 2e-4:
    // some 3e-4 of what is shown, to the power of 2.2.
    assert!(
        shown.max_element() - shown.min_element() <= 7e-4,
        "{curve:?} {shown}"
    );
    shown.x
}

#[test]
fn srgb_has_its_known_values() {
    near(srgb_encoded(0.0), 0.0);
    near(srgb_encoded(1.0), 1.0);
    near(srgb_encoded(0.002), 0.02584);
    // 0.5^(1/2.4) = 0.749153538438341
    near(srgb_encoded(0.5), 1.055 * 0.749_153_538_438_341 - 0.055);
    // The encoded 0.5 is ((0.5 + 0.055) / 1.055)^2.4.
    near(srgb_encoded((0.555_f64 / 1.055).powf(2.4)), 0.5);
    for (odd, expected) in [
        (f64::NAN, 0.0),
        (-1.0, 0.0),
        (2.0, 1.0),
        (f64::INFINITY, 1.0),
    ] {
        near(srgb_encoded(odd), expected);
    }
    // The two branches meet as nearly as the standard makes them.
    let step = srgb_encoded(0.003_130_8_f64.next_up()) - srgb_encoded(0.003_130_8);
    assert!(step.abs() <= 1e-7, "{step}");
}

#[test]
fn curves_have_their_known_values() {
    let linear = tone(ToneCurve::Linear, DVec3::new(0.25, 1.0, 7.0));
    assert_eq!(linear, DVec3::new(0.25, 1.0, 1.0));

    // L (1 + L / w²) / (1 + L): white is 1, and 1 of a white of 2 is 5/8.
    for white in [1.0, 2.0, 4.0] {
        near(grey(ToneCurve::Reinhard { white }, white.into()), 1.0);
    }
    near(grey(ToneCurve::Reinhard { white: 2.0 }, 1.0), 0.625);
    near(grey(ToneCurve::Reinhard { white: 4.0 }, 0.5), 0.34375);
    // On luminance: red of 1 is scaled as a grey of 0.2126.
    let red = tone(ToneCurve::Reinhard { white: 4.0 }, DVec3::X);
    near(red.x, (1.0 + 0.2126 / 16.0) / 1.2126);
    near(red.y, 0.0);

    // Neutral: less 0.04 up to 0.8; below 0.08 less x − x²/0.16, which leaves
    // x²/0.16; above, with p = x − 0.04: 1 − 0.24² / (p − 0.52).
    near(grey(ToneCurve::Neutral, 0.5), 0.46);
    near(grey(ToneCurve::Neutral, 0.04), 0.01);
    near(grey(ToneCurve::Neutral, 0.8), 0.76);
    near(grey(ToneCurve::Neutral, 1.04), 0.88);
    near(grey(ToneCurve::Neutral, 2.04), 1.0 - 0.0576 / 1.48);
    // A red of 1: nothing is subtracted; p = 1, pn = 1 − 0.0576 / 0.48 = 0.88,
    // g = 1 / (0.15 · 0.12 + 1).
    let red = tone(ToneCurve::Neutral, DVec3::X);
    let g = 1.0 / 1.018;
    near(red.x, 0.88);
    near(red.y, 0.88 * (1.0 - g));

    // ACES of 1 and of black: rows of the first matrix sum to 1, of the second to
    // 1, 1 and 0.99999.
    let fit =
        |x: f64| (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081);
    near(fit(1.0), 1.024488063 / 1.654761);
    let shown = tone(ToneCurve::Aces, DVec3::ONE);
    near(shown.x, fit(1.0));
    near(shown.y, fit(1.0));
    near(shown.z, 0.99999 * fit(1.0));
    assert_eq!(tone(ToneCurve::Aces, DVec3::ZERO), DVec3::ZERO);

    // AgX at both ends of its range: the polynomial at 1 and below 0.
    let top = 15.5 - 40.14 + 31.96 - 6.868 + 0.4298 + 0.1191 - 0.00232;
    let outset = 1.19687900512017 - 0.0980208811401368 - 0.0990297440797205;
    let shown = tone(ToneCurve::AgX, DVec3::splat(60_000.0));
    near(shown.x, f64::powf(top * outset, 2.2));
    assert_eq!(tone(ToneCurve::AgX, DVec3::ZERO), DVec3::ZERO);
    // Half way up its range, 2^-4.2239305, where the polynomial at 1/2 is
    // 15.5/64 − 40.14/32 + 31.96/16 − 6.868/8 + 0.4298/4 + 0.1191/2 − 0.00232.
    let half = 0.242_187_5 - 1.254_375 + 1.997_5 - 0.858_5 + 0.107_45 + 0.059_55 - 0.002_32;
    let light = f64::exp2((4.026069 - 12.47393) / 2.0);
    // Rows of the inset sum to 1 to 1.4e-4 in light, 2e-4 stops, 1.3e-5 of the range.
    let shown = tone(ToneCurve::AgX, DVec3::splat(light)).x;
    assert!(
        (shown - f64::powf(half * outset, 2.2)).abs() <= 1e-4,
        "{shown}"
    );
}

#[test]
fn curves_rise_and_stay_in_range() {
    for curve in ToneCurve::ALL {
        let mut previous = -1.0;
        for step in 0..4000 {
            let shown = grey(curve, f64::exp2(f64::from(step) * 0.01 - 24.0));
            assert!(
                (0.0..=1.0).contains(&shown) && shown >= previous,
                "{curve:?} {step}"
            );
            previous = shown;
        }
    }
}

fn computed(
    colour: &ImageData,
    glow: Option<(&ImageData, f32)>,
    settings: &Composite,
) -> Vec<[f32; 4]> {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let glow = glow.map(|(bloom, intensity)| EffectGlow {
        bloom: run.import("bloom", bloom),
        intensity,
    });
    let result = effect(&mut run.graph, source, None, glow, settings).expect("valid settings");
    texels(&run.output(result))
}

#[test]
fn the_kernel_is_it_rounded() {
    let (width, height) = (61, 35);
    let light = |seed: u32| {
        move |x: u32, y: u32| {
            let stops = |c: u32| {
                let random = hash(x + 61 * y + 10_007 * c + seed) as f32 / u32::MAX as f32;
                (random * 20.0 - 14.0).exp2()
            };
            [stops(0), stops(1), stops(2), 0.25]
        }
    };
    let colour = image(Format::Rgba16Float, width, height, |x, y| match (x, y) {
        (7, 3) => [f32::NAN, f32::INFINITY, -1.0, f32::NAN],
        (8, 3) => [0.0; 4],
        _ => light(0)(x, y),
    });
    let bloom = image(Format::Rgba16Float, 31, 18, light(99));
    let planes = [&colour, &bloom].map(|image| Plane::of(image).expect("small"));
    for with_glow in [false, true] {
        let outputs = ToneCurve::ALL
            .map(Output::Sdr)
            .into_iter()
            .chain([Output::Hdr]);
        for output in outputs {
            let settings = Composite {
                exposure: 1.5,
                output,
            };
            let glow = with_glow.then_some((&bloom, 0.3_f32));
            let kernel = computed(&colour, glow, &settings);
            let glow = with_glow.then_some(Glow {
                bloom: &planes[1],
                intensity: 0.3,
            });
            let truth = composite(&planes[0], 1.0, glow, &settings).expect("valid");
            for (kernel, truth) in kernel.iter().zip(truth.texels()) {
                for (&kernel, &truth) in kernel.iter().zip(truth) {
                    let kernel = f64::from(kernel);
                    let error = (kernel - truth).abs();
                    // Half a code, and f32 on the way to it: 0.007 of a code near
                    // black, where the curves cancel. Or half a step of f16, and
                    // a handful of roundings of f32.
                    let bound = match output {
                        Output::Sdr(_) => 0.507 / 255.0,
                        Output::Hdr => truth * (1.0 / 2048.0 + 1e-6) + 1e-7,
                    };
                    assert!(error <= bound, "{output:?}: {kernel} for {truth}");
                }
            }
        }
    }
}

#[test]
fn adaptation_and_glow_come_on_top() {
    let one =
        |size: [u32; 2], texel| Plane::from_fn(size[0], size[1], |_, _| texel).expect("small");
    let colour = one([5, 3], [0.25, 0.5, 1e6, 2.0]);
    let bloom = one([3, 2], [1.0, 2.0, 3.0, 1.0]);
    let settings = Composite {
        exposure: 0.5,
        output: Output::Hdr,
    };
    let glow = Glow {
        bloom: &bloom,
        intensity: 0.25,
    };
    let shown = composite(&colour, 4.0, Some(glow), &settings).expect("valid");
    for texel in shown.texels() {
        for (got, expected) in texel.iter().zip([0.75, 1.5, 65_504.0, 1.0]) {
            near(*got, expected);
        }
    }
    // The glow is interpolated with the weights that the kernel's text gives:
    // 3 7 5 1 of 16 for odd texels, mirrored for even ones.
    let step = Plane::from_fn(8, 1, |x, _| [f64::from(u8::from(x == 3)); 4]).expect("small");
    let black = one([16, 2], [0.0; 4]);
    let glow = Glow {
        bloom: &step,
        intensity: 1.0,
    };
    let shown = composite(&black, 1.0, Some(glow), &settings).expect("valid");
    for (x, expected) in [0, 1, 3, 5, 7, 7, 5, 3, 1, 0].into_iter().enumerate() {
        near(shown.at(x as i64 + 2, 0)[0], f64::from(expected) / 16.0);
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let colour = Plane::from_fn(5, 3, |_, _| [1.0; 4]).expect("small");
    let settings = Composite::default();
    for adaptation in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(matches!(
            composite(&colour, adaptation, None, &settings),
            Err(EffectError::Setting(_))
        ));
    }
    let glow = |intensity| Glow {
        bloom: &colour,
        intensity,
    };
    assert!(matches!(
        composite(&colour, 1.0, Some(glow(1.0)), &settings),
        Err(EffectError::SizeMismatch {
            second: "bloom",
            ..
        })
    ));
    assert!(matches!(
        composite(&colour, 1.0, Some(glow(f32::NAN)), &settings),
        Err(EffectError::Setting(_))
    ));
    let white = Composite {
        output: Output::Sdr(ToneCurve::Reinhard { white: 0.0 }),
        ..settings
    };
    assert!(composite(&colour, 1.0, None, &white).is_err());
    // Light times the largest factor of all stays a number.
    let odd = Plane::from_fn(2, 1, |x, _| match x {
        0 => [f64::NAN, f64::INFINITY, -1.0, f64::NAN],
        _ => [1e300, 0.0, 1e-300, -1.0],
    })
    .expect("small");
    for output in ToneCurve::ALL.map(Output::Sdr) {
        let settings = Composite {
            exposure: 1e6,
            output,
        };
        let shown = composite(&odd, f64::MAX, None, &settings).expect("valid");
        let share = |x: &f64| (0.0..=1.0).contains(x);
        assert!(shown.texels().iter().flatten().all(share), "{output:?}");
    }
}

//! The truth of exposure against sums of whole numbers and the lag's equation,
//! and the kernels against it.

use crate::common;

use common::{Run, backend, hash, image, texels};
use etalon_core::Format;
use etalon_core::backend::Backend;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::exposure::truth::{adapt, ev_between, exposure, measure};
use etalon_effects::exposure::{Exposure, Metering, exposure as effect};
use etalon_effects::truth::{Plane, exact_sum};

fn metered(metering: Metering) -> Exposure {
    Exposure {
        metering,
        ..Exposure::default()
    }
}

#[test]
fn a_sum_is_rounded_once() {
    assert_eq!(exact_sum([]), 0.0);
    assert_eq!(exact_sum([1e100, 1.0, -1e100]), 1.0);
    assert_eq!(exact_sum([0.1; 10]), 1.0);
    // Half a unit and a trace more: to even it would be rounded down.
    let half = f64::EPSILON / 2.0;
    assert_eq!(exact_sum([1.0, half]), 1.0);
    assert_eq!(exact_sum([1.0, half, 1e-300]), 1.0 + f64::EPSILON);
    assert_eq!(exact_sum([1.0, half, -1e-300]), 1.0);
    assert_eq!(exact_sum([-1.0, -half, -1e-300]), -1.0 - f64::EPSILON);
    assert!(exact_sum([1.0, f64::NAN]).is_nan());
    // Against whole numbers of 128 bits, over the widest range that they have.
    for seed in 0..200 {
        let terms: Vec<i128> = (0..300)
            .map(|i| {
                let random = |c: u32| hash(i + 1000 * seed + 77_777 * c);
                let mantissa = i128::from(random(0)) - (1 << 31);
                mantissa << (random(1) % 80)
            })
            .collect();
        let exact: i128 = terms.iter().sum();
        let numbers = terms.iter().map(|&term| term as f64);
        assert_eq!(exact_sum(numbers), exact as f64, "{seed}");
    }
}

#[test]
fn a_uniform_picture_averages_to_itself() {
    for metering in [Metering::Arithmetic, Metering::Logarithmic] {
        for size in [[1, 1], [257, 129]] {
            let picture = Plane::from_fn(size[0], size[1], |_, _| [0.3, 0.3, 0.3, 0.0]);
            let measured = measure(&picture.expect("small"), &metered(metering)).expect("valid");
            let average = measured.luminance.expect("finite");
            assert!((average / 0.3 - 1.0).abs() <= 1e-14, "{average}");
            assert_eq!(measured.texels, u64::from(size[0] * size[1]));
        }
    }
}

#[test]
fn averages_are_those_of_whole_numbers_and_of_stops() {
    // Luminance of a grey k is k but for the sum of the coefficients, 1.
    let (width, height) = (300, 211);
    let grey = |x: u32, y: u32| hash(x + 300 * y) % 60_000;
    let sum: u64 = (0..height)
        .flat_map(|y| (0..width).map(move |x| u64::from(grey(x, y))))
        .sum();
    let picture = Plane::from_fn(width, height, |x, y| [f64::from(grey(x, y)); 4]);
    let measured = measure(&picture.expect("small"), &metered(Metering::Arithmetic));
    let average = measured.expect("valid").luminance.expect("finite");
    let exact = sum as f64 / f64::from(width * height);
    assert!((average / exact - 1.0).abs() <= 1e-15, "{average} {exact}");
    // A quarter of the texels at 2^4, the rest at 2^-2, and black at the floor.
    let picture = Plane::from_fn(4, 2, |x, y| match (x, y) {
        (0, _) => [16.0; 4],
        (1, 1) => [0.0; 4],
        _ => [0.25; 4],
    });
    let settings = Exposure {
        min_luminance: 0.125,
        ..metered(Metering::Logarithmic)
    };
    let measured = measure(&picture.expect("small"), &settings).expect("valid");
    let stops = (2.0 * 4.0 - 3.0 - 5.0 * 2.0) / 8.0_f64;
    let average = measured.luminance.expect("finite");
    assert!((average.log2() - stops).abs() <= 1e-14, "{average}");
}

#[test]
fn texels_that_are_no_numbers_take_no_part() {
    let picture = Plane::from_fn(8, 4, |x, y| match (x + 8 * y) % 8 {
        0 => [f64::NAN, 1.0, 1.0, 1.0],
        1 => [1.0, f64::INFINITY, 1.0, 1.0],
        2 => [1.0, 1.0, f64::NEG_INFINITY, 1.0],
        // Alpha is no light; negative light is none; more than f16 holds is that.
        3 => [0.5, 0.5, 0.5, f64::NAN],
        4 => [-1.0, -1e300, -0.0, 1.0],
        5 => [1e300, 1e300, 1e300, 1.0],
        _ => [0.5; 4],
    });
    let picture = picture.expect("small");
    let measured = measure(&picture, &metered(Metering::Arithmetic)).expect("valid");
    assert_eq!(measured.texels, 20);
    let expected = (3.0 * 0.5 + 65_504.0) / 5.0;
    let average = measured.luminance.expect("finite");
    assert!((average / expected - 1.0).abs() <= 1e-14);
    // None at all: what was before stays; the first frame is exposed as the darkest,
    // and there is still none to be kept.
    let none = Plane::from_fn(3, 3, |_, _| [f64::NAN; 4]).expect("small");
    let settings = Exposure::default();
    let measured = measure(&none, &settings).expect("valid");
    assert_eq!((measured.luminance, measured.texels), (None, 0));
    let kept = exposure(&none, Some(0.5), 1.0, &settings).expect("valid");
    assert_eq!(kept.luminance, 0.5);
    let first = exposure(&none, None, 1.0, &settings).expect("valid");
    assert_eq!(first.luminance, 0.0);
    let darkest = f64::from(settings.key) / f64::from(settings.min_luminance);
    assert_eq!(first.factor, darkest);
    let next = exposure(&grey_plane(0.5), Some(first.luminance), 0.01, &settings).expect("valid");
    assert!((next.luminance - 0.5).abs() <= 1e-9, "{}", next.luminance);
}

/// Three texels square, of one grey.
fn grey_plane(value: f64) -> Plane {
    Plane::from_fn(3, 3, |_, _| [value, value, value, 1.0]).expect("small")
}

#[test]
fn the_eye_follows_by_the_equation_of_the_lag() {
    let settings = Exposure {
        speed_up: 3.0,
        speed_down: 0.5,
        compensation: 1.0,
        key: 0.25,
        ..Exposure::default()
    };
    for (from, to, speed) in [(0.5, 4.0, 3.0_f64), (4.0, 0.5, 0.5)] {
        for time in [0.0, 1e-9, 0.01, 0.7, 20.0, 1e6] {
            let adapted = adapt(Some(to), Some(from), time, &settings).expect("valid");
            let expected = to + (from - to) * (-speed * time).exp();
            assert!(
                (adapted.luminance - expected).abs() <= 1e-14 * 4.0,
                "{time}"
            );
            assert!((adapted.factor * adapted.luminance / 0.5 - 1.0).abs() <= 1e-15);
        }
        // Two steps of a time are one of twice that.
        let once = adapt(Some(to), Some(from), 0.6, &settings).expect("valid");
        let half = adapt(Some(to), Some(from), 0.3, &settings).expect("valid");
        let twice = adapt(Some(to), Some(half.luminance), 0.3, &settings).expect("valid");
        assert!((once.luminance / twice.luminance - 1.0).abs() <= 1e-14);
        // A short step keeps its digits: (to − from) speed t.
        let step = adapt(Some(to), Some(from), 1e-12, &settings).expect("valid");
        let moved = step.luminance - from;
        assert!((moved / ((to - from) * speed * 1e-12) - 1.0).abs() <= 1e-3);
    }
    // No history to speak of.
    for previous in [
        None,
        Some(0.0),
        Some(-1.0),
        Some(f64::NAN),
        Some(f64::INFINITY),
    ] {
        let adapted = adapt(Some(2.0), previous, 0.01, &settings).expect("valid");
        assert_eq!(adapted.luminance, 2.0);
    }
    // Limits, of the average and of what was before.
    for (average, previous, expected) in [
        (1e9, None, 1e4_f32),
        (1e-9, None, 1e-3),
        (1e9, Some(1e9), 1e4),
    ] {
        let adapted = adapt(Some(average), previous, 0.01, &settings).expect("valid");
        assert_eq!(adapted.luminance, f64::from(expected));
    }
    for time in [-1.0, f64::NAN, f64::INFINITY, 1.1e6] {
        assert!(matches!(
            adapt(Some(1.0), None, time, &settings),
            Err(EffectError::Setting(_))
        ));
    }
    let odd = Exposure {
        key: f32::NAN,
        ..settings
    };
    assert!(adapt(Some(1.0), None, 0.0, &odd).is_err());
    let crossed = Exposure {
        min_luminance: 2.0,
        max_luminance: 1.0,
        ..settings
    };
    assert!(adapt(Some(1.0), None, 0.0, &crossed).is_err());
}

#[test]
fn differences_are_in_stops() {
    assert_eq!(ev_between(4.0, 1.0), Some(2.0));
    assert_eq!(ev_between(0.125, 0.5), Some(-2.0));
    assert_eq!(ev_between(f64::MAX, f64::MIN_POSITIVE), Some(2046.0));
    for odd in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(ev_between(odd, 1.0), None);
        assert_eq!(ev_between(1.0, odd), None);
    }
}

/// (adapted, factor) after one frame.
fn frame(
    backend: &mut dyn Backend,
    colour: &ImageData,
    delta_time: f32,
    settings: &Exposure,
) -> [f64; 2] {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let result = effect(&mut run.graph, source, delta_time, settings).expect("valid");
    let texel = texels(&run.output_on(backend, result))[0];
    [texel[0].into(), texel[1].into()]
}

#[test]
fn the_kernels_are_within_their_rounding() {
    for metering in [Metering::Arithmetic, Metering::Logarithmic] {
        let settings = metered(metering);
        let mut backend = backend();
        let mut previous = None;
        let mut worst = 0.0_f64;
        for step in 0..6_u32 {
            let colour = image(Format::Rgba16Float, 257, 129, |x, y| {
                let random = |c: u32| {
                    let unit = hash(x ^ (y << 12) ^ (c << 24) ^ step) as f32 / u32::MAX as f32;
                    (unit * 10.0 - 6.0 + step as f32).exp2()
                };
                if hash(x + 257 * y).is_multiple_of(91) {
                    [f32::NAN, 1.0, 1.0, 1.0]
                } else {
                    [random(0), random(1), random(2), 1.0]
                }
            });
            let got = frame(backend.as_mut(), &colour, 0.125, &settings);
            let plane = Plane::of(&colour).expect("small");
            let truth = exposure(&plane, previous, 0.125, &settings).expect("valid");
            previous = Some(truth.luminance);
            let error = ev_between(got[0], truth.luminance).expect("positive").abs();
            let factor = ev_between(got[1], truth.factor).expect("positive").abs();
            worst = worst.max(error).max(factor);
        }
        // The sum is a tree over three reductions of eight additions, and logarithms
        // are at most 14 stops: (2 + 8 · 3) · 14 roundings of 2^-24 stops, and a
        // few of the lag and the exponential.
        println!("{metering:?}: {worst:e} EV");
        assert!(worst <= 400.0 / f64::from(1 << 24), "{metering:?}: {worst}");
    }
}

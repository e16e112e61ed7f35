//! Exposure against exact averages and the closed form of the lag.

use crate::common;

use common::{Run, backend, hash, image, texels};
use etalon_core::Format;
use etalon_core::backend::Backend;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_effects::exposure::{Exposure, Metering, exposure, measure};

/// Half an ulp of 1, the relative error of one rounding.
const U: f64 = 1.0 / (1 << 24) as f64;

fn luminance(texel: &[f32; 4]) -> f64 {
    let [r, g, b, _] = texel.map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Light over ten stops, the same each time.
fn noise(width: u32, height: u32) -> ImageData {
    image(Format::Rgba16Float, width, height, |x, y| {
        let channel = |c: u32| {
            let random = hash(x ^ (y << 12) ^ (c << 24)) as f32 / u32::MAX as f32;
            (random * 10.0 - 6.0).exp2()
        };
        [channel(0), channel(1), channel(2), 1.0]
    })
}

/// (sum, weight) of an image.
fn measured(colour: &ImageData, settings: &Exposure) -> [f64; 2] {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let sums = measure(&mut run.graph, source, settings).expect("valid settings");
    let texel = texels(&run.output(sums))[0];
    [texel[0].into(), texel[1].into()]
}

/// How many times the picture is reduced until one texel is left.
fn reductions(width: u32, height: u32) -> i32 {
    let mut side = width.max(height);
    let mut count = 0;
    while count == 0 || side > 1 {
        side = side.div_ceil(16);
        count += 1;
    }
    count
}

const SIZES: [(u32, u32); 8] = [
    (1, 1),
    (7, 5),
    (16, 16),
    (17, 33),
    (1, 300),
    (100, 60),
    (257, 129),
    (512, 512),
];

#[test]
fn the_arithmetic_mean_is_exact_within_rounding() {
    let settings = Exposure {
        metering: Metering::Arithmetic,
        ..Exposure::default()
    };
    for (width, height) in SIZES {
        let colour = noise(width, height);
        let [sum, weight] = measured(&colour, &settings);
        assert_eq!(weight, f64::from(width * height));
        let exact: f64 = texels(&colour).iter().map(luminance).sum();
        // All terms are positive, so relative errors of terms are relative errors
        // of the sum: three roundings and that of a coefficient in the luminance,
        // eight additions in each reduction.
        let bound = f64::from(4 + 8 * reductions(width, height)) * U;
        assert!(
            (sum / exact - 1.0).abs() <= bound,
            "{width}×{height}: {sum} for {exact}"
        );
    }
}

#[test]
fn the_geometric_mean_is_exact_within_rounding() {
    let settings = Exposure {
        metering: Metering::Logarithmic,
        min_luminance: 0.125,
        ..Exposure::default()
    };
    for (width, height) in SIZES {
        let colour = noise(width, height);
        let [sum, weight] = measured(&colour, &settings);
        assert_eq!(weight, f64::from(width * height));
        let logarithms: Vec<f64> = texels(&colour)
            .iter()
            .map(|texel| luminance(texel).max(0.125).log2())
            .collect();
        let exact: f64 = logarithms.iter().sum();
        let size: f64 = logarithms.iter().map(|l| l.abs()).sum();
        // A luminance off by 4 u moves its logarithm by 4 u / ln 2; the logarithm
        // itself is within 1 ulp = 2 u, and each reduction adds eight roundings
        // of partial sums, which are at most the sum of magnitudes.
        let bound = 5.8 * U * weight + f64::from(2 + 8 * reductions(width, height)) * U * size;
        assert!(
            (sum - exact).abs() <= bound,
            "{width}×{height}: {sum} for {exact}"
        );
    }
}

#[test]
fn a_constant_picture_averages_to_itself() {
    // A running sum of 512 × 512 equal values would have drifted.
    let settings = Exposure {
        metering: Metering::Arithmetic,
        ..Exposure::default()
    };
    let white = image(Format::Rgba16Float, 512, 512, |_, _| [1.0; 4]);
    let [sum, weight] = measured(&white, &settings);
    // 0.2126 + 0.7152 + 0.0722 in f32, rounded twice, is within an ulp of 1.
    assert!((sum / weight - 1.0).abs() <= 2.0 * U);
}

#[test]
fn texels_that_are_no_numbers_do_not_count() {
    let settings = Exposure {
        metering: Metering::Arithmetic,
        ..Exposure::default()
    };
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let colour = image(Format::Rgba16Float, 40, 20, |x, y| {
        let index = (x + 40 * y) as usize;
        let mut texel = [0.5, 0.5, 0.5, 1.0];
        if index.is_multiple_of(7) {
            texel[index % 3] = odd[index % 9 / 3];
        }
        texel
    });
    let [sum, weight] = measured(&colour, &settings);
    let left_out = (0..800_u32).filter(|index| index.is_multiple_of(7)).count();
    assert_eq!(weight, (800 - left_out) as f64);
    assert!((sum / weight - 0.5).abs() <= 0.5 * 28.0 * U);
    // Negative light counts as none.
    let below = image(Format::Rgba16Float, 16, 16, |_, _| [-1.0; 4]);
    assert_eq!(measured(&below, &settings), [0.0, 256.0]);
}

/// (adapted, exposure) after one frame of a picture of grey `luminance`.
fn frame(
    backend: &mut dyn Backend,
    colour: &ImageData,
    delta_time: f32,
    settings: &Exposure,
) -> [f32; 2] {
    let mut run = Run::new();
    let source = run.import("colour", colour);
    let result = exposure(&mut run.graph, source, delta_time, settings).expect("valid settings");
    let texel = texels(&run.output_on(backend, result))[0];
    [texel[0], texel[1]]
}

fn grey(value: f32) -> ImageData {
    image(Format::Rgba16Float, 8, 8, |_, _| [value, value, value, 1.0])
}

#[test]
fn the_eye_follows_the_closed_form() {
    let settings = Exposure {
        metering: Metering::Arithmetic,
        speed_up: 3.0,
        speed_down: 0.5,
        ..Exposure::default()
    };
    let mut backend = backend();
    let (dark, bright) = (grey(0.25), grey(4.0));
    // The first frame has no history and starts where the scene is.
    let [start, _] = frame(backend.as_mut(), &dark, 0.1, &settings);
    assert!((start - 0.25).abs() <= 1e-6);
    let mut adapted = f64::from(start);
    for (picture, target, speed, steps) in [(&bright, 4.0_f64, 3.0_f64, 12), (&dark, 0.25, 0.5, 12)]
    {
        for step in 0..steps {
            let delta_time = [0.004_f32, 0.016, 0.25, 1.0][step % 4];
            let [got, factor] = frame(backend.as_mut(), picture, delta_time, &settings);
            adapted += (target - adapted) * -(-speed * f64::from(delta_time)).exp_m1();
            // A few roundings per step, of values of at most 4, that do not add
            // up since each step forgets some of the error before it.
            assert!(
                (f64::from(got) / adapted - 1.0).abs() <= 64.0 * U,
                "{got} for {adapted}"
            );
            assert!((f64::from(factor) * f64::from(got) / 0.18 - 1.0).abs() <= 8.0 * U);
        }
    }
}

#[test]
fn no_frame_time_overshoots() {
    let settings = Exposure {
        metering: Metering::Arithmetic,
        ..Exposure::default()
    };
    for delta_time in [0.0, 1e-30, 1e-6, 0.5, 5.0, 1e6] {
        let mut backend = backend();
        let [start, _] = frame(backend.as_mut(), &grey(0.5), 0.0, &settings);
        let [next, _] = frame(backend.as_mut(), &grey(2.0), delta_time, &settings);
        assert!(
            next >= start && next <= 2.0 * (1.0 + 4.0 * U as f32),
            "{delta_time}: {next}"
        );
        if delta_time == 0.0 {
            assert_eq!(next, start);
        }
        if delta_time >= 1e6 {
            assert!((next - 2.0).abs() <= 1e-6);
        }
    }
}

#[test]
fn two_half_steps_are_one_step() {
    let settings = Exposure {
        metering: Metering::Arithmetic,
        ..Exposure::default()
    };
    let run = |steps: &[f32]| {
        let mut backend = backend();
        frame(backend.as_mut(), &grey(0.5), 0.0, &settings);
        steps
            .iter()
            .map(|dt| frame(backend.as_mut(), &grey(2.0), *dt, &settings)[0])
            .last()
            .expect("a step")
    };
    let (one, two) = (run(&[0.125]), run(&[0.0625, 0.0625]));
    assert!(
        (one / two - 1.0).abs() <= 16.0 * U as f32,
        "{one} and {two}"
    );
}

#[test]
fn black_white_and_unmeasurable_pictures_stay_in_range() {
    for metering in [Metering::Arithmetic, Metering::Logarithmic] {
        let settings = Exposure {
            metering,
            min_luminance: 0.01,
            max_luminance: 100.0,
            ..Exposure::default()
        };
        for (value, expected) in [
            (0.0, 0.01),
            (-5.0, 0.01),
            (65_504.0, 100.0),
            (f32::NAN, 0.01),
            (f32::INFINITY, 0.01),
        ] {
            let [adapted, factor] = frame(backend().as_mut(), &grey(value), 0.1, &settings);
            // Where nothing is a number the darkest is exposed for, and none kept.
            let kept = if value.is_finite() { expected } else { 0.0 };
            assert!(
                (adapted - kept).abs() <= 1e-6 * expected,
                "{metering:?} {value}: {adapted}"
            );
            assert!((factor * expected / 0.18 - 1.0).abs() <= 1e-6);
        }
        // With a history, an unmeasurable picture changes nothing.
        let mut backend = backend();
        let [before, _] = frame(backend.as_mut(), &grey(3.0), 0.1, &settings);
        let [after, _] = frame(backend.as_mut(), &grey(f32::NAN), 1e6, &settings);
        assert_eq!(before, after);
    }
}

/// A first frame in which nothing is a number leaves nothing behind: the second is
/// the first to adapt to. The darkest luminance in its place would be followed from
/// there for seconds.
#[test]
fn a_first_frame_of_no_numbers_is_forgotten() {
    let settings = Exposure::default();
    for nothing in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut backend = backend();
        let [none, factor] = frame(backend.as_mut(), &grey(nothing), 0.01, &settings);
        assert_eq!(none, 0.0);
        let darkest = settings.key / settings.min_luminance;
        assert!((factor / darkest - 1.0).abs() <= 1e-6, "{factor}");
        let [adapted, _] = frame(backend.as_mut(), &grey(0.5), 0.01, &settings);
        assert!((adapted / 0.5 - 1.0).abs() <= 1e-6, "{adapted}");
    }
}

#[test]
fn compensation_is_in_stops() {
    let at = |compensation| {
        let settings = Exposure {
            compensation,
            ..Exposure::default()
        };
        frame(backend().as_mut(), &grey(1.0), 0.1, &settings)[1]
    };
    assert_eq!(at(1.0), 2.0 * at(0.0));
    assert_eq!(at(-16.0), at(0.0) / 65_536.0);
}

#[test]
fn a_poisoned_history_is_forgotten_in_one_frame() {
    let sums = image(Format::Rgba32Float, 1, 1, |_, _| [12.0, 6.0, 0.0, 0.0]);
    for poison in [
        f32::NAN,
        -f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        0.0,
        -0.0,
        -3.0,
        f32::MAX,
        f32::MIN_POSITIVE,
    ] {
        let history = image(Format::Rgba32Float, 1, 1, |_, _| {
            [poison, f32::NAN, 0.0, 0.0]
        });
        let mut run = Run::new();
        let (measured, history) = (
            run.import("measured", &sums),
            run.import("history", &history),
        );
        let result = run
            .graph
            .texture("result", TextureDesc::d2(1, 1, Format::Rgba32Float));
        let result = run
            .graph
            .compute("exposure/adapt")
            .read("measured", measured)
            .read("history", history)
            .write("result", result)
            .constant("METERING", 0.0)
            .set("min_luminance", 0.5_f32)
            .set("max_luminance", 8.0_f32)
            .set("key", 0.18_f32)
            .set("compensation", 0.0_f32)
            .set("speed_up", 1.0_f32)
            .set("speed_down", 1.0_f32)
            .set("delta_time", 1.0_f32)
            .per_texel("result")
            .expect("a valid pass");
        let [adapted, factor, ..] = texels(&run.output(result))[0];
        assert!(factor.is_finite());
        if poison.is_finite() && poison > 0.0 {
            // A number, however extreme, is limited to the range and followed.
            assert!((0.5..=8.0).contains(&adapted), "{poison}: {adapted}");
        } else {
            assert_eq!(adapted, 2.0, "{poison}");
        }
    }
}

/// Of each square of texels one counts: a picture that is one thing there and
/// another elsewhere measures that thing.
#[test]
fn a_stride_looks_at_the_middle_of_each_square() {
    for (width, height, stride) in [(64, 48, 2), (61, 47, 4), (7, 5, 3), (33, 1, 32), (3, 3, 64)] {
        let middle = |at: u32, side: u32| at == (at / stride * stride + stride / 2).min(side - 1);
        let colour = image(Format::Rgba16Float, width, height, |x, y| {
            let seen = middle(x, width) && middle(y, height);
            [if seen { 2.0 } else { 1000.0 }; 4]
        });
        let mut run = Run::new();
        let source = run.import("colour", &colour);
        let settings = Exposure {
            metering: Metering::Arithmetic,
            stride,
            ..Exposure::default()
        };
        let sum = measure(&mut run.graph, source, &settings).expect("valid");
        let [sum, weight, ..] = texels(&run.output(sum))[0];
        let squares = width.div_ceil(stride) * height.div_ceil(stride);
        assert_eq!(weight, squares as f32, "{width}×{height} / {stride}");
        // Luminance weights sum to 1 within a rounding of each.
        assert!(
            (sum / weight - 2.0).abs() < 1e-6,
            "{width}×{height} / {stride}: {sum}"
        );
    }
}

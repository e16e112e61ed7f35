//! The functions of `shaders/lib/math` and `shaders/lib/colour` against f64.

use crate::common;

use common::{Run, image, texels, ulps};
use etalon_core::Format;
use etalon_core::resource::TextureDesc;

/// Applies one of the functions to (x, y) pairs.
const KERNEL: &str = "
import package::lib::colour::{srgb_decoded1, srgb_encoded1};
import package::lib::math::{approach, exponential, exponential2, fraction_power, lerp, logarithm, logarithm2, power, smooth01};

override FUNCTION: u32 = 0u;

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<r32float, write>;

fn value(x: f32, y: f32) -> f32 {
    switch FUNCTION {
        case 0u: { return exponential2(x); }
        case 1u: { return exponential(x); }
        case 2u: { return logarithm2(x); }
        case 3u: { return logarithm(x); }
        case 4u: { return power(x, y); }
        case 5u: { return approach(x); }
        case 6u: { return srgb_encoded1(x); }
        case 7u: { return srgb_decoded1(x); }
        case 8u: { return smooth01(x); }
        case 9u: { return fraction_power(x, y); }
        default: { return lerp(x, y, 1.0); }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = textureDimensions(result);
    if (id.x >= extent.x || id.y >= extent.y) {
        return;
    }
    let pair = textureLoad(source, id.xy, 0).xy;
    textureStore(result, id.xy, vec4<f32>(value(pair.x, pair.y), 0.0, 0.0, 1.0));
}
";

const EXPONENTIAL2: u32 = 0;
const EXPONENTIAL: u32 = 1;
const LOGARITHM2: u32 = 2;
const LOGARITHM: u32 = 3;
const POWER: u32 = 4;
const APPROACH: u32 = 5;
const SRGB_ENCODED: u32 = 6;
const SRGB_DECODED: u32 = 7;
const SMOOTH01: u32 = 8;
const FRACTION_POWER: u32 = 9;
const LERP_AT_ONE: u32 = 10;

/// Values of a function at `points`.
fn evaluate(function: u32, points: &[[f32; 2]]) -> Vec<f32> {
    const WIDTH: usize = 512;
    let height = points.len().div_ceil(WIDTH);
    let arguments = image(Format::Rg32Float, WIDTH as u32, height as u32, |x, y| {
        let [x, y] = points
            .get(y as usize * WIDTH + x as usize)
            .copied()
            .unwrap_or([1.0; 2]);
        [x, y, 0.0, 0.0]
    });
    let mut run = Run::new();
    run.kernels.add_source("test/function", KERNEL);
    let source = run.import("source", &arguments);
    let desc = TextureDesc::d2(WIDTH as u32, height as u32, Format::R32Float);
    let result = run.graph.texture("result", desc);
    let result = run
        .graph
        .compute("test/function")
        .read("source", source)
        .write("result", result)
        .constant("FUNCTION", function.into())
        .per_texel("result")
        .expect("a valid pass");
    let values = texels(&run.output(result));
    values
        .iter()
        .take(points.len())
        .map(|texel| texel[0])
        .collect()
}

/// `count` floats from `low` to `high`, both of one sign, evenly spread over the
/// bit patterns between them and so over all magnitudes; both ends included.
fn spread(low: f32, high: f32, count: u32) -> Vec<f32> {
    let (low, high) = (u64::from(low.to_bits()), u64::from(high.to_bits()));
    let at = |i: u32| {
        let step = (high as i64 - low as i64) * i64::from(i) / i64::from(count - 1);
        f32::from_bits((low as i64 + step) as u32)
    };
    (0..count).map(at).collect()
}

/// The largest error of `function` over `points`, held against `bound`.
fn within(
    name: &str,
    function: u32,
    points: &[[f32; 2]],
    exact: impl Fn(f64, f64) -> f64,
    bound: f64,
) {
    let values = evaluate(function, points);
    let mut worst = (0.0, [0.0; 2], 0.0);
    for (&[x, y], &value) in points.iter().zip(&values) {
        assert!(value.is_finite(), "{name}({x:e}, {y:e}) = {value}");
        let error = ulps(value, exact(x.into(), y.into()));
        if error > worst.0 {
            worst = (error, [x, y], value);
        }
    }
    let (error, [x, y], value) = worst;
    assert!(
        error <= bound,
        "{name}({x:e}, {y:e}) = {value:e} is {error:.3} ulp off; stated {bound}"
    );
    // A bound far above what happens would hide a loss of accuracy.
    assert!(
        error >= 0.25 * bound,
        "{name}: {error:.3} ulp at most, stated {bound}"
    );
}

fn unary(points: impl IntoIterator<Item = f32>) -> Vec<[f32; 2]> {
    points.into_iter().map(|x| [x, 0.0]).collect()
}

const DENSE: u32 = 100_000;

#[test]
fn exponentials() {
    let points = unary([spread(1e-9, 127.99999, DENSE), spread(-1e-9, -126.0, DENSE)].concat());
    within("exponential2", EXPONENTIAL2, &points, |x, _| x.exp2(), 1.25);
    let points = unary([spread(1e-9, 88.72, DENSE), spread(-1e-9, -87.33, DENSE)].concat());
    within("exponential", EXPONENTIAL, &points, |x, _| x.exp(), 1.25);
}

#[test]
fn logarithms() {
    let everywhere = [
        spread(f32::MIN_POSITIVE, f32::MAX, DENSE),
        // Where the result is small and cancellation would show.
        spread(0.5, 2.0, DENSE),
    ];
    let points = unary(everywhere.concat());
    within("logarithm2", LOGARITHM2, &points, |x, _| x.log2(), 1.0);
    within("logarithm", LOGARITHM, &points, |x, _| x.ln(), 1.0);
}

#[test]
fn powers() {
    for (exponents, bound) in [
        (
            &[
                1.0_f32 / 2.4,
                2.4,
                2.2,
                0.5,
                3.0,
                0.1,
                7.3,
                10.0,
                -0.7,
                -10.0,
            ][..],
            2.0,
        ),
        (&[33.0, 100.0, -100.0], 10.0),
    ] {
        let mut points = Vec::new();
        for &y in exponents {
            // Stay where the result is a normal number.
            let reach = (125.0 / y.abs()).min(125.0);
            points.extend(
                spread((-reach).exp2(), reach.exp2(), DENSE / 8)
                    .into_iter()
                    .map(|x| [x, y]),
            );
            points.extend(spread(0.9, 1.1, DENSE / 8).into_iter().map(|x| [x, y]));
        }
        within("power", POWER, &points, |x, y| x.powf(y), bound);
    }
}

#[test]
fn the_lag_keeps_its_digits_for_short_times() {
    let points = unary(spread(1e-30, 90.0, DENSE));
    within("approach", APPROACH, &points, |x, _| -(-x).exp_m1(), 1.5);
}

#[test]
fn srgb() {
    // Encoding: from 0.0031308 on the logarithm is below 2^4 and its product with
    // 1/2.4 below 4, so that the power's exponent is off by up to 2^-21 / 2.4 +
    // 2^-23, and the power by ln 2 of that, 2.9 ulp where it is next to 0.1, and
    // its own 1.25. The factor 1.055 and two roundings make 4.9 of that; the ulp
    // of 0.1055 - 0.055 is half as large. (2.9 + 1.25) · 1.055 · 2 + 1 + 0.5 = 10.3.
    let encoded = |x: f64| {
        if x <= 0.003_130_8_f32.into() {
            12.92 * x
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        }
    };
    // (The exponent 1/2.4 as f32 is off by 2^-26 of itself: a tenth of that.)
    let points = unary(spread(1e-6, 1.0, DENSE));
    within(
        "srgb_encoded1",
        SRGB_ENCODED,
        &points,
        |x, _| encoded(x),
        10.3,
    );
    // Decoding: the argument within 1 ulp, times 2.4 by the power, and its own 2.
    let decoded = |x: f64| {
        if x <= 0.040_45_f32.into() {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055).powf(2.4)
        }
    };
    within(
        "srgb_decoded1",
        SRGB_DECODED,
        &points,
        |x, _| decoded(x),
        7.0,
    );
}

#[test]
fn powers_of_fractions() {
    let exact = |x: f64, y: f64| x.powf(y);
    // The logarithm's sum with its exponent, below 2^k, rounds by 2^(k - 25), and
    // the product with y, below 2^j, by 2^(j - 25) unless y = 1. The result is off
    // by ln 2 of what they make of the power, in ulp of at least 2^-24 of it, and
    // by the 1.25 ulp of 2^x.
    let points = |from: f64, y: f32| -> Vec<[f32; 2]> {
        let points = spread(from as f32, 1.0, DENSE).into_iter();
        points.map(|x| [x, y]).collect()
    };
    let cases = [
        // (2^(3 - 25) / 2 + 2^(2 - 25)) ln 2 = 2.8 · 2^-24.
        (2.0_f64.powi(-8), 0.416_666_66_f32, 4.0),
        (2.0_f64.powi(-8), 0.5, 4.0),
        // 2^(2 - 25) ln 2 = 1.4 · 2^-24.
        (2.0_f64.powi(-4), 1.0, 2.6),
        // 2^(5 - 25) ln 2 = 11.1 · 2^-24.
        (2.0_f64.powi(-32), 1.0, 12.4),
        // Twice that.
        (2.0_f64.powi(-64), 0.5, 23.5),
    ];
    for (from, y, ulp) in cases {
        within(
            "fraction_power",
            FRACTION_POWER,
            &points(from, y),
            exact,
            ulp,
        );
    }
    // Whole powers at the ends, and something in [0, 1] for 0.
    let ends = [
        [1.0, 0.3],
        [1.0, 0.0],
        [0.25, 0.0],
        [0.25, 0.5],
        [0.0, 0.4],
        [0.0, 1.0],
    ];
    let got = evaluate(FRACTION_POWER, &ends);
    assert_eq!(got[..4], [1.0, 1.0, 1.0, 0.5]);
    assert!(
        got[4..].iter().all(|power| (0.0..=1.0).contains(power)),
        "{got:?}"
    );
}

#[test]
fn special_values_give_what_is_stated() {
    let check = |function, cases: &[([f32; 2], f32)]| {
        let points: Vec<_> = cases.iter().map(|case| case.0).collect();
        for (&(point, expected), value) in cases.iter().zip(evaluate(function, &points)) {
            assert_eq!(value, expected, "function {function} at {point:?}");
        }
    };
    let max = f32::MAX;
    check(
        EXPONENTIAL2,
        &[
            ([0.0, 0.0], 1.0),
            ([-0.0, 0.0], 1.0),
            ([1.0, 0.0], 2.0),
            ([-126.0, 0.0], f32::MIN_POSITIVE),
            ([-126.1, 0.0], 0.0),
            ([127.0, 0.0], 127_f32.exp2()),
            ([128.0, 0.0], max),
            ([max, 0.0], max),
            ([-max, 0.0], 0.0),
        ],
    );
    check(
        EXPONENTIAL,
        &[
            ([0.0, 0.0], 1.0),
            ([88.73, 0.0], max),
            ([-87.34, 0.0], 0.0),
            ([max, 0.0], max),
            ([-max, 0.0], 0.0),
        ],
    );
    check(
        LOGARITHM2,
        &[
            ([1.0, 0.0], 0.0),
            ([2.0, 0.0], 1.0),
            ([0.25, 0.0], -2.0),
            ([f32::MIN_POSITIVE, 0.0], -126.0),
            ([0.0, 0.0], -126.0),
            ([-0.0, 0.0], -126.0),
            ([-1.0, 0.0], -126.0),
            ([1e-40, 0.0], -126.0),
            ([127_f32.exp2(), 0.0], 127.0),
        ],
    );
    check(
        LOGARITHM,
        &[
            ([1.0, 0.0], 0.0),
            ([0.0, 0.0], -87.336_55),
            ([-3.0, 0.0], -87.336_55),
        ],
    );
    check(
        POWER,
        &[
            ([1.0, 5.0], 1.0),
            ([5.0, 0.0], 1.0),
            ([0.0, 2.0], 0.0),
            ([-1.0, 2.0], 0.0),
            ([0.0, 0.0], 1.0),
            ([0.0, -1.0], max),
            ([2.0, 127.0], 127_f32.exp2()),
            ([2.0, 128.0], max),
            ([2.0, -126.0], f32::MIN_POSITIVE),
            ([2.0, -127.0], 0.0),
            ([max, max], max),
            ([max, -max], 0.0),
            ([4.0, 0.5], 2.0),
        ],
    );
    check(
        APPROACH,
        &[([0.0, 0.0], 0.0), ([32.0, 0.0], 1.0), ([1e6, 0.0], 1.0)],
    );
    check(
        SRGB_ENCODED,
        &[
            ([0.0, 0.0], 0.0),
            ([-1.0, 0.0], 0.0),
            ([1.0, 0.0], 1.0),
            ([9.0, 0.0], 1.0),
        ],
    );
    check(
        SRGB_DECODED,
        &[
            ([0.0, 0.0], 0.0),
            ([-1.0, 0.0], 0.0),
            ([1.0, 0.0], 1.0),
            ([9.0, 0.0], 1.0),
        ],
    );
    check(
        SMOOTH01,
        &[
            ([-1.0, 0.0], 0.0),
            ([0.0, 0.0], 0.0),
            ([0.5, 0.0], 0.5),
            ([1.0, 0.0], 1.0),
            ([7.0, 0.0], 1.0),
        ],
    );
    // Exact at the end, however unlike the two values are.
    check(
        LERP_AT_ONE,
        &[([1e30, 1e-30], 1e-30), ([65_504.0, 6e-8], 6e-8)],
    );
}

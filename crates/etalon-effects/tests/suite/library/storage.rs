//! The roundings of `shaders/lib/storage` against the codec, over every
//! boundary between two numbers of each format.

use crate::common;

use common::{Run, image, texels};
use etalon_core::Format;
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;

const KERNEL: &str = "
import package::lib::storage::{f16_rounded1, ufloat_rounded1, unorm8_loaded1, unorm8_rounded1};

override FUNCTION: u32 = 0u;

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<r32float, write>;

fn value(x: f32) -> f32 {
    switch FUNCTION {
        case 0u: { return f16_rounded1(x); }
        case 1u: { return ufloat_rounded1(x, 17u, 0x477e0000u); }
        case 2u: { return ufloat_rounded1(x, 18u, 0x477c0000u); }
        case 3u: { return unorm8_rounded1(x); }
        default: { return unorm8_loaded1(x); }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = textureDimensions(result);
    if (id.x >= extent.x || id.y >= extent.y) {
        return;
    }
    textureStore(result, id.xy, vec4<f32>(value(textureLoad(source, id.xy, 0).x), 0.0, 0.0, 1.0));
}
";

fn evaluate(function: u32, points: &[f32]) -> Vec<f32> {
    const WIDTH: usize = 512;
    let height = points.len().div_ceil(WIDTH);
    let arguments = image(Format::R32Float, WIDTH as u32, height as u32, |x, y| {
        let value = points
            .get(y as usize * WIDTH + x as usize)
            .copied()
            .unwrap_or(0.0);
        [value, 0.0, 0.0, 0.0]
    });
    let mut run = Run::new();
    run.kernels.add_source("test/rounding", KERNEL);
    let source = run.import("source", &arguments);
    let result = run.graph.texture(
        "result",
        TextureDesc::d2(WIDTH as u32, height as u32, Format::R32Float),
    );
    let result = run
        .graph
        .compute("test/rounding")
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

/// The number that a channel of `format` holds after `value` was stored to it.
fn stored(format: Format, channel: usize, value: f32) -> f32 {
    let mut texel = [0.0; 4];
    texel[channel] = value;
    let mut bytes = [0; 16];
    format.encode(Texel::Float(texel), &mut bytes);
    format.decode(&bytes).to_f32()[channel]
}

/// Each number of the format, the midpoint to the next, and the f32 next to
/// each on either side; both signs if `signed`; and what lies beyond the range.
fn boundaries(numbers: &[f32], signed: bool) -> Vec<f32> {
    let mut points = Vec::new();
    for pair in numbers.windows(2) {
        let middle = ((f64::from(pair[0]) + f64::from(pair[1])) / 2.0) as f32;
        for centre in [pair[0], middle] {
            points.extend([centre.next_down(), centre, centre.next_up()]);
        }
    }
    let last = numbers[numbers.len() - 1];
    points.extend([
        last.next_down(),
        last,
        last.next_up(),
        65_519.0,
        65_520.0,
        1e6,
        f32::MAX,
        1e-30,
    ]);
    if signed {
        points.extend(points.clone().iter().map(|value| -value));
    }
    points
}

#[test]
fn f16_rounds_to_nearest_even() {
    let numbers: Vec<f32> = (0..0x7c00_u16)
        .map(|code| half::f16::from_bits(code).to_f32())
        .collect();
    let points = boundaries(&numbers, true);
    for (&x, value) in points.iter().zip(evaluate(0, &points)) {
        let exact = half::f16::from_f32(x).to_f32();
        // Where IEEE 754 overflows to infinity the library stops at the largest.
        let expected = if exact.is_infinite() {
            65_504.0_f32.copysign(x)
        } else {
            exact
        };
        // -0 and +0 are one number; f32 subnormals may be flushed to either.
        assert_eq!(value, expected, "{x:e}");
        // And it is a number of the format: storing it changes nothing.
        assert_eq!(stored(Format::Rgba16Float, 0, value), value);
    }
}

#[test]
fn small_unsigned_floats_round_to_nearest_even() {
    for (function, channel, bits) in [(1, 0, 6_u32), (2, 2, 5)] {
        // Codes of a float with 5 exponent bits and `bits` mantissa bits are
        // those of an f16 cut short.
        let codes = 0..31_u16 << bits;
        let numbers: Vec<f32> = codes
            .map(|code| half::f16::from_bits(code << (10 - bits)).to_f32())
            .collect();
        let points = boundaries(&numbers, false);
        for (&x, value) in points.iter().zip(evaluate(function, &points)) {
            assert_eq!(
                value,
                stored(Format::Rg11b10Ufloat, channel, x),
                "{bits} bits, {x:e}"
            );
        }
        let negative = [-1e-30, -1.0, -f32::MAX, -0.0];
        assert_eq!(evaluate(function, &negative), [0.0; 4]);
    }
}

#[test]
fn numbers_that_are_none_are_stored_as_numbers() {
    let odd = [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    assert_eq!(evaluate(0, &odd), [0.0, 0.0, 65_504.0, -65_504.0]);
    assert_eq!(evaluate(1, &odd), [0.0, 0.0, 65_024.0, 0.0]);
    assert_eq!(evaluate(2, &odd), [0.0, 0.0, 64_512.0, 0.0]);
}

#[test]
fn unorm8_stores_the_nearest_code_under_any_rounding() {
    let mut points = vec![-1.0, -0.0, 0.0, 1.0, 2.0, f32::MAX, -f32::MAX, 1e-30];
    for code in 0..=255_u32 {
        let at = |value: f64| (value / 255.0) as f32;
        let centres = [at(code.into()), at(f64::from(code) + 0.5)];
        points.extend(
            centres
                .iter()
                .flat_map(|&x| [x.next_down(), x, x.next_up()]),
        );
    }
    for (&x, value) in points.iter().zip(evaluate(3, &points)) {
        let code = (stored(Format::Rgba8Unorm, 0, value) * 255.0).round();
        // Product and sum are each rounded by up to 2^-17 of a step.
        let exact = (f64::from(x) * 255.0).clamp(0.0, 255.0);
        let off = (f64::from(code) - exact).abs();
        assert!(off <= 0.5 + 2.0_f64.powi(-16), "{x:e} is stored as {code}");
        assert_eq!(value, code / 255.0, "{x:e}");
        // A device that cuts off instead of rounding stores the same.
        assert_eq!((f64::from(value) * 255.0).floor() as f32, code, "{x:e}");
    }
}

#[test]
fn unorm8_loads_as_its_exact_fraction() {
    let mut points = Vec::new();
    for code in 0..=255_u16 {
        let exact = f32::from(code) / 255.0;
        // What a device may return: some ulp of 1 to either side.
        points.extend((-4..=4).map(|step| (exact + step as f32 * f32::EPSILON).max(0.0)));
    }
    for (index, value) in evaluate(4, &points).into_iter().enumerate() {
        assert_eq!(value, (index / 9) as f32 / 255.0);
    }
    // Between the fractions nothing moves.
    let between: Vec<f32> = (0..255).map(|code| (code as f32 + 0.25) / 255.0).collect();
    assert_eq!(evaluate(4, &between), between);
}

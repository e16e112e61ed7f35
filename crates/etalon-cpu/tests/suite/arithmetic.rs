//! Operators and built-in functions on numbers against what Rust computes, for
//! operands that are the same in all invocations or not.

use crate::common;

use common::*;

/// Numbers at and around every boundary.
const FLOATS: &[f32] = &[
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    1.5,
    2.5,
    -2.5,
    3.0,
    0.1,
    7.25,
    -7.75,
    100.625,
    1e-3,
    8_388_607.5,
    8_388_609.0,
    16_777_216.0,
    -16_777_217.0,
    2_147_483_500.0,
    2_147_483_648.0,
    -2_147_483_648.0,
    4_294_967_040.0,
    4_294_967_296.0,
    1e20,
    -1e20,
    3.4e38,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-40,
    -1e-45,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    0.999_999_94,
    1.000_000_1,
    std::f32::consts::PI,
];

const INTS: &[u32] = &[
    0,
    1,
    2,
    3,
    5,
    7,
    31,
    32,
    33,
    63,
    100,
    255,
    256,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x1234_5678,
    0x7fff_fffe,
    0x7fff_ffff,
    0x8000_0000,
    0x8000_0001,
    0xdead_beef,
    0xffff_0000,
    0xffff_fffd,
    0xffff_fffe,
    0xffff_ffff,
];

/// Whether two words are the same number; NaNs are all alike.
fn same(a: u32, b: u32, float: bool) -> bool {
    a == b || float && f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan()
}

/// Checks `expression` of `a` and `b`, given as bits, on all pairs of `values`.
fn check(
    expression: &str,
    operand: &str,
    result_is_float: bool,
    values: &[u32],
    expected: impl Fn(u32, u32) -> u32,
) {
    check_if(
        expression,
        operand,
        result_is_float,
        values,
        expected,
        |_, _| true,
    );
}

fn check_if(
    expression: &str,
    operand: &str,
    result_is_float: bool,
    values: &[u32],
    expected: impl Fn(u32, u32) -> u32,
    applies: impl Fn(u32, u32) -> bool,
) {
    let pairs: Vec<(u32, u32)> = values
        .iter()
        .flat_map(|&a| values.iter().map(move |&b| (a, b)))
        .collect();
    let uniform = pairs[pairs.len() / 3];
    let count = pairs.len();
    let wgsl = format!(
        "@group(0) @binding(0) var<storage, read> data: array<u32>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32>;
         fn f(a: {operand}, b: {operand}) -> u32 {{ return bitcast<u32>({expression}); }}
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let i = id.x;
             if i >= {count}u {{ return; }}
             let a = bitcast<{operand}>(data[2u * i]);
             let b = bitcast<{operand}>(data[2u * i + 1u]);
             let ua = bitcast<{operand}>(data[{last}u]);
             let ub = bitcast<{operand}>(data[{last}u + 1u]);
             result[4u * i] = f(a, b);
             result[4u * i + 1u] = f(a, ub);
             result[4u * i + 2u] = f(ua, b);
             result[4u * i + 3u] = f(ua, ub);
         }}",
        last = 2 * count,
    );
    let data: Vec<u32> = pairs
        .iter()
        .copied()
        .chain([uniform])
        .flat_map(|(a, b)| [a, b])
        .collect();
    let result = run_buffers(&wgsl, &data, 4 * count, (count as u32).div_ceil(64));
    for (i, &(a, b)) in pairs.iter().enumerate() {
        for (shape, (a, b)) in [(a, b), (a, uniform.1), (uniform.0, b), uniform]
            .into_iter()
            .enumerate()
        {
            if applies(a, b) {
                let (got, want) = (result[4 * i + shape], expected(a, b));
                assert!(
                    same(got, want, result_is_float),
                    "{expression} with a = {a:#x} ({}), b = {b:#x} ({}), shape {shape}: {got:#x} ({}), not {want:#x} ({})",
                    f32::from_bits(a),
                    f32::from_bits(b),
                    f32::from_bits(got),
                    f32::from_bits(want)
                );
            }
        }
    }
}

fn float_bits() -> Vec<u32> {
    FLOATS.iter().map(|value| value.to_bits()).collect()
}

/// A function from floats to a float.
fn floats_to_float(expression: &str, expected: impl Fn(f32, f32) -> f32) {
    check(expression, "f32", true, &float_bits(), |a, b| {
        expected(f32::from_bits(a), f32::from_bits(b)).to_bits()
    });
}

fn floats_to_int(expression: &str, expected: impl Fn(f32, f32) -> u32) {
    check(expression, "f32", false, &float_bits(), |a, b| {
        expected(f32::from_bits(a), f32::from_bits(b))
    });
}

fn unsigned(expression: &str, expected: impl Fn(u32, u32) -> u32) {
    check(expression, "u32", false, INTS, expected);
}

fn signed(expression: &str, expected: impl Fn(i32, i32) -> i32) {
    check(expression, "i32", false, INTS, |a, b| {
        expected(a as i32, b as i32) as u32
    });
}

#[test]
fn float_operators_are_ieee() {
    floats_to_float("a + b", |a, b| a + b);
    floats_to_float("a - b", |a, b| a - b);
    floats_to_float("a * b", |a, b| a * b);
    floats_to_float("a / b", |a, b| a / b);
    floats_to_float("a % b", |a, b| a - b * (a / b).trunc());
    floats_to_float("-a", |a, _| -a);
    // Rounded twice, never fused.
    floats_to_float("a * b + a", |a, b| a * b + a);
    floats_to_float("a - a * b", |a, b| a - a * b);
    floats_to_float("a * b - b", |a, b| a * b - b);
    floats_to_float("fma(a, b, a)", |a, b| a * b + a);
}

#[test]
fn float_comparisons_are_ieee() {
    for (op, f) in [
        ("==", (|a, b| a == b) as fn(f32, f32) -> bool),
        ("!=", |a, b| a != b),
        ("<", |a, b| a < b),
        ("<=", |a, b| a <= b),
        (">", |a, b| a > b),
        (">=", |a, b| a >= b),
    ] {
        floats_to_int(&format!("select(0u, 1u, a {op} b)"), |a, b| {
            u32::from(f(a, b))
        });
    }
}

#[test]
fn float_functions_are_exact() {
    let min = |a: f32, b: f32| if a < b || b.is_nan() { a } else { b };
    let max = |a: f32, b: f32| if a > b || b.is_nan() { a } else { b };
    floats_to_float("abs(a)", |a, _| a.abs());
    floats_to_float("min(a, b)", min);
    floats_to_float("max(a, b)", max);
    floats_to_float("clamp(a, b, 2.0)", |a, b| min(max(a, b), 2.0));
    floats_to_float("saturate(a)", |a, _| min(max(a, 0.0), 1.0));
    floats_to_float("floor(a)", |a, _| a.floor());
    floats_to_float("ceil(a)", |a, _| a.ceil());
    floats_to_float("trunc(a)", |a, _| a.trunc());
    floats_to_float("round(a)", |a, _| a.round_ties_even());
    floats_to_float("fract(a)", |a, _| a - a.floor());
    floats_to_float("sign(a)", |a, _| {
        if a > 0.0 {
            1.0
        } else if a < 0.0 {
            -1.0
        } else {
            0.0
        }
    });
    floats_to_float("sqrt(a)", |a, _| a.sqrt());
    floats_to_float("inverseSqrt(a)", |a, _| 1.0 / a.sqrt());
    floats_to_float("step(a, b)", |a, b| if a <= b { 1.0 } else { 0.0 });
    floats_to_float("mix(a, b, 0.25)", |a, b| a * 0.75 + b * 0.25);
    floats_to_float("smoothstep(-1.0, b, a)", |a, b| {
        let t = min(max((a + 1.0) / (b + 1.0), 0.0), 1.0);
        t * t * (3.0 - 2.0 * t)
    });
    floats_to_float("radians(a)", |a, _| a * (std::f32::consts::PI / 180.0));
    floats_to_float("degrees(a)", |a, _| a * 57.295_78);
    floats_to_float("select(a, b, a < b)", |a, b| if a < b { b } else { a });
    floats_to_float("quantizeToF16(a)", |a, _| half::f16::from_f32(a).to_f32());
    floats_to_float("modf(a).whole", |a, _| a.trunc());
    floats_to_float("modf(a).fract", |a, _| a - a.trunc());
    floats_to_float("ldexp(a, i32(clamp(b, -50.0, 50.0)))", |a, b| {
        // `max` of NaN and a number is the number.
        let e = if b.is_nan() {
            -50
        } else {
            b.clamp(-50.0, 50.0) as i32
        };
        (f64::from(a) * 2.0_f64.powi(e)) as f32
    });
}

#[test]
fn frexp_takes_numbers_apart() {
    let reference = |a: f32| -> (f32, i32) {
        if a == 0.0 || !a.is_finite() {
            return (a, 0);
        }
        let mut e = 0;
        let mut m = f64::from(a);
        while m.abs() >= 1.0 {
            m /= 2.0;
            e += 1;
        }
        while m.abs() < 0.5 {
            m *= 2.0;
            e -= 1;
        }
        (m as f32, e)
    };
    floats_to_float("frexp(a).fract", |a, _| reference(a).0);
    floats_to_int("frexp(a).exp", |a, _| reference(a).1 as u32);
}

#[test]
fn conversions_saturate() {
    // Not to the largest integer, but to the largest that is also an f32.
    floats_to_int("i32(a)", |a, _| (a as i32).min(2_147_483_520) as u32);
    floats_to_int("u32(a)", |a, _| (a as u32).min(4_294_967_040));
    floats_to_int("u32(bool(a))", |a, _| u32::from(a != 0.0));
    check("f32(a)", "u32", true, INTS, |a, _| (a as f32).to_bits());
    check("f32(a)", "i32", true, INTS, |a, _| {
        (a as i32 as f32).to_bits()
    });
    check("u32(a)", "i32", false, INTS, |a, _| a);
    unsigned("u32(bool(a))", |a, _| u32::from(a != 0));
    unsigned("u32(f32(a == b))", |a, b| u32::from(a == b));
}

#[test]
fn integer_operators_wrap() {
    unsigned("a + b", u32::wrapping_add);
    unsigned("a - b", u32::wrapping_sub);
    unsigned("a * b", u32::wrapping_mul);
    unsigned("a / b", |a, b| a.checked_div(b).unwrap_or(a));
    unsigned("a % b", |a, b| if b == 0 { 0 } else { a % b });
    unsigned("a & b", |a, b| a & b);
    unsigned("a | b", |a, b| a | b);
    unsigned("a ^ b", |a, b| a ^ b);
    unsigned("~a", |a, _| !a);
    unsigned("a << (b & 31u)", |a, b| a << (b & 31));
    unsigned("a >> (b & 31u)", |a, b| a >> (b & 31));
    signed("a + b", i32::wrapping_add);
    signed("a - b", i32::wrapping_sub);
    signed("a * b", i32::wrapping_mul);
    signed("a / b", |a, b| if b == 0 { a } else { a.wrapping_div(b) });
    signed("a % b", |a, b| if b == 0 { 0 } else { a.wrapping_rem(b) });
    signed("-a", |a, _| a.wrapping_neg());
    signed("a >> (u32(b) & 31u)", |a, b| a >> (b & 31));
}

#[test]
fn integer_comparisons_know_signs() {
    for (op, u, s) in [
        (
            "==",
            (|a, b| a == b) as fn(u32, u32) -> bool,
            (|a, b| a == b) as fn(i32, i32) -> bool,
        ),
        ("!=", |a, b| a != b, |a, b| a != b),
        ("<", |a, b| a < b, |a, b| a < b),
        ("<=", |a, b| a <= b, |a, b| a <= b),
        (">", |a, b| a > b, |a, b| a > b),
        (">=", |a, b| a >= b, |a, b| a >= b),
    ] {
        unsigned(&format!("select(0u, 1u, a {op} b)"), |a, b| {
            u32::from(u(a, b))
        });
        signed(&format!("select(0, 1, a {op} b)"), |a, b| {
            i32::from(s(a, b))
        });
    }
}

#[test]
fn integer_functions_are_exact() {
    unsigned("min(a, b)", u32::min);
    unsigned("max(a, b)", u32::max);
    unsigned("clamp(a, b, 1000u)", |a, b| a.max(b).min(1000));
    signed("min(a, b)", i32::min);
    signed("max(a, b)", i32::max);
    signed("clamp(a, b, 1000)", |a, b| a.max(b).min(1000));
    signed("abs(a)", |a, _| a.wrapping_abs());
    signed("sign(a)", |a, _| a.signum());
    unsigned("countLeadingZeros(a)", |a, _| a.leading_zeros());
    unsigned("countTrailingZeros(a)", |a, _| a.trailing_zeros());
    unsigned("countOneBits(a)", |a, _| a.count_ones());
    unsigned("reverseBits(a)", |a, _| a.reverse_bits());
    unsigned("firstLeadingBit(a)", |a, _| {
        if a == 0 {
            u32::MAX
        } else {
            31 - a.leading_zeros()
        }
    });
    unsigned("firstTrailingBit(a)", |a, _| {
        if a == 0 { u32::MAX } else { a.trailing_zeros() }
    });
    signed("firstLeadingBit(a)", |a, _| {
        let bits = if a < 0 { !a } else { a };
        if bits == 0 {
            -1
        } else {
            31 - bits.leading_zeros() as i32
        }
    });
    let field = |value: u64, offset: u32, count: u32| -> (u64, u32) {
        let offset = offset.min(32);
        let count = count.min(32 - offset);
        (value >> offset & ((1_u64 << count) - 1), count)
    };
    unsigned("extractBits(a, b & 63u, (b >> 3u) & 63u)", |a, b| {
        field(a.into(), b & 63, b >> 3 & 63).0 as u32
    });
    signed(
        "extractBits(a, u32(b) & 63u, (u32(b) >> 3u) & 63u)",
        |a, b| {
            let (bits, count) = field((a as u32).into(), b as u32 & 63, b as u32 >> 3 & 63);
            if count == 0 {
                0
            } else {
                ((bits << (64 - count)) as i64 >> (64 - count)) as i32
            }
        },
    );
    unsigned("insertBits(a, b, b & 63u, (a >> 3u) & 63u)", |a, b| {
        let offset = (b & 63).min(32);
        let count = (a >> 3 & 63).min(32 - offset);
        let mask = (((1_u64 << count) - 1) << offset) as u32;
        a & !mask | ((u64::from(b) << offset) as u32 & mask)
    });
}

#[test]
fn packing_is_as_wgsl_defines() {
    let norm = |x: f32, low: f32, scale: f32| {
        (0.5 + scale * if x.is_nan() { low } else { x.clamp(low, 1.0) }).floor() as i32 as u32
    };
    floats_to_int("pack4x8unorm(vec4<f32>(a, b, 0.3, 1.0))", |a, b| {
        [a, b, 0.3, 1.0]
            .iter()
            .enumerate()
            .fold(0, |w, (i, &x)| w | (norm(x, 0.0, 255.0) & 255) << (8 * i))
    });
    floats_to_int("pack4x8snorm(vec4<f32>(a, b, -0.3, 1.0))", |a, b| {
        [a, b, -0.3, 1.0]
            .iter()
            .enumerate()
            .fold(0, |w, (i, &x)| w | (norm(x, -1.0, 127.0) & 255) << (8 * i))
    });
    floats_to_int("pack2x16unorm(vec2<f32>(a, b))", |a, b| {
        norm(a, 0.0, 65535.0) & 0xffff | norm(b, 0.0, 65535.0) << 16
    });
    floats_to_int("pack2x16snorm(vec2<f32>(a, b))", |a, b| {
        norm(a, -1.0, 32767.0) & 0xffff | norm(b, -1.0, 32767.0) << 16
    });
    let values: Vec<u32> = float_bits()
        .into_iter()
        .filter(|&bits| !f32::from_bits(bits).is_nan())
        .collect();
    check(
        "pack2x16float(vec2<f32>(a, b))",
        "f32",
        false,
        &values,
        |a, b| {
            let half = |bits: u32| u32::from(half::f16::from_f32(f32::from_bits(bits)).to_bits());
            half(a) | half(b) << 16
        },
    );
    let byte = |a: u32, b: u32| (a >> (8 * (b & 3))) & 255;
    check("unpack4x8unorm(a)[b & 3u]", "u32", true, INTS, |a, b| {
        (byte(a, b) as f32 / 255.0).to_bits()
    });
    check("unpack4x8snorm(a)[b & 3u]", "u32", true, INTS, |a, b| {
        (byte(a, b) as u8 as i8 as f32 / 127.0).max(-1.0).to_bits()
    });
    let half = |a: u32, b: u32| (a >> (16 * (b & 1))) as u16;
    check("unpack2x16unorm(a)[b & 1u]", "u32", true, INTS, |a, b| {
        (f32::from(half(a, b)) / 65535.0).to_bits()
    });
    check("unpack2x16snorm(a)[b & 1u]", "u32", true, INTS, |a, b| {
        (f32::from(half(a, b) as i16) / 32767.0).max(-1.0).to_bits()
    });
    check("unpack2x16float(a)[b & 1u]", "u32", true, INTS, |a, b| {
        half::f16::from_bits(half(a, b)).to_f32().to_bits()
    });
    unsigned("unpack4xU8(a)[b & 3u]", byte);
    check("unpack4xI8(a)[b & 3u]", "u32", false, INTS, |a, b| {
        byte(a, b) as u8 as i8 as i32 as u32
    });
    unsigned("pack4xU8(vec4<u32>(a, b, 3u, 4u))", |a, b| {
        a & 255 | (b & 255) << 8 | 3 << 16 | 4 << 24
    });
    unsigned("pack4xU8Clamp(vec4<u32>(a, b, 3u, 4u))", |a, b| {
        a.min(255) | b.min(255) << 8 | 3 << 16 | 4 << 24
    });
    unsigned("dot4U8Packed(a, b)", |a, b| {
        (0..4).map(|i| byte(a, i) * byte(b, i)).sum()
    });
    check("dot4I8Packed(a, b)", "u32", false, INTS, |a, b| {
        (0..4)
            .map(|i| i32::from(byte(a, i) as u8 as i8) * i32::from(byte(b, i) as u8 as i8))
            .sum::<i32>() as u32
    });
}

/// Checks a function whose exact value is not representable: the result must be
/// the reference rounded to f32, or a neighbour of that, as the f64 reference
/// is itself not exact.
fn close(expression: &str, reference: impl Fn(f64, f64) -> f64, domain: impl Fn(f32, f32) -> bool) {
    let expected = |a: u32, b: u32| {
        reference(f64::from(f32::from_bits(a)), f64::from(f32::from_bits(b))) as f32
    };
    let near = |got: f32, want: f32| {
        got == want
            || got.is_nan() && want.is_nan()
            || got == want.next_up()
            || got == want.next_down()
    };
    let wgsl_values = float_bits();
    let pairs: Vec<(u32, u32)> = wgsl_values
        .iter()
        .flat_map(|&a| wgsl_values.iter().map(move |&b| (a, b)))
        .collect();
    let wgsl = format!(
        "@group(0) @binding(0) var<storage, read> data: array<f32>;
         @group(0) @binding(1) var<storage, read_write> result: array<f32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             if id.x >= {}u {{ return; }}
             let a = data[2u * id.x];
             let b = data[2u * id.x + 1u];
             result[id.x] = {expression};
         }}",
        pairs.len()
    );
    let data: Vec<u32> = pairs.iter().flat_map(|&(a, b)| [a, b]).collect();
    let result = run_buffers(&wgsl, &data, pairs.len(), (pairs.len() as u32).div_ceil(64));
    for (&(a, b), &got) in pairs.iter().zip(&result) {
        let (a, b, got, want) = (
            f32::from_bits(a),
            f32::from_bits(b),
            f32::from_bits(got),
            expected(a, b),
        );
        assert!(
            !domain(a, b) || near(got, want),
            "{expression} with a = {a}, b = {b}: {got}, not {want}"
        );
    }
}

#[test]
fn transcendental_functions_are_accurate() {
    let any = |_: f32, _: f32| true;
    close("exp(a)", |a, _| a.exp(), any);
    close("exp2(a)", |a, _| a.exp2(), any);
    close("log(a)", |a, _| a.ln(), any);
    close("log2(a)", |a, _| a.log2(), any);
    close("sin(a)", |a, _| a.sin(), any);
    close("cos(a)", |a, _| a.cos(), any);
    close("tan(a)", |a, _| a.tan(), any);
    close("asin(a)", |a, _| a.asin(), any);
    close("acos(a)", |a, _| a.acos(), any);
    close("atan(a)", |a, _| a.atan(), any);
    close("atan2(a, b)", f64::atan2, any);
    close("sinh(a)", |a, _| a.sinh(), any);
    close("cosh(a)", |a, _| a.cosh(), any);
    close("tanh(a)", |a, _| a.tanh(), any);
    close("asinh(a)", |a, _| a.asinh(), any);
    close("acosh(a)", |a, _| a.acosh(), any);
    close("atanh(a)", |a, _| a.atanh(), any);
    // WGSL's pow is exp2(b * log2(a)): not defined for negative a as libm's is.
    close("pow(a, b)", f64::powf, |a, b| {
        a > 0.0 && a.is_finite() && b.is_finite()
    });
}

#[test]
fn vectors_and_matrices_follow_their_definitions() {
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<f32>;
        @group(0) @binding(1) var<storage, read_write> result: array<f32>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            let i = id.x * 12u;
            let a = vec3<f32>(data[i], data[i + 1u], data[i + 2u]);
            let b = vec3<f32>(data[i + 3u], data[i + 4u], data[i + 5u]);
            let m = mat2x3<f32>(a, b);
            let n = mat3x2<f32>(data[i + 6u], data[i + 7u], data[i + 8u], data[i + 9u], data[i + 10u], data[i + 11u]);
            let o = id.x * 40u;
            result[o] = dot(a, b);
            result[o + 1u] = length(a);
            result[o + 2u] = distance(a, b);
            let c = cross(a, b);
            let r = reflect(a, b);
            let t = refract(a, b, 0.5);
            let f = faceForward(a, b, c.yzx);
            let z = normalize(a);
            for (var k = 0u; k < 3u; k++) {
                result[o + 3u + k] = c[k];
                result[o + 6u + k] = r[k];
                result[o + 9u + k] = t[k];
                result[o + 12u + k] = f[k];
                result[o + 15u + k] = z[k];
            }
            let p = m * n;         // mat3x3
            for (var k = 0; k < 9; k++) { result[o + 18u + u32(k)] = p[k / 3][k % 3]; }
            let v = m * vec2<f32>(0.5, 2.0);
            let w = a * m;
            result[o + 27u] = v.x; result[o + 28u] = v.y; result[o + 29u] = v.z;
            result[o + 30u] = w.x; result[o + 31u] = w.y;
            result[o + 32u] = determinant(p);
            result[o + 33u] = transpose(m)[1][0] + transpose(m)[2][1] * 2.0;
            let s = (a + b.zyx * 2.0 - 1.0) / vec3<f32>(2.0, 4.0, 8.0);
            result[o + 34u] = s.x; result[o + 35u] = s.y; result[o + 36u] = s.z;
            result[o + 37u] = select(0.0, 1.0, any(a < b));
            result[o + 38u] = select(0.0, 1.0, all(a < b));
            result[o + 39u] = (p * 2.0 + p - p)[2][1];
        }";
    let value = |i: u32| ((i.wrapping_mul(2_654_435_761) >> 16) as f32 / 32768.0) - 1.0;
    let data: Vec<f32> = (0..64 * 12).map(value).collect();
    let bits: Vec<u32> = data.iter().map(|v| v.to_bits()).collect();
    let result = run_buffers(wgsl, &bits, 64 * 40, 1);
    for (lane, d) in data.chunks(12).enumerate() {
        let (a, b) = ([d[0], d[1], d[2]], [d[3], d[4], d[5]]);
        let n = [[d[6], d[7]], [d[8], d[9]], [d[10], d[11]]];
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let c: [f32; 3] = std::array::from_fn(|i| {
            a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]
        });
        let along = dot(b, a);
        let k = 1.0 - 0.25 * (1.0 - along * along);
        let length = dot(a, a).sqrt();
        let difference: [f32; 3] = std::array::from_fn(|i| a[i] - b[i]);
        let p: [[f32; 3]; 3] = std::array::from_fn(|col| {
            std::array::from_fn(|row| a[row] * n[col][0] + b[row] * n[col][1])
        });
        let mut want = vec![dot(a, b), length, dot(difference, difference).sqrt()];
        want.extend(c);
        want.extend((0..3).map(|i| a[i] - b[i] * (2.0 * along)));
        want.extend((0..3).map(|i| {
            if k < 0.0 {
                0.0
            } else {
                a[i] * 0.5 - b[i] * (0.5 * along + k.sqrt())
            }
        }));
        want.extend((0..3).map(|i| {
            if dot(b, [c[1], c[2], c[0]]) < 0.0 {
                a[i]
            } else {
                -a[i]
            }
        }));
        want.extend((0..3).map(|i| a[i] / length));
        want.extend(p.iter().flatten());
        want.extend((0..3).map(|i| a[i] * 0.5 + b[i] * 2.0));
        want.extend([dot(a, a), dot(a, b)]);
        let minor = |r: usize, q: usize| p[1][r] * p[2][q] - p[1][q] * p[2][r];
        want.push(p[0][0] * minor(1, 2) - p[0][1] * minor(0, 2) + p[0][2] * minor(0, 1));
        want.push(a[1] + b[2] * 2.0);
        let scale = [2.0, 4.0, 8.0];
        want.extend((0..3).map(|i| (a[i] + b[2 - i] * 2.0 - 1.0) / scale[i]));
        want.push(if (0..3).any(|i| a[i] < b[i]) {
            1.0
        } else {
            0.0
        });
        want.push(if (0..3).all(|i| a[i] < b[i]) {
            1.0
        } else {
            0.0
        });
        want.push(p[2][1] * 2.0 + p[2][1] - p[2][1]);
        for (i, want) in want.into_iter().enumerate() {
            let got = f32::from_bits(result[lane * 40 + i]);
            assert!(
                got == want || got.is_nan() && want.is_nan(),
                "lane {lane}, result {i}: {got}, not {want}"
            );
        }
    }
}

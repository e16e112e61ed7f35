//! `f16`: every operation is rounded to binary16 once, against f64.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Buffer};

fn value(bits: u16) -> f64 {
    half::f16::from_bits(bits).to_f64()
}

/// The nearest binary16, ties to even, found by bisecting all of them.
fn nearest(x: f64) -> u16 {
    let sign = if x.is_sign_negative() { 0x8000 } else { 0 };
    let magnitude = x.abs();
    if magnitude.is_nan() {
        return 0x7e00;
    }
    // Half way between the largest finite number and 2^16.
    if magnitude >= 65520.0 {
        return sign | 0x7c00;
    }
    let (mut low, mut high) = (0_u16, 0x7c00_u16);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if value(middle) <= magnitude {
            low = middle;
        } else {
            high = middle;
        }
    }
    let above = if high == 0x7c00 { 65536.0 } else { value(high) };
    let (down, up) = (magnitude - value(low), above - magnitude);
    let up = up < down || (up == down && low % 2 == 1);
    sign | if up { high } else { low }
}

fn same(got: u16, want: u16) -> bool {
    got == want || (value(got).is_nan() && value(want).is_nan())
}

/// Special and arbitrary numbers.
fn numbers() -> Vec<u16> {
    let special = [
        0x0000, 0x8000, 0x0001, 0x8001, 0x03ff, 0x0400, 0x0401, 0x3c00, 0xbc00, 0x3bff, 0x3c01,
        0x3555, 0x4000, 0x4248, 0x7bff, 0xfbff, 0x7c00, 0xfc00, 0x7e00, 0x6800, 0x5640,
    ];
    special
        .into_iter()
        .chain((0..43_u32).map(|i| (i.wrapping_mul(0x9e37_79b1) >> 16) as u16))
        .collect()
}

/// Binds bytes as binding 0 and the result as binding 1, on every executor.
fn run(wgsl: &str, data: &[u8], bytes: u64, workgroups: u32) -> Vec<u8> {
    let program = program(wgsl);
    let input = Buffer::from_bytes(data).unwrap();
    let mut first: Option<Vec<u8>> = None;
    for (name, executor) in executors() {
        let result = Buffer::zeroed(bytes).unwrap();
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(if binding.binding == 0 {
                    &input
                } else {
                    &result
                })
            })
            .collect();
        program
            .dispatch(&executor, [workgroups, 1, 1], &bound)
            .unwrap_or_else(|error| panic!("{error}\n{program}"));
        let got = result.to_bytes().unwrap();
        let same = first.as_ref().is_none_or(|first| {
            first.len() == got.len()
                && halves(first).iter().zip(halves(&got)).all(|(&a, b)| {
                    // The sign and payload of a NaN are nobody's promise.
                    a == b || is_nan(a) && is_nan(b)
                })
        });
        assert!(same, "{name}");
        first = Some(got);
    }
    first.unwrap()
}

fn is_nan(half: u16) -> bool {
    half & 0x7fff > 0x7c00
}

fn halves(bytes: &[u8]) -> Vec<u16> {
    bytes
        .chunks_exact(2)
        .map(|b| u16::from_le_bytes([b[0], b[1]]))
        .collect()
}

fn bytes(halves: &[u16]) -> Vec<u8> {
    halves.iter().flat_map(|half| half.to_le_bytes()).collect()
}

/// Evaluates expressions of `a` and `b` for all pairs of numbers.
fn evaluate(expressions: &[&str]) -> Vec<(u16, u16, Vec<u16>)> {
    let numbers = numbers();
    let pairs: Vec<u16> = numbers
        .iter()
        .flat_map(|&a| numbers.iter().flat_map(move |&b| [a, b]))
        .collect();
    let count = pairs.len() / 2;
    let stores: String = expressions
        .iter()
        .enumerate()
        .map(|(i, e)| format!("result[at + {i}u] = {e};\n"))
        .collect();
    let wgsl = format!(
        "enable f16;
         @group(0) @binding(0) var<storage, read> data: array<vec2<f16>>;
         @group(0) @binding(1) var<storage, read_write> result: array<f16>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let a = data[id.x].x;
             let b = data[id.x].y;
             let at = id.x * {}u;
             {stores}
         }}",
        expressions.len()
    );
    let size = (count * expressions.len() * 2) as u64;
    let got = halves(&run(&wgsl, &bytes(&pairs), size, count.div_ceil(64) as u32));
    pairs
        .chunks(2)
        .zip(got.chunks(expressions.len()))
        .map(|(pair, got)| (pair[0], pair[1], got.to_vec()))
        .collect()
}

/// An expression, and what it is of two numbers.
type Case = (&'static str, fn(f64, f64) -> f64);

#[test]
fn basic_operations_are_rounded_once() {
    let cases: [Case; 12] = [
        ("a + b", |a, b| a + b),
        ("a - b", |a, b| a - b),
        ("a * b", |a, b| a * b),
        ("a / b", |a, b| a / b),
        ("sqrt(abs(a))", |a, _| a.abs().sqrt()),
        ("-a", |a, _| -a),
        ("abs(a)", |a, _| a.abs()),
        ("floor(a)", |a, _| a.floor()),
        ("ceil(a)", |a, _| a.ceil()),
        ("trunc(a)", |a, _| a.trunc()),
        ("round(a)", |a, _| a.round_ties_even()),
        ("select(a, b, a < b)", |a, b| if a < b { b } else { a }),
    ];
    let texts = cases.map(|(text, _)| text);
    for (a, b, got) in evaluate(&texts) {
        for ((text, reference), got) in cases.iter().zip(got) {
            let want = nearest(reference(value(a), value(b)));
            assert!(
                same(got, want),
                "{text}, a = {}, b = {}: {got:#x}, not {want:#x}",
                value(a),
                value(b)
            );
        }
    }
}

#[test]
fn the_reference_notices_double_rounding() {
    // 1 + 2^-11 + 2^-30 is above half way between two numbers; binary32 has
    // no room for the last bit, so that rounding twice goes down.
    let exact = 1.0 + 2.0_f64.powi(-11) + 2.0_f64.powi(-30);
    assert_eq!(nearest(exact), 0x3c01);
    assert_eq!(nearest(f64::from(exact as f32)), 0x3c00);
    for bits in (0..0x7c00_u16).chain(0x8000..0xfc00) {
        assert_eq!(nearest(value(bits)), bits);
    }
}

#[test]
fn each_operation_of_a_function_is_rounded() {
    let r = |x: f64| value(nearest(x));
    let max = |a: f64, b: f64| if a > b { a } else { b };
    let min = |a: f64, b: f64| if a < b { a } else { b };
    let expressions = [
        "fma(a, b, a)",
        "mix(a, b, 0.25h)",
        "dot(vec2(a, b), vec2(b, 3.5h))",
        "(mat2x2(a, b, 2.0h, 1.5h) * vec2(b, a)).y",
        "determinant(mat2x2(a, b, 2.0h, 1.5h))",
        "clamp(a, 0.5h, 2.0h)",
        "a * b + 1.0h",
        "length(vec2(a, b))",
    ];
    for (a_bits, b_bits, got) in evaluate(&expressions) {
        let (a, b) = (value(a_bits), value(b_bits));
        let want = [
            // The product is exact in binary32, which the sum is rounded to first.
            f64::from((a * b + a) as f32),
            r(r(a * 0.75) + r(b * 0.25)),
            r(r(a * b) + r(b * 3.5)),
            r(r(b * b) + r(1.5 * a)),
            r(r(a * 1.5) - r(b * 2.0)),
            min(max(a, 0.5), 2.0),
            r(r(a * b) + 1.0),
            r(r(r(a * a) + r(b * b)).sqrt()),
        ];
        for ((text, got), want) in expressions.iter().zip(got).zip(want) {
            // WGSL leaves clamp of a NaN open.
            if a.is_nan() && text.starts_with("clamp") {
                continue;
            }
            let want = nearest(want);
            assert!(
                same(got, want),
                "{text}, a = {a}, b = {b}: {} ({got:#x}), not {} ({want:#x})",
                value(got),
                value(want)
            );
        }
    }
}

#[test]
fn functions_are_within_a_unit_of_f64() {
    let cases: [Case; 18] = [
        ("sin(a)", |a, _| a.sin()),
        ("cos(a)", |a, _| a.cos()),
        ("tan(a)", |a, _| a.tan()),
        ("asin(a)", |a, _| a.asin()),
        ("acos(a)", |a, _| a.acos()),
        ("atan(a)", |a, _| a.atan()),
        ("atan2(a, b)", f64::atan2),
        ("sinh(a)", |a, _| a.sinh()),
        ("cosh(a)", |a, _| a.cosh()),
        ("tanh(a)", |a, _| a.tanh()),
        ("exp(a)", |a, _| a.exp()),
        ("exp2(a)", |a, _| a.exp2()),
        ("log(abs(a))", |a, _| a.abs().ln()),
        ("log2(abs(a))", |a, _| a.abs().log2()),
        ("pow(abs(a), b)", |a, b| a.abs().powf(b)),
        ("fract(a)", |a, _| a - a.floor()),
        ("ldexp(a, 3)", |a, _| a * 8.0),
        ("ldexp(a, -12)", |a, _| a / 4096.0),
    ];
    let texts = cases.map(|(text, _)| text);
    for (a, b, got) in evaluate(&texts) {
        for ((text, reference), got) in cases.iter().zip(got) {
            let exact = reference(value(a), value(b));
            // WGSL has no powers of 0 to 0 or of infinities, nor NaN.
            let pow = text.starts_with("pow")
                && (value(a) == 0.0 || !value(a).is_finite() || !value(b).is_finite());
            if pow || value(a).is_nan() || value(b).is_nan() {
                continue;
            }
            let want = nearest(exact);
            // What binary32 gives is within a unit of its own, so the result is
            // the nearest number or, next to half way, its neighbour.
            let near = got.abs_diff(want) <= 1;
            assert!(
                same(got, want) || near,
                "{text}, a = {}, b = {}: {}, not {}",
                value(a),
                value(b),
                value(got),
                value(want)
            );
        }
    }
}

#[test]
fn fractions_are_split_off() {
    let expressions = [
        "a / frexp(a).fract",
        "frexp(a).fract",
        "modf(a).fract",
        "modf(a).whole",
    ];
    for (a, _, got) in evaluate(&expressions) {
        let x = value(a);
        if !x.is_finite() {
            continue;
        }
        let (power, fraction) = (value(got[0]), value(got[1]).abs());
        if x == 0.0 {
            assert_eq!(fraction, 0.0);
        } else {
            assert!((0.5..1.0).contains(&fraction), "{x}: {fraction}");
            // From 32768 on the power of two is beyond binary16.
            assert!(
                power == f64::INFINITY || power.log2().fract() == 0.0,
                "{x}: {power}"
            );
        }
        assert_eq!(value(got[2]), x - x.trunc(), "{x}");
        assert_eq!(value(got[3]), x.trunc(), "{x}");
    }
}

#[test]
fn conversions_round_and_truncate() {
    let floats = [
        0.0_f32,
        -0.0,
        1.0,
        65504.0,
        65519.9,
        65520.0,
        -70000.0,
        1.0 / 3.0,
        1.0 + 1.0 / 2048.0,
        1.0 + 3.0 / 2048.0,
        5.0e-8,
        2.0e-8,
        f32::INFINITY,
        f32::NAN,
        2049.0,
        2051.0,
    ];
    let integers = [
        0_i32,
        1,
        -1,
        2049,
        2051,
        -2051,
        65519,
        65520,
        100_000,
        i32::MAX,
        i32::MIN,
        4097,
    ];
    let mut data = [0_u32; 64];
    for (word, x) in data.iter_mut().zip(floats) {
        *word = x.to_bits();
    }
    for (word, x) in data[16..].iter_mut().zip(integers) {
        *word = x as u32;
    }
    let wgsl = "enable f16;
        @group(0) @binding(0) var<storage, read> data: array<u32>;
        struct Out { h: vec4<f16>, f: f32, i: i32, u: u32, b: u32 }
        @group(0) @binding(1) var<storage, read_write> result: array<Out>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32) {
            let x = bitcast<f32>(data[i]);
            let h = f16(x);
            result[i].h = vec4(h, f16(bitcast<i32>(data[i])), f16(data[i]), f16(data[i] > 7u));
            result[i].f = f32(h);
            result[i].i = i32(h);
            result[i].u = u32(h);
            result[i].b = u32(bool(h));
        }";
    let input: Vec<u8> = data.iter().flat_map(|word| word.to_le_bytes()).collect();
    let got = run(wgsl, &input, 64 * 24, 1);
    for (word, out) in data.into_iter().zip(got.chunks(24)) {
        let h = halves(&out[..8]);
        let word_at =
            |at: usize| u32::from_le_bytes([out[at], out[at + 1], out[at + 2], out[at + 3]]);
        let x = f32::from_bits(word);
        let want = nearest(f64::from(x));
        assert!(same(h[0], want), "{x}: {:#x}, not {want:#x}", h[0]);
        assert_eq!(h[1], nearest(f64::from(word as i32)), "{}", word as i32);
        assert_eq!(h[2], nearest(f64::from(word)), "{word}");
        assert_eq!(h[3], if word > 7 { 0x3c00 } else { 0 });
        let v = value(h[0]);
        let f = f64::from(f32::from_bits(word_at(8)));
        assert!(f == v || (f.is_nan() && v.is_nan()));
        // Infinities become the largest numbers that f16 has as well.
        let (i, u) = ((v as i32).clamp(-65504, 65504), (v as u32).min(65504));
        assert_eq!(word_at(12) as i32, i, "{v}");
        assert_eq!(word_at(16), u, "{v}");
        assert_eq!(word_at(20), u32::from(v != 0.0), "{v}");
    }
}

#[test]
fn memory_is_laid_out_as_wgsl_says() {
    // WGSL §14.4.1: f16 takes 2 bytes, vec3<f16> 6 aligned to 8, columns of
    // three 8, of two 4.
    let wgsl = "enable f16;
        struct Inner { a: f16, b: array<f16, 2> }
        struct S {
            a: f16,                    // 0
            b: vec3<f16>,              // 8
            c: f16,                    // 14
            m: mat3x3<f16>,            // 16
            n: mat2x2<f16>,            // 40
            arr: array<f16, 5>,        // 48
            e: f32,                    // 60
            inner: array<Inner, 3>,    // 64, 6 bytes each
            v: vec2<f16>,              // 84
        }                              // 88
        @group(0) @binding(0) var<storage, read> data: array<S>;
        struct T { values: array<f16, 40> }
        @group(0) @binding(1) var<storage, read_write> result: array<T>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) w: vec3<u32>) {
            let s = w.x;
            if i >= 40u { return; }
            var x = 0.0h;
            if i == 0u { x = data[s].a; }
            else if i < 4u { x = data[s].b[i - 1u]; }
            else if i == 4u { x = data[s].c; }
            else if i < 14u { x = data[s].m[(i - 5u) / 3u][(i - 5u) % 3u]; }
            else if i < 18u { x = data[s].n[(i - 14u) / 2u][(i - 14u) % 2u]; }
            else if i < 23u { x = data[s].arr[i - 18u]; }
            else if i == 23u { x = f16(data[s].e); }
            else if i < 33u {
                let k = (i - 24u) / 3u;
                let j = (i - 24u) % 3u;
                if j == 0u { x = data[s].inner[k].a; } else { x = data[s].inner[k].b[j - 1u]; }
            }
            else if i < 35u { x = data[s].v[i - 33u]; }
            result[s].values[i] = x;
        }";
    // The bytes that each of the results comes from.
    let mut from = vec![0_usize, 8, 10, 12, 14];
    from.extend((0..9).map(|i| 16 + i / 3 * 8 + i % 3 * 2));
    from.extend((0..4).map(|i| 40 + i * 2));
    from.extend((0..5).map(|i| 48 + i * 2));
    from.push(60);
    from.extend((0..9).map(|i| 64 + i * 2));
    from.extend([84, 86]);
    let structs = 3;
    let mut data: Vec<u8> = (0..88 * structs)
        .map(|i: usize| ((i * 97 + 31) % 251) as u8 & 0x3f)
        .collect();
    for s in 0..structs {
        data[88 * s + 60..88 * s + 64].copy_from_slice(&(1.5_f32 + s as f32).to_le_bytes());
    }
    let got = halves(&run(wgsl, &data, 80 * structs as u64, structs as u32));
    for s in 0..structs {
        for (i, &from) in from.iter().enumerate() {
            let at = 88 * s + from;
            let want = if from == 60 {
                nearest(1.5 + s as f64)
            } else {
                u16::from_le_bytes([data[at], data[at + 1]])
            };
            assert_eq!(got[40 * s + i], want, "struct {s}, value {i}");
        }
        assert_eq!(&got[40 * s + from.len()..40 * s + 40], [0; 5]);
    }
}

#[test]
fn stores_leave_the_other_half_alone() {
    // All invocations write neighbouring halves, every third nothing.
    let wgsl = "enable f16;
        @group(0) @binding(0) var<storage, read> data: array<f16>;
        struct Column { v: vec3<f16>, tail: f16 }
        @group(0) @binding(1) var<storage, read_write> result: array<Column>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            let i = id.x;
            if i % 3u == 0u { return; }
            if i % 4u == 3u { result[i / 4u].tail = data[i]; } else { result[i / 4u].v[i % 4u] = data[i]; }
        }";
    let count = 64 * 40_u32;
    let data: Vec<u16> = (0..count).map(|i| (i * 7 % 30000) as u16 + 1).collect();
    let got = halves(&run(wgsl, &bytes(&data), u64::from(count) * 2, 40));
    for (i, got) in got.into_iter().enumerate() {
        assert_eq!(got, if i % 3 == 0 { 0 } else { data[i] }, "{i}");
    }
}

#[test]
fn variables_uniforms_and_workgroup_memory_hold_them() {
    let wgsl = "enable f16;
        struct U { scale: vec4<f16>, m: mat2x4<f16> }
        @group(0) @binding(0) var<uniform> u: U;
        @group(0) @binding(1) var<storage, read_write> result: array<f16>;
        var<workgroup> shared_values: array<f16, 64>;
        const table = array<f16, 5>(0.5h, 1.5h, -2.0h, 8.0h, 0.1h);
        fn add(p: ptr<function, f16>, x: f16) { *p += x; }
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32) {
            var values = array<f16, 3>(1.0h, 2.0h, 3.0h);
            values[i % 3u] = table[i % 5u];
            add(&values[1], u.scale[i % 4u]);
            shared_values[i] = values[i % 3u] + values[1];
            workgroupBarrier();
            result[i] = shared_values[63u - i] * u.m[i % 2u][i / 2u % 4u];
        }";
    let uniform: Vec<u16> = (0..12).map(|i| nearest(0.3 * f64::from(i) - 1.0)).collect();
    let got = halves(&run(wgsl, &bytes(&uniform), 128, 1));
    let r = |x: f64| value(nearest(x));
    let table = [0.5, 1.5, -2.0, 8.0, r(0.1)];
    let shared = |i: usize| {
        let mut values = [1.0, 2.0, 3.0];
        values[i % 3] = table[i % 5];
        values[1] = r(values[1] + value(uniform[i % 4]));
        r(values[i % 3] + values[1])
    };
    for (i, got) in got.into_iter().enumerate() {
        let want = nearest(shared(63 - i) * value(uniform[4 + i % 2 * 4 + i / 2 % 4]));
        assert_eq!(got, want, "{i}");
    }
}

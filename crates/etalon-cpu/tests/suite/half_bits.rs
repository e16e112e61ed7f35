//! `f16` by its bits: every one of the 65536 numbers, in every number type,
//! against the crate `half` and `f64`.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Buffer, NumberType, TranslateError};
use half::f16;

/// `results` words for each `f16` that there is, on every executor and in every
/// number type. `code` computes `r`, an array of words, from `h`.
fn of_all(results: usize, code: &str) -> Vec<(f16, Vec<u32>)> {
    let wgsl = format!(
        "enable f16; enable wgpu_int16;
         @group(0) @binding(0) var<storage, read> data: array<f16>;
         @group(0) @binding(1) var<storage, read_write> result: array<array<u32, {results}>>;
         fn word(h: f16) -> u32 {{ return pack2x16float(vec2(f32(h), 0.0)); }}
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let h = data[id.x];
             var r: array<u32, {results}>;
             {code}
             result[id.x] = r;
         }}"
    );
    let program = program(&wgsl);
    let numbers: Vec<f16> = (0..=u16::MAX).map(f16::from_bits).collect();
    let bytes: Vec<u8> = numbers
        .iter()
        .flat_map(|h| h.to_bits().to_le_bytes())
        .collect();
    let input = Buffer::from_bytes(&bytes).unwrap();
    let mut first: Option<Vec<u32>> = None;
    for number_type in NumberType::ALL {
        for (name, executor) in executors() {
            let output = Buffer::zeroed((4 * results * numbers.len()) as u64).unwrap();
            let bound: Vec<BoundResource<'_>> = program
                .bindings()
                .iter()
                .map(|binding| {
                    BoundResource::Buffer(if binding.binding == 0 {
                        &input
                    } else {
                        &output
                    })
                })
                .collect();
            let executor = executor.with_number_type(number_type);
            program
                .dispatch(&executor, [1024, 1, 1], &bound)
                .unwrap_or_else(|error| panic!("{error}\n{program}"));
            let got = words(&output);
            let first = first.get_or_insert_with(|| got.clone());
            for (at, (a, b)) in first.iter().zip(&got).enumerate() {
                let (h, result) = (at / results, at % results);
                assert!(
                    a == b || (is_nan(*a) && is_nan(*b)),
                    "result {result} of {h:#06x} in {number_type}, {name}: {a:#x} and {b:#x}"
                );
            }
        }
    }
    let got = first.unwrap();
    let results = got.chunks(results).map(<[u32]>::to_vec);
    numbers.into_iter().zip(results).collect()
}

/// Whether the word is that of an `f16` that is NaN.
fn is_nan(word: u32) -> bool {
    word & !0x8000 > 0x7c00 && word <= 0xffff
}

/// The bits of an `f16`; a NaN is a quiet one.
fn bits(h: f16) -> u32 {
    u32::from(if h.is_nan() {
        h.to_bits() | 0x200
    } else {
        h.to_bits()
    })
}

fn rounded(x: f64) -> u32 {
    bits(f16::from_f64(x))
}

fn same(got: u32, want: u32) -> bool {
    got == want || is_nan(got) && is_nan(want)
}

#[test]
fn bit_casts_keep_every_bit() {
    let code = "
        let u = bitcast<u16>(h);
        let i = bitcast<i16>(h);
        let v = bitcast<vec3<u16>>(vec3(0.5h, h, -h));
        r[0] = u32(u);
        r[1] = u32(i32(i));
        r[2] = word(bitcast<f16>(u));
        r[3] = word(bitcast<f16>(i));
        r[4] = word(bitcast<f16>(h));
        r[5] = word(bitcast<vec4<f16>>(vec4(h, 1.0h, 2.0h, h)).w);
        r[6] = u32(v.y);
        r[7] = u32(v.z);
        r[8] = u32(u32(bitcast<i16>(u)) == u32(i32(i)) && u32(bitcast<u16>(i)) == u32(u));
        r[9] = u32(i < bitcast<i16>(1.0h));";
    for (h, got) in of_all(10, code) {
        let want = bits(h);
        let signed = i32::from(want as u16 as i16);
        assert_eq!(got[0], want, "{h:?}");
        assert_eq!(got[1], signed as u32, "{h:?}");
        assert_eq!(got[2..7], [want; 5], "{h:?}");
        assert_eq!(got[7], want ^ 0x8000, "{h:?}");
        assert_eq!(got[8], 1, "{h:?}");
        assert_eq!(got[9], u32::from(signed < 0x3c00), "{h:?}");
    }
}

#[test]
fn numbers_come_apart_and_together_again() {
    let code = "
        let apart = frexp(h);
        let parts = frexp(vec2(1.0h, h));
        let split = modf(h);
        r[0] = word(apart.fract);
        r[1] = u32(i32(apart.exp));
        r[2] = word(ldexp(apart.fract, i32(apart.exp)));
        r[3] = u32(i32(parts.exp.y));
        r[4] = word(split.fract);
        r[5] = word(split.whole);
        r[6] = word(f16(apart.exp));";
    for (h, got) in of_all(7, code) {
        let x = h.to_f64();
        let (fraction, exponent) = if x == 0.0 || !x.is_finite() {
            (x, 0)
        } else {
            // Every f16 is a normal f64.
            let exponent = (x.to_bits() >> 52 & 0x7ff) as i32 - 1022;
            (x / 2.0_f64.powi(exponent), exponent)
        };
        assert!(same(got[0], rounded(fraction)), "{h:?}: {:#x}", got[0]);
        assert_eq!(got[1] as i32, exponent, "{h:?}");
        assert!(same(got[2], bits(h)), "{h:?}: {:#x}", got[2]);
        assert_eq!(got[3] as i32, exponent, "{h:?}");
        assert!(same(got[4], rounded(x - x.trunc())), "{h:?}: {:#x}", got[4]);
        assert!(same(got[5], rounded(x.trunc())), "{h:?}: {:#x}", got[5]);
        assert_eq!(got[6], rounded(f64::from(exponent)), "{h:?}");
    }
}

#[test]
fn powers_of_two_are_multiplied_with_one_rounding() {
    let exponents = [-60, -30, -25, -24, -14, -10, -1, 0, 1, 5, 16, 29, 40, 60];
    let code: String = exponents
        .iter()
        .enumerate()
        .map(|(at, exponent)| format!("r[{at}] = word(ldexp(h, {exponent}i));\n"))
        .collect();
    for (h, got) in of_all(exponents.len(), &code) {
        for (&exponent, got) in exponents.iter().zip(got) {
            let want = rounded(h.to_f64() * 2.0_f64.powi(exponent));
            assert!(
                same(got, want),
                "{h:?}, {exponent}: {got:#x}, not {want:#x}"
            );
        }
    }
}

#[test]
fn functions_that_are_exact_are_so_of_every_number() {
    type Case = (&'static str, fn(f64) -> f64);
    let cases: [Case; 14] = [
        ("-h", |x| -x),
        ("abs(h)", f64::abs),
        ("floor(h)", f64::floor),
        ("ceil(h)", f64::ceil),
        ("trunc(h)", f64::trunc),
        ("round(h)", f64::round_ties_even),
        ("fract(h)", |x| x - x.floor()),
        ("sqrt(h)", f64::sqrt),
        ("sign(h)", |x| {
            if x > 0.0 {
                1.0
            } else if x < 0.0 {
                -1.0
            } else {
                0.0
            }
        }),
        ("saturate(h)", |x| if x > 0.0 { x.min(1.0) } else { 0.0 }),
        ("h + h", |x| x + x),
        ("h * h", |x| x * x),
        ("1.0h / h", |x| 1.0 / x),
        ("h - 0.333h", |x| x - f16::from_f64(0.333).to_f64()),
    ];
    let code: String = cases
        .iter()
        .enumerate()
        .map(|(at, (text, _))| format!("r[{at}] = word({text});\n"))
        .collect();
    for (h, got) in of_all(cases.len(), &code) {
        for ((text, exact), got) in cases.iter().zip(got) {
            let want = rounded(exact(h.to_f64()));
            let zeros = got | want == 0x8000 || got | want == 0;
            // The sign of zero is looked at where IEEE 754 says what it is.
            let open = zeros && matches!(*text, "sign(h)" | "saturate(h)");
            assert!(
                same(got, want) || open,
                "{text} of {h:?}: {got:#x}, not {want:#x}"
            );
        }
    }
}

#[test]
fn integers_of_16_bits_are_for_nothing_else() {
    let refused = |declaration: &str, code: &str| {
        let wgsl = format!(
            "enable f16; enable wgpu_int16;
             @group(0) @binding(0) var<storage, read_write> data: array<f16>;
             {declaration}
             @compute @workgroup_size(1) fn main() {{ let h = data[0]; {code} }}"
        );
        match translate(&wgsl) {
            Err(TranslateError::Unsupported { construct, .. }) => construct,
            other => panic!("{code}: {:?}", other.map(|program| program.to_string())),
        }
    };
    for (declaration, code, says) in [
        (
            "",
            "data[1] = bitcast<f16>(bitcast<u16>(h) + bitcast<u16>(h));",
            "arithmetic on 16-bit",
        ),
        (
            "",
            "data[1] = bitcast<f16>(-bitcast<i16>(h));",
            "arithmetic on 16-bit",
        ),
        (
            "",
            "data[1] = bitcast<f16>(min(frexp(h).exp, bitcast<i16>(h)));",
            "arithmetic on 16-bit",
        ),
        (
            "",
            "data[1] = bitcast<f16>(u16(f32(h)));",
            "conversions to 16-bit",
        ),
        (
            "@group(0) @binding(1) var<storage, read_write> short: array<i16>;",
            "short[0] = bitcast<i16>(h);",
            "in buffers",
        ),
    ] {
        let construct = refused(declaration, code);
        assert!(construct.contains(says), "{code}: {construct}");
    }
}

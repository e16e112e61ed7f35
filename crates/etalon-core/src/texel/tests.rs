//! The codec against independent arithmetic: the `half` crate, values built
//! from the formats' definitions in `f64`, and exhaustive searches.

use super::*;
use crate::format::StorageSupport;

/// Encodes one value into every channel and returns the codes.
fn codes_of(format: Format, value: f32) -> TexelCodes {
    format.encode_codes(Texel::Float([value; 4]))
}

/// Decodes a code put into the first channel.
fn first(format: Format, code: u32) -> f32 {
    format
        .decode_codes(TexelCodes {
            channels: [code, 0, 0, 0],
            exponent: 0,
        })
        .to_f32()[0]
}

/// The value of an unsigned small float, from its definition.
fn ufloat_value(code: u32, mantissa_bits: u32) -> f64 {
    let exponent = code >> mantissa_bits;
    let mantissa = f64::from(code & ((1 << mantissa_bits) - 1)) / f64::from(1 << mantissa_bits);
    match exponent {
        0 => mantissa * 2_f64.powi(-14),
        31 if mantissa == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + mantissa) * 2_f64.powi(exponent as i32 - 15),
    }
}

#[test]
fn every_half_decodes_as_the_half_crate_says_and_encodes_back() {
    for code in 0..=u16::MAX {
        let decoded = first(Format::R16Float, code.into());
        let expected = half::f16::from_bits(code);
        if expected.is_nan() {
            assert!(decoded.is_nan(), "{code:#06x}");
        } else {
            assert_eq!(
                decoded.to_bits(),
                expected.to_f32().to_bits(),
                "{code:#06x}"
            );
        }
        assert_eq!(
            codes_of(Format::R16Float, decoded).channels[0],
            u32::from(code),
            "{code:#06x}"
        );
    }
}

#[test]
fn halves_round_as_the_half_crate_does() {
    // Around every half value: its neighbours in f32, the midpoint to the next
    // half and the neighbours of that.
    let check = |value: f32| {
        let expected = half::f16::from_f32(value);
        let actual = codes_of(Format::R16Float, value).channels[0];
        assert_eq!(
            actual,
            u32::from(expected.to_bits()),
            "{value:e} {:#010x}",
            value.to_bits()
        );
    };
    for code in 0..0x7c00_u16 {
        let value = half::f16::from_bits(code).to_f32();
        let next = half::f16::from_bits((code + 1).min(0x7bff)).to_f32();
        let midpoint = value + (next - value) * 0.5;
        for bits in [value.to_bits(), midpoint.to_bits()] {
            for near in [bits.saturating_sub(1), bits, bits + 1] {
                check(f32::from_bits(near));
                check(-f32::from_bits(near));
            }
        }
    }
    // The midpoint between the largest half and the next step overflows.
    assert_eq!(codes_of(Format::R16Float, 65519.996).channels[0], 0x7bff);
    assert_eq!(codes_of(Format::R16Float, 65520.0).channels[0], 0x7c00);
    assert_eq!(codes_of(Format::R16Float, f32::MAX).channels[0], 0x7c00);
    assert_eq!(
        codes_of(Format::R16Float, f32::NEG_INFINITY).channels[0],
        0xfc00
    );
    assert_eq!(codes_of(Format::R16Float, f32::from_bits(1)).channels[0], 0);
    assert_eq!(codes_of(Format::R16Float, -0.0).channels[0], 0x8000);
}

#[test]
fn a_signalling_nan_with_a_low_payload_stays_nan() {
    for bits in [0x7f80_0001, 0xff80_0001, 0x7fc0_0000] {
        for format in [Format::R16Float, Format::Rg11b10Ufloat, Format::R32Float] {
            assert!(
                format
                    .decode_codes(codes_of(format, f32::from_bits(bits)))
                    .to_f32()[0]
                    .is_nan(),
                "{format} {bits:#x}"
            );
        }
    }
}

#[test]
fn every_small_float_decodes_by_definition_and_encodes_back() {
    for (channel, mantissa_bits, count) in [(0, 6, 2048), (1, 6, 2048), (2, 5, 1024)] {
        for code in 0..count {
            let mut codes = TexelCodes::default();
            codes.channels[channel] = code;
            let texel = Format::Rg11b10Ufloat.decode_codes(codes);
            let decoded = texel.to_f32()[channel];
            let expected = ufloat_value(code, mantissa_bits);
            assert!(
                f64::from(decoded) == expected || decoded.is_nan() && expected.is_nan(),
                "{code:#x}"
            );
            assert_eq!(
                Format::Rg11b10Ufloat.encode_codes(texel),
                codes,
                "{code:#x}"
            );
        }
    }
}

#[test]
fn small_floats_round_to_nearest_even_and_clamp_as_the_specification_says() {
    for (channel, mantissa_bits, largest) in [(0, 6, 65024.0_f32), (2, 5, 64512.0)] {
        let encode = |value: f32| codes_of(Format::Rg11b10Ufloat, value).channels[channel];
        let infinity = 31 << mantissa_bits;
        for code in 0..infinity - 1 {
            let (low, high) = (
                ufloat_value(code, mantissa_bits),
                ufloat_value(code + 1, mantissa_bits),
            );
            let midpoint = ((low + high) / 2.0) as f32;
            let even = if code % 2 == 0 { code } else { code + 1 };
            assert_eq!(encode(midpoint), even, "midpoint above {low}");
            assert_eq!(
                encode(f32::from_bits(midpoint.to_bits() - 1)),
                code,
                "below the midpoint above {low}"
            );
            assert_eq!(
                encode(f32::from_bits(midpoint.to_bits() + 1)),
                code + 1,
                "above the midpoint above {low}"
            );
        }
        assert_eq!(encode(largest), infinity - 1);
        for (value, code) in [
            (largest + 1.0, infinity - 1),
            (f32::MAX, infinity - 1),
            (f32::INFINITY, infinity),
            (f32::NEG_INFINITY, 0),
            (-1.0, 0),
            (-0.0, 0),
        ] {
            assert_eq!(encode(value), code, "{value}");
        }
        assert!(encode(f32::NAN) > infinity);
        assert!(encode(-f32::NAN) > infinity);
    }
}

#[test]
fn every_normalised_and_integer_code_encodes_back() {
    for &format in Format::ALL {
        if matches!(
            format.encoding(),
            Encoding::Float | Encoding::Ufloat | Encoding::SharedExponent
        ) {
            continue;
        }
        for (channel, &bits) in format.channel_bits().iter().enumerate() {
            // All codes up to 16 bits; the ends and the signs' border above.
            let codes: Vec<u32> = if bits <= 16 {
                (0..1 << bits).collect()
            } else {
                [
                    0,
                    1,
                    2,
                    0x7fff_fffe,
                    0x7fff_ffff,
                    0x8000_0000,
                    0x8000_0001,
                    u32::MAX,
                ]
                .to_vec()
            };
            for code in codes {
                let mut expected = TexelCodes::default();
                expected.channels[channel] = code;
                let back = format.encode_codes(format.decode_codes(expected));
                // −1 has two codes; stores use the smaller magnitude.
                if format.encoding() == Encoding::Snorm && code == 1 << (bits - 1) {
                    assert_eq!(back.channels[channel], code + 1, "{format}");
                    assert_eq!(format.ulps(back, expected), [0; 4], "{format}");
                } else {
                    assert_eq!(back, expected, "{format} channel {channel}");
                }
            }
        }
    }
}

#[test]
fn float_codes_encode_back_bit_for_bit() {
    for bits in [
        0,
        1,
        0x8000_0000,
        0x3f80_0000,
        0x7f7f_ffff,
        0x7f80_0000,
        0x7f80_0001,
        0xffc1_2345,
        0x0080_0000,
    ] {
        for format in [
            Format::R32Float,
            Format::Rg32Float,
            Format::Rgba32Float,
            Format::Depth32Float,
        ] {
            let mut codes = TexelCodes::default();
            codes.channels[0] = bits;
            assert_eq!(
                format.encode_codes(format.decode_codes(codes)),
                codes,
                "{format} {bits:#010x}"
            );
        }
    }
}

#[test]
fn normalised_values_clamp_and_round_to_nearest_even() {
    let encode = |format, value| codes_of(format, value).channels[0];
    for format in [
        Format::Rgba8Unorm,
        Format::Rgba8UnormSrgb,
        Format::Bgra8Unorm,
        Format::Rgb10a2Unorm,
        Format::Depth16Unorm,
    ] {
        let largest = (1 << format.channel_bits()[0]) - 1;
        for (value, code) in [
            (-1.0, 0),
            (-0.0, 0),
            (2.0, largest),
            (f32::INFINITY, largest),
            (f32::NEG_INFINITY, 0),
            (f32::NAN, 0),
        ] {
            assert_eq!(encode(format, value), code, "{format} {value}");
        }
    }
    // One half is the one midpoint that f32 holds exactly: (2^n − 1) / 2 lies
    // between the odd 2^(n−1) − 1 and the even 2^(n−1).
    assert_eq!(encode(Format::R8Unorm, 0.5), 128);
    assert_eq!(encode(Format::R8Unorm, 0.5 - f32::EPSILON), 127);
    assert_eq!(encode(Format::Depth16Unorm, 0.5), 32768);
    assert_eq!(
        codes_of(Format::Rgb10a2Unorm, 0.5).channels,
        [512, 512, 512, 2]
    );
    for (value, code) in [
        (0.5, 64_i8),
        (-0.5, -64),
        (1.5, 127),
        (-1.5, -127),
        (f32::NAN, 0),
        (f32::NEG_INFINITY, -127),
    ] {
        assert_eq!(
            encode(Format::R8Snorm, value),
            u32::from(code as u8),
            "{value}"
        );
    }
    // Away from midpoints, against rounding of the exact product.
    for code in 0..255_u32 {
        let border = (f64::from(code) + 0.5) / 255.0;
        assert_eq!(encode(Format::R8Unorm, (border - 1e-6) as f32), code);
        assert_eq!(encode(Format::R8Unorm, (border + 1e-6) as f32), code + 1);
    }
}

#[test]
fn unorm_decodes_to_the_nearest_f32() {
    for code in 0..=255_u32 {
        assert_eq!(
            first(Format::R8Unorm, code),
            (f64::from(code) / 255.0) as f32
        );
    }
    for code in -128..=127_i32 {
        let expected = (f64::from(code) / 127.0).max(-1.0) as f32;
        assert_eq!(first(Format::R8Snorm, code as u32 & 255), expected);
    }
}

#[test]
fn srgb_meets_published_values_and_is_monotone() {
    // Mid grey: 0.5 encodes to 188, 0.2140… is linear for 0.5 (IEC 61966-2-1).
    assert_eq!(
        codes_of(Format::Rgba8UnormSrgb, 0.5).channels,
        [188, 188, 188, 128]
    );
    assert!((srgb_to_linear(0.5) - 0.214_041_140_482_232_55).abs() < 1e-15);
    // The two branches meet at the knee; the constants are rounded to 4 digits
    // of 0.04045, so they meet to 4e-8.
    assert!((srgb_to_linear(0.04045) - srgb_to_linear(0.040_450_001)).abs() < 4e-8);
    let decoded: Vec<f32> = (0..256)
        .map(|code| first(Format::Rgba8UnormSrgb, code))
        .collect();
    assert!(decoded.windows(2).all(|pair| pair[0] < pair[1]));
    assert_eq!((decoded[0], decoded[255]), (0.0, 1.0));
    assert!(linear_to_srgb(f64::NAN).is_nan());
}

#[test]
fn integers_clamp_and_other_kinds_convert() {
    let code = |format: Format, texel| format.encode_codes(texel).channels[0];
    assert_eq!(code(Format::R8Uint, Texel::Uint([300; 4])), 255);
    assert_eq!(code(Format::R8Uint, Texel::Sint([-1; 4])), 0);
    assert_eq!(code(Format::R8Sint, Texel::Sint([-300; 4])), 0x80);
    assert_eq!(code(Format::R16Sint, Texel::Sint([40_000; 4])), 0x7fff);
    assert_eq!(
        code(Format::R32Sint, Texel::Uint([u32::MAX; 4])),
        0x7fff_ffff
    );
    assert_eq!(
        code(Format::R32Uint, Texel::Float([f32::INFINITY; 4])),
        u32::MAX
    );
    assert_eq!(code(Format::R32Uint, Texel::Float([f32::NAN; 4])), 0);
    assert_eq!(code(Format::R8Uint, Texel::Float([2.5; 4])), 2);
    assert_eq!(code(Format::R8Uint, Texel::Float([3.5; 4])), 4);
    assert_eq!(
        code(Format::R32Float, Texel::Uint([16_777_217; 4])),
        16_777_216_f32.to_bits()
    );
    assert_eq!(Format::R8Sint.decode(&[0xff]), Texel::Sint([-1, 0, 0, 1]));
    assert_eq!(
        Format::Rg16Uint.decode(&[1, 0, 0, 1]),
        Texel::Uint([1, 256, 0, 1])
    );
}

#[test]
fn shared_exponents_follow_the_specification() {
    let decode = |codes| Format::Rgb9e5Ufloat.decode_codes(codes).to_f32();
    let encode =
        |red, green, blue| Format::Rgb9e5Ufloat.encode_codes(Texel::Float([red, green, blue, 1.0]));
    // Every mantissa under every exponent keeps its value, alone and next to
    // the largest mantissa, where its code must come back too.
    for exponent in 0..32 {
        for mantissa in 0..512 {
            let codes = TexelCodes {
                channels: [mantissa, 0, 511, 0],
                exponent,
            };
            let expected = f64::from(mantissa) * 2_f64.powi(exponent as i32 - 24);
            let values = decode(codes);
            assert_eq!(f64::from(values[0]), expected);
            assert_eq!(encode(values[0], values[1], values[2]), codes);
            let alone = decode(TexelCodes {
                channels: [mantissa, 0, 0, 0],
                exponent,
            });
            assert_eq!(decode(encode(alone[0], 0.0, 0.0)), alone);
        }
    }
    assert_eq!(
        decode(encode(f32::NAN, -1.0, f32::NEG_INFINITY)),
        [0.0, 0.0, 0.0, 1.0]
    );
    assert_eq!(
        decode(encode(f32::INFINITY, 1e9, 65408.0)),
        [65408.0, 65408.0, 65408.0, 1.0]
    );
    // 511.5 steps round up to 512, which takes the next exponent; halves round up.
    assert_eq!(
        encode(511.5, 0.0, 0.0),
        TexelCodes {
            channels: [256, 0, 0, 0],
            exponent: 25
        }
    );
    assert_eq!(
        encode(511.0, 2.5, 0.49),
        TexelCodes {
            channels: [511, 3, 0, 0],
            exponent: 24
        }
    );
    // Zero and values far below the smallest step.
    assert_eq!(encode(0.0, 0.0, 1e-30), TexelCodes::default());
}

#[test]
fn bytes_lie_where_webgpu_and_vulkan_put_them() {
    let bytes = |format: Format, texel| {
        let mut out = vec![0; format.texel_bytes() as usize];
        format.encode(texel, &mut out);
        out
    };
    let colour = Texel::Float([1.0, 0.0, 0.2, 0.6]);
    assert_eq!(bytes(Format::Rgba8Unorm, colour), [255, 0, 51, 153]);
    assert_eq!(bytes(Format::Bgra8Unorm, colour), [51, 0, 255, 153]);
    let word = |format, texel| u32::from_le_bytes(bytes(format, texel).try_into().unwrap());
    assert_eq!(
        word(Format::Rgb10a2Unorm, Texel::Float([1.0, 0.0, 0.0, 0.0])),
        0x3ff
    );
    assert_eq!(
        word(Format::Rgb10a2Unorm, Texel::Float([0.0, 0.0, 0.0, 1.0])),
        0xc000_0000
    );
    // 1.0 is exponent 15, mantissa 0.
    assert_eq!(
        word(Format::Rg11b10Ufloat, Texel::Float([1.0, 0.0, 0.0, 1.0])),
        15 << 6
    );
    assert_eq!(
        word(Format::Rg11b10Ufloat, Texel::Float([0.0, 1.0, 0.0, 1.0])),
        15 << 17
    );
    assert_eq!(
        word(Format::Rg11b10Ufloat, Texel::Float([0.0, 0.0, 1.0, 1.0])),
        15 << 27
    );
    // 1.0 is 256 / 512 · 2^(16 − 15).
    assert_eq!(
        word(Format::Rgb9e5Ufloat, Texel::Float([0.0, 1.0, 0.0, 1.0])),
        16 << 27 | 256 << 9
    );
    assert_eq!(
        bytes(Format::R16Float, Texel::Float([1.0; 4])),
        [0x00, 0x3c]
    );
}

#[test]
fn short_and_long_slices_are_safe() {
    for &format in Format::ALL {
        let size = format.texel_bytes() as usize;
        for length in 0..size + 3 {
            let given = vec![0xa5; length];
            let mut padded = given.clone();
            padded.resize(size, 0);
            assert_eq!(format.codes(&given), format.codes(&padded), "{format}");
            let mut out = vec![0x5a; length];
            format.encode(Texel::Float([0.0; 4]), &mut out);
            assert!(
                out.iter().skip(size).all(|&byte| byte == 0x5a),
                "{format} wrote past its texel"
            );
        }
    }
}

#[test]
fn missing_channels_read_zero_and_one() {
    for &format in Format::ALL {
        let texel = format.decode(&[0; 16]).to_f64();
        let present = format.channels() as usize;
        let expected = [0.0, 0.0, 0.0, 1.0];
        assert_eq!(texel[present..], expected[present..], "{format}");
    }
}

#[test]
fn field_widths_fill_the_texel() {
    for &format in Format::ALL {
        let shared = if format == Format::Rgb9e5Ufloat { 5 } else { 0 };
        assert_eq!(
            format.channel_bits().iter().sum::<u32>() + shared,
            format.texel_bytes() * 8,
            "{format}"
        );
        assert_eq!(
            format.channel_bits().len(),
            format.channels() as usize,
            "{format}"
        );
        // What kernels may store to has no rule of its own beyond rounding.
        assert!(
            format.storage() == StorageSupport::None
                || format.encoding() != Encoding::SharedExponent,
            "{format}"
        );
    }
}

fn one_channel(code: u32) -> TexelCodes {
    TexelCodes {
        channels: [code, 0, 0, 0],
        exponent: 0,
    }
}

fn ulps_between(format: Format, a: f32, b: f32) -> u64 {
    format.ulps(codes_of(format, a), codes_of(format, b))[0]
}

#[test]
fn ulps_count_representable_steps_of_halves_and_small_floats() {
    // All finite halves sorted by value: neighbours are one apart, save for
    // the two zeros, which are equal.
    let mut halves: Vec<u16> = (0..=u16::MAX)
        .filter(|&code| half::f16::from_bits(code).is_finite())
        .collect();
    halves.sort_by(|&a, &b| half::f16::from_bits(a).total_cmp(&half::f16::from_bits(b)));
    for pair in halves.windows(2) {
        let zeros = half::f16::from_bits(pair[0]).to_f32() == 0.0
            && half::f16::from_bits(pair[1]).to_f32() == 0.0;
        let distance =
            Format::R16Float.ulps(one_channel(pair[0].into()), one_channel(pair[1].into()))[0];
        assert_eq!(distance, u64::from(!zeros), "{pair:?}");
    }
    let (lowest, highest) = (halves[0].into(), halves[halves.len() - 1].into());
    assert_eq!(
        Format::R16Float.ulps(one_channel(lowest), one_channel(highest))[0],
        halves.len() as u64 - 2
    );
    for code in 0..(31 << 6) - 1 {
        assert_eq!(
            Format::Rg11b10Ufloat.ulps(one_channel(code), one_channel(code + 1))[0],
            1
        );
    }
}

#[test]
fn ulps_of_single_precision_see_subnormals_as_zero() {
    let step = |value: f32| f32::from_bits(value.to_bits() + 1);
    for value in [1.0, 1.5e30, 3.0e-30, f32::MIN_POSITIVE] {
        assert_eq!(ulps_between(Format::R32Float, value, step(value)), 1);
        assert_eq!(ulps_between(Format::R32Float, -value, -step(value)), 1);
    }
    let subnormal = f32::from_bits(0x007f_ffff);
    for zero in [0.0, -0.0, subnormal, -subnormal, f32::from_bits(1)] {
        assert_eq!(ulps_between(Format::R32Float, zero, 0.0), 0);
        assert_eq!(ulps_between(Format::R32Float, zero, f32::MIN_POSITIVE), 1);
        assert_eq!(ulps_between(Format::R32Float, zero, -f32::MIN_POSITIVE), 1);
    }
    assert_eq!(ulps_between(Format::R32Float, 1.0, 2.0), 1 << 23);
    assert_eq!(
        ulps_between(Format::R32Float, -f32::MIN_POSITIVE, f32::MIN_POSITIVE),
        2
    );
}

#[test]
fn non_finite_values_are_infinitely_far_from_others() {
    for format in [Format::R16Float, Format::R32Float, Format::Rg11b10Ufloat] {
        assert_eq!(ulps_between(format, f32::NAN, -f32::NAN), 0, "{format}");
        assert_eq!(
            ulps_between(format, f32::INFINITY, f32::INFINITY),
            0,
            "{format}"
        );
        for number in [0.0, 1.0, 60000.0] {
            assert_eq!(
                ulps_between(format, f32::NAN, number),
                INFINITE_ULPS,
                "{format}"
            );
            assert_eq!(
                ulps_between(format, number, f32::INFINITY),
                INFINITE_ULPS,
                "{format}"
            );
        }
        assert_eq!(
            ulps_between(format, f32::NAN, f32::INFINITY),
            INFINITE_ULPS,
            "{format}"
        );
        assert!(format.is_non_finite(0, codes_of(format, f32::NAN).channels[0]));
        assert!(format.is_non_finite(0, codes_of(format, f32::INFINITY).channels[0]));
        assert!(!format.is_non_finite(0, codes_of(format, 1.0).channels[0]));
    }
    assert_eq!(
        ulps_between(Format::R32Float, f32::INFINITY, f32::NEG_INFINITY),
        INFINITE_ULPS
    );
}

#[test]
fn ulps_of_integers_and_normalised_channels_are_code_differences() {
    let sint = |value| Format::R32Sint.encode_codes(Texel::Sint([value; 4]));
    assert_eq!(
        Format::R32Sint.ulps(sint(i32::MIN), sint(i32::MAX))[0],
        u64::from(u32::MAX)
    );
    assert_eq!(
        Format::R8Snorm.ulps(one_channel(0xff), one_channel(0x01))[0],
        2
    );
    assert_eq!(
        Format::R8Snorm.ulps(one_channel(0x80), one_channel(0x81))[0],
        0
    );
    assert_eq!(
        Format::Rgba8Unorm.ulps(one_channel(3), one_channel(250)),
        [247, 0, 0, 0]
    );
}

#[test]
fn ulps_of_shared_exponents_use_the_larger_step_and_never_hide_a_difference() {
    let codes = |mantissa, exponent| TexelCodes {
        channels: [mantissa, 0, 0, 0],
        exponent,
    };
    let ulps = |a, b| Format::Rgb9e5Ufloat.ulps(a, b)[0];
    assert_eq!(ulps(codes(7, 20), codes(9, 20)), 2);
    assert_eq!(ulps(codes(256, 20), codes(128, 21)), 0);
    assert_eq!(ulps(codes(257, 20), codes(128, 21)), 1);
    assert_eq!(ulps(codes(511, 31), codes(0, 0)), 511);
}

//! Faults planted into images: each must be found, measured and placed.

use etalon_core::Format;
use etalon_core::image::{ImageData, TexelPosition};
use etalon_core::resource::{Dimension, Extent, TextureDesc};
use etalon_core::texel::Texel;

use super::*;

/// A smooth image of positive values, different in every texel and channel.
fn smooth(desc: TextureDesc) -> ImageData {
    let mut image = ImageData::zeroed(desc).unwrap();
    for mip in 0..desc.mips {
        for TexelPosition { mip, layer, y, x } in desc.positions(mip).collect::<Vec<_>>() {
            let base =
                0.1 + x as f32 * 0.01 + y as f32 * 0.003 + layer as f32 * 0.05 + mip as f32 * 0.2;
            let texel = Texel::Float([base, base * 1.5, base * 0.7, 0.9]);
            image.set_texel(x, y, layer, mip, texel).unwrap();
        }
    }
    image
}

fn rgba16() -> ImageData {
    smooth(TextureDesc::d2(64, 48, Format::Rgba16Float))
}

/// Compares and judges, expecting both to be possible.
fn judge(
    tolerance: &Tolerance,
    reference: &ImageData,
    subject: &ImageData,
) -> (Comparison, Verdict) {
    let comparison = compare(reference, subject).unwrap();
    let verdict = tolerance.judge(&comparison, reference, subject).unwrap();
    (comparison, verdict)
}

/// An image with every texel changed by a function.
fn changed(image: &ImageData, change: impl Fn([f32; 4]) -> [f32; 4]) -> ImageData {
    let texels: Vec<_> = image
        .to_rgba_f32()
        .unwrap()
        .into_iter()
        .map(change)
        .collect();
    ImageData::from_rgba_f32(image.desc, &texels).unwrap()
}

#[test]
fn identical_images_pass_with_all_figures_at_zero() {
    for format in [
        Format::Rgba16Float,
        Format::R32Float,
        Format::Rg11b10Ufloat,
        Format::Rgba8Unorm,
        Format::R32Uint,
    ] {
        let image = smooth(TextureDesc::d2(32, 16, format));
        let (comparison, verdict) = judge(&Tolerance::BitEqual, &image, &image.clone());
        assert_eq!(verdict, Verdict::Pass);
        assert!(comparison.same_bits);
        assert_eq!(
            (comparison.max_ulp, comparison.mean_ulp, comparison.max_abs),
            (Ulps(0), 0.0, 0.0)
        );
        assert_eq!(
            (
                comparison.texels,
                comparison.differing_texels,
                comparison.worst
            ),
            (512, 0, None)
        );
        assert!(comparison.flip.mean().is_none_or(|mean| mean == 0.0));
    }
}

#[test]
fn one_ulp_in_one_texel_is_found_and_placed() {
    let desc = TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 16,
            height: 8,
            depth_or_layers: 3,
        },
        mips: 4,
        format: Format::Rgba16Float,
    };
    let reference = smooth(desc);
    let mut subject = reference.clone();
    let (position, channel) = (
        TexelPosition {
            mip: 2,
            layer: 1,
            y: 1,
            x: 3,
        },
        2,
    );
    let offset = subject
        .offset(position.x, position.y, position.layer, position.mip)
        .unwrap()
        + channel * 2;
    subject.bytes[offset] ^= 1;
    let (comparison, verdict) = judge(&Tolerance::BitEqual, &reference, &subject);
    assert!(!verdict.passed());
    assert!(!comparison.same_bits);
    let worst = comparison.worst.unwrap();
    assert_eq!(
        (worst.position, worst.channel, worst.ulps),
        (position, channel, Ulps(1))
    );
    assert_eq!(comparison.differing_texels, 1);
    assert!((comparison.differing_share * comparison.texels as f64 - 1.0).abs() < 1e-12);
    assert!((comparison.mean_ulp - 1.0 / (comparison.texels as f64 * 4.0)).abs() < 1e-15);
    assert_eq!(comparison.max_abs, (worst.reference - worst.subject).abs());
    assert!(
        judge(&Tolerance::ulps(1, "for the test"), &reference, &subject)
            .1
            .passed()
    );
}

#[test]
fn one_texel_of_noise_is_found() {
    let reference = rgba16();
    let mut subject = reference.clone();
    subject
        .set_texel(63, 47, 0, 0, Texel::Float([5.0, 0.1, 0.2, 0.3]))
        .unwrap();
    let (comparison, verdict) = judge(&Tolerance::ulps(64, "for the test"), &reference, &subject);
    assert!(!verdict.passed());
    assert_eq!(comparison.differing_texels, 1);
    assert_eq!(
        comparison.worst.unwrap().position,
        TexelPosition {
            mip: 0,
            layer: 0,
            y: 47,
            x: 63
        }
    );
    assert!(comparison.flip.mean().unwrap() > 0.0);
}

#[test]
fn a_constant_changed_in_its_eleventh_digit_is_found() {
    // 1 + 2^-10 is one step of a half just above a power of two, half a step
    // just below one, so some texels change, by one step.
    let reference = rgba16();
    let subject = changed(&reference, |texel| {
        texel.map(|value| value * (1.0 + 1.0 / 1024.0))
    });
    let (comparison, verdict) = judge(&Tolerance::BitEqual, &reference, &subject);
    assert!(!verdict.passed());
    assert!(
        comparison.max_ulp >= Ulps(1) && comparison.max_ulp <= Ulps(2),
        "{}",
        comparison.max_ulp
    );
    assert!(
        comparison.differing_share > 0.5,
        "{}",
        comparison.differing_share
    );
}

#[test]
fn swapped_channels_are_found() {
    let reference = rgba16();
    let subject = changed(&reference, |[red, green, blue, alpha]| {
        [blue, green, red, alpha]
    });
    let (comparison, verdict) = judge(
        &Tolerance::absolute(0.01, "for the test"),
        &reference,
        &subject,
    );
    assert!(!verdict.passed());
    assert_eq!(comparison.differing_share, 1.0);
    assert!(
        comparison.flip.mean().unwrap() > 0.05,
        "{:?}",
        comparison.flip
    );
}

#[test]
fn other_sizes_and_formats_are_refused() {
    let reference = rgba16();
    for desc in [
        TextureDesc::d2(48, 64, Format::Rgba16Float),
        TextureDesc::d2(64, 48, Format::Rg32Float),
        TextureDesc::d2(64, 48, Format::Rgba16Float).with_mips(2),
    ] {
        let error = compare(&reference, &smooth(desc)).unwrap_err();
        assert_eq!(
            error,
            CompareError::Description {
                reference: reference.desc,
                subject: desc
            }
        );
        assert!(error.to_string().contains("64×48"), "{error}");
    }
    let mut short = reference.clone();
    short.bytes.pop();
    assert!(matches!(
        compare(&reference, &short),
        Err(CompareError::Incomplete { actual: 24575, .. })
    ));
}

#[test]
fn a_nan_in_one_image_is_never_tolerated() {
    let reference = rgba16();
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut subject = reference.clone();
        subject
            .set_texel(5, 6, 0, 0, Texel::Float([0.1, value, 0.1, 1.0]))
            .unwrap();
        for tolerance in [
            Tolerance::BitEqual,
            Tolerance::ulps(u64::MAX, "for the test"),
            Tolerance::absolute(f64::INFINITY, "for the test").with_outliers(1.0),
        ] {
            let (comparison, verdict) = judge(&tolerance, &reference, &subject);
            assert!(
                matches!(&verdict, Verdict::Fail(why) if why.contains("NaN or infinity")),
                "{verdict:?}"
            );
            assert_eq!(
                (
                    comparison.non_finite_reference,
                    comparison.non_finite_subject
                ),
                (0, 1)
            );
            assert_eq!(
                (comparison.max_ulp, comparison.max_abs),
                (Ulps::INFINITE, f64::INFINITY)
            );
            let json = serde_json::to_value(&comparison).unwrap();
            assert_eq!(json["max_ulp"], "infinite");
            assert!(json["worst"]["subject"].is_string(), "{json}");
        }
        // In both, they are counted and equal.
        let (comparison, verdict) = judge(&Tolerance::BitEqual, &subject, &subject);
        assert!(verdict.passed());
        assert_eq!(
            (
                comparison.non_finite_reference,
                comparison.non_finite_subject
            ),
            (1, 1)
        );
    }
}

#[test]
fn flushed_subnormals_and_signs_of_zeros_are_equal_but_not_the_same_bits() {
    let desc = TextureDesc::d2(2, 1, Format::R32Float);
    let image = |values: [f32; 2]| {
        ImageData::from_rgba_f32(desc, &values.map(|value| [value, 0.0, 0.0, 1.0])).unwrap()
    };
    let (comparison, verdict) = judge(
        &Tolerance::BitEqual,
        &image([f32::from_bits(77), 0.0]),
        &image([0.0, -0.0]),
    );
    assert!(verdict.passed());
    assert!(!comparison.same_bits);
    assert_eq!((comparison.max_ulp, comparison.max_abs), (Ulps(0), 0.0));
}

#[test]
fn outliers_are_counted_against_their_share() {
    let reference = rgba16();
    let mut subject = reference.clone();
    for x in 0..3 {
        subject
            .set_texel(x, 0, 0, 0, Texel::Float([9.0; 4]))
            .unwrap();
    }
    let share = 3.0 / (64.0 * 48.0);
    let limit = || Tolerance::absolute(0.5, "for the test");
    assert!(
        judge(&limit().with_outliers(share), &reference, &subject)
            .1
            .passed()
    );
    let (_, verdict) = judge(&limit().with_outliers(share * 0.9), &reference, &subject);
    assert!(matches!(verdict, Verdict::Fail(why) if why.starts_with("3 texels (0.098 %) not")));
    assert_eq!(
        texels_with(&reference, &subject, |_, difference| difference.absolute()
            > 0.5),
        Ok(3)
    );
    assert!(
        !judge(
            &Tolerance::BitEqual.with_outliers(1.0),
            &reference,
            &subject
        )
        .1
        .passed()
    );
    assert!(
        !judge(
            &Tolerance::absolute(f64::NAN, "for the test"),
            &reference,
            &subject
        )
        .1
        .passed()
    );
}

#[test]
fn relative_limits_grow_with_the_value() {
    let desc = TextureDesc::d2(2, 1, Format::R32Float);
    let image = |values: [f32; 2]| {
        ImageData::from_rgba_f32(desc, &values.map(|value| [value, 0.0, 0.0, 1.0])).unwrap()
    };
    let tolerance = |relative, absolute| Tolerance::Within {
        limit: Limit::Relative { relative, absolute },
        outliers: 0.0,
        reason: "for the test".into(),
    };
    let (reference, subject) = (image([1000.0, 0.0]), image([1001.0, 0.01]));
    assert!(
        judge(&tolerance(0.001, 0.01), &reference, &subject)
            .1
            .passed()
    );
    assert!(
        !judge(&tolerance(0.0009, 0.01), &reference, &subject)
            .1
            .passed()
    );
    assert!(
        !judge(&tolerance(0.001, 0.009), &reference, &subject)
            .1
            .passed()
    );
    assert!(
        !judge(&tolerance(f64::NAN, 1.0), &reference, &subject)
            .1
            .passed()
    );
    assert_eq!(tolerance(0.002, 0.0123456).summary(), "≤ 0.0123 + 0.200 %");
}

#[test]
fn flip_is_skipped_where_it_means_nothing() {
    let integers = ImageData::zeroed(TextureDesc::d2(32, 32, Format::R32Uint)).unwrap();
    assert_eq!(
        flip(&integers, &integers),
        Flip::Skipped("integers are no picture")
    );
    let tiny = ImageData::zeroed(TextureDesc::d2(1, 1, Format::Rgba16Float)).unwrap();
    assert_eq!(flip(&tiny, &tiny), Flip::Skipped("smaller than 8×8"));
    // The smallest it is computed for.
    let reference = smooth(TextureDesc::d2(8, 8, Format::Rgba16Float));
    let subject = changed(&reference, |texel| texel.map(|value| value * 2.0));
    let mean = flip(&reference, &subject).mean().unwrap();
    assert!(mean > 0.05 && mean <= 1.0, "{mean}");
}

#[test]
fn flip_orders_visible_differences() {
    let reference = rgba16();
    let by = |factor: f32| {
        flip(
            &reference,
            &changed(&reference, |texel| texel.map(|value| value * factor)),
        )
        .mean()
    };
    let (small, large) = (by(1.02).unwrap(), by(1.5).unwrap());
    assert!(0.0 < small && small < large, "{small} {large}");
}

#[test]
fn mappings_follow_the_kind_of_value() {
    let image = |format, values: [[f32; 4]; 4]| {
        ImageData::from_rgba_f32(TextureDesc::d2(2, 2, format), &values).unwrap()
    };
    let normals = image(Format::Rgba16Float, [[-0.5, 1.0, 0.0, 1.0]; 4]);
    assert_eq!(Mapping::of(&normals), Mapping::Signed { limit: 1.0 });
    let pixels = picture(&normals, Mapping::of(&normals));
    assert_eq!(
        (pixels.width, pixels.height, &pixels.rgb[..3]),
        (2, 2, &[64, 255, 128][..])
    );
    let depth = image(Format::R32Float, [[0.25, 0.0, 0.0, 0.0]; 4]);
    assert_eq!(Mapping::of(&depth), Mapping::Grey { limit: 0.25 });
    assert_eq!(picture(&depth, Mapping::of(&depth)).rgb[..3], [255; 3]);
    let light = image(Format::Rgba16Float, [[4.0, 1.0, 0.0, -7.0]; 4]);
    assert_eq!(Mapping::of(&light), Mapping::Light { white: 4.0 });
    assert_eq!(picture(&light, Mapping::of(&light)).rgb[0], 255);
    let broken = image(Format::Rgba16Float, [[f32::NAN, 1.0, 0.0, 1.0]; 4]);
    assert_eq!(
        picture(&broken, Mapping::of(&broken)).rgb[..3],
        [255, 0, 255]
    );
}

#[test]
fn pictures_show_every_mip_and_layer_and_differences_where_they_are() {
    let desc = TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 8,
            height: 4,
            depth_or_layers: 3,
        },
        mips: 3,
        format: Format::Rgba16Float,
    };
    let reference = smooth(desc);
    // Two columns of 8 and the mips' two of 4; two rows of 4.
    let shown = picture(&reference, Mapping::of(&reference));
    assert_eq!((shown.width, shown.height), (16 + 8, 8));
    let mut subject = reference.clone();
    // Layer 2 is the second row's first; mip 1 starts at column 16.
    subject
        .set_texel(3, 1, 2, 1, Texel::Float([9.0; 4]))
        .unwrap();
    let difference = difference_picture(&reference, &subject);
    assert_eq!((difference.width, difference.height), (24, 8));
    let lit: Vec<_> = (0..difference.width * difference.height)
        .filter(|pixel| {
            let colour = &difference.rgb[*pixel as usize * 3..][..3];
            colour != [0; 3] && colour != [24; 3]
        })
        .map(|pixel| (pixel % 24, pixel / 24))
        .collect();
    assert_eq!(lit, [(16 + 3, 2 + 1)]);
}

#[test]
fn tolerances_say_what_and_why() {
    assert_eq!(Tolerance::BitEqual.summary(), "bit equal");
    assert_eq!(Tolerance::ulps(2, "two roundings").summary(), "≤ 2 ULP");
    assert_eq!(
        Tolerance::absolute(0.5, "x").with_outliers(0.25).summary(),
        "≤ 0.5 but for 25 %"
    );
    assert_eq!(
        Tolerance::ulps(2, "two roundings").reason(),
        "two roundings"
    );
    let json = serde_json::to_value(Tolerance::ulps(2, "two roundings")).unwrap();
    assert_eq!(json["kind"], "within");
    assert_eq!(json["limit"]["ulps"], 2);
    assert_eq!(json["reason"], "two roundings");
}

#[test]
fn a_spread_allows_each_texel_its_own_difference() {
    let desc = TextureDesc::d2(3, 1, Format::R32Float);
    let image = |values: [f32; 3]| {
        ImageData::from_rgba_f32(desc, &values.map(|value| [value, 0.0, 0.0, 1.0])).unwrap()
    };
    let reference = image([1.0, 1.0, 1.0]);
    let judged = |decided, values| {
        let tolerance = Tolerance::Spread {
            allowed: [[0.5, 0.0, 0.0, 0.0], [0.0; 4], [0.25, 0.0, 0.0, 0.0]].into(),
            decided,
        };
        judge(&tolerance, &reference, &image(values)).1.passed()
    };
    assert!(judged(0, [1.5, 1.0, 0.75]));
    assert!(!judged(0, [1.5, 1.0, 0.5]));
    assert!(!judged(0, [1.0, 1.000_001, 1.0]));
    // As many may be anything as were decided otherwise, but no more.
    assert!(judged(1, [1.5, 7.0, 0.75]));
    assert!(!judged(1, [3.0, 7.0, 0.75]));
    assert!(!judged(3, [f32::NAN, 1.0, 1.0]));
    let spread = Tolerance::Spread {
        allowed: [[0.0; 4]; 3].into(),
        decided: 2,
    };
    assert_eq!(spread.summary(), "≤ spread but for 2");
    assert!(spread.reason().contains("eight executions"));
}

//! Settings outside of their range are refused, by name.

use etalon_core::graph::Graph;
use etalon_effects::bloom::Bloom;
use etalon_effects::composite::{Composite, Output, ToneCurve};
use etalon_effects::exposure::Exposure;
use etalon_effects::ssr::Ssr;
use etalon_effects::{CameraParams, ChainSettings, DepthRange, SettingError};

/// One field: how to set it, its name, and its range.
type Field<S, V = f32> = (fn(&mut S, V), &'static str, V, V);

/// Both ends of each range are accepted; what lies beyond them, NaN and
/// infinities are refused with the field's name and range.
fn check<S: Copy>(
    start: S,
    fields: &[Field<S>],
    validate: impl Fn(&S) -> Result<(), SettingError>,
) {
    assert_eq!(validate(&start), Ok(()));
    for &(set, name, min, max) in fields {
        for value in [min, max] {
            let mut settings = start;
            set(&mut settings, value);
            assert_eq!(validate(&settings), Ok(()), "{name} = {value}");
        }
        let beyond = [
            min.next_down(),
            max.next_up(),
            f32::NEG_INFINITY,
            f32::INFINITY,
            f32::NAN,
        ];
        for value in beyond {
            let mut settings = start;
            set(&mut settings, value);
            let error = validate(&settings).expect_err(name);
            assert_eq!(error.field, name);
            assert_eq!((error.min, error.max), (min.into(), max.into()), "{name}");
            assert_eq!(error.value.to_bits(), f64::from(value).to_bits(), "{name}");
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

#[test]
fn ssr() {
    let fields: [Field<Ssr>; 7] = [
        (|s, v| s.max_distance = v, "max_distance", 1e-3, 1e6),
        (|s, v| s.resolution = v, "resolution", 0.0, 1.0),
        (|s, v| s.thickness = v, "thickness", 1e-6, 1e6),
        (|s, v| s.camera_fade = v, "camera_fade", 0.0, 1.0),
        (|s, v| s.depth_fade = v, "depth_fade", 0.0, 1.0),
        (|s, v| s.distance_fade = v, "distance_fade", 0.0, 1.0),
        (|s, v| s.border = v, "border", 0.0, 0.5),
    ];
    check(Ssr::default(), &fields, Ssr::validate);
    let counts: [Field<Ssr, u32>; 3] = [
        (|s, v| s.steps = v, "steps", 0, 24),
        (|s, v| s.march_limit = v, "march_limit", 1, 23_171),
        (|s, v| s.blur_radius = v, "blur_radius", 0, 64),
    ];
    for (set, name, min, max) in counts {
        for (value, good) in [
            (Some(min), true),
            (Some(max), true),
            (max.checked_add(1), false),
            (min.checked_sub(1), false),
            (Some(u32::MAX), false),
        ] {
            let Some(value) = value else { continue };
            let mut settings = Ssr::default();
            set(&mut settings, value);
            match settings.validate() {
                Ok(()) => assert!(good, "{name} = {value}"),
                Err(error) => assert!(!good && error.field == name, "{error}"),
            }
        }
    }
}

#[test]
fn exposure() {
    let fields: [Field<Exposure>; 6] = [
        (|s, v| s.key = v, "key", 1e-4, 10.0),
        (|s, v| s.compensation = v, "compensation", -16.0, 16.0),
        (|s, v| s.min_luminance = v, "min_luminance", 1e-6, 65_504.0),
        (|s, v| s.max_luminance = v, "max_luminance", 1e-6, 65_504.0),
        (|s, v| s.speed_up = v, "speed_up", 0.0, 1e4),
        (|s, v| s.speed_down = v, "speed_down", 0.0, 1e4),
    ];
    let start = Exposure {
        min_luminance: 1e-6,
        max_luminance: 65_504.0,
        ..Exposure::default()
    };
    check(start, &fields, Exposure::validate);
    let crossed = Exposure {
        min_luminance: 2.0,
        max_luminance: 1.0,
        ..Exposure::default()
    };
    assert_eq!(
        crossed.validate().expect_err("crossed").field,
        "max_luminance"
    );
}

#[test]
fn bloom() {
    let fields: [Field<Bloom>; 4] = [
        (|s, v| s.threshold = v, "threshold", 0.0, 65_504.0),
        (|s, v| s.knee = v, "knee", 0.0, 1.0),
        (|s, v| s.scatter = v, "scatter", 0.0, 1.0),
        (|s, v| s.intensity = v, "intensity", 0.0, 16.0),
    ];
    check(Bloom::default(), &fields, Bloom::validate);
    for levels in [0, 13, u32::MAX] {
        let settings = Bloom {
            levels,
            ..Bloom::default()
        };
        assert_eq!(settings.validate().expect_err("levels").field, "levels");
    }
}

#[test]
fn composite() {
    let fields: [Field<Composite>; 2] = [
        (|s, v| s.exposure = v, "exposure", 0.0, 1e6),
        (
            |s, v| s.output = Output::Sdr(ToneCurve::Reinhard { white: v }),
            "white",
            1e-2,
            65_504.0,
        ),
    ];
    check(Composite::default(), &fields, Composite::validate);
}

#[test]
fn camera() {
    let start = CameraParams::perspective(1.0, 1.5, 0.125);
    let fields: [Field<CameraParams>; 5] = [
        (|s, v| s.scale.x = v, "scale.x", 1e-3, 1e6),
        (|s, v| s.scale.y = v, "scale.y", 1e-3, 1e6),
        (|s, v| s.centre.x = v, "centre.x", -4.0, 4.0),
        (|s, v| s.centre.y = v, "centre.y", -4.0, 4.0),
        (|s, v| s.near = v, "near", 1e-6, 1e6),
    ];
    check(start, &fields, CameraParams::validate);
    for depth in [
        DepthRange::Reversed { far: 0.125 },
        DepthRange::Standard { far: f32::NAN },
    ] {
        let camera = CameraParams { depth, ..start };
        assert_eq!(camera.validate().expect_err("far").field, "far");
    }
}

#[test]
fn a_chain_names_the_effect_at_fault() {
    let bad = [
        (
            "ssr",
            ChainSettings {
                ssr: Some(Ssr {
                    thickness: 0.0,
                    ..Ssr::default()
                }),
                ..ChainSettings::full()
            },
        ),
        (
            "exposure",
            ChainSettings {
                exposure: Some(Exposure {
                    key: -1.0,
                    ..Exposure::default()
                }),
                ..ChainSettings::full()
            },
        ),
        (
            "bloom",
            ChainSettings {
                bloom: Some(Bloom {
                    knee: 2.0,
                    ..Bloom::default()
                }),
                ..ChainSettings::full()
            },
        ),
        (
            "composite",
            ChainSettings {
                composite: Composite {
                    exposure: f32::NAN,
                    ..Composite::default()
                },
                ..ChainSettings::full()
            },
        ),
    ];
    for (effect, settings) in bad {
        assert_eq!(settings.validate().expect_err(effect).effect, effect);
    }
}

#[test]
fn a_negative_frame_time_is_refused() {
    let mut graph = Graph::new();
    let desc = etalon_core::resource::TextureDesc::d2(4, 4, etalon_core::Format::Rgba16Float);
    let colour = graph.import_texture("colour", desc).expect("a new name");
    for delta_time in [-1e-6, f32::NAN, f32::INFINITY] {
        let result = etalon_effects::exposure::exposure(
            &mut graph,
            colour,
            delta_time,
            &Exposure::default(),
        );
        match result {
            Err(etalon_effects::EffectError::Setting(error)) => {
                assert_eq!(error.field, "delta_time")
            }
            other => panic!("{other:?}"),
        }
    }
}

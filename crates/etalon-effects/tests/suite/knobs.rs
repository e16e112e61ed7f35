//! Settings as data: the tables say what the structs hold.

use crate::common;

use std::collections::BTreeSet;
use std::fmt::Debug;

use common::{PLAIN_SSR, Run, hash, image, texels};
use etalon_core::Format;
use etalon_core::kernel::Arithmetic;
use etalon_effects::bloom::{Bloom, LightStorage, bloom};
use etalon_effects::composite::Composite;
use etalon_effects::environment::Prefilter;
use etalon_effects::exposure::{Exposed, Exposure};
use etalon_effects::knob::{Domain, KnobError, KnobInfo, KnobValue, Role, Tunable, tuned};
use etalon_effects::quality::{Quality, preset};
use etalon_effects::registry::WITHOUT_KNOBS;
use etalon_effects::ssr::{HitStorage, Search, Ssr, march};
use etalon_effects::{
    CameraParams, ChainSettings, EffectError, chain, effect, effects, map_effects,
};

/// What any table has to be.
fn check<S: Tunable + Debug + PartialEq>() {
    let default = S::default();
    assert_eq!(default.check_knobs(), Ok(()));
    // A field that nobody can turn would be forgotten by sweeps: each is in the
    // table, in the order of the struct.
    let printed = format!("{default:#?}");
    let fields: Vec<&str> = printed
        .lines()
        .filter_map(|line| line.strip_prefix("    ")?.split_once(':'))
        .map(|(name, _)| name)
        .filter(|name| !name.starts_with(' '))
        .collect();
    let names: Vec<&str> = S::knobs().iter().map(|knob| knob.name).collect();
    assert_eq!(fields, names, "{}", S::EFFECT);

    for knob in S::knobs() {
        let what = format!("{} {}", S::EFFECT, knob.name);
        assert!(
            !knob.description.is_empty() && knob.ladder.len() > 1,
            "{what}"
        );
        let distinct: BTreeSet<String> = knob.ladder.iter().map(ToString::to_string).collect();
        assert_eq!(
            distinct.len(),
            knob.ladder.len(),
            "{what} tries a value twice"
        );
        for &value in knob.ladder.iter().chain([&(knob.get)(&default)]) {
            assert!(knob.domain.contains(value), "{what} = {value}");
            // There and back, as a value and as text.
            let set = default.clone().with(knob.name, value).expect(&what);
            assert_eq!((knob.get)(&set), value, "{what}");
            assert_eq!(knob.domain.parse(&value.to_string()), Some(value), "{what}");
            assert_eq!(tuned::<S>(&[(knob.name, value)]), Ok(set), "{what}");
        }
        let beyond = match knob.domain {
            Domain::Real { min, max } => vec![
                KnobValue::Real(min.next_down()),
                KnobValue::Real(max.next_up()),
                KnobValue::Real(f32::NAN),
                KnobValue::Count(1),
            ],
            Domain::Count { max, .. } => {
                vec![KnobValue::Count(max + 1), KnobValue::Real(1.0)]
            }
            Domain::Choice(_) => vec![KnobValue::Choice("neither"), KnobValue::Count(0)],
        };
        for value in beyond {
            let error = default.clone().with(knob.name, value).expect_err(&what);
            assert!(matches!(error, KnobError::Value { .. }), "{what}: {error}");
            let text = error.to_string();
            assert!(text.contains(knob.name) && text.contains(&knob.domain.to_string()));
        }
        for text in ["", "nothing", "1e99", "NaN", "-1e30"] {
            assert_eq!(knob.domain.parse(text), None, "{what} {text}");
        }
    }
    let error = default
        .with("volume", KnobValue::Count(1))
        .expect_err("none");
    assert!(error.to_string().contains(names[0]), "{error}");
}

#[test]
fn tables_say_what_the_structs_hold() {
    check::<Ssr>();
    check::<Exposure>();
    check::<Bloom>();
    check::<Composite>();
    check::<Prefilter>();
}

/// Every effect with knobs, by name.
fn knobs_of_all() -> Vec<(&'static str, Vec<KnobInfo>)> {
    let frames = effects().iter().map(|entry| (entry.name, entry.knobs()));
    let maps = map_effects()
        .iter()
        .map(|entry| (entry.name, entry.knobs()));
    frames.chain(maps).collect()
}

#[test]
fn every_effect_has_one_entry() {
    let mut names: Vec<&str> = knobs_of_all().into_iter().map(|(name, _)| name).collect();
    names.extend(WITHOUT_KNOBS.iter().map(|(name, _)| *name));
    let distinct: BTreeSet<&str> = names.iter().copied().collect();
    assert_eq!(distinct.len(), names.len(), "{names:?}");
}

#[test]
fn presets_set_accuracy_and_nothing_else() {
    for (effect, knobs) in knobs_of_all() {
        let mut before: Option<&[(&str, KnobValue)]> = None;
        for quality in Quality::ALL {
            let values = preset(effect, quality);
            for (name, value) in values {
                let knob = knobs.iter().find(|knob| knob.name == *name);
                let knob = knob.unwrap_or_else(|| panic!("{effect} has no {name}"));
                assert_eq!(knob.role, Role::Accuracy, "{name}");
                assert!(knob.domain.contains(*value), "{name} = {value}");
            }
            if knobs.iter().any(|knob| knob.role == Role::Accuracy) {
                assert_ne!(before, Some(values), "{effect} {quality}");
            }
            before = Some(values);
        }
    }
    assert_eq!(
        Ssr::preset(Quality::Low).blur_radius,
        Ssr::default().blur_radius
    );
    assert_ne!(Ssr::preset(Quality::Low), Ssr::default());
    for quality in Quality::ALL {
        let settings = ChainSettings::preset(quality);
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(settings.ssr, Some(Ssr::preset(quality)));
        assert_eq!(settings.bloom, Some(Bloom::preset(quality)));
        assert_eq!(settings.exposure, Some(Exposure::preset(quality)));
        assert_eq!(Prefilter::preset(quality).validate(), Ok(()));
    }
}

#[test]
fn the_registry_sets_knobs_by_name() {
    for entry in effects() {
        let names: BTreeSet<&str> = entry.knobs().iter().map(|knob| knob.name).collect();
        assert_eq!(names.len(), entry.knobs().len(), "{}", entry.name);
    }
    assert!(effect("chain").is_some_and(|chain| chain.knobs().is_empty()));
    let mut graph = etalon_core::graph::Graph::new();
    let world = etalon_scenes::scene("mirror-planes").expect("registered");
    let size = etalon_scenes::FrameSize::new(16, 9).expect("small");
    let frame = world.frame(size).expect("small");
    let inputs = frame.import(&mut graph, 0.0).expect("fresh");
    for name in ["ssr", "chain"] {
        let entry = effect(name).expect("registered");
        let error = entry.build_with(&mut graph, &inputs, &[("volume", KnobValue::Count(1))]);
        assert!(
            matches!(&error, Err(EffectError::Knob(KnobError::Unknown { effect, .. })) if *effect == name),
            "{error:?}"
        );
    }
    let value = [("levels", KnobValue::Count(1))];
    let bloom = effect("bloom").expect("registered");
    let result = bloom
        .build_with(&mut graph, &inputs, &value)
        .expect("valid");
    assert_eq!(graph.desc(result).extent.width, 8);
}

/// What a level may differ from an exact one by, relatively: half a step for each
/// of the values in between, which a chain of `levels` has two of per level.
#[test]
fn levels_keep_the_digits_of_their_format() {
    let colour = image(Format::Rgba16Float, 61, 35, |x, y| {
        let light =
            |channel: u32| 0.25 + (hash(x + 61 * (y + 35 * channel)) >> 8) as f32 / 2_097_152.0;
        [light(0), light(1), light(2), 1.0]
    });
    let levels = 4;
    let bloomed = |storage| {
        let settings = Bloom {
            threshold: 0.0,
            suppress_fireflies: false,
            levels,
            storage,
            ..Bloom::default()
        };
        let mut run = Run::new();
        let source = run.import("colour", &colour);
        let result =
            bloom(&mut run.graph, source, Exposed::default(), &settings).expect("valid settings");
        run.output(result)
    };
    let exact = bloomed(LightStorage::Full);
    assert_eq!(exact.desc.format, Format::Rgba32Float);
    for (storage, format, bits) in [
        (LightStorage::Half, Format::Rgba16Float, [10; 3]),
        (LightStorage::Packed, Format::Rg11b10Ufloat, [6, 6, 5]),
    ] {
        let result = bloomed(storage);
        assert_eq!(result.desc.format, format);
        let mut worst = [0.0f32; 3];
        for (a, b) in texels(&exact).iter().zip(&texels(&result)) {
            for channel in 0..3 {
                worst[channel] = worst[channel].max((a[channel] - b[channel]).abs() / a[channel]);
            }
        }
        for (channel, worst) in worst.into_iter().enumerate() {
            let half_a_step = 0.5 * (-f32::from(bits[channel] as u8)).exp2();
            let bound = half_a_step * 2.0 * levels as f32;
            // Rounding it is, but not none.
            assert!(
                worst > 0.25 * half_a_step && worst <= bound,
                "{format}: {worst}"
            );
        }
    }
}

#[test]
fn half_places_are_full_ones_rounded_and_a_linear_search_has_no_refinement() {
    let world = etalon_scenes::scene("mirror-planes").expect("registered");
    let size = etalon_scenes::FrameSize::new(96, 54).expect("small");
    let frame = world.frame(size).expect("small");
    let camera = {
        let mut graph = etalon_core::graph::Graph::new();
        frame.import(&mut graph, 0.0).expect("fresh").camera
    };
    let marched = |settings: &Ssr, camera: &CameraParams| {
        let mut run = Run::new();
        let depth = run.import("depth", &frame.depth);
        let normal = run.import("normal", &frame.normal);
        let result = march(&mut run.graph, depth, normal, camera, settings).expect("valid");
        run.output(result)
    };
    let full = marched(&PLAIN_SSR, &camera);
    let half = marched(
        &Ssr {
            storage: HitStorage::Half,
            ..PLAIN_SSR
        },
        &camera,
    );
    assert_eq!(half.desc.format, Format::Rgba16Float);
    for (full, half) in texels(&full).iter().zip(&texels(&half)) {
        let rounded = full.map(|value| half::f16::from_f32(value).to_f32());
        assert_eq!(rounded, *half);
    }
    let linear = Ssr {
        search: Search::Linear,
        ..PLAIN_SSR
    };
    let none = Ssr {
        steps: 0,
        ..PLAIN_SSR
    };
    let linear = marched(&linear, &camera);
    assert_eq!(linear.bytes, marched(&none, &camera).bytes);
    assert_ne!(linear.bytes, full.bytes);
}

/// A choice is another kernel, and the composite reads what bloom was stored in.
#[test]
fn every_storage_makes_the_same_picture_in_both_arithmetics() {
    let world = etalon_scenes::scene("dark-room-lights").expect("registered");
    let size = etalon_scenes::FrameSize::new(61, 35).expect("small");
    let frame = world.frame(size).expect("small");
    let shown = |storage, arithmetic| {
        let settings = ChainSettings {
            bloom: Some(Bloom {
                storage,
                ..Bloom::default()
            }),
            ..ChainSettings::full()
        };
        let mut run = Run::new();
        run.arithmetic = arithmetic;
        let inputs = run.import_frame(&frame);
        let result = chain(&mut run.graph, &inputs, &settings).expect("valid");
        texels(&run.output(result.picture))
    };
    let exact = shown(LightStorage::Full, Arithmetic::Strict);
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        for storage in [LightStorage::Full, LightStorage::Half, LightStorage::Packed] {
            let picture = shown(storage, arithmetic);
            // A step of the coarsest format is 1/32 of the bloom, which is some
            // tenths of the light; encoding makes of a relative error e of light at
            // most e / 2.4 of a value.
            let worst = exact
                .iter()
                .zip(&picture)
                .flat_map(|(a, b)| (0..3).map(|channel| (a[channel] - b[channel]).abs()));
            let worst = worst.fold(0.0, f32::max);
            assert!(worst <= 1.0 / 32.0, "{storage:?}, {arithmetic}: {worst}");
        }
    }
}

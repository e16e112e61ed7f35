//! Settings for a budget are the best there are, by trying all.

use etalon_effects::ChainSettings;
use etalon_effects::budget::{BudgetError, DeviceProfile, EffectProfile, ProfilePoint};
use etalon_effects::knob::KnobError;

fn point(milliseconds: f64, error: f64, values: &[(&str, &str)]) -> ProfilePoint {
    let values = values
        .iter()
        .map(|(name, value)| ((*name).into(), (*value).into()));
    ProfilePoint {
        milliseconds,
        error,
        values: values.collect(),
    }
}

/// Points of no order, some of them beaten by others.
fn profile() -> DeviceProfile {
    let effect = |effect: &str, points: Vec<ProfilePoint>| EffectProfile {
        effect: effect.into(),
        points,
    };
    let resolution = |time, error, value| point(time, error, &[("resolution", value)]);
    let levels = |time, error, value| point(time, error, &[("levels", value)]);
    let stride = |time, error, value| point(time, error, &[("stride", value)]);
    DeviceProfile {
        device: "a device".into(),
        size: [640, 360],
        effects: vec![
            effect(
                "bloom",
                vec![
                    levels(3.0, 0.02, "7"),
                    levels(1.0, 0.3, "2"),
                    levels(2.0, 0.5, "3"),
                ],
            ),
            effect(
                "ssr",
                vec![
                    resolution(16.0, 0.001, "1"),
                    resolution(1.0, 0.4, "0.0625"),
                    resolution(4.0, 0.05, "0.25"),
                    resolution(8.0, f64::NAN, "0.5"),
                    resolution(9.0, 0.01, "0.5"),
                ],
            ),
            effect(
                "exposure",
                vec![stride(0.5, 0.0, "1"), stride(0.1, 0.03, "8")],
            ),
            effect("composite", vec![point(2.0, 0.001, &[])]),
        ],
    }
}

/// The least sum of errors within a budget, by trying everything.
fn least(profile: &DeviceProfile, budget: f64) -> Option<f64> {
    let mut sums = vec![(0.0, 0.0)];
    for effect in &profile.effects {
        let mut next = Vec::new();
        for (time, error) in sums {
            for point in effect.points.iter().filter(|point| !point.error.is_nan()) {
                next.push((time + point.milliseconds, error + point.error));
            }
        }
        sums = next;
    }
    let within = sums.into_iter().filter(|(time, _)| *time <= budget);
    within.map(|(_, error)| error).min_by(f64::total_cmp)
}

/// The error of the settings chosen, as the profile has it.
fn error_of(profile: &DeviceProfile, settings: &ChainSettings) -> (f64, f64) {
    let (ssr, bloom) = (settings.ssr.unwrap(), settings.bloom.unwrap());
    let chosen = [
        ("ssr", format!("{}", ssr.resolution)),
        ("bloom", format!("{}", bloom.levels)),
        ("exposure", format!("{}", settings.exposure.unwrap().stride)),
    ];
    let mut sum = (2.0, 0.001);
    for (effect, value) in chosen {
        let effect = profile.effects.iter().find(|known| known.effect == effect);
        let mut points = effect.unwrap().points.iter();
        let point = points.find(|point| point.values[0].1 == value && !point.error.is_nan());
        let point = point.unwrap();
        sum = (sum.0 + point.milliseconds, sum.1 + point.error);
    }
    sum
}

#[test]
fn every_budget_gets_the_least_error_there_is() {
    let profile = profile();
    let mut tried = 0;
    for tenths in 0..300 {
        let budget = f64::from(tenths) / 10.0;
        match ChainSettings::full().for_budget(budget, &profile) {
            Ok(settings) => {
                let (time, error) = error_of(&profile, &settings);
                assert!(time <= budget + 1e-9, "{budget}: {time}");
                let least = least(&profile, budget + 1e-9).expect("something fits");
                assert!(
                    (error - least).abs() < 1e-12,
                    "{budget}: {error}, not {least}"
                );
                tried += 1;
            }
            Err(BudgetError::TooLittle { least: needed, .. }) => {
                assert!(
                    budget < needed && least(&profile, budget).is_none(),
                    "{budget}"
                );
                assert!((needed - 4.1).abs() < 1e-12);
            }
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!(tried, 300 - 41);
}

#[test]
fn the_look_stays_and_what_is_off_costs_nothing() {
    let mut settings = ChainSettings::full();
    settings.bloom.as_mut().unwrap().scatter = 0.9;
    let chosen = settings.for_budget(100.0, &profile()).unwrap();
    assert_eq!(chosen.bloom.unwrap().scatter, 0.9);
    assert_eq!(chosen.bloom.unwrap().levels, 7);
    let none = ChainSettings::default()
        .for_budget(2.0, &profile())
        .unwrap();
    assert_eq!(none, ChainSettings::default());
}

#[test]
fn twice_the_pixels_take_twice_the_time() {
    let doubled = profile().at_size([640, 720]);
    let [half, whole] = [(9.1, profile()), (18.2, doubled)]
        .map(|(budget, profile)| ChainSettings::full().for_budget(budget, &profile).unwrap());
    assert_eq!(half, whole);
}

#[test]
fn profiles_of_other_effects_and_values_are_refused() {
    let mut lacking = profile();
    lacking.effects.remove(0);
    let error = ChainSettings::full()
        .for_budget(100.0, &lacking)
        .unwrap_err();
    assert!(
        matches!(
            error,
            BudgetError::NotMeasured {
                effect: "bloom",
                ..
            }
        ),
        "{error}"
    );
    for values in [
        vec![("volume", "3")],
        vec![("levels", "99")],
        vec![("levels", "many")],
    ] {
        let mut wrong = profile();
        wrong.effects[0].points = vec![point(1.0, 0.0, &values)];
        let error = ChainSettings::full().for_budget(100.0, &wrong).unwrap_err();
        let wanted = |error: &KnobError| match error {
            KnobError::Unknown { .. } => values[0].0 == "volume",
            _ => values[0].0 == "levels",
        };
        assert!(
            matches!(&error, BudgetError::Knob(error) if wanted(error)),
            "{error}"
        );
    }
    let error = ChainSettings::full()
        .for_budget(f64::NAN, &profile())
        .unwrap_err();
    assert!(matches!(error, BudgetError::TooLittle { .. }), "{error}");
}

//! Which settings of an effect are tried.
//!
//! Every knob that costs accuracy is turned through its ladder alone, and every
//! two of them together: what three knobs do to each other is rarely worth the
//! time, which grows with the product. Knobs of the look stay where they are,
//! since another look is no error.

use std::fmt::Write as _;

use etalon_core::kernel::Arithmetic;
use etalon_effects::knob::{KnobInfo, KnobValue, Role};
use etalon_effects::quality::{self, Quality};

use crate::trial::Swept;

/// One setting to be tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Strict or fast.
    pub arithmetic: Arithmetic,
    /// The knobs of accuracy, each with its value, in the effect's order.
    pub values: Vec<(&'static str, KnobValue)>,
    /// How many of them, arithmetic included, are not at their default.
    pub turned: usize,
    /// The preset that it is.
    pub preset: Option<Quality>,
}

impl Setting {
    /// Its name among the settings of the effect, of letters, digits, points and
    /// hyphens: `strict` or `fast`, and what is not at its default.
    #[must_use]
    pub fn id(&self, knobs: &[KnobInfo]) -> String {
        let mut id = self.arithmetic.to_string();
        for (name, value) in &self.values {
            let default = knobs.iter().find(|knob| knob.name == *name);
            if default.is_none_or(|knob| knob.default != *value) {
                // Writing to a string does not fail.
                let _ = write!(id, "-{}-{value}", name.replace('_', "-"));
            }
        }
        id
    }
}

/// The knobs whose values are tried.
#[must_use]
pub fn knobs(effect: &Swept) -> Vec<KnobInfo> {
    let mut knobs = effect.knobs();
    knobs.retain(|knob| knob.role == Role::Accuracy);
    knobs
}

/// The settings to be tried with at most `depth` knobs turned, the least turned
/// first; presets, however far they are turned, right after the default.
#[must_use]
pub fn settings(effect: &Swept, depth: usize) -> Vec<Setting> {
    let knobs = knobs(effect);
    let mut settings = vec![Setting {
        arithmetic: Arithmetic::Strict,
        values: knobs.iter().map(|knob| (knob.name, knob.default)).collect(),
        turned: 0,
        preset: None,
    }];
    for (index, knob) in knobs.iter().enumerate() {
        for position in 0..settings.len() {
            if settings[position].turned >= depth {
                continue;
            }
            for &value in knob.ladder.iter().filter(|value| **value != knob.default) {
                let mut turned = settings[position].clone();
                turned.values[index].1 = value;
                turned.turned += 1;
                settings.push(turned);
            }
        }
    }
    for position in 0..settings.len() {
        if settings[position].turned < depth {
            let mut fast = settings[position].clone();
            fast.arithmetic = Arithmetic::Fast;
            fast.turned += 1;
            settings.push(fast);
        }
    }
    for quality in Quality::ALL {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let preset = preset(&knobs, effect, quality, arithmetic);
            let same = |setting: &&mut Setting| {
                setting.arithmetic == arithmetic && setting.values == preset.values
            };
            match settings.iter_mut().find(same) {
                Some(setting) => setting.preset = Some(quality),
                None => settings.push(preset),
            }
        }
    }
    // Stable, so that the order of knobs and ladders is kept.
    settings.sort_by_key(|setting| match setting.preset {
        Some(_) => setting.turned.min(1),
        None => setting.turned,
    });
    settings
}

fn preset(knobs: &[KnobInfo], effect: &Swept, quality: Quality, arithmetic: Arithmetic) -> Setting {
    let preset = quality::preset(effect.name(), quality);
    let value = |knob: &KnobInfo| {
        let set = preset.iter().find(|(name, _)| *name == knob.name);
        (knob.name, set.map_or(knob.default, |(_, value)| *value))
    };
    let values: Vec<_> = knobs.iter().map(value).collect();
    let turned = |knob: &&KnobInfo| !values.contains(&(knob.name, knob.default));
    Setting {
        turned: knobs.iter().filter(turned).count() + usize::from(arithmetic == Arithmetic::Fast),
        arithmetic,
        values,
        preset: Some(quality),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_effects::effects;
    use std::collections::BTreeSet;

    /// What has no knobs as well.
    fn all() -> impl Iterator<Item = Swept> {
        let maps = etalon_effects::map_effects().iter().map(Swept::Map);
        effects().iter().map(Swept::Frame).chain(maps)
    }

    #[test]
    fn every_two_knobs_are_turned_together_and_nothing_twice() {
        for effect in all() {
            let knobs = knobs(&effect);
            let settings = settings(&effect, 2);
            let ids: BTreeSet<String> = settings.iter().map(|setting| setting.id(&knobs)).collect();
            assert_eq!(ids.len(), settings.len(), "{}", effect.name());
            assert!(ids.iter().all(|id| {
                let good = |letter: char| letter.is_ascii_alphanumeric() || "-.".contains(letter);
                id.chars().all(good)
            }));
            // Others than the default, on each knob and on arithmetic.
            let mut steps: Vec<usize> = knobs
                .iter()
                .map(|knob| {
                    let other = |value: &&KnobValue| **value != knob.default;
                    knob.ladder.iter().filter(other).count()
                })
                .collect();
            steps.push(1);
            let singles: usize = steps.iter().sum();
            let squares: usize = steps.iter().map(|count| count * count).sum();
            let expected = 1 + singles + (singles * singles - squares) / 2;
            let further = settings.iter().filter(|setting| setting.turned > 2).count();
            assert_eq!(settings.len(), expected + further, "{}", effect.name());
            assert!(further <= 2 * Quality::ALL.len());
        }
    }

    #[test]
    fn the_default_is_first_and_every_preset_is_there() {
        for entry in all() {
            for depth in 0..3 {
                let settings = settings(&entry, depth);
                assert_eq!(settings[0].turned, 0, "{}", entry.name());
                let presets = settings.iter().filter(|setting| setting.preset.is_some());
                assert!(presets.count() >= 2, "{}", entry.name());
            }
        }
        let ssr = Swept::named("ssr").expect("registered");
        assert_eq!(settings(&ssr, 0)[0].id(&knobs(&ssr)), "strict");
    }
}

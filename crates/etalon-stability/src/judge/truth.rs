//! Is it what the effect's truth says?
//!
//! The truths are written from the effects' definitions, in `f64`, and know nothing of
//! the kernels:
//!
//! * what the march stores as a reflection has to be one ([`Claims`]): it may miss what an
//!   exact search finds, and may not make one up;
//! * the luminance adapted to and its factor, frame after frame, where every texel is
//!   measured ([`exposure`]);
//! * the final picture ([`composite`]);
//! * what is drawn, and its light ([`drawn`]).
//!
//! Of the first it is known how far `f32` may be off. Of the others the difference is
//! rounding: allowed is [`BOUND`] as for [rounding](super::rounding), beside what storing
//! to the format moves a number by.

use etalon_effects::composite::Composite;
use etalon_effects::composite::truth::composite;
use etalon_effects::exposure::Exposure;
use etalon_effects::exposure::truth::exposure;
use etalon_effects::knob::{KnobValue, Tunable, tuned};
use etalon_effects::ssr::Ssr;
use etalon_effects::ssr::truth::claim::Claims;
use etalon_effects::truth::Plane;
use etalon_scenes::cases::Step;
use etalon_scenes::cases::drawn::DrawnEffect;
use serde::{Deserialize, Serialize};

use super::drawn;
use super::rounding::BOUND;
use super::scale::half_step;
use crate::observe::{Place, Store};
use crate::scene::Scene;

/// Texels that are not what they should be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Untrue {
    /// How many, of all frames.
    pub texels: u64,
    /// The first.
    pub first: Place,
    /// What is wrong with it.
    pub what: String,
}

/// Of which effect.
enum Truth {
    Ssr(Ssr),
    Exposure {
        settings: Exposure,
        /// The luminance adapted to so far.
        held: Option<f64>,
    },
    Composite(Composite),
    /// What is drawn and lit: its stage says what that is.
    Stage,
}

/// Holds a case's frames to an effect's truth, one after the other.
pub struct Judge {
    truth: Truth,
    bound: f64,
    found: Option<Untrue>,
}

impl std::fmt::Debug for Judge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Judge({:?})", self.found)
    }
}

/// The settings that a case's knobs make; `None` where they are none.
fn settings<S: Tunable>(knobs: &[(&str, KnobValue)]) -> Option<S> {
    tuned(knobs).ok()
}

impl Judge {
    /// Of an effect with some knobs set; `None` if it has no truth to be held to so.
    /// `bound` is what a case declares in place of [`BOUND`].
    #[must_use]
    pub fn new(effect: &str, knobs: &[(&str, KnobValue)], bound: Option<f64>) -> Option<Self> {
        let truth = match effect {
            "ssr" => Truth::Ssr(settings(knobs)?),
            // Its march is that of the default settings.
            "chain" => Truth::Ssr(Ssr::default()),
            "exposure" => Truth::Exposure {
                settings: settings(knobs).filter(|exposure: &Exposure| exposure.stride == 1)?,
                held: None,
            },
            "composite" => Truth::Composite(settings(knobs)?),
            _ if DrawnEffect::named(effect).is_some() => Truth::Stage,
            _ => return None,
        };
        Some(Self {
            truth,
            bound: bound.unwrap_or(BOUND),
            found: None,
        })
    }

    /// Looks at what a frame's passes stored. Inputs that are no images of numbers, and
    /// images that memory does not hold twice, are left out.
    pub fn look(&mut self, frame: usize, scene: &Scene, stores: &[Store]) {
        let wrong = match (&mut self.truth, scene) {
            (Truth::Ssr(settings), Scene::Images(step)) => reflections(settings, step, stores),
            (Truth::Exposure { settings, held }, Scene::Images(step)) => {
                adaptation(settings, held, self.bound, step, stores)
            }
            (Truth::Composite(settings), Scene::Images(step)) => {
                picture(settings, self.bound, step, stores)
            }
            (Truth::Stage, Scene::Stage(stage)) => drawn::wrong(stage, stores),
            _ => None,
        };
        for Wrong { store, index, what } in wrong.unwrap_or_default() {
            let found = self.found.get_or_insert_with(|| Untrue {
                texels: 0,
                first: store.place(frame, index, 0),
                what,
            });
            found.texels += 1;
        }
    }

    /// What was found.
    #[must_use]
    pub fn finish(self) -> Option<Untrue> {
        self.found
    }
}

/// A texel that is not what it should be.
pub(super) struct Wrong<'a> {
    pub(super) store: &'a Store,
    pub(super) index: usize,
    pub(super) what: String,
}

/// What a pass stored.
pub(super) fn of<'a>(stores: &'a [Store], pass: &str) -> Option<(&'a Store, Plane)> {
    let store = stores.iter().find(|store| store.pass == pass)?;
    let plane = Plane::of(store.image.as_ref()?).ok()?;
    Some((store, plane))
}

fn reflections<'a>(settings: &Ssr, step: &Step, stores: &'a [Store]) -> Option<Vec<Wrong<'a>>> {
    let (store, plane) = of(stores, "ssr/march")?;
    let depth = Plane::of(&step.frame.depth).ok()?;
    let normal = Plane::of(&step.frame.normal).ok()?;
    let claims = Claims::new(&depth, &normal, &step.camera, settings).ok()?;
    let width = plane.width();
    let wrong = plane
        .texels()
        .iter()
        .enumerate()
        .filter_map(|(index, texel)| {
            let number = u32::try_from(index).ok()?;
            let what = claims
                .check([number % width, number / width], *texel)
                .err()?;
            Some(Wrong {
                store,
                index,
                what: what.to_string(),
            })
        });
    Some(wrong.collect())
}

fn adaptation<'a>(
    settings: &Exposure,
    held: &mut Option<f64>,
    bound: f64,
    step: &Step,
    stores: &'a [Store],
) -> Option<Vec<Wrong<'a>>> {
    let (store, plane) = of(stores, "exposure/adapt")?;
    let colour = Plane::of(&step.frame.colour).ok()?;
    let exact = exposure(&colour, *held, step.delta_time.into(), settings).ok()?;
    *held = Some(exact.luminance);
    let [luminance, factor, ..] = *plane.texels().first()?;
    let mut wrong = Vec::new();
    for (name, stored, exact) in [
        ("luminance", luminance, exact.luminance),
        ("factor", factor, exact.factor),
    ] {
        // Written so that a NaN is wrong.
        let right = (stored - exact).abs() <= bound * exact.abs();
        if !right {
            wrong.push(Wrong {
                store,
                index: 0,
                what: format!("{name} {stored:e} in place of {exact:e}"),
            });
        }
    }
    Some(wrong)
}

fn picture<'a>(
    settings: &Composite,
    bound: f64,
    step: &Step,
    stores: &'a [Store],
) -> Option<Vec<Wrong<'a>>> {
    let (store, plane) = of(stores, "composite/composite")?;
    let format = store.image.as_ref()?.desc.format;
    let colour = Plane::of(&step.frame.colour).ok()?;
    let exact = composite(&colour, 1.0, None, settings).ok()?;
    let texels = plane.texels().iter().zip(exact.texels());
    let wrong = texels.enumerate().filter_map(|(index, (stored, exact))| {
        let channel = (0..4).find(|&channel| {
            let (stored, exact) = (stored[channel], exact[channel]);
            let step = half_step(format, channel, exact.abs().max(stored.abs()));
            // Written so that a NaN is wrong.
            let right = (stored - exact).abs() <= step + bound * exact.abs().max(1.0);
            !right
        })?;
        Some(Wrong {
            store,
            index,
            what: format!(
                "{:e} in place of {:e} in channel {channel}",
                stored[channel], exact[channel]
            ),
        })
    });
    Some(wrong.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_core::Format;
    use etalon_core::image::ImageData;
    use etalon_core::resource::TextureDesc;
    use etalon_scenes::cases::case;

    fn stored(pass: &str, format: Format, size: [u32; 2], texels: &[[f32; 4]]) -> Vec<Store> {
        let desc = TextureDesc::d2(size[0], size[1], format);
        vec![Store {
            pass: pass.to_owned(),
            binding: "result".to_owned(),
            image: Some(ImageData::from_rgba_f32(desc, texels).unwrap()),
            wide: None,
            buffer: None,
        }]
    }

    fn untrue(effect: &str, stores: &[Store], step: &Step) -> Option<Untrue> {
        let mut judge = Judge::new(effect, &[], None).unwrap();
        judge.look(2, &Scene::Images(Box::new(step.clone())), stores);
        judge.finish()
    }

    fn frame() -> Step {
        let steps = case("depth-at-the-near-plane").unwrap().steps().unwrap();
        steps.into_iter().next().unwrap()
    }

    #[test]
    fn a_picture_is_held_to_its_truth() {
        let step = frame();
        let colour = Plane::of(&step.frame.colour).unwrap();
        let exact = composite(&colour, 1.0, None, &Composite::default()).unwrap();
        let mut texels: Vec<[f32; 4]> =
            exact.texels().iter().map(|t| t.map(|v| v as f32)).collect();
        let size = colour.size();
        let format = Format::Rgba8Unorm;
        let stores = |texels: &[[f32; 4]]| stored("composite/composite", format, size, texels);
        assert_eq!(untrue("composite", &stores(&texels), &step), None);
        texels[5][1] += 1.0 / 255.0;
        let found = untrue("composite", &stores(&texels), &step).unwrap();
        assert_eq!((found.texels, found.first.x, found.first.frame), (1, 5, 2));
    }

    #[test]
    fn an_eye_is_held_to_its_truth_in_every_frame() {
        let step = frame();
        let colour = Plane::of(&step.frame.colour).unwrap();
        let settings = Exposure::default();
        let mut judge = Judge::new("exposure", &[], None).unwrap();
        let mut held = None;
        for number in 0..3 {
            let exact = exposure(&colour, held, step.delta_time.into(), &settings).unwrap();
            held = Some(exact.luminance);
            // In the last frame the factor is not that of the luminance.
            let off = if number == 2 { 1.001 } else { 1.0 };
            let texel = [
                exact.luminance as f32,
                (exact.factor * off) as f32,
                0.0,
                1.0,
            ];
            let stores = stored("exposure/adapt", Format::Rgba32Float, [1, 1], &[texel]);
            judge.look(number, &Scene::Images(Box::new(step.clone())), &stores);
        }
        let found = judge.finish().unwrap();
        assert_eq!((found.texels, found.first.frame), (1, 2));
        assert!(found.what.contains("factor"), "{}", found.what);
    }

    #[test]
    fn a_reflection_that_is_none_is_found() {
        let step = frame();
        let [width, height] = Plane::of(&step.frame.depth).unwrap().size();
        let mut texels = vec![[0.0; 4]; (width * height) as usize];
        let format = Format::Rgba32Float;
        let stores = |texels: &[[f32; 4]]| stored("ssr/march", format, [width, height], texels);
        assert_eq!(untrue("ssr", &stores(&texels), &step), None);
        texels[7] = [0.5, 0.5, 1.0, 0.0];
        let found = untrue("ssr", &stores(&texels), &step).unwrap();
        assert_eq!((found.texels, found.first.x), (1, 7));
    }

    #[test]
    fn effects_and_settings_without_a_truth_are_not_judged() {
        assert!(Judge::new("bloom", &[], None).is_none());
        let stride = [("stride", KnobValue::Count(4))];
        assert!(Judge::new("exposure", &stride, None).is_none());
    }
}

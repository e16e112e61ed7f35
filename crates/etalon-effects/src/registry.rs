//! Every effect by name, for whatever runs them all: comparison, measurement,
//! the command line.

use etalon_core::graph::{Decision, Graph, Texture};

use crate::bloom::{self, Bloom, bloom};
use crate::chain::{ChainSettings, chain};
use crate::composite::{self, Composite, composite};
use crate::demand::{Calls, Need};
use crate::environment::{Irradiance, Prefilter, environment};
use crate::exposure::{self, Exposed, Exposure, exposure};
use crate::knob::{KnobError, KnobInfo, KnobValue, Role, Tunable, infos, tuned};
use crate::ssr::{self, Ssr, ssr};
use crate::{EffectError, SceneInputs};

/// Declares an effect with some knobs set and returns its result.
type DeclareWith =
    fn(&mut Graph, &SceneInputs, &[(&str, KnobValue)]) -> Result<Texture, EffectError>;

/// Declares an effect as it is.
pub type Declare = fn(&mut Graph, &SceneInputs) -> Result<Texture, EffectError>;

#[derive(Clone, Copy, Debug)]
enum How {
    Tuned(DeclareWith),
    Fixed(Declare),
}

/// An effect that can be built on the frame of any scene.
#[derive(Clone, Copy, Debug)]
pub struct EffectEntry {
    /// By which it is known: its module and its folder of kernels.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub description: &'static str,
    /// Images of the frame that it reads beside the light.
    pub needs: &'static [Need],
    knobs: fn() -> Vec<KnobInfo>,
    how: How,
    decide: fn(&Calls<'_>) -> Decision,
}

impl EffectEntry {
    const fn of<S: Tunable>(
        description: &'static str,
        declare: DeclareWith,
        needs: &'static [Need],
        decide: fn(&Calls<'_>) -> Decision,
    ) -> Self {
        Self {
            name: S::EFFECT,
            description,
            needs,
            knobs: infos::<S>,
            how: How::Tuned(declare),
            decide,
        }
    }

    /// An effect, or several as one, with settings of its own that are no knobs. It is
    /// taken to read every image of the frame, and to be called for always.
    #[must_use]
    pub const fn fixed(name: &'static str, description: &'static str, declare: Declare) -> Self {
        Self {
            name,
            description,
            needs: ssr::demand::NEEDS,
            knobs: Vec::new,
            how: How::Fixed(declare),
            decide: composite::demand::decide,
        }
    }

    /// Whether a frame calls for it, and why or why not.
    #[must_use]
    pub fn decide(&self, calls: &Calls<'_>) -> Decision {
        (self.decide)(calls)
    }

    /// Its settings as data; none for `chain`, which has those of all others.
    #[must_use]
    pub fn knobs(&self) -> Vec<KnobInfo> {
        (self.knobs)()
    }

    /// Its knobs that change the cost alone, set so that every pass runs on the whole
    /// picture: what it then takes does not depend on what the scene shows.
    #[must_use]
    pub fn everywhere(&self) -> Vec<(&'static str, KnobValue)> {
        let knobs = self.knobs().into_iter();
        let costs = knobs.filter(|knob| knob.role == Role::Cost);
        costs
            .filter_map(|knob| Some((knob.name, *knob.ladder.first()?)))
            .collect()
    }

    /// Declares it with default settings and returns its result.
    ///
    /// # Errors
    /// If the inputs do not fit together.
    pub fn build(&self, graph: &mut Graph, inputs: &SceneInputs) -> Result<Texture, EffectError> {
        self.build_with(graph, inputs, &[])
    }

    /// Declares it with some knobs set, the others as they are by default.
    ///
    /// # Errors
    /// If there is no such knob, a value is not allowed, or the inputs do not fit
    /// together.
    pub fn build_with(
        &self,
        graph: &mut Graph,
        inputs: &SceneInputs,
        values: &[(&str, KnobValue)],
    ) -> Result<Texture, EffectError> {
        match self.how {
            How::Tuned(declare) => declare(graph, inputs, values),
            How::Fixed(declare) => match values.first() {
                None => declare(graph, inputs),
                Some((knob, _)) => Err(KnobError::Unknown {
                    effect: self.name,
                    knob: (*knob).to_owned(),
                    known: Vec::new(),
                }
                .into()),
            },
        }
    }
}

/// Declares an effect on the image of an environment map with some knobs set.
type DeclareOnMap = fn(&mut Graph, Texture, &[(&str, KnobValue)]) -> Result<Texture, EffectError>;

/// An effect that is made of an environment map, once for many frames.
#[derive(Clone, Copy, Debug)]
pub struct MapEntry {
    /// By which it is known: its module and its folder of kernels.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub description: &'static str,
    knobs: fn() -> Vec<KnobInfo>,
    declare: DeclareOnMap,
}

impl MapEntry {
    /// Its settings as data.
    #[must_use]
    pub fn knobs(&self) -> Vec<KnobInfo> {
        (self.knobs)()
    }

    /// Declares it on the image of an [`EnvironmentMap`](crate::environment::EnvironmentMap)
    /// with some knobs set, the others as they are by default.
    ///
    /// # Errors
    /// If there is no such knob, a value is not allowed, or `base` is not of the size of
    /// such an image.
    pub fn build_with(
        &self,
        graph: &mut Graph,
        base: Texture,
        values: &[(&str, KnobValue)],
    ) -> Result<Texture, EffectError> {
        (self.declare)(graph, base, values)
    }
}

/// Effects that are made of an environment map.
#[must_use]
pub const fn map_effects() -> &'static [MapEntry] {
    MAP_EFFECTS
}

const MAP_EFFECTS: &[MapEntry] = &[MapEntry {
    name: Prefilter::EFFECT,
    description: "Light from everywhere, blurred by roughness as surfaces mirror it",
    knobs: infos::<Prefilter>,
    declare: |graph, base, values| {
        // What surfaces scatter is no part of the map.
        let scattered = Irradiance::default();
        Ok(environment(graph, base, &scattered, &tuned(values)?)?.radiance)
    },
}];

/// The effects that draw have no knob that trades accuracy for time. By name, why.
pub const WITHOUT_KNOBS: &[(&str, &str)] = &[
    (
        "geometry",
        "its formats are fixed, and each surface seen is drawn once, exactly where the rasteriser's rules say",
    ),
    (
        "lighting",
        "each light is evaluated at every pixel, in closed form; its reach is a look",
    ),
    (
        "forward",
        "each lamp is evaluated at every fragment, in closed form; its cost is theirs alone",
    ),
];

/// All effects that run on a frame, and `chain`, which is all of them one after the other.
#[must_use]
pub const fn effects() -> &'static [EffectEntry] {
    EFFECTS
}

const EFFECTS: &[EffectEntry] = &[
    EffectEntry::of::<Ssr>(
        "Screen-space reflection by a march across the screen and bisection",
        |graph, inputs, values| ssr(graph, inputs, &tuned(values)?),
        ssr::demand::NEEDS,
        ssr::demand::decide,
    ),
    EffectEntry::of::<Exposure>(
        "Automatic exposure from the picture's average luminance",
        |graph, inputs, values| exposure(graph, inputs.colour, inputs.delta_time, &tuned(values)?),
        exposure::demand::NEEDS,
        exposure::demand::decide,
    ),
    EffectEntry::of::<Bloom>(
        "The glow of bright light, by halving and doubling the picture's size",
        |graph, inputs, values| bloom(graph, inputs.colour, Exposed::default(), &tuned(values)?),
        bloom::demand::NEEDS,
        bloom::demand::decide,
    ),
    EffectEntry::of::<Composite>(
        "Tone curve and encoding for the display",
        |graph, inputs, values| composite(graph, inputs.colour, None, None, &tuned(values)?),
        composite::demand::NEEDS,
        composite::demand::decide,
    ),
    EffectEntry::fixed(
        "chain",
        "Reflection, exposure, bloom and composite, one after the other",
        |graph, inputs| Ok(chain(graph, inputs, &ChainSettings::full())?.picture),
    ),
];

/// The effect of that name.
#[must_use]
pub fn effect(name: &str) -> Option<&'static EffectEntry> {
    effects().iter().find(|entry| entry.name == name)
}

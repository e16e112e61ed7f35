//! Every effect by name, for whatever runs them all: comparison, measurement,
//! the command line.

use etalon_core::graph::{Graph, Texture};

use crate::bloom::{Bloom, bloom};
use crate::chain::{ChainSettings, chain};
use crate::composite::{Composite, composite};
use crate::exposure::{Exposed, Exposure, exposure};
use crate::ssr::{Ssr, ssr};
use crate::{EffectError, SceneInputs};

/// An effect that can be built on any scene.
#[derive(Clone, Copy, Debug)]
pub struct EffectEntry {
    /// By which it is known: its module and its folder of kernels.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub description: &'static str,
    /// Declares it with default settings and returns its result.
    pub build: fn(&mut Graph, &SceneInputs) -> Result<Texture, EffectError>,
}

/// All effects, and `chain`, which is all of them one after the other.
#[must_use]
pub const fn effects() -> &'static [EffectEntry] {
    &[
        EffectEntry {
            name: "ssr",
            description: "Screen-space reflection by a march across the screen and bisection",
            build: |graph, inputs| ssr(graph, inputs, &Ssr::default()),
        },
        EffectEntry {
            name: "exposure",
            description: "Automatic exposure from the picture's average luminance",
            build: |graph, inputs| {
                exposure(
                    graph,
                    inputs.colour,
                    inputs.delta_time,
                    &Exposure::default(),
                )
            },
        },
        EffectEntry {
            name: "bloom",
            description: "The glow of bright light, by halving and doubling the picture's size",
            build: |graph, inputs| {
                bloom(graph, inputs.colour, Exposed::default(), &Bloom::default())
            },
        },
        EffectEntry {
            name: "composite",
            description: "Tone curve and encoding for the display",
            build: |graph, inputs| {
                composite(graph, inputs.colour, None, None, &Composite::default())
            },
        },
        EffectEntry {
            name: "chain",
            description: "Reflection, exposure, bloom and composite, one after the other",
            build: |graph, inputs| Ok(chain(graph, inputs, &ChainSettings::full())?.picture),
        },
    ]
}

/// The effect of that name.
#[must_use]
pub fn effect(name: &str) -> Option<&'static EffectEntry> {
    effects().iter().find(|entry| entry.name == name)
}

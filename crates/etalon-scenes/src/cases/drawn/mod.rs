//! Hard cases of what is drawn, and of what lights it: geometry, lighting from a
//! G-buffer, environments, forward shading with glass.
//!
//! These effects take no images of a scene but triangles, lights and maps. What a case
//! gives them is its [`Stage`]: [`Solids`] for [`DrawnEffect::Geometry`] and
//! [`DrawnEffect::Forward`], [`Surfaces`] for [`DrawnEffect::Lighting`], a [`LightMap`]
//! for [`DrawnEffect::Environment`].

mod environment;
mod forward;
mod geometry;
mod light_map;
mod lighting;
mod probes;
mod solids;
mod surfaces;

use std::fmt;
use std::sync::Arc;

use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_effects::EffectError;
use etalon_effects::environment::Surroundings;

pub use self::light_map::LightMap;
pub use self::solids::{Solid, Solids};
pub use self::surfaces::{Rooms, Surfaces};
use super::CaseError;
use crate::frame::FrameSize;

/// An effect that is no function of a scene's images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DrawnEffect {
    /// Depth, velocity and G-buffer.
    Geometry,
    /// Lights added up from a G-buffer.
    Lighting,
    /// Light from everywhere, blurred by roughness.
    Environment,
    /// Surfaces lit as they are drawn, and glass over them.
    Forward,
}

impl DrawnEffect {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Geometry,
        Self::Lighting,
        Self::Environment,
        Self::Forward,
    ];

    /// Its module of `etalon-effects`, and its folder of kernels.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Geometry => "geometry",
            Self::Lighting => "lighting",
            Self::Environment => "environment",
            Self::Forward => "forward",
        }
    }

    /// That of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    fn cases(self) -> impl Iterator<Item = &'static DrawnCase> {
        let (own, probes): (&[DrawnCase], &[DrawnCase]) = match self {
            Self::Geometry => (geometry::CASES, &[]),
            Self::Lighting => (lighting::CASES, probes::CASES),
            Self::Environment => (environment::CASES, &[]),
            Self::Forward => (forward::CASES, &[]),
        };
        own.iter().chain(probes)
    }
}

impl fmt::Display for DrawnEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A hard case of one of these effects.
#[derive(Clone, Copy, Debug)]
pub struct DrawnCase {
    /// By which it is known: lower case and hyphens, unique.
    pub name: &'static str,
    /// What goes wrong on it, and where.
    pub reason: &'static str,
    /// Where that is known from: a paper, a specification, a thread.
    pub source: &'static str,
    /// Why sums in a target may be infinite, if they may.
    pub overflows: Option<&'static str>,
    build: fn() -> Result<Stage, CaseError>,
}

impl DrawnCase {
    const fn new(
        name: &'static str,
        reason: &'static str,
        source: &'static str,
        build: fn() -> Result<Stage, CaseError>,
    ) -> Self {
        Self {
            name,
            reason,
            source,
            overflows: None,
            build,
        }
    }

    /// With sums beyond what the target holds.
    const fn overflowing(self, why: &'static str) -> Self {
        Self {
            overflows: Some(why),
            ..self
        }
    }

    /// Makes what the effect is given.
    ///
    /// # Errors
    /// If memory runs out; the cases are otherwise possible.
    pub fn stage(&self) -> Result<Stage, CaseError> {
        (self.build)()
    }
}

/// What a case gives its effect.
#[derive(Clone, Debug)]
pub enum Stage {
    /// Triangles.
    Solids(Box<Solids>),
    /// A G-buffer.
    Surfaces(Box<Surfaces>),
    /// A map of light from all directions.
    LightMap(Box<LightMap>),
}

impl Stage {
    /// Pixels of the picture, or of the map's image.
    #[must_use]
    pub fn size(&self) -> FrameSize {
        match self {
            Self::Solids(solids) => solids.size,
            Self::Surfaces(surfaces) => surfaces.step.frame.size(),
            Self::LightMap(map) => map.size,
        }
    }

    /// What the graph's imports hold.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        match self {
            Self::Solids(solids) => solids.inputs(),
            Self::Surfaces(surfaces) => surfaces.inputs(),
            Self::LightMap(map) => map.inputs(),
        }
    }

    /// Hands it the table of [`mirroring`], which it else makes in every frame at the cost
    /// of far more than the case.
    ///
    /// [`mirroring`]: etalon_effects::environment::mirroring
    pub fn give_mirroring(&mut self, table: &Arc<ImageData>) {
        match self {
            Self::Solids(solids) => solids.mirroring = Some(Arc::clone(table)),
            Self::Surfaces(surfaces) => surfaces.mirroring = Some(Arc::clone(table)),
            // Its own is what it is about.
            Self::LightMap(_) => {}
        }
    }

    /// The graph of the effect; its results are outputs.
    ///
    /// # Errors
    /// If the effect or the graph refuses it.
    pub fn graph(&self, effect: DrawnEffect) -> Result<Graph, EffectError> {
        match self {
            Self::Solids(solids) if effect == DrawnEffect::Geometry => solids.geometry(),
            Self::Solids(solids) => solids.forward(),
            Self::Surfaces(surfaces) => surfaces.lighting(),
            Self::LightMap(map) => map.environment(),
        }
    }
}

/// Surroundings with a table that was given, if they have light for it.
fn with_mirroring(
    graph: &mut Graph,
    surroundings: Surroundings,
    table: Option<&Arc<ImageData>>,
) -> Result<Surroundings, EffectError> {
    let mirroring = match table.filter(|_| surroundings.shine()) {
        Some(table) => Some(graph.import_texture(MIRRORING, table.desc)?),
        None => None,
    };
    Ok(Surroundings {
        mirroring,
        ..surroundings
    })
}

/// The import of a table that was given.
const MIRRORING: &str = "mirroring";

/// All cases with their effects.
pub fn drawn_cases() -> impl Iterator<Item = (DrawnEffect, &'static DrawnCase)> {
    DrawnEffect::ALL
        .into_iter()
        .flat_map(|effect| effect.cases().map(move |case| (effect, case)))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::cases::cases;

    #[test]
    fn every_case_has_its_own_name_a_reason_and_a_source() {
        let mut names: BTreeSet<&str> = cases().map(|(_, case)| case.name).collect();
        let mut reasons = BTreeSet::new();
        for (_, case) in drawn_cases() {
            assert!(names.insert(case.name), "{} is there twice", case.name);
            assert!(case.reason.len() > 20, "{}", case.name);
            assert!(reasons.insert(case.reason), "{}", case.name);
            assert!(!case.source.is_empty(), "{}", case.name);
        }
        for effect in DrawnEffect::ALL {
            assert!(effect.cases().count() >= 12, "{effect}");
            assert_eq!(DrawnEffect::named(effect.name()), Some(effect));
        }
    }

    #[test]
    fn every_stage_makes_a_graph_and_is_the_same_each_time() {
        for (effect, case) in drawn_cases() {
            let stage = case
                .stage()
                .unwrap_or_else(|error| panic!("{}: {error}", case.name));
            let graph = stage.graph(effect);
            assert!(graph.is_ok(), "{}: {:?}", case.name, graph.err());
            // NaN is not equal to itself, its letters are.
            let again = case.stage().unwrap();
            assert_eq!(format!("{stage:?}"), format!("{again:?}"), "{}", case.name);
        }
    }
}

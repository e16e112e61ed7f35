//! What is run on what.

use std::sync::Arc;

use etalon_core::backend::Inputs;
use etalon_core::image::ImageData;
use etalon_effects::EffectEntry;
use etalon_scenes::FrameSize;
use etalon_scenes::cases::Step;
use etalon_scenes::cases::drawn::{DrawnEffect, Stage};

/// An effect of either kind.
#[derive(Clone, Copy, Debug)]
pub enum Effect {
    /// A function of a scene's images.
    OfImages(EffectEntry),
    /// One that draws, or lights.
    Drawn(DrawnEffect),
}

impl Effect {
    /// By which it is known.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::OfImages(entry) => entry.name,
            Self::Drawn(effect) => effect.name(),
        }
    }

    /// All names that there are.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let of_images = etalon_effects::effects().iter().map(|entry| entry.name);
        of_images.chain(DrawnEffect::ALL.map(DrawnEffect::name))
    }

    /// How it comes to its results.
    #[must_use]
    pub const fn drawing(&self) -> Drawing {
        match self {
            Self::OfImages(_) | Self::Drawn(DrawnEffect::Environment) => Drawing::None,
            Self::Drawn(DrawnEffect::Lighting) => Drawing::Covering,
            Self::Drawn(DrawnEffect::Geometry | DrawnEffect::Forward) => Drawing::Triangles,
        }
    }
}

/// What of an effect a rasteriser has a part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawing {
    /// None: kernels compute.
    None,
    /// Fragments over the whole picture, blended.
    Covering,
    /// Triangles.
    Triangles,
}

/// One frame of a case.
#[derive(Clone, Debug)]
pub enum Scene {
    /// Images of a scene.
    Images(Box<Step>),
    /// What is drawn and lit.
    Stage(Stage),
}

impl Scene {
    /// Of the picture.
    #[must_use]
    pub fn size(&self) -> FrameSize {
        match self {
            Self::Images(step) => step.frame.size(),
            Self::Stage(stage) => stage.size(),
        }
    }

    /// What graphs are given.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        match self {
            Self::Images(step) => step.frame.inputs(),
            Self::Stage(stage) => stage.inputs(),
        }
    }

    /// Hands it what it else makes in every frame.
    pub fn give_mirroring(&mut self, table: &Arc<ImageData>) {
        if let Self::Stage(stage) = self {
            stage.give_mirroring(table);
        }
    }

    /// The light that it gives, if any of it is an image.
    #[must_use]
    pub fn light(&self) -> Option<&ImageData> {
        match self {
            Self::Images(step) => Some(&step.frame.colour),
            Self::Stage(Stage::LightMap(map)) => Some(&map.base),
            Self::Stage(Stage::Surfaces(_) | Stage::Solids(_)) => None,
        }
    }
}

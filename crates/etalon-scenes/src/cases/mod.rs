//! The corpus of hard cases: named inputs that effects of this kind are known to
//! break on, each with why it is hard and where that is known from.
//!
//! A [`Case`] makes one frame, or several in a row for what has a history, at its
//! own small size. What is to hold of every effect on every case — numbers
//! everywhere, the same bits on every backend under strict arithmetic, a bounded
//! rounding error — is for whoever runs them; a case that cannot keep the last of
//! these says so in [`Case::expected`], with the reason.
//!
//! ```
//! use etalon_scenes::cases::{case, cases};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let hard = case("ray-parallel-to-view-plane").ok_or("no such case")?;
//! let steps = hard.steps()?;
//! println!("{}: {} ({})", hard.name, hard.reason, hard.source);
//! assert!(steps[0].frame.size().pixels() > 0);
//! assert!(cases().count() >= 120);
//! # Ok(())
//! # }
//! ```

mod bits;
mod depth;
pub mod drawn;
mod light;
mod materials;
mod normals;
mod paint;
mod rays;
mod sizes;
mod time;
mod tone;

use std::fmt;

use etalon_core::graph::{Graph, GraphError};
use etalon_core::image::ImageError;
use etalon_effects::knob::KnobValue;
use etalon_effects::{CameraParams, EffectError, SceneInputs};
use thiserror::Error;

use crate::camera::CameraError;
use crate::frame::{Frame, FrameError, FrameSize};
use crate::scenes::{WorldError, scene};

/// What a case is hard about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// Where mirror rays go.
    Rays,
    /// Normals that are none, or point the wrong way.
    Normals,
    /// Depths at and beyond the ends of their range, and projections.
    Depth,
    /// Reflectance and roughness at their ends.
    Materials,
    /// Amounts of light.
    Light,
    /// Where tone curves bend, end or divide.
    Tone,
    /// Widths and heights.
    Sizes,
    /// Time between frames, and what histories hold.
    Time,
    /// Every bit pattern.
    Bits,
}

impl Family {
    /// All of them, in the order of the corpus.
    pub const ALL: [Self; 9] = [
        Self::Rays,
        Self::Normals,
        Self::Depth,
        Self::Materials,
        Self::Light,
        Self::Tone,
        Self::Sizes,
        Self::Time,
        Self::Bits,
    ];

    /// In lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::Normals => "normals",
            Self::Depth => "depth",
            Self::Materials => "materials",
            Self::Light => "light",
            Self::Tone => "tone",
            Self::Sizes => "sizes",
            Self::Time => "time",
            Self::Bits => "bits",
        }
    }

    const fn cases(self) -> &'static [Case] {
        match self {
            Self::Rays => rays::CASES,
            Self::Normals => normals::CASES,
            Self::Depth => depth::CASES,
            Self::Materials => materials::CASES,
            Self::Light => light::CASES,
            Self::Tone => tone::CASES,
            Self::Sizes => sizes::CASES,
            Self::Time => time::CASES,
            Self::Bits => bits::CASES,
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A rounding error that a case cannot do without.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The effect, by its name in the registry.
    pub effect: &'static str,
    /// Largest error in place of the usual one, relative.
    pub bound: f64,
    /// Why no formula avoids it.
    pub reason: &'static str,
}

/// For how long a fault in one frame may show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recovery {
    /// The effect whose history must not keep it.
    pub effect: &'static str,
    /// The frame that is at fault.
    pub poisoned: usize,
    /// Frames after it from which on the results are those without the fault.
    pub frames: usize,
}

/// One input that is hard, or several in a row.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// By which it is known: lower case and hyphens, unique.
    pub name: &'static str,
    /// What goes wrong on it, and where.
    pub reason: &'static str,
    /// Where that is known from: a paper, a specification, a thread.
    pub source: &'static str,
    /// Effects that it concerns, by name; empty for all.
    pub effects: &'static [&'static str],
    /// Knobs that are set, of all effects of [`Case::effects`].
    pub knobs: &'static [(&'static str, KnobValue)],
    /// Larger rounding errors, with their reasons.
    pub expected: &'static [Expected],
    /// The same where reflections are searched by another way than the default one; what
    /// is expected of that, unless something is said here.
    pub searched: &'static [Expected],
    /// For sequences with a fault in them.
    pub recovery: Option<Recovery>,
    build: fn() -> Result<Vec<Step>, CaseError>,
}

impl Case {
    const fn new(
        name: &'static str,
        reason: &'static str,
        source: &'static str,
        build: fn() -> Result<Vec<Step>, CaseError>,
    ) -> Self {
        Self {
            name,
            reason,
            source,
            effects: &[],
            knobs: &[],
            expected: &[],
            searched: &[],
            recovery: None,
            build,
        }
    }

    /// For these effects alone.
    const fn on(self, effects: &'static [&'static str]) -> Self {
        Self { effects, ..self }
    }

    /// With knobs set.
    const fn with(self, knobs: &'static [(&'static str, KnobValue)]) -> Self {
        Self { knobs, ..self }
    }

    /// With larger errors.
    const fn expecting(self, expected: &'static [Expected]) -> Self {
        Self {
            expected,
            searched: expected,
            ..self
        }
    }

    /// With larger errors where reflections are searched by texels.
    const fn expecting_of_searches(self, searched: &'static [Expected]) -> Self {
        Self { searched, ..self }
    }

    /// With a fault in a frame.
    const fn recovering(self, poisoned: usize, frames: usize) -> Self {
        Self {
            recovery: Some(Recovery {
                effect: "exposure",
                poisoned,
                frames,
            }),
            ..self
        }
    }

    /// Makes the frames, at least one, all of one size.
    ///
    /// # Errors
    /// If memory runs out; the cases of the corpus are otherwise possible.
    pub fn steps(&self) -> Result<Vec<Step>, CaseError> {
        let steps = (self.build)()?;
        if steps.is_empty() {
            return Err(CaseError::Empty { name: self.name });
        }
        Ok(steps)
    }

    /// Whether an effect is to be run on it.
    #[must_use]
    pub fn concerns(&self, effect: &str) -> bool {
        self.effects.is_empty() || self.effects.contains(&effect)
    }

    /// The larger error that is expected of an effect, if any.
    #[must_use]
    pub fn expected_of(&self, effect: &str) -> Option<&'static Expected> {
        self.expected.iter().find(|known| known.effect == effect)
    }
}

/// One frame of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The images.
    pub frame: Frame,
    /// The projection, in place of [`Frame::camera_params`]: some are none that a
    /// frame's own camera can have.
    pub camera: CameraParams,
    /// Seconds since the frame before, in `[0, 1e6]`.
    pub delta_time: f32,
}

impl Step {
    /// Imports the images into a graph, each under its name in [`Frame::IMAGES`].
    ///
    /// # Errors
    /// If the graph has imports of these names already.
    pub fn import(&self, graph: &mut Graph) -> Result<SceneInputs, GraphError> {
        let inputs = self.frame.import(graph, self.delta_time)?;
        Ok(SceneInputs {
            camera: self.camera,
            ..inputs
        })
    }
}

/// A scene of the registry as a case's frame.
struct FrameSource(&'static str);

impl FrameSource {
    fn steps(&self, (width, height): (u32, u32)) -> Result<Vec<Step>, CaseError> {
        let entry = scene(self.0).ok_or(CaseError::Empty { name: self.0 })?;
        let frame = entry.frame(FrameSize::new(width, height)?)?;
        Ok(vec![Step {
            camera: frame.camera_params(),
            frame,
            delta_time: paint::FRAME_TIME,
        }])
    }
}

/// Why a case cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CaseError {
    /// Its frame is not possible.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Its images are not possible.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Its camera is not possible.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// An effect refuses what it gives.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// Its scene is not possible.
    #[error(transparent)]
    World(#[from] WorldError),
    /// It makes no frame.
    #[error("case `{name}` makes no frame")]
    Empty {
        /// Its name.
        name: &'static str,
    },
}

/// All cases with their families.
pub fn cases() -> impl Iterator<Item = (Family, &'static Case)> {
    Family::ALL
        .into_iter()
        .flat_map(|family| family.cases().iter().map(move |case| (family, case)))
}

/// The case of a name.
#[must_use]
pub fn case(name: &str) -> Option<&'static Case> {
    cases().map(|(_, case)| case).find(|case| case.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_its_own_name_a_reason_and_a_source() {
        let mut names = std::collections::BTreeSet::new();
        let mut reasons = std::collections::BTreeSet::new();
        for (_, case) in cases() {
            assert!(names.insert(case.name), "{} is there twice", case.name);
            assert!(
                case.name
                    .chars()
                    .all(|one| one.is_ascii_lowercase() || one.is_ascii_digit() || one == '-'),
                "{}",
                case.name
            );
            assert!(case.reason.len() > 20, "{}", case.name);
            assert!(
                reasons.insert(case.reason),
                "{}: no reason of its own",
                case.name
            );
            assert!(!case.source.is_empty(), "{}", case.name);
            for expected in case.expected.iter().chain(case.searched) {
                assert!(expected.bound > 0.0 && expected.reason.len() > 20);
            }
        }
        assert!(names.len() >= 120, "{}", names.len());
        assert!(case("no such case").is_none());
    }

    #[test]
    fn every_case_makes_frames_of_one_size_and_the_same_each_time() {
        for (_, case) in cases() {
            let steps = case
                .steps()
                .unwrap_or_else(|error| panic!("{}: {error}", case.name));
            let size = steps[0].frame.size();
            assert!(size.pixels() <= 1 << 17, "{}", case.name);
            for step in &steps {
                assert_eq!(step.frame.size(), size, "{}", case.name);
                assert_eq!(step.camera.validate(), Ok(()), "{}", case.name);
                for (name, image) in step.frame.images() {
                    assert_eq!(
                        (image.desc.extent.width, image.desc.extent.height),
                        (size.width(), size.height()),
                        "{}: {name}",
                        case.name
                    );
                }
            }
            let bytes = |steps: &[Step]| -> Vec<Vec<u8>> {
                let images = steps.iter().flat_map(|step| step.frame.images());
                images.map(|(_, image)| image.bytes.clone()).collect()
            };
            let again = case.steps().unwrap();
            assert!(
                bytes(&steps) == bytes(&again),
                "{} differs from itself",
                case.name
            );
        }
    }
}

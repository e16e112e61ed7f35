//! What can be wrong with a model, and where.

use std::fmt;

use thiserror::Error;

use crate::camera::CameraError;

/// A part of a model, as errors name it: `mesh 3 "wheel"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// What it is: `mesh`, `material`, `node`, …
    pub kind: &'static str,
    /// Its index in the model; `None` for what is in no model yet.
    pub index: Option<usize>,
    /// Its name; may be empty.
    pub name: String,
}

impl Place {
    pub(crate) fn new(kind: &'static str, index: usize, name: &str) -> Self {
        Self {
            kind,
            index: Some(index),
            name: name.into(),
        }
    }

    pub(crate) fn loose(kind: &'static str, name: &str) -> Self {
        Self {
            kind,
            index: None,
            name: name.into(),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind)?;
        if let Some(index) = self.index {
            write!(f, " {index}")?;
        }
        if !self.name.is_empty() {
            write!(f, " {:?}", self.name)?;
        }
        Ok(())
    }
}

/// Why a model, or a part of one, cannot be made or posed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A number is no use.
    #[error("{what} of {place} is {value}; it must be {need}")]
    Value {
        /// Of what.
        place: Place,
        /// Which of its numbers, with the element if there are several.
        what: String,
        /// As given.
        value: Box<str>,
        /// What would be right.
        need: &'static str,
    },
    /// There are more or fewer of something than there have to be.
    #[error("{place} has {count} {what}; there must be {need}")]
    Count {
        /// Of what.
        place: Place,
        /// Which of its lists.
        what: &'static str,
        /// As given.
        count: u64,
        /// What would be right.
        need: String,
    },
    /// Something refers to what is not there.
    #[error("{what} of {place} is {target} {index}, but there are {count}")]
    Index {
        /// What refers.
        place: Place,
        /// By which of its properties.
        what: String,
        /// What is referred to.
        target: &'static str,
        /// As given.
        index: u64,
        /// How many there are; indices are below.
        count: usize,
    },
    /// A node is its own ancestor.
    #[error("{0} is its own ancestor; parents must form a forest")]
    Cycle(Place),
    /// A property is not possible beside another one.
    #[error("{place}: {problem}")]
    Conflict {
        /// Where.
        place: Place,
        /// What contradicts what, and what would be right.
        problem: String,
    },
    /// A camera is invalid.
    #[error("{place}: {source}")]
    Camera {
        /// Which one.
        place: Place,
        /// What is wrong with it.
        source: Box<CameraError>,
    },
}

/// Checks of numbers, naming the place.
pub(crate) struct Check<'a>(pub(crate) &'a Place);

impl Check<'_> {
    pub(crate) fn value(
        &self,
        what: impl Into<String>,
        value: impl fmt::Debug,
        need: &'static str,
        right: bool,
    ) -> Result<(), ModelError> {
        if right {
            return Ok(());
        }
        Err(ModelError::Value {
            place: self.0.clone(),
            what: what.into(),
            value: format!("{value:?}").into(),
            need,
        })
    }

    /// Every element of a list; the element's index is part of the message.
    pub(crate) fn each<T: fmt::Debug>(
        &self,
        what: &'static str,
        values: &[T],
        need: &'static str,
        right: impl Fn(&T) -> bool,
    ) -> Result<(), ModelError> {
        match values.iter().position(|value| !right(value)) {
            None => Ok(()),
            Some(i) => self.value(format!("{what} {i}"), &values[i], need, false),
        }
    }

    pub(crate) fn unit(&self, what: &'static str, value: f32) -> Result<(), ModelError> {
        self.value(what, value, "in [0, 1]", (0.0..=1.0).contains(&value))
    }

    pub(crate) fn not_negative(&self, what: &'static str, value: f32) -> Result<(), ModelError> {
        self.value(
            what,
            value,
            "finite and not negative",
            value.is_finite() && value >= 0.0,
        )
    }

    pub(crate) fn count(
        &self,
        what: &'static str,
        count: usize,
        need: impl Into<String>,
        right: bool,
    ) -> Result<(), ModelError> {
        if right {
            return Ok(());
        }
        Err(ModelError::Count {
            place: self.0.clone(),
            what,
            count: count as u64,
            need: need.into(),
        })
    }

    pub(crate) fn index(
        &self,
        what: impl Into<String>,
        target: &'static str,
        index: usize,
        count: usize,
    ) -> Result<(), ModelError> {
        if index < count {
            return Ok(());
        }
        Err(ModelError::Index {
            place: self.0.clone(),
            what: what.into(),
            target,
            index: index as u64,
            count,
        })
    }
}

/// Whether every component is finite.
pub(crate) fn finite<const N: usize>(value: &[f32; N]) -> bool {
    value.iter().all(|x| x.is_finite())
}

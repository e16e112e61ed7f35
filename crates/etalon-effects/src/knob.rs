//! Settings as data: which knobs an effect has, what each may be set to, and
//! which values are worth trying.
//!
//! An effect's settings stay a plain struct; beside it stands one table of
//! [`Knob`]s, a line per field. Checking a range, sweeping a setting against its
//! error and its time, and setting it by name on a command line all read that
//! table, so a range is written down once.

use std::fmt;

use thiserror::Error;

use crate::SettingError;
use crate::quality::{Quality, preset};

/// What a knob is set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnobValue {
    /// A quantity.
    Real(f32),
    /// A number of things.
    Count(u32),
    /// One of several ways.
    Choice(&'static str),
}

impl fmt::Display for KnobValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real(value) => value.fmt(f),
            Self::Count(value) => value.fmt(f),
            Self::Choice(name) => f.pad(name),
        }
    }
}

/// What a knob may be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// Any number from the first to the last.
    Real {
        /// Smallest.
        min: f32,
        /// Largest.
        max: f32,
    },
    /// Any whole number from the first to the last.
    Count {
        /// Smallest.
        min: u32,
        /// Largest.
        max: u32,
    },
    /// One of these.
    Choice(&'static [&'static str]),
}

impl fmt::Display for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real { min, max } => write!(f, "a number from {min} to {max}"),
            Self::Count { min, max } => write!(f, "a whole number from {min} to {max}"),
            Self::Choice(names) => write!(f, "one of {}", names.join(", ")),
        }
    }
}

impl Domain {
    /// Whether a value is allowed; NaN never is.
    #[must_use]
    pub fn contains(&self, value: KnobValue) -> bool {
        match (self, value) {
            (Self::Real { min, max }, KnobValue::Real(value)) => (*min..=*max).contains(&value),
            (Self::Count { min, max }, KnobValue::Count(value)) => (*min..=*max).contains(&value),
            (Self::Choice(names), KnobValue::Choice(name)) => names.contains(&name),
            _ => false,
        }
    }

    /// The value that a text says, as [`KnobValue`] prints it; `None` if it says
    /// none that is allowed.
    #[must_use]
    pub fn parse(&self, text: &str) -> Option<KnobValue> {
        let value = match self {
            Self::Real { .. } => KnobValue::Real(text.parse().ok()?),
            Self::Count { .. } => KnobValue::Count(text.parse().ok()?),
            Self::Choice(names) => {
                KnobValue::Choice(names.iter().copied().find(|name| *name == text)?)
            }
        };
        self.contains(value).then_some(value)
    }

    /// Why a value is refused. Only numbers can lie outside: a choice that there
    /// is not cannot be made.
    fn refusal(
        &self,
        effect: &'static str,
        field: &'static str,
        value: KnobValue,
    ) -> Option<SettingError> {
        let (value, min, max) = match (self, value) {
            (Self::Real { min, max }, KnobValue::Real(value)) => {
                (value.into(), (*min).into(), (*max).into())
            }
            (Self::Count { min, max }, KnobValue::Count(value)) => {
                (value.into(), (*min).into(), (*max).into())
            }
            _ => return None,
        };
        Some(SettingError {
            effect,
            field,
            value,
            min,
            max,
        })
    }
}

/// What turning a knob does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Brings the result nearer to the same ideal, or further from it, for more
    /// or less work.
    Accuracy,
    /// Asks for another picture, which is as right as the one before.
    Look,
    /// Changes how much work it is, and no bit of the picture.
    Cost,
}

/// One setting of the effect whose settings are `S`.
#[derive(Debug)]
pub struct Knob<S> {
    /// The field's name.
    pub name: &'static str,
    /// What it does, in a few words; the field's documentation says more.
    pub description: &'static str,
    /// Of a quantity; empty for a share or a number of things.
    pub unit: &'static str,
    /// What turning it does.
    pub role: Role,
    /// What it may be set to.
    pub domain: Domain,
    /// Values worth trying, from the cheapest to the dearest if they differ in
    /// that.
    pub ladder: &'static [KnobValue],
    /// Reads it.
    pub get: fn(&S) -> KnobValue,
    /// Sets it; `false` if the value is of another kind.
    pub set: fn(&mut S, KnobValue) -> bool,
}

/// Why a knob cannot be turned.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum KnobError {
    /// There is no such knob.
    #[error("{effect} has no setting `{knob}`; it has {}", known.join(", "))]
    Unknown {
        /// The effect.
        effect: &'static str,
        /// As given.
        knob: String,
        /// Those there are.
        known: Vec<&'static str>,
    },
    /// The value is not allowed.
    #[error("{effect}: `{knob}` cannot be {value}; it is {domain}")]
    Value {
        /// The effect.
        effect: &'static str,
        /// The knob.
        knob: &'static str,
        /// As given.
        value: String,
        /// What is allowed.
        domain: Domain,
    },
}

/// The settings of an effect, with their knobs.
pub trait Tunable: Clone + Default + 'static {
    /// The effect's name.
    const EFFECT: &'static str;

    /// One for each field that is a single value.
    fn knobs() -> &'static [Knob<Self>];

    /// The settings of a preset: of accuracy, with the default look.
    #[must_use]
    fn preset(quality: Quality) -> Self {
        // A test holds every preset to its effect's table.
        tuned(preset(Self::EFFECT, quality)).unwrap_or_default()
    }

    /// The knob of a name.
    ///
    /// # Errors
    /// If there is none.
    fn knob(name: &str) -> Result<&'static Knob<Self>, KnobError> {
        let known = || Self::knobs().iter().map(|knob| knob.name);
        Self::knobs()
            .iter()
            .find(|knob| knob.name == name)
            .ok_or_else(|| KnobError::Unknown {
                effect: Self::EFFECT,
                knob: name.to_owned(),
                known: known().collect(),
            })
    }

    /// The same settings with one knob set to a value.
    ///
    /// # Errors
    /// If there is no such knob, or the value is not allowed.
    fn with(mut self, name: &str, value: KnobValue) -> Result<Self, KnobError> {
        let knob = Self::knob(name)?;
        if knob.domain.contains(value) && (knob.set)(&mut self, value) {
            return Ok(self);
        }
        Err(KnobError::Value {
            effect: Self::EFFECT,
            knob: knob.name,
            value: value.to_string(),
            domain: knob.domain,
        })
    }

    /// Checks every knob against its domain.
    ///
    /// # Errors
    /// The first outside of it.
    fn check_knobs(&self) -> Result<(), SettingError> {
        let refusal = |knob: &Knob<Self>| {
            let value = (knob.get)(self);
            if knob.domain.contains(value) {
                return None;
            }
            knob.domain.refusal(Self::EFFECT, knob.name, value)
        };
        Self::knobs().iter().find_map(refusal).map_or(Ok(()), Err)
    }
}

/// A knob, whatever effect it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnobInfo {
    /// See [`Knob::name`].
    pub name: &'static str,
    /// See [`Knob::description`].
    pub description: &'static str,
    /// See [`Knob::unit`].
    pub unit: &'static str,
    /// See [`Knob::role`].
    pub role: Role,
    /// See [`Knob::domain`].
    pub domain: Domain,
    /// See [`Knob::ladder`].
    pub ladder: &'static [KnobValue],
    /// What it is set to if nobody sets it.
    pub default: KnobValue,
}

/// The knobs of an effect, without its type.
#[must_use]
pub fn infos<S: Tunable>() -> Vec<KnobInfo> {
    let default = S::default();
    S::knobs()
        .iter()
        .map(|knob| KnobInfo {
            name: knob.name,
            description: knob.description,
            unit: knob.unit,
            role: knob.role,
            domain: knob.domain,
            ladder: knob.ladder,
            default: (knob.get)(&default),
        })
        .collect()
}

/// The default settings with some knobs set.
///
/// # Errors
/// If there is no such knob, or a value is not allowed.
pub fn tuned<S: Tunable>(values: &[(&str, KnobValue)]) -> Result<S, KnobError> {
    let mut settings = S::default();
    for &(name, value) in values {
        settings = settings.with(name, value)?;
    }
    Ok(settings)
}

/// A way out of several, by name.
pub(crate) trait Choice: Copy + 'static {
    const NAMES: &'static [&'static str];
    fn name(self) -> &'static str;
    fn named(name: &str) -> Option<Self>;
}

impl Choice for bool {
    const NAMES: &'static [&'static str] = &["off", "on"];

    fn name(self) -> &'static str {
        Self::NAMES[usize::from(self)]
    }

    fn named(name: &str) -> Option<Self> {
        match name {
            "off" => Some(false),
            "on" => Some(true),
            _ => None,
        }
    }
}

/// Implements [`Choice`] for an enum: a line for each variant with its name.
macro_rules! choices {
    ($type:ty { $($variant:ident => $name:literal,)* }) => {
        impl $crate::knob::Choice for $type {
            const NAMES: &'static [&'static str] = &[$($name),*];

            fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            fn named(name: &str) -> Option<Self> {
                match name { $($name => Some(Self::$variant),)* _ => None }
            }
        }
    };
}

/// Implements [`Tunable`]: a line for each field, with its kind, role, domain,
/// ladder, unit and description.
macro_rules! knobs {
    (@domain real [$min:expr, $max:expr] $field:ident $settings:ty) => {
        $crate::knob::Domain::Real { min: $min, max: $max }
    };
    (@domain count [$min:expr, $max:expr] $field:ident $settings:ty) => {
        $crate::knob::Domain::Count { min: $min, max: $max }
    };
    (@domain choice [$type:ty] $field:ident $settings:ty) => {
        $crate::knob::Domain::Choice(<$type as $crate::knob::Choice>::NAMES)
    };
    (@ladder real [$($value:expr),*]) => { &[$($crate::knob::KnobValue::Real($value)),*] };
    (@ladder count [$($value:expr),*]) => { &[$($crate::knob::KnobValue::Count($value)),*] };
    (@ladder choice [$($value:expr),*]) => { &[$($crate::knob::KnobValue::Choice($value)),*] };
    (@get real $field:ident) => { |settings| $crate::knob::KnobValue::Real(settings.$field) };
    (@get count $field:ident) => { |settings| $crate::knob::KnobValue::Count(settings.$field) };
    (@get choice $field:ident) => {
        |settings| $crate::knob::KnobValue::Choice($crate::knob::Choice::name(settings.$field))
    };
    (@set real $field:ident) => {
        |settings, value| {
            let $crate::knob::KnobValue::Real(value) = value else { return false };
            settings.$field = value;
            true
        }
    };
    (@set count $field:ident) => {
        |settings, value| {
            let $crate::knob::KnobValue::Count(value) = value else { return false };
            settings.$field = value;
            true
        }
    };
    (@set choice $field:ident) => {
        |settings, value| {
            let $crate::knob::KnobValue::Choice(name) = value else { return false };
            let Some(value) = $crate::knob::Choice::named(name) else { return false };
            settings.$field = value;
            true
        }
    };
    ($settings:ty, $effect:literal {
        $($kind:ident $field:ident $domain:tt $unit:literal, $role:ident $ladder:tt, $description:literal;)*
    }) => {
        impl $crate::knob::Tunable for $settings {
            const EFFECT: &'static str = $effect;

            fn knobs() -> &'static [$crate::knob::Knob<Self>] {
                const KNOBS: &[$crate::knob::Knob<$settings>] = &[$($crate::knob::Knob {
                    name: stringify!($field),
                    description: $description,
                    unit: $unit,
                    role: $crate::knob::Role::$role,
                    domain: $crate::knob::knobs!(@domain $kind $domain $field $settings),
                    ladder: $crate::knob::knobs!(@ladder $kind $ladder),
                    get: $crate::knob::knobs!(@get $kind $field),
                    set: $crate::knob::knobs!(@set $kind $field),
                }),*];
                KNOBS
            }
        }
    };
}

pub(crate) use {choices, knobs};

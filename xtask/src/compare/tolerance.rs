//! Tolerances as data, and verdicts.

use std::borrow::Cow;
use std::sync::Arc;

use etalon_core::image::ImageData;
use serde::Serialize;

use super::figures::{Channel, CompareError, Comparison, Difference, Ulps, texels_with};

/// How far an image may be from its reference.
///
/// A NaN or infinity that only one of the images has is never tolerated.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Tolerance {
    /// Not at all: 0 ULPs everywhere. The signs of zeros, subnormal `f32`
    /// values (which WGSL lets devices flush) and the payloads of NaNs are not
    /// looked at.
    BitEqual,
    /// Each texel as far as perturbed executions move it.
    Spread {
        /// For each channel of each texel, in storage order, in the unit of the decoded
        /// values.
        #[serde(skip)]
        allowed: Arc<[[f32; 4]]>,
        /// Texels that may lie beyond: as many as were decided otherwise.
        decided: u64,
    },
    /// Within a limit derived from how the values are computed.
    Within {
        /// For every channel of the texels that are not outliers.
        limit: Limit,
        /// The share of texels that may lie beyond the limit, 0 to 1. Above 0
        /// only where a decision (a hit or a miss, a tap or its neighbour)
        /// hangs on a rounded value.
        outliers: f64,
        /// Where the figures come from.
        reason: Cow<'static, str>,
    },
}

/// A bound on differences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// In units of the last place of the storage format.
    Ulps(u64),
    /// In the unit of the decoded values.
    Absolute(f64),
    /// In the unit of the decoded values: `absolute + relative · |reference|`.
    Relative {
        /// Share of the reference's magnitude.
        relative: f64,
        /// What is tolerated of 0.
        absolute: f64,
    },
}

impl Tolerance {
    /// At most `max` units of the last place, everywhere.
    #[must_use]
    pub fn ulps(max: u64, reason: impl Into<Cow<'static, str>>) -> Self {
        Self::Within {
            limit: Limit::Ulps(max),
            outliers: 0.0,
            reason: reason.into(),
        }
    }

    /// Differences of at most `max`, everywhere.
    #[must_use]
    pub fn absolute(max: f64, reason: impl Into<Cow<'static, str>>) -> Self {
        Self::Within {
            limit: Limit::Absolute(max),
            outliers: 0.0,
            reason: reason.into(),
        }
    }

    /// The same limit for all but a share of the texels.
    #[must_use]
    pub fn with_outliers(self, share: f64) -> Self {
        match self {
            Self::BitEqual | Self::Spread { .. } => self,
            Self::Within { limit, reason, .. } => Self::Within {
                limit,
                outliers: share,
                reason,
            },
        }
    }

    /// In a few words: `bit equal`, `≤ 2 ULP`, `≤ 0.001 but for 0.5 %`.
    #[must_use]
    pub fn summary(&self) -> String {
        match self {
            Self::BitEqual => "bit equal".to_owned(),
            Self::Spread { decided: 0, .. } => "≤ spread".to_owned(),
            Self::Spread { decided, .. } => format!("≤ spread but for {decided}"),
            Self::Within {
                limit, outliers, ..
            } => {
                let limit = match limit {
                    Limit::Ulps(max) => format!("≤ {max} ULP"),
                    Limit::Absolute(max) => format!("≤ {max}"),
                    Limit::Relative { relative, absolute } => {
                        format!("≤ {} + {} %", short(*absolute), short(relative * 100.0))
                    }
                };
                if *outliers > 0.0 {
                    format!("{limit} but for {} %", outliers * 100.0)
                } else {
                    limit
                }
            }
        }
    }

    /// Why it is as it is.
    #[must_use]
    pub fn reason(&self) -> &str {
        match self {
            Self::BitEqual => {
                "strict arithmetic allows one result only: operations are correctly rounded, in one order, \
                 without contraction, and stores round explicitly"
            }
            Self::Spread { .. } => {
                "four times what the largest of eight executions moved it that rounded, fused and flushed as WGSL \
                 allows, and a unit for the store; texels are left out where these decided otherwise"
            }
            Self::Within { reason, .. } => reason,
        }
    }

    /// Whether a comparison of the two images is within the tolerance.
    ///
    /// # Errors
    /// If the images cannot be compared.
    pub fn judge(
        &self,
        comparison: &Comparison,
        reference: &ImageData,
        subject: &ImageData,
    ) -> Result<Verdict, CompareError> {
        // Written so that a limit of NaN tolerates nothing.
        let (limit, outliers) = match self {
            Self::BitEqual => (Limit::Ulps(0), 0),
            Self::Spread { decided, .. } => (Limit::Absolute(0.0), *decided),
            Self::Within {
                limit, outliers, ..
            } => (*limit, (outliers * comparison.texels as f64) as u64),
        };
        let own = |Channel { texel, channel }: Channel| match self {
            Self::Spread { allowed, .. } => {
                let texel = allowed.get(texel).copied().unwrap_or_default();
                Limit::Absolute(texel[channel].into())
            }
            _ => limit,
        };
        let within = |at: Channel, difference: &Difference| {
            difference.ulps != Ulps::INFINITE
                && match own(at) {
                    Limit::Ulps(max) => difference.ulps <= Ulps(max),
                    Limit::Absolute(max) => difference.absolute() <= max,
                    Limit::Relative { relative, absolute } => {
                        difference.absolute() <= absolute + relative * difference.reference.abs()
                    }
                }
        };
        if comparison.max_ulp == Ulps(0) {
            return Ok(Verdict::Pass);
        }
        if comparison.max_ulp == Ulps::INFINITE {
            return Ok(Verdict::Fail(
                "a NaN or infinity is in one image only".to_owned(),
            ));
        }
        let beyond = texels_with(reference, subject, |at, difference| !within(at, difference))?;
        let share = beyond as f64 / comparison.texels.max(1) as f64;
        if beyond <= outliers {
            return Ok(Verdict::Pass);
        }
        Ok(Verdict::Fail(format!(
            "{beyond} texel{} ({:.3} %) not {}",
            if beyond == 1 { "" } else { "s" },
            share * 100.0,
            self.summary()
        )))
    }
}

/// A number in three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (2.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.digits$}")
}

/// The outcome of one comparison.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "why", rename_all = "kebab-case")]
pub enum Verdict {
    /// Within the tolerance.
    Pass,
    /// Beyond it, and by how much.
    Fail(String),
}

impl Verdict {
    /// Whether it is a pass.
    #[must_use]
    pub const fn passed(&self) -> bool {
        matches!(self, Self::Pass)
    }
}

//! A program linked for every number type.

use std::sync::OnceLock;

use super::link::Linked;
use super::tier::Tier;
use crate::code::Code;
use crate::num::Shadow;

/// By instruction set; each when it is first needed.
type ByTier<N> = [OnceLock<Linked<N>>; Tier::ALL.len()];

/// Code linked to the handlers of each number type and instruction set.
#[derive(Default)]
pub(crate) struct Links {
    singles: ByTier<f32>,
    doubles: ByTier<f64>,
    shadowed: ByTier<Shadow>,
}

impl Links {
    pub(crate) fn singles(&self, code: &Code, tier: Tier) -> &Linked<f32> {
        self.singles[tier as usize].get_or_init(|| Linked::new(code, tier))
    }

    pub(crate) fn doubles(&self, code: &Code, tier: Tier) -> &Linked<f64> {
        self.doubles[tier as usize].get_or_init(|| Linked::new(code, tier))
    }

    pub(crate) fn shadowed(&self, code: &Code, tier: Tier) -> &Linked<Shadow> {
        self.shadowed[tier as usize].get_or_init(|| Linked::new(code, tier))
    }
}

//! Textures that live across frames.

use std::collections::BTreeMap;

use etalon_core::graph::ClearValue;
use etalon_core::plan::Plan;
use etalon_core::texel::Texel;

use super::pool::Pool;
use crate::error::RunError;
use crate::memory::Texture;

/// Two textures of one name, which change roles after each frame.
#[derive(Debug)]
pub(super) struct History {
    /// What the next frame reads.
    pub(super) previous: Texture,
    /// What it writes.
    pub(super) current: Texture,
}

/// The histories that the last plan had, by name.
#[derive(Debug, Default)]
pub(super) struct Histories(BTreeMap<String, History>);

pub(super) fn clear_texel(value: ClearValue) -> Texel {
    match value {
        ClearValue::Float(value) => Texel::Float(value),
        ClearValue::Sint(value) => Texel::Sint(value),
        ClearValue::Uint(value) => Texel::Uint(value),
    }
}

impl Histories {
    /// Makes sure that every history of a plan exists in its shape, with its
    /// first contents if it is new. If `watched`, what a frame is to write counts as
    /// unwritten at its start.
    pub(super) fn acquire(
        &mut self,
        plan: &Plan,
        pool: &mut Pool,
        watched: bool,
    ) -> Result<(), RunError> {
        for planned in &plan.histories {
            if let Some(history) = self.0.get_mut(&planned.name)
                && history.previous.desc() == planned.desc
            {
                if watched {
                    history.current.forget()?;
                }
                continue;
            }
            if let Some(other) = self.0.remove(&planned.name) {
                release(other, pool);
            }
            let previous = pool.texture(planned.desc, true)?;
            previous.view().fill(clear_texel(planned.initial));
            let mut current = pool.texture(planned.desc, true)?;
            if watched {
                current.forget()?;
            }
            self.0
                .insert(planned.name.clone(), History { previous, current });
        }
        Ok(())
    }

    pub(super) fn get(&self, name: &str) -> Option<&History> {
        self.0.get(name)
    }

    /// The plan has run: what it wrote is what the next frame reads, and
    /// histories it does not have are gone.
    pub(super) fn advance(&mut self, plan: &Plan, pool: &mut Pool) {
        for (name, mut history) in std::mem::take(&mut self.0) {
            if plan.histories.iter().any(|planned| planned.name == name) {
                std::mem::swap(&mut history.previous, &mut history.current);
                self.0.insert(name, history);
            } else {
                release(history, pool);
            }
        }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self, pool: &mut Pool) {
        for history in std::mem::take(&mut self.0).into_values() {
            release(history, pool);
        }
    }
}

fn release(history: History, pool: &mut Pool) {
    pool.return_texture(history.previous);
    pool.return_texture(history.current);
}

//! What a plan's transients take, and how little they could.

use serde::Serialize;

use crate::graph::ResourceDesc;
use crate::plan::{Placement, Plan, PlannedResource, ResourceKind};

/// Bytes of a plan's transient resources, as its memory model has them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TransientMemory {
    /// Both heaps, in which resources share bytes.
    pub planned: u64,
    /// The largest set alive at once, which no placement can be smaller than. It holds
    /// the resources of the plan's order of steps: another order may need less.
    pub least: u64,
    /// For executors that reuse whole resources rather than bytes: one of each
    /// [slot](Placement::slot).
    pub slots: u64,
    /// The sum of all.
    pub unaliased: u64,
}

impl TransientMemory {
    /// How much more is planned than the least there can be: 0 for nothing, 0.1 for a
    /// tenth.
    #[must_use]
    pub fn excess(&self) -> f64 {
        if self.planned <= self.least {
            0.0
        } else {
            self.planned as f64 / self.least.max(1) as f64 - 1.0
        }
    }
}

/// What is held while a step runs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MemoryAtStep {
    /// The step's name.
    pub step: String,
    /// Bytes of the transients alive.
    pub alive: u64,
    /// The transients alive: indices into [`Plan::resources`], from the lowest.
    pub resources: Vec<u32>,
}

impl PlannedResource {
    /// Where it lives, if it is transient.
    #[must_use]
    pub const fn placement(&self) -> Option<&Placement> {
        match &self.kind {
            ResourceKind::Transient(place) => Some(place),
            _ => None,
        }
    }
}

impl Plan {
    /// What the transients take.
    #[must_use]
    pub fn transient_memory(&self) -> TransientMemory {
        let mut slots: Vec<(bool, u32, u64)> = Vec::new();
        // Where alive bytes begin and end to count, by step.
        let mut changes = vec![(0_u64, 0_u64); self.steps.len() + 1];
        for resource in &self.resources {
            let Some(place) = resource.placement() else {
                continue;
            };
            let texture = matches!(resource.desc, ResourceDesc::Texture(_));
            slots.push((texture, place.slot, place.bytes));
            let [first, last] = [resource.first, resource.last].map(|step| step as usize);
            if let Some((begins, _)) = changes.get_mut(first) {
                *begins = begins.saturating_add(place.bytes);
            }
            if let Some((_, ends)) = changes.get_mut(last + 1) {
                *ends = ends.saturating_add(place.bytes);
            }
        }
        let (mut alive, mut least) = (0_u64, 0_u64);
        for (begins, ends) in changes {
            alive = alive.saturating_sub(ends).saturating_add(begins);
            least = least.max(alive);
        }
        slots.sort_unstable();
        slots.dedup_by_key(|(texture, slot, _)| (*texture, *slot));
        TransientMemory {
            planned: self.texture_heap.saturating_add(self.buffer_heap),
            least,
            slots: slots.iter().map(|(_, _, bytes)| bytes).sum(),
            unaliased: self.unaliased_bytes,
        }
    }

    /// What is held at each step. It takes time in proportion to steps times
    /// resources alive.
    #[must_use]
    pub fn memory_timeline(&self) -> Vec<MemoryAtStep> {
        let mut timeline: Vec<MemoryAtStep> = self
            .steps
            .iter()
            .map(|step| MemoryAtStep {
                step: step.name.clone(),
                ..MemoryAtStep::default()
            })
            .collect();
        for (index, resource) in (0_u32..).zip(&self.resources) {
            let Some(place) = resource.placement() else {
                continue;
            };
            let lives = resource.first as usize..resource.last as usize + 1;
            for at in timeline.get_mut(lives).into_iter().flatten() {
                at.alive = at.alive.saturating_add(place.bytes);
                at.resources.push(index);
            }
        }
        timeline
    }
}

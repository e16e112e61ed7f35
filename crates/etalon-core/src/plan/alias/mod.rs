//! Phase 5: transient resources that live at different times share memory.
//!
//! A [sweep](sweep) over the steps places most plans as closely as can be. Where it
//! leaves more than a little over the largest set alive at once, which no placement can
//! be smaller than, the resources are [packed](pack) in other orders too, and what is
//! smallest is kept. Textures and buffers have a heap each, since Vulkan's
//! `bufferImageGranularity` keeps them apart.
//!
//! Then, for every resource, [how the earlier tenants](tenants) of its bytes were used:
//! it must wait for those uses before its first.

mod pack;
mod sweep;
mod tenants;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use crate::graph::ResourceDesc;
use crate::plan::lifetime::{Ordered, OrderedStep};
use crate::plan::{
    CulledPass, MemoryModel, MemoryNeed, Placement, PlanError, PlannedEffect, PlannedHistory,
    PlannedResource, ResourceKind, UsageSet,
};

/// Everything but the barriers.
#[derive(Debug)]
pub(crate) struct Placed {
    pub(crate) steps: Vec<OrderedStep>,
    pub(crate) resources: Vec<PlannedResource>,
    /// Per resource: how the earlier tenants of its memory were used.
    pub(crate) tenants_before: Vec<UsageSet>,
    pub(crate) histories: Vec<PlannedHistory>,
    pub(crate) culled: Vec<CulledPass>,
    pub(crate) effects: Vec<PlannedEffect>,
    pub(crate) uniforms: Vec<u8>,
    pub(crate) texture_heap: u64,
    pub(crate) buffer_heap: u64,
    pub(crate) heap_alignment: u64,
    pub(crate) unaliased_bytes: u64,
}

/// What needs a place in a heap.
#[derive(Clone, Copy, Debug)]
struct Item {
    /// Of the plan's resources.
    resource: usize,
    /// Steps, both included.
    first: u32,
    last: u32,
    /// More than 0 for everything that takes memory at all.
    bytes: u64,
}

impl Item {
    /// Whether there is a step at which both are alive.
    const fn meets(&self, other: &Self) -> bool {
        self.first <= other.last && other.first <= self.last
    }
}

/// Where each item lives.
#[derive(Clone, Debug, Default)]
struct Layout {
    /// As the items.
    offsets: Vec<u64>,
    /// Of the heap.
    size: u64,
}

/// Gives every transient its place.
pub(crate) fn place(ordered: Ordered, memory: &dyn MemoryModel) -> Result<Placed, PlanError> {
    let Ordered {
        steps,
        mut resources,
        histories,
        culled,
        effects,
        uniforms,
    } = ordered;
    let needs: Vec<Option<MemoryNeed>> = resources
        .iter()
        .map(|resource| match (&resource.kind, &resource.desc) {
            (ResourceKind::Transient(_), ResourceDesc::Texture(desc)) => {
                Some(memory.texture(desc, resource.usages))
            }
            (ResourceKind::Transient(_), ResourceDesc::Buffer(desc)) => {
                Some(memory.buffer(desc, resource.usages))
            }
            _ => None,
        })
        .collect();
    // One alignment for all keeps every free block usable for every resource.
    let heap_alignment = needs
        .iter()
        .flatten()
        .map(|need| need.alignment)
        .max()
        .unwrap_or(1)
        .max(1);

    let (mut textures, mut buffers) = (Vec::new(), Vec::new());
    let mut unaliased_bytes = 0_u64;
    for (resource, need) in needs.iter().enumerate() {
        let Some(need) = need else {
            continue;
        };
        let bytes = need
            .bytes
            .checked_next_multiple_of(heap_alignment)
            .ok_or(PlanError::OutOfRange)?;
        // No offset is larger than this sum.
        unaliased_bytes = unaliased_bytes
            .checked_add(bytes)
            .ok_or(PlanError::OutOfRange)?;
        let PlannedResource {
            first, last, desc, ..
        } = resources[resource];
        let heap = match desc {
            ResourceDesc::Texture(_) => &mut textures,
            ResourceDesc::Buffer(_) => &mut buffers,
        };
        heap.push(Item {
            resource,
            first,
            last,
            bytes,
        });
    }

    let mut tenants_before = vec![UsageSet::EMPTY; resources.len()];
    let mut slots = Slots::default();
    let mut sizes = [0; 2];
    for (items, size) in [textures, buffers].iter_mut().zip(&mut sizes) {
        // In the order of their first steps, which is that of slots too.
        items.sort_by_key(|item| item.first);
        let layout = smallest(items);
        *size = layout.size;
        let usages: Vec<UsageSet> = items
            .iter()
            .map(|item| resources[item.resource].usages)
            .collect();
        let tenants = tenants::before(items, &layout.offsets, &usages);
        let by_slot = slots.all(items, &resources);
        for (k, item) in items.iter().enumerate() {
            tenants_before[item.resource] = tenants[k];
            resources[item.resource].kind = ResourceKind::Transient(Placement {
                offset: layout.offsets[k],
                bytes: item.bytes,
                slot: by_slot[k],
            });
        }
    }
    let [texture_heap, buffer_heap] = sizes;
    Ok(Placed {
        steps,
        resources,
        tenants_before,
        histories,
        culled,
        effects,
        uniforms,
        texture_heap,
        buffer_heap,
        heap_alignment,
        unaliased_bytes,
    })
}

/// The smallest layout found, of items in the order of their first steps.
fn smallest(items: &[Item]) -> Layout {
    let least = least(items);
    let swept = sweep::layout(items);
    if swept.size <= least {
        return swept;
    }
    let packed = pack::layout(items, least);
    if packed.size < swept.size {
        packed
    } else {
        swept
    }
}

/// The largest set alive at once.
fn least(items: &[Item]) -> u64 {
    let mut changes: Vec<(u32, bool, u64)> = items
        .iter()
        .flat_map(|item| {
            [
                (item.first, true, item.bytes),
                (item.last + 1, false, item.bytes),
            ]
        })
        .collect();
    // What ends does so before what begins at the same step.
    changes.sort_unstable();
    let (mut alive, mut least) = (0, 0);
    for (_, begins, bytes) in changes {
        if begins {
            alive += bytes;
            least = least.max(alive);
        } else {
            alive -= bytes;
        }
    }
    least
}

/// Whole resources for reuse, by description.
#[derive(Debug, Default)]
struct Slots {
    count: u32,
    free: HashMap<ResourceDesc, Vec<u32>>,
}

impl Slots {
    /// The slot of each item, of items in the order of their first steps.
    fn all(&mut self, items: &[Item], resources: &[PlannedResource]) -> Vec<u32> {
        let mut ends: Vec<usize> = (0..items.len()).collect();
        ends.sort_by_key(|&k| items[k].last);
        let mut ends = ends.into_iter().peekable();
        let mut slots = vec![0; items.len()];
        for (k, item) in items.iter().enumerate() {
            while let Some(ended) = ends.next_if(|&ended| items[ended].last < item.first) {
                let desc = resources[items[ended].resource].desc;
                self.free.entry(desc).or_default().push(slots[ended]);
            }
            let desc = resources[item.resource].desc;
            let free = self.free.get_mut(&desc).and_then(Vec::pop);
            slots[k] = free.unwrap_or_else(|| {
                self.count += 1;
                self.count - 1
            });
        }
        slots
    }
}

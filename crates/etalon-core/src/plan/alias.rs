//! Phase 5: transient resources that live at different times share memory.
//!
//! The steps are swept in order. Memory freed by resources whose last use has
//! passed is given to the next that fits most closely (best fit, neighbours
//! merged); what fits nowhere grows the heap. Textures and buffers have a heap
//! each, since Vulkan's `bufferImageGranularity` keeps them apart.
//!
//! Every block remembers how its earlier tenants were used: the next tenant
//! must wait for those uses before its first.

use std::collections::{BTreeMap, BTreeSet, HashMap};

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

    let mut starts: Vec<Vec<u32>> = vec![Vec::new(); steps.len()];
    let mut ends: Vec<Vec<u32>> = vec![Vec::new(); steps.len() + 1];
    for (index, resource) in resources
        .iter()
        .enumerate()
        .filter(|(index, _)| needs[*index].is_some())
    {
        starts[resource.first as usize].push(index as u32);
        ends[resource.last as usize + 1].push(index as u32);
    }

    let mut tenants_before = vec![UsageSet::EMPTY; resources.len()];
    let (mut textures, mut buffers, mut slots) =
        (Heap::default(), Heap::default(), Slots::default());
    let mut unaliased_bytes = 0_u64;
    for at in 0..steps.len() {
        for &ended in &ends[at] {
            let resource = &resources[ended as usize];
            if let ResourceKind::Transient(place) = &resource.kind {
                let heap = heap_of(&resource.desc, &mut textures, &mut buffers);
                // A barrier on one tenant says nothing of the tenants
                // before, so their uses stay with the block.
                let tenants = resource.usages.union(tenants_before[ended as usize]);
                heap.free(place.offset, place.bytes, tenants);
                slots.free(resource.desc, place.slot);
            }
        }
        for &started in &starts[at] {
            let resource = &mut resources[started as usize];
            let Some(need) = needs[started as usize] else {
                continue;
            };
            let bytes = need
                .bytes
                .checked_next_multiple_of(heap_alignment)
                .ok_or(PlanError::OutOfRange)?;
            unaliased_bytes = unaliased_bytes
                .checked_add(bytes)
                .ok_or(PlanError::OutOfRange)?;
            let heap = heap_of(&resource.desc, &mut textures, &mut buffers);
            let (offset, tenants) = heap.allocate(bytes).ok_or(PlanError::OutOfRange)?;
            tenants_before[started as usize] = tenants;
            let slot = slots.allocate(resource.desc);
            resource.kind = ResourceKind::Transient(Placement {
                offset,
                bytes,
                slot,
            });
        }
    }
    Ok(Placed {
        steps,
        resources,
        tenants_before,
        histories,
        culled,
        effects,
        uniforms,
        texture_heap: textures.size,
        buffer_heap: buffers.size,
        heap_alignment,
        unaliased_bytes,
    })
}

fn heap_of<'h>(desc: &ResourceDesc, textures: &'h mut Heap, buffers: &'h mut Heap) -> &'h mut Heap {
    match desc {
        ResourceDesc::Texture(_) => textures,
        ResourceDesc::Buffer(_) => buffers,
    }
}

/// A growing range of bytes with free blocks in it.
#[derive(Debug, Default)]
struct Heap {
    size: u64,
    /// Free blocks by offset: bytes, and the uses of former tenants.
    blocks: BTreeMap<u64, (u64, UsageSet)>,
    /// The same blocks as (bytes, offset), for the closest fit.
    by_size: BTreeSet<(u64, u64)>,
}

impl Heap {
    fn allocate(&mut self, bytes: u64) -> Option<(u64, UsageSet)> {
        if let Some(&(size, offset)) = self.by_size.range((bytes, 0)..).next() {
            let (_, tenants) = self.remove(offset)?;
            if size > bytes {
                self.insert(offset + bytes, size - bytes, tenants);
            }
            return Some((offset, tenants));
        }
        // Grow, from the last block if that is free. Whoever used the added
        // bytes did so in an earlier run, in any way.
        let last = self
            .blocks
            .last_key_value()
            .map(|(offset, (size, _))| (*offset, *size));
        let (offset, tenants) = match last {
            Some((offset, size)) if offset + size == self.size => {
                self.remove(offset)?;
                (offset, UsageSet::ALL)
            }
            _ => (self.size, UsageSet::EMPTY),
        };
        self.size = offset.checked_add(bytes)?;
        Some((offset, tenants))
    }

    fn free(&mut self, mut offset: u64, mut bytes: u64, mut tenants: UsageSet) {
        if let Some((&before, &(size, uses))) = self.blocks.range(..offset).next_back()
            && before + size == offset
        {
            self.remove(before);
            (offset, bytes, tenants) = (before, bytes + size, tenants.union(uses));
        }
        if let Some((size, uses)) = self.remove(offset + bytes) {
            (bytes, tenants) = (bytes + size, tenants.union(uses));
        }
        self.insert(offset, bytes, tenants);
    }

    fn insert(&mut self, offset: u64, bytes: u64, tenants: UsageSet) {
        self.blocks.insert(offset, (bytes, tenants));
        self.by_size.insert((bytes, offset));
    }

    fn remove(&mut self, offset: u64) -> Option<(u64, UsageSet)> {
        let block = self.blocks.remove(&offset)?;
        self.by_size.remove(&(block.0, offset));
        Some(block)
    }
}

/// Whole resources for reuse, by description.
#[derive(Debug, Default)]
struct Slots {
    count: u32,
    free: HashMap<ResourceDesc, Vec<u32>>,
}

impl Slots {
    fn allocate(&mut self, desc: ResourceDesc) -> u32 {
        self.free
            .get_mut(&desc)
            .and_then(Vec::pop)
            .unwrap_or_else(|| {
                self.count += 1;
                self.count - 1
            })
    }

    fn free(&mut self, desc: ResourceDesc, slot: u32) {
        self.free.entry(desc).or_default().push(slot);
    }
}

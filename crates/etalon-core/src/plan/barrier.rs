//! Phase 6: what must be waited for and made visible before each step.
//!
//! The state of every mip and layer is followed through the steps. A read
//! waits for the last write, once per way of reading; a write waits for the
//! last write and every read since; a change of a texture's layout counts as a
//! write.

use crate::graph::{ResourceDesc, Subresources};
use crate::kernel::Arithmetic;
use crate::plan::alias::Placed;
use crate::plan::bind::Use;
use crate::plan::{Barrier, Plan, PlannedResource, PlannedStep, ResourceKind, Usage, UsageSet};

/// What has happened to one mip of one layer.
#[derive(Clone, Copy)]
struct State {
    /// The layout it is in, if its contents are defined.
    layout: Option<Usage>,
    /// Uses that a write must wait for.
    users: UsageSet,
    /// The write (or layout change) that a read must wait for.
    written: UsageSet,
    /// Ways of reading that have waited for it.
    seen: UsageSet,
}

/// Completes the plan.
pub(crate) fn finish(placed: Placed, arithmetic: Arithmetic) -> Plan {
    let mut states: Vec<Vec<State>> = placed
        .resources
        .iter()
        .zip(&placed.tenants_before)
        .map(|(resource, tenants)| initial(resource, *tenants))
        .collect();
    let mut steps = Vec::with_capacity(placed.steps.len());
    for step in placed.steps {
        let mut barriers = Vec::new();
        for used in &step.uses {
            transition(&mut states, &placed.resources, used, &mut barriers);
        }
        steps.push(PlannedStep {
            name: step.name,
            effect: step.effect,
            reason: step.reason,
            goal: step.goal,
            barriers,
            step: step.step,
        });
    }
    let mut final_barriers = Vec::new();
    for (index, resource) in placed.resources.iter().enumerate() {
        if matches!(resource.kind, ResourceKind::Transient(_)) {
            continue;
        }
        let (mips, layers) = resource.desc.subresources();
        let rest = Use {
            resource: index as u32,
            range: Subresources {
                mip: 0,
                mips,
                layer: 0,
                layers,
            },
            usage: at_rest(&resource.desc),
            keeps: true,
        };
        transition(&mut states, &placed.resources, &rest, &mut final_barriers);
    }
    Plan {
        arithmetic,
        steps,
        final_barriers,
        resources: placed.resources,
        histories: placed.histories,
        texture_heap: placed.texture_heap,
        buffer_heap: placed.buffer_heap,
        heap_alignment: placed.heap_alignment,
        unaliased_bytes: placed.unaliased_bytes,
        culled: placed.culled,
        effects: placed.effects,
        uniforms: placed.uniforms,
    }
}

const fn at_rest(desc: &ResourceDesc) -> Usage {
    match desc {
        ResourceDesc::Texture(_) => Usage::Sampled,
        ResourceDesc::Buffer(_) => Usage::StorageRead,
    }
}

fn initial(resource: &PlannedResource, tenants: UsageSet) -> Vec<State> {
    let (mips, layers) = resource.desc.subresources();
    let rest = at_rest(&resource.desc);
    let state = match resource.kind {
        // Visible to whoever reads it as it rests.
        ResourceKind::Import(_) | ResourceKind::HistoryPrevious(_) => State {
            layout: Some(rest),
            users: rest.into(),
            written: rest.into(),
            seen: rest.into(),
        },
        // Its former contents may still be being read, but are not kept.
        ResourceKind::Output(_) | ResourceKind::HistoryCurrent(_) => State {
            layout: None,
            users: rest.into(),
            written: UsageSet::EMPTY,
            seen: UsageSet::EMPTY,
        },
        ResourceKind::Transient(_) => State {
            layout: None,
            users: tenants,
            written: UsageSet::EMPTY,
            seen: UsageSet::EMPTY,
        },
    };
    vec![state; (mips * layers) as usize]
}

/// Moves the mips and layers of a use into it, adding the barriers this needs.
fn transition(
    states: &mut [Vec<State>],
    resources: &[PlannedResource],
    used: &Use,
    barriers: &mut Vec<Barrier>,
) {
    let (_, layers) = resources[used.resource as usize].desc.subresources();
    let is_texture = matches!(
        resources[used.resource as usize].desc,
        ResourceDesc::Texture(_)
    );
    let mut needed = Vec::new();
    for mip in used.range.mip..used.range.mip + used.range.mips {
        for layer in used.range.layer..used.range.layer + used.range.layers {
            let state = &mut states[used.resource as usize][(mip * layers + layer) as usize];
            if let Some((from, layout)) = step_state(state, used, is_texture) {
                let range = Subresources {
                    mip,
                    mips: 1,
                    layer,
                    layers: 1,
                };
                needed.push(Barrier {
                    resource: used.resource,
                    range,
                    from,
                    layout,
                    to: used.usage,
                });
            }
        }
    }
    merge(needed, barriers);
}

/// The uses to wait for and the layout to leave, if the next use needs a barrier.
fn step_state(
    state: &mut State,
    used: &Use,
    is_texture: bool,
) -> Option<(UsageSet, Option<Usage>)> {
    let to = used.usage;
    let layout = state.layout.filter(|_| used.keeps);
    let relayout = is_texture && !state.layout.is_some_and(|layout| layout.same_layout(to));
    if to.writes() || relayout {
        let barrier = (state.users.union(state.written), layout);
        *state = State {
            layout: Some(to),
            users: to.into(),
            written: to.into(),
            seen: to.into(),
        };
        return Some(barrier);
    }
    state.layout = Some(to);
    state.users = state.users.with(to);
    if state.seen.contains(to) {
        return None;
    }
    state.seen = state.seen.with(to);
    Some((state.written, layout))
}

/// Joins barriers that differ only in the mip or layer: first along the
/// layers, then along the mips.
fn merge(needed: Vec<Barrier>, barriers: &mut Vec<Barrier>) {
    let alike = |a: &Barrier, b: &Barrier| (a.from, a.layout, a.to) == (b.from, b.layout, b.to);
    let mut rows: Vec<Barrier> = Vec::new();
    for next in needed {
        match rows.last_mut() {
            Some(last)
                if alike(last, &next)
                    && last.range.mip == next.range.mip
                    && last.range.layer + last.range.layers == next.range.layer =>
            {
                last.range.layers += 1;
            }
            _ => rows.push(next),
        }
    }
    let start = barriers.len();
    for next in rows {
        match barriers[start..].last_mut() {
            Some(last)
                if alike(last, &next)
                    && (last.range.layer, last.range.layers)
                        == (next.range.layer, next.range.layers)
                    && last.range.mip + last.range.mips == next.range.mip =>
            {
                last.range.mips += 1;
            }
            _ => barriers.push(next),
        }
    }
}

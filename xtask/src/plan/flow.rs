//! What steps of a plan hand to each other.

use std::collections::{BTreeMap, BTreeSet};

use etalon_core::graph::Subresources;
use etalon_core::kernel::{Binding, BindingKind};
use etalon_core::plan::{Bound, DrawExtent, Groups, Plan, PlannedTarget, Step};

/// Something handed from one step to a later one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// The step that wrote; `None` for what was there before the plan.
    pub(super) from: Option<usize>,
    /// The step that reads; `None` for what is there after it.
    pub(super) to: Option<usize>,
    /// Index of the resource.
    pub(super) resource: u32,
}

/// One use of part of a resource.
struct Use {
    resource: u32,
    range: Subresources,
    reads: bool,
    writes: bool,
    /// Whether what was written before stays where this writes nothing.
    keeps: bool,
}

const WHOLE: Subresources = Subresources {
    mip: 0,
    mips: u32::MAX,
    layer: 0,
    layers: u32::MAX,
};

fn bound(binding: &Binding, bound: &Bound) -> Option<Use> {
    let (resource, range) = match bound {
        Bound::Texture { resource, range } => (*resource, *range),
        Bound::Buffer { resource } => (*resource, WHOLE),
        Bound::Uniform(_) | Bound::Sampler(_) => return None,
    };
    let (reads, writes) = match &binding.kind {
        BindingKind::StorageTexture { access, .. } | BindingKind::StorageBuffer { access, .. } => {
            (access.reads(), access.writes())
        }
        _ => (true, false),
    };
    Some(Use {
        resource,
        range,
        reads,
        writes,
        keeps: false,
    })
}

fn uses(step: &Step) -> Vec<Use> {
    let read = |resource, range| Use {
        resource,
        range,
        reads: true,
        writes: false,
        keeps: false,
    };
    let written = |resource, range| Use {
        resource,
        range,
        reads: false,
        writes: true,
        keeps: false,
    };
    match step {
        Step::Dispatch {
            kernel,
            bindings,
            groups,
        } => {
            let pairs = kernel.0.bindings.iter().zip(bindings);
            let mut uses: Vec<Use> = pairs.filter_map(|(a, b)| bound(a, b)).collect();
            if let Groups::Indirect { buffer, .. } = groups {
                // It reaches as much as the buffer says.
                for used in &mut uses {
                    used.keeps = used.writes;
                }
                uses.push(read(*buffer, WHOLE));
            }
            uses
        }
        Step::Raster(raster) => {
            let target = |target: &PlannedTarget| Use {
                resource: target.resource,
                range: target.range,
                reads: target.clear.is_none(),
                writes: true,
                keeps: false,
            };
            let mut uses: Vec<Use> = raster.colours.iter().map(target).collect();
            // Depth that no draw writes is handed on as it is.
            let writes = raster.draws.iter().any(|draw| {
                let state = draw.state.depth.as_ref();
                state.is_some_and(|state| state.write)
            });
            if let Some(depth) = &raster.depth {
                let clears = depth.clear.is_some();
                uses.push(Use {
                    writes: clears || writes,
                    ..target(depth)
                });
            }
            for draw in &raster.draws {
                let pairs = draw.kernel.0.bindings.iter().zip(&draw.bindings);
                uses.extend(pairs.filter_map(|(a, b)| bound(a, b)));
                uses.extend(draw.vertices.iter().map(|from| read(from.buffer, WHOLE)));
                uses.extend(draw.indices.iter().map(|from| read(from.buffer, WHOLE)));
                if let DrawExtent::Indirect { buffer, .. } = &draw.extent {
                    uses.push(read(*buffer, WHOLE));
                }
            }
            uses
        }
        Step::ClearTexture {
            resource, range, ..
        } => vec![written(*resource, *range)],
        Step::ClearBuffer { resource } => vec![written(*resource, WHOLE)],
        Step::CopyTexture { source, target } => {
            vec![read(source.0, source.1), written(target.0, target.1)]
        }
        Step::CopyBuffer { source, target } => {
            vec![read(*source, WHOLE), written(*target, WHOLE)]
        }
        Step::Capture {
            resource, range, ..
        } => vec![read(*resource, *range)],
    }
}

/// The mips and layers of a resource that a use is of.
fn parts(plan: &Plan, used: &Use) -> Vec<(u32, u32)> {
    use etalon_core::graph::ResourceDesc;
    let (mips, layers) = match plan.resources.get(used.resource as usize).map(|r| r.desc) {
        Some(ResourceDesc::Texture(desc)) => (desc.mips, desc.layers()),
        _ => (1, 1),
    };
    let end = |first: u32, count: u32, most: u32| first.saturating_add(count).min(most);
    let range = used.range;
    (range.mip..end(range.mip, range.mips, mips))
        .flat_map(|mip| {
            (range.layer..end(range.layer, range.layers, layers)).map(move |layer| (mip, layer))
        })
        .collect()
}

/// Every edge, in order, each once.
pub(super) fn edges(plan: &Plan) -> Vec<Edge> {
    use etalon_core::plan::ResourceKind;
    let mut edges = BTreeSet::new();
    let mut writers: BTreeMap<(u32, u32, u32), usize> = BTreeMap::new();
    for (index, step) in plan.steps.iter().enumerate() {
        let uses = uses(&step.step);
        for used in uses.iter().filter(|used| used.reads || used.keeps) {
            for (mip, layer) in parts(plan, used) {
                let from = writers.get(&(used.resource, mip, layer)).copied();
                if from != Some(index) && (used.reads || from.is_some()) {
                    edges.insert(Edge {
                        from,
                        to: Some(index),
                        resource: used.resource,
                    });
                }
            }
        }
        for used in uses.iter().filter(|used| used.writes) {
            for (mip, layer) in parts(plan, used) {
                writers.insert((used.resource, mip, layer), index);
            }
        }
    }
    for (&(resource, _, _), &writer) in &writers {
        let kind = plan.resources.get(resource as usize).map(|r| &r.kind);
        let stays = matches!(
            kind,
            Some(ResourceKind::Output(_) | ResourceKind::HistoryCurrent(_))
        );
        if stays {
            edges.insert(Edge {
                from: Some(writer),
                to: None,
                resource,
            });
        }
    }
    edges.into_iter().collect()
}
